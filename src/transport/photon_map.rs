//! The photon map: photons of punctual lights that smooth surfaces deflect, and the density of those that landed.
//!
//! Read Jensen 2001, "Realistic Image Synthesis Using Photon Mapping"; Silverman 1986, "Density Estimation for
//! Statistics and Data Analysis", section 5.3; docs/decisions/paths.md. No path from the eye reaches a punctual light
//! by way of a smooth surface: the chance to meet a light without an area is 0. Photons do. The host chooses rays that
//! leave the lights towards smooth surfaces; the device traces them (shaders/pass/trace_photons.comp), so that
//! materials have one implementation. Then the host spreads each landed photon over a disk and builds a bounding volume
//! hierarchy over the disks, in which path vertices look up (shaders/lib/photon_map.glsl). Coordinates are in bvh
//! space, metres.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::aabb::Aabb;
use super::bvh::{Bvh, Triangle};
use super::layers::{coverage, deflects, immerses};
use super::line;
use super::octahedral::{octahedral_from_unit, pack_snorm_2x8, pack_snorm_2x16};
use super::photon_guiding::PhotonRandom;
use crate::scene::solid::Solids;
use crate::scene::{Extent, Instance, Light, LightKind, Scene};
use crate::share::{DISK_THICKNESS, Landing, PHOTON_COUNT_BITS, Photon, PhotonNode, PhotonRay, SAME_SURFACE};

/// Neighbours of a photon on its surface inside its disk. With fewer the density is noisier, with more it is blurred.
const NEIGHBOURS: usize = 8;
/// Largest number of photons in a leaf.
const LEAF: usize = 4;
const _: () = assert!(LEAF < 1 << PHOTON_COUNT_BITS);
/// Smallest and largest radius of a disk, relative to the radius of the scene.
const RADII: [f64; 2] = [1e-6, 0.1];
/// Smallest cosine of incidence of a photon: its irradiance perpendicular to its direction is its power over it.
const GRAZING: f64 = 1e-3;
/// Rays that look for smooth surfaces, over all lights.
const PILOT_RAYS: usize = 1 << 18;
/// Such rays in each cell of a light's directions.
const PILOTS_IN_CELL: usize = 4;
/// Largest number of cells along each side of the square of a light's directions.
const MOST_CELLS: usize = 128;

/// Point `i` of the R2 sequence in the unit square, of low discrepancy (Roberts 2018): additive recurrence by powers of
/// the plastic number.
fn r2_point(i: u64) -> DVec2 {
    // Fractions of 2^64, whose sums wrap around by themselves.
    const STEPS: [u64; 2] = [0xc13f_a9a9_02a6_328f, 0x91e1_0da5_c79e_7b1c];
    DVec2::from(STEPS.map(|step| i.wrapping_mul(step) as f64 / 18_446_744_073_709_551_616.0))
        .min(DVec2::splat(1.0_f64.next_down()))
}

/// The directions of a light as a unit square, of equal measure everywhere; of a directional light its cross-section.
struct EmissionDomain {
    is_directional: bool,
    /// Shape of a light that emits from an area.
    extent: Option<Extent>,
    /// Position in bvh space; of a directional light the centre of the scene.
    middle: DVec3,
    /// Unit axis, and two directions across it.
    axis: DVec3,
    across: [DVec3; 2],
    /// 1 − the cosine of the cone of directions about the axis; of a directional light half the side of the square.
    spread: f64,
    /// Measure of the whole square: solid angle in sr, or area in m².
    measure: f64,
}

