//! Directions in which rays of ambient occlusion look at the environment: a median cut of its sphere.
//!
//! Read Debevec 2005, "A Median Cut Algorithm for Light Probe Sampling"; Real-Time Rendering (4th ed.), section 11.3.
//! The sphere is cut into regions of equal measure, half of it the environment's power and half solid angle, each
//! across the axis in which it is longest. The directions are the regions' middles. In the list a run of N directions
//! has one in each of the N regions of a coarser cut, so each sample of a pixel has directions all over the sphere.

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
    /// In the axes of the cuts.
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

/// Cuts pieces into `count` regions of equal measure, and gives their middles: from both sides of the cut in turn, the
/// left one first where `from_left`. In what lies right of a cut the order is the other way round, at each cut (Thue
/// and Morse): otherwise the directions of a sample would all lie on the same side within regions of a coarser cut.
fn cut(mut pieces: Vec<Piece>, count: usize, from_left: bool) -> Vec<Piece> {
    let measure: f64 = pieces.iter().map(|piece| piece.measure).sum();
    let middle = pieces.iter().map(|piece| piece.direction * piece.measure).sum::<DVec3>() / measure;
    if count == 1 {
        let power = std::array::from_fn(|channel| pieces.iter().map(|piece| piece.power[channel]).sum());
        let solid_angle = pieces.iter().map(|piece| piece.solid_angle).sum();
        // The middle of the whole sphere is no direction.
        let direction = middle.try_normalize().unwrap_or(pieces[0].direction);
        return vec![Piece { direction, measure, power, solid_angle }];
    }
    let variance: DVec3 = pieces.iter().map(|piece| (piece.direction - middle).powf(2.0) * piece.measure).sum();
    let axis = variance.max_position();
    // Pieces are large: their places are sorted.
    let mut places: Vec<(f64, u32)> = (0..).zip(&pieces).map(|(i, piece)| (piece.direction[axis], i)).collect();
    places.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    pieces = places.into_iter().map(|(_, i)| pieces[i as usize]).collect();
    // The piece in which the cut lies is parted: a lamp of one texel may be several regions.
    let on_left = if from_left { count.div_ceil(2) } else { count / 2 };
    let wanted = measure * on_left as f64 / count as f64;
    let mut below = 0.0;
    let parted = pieces.iter().position(|piece| {
        below += piece.measure;
        below >= wanted
    });
    let parted = parted.unwrap_or(pieces.len() - 1);
    let piece = pieces[parted];
    let share = (1.0 - (below - wanted) / piece.measure).clamp(0.0, 1.0);
    let mut right = pieces.split_off(parted);
    pieces.push(piece.part(share));
    right[0] = piece.part(1.0 - share);
    let (left, right) = (cut(pieces, on_left, from_left), cut(right, count - on_left, !from_left));
    let (first, second) = if from_left { (left, right) } else { (right, left) };
    let mut regions = Vec::with_capacity(count);
    for (i, region) in first.into_iter().enumerate() {
        regions.push(region);
        regions.extend(second.get(i));
    }
    regions
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
        let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
        let map_from_cuts = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), seed as f64 * golden_angle);
        let cuts_from_map = map_from_cuts.transpose();
        let world_from_cuts = DMat3::from_rotation_y(self.rotation.to_radians()) * map_from_cuts;
        let mut pieces = self.pieces.clone();
        for piece in &mut pieces {
            piece.direction = cuts_from_map * piece.direction;
        }
        let of_region = |region: Piece| SkyDirection {
            direction: world_from_cuts * region.direction,
            weight: region.power.map(|power| power * f64::from(count)),
            solid_angle: region.solid_angle * f64::from(count),
        };
        cut(pieces, count as usize, false).into_iter().map(of_region).collect()
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
            assert!(off < 0.15, "{wall}: {off}");
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
