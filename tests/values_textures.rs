//! What textures, vertices and alpha say of a surface is what its picture shows, in all three models: a board of tiles,
//! each with a texture of eight texels, against what the formats' specifications make of each texel (glTF 2.0,
//! KHR_texture_transform, KHR_materials_clearcoat, _specular, _transmission, _volume).

use etalon::image::Picture;
use etalon::plan::Model;
use etalon::scene::environment::Environment;
use etalon::scene::{
    AlphaMode, Image, Instance, LightKind, LoadOptions, Material, Mesh, Sampler, Scene, TextureRef, Wrap, load,
};
use etalon::study::shape::Shape;
use etalon_testing::gltf_builder::{Builder, png};
use etalon_testing::gpu::Gpu;
use etalon_testing::lobe::{MODELS, model};
use etalon_testing::made::{Made, at, lambert, unlit};
use glam::{Affine2, DAffine3, DVec2, DVec3, Vec2};
use serde_json::json;

/// Pixels of a tile's side, and tiles in a row.
const TILE: u32 = 8;
const ROW: usize = 6;
/// All light arrives along this irradiance from the eye, unless a test says otherwise: what a white Lambert surface
/// shows is 1.
const PI: f32 = std::f32::consts::PI;

/// Four texels across and two down, no two alike in any channel.
fn texels() -> Image {
    let rgba = (0..8_u8).flat_map(|i| [40 + 25 * i, 255 - 30 * i, 60 + 17 * (i * 3 % 8), 90 + 20 * (i * 5 % 8)]);
    Image { name: "texels".to_owned(), width: 4, height: 2, rgba: rgba.collect() }
}

/// The whole of a picture, by its texels.
fn sharp(image: usize) -> TextureRef {
    let sampler = Sampler { mag_nearest: true, min_nearest: true, mips: false, ..Sampler::default() };
    TextureRef { image, uv_set: 0, uv_transform: Affine2::IDENTITY, sampler }
}

/// The texel of a picture at a coordinate, which repeats.
fn texel(image: &Image, uv: DVec2) -> [f64; 4] {
    let at = |x: f64, size: u32| (x.rem_euclid(1.0) * f64::from(size)).floor() as usize;
    let first = (at(uv.y, image.height) * image.width as usize + at(uv.x, image.width)) * 4;
    [0, 1, 2, 3].map(|c| f64::from(image.rgba[first + c]) / 255.0)
}

/// IEC 61966-2-1.
fn linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

fn linear_rgb([r, g, b, _]: [f64; 4]) -> DVec3 {
    DVec3::new(linear(r), linear(g), linear(b))
}

/// One square of the board. Its corners are the lower left one, and on counter-clockwise.
struct Tile {
    what: &'static str,
    material: Material,
    uvs: [[[f32; 2]; 4]; 2],
    colors: Vec<[f32; 4]>,
    tangent: Option<[f32; 4]>,
    /// Of a place in the tile, from its upper left corner.
    expected: Box<dyn Fn(DVec2) -> DVec3>,
}

/// Across the tile: u to the right, v down.
const WHOLE: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];

fn tile(what: &'static str, material: Material, expected: impl Fn(DVec2) -> DVec3 + 'static) -> Tile {
    let expected = Box::new(expected);
    Tile { what, material, uvs: [WHOLE, [[0.1, 0.1]; 4]], colors: Vec::new(), tangent: None, expected }
}

/// The tiles side by side in the plane z = 0, before a parallel view.
fn board(tiles: &[Tile], images: Vec<Image>) -> (Scene, [u32; 2]) {
    let rows = tiles.len().div_ceil(ROW);
    let mut made = Made::new("board");
    for (i, tile) in tiles.iter().enumerate() {
        let (x, y) = ((i % ROW) as f32 - 0.5 * ROW as f32, 0.5 * rows as f32 - (i / ROW) as f32);
        made.0.materials.push(Material { name: tile.what.to_owned(), ..tile.material.clone() });
        made.0.meshes.push(Mesh {
            name: tile.what.to_owned(),
            positions: [[x, y - 1.0, 0.0], [x + 1.0, y - 1.0, 0.0], [x + 1.0, y, 0.0], [x, y, 0.0]].to_vec().into(),
            normals: vec![[0.0, 0.0, 1.0]; 4].into(),
            tangents: tile.tangent.map_or(Vec::new().into(), |tangent| vec![tangent; 4].into()),
            uvs: tile.uvs.map(|set| set.to_vec().into()),
            colors: tile.colors.clone().into(),
            indices: vec![0, 1, 2, 0, 2, 3].into(),
            material: i,
        });
        made.place(i, DAffine3::IDENTITY);
    }
    made.0.images = images;
    made.front(0.5 * rows as f64);
    (made.0, [TILE * ROW as u32, TILE * rows as u32])
}