impl EmissionDomain {
    fn new(light: &Light, shaped: bool, anchor: DVec3, (middle, radius): (DVec3, f64)) -> Self {
        let (middle, axis, spread, measure) = match light.kind {
            LightKind::Directional { direction } => (middle, direction, radius, 4.0 * radius * radius),
            LightKind::Point { position, .. } => (position - anchor, DVec3::Y, 2.0, 4.0 * PI),
            LightKind::Spot { position, direction, outer, .. } => {
                let spread = 1.0 - outer.cos();
                (position - anchor, direction, spread, TAU * spread)
            }
        };
        let (x, y) = axis.any_orthonormal_pair();
        let is_directional = matches!(light.kind, LightKind::Directional { .. });
        let extent = light.extent.filter(|_| shaped);
        Self { is_directional, extent, middle, axis, across: [x, y], spread, measure }
    }

    /// Origin and direction of the ray at a point of the square; `on` chooses the point on a light with an area. The
    /// third value is the cosine with which a flat light emits.
    fn ray(&self, at: DVec2, on: DVec2) -> (DVec3, DVec3, f64) {
        let [x, y] = self.across;
        if self.is_directional {
            let place = (at * 2.0 - 1.0) * self.spread;
            return (self.middle + x * place.x + y * place.y - self.axis * (2.0 * self.spread), self.axis, 1.0);
        }
        let turn = DVec2::from_angle(TAU * at.x);
        let below = at.y * self.spread;
        let flat = (below * (2.0 - below)).max(0.0).sqrt();
        let direction = x * (turn.x * flat) + y * (turn.y * flat) + self.axis * (1.0 - below);
        let Some(extent) = self.extent else { return (self.middle, direction, 1.0) };
        let disk = DVec2::from_angle(TAU * on.x) * on.y.sqrt();
        let cosine = direction.dot(self.axis);
        match extent {
            // The side that faces the direction, of equal projected area everywhere.
            Extent::Sphere { radius } => {
                let (u, v) = direction.any_orthonormal_pair();
                let front = (1.0 - disk.length_squared()).max(0.0).sqrt();
                (self.middle + (u * disk.x + v * disk.y + direction * front) * radius, direction, 1.0)
            }
            Extent::Disk { radius } => (self.middle + (x * disk.x + y * disk.y) * radius, direction, cosine),
            Extent::Rectangle { across, half_height } => {
                let up = self.axis.cross(across).normalize() * half_height;
                (self.middle + across * (2.0 * on.x - 1.0) + up * (2.0 * on.y - 1.0), direction, cosine)
            }
        }
    }

    /// The point of the square whose ray passes a point, if one does.
    fn place(&self, p: DVec3) -> Option<DVec2> {
        let off = p - self.middle;
        let [x, y] = self.across.map(|axis| off.dot(axis));
        let at = match self.is_directional {
            true => DVec2::new(x, y) / (2.0 * self.spread) + 0.5,
            false => {
                let below = 1.0 - off.dot(self.axis) / off.length();
                DVec2::new((y.atan2(x) / TAU).rem_euclid(1.0), below / self.spread)
            }
        };
        (at.cmpge(DVec2::ZERO) & at.cmplt(DVec2::ONE)).all().then_some(at)
    }
}

/// What the surface of an instance does to photons.
#[derive(Clone, Copy, PartialEq, Eq)]
enum PhotonSurface {
    /// Some of it is smooth.
    Deflects,
    /// Photons may pass it.
    Passes,
    /// It is opaque, and nowhere smooth.
    Ends,
}

impl PhotonSurface {
    /// By instance. Materials are looked at once each, because their textures are.
    fn of_instances(scene: &Scene, solids: &Solids) -> Vec<Self> {
        let immersed = scene.materials.iter().any(immerses);
        let deflecting: Vec<bool> =
            scene.materials.iter().map(|material| deflects(scene, material, immersed)).collect();
        let of = |(instance, placed): (usize, &Instance)| {
            let index = scene.meshes[placed.mesh].material;
            let material = &scene.materials[index];
            match (deflecting[index], coverage(material)) {
                (true, _) => Self::Deflects,
                (false, Some(1.0)) if material.transmission == 0.0 && !solids.solid[instance] => Self::Ends,
                _ => Self::Passes,
            }
        };
        scene.instances.iter().enumerate().map(of).collect()
    }
}

