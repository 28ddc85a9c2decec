//! A picture of some tiles of a larger one: what a forecast measures in place of a smaller picture.
//!
//! A smaller picture has other edges and larger glows than the picture that is asked for. Tiles of 8x8 pixels of that
//! picture itself have neither. They are put side by side, so that everything that judges pictures judges these. What
//! looks at neighbouring pixels, such as FLIP, sees the seams; the mean error of pixels does not.

use etalon::frame::TileShare;
use etalon::image::Picture;
use etalon::image::png::Display;
use etalon::shader::lib::work_tile::WORK_TILE as TILE;

/// The part of a row of tiles by which the pattern of a share moves from row to row, so that few tiles lie in columns:
/// the golden section.
const STEP: f64 = 0.381_966;

/// Fewest whole tiles that stand for a picture.
const FEWEST: usize = 16;

/// The share of one in `times` tiles of a picture of `size` pixels, give or take a quarter, whose tiles are spread most
/// evenly. The whole picture where the share has too few whole tiles: a picture may be lower than a tile.
#[must_use]
pub fn spread(size: [u32; 2], times: f64) -> TileShare {
    let across = size[0].div_ceil(TILE);
    let about = times.round().max(1.0) as u32;
    if about == 1 {
        return TileShare::ALL;
    }
    let uneven = |of: u32| {
        let moves = f64::from(across % of) / f64::from(of);
        (moves - STEP).abs().min((moves - 1.0 + STEP).abs())
    };
    // With a common divisor, the pattern returns to its first columns sooner.
    let divisor = |of: u32| (1..=of).rev().find(|d| of.is_multiple_of(*d) && across.is_multiple_of(*d));
    let near = (about - about / 4).max(2)..=about + about / 4;
    let of = near.min_by(|a, b| divisor(*a).cmp(&divisor(*b)).then(uneven(*a).total_cmp(&uneven(*b))));
    let share = TileShare { index: 0, of: of.unwrap_or(about) };
    if Packing::of(size, share).tiles.len() < FEWEST { TileShare::ALL } else { share }
}

/// The whole tiles of a share, and how they lie side by side.
struct Packing {
    tiles: Vec<[u32; 2]>,
    across: u32,
    down: u32,
}

impl Packing {
    /// A rectangle of tiles, about as wide as high. Tiles beyond its last row are left out: fewer than a row.
    fn of(size: [u32; 2], share: TileShare) -> Self {
        let [across, down] = size.map(|side| side / TILE);
        let at = |row: u32| (0..across).map(move |column| [column * TILE, row * TILE]);
        let tiles: Vec<_> = (0..down).flat_map(at).filter(|&corner| share.has(corner, size[0])).collect();
        let down = (tiles.len() as f64).sqrt().floor().max(1.0) as u32;
        let across = tiles.len() as u32 / down;
        Self { tiles, across, down }
    }
}

/// Size in pixels of what [`packed`] gives: `size` itself for the whole picture.
#[must_use]
pub fn packed_size(size: [u32; 2], share: TileShare) -> [u32; 2] {
    if share == TileShare::ALL {
        return size;
    }
    let Packing { across, down, .. } = Packing::of(size, share);
    [across * TILE, down * TILE]
}

/// The pixels of a share's tiles side by side, row by row; all pixels for the whole picture.
#[must_use]
pub fn packed<T: Copy>(pixels: Vec<T>, size: [u32; 2], share: TileShare) -> Vec<T> {
    if share == TileShare::ALL {
        return pixels;
    }
    let Packing { tiles, across, down } = Packing::of(size, share);
    let row = |y: u32| {
        let tiles = &tiles[(y / TILE * across) as usize..((y / TILE + 1) * across) as usize];
        tiles.iter().flat_map(move |[x, top]| {
            let first = ((top + y % TILE) * size[0] + x) as usize;
            first..first + TILE as usize
        })
    };
    (0..down * TILE).flat_map(row).map(|at| pixels[at]).collect()
}

/// [`packed`] for a picture.
#[must_use]
pub fn packed_picture(picture: Picture, share: TileShare) -> Picture {
    let size = [picture.width, picture.height];
    let [width, height] = packed_size(size, share);
    Picture { width, height, rgba: packed(picture.rgba, size, share) }
}