/// Largest relative error over the pixels that lie in one texel each, wherever in them a sample is taken.
#[track_caller]
fn agrees(film: &Picture, tiles: &[Tile], bound: f64, name: &str) {
    let mut worst = (0.0, String::new());
    let mut compared = vec![0; tiles.len()];
    for (i, got) in film.rgba.iter().enumerate() {
        let (x, y) = (i as u32 % film.width, i as u32 / film.width);
        let index = (y / TILE) as usize * ROW + (x / TILE) as usize;
        let Some(tile) = tiles.get(index) else { continue };
        let place = |dx: f64, dy: f64| DVec2::new(f64::from(x % TILE) + dx, f64::from(y % TILE) + dy) / f64::from(TILE);
        let want = (tile.expected)(place(0.5, 0.5));
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, y)| place(x, y) * 0.998 + 0.001);
        if corners.into_iter().any(|p| (tile.expected)(p).distance(want) > 1e-9) {
            continue;
        }
        compared[index] += 1;
        for c in 0..3 {
            let error = (f64::from(got[c]) - want[c]).abs() / want[c].max(1e-2 * want.max_element()).max(1e-9);
            if error.is_nan() || error > worst.0 {
                worst = (error, format!("\"{}\", {}, {}: {got:?} for {want}", tile.what, x % TILE, y % TILE));
            }
        }
    }
    eprintln!("{name}: worst {:.2e}, {}", worst.0, worst.1);
    assert!(compared.iter().all(|&count| count > 3), "pixels compared: {compared:?}");
    assert!(worst.0 < bound, "{name}: {:e}, {}", worst.0, worst.1);
}

/// What textures make of a base colour is kept in halves, of 11 bits: 2.4e-4 each for texel and product.
const TEXTURED: f64 = 6e-4;

/// Bytes in sRGB are decoded to 2e-6 by rays; by lavapipe's texture unit to a quarter of a step, which is 1.1 % of the
/// least byte here. A byte that were read as a linear number would be seven times as much.
fn of_colours(of: Model) -> f64 {
    if of == Model::Global { TEXTURED } else { 1.2e-2 }
}

fn lit(gpu: &Gpu, tiles: &[Tile], images: Vec<Image>, towards: DVec3, of: Model) -> Picture {
    let (mut scene, size) = board(tiles, images);
    let mut made = Made(std::mem::take(&mut scene));
    made.light([PI; 3], LightKind::Directional { direction: -towards.normalize() });
    // Nothing stands before anything; and what rays make of bent normals near the terminator is another matter.
    let off: &[&str] = if of == Model::Global { &[] } else { &["shadows=off"] };
    let choices = [&["brdf=ggx", "fresnel=schlick"], off].concat();
    gpu.film(&made.0, model(of, size, &choices))
}

#[test]
fn a_base_colour_is_texel_in_srgb_times_factor_times_vertex_colour() {
    let gpu = Gpu::hasty();
    let textured = |factor: [f32; 3]| Material { base_color_texture: Some(sharp(0)), ..lambert(factor) };
    let moved = |uv_transform: Affine2| {
        let texture = TextureRef { uv_transform, ..sharp(0) };
        Material { base_color_texture: Some(texture), ..lambert([1.0; 3]) }
    };
    let by = |uv: fn(DVec2) -> DVec2| move |p: DVec2| linear_rgb(texel(&texels(), uv(p)));
    let factor = DVec3::new(0.5, 0.25, 1.0);
    let mirrored = |wrap_u, wrap_v| {
        let sampler = Sampler { wrap_u, wrap_v, ..sharp(0).sampler };
        let uv_transform = Affine2::from_scale_angle_translation(Vec2::splat(2.0), 0.0, Vec2::splat(-0.5));
        let texture = TextureRef { sampler, uv_transform, ..sharp(0) };
        Material { base_color_texture: Some(texture), ..lambert([1.0; 3]) }
    };
    let mut tiles = vec![
        tile("texels", textured([1.0; 3]), by(|p| p)),
        tile("factor", textured([0.5, 0.25, 1.0]), move |p| factor * linear_rgb(texel(&texels(), p))),
        tile("offset", moved(Affine2::from_translation(Vec2::new(0.25, 0.5))), by(|p| p + DVec2::new(0.25, 0.5))),
        tile("scale", moved(Affine2::from_scale(Vec2::new(0.5, 1.0))), by(|p| p * DVec2::new(0.5, 1.0))),
        tile("quarter turn", moved(Affine2::from_angle(0.5 * PI)), by(|p| DVec2::new(-p.y, p.x))),
        tile(
            "mirrored ends",
            mirrored(Wrap::Mirror, Wrap::Repeat),
            by(|p| {
                let u = 2.0 * p.x - 0.5;
                DVec2::new(
                    if u < 0.0 {
                        -u
                    } else if u > 1.0 {
                        2.0 - u
                    } else {
                        u
                    },
                    2.0 * p.y - 0.5,
                )
            }),
        ),
        tile(
            "clamped ends",
            mirrored(Wrap::Clamp, Wrap::Clamp),
            by(|p| (2.0 * p - 0.5).clamp(DVec2::ZERO, DVec2::splat(0.999))),
        ),
    ];
    // The second set runs from right to left, and from the bottom up.
    let second = TextureRef { uv_set: 1, ..sharp(0) };
    let mut other =
        tile("second set", Material { base_color_texture: Some(second), ..lambert([1.0; 3]) }, by(|p| 1.0 - p));
    other.uvs[1] = WHOLE.map(|[u, v]| [1.0 - u, 1.0 - v]);
    tiles.push(other);
    let mut colors =
        tile("vertices", textured([1.0; 3]), |p| linear_rgb(texel(&texels(), p)) * DVec3::new(0.5, 0.75, 0.25));
    colors.colors = vec![[0.5, 0.75, 0.25, 1.0]; 4];
    tiles.push(colors);
    let factor_alone = DVec3::new(f64::from(0.3_f32), f64::from(0.7_f32), f64::from(0.9_f32));
    tiles.push(tile("no texture", lambert([0.3, 0.7, 0.9]), move |_| factor_alone));
    for of in MODELS {
        let film = lit(&gpu, &tiles, vec![texels()], DVec3::Z, of);
        agrees(&film, &tiles, of_colours(of), &format!("{of:?}"));
    }
}

