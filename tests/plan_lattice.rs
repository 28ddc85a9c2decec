//! Every plan once: tiny scenes for all ways in which lights are looked for, surfaces mirror and let light through, and
//! everything else so spread over them that any two things meet. Each is drawn under core and synchronization
//! validation.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::{Arc, OnceLock};

use etalon::frame::{Background, Part, Renderer, Settings};
use etalon::gpu::Compiled;
use etalon::image::Picture;
use etalon::optics::SplitMix64;
use etalon::plan::{EffectState, Facts, ForcedEffects, Knobs, Plan, Surroundings};
use etalon::scene::canonical::canonicalise;
use etalon::scene::environment::Environment;
use etalon::scene::lobe::{ANISOTROPY, DIFFUSE_TRANSMISSION, IRIDESCENCE, SHEEN};
use etalon::scene::material::{Sampler, TextureRef};
use etalon::scene::prune::prune_unused;
use etalon::scene::{AlphaMode, AmbientLight, Camera, Image, LightKind, Material, Prune, SigmaGrid};
use etalon::study::shape::Shape;
use etalon::upload::rays::Traversal;
use etalon_testing::gpu::{Gpu, bits};
use etalon_testing::made::{Made, at, lambert, orthographic, perspective, unlit};
use glam::DVec3;

const SIZE: [u32; 2] = [16, 16];

/// The ways through a frame: their product is the list of passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Ways {
    shadows: &'static str,
    mirrors: &'static str,
    transmission: &'static str,
    blended: bool,
    listed: bool,
}

const SHADOWS: [&str; 3] = ["off", "map", "ray"];
const MIRRORS: [&str; 3] = ["off", "screen", "ray"];
const TRANSMISSION: [&str; 4] = ["none", "off", "screen", "ray"];

fn all_ways() -> Vec<Ways> {
    let mut all = Vec::new();
    for shadows in SHADOWS {
        for mirrors in MIRRORS {
            for transmission in TRANSMISSION {
                for (blended, listed) in [(false, false), (false, true), (true, false), (true, true)] {
                    all.push(Ways { shadows, mirrors, transmission, blended, listed });
                }
            }
        }
    }
    all
}

impl Ways {
    /// What a plan says of them.
    fn of(plan: &Plan) -> Self {
        let rays = plan.rays.unwrap_or_default();
        let effect = |name: &str| plan.effects.iter().find(|effect| effect.id.name() == name).expect("an effect");
        let pick =
            |cases: &[(bool, &'static str)], otherwise| cases.iter().find(|(is, _)| *is).map_or(otherwise, |c| c.1);
        let transmits = effect("refraction").state != EffectState::NotCalledFor;
        Self {
            shadows: pick(&[(plan.shadow_maps, "map"), (rays.shadows, "ray")], "off"),
            mirrors: pick(&[(plan.screen.mirrors, "screen"), (rays.mirrors, "ray")], "off"),
            transmission: pick(
                &[(plan.screen.refraction, "screen"), (rays.refraction, "ray"), (transmits, "off")],
                "none",
            ),
            blended: plan.transparency
                && (!transmits
                    || rays.refraction
                    || effect("order-independent transparency").reason().contains("veil")),
            listed: plan.tiles,
        }
    }
}

/// Something that a scene, a knob or a setting may have more than one of.
struct Factor {
    name: &'static str,
    levels: &'static [&'static str],
}

/// Each level of the knobs among them is set as it is; the others are things in the scene.
const FACTORS: &[Factor] = &[
    // The rung of `reflection` where nothing mirrors what is near.
    Factor { name: "far mirrors", levels: &["environment", "off"] },
    Factor { name: "samples", levels: &["1", "4"] },
    Factor { name: "fresnel", levels: &["schlick", "exact"] },
    Factor { name: "brdf", levels: &["blinn-phong", "blinn-phong-reciprocal", "ggx", "ggx-multi"] },
    Factor { name: "lobes", levels: &["0.2", "1"] },
    Factor { name: "interfaces", levels: &["1", "8"] },
    Factor { name: "absorption", levels: &["off", "thickness", "path", "march:4"] },
    Factor { name: "quadrature", levels: &["left", "midpoint", "simpson"] },
    Factor { name: "indirect", levels: &["off", "ambient", "occlusion:4"] },
    Factor { name: "lights", levels: &["points", "area:4"] },
    Factor { name: "arithmetic", levels: &["fast", "stable", "compensated"] },
    Factor { name: "environment", levels: &["none", "constant", "studio"] },
    Factor { name: "background", levels: &["default", "transparent"] },
    Factor { name: "traversal", levels: &["links16", "links32", "stack"] },
    Factor { name: "projection", levels: &["perspective", "orthographic"] },
    Factor { name: "parts", levels: &["none", "both"] },
    Factor { name: "emissive texture", levels: &["no", "yes"] },
    Factor { name: "layers", levels: &["no", "yes"] },
    Factor { name: "coat", levels: &["no", "yes"] },
    Factor { name: "cloth", levels: &["no", "yes"] },
    Factor { name: "brushed", levels: &["no", "yes"] },
    Factor { name: "film", levels: &["no", "yes"] },
    Factor { name: "leaf", levels: &["no", "yes"] },
    Factor { name: "specular colours", levels: &["no", "yes"] },
    Factor { name: "metal", levels: &["none", "colour", "n and kappa"] },
    Factor { name: "holes", levels: &["no", "yes"] },
    Factor { name: "bent normals", levels: &["no", "yes"] },
    Factor { name: "vertex colours", levels: &["no", "yes"] },
    Factor { name: "medium", levels: &["clear", "tinted", "grid"] },
    Factor { name: "bodies", levels: &["apart", "touch", "nested"] },
    Factor { name: "glass", levels: &["smooth", "rough"] },
    Factor { name: "eye", levels: &["outside", "in glass"] },
    Factor { name: "chalk", levels: &["no", "yes"] },
];

const OF_GLASS: [&str; 4] = ["medium", "bodies", "glass", "eye"];

/// A level of each factor.
type Choice = Vec<usize>;

fn level(choice: &Choice, name: &str) -> &'static str {
    let index = FACTORS.iter().position(|factor| factor.name == name).expect("a factor");
    FACTORS[index].levels[choice[index]]
}

