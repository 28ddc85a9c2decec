//! A scene made ready to be drawn, before any device is there: in normal form, planned, with the hierarchy that its rays go
//! through. Data alone: what is drawn of it, and on what, is for [`crate::frame`] to say.

use std::sync::{Arc, OnceLock};
use std::time::Instant;

use anyhow::{Result, anyhow, bail};
use glam::DVec3;

use crate::plan::{Demand, Facts, Knobs, Plan, Rays, Surroundings, needs_lights};
use crate::scene::environment::Environment;
use crate::scene::normal_form::{NormalForm, normalise};
use crate::scene::reads::forget_unread;
use crate::scene::sigma::one_medium_each;
use crate::scene::solid::Solids;
use crate::scene::{Ambience, Bounds, Light, LightKind, Reads, Scene};
use crate::transport::bvh::Bvh;
use crate::transport::contact::{bodies_touch, twins};
use crate::transport::emitters::{Emitters, Sky};

/// What a scene is prepared for.
#[derive(Debug, Clone, Copy)]
pub struct Conditions<'a> {
    /// Rungs.
    pub knobs: &'a Knobs,
    /// What is planned although the scene does not call for it.
    pub demand: Demand,
    /// Light from all around.
    pub sky: Option<Sky<'a>>,
    /// The sky is seen behind the scene, too.
    pub background: bool,
}

/// A scene as it was read. Clones, and all that is prepared of them, share its lists and the one tree of its triangles, which is
/// built when rays are first called for.
#[derive(Debug, Clone, Default)]
pub struct Original {
    scene: Scene,
    tree: Arc<OnceLock<Result<Tree, String>>>,
}

/// A tree, and the milliseconds that it took.
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
    /// What was read.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The tree of the scene's normal form, whose triangles are those of every plan: plans leave out textures and lights.
    ///
    /// # Errors
    /// When the scene has more triangles than a tree holds.
    pub fn bvh(&self) -> Result<Arc<Bvh>> {
        let normal = || {
            let mut scene = self.scene.clone();
            one_medium_each(&mut scene);
            normalise(&mut scene);
            scene
        };
        Ok(self.tree_of(normal)?.0)
    }

    fn tree_of<S: std::borrow::Borrow<Scene>>(&self, normal: impl FnOnce() -> S) -> Result<Tree> {
        let built = self.tree.get_or_init(|| {
            let start = Instant::now();
            let bvh = Bvh::build(normal().borrow()).map_err(|error| format!("{error:#}"))?;
            let build_ms = start.elapsed().as_secs_f64() * 1e3;
            tracing::info!("a tree of {} triangles, in {build_ms:.1} ms", bvh.triangles.len());
            Ok((Arc::new(bvh), build_ms))
        });
        built.clone().map_err(|error| anyhow!(error))
    }

    /// What the scene calls for under the chosen rungs, without preparing anything else.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn plan(&self, conditions: &Conditions<'_>) -> Result<Plan> {
        planned(&mut self.scene.clone(), conditions).map(|(plan, _)| plan)
    }
}

/// A scene that is ready to be drawn.
#[derive(Debug)]
pub struct Prepared {
    /// In normal form, with the lights that are planned, directional ones first.
    pub scene: Scene,
    /// What will be done and why.
    pub plan: Plan,
    /// Which surfaces enclose a medium.
    pub solids: Solids,
    /// What paths draw light from.
    pub emitters: Emitters,
    /// What rays go through; `None` where the plan sends none.
    pub hierarchy: Option<Hierarchy>,
    /// What is odd about the scene, a sentence each.
    pub warnings: Vec<String>,
}

/// The hierarchy of a scene's triangles.
#[derive(Debug)]
pub struct Hierarchy {
    /// The tree.
    pub bvh: Arc<Bvh>,
    /// Milliseconds that it took.
    pub build_ms: f64,
    /// How far rays start off a surface, metres.
    pub offset: f64,
    /// Some transparent body lies against another surface.
    pub touching: bool,
    /// What is odd about the triangles, a sentence each.
    pub warnings: Vec<String>,
}

/// Rays start this many roundings of the largest coordinate off their surface (shaders/lib/trace.glsl, `ray_origin`).
const OFFSET_ROUNDINGS: f64 = 32.0;

/// How far rays start off surfaces of a scene whose coordinates are at most `extent`.
#[must_use]
pub fn ray_offset(extent: f64) -> f64 {
    OFFSET_ROUNDINGS * extent * 2.0_f64.powi(-24)
}

