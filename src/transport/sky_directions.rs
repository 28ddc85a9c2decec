//! Directions in which rays of ambient occlusion look at the environment: a median cut of its sphere.
//!
//! Read Debevec 2005, "A Median Cut Algorithm for Light Probe Sampling"; Real-Time Rendering (4th ed.), section 11.3.
//! The sphere is cut into regions of equal measure, half of it the environment's power and half solid angle, each
//! across the axis in which it is longest. The directions are the regions' middles. In the list a run of N directions
//! has one in each of the N regions of a coarser cut, so each sample of a pixel has directions all over the sphere.

use std::cmp::Ordering;
use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use super::emitters::Sky;
use crate::scene::environment::{Environment, direction};

/// A direction and its weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkyDirection {
    /// Unit vector in world axes.
    pub direction: DVec3,
    /// The region's radiance times solid angle, times the number of directions, in W/m².
    pub weight: [f64; 3],
    /// That of the region, times the number of directions, in sr.
    pub solid_angle: f64,
}

/// A piece of the sphere.
#[derive(Clone, Copy)]
struct Piece {
    /// In the axes of the cuts: of a cell a unit vector, of a region the mean of its cells' vectors.
    direction: DVec3,
    /// Mean of its shares of all power and of all solid angle.
    measure: f64,
    /// Radiance times solid angle, in W/m².
    power: [f64; 3],
    /// In sr.
    solid_angle: f64,
}

impl Piece {
    fn part(self, share: f64) -> Self {
        Self {
            direction: self.direction,
            measure: self.measure * share,
            power: self.power.map(|power| power * share),
            solid_angle: self.solid_angle * share,
        }
    }
}

/// Rows of the grid that is cut; there are twice as many columns. With twice as coarse a grid
/// 64 directions are off by 3 % more.
const ROWS: u32 = 128;

/// The cells of a grid of longitudes and latitudes.
fn grid(map: &Environment) -> Vec<Piece> {
    // Texels of which a cell has the mean, or the one that it lies in.
    let texels = |cell: u32, cells: u32, texels: u32| {
        let first = cell * texels / cells;
        first..((cell + 1) * texels / cells).max(first + 1)
    };
    let mut cells = Vec::with_capacity((2 * ROWS * ROWS) as usize);
    for row in 0..ROWS {
        let v = |row: f64| row / f64::from(ROWS);
        let solid_angle =
            ((PI * v(row.into())).cos() - (PI * v(f64::from(row) + 1.0)).cos()) * TAU / f64::from(2 * ROWS);
        for column in 0..2 * ROWS {
            let (down, across) = (texels(row, ROWS, map.height), texels(column, 2 * ROWS, map.width));
            let share = solid_angle / f64::from(down.len() as u32 * across.len() as u32);
            let mut power = [0.0; 3];
            for texel in down.flat_map(|y| across.clone().map(move |x| y * map.width + x)) {
                let radiance = map.radiance[texel as usize];
                power = std::array::from_fn(|channel| power[channel] + f64::from(radiance[channel]) * share);
            }
            let u = (f64::from(column) + 0.5) / f64::from(2 * ROWS);
            cells.push(Piece { direction: direction(u, v(f64::from(row) + 0.5)), measure: 0.0, power, solid_angle });
        }
    }
    let total = |power: [f64; 3]| power.iter().sum::<f64>();
    let all: f64 = cells.iter().map(|cell| total(cell.power)).sum();
    for cell in &mut cells {
        let of_power = if all > 0.0 { total(cell.power) / all } else { 0.0 };
        cell.measure = 0.5 * (of_power + cell.solid_angle / (4.0 * PI));
    }
    cells
}

/// Intervals in which a cut looks for its place before it sorts.
const INTERVALS: usize = 1024;

