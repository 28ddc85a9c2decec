//! Recursive ray tracing of one pixel on the host (lecture R1 to R6): reflected and refracted rays, and shadow rays to
//! each light from scattering surfaces.
//!
//! Read Whitted 1980, "An Improved Illumination Model for Shaded Display". The rays explain a pixel to a user; no
//! picture is made of them. They are in f64 and use textbook formulas. Materials and normals are those of the point
//! that is met ([`super::surface_point`]); a clear coat has the normal of its base. Media and energy shares are those
//! of green light.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::bvh::Bvh;
use super::layers::{Layer, Layers, Media, coverage};
use super::line::{self, Crossing};
use super::sight::line_through;
use super::surface_point::SurfacePoint;
use crate::scene::light::LightKind;
use crate::scene::material::Material;
use crate::scene::solid::{Solids, solids};
use crate::scene::{AlphaMode, Camera, Scene};

/// Largest number of events per pixel: their tree grows exponentially.
const MOST_EVENTS: usize = 96;
/// Largest number of lights that a surface sends shadow rays to.
const MOST_LIGHTS: usize = 8;

/// Wavelength of indices and energy shares, nm.
pub const GREEN: f64 = 550.0;

/// Limits of the recursion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest number of surfaces along a path.
    pub surfaces: u32,
    /// Perceptual roughness up to which reflection and transmission are followed.
    pub roughest: f32,
    /// Smallest share of the pixel's light that is followed.
    pub least_share: f64,
    /// Whether proxy lights are used, which replace emissive surfaces.
    pub proxies: bool,
}

/// The kind of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// A camera ray.
    Seen,
    /// A reflected ray (F4).
    Mirrored,
    /// A refracted ray at an interface of two media (F5).
    Bent,
    /// A ray straight through a thin-walled surface, or where no medium changes.
    Straight,
    /// A shadow ray to the light with this index (R5).
    ToLight(usize),
}

/// A ray with its end point.
#[derive(Debug, Clone)]
pub struct Event {
    /// Index of the event whose surface the ray leaves; `None` for the camera ray.
    pub after: Option<usize>,
    /// Kind of the ray.
    pub way: Way,
    /// Origin in world space.
    pub from: DVec3,
    /// End point in world space; a ray that leaves the scene ends at a distance of the scene's size.
    pub to: DVec3,
    /// Share of the pixel's light, before absorption; for a shadow ray that of the surface.
    pub share: f64,
    /// The surface at the end; for a shadow ray the occluder.
    pub interaction: Option<Interaction>,
}

/// A surface hit by a ray.
#[derive(Debug, Clone)]
pub struct Interaction {
    /// Index into the scene's instances.
    pub instance: usize,
    /// Index into the scene's materials.
    pub material: usize,
    /// That material at the point that is hit, without textures ([`SurfacePoint::material`]).
    ///
    /// [`SurfacePoint::material`]: super::surface_point::SurfacePoint::material
    pub at: Arc<Material>,
    /// Opacity by alpha; the rest of the light passes straight through.
    pub opacity: f64,
    /// Unit normal on the ray's side.
    pub normal: DVec3,
    /// Cosine of the angle of incidence.
    pub cos: f64,
    /// Relative index of refraction: behind the surface over before it.
    pub ratio: f64,
    /// Reflectance of coat and base together (F2, F3).
    pub reflected: f64,
    /// Reflectance of the dielectric and of the metallic part of the base, without a coat.
    pub parts: [f64; 2],
    /// Whether reflection is total (F6).
    pub total: bool,
    /// Whether the surface scatters the remaining light, or is too rough to be followed.
    pub spreads: bool,
}

/// A scene with its BVH, ready for recursive ray tracing.
pub struct EventTracer {
    bvh: Arc<Bvh>,
    solids: Solids,
    radius: f64,
}

/// A ray on the stack of rays to follow.
struct Pending {
    after: Option<usize>,
    way: Way,
    from: DVec3,
    direction: DVec3,
    share: f64,
    surfaces: u32,
    media: Media,
}

