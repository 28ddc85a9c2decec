//! A plan has no pass or buffer that its scene does not call for, and the picture does not change: a hidden surface
//! that calls for an effect adds the effect to the plan, and the picture is the same to the last bit.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use etalon::frame::Settings;
use etalon::gpu::NOTHING;
use etalon::image::Picture;
use etalon::plan::{Architecture, Knobs, Plan};
use etalon::scene::environment::Environment;
use etalon::scene::lobe::{ANISOTROPY, DIFFUSE_TRANSMISSION, IRIDESCENCE};
use etalon::scene::material::{Sampler, TextureRef};
use etalon::scene::{AlphaMode, Extent, Image, Light, LightKind, Material, Scene, SigmaGrid};
use etalon::study::shape::Shape;
use etalon_testing::gpu::{Gpu, bits};
use etalon_testing::made::{Made, at, lambert, orthographic, unlit};
use glam::DVec3;

const SIZE: [u32; 2] = [48, 36];

/// A texture of 4x4 texels of one colour, the only one of its scene.
fn one_colour(made: &mut Made, rgba: [u8; 4]) -> TextureRef {
    made.0.images = vec![Image { name: "texels".to_owned(), width: 4, height: 4, rgba: rgba.repeat(16).into() }];
    TextureRef { image: 0, uv_set: 0, uv_transform: glam::Affine2::IDENTITY, sampler: Sampler::default() }
}

/// A ball of one material before a darker one, and inside the first a small cube of another.
fn ball(surface: Material, hidden: Option<Material>) -> Made {
    let mut made = Made::new("plan");
    made.add(Shape::sphere(1.0, 16), surface.clone(), at(0.0, 0.0, 0.0));
    made.add(Shape::sphere(0.4, 12), Material { base_color: [0.4, 0.2, 0.1, 1.0], ..surface }, at(0.9, 0.5, 1.2));
    if let Some(hidden) = hidden {
        made.add(Shape::cuboid(DVec3::splat(0.1)), hidden, at(0.0, 0.0, 0.0));
    }
    made.camera(DVec3::Z * 10.0, DVec3::ZERO, orthographic(1.5));
    made
}

fn metal(roughness: f32) -> Material {
    Material { base_color: [0.9, 0.7, 0.4, 1.0], metallic: 1.0, roughness, ..Material::default() }
}

struct Drawn {
    plan: Plan,
    film: Picture,
    /// Buffers and images that hold something, by name.
    objects: BTreeMap<String, u64>,
    passes: BTreeSet<String>,
    /// Per program and constant all values that some pipeline has.
    code: BTreeMap<String, BTreeSet<u32>>,
}

fn draw(scene: &Scene, environment: Option<&Environment>, choices: &[&str]) -> Drawn {
    let gpu = Gpu::alone();
    let mut knobs = Knobs::default();
    for choice in ["samples=1"].iter().chain(choices) {
        knobs.set(choice).expect("a rung");
    }
    // The programs are those for CPUs, whatever the device is.
    let architecture = Some(Architecture::Cpu);
    let mut renderer =
        gpu.renderer(scene, environment, Settings { size: SIZE, knobs, architecture, ..Settings::default() });
    let rendered = renderer.render(&scene.cameras[0], &mut |_| ()).expect("a picture");
    let film = renderer.film().expect("the film");
    // Pages of textures and staging come with textures, whatever they are for; a prefiltered environment may come from
    // the cache.
    let shared = |name: &str| {
        [NOTHING, "staging", "film read back", "prefiltered level"].contains(&name) || name.starts_with("texture page")
    };
    let created = gpu.device.created().into_iter().filter(|made| matches!(made.kind, "buffer" | "image"));
    let objects = created.map(|made| (made.name, made.bytes)).filter(|(name, _)| !shared(name)).collect();
    let mut code: BTreeMap<String, BTreeSet<u32>> = BTreeMap::new();
    // What the cache of prefiltered environments holds takes no pipeline.
    for (program, constants) in gpu.device.pipelines().into_iter().filter(|(program, _)| program.name != "prefilter") {
        code.entry(program.name.to_owned()).or_default();
        for (id, value) in constants {
            // Words that a program does not read change nothing.
            let Some(constant) = program.constants.iter().find(|constant| constant.id == id) else { continue };
            code.entry(format!("{}.{}", program.name, constant.name)).or_default().insert(value);
        }
    }
    let passes = rendered.passes.into_iter().map(|pass| pass.name).collect();
    Drawn { plan: renderer.plan().clone(), film, objects, passes, code }
}

fn state(plan: &Plan, name: &str) -> (&'static str, String) {
    let effect = plan.effects.iter().find(|effect| effect.id.name() == name).expect("an effect");
    (effect.state.name(), effect.reason())
}