#[test]
fn roughness_is_in_green_and_metal_in_blue_and_layers_in_their_channels() {
    let gpu = Gpu::hasty();
    let black = Material { specular: 0.0, roughness: 1.0, ..lambert([0.0; 3]) };
    let (gold, white) = (DVec3::new(0.9, 0.6, 0.3), DVec3::ONE);
    // Where light, eye and normal are one, π D/4 = 1/(4α²).
    let lobe = |roughness: f64| 1.0 / (4.0 * roughness.powi(4));
    let mixed = Material {
        base_color: [0.9, 0.6, 0.3, 1.0],
        metallic: 1.0,
        roughness: 0.8,
        metallic_roughness_texture: Some(sharp(0)),
        specular: 1.0,
        ..Material::default()
    };
    let half = Material { metallic: 0.5, roughness: 1.0, ..mixed.clone() };
    let metal = move |roughness: f64, metallic: f64| {
        move |p: DVec2| {
            let [_, g, b, _] = texel(&texels(), p);
            let share = metallic * b;
            let f = DVec3::splat(0.04).lerp(gold, share);
            gold * ((1.0 - share) * 0.96) + f * lobe(roughness * g)
        }
    };
    let coated = Material { clearcoat: 0.75, clearcoat_roughness: 0.5, ..black.clone() };
    let tiles = [
        tile("metal and roughness", mixed, metal(0.8_f32.into(), 1.0)),
        tile("half", half, metal(1.0, 0.5)),
        tile(
            "specular",
            Material { specular: 0.5, roughness: 0.5, specular_texture: Some(sharp(0)), ..black.clone() },
            move |p| white * (0.04 * 0.5 * texel(&texels(), p)[3] * lobe(0.5)),
        ),
        tile("coat", Material { clearcoat_texture: Some(sharp(0)), ..coated.clone() }, move |p| {
            white * (0.75 * texel(&texels(), p)[0] * 0.04 * lobe(0.5))
        }),
        tile("coat's roughness", Material { clearcoat_roughness_texture: Some(sharp(0)), ..coated }, move |p| {
            white * (0.75 * 0.04 * lobe(0.5 * texel(&texels(), p)[1]))
        }),
    ];
    for of in MODELS {
        let film = lit(&gpu, &tiles, vec![texels()], DVec3::Z, of);
        // Metal is kept in a half, and α² has the fourth power of a roughness in 16 bits.
        agrees(&film, &tiles, TEXTURED, &format!("{of:?}"));
    }
}

/// Normals of a picture of one texel, by its bytes.
fn bent([x, y, z]: [u8; 3]) -> (Image, DVec3) {
    let image = Image { name: "normal".to_owned(), width: 1, height: 1, rgba: vec![x, y, z, 255].into() };
    (image, DVec3::new(f64::from(x), f64::from(y), f64::from(z)) / 127.5 - 1.0)
}

