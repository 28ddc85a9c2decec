//! What the ray of a pixel meets, one surface after the other, as the lecture tells it (R1 to R6): the mirrored ray, the bent one, and
//! from what spreads light a ray to each light. In f64 and by textbook formulas, for whoever asks why a pixel looks as it does; no
//! picture is made of it. Normals are those of the corners, without textures; media and shares are those of green light.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::bvh::Bvh;
use super::layers::{Layer, Layers, Media, coverage};
use super::line::{self, Crossing};
use super::sight::line_through;
use crate::scene::light::LightKind;
use crate::scene::material::Material;
use crate::scene::solid::{Solids, solids};
use crate::scene::{Camera, Scene};

/// Events of one pixel at most: a tree of them grows quickly.
const MOST_EVENTS: usize = 96;
/// Lights that a surface is connected with at most.
const MOST_LIGHTS: usize = 8;

/// Wavelength of which media and shares are, nm.
pub const GREEN: f64 = 550.0;

/// How far a ray is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Surfaces one behind the other.
    pub surfaces: u32,
    /// Perceptual roughness up to which what a surface mirrors, or lets through, is followed.
    pub roughest: f32,
    /// Share of the pixel's light below which nothing is followed.
    pub least_share: f64,
    /// Lights shine that stand for surfaces which emit.
    pub stand_ins: bool,
}

/// What a ray was sent for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// By the eye.
    Seen,
    /// For a mirror image (F4).
    Mirrored,
    /// Through a boundary of two media (F5).
    Bent,
    /// Through a sheet, or where no medium ends.
    Straight,
    /// To a light, by its index (R5).
    ToLight(usize),
}

/// One ray and where it ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Place in the list of the event whose surface it leaves; `None`: the eye's.
    pub after: Option<usize>,
    /// What it was sent for.
    pub way: Way,
    /// Where it begins, in the world.
    pub from: DVec3,
    /// Where it ends; of what leaves the scene, as far away as the scene is large.
    pub to: DVec3,
    /// Of the pixel's light, before absorption; of a ray to a light, that of the surface.
    pub share: f64,
    /// What it meets; of a ray to a light, what stands before that light.
    pub met: Option<Met>,
}

/// A surface that a ray meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Met {
    /// Index of the scene's.
    pub instance: usize,
    /// Index of the scene's.
    pub material: usize,
    /// Unit normal on the side that the ray comes from.
    pub normal: DVec3,
    /// Of the angle of incidence.
    pub cos: f64,
    /// Index of refraction behind it over that before it.
    pub ratio: f64,
    /// Share that is mirrored (F2, F3).
    pub reflected: f64,
    /// Nothing goes through (F6).
    pub total: bool,
    /// It spreads what it does not mirror, or is too rough to be followed.
    pub spreads: bool,
}

/// A scene that rays can be followed through.
pub struct Tracer {
    bvh: Arc<Bvh>,
    solids: Solids,
    radius: f64,
}

/// A ray that is still to be followed.
struct Pending {
    after: Option<usize>,
    way: Way,
    from: DVec3,
    direction: DVec3,
    share: f64,
    surfaces: u32,
    media: Media,
}

fn material(scene: &Scene, instance: usize) -> &Material {
    &scene.materials[scene.meshes[scene.instances[instance].mesh].material]
}

impl Tracer {
    /// Makes ready, with the tree of the scene's triangles.
    #[must_use]
    pub fn new(scene: &Scene, bvh: Arc<Bvh>) -> Self {
        let radius = scene.bounds().map_or(1.0, |bounds| bounds.radius());
        Self { bvh, solids: solids(scene), radius }
    }

    /// Follows the ray through the middle of a pixel of a picture of `size` that `camera` sees.
    #[must_use]
    pub fn follow(
        &self,
        scene: &Scene,
        camera: &Camera,
        size: [u32; 2],
        pixel: [u32; 2],
        limits: &Limits,
    ) -> Vec<Event> {
        let at = DVec2::new(
            (f64::from(pixel[0]) + 0.5) / f64::from(size[0]) * 2.0 - 1.0,
            1.0 - (f64::from(pixel[1]) + 0.5) / f64::from(size[1]) * 2.0,
        );
        let (from, direction) = line_through(camera, f64::from(size[0]) / f64::from(size[1]), at);
        let media = Media::at(scene, &self.solids, from);
        let mut open = vec![Pending { after: None, way: Way::Seen, from, direction, share: 1.0, surfaces: 0, media }];
        let mut events: Vec<Event> = Vec::new();
        while let Some(ray) = open.pop() {
            if events.len() >= MOST_EVENTS {
                break;
            }
            let crossing = self.nearest_seen(scene, ray.from, ray.direction);
            let index = events.len();
            let to = ray.from + ray.direction * crossing.map_or(2.0 * self.radius, |crossing| crossing.t);
            let mut event = Event { after: ray.after, way: ray.way, from: ray.from, to, share: ray.share, met: None };
            let Some(crossing) = crossing else {
                events.push(event);
                continue;
            };
            let (met, next) = self.at_surface(scene, &ray, &crossing, limits);
            event.met = Some(met);
            events.push(event);
            if met.spreads {
                let from = (index, to);
                events.extend(self.to_lights(scene, from, met, ray.share, limits.stand_ins));
            }
            // The strongest is followed first.
            let mut next: Vec<Pending> = next.into_iter().map(|ray| Pending { after: Some(index), ..ray }).collect();
            next.retain(|ray| ray.share >= limits.least_share && ray.surfaces < limits.surfaces);
            next.sort_by(|a, b| a.share.total_cmp(&b.share));
            open.extend(next);
        }
        events
    }