/// Parts pieces in two across an axis, `wanted` of their measure on the left. The piece in which the cut lies is
/// parted: a lamp of one texel may be several regions. Only the interval with the cut is sorted: sorting all pieces was
/// half of the time of the tests that draw every plan.
fn parted(pieces: Vec<Piece>, axis: usize, wanted: f64) -> [Vec<Piece>; 2] {
    let along = |piece: &Piece| piece.direction[axis];
    let (least, most) = pieces.iter().map(along).fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
    // Where all lie in a plane this is no number, which counts as 0.
    let scale = INTERVALS as f64 / (most - least);
    let interval = |piece: &Piece| (((along(piece) - least) * scale) as usize).min(INTERVALS - 1);
    let mut measures = [0.0; INTERVALS];
    pieces.iter().for_each(|piece| measures[interval(piece)] += piece.measure);
    let mut below = 0.0;
    let at = measures.iter().position(|measure| {
        below += measure;
        below >= wanted
    });
    let at = at.unwrap_or(INTERVALS - 1);
    below -= measures[at];

    let (mut left, mut right, mut between) = (Vec::new(), Vec::new(), Vec::new());
    for piece in pieces {
        match interval(&piece).cmp(&at) {
            Ordering::Less => left.push(piece),
            Ordering::Equal => between.push(piece),
            Ordering::Greater => right.push(piece),
        }
    }
    between.sort_by(|a, b| along(a).total_cmp(&along(b)));
    for piece in between {
        let share = ((wanted - below) / piece.measure).clamp(0.0, 1.0);
        below += piece.measure;
        left.extend((share > 0.0).then(|| piece.part(share)));
        right.extend((share < 1.0).then(|| piece.part(1.0 - share)));
    }
    [left, right]
}

/// Cuts pieces into `count` regions of equal measure, and gives their middles: from both sides of the cut in turn, the
/// left one first where `from_left`. In what lies right of a cut the order is the other way round, at each cut (Thue
/// and Morse): otherwise the directions of a sample would all lie on the same side within regions of a coarser cut.
fn cut(pieces: Vec<Piece>, count: usize, from_left: bool) -> Vec<Piece> {
    let region = joined(&pieces);
    if count <= 1 {
        return vec![region; count];
    }
    let spread = |piece: &Piece| (piece.direction - region.direction).powf(2.0) * piece.measure;
    let axis = pieces.iter().map(spread).sum::<DVec3>().max_position();
    let on_left = if from_left { count.div_ceil(2) } else { count / 2 };
    let [left, right] = parted(pieces, axis, region.measure * on_left as f64 / count as f64);
    let (left, right) = (cut(left, on_left, from_left), cut(right, count - on_left, !from_left));
    let (first, second) = if from_left { (left, right) } else { (right, left) };
    let mut regions = Vec::with_capacity(count);
    for (i, region) in first.into_iter().enumerate() {
        regions.push(region);
        regions.extend(second.get(i));
    }
    regions
}

/// Several pieces as one, with their middle for a direction.
fn joined<'a>(pieces: impl IntoIterator<Item = &'a Piece>) -> Piece {
    let mut all = Piece { direction: DVec3::ZERO, measure: 0.0, power: [0.0; 3], solid_angle: 0.0 };
    for piece in pieces {
        all.direction += piece.direction * piece.measure;
        all.measure += piece.measure;
        all.power = std::array::from_fn(|channel| all.power[channel] + piece.power[channel]);
        all.solid_angle += piece.solid_angle;
    }
    all.direction /= all.measure;
    all
}

/// The `count` regions of a coarser cut of the same sphere, in the order of that cut: powers of two.
fn coarser(regions: &[Piece], count: usize) -> Vec<Piece> {
    // The lowest bit of a region's place is its side of the first cut, and so on.
    (0..count).map(|first| joined(regions.iter().skip(first).step_by(count))).collect()
}

/// The direction of a region's middle. That of the whole sphere is none, but for roundings.
fn towards(middle: DVec3) -> DVec3 {
    if middle.length() > 1e-9 { middle.normalize() } else { DVec3::Y }
}

/// The sphere of an environment, to be cut.
pub struct Sphere {
    pieces: Vec<Piece>,
    /// Of the environment, in degrees.
    rotation: f64,
}

impl Sphere {
    /// The environment's power and solid angle, by cells of a grid.
    #[must_use]
    pub fn new(sky: Sky<'_>) -> Self {
        Self { pieces: grid(sky.map), rotation: sky.rotation.into() }
    }

    /// `count` directions; `seed` turns the axes of the cuts.
    #[must_use]
    pub fn directions(&self, count: u32, seed: u64) -> Vec<SkyDirection> {
        self.of_regions(self.regions(count, seed), seed)
    }