/// Pairs of levels of two factors, and of a factor and a way.
fn pairs(ways: &Ways, choice: &Choice) -> BTreeSet<String> {
    let named = |i: usize| format!("{}={}", FACTORS[i].name, FACTORS[i].levels[choice[i]]);
    // What glass is like is nothing where there is none.
    let there = |i: usize| ways.transmission != "none" || !OF_GLASS.contains(&FACTORS[i].name);
    let mut all = BTreeSet::new();
    for i in (0..choice.len()).filter(|&i| there(i)) {
        for j in (i + 1..choice.len()).filter(|&j| there(j)) {
            all.insert(format!("{} {}", named(i), named(j)));
        }
        for way in [
            format!("shadows={}", ways.shadows),
            format!("mirrors={}", ways.mirrors),
            format!("transmission={}", ways.transmission),
            format!("blended={}", ways.blended),
            format!("listed={}", ways.listed),
        ] {
            all.insert(format!("{way} {}", named(i)));
        }
    }
    all
}

/// Of any two effects, which are kept.
fn effect_pairs(plan: &Plan) -> BTreeSet<String> {
    let kept =
        |name: &str| plan.effects.iter().any(|effect| effect.id.name() == name && effect.state == EffectState::Kept);
    let states: Vec<String> = NAMES.iter().map(|name| format!("({name}: {})", kept(name))).collect();
    let pair = |i: usize| states[i + 1..].iter().map(move |b| (i, b));
    (0..states.len()).flat_map(pair).map(|(i, b)| format!("{} {b}", states[i])).collect()
}

/// Levels for all ways, chosen once (2 s) among a few random ones for the most pairs that are new.
fn spread() -> &'static [(Ways, Choice)] {
    static SPREAD: OnceLock<Vec<(Ways, Choice)>> = OnceLock::new();
    SPREAD.get_or_init(chosen)
}

fn chosen() -> Vec<(Ways, Choice)> {
    let mut random = SplitMix64::new(5);
    let mut seen = BTreeSet::new();
    let mut all = Vec::new();
    for ways in all_ways() {
        let mut candidate = || -> Choice {
            FACTORS.iter().map(|factor| (random.unit() * factor.levels.len() as f64) as usize).collect()
        };
        let all_pairs = |choice: &Choice| {
            let mut all = pairs(&ways, choice);
            all.extend(effect_pairs(&planned(&ways, choice, knobs(&ways, choice))));
            all
        };
        let best = (0..24).map(|_| candidate()).max_by_key(|choice| all_pairs(choice).difference(&seen).count());
        let best = best.expect("a candidate");
        seen.extend(all_pairs(&best));
        all.push((ways, best));
    }
    all
}

