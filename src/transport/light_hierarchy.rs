//! The light hierarchy: a binary tree over the emitters that have a place, from which light sampling chooses one by its
//! importance at the shaded point.
//!
//! Read Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting"; pbrt (4th
//! ed.), section 12.6.3 (BVH light sampling). A node bounds its emitters: a sphere for their positions, an orientation
//! cone, and the sum of their intensities. `descend_light_hierarchy` of shaders/lib/emitters.glsl walks from the root
//! to a leaf and chooses between two children in proportion to their importance.
//!
//! Assumes: bvh space, metres. Nodes are stored as the device reads them, rounded so that they still bound.

use std::f64::consts::{FRAC_PI_2, PI};

use bytemuck::Zeroable as _;
use glam::DVec3;
use half::f16;

use super::emitters::{EmitterSource, Emitters, mean};
use super::octahedral::{octahedral_from_unit, pack_snorm_2x16, unit_from_octahedral, unpack_snorm_2x16};
use crate::optics::light::light_importance;
use crate::scene::{Extent, Light, LightKind};
use crate::share::{LIGHT_INDEX, LIGHT_LEAF, LIGHT_TWO_SIDED, LightNode};

/// Levels below the root: a trail has one bit for each and a 1 above them, in one word.
const MOST_DEPTH: u32 = 31;
/// Candidate planes along each axis, less one.
const BUCKETS: usize = 12;
/// Added to the angle of every cone: the octahedral encoding in 2x16 bits turns an axis by at most 6.5e-5 rad.
const MARGIN: f64 = 1e-4;
/// Least intensity of an emitter relative to all: as in the CDF over powers, none is lost.
const LEAST: f64 = 1.0 / 4_294_967_296.0;

/// The light hierarchy of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct LightHierarchy {
    /// Index of the first emitter that has a place; those before it are infinitely far.
    pub first: usize,
    /// The root, then pairs of siblings. A leaf holds the index of its emitter plus 1, because the table of emitters
    /// has the bin of the hierarchy before them.
    pub nodes: Vec<LightNode>,
    /// For each emitter the way from the root: one bit for each node, the first one lowest, below a 1. 0: not in the
    /// hierarchy.
    pub trails: Vec<u32>,
}

/// Bounds of one emitter or of several.
#[derive(Debug, Clone, Copy)]
struct LightBounds {
    low: DVec3,
    high: DVec3,
    /// Axis of the orientation cone, which holds the axes of the emitters.
    axis: DVec3,
    /// Half angle θ_o of that cone.
    spread: f64,
    /// Angle θ_e from its axis up to which an emitter emits.
    reach: f64,
    two_sided: bool,
    intensity: f64,
}

/// An emitter with its bounding sphere.
#[derive(Debug, Clone, Copy)]
struct Bounded {
    emitter: usize,
    centre: DVec3,
    radius: f64,
    bounds: LightBounds,
}

impl Bounded {
    fn new(emitter: usize, centre: DVec3, radius: f64, axis: DVec3, [spread, reach]: [f64; 2]) -> Self {
        let (low, high) = (centre - radius, centre + radius);
        let bounds = LightBounds { low, high, axis, spread, reach, two_sided: false, intensity: 0.0 };
        Self { emitter, centre, radius, bounds }
    }

    fn of_light(emitter: usize, light: &Light, anchor: DVec3) -> Option<Self> {
        let (position, axis, angles) = match light.kind {
            LightKind::Directional { .. } => return None,
            LightKind::Point { position, .. } => (position, DVec3::Z, [PI, FRAC_PI_2]),
            // Within its outer cone a spot light has up to its full intensity at every angle.
            LightKind::Spot { position, direction, outer, .. } => (position, direction, [outer, 0.0]),
        };
        let (radius, angles) = match light.extent {
            None => (0.0, angles),
            Some(Extent::Sphere { radius }) => (radius, angles),
            // Of a diffuse emitter the intensity falls with the cosine.
            Some(Extent::Disk { radius }) => (radius, [0.0, angles[0].min(FRAC_PI_2)]),
            Some(Extent::Rectangle { across, half_height }) => {
                (across.length().hypot(half_height), [0.0, angles[0].min(FRAC_PI_2)])
            }
        };
        let mut found = Self::new(emitter, position - anchor, radius, axis, angles);
        found.bounds.intensity = mean(light.color);
        Some(found)
    }

