//! The radiosity of what the surfaces of a scene face: the light that occluders send in place of what they hide.
//!
//! Read Goral, Torrance, Greenberg and Battaile 1984 (radiosity); pbrt (4th ed.), chapter 13 (path tracing);
//! docs/decisions/ambient-occlusion.md. Paths start on surfaces, by the cosine as light arrives there, and
//! take all surfaces to be diffuse. What the first ray meets sends the radiosity B, from lamps and from the
//! environment, over any number of surfaces. An ambient cube (McTaggart 2004, "Half-Life 2 / Valve Source
//! Shading") with slopes by place and by the occluded share is fitted to B by robust least squares. It is the same for
//! every device, traversal and camera.

use std::array::from_fn;
use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::bvh::{Bvh, Triangle};
use super::emitters::{EmitterSource, Emitters, SceneTriangle, Sky};
use super::line;
use super::sky_directions::{SkyDirection, Sphere};
use super::surface_point::SurfacePoint;
use crate::optics::SplitMix64;
use crate::optics::light::{point_falloff, spot_share};
use crate::scene::lobe::DIFFUSE_TRANSMISSION;
use crate::scene::solid::Solids;
use crate::scene::{AlphaMode, Extent, Light, LightKind, Material, Scene};

/// Number of points, and of paths from each.
const POINTS: usize = 2048;
const PATHS: usize = 8;
/// Light samples where a path's first ray ends, of the environment and of lamps each; one at later surfaces.
const FIRST_SAMPLES: u32 = 4;
/// Directions of the environment.
const SKY_DIRECTIONS: u32 = 256;
/// Surfaces of a path after which Russian roulette may end it.
const SURE_SURFACES: u32 = 3;
/// Distance of a lamp, in parts of the scene's diagonal, below which it is no brighter: a path beside one would bend
/// the function for the whole scene.
const NEAREST_LAMP: f64 = 0.01;
/// Surfaces that a ray passes at most.
const MOST_PASSED: u32 = 32;
/// Coefficients: the mean, what the cube's six sides have beside it, the slopes by place and by the occluded share.
const TERMS: usize = 11;
/// A ray whose radiosity is off the fit by more than this times the mean counts by the distance, no longer by its
/// square (Huber 1964): the few that end beside a lamp would bend the function for the whole scene.
const FAR_OFF: f64 = 16.0;
/// Fits, each with the weights of the one before (iteratively reweighted least squares).
const FITS: usize = 8;
/// The largest factor by which such a fit is scaled up: where all of the light is far off, no fit has it.
const MOST_SCALED: f64 = 4.0;
/// The ridge of the least squares, in parts of the number of rays and in rays: few rays give a constant.
const RIDGE: [f64; 2] = [0.02, 10.0];

/// The radiosity of occluders in W/m², red, green and blue: an ambient cube with slopes. Zero where no surface faces
/// another one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OccluderRadiosity {
    /// What rays along +x, +y and +z meet, at the origin of bvh space.
    pub along: DMat3,
    /// What rays along −x, −y and −z meet.
    pub against: DMat3,
    /// The slopes along the axes of bvh space, in W/m³.
    pub by_place: DMat3,
    /// The slope by the share of what a surface has around it that is occluded.
    pub by_share: DVec3,
}

impl OccluderRadiosity {
    /// That of black surfaces.
    pub const ZERO: Self =
        Self { along: DMat3::ZERO, against: DMat3::ZERO, by_place: DMat3::ZERO, by_share: DVec3::ZERO };