fn scene(ways: &Ways, choice: &Choice) -> Made {
    let is = |name: &str, wanted: &str| level(choice, name) == wanted;
    let mut made = Made::new("lattice");
    made.0.images.push(Image {
        name: "texels".to_owned(),
        width: 4,
        height: 4,
        rgba: (0..64).map(|i| i * 4 + 3).collect(),
    });
    let texture =
        TextureRef { image: 0, uv_set: 0, uv_transform: glam::Affine2::IDENTITY, sampler: Sampler::default() };
    let place = |i: usize| at(0.5 * (i % 5) as f64 - 1.0, 0.45 * (i / 5) as f64 - 0.9, 0.0);
    let mut next = 0;
    let mut add = |made: &mut Made, name: &str, material: Material| {
        made.add(Shape::sphere(0.2, 6), Material { name: name.to_owned(), ..material }, place(next));
        next += 1;
    };
    // Unlit where nothing else is called for, so that each thing comes with its own surface.
    made.add(Shape::panel(4.0, 4.0), unlit([0.3, 0.4, 0.5]), at(0.0, 0.0, -1.5));
    let rough = Material { metallic: 0.0, roughness: 0.9, ..Material::default() };
    add(&mut made, "lit", rough.clone());
    if ways.mirrors != "off" {
        add(&mut made, "mirror", Material { metallic: 1.0, roughness: 0.05, ..Material::default() });
    }
    if ways.blended {
        let veil = Material { base_color: [0.2, 0.9, 0.3, 0.5], alpha_mode: AlphaMode::Blend, ..rough.clone() };
        // First among the transparent ones.
        made.0.materials.insert(0, Material { name: "veil".to_owned(), ..veil });
        made.0.meshes.iter_mut().for_each(|mesh| mesh.material += 1);
        let mesh = made.mesh(Shape::panel(1.0, 1.0), rough.clone());
        made.0.materials.pop();
        made.0.meshes[mesh].material = 0;
        made.place(mesh, at(0.0, 0.0, 0.6));
    }
    if ways.transmission != "none" {
        let sigma = SigmaGrid::new([2, 2, 2], (0..24).map(|i| 0.1 * i as f32).collect(), None).expect("a grid");
        let tinted = is("medium", "tinted");
        let glass = Material {
            name: "glass".to_owned(),
            metallic: 0.0,
            roughness: if is("glass", "rough") { 0.3 } else { 0.0 },
            transmission: 0.9,
            thickness: 0.3,
            ior: 1.4,
            attenuation_color: if tinted { [0.5, 0.7, 0.9] } else { [1.0; 3] },
            attenuation_distance: if tinted { 0.2 } else { f32::INFINITY },
            sigma: is("medium", "grid").then(|| Arc::new(sigma)),
            ..Material::default()
        };
        let cube = |size: f64| Shape::cuboid(DVec3::splat(size));
        made.add(cube(0.4), glass.clone(), at(-0.5, 0.8, 0.3));
        let other = match level(choice, "bodies") {
            "touch" => (0.4, -0.1),
            "nested" => (0.2, -0.5),
            _ => (0.3, 0.5),
        };
        made.add(cube(other.0), Material { ior: 1.2, priority: 1, ..glass.clone() }, at(other.1, 0.8, 0.3));
        if is("eye", "in glass") {
            made.add(cube(0.5), glass, at(0.0, 0.0, 3.0));
        }
    }
    if is("emissive texture", "yes") {
        add(&mut made, "lamp", Material { emissive: [1.0; 3], emissive_texture: Some(texture), ..unlit([0.5; 3]) });
        made.0.materials.last_mut().expect("a material").unlit = false;
    }
    if is("layers", "yes") {
        add(&mut made, "layered", Material { specular_texture: Some(texture), ..rough.clone() });
    }
    if is("coat", "yes") {
        add(&mut made, "coated", Material { clearcoat: 1.0, clearcoat_roughness: 0.9, ..rough.clone() });
    }
    if is("cloth", "yes") {
        let mut cloth = rough.clone();
        cloth.lobes[SHEEN].factors = [0.8, 0.6, 0.9, 0.5];
        add(&mut made, "cloth", cloth);
    }
    if is("brushed", "yes") {
        let mut brushed = Material { metallic: 1.0, ..rough.clone() };
        brushed.lobes[ANISOTROPY].factors = [0.7, 0.4, 0.0, 0.0];
        add(&mut made, "brushed", brushed);
        let mesh = made.0.meshes.last_mut().expect("a mesh");
        mesh.tangents = vec![[1.0, 0.0, 0.0, 1.0]; mesh.positions.len()].into();
    }
    if is("film", "yes") {
        let mut film = rough.clone();
        film.lobes[IRIDESCENCE].factors = [0.9, 1.4, 100.0, 350.0];
        add(&mut made, "film", film);
    }
    if is("leaf", "yes") {
        let mut leaf = rough.clone();
        leaf.lobes[DIFFUSE_TRANSMISSION].factors = [0.5, 0.3, 0.9, 0.2];
        add(&mut made, "leaf", leaf);
    }
    if is("specular colours", "yes") {
        add(&mut made, "coloured gloss", Material { specular_color_texture: Some(texture), ..rough.clone() });
    }
    if !is("metal", "none") {
        let conductor = is("metal", "n and kappa").then_some([[0.2, 3.1], [0.4, 2.4], [1.4, 1.9]]);
        add(&mut made, "metal", Material { metallic: 1.0, roughness: 0.9, conductor, ..Material::default() });
    }
    if is("holes", "yes") {
        let holes = Material { alpha_mode: AlphaMode::Mask(0.5), base_color_texture: Some(texture), ..rough.clone() };
        add(&mut made, "holes", holes);
    }
    if is("bent normals", "yes") {
        add(&mut made, "bent", Material { normal_texture: Some(texture), ..rough.clone() });
        let mesh = made.0.meshes.last_mut().expect("a mesh");
        mesh.tangents = vec![[1.0, 0.0, 0.0, 1.0]; mesh.positions.len()].into();
    }
    if is("vertex colours", "yes") {
        add(&mut made, "coloured", rough);
        let mesh = made.0.meshes.last_mut().expect("a mesh");
        mesh.colors = mesh.positions.iter().map(|p| [p[0].abs(), 0.5, 0.5, 1.0]).collect();
    }
    if is("chalk", "yes") {
        add(&mut made, "chalk", lambert([0.7; 3]));
    }
    let lamps = if ways.listed { 16 } else { usize::from(ways.shadows != "off") };
    for i in 0..lamps {
        let position = DVec3::new(i as f64 * 0.3 - 2.0, 2.0, 2.0);
        made.light([3.0; 3], LightKind::Point { position, range: Some(6.0) });
    }
    if ways.shadows != "off" {
        made.light([1.0; 3], LightKind::Directional { direction: DVec3::new(0.3, -1.0, -0.4).normalize() });
    }
    let projection = if is("projection", "perspective") { perspective(40.0) } else { orthographic(1.3) };
    made.camera(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, projection);
    made
}