/// The ray through the centre of a pixel: origin and unit direction in world space.
fn pixel_line(camera: &Camera, size: [u32; 2], pixel: [u32; 2]) -> (DVec3, DVec3) {
    let at = DVec2::new(
        (f64::from(pixel[0]) + 0.5) / f64::from(size[0]) * 2.0 - 1.0,
        1.0 - (f64::from(pixel[1]) + 0.5) / f64::from(size[1]) * 2.0,
    );
    line_through(camera, f64::from(size[0]) / f64::from(size[1]), at)
}

fn material(scene: &Scene, instance: usize) -> &Material {
    &scene.materials[scene.meshes[scene.instances[instance].mesh].material]
}

/// Whether the alpha test cuts a surface out at a point.
fn is_hole(scene: &Scene, crossing: &Crossing<'_>) -> bool {
    let is_tested = matches!(material(scene, crossing.triangle.instance as usize).alpha_mode, AlphaMode::Mask(_));
    is_tested && coverage(&crossing.point().material(scene)) == Some(0.0)
}

impl EventTracer {
    /// Prepares a scene with its BVH.
    #[must_use]
    pub fn new(scene: &Scene, bvh: Arc<Bvh>) -> Self {
        let radius = scene.bounds().map_or(1.0, |bounds| bounds.radius());
        Self { bvh, solids: solids(scene), radius }
    }