/// Scenes without and with what calls for an effect.
struct Case {
    effect: &'static str,
    /// Why it is not called for.
    reason: &'static str,
    scenes: [Made; 2],
    environments: [Option<Environment>; 2],
    choices: &'static [&'static str],
    /// What it brings: `image or buffer`, `[pass]`, `program`, `program.constant`; nothing else may come or go.
    /// Programs that are new bring their constants.
    brings: &'static [&'static [&'static str]],
    /// The pictures are the same to the last bit: what calls for the effect cannot be seen.
    same: bool,
}

impl Case {
    fn new(effect: &'static str, reason: &'static str, without: Made, with: Made) -> Self {
        let environments = [Some(Environment::studio()), Some(Environment::studio())];
        Self { effect, reason, scenes: [without, with], environments, choices: &[], brings: &[], same: true }
    }

    /// A ball of one material, and one more surface inside of it that nobody sees.
    fn hidden(effect: &'static str, reason: &'static str, ball_of: Material, with: Material) -> Self {
        Self::new(effect, reason, ball(ball_of.clone(), None), ball(ball_of, Some(with)))
    }

    fn check(self) -> [Drawn; 2] {
        let Self { effect, reason, scenes, environments, choices, brings, same } = self;
        // Ambient occlusion and light samples are cases of their own: their rays would call for what other effects
        // bring.
        let choices = &[&["indirect=ambient", "lights=points", "light-sampler=power"], choices].concat();
        let [without, with] = [0, 1].map(|i| draw(&scenes[i].0, environments[i].as_ref(), choices));
        assert_eq!(state(&without.plan, effect), ("not needed", reason.to_owned()), "{effect}");
        assert_eq!(state(&with.plan, effect).0, "used", "{effect}: {}", state(&with.plan, effect).1);
        let mut brings: Vec<&str> = brings.concat();
        brings.sort_unstable();
        assert_eq!(came(&without, &with), brings, "{effect}");
        assert_eq!(
            came(&with, &without).iter().filter(|name| !name.contains('.')).count(),
            0,
            "{effect}: nothing goes"
        );
        assert!(!same || bits(&without.film) == bits(&with.film), "{effect}: the pictures differ");
        assert!(without.film.rgba.iter().any(|pixel| pixel[0] > 0.1), "{effect}: something is seen");
        [without, with]
    }
}

/// What the one has beside the other, as [`Case::brings`] names it.
fn came(before: &Drawn, after: &Drawn) -> Vec<String> {
    let mut all: Vec<String> =
        after.objects.keys().filter(|name| !before.objects.contains_key(*name)).cloned().collect();
    all.extend(after.passes.difference(&before.passes).map(|pass| format!("[{pass}]")));
    for (name, values) in &after.code {
        let program = name.split('.').next().expect("a name");
        let changed = match before.code.get(name) {
            None => !name.contains('.') || before.code.contains_key(program),
            // The G-buffer has a pipeline for each kind of material: what matters is a value that none had.
            Some(known) => !values.is_subset(known),
        };
        if changed {
            all.push(name.clone());
        }
    }
    all.sort_unstable();
    all
}

/// What rays go through.
const HIERARCHY: &[&str] = &[
    "BVH nodes",
    "BVH triangles",
    "G-buffer triangles",
    "corners for rays",
    "leaf places",
    "work counts",
    "work counts for the host",
    "[reset work counts]",
];
/// The tiles in which something is mirrored or refracted.
const TILES: &[&str] = &[
    "empty ray work size",
    "ray tiles",
    "ray work size",
    "[classify ray tiles]",
    "[reset ray work size]",
    "classify_rays",
];
/// Buffers of the per-pixel fragment lists.
const FRAGMENTS: &[&str] = &[
    "dropped fragments",
    "dropped fragments for the host",
    "empty fragment work size",
    "fragment counters",
    "fragment counters for the host",
    "fragment list heads",
    "fragment list nodes",
    "fragment tiles",
    "fragment work size",
    "[classify fragment tiles]",
    "[clear fragment lists]",
    "[reset dropped fragments]",
    "[reset fragment counters]",
    "[reset fragment work size]",
    "[transparent fragments]",
    "[transparent lighting]",
    "classify_fragments",
    "composite",
    "fragments",
];
/// A copy of the picture to look up.
const SCREEN: &[&str] = &[
    "nearest depth of tiles",
    "radiance on the screen",
    "[copy radiance]",
    "[nearest depth of tiles]",
    "screen_tiles",
];
const TEXTURES: &[&str] = &["texture coordinates 0"];
/// What textures of lobes and directions are stored in.
const LOBE_TARGET: &[&str] =
    &["G-buffer lobes", "G-buffer lobe rows", "[copy lobes]", "light.stored_lobes", "light.specular_colors"];

