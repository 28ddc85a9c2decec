//! How long lists of workgroups are dispatched.

/// Workgroups along x before a dispatch goes on along y: `ROW` of shaders/lib/work_tile.glsl.
const ROW: u32 = 32768;

/// A dispatch of `count` workgroups in rows; the shader takes its place from `listed_tile`.
#[must_use]
pub fn rows_of(count: u32) -> [u32; 3] {
    [count.min(ROW), count.div_ceil(ROW), 1]
}