/// A tile with a tangent, whose Lambert surface shows the cosine of its bent normal in oblique light.
fn bent_tile(what: &'static str, scale: f32, tangent: [f32; 4], n: DVec3, towards: DVec3) -> Tile {
    let material = Material { normal_texture: Some(sharp(0)), normal_scale: scale, ..lambert([1.0; 3]) };
    let [tx, ty, tz, w] = tangent.map(f64::from);
    let t = DVec3::new(tx, ty, tz);
    let b = DVec3::Z.cross(t) * w;
    let s = f64::from(scale);
    let bent = (t * (n.x * s) + b * (n.y * s) + DVec3::Z * n.z).normalize();
    let cos = bent.dot(towards.normalize()).max(0.0);
    Tile { tangent: Some(tangent), ..tile(what, material, move |_| DVec3::splat(cos)) }
}

#[test]
fn a_normal_texture_bends_by_its_scale_along_tangent_and_bitangent() {
    let gpu = Gpu::hasty();
    let (image, n) = bent([190, 150, 230]);
    let towards = DVec3::new(0.3, 0.5, 0.8);
    let along = [1.0, 0.0, 0.0, 1.0];
    let tiles = [
        bent_tile("scale 1", 1.0, along, n, towards),
        bent_tile("scale 0.5", 0.5, along, n, towards),
        bent_tile("scale 2", 2.0, along, n, towards),
        bent_tile("scale -1", -1.0, along, n, towards),
        bent_tile("scale 0", 0.0, along, n, towards),
        bent_tile("mirrored tangent", 1.0, [1.0, 0.0, 0.0, -1.0], n, towards),
        bent_tile("turned tangent", 1.0, [0.6, 0.8, 0.0, 1.0], n, towards),
        bent_tile("turned and mirrored", 1.5, [-0.8, 0.6, 0.0, -1.0], n, towards),
    ];
    for of in MODELS {
        let film = lit(&gpu, &tiles, vec![image.clone()], towards, of);
        // Roundings of the normal's three numbers, in f32, and of a cosine of 0.4 or more.
        agrees(&film, &tiles, 3e-6, &format!("{of:?}"));
    }
}

#[test]
fn a_coat_has_a_normal_texture_of_its_own() {
    let gpu = Gpu::hasty();
    let (image, n) = bent([190, 150, 230]);
    let other = bent([100, 120, 240]);
    let towards = DVec3::new(0.3, 0.5, 0.8).normalize();
    let coat = Material { clearcoat: 1.0, clearcoat_roughness: 0.4, ..lambert([0.0; 3]) };
    let (t, mirrored) = ([1.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, -1.0]);
    let shown = move |n: DVec3| {
        let h = (towards + DVec3::Z).normalize();
        let f = 0.04 + 0.96 * (1.0 - h.z).powi(5);
        DVec3::splat(
            f * f64::from(PI)
                * etalon_testing::lobe::ggx(n, towards, DVec3::Z, etalon_testing::lobe::alpha(0.4))
                * n.dot(towards),
        )
    };
    let n_coat = n.normalize();
    let turned = DVec3::new(n_coat.x, -n_coat.y, n_coat.z);
    let with = |normal: Option<usize>, coats: Option<usize>| Material {
        normal_texture: normal.map(sharp),
        clearcoat_normal_texture: coats.map(sharp),
        ..coat.clone()
    };
    let tiles = [
        Tile { tangent: Some(t), ..tile("coat", with(None, Some(0)), move |_| shown(n_coat)) },
        Tile { tangent: Some(t), ..tile("base", with(Some(0), None), move |_| shown(DVec3::Z)) },
        Tile { tangent: Some(t), ..tile("both", with(Some(1), Some(0)), move |_| shown(n_coat)) },
        Tile { tangent: Some(mirrored), ..tile("mirrored", with(None, Some(0)), move |_| shown(turned)) },
    ];
    for of in MODELS {
        let film = lit(&gpu, &tiles, vec![image.clone(), other.0.clone()], towards, of);
        // The coat's normal is kept as an octahedron in 2 x 16 bits, off by 3.7e-3 degrees at most, which the lobe's
        // slope of 4 per radian here makes 3e-4 of.
        let bound = if of == Model::Global { 1e-5 } else { 4e-4 };
        agrees(&film, &tiles, bound, &format!("{of:?}"));
    }
}