    /// Follows paths from all over the scene, whose lights are `emitters` and `sky`; `offset` is where rays start, in
    /// metres from the surface.
    #[must_use]
    pub fn of(
        scene: &Scene,
        solids: &Solids,
        bvh: &Bvh,
        emitters: &Emitters,
        sky: Option<Sky<'_>>,
        offset: f64,
    ) -> Self {
        let intensity = sky.map_or(0.0, |sky| f64::from(sky.intensity));
        let mut sky = sky.map_or_else(Vec::new, |sky| Sphere::new(sky).directions(SKY_DIRECTIONS, 0));
        sky.iter_mut().for_each(|at| at.weight = at.weight.map(|weight| weight * intensity));
        let first_triangles = scene.first_triangles();
        let size = bvh.nodes.first().map_or(0.0, |root| {
            let [min, max] = [root.bounds().min, root.bounds().max].map(|corner| Vec3::from(corner).as_dvec3());
            (max - min).length()
        });
        let nearest = NEAREST_LAMP * size;
        let lit = LitScene { scene, solids, bvh, emitters, sky, offset, nearest, first_triangles };
        let areas: Vec<f64> = bvh
            .triangles
            .iter()
            .map(|triangle| {
                let [_, ab, ac] = edges(triangle);
                ab.cross(ac).length()
            })
            .collect();
        // Half of the points by area, half evenly over the triangles: by area alone hardly any would lie on what stands
        // on a large ground.
        let total: f64 = areas.iter().sum();
        let mut sum = 0.0;
        let chosen: Vec<f64> = areas
            .iter()
            .map(|area| {
                sum += 0.5 * area / total + 0.5 / areas.len() as f64;
                sum
            })
            .collect();
        let found: Vec<Vec<Sent>> = (0..POINTS)
            .into_par_iter()
            .filter_map(|i| {
                let at = (i as f64 + 0.5) / POINTS as f64 * sum;
                let which = chosen.partition_point(|&up_to| up_to <= at);
                let by_area = areas.get(which)? / total;
                let of_area = by_area / (0.5 * by_area + 0.5 / areas.len() as f64);
                Some(lit.arriving(&bvh.triangles[which], i, of_area))
            })
            .collect();
        Self::fitted(&found.concat())
    }

    /// Whether no surface sends light to another one.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        *self == Self::ZERO
    }

    /// The radiosity of what occludes the share `occluded` of what a surface at `place` in bvh space has around it;
    /// `along` and `against` are the means of the squared positive and negative components of those directions.
    #[must_use]
    pub fn at(&self, place: DVec3, [along, against]: [DVec3; 2], occluded: f64) -> DVec3 {
        let by_direction = self.along * along + self.against * against;
        (self.by_place * place + by_direction + self.by_share * occluded).max(DVec3::ZERO)
    }

    /// The function of all rays, in which those far off count less. By area it has no less light than they: a patch of
    /// sun in a room is far off, and all the light that there is.
    fn fitted(sent: &[Sent]) -> Self {
        let far_off = FAR_OFF * sent.iter().map(|ray| ray.radiosity.length()).sum::<f64>() / sent.len() as f64;
        if sent.is_empty() || far_off == 0.0 {
            return Self::ZERO;
        }
        let mut weights = vec![1.0; sent.len()];
        let mut fit = Self::weighted(sent, &weights);
        for _ in 1..FITS {
            let off = |ray: &Sent| (fit.at(ray.from, squares(ray.direction), ray.occluded) - ray.radiosity).length();
            weights = sent.iter().map(|ray| far_off / off(ray).max(far_off)).collect();
            if weights.iter().all(|&weight| weight == 1.0) {
                return fit;
            }
            fit = Self::weighted(sent, &weights);
        }
        let by_area = |of: &dyn Fn(&Sent) -> DVec3| sent.iter().map(|ray| of(ray) * ray.of_area).sum::<DVec3>();
        let has = by_area(&|ray| fit.at(ray.from, squares(ray.direction), ray.occluded));
        let lacks = by_area(&|ray| ray.radiosity) / has.max(DVec3::splat(f64::MIN_POSITIVE));
        fit.scaled(lacks.clamp(DVec3::ONE, DVec3::splat(MOST_SCALED)))
    }

    fn scaled(&self, by: DVec3) -> Self {
        let by_channel = DMat3::from_diagonal(by);
        let [along, against, by_place] = [self.along, self.against, self.by_place].map(|of| by_channel * of);
        Self { along, against, by_place, by_share: self.by_share * by }
    }

    /// The ridge regression: (FᵀWF + ridge) β = FᵀWB for the features F of all rays and their weights W. The mean has
    /// no ridge. Places count in units of the largest one.
    fn weighted(sent: &[Sent], weights: &[f64]) -> Self {
        let unit = sent.iter().map(|ray| ray.from.length()).fold(f64::MIN_POSITIVE, f64::max);
        let mut rows = [[0.0; TERMS + 3]; TERMS];
        for (ray, &weight) in sent.iter().zip(weights) {
            let ([along, against], p, b) = (squares(ray.direction), ray.from / unit, ray.radiosity.to_array());
            let features =
                [1.0, along.x, along.y, along.z, against.x, against.y, against.z, p.x, p.y, p.z, ray.occluded - 0.5];
            for (row, feature) in rows.iter_mut().zip(features) {
                let products = features.into_iter().chain(b);
                row.iter_mut().zip(products).for_each(|(sum, product)| *sum += weight * feature * product);
            }
        }
        for (i, row) in rows.iter_mut().enumerate().skip(1) {
            row[i] += RIDGE[0] * sent.len() as f64 + RIDGE[1];
        }
        // Elimination (Gauss and Jordan) without pivots: the matrix is symmetric and positive definite.
        for i in 0..TERMS {
            let pivot = rows[i].map(|x| x / rows[i][i]);
            rows[i] = pivot;
            for (_, row) in rows.iter_mut().enumerate().filter(|(k, _)| *k != i) {
                let factor = row[i];
                row.iter_mut().zip(pivot).for_each(|(x, of_pivot)| *x -= factor * of_pivot);
            }
        }
        let [mean, ax, ay, az, bx, by, bz, px, py, pz, by_share] = rows.map(|row| DVec3::from_slice(&row[TERMS..]));
        let mean = mean - by_share * 0.5;
        Self {
            by_share,
            along: DMat3::from_cols(mean + ax, mean + ay, mean + az),
            against: DMat3::from_cols(mean + bx, mean + by, mean + bz),
            by_place: DMat3::from_cols(px, py, pz) * unit.recip(),
        }
    }
}