fn knobs(ways: &Ways, choice: &Choice) -> Knobs {
    let mut knobs = Knobs::default();
    let mut set = |knob: &str, rung: &str| knobs.set(&format!("{knob}={rung}")).expect("a rung");
    set("shadows", ways.shadows);
    set("reflection", if ways.mirrors == "off" { level(choice, "far mirrors") } else { ways.mirrors });
    set("refraction", if ways.transmission == "none" { "ray" } else { ways.transmission });
    for factor in FACTORS.iter().filter(|factor| etalon::plan::KNOBS.iter().any(|knob| knob.name == factor.name)) {
        set(factor.name, level(choice, factor.name));
    }
    knobs
}

/// The same with paths, which need rays for everything.
fn knobs_of_paths(ways: &Ways, choice: &Choice) -> Knobs {
    let mut knobs = knobs(ways, choice);
    // From inside glass, one surface is not enough to see anything.
    for choice in ["shadows=ray", "reflection=ray", "refraction=ray", "indirect=path", "lights=area:1", "interfaces=8"]
    {
        knobs.set(choice).expect("a rung");
    }
    knobs
}

fn traversal_of(choice: &Choice) -> Traversal {
    match level(choice, "traversal") {
        "links16" => Traversal::Links16,
        "links32" => Traversal::Links32,
        _ => Traversal::Stack,
    }
}

