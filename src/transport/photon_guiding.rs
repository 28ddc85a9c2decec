//! Path guiding by photons: the guiding distribution of path tracing, from photon mapping.
//!
//! Read Jensen 1995, "Importance Driven Path Tracing using the Photon Map"; pbrt (4th ed.), section 13.4 (path
//! tracing). BSDF sampling at a diffuse surface rarely hits the small part of a sphere in which the lamp is seen, and
//! the path is then very bright (a caustic). A few photons are therefore traced from the lights first. For each cell of
//! a grid over the scene, a few bounding spheres cover the points that photons last left before they arrived in the
//! cell. A path in the cell samples the cones of these spheres.
//!
//! The guiding distribution only changes how often paths take a direction. The mixture density with BSDF sampling
//! divides the estimate, so the expected picture is the same, however few or wrong the photons are.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::bvh::Bvh;
use super::emitters::{Emitter, EmitterSource, Emitters, SceneTriangle};
use super::layers::{Layer, Layers, Media, coverage};
pub use super::layers::{SMOOTHEST, is_smooth};
use super::line::{self, Crossing};
use crate::optics::SplitMix64;
use crate::scene::solid::Solids;
use crate::scene::{Instance, Scene};
use crate::share::GUIDING_COUNT_BITS;

/// Number of photons.
const PHOTONS: u64 = 1 << 19;
/// Largest number of surfaces along a photon's path.
const MOST_SURFACES: usize = 12;
/// Cells along the longest side of the scene.
const CELLS: f64 = 32.0;
/// Largest number of spheres per cell: shaders/lib/path_guiding.glsl loops over all of them to evaluate the density.
const MOST_SPHERES: usize = 8;
const _: () = assert!(MOST_SPHERES < 1 << GUIDING_COUNT_BITS);
/// Largest number of photons from which a cell's spheres are made.
const MOST_PHOTONS: usize = 96;
/// Candidate radii of the spheres, in cells.
const RADII: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Factor on the radii: few photons do not show the extent of the region that they represent.
const MARGIN: f64 = 1.2;
/// Probabilities are multiples of 1/1024, which a half float stores exactly.
const SHARES: f64 = 1024.0;
/// Smallest score of a sphere relative to the largest of its cell.
const WORTH_AIMING: f64 = 0.05;

/// The guiding distribution: bounding spheres of the points that light last left, for each cell of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct PhotonGuiding {
    /// Smallest corner of the grid, in bvh space.
    pub corner: DVec3,
    /// Side of a cell in metres.
    pub cell: f64,
    /// Number of cells along x, y and z; x varies fastest.
    pub cells: [u32; 3],
    /// For each cell the index of its first sphere `<<` [`GUIDING_COUNT_BITS`] `|` its number of spheres.
    pub firsts: Vec<u32>,
    /// The spheres of all cells, one cell after the other.
    pub spheres: Vec<GuidingBall>,
}

/// A bounding sphere of the guiding distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuidingBall {
    /// Centre in bvh space.
    pub middle: DVec3,
    /// Radius in metres.
    pub radius: f64,
    /// Probability among the spheres of its cell.
    pub share: f64,
}

/// A photon that arrived at a diffuse or glossy surface.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Photon {
    at: DVec3,
    /// The point on the previous surface that the photon left.
    from: DVec3,
}

/// A ray of a photon.
struct Beam {
    origin: DVec3,
    direction: DVec3,
    media: Media,
}

/// The scene that photons are traced through.
struct PhotonWorld<'a> {
    scene: &'a Scene,
    solids: &'a Solids,
    bvh: &'a Bvh,
    emitters: &'a Emitters,
    /// Index of the first triangle of each instance.
    firsts: Vec<u32>,
    /// For each emissive instance, the media around its first corner.
    media: Vec<Media>,
    /// Whether an instance is opaque and purely diffuse or glossy.
    diffuse: Vec<bool>,
    middle: DVec3,
    radius: f64,
}

/// Random numbers of photons.
pub(super) struct PhotonRandom(SplitMix64);

impl PhotonRandom {
    pub(super) fn new(number: u64) -> Self {
        Self(SplitMix64::new(number))
    }

    pub(super) fn word(&mut self) -> u64 {
        self.0.bits()
    }

    pub(super) fn unit(&mut self) -> f64 {
        self.0.unit()
    }

    /// A uniform point in the unit disk.
    fn disk(&mut self) -> DVec2 {
        let radius = self.unit().sqrt();
        DVec2::from_angle(std::f64::consts::TAU * self.unit()) * radius
    }

    /// A cosine-weighted unit direction around n.
    fn above(&mut self, n: DVec3) -> DVec3 {
        let (across, up) = n.any_orthonormal_pair();
        let at = self.disk();
        across * at.x + up * at.y + n * (1.0 - at.length_squared()).max(0.0).sqrt()
    }
}

