//! Preparation of a scene without a device: canonical form, plan, BVH and light sampling tables.
//!
//! Read docs/plan.md. The result is data; [`crate::frame`] uploads and draws it.

use std::sync::{Arc, OnceLock};
use std::time::Instant;

use anyhow::{Result, anyhow, bail};
use glam::DVec3;

use crate::plan::{Facts, ForcedEffects, Knobs, LightSamples, Plan, Rays, Surroundings, needs_lights};
use crate::scene::canonical::{CanonicalForm, canonicalise};
use crate::scene::environment::Environment;
use crate::scene::prune::prune_unused;
use crate::scene::sigma::one_medium_each;
use crate::scene::solid::Solids;
use crate::scene::{AmbientLight, Bounds, Light, LightKind, Prune, Scene};
use crate::transport::bvh::Bvh;
use crate::transport::contact::{has_coincident_interfaces, twins};
use crate::transport::emitters::{Emitters, Sky};
use crate::transport::occluders::OccluderRadiosity;

/// Conditions under which a scene is prepared.
#[derive(Debug, Clone, Copy)]
pub struct Conditions<'a> {
    /// Rungs of all knobs.
    pub knobs: &'a Knobs,
    /// Effects that are planned although the scene does not call for them.
    pub forced: ForcedEffects,
    /// The environment light.
    pub sky: Option<Sky<'a>>,
    /// Whether the environment is also the background.
    pub background: bool,
    /// Whether it is blurred there.
    pub blurred: bool,
}

/// A scene as it was read. Clones, and everything prepared from them, share its lists and the one BVH of its triangles,
/// which is built when rays are first needed.
#[derive(Debug, Clone, Default)]
pub struct Original {
    scene: Scene,
    tree: Arc<OnceLock<Result<Tree, String>>>,
}

/// A BVH, and its build time in milliseconds.
type Tree = (Arc<Bvh>, f64);

impl From<Scene> for Original {
    fn from(scene: Scene) -> Self {
        Self { scene, tree: Arc::default() }
    }
}

impl From<&Self> for Original {
    fn from(other: &Self) -> Self {
        other.clone()
    }
}

impl Original {
    /// The scene as it was read.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The BVH of the scene's canonical form. Its triangles are those of every plan: a plan omits only textures and
    /// lights.
    ///
    /// # Errors
    /// When the scene has more triangles than a BVH holds.
    pub fn bvh(&self) -> Result<Arc<Bvh>> {
        let normal = || {
            let mut scene = self.scene.clone();
            one_medium_each(&mut scene);
            canonicalise(&mut scene);
            scene
        };
        Ok(self.tree_of(normal)?.0)
    }

    fn tree_of<S: std::borrow::Borrow<Scene>>(&self, normal: impl FnOnce() -> S) -> Result<Tree> {
        let built = self.tree.get_or_init(|| {
            let start = Instant::now();
            let bvh = Bvh::build(normal().borrow()).map_err(|error| format!("{error:#}"))?;
            let build_ms = start.elapsed().as_secs_f64() * 1e3;
            tracing::info!("built a BVH of {} triangles in {build_ms:.1} ms", bvh.triangles.len());
            Ok((Arc::new(bvh), build_ms))
        });
        built.clone().map_err(|error| anyhow!(error))
    }

    /// The plan of the scene under the chosen rungs, without any other preparation: surfaces are taken to send light to
    /// others where lamps could light them.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn plan(&self, conditions: &Conditions<'_>) -> Result<Plan> {
        planned(&mut self.scene.clone(), conditions).map(|(plan, ..)| plan)
    }
}

/// A scene that is ready to be rendered.
#[derive(Debug)]
pub struct Prepared {
    /// The scene in canonical form, with the planned lights, directional ones first.
    pub scene: Scene,
    /// The plan.
    pub plan: Plan,
    /// Closed dielectric meshes, which enclose a medium.
    pub solids: Solids,
    /// The light sampling tables of path tracing.
    pub emitters: Emitters,
    /// The BVH; `None` when the plan sends no rays.
    pub hierarchy: Option<Hierarchy>,
    /// Warnings about the scene, one sentence each.
    pub warnings: Vec<String>,
}