fn chalk() -> Material {
    lambert([0.5, 0.6, 0.7])
}

fn glass() -> Material {
    Material {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        thickness: 0.1,
        double_sided: true,
        ..Material::default()
    }
}

const NONE: &str = "no visible material uses it";

#[test]
fn surfaces_bring_their_targets() {
    let mut with = ball(chalk(), Some(chalk()));
    let texture = one_colour(&mut with, [9, 9, 9, 255]);
    with.0.materials[2].emissive = [1.0; 3];
    with.0.materials[2].emissive_texture = Some(texture);
    let case = Case::new("emissive textures", NONE, ball(chalk(), None), with);
    Case { brings: &[TEXTURES, &["G-buffer emissive", "gbuffer.textures", "light.stored_emissive"]], ..case }.check();

    let coated = Material { clearcoat: 0.5, clearcoat_roughness: 0.5, ..metal(0.5) };
    Case {
        brings: &[&["G-buffer layers", "light.clearcoat", "light.stored_layers"]],
        ..Case::hidden("clear coat", NONE, metal(0.5), coated)
    }
    .check();

    let mut with = ball(metal(0.5), Some(metal(0.5)));
    let texture = one_colour(&mut with, [9, 9, 9, 9]);
    with.0.materials[2].specular_texture = Some(texture);
    Case {
        brings: &[TEXTURES, &["G-buffer layers", "gbuffer.textures", "light.stored_layers"]],
        ..Case::new("material layers", NONE, ball(metal(0.5), None), with)
    }
    .check();

    let mut with = ball(metal(0.5), Some(metal(0.5)));
    let texture = one_colour(&mut with, [9, 9, 9, 9]);
    with.0.materials[2].specular_color_texture = Some(texture);
    Case {
        brings: &[TEXTURES, LOBE_TARGET, &["gbuffer.textures"]],
        ..Case::new("textures of lobes", NONE, ball(metal(0.5), None), with)
    }
    .check();
    for (lobe, name, below) in
        [(IRIDESCENCE, "iridescence", metal(0.5)), (DIFFUSE_TRANSMISSION, "diffuse transmission", chalk())]
    {
        let mut with = below.clone();
        with.lobes[lobe].factors = [1.0, 1.3, 100.0, 300.0];
        Case { brings: &[&["light.lobes_seen"]], ..Case::hidden(name, NONE, below, with) }.check();
    }
    let mut brushed = metal(0.5);
    brushed.lobes[ANISOTROPY].factors = [1.0, 0.0, 0.0, 0.0];
    Case {
        brings: &[LOBE_TARGET, &["light.lobes_seen", "gbuffer.anisotropic"]],
        ..Case::hidden("anisotropy", NONE, metal(0.5), brushed)
    }
    .check();

    let gold = Material { conductor: Some([[0.2, 3.1]; 3]), ..metal(0.5) };
    Case { brings: &[&["light.conductors"]], ..Case::hidden("conductors with n and kappa", NONE, metal(0.5), gold) }
        .check();
}

#[test]
fn what_lets_light_through_brings_its_passes() {
    Case {
        brings: &[
            HIERARCHY,
            TILES,
            &["[reflection and refraction]", "interact", "light.stored_transmission", "light.mirror_rays"],
        ],
        ..Case::hidden("refraction", NONE, metal(0.5), glass())
    }
    .check();
    let screen = &["refraction=screen", "reflection=screen"];
    Case { choices: screen, brings: &[FRAGMENTS, SCREEN], ..Case::hidden("refraction", NONE, metal(0.5), glass()) }
        .check();
    let veil = Material { base_color: [1.0, 1.0, 1.0, 0.5], alpha_mode: AlphaMode::Blend, ..metal(0.5) };
    Case { brings: &[FRAGMENTS], ..Case::hidden("order-independent transparency", NONE, metal(0.5), veil) }.check();
}