    /// The same, and `fewer` directions of a coarser cut about the same axes: quickly where both are powers of two.
    #[must_use]
    pub fn directions_of_two_cuts(&self, count: u32, fewer: u32, seed: u64) -> [Vec<SkyDirection>; 2] {
        let regions = self.regions(count, seed);
        let is_part = count.is_power_of_two() && fewer.is_power_of_two() && fewer <= count;
        let fewer = if is_part { coarser(&regions, fewer as usize) } else { self.regions(fewer, seed) };
        [regions, fewer].map(|regions| self.of_regions(regions, seed))
    }

    fn map_from_cuts(seed: u64) -> DMat3 {
        let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
        DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), seed as f64 * golden_angle)
    }

    fn regions(&self, count: u32, seed: u64) -> Vec<Piece> {
        let cuts_from_map = Self::map_from_cuts(seed).transpose();
        let mut pieces = self.pieces.clone();
        for piece in &mut pieces {
            piece.direction = cuts_from_map * piece.direction;
        }
        cut(pieces, count as usize, false)
    }

    fn of_regions(&self, regions: Vec<Piece>, seed: u64) -> Vec<SkyDirection> {
        let world_from_cuts = DMat3::from_rotation_y(self.rotation.to_radians()) * Self::map_from_cuts(seed);
        let count = regions.len() as f64;
        let of_region = |region: Piece| SkyDirection {
            direction: world_from_cuts * towards(region.direction),
            weight: region.power.map(|power| power * count),
            solid_angle: region.solid_angle * count,
        };
        regions.into_iter().map(of_region).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unturned(map: &Environment) -> Sky<'_> {
        Sky { map, intensity: 1.0, rotation: 0.0 }
    }

    /// Irradiance of a normal in the first channel, summed over the texels of the map.
    fn irradiance(map: &Environment, normal: DVec3) -> f64 {
        let mut sum = 0.0;
        for y in 0..map.height {
            let v = (f64::from(y) + 0.5) / f64::from(map.height);
            let texel = 2.0 * PI * PI * (PI * v).sin() / f64::from(map.width * map.height);
            for x in 0..map.width {
                let d = direction((f64::from(x) + 0.5) / f64::from(map.width), v);
                let radiance = map.radiance[(y * map.width + x) as usize][0];
                sum += f64::from(radiance) * normal.dot(d).max(0.0) * texel;
            }
        }
        sum
    }

    /// The mean of weights with cosines is the irradiance of any normal.
    #[test]
    fn directions_give_the_irradiance_of_the_map() {
        let map = Environment::studio();
        for (count, most_off) in [(64, 0.05), (4096, 1e-3)] {
            for seed in [0, 1, 5] {
                let directions = Sphere::new(unturned(&map)).directions(count, seed);
                for normal in [DVec3::Y, DVec3::NEG_Y, DVec3::X, DVec3::new(0.6, 0.0, -0.8)] {
                    let sum: f64 = directions.iter().map(|at| at.weight[0] * normal.dot(at.direction).max(0.0)).sum();
                    let off = sum / f64::from(count) / irradiance(&map, normal) - 1.0;
                    assert!(off.abs() < most_off, "{count}, seed {seed}, {normal}: {off}");
                }
            }
        }
    }

    /// Beside a wall half of a constant environment is seen: by all directions, and by those of each sample.
    #[test]
    fn each_sample_has_directions_all_over_the_sphere() {
        let map = Environment::constant([1.0; 3]);
        for wall in [DVec3::X, DVec3::Z, DVec3::new(0.6, 0.0, -0.8)] {
            let seen = |block: &[SkyDirection]| {
                let cos = |at: &SkyDirection| at.weight[0] * at.direction.y.max(0.0);
                let all: f64 = block.iter().map(cos).sum();
                block.iter().filter(|at| at.direction.dot(wall) > 0.0).map(cos).sum::<f64>() / all
            };
            let directions = Sphere::new(unturned(&map)).directions(256, 0);
            assert!((seen(&directions) - 0.5).abs() < 0.03, "{wall}: {}", seen(&directions));
            let mean = directions.chunks(16).map(seen).sum::<f64>() / 16.0;
            assert!((mean - 0.5).abs() < 0.03, "{wall}: {mean}");
            // With the same order on both sides of each cut it is up to 0.30.
            let off = directions.chunks(16).map(|block| (seen(block) - 0.5).abs()).fold(0.0, f64::max);
            assert!(off < 0.16, "{wall}: {off}");
        }
    }

    /// All power in one texel is half of the measure: about half of the directions point at it, with nearly all power.
    #[test]
    fn a_lamp_of_one_texel_is_several_regions() {
        let mut map = Environment::constant([0.0; 3]);
        (map.width, map.height) = (64, 32);
        map.radiance = vec![[0.0; 3]; 64 * 32];
        map.radiance[10 * 64 + 20] = [5.0; 3];
        let lamp = direction(20.5 / 64.0, 10.5 / 32.0);
        let directions = Sphere::new(unturned(&map)).directions(64, 0);
        // A texel is 5.6° wide.
        let at_lamp = |at: &SkyDirection| at.direction.angle_between(lamp) < 4.0_f64.to_radians();
        let power = |among: &dyn Fn(&SkyDirection) -> bool| {
            directions.iter().filter(|at| among(at)).map(|at| at.weight[0]).sum::<f64>()
        };
        let share = power(&at_lamp) / power(&|_| true);
        assert!(share > 0.9, "{share}");
        for block in directions.chunks(16) {
            let of_block = block.iter().filter(|at| at_lamp(at)).count();
            assert!((7..=9).contains(&of_block), "{of_block}");
        }
    }

    /// The regions are a partition: all power and all solid angle, in equal measures.
    #[test]
    fn regions_have_equal_measures() {
        let pieces = grid(&Environment::studio());
        let sums = |pieces: &[Piece]| {
            let power: f64 = pieces.iter().map(|piece| piece.power[1]).sum();
            (power, pieces.iter().map(|piece| piece.solid_angle).sum::<f64>())
        };
        let all = sums(&pieces);
        assert!((all.1 / (4.0 * PI) - 1.0).abs() < 1e-12, "{}", all.1);
        for count in [1, 3, 16, 100] {
            let regions = cut(pieces.clone(), count, false);
            assert_eq!(regions.len(), count);
            let of_regions = sums(&regions);
            assert!((of_regions.0 / all.0 - 1.0).abs() < 1e-9 && (of_regions.1 / all.1 - 1.0).abs() < 1e-9);
            for region in regions {
                assert!((region.measure * count as f64 - 1.0).abs() < 1e-9, "{count}: {}", region.measure);
            }
        }
    }

    /// The directions that are joined are those of a cut of its own.
    #[test]
    fn a_coarser_cut_is_joined_from_a_finer_one() {
        let map = Environment::studio();
        let sphere = Sphere::new(unturned(&map));
        assert!(sphere.directions(0, 7).is_empty());
        for fewer in [0, 1, 4, 5, 64, 256] {
            let [fine, joined] = sphere.directions_of_two_cuts(256, fewer, 7);
            let own = sphere.directions(fewer, 7);
            assert_eq!((fine.len(), joined.len()), (256, own.len()));
            for (a, b) in joined.iter().zip(&own) {
                assert!(a.direction.distance(b.direction) < 1e-9 * f64::from(256 / fewer), "{fewer}: {a:?}, {b:?}");
                assert!((a.solid_angle / b.solid_angle - 1.0).abs() < 1e-9, "{fewer}: {a:?}, {b:?}");
                assert!(
                    a.weight.iter().zip(b.weight).all(|(a, b)| (a / b - 1.0).abs() < 1e-9),
                    "{fewer}: {a:?}, {b:?}"
                );
            }
        }
    }

    /// Roundings are no direction: that of a constant map's whole sphere is an axis of the cuts.
    #[test]
    fn the_middle_of_the_sphere_is_no_direction() {
        let map = Environment::constant([1.0; 3]);
        let sphere = Sphere::new(unturned(&map));
        let [_, joined] = sphere.directions_of_two_cuts(16, 1, 7);
        let axis = Sphere::map_from_cuts(7) * DVec3::Y;
        assert_eq!([joined[0].direction, sphere.directions(1, 7)[0].direction], [axis; 2]);
    }

    #[test]
    fn rotation_turns_directions_and_keeps_weights() {
        let map = Environment::studio();
        let at = |rotation| Sphere::new(Sky { map: &map, intensity: 1.0, rotation }).directions(16, 3);
        for (a, b) in at(0.0).iter().zip(at(90.0)) {
            assert_eq!((a.weight, a.solid_angle), (b.weight, b.solid_angle));
            assert!((DMat3::from_rotation_y(PI / 2.0) * a.direction).distance(b.direction) < 1e-12);
        }
    }
}