/// The cells of a source's square that smooth surfaces may lie in.
struct Cells {
    side: usize,
    wanted: Vec<bool>,
    /// The rectangle around them: its smallest corner and its size, in parts of the square.
    corner: DVec2,
    size: DVec2,
}

impl Cells {
    fn of(domain: &EmissionDomain, bvh: &Bvh, surfaces: &[PhotonSurface], side: usize, least: f64) -> Self {
        // From a light with an area a small surface is seen in other directions at each of its points.
        let mut seen = vec![domain.extent.is_some(); side * side];
        let cell = |at: DVec2| (at.x * side as f64) as usize + side * (at.y * side as f64) as usize;
        let surface_of = |triangle: &Triangle| surfaces[triangle.instance as usize];
        // Large surfaces are met by rays through each cell.
        for (place, seen) in seen.iter_mut().enumerate() {
            let corner = DVec2::new((place % side) as f64, (place / side) as f64);
            *seen |= (0..PILOTS_IN_CELL).any(|i| {
                let number = (place * PILOTS_IN_CELL + i) as u64;
                let at = (corner + r2_point(number)) / side as f64;
                let (origin, direction, _) = domain.ray(at, r2_point(number ^ 1));
                line::nearest(bvh, origin, direction, least)
                    .is_some_and(|met| surface_of(met.triangle) != PhotonSurface::Ends)
            });
        }
        // Small and thin ones may lie between the rays; points along their edges tell the cells.
        for triangle in bvh.triangles.iter().filter(|triangle| surface_of(triangle) == PhotonSurface::Deflects) {
            let corners = triangle.corners.map(|corner| Vec3::from(corner).as_dvec3());
            for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (corners[a], corners[b])) {
                let across = match [from, to].map(|corner| domain.place(corner)) {
                    [Some(one), Some(other)] => (one - other).abs().max_element(),
                    _ => 1.0,
                };
                let steps = (2.0 * across * side as f64).ceil().max(1.0);
                for i in 0..steps as usize {
                    if let Some(at) = domain.place(from.lerp(to, i as f64 / steps)) {
                        seen[cell(at)] = true;
                    }
                }
            }
        }
        // Neighbours as well: what lies across a border is then not cut off. Directions wrap around the axis, and all
        // cells at a pole are neighbours.
        let wraps = !domain.is_directional;
        let pole = |row: usize| wraps && (row == 0 || (row + 1 == side && domain.spread >= 2.0));
        let is_seen = |x: usize, y: usize| match pole(y) {
            true => seen[y * side..][..side].contains(&true),
            false => seen[y * side + x],
        };
        let wanted = (0..side * side).map(|place| {
            let (x, y) = (place % side, place / side);
            let columns = match wraps {
                true => [(x + side - 1) % side, x, (x + 1) % side],
                false => [x.saturating_sub(1), x, (x + 1).min(side - 1)],
            };
            (y.saturating_sub(1)..=(y + 1).min(side - 1)).any(|row| columns.iter().any(|&x| is_seen(x, row)))
        });
        let wanted: Vec<bool> = wanted.collect();
        let places = (0..side * side).filter(|&place| wanted[place]);
        let places = places.map(|place| DVec2::new((place % side) as f64, (place / side) as f64));
        let (low, high) =
            places.fold((DVec2::splat(side as f64), DVec2::ZERO), |(low, high), at| (low.min(at), high.max(at + 1.0)));
        let (corner, size) = (low / side as f64, (high - low).max(DVec2::ZERO) / side as f64);
        Self { side, wanted, corner, size }
    }

    /// Their part of the square.
    fn share(&self) -> f64 {
        self.wanted.iter().filter(|wanted| **wanted).count() as f64 / self.wanted.len() as f64
    }

    /// Part of the square that the rectangle around them is.
    fn around(&self) -> f64 {
        self.size.x * self.size.y
    }

    fn contains(&self, at: DVec2) -> bool {
        let [x, y] = [at.x, at.y].map(|x| ((x * self.side as f64) as usize).min(self.side - 1));
        self.wanted[y * self.side + x]
    }
}