#[test]
fn media_bring_their_code() {
    let fog = SigmaGrid::new([2, 2, 2], vec![0.1; 8], None).expect("a grid");
    let fog = Material { sigma: Some(Arc::new(fog)), ..glass() };
    let tinted = || Material { attenuation_color: [0.5; 3], attenuation_distance: 0.1, ..glass() };
    let march = Case::new("heterogeneous media", NONE, ball(metal(0.5), Some(tinted())), ball(metal(0.5), Some(fog)));
    Case { choices: &["absorption=march:4"], brings: &[&["grids of sigma", "interact.march_steps"]], ..march }.check();
    let absorbs = Case::new("absorption", NONE, ball(metal(0.5), Some(glass())), ball(metal(0.5), Some(tinted())));
    Case { brings: &[&["interact.absorption"]], ..absorbs }.check();
    let slabs = |gap: f64| {
        let mut made = ball(metal(0.5), Some(glass()));
        made.add(Shape::cuboid(DVec3::splat(0.1)), glass(), at(0.1 + gap, 0.0, 0.0));
        made
    };
    let reason = "no transparent mesh touches another surface";
    Case {
        brings: &[&["interact.coincident_interfaces"]],
        ..Case::new("coincident interfaces", reason, slabs(0.01), slabs(0.0))
    }
    .check();
}

/// What ambient occlusion brings to a scene without lights and mirrors, with its environment.
const OF_OCCLUSION: &[&[&str]] = &[
    &[
        "BVH nodes",
        "BVH triangles",
        "corners for rays",
        "leaf places",
        "[reset work counts]",
        "work counts",
        "work counts for the host",
    ],
    &["G-buffer triangles"],
    &["environment", "background.sky"],
    &["[ambient occlusion]", "ambient", "sky directions"],
];

#[test]
fn light_from_all_around_is_there_where_it_is_seen() {
    let scatters = "no visible material scatters light";
    Case { brings: &[&["light.ambient"]], ..Case::hidden("ambient light", scatters, metal(0.5), chalk()) }.check();
    let mirrors = "no visible material has specular reflection";
    Case {
        brings: &[&["prefiltered environment", "light.reflection"]],
        ..Case::hidden("environment reflection", mirrors, chalk(), metal(0.5))
    }
    .check();
    // What is made of glass that bends nothing mirrors nothing.
    let air = Material { ior: 1.0, specular: 1.0, ..chalk() };
    Case {
        brings: &[&["prefiltered environment", "light.reflection"]],
        ..Case::hidden("environment reflection", mirrors, air, metal(0.5))
    }
    .check();
    let glow = || ball(Material { emissive: [0.5; 3], ..chalk() }, None);
    let occluded = Case::new("ambient occlusion", "there is no environment", glow(), glow());
    Case {
        environments: [None, Some(Environment::studio())],
        choices: &["indirect=occlusion:4"],
        same: false,
        brings: OF_OCCLUSION,
        ..occluded
    }
    .check();
    let around =
        Case::new("environment", "there is no environment", ball(unlit([0.5; 3]), None), ball(unlit([0.5; 3]), None));
    Case {
        environments: [None, Some(Environment::studio())],
        same: false,
        brings: &[&["environment", "background.sky"]],
        ..around
    }
    .check();
    let even = "the environment is the same in all directions";
    let prefiltered = Case::new("prefiltered environment", even, ball(metal(0.5), None), ball(metal(0.5), None));
    let environments = [Some(Environment::constant([0.3, 0.4, 0.5])), Some(Environment::studio())];
    let [without, with] = Case { environments, same: false, brings: &[], ..prefiltered }.check();
    let bytes = |drawn: &Drawn| drawn.objects["prefiltered environment"];
    assert!(bytes(&without) < 1000 && bytes(&with) > 1_000_000, "{}, {}", bytes(&without), bytes(&with));
}

/// The scene calls for path guiding, so its buffers exist; no photon reaches the hidden mirror, so they hold no sphere.
#[test]
fn path_guiding_brings_its_tables() {
    Case {
        choices: &["indirect=path", "lights=area:1", "guiding=photons"],
        brings: &[&["guiding spheres", "guiding cells", "path.path_guiding"]],
        ..Case::hidden("path guiding", NONE, chalk(), metal(0.0))
    }
    .check();
}

/// Photons fly towards the hidden mirror, and none arrives there.
#[test]
fn caustics_bring_photons_and_their_map() {
    let effect = "caustics of punctual lights";
    let light = LightKind::Directional { direction: DVec3::NEG_Z };
    let mut case = Case {
        choices: &["indirect=path", "caustics=photons:16384"],
        brings: &[
            &["rays of photons", "landings of photons", "photon map"],
            &["[photons]", "trace_photons", "path.photon_map"],
        ],
        ..Case::hidden(effect, NONE, metal(0.3), metal(0.0))
    };
    case.scenes.iter_mut().for_each(|made| made.light([1.0; 3], light));
    case.check();
    // Glass that bends nothing deflects nothing.
    let mut air = ball(chalk(), Some(Material { ior: 1.0, specular: 1.0, roughness: 0.0, ..glass() }));
    air.light([1.0; 3], light);
    assert_eq!(state(&draw(&air.0, None, &["indirect=path", "caustics=photons:16384"]).plan, effect).0, "not needed");
}