#[test]
fn occlusion_takes_its_share_of_the_light_from_all_around() {
    let gpu = Gpu::hasty();
    let occluded = |strength: f32| Material {
        occlusion_texture: Some(sharp(0)),
        occlusion_strength: strength,
        ..lambert([0.5, 0.25, 1.0])
    };
    let shown =
        |strength: f64| move |p: DVec2| DVec3::new(0.5, 0.25, 1.0) * (1.0 + strength * (texel(&texels(), p)[0] - 1.0));
    let tiles = [
        tile("whole", occluded(1.0), shown(1.0)),
        tile("half", occluded(0.5), shown(0.5)),
        tile("none", occluded(0.0), shown(0.0)),
    ];
    let (scene, size) = board(&tiles, vec![texels()]);
    for of in [Model::Local, Model::Recursive] {
        let settings = model(of, size, &["indirect=ambient"]);
        let (_, film) = gpu.shot(&scene, Some(&Environment::constant([1.0; 3])), settings);
        // The harmonics of what is constant: see tests/light.rs; occlusion is kept in the byte that it comes in.
        agrees(&film, &tiles, 1e-5, &format!("{of:?}"));
    }
    // Rays compute what the texture approximates: nothing stands before these tiles.
    let settings = model(Model::Recursive, size, &["indirect=occlusion:4"]);
    let (_, film) = gpu.shot(&scene, Some(&Environment::constant([1.0; 3])), settings);
    let open = tiles.map(|mut tile| {
        tile.expected = Box::new(shown(0.0));
        tile
    });
    agrees(&film, &open, 1e-5, "by rays");
}

#[test]
fn what_emits_and_what_is_unlit_shows_its_texels() {
    let gpu = Gpu::hasty();
    let glow = Material { emissive: [2.0, 0.5, 8.0], emissive_texture: Some(sharp(0)), ..lambert([0.0; 3]) };
    let plain = |p| linear_rgb(texel(&texels(), p));
    let flat = Material { base_color_texture: Some(sharp(0)), ..unlit([0.5, 1.0, 2.0]) };
    let second = Material { emissive_texture: Some(TextureRef { uv_set: 1, ..sharp(0) }), ..glow.clone() };
    let mut tiles = vec![
        tile("emission", glow, move |p| plain(p) * DVec3::new(2.0, 0.5, 8.0)),
        tile("unlit", flat.clone(), move |p| plain(p) * DVec3::new(0.5, 1.0, 2.0)),
        tile("emission by the second set", second, move |p| plain(1.0 - p) * DVec3::new(2.0, 0.5, 8.0)),
    ];
    tiles[2].uvs[1] = WHOLE.map(|[u, v]| [1.0 - u, 1.0 - v]);
    let mut colors = tile("unlit vertices", flat, move |p| plain(p) * DVec3::new(0.25, 0.5, 0.5));
    colors.colors = vec![[0.5, 0.5, 0.25, 1.0]; 4];
    tiles.push(colors);
    for of in MODELS {
        let (scene, size) = board(&tiles, vec![texels()]);
        let film = gpu.film(&scene, model(of, size, &[]));
        agrees(&film, &tiles, of_colours(of), &format!("{of:?}"));
    }
}

/// The tiles before a wall that shows `behind` everywhere, unlit.
fn before_a_wall(tiles: &[Tile], behind: [f32; 3]) -> (Scene, [u32; 2]) {
    let (scene, size) = board(tiles, vec![texels()]);
    let mut made = Made(scene);
    made.add(Shape::panel(12.0, 12.0), unlit(behind), at(0.0, 0.0, -2.0));
    (made.0, size)
}

const BEHIND: [f32; 3] = [3.0, 2.0, 1.0];

#[test]
fn alpha_cuts_out_below_its_cutoff() {
    let gpu = Gpu::hasty();
    let cut = |cutoff: f32, alpha: f32| Material {
        base_color: [1.0, 1.0, 1.0, alpha],
        base_color_texture: Some(sharp(0)),
        alpha_mode: AlphaMode::Mask(cutoff),
        ..unlit([1.0; 3])
    };
    let shown = |cutoff: f64, alpha: f64| {
        move |p: DVec2| {
            let texel = texel(&texels(), p);
            if texel[3] * alpha < cutoff { etalon_testing::lobe::rgb(BEHIND) } else { linear_rgb(texel) }
        }
    };
    let mut tiles = vec![
        tile("cutoff 0.5", cut(0.5, 1.0), shown(0.5, 1.0)),
        tile("cutoff 0.75", cut(0.75, 1.0), shown(0.75, 1.0)),
        tile("alpha 0.75", cut(0.5, 0.75), shown(0.5, 0.75)),
    ];
    let mut colors = tile("vertices", cut(0.5, 1.0), shown(0.5, 0.625));
    colors.colors = vec![[1.0, 1.0, 1.0, 0.625]; 4];
    tiles.push(colors);
    let (scene, size) = before_a_wall(&tiles, BEHIND);
    for of in MODELS {
        agrees(&gpu.film(&scene, model(of, size, &[])), &tiles, of_colours(of), &format!("{of:?}"));
    }
}

