//! What the viewer says of a picked pixel is what is drawn there: the material at the point that the host's ray meets
//! (src/transport/surface_point.rs) equals the G-buffer, and a texture lookup of the tests' own ray caster
//! (crates/testing/src/raycast.rs). Ten pixels of each of ten models with random textures, and of ten real ones.
//!
//! Each pixel is looked at so closely that it is smaller than a quarter of a texel of every texture: the picture then
//! reads the finest level, as the host does.

use std::path::Path;

use etalon::frame::{Renderer, Settings};
use etalon::optics::SplitMix64;
use etalon::optics::fresnel::{fresnel_dielectric, schlick};
use etalon::plan::is_transparent;
use etalon::prepare::Original;
use etalon::scene::lobe::{ANISOTROPY, DIFFUSE_TRANSMISSION, IRIDESCENCE, SHEEN};
use etalon::scene::{Camera, LoadOptions, Material, Meaning, Scene, TextureRef, load};
use etalon::share::AovPixel;
use etalon::transport::events::{Event, EventTracer, Interaction, Limits, Way};
use etalon_testing::gltf_builder::Builder;
use etalon_testing::gpu::{Gpu, knobs, settings};
use etalon_testing::raycast::{Hit, Options, World, camera_ray, texel, texel_place};
use glam::{DQuat, DVec2, DVec3, Vec3};
use serde_json::{Value, json};

const SIZE: [u32; 2] = [3, 3];
const PIXELS: usize = 10;
/// Width of a pixel in texels of the finest texture.
const PIXEL: f64 = 0.25;

fn coin(random: &mut SplitMix64) -> bool {
    random.below(2) == 0
}

/// Uniform numbers in [`least`, `most`).
fn list(random: &mut SplitMix64, count: usize, least: f64, most: f64) -> Vec<f32> {
    (0..count).map(|_| random.between(least, most) as f32).collect()
}

/// A value at a point: as looked up, and how far it would be off by one texel.
#[derive(Clone, Copy)]
struct Lookup {
    what: &'static str,
    value: f64,
    spread: f64,
    /// What its texel is multiplied by; 0 without a texture.
    factor: f64,
    is_color: bool,
}

/// A vertex attribute at a hit.
fn attribute<const N: usize>(scene: &Scene, hit: &Hit, values: &[[f32; N]]) -> [f64; N] {
    let mesh = &scene.meshes[scene.instances[hit.instance].mesh];
    let mut sum = [0.0; N];
    for k in 0..3 {
        let value = values[mesh.indices[3 * hit.triangle + k] as usize];
        sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += f64::from(value) * hit.barycentric[k]);
    }
    sum
}

fn coordinates(scene: &Scene, hit: &Hit, texture: &TextureRef) -> DVec2 {
    let uvs = &scene.meshes[scene.instances[hit.instance].mesh].uvs[texture.uv_set as usize];
    if uvs.is_empty() { DVec2::ZERO } else { DVec2::from(attribute(scene, hit, uvs)) }
}