    fn of_triangle(emitter: usize, corners: [DVec3; 3], two_sided: bool, intensity: f64) -> Self {
        let [a, b, c] = corners;
        let centre = (a.min(b).min(c) + a.max(b).max(c)) * 0.5;
        let radius = corners.iter().fold(0.0_f64, |radius, p| radius.max(p.distance(centre)));
        let axis = (b - a).cross(c - a).try_normalize().unwrap_or(DVec3::Z);
        let mut found = Self::new(emitter, centre, radius, axis, [0.0, FRAC_PI_2]);
        (found.bounds.two_sided, found.bounds.intensity) = (two_sided, intensity);
        found
    }
}

impl LightBounds {
    fn joined(&self, other: &Self) -> Self {
        let two_sided = self.two_sided || other.two_sided;
        let flips = two_sided && self.axis.dot(other.axis) < 0.0;
        let (axis, spread) =
            joined_cones((self.axis, self.spread), (if flips { -other.axis } else { other.axis }, other.spread));
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            axis,
            spread,
            reach: self.reach.max(other.reach),
            two_sided,
            intensity: self.intensity + other.intensity,
        }
    }

    /// Cost of the surface area orientation heuristic (Conty Estevez and Kulla 2018, section 4.2), with the square of
    /// the diagonal for the surface area: importance sees a sphere, and the box of a row of lights has no area.
    fn cost(&self) -> f64 {
        let end = (self.spread + self.reach).min(PI);
        let (sin, cos) = self.spread.sin_cos();
        let cone = 2.0 * PI * (1.0 - cos)
            + FRAC_PI_2 * (2.0 * end * sin - (self.spread - 2.0 * end).cos() - 2.0 * self.spread * sin + cos);
        self.intensity * cone * (self.high - self.low).length_squared()
    }
}

/// The smallest cone that holds two cones, by axis and half angle.
fn joined_cones((one, one_angle): (DVec3, f64), (other, other_angle): (DVec3, f64)) -> (DVec3, f64) {
    let between = one.cross(other).length().atan2(one.dot(other));
    if (between + other_angle).min(PI) <= one_angle {
        return (one, one_angle);
    }
    if (between + one_angle).min(PI) <= other_angle {
        return (other, other_angle);
    }
    let angle = 0.5 * (one_angle + between + other_angle);
    match one.cross(other).try_normalize() {
        Some(about) if angle < PI => {
            let (sin, cos) = (angle - one_angle).sin_cos();
            ((one * cos + about.cross(one) * sin).normalize(), angle)
        }
        _ => (one, PI),
    }
}

