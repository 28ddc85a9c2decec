//! Dispatch sizes for lists of tiles, and shares of a picture's tiles.

use crate::plan::Architecture;
use crate::shader::lib::work_tile::{ROW, WORK_TILE};

/// A share of the picture: every `of`-th tile of 8x8 pixels, in row order, from tile `index` on. Neighbouring tiles
/// take similar time, so shares do, too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileShare {
    /// Index of the first tile, less than `of`.
    pub index: u32,
    /// Number of shares.
    pub of: u32,
}

impl TileShare {
    /// The whole picture.
    pub const ALL: Self = Self { index: 0, of: 1 };

    /// Number of tiles of a picture of `size` pixels in this share (shaders/lib/own_tiles.glsl).
    #[must_use]
    pub fn tiles(self, size: [u32; 2]) -> u32 {
        let all = size[0].div_ceil(WORK_TILE) * size[1].div_ceil(WORK_TILE);
        all.saturating_sub(self.index).div_ceil(self.of)
    }

    /// Whether the share contains the tile of a pixel.
    #[must_use]
    pub fn has(self, [x, y]: [u32; 2], width: u32) -> bool {
        (y / WORK_TILE * width.div_ceil(WORK_TILE) + x / WORK_TILE) % self.of == self.index
    }
}

/// Size of a dispatch of `count` workgroups in rows; `listed_tile` of the shader computes the linear index.
#[must_use]
pub fn rows_of(count: u32) -> [u32; 3] {
    [count.min(ROW), count.div_ceil(ROW), 1]
}

/// Stride in which `count` workgroups visit the tiles of a picture, modulo `count`.
///
/// Workgroups of a GPU that run together share caches: neighbours take neighbouring tiles. A CPU (lavapipe) gives each
/// of its threads one contiguous piece of a dispatch, and expensive pixels are often in one part of the picture: the
/// stride is about `count` times the golden section, which spreads any number of workgroups evenly. It is coprime to
/// `count`, so every tile is visited once, and its product with any index fits 32 bits.
#[must_use]
pub fn stride(architecture: Architecture, count: u32) -> u32 {
    if architecture == Architecture::Gpu {
        return 1;
    }
    let gcd = |mut a: u32, mut b: u32| {
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let golden = (f64::from(count) * 0.618_033_988_749_895) as u32;
    let most = golden.min(u32::MAX / count.max(1));
    (1..=most).rev().find(|&stride| gcd(stride, count) == 1).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strides_reach_every_workgroup_and_any_piece_is_from_everywhere() {
        for count in [1, 2, 3, 4, 6, 12, 30, 225, 900, 2310, 8160, 65_536] {
            let place = |turn: u32| turn.checked_mul(stride(Architecture::Cpu, count)).expect("32 bits") % count;
            let mut places: Vec<u32> = (0..count).map(place).collect();
            // A half of the first half of the workgroups lies in each half of the picture: the discrepancy of the
            // golden section grows with the logarithm.
            let early = places[..count as usize / 2].iter().filter(|&&place| place < count / 2).count();
            assert!(early.abs_diff(count as usize / 4) <= 1 + count.ilog2() as usize, "{count}: {early}");
            places.sort_unstable();
            assert!(places.iter().copied().eq(0..count), "{count}");
        }
    }
}