/// The BVH of a scene's triangles, with its ray offset.
#[derive(Debug)]
pub struct Hierarchy {
    /// The BVH.
    pub bvh: Arc<Bvh>,
    /// Build time in milliseconds.
    pub build_ms: f64,
    /// Distance from the surface at which rays start, in metres.
    pub offset: f64,
    /// Whether some closed dielectric mesh touches another surface (coincident interfaces).
    pub touching: bool,
    /// Of what surfaces face; zero without rays of ambient occlusion.
    pub occluder_radiosity: OccluderRadiosity,
    /// Warnings about the triangles, one sentence each.
    pub warnings: Vec<String>,
}

/// Ray offset from the surface, in rounding errors of the largest coordinate (shaders/lib/trace.glsl, `ray_origin`).
const OFFSET_ROUNDINGS: f64 = 32.0;

/// Ray offset in metres for a scene whose coordinates are at most `extent` in absolute value.
#[must_use]
pub fn ray_offset(extent: f64) -> f64 {
    OFFSET_ROUNDINGS * extent * 2.0_f64.powi(-24)
}

/// Ray offset in metres of a tree's triangles.
fn offset_of(bvh: &Bvh) -> f64 {
    let extent = bvh.triangles.iter().flat_map(|t| t.corners.iter().flatten()).fold(0.0_f32, |m, x| m.max(x.abs()));
    ray_offset(extent.into())
}

/// Canonicalises a scene and plans it.
fn planned(scene: &mut Scene, conditions: &Conditions<'_>) -> Result<(Plan, Facts, Surroundings)> {
    let &Conditions { knobs, forced, sky, background, blurred } = conditions;
    one_medium_each(scene);
    let triangles = scene.triangles();
    let shown = knobs.show_occlusion(sky.is_some());
    let reads = match forced {
        ForcedEffects::All => Prune::Nothing,
        _ => Prune::Unused(if shown { AmbientLight::Present } else { AmbientLight::Absent }),
    };
    // Pruned again after canonicalisation, which leaves fewer textures and attributes in use.
    prune_unused(scene, reads);
    let form = canonicalise(scene);
    prune_unused(scene, reads);
    if scene.triangles() == 0 {
        let why = if triangles == 0 { "it has 0 triangles" } else { "all of its surfaces have alpha 0" };
        bail!("{}: the scene has nothing to draw: {why}", scene.name);
    }
    if needs_lights(forced) && scene.lights.iter().all(|light| light.proxy) {
        add_dark_lights(scene);
    }
    let facts = Facts::of(scene, form);
    let surroundings = Surroundings {
        environment: sky.is_some(),
        constant: sky.is_some_and(|sky| Environment::is_constant(sky.map)),
        grey: sky.is_some_and(|sky| Environment::is_grey(sky.map)),
        sky: background,
        blurred,
        interreflection: true,
        forced,
    };
    let plan = Plan::new(scene, &facts, surroundings, knobs);
    Ok((plan, facts, surroundings))
}

/// Adds a black directional and a black point light: placeholders for forced effects that need lights.
fn add_dark_lights(scene: &mut Scene) {
    let bounds = scene.bounds().unwrap_or(Bounds { min: DVec3::ZERO, max: DVec3::ONE });
    let dark =
        |kind| Light { name: "dark".to_owned(), color: [0.0; 3], spectrum: None, extent: None, kind, proxy: false };
    let point = LightKind::Point { position: bounds.max, range: Some(2.0 * bounds.radius()) };
    scene.lights.extend([dark(LightKind::Directional { direction: DVec3::NEG_Y }), dark(point)]);
}