    /// Traces the ray through the centre of a pixel of `camera`'s picture of `size` pixels, and its secondary rays.
    #[must_use]
    pub fn follow(
        &self,
        scene: &Scene,
        camera: &Camera,
        size: [u32; 2],
        pixel: [u32; 2],
        limits: &Limits,
    ) -> Vec<Event> {
        let (from, direction) = pixel_line(camera, size, pixel);
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
            let mut event =
                Event { after: ray.after, way: ray.way, from: ray.from, to, share: ray.share, interaction: None };
            let Some(crossing) = crossing else {
                events.push(event);
                continue;
            };
            let (interaction, next) = self.at_surface(scene, &ray, &crossing, limits);
            event.interaction = Some(interaction.clone());
            events.push(event);
            if interaction.spreads {
                let from = (index, to);
                events.extend(self.to_lights(scene, from, &interaction, ray.share, limits.proxies));
            }
            // The strongest ray is followed first.
            let mut next: Vec<Pending> = next.into_iter().map(|ray| Pending { after: Some(index), ..ray }).collect();
            next.retain(|ray| ray.share >= limits.least_share && ray.surfaces < limits.surfaces);
            next.sort_by(|a, b| a.share.total_cmp(&b.share));
            open.extend(next);
        }
        events
    }

    /// The point of a triangle at the centre of a pixel of `camera`'s picture of `size` pixels; `None` where no surface
    /// is seen.
    #[must_use]
    pub fn point_at(&self, scene: &Scene, camera: &Camera, size: [u32; 2], pixel: [u32; 2]) -> Option<SurfacePoint> {
        let (from, direction) = pixel_line(camera, size, pixel);
        let crossing = self.nearest_seen(scene, from, direction)?;
        let (instance, primitive) = (crossing.triangle.instance as usize, crossing.triangle.primitive as usize);
        Some(SurfacePoint { instance, primitive, uv: crossing.uv })
    }

    /// The nearest surface that light meets: holes of alpha-tested surfaces are skipped.
    fn nearest(&self, scene: &Scene, from: DVec3, direction: DVec3) -> Option<Crossing<'_>> {
        let mut behind = 1e-6 * self.radius;
        loop {
            let crossing = line::nearest(&self.bvh, from - self.bvh.anchor, direction, behind)?;
            if !is_hole(scene, &crossing) {
                return Some(crossing);
            }
            behind = crossing.t * (1.0 + 1e-9);
        }
    }

    /// The nearest visible surface: back faces of one-sided thin-walled surfaces and holes of alpha-tested ones are
    /// skipped.
    fn nearest_seen(&self, scene: &Scene, from: DVec3, direction: DVec3) -> Option<Crossing<'_>> {
        let mut behind = 1e-6 * self.radius;
        loop {
            let crossing = line::nearest(&self.bvh, from - self.bvh.anchor, direction, behind)?;
            let instance = crossing.triangle.instance as usize;
            let is_seen = self.solids.solid[instance] || material(scene, instance).double_sided;
            if (is_seen || crossing.facing(scene, &self.solids, direction, |n| n).front) && !is_hole(scene, &crossing) {
                return Some(crossing);
            }
            behind = crossing.t * (1.0 + 1e-9);
        }
    }

    /// The interaction of a ray with a surface, and the secondary rays.
    fn at_surface(
        &self,
        scene: &Scene,
        ray: &Pending,
        crossing: &Crossing<'_>,
        limits: &Limits,
    ) -> (Interaction, Vec<Pending>) {
        let instance = crossing.triangle.instance as usize;
        let point = crossing.point();
        let m = &Arc::new(point.material(scene));
        let to = ray.from + ray.direction * crossing.t;
        let facing = crossing.facing(scene, &self.solids, ray.direction, |n| point.bent_normal(scene, n));
        let (normals, cos) = ([facing.normal, facing.flat], (-ray.direction.dot(facing.normal)).clamp(0.0, 1.0));
        let index = |m: &Material| m.dispersion.index(f64::from(m.ior), GREEN);
        let boundary = ray.media.cross(scene, &self.solids, instance, facing.front, index);
        let layers = Layers::of(m, &boundary, cos);
        let green = |layer: Layer| layers.share(layer).y;
        // Of a material without textures alpha is always known.
        let opacity = if boundary.hidden { 0.0 } else { coverage(m).unwrap_or(1.0) };
        let mut interaction = Interaction {
            instance,
            material: scene.meshes[scene.instances[instance].mesh].material,
            at: m.clone(),
            opacity,
            normal: facing.normal,
            cos,
            ratio: layers.ratio,
            reflected: green(Layer::Coat) + green(Layer::Base),
            parts: layers.fresnel.map(|part| part.y),
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
            (interaction.reflected, interaction.total) = (0.0, false);
            return (interaction, vec![leave(Way::Straight, ray.direction, 1.0, &boundary.beyond)]);
        }
        let mut next = Vec::new();
        if opacity < 1.0 {
            // Alpha is no interface: what shows through it is seen however few interfaces are followed.
            next.push(Pending {
                surfaces: ray.surfaces,
                ..leave(Way::Straight, ray.direction, 1.0 - opacity, &ray.media)
            });
        }
        let is_followed = |layer: &Layer| !layers.spreads(*layer, limits.roughest);
        // Slightly rough lobes are followed along their centre.
        let along = |layer| layers.direction(layer, ray.direction, normals, facing.normal);
        // Coat and base reflect into the same direction.
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
        (interaction, next)
    }

    /// Shadow rays to the first few lights.
    fn to_lights(
        &self,
        scene: &Scene,
        (after, at): (usize, DVec3),
        interaction: &Interaction,
        share: f64,
        proxies: bool,
    ) -> Vec<Event> {
        let lights = scene.lights.iter().enumerate().filter(|(_, light)| light.shines() && (proxies || !light.proxy));
        let towards = lights.map(|(index, light)| match light.kind {
            LightKind::Directional { direction } => (index, at - direction * 2.0 * self.radius),
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } => (index, position),
        });
        let lit = towards.filter(|(_, place)| (*place - at).dot(interaction.normal) > 0.0).take(MOST_LIGHTS);
        lit.map(|(index, place)| {
            let way = place - at;
            let direction = way.normalize();
            let crossing = self.nearest(scene, at, direction).filter(|crossing| crossing.t < way.length());
            let interaction = crossing.map(|crossing| {
                let instance = crossing.triangle.instance as usize;
                let normal = crossing.normal(scene);
                let cos = -direction.dot(normal);
                let m = crossing.point().material(scene);
                Interaction {
                    instance,
                    material: scene.meshes[scene.instances[instance].mesh].material,
                    opacity: coverage(&m).unwrap_or(1.0),
                    at: Arc::new(m),
                    normal: normal * cos.signum(),
                    cos: cos.abs(),
                    ratio: 1.0,
                    reflected: 0.0,
                    parts: [0.0; 2],
                    total: false,
                    spreads: false,
                }
            });
            let to = crossing.map_or(place, |crossing| at + direction * crossing.t);
            Event { after: Some(after), way: Way::ToLight(index), from: at, to, share, interaction }
        })
        .collect()
    }
}
