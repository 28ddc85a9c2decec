//! Light sampling by power: the discrete distribution over lights, emissive triangles and the environment (lecture
//! R2–R4).
//!
//! Read pbrt (4th ed.), sections 12.6 (light sampling), 12.5 (infinite area lights) and 2.3 (inversion method).
//! Importance sampling inverts a CDF: cumulative probabilities are 32-bit fixed point, a random 32-bit word selects a
//! bin by binary search, and every bin has at least one word. Units: radiance in the scene's units, areas in square
//! metres.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use crate::image::tone::srgb_decode;
use crate::scene::environment::{Environment, direction};
use crate::scene::{AlphaMode, Image, Instance, Light, LightKind, Material, Scene};

/// A kind of light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EmitterSource {
    /// The environment map.
    Environment,
    /// A punctual or analytic area light, as an index into the scene's lights.
    Punctual(u32),
    /// An emissive triangle.
    Triangle {
        /// Index among all triangles of the scene, in the order of instances.
        index: u32,
        /// Area in square metres.
        area: f64,
        /// Whether both sides emit.
        two_sided: bool,
    },
}

/// A light with its bin of the CDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emitter {
    /// The light.
    pub source: EmitterSource,
    /// CDF at the light's bin: its first 32-bit word.
    pub first: u32,
    /// Probability of the light: size of its bin over 2³².
    pub probability: f64,
}

/// All lights: the environment first, then punctual and area lights, then emissive triangles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Emitters {
    /// Lights in the order of their bins.
    pub list: Vec<Emitter>,
    /// Sum of their powers, relative to π.
    pub power: f64,
    /// The distribution within the environment.
    pub environment: EnvironmentCdf,
}

/// Environment CDF: a piecewise-constant distribution over cells of the map. The marginal CDF over rows comes first,
/// then, row by row, the conditional CDF over columns.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct EnvironmentCdf {
    /// Number of columns.
    pub columns: u32,
    /// Number of rows.
    pub rows: u32,
    /// First words of the bins: marginal, then conditional.
    pub words: Vec<u32>,
    /// Rotation of the environment about +Y in degrees.
    pub rotation: f64,
}

/// An environment that lights a scene.
#[derive(Debug, Clone, Copy)]
pub struct Sky<'a> {
    /// The environment map.
    pub map: &'a Environment,
    /// Factor on the radiance.
    pub intensity: f32,
    /// Rotation about +Y in degrees.
    pub rotation: f32,
}

/// Number of 32-bit words: all bins of a CDF together.
const ALL: f64 = 4_294_967_296.0;

/// CDF in 32-bit fixed point: for each weight the first word of its bin and its probability (bin size over 2³²). No bin
/// is empty; weights without a finite positive sum give equal bins.
fn shares(weights: &[f64]) -> Vec<(u32, f64)> {
    let count = weights.len() as f64;
    let sum: f64 = weights.iter().sum();
    let even = !(sum > 0.0 && sum.is_finite());
    let mut before = 0.0;
    let mut firsts: Vec<u64> = Vec::with_capacity(weights.len() + 1);
    for (i, weight) in weights.iter().enumerate() {
        let share = if even { i as f64 / count } else { before / sum };
        firsts.push((share * (ALL - count)) as u64 + i as u64);
        before += weight;
    }
    firsts.push(ALL as u64);
    firsts.windows(2).map(|pair| (pair[0] as u32, (pair[1] - pair[0]) as f64 / ALL)).collect()
}

pub(super) fn mean(rgb: [f32; 3]) -> f64 {
    rgb.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0
}

/// Whether next event estimation samples a surface: it emits, and neither alpha nor a coat modifies its emission.
#[must_use]
pub fn is_emitter(material: &Material) -> bool {
    !material.unlit
        && material.emissive.iter().any(|&c| c > 0.0)
        && material.alpha_mode == AlphaMode::Opaque
        && material.clearcoat == 0.0
}

/// Power of a light relative to π, the power of one side of a square metre of radiance 1. A directional light's power
/// is that through the scene's largest cross-section.
fn power(light: &Light, radius: f64) -> f64 {
    use std::f64::consts::PI;
    let towards = match light.kind {
        LightKind::Directional { .. } => PI * radius * radius,
        LightKind::Spot { .. } if light.extent.is_some() => PI,
        LightKind::Spot { outer, .. } => 2.0 * PI * (1.0 - outer.cos()),
        LightKind::Point { .. } => 4.0 * PI,
    };
    mean(light.color) * towards
}