/// With the device's own traversal, unless one is given.
fn renderer_of(
    gpu: &Gpu,
    ways: &Ways,
    choice: &Choice,
    traversal: Option<Traversal>,
    forced: ForcedEffects,
    by_paths: bool,
) -> (Camera, Renderer) {
    let made = scene(ways, choice);
    let environment = match level(choice, "environment") {
        "none" => None,
        "constant" => Some(Environment::constant([0.4, 0.5, 0.6])),
        _ => Some(Environment::studio()),
    };
    let by_ray = |rung: &str| !by_paths && rung == "ray" && level(choice, "parts") == "both";
    let mut parts = Vec::new();
    parts.extend(by_ray(ways.mirrors).then_some(Part::Reflection));
    let of_nothing = ways.transmission == "none" && !by_paths;
    parts.extend((of_nothing || by_ray(ways.transmission)).then_some(Part::Refraction));
    let settings = Settings {
        size: SIZE,
        knobs: if by_paths { knobs_of_paths(ways, choice) } else { knobs(ways, choice) },
        background: match level(choice, "background") {
            "transparent" => Background::Transparent,
            _ => Background::Default,
        },
        traversal,
        parts,
        forced,
        ..Settings::default()
    };
    (made.0.cameras[0].clone(), gpu.renderer(&made.0, environment.as_ref(), settings))
}

/// Draws one plan of all.
fn drawn(gpu: &Gpu, ways: &Ways, choice: &Choice, forced: ForcedEffects, by_paths: bool) -> (Plan, Picture) {
    let (camera, mut renderer) = renderer_of(gpu, ways, choice, Some(traversal_of(choice)), forced, by_paths);
    let rendered = renderer.render(&camera, &mut |_| ()).expect("a picture");
    assert_eq!((rendered.counts.nan, rendered.counts.inf), (0, 0), "{ways:?} {choice:?}");
    let film = renderer.film().expect("the film");
    let seen = film.rgba.iter().filter(|pixel| pixel[0] > 0.0).count();
    assert!(seen > 50, "{ways:?} {choice:?}: {seen} pixels are lit");
    (renderer.plan().clone(), film)
}

/// Draws each of the ways `share` of three, and looks that it is the one that was meant.
fn draw_all(share: &str) {
    let gpu = Gpu::hasty();
    let mut whole = Vec::new();
    for (i, (ways, choice)) in spread().iter().enumerate().filter(|(_, (ways, _))| ways.shadows == share) {
        let (plan, film) = drawn(&gpu, ways, choice, ForcedEffects::None, false);
        assert_eq!(Ways::of(&plan), *ways, "{choice:?}: {:#?}", plan.effects);
        // The pictures of everything take as long again: a seventh of them, which divides no number of ways. All 144
        // were compared once: 143 were the same to the last bit, one differed in one pixel by two roundings, with no
        // single effect at fault.
        if i % 7 == 0 {
            whole.push(*ways);
            let (_, full) = drawn(&gpu, ways, choice, ForcedEffects::All, false);
            let named: Vec<_> = FACTORS.iter().zip(choice).map(|(f, &c)| (f.name, f.levels[c])).collect();
            assert!(bits(&film) == bits(&full), "{ways:?} {named:?}");
        }
    }
    assert_all_ways(&whole, &[share]);
    assert!(gpu.errors().is_empty(), "{:?}", gpu.errors());
}

/// Asserts that each of the ways is among some of the scenes.
fn assert_all_ways(some: &[Ways], shadows: &[&str]) {
    assert!(shadows.iter().all(|level| some.iter().any(|ways| ways.shadows == *level)), "{some:?}");
    assert!(MIRRORS.iter().all(|level| some.iter().any(|ways| ways.mirrors == *level)), "{some:?}");
    assert!(TRANSMISSION.iter().all(|level| some.iter().any(|ways| ways.transmission == *level)), "{some:?}");
    let both = [false, true].map(|is| some.iter().any(|w| w.blended == is) && some.iter().any(|w| w.listed == is));
    assert_eq!(both, [true; 2], "{some:?}");
}

#[test]
fn plans_without_shadows() {
    draw_all("off");
}

