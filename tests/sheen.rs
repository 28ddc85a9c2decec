//! Sheen (KHR_materials_sheen) in pictures of all three models against its formulas in f64: under a light, before light
//! that is the same from everywhere, by its textures, and from a file.

use etalon::plan::Model;
use etalon::plan::rungs::Brdf;
use etalon::scene::environment::Environment;
use etalon::scene::lobe::LobeOf;
use etalon::scene::lobe::sheen::{albedo, sheen};
use etalon::scene::{Image, LightKind, LoadOptions, Material, Sampler, Scene, TextureRef, load};
use etalon_testing::gltf_builder::Builder;
use etalon_testing::gpu::Gpu;
use etalon_testing::lobe::{DOME, Facet, MODELS, Rungs, dome, model, reflected, worst};
use etalon_testing::made::{Made, lambert};
use glam::{Affine2, DVec3};
use serde_json::json;

/// Place of sheen among the lobes of a material.
const SHEEN: usize = 0;
const IRRADIANCE: [f32; 3] = [3.0, 2.0, 5.0];

fn with_sheen(color: [f32; 3], roughness: f32, below: Material) -> Material {
    let mut material = below;
    material.lobes[SHEEN].factors = [color[0], color[1], color[2], roughness];
    material
}

fn plastic(base_color: [f32; 3], roughness: f32) -> Material {
    Material { specular: 1.0, roughness, ..lambert(base_color) }
}

/// Cloth over a matt ground, over plastic, over metal, and under a coat.
fn cloths() -> [Material; 6] {
    let metal = Material { base_color: [0.9, 0.6, 0.3, 1.0], metallic: 1.0, roughness: 0.4, ..Material::default() };
    let coated = Material { clearcoat: 1.0, clearcoat_roughness: 0.3, ..plastic([0.2, 0.3, 0.6], 0.5) };
    [
        with_sheen([1.0, 0.5, 0.2], 0.5, lambert([0.5, 0.4, 0.3])),
        with_sheen([0.3, 0.8, 1.0], 1.0, plastic([0.4, 0.1, 0.2], 0.6)),
        with_sheen([0.9, 0.9, 0.9], 0.3, metal),
        with_sheen([0.6, 0.2, 0.1], 0.8, coated),
        with_sheen([1.0, 1.0, 1.0], 0.15, lambert([0.2; 3])),
        lambert([0.7, 0.6, 0.5]),
    ]
}

fn factors(m: &Material) -> (DVec3, f64) {
    let [r, g, b, roughness] = m.lobes[SHEEN].factors.map(f64::from);
    (DVec3::new(r, g, b), roughness)
}

/// What the whole material makes of light from l: the base under the lesser of two scales, the lobe, and over both the
/// coat.
fn expected(m: &Material, n: DVec3, l: DVec3, v: DVec3) -> DVec3 {
    let rungs = Rungs { brdf: Brdf::Ggx, exact: false };
    let bare = Material { clearcoat: 0.0, ..m.clone() };
    let (color, roughness) = factors(m);
    let (cos_l, cos_v, h) = (n.dot(l), n.dot(v), (l + v).normalize());
    let mut result = reflected(&bare, rungs, n, l, v);
    if cos_l > 0.0 {
        let left = |cos: f64| 1.0 - color.max_element() * albedo(cos, roughness).min(1.0);
        let most = albedo(cos_v, roughness).max(1.0);
        result =
            result * left(cos_l).min(left(cos_v)) + color * sheen(cos_l, cos_v, n.dot(h), roughness) * cos_l / most;
    }
    // The coat alone is what is left of a coated black body.
    let black = Material { base_color: [0.0, 0.0, 0.0, 1.0], metallic: 0.0, specular: 0.0, ..m.clone() };
    let coat_f = f64::from(m.clearcoat) * etalon_testing::lobe::schlick(DVec3::splat(0.04), 1.0, h.dot(v)).x;
    result * (1.0 - coat_f) + reflected(&black, rungs, n, l, v)
}

/// The table of E has 32 steps each way: its lines are off by 4e-3 of the white that they scale. Within 0.1° of the
/// horizon they are off by more, where light makes next to nothing: pixels count from a tenth of the brightest on.
const TABLE: f64 = 4e-3;
const BRIGHT: f64 = 0.1;

#[test]
fn cloth_reflects_a_light_as_estevez_and_kulla_say() {
    let gpu = Gpu::open();
    for of in MODELS {
        for light in [DVec3::new(0.2, 0.5, 1.0), DVec3::new(-0.7, 0.15, 0.4)] {
            let (mut scene, facets) = dome(&cloths());
            let l = light.normalize();
            let mut made = Made(std::mem::take(&mut scene));
            made.light(IRRADIANCE, LightKind::Directional { direction: -l });
            let film = gpu.film(&made.0, model(of, DOME, &["brdf=ggx", "fresnel=schlick"]));
            eprint!("{of:?} ");
            let error = worst(&film, &facets, BRIGHT, |facet: &Facet| {
                expected(&made.0.materials[facet.material], facet.n, l, DVec3::Z)
                    * etalon_testing::lobe::rgb(IRRADIANCE)
            });
            assert!(error < TABLE, "{of:?}, {light}: {error:e}");
        }
    }
}