/// Photons that leave the punctual lights of a scene towards its smooth surfaces.
pub struct PhotonEmission {
    lights: Vec<PhotonSource>,
    /// Radius of the scene in metres.
    radius: f64,
}

/// The photons of one light.
struct PhotonSource {
    domain: EmissionDomain,
    cells: Cells,
    /// Points of the rectangle around the wanted cells; those in wanted cells are photons.
    points: u64,
    /// Media around the light, as entries of shaders/lib/media.glsl.
    media: [u32; 4],
}

impl PhotonEmission {
    /// Some `count` photons of a scene's punctual lights, in proportion to the lights' power towards smooth surfaces;
    /// `None` where no smooth surface is in sight of a light. Lights with an area emit from all of it where `shaped`.
    /// `media` gives the media around a point of the world.
    #[must_use]
    pub fn new(
        (scene, solids, bvh): (&Scene, &Solids, &Bvh),
        shaped: bool,
        count: u32,
        media: impl Fn(DVec3) -> [u32; 4] + Sync,
    ) -> Option<Self> {
        let bounds = bvh.nodes.first()?.bounds();
        let [low, high] = [bounds.min, bounds.max].map(|corner| Vec3::from(corner).as_dvec3());
        let (middle, radius) = ((low + high) * 0.5, 0.5 * (high - low).length());
        let surfaces = PhotonSurface::of_instances(scene, solids);
        let side = (PILOT_RAYS / PILOTS_IN_CELL / scene.lights.len().max(1)).isqrt().clamp(8, MOST_CELLS);
        let sought: Vec<(EmissionDomain, Cells, f64)> = scene
            .lights
            .par_iter()
            .map(|light| {
                let domain = EmissionDomain::new(light, shaped, bvh.anchor, (middle, radius));
                let cells = Cells::of(&domain, bvh, &surfaces, side, RADII[0] * radius);
                let power = light.color.iter().map(|&c| f64::from(c)).sum::<f64>() * domain.measure * cells.share();
                (domain, cells, power)
            })
            .collect();
        let all: f64 = sought.iter().map(|(.., power)| power).sum();
        let emission = |(light, (domain, cells, power)): (&Light, (EmissionDomain, Cells, f64))| {
            let of_light = f64::from(count) * power / all;
            let points = if power > 0.0 { (of_light * cells.around() / cells.share()).ceil() as u64 } else { 0 };
            let media = match light.kind {
                LightKind::Point { position, .. } | LightKind::Spot { position, .. } if points > 0 => media(position),
                _ => [0; 4],
            };
            PhotonSource { domain, cells, points, media }
        };
        let lights = scene.lights.iter().zip(sought).map(emission).collect();
        (all > 0.0).then_some(Self { lights, radius })
    }

    /// The rays of one set of photons; each `number` gives another set, of about the same size.
    #[must_use]
    pub fn rays(&self, number: u64) -> Vec<PhotonRay> {
        let mut random = PhotonRandom::new(number);
        let mut rays = Vec::new();
        for (index, PhotonSource { domain, cells, points, media }) in self.lights.iter().enumerate() {
            // The same points, shifted (Cranley and Patterson 1976), at which they are as even.
            let shift = DVec2::new(random.unit(), random.unit());
            let of_light = random.word();
            let ray = |i: u64| {
                let at = r2_point(i) + shift;
                let at =
                    cells.corner + cells.size * (at - DVec2::select(at.cmpge(DVec2::ONE), DVec2::ONE, DVec2::ZERO));
                let mut place = PhotonRandom::new(of_light ^ i);
                let (origin, direction, cosine) =
                    cells.contains(at).then(|| domain.ray(at, DVec2::new(place.unit(), place.unit())))?;
                Some(PhotonRay {
                    origin: origin.as_vec3().to_array(),
                    light: index as u32,
                    direction: direction.as_vec3().normalize().to_array(),
                    measure: (domain.measure * cells.around() / *points as f64 * cosine.max(0.0)) as f32,
                    media: *media,
                })
            };
            rays.par_extend((0..*points).into_par_iter().filter_map(ray));
        }
        rays
    }

