//! Environment light: an equirectangular radiance map (product.md "Conventions").
//!
//! Lookup for a world direction d: u = atan2(d.z, d.x) / 2π + 0.5, v = 0.5 − asin(d.y) / π; u to the right, v down
//! from the top row, bilinear, wrapping in u.

/// Linear Rec. 709 radiance on an equirectangular grid.
#[derive(Debug, Clone)]
pub struct Environment {
    /// Path or the name of the generator.
    pub name: String,
    /// Pixels across (full turn).
    pub width: u32,
    /// Pixels down (top pole to bottom pole).
    pub height: u32,
    /// `width * height` radiances, rows from the top, finite and never negative.
    pub radiance: Vec<[f32; 3]>,
}
