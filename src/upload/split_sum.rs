//! The tables of GGX lobes for the split-sum approximation, by the viewer's cosine and perceptual roughness:
//! directional albedos, and the means of lobes (shaders/lib/reflectance.glsl).
//!
//! A lobe sees the environment as the lobe of the prefiltered map does whose mean direction is the same, and whose mean
//! has the same length (docs/decisions/split-sum.md). Read Karis 2013, "Real Shading in Unreal Engine 4"; Heitz 2018,
//! "Sampling the GGX Distribution of Visible Normals".

use std::sync::OnceLock;

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::lobe::LOBES;
use crate::share;

/// Side of each table, over cosθ and perceptual roughness.
pub const SIDE: u32 = share::LOBE_TABLE_SIDE;
type Texel = [f32; 4];

/// Samples of a lobe.
const SAMPLES: u32 = 512;
/// The cosine for the last column of means: at 1 the direction of reflection is the normal, and nothing lies between.
const ALMOST_NORMAL: f64 = 0.999;
/// The roughness for the first row of means: a lobe without width has no share of a width.
const ALMOST_SMOOTH: f64 = 0.01;

/// Both tables, one below the other, computed once per process. It has two forms: with the albedo of an extension's
/// lobe in the last two channels of the first table, or without.
pub fn tables(lobes: u32) -> &'static [Texel] {
    static TABLES: [OnceLock<Vec<Texel>>; 2] = [const { OnceLock::new() }; 2];
    let side = SIDE as usize;
    // Both axes run from 0 to 1 inclusive; the horizon, where the lobe is invisible, takes its limit.
    let at = |i: usize| i as f64 / (side - 1) as f64;
    let seen = LOBES.iter().enumerate().filter(|(place, _)| lobes >> place & 1 != 0);
    let over = seen.filter_map(|(_, lobe)| lobe.albedo).next();
    let row = |row: usize, widths: &Widths| {
        let over = over.map_or(vec![[0.0; 2]; side], |albedo| albedo(at(row), side));
        let texels = over.into_iter().enumerate().map(|(i, [c, d])| {
            let (cos_v, roughness) = (at(i).max(1e-4), at(row));
            let parts = parts_of_lobe(cos_v, roughness);
            let [a, b] = directional_reflectance(parts);
            let inner = (cos_v.min(ALMOST_NORMAL), roughness.max(ALMOST_SMOOTH));
            let parts = if inner == (cos_v, roughness) { parts } else { parts_of_lobe(inner.0, inner.1) };
            let [[k, l], [m, n]] = parts.map(|part| round_lobe(inner.0, inner.1, part, widths));
            [[a, b, c, d], [k, l, m, n]].map(|texel| texel.map(|x| x as f32))
        });
        texels.collect::<Vec<_>>()
    };
    // At most one lobe has an albedo (`LOBES`).
    TABLES[usize::from(over.is_some())].get_or_init(|| {
        let widths = Widths::new();
        let both: Vec<[Texel; 2]> = (0..side).into_par_iter().flat_map_iter(|i| row(i, &widths)).collect();
        [0, 1].into_iter().flat_map(|table| both.iter().map(move |texel| texel[table])).collect()
    })
}

/// Sums over samples of a lobe, or of a part of it: of the weights, and of the directions by their weights.
#[derive(Debug, Clone, Copy, Default)]
struct LobeSums {
    weight: f64,
    direction: DVec3,
}

impl LobeSums {
    fn of_both([a, b]: [Self; 2]) -> Self {
        Self { weight: a.weight + b.weight, direction: a.direction + b.direction }
    }

    /// The mean direction. Its length is 1 for a lobe without width.
    fn mean(self) -> DVec3 {
        // The exact mean lies in the plane of v and the normal.
        DVec3::new(self.direction.x, 0.0, self.direction.z) / self.weight
    }
}