#[test]
fn plans_with_shadow_maps() {
    draw_all("map");
}

#[test]
fn plans_with_shadow_rays() {
    draw_all("ray");
}

/// Paths through some of the scenes, with both plans.
#[test]
fn plans_with_paths() {
    let gpu = Gpu::hasty();
    let mut drawn_ways = Vec::new();
    // A number that divides no number of ways.
    for (i, (ways, choice)) in spread().iter().enumerate().filter(|(i, _)| i % 23 == 0) {
        drawn_ways.push(*ways);
        let (plan, film) = drawn(&gpu, ways, choice, ForcedEffects::None, true);
        assert!(plan.paths.is_some() && !plan.tiles && !plan.transparency && !plan.shadow_maps, "{ways:?}");
        let (_, full) = drawn(&gpu, ways, choice, ForcedEffects::All, true);
        let named: Vec<_> = FACTORS.iter().zip(choice).map(|(f, &c)| (f.name, f.levels[c])).collect();
        let different = bits(&film).iter().zip(bits(&full)).filter(|(a, b)| *a != b).count();
        assert!(different == 0, "{i}: {different} pixels differ: {ways:?} {named:?}");
    }
    assert_all_ways(&drawn_ways, &SHADOWS);
    assert!(gpu.errors().is_empty(), "{:?}", gpu.errors());
}

/// The largest figures of a program over all plans.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
struct Largest {
    registers: u64,
    code_bytes: u64,
    /// How many of its kernels have more than 128 registers.
    large: u64,
}

/// No kernel of any plan spills vector registers or keeps an array in memory, validation has nothing against the
/// pipelines, and the largest kernels are within a tenth of those in tests/lattice.json: on the devices and drivers
/// that it names (docs/decisions/architectures.md says how to run this without a GPU). `ETALON_BLESS=1` writes the
/// figures of the device into the file.
#[test]
fn compilers_spill_no_register() {
    let Some(gpu) = Gpu::that_tells_compiled() else {
        eprintln!("skipped: no driver here reports what its compiler made");
        return;
    };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/lattice.json");
    let text = std::fs::read_to_string(&path).expect("tests/lattice.json");
    let mut known: BTreeMap<String, BTreeMap<String, Largest>> = serde_json::from_str(&text).expect("figures");
    let device = format!("{}, {}", gpu.device.info().name, gpu.device.info().driver);
    let is_blessing = std::env::var_os("ETALON_BLESS").is_some();
    if !is_blessing && !known.contains_key(&device) {
        eprintln!("skipped: tests/lattice.json has no figures of {device}");
        return;
    }
    let mut in_memory = BTreeSet::new();
    let mut largest: BTreeMap<String, Largest> = BTreeMap::new();
    let mut told = 0;
    for (i, (ways, choice)) in spread().iter().enumerate() {
        // A GPU has a traversal of its own. Deep hierarchies are traversed by links there too, which may not spill
        // either.
        let kinds =
            [(false, true), (true, i % 8 == 0)].map(|(by_paths, is_drawn)| is_drawn.then_some((by_paths, None)));
        let forced = (i % 6 == 5).then(|| (false, Some(traversal_of(choice))));
        for (by_paths, traversal) in kinds.into_iter().flatten().chain(forced) {
            let (camera, mut renderer) = renderer_of(&gpu, ways, choice, traversal, ForcedEffects::None, by_paths);
            for (program, constants) in
                renderer.passes(&camera).expect("passes").iter().flat_map(|pass| &pass.pipelines)
            {
                let compiled = gpu.device.compiled(program, constants).expect("statistics");
                for of in compiled.iter().filter_map(Compiled::footprint) {
                    told += 1;
                    if traversal.is_none() {
                        let most = largest.entry(program.name.to_owned()).or_default();
                        most.registers = of.registers.max(most.registers);
                        most.code_bytes = of.code_bytes.max(most.code_bytes);
                        most.large += u64::from(of.registers > 128);
                    }
                    let kept = of.spilled + of.scratch_bytes;
                    in_memory.extend((kept > 0).then(|| format!("{} in plan {i}: {of:?}", program.name)));
                }
            }
        }
    }
    // Programs whose kernels are all small have no line in the file.
    largest.retain(|_, most| most.registers > 128 || most.code_bytes > 32 << 10);
    eprintln!("{device}: of {told} kernels more than 128 registers or 32 KB of code have {largest:?}");
    assert!(told > 2000 && in_memory.is_empty(), "{device}: {told} kernels, in memory: {in_memory:#?}");
    assert_eq!(gpu.errors(), Vec::<String>::new());
    if is_blessing {
        known.insert(device, largest);
        std::fs::write(&path, serde_json::to_string_pretty(&known).expect("JSON") + "\n").expect("a written file");
        return;
    }
    let before = &known[&device];
    assert_eq!(before.keys().collect::<Vec<_>>(), largest.keys().collect::<Vec<_>>(), "large programs of {device}");
    for (name, then) in before {
        let now = largest[name];
        let words = |of: &Largest| [of.registers, of.code_bytes, of.large].map(|word| word as f64);
        let near = words(then).into_iter().zip(words(&now)).all(|(a, b)| (a - b).abs() <= 0.1 * a);
        assert!(near, "{device}: {name} was {then:?} and is {now:?}");
    }
}

