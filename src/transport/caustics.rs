//! Where light comes from by way of what mirrors and bends it: places that paths aim at. A path that goes on from a wall in any
//! direction hardly ever meets the small part of a ball in which the lamp is seen, and is very bright when it does. Light
//! is therefore sent the other way first, a little of it, and what it last left before each part of the scene is kept.
//!
//! Aims only say where paths go more often (photon maps as densities: Jensen, "Importance driven path tracing using the photon
//! map", 1995). They are weighted by the density with which they are drawn, so that however few or wrong they are, the
//! picture is the same in the mean.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::bvh::Bvh;
use super::emitters::{Emitter, Emitters, Source};
use super::layers::{Layer, Layers, Media, coverage};
pub use super::layers::{SMOOTHEST, is_smooth};
use super::line::{self, Crossing};
use crate::scene::solid::Solids;
use crate::scene::{Instance, Scene};
use crate::share::AIM_COUNT_BITS;

/// Photons that are sent.
const PHOTONS: u64 = 1 << 19;
/// Surfaces that one of them may meet.
const MOST_SURFACES: usize = 12;
/// Cells along the longest side of the scene.
const CELLS: f64 = 32.0;
/// Aims of one cell: shaders/lib/aims.glsl goes through all of them for each direction that it weighs.
const MOST_AIMS: usize = 8;
const _: () = assert!(MOST_AIMS < 1 << AIM_COUNT_BITS);
/// Photons that the aims of one cell are made from.
const MOST_PHOTONS: usize = 96;
/// Radii of what is aimed at, in cells.
const RADII: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Around them: few photons do not tell where what they stand for ends.
const MARGIN: f64 = 1.2;
/// Steps of shares in 1: no more than a half holds exactly.
const SHARES: f64 = 1024.0;
/// Least share over the largest of its cell.
const WORTH_AIMING: f64 = 0.05;

/// Balls around what light last left, for each cell of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Aims {
    /// Least corner of the grid, in bvh space.
    pub corner: DVec3,
    /// Length of a cell's sides, metres.
    pub cell: f64,
    /// How many cells there are along x, y and z; x varies fastest.
    pub cells: [u32; 3],
    /// For each cell its first aim `<<` [`AIM_COUNT_BITS`] `|` how many it has.
    pub firsts: Vec<u32>,
    /// What is aimed at from the cells, one cell after the other.
    pub aims: Vec<Ball>,
}

/// What paths aim at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// In bvh space.
    pub middle: DVec3,
    /// Metres.
    pub radius: f64,
    /// Of the aims of its cell.
    pub share: f64,
}

/// Light that arrived at a surface that spreads it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Photon {
    at: DVec3,
    /// Where it left the surface before.
    from: DVec3,
}

/// A line along which light is sent.
struct Beam {
    origin: DVec3,
    direction: DVec3,
    media: Media,
}

/// What photons go through.
struct World<'a> {
    scene: &'a Scene,
    solids: &'a Solids,
    bvh: &'a Bvh,
    emitters: &'a Emitters,
    /// First triangle of each instance.
    firsts: Vec<u32>,
    /// Of each instance that emits, media that its first corner lies in.
    media: Vec<Media>,
    /// Instances that stop light or spread it, whatever else.
    diffuse: Vec<bool>,
    middle: DVec3,
    radius: f64,
}

/// Numbers in [0, 1) (splitmix64; Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f64 {
        (self.word() >> 11) as f64 / 9_007_199_254_740_992.0
    }

    /// In the unit circle, evenly.
    fn disk(&mut self) -> DVec2 {
        let radius = self.unit().sqrt();
        DVec2::from_angle(std::f64::consts::TAU * self.unit()) * radius
    }

    /// A unit direction by its cosine with n.
    fn above(&mut self, n: DVec3) -> DVec3 {
        let (across, up) = n.any_orthonormal_pair();
        let at = self.disk();
        across * at.x + up * at.y + n * (1.0 - at.length_squared()).max(0.0).sqrt()
    }
}