/// Every value of the material at a hit.
fn lookups(scene: &Scene, hit: &Hit) -> Vec<Lookup> {
    let mesh = &scene.meshes[scene.instances[hit.instance].mesh];
    let m = &scene.materials[hit.material];
    let vertex = if mesh.colors.is_empty() { [1.0; 4] } else { attribute(scene, hit, &mesh.colors) };
    let mut all = Vec::new();
    let mut say = |what, texture: Option<TextureRef>, meaning, channel: usize, factor: f64| {
        let texels = texture.map_or([[1.0; 4]; 3], |t| texel(scene, &t, coordinates(scene, hit, &t), meaning));
        let [value, least, most] = texels.map(|texel| texel[channel] * factor);
        let factor = texture.map_or(0.0, |_| factor.abs());
        let is_color = meaning == Meaning::Color && channel < 3;
        all.push(Lookup { what, value, spread: (most - least).abs(), factor, is_color });
    };
    use Meaning::{Color, Data};
    for (c, vertex) in vertex.into_iter().enumerate() {
        say("base colour", m.base_color_texture, Color, c, f64::from(m.base_color[c]) * vertex);
    }
    say("roughness", m.metallic_roughness_texture, Data, 1, m.roughness.into());
    say("metallic", m.metallic_roughness_texture, Data, 2, m.metallic.into());
    for c in 0..3 {
        say("emission", m.emissive_texture, Color, c, m.emissive[c].into());
    }
    say("specular", m.specular_texture, Data, 3, m.specular.into());
    for c in 0..3 {
        say("specular colour", m.specular_color_texture, Color, c, m.specular_color[c].into());
    }
    say("transmission", m.transmission_texture, Data, 0, m.transmission.into());
    say("thickness", m.thickness_texture, Data, 1, m.thickness.into());
    say("coat", m.clearcoat_texture, Data, 0, m.clearcoat.into());
    say("coat roughness", m.clearcoat_roughness_texture, Data, 1, m.clearcoat_roughness.into());
    let sheen = &m.lobes[SHEEN];
    for c in 0..3 {
        say("sheen", sheen.textures[0], Color, c, sheen.factors[c].into());
    }
    say("sheen roughness", sheen.textures[1], Data, 3, sheen.factors[3].into());
    say("anisotropy", m.lobes[ANISOTROPY].textures[0], Data, 2, m.lobes[ANISOTROPY].factors[0].into());
    let film = &m.lobes[IRIDESCENCE];
    say("film", film.textures[0], Data, 0, film.factors[0].into());
    let through = &m.lobes[DIFFUSE_TRANSMISSION];
    say("diffuse transmission", through.textures[0], Data, 3, through.factors[0].into());
    for c in 0..3 {
        say("diffuse transmission colour", through.textures[1], Color, c, through.factors[1 + c].into());
    }
    all
}

/// The same values of the host's material, in the same order.
fn values(m: &Material) -> Vec<f64> {
    let mut all: Vec<f32> = m.base_color.to_vec();
    all.extend([m.roughness, m.metallic]);
    all.extend(m.emissive);
    all.push(m.specular);
    all.extend(m.specular_color);
    all.extend([m.transmission, m.thickness, m.clearcoat, m.clearcoat_roughness]);
    all.extend(m.lobes[SHEEN].factors);
    all.extend([m.lobes[ANISOTROPY].factors[0], m.lobes[IRIDESCENCE].factors[0]]);
    all.extend(m.lobes[DIFFUSE_TRANSMISSION].factors);
    all.into_iter().map(f64::from).collect()
}

/// Those that the G-buffer holds, by their index among the values.
fn stored(p: &AovPixel) -> [(usize, f64); 8] {
    let [r, g, b] = p.albedo.map(f64::from);
    let [x, y, z] = p.emissive.map(f64::from);
    [(0, r), (1, g), (2, b), (4, p.roughness.into()), (5, p.metallic.into()), (6, x), (7, y), (8, z)]
}

/// Largest number of texels per metre of the surface, of any texture; `None` where a texture that is read by its
/// nearest texel changes so near to the hit that either texel is right.
fn density(scene: &Scene, hit: &Hit) -> Option<f64> {
    let instance = &scene.instances[hit.instance];
    let mesh = &scene.meshes[instance.mesh];
    let corners = [0, 1, 2].map(|k| mesh.indices[3 * hit.triangle + k] as usize);
    let [a, b, c] =
        corners.map(|i| instance.world_from_object.transform_point3(Vec3::from(mesh.positions[i]).as_dvec3()));
    let n = (b - a).cross(c - a);
    let gradients = [(c - a).cross(n), n.cross(b - a)].map(|g| -g / n.length_squared());
    let mut most = 0.0_f64;
    for texture in scene.materials[hit.material].textures().filter_map(|(.., texture)| texture) {
        let uvs = &mesh.uvs[texture.uv_set as usize];
        if uvs.is_empty() {
            continue;
        }
        let [a, b, c] = corners.map(|i| texel_place(scene, &texture, DVec2::from(uvs[i].map(f64::from))));
        for axis in 0..2 {
            most = most.max((gradients[0] * (b - a)[axis] + gradients[1] * (c - a)[axis]).length());
        }
        if texture.sampler.mag_nearest {
            let place = texel_place(scene, &texture, coordinates(scene, hit, &texture));
            let inside = place - place.floor();
            if inside.min_element() < NEAR_BORDER || inside.max_element() > 1.0 - NEAR_BORDER {
                return None;
            }
        }
    }
    Some(most * std::f64::consts::SQRT_2)
}