impl Prepared {
    /// Plans a scene and builds the BVH and tables that the plan needs.
    ///
    /// # Errors
    /// When the scene has nothing to draw, or more triangles than a BVH holds.
    pub fn new(original: impl Into<Original>, conditions: &Conditions<'_>) -> Result<Self> {
        let original = original.into();
        let mut scene = original.scene.clone();
        let (mut plan, facts, surroundings) = planned(&mut scene, conditions)?;
        let canonical = scene.clone();
        // Lights that contribute nothing take no loop iteration.
        let mut kept = plan.lights.iter();
        scene.lights.retain(|_| kept.next().copied().unwrap_or_default());
        // Directional lights come first: loops over lights and the light sampling table rely on it.
        // Those that other models than path tracing sample come last, where their loops do not reach.
        let sampled = |light: &Light| plan.paths.is_none() && plan.light_samples.take(light);
        scene.lights.sort_by_key(|light| (!matches!(light.kind, LightKind::Directional { .. }), sampled(light)));
        let LightSamples { emitting, shaped, .. } = plan.light_samples;
        let mut occluder_radiosity = OccluderRadiosity::ZERO;
        if plan.occlusion_rays() > 0 {
            let (bvh, _) = original.tree_of(|| &scene)?;
            let mut lit = scene.clone();
            if !shaped {
                lit.lights.iter_mut().for_each(|light| light.extent = None);
            }
            let lamps = Emitters::of(&lit, None, emitting);
            occluder_radiosity =
                OccluderRadiosity::of(&lit, &facts.solids, &bvh, &lamps, conditions.sky, offset_of(&bvh));
            // Without an environment rays would only look for the light of surfaces that have none.
            if conditions.sky.is_none() && occluder_radiosity.is_zero() {
                plan = Plan::new(
                    &canonical,
                    &facts,
                    Surroundings { interreflection: false, ..surroundings },
                    conditions.knobs,
                );
            }
        }
        let solids = facts.solids;
        let refracts = plan.screen.refraction || plan.rays.is_some_and(|rays| rays.refraction);
        let mut warnings = if refracts { solids.warnings.clone() } else { Vec::new() };
        let emitters = match plan.paths {
            Some(_) => Emitters::of(&scene, conditions.sky, emitting),
            None => Emitters::with_extent(&scene, shaped, emitting),
        };
        // Where every emitter is black there is nothing to sample.
        if plan.paths.is_none() && emitters.list.is_empty() {
            plan.light_samples.count = 0;
        }
        let hierarchy = match plan.rays {
            Some(rays) => {
                let tree = original.tree_of(|| &scene)?;
                Some(Hierarchy::of(&scene, tree, &solids, rays, occluder_radiosity))
            }
            None => None,
        };
        if let Some(hierarchy) = &hierarchy {
            warnings.extend(hierarchy.warnings.iter().cloned());
            if plan.rays.is_some_and(|rays| rays.refraction) {
                plan.found_touching(hierarchy.touching);
            }
        }
        Ok(Self { scene, plan, solids, emitters, hierarchy, warnings })
    }

    /// Prepares a scene without canonicalisation, for rays only.
    ///
    /// # Errors
    /// When the scene has more triangles than a BVH holds.
    pub fn for_rays(scene: Scene) -> Result<Self> {
        let surroundings = Surroundings::DARK;
        let facts = Facts::of(&scene, CanonicalForm::default());
        let rays = Rays::default();
        let plan = Plan { rays: Some(rays), ..Plan::new(&scene, &facts, surroundings, &Knobs::default()) };
        let tree = Original::from(scene.clone()).tree_of(|| &scene)?;
        let hierarchy = Some(Hierarchy::of(&scene, tree, &facts.solids, rays, OccluderRadiosity::ZERO));
        let solids = facts.solids;
        Ok(Self { scene, plan, solids, emitters: Emitters::default(), hierarchy, warnings: Vec::new() })
    }
}

impl Hierarchy {
    fn of(
        scene: &Scene,
        (bvh, build_ms): Tree,
        solids: &Solids,
        rays: Rays,
        occluder_radiosity: OccluderRadiosity,
    ) -> Self {
        let offset = offset_of(&bvh);
        let touching = rays.refraction && has_coincident_interfaces(&bvh, &solids.body, offset);
        Self { build_ms, offset, touching, occluder_radiosity, warnings: odd_triangles(scene, &bvh, solids), bvh }
    }
}

/// Warnings about degenerate triangles, and about coincident triangles of which only one is visible. Coincident
/// interfaces of closed dielectric meshes are legitimate.
fn odd_triangles(scene: &Scene, bvh: &Bvh, solids: &Solids) -> Vec<String> {
    const MOST: usize = 4;
    let mut warnings = Vec::new();
    if bvh.dropped > 0 {
        warnings.push(format!("{} triangles without area are left out of ray tracing", bvh.dropped));
    }
    let name = |instance: u32| &scene.meshes[scene.instances[instance as usize].mesh].name;
    let is_body = |instance: u32| solids.solid[instance as usize];
    let mut pairs = twins(bvh).into_iter().filter(|([a, b], _)| a == b || !(is_body(*a) || is_body(*b)));
    warnings.extend(pairs.by_ref().take(MOST).map(|([a, b], count)| {
        format!(
            "{count} triangles of mesh \"{}\" duplicate triangles of mesh \"{}\"; one of each pair is drawn",
            name(b),
            name(a)
        )
    }));
    let more = pairs.count();
    if more > 0 {
        warnings.push(format!("{more} more pairs of meshes have duplicate triangles"));
    }
    warnings
}