    /// Radius of the scene in metres.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }
}

/// The photon map in its layout on the device: nodes in depth-first order, then photons, two texels of four words each.
/// `scene_radius` is in metres.
#[must_use]
pub fn photon_map(landings: &[Landing], scene_radius: f64) -> Vec<[u32; 4]> {
    let finite = |landing: &&Landing| {
        let all = [landing.position, landing.normal, landing.to_light, landing.power];
        all.iter().flatten().all(|x| x.is_finite()) && landing.power.iter().any(|&power| power > 0.0)
    };
    let tree = PhotonTree::of(landings.iter().filter(finite).copied().collect());
    let [least, most] = RADII.map(|share| share * scene_radius);
    let photons: Vec<(Photon, Aabb)> = (tree.photons.par_iter())
        .map(|landing| spread(landing, tree.distance_of_neighbours(landing).clamp(least, most)))
        .collect();
    // Places count nodes and photons, which have two texels each.
    let behind = tree.nodes.len() as u32;
    let mut nodes: Vec<PhotonNode> = Vec::with_capacity(tree.nodes.len());
    // From the last to the first: a node comes before its children.
    for (at, node) in tree.nodes.iter().enumerate().rev() {
        let bounds = match node.count {
            0 if photons.is_empty() => Aabb { min: [1.0; 3], max: [-1.0; 3] },
            0 => {
                let child = |place: usize| Aabb {
                    min: nodes[behind as usize - 1 - place].low,
                    max: nodes[behind as usize - 1 - place].high,
                };
                child(at + 1).union(&child(tree.nodes[at + 1].next))
            }
            count => {
                photons[node.first..node.first + count].iter().fold(Aabb::EMPTY, |all, (_, bounds)| all.union(bounds))
            }
        };
        let first = if node.count > 0 { behind + node.first as u32 } else { 0 };
        let photons = first << PHOTON_COUNT_BITS | node.count as u32;
        nodes.push(PhotonNode { low: bounds.min, next: node.next as u32, high: bounds.max, photons });
    }
    nodes.reverse();
    let photons: Vec<Photon> = photons.into_iter().map(|(photon, _)| photon).collect();
    [bytemuck::cast_slice(&nodes), bytemuck::cast_slice(&photons)].concat()
}

/// A k-d tree over photons (Bentley 1975), in depth-first order. It finds the neighbours of a photon, and is the
/// topology of the hierarchy over the disks.
struct PhotonTree {
    /// In the order of the leaves.
    photons: Vec<Landing>,
    nodes: Vec<TreeNode>,
}

struct TreeNode {
    /// Box around the positions.
    low: Vec3,
    high: Vec3,
    /// The node after the subtree.
    next: usize,
    /// The photons of a leaf; `count` is 0 of an inner node.
    first: usize,
    count: usize,
}

impl PhotonTree {
    fn of(photons: Vec<Landing>) -> Self {
        let mut tree = Self { photons, nodes: Vec::new() };
        tree.add(0, tree.photons.len());
        tree
    }

    /// Adds a subtree over a range of photons. Half of them lie on either side of a plane across the longest side.
    fn add(&mut self, first: usize, end: usize) {
        let (low, high) = self.photons[first..end]
            .iter()
            .map(|photon| Vec3::from(photon.position))
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let at = self.nodes.len();
        let is_leaf = end - first <= LEAF;
        self.nodes.push(TreeNode { low, high, next: 0, first, count: if is_leaf { end - first } else { 0 } });
        if !is_leaf {
            let axis = (high - low).max_position();
            let middle = usize::midpoint(first, end);
            self.photons[first..end]
                .select_nth_unstable_by(middle - first, |a, b| a.position[axis].total_cmp(&b.position[axis]));
            self.add(first, middle);
            self.add(middle, end);
        }
        self.nodes[at].next = self.nodes.len();
    }