/// Distance from a texel's border, in texels, within which either texel is right: twice the rounding of the place.
const NEAR_BORDER: f64 = 0.02;
/// Rounding of a place in texels: of coordinates in f32, interpolated over triangles whose corners the rasteriser snaps
/// to 1/256 of a pixel, a pixel being a quarter of a texel, and of the tree's corners in f32.
const PLACE: f64 = 0.01;
/// lavapipe's weights of bilinear filtering have 8 bits (`subTexelPrecisionBits`), two of them, rounded down.
const WEIGHTS: f64 = 2.0 / 256.0;
/// It filters bytes as bytes: rounding in each of two steps.
const BYTES: f64 = 1.0 / 255.0;
/// It decodes sRGB to a quarter of a step of the byte, where the curve is steepest.
const DECODED: f64 = 0.25 / 255.0 * 2.28;
/// A half float has 11 bits, and Vulkan lets a device round either way; a roughness in 16 bits rounds by less.
const HALF: f64 = 1.0 / 1024.0;

/// Largest deviations over all compared pixels.
#[derive(Debug, Default)]
struct Worst {
    pixels: usize,
    /// Of the host from the lookup, absolute.
    lookup: f64,
    /// Of the host from the G-buffer: of colours and of numbers, absolute; and over what is allowed.
    colors: f64,
    numbers: f64,
    allowed: f64,
    /// Of the shading normal, in degrees.
    normal: f64,
    /// Of the Fresnel reflectance from that of the looked-up values.
    fresnel: f64,
    /// Values that a texture changes by more than a tenth.
    textured: usize,
    /// Pixels whose line of sight has a blended surface in front.
    behind: usize,
    mixtures: usize,
}

/// A scene with what looks at it.
struct Stage {
    scene: Scene,
    opaque: Scene,
    tracer: EventTracer,
    renderer: Renderer,
}

/// Normals and positions are not encoded: `normals=f32` and `position=stored`.
fn stage(gpu: &Gpu, scene: Scene) -> Stage {
    let settings = Settings { knobs: knobs(&["samples=1", "normals=f32", "position=stored"]), ..settings(SIZE) };
    let mut opaque = scene.clone();
    for mesh in &mut opaque.meshes {
        if is_transparent(&scene.materials[mesh.material], false) {
            mesh.indices.clear();
        }
    }
    let tracer = EventTracer::new(&scene, Original::from(scene.clone()).bvh().expect("a tree"));
    let renderer = gpu.renderer(&scene, None, settings);
    Stage { scene, opaque, tracer, renderer }
}

const LIMITS: Limits = Limits { surfaces: 1, roughest: 0.0, least_share: 0.0, proxies: true };

/// The surface of the line of sight that the G-buffer has.
fn drawn<'e>(events: &'e [Event], hit: &Hit) -> Option<(usize, &'e Interaction)> {
    let mut last = None;
    for (index, event) in events.iter().enumerate() {
        if event.way == Way::Seen || (event.way == Way::Straight && event.after == last) {
            last = Some(index);
            let here = event.interaction.as_ref()?;
            if here.instance == hit.instance && event.to.distance(hit.position) < 1e-3 * hit.distance {
                return Some((index, here));
            }
        }
    }
    None
}

