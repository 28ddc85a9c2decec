//! Catalogue entries of equations: twin, test regions and error bounds.
//!
//! Read docs/numerics.md. Bounds are absolute errors or units in the last place (ulp) of f32.

use glam::DVec3;
use strum::{EnumMessage, IntoStaticStr, VariantArray};

/// Tiers of f32 arithmetic: the rungs of the knob `arithmetic`.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, EnumMessage, IntoStaticStr, VariantArray, serde::Serialize,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Tier {
    /// The textbook formula as written, without an error bound.
    Fast,
    /// Rewritten without cancellation, at about the same cost.
    Stable,
    /// Double-float sums and products (pairs of f32) where they reduce the error further.
    Compensated,
}

impl Tier {
    /// All tiers, cheapest first.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Stable, Self::Compensated];

    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// One equation.
#[derive(Debug)]
pub struct Equation {
    /// Name in tables and vector files, equal to the name in the shader's tag.
    pub name: &'static str,
    /// Maps input columns to output columns, exact within f64. NaN where an output is undefined.
    pub twin: fn(&[f64]) -> Vec<f64>,
    /// Parts of the domain from which test inputs are drawn.
    pub regions: &'static [Region],
    /// Bounds, in the order of the output columns.
    pub outputs: &'static [Output],
    /// Abscissa of the error plot.
    pub axis: Axis,
    /// Largest magnitude of inputs outside the domain for which the result, though possibly meaningless, must not be
    /// NaN. Below 0: callers keep to the domain, and inputs outside it are not tested.
    pub extreme: f32,
}

/// A part of the domain with a random generator of inputs.
#[derive(Debug)]
pub struct Region {
    /// Description of the part.
    pub name: &'static str,
    /// Relative weight of the region among all cases.
    pub share: u32,
    /// Draws the input columns of one case; each is a value of f32.
    pub draw: fn(&mut SplitMix64) -> Vec<f32>,
}

/// An output column and its error bound.
#[derive(Debug)]
pub struct Output {
    /// Column name.
    pub name: &'static str,
    /// The error bound in words.
    pub bound: &'static str,
    /// The largest absolute error allowed in a case; infinite without a bound.
    pub allowed: fn(&Case<'_>) -> f64,
}

/// The data of a case from which a bound is computed.
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    /// Stable or compensated: the fast tier has no bounds.
    pub tier: Tier,
    /// Input columns.
    pub inputs: &'a [f64],
    /// Exact output columns.
    pub exact: &'a [f64],
    /// Index of the output column.
    pub column: usize,
}

impl Case<'_> {
    /// The exact value of the column.
    #[must_use]
    pub fn x(&self) -> f64 {
        self.exact[self.column]
    }

    /// `count` units in the last place of the exact value.
    #[must_use]
    pub fn ulps(&self, count: f64) -> f64 {
        count * ulp(self.x())
    }

    /// `part` times the magnitude of the exact value.
    #[must_use]
    pub fn rel(&self, part: f64) -> f64 {
        part * self.x().abs()
    }

    /// The first value for the stable tier, the second for the compensated one.
    #[must_use]
    pub fn tiered(&self, stable: f64, compensated: f64) -> f64 {
        if self.tier == Tier::Compensated { compensated } else { stable }
    }
}

/// Abscissa of an error plot.
#[derive(Debug, Clone, Copy)]
pub struct Axis {
    /// Name with unit.
    pub name: &'static str,
    /// Whether the axis is logarithmic.
    pub log: bool,
    /// The quantity, from the input columns.
    pub of: fn(&[f64]) -> f64,
    /// The output column whose error is plotted.
    pub column: usize,
    /// Whether the error is relative to the exact value; not for components of vectors, which may be near 0.
    pub relative: bool,
}

/// Unit in the last place: distance between neighbouring values of f32 at `x`.
#[must_use]
pub fn ulp(x: f64) -> f64 {
    let size = x.abs();
    if !size.is_finite() || size > f64::from(f32::MAX) {
        return 2_f64.powi(104);
    }
    // f32 and f64 have the same exponent, except below the normal range of f32.
    let exponent = ((size.to_bits() >> 52) as i32 - 1023).max(-126);
    2_f64.powi(exponent - 23)
}

/// SplitMix64 (Steele, Lea, Flood 2014): a random number generator with the same sequence on every machine.
#[derive(Debug, Clone)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// The sequence of `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * 2_f64.powi(-53)
    }

    /// Uniform in [a, b).
    pub fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }

    /// Log-uniform in [a, b), both positive.
    pub fn log(&mut self, a: f64, b: f64) -> f64 {
        (a.ln() + (b / a).ln() * self.unit()).exp()
    }

    /// 1 or −1.
    pub fn sign(&mut self) -> f64 {
        if self.bits() & 1 == 0 { 1.0 } else { -1.0 }
    }

    /// Fisher–Yates shuffle.
    pub fn shuffle<T>(&mut self, all: &mut [T]) {
        for i in (1..all.len()).rev() {
            let j = self.below(i + 1);
            all.swap(i, j);
        }
    }

    /// An integer in [0, count).
    pub fn below(&mut self, count: usize) -> usize {
        (self.unit() * count as f64) as usize
    }

    /// One of `values`, or a neighbour at most three values of f32 away.
    pub fn near(&mut self, values: &[f32]) -> f32 {
        let value = values[self.below(values.len())];
        let steps = self.below(7) as i32 - 3;
        let mut moved = value;
        for _ in 0..steps.abs() {
            moved = if steps > 0 { moved.next_up() } else { moved.next_down() };
        }
        moved
    }

    /// A uniformly distributed direction, exact in f64.
    pub fn direction(&mut self) -> DVec3 {
        let z = self.between(-1.0, 1.0);
        let phi = self.between(0.0, std::f64::consts::TAU);
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * phi.cos(), r * phi.sin(), z)
    }

    /// A direction at `angle` radians from the unit vector `from`, at a random azimuth.
    pub fn at_angle(&mut self, from: DVec3, angle: f64) -> DVec3 {
        let across = self.perpendicular(from);
        from * angle.cos() + across * angle.sin()
    }

    /// A unit vector perpendicular to `to`.
    pub fn perpendicular(&mut self, to: DVec3) -> DVec3 {
        loop {
            let across = to.cross(self.direction());
            if across.length() > 0.1 {
                return across.normalize();
            }
        }
    }
}

/// Components of vectors as columns, rounded to f32.
#[must_use]
pub fn columns(vectors: &[DVec3]) -> Vec<f32> {
    vectors.iter().flat_map(|v| [v.x as f32, v.y as f32, v.z as f32]).collect()
}

/// The vector in three columns starting at `first`.
#[must_use]
pub fn vector(inputs: &[f64], first: usize) -> DVec3 {
    DVec3::from_slice(&inputs[first..first + 3])
}

/// 1 for true, 0 for false.
#[must_use]
pub fn flag(set: bool) -> f64 {
    f64::from(u8::from(set))
}

/// Bound of flags and of outputs that must be exact.
pub const EXACT: fn(&Case<'_>) -> f64 = |_| 0.0;