impl LightHierarchy {
    /// The hierarchy over the emitters that have a place. `corners` gives the corners of a triangle of the scene in bvh
    /// space, counter-clockwise around its front; `None`: the triangle is degenerate and no light. Directional lights
    /// are the first ones of `lights`.
    #[must_use]
    pub fn of(
        emitters: &Emitters,
        lights: &[Light],
        anchor: DVec3,
        corners: impl Fn(u32) -> Option<[DVec3; 3]>,
    ) -> Self {
        let is_far = |source: &EmitterSource| match *source {
            EmitterSource::Environment => true,
            EmitterSource::Punctual(light) => matches!(lights[light as usize].kind, LightKind::Directional { .. }),
            EmitterSource::Triangle { .. } => false,
        };
        let first = emitters.list.iter().take_while(|emitter| is_far(&emitter.source)).count();
        let mut found: Vec<Bounded> = Vec::new();
        for (i, emitter) in emitters.list.iter().enumerate().skip(first) {
            found.extend(match emitter.source {
                EmitterSource::Environment => None,
                EmitterSource::Punctual(light) => Bounded::of_light(i, &lights[light as usize], anchor),
                EmitterSource::Triangle { index, two_sided, .. } => corners(index).map(|corners| {
                    // The power of each side is π times the intensity along the normal.
                    let sides = if two_sided { 2.0 } else { 1.0 };
                    Bounded::of_triangle(i, corners, two_sided, emitter.probability * emitters.power / (PI * sides))
                }),
            });
        }
        let all: f64 = found.iter().map(|light| light.bounds.intensity).sum();
        let even = !(all > 0.0 && all.is_finite());
        let each = 1.0 / found.len() as f64;
        for light in &mut found {
            let share = light.bounds.intensity / all;
            light.bounds.intensity = if even { each } else { share.max(LEAST) };
        }
        let mut hierarchy = Self { first, nodes: Vec::new(), trails: vec![0; emitters.list.len()] };
        if !found.is_empty() {
            hierarchy.nodes.push(LightNode::zeroed());
            hierarchy.build(&mut found, 0, 0, 0);
        }
        hierarchy
    }

    /// Fills the node `at` and what is below it; `trail` has the bits of the way to it.
    fn build(&mut self, lights: &mut [Bounded], at: usize, trail: u32, depth: u32) {
        let link = if let [light] = lights {
            self.trails[light.emitter] = trail | 1 << depth;
            LIGHT_LEAF | (light.emitter as u32 + 1)
        } else {
            self.nodes.len() as u32
        };
        self.nodes[at] = node(lights, link);
        if lights.len() > 1 {
            self.nodes.extend([LightNode::zeroed(); 2]);
            let middle = split(lights, 1 << (MOST_DEPTH - depth - 1));
            let (one, other) = lights.split_at_mut(middle);
            self.build(one, link as usize, trail, depth + 1);
            self.build(other, link as usize + 1, trail | 1 << depth, depth + 1);
        }
    }

    /// Axis of a node's cone, and the cosines of θ_o and θ_e, as the device reads them.
    #[must_use]
    pub fn cone(node: &LightNode) -> (DVec3, [f64; 2]) {
        (unit_from_octahedral(unpack_snorm_2x16(node.axis)), [cosine_of(node.cosines), cosine_of(node.cosines >> 16)])
    }

    /// Importance of a node at a point: `node_importance` of shaders/lib/emitters.glsl in f64.
    #[must_use]
    pub fn importance(node: &LightNode, point: DVec3) -> f64 {
        let to_point = point - glam::Vec3::from(node.centre).as_dvec3();
        let (axis, [cos_o, cos_e]) = Self::cone(node);
        let bounds = [node.radius.into(), cos_o, cos_e, node.intensity.into()];
        light_importance(to_point, axis, bounds, node.link & LIGHT_TWO_SIDED != 0)
    }

    /// Probability with which the descent from the root ends at an emitter: `descend_light_hierarchy` in f64, without
    /// the bin of the hierarchy itself. `importance` is [`LightHierarchy::importance`] or what the device says of it.
    #[must_use]
    pub fn probability(&self, emitter: usize, importance: impl Fn(&LightNode) -> f64) -> f64 {
        let mut trail = self.trails[emitter];
        if trail == 0 {
            return 0.0;
        }
        let (mut link, mut probability) = (self.nodes[0].link, 1.0);
        while link & LIGHT_LEAF == 0 {
            let pair = (link & LIGHT_INDEX) as usize;
            let both = [0, 1].map(|i| importance(&self.nodes[pair + i]));
            let chosen = (trail & 1) as usize;
            probability *= if both[chosen] > 0.0 { both[chosen] / (both[0] + both[1]) } else { 0.0 };
            link = self.nodes[pair + chosen].link;
            trail >>= 1;
        }
        probability
    }
}