/// Compares [`PIXELS`] pixels that look at random points from the side of `above`.
fn compare(stage: &mut Stage, random: &mut SplitMix64, above: Option<DVec3>, name: &str) -> Worst {
    let Stage { scene, opaque, tracer, renderer } = stage;
    let bounds = scene.bounds().expect("bounds");
    let world = World::new(opaque, Options::default());
    let everything = World::new(scene, Options { blend: true, ..Options::default() });
    let triangles: Vec<(usize, usize)> = opaque
        .instances
        .iter()
        .enumerate()
        .flat_map(|(instance, placed)| {
            (0..opaque.meshes[placed.mesh].indices.len() / 3).map(move |triangle| (instance, triangle))
        })
        .collect();
    let mut worst = Worst::default();
    for _ in 0..40 * PIXELS {
        if worst.pixels == PIXELS {
            break;
        }
        let (instance, triangle) = triangles[random.below(triangles.len())];
        let mesh = &opaque.meshes[opaque.instances[instance].mesh];
        let (x, y) = (random.between(0.0, 1.0).sqrt(), random.between(0.0, 1.0));
        let target = [1.0 - x, x * (1.0 - y), x * y].into_iter().enumerate().fold(DVec3::ZERO, |sum, (k, weight)| {
            let p = Vec3::from(mesh.positions[mesh.indices[3 * triangle + k] as usize]).as_dvec3();
            sum + opaque.instances[instance].world_from_object.transform_point3(p) * weight
        });
        let way =
            DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0)).normalize();
        let way = above.map_or(way, |above| (above + 0.7 * way).normalize());
        let eye = bounds.center() + way * 3.0 * bounds.radius();
        let up = way.any_orthonormal_vector();
        let looking = |target, fov| Camera::looking_at(eye, target, up, fov).expect("a camera");
        let ray = |camera: &Camera| camera_ray(camera, SIZE[0], SIZE[1], 1.5, 1.5);
        let Some(first) = world.closest(&ray(&looking(target, 0.1))) else { continue };
        let cos = first.geometric_normal.dot((eye - first.position).normalize());
        let Some(density) = density(scene, &first).filter(|_| cos > 0.2) else { continue };
        let pixel = (PIXEL * cos / density.max(1e-9)).min(1e-3 * bounds.radius()) / first.distance;
        let camera = looking(first.position, 2.0 * (1.5 * pixel).atan());
        let Some(hit) = world.closest(&ray(&camera)) else { continue };
        let (pixels, _) = renderer.aovs(&camera).expect("the G-buffer");
        let p = &pixels[4];
        // The rasteriser may give a point on an edge to the other triangle, and one on an outline to another surface.
        let edge = hit.barycentric.into_iter().fold(1.0, f64::min) < 1e-3;
        if edge || p.instance as usize != hit.instance + 1 {
            assert!(edge, "{name}: {hit:?} is not instance {} - 1", p.instance);
            continue;
        }
        let here = format!("{name}, pixel {}, \"{}\"", worst.pixels, scene.materials[hit.material].name);
        let events = tracer.follow(scene, &camera, SIZE, [1, 1], &LIMITS);
        let Some((index, found)) = drawn(&events, &hit) else {
            // Behind glass: the ray is bent, and the G-buffer has what lies straight behind.
            let transmits = |hit: &Interaction| hit.at.transmission > 0.0;
            let bent = events.iter().any(|event| event.interaction.as_ref().is_some_and(transmits));
            assert!(bent, "{here}: {hit:?} is not in {events:?}");
            continue;
        };
        check(&mut worst, scene, &hit, found, p, &here);
        // What is before it, too.
        if index > 0 {
            let pane = everything.closest(&ray(&camera)).expect("what is in front");
            let front = events[0].interaction.as_ref().expect("a surface");
            assert_eq!(front.instance, pane.instance, "{here}");
            let wanted = lookups(scene, &pane);
            equals(&mut worst, &wanted, &values(&front.at), &here);
            assert!((front.opacity - pane.alpha).abs() <= 1e-6 + wanted[3].spread * PLACE, "{here}: {}", front.opacity);
            worst.behind += 1;
        }
        worst.pixels += 1;
    }
    eprintln!("{name}: {worst:?}");
    assert_eq!(worst.pixels, PIXELS, "{name}: too few pixels were compared");
    worst
}