    fn nearest(&self, from: DVec3, direction: DVec3) -> Option<Crossing<'_>> {
        line::nearest(&self.bvh, from - self.bvh.anchor, direction, 1e-6 * self.radius)
    }

    /// The nearest surface that is seen: backs of sheets with one side are not.
    fn nearest_seen(&self, scene: &Scene, from: DVec3, direction: DVec3) -> Option<Crossing<'_>> {
        let mut behind = 1e-6 * self.radius;
        loop {
            let crossing = line::nearest(&self.bvh, from - self.bvh.anchor, direction, behind)?;
            let instance = crossing.triangle.instance as usize;
            let is_seen = self.solids.solid[instance] || material(scene, instance).double_sided;
            if is_seen || crossing.facing(scene, &self.solids, direction).front {
                return Some(crossing);
            }
            behind = crossing.t * (1.0 + 1e-9);
        }
    }

    /// What a surface is to a ray, and the rays that leave it.
    fn at_surface(
        &self,
        scene: &Scene,
        ray: &Pending,
        crossing: &Crossing<'_>,
        limits: &Limits,
    ) -> (Met, Vec<Pending>) {
        let instance = crossing.triangle.instance as usize;
        let m = material(scene, instance);
        let to = ray.from + ray.direction * crossing.t;
        let facing = crossing.facing(scene, &self.solids, ray.direction);
        let (normals, cos) = ([facing.normal, facing.flat], (-ray.direction.dot(facing.normal)).clamp(0.0, 1.0));
        let index = |m: &Material| m.dispersion.index(f64::from(m.ior), GREEN);
        let boundary = ray.media.cross(scene, &self.solids, instance, facing.front, index);
        let layers = Layers::of(m, &boundary, cos);
        let green = |layer: Layer| layers.share(layer).y;
        // Where a texture has alpha, the surface is taken to be there.
        let opacity = if boundary.hidden { 0.0 } else { coverage(m).unwrap_or(1.0) };
        let mut met = Met {
            instance,
            material: scene.meshes[scene.instances[instance].mesh].material,
            normal: facing.normal,
            cos,
            ratio: layers.ratio,
            reflected: green(Layer::Coat) + green(Layer::Base),
            total: layers.total,
            spreads: layers.spreads_some(limits.roughest) && opacity > 0.0,
        };
        let leave = |way, direction, share, media: &Media| Pending {
            after: None,
            way,
            from: to,
            direction,
            share: ray.share * share,
            surfaces: ray.surfaces + 1,
            media: media.clone(),
        };
        if boundary.hidden {
            (met.reflected, met.total) = (0.0, false);
            return (met, vec![leave(Way::Straight, ray.direction, 1.0, &boundary.beyond)]);
        }
        let mut next = Vec::new();
        if opacity < 1.0 {
            next.push(leave(Way::Straight, ray.direction, 1.0 - opacity, &ray.media));
        }
        let is_followed = |layer: &Layer| !layers.spreads(*layer, limits.roughest);
        // The middle of the lobe of what is a little rough.
        let along = |layer| layers.direction(layer, ray.direction, normals, facing.normal);
        // Coat and base mirror into one direction.
        let mut mirrors = [Layer::Coat, Layer::Base].into_iter().filter(is_followed);
        let share: f64 = mirrors.clone().map(green).sum();
        if let Some(direction) = mirrors.next_back().and_then(along) {
            next.push(leave(Way::Mirrored, direction, opacity * share, &ray.media));
        }
        if let Some(direction) = along(Layer::Through).filter(|_| is_followed(&Layer::Through)) {
            let (way, media) = match self.solids.solid[instance] {
                true => (Way::Bent, &boundary.beyond),
                false => (Way::Straight, &ray.media),
            };
            next.push(leave(way, direction, opacity * green(Layer::Through), media));
        }
        (met, next)
    }

    /// A ray to each light, of the first few.
    fn to_lights(
        &self,
        scene: &Scene,
        (after, at): (usize, DVec3),
        met: Met,
        share: f64,
        stand_ins: bool,
    ) -> Vec<Event> {
        let lights =
            scene.lights.iter().enumerate().filter(|(_, light)| light.shines() && (stand_ins || !light.stand_in));
        let towards = lights.map(|(index, light)| match light.kind {
            LightKind::Directional { direction } => (index, at - direction * 2.0 * self.radius),
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } => (index, position),
        });
        let lit = towards.filter(|(_, place)| (*place - at).dot(met.normal) > 0.0).take(MOST_LIGHTS);
        lit.map(|(index, place)| {
            let way = place - at;
            let direction = way.normalize();
            let crossing = self.nearest(at, direction).filter(|crossing| crossing.t < way.length());
            let met = crossing.map(|crossing| {
                let instance = crossing.triangle.instance as usize;
                let normal = crossing.normal(scene);
                let cos = -direction.dot(normal);
                Met {
                    instance,
                    material: scene.meshes[scene.instances[instance].mesh].material,
                    normal: normal * cos.signum(),
                    cos: cos.abs(),
                    ratio: 1.0,
                    reflected: 0.0,
                    total: false,
                    spreads: false,
                }
            });
            let to = crossing.map_or(place, |crossing| at + direction * crossing.t);
            Event { after: Some(after), way: Way::ToLight(index), from: at, to, share, met }
        })
        .collect()
    }
}