    /// Distance from a photon to the last of its nearest [`NEIGHBOURS`] on the same surface; infinite with fewer.
    fn distance_of_neighbours(&self, photon: &Landing) -> f64 {
        // The photon itself is among them.
        let mut nearest = [f32::INFINITY; NEIGHBOURS + 1];
        self.search(0, photon, &mut nearest);
        f64::from(nearest[NEIGHBOURS]).sqrt()
    }

    /// Sorts the squared distances of a subtree's photons into `nearest`.
    fn search(&self, at: usize, photon: &Landing, nearest: &mut [f32; NEIGHBOURS + 1]) {
        let (position, normal) = (Vec3::from(photon.position), Vec3::from(photon.normal));
        let node = &self.nodes[at];
        for other in &self.photons[node.first..node.first + node.count] {
            let distance2 = position.distance_squared(Vec3::from(other.position));
            if distance2 < nearest[NEIGHBOURS] && normal.dot(Vec3::from(other.normal)) >= SAME_SURFACE {
                let place = nearest.partition_point(|&known| known <= distance2);
                nearest.copy_within(place..NEIGHBOURS, place + 1);
                nearest[place] = distance2;
            }
        }
        if node.count == 0 && at + 1 < node.next {
            let beside = |child: usize| {
                let TreeNode { low, high, .. } = self.nodes[child];
                position.distance_squared(position.clamp(low, high))
            };
            let children = [at + 1, self.nodes[at + 1].next].map(|child| (beside(child), child));
            let [near, far] = if children[0].0 <= children[1].0 { children } else { [children[1], children[0]] };
            for (distance2, child) in [near, far] {
                if distance2 < nearest[NEIGHBOURS] {
                    self.search(child, photon, nearest);
                }
            }
        }
    }
}