#[test]
fn mirrors_bring_rays_and_rays_what_they_may_meet() {
    Case {
        brings: &[HIERARCHY, TILES, &["[reflection and refraction]", "interact", "light.mirror_rays"]],
        ..Case::hidden("reflection", NONE, metal(0.5), metal(0.0))
    }
    .check();
    let screen = &["reflection=screen"];
    Case {
        choices: screen,
        brings: &[TILES, SCREEN, &["[screen-space reflection]", "mirror"]],
        ..Case::hidden("reflection", NONE, metal(0.5), metal(0.0))
    }
    .check();
    Case { brings: &[&["interact.rough"]], ..Case::hidden("glossy reflection", NONE, metal(0.0), metal(0.1)) }.check();
    let holes = Material { base_color: [1.0, 1.0, 1.0, 0.5], alpha_mode: AlphaMode::Mask(0.5), ..metal(0.5) };
    Case {
        brings: &[&["gbuffer.masked", "interact.masked_hits"]],
        ..Case::hidden("alpha test in rays", NONE, metal(0.0), holes)
    }
    .check();
    let sheet = Material { thickness: 0.0, ..glass() };
    let off = &["refraction=off"];
    Case {
        choices: off,
        brings: &[FRAGMENTS, &["interact.transmissive"]],
        ..Case::hidden("transmissive hits", NONE, metal(0.0), sheet)
    }
    .check();
}

#[test]
fn lights_are_there_where_something_is_lit() {
    let lamp = LightKind::Point { position: DVec3::new(1.0, 2.0, 3.0), range: Some(10.0) };
    let lit = |mut made: Made, count: usize| {
        (0..count).for_each(|_| made.light([10.0 / count as f32; 3], lamp));
        made
    };
    let dark = || [None, None];
    let gray = || unlit([0.5, 0.6, 0.7]);
    let reason = "all visible materials are unlit";
    let scenes = || [lit(ball(gray(), None), 1), lit(ball(gray(), Some(chalk())), 1)];
    let [without, with] = scenes();
    let off = &["shadows=off"];
    Case {
        environments: dark(),
        choices: off,
        brings: &[&["lights", "light.local_lights"]],
        ..Case::new("punctual lights", reason, without, with)
    }
    .check();
    let [without, with] = scenes();
    Case {
        environments: dark(),
        brings: &[
            HIERARCHY,
            &["lights", "light.stored_triangles", "light.local_lights", "light.octants", "light.shadows"],
        ],
        ..Case::new("shadows", reason, without, with)
    }
    .check();
    let [without, with] = scenes();
    let map = &["shadows=map"];
    Case {
        environments: dark(),
        choices: map,
        brings: &[&[
            "instances around the scene",
            "lights",
            "shadow maps",
            "[shadow maps]",
            "light.local_lights",
            "light.shadows",
            "shadow_map",
        ]],
        ..Case::new("shadows", reason, without, with)
    }
    .check();
    let sheet = |roughness| Material { thickness: 0.0, roughness, ..glass() };
    let (without, with) = ([0.0, 0.1]).map(|roughness| lit(ball(chalk(), Some(sheet(roughness))), 1)).into();
    Case {
        environments: dark(),
        brings: &[&["interact.rough", "interact.rough_transmission", "light.rough_transmission"]],
        ..Case::new("rough transmission", NONE, without, with)
    }
    .check();
    let veil = Material { base_color: [1.0, 1.0, 1.0, 0.5], alpha_mode: AlphaMode::Blend, ..chalk() };
    let (without, with) = (lit(ball(chalk(), None), 1), lit(ball(chalk(), Some(veil)), 1));
    Case {
        environments: dark(),
        brings: &[FRAGMENTS, &["light.filters"]],
        ..Case::new("transparent shadows", NONE, without, with)
    }
    .check();
    let (without, with) = (lit(ball(chalk(), None), 15), lit(ball(chalk(), None), 16));
    let lists = Case::new("tiled light culling", "there are too few point and spot lights", without, with);
    Case {
        environments: dark(),
        same: false,
        brings: &[&[
            "tile depths",
            "tile light masks",
            "[tiled light culling]",
            "[tile depths]",
            "light.local_lights",
            "light.tile_words",
            "tile_depth",
            "tiles",
        ]],
        ..lists
    }
    .check();
}