impl Emitters {
    /// The distribution for a scene, its environment and, with `surfaces`, its emissive triangles.
    #[must_use]
    pub fn of(scene: &Scene, environment: Option<Sky>, surfaces: bool) -> Self {
        Self::among(scene, environment, |_| true, surfaces)
    }

    /// The distribution over the lights of a scene that have an extent: with `shaped` its analytic area lights, with
    /// `surfaces` its emissive triangles.
    #[must_use]
    pub fn with_extent(scene: &Scene, shaped: bool, surfaces: bool) -> Self {
        Self::among(scene, None, |light| shaped && light.extent.is_some(), surfaces)
    }

    fn among(scene: &Scene, environment: Option<Sky>, is_among: impl Fn(&Light) -> bool, surfaces: bool) -> Self {
        use std::f64::consts::PI;
        let radius = scene.bounds().map_or(1.0, |bounds| bounds.radius());
        let mut sources = Vec::new();
        let mut weights = Vec::new();
        let mut cdf = EnvironmentCdf::default();
        // A constant environment is not sampled: BSDF sampling finds it as well.
        if let Some(around) = environment.filter(|sky| !sky.map.is_constant() && sky.intensity > 0.0) {
            let radiance = around.map.mean().iter().sum::<f64>() / 3.0 * f64::from(around.intensity);
            if radiance > 0.0 {
                cdf = EnvironmentCdf::of(around.map);
                cdf.rotation = f64::from(around.rotation);
                sources.push(EmitterSource::Environment);
                weights.push(PI * radius * radius * 4.0 * PI * radiance);
            }
        }
        for (i, light) in scene.lights.iter().enumerate().filter(|(_, light)| light.shines() && is_among(light)) {
            sources.push(EmitterSource::Punctual(i as u32));
            weights.push(power(light, radius));
        }
        if surfaces {
            for (source, weight) in triangles(scene, 0.0) {
                sources.push(source);
                weights.push(weight);
            }
        }
        let shares = shares(&weights);
        let list = sources.into_iter().zip(shares).map(|(source, (first, probability))| Emitter {
            source,
            first,
            probability,
        });
        Self { list: list.collect(), power: weights.iter().sum(), environment: cdf }
    }
}

/// Number of emitters of a scene that have a place: its lights that `is_among` takes, but for directional ones, and
/// with `surfaces` its emissive triangles.
#[must_use]
pub fn bounded(scene: &Scene, surfaces: bool, is_among: impl Fn(&Light) -> bool) -> usize {
    let local = |light: &&Light| {
        light.shines()
            && is_among(light)
            && !matches!(light.kind, LightKind::Directional { .. })
            && !(light.proxy && surfaces)
    };
    let triangles = |instance: &Instance| {
        let mesh = &scene.meshes[instance.mesh];
        if is_emitter(&scene.materials[mesh.material]) { mesh.indices.len() / 3 } else { 0 }
    };
    let emissive: usize = if surfaces { scene.instances.iter().map(triangles).sum() } else { 0 };
    scene.lights.iter().filter(local).count() + emissive
}

/// Linear mean of an sRGB-encoded image.
fn mean_of(image: &Image) -> f64 {
    let mut counts = [0_u64; 256];
    for texel in image.rgba.as_chunks::<4>().0 {
        texel[..3].iter().for_each(|&byte| counts[usize::from(byte)] += 1);
    }
    let total: u64 = counts.iter().sum();
    let decoded = counts.iter().enumerate().map(|(i, &n)| srgb_decode(i as f64 / 255.0) * n as f64);
    decoded.sum::<f64>() / total.max(1) as f64
}

/// The corners of a triangle of an instance, in world space.
fn corners(scene: &Scene, instance: &Instance, primitive: usize) -> [DVec3; 3] {
    let mesh = &scene.meshes[instance.mesh];
    [0, 1, 2].map(|k| {
        let p = mesh.positions[mesh.indices[3 * primitive + k] as usize];
        instance.world_from_object.transform_point3(glam::Vec3::from(p).as_dvec3())
    })
}