/// Relative standard error of a picture's error (root mean square of display values) as an estimate from tiles: by the
/// variance of the mean square between the tiles of a picture that is made of them (Cochran, Sampling Techniques, 1977,
/// chapter 2). 0 where nothing differs. `left_out`: the part of all tiles that are not there.
#[must_use]
pub fn standard_error(picture: &Display, reference: &Display, left_out: f64) -> f64 {
    let tiles_across = (picture.width / TILE).max(1) as usize;
    let tiles = tiles_across * (picture.height / TILE).max(1) as usize;
    let mut squares = vec![0.0; tiles];
    for (at, (a, b)) in picture.rgba.iter().zip(&reference.rgba).enumerate() {
        let (x, y) = (at % picture.width as usize, at / picture.width as usize);
        let tile = y / TILE as usize * tiles_across + x / TILE as usize;
        let squared = |c: usize| (f64::from(a[c]) - f64::from(b[c])).powi(2);
        squares[tile.min(tiles - 1)] += squared(0) + squared(1) + squared(2);
    }
    let n = tiles as f64;
    let mean = squares.iter().sum::<f64>() / n;
    let variance = squares.iter().map(|square| (square - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    // A root has half the relative error.
    if mean > 0.0 { 0.5 * (variance * left_out / n).sqrt() / mean } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean square is 0 in one half of 64 tiles and the same in the other half: its mean has a relative standard
    /// error of 1/8, and the root of it half of that.
    #[test]
    fn tiles_that_differ_more_are_known_less() {
        let display = |value: &dyn Fn(u32) -> u8| Display {
            width: 64,
            height: 64,
            rgba: (0..64 * 64).map(|at| [value(at / 64 / 8 * 8 + at % 64 / 8), 0, 0, 255]).collect(),
        };
        let black = display(&|_| 0);
        let half = display(&|tile| 200 * u8::from(tile * 7 % 64 < 32));
        let found = standard_error(&half, &black, 1.0);
        assert!((found - 0.5 / 8.0).abs() < 1e-3, "{found}");
        assert!((standard_error(&half, &black, 0.25) - 0.5 * found).abs() < 1e-9);
        assert_eq!(standard_error(&display(&|_| 9), &black, 1.0), 0.0);
        assert_eq!(standard_error(&black, &black, 1.0), 0.0);
    }

    #[test]
    fn a_share_is_spread_over_rows_and_columns() {
        let cases = [
            ([320, 180], 4.0),
            ([1280, 720], 64.0),
            ([128, 72], 4.0),
            ([1920, 1080], 144.0),
            ([320, 240], 5.3),
            ([240, 135], 2.25),
        ];
        for (size, times) in cases {
            let share = spread(size, times);
            assert!((0.75..=1.25).contains(&(f64::from(share.of) / times)), "{size:?}: {share:?}");
            let across = size[0] / TILE;
            let columns: std::collections::BTreeSet<u32> =
                Packing::of(size, share).tiles.iter().map(|[x, _]| x / TILE).collect();
            assert!(columns.len() as f64 > 0.4 * f64::from(across), "{size:?}: {} columns of {across}", columns.len());
        }
        assert_eq!(spread([64, 36], 0.7), TileShare::ALL);
        assert_eq!([spread([20_000, 7], 9.7), spread([64, 48], 4.0)], [TileShare::ALL; 2]);
    }

    #[test]
    fn tiles_lie_side_by_side() {
        let (size, share) = ([40, 20], TileShare { index: 1, of: 3 });
        // Whole tiles 1, 4, 7 of ten; the rows from 16 on are no whole tiles. One row of three.
        assert_eq!(packed_size(size, share), [24, 8]);
        let pixels: Vec<[u32; 2]> = (0..20).flat_map(|y| (0..40).map(move |x| [x, y])).collect();
        let packed_pixels = packed(pixels.clone(), size, share);
        assert_eq!(packed_pixels.len(), 24 * 8);
        assert_eq!([packed_pixels[0], packed_pixels[8], packed_pixels[16 + 24]], [[8, 0], [32, 0], [16, 9]]);
        assert_eq!(packed(pixels.clone(), size, TileShare::ALL), pixels);
    }
}