#[test]
fn alpha_covers_its_share_of_what_lies_behind() {
    let gpu = Gpu::hasty();
    let blend = |alpha: f32, texture: bool| Material {
        base_color: [0.2, 0.4, 0.8, alpha],
        base_color_texture: texture.then(|| sharp(0)),
        alpha_mode: AlphaMode::Blend,
        ..lambert([0.0; 3])
    };
    let colour = DVec3::new(0.2, 0.4, 0.8);
    let over = |shown: DVec3, alpha: f64| etalon_testing::lobe::rgb(BEHIND).lerp(shown, alpha);
    let tiles = [
        tile("a quarter", blend(0.25, false), move |_| over(colour, 0.25)),
        tile("texels", blend(0.75, true), move |p| {
            let texel = texel(&texels(), p);
            over(colour * linear_rgb(texel), 0.75 * texel[3])
        }),
        tile("unlit", Material { unlit: true, ..blend(0.5, false) }, move |_| over(colour, 0.5)),
    ];
    let (scene, size) = before_a_wall(&tiles, BEHIND);
    let mut made = Made(scene);
    made.light([PI; 3], LightKind::Directional { direction: DVec3::NEG_Z });
    for of in [Model::Local, Model::Recursive] {
        let film = gpu.film(&made.0, model(of, size, &["fresnel=schlick"]));
        agrees(&film, &tiles, of_colours(of), &format!("{of:?}"));
    }
    // Paths meet it or not, at points that are spread evenly: of 64 no more than one too many
    // (shaders/lib/random.glsl), of a step of 3 at most.
    let film = gpu.film(&made.0, model(Model::Global, size, &["samples=64", "fresnel=schlick"]));
    agrees(&film, &tiles, 0.1, "Global");
    for (i, tile) in tiles.iter().enumerate() {
        let mut off = DVec3::ZERO;
        for p in 0..TILE * TILE {
            let (x, y) = (p % TILE, p / TILE);
            let got = film.rgba[(y * film.width + i as u32 * TILE + x) as usize].map(f64::from);
            let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) / f64::from(TILE);
            off += (DVec3::new(got[0], got[1], got[2]) - (tile.expected)(place)) / f64::from(TILE * TILE);
        }
        eprintln!("{}: {off}", tile.what);
        // In the mean over 64 pixels an eighth of 3/64.
        assert!(off.abs().max_element() < 6e-3, "{}: {off}", tile.what);
    }
}

#[test]
fn a_sheet_lets_through_its_colour_times_its_transmission() {
    let gpu = Gpu::hasty();
    let sheet = Material { transmission: 0.75, roughness: 0.0, specular: 0.0, ..lambert([0.5, 0.25, 1.0]) };
    let tint = DVec3::new(0.5, 0.25, 1.0);
    let textured = Material { transmission_texture: Some(sharp(0)), ..sheet.clone() };
    let tiles = [
        tile("transmission", sheet, move |_| etalon_testing::lobe::rgb(BEHIND) * tint * 0.75),
        tile("texels", textured, move |p| etalon_testing::lobe::rgb(BEHIND) * tint * (0.75 * texel(&texels(), p)[0])),
    ];
    let (scene, size) = before_a_wall(&tiles, BEHIND);
    let film = gpu.film(&scene, model(Model::Recursive, size, &["refraction=ray"]));
    agrees(&film, &tiles, 2.0 * TEXTURED, "Recursive");
    // Paths go through it or are scattered, at points that are spread evenly: see above.
    let film = gpu.film(&scene, model(Model::Global, size, &["samples=64"]));
    agrees(&film, &tiles, 0.1, "Global");
}

/// Bodies a metre apart, seen through their faces: exp(−σd) of the wall behind, whatever bends where nothing is
/// oblique.
#[test]
fn closed_meshes_absorb_by_path_length_or_nominal_thickness() {
    let gpu = Gpu::hasty();
    // Without reflection: see the sheet.
    let body = Material {
        transmission: 1.0,
        roughness: 0.0,
        specular: 0.0,
        ior: 1.33,
        thickness: 0.7,
        attenuation_distance: 0.5,
        attenuation_color: [0.5, 0.8, 0.1],
        ..lambert([1.0; 3])
    };
    let left = |d: f64| etalon_testing::lobe::rgb(BEHIND) * DVec3::new(0.5, 0.8, 0.1).powf(d / 0.5);
    for (absorption, ways) in [("absorption=path", [0.4, 0.8]), ("absorption=thickness", [0.7, 1.4])] {
        let mut made = Made::new("bodies");
        let mesh = made.mesh(Shape::cuboid(DVec3::new(0.9, 0.9, 0.4)), body.clone());
        made.place(mesh, at(-1.0, 0.0, 0.0));
        // Twice as large in all directions.
        made.place(mesh, at(1.0, 0.0, 0.0) * DAffine3::from_scale(DVec3::splat(2.0)));
        made.add(Shape::panel(6.0, 6.0), unlit(BEHIND), at(0.0, 0.0, -2.0));
        made.front(1.0);
        let models: &[Model] = if absorption == "absorption=path" { &MODELS[1..] } else { &MODELS[1..2] };
        for &of in models {
            let film = gpu.film(&made.0, model(of, [32, 16], &[absorption, "refraction=ray"]));
            for (x, way) in [(8_usize, ways[0]), (24, ways[1])] {
                let got = film.rgba[8 * 32 + x].map(f64::from);
                let off = (DVec3::new(got[0], got[1], got[2]) / left(way) - 1.0).abs().max_element();
                eprintln!("{of:?}, {absorption}, {way} m: {got:?} for {}, {off:.1e}", left(way));
                // Rays begin behind a surface by a millionth of the scene's extent, 6e-6 m of 4.6/m.
                assert!(off < 5e-5, "{of:?}, {absorption}, {way} m: {got:?} for {}", left(way));
            }
        }
    }
}