impl PhotonWorld<'_> {
    /// Samples a light by power and a ray that leaves it.
    fn start(&self, random: &mut PhotonRandom) -> Option<Beam> {
        let word = (random.word() >> 32) as u32;
        let list = &self.emitters.list;
        let found = list.partition_point(|emitter| emitter.first <= word).checked_sub(1)?;
        let Emitter { source, .. } = list[found];
        match source {
            // No BSDF-sampled ray hits a punctual light.
            EmitterSource::Punctual(_) => None,
            EmitterSource::Environment => {
                let towards = self.emitters.environment.direction([(); 2].map(|()| (random.word() >> 32) as u32));
                let (across, up) = towards.any_orthonormal_pair();
                let at = random.disk();
                let origin = self.middle + self.radius * (towards + across * at.x + up * at.y);
                Some(Beam { origin, direction: -towards, media: Media::default() })
            }
            EmitterSource::Triangle { index, two_sided, .. } => {
                let SceneTriangle { instance, corners, front, .. } = SceneTriangle::of(self.scene, &self.firsts, index);
                let [a, b, c] = corners.map(|corner| corner - self.bvh.anchor);
                let (x, y) = (random.unit().sqrt(), random.unit());
                let back = two_sided && random.unit() < 0.5;
                let direction = random.above(if back { -front } else { front });
                let origin = a + (b - a) * (x * (1.0 - y)) + (c - a) * (x * y);
                Some(Beam { origin, direction, media: self.media[instance].clone() })
            }
        }
    }

    /// Traces one photon to the first diffuse or glossy surface after a specular one, and to the next from there:
    /// caustics are small and bright, and light other surfaces.
    fn follow(&self, number: u64) -> impl Iterator<Item = Photon> {
        let mut found = [None; 2];
        let mut random = PhotonRandom::new(number);
        let mut next = self.start(&mut random);
        let mut from = None;
        for _ in 0..MOST_SURFACES {
            let Some(beam) = next else { break };
            let Some(met) = line::nearest(self.bvh, beam.origin, beam.direction, 1e-6 * self.radius) else { break };
            // Most photons end here: next event estimation finds light without a specular surface in between.
            if from.is_none() && self.diffuse[met.triangle.instance as usize] {
                break;
            }
            let at = beam.origin + beam.direction * met.t;
            let (spreads, onward) = self.meet(&met, &beam, &mut random);
            next = onward.map(|(direction, media)| Beam { origin: at, direction, media });
            if !spreads {
                // Next event estimation also finds light that passes straight through.
                if next.as_ref().is_some_and(|next| next.direction != beam.direction) {
                    from = Some(at);
                }
                continue;
            }
            let Some(left) = from else { break };
            if found[0].is_some() {
                found[1] = Some(Photon { at, from: left });
                break;
            }
            found[0] = Some(Photon { at, from: left });
            from = Some(at);
        }
        found.into_iter().flatten()
    }

    /// Whether a surface scatters the photon (diffuse or glossy), and the ray that continues: direction and media.
    fn meet(&self, met: &Crossing, beam: &Beam, random: &mut PhotonRandom) -> (bool, Option<(DVec3, Media)>) {
        let instance = met.triangle.instance as usize;
        let material = &self.scene.materials[self.scene.meshes[self.scene.instances[instance].mesh].material];
        let facing = met.facing(self.scene, self.solids, beam.direction, |n| n);
        let boundary = beam.media.cross(self.scene, self.solids, instance, facing.front, |m| m.ior.into());
        if boundary.hidden {
            return (false, Some((beam.direction, boundary.beyond)));
        }
        // Alpha from a texture is unknown, so photons pass: surfaces behind then still get guiding.
        if random.unit() >= coverage(material).unwrap_or(0.0) {
            return (false, Some((beam.direction, beam.media.clone())));
        }
        let layers = Layers::of(material, &boundary, -beam.direction.dot(facing.normal));
        let Some(layer) = layers.sample(random.unit()) else { return (layers.spreads_some(SMOOTHEST), None) };
        let spreads = layers.spreads(layer, SMOOTHEST);
        if layer == Layer::Ground {
            return (spreads, Some((random.above(facing.flat), beam.media.clone())));
        }
        let h = layers.half_vector(layer, beam.direction, facing.normal, [random.unit(), random.unit()]);
        let direction = layers.direction(layer, beam.direction, [facing.normal, facing.flat], h);
        let enters = layer == Layer::Through && self.solids.solid[instance];
        let media = if enters { boundary.beyond } else { beam.media.clone() };
        (spreads, direction.map(|direction| (direction, media)))
    }
}

/// Whether an instance only scatters: it is opaque, and no layer has a specular lobe.
fn is_diffuse(scene: &Scene, solids: &Solids, instance: usize) -> bool {
    let material = &scene.materials[scene.meshes[scene.instances[instance].mesh].material];
    !solids.solid[instance] && coverage(material) == Some(1.0) && !is_smooth(material)
}