/// The parts of a white GGX lobe about +Z by F0 and by F90 of Schlick's curve, 1 − (1 − V·H)⁵ and (1 − V·H)⁵ of it,
/// seen from (sinθ, 0, cosθ).
///
/// Importance sampling of the visible normals (VNDF, Heitz 2018): each sample's weight is G₂ / G₁(V), at most 1, so the
/// sum never exceeds the received energy. 512 samples are accurate to 3e-3 in albedos, and to 6e-4 in the mean over the
/// table's texels; with 128, white metals of roughness 0.5 reflected 1.002 of the received light. Sampling D alone
/// needs 4096 for 4e-3.
fn parts_of_lobe(cos_v: f64, roughness: f64) -> [LobeSums; 2] {
    let alpha = roughness * roughness;
    let a2 = alpha * alpha;
    let root = |c: f64| (a2 + (1.0 - a2) * c * c).sqrt();
    let v = DVec3::new((1.0 - cos_v * cos_v).sqrt(), 0.0, cos_v);
    // V in the stretched space where the microsurface is a hemisphere, and a basis around it; V has no y.
    let stretched = DVec3::new(alpha * v.x, 0.0, v.z).normalize();
    let (t1, t2) = (DVec3::Y, stretched.cross(DVec3::Y));
    let mut parts = [LobeSums::default(); 2];
    for i in 0..SAMPLES {
        let radius = ((f64::from(i) + 0.5) / f64::from(SAMPLES)).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i.reverse_bits()) / 2_f64.powi(32)).sin_cos();
        // A point on the projected disk of the hemisphere seen from V: its lower half is foreshortened.
        let x = radius * cos;
        let lower = 0.5 * (1.0 + stretched.z);
        let y = (1.0 - lower) * (1.0 - x * x).sqrt() + lower * radius * sin;
        let n = t1 * x + t2 * y + stretched * (1.0 - x * x - y * y).max(0.0).sqrt();
        let h = DVec3::new(alpha * n.x, alpha * n.y, n.z.max(0.0)).normalize();
        let v_h = v.dot(h);
        let l = h * (2.0 * v_h) - v;
        if l.z > 0.0 {
            let masking = 2.0 * cos_v / (cos_v + root(cos_v));
            let masking_shadowing = 2.0 * l.z * cos_v / (cos_v * root(l.z) + l.z * root(cos_v));
            let weight = masking_shadowing / masking;
            let grazing = (1.0 - v_h).powi(5);
            for (part, share) in parts.iter_mut().zip([1.0 - grazing, grazing]) {
                part.weight += weight * share;
                part.direction += l * (weight * share);
            }
        }
    }
    parts
}

/// Directional albedo of the GGX lobe, split into the factors of F0 and F90 (split sum, Karis 2013):
/// A = ∫ (1 − (1 − V·H)⁵) G₂ V·H / (N·H N·V), B the same integral with (1 − V·H)⁵, over the distribution of half
/// vectors.
fn directional_reflectance(parts: [LobeSums; 2]) -> [f64; 2] {
    parts.map(|part| part.weight / f64::from(SAMPLES))
}

/// How short the mean of the prefiltered map's lobe is, N = V = R, by α.
struct Widths {
    /// ln α and ln (1 − length), both ascending.
    of_alpha: Vec<[f64; 2]>,
}

impl Widths {
    fn new() -> Self {
        const STEPS: u32 = 256;
        let ends = [2.0 * ALMOST_SMOOTH.ln() - 1.0, 0.0];
        let of_alpha = (0..=STEPS).into_par_iter().map(|i| {
            let ln_alpha = ends[0] + (ends[1] - ends[0]) * f64::from(i) / f64::from(STEPS);
            let lobe = LobeSums::of_both(parts_of_lobe(1.0, (0.5 * ln_alpha).exp()));
            [ln_alpha, (1.0 - lobe.mean().length()).ln()]
        });
        Self { of_alpha: of_alpha.collect() }
    }

    /// The α of which the mean has this length.
    fn alpha(&self, length: f64) -> f64 {
        let short = (1.0 - length).ln();
        let next = self.of_alpha.partition_point(|&[_, other]| other < short).clamp(1, self.of_alpha.len() - 1);
        let ([a, b], [c, d]) = (self.of_alpha[next - 1], self.of_alpha[next]);
        (a + (c - a) * ((short - b) / (d - b)).clamp(0.0, 1.0)).exp()
    }
}