/// By the local model and along paths. (The recursive model reads no texel of the thickness of what is nearest to the
/// eye: shaders/lib/primary.glsl.)
#[test]
fn a_sheets_thickness_is_in_green() {
    let gpu = Gpu::hasty();
    let sheet = Material {
        transmission: 1.0,
        roughness: 0.0,
        specular: 0.0,
        thickness: 0.7,
        attenuation_distance: 0.5,
        attenuation_color: [0.5, 0.8, 0.1],
        double_sided: true,
        ..lambert([1.0; 3])
    };
    let textured = Material { thickness_texture: Some(sharp(0)), ..sheet.clone() };
    let left = |d: f64| etalon_testing::lobe::rgb(BEHIND) * DVec3::new(0.5, 0.8, 0.1).powf(d / 0.5);
    let tiles = [
        tile("thickness", sheet, move |_| left(f64::from(0.7_f32))),
        tile("texels", textured, move |p| left(f64::from(0.7_f32) * texel(&texels(), p)[1])),
    ];
    let (scene, size) = before_a_wall(&tiles, BEHIND);
    for of in [Model::Local, Model::Global] {
        let film = gpu.film(&scene, model(of, size, &["fresnel=schlick"]));
        // The texel is kept in 16 bits.
        agrees(&film, &tiles, 1e-4, &format!("{of:?}"));
    }
}