/// The squares of a direction's positive and of its negative components. They sum to 1.
#[must_use]
pub fn squares(direction: DVec3) -> [DVec3; 2] {
    [direction.max(DVec3::ZERO), direction.min(DVec3::ZERO)].map(|part| part * part)
}

/// What arrives along the first ray of a path.
#[derive(Clone)]
struct Sent {
    /// Where the ray starts, in bvh space.
    from: DVec3,
    direction: DVec3,
    /// Of what the ray meets, in W/m².
    radiosity: DVec3,
    /// The share of all rays from there that meet something.
    occluded: f64,
    /// The density of points by area alone over that of the points here.
    of_area: f64,
}

/// A point that a ray meets.
struct Met {
    at: DVec3,
    /// Unit geometric normal on the ray's side.
    normal: DVec3,
    material: Material,
}

/// What paths meet and what lights it.
struct LitScene<'a> {
    scene: &'a Scene,
    solids: &'a Solids,
    bvh: &'a Bvh,
    emitters: &'a Emitters,
    sky: Vec<SkyDirection>,
    offset: f64,
    /// Distance in metres below which a lamp is no brighter.
    nearest: f64,
    first_triangles: Vec<u32>,
}

impl LitScene<'_> {
    /// What arrives at point `number`, which lies on the triangle. Places and directions are those of R sequences
    /// (Roberts 2018).
    fn arriving(&self, triangle: &Triangle, number: usize, of_area: f64) -> Vec<Sent> {
        // The root of x³ = x + 1.
        const STEP: f64 = 1.324_717_957_244_746;
        let sequence = |i: usize| [1, 2].map(|power| (0.5 + (i as f64 + 1.0) * STEP.powi(-power)).fract());
        let mut random = SplitMix64::new(number as u64);
        let instance = triangle.instance as usize;
        let [a, ab, ac] = edges(triangle);
        let mesh = &self.scene.meshes[self.scene.instances[instance].mesh];
        let two_sided = self.scene.materials[mesh.material].double_sided && !self.solids.solid[instance];
        let outwards = line::winds_outwards(self.scene, self.solids, instance);
        let front = outwards != (two_sided && random.unit() < 0.5);
        let n = ab.cross(ac).normalize_or_zero() * if front { 1.0 } else { -1.0 };
        let [u, v] = sequence(number);
        let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
        let from = a + ab * u + ac * v;
        let turn = [random.unit(), random.unit()];
        let mut sent: Vec<Sent> = (0..PATHS)
            .filter_map(|i| {
                let numbers = sequence(i);
                let direction = by_cosine(n, (numbers[0] + turn[0]).fract(), (numbers[1] + turn[1]).fract());
                let met = self.meet(from, direction, &mut random)?;
                Some(Sent { from, direction, radiosity: self.radiosity(met, &mut random), occluded: 0.0, of_area })
            })
            .collect();
        let occluded = sent.len() as f64 / PATHS as f64;
        sent.iter_mut().for_each(|sent| sent.occluded = occluded);
        sent
    }

    /// The first surface along a ray that does not let it through, as far as it lets through at random.
    fn meet(&self, mut origin: DVec3, direction: DVec3, random: &mut SplitMix64) -> Option<Met> {
        for _ in 0..MOST_PASSED {
            let hit = line::nearest(self.bvh, origin, direction, self.offset)?;
            origin += direction * hit.t;
            let material = hit.point().material(self.scene);
            if random.unit() < stops(&material) {
                let [_, ab, ac] = edges(hit.triangle);
                let n = ab.cross(ac).normalize_or_zero();
                return Some(Met { at: origin, normal: if n.dot(direction) > 0.0 { -n } else { n }, material });
            }
        }
        None
    }

    /// The radiosity of a point on the side of its normal, by a path of diffuse reflections and transmissions.
    fn radiosity(&self, first: Met, random: &mut SplitMix64) -> DVec3 {
        let (mut met, mut weight, mut sum) = (first, DVec3::ONE, DVec3::ZERO);
        for surfaces in 1.. {
            let m = &met.material;
            if m.unlit {
                return sum + weight * rgb(m.base_color) * PI;
            }
            let [reflected, transmitted] = albedos(m);
            let mut n = met.normal;
            // Which of both, by their shares.
            let through = transmitted.element_sum() / (reflected + transmitted).element_sum().max(f64::MIN_POSITIVE);
            weight *= if random.unit() < through {
                n = -n;
                transmitted / through
            } else {
                reflected / (1.0 - through)
            };
            let samples = if surfaces == 1 { FIRST_SAMPLES } else { 1 };
            for _ in 0..samples {
                let arriving = self.light_of_sky(met.at, n, random) + self.light_of_lamps(met.at, n, random);
                sum += weight * arriving / f64::from(samples);
            }
            let goes_on = if surfaces < SURE_SURFACES { 1.0 } else { weight.max_element().min(0.95) };
            if random.unit() >= goes_on {
                break;
            }
            weight /= goes_on;
            let direction = by_cosine(n, random.unit(), random.unit());
            match self.meet(met.at, direction, random) {
                Some(next) => met = next,
                None => break,
            }
        }
        sum
    }

    /// The share of light that passes from `origin` along a unit direction.
    fn visibility(&self, origin: DVec3, direction: DVec3, distance: f64) -> f64 {
        let mut passing = 1.0;
        line::traverse(self.bvh, origin, direction, self.offset, |hit| {
            if hit.t < distance {
                let instance = &self.scene.instances[hit.triangle.instance as usize];
                let m = &self.scene.materials[self.scene.meshes[instance.mesh].material];
                let opaque = m.alpha_mode == AlphaMode::Opaque && m.transmission == 0.0;
                passing *= if opaque { 0.0 } else { 1.0 - stops(&hit.point().material(self.scene)) };
            }
            if passing > 0.0 { distance } else { 0.0 }
        });
        passing
    }

    /// Irradiance from the environment, by one of its directions.
    fn light_of_sky(&self, at: DVec3, n: DVec3, random: &mut SplitMix64) -> DVec3 {
        let Some(sky) = self.sky.get((random.unit() * self.sky.len() as f64) as usize) else { return DVec3::ZERO };
        match sky.direction.dot(n) {
            cos if cos > 0.0 => DVec3::from(sky.weight) * (cos * self.visibility(at, sky.direction, f64::INFINITY)),
            _ => DVec3::ZERO,
        }
    }

    /// Irradiance from lamps, by one of them.
    fn light_of_lamps(&self, at: DVec3, n: DVec3, random: &mut SplitMix64) -> DVec3 {
        let word = (random.bits() >> 32) as u32;
        let list = &self.emitters.list;
        let Some(emitter) = list.partition_point(|emitter| emitter.first <= word).checked_sub(1).map(|i| list[i])
        else {
            return DVec3::ZERO;
        };
        let (to_light, arriving) = match emitter.source {
            EmitterSource::Environment => return DVec3::ZERO,
            EmitterSource::Punctual(i) => {
                self.light_of_lamp(&self.scene.lights[i as usize], at + self.bvh.anchor, random)
            }
            EmitterSource::Triangle { index, area, two_sided } => {
                let SceneTriangle { instance, primitive, corners, front } =
                    SceneTriangle::of(self.scene, &self.first_triangles, index);
                let [a, b, c] = corners.map(|corner| corner - self.bvh.anchor);
                let (ab, ac, root) = (b - a, c - a, random.unit().sqrt());
                let v = root * random.unit();
                let uv = [root - v, v];
                let to_light = a + ab * uv[0] + ac * uv[1] - at;
                let cos = -front.dot(to_light.normalize_or_zero());
                let cos = if two_sided { cos.abs() } else { cos.max(0.0) };
                let radiance = SurfacePoint { instance, primitive, uv }.material(self.scene).emissive;
                // No triangle is seen at more than a hemisphere: beside a near one the estimate is bounded.
                let solid_angle = (cos * area * point_falloff(to_light.length_squared(), 0.0)).min(TAU);
                (to_light, rgb(radiance) * solid_angle)
            }
        };
        let l = to_light.normalize_or_zero();
        let cos = l.dot(n);
        if cos <= 0.0 || arriving == DVec3::ZERO {
            return DVec3::ZERO;
        }
        // A directional light has no place, only a direction; a ball of light begins before its middle.
        let distance = match emitter.source {
            EmitterSource::Punctual(i) => match self.scene.lights[i as usize] {
                Light { kind: LightKind::Directional { .. }, .. } => f64::INFINITY,
                Light { extent: Some(Extent::Sphere { radius }), .. } => to_light.length() - radius,
                _ => to_light.length() - self.offset,
            },
            _ => to_light.length() - self.offset,
        };
        arriving * (cos / emitter.probability * self.visibility(at, l, distance))
    }

    /// The way to a point of a light, and the irradiance from there of a surface that faces it.
    fn light_of_lamp(&self, light: &Light, at: DVec3, random: &mut SplitMix64) -> (DVec3, DVec3) {
        let color = rgb(light.color);
        let falloff = |to_light: DVec3, range: Option<f64>| {
            let r2 = to_light.length_squared().max(self.nearest * self.nearest);
            point_falloff(r2, range.map_or(0.0, |range| (range * range).recip()))
        };
        match light.kind {
            LightKind::Directional { direction } => (-direction, color),
            // A sphere has the irradiance of its middle, as far as nothing hides a part of it.
            LightKind::Point { position, range } => {
                let to_light = position - at;
                (to_light, color * falloff(to_light, range))
            }
            LightKind::Spot { position, direction, range, inner, outer } => {
                let (x, y) = (random.between(-1.0, 1.0), random.between(-1.0, 1.0));
                let aside = match light.extent {
                    Some(Extent::Rectangle { across, half_height }) => {
                        across * x + direction.cross(across).normalize_or_zero() * (half_height * y)
                    }
                    Some(Extent::Disk { radius } | Extent::Sphere { radius }) => {
                        let (across, up) = direction.any_orthonormal_pair();
                        let (sin, cos) = (PI * y).sin_cos();
                        (across * cos + up * sin) * (radius * x.abs().sqrt())
                    }
                    None => DVec3::ZERO,
                };
                let to_light = position + aside - at;
                let cos = -direction.dot(to_light.normalize_or_zero());
                let scale = (inner.cos() - outer.cos()).max(1e-7).recip();
                let share = match light.extent {
                    Some(_) => cos.max(0.0),
                    None => spot_share(cos, scale, -outer.cos() * scale),
                };
                (to_light, color * (share * falloff(to_light, range)))
            }
        }
    }
}

