//! Axis-aligned bounding boxes (AABB).
//!
//! Read pbrt (4th ed.), section 3.7 (bounding boxes).

/// An axis-aligned box in bvh space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Smallest corner.
    pub min: [f32; 3],
    /// Largest corner.
    pub max: [f32; 3],
}

impl Aabb {
    /// The empty box: the neutral element of the union.
    pub const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// The smallest box around both boxes.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|i| self.min[i].min(other.min[i])),
            max: std::array::from_fn(|i| self.max[i].max(other.max[i])),
        }
    }

    /// Whether every point of `other` is in this box.
    #[must_use]
    pub fn contains(&self, other: &Self) -> bool {
        (0..3).all(|i| self.min[i] <= other.min[i] && other.max[i] <= self.max[i])
    }

    /// Extent along an axis.
    #[must_use]
    pub fn size(&self, axis: usize) -> f64 {
        f64::from(self.max[axis]) - f64::from(self.min[axis])
    }

    /// Half of the surface area.
    #[must_use]
    pub fn half_area(&self) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| self.size(axis));
        x * y + y * z + z * x
    }

    /// Twice the centre; exact in f64 for coordinates of similar size.
    pub(crate) fn double_center(&self, axis: usize) -> f64 {
        f64::from(self.min[axis]) + f64::from(self.max[axis])
    }
}