/// The hierarchy lies in the table of emitters, which then has one bin for all lights that have a place.
#[test]
fn the_light_hierarchy_brings_its_nodes() {
    let lit = |count: usize, kind: LightKind| {
        let mut made = ball(chalk(), None);
        (0..count).for_each(|_| made.light([10.0 / count as f32; 3], kind));
        made
    };
    let lamp = LightKind::Point { position: DVec3::new(1.0, 2.0, 3.0), range: None };
    let reason = "too few lights and emissive triangles have a place";
    let paths = &["indirect=path", "light-sampler=hierarchy"];
    let case = Case::new("light hierarchy", reason, lit(2, lamp), lit(3, lamp));
    let brings: &[&[&str]] =
        &[&["path.emitters", "path.emitter_search_steps", "path.light_hierarchy", "path.light_nodes"]];
    let emitters = |drawn: &Drawn, other: &Drawn| drawn.objects["BVH triangles"] - other.objects["BVH triangles"];
    let one = draw(&lit(1, lamp).0, None, paths);
    let [without, with] = Case { environments: [None, None], choices: paths, brings, same: false, ..case }.check();
    // Emitters of 16 bytes and nodes of 32: two emitters; the bin, three emitters and five nodes.
    // Tables of GPUs have sizes of their own.
    let sizes_are_known = Gpu::open().device.is_software();
    if sizes_are_known {
        assert_eq!([&without, &with].map(|drawn| emitters(drawn, &one) + 16), [2 * 16, 4 * 16 + 5 * 32]);
    }
    // Where it is a knob's choice, and not of the lights that have no place.
    let switched_off = draw(&lit(3, lamp).0, None, &["indirect=path", "light-sampler=power"]);
    assert_eq!(state(&switched_off.plan, "light hierarchy"), ("switched off", "light-sampler=power".to_owned()));
    assert!(!sizes_are_known || emitters(&switched_off, &one) + 16 == 3 * 16);
    let sun = LightKind::Directional { direction: DVec3::NEG_Y };
    assert_eq!(state(&draw(&lit(3, sun).0, None, paths).plan, "light hierarchy"), ("not needed", reason.to_owned()));
    let apart = draw(&lit(3, lamp).0, None, &["indirect=ambient"]);
    assert_eq!(state(&apart.plan, "light hierarchy"), ("not needed", "no lights are sampled".to_owned()));
}

/// Emissive surfaces as lights: their table lies behind the triangles of the BVH.
#[test]
fn lights_with_an_extent_bring_rays_and_samples() {
    let lit = |glows: f32| {
        let glowing =
            Material { emissive: [glows; 3], base_color: [0.0, 0.0, 0.0, 1.0], specular: 0.0, ..Material::default() };
        let mut made = ball(chalk(), None);
        made.add(Shape::panel(1.0, 1.0), glowing, at(0.0, 0.0, 5.0));
        made
    };
    let [without, with] = Case {
        choices: &["lights=area:4"],
        brings: &[
            HIERARCHY,
            &["light.emissive_triangles", "light.emitters", "light.emitter_search_steps", "light.light_samples"],
            &["light.octants", "light.shadows", "light.stored_triangles"],
        ],
        environments: [Some(Environment::studio()), Some(Environment::studio())],
        same: false,
        ..Case::new("emissive surfaces as lights", NONE, lit(0.0), lit(2.0))
    }
    .check();
    assert_eq!([&without, &with].map(|drawn| drawn.plan.light_samples.count), [0, 4]);
}

/// Neither mirrors nor scattered light are needed for what is seen through glass: all that enters a ball leaves it,
/// which at the middle is 1 − F0 of a white environment; the rest is mirrored.
#[test]
fn glass_shows_the_environment_whatever_surfaces_do() {
    let environment = Environment::constant([1.0; 3]);
    let glass = Material { transmission: 1.0, thickness: 1.0, roughness: 0.0, ior: 1.5, ..Material::default() };
    let mut made = Made::new("glass");
    made.add(Shape::sphere(1.0, 32), Material { metallic: 0.0, ..glass }, at(0.0, 0.0, 0.0));
    made.camera(DVec3::Z * 10.0, DVec3::ZERO, orthographic(1.5));
    for choices in [&["reflection=off"][..], &["reflection=off", "indirect=off"], &["indirect=off"]] {
        let drawn = draw(&made.0, Some(&environment), choices);
        let middle = drawn.film.rgba[(SIZE[1] / 2 * SIZE[0] + SIZE[0] / 2) as usize];
        let expected = if choices.contains(&"reflection=off") { 0.96 } else { 1.0 };
        assert!((middle[0] - expected).abs() < 1e-4, "{choices:?}: {middle:?}");
    }
}