/// White cloth on a white ground before light from everywhere sends c E(V), and of the ground what the lesser of both
/// scales leaves: with cosines x below the viewer's, 1 − c (E(V) (1 − cos²) + ∫ 2x E(x) dx). Never more than it
/// receives.
fn furnace(m: &Material, cos_v: f64) -> DVec3 {
    let (color, roughness) = factors(m);
    let steps = 100;
    let below = (0..steps).map(|i| (f64::from(i) + 0.5) / f64::from(steps) * cos_v);
    let moment: f64 = below.map(|x| 2.0 * x * albedo(x, roughness).min(1.0)).sum::<f64>() * cos_v / f64::from(steps);
    let e = albedo(cos_v, roughness).min(1.0);
    let left = 1.0 - color.max_element() * (e * (1.0 - cos_v * cos_v) + moment);
    color * e + etalon_testing::lobe::base(m) * left
}

#[test]
fn white_cloth_sends_no_more_than_it_receives() {
    let gpu = Gpu::open();
    let sky = Environment::constant([1.0; 3]);
    let white = lambert([1.0; 3]);
    let cloths = [
        with_sheen([1.0; 3], 1.0, white.clone()),
        with_sheen([1.0; 3], 0.5, white.clone()),
        with_sheen([1.0; 3], 0.25, white.clone()),
        with_sheen([1.0, 0.5, 0.0], 0.6, white),
    ];
    let (scene, facets) = dome(&cloths);
    let wanted: Vec<DVec3> = facets.iter().map(|facet| furnace(&cloths[facet.material], facet.n.z)).collect();
    for (of, samples, noise) in [(Model::Local, 1, 0.0), (Model::Recursive, 1, 0.0), (Model::Global, 1024, 5.0)] {
        let settings = model(of, DOME, &[&format!("samples={samples}")]);
        let (_, film) = gpu.shot(&scene, Some(&sky), settings);
        for (facet, want) in facets.iter().zip(&wanted) {
            for c in 0..3 {
                let all: Vec<f64> = facet.pixels.iter().map(|&pixel| f64::from(film.rgba[pixel][c])).collect();
                let n = all.len() as f64;
                let mean = all.iter().sum::<f64>() / n;
                let spread = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n.max(2.0);
                let error = if n > 3.0 { noise * (spread / n).sqrt() } else { 0.02 * noise };
                let about = format!("{of:?}, material {}, cosine {:.2}: {mean} ± {error}", facet.material, facet.n.z);
                assert!((mean - want[c]).abs() < TABLE + error, "{about}, not {}", want[c]);
                assert!(mean < 1.0 + TABLE + error, "{about}");
            }
        }
    }
}

/// One texel everywhere.
fn texture(image: usize) -> TextureRef {
    TextureRef { image, uv_set: 0, uv_transform: Affine2::IDENTITY, sampler: Sampler::default() }
}

#[test]
fn textures_multiply_its_colour_and_roughness() {
    let gpu = Gpu::open();
    let ground = plastic([0.3, 0.3, 0.3], 0.7);
    let told = with_sheen([0.9, 0.6, 0.8], 0.9, ground.clone());
    let mut textured = told.clone();
    textured.lobes[SHEEN].textures = [Some(texture(0)), Some(texture(1))];
    // sRGB 188 is 0.503 in linear light; of 255 the alpha 128 is 0.502.
    let linear = |byte: f32| ((byte / 255.0 + 0.055) / 1.055).powf(2.4);
    let product = with_sheen([0.9 * linear(188.0), 0.6, 0.8 * linear(137.0)], 0.9 * 128.0 / 255.0, ground);
    let made = |material: &Material| -> Scene {
        let (mut scene, _) = dome(std::slice::from_ref(material));
        for (name, texel) in [("colour", [188, 255, 137, 9]), ("roughness", [7, 200, 90, 128])] {
            scene.images.push(Image { name: name.to_owned(), width: 1, height: 1, rgba: texel.to_vec().into() });
        }
        for mesh in &mut scene.meshes {
            mesh.uvs[0] = vec![[0.5; 2]; 4].into();
        }
        let mut made = Made(scene);
        made.light(IRRADIANCE, LightKind::Directional { direction: DVec3::new(-0.2, -0.5, -1.0).normalize() });
        made.0
    };
    for of in MODELS {
        let settings = || model(of, DOME, &[]);
        let [a, b, plain] = [&textured, &product, &told].map(|m| gpu.film(&made(m), settings()));
        let difference = etalon_testing::gpu::largest_difference(&a, &b, 1.0);
        // A byte's half step of roughness, 2e-3, is most of it.
        assert!(difference < 8e-3, "{of:?}: {difference}");
        assert!(
            etalon_testing::gpu::largest_difference(&a, &plain, 1.0) > 0.1,
            "{of:?}: the textures change something"
        );
    }
}

#[test]
fn a_file_describes_sheen() {
    let mut b = Builder::new();
    let position = b.triangle();
    b.push(
        "materials",
        json!({ "extensions": { "KHR_materials_sheen": {
        "sheenColorFactor": [0.2, 0.4, 1.5], "sheenRoughnessFactor": 0.7 } } }),
    );
    b.json["extensionsUsed"] = json!(["KHR_materials_sheen"]);
    b.json["extensionsRequired"] = json!(["KHR_materials_sheen"]);
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position }, "material": 0 }));
    b.root(json!({ "mesh": mesh }));
    let folder = tempfile::tempdir().expect("a folder");
    let loaded = load(&b.save_glb(folder.path()), &LoadOptions::default()).expect("a scene");
    let found = loaded.materials.iter().map(|m| m.lobes[SHEEN]).find(|of| *of != LobeOf::default());
    assert_eq!(found.expect("a sheen").factors, [0.2, 0.4, 1.0, 0.7]);
    assert!(loaded.warnings.iter().any(|w| w.contains("sheenColorFactor 1.5 lies outside")), "{:?}", loaded.warnings);
}