/// The host's values against those looked up: both are in f64, the place in a texel apart.
fn equals(worst: &mut Worst, wanted: &[Lookup], found: &[f64], here: &str) {
    assert_eq!(wanted.len(), found.len());
    for (want, &found) in wanted.iter().zip(found) {
        let off = (found - want.value).abs();
        let allowed = 1e-6 * want.value.abs() + PLACE * want.spread;
        assert!(off <= allowed, "{here}: {} is {found}, not {}", want.what, want.value);
        worst.lookup = worst.lookup.max(off);
    }
}

fn check(worst: &mut Worst, scene: &Scene, hit: &Hit, found: &Interaction, p: &AovPixel, here: &str) {
    let m = &scene.materials[hit.material];
    let wanted = lookups(scene, hit);
    let at = values(&found.at);
    equals(worst, &wanted, &at, here);
    for (i, drawn) in stored(p) {
        let Lookup { what, spread, factor, is_color, .. } = wanted[i];
        let off = (at[i] - drawn).abs();
        let filtered = if spread > 0.0 { spread * (WEIGHTS + 2.0 * PLACE) + BYTES * factor } else { 0.0 };
        let decoded = if is_color { DECODED * factor } else { 0.0 };
        let allowed = filtered + decoded + HALF * at[i].abs() + 1e-6;
        assert!(off <= allowed, "{here}: {what} is {}, and {drawn} in the G-buffer ({allowed:.1e})", at[i]);
        let worst_of = if is_color { &mut worst.colors } else { &mut worst.numbers };
        *worst_of = worst_of.max(off);
        worst.allowed = worst.allowed.max(off / allowed);
    }
    let factors = values(m);
    worst.textured += at.iter().zip(&factors).filter(|(at, factor)| (*at - *factor).abs() > 0.1 * factor.abs()).count();

    // A normal that faces away from the ray is replaced by the triangle's.
    let normal = Vec3::from(p.normal).as_dvec3();
    let view = -Vec3::from(p.p_rel).as_dvec3().normalize();
    if normal.dot(view) > 0.01 {
        let angle = normal.cross(found.normal).length().atan2(normal.dot(found.normal)).to_degrees();
        let texels = m.normal_texture.map(|t| texel(scene, &t, coordinates(scene, hit, &t), Meaning::Data));
        // Normals turn by less than a radian over a triangle, and the place in it is known to a ten-thousandth of it.
        // A channel's error is doubled by the decoding to −1 … 1, and there are two that bend, of a vector that is half
        // a unit long or longer.
        let channel = texels.map_or(0.0, |[_, least, most]| {
            let spread = (0..3).map(|c| most[c] - least[c]).fold(0.0, f64::max);
            if spread > 0.0 { spread * (WEIGHTS + 2.0 * PLACE) + BYTES } else { 0.0 }
        });
        let allowed = (8.0 * channel * f64::from(m.normal_scale.abs().max(1.0))).to_degrees() + 0.006;
        assert!(angle <= allowed, "{here}: normals {angle} degrees apart, {allowed} are allowed");
        worst.normal = worst.normal.max(angle);
    }

    // Dielectric and metal mixed by the metal of the point; KHR_materials_specular scales the dielectric's curve.
    if !m.unlit && m.conductor.is_none() && !m.dispersion.disperses(f64::from(m.ior)) && m.ior != 1.0 {
        let f0 = f64::from((m.ior - 1.0) / (m.ior + 1.0)).powi(2);
        let [specular, tint, metallic] = [9, 11, 5].map(|i| wanted[i].value);
        let exact = fresnel_dielectric(found.cos, m.ior.into())[0];
        let least = (f0 * tint).min(1.0) * specular;
        let dielectric = least + (specular - least) * (exact - f0) / (1.0 - f0);
        let metal = schlick(wanted[1].value, 1.0, found.cos);
        let [got_dielectric, got_metal] = found.parts;
        let off = (got_dielectric - dielectric).abs().max(if metallic > 0.0 { (got_metal - metal).abs() } else { 0.0 });
        let slack = 1e-5 + PLACE * [1, 5, 9, 11].map(|i| wanted[i].spread).into_iter().sum::<f64>();
        assert!(off <= slack, "{here}: F {:?}, not {dielectric} and {metal}", found.parts);
        worst.fresnel = worst.fresnel.max(off);
        if wanted[15].value == 0.0 {
            let mixed = dielectric + (metal - dielectric) * metallic;
            assert!((found.reflected - mixed).abs() <= slack, "{here}: {} is reflected, not {mixed}", found.reflected);
        }
        worst.mixtures += usize::from(metallic > 0.05 && metallic < 0.95);
    }
}