/// The media around the first corner of an emissive instance.
fn media_of_lamp(scene: &Scene, solids: &Solids, placed: &Instance) -> Media {
    let mesh = &scene.meshes[placed.mesh];
    let corner = mesh.indices.first().filter(|_| scene.materials[mesh.material].emissive != [0.0; 3]);
    corner.map_or_else(Media::default, |&corner| {
        let p = glam::Vec3::from(mesh.positions[corner as usize]).as_dvec3();
        Media::at(scene, solids, placed.world_from_object.transform_point3(p))
    })
}

impl PhotonGuiding {
    /// The guiding distribution of a scene.
    #[must_use]
    pub fn of(scene: &Scene, solids: &Solids, bvh: &Bvh, emitters: &Emitters) -> Self {
        let Some(bounds) = bvh.nodes.first().map(|root| *root.bounds()) else {
            return Self { corner: DVec3::ZERO, cell: 1.0, cells: [1; 3], firsts: vec![0], spheres: Vec::new() };
        };
        let corner = DVec3::from(bounds.min.map(f64::from));
        let size = DVec3::from(bounds.max.map(f64::from)) - corner;
        let world = PhotonWorld {
            scene,
            solids,
            bvh,
            emitters,
            firsts: scene.first_triangles(),
            media: scene.instances.iter().map(|placed| media_of_lamp(scene, solids, placed)).collect(),
            diffuse: (0..scene.instances.len()).map(|instance| is_diffuse(scene, solids, instance)).collect(),
            middle: corner + size * 0.5,
            radius: 0.5 * size.length(),
        };
        let photons: Vec<Photon> = (0..PHOTONS).into_par_iter().flat_map_iter(|i| world.follow(i)).collect();
        Self::around(corner, size, &photons)
    }

    fn around(corner: DVec3, size: DVec3, photons: &[Photon]) -> Self {
        let cell = size.max_element() / CELLS;
        // The scene's bounds then lie well inside the outermost cells.
        let corner = corner - 0.5 * cell;
        let cells = (size / cell).to_array().map(|n| n.ceil() as u32 + 1);
        // Photons of neighbouring cells count, too: the grid has no discontinuities at cell borders that way.
        let mut found: HashMap<u32, Vec<DVec3>> = HashMap::new();
        for photon in photons {
            let at = ((photon.at - corner) / cell).floor();
            for i in 0..27 {
                let step = DVec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9)) - 1.0;
                let place = at + step;
                if place.cmpge(DVec3::ZERO).all() && place.cmplt(DVec3::from(cells.map(f64::from))).all() {
                    let [x, y, z] = place.to_array().map(|n| n as u32);
                    let of_cell = found.entry(x + cells[0] * (y + cells[1] * z)).or_default();
                    if of_cell.len() < MOST_PHOTONS {
                        of_cell.push(photon.from);
                    }
                }
            }
        }
        let mut order: Vec<(u32, Vec<DVec3>)> = found.into_iter().collect();
        order.sort_unstable_by_key(|(place, _)| *place);
        let of_cells: Vec<(u32, Vec<GuidingBall>)> =
            order.into_par_iter().map(|(place, from)| (place, spheres(&from, cell))).collect();
        let mut firsts = vec![0; cells.iter().product::<u32>() as usize];
        let mut all = Vec::new();
        for (place, spheres) in of_cells {
            firsts[place as usize] = (all.len() << GUIDING_COUNT_BITS | spheres.len()) as u32;
            all.extend(spheres);
        }
        Self { corner, cell, cells, firsts, spheres: all }
    }
}

/// At most [`MOST_SPHERES`] spheres that cover the points, chosen greedily: each is the candidate with the best score
/// among the points not yet covered. BSDF sampling alone finds a sphere of radius r with a variance of (points)²/r²;
/// the score and the probability are proportional to its root.
fn spheres(points: &[DVec3], cell: f64) -> Vec<GuidingBall> {
    let mut left = points.to_vec();
    let mut found: Vec<GuidingBall> = Vec::new();
    while found.len() < MOST_SPHERES && !left.is_empty() {
        let held =
            |middle: DVec3, radius: f64| left.iter().filter(|p| p.distance_squared(middle) <= radius * radius).count();
        let candidates = left.iter().flat_map(|&middle| RADII.map(|radius| (middle, radius * cell)));
        let scored = candidates.map(|(middle, radius)| ((held(middle, radius) as f64 - 0.5) / radius, middle, radius));
        let Some((score, middle, radius)) = scored.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if found.first().is_some_and(|first| score < WORTH_AIMING * first.share) {
            break;
        }
        found.push(GuidingBall { middle, radius: MARGIN * radius, share: score });
        left.retain(|p| p.distance_squared(middle) > radius * radius);
    }
    // Probabilities are exact in half floats: if they did not sum to 1, the sampled density would differ from the
    // computed one.
    let sum: f64 = found.iter().map(|sphere| sphere.share).sum();
    found.iter_mut().for_each(|sphere| sphere.share = (sphere.share / sum * SHARES).floor().max(1.0) / SHARES);
    let others: f64 = found.iter().skip(1).map(|sphere| sphere.share).sum();
    if let Some(first) = found.first_mut() {
        first.share = 1.0 - others;
    }
    found
}