/// The lobe of the prefiltered map that stands for a part of a lobe: k and α'/α. Its direction is that of
/// R + k (N − R), where R is the direction of reflection.
///
/// For R = (−sinθ, cosθ) and a mean direction of tangent T to the normal, sinθ (1 − k) = T (cosθ + k (1 − cosθ)).
fn round_lobe(cos_v: f64, roughness: f64, part: LobeSums, widths: &Widths) -> [f64; 2] {
    let sin_v = (1.0 - cos_v * cos_v).sqrt();
    let mean = part.mean();
    let tangent = -mean.x / mean.z;
    let towards_normal = (sin_v - tangent * cos_v) / (sin_v + tangent * (1.0 - cos_v));
    [towards_normal, widths.alpha(mean.length()) / (roughness * roughness)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_lobe_reflects_as_fresnel_says() {
        let [a, b] = directional_reflectance(parts_of_lobe(0.5, 0.02));
        let grazing = 0.5_f64.powi(5);
        assert!((a - (1.0 - grazing)).abs() < 5e-3, "{a}");
        assert!((b - grazing).abs() < 5e-3, "{b}");
    }

    #[test]
    fn no_lobe_reflects_more_than_it_receives() {
        for roughness in [0.05, 0.2, 0.5, 0.8, 1.0] {
            for cos_v in [0.02, 0.1, 0.5, 1.0] {
                let [a, b] = directional_reflectance(parts_of_lobe(cos_v, roughness));
                assert!(a + b <= 1.0 && a >= 0.0 && b >= 0.0, "{cos_v} {roughness}: {a} {b}");
            }
        }
    }

    /// The midpoint rule over the hemisphere of L, without importance sampling: directions and solid angles.
    fn over_the_hemisphere(mut at: impl FnMut(DVec3, f64)) {
        let (rings, turns) = (1000, 1000);
        for i in 0..rings {
            let cos_l = (f64::from(i) + 0.5) / f64::from(rings);
            let sin_l = (1.0 - cos_l * cos_l).sqrt();
            for j in 0..turns {
                let (sin, cos) = (std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(turns)).sin_cos();
                at(DVec3::new(sin_l * cos, sin_l * sin, cos_l), std::f64::consts::TAU / f64::from(rings * turns));
            }
        }
    }

    /// The BRDF of a white microsurface of α times cosθ.
    fn ggx(cos_v: f64, alpha: f64, l: DVec3, v: DVec3) -> f64 {
        let root = |c: f64| (alpha * alpha + (1.0 - alpha * alpha) * c * c).sqrt();
        let h = (l + v).normalize();
        let d = alpha * alpha / (std::f64::consts::PI * (h.z * h.z * (alpha * alpha - 1.0) + 1.0).powi(2));
        d * 0.5 / (cos_v * root(l.z) + l.z * root(cos_v)) * l.z
    }

    #[test]
    fn the_table_is_the_integral() {
        for (cos_v, roughness) in [(0.9, 0.6), (0.3, 0.5), (0.1, 0.8), (0.6, 1.0)] {
            let v = DVec3::new((1.0_f64 - cos_v * cos_v).sqrt(), 0.0, cos_v);
            let mut truth = [0.0; 2];
            over_the_hemisphere(|l, solid_angle| {
                let value = ggx(cos_v, roughness * roughness, l, v) * solid_angle;
                let grazing = (1.0 - v.dot((l + v).normalize())).powi(5);
                truth[0] += value * (1.0 - grazing);
                truth[1] += value * grazing;
            });
            let table = directional_reflectance(parts_of_lobe(cos_v, roughness));
            for (table, truth) in table.iter().zip(truth) {
                assert!((table - truth).abs() < 3e-3, "{cos_v} {roughness}: {table} {truth}");
            }
        }
    }

    #[test]
    fn a_round_lobe_has_the_mean_of_the_lobe() {
        let widths = Widths::new();
        let mean = |cos_v: f64, alpha: f64, part: fn(f64) -> f64| {
            let v = DVec3::new((1.0 - cos_v * cos_v).sqrt(), 0.0, cos_v);
            let (mut sum, mut all) = (DVec3::ZERO, 0.0);
            over_the_hemisphere(|l, solid_angle| {
                let weight = ggx(cos_v, alpha, l, v) * solid_angle * part(v.dot((l + v).normalize()));
                sum += l * weight;
                all += weight;
            });
            sum / all
        };
        let lobes = [(0.9, 0.6), (0.3, 0.5), (0.1, 0.8), (0.6, 1.0), (0.5, 0.4)];
        let shares: [fn(f64) -> f64; 2] = [|v_h| 1.0 - (1.0 - v_h).powi(5), |v_h| (1.0 - v_h).powi(5)];
        for ((cos_v, roughness), part) in lobes.into_iter().flat_map(|lobe| [0, 1].map(|part| (lobe, part))) {
            let [towards_normal, width] = round_lobe(cos_v, roughness, parts_of_lobe(cos_v, roughness)[part], &widths);
            let truth = mean(cos_v, roughness * roughness, shares[part]);
            let r = DVec3::new(-(1.0_f64 - cos_v * cos_v).sqrt(), 0.0, cos_v);
            let direction = (r + (DVec3::Z - r) * towards_normal).normalize();
            let angle = direction.cross(truth.normalize()).length();
            assert!(angle < 3e-3, "{cos_v} {roughness}: {angle}");
            // The map has no lobe wider than that of α = 1.
            let [wanted, widest] = [truth.length(), mean(1.0, 1.0, |_| 1.0).length()];
            let length = mean(1.0, width * roughness * roughness, |_| 1.0).length();
            assert!((length - wanted.max(widest)).abs() < 3e-3, "{cos_v} {roughness}: {length} {wanted}");
        }
    }

    /// A narrow lobe is seen in the direction of reflection. Seen from the normal, a lobe stands for itself.
    #[test]
    fn narrow_and_straight_lobes_stay_what_they_are() {
        let widths = Widths::new();
        let [towards_normal, width] = round_lobe(0.5, 0.05, LobeSums::of_both(parts_of_lobe(0.5, 0.05)), &widths);
        assert!(towards_normal.abs() < 1e-3 && width > 0.5 && width < 1.0, "{towards_normal} {width}");
        for roughness in [0.05, 0.3, 0.7, 1.0] {
            let [_, width] = round_lobe(
                ALMOST_NORMAL,
                roughness,
                LobeSums::of_both(parts_of_lobe(ALMOST_NORMAL, roughness)),
                &widths,
            );
            assert!((width - 1.0).abs() < 5e-3, "{roughness}: {width}");
        }
    }
}