/// What has a black texture for a factor is drawn as if the factor were 0, with a plan as if there were neither.
#[test]
fn black_textures_call_for_nothing() {
    let environment = Environment::studio();
    let plain = Material { base_color: [0.5, 0.6, 0.7, 1.0], roughness: 0.6, metallic: 0.0, ..Material::default() };
    type Change = fn(&mut Material, TextureRef);
    let changes: [(&str, [u8; 4], Change); 4] = [
        ("emissive textures", [0, 0, 0, 255], |m, t| (m.emissive, m.emissive_texture) = ([5.0; 3], Some(t))),
        ("refraction", [0, 255, 255, 255], |m, t| (m.transmission, m.transmission_texture) = (1.0, Some(t))),
        ("clear coat", [0, 255, 255, 255], |m, t| (m.clearcoat, m.clearcoat_texture) = (1.0, Some(t))),
        ("reflection", [255, 255, 0, 255], |m, t| {
            (m.metallic, m.specular, m.metallic_roughness_texture) = (1.0, 0.0, Some(t));
        }),
    ];
    for (effect, texel, change) in changes {
        let drawn = |texel: Option<[u8; 4]>| {
            let mut made = ball(plain.clone(), None);
            let texture = one_colour(&mut made, texel.unwrap_or([255; 4]));
            for material in &mut made.0.materials {
                change(material, texture);
                if texel.is_none() {
                    // The same material by its factors.
                    *material = plain_of(material);
                }
            }
            draw(&made.0, Some(&environment), &[])
        };
        let (black, without) = (drawn(Some(texel)), drawn(None));
        assert_eq!(state(&without.plan, effect).0, "not needed", "{effect}");
        assert_eq!(state(&black.plan, effect).0, "not needed", "{effect}");
        assert!(bits(&black.film) == bits(&without.film), "{effect}: the pictures differ");
    }
}

/// Without what its textures multiply.
fn plain_of(material: &Material) -> Material {
    Material {
        emissive: [0.0; 3],
        emissive_texture: None,
        transmission: 0.0,
        transmission_texture: None,
        clearcoat: 0.0,
        clearcoat_texture: None,
        metallic: 0.0,
        metallic_roughness_texture: None,
        ..material.clone()
    }
}

#[test]
fn dark_lights_are_no_lights() {
    let lamp = |x| LightKind::Point { position: DVec3::new(x, 2.0, 3.0), range: None };
    let mut lit = ball(lambert([0.5; 3]), None);
    lit.light([10.0; 3], lamp(1.0));
    let alone = draw(&lit.0, None, &[]);
    lit.light([0.0; 3], lamp(-1.0));
    let both = draw(&lit.0, None, &[]);
    assert!(bits(&alone.film) == bits(&both.film));
    assert_eq!((alone.plan.local_lights, both.plan.local_lights), (1, 1));
    let effect = both.plan.effects.iter().find(|effect| effect.id.name() == "shadows").expect("an effect");
    assert_eq!(effect.evidence["dark"], "1");

    let mut dark = ball(lambert([0.5; 3]), None);
    dark.light([0.0; 3], lamp(1.0));
    let dark = draw(&dark.0, None, &[]);
    assert_eq!(state(&dark.plan, "shadows"), ("not needed", "all lights have zero intensity".to_owned()));
    assert!(dark.plan.rays.is_none());
    assert!(dark.film.rgba.iter().all(|pixel| pixel[..3] == [0.0; 3]));
}

/// Lights that reach nothing are no lights, like dark ones.
#[test]
fn lights_out_of_range_are_no_lights() {
    let lamp = |x, range| LightKind::Point { position: DVec3::new(x, 0.0, 0.0), range: Some(range) };
    let near = |made: &mut Made| made.light([10.0; 3], lamp(3.0, 10.0));
    let mut alone = ball(chalk(), None);
    near(&mut alone);
    let mut both = ball(chalk(), None);
    near(&mut both);
    // The scene reaches from -1 to 1.3 along x.
    both.light([10.0; 3], lamp(-12.0, 10.9));
    let [alone, both] = [alone, both].map(|made| draw(&made.0, None, &[]));
    assert_eq!((alone.plan.local_lights, both.plan.local_lights), (1, 1));
    assert!(bits(&alone.film) == bits(&both.film));
    let shadows = both.plan.effects.iter().find(|effect| effect.id.name() == "shadows").expect("an effect");
    assert_eq!(shadows.evidence["out of range"], "1");

    let mut far = ball(chalk(), None);
    far.light([10.0; 3], lamp(-12.0, 10.9));
    let far = draw(&far.0, None, &[]);
    assert_eq!(state(&far.plan, "shadows"), ("not needed", "no light reaches the scene".to_owned()));
    assert!(far.plan.rays.is_none());
    // As far as it says, and a little more, it is one.
    let mut touching = ball(chalk(), None);
    touching.light([10.0; 3], lamp(-12.0, 11.1));
    assert_eq!(draw(&touching.0, None, &[]).plan.local_lights, 1);

    // Nor do they call for bands of wavelengths, samples of areas or a hierarchy of lights.
    let mut grey = Made::new("grey");
    grey.add(Shape::sphere(1.0, 16), lambert([0.5; 3]), at(0.0, 0.0, 0.0));
    grey.camera(DVec3::Z * 10.0, DVec3::ZERO, orthographic(1.5));
    let with = |x, range| {
        let mut made = grey.0.clone();
        made.lights.extend((0..3).map(|_| Light {
            name: "red".to_owned(),
            color: [10.0, 1.0, 1.0],
            spectrum: None,
            extent: Some(Extent::Sphere { radius: 0.1 }),
            kind: lamp(x, range),
            proxy: false,
        }));
        let plan = draw(&made, None, &["lights=area:4", "colour=spectral:8"]).plan;
        ["spectral rendering", "analytic area lights", "light hierarchy"].map(|name| state(&plan, name).0)
    };
    assert_eq!(with(-12.0, 10.9), ["not needed"; 3]);
    assert_eq!(with(3.0, 10.0), ["used"; 3]);
}