impl World<'_> {
    /// A line along which light is sent, by what sends most.
    fn start(&self, random: &mut Random) -> Option<Beam> {
        let word = (random.word() >> 32) as u32;
        let list = &self.emitters.list;
        let found = list.partition_point(|emitter| emitter.first <= word).checked_sub(1)?;
        let Emitter { source, .. } = list[found];
        match source {
            // No ray meets them.
            Source::Punctual(_) => None,
            Source::Sky => {
                let towards = self.emitters.sky.direction([(); 2].map(|()| (random.word() >> 32) as u32));
                let (across, up) = towards.any_orthonormal_pair();
                let at = random.disk();
                let origin = self.middle + self.radius * (towards + across * at.x + up * at.y);
                Some(Beam { origin, direction: -towards, media: Media::default() })
            }
            Source::Triangle { index, two_sided, .. } => {
                let instance = self.firsts.partition_point(|&first| first <= index) - 1;
                let placed = &self.scene.instances[instance];
                let mesh = &self.scene.meshes[placed.mesh];
                let first = 3 * (index - self.firsts[instance]) as usize;
                let [a, b, c] = [0, 1, 2].map(|k| {
                    let p = glam::Vec3::from(mesh.positions[mesh.indices[first + k] as usize]).as_dvec3();
                    placed.world_from_object.transform_point3(p) - self.bvh.anchor
                });
                let (x, y) = (random.unit().sqrt(), random.unit());
                let n = (b - a).cross(c - a).normalize();
                let mirrored = placed.world_from_object.matrix3.determinant() < 0.0;
                let back = (two_sided && random.unit() < 0.5) != mirrored;
                let direction = random.above(if back { -n } else { n });
                let origin = a + (b - a) * (x * (1.0 - y)) + (c - a) * (x * y);
                Some(Beam { origin, direction, media: self.media[instance].clone() })
            }
        }
    }

    /// Follows one photon to the first surface that spreads it after some surface has mirrored or bent it, and to the next from
    /// there: spots of such light are small and bright, and light others.
    fn follow(&self, number: u64) -> impl Iterator<Item = Photon> {
        let mut found = [None; 2];
        let mut random = Random(number);
        let mut next = self.start(&mut random);
        let mut from = None;
        for _ in 0..MOST_SURFACES {
            let Some(beam) = next else { break };
            let Some(met) = line::nearest(self.bvh, beam.origin, beam.direction, 1e-6 * self.radius) else { break };
            // Most photons end here: light that nothing has mirrored or bent is found by the search for lights.
            if from.is_none() && self.diffuse[met.triangle.instance as usize] {
                break;
            }
            let at = beam.origin + beam.direction * met.t;
            let (spreads, onward) = self.meet(&met, &beam, &mut random);
            next = onward.map(|(direction, media)| Beam { origin: at, direction, media });
            if !spreads {
                // What goes straight on is found by the search for lights.
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

    /// Whether a surface spreads the light that it has received, and where that goes on.
    fn meet(&self, met: &Crossing, beam: &Beam, random: &mut Random) -> (bool, Option<(DVec3, Media)>) {
        let instance = met.triangle.instance as usize;
        let material = &self.scene.materials[self.scene.meshes[self.scene.instances[instance].mesh].material];
        let facing = met.facing(self.scene, self.solids, beam.direction);
        let boundary = beam.media.cross(self.scene, self.solids, instance, facing.front, |m| m.ior.into());
        if boundary.hidden {
            return (false, Some((beam.direction, boundary.beyond)));
        }
        // Where a texture has the alpha, photons go past: what lies behind is not left without any.
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

/// Whether all that an instance sends on is spread: nothing passes its surface, and no layer of it is smooth.
fn is_diffuse(scene: &Scene, solids: &Solids, instance: usize) -> bool {
    let material = &scene.materials[scene.meshes[scene.instances[instance].mesh].material];
    !solids.solid[instance] && coverage(material) == Some(1.0) && !is_smooth(material)
}

/// Media that the first corner of an instance lies in, where that emits.
fn media_of_lamp(scene: &Scene, solids: &Solids, placed: &Instance) -> Media {
    let mesh = &scene.meshes[placed.mesh];
    let corner = mesh.indices.first().filter(|_| scene.materials[mesh.material].emissive != [0.0; 3]);
    corner.map_or_else(Media::default, |&corner| {
        let p = glam::Vec3::from(mesh.positions[corner as usize]).as_dvec3();
        Media::at(scene, solids, placed.world_from_object.transform_point3(p))
    })
}

impl Aims {
    /// For paths through a scene.
    #[must_use]
    pub fn of(scene: &Scene, solids: &Solids, bvh: &Bvh, emitters: &Emitters) -> Self {
        let Some(bounds) = bvh.nodes.first().map(|root| *root.bounds()) else {
            return Self { corner: DVec3::ZERO, cell: 1.0, cells: [1; 3], firsts: vec![0], aims: Vec::new() };
        };
        let corner = DVec3::from(bounds.min.map(f64::from));
        let size = DVec3::from(bounds.max.map(f64::from)) - corner;
        let world = World {
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
        // What bounds the scene lies well within the outermost cells.
        let corner = corner - 0.5 * cell;
        let cells = (size / cell).to_array().map(|n| n.ceil() as u32 + 1);
        // Photons of the cells beside a cell count as its own: paths meet surfaces between them, too.
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
        let of_cells: Vec<(u32, Vec<Ball>)> =
            order.into_par_iter().map(|(place, from)| (place, balls(&from, cell))).collect();
        let mut firsts = vec![0; cells.iter().product::<u32>() as usize];
        let mut aims = Vec::new();
        for (place, balls) in of_cells {
            firsts[place as usize] = (aims.len() << AIM_COUNT_BITS | balls.len()) as u32;
            aims.extend(balls);
        }
        Self { corner, cell, cells, firsts, aims }
    }
}

/// At most [`MOST_AIMS`] balls around points, of few sizes: one by one that which holds most of what is left, as light falls on it
/// unevenly. What a ball of radius r holds is missed by a path that does not aim with a variance of (points)²/r²; aims are
/// shared out by its root.
fn balls(points: &[DVec3], cell: f64) -> Vec<Ball> {
    let mut left = points.to_vec();
    let mut found: Vec<Ball> = Vec::new();
    while found.len() < MOST_AIMS && !left.is_empty() {
        let held =
            |middle: DVec3, radius: f64| left.iter().filter(|p| p.distance_squared(middle) <= radius * radius).count();
        let candidates = left.iter().flat_map(|&middle| RADII.map(|radius| (middle, radius * cell)));
        let scored = candidates.map(|(middle, radius)| ((held(middle, radius) as f64 - 0.5) / radius, middle, radius));
        let Some((score, middle, radius)) = scored.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if found.first().is_some_and(|first| score < WORTH_AIMING * first.share) {
            break;
        }
        found.push(Ball { middle, radius: MARGIN * radius, share: score });
        left.retain(|p| p.distance_squared(middle) > radius * radius);
    }
    // In steps that a half holds exactly: what is drawn by shares that do not add up to 1 is drawn by another density.
    let sum: f64 = found.iter().map(|ball| ball.share).sum();
    found.iter_mut().for_each(|ball| ball.share = (ball.share / sum * SHARES).floor().max(1.0) / SHARES);
    let others: f64 = found.iter().skip(1).map(|ball| ball.share).sum();
    if let Some(first) = found.first_mut() {
        first.share = 1.0 - others;
    }
    found
}