/// A picture of random bytes in the given ranges.
fn picture(random: &mut SplitMix64, ranges: [[f64; 2]; 4]) -> Vec<u8> {
    let (width, height) = (3 + random.below(10) as u32, 2 + random.below(9) as u32);
    let bytes =
        (0..width * height).flat_map(|_| ranges.map(|[least, most]| random.between(least, most) as u8)).collect();
    let mut out = std::io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_raw(width, height, bytes).expect("its size");
    image.write_to(&mut out, image::ImageFormat::Png).expect("a picture");
    out.into_inner()
}

/// A new texture as a glTF textureInfo, of one of two sets of coordinates and with a transform.
fn texture(builder: &mut Builder, random: &mut SplitMix64, ranges: [[f64; 2]; 4]) -> Value {
    let view = builder.view(&picture(random, ranges), None);
    let source = builder.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
    let wraps = [10497, 33648, 33071];
    let filter = if coin(random) { 9728 } else { 9729 };
    let sampler = json!({
        "magFilter": filter, "minFilter": filter, "wrapS": wraps[random.below(3)], "wrapT": wraps[random.below(3)],
    });
    let sampler = builder.push("samplers", sampler);
    let index = builder.push("textures", json!({ "source": source, "sampler": sampler }));
    let transform = json!({
        "offset": list(random, 2, -1.0, 1.0), "rotation": random.between(-3.0, 3.0), "scale": list(random, 2, -1.5, 1.5),
    });
    let mut info = json!({ "index": index, "texCoord": random.below(2) });
    if random.below(4) > 0 {
        info["extensions"] = json!({ "KHR_texture_transform": transform });
    }
    info
}

const ANY: [[f64; 2]; 4] = [[0.0, 256.0]; 4];
/// Not so far from the surface that the normal turns away.
const BUMPS: [[f64; 2]; 4] = [[90.0, 166.0], [90.0, 166.0], [200.0, 256.0], [255.0, 256.0]];
/// Never below the cutoff of a mask.
const COVERED: [[f64; 2]; 4] = [[0.0, 256.0], [0.0, 256.0], [0.0, 256.0], [200.0, 256.0]];