/// A triangle of a scene.
pub(super) struct SceneTriangle {
    pub(super) instance: usize,
    /// Index of the triangle in its mesh.
    pub(super) primitive: usize,
    /// In world space.
    pub(super) corners: [DVec3; 3],
    /// Unit normal of the front.
    pub(super) front: DVec3,
}

impl SceneTriangle {
    /// The triangle with this index among all of the scene, whose instances begin at `firsts`.
    pub(super) fn of(scene: &Scene, firsts: &[u32], index: u32) -> Self {
        let instance = firsts.partition_point(|&first| first <= index) - 1;
        let placed = &scene.instances[instance];
        let primitive = (index - firsts[instance]) as usize;
        let corners = corners(scene, placed, primitive);
        let [a, b, c] = corners;
        let mirrored = placed.world_from_object.matrix3.determinant() < 0.0;
        let n = (b - a).cross(c - a).normalize_or_zero();
        Self { instance, primitive, corners, front: if mirrored { -n } else { n } }
    }
}

/// The triangles whose emission factor is above `above`, with their power.
fn triangles(scene: &Scene, above: f64) -> Vec<(EmitterSource, f64)> {
    use std::f64::consts::PI;
    let radiance: Vec<f64> = scene
        .materials
        .iter()
        .map(|material| match is_emitter(material) && mean(material.emissive) > above {
            true => {
                mean(material.emissive) * material.emissive_texture.map_or(1.0, |t| mean_of(&scene.images[t.image]))
            }
            false => 0.0,
        })
        .collect();
    let mut found = Vec::new();
    let mut first = 0;
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh];
        let material = &scene.materials[mesh.material];
        let count = mesh.indices.len() / 3;
        if radiance[mesh.material] > 0.0 {
            for i in 0..count {
                let [a, b, c] = corners(scene, instance, i);
                let area = 0.5 * (b - a).cross(c - a).length();
                let two_sided = material.double_sided;
                if area > 0.0 && area.is_finite() {
                    let sides = if two_sided { 2.0 } else { 1.0 };
                    let source = EmitterSource::Triangle { index: (first + i) as u32, area, two_sided };
                    found.push((source, PI * area * sides * radiance[mesh.material]));
                }
            }
        }
        first += count;
    }
    found
}

/// Power of a scene's emissive surfaces that next event estimation samples and that are brighter than white paper in
/// the studio (radiance 1), relative to π: the sum of radiance times area in square metres, over both sides of
/// two-sided ones. Dimmer ones are labels, screens and glowing letters, and no lamps; ClearCoatTest has such labels.
#[must_use]
pub fn emitted(scene: &Scene) -> f64 {
    triangles(scene, 1.0).into_iter().map(|(_, power)| power / std::f64::consts::PI).sum()
}

/// Largest number of rows of the environment CDF; there are twice as many columns.
const MOST_ROWS: u32 = 256;

impl EnvironmentCdf {
    /// The CDF in proportion to each cell's mean radiance times its solid angle.
    #[must_use]
    pub fn of(map: &Environment) -> Self {
        let (rows, columns) = (map.height.min(MOST_ROWS), map.width.min(2 * MOST_ROWS));
        let (width, height) = (map.width as usize, map.height as usize);
        // Neighbouring texels count, too, because bilinear interpolation mixes them in.
        let range = |cell: u32, cells: u32, texels: usize| {
            let at = |i: u32| f64::from(i) / f64::from(cells) * texels as f64;
            (at(cell).floor() as isize - 1, at(cell + 1).ceil() as isize + 1)
        };
        let mut cells = vec![0.0; (rows * columns) as usize];
        let mut sums = Vec::with_capacity(rows as usize);
        for row in 0..rows {
            let (top, bottom) = range(row, rows, height);
            let sin = ((f64::from(row) + 0.5) / f64::from(rows) * PI).sin();
            let mut sum = 0.0;
            for column in 0..columns {
                let (left, right) = range(column, columns, width);
                let mut total = 0.0;
                for y in top..bottom {
                    let y = y.clamp(0, height as isize - 1) as usize;
                    for x in left..right {
                        total += mean(map.radiance[y * width + x.rem_euclid(width as isize) as usize]);
                    }
                }
                let weight = total / ((bottom - top) * (right - left)) as f64 * sin;
                cells[(row * columns + column) as usize] = weight;
                sum += weight;
            }
            sums.push(sum);
        }
        let mut words: Vec<u32> = shares(&sums).into_iter().map(|(first, _)| first).collect();
        for row in cells.chunks(columns as usize) {
            words.extend(shares(row).into_iter().map(|(first, _)| first));
        }
        Self { columns, rows, words, rotation: 0.0 }
    }