/// A photon of the map, spread over a disk, and the disk's box.
fn spread(landing: &Landing, radius: f64) -> (Photon, Aabb) {
    let [position, normal, to_light] =
        [landing.position, landing.normal, landing.to_light].map(|v| Vec3::from(v).as_dvec3());
    // The upper half of the float, rounded up: the kernel has the volume of the stored radius.
    let upper = ((radius as f32).to_bits() + 0xffff) & 0xffff_0000;
    let radius = f64::from(f32::from_bits(upper));
    // The kernel of Epanechnikov, 2/(π r²) (1 − d²/r²), over the cosine of incidence.
    let peak = 2.0 / (PI * radius * radius * normal.dot(to_light).abs().max(GRAZING));
    let photon = Photon {
        position: landing.position,
        to_light: pack_snorm_2x16(octahedral_from_unit(to_light)),
        irradiance: landing.power.map(|power| (f64::from(power) * peak) as f32),
        normal_radius: pack_snorm_2x8(octahedral_from_unit(normal)) | upper,
    };
    // A thousandth more than the disk, for the roundings of its normal.
    let flat = (DVec3::ONE - normal * normal).max(DVec3::ZERO).map(f64::sqrt);
    let half = (flat + normal.abs() * f64::from(DISK_THICKNESS)) * radius * 1.001;
    let corner = |side: f64| (position + half * side).as_vec3().to_array();
    (photon, Aabb { min: corner(-1.0), max: corner(1.0) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Photons on a floor and on a wall, denser towards their common edge, and three at one place.
    fn landings() -> Vec<Landing> {
        let mut random = PhotonRandom::new(1);
        let mut landing = |i: u32| {
            let [along, near, tilt] = [random.unit(), random.unit().powi(3), random.unit()];
            let (position, normal) = match i % 3 {
                0 => (DVec3::new(along, near, 0.0), DVec3::Z),
                _ => (DVec3::new(along, 0.0, near), DVec3::Y),
            };
            Landing {
                position: position.as_vec3().to_array(),
                normal: normal.as_vec3().to_array(),
                to_light: (normal + DVec3::X * tilt).normalize().as_vec3().to_array(),
                power: [1.0, 0.5, tilt as f32],
            }
        };
        let mut all: Vec<Landing> = (0..500).map(&mut landing).collect();
        all.extend([all[7]; 2]);
        all
    }

    #[test]
    fn neighbours_are_the_nearest_on_the_same_surface() {
        let tree = PhotonTree::of(landings());
        for photon in &tree.photons {
            let [position, normal] = [photon.position, photon.normal].map(Vec3::from);
            let same = tree.photons.iter().filter(|other| normal.dot(Vec3::from(other.normal)) >= SAME_SURFACE);
            let mut all: Vec<f32> = same.map(|other| position.distance_squared(Vec3::from(other.position))).collect();
            all.sort_by(f32::total_cmp);
            assert_eq!(tree.distance_of_neighbours(photon), f64::from(all[NEIGHBOURS]).sqrt());
        }
        let few = PhotonTree::of(landings()[..NEIGHBOURS].to_vec());
        assert_eq!(few.distance_of_neighbours(&few.photons[0]), f64::INFINITY);
    }

    /// The look-up of shaders/lib/photon_map.glsl: places of the photons in the leaves whose boxes hold a point.
    fn found(texels: &[[u32; 4]], p: Vec3) -> Vec<usize> {
        let node = |at: u32| -> PhotonNode { bytemuck::cast([texels[2 * at as usize], texels[2 * at as usize + 1]]) };
        let (mut at, end, mut places) = (0, node(0).next, Vec::new());
        while at < end {
            let PhotonNode { low, next, high, photons } = node(at);
            let inside = p.cmpge(low.into()).all() && p.cmple(high.into()).all();
            let count = photons & ((1 << PHOTON_COUNT_BITS) - 1);
            let first = photons >> PHOTON_COUNT_BITS;
            places.extend((first..first + if inside { count } else { 0 }).map(|place| place as usize));
            at = if inside { at + 1 } else { next };
        }
        places
    }

    #[test]
    fn a_look_up_finds_every_disk_that_covers_the_point() {
        let texels = photon_map(&landings(), 1.0);
        let behind = texels.len() / 2 - landings().len();
        let photon = |place: usize| -> Photon { bytemuck::cast([texels[2 * place], texels[2 * place + 1]]) };
        for i in 0..200_u64 {
            let at = r2_point(i);
            let p = if i % 2 == 0 { at.extend(0.0) } else { DVec3::new(at.x, 0.0, at.y) }.as_vec3();
            let found = found(&texels, p);
            for place in behind..texels.len() / 2 {
                let Photon { position, normal_radius, .. } = photon(place);
                let radius = f32::from_bits(normal_radius & 0xffff_0000);
                let covers = p.distance(Vec3::from(position)) < DISK_THICKNESS * radius;
                assert!(!covers || found.contains(&place), "photon {place} at {p}");
            }
        }
        assert_eq!(found(&photon_map(&[], 1.0), Vec3::ZERO), [0; 0]);
    }

    /// Over its disk the irradiance of a photon adds up to its power.
    #[test]
    fn disks_have_the_power_of_their_photons() {
        for landing in landings() {
            for radius in [1e-4, 0.03, 7.0] {
                let (photon, _) = spread(&landing, radius);
                let [normal, to_light] = [landing.normal, landing.to_light].map(|v| Vec3::from(v).as_dvec3());
                let radius = f64::from(f32::from_bits(photon.normal_radius & 0xffff_0000));
                // Half of the peak, over the area.
                let area = 0.5 * PI * radius * radius * normal.dot(to_light);
                for (power, peak) in landing.power.iter().zip(photon.irradiance) {
                    assert!((f64::from(peak) * area - f64::from(*power)).abs() < 1e-6, "{power}");
                }
            }
        }
    }
}