/// What paths may meet is planned where it is, and not where it is not; and nothing that they take the place of.
#[test]
fn paths_call_for_what_they_may_meet() {
    let mut states: BTreeMap<&'static str, BTreeSet<&'static str>> = BTreeMap::new();
    for (ways, choice) in spread() {
        let plan = planned(ways, choice, knobs_of_paths(ways, choice));
        for effect in &plan.effects {
            states.entry(effect.id.name()).or_default().insert(effect.state.name());
        }
    }
    let of = |name: &str| states[name].iter().copied().collect::<Vec<_>>();
    for name in [
        "absorption",
        "clear coat",
        "environment",
        "rough transmission",
        "alpha test in rays",
        "transparent shadows",
        "heterogeneous media",
        "conductors with n and kappa",
        "punctual lights",
        "transmissive hits",
    ] {
        assert!(of(name).contains(&"used") && of(name).contains(&"not needed"), "{name}: {:?}", of(name));
    }
    for name in [
        "ambient light",
        "tiled light culling",
        "environment reflection",
        "reflection",
        "order-independent transparency",
    ] {
        assert_eq!(of(name), ["not needed", "switched off"], "{name}");
    }
    // Some surface of each scene is rough, and one is shown as it is.
    assert_eq!([of("path tracing"), of("glossy reflection"), of("emissive surfaces as lights")], [["used"]; 3]);
}

#[test]
fn any_two_things_meet() {
    let all = spread();
    let reached: BTreeSet<String> = all.iter().flat_map(|(ways, choice)| pairs(ways, choice)).collect();
    let levels = |factor: &Factor| factor.levels.iter().map(|level| format!("{}={level}", factor.name)).collect();
    let named: Vec<Vec<String>> = FACTORS.iter().map(levels).collect();
    let of_ways = |name: &str, levels: &[&str]| levels.iter().map(|level| format!("{name}={level}")).collect();
    let ways: [Vec<String>; 5] = [
        of_ways("shadows", &SHADOWS),
        of_ways("mirrors", &MIRRORS),
        of_ways("transmission", &TRANSMISSION),
        of_ways("blended", &["false", "true"]),
        of_ways("listed", &["false", "true"]),
    ];
    let mut expected = BTreeSet::new();
    for (i, these) in named.iter().enumerate() {
        let of_glass = OF_GLASS.contains(&FACTORS[i].name);
        for others in named[i + 1..].iter() {
            expected.extend(these.iter().flat_map(|a| others.iter().map(move |b| format!("{a} {b}"))));
        }
        for others in &ways {
            let with_glass = others.iter().filter(|way| !(of_glass && *way == "transmission=none"));
            expected.extend(with_glass.flat_map(|a| these.iter().map(move |b| format!("{a} {b}"))));
        }
    }
    let missed: Vec<_> = expected.difference(&reached).collect();
    assert!(expected.len() > 1500 && missed.is_empty(), "never drawn together: {missed:?}");
}

/// The plan as the renderer makes it, without a device.
fn planned(ways: &Ways, choice: &Choice, knobs: Knobs) -> Plan {
    let Made(mut scene) = scene(ways, choice);
    let environment = level(choice, "environment");
    let ambience = if environment == "none" { AmbientLight::Absent } else { AmbientLight::Present };
    prune_unused(&mut scene, Prune::Unused(ambience));
    let form = canonicalise(&mut scene);
    let surroundings = Surroundings {
        environment: environment != "none",
        constant: environment == "constant",
        grey: false,
        sky: environment != "none",
        blurred: false,
        interreflection: true,
        forced: ForcedEffects::None,
    };
    Plan::new(&scene, &Facts::of(&scene, form), surroundings, &knobs)
}