    /// The cell of two numbers in [0, 1), and where in it they are: column, row, and fractions across and down.
    fn cell(&self, [x, y]: [f64; 2]) -> ([usize; 2], [f64; 2]) {
        let (columns, rows) = (self.columns as usize, self.rows as usize);
        let find = |firsts: &[u32], at: f64| {
            let word = at * ALL;
            let found = firsts.partition_point(|&first| f64::from(first) <= word).max(1) - 1;
            let (first, next) = (f64::from(firsts[found]), firsts.get(found + 1).map_or(ALL, |&next| f64::from(next)));
            (found, ((word - first) / (next - first)).clamp(0.0, 1.0))
        };
        let (row, down) = find(&self.words[..rows], y);
        let (column, across) = find(&self.words[rows + row * columns..][..columns], x);
        ([column, row], [across, down])
    }

    /// A direction in the map's axes, from two numbers in [0, 1).
    #[must_use]
    pub fn sample(&self, numbers: [f64; 2]) -> DVec3 {
        let ([column, row], [across, down]) = self.cell(numbers);
        let at = |i: usize, part: f64, of: u32| (i as f64 + part) / f64::from(of);
        direction(at(column, across, self.columns), at(row, down, self.rows))
    }

    /// Density per solid angle of a direction in the map's axes.
    #[must_use]
    pub fn density(&self, d: DVec3) -> f64 {
        let (columns, rows) = (self.columns as usize, self.rows as usize);
        let [u, v] = [d.z.atan2(d.x) / TAU + 0.5, 0.5 - d.y.clamp(-1.0, 1.0).asin() / PI];
        let row = ((v * rows as f64) as usize).min(rows - 1);
        let column = ((u * columns as f64) as usize).min(columns - 1);
        let share = |firsts: &[u32], i: usize| {
            (firsts.get(i + 1).map_or(ALL, |&next| f64::from(next)) - f64::from(firsts[i])) / ALL
        };
        let probability =
            share(&self.words[..rows], row) * share(&self.words[rows + row * columns..][..columns], column);
        // Samples are even over v within a cell, so the density has the sine of the direction itself.
        let sin = (1.0 - d.y * d.y).max(1e-12).sqrt();
        probability * (rows * columns) as f64 / (2.0 * PI * PI * sin)
    }

    /// Samples a world-space direction with two random words: `sample_environment` of shaders/lib/light_sampling.glsl
    /// without the jitter within a cell.
    #[must_use]
    pub fn direction(&self, words: [u32; 2]) -> DVec3 {
        let ([column, row], _) = self.cell(words.map(|word| f64::from(word) / ALL));
        let middle = |i: usize, of: u32| (i as f64 + 0.5) / f64::from(of);
        let found = direction(middle(column, self.columns), middle(row, self.rows));
        DMat3::from_rotation_y(self.rotation.to_radians()) * found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_fill_all_words_and_none_is_empty() {
        for weights in [vec![1.0], vec![1.0, 3.0], vec![0.0, 0.0, 5.0], vec![0.0; 4], vec![1e-30, 1.0, 1e30]] {
            let shares = shares(&weights);
            assert_eq!(shares[0].0, 0);
            let total: f64 = shares.iter().map(|share| share.1).sum();
            assert!((total - 1.0).abs() < 1e-15);
            assert!(shares.iter().all(|share| share.1 > 0.0));
            let sum: f64 = weights.iter().sum();
            for ((_, probability), weight) in shares.iter().zip(&weights) {
                let wanted = if sum > 0.0 { weight / sum } else { 1.0 / weights.len() as f64 };
                assert!((probability - wanted).abs() < 1e-8, "{weights:?}: {probability} for {wanted}");
            }
            let word = |probability: f64| probability * 4_294_967_296.0;
            assert!(shares.windows(2).all(|pair| f64::from(pair[1].0 - pair[0].0) == word(pair[0].1)));
        }
    }
}