/// Brings a scene into its normal form and plans it.
fn planned(scene: &mut Scene, conditions: &Conditions<'_>) -> Result<(Plan, Solids)> {
    let &Conditions { knobs, demand, sky, background } = conditions;
    one_medium_each(scene);
    let triangles = scene.triangles();
    let shown = knobs.show_occlusion(sky.is_some());
    let reads = match demand {
        Demand::Full => Reads::Everything,
        _ => Reads::Visible(if shown { Ambience::Present } else { Ambience::Absent }),
    };
    // Once more after the normal form, which leaves less to be read.
    forget_unread(scene, reads);
    let form = normalise(scene);
    forget_unread(scene, reads);
    if scene.triangles() == 0 {
        let why = if triangles == 0 { "the scene has 0 triangles" } else { "alpha leaves nothing of its surfaces" };
        bail!("{}: there is nothing to draw, {why}", scene.name);
    }
    if needs_lights(demand) && scene.lights.iter().all(|light| light.stand_in) {
        add_dark_lights(scene);
    }
    let facts = Facts::of(scene, form);
    let surroundings = Surroundings {
        environment: sky.is_some(),
        constant: sky.is_some_and(|sky| Environment::is_constant(sky.map)),
        grey: sky.is_some_and(|sky| Environment::is_grey(sky.map)),
        sky: background,
        demand,
    };
    let plan = Plan::new(scene, &facts, surroundings, knobs);
    Ok((plan, facts.solids))
}

/// A directional and a point light without light: they stand for what is asked for and not there.
fn add_dark_lights(scene: &mut Scene) {
    let bounds = scene.bounds().unwrap_or(Bounds { min: DVec3::ZERO, max: DVec3::ONE });
    let dark =
        |kind| Light { name: "dark".to_owned(), color: [0.0; 3], spectrum: None, extent: None, kind, stand_in: false };
    let point = LightKind::Point { position: bounds.max, range: Some(2.0 * bounds.radius()) };
    scene.lights.extend([dark(LightKind::Directional { direction: DVec3::NEG_Y }), dark(point)]);
}

impl Prepared {
    /// Plans a scene and builds what the plan asks for.
    ///
    /// # Errors
    /// When the scene has nothing to draw, or more triangles than a hierarchy holds.
    pub fn new(original: impl Into<Original>, conditions: &Conditions<'_>) -> Result<Self> {
        let original = original.into();
        let mut scene = original.scene.clone();
        let (mut plan, solids) = planned(&mut scene, conditions)?;
        // What adds nothing takes no turn of any loop.
        let mut kept = plan.lights.iter();
        scene.lights.retain(|_| kept.next().copied().unwrap_or_default());
        // Directional ones first: loops over lights count on it, and so does the table of what paths draw light from.
        scene.lights.sort_by_key(|light| !matches!(light.kind, LightKind::Directional { .. }));
        let refracts = plan.screen.refraction || plan.rays.is_some_and(|rays| rays.refraction);
        let mut warnings = if refracts { solids.warnings.clone() } else { Vec::new() };
        let emitters =
            plan.paths.map_or_else(Emitters::default, |paths| Emitters::of(&scene, conditions.sky, paths.emitting));
        let hierarchy = match plan.rays {
            Some(rays) => Some(Hierarchy::of(&scene, original.tree_of(|| &scene)?, &solids, rays)),
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

    /// A scene as it is, for rays alone.
    ///
    /// # Errors
    /// When it has more triangles than a hierarchy holds.
    pub fn for_rays(scene: Scene) -> Result<Self> {
        let surroundings =
            Surroundings { environment: false, constant: false, grey: false, sky: false, demand: Demand::Scene };
        let facts = Facts::of(&scene, NormalForm::default());
        let rays = Rays::default();
        let plan = Plan { rays: Some(rays), ..Plan::new(&scene, &facts, surroundings, &Knobs::default()) };
        let tree = Original::from(scene.clone()).tree_of(|| &scene)?;
        let hierarchy = Some(Hierarchy::of(&scene, tree, &facts.solids, rays));
        let solids = facts.solids;
        Ok(Self { scene, plan, solids, emitters: Emitters::default(), hierarchy, warnings: Vec::new() })
    }
}

impl Hierarchy {
    fn of(scene: &Scene, (bvh, build_ms): Tree, solids: &Solids, rays: Rays) -> Self {
        let extent = bvh.triangles.iter().flat_map(|t| t.corners.iter().flatten()).fold(0.0_f32, |m, x| m.max(x.abs()));
        let offset = ray_offset(extent.into());
        let touching = rays.refraction && bodies_touch(&bvh, &solids.solid, offset);
        Self { build_ms, offset, touching, warnings: odd_triangles(scene, &bvh, solids), bvh }
    }
}

/// What is left out, and what is there twice: of that only one is seen, unless bodies touch there.
fn odd_triangles(scene: &Scene, bvh: &Bvh, solids: &Solids) -> Vec<String> {
    const MOST: usize = 4;
    let mut warnings = Vec::new();
    if bvh.dropped > 0 {
        warnings.push(format!("{} triangles without area are left out for rays", bvh.dropped));
    }
    let name = |instance: u32| &scene.meshes[scene.instances[instance as usize].mesh].name;
    let is_body = |instance: u32| solids.solid[instance as usize];
    let mut pairs = twins(bvh).into_iter().filter(|([a, b], _)| a == b || !(is_body(*a) || is_body(*b)));
    warnings.extend(pairs.by_ref().take(MOST).map(|([a, b], count)| {
        format!(
            "{count} triangles of mesh \"{}\" lie exactly in triangles of mesh \"{}\": one of each is seen",
            name(b),
            name(a)
        )
    }));
    let more = pairs.count();
    if more > 0 {
        warnings.push(format!("triangles of {more} more pairs of meshes lie exactly in each other"));
    }
    warnings
}