/// Effects that are only kept where another one is, and so where those are that it needs.
const NEEDS: &[(&str, &str)] = &[
    ("absorption", "transmissive hits"),
    // Every scene here has a surface that scatters.
    ("ambient occlusion", "ambient light"),
    ("anisotropy", "textures of lobes"),
    ("clear coat", "material layers"),
    ("tiled light culling", "punctual lights"),
    ("heterogeneous media", "absorption"),
    ("heterogeneous media", "refraction"),
    ("emissive surfaces as lights", "emissive textures"),
    ("prefiltered environment", "environment"),
    ("prefiltered environment", "environment reflection"),
    ("quadrature", "heterogeneous media"),
    ("shadows", "punctual lights"),
];

fn needs(a: &str, b: &str) -> bool {
    a == b || NEEDS.iter().any(|(x, y)| *x == a && needs(y, b))
}

/// Every effect is kept in some plan and not called for in another, and any two are kept together, and each without the
/// other unless it needs it.
#[test]
fn any_two_effects_are_kept_together_and_apart() {
    let mut states: BTreeMap<&'static str, BTreeSet<&'static str>> = BTreeMap::new();
    let mut seen = BTreeSet::new();
    for (ways, choice) in spread() {
        let plan = planned(ways, choice, knobs(ways, choice));
        let elsewhere = [OF_PATHS.as_slice(), &OF_LIGHTS, &OF_WAVELENGTHS].concat();
        for a in plan.effects.iter().filter(|effect| !elsewhere.contains(&effect.id.name())) {
            states.entry(a.id.name()).or_default().insert(a.state.name());
        }
        seen.extend(effect_pairs(&plan));
    }
    assert_eq!(states.keys().copied().collect::<Vec<_>>(), NAMES);
    for (name, states) in &states {
        assert!(states.contains("used") && states.contains("not needed"), "{name}: only {states:?}");
    }
    let mut missed = Vec::new();
    for (i, a) in NAMES.iter().enumerate() {
        for b in &NAMES[i + 1..] {
            for (x, y) in [(true, true), (true, false), (false, true)] {
                // Where a medium is marched there is a rule for it.
                let marched = [*a, *b] == ["heterogeneous media", "quadrature"] && x != y;
                let impossible = marched || (x && !y && needs(a, b)) || (y && !x && needs(b, a));
                let pair = format!("({a}: {x}) ({b}: {y})");
                if seen.contains(&pair) == impossible {
                    missed.push(pair);
                }
            }
        }
    }
    assert!(missed.is_empty(), "never planned, or planned although impossible: {missed:#?}");
}

/// Effects of paths. Rough transmission is one of lamps behind thin surfaces too (tests/plan.rs, tests/light.rs).
const OF_PATHS: [&str; 5] =
    ["path guiding", "caustics of punctual lights", "rough transmission", "path tracing", "denoising"];

/// Effects of more lights than are here: tests/light_samples.rs has them.
const OF_LIGHTS: [&str; 2] = ["analytic area lights", "light hierarchy"];

/// Effects of another rung of `colour`: tests/spectra.rs has them.
const OF_WAVELENGTHS: [&str; 2] = ["spectral rendering", "dispersion"];

/// Every other effect, except the one that only the hierarchy of triangles decides.
const NAMES: [&str; 28] = [
    "absorption",
    "alpha test in rays",
    "ambient light",
    "ambient occlusion",
    "anisotropy",
    "clear coat",
    "conductors with n and kappa",
    "diffuse transmission",
    "emissive surfaces as lights",
    "emissive textures",
    "environment",
    "environment reflection",
    "glossy reflection",
    "heterogeneous media",
    "iridescence",
    "material layers",
    "order-independent transparency",
    "prefiltered environment",
    "punctual lights",
    "quadrature",
    "reflection",
    "refraction",
    "shadows",
    "sheen",
    "textures of lobes",
    "tiled light culling",
    "transmissive hits",
    "transparent shadows",
];