/// A texture without colour needs no bands, as a base colour and as emission.
#[test]
fn grey_textures_call_for_no_bands() {
    for (rgba, expected) in [([90, 90, 90, 255], "not needed"), ([90, 90, 91, 255], "used")] {
        let mut made = Made::new("grey");
        let texture = Some(one_colour(&mut made, rgba));
        let painted = Material {
            base_color_texture: texture,
            emissive_texture: texture,
            emissive: [0.5; 3],
            ..lambert([0.5; 3])
        };
        let sphere = Shape::sphere(1.0, 16);
        made.add(sphere, painted, at(0.0, 0.0, 0.0));
        made.camera(DVec3::Z * 10.0, DVec3::ZERO, orthographic(1.5));
        let plan = draw(&made.0, None, &["colour=spectral:8"]).plan;
        let (state, reason) = state(&plan, "spectral rendering");
        assert_eq!(state, expected, "{rgba:?}: {reason}");
    }
}

/// What alpha says by its values: a surface that blends with an alpha of 1 is planned and drawn as an opaque one, one
/// with 0 as none.
#[test]
fn alpha_calls_for_what_it_does() {
    let environment = Environment::studio();
    let hidden = |alpha_mode, alpha: f32| {
        let mut made = ball(metal(0.0), None);
        let material = Material { alpha_mode, base_color: [0.8, 0.5, 0.3, alpha], ..metal(0.6) };
        made.add(Shape::cuboid(DVec3::splat(0.6)), material, at(-0.8, 0.7, 1.0));
        made
    };
    let drawn = |mode, alpha| draw(&hidden(mode, alpha).0, Some(&environment), &[]);
    let (blended, masked, opaque) =
        (drawn(AlphaMode::Blend, 1.0), drawn(AlphaMode::Mask(0.5), 1.0), drawn(AlphaMode::Opaque, 1.0));
    for same in [&blended, &masked] {
        assert!(came(&opaque, same).is_empty() && came(same, &opaque).is_empty());
        assert!(bits(&same.film) == bits(&opaque.film));
    }
    let transparency =
        blended.plan.effects.iter().find(|effect| effect.id.name() == "order-independent transparency").expect("one");
    assert_eq!(transparency.evidence.get("alpha 1 everywhere").map(String::as_str), Some("default"));

    let none = draw(&ball(metal(0.0), None).0, Some(&environment), &[]);
    for (mode, alpha) in [(AlphaMode::Blend, 0.0), (AlphaMode::Mask(0.5), 0.4)] {
        let unseen = drawn(mode, alpha);
        assert!(came(&none, &unseen).is_empty(), "{:?}", came(&none, &unseen));
        assert!(bits(&unseen.film) == bits(&none.film));
    }
    let veil = drawn(AlphaMode::Blend, 0.5);
    assert!(bits(&veil.film) != bits(&opaque.film) && veil.plan.transparency);
}

#[test]
fn rungs_name_statements_that_there_are() {
    for knob in etalon::plan::KNOBS {
        for id in knob.lecture {
            assert!(etalon::lecture::statement(id).is_some_and(|text| text.len() > 20), "{}: {id}", knob.name);
        }
    }
    assert_eq!(etalon::lecture::statement("Z9"), None);
    assert_eq!(etalon::lecture::functions("F5"), ["fresnel_dielectric", "refract"]);
    assert!(etalon::lecture::functions("R5").is_empty(), "visibility is no formula");
}