/// A material with random factors and textures in all slots.
fn material(builder: &mut Builder, random: &mut SplitMix64, number: u64) -> Value {
    let mut textures = |ranges| texture(builder, random, ranges);
    let [base, surface, mut normal, emissive, specular, specular_color, coat, coat_roughness, sheen, film, through] =
        [COVERED, ANY, BUMPS, ANY, ANY, ANY, ANY, ANY, ANY, ANY, ANY].map(&mut textures);
    normal["scale"] = random.between(-1.5, 1.5).into();
    let mut factors = |count, least, most| list(random, count, least, most);
    let mut extensions = json!({
        "KHR_materials_emissive_strength": { "emissiveStrength": factors(1, 0.5, 3.0)[0] },
    });
    if number.is_multiple_of(2) {
        extensions["KHR_materials_specular"] = json!({
            "specularFactor": factors(1, 0.2, 1.0)[0], "specularTexture": specular,
            "specularColorFactor": factors(3, 0.2, 1.0), "specularColorTexture": specular_color,
        });
    }
    if number.is_multiple_of(3) {
        extensions["KHR_materials_clearcoat"] = json!({
            "clearcoatFactor": factors(1, 0.2, 1.0)[0], "clearcoatTexture": coat,
            "clearcoatRoughnessFactor": factors(1, 0.2, 1.0)[0], "clearcoatRoughnessTexture": coat_roughness,
        });
    }
    if number % 4 == 1 {
        extensions["KHR_materials_sheen"] = json!({
            "sheenColorFactor": factors(3, 0.2, 1.0), "sheenColorTexture": sheen,
            "sheenRoughnessFactor": factors(1, 0.2, 1.0)[0], "sheenRoughnessTexture": sheen,
        });
        extensions["KHR_materials_diffuse_transmission"] = json!({
            "diffuseTransmissionFactor": factors(1, 0.2, 1.0)[0], "diffuseTransmissionTexture": through,
            "diffuseTransmissionColorFactor": factors(3, 0.2, 1.0), "diffuseTransmissionColorTexture": through,
        });
    }
    if number % 4 == 2 {
        extensions["KHR_materials_iridescence"] = json!({
            "iridescenceFactor": factors(1, 0.2, 1.0)[0], "iridescenceTexture": film,
        });
        extensions["KHR_materials_anisotropy"] = json!({
            "anisotropyStrength": factors(1, 0.2, 1.0)[0], "anisotropyTexture": film,
        });
    }
    json!({
        "name": format!("material {number}"),
        "pbrMetallicRoughness": {
            "baseColorFactor": factors(3, 0.3, 1.0).into_iter().chain([0.9]).collect::<Vec<f32>>(),
            "baseColorTexture": base, "metallicRoughnessTexture": surface,
            "metallicFactor": factors(1, 0.3, 1.0)[0], "roughnessFactor": factors(1, 0.3, 1.0)[0],
        },
        "normalTexture": normal,
        "emissiveFactor": factors(3, 0.2, 1.0), "emissiveTexture": emissive,
        "alphaMode": if number % 3 == 1 { "MASK" } else { "OPAQUE" }, "alphaCutoff": 0.3,
        "doubleSided": true,
        "extensions": extensions,
    })
}

/// A patch of `side` by `side` squares over the unit square, with random heights, normals, coordinates and colours.
fn patch(builder: &mut Builder, random: &mut SplitMix64, side: usize, height: f64, tangents: bool) -> Value {
    let count = (side + 1).pow(2);
    let place = |i: usize| [i % (side + 1), i / (side + 1)].map(|x| x as f64 / side as f64);
    let mut floats = |shape, width: usize, mut value: Box<dyn FnMut(usize) -> Vec<f64> + '_>| {
        let all: Vec<f32> = (0..count).flat_map(&mut value).map(|x| x as f32).collect();
        assert_eq!(all.len(), width * count);
        builder.floats(shape, &all)
    };
    let mut spread = |spread: f64| random.between(-spread, spread);
    let positions = floats(
        "VEC3",
        3,
        Box::new(|i| {
            let [x, y] = place(i);
            vec![x, y, height + spread(0.05)]
        }),
    );
    let normals =
        floats("VEC3", 3, Box::new(|_| DVec3::new(spread(0.3), spread(0.3), 1.0).normalize().to_array().into()));
    let sets = [0, 1].map(|_| floats("VEC2", 2, Box::new(|i| place(i).map(|x| 1.3 * x + spread(0.05)).into())));
    let colors =
        floats("VEC4", 4, Box::new(|_| [0, 1, 2].map(|_| 0.7 + spread(0.3)).into_iter().chain([0.95]).collect()));
    let mut attributes = json!({
        "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": sets[0], "TEXCOORD_1": sets[1], "COLOR_0": colors,
    });
    if tangents {
        let hand = if spread(1.0) > 0.0 { 1.0 } else { -1.0 };
        attributes["TANGENT"] = floats(
            "VEC4",
            4,
            Box::new(|_| {
                let t = DVec3::new(1.0, spread(0.3), spread(0.3)).normalize();
                vec![t.x, t.y, t.z, hand]
            }),
        )
        .into();
    }
    let corners: Vec<u16> = (0..side * side)
        .flat_map(|i| {
            let a = i / side * (side + 1) + i % side;
            [a, a + 1, a + side + 2, a, a + side + 2, a + side + 1].map(|i| i as u16)
        })
        .collect();
    let indices = builder.indices(&corners);
    json!({ "attributes": attributes, "indices": indices })
}