/// Divides lights into two parts of at most `most` each; returns the size of the first.
fn split(lights: &mut [Bounded], most: usize) -> usize {
    let low = lights.iter().fold(DVec3::INFINITY, |low, light| low.min(light.centre));
    let high = lights.iter().fold(DVec3::NEG_INFINITY, |high, light| high.max(light.centre));
    let size = high - low;
    let bucket = |light: &Bounded, axis: usize| {
        (((light.centre[axis] - low[axis]) / size[axis] * BUCKETS as f64) as usize).min(BUCKETS - 1)
    };
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| size[axis] > 0.0) {
        let mut buckets = [None::<LightBounds>; BUCKETS];
        for light in &*lights {
            let of = &mut buckets[bucket(light, axis)];
            *of = join(of.as_ref(), Some(&light.bounds));
        }
        let mut before = [0.0; BUCKETS];
        let mut sum = None;
        for (cost, of) in before.iter_mut().zip(&buckets) {
            sum = join(sum.as_ref(), of.as_ref());
            *cost = sum.as_ref().map_or(0.0, LightBounds::cost);
        }
        let mut sum = None;
        for plane in (1..BUCKETS).rev() {
            sum = join(sum.as_ref(), buckets[plane].as_ref());
            // Long boxes are cut across.
            let long = size.max_element() / size[axis];
            let cost = long * (before[plane - 1] + sum.as_ref().map_or(0.0, LightBounds::cost));
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, plane));
            }
        }
    }
    if let Some((_, axis, plane)) = best {
        lights.sort_by_key(|light| bucket(light, axis) >= plane);
        let middle = lights.partition_point(|light| bucket(light, axis) < plane);
        if (1..lights.len()).contains(&middle) && middle.max(lights.len() - middle) <= most {
            return middle;
        }
        lights.sort_by(|a, b| a.centre[axis].total_cmp(&b.centre[axis]));
    }
    lights.len() / 2
}

fn join(one: Option<&LightBounds>, other: Option<&LightBounds>) -> Option<LightBounds> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.joined(other)),
        (one, other) => one.or(other).copied(),
    }
}

/// The node that bounds some lights, as the device reads it.
fn node(lights: &[Bounded], link: u32) -> LightNode {
    let all = lights.iter().map(|light| light.bounds).reduce(|all, bounds| all.joined(&bounds));
    let Some(all) = all else { return LightNode::zeroed() };
    let centre = ((all.low + all.high) * 0.5).as_vec3();
    let from = centre.as_dvec3();
    let radius = lights.iter().fold(0.0_f64, |radius, light| radius.max(light.centre.distance(from) + light.radius));
    let cosines = [all.spread + MARGIN, all.reach + MARGIN].map(|angle| below(angle.min(PI).cos()).to_bits());
    LightNode {
        centre: centre.to_array(),
        radius: (radius as f32).next_up(),
        axis: pack_snorm_2x16(octahedral_from_unit(all.axis)),
        cosines: u32::from(cosines[0]) | u32::from(cosines[1]) << 16,
        intensity: all.intensity as f32,
        link: link | if all.two_sided { LIGHT_TWO_SIDED } else { 0 },
    }
}

/// The largest half float up to a cosine.
fn below(cosine: f64) -> f16 {
    let near = f16::from_f64(cosine);
    match near.to_f64() <= cosine {
        true => near,
        // Bits of a half float grow with its magnitude.
        false if near.to_f64() > 0.0 => f16::from_bits(near.to_bits() - 1),
        false => f16::from_bits((near.to_bits() | 0x8000) + 1),
    }
}

fn cosine_of(halves: u32) -> f64 {
    f16::from_bits(halves as u16).to_f64()
}