/// The first corner, and the edges from there.
fn edges(triangle: &Triangle) -> [DVec3; 3] {
    let [a, b, c] = triangle.corners.map(|corner| Vec3::from(corner).as_dvec3());
    [a, b - a, c - a]
}

/// A direction around `n` with the density cos θ / π, of two numbers in [0, 1): `n` and a uniform point of the sphere
/// around its tip.
fn by_cosine(n: DVec3, z: f64, around: f64) -> DVec3 {
    let z = 2.0 * z - 1.0;
    let (sin, cos) = (TAU * around).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    (n + DVec3::new(radius * cos, radius * sin, z)).normalize_or(n)
}

fn rgb<const N: usize>(of: [f32; N]) -> DVec3 {
    DVec3::from(from_fn::<_, 3, _>(|i| f64::from(of[i])))
}

/// The share of light that a surface does not let straight through.
fn stops(m: &Material) -> f64 {
    let alpha = f64::from(m.base_color[3]);
    let covers = match m.alpha_mode {
        AlphaMode::Opaque => 1.0,
        AlphaMode::Mask(cutoff) => f64::from(u8::from(alpha >= f64::from(cutoff))),
        AlphaMode::Blend => alpha,
    };
    covers * (1.0 - f64::from(m.transmission * (1.0 - m.metallic)))
}

/// The shares of light that a material gives back and transmits diffusely: metals give back their base colour. The few
/// percent of a dielectric's own mirror are left out.
fn albedos(m: &Material) -> [DVec3; 2] {
    let [share, color @ ..] = m.lobes[DIFFUSE_TRANSMISSION].factors;
    let through = f64::from(share * (1.0 - m.metallic));
    [rgb(m.base_color) * (1.0 - through), rgb(color) * through]
}