/// A model with random textures, and the direction from which its patch is seen.
fn random_model(number: u64) -> (Scene, DVec3) {
    let random = &mut SplitMix64::new(1000 + number);
    let mut builder = Builder::new();
    builder.json["extensionsUsed"] = json!([
        "KHR_texture_transform",
        "KHR_materials_emissive_strength",
        "KHR_materials_specular",
        "KHR_materials_clearcoat",
        "KHR_materials_sheen",
        "KHR_materials_iridescence",
        "KHR_materials_anisotropy",
        "KHR_materials_diffuse_transmission",
    ]);
    let turn = DQuat::from_euler(
        glam::EulerRot::XYZ,
        random.between(-3.0, 3.0),
        random.between(-3.0, 3.0),
        random.between(-3.0, 3.0),
    );
    let mirror = if number % 2 == 1 { -1.0 } else { 1.0 };
    let scale = [mirror * random.between(0.5, 2.0), random.between(0.5, 2.0), random.between(0.5, 2.0)];
    let mut blended = vec![(0.0, false)];
    if number % 5 < 2 {
        blended.push((0.4, true));
    }
    for (height, blend) in blended {
        let mut m = material(&mut builder, random, number);
        if blend {
            m["name"] = "pane".into();
            m["alphaMode"] = "BLEND".into();
            m["pbrMetallicRoughness"]["baseColorTexture"] = texture(&mut builder, random, ANY);
        }
        let mut primitive = patch(&mut builder, random, 4, height, !number.is_multiple_of(3));
        primitive["material"] = builder.push("materials", m).into();
        let mesh = builder.mesh(primitive);
        builder.root(json!({
            "mesh": mesh, "rotation": turn.to_array(), "scale": scale, "translation": [3.0, -2.0, 5.0],
        }));
    }
    let folder = tempfile::tempdir().expect("a folder");
    let scene = load(&builder.save_glb(folder.path()), &LoadOptions::default()).expect("a scene");
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    (scene, turn * DVec3::Z)
}

#[test]
fn a_picked_pixel_of_random_models_has_the_values_of_the_g_buffer_and_of_a_lookup() {
    let gpu = Gpu::hasty();
    let (mut textured, mut behind, mut mixtures) = (0, 0, 0);
    for number in 0..10 {
        let (scene, above) = random_model(number);
        let random = &mut SplitMix64::new(number);
        let worst = compare(&mut stage(&gpu, scene), random, Some(above), &format!("model {number}"));
        textured += worst.textured;
        behind += worst.behind;
        mixtures += worst.mixtures;
    }
    // The factors alone would be wrong nearly everywhere.
    assert!(textured > 500 && behind > 10 && mixtures > 50, "{textured}, {behind}, {mixtures}");
}

/// Textured files of the shared collection.
const REAL: [&str; 12] = [
    "AlphaBlendModeTest",
    "BoxTextured",
    "CesiumMan",
    "CesiumMilkTruck",
    "ClearCoatTest",
    "GlassHurricaneCandleHolder",
    "LightsPunctualLamp",
    "MultiUVTest",
    "NormalTangentTest",
    "StainedGlassLamp",
    "TextureTransformTest",
    "WaterBottle",
];

#[test]
fn a_picked_pixel_of_real_models_has_the_values_of_the_g_buffer_and_of_a_lookup() {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets/models");
    if !models.is_dir() {
        eprintln!("skipped: {} is absent", models.display());
        return;
    }
    let gpu = Gpu::hasty();
    for (number, name) in REAL.into_iter().enumerate() {
        let files = std::fs::read_dir(models.join(name)).expect("a folder of the collection");
        let is_scene = |path: &std::path::PathBuf| path.extension().is_some_and(|e| e == "glb" || e == "gltf");
        let file = files.map(|entry| entry.expect("an entry").path()).find(is_scene).expect("a scene");
        let scene = load(&file, &LoadOptions::default()).expect("a scene");
        compare(&mut stage(&gpu, scene), &mut SplitMix64::new(number as u64), None, name);
    }
}