/// One face whose texture coordinates, transform and tangents come from a file: without tangents of its own those are
/// made from the coordinates, so that what bends the normal to the right is to the right of the picture that is
/// mirrored, too.
#[test]
fn a_file_says_transforms_scales_and_sets_of_its_textures() {
    let gpu = Gpu::hasty();
    let mut builder = Builder::new();
    // Red is bent along u, none along v.
    let picture = png(1, 1, [200, 128, 220, 255]);
    let quarters = {
        let mut out = std::io::Cursor::new(Vec::new());
        let image = texels();
        image::RgbaImage::from_raw(image.width, image.height, image.rgba.to_vec())
            .expect("its size")
            .write_to(&mut out, image::ImageFormat::Png)
            .expect("a picture");
        out.into_inner()
    };
    for bytes in [picture, quarters] {
        let view = builder.view(&bytes, None);
        builder.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
    }
    builder.push("samplers", json!({ "magFilter": 9728, "minFilter": 9728 }));
    for source in 0..2 {
        builder.push("textures", json!({ "source": source, "sampler": 0 }));
    }
    builder.json["extensionsUsed"] = json!(["KHR_texture_transform", "KHR_materials_unlit", "KHR_materials_specular"]);
    let normal = |scale: f64| {
        json!({
            "pbrMetallicRoughness": { "metallicFactor": 0.0 },
            "extensions": { "KHR_materials_specular": { "specularFactor": 0.0 } },
            "normalTexture": { "index": 0, "scale": scale },
        })
    };
    let turned = json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 1, "texCoord": 0, "extensions": { "KHR_texture_transform": {
            "offset": [0.25, 0.1], "rotation": 0.6, "scale": [0.5, 0.8], "texCoord": 1 } } } },
        "extensions": { "KHR_materials_unlit": {} },
    });
    for material in [normal(1.0), normal(0.5), turned] {
        builder.push("materials", material);
    }
    // Plain, mirrored along u, and plain again; the second set is plain everywhere.
    for (i, (left, right, material)) in
        [(0.0, 1.0, 0), (1.0, 0.0, 0), (0.0, 1.0, 1), (1.0, 0.0, 2)].into_iter().enumerate()
    {
        let x = i as f32 - 2.0;
        let corners = [[x, -0.5], [x + 1.0, -0.5], [x + 1.0, 0.5], [x, 0.5]];
        let positions = builder.floats("VEC3", &corners.map(|[x, y]| [x, y, 0.0]).concat());
        let normals = builder.floats("VEC3", &[[0.0, 0.0, 1.0]; 4].concat());
        let uvs = builder.floats("VEC2", &[[left, 1.0], [right, 1.0], [right, 0.0], [left, 0.0]].concat());
        let second = builder.floats("VEC2", &WHOLE.concat());
        let indices = builder.indices(&[0, 1, 2, 0, 2, 3]);
        let attributes = json!({ "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs, "TEXCOORD_1": second });
        let mesh = builder.mesh(json!({ "attributes": attributes, "indices": indices, "material": material }));
        builder.root(json!({ "mesh": mesh }));
    }
    let folder = tempfile::tempdir().expect("a folder");
    let scene = load(&builder.save_glb(folder.path()), &LoadOptions::default()).expect("a scene");
    let towards = DVec3::new(0.5, 0.2, 0.8).normalize();
    let mut made = Made(scene);
    made.light([PI; 3], LightKind::Directional { direction: -towards });
    made.front(0.5);
    let cosine = |scale: f64, side: f64| {
        let (_, n) = bent([200, 128, 220]);
        // v grows downwards and the bitangent upwards in the picture (glTF: +Y of the texture is up).
        let n = DVec3::new(side * n.x * scale, n.y * scale, n.z).normalize();
        DVec3::splat(n.dot(towards))
    };
    let transformed = |p: DVec2| {
        // KHR_texture_transform: translation · rotation · scale, its rotation counter-clockwise seen with v down.
        let (sin, cos) = 0.6_f64.sin_cos();
        let s = p * DVec2::new(0.5, 0.8);
        let uv = DVec2::new(cos * s.x + sin * s.y, -sin * s.x + cos * s.y) + DVec2::new(0.25, 0.1);
        linear_rgb(texel(&texels(), uv))
    };
    for of in MODELS {
        let off: &[&str] = if of == Model::Global { &[] } else { &["shadows=off"] };
        let size = [4 * TILE, TILE];
        let film = gpu.film(&made.0, model(of, size, off));
        let (mut wrong, mut compared) = (0.0_f64, 0);
        for (i, got) in film.rgba.iter().enumerate() {
            let (x, y) = (i as u32 % size[0], i as u32 / size[0]);
            let place = |dx: f64, dy: f64| DVec2::new(f64::from(x % TILE) + dx, f64::from(y) + dy) / f64::from(TILE);
            let want = |p: DVec2| match x / TILE {
                0 => cosine(1.0, 1.0),
                1 => cosine(1.0, -1.0),
                2 => cosine(0.5, 1.0),
                _ => transformed(p),
            };
            let middle = want(place(0.5, 0.5));
            if [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].into_iter().any(|(x, y)| want(place(x, y)) != middle) {
                continue;
            }
            compared += 1;
            let got = DVec3::new(got[0].into(), got[1].into(), got[2].into());
            wrong = wrong.max((got / middle - 1.0).abs().max_element());
        }
        eprintln!("{of:?}: {wrong:.2e} of {compared} pixels");
        assert!(compared > 3 * 64 && wrong < of_colours(of), "{of:?}: {wrong:e} of {compared} pixels");
    }
}

/// The same tile as an object, and turned over by its instance: what mirrors an object mirrors its tangent space with
/// it.
#[test]
fn a_mirrored_object_has_its_bumps_mirrored() {
    let gpu = Gpu::hasty();
    let (image, n) = bent([190, 150, 230]);
    let towards = DVec3::new(0.3, 0.5, 0.8).normalize();
    let along = [1.0, 0.0, 0.0, 1.0];
    let tiles = [bent_tile("plain", 1.0, along, n, towards)];
    let (mut scene, _) = board(&tiles, vec![image]);
    let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    scene.instances.push(Instance { name: "mirrored".to_owned(), mesh: 0, world_from_object: mirror });
    let mut made = Made(scene);
    made.light([PI; 3], LightKind::Directional { direction: -towards });
    let plain = n.normalize();
    let wants = [plain, DVec3::new(-plain.x, plain.y, plain.z)].map(|n| n.dot(towards));
    for of in MODELS {
        let off: &[&str] = if of == Model::Global { &[] } else { &["shadows=off"] };
        let film = gpu.film(&made.0, model(of, [48, 8], &[&["fresnel=schlick"], off].concat()));
        for (x, want) in [(4_usize, wants[0]), (43, wants[1])] {
            let got = f64::from(film.rgba[4 * 48 + x][1]);
            assert!((got / want - 1.0).abs() < 3e-6, "{of:?}, pixel {x}: {got} for {want}");
        }
    }
}
