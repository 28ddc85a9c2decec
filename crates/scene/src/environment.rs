//! Environment light: an equirectangular environment map of radiance (README, "Conventions").
//!
//! Read pbrt 12.5; Ramamoorthi and Hanrahan, "An Efficient Representation for Irradiance Environment Maps", 2001.
//! Lookup for a world direction d: u = atan2(d.z, d.x) / 2π + 0.5, v = 0.5 − asin(d.y) / π; u to the right, v down
//! from the top row, bilinear, periodic in u.

use std::f64::consts::{PI, TAU};
use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result, anyhow, ensure};
use glam::DVec3;
use image::ImageDecoder;
use rayon::prelude::*;

use etalon_image::{MAX_PIXELS, exr, file};

/// Equirectangular map of linear Rec. 709 radiance.
#[derive(Debug, Clone)]
pub struct Environment {
    /// Path, or name of the generator.
    pub name: String,
    /// Pixels across (360° of longitude).
    pub width: u32,
    /// Pixels down (north pole to south pole).
    pub height: u32,
    /// `width * height` radiances, rows from the top, finite and never negative.
    pub radiance: Vec<[f32; 3]>,
}

impl Environment {
    /// Reads a Radiance `.hdr` or an OpenEXR map; the content decides, not the extension.
    ///
    /// Also returns warnings, one sentence each: texels that were NaN, infinite or negative and became 0, an aspect
    /// ratio other than two to one, an exposure in the file that was divided out. Alpha of an EXR is dropped.
    pub fn load(path: &Path) -> Result<(Self, Vec<String>)> {
        let bytes = file::read(path)?;
        let name = path.display().to_string();
        Self::decode(&name, &bytes).with_context(|| format!("reading the environment {name}"))
    }

    /// Decodes a map from bytes in memory; `name` is for messages.
    pub fn decode(name: &str, bytes: &[u8]) -> Result<(Self, Vec<String>)> {
        let mut warnings = Vec::new();
        let (width, height, mut radiance) = if bytes.starts_with(b"#?") {
            decode_hdr(name, bytes, &mut warnings)?
        } else if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            let picture = exr::decode_exr(bytes)?;
            let radiance = picture.rgba.iter().map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
            (picture.width, picture.height, radiance)
        } else {
            return Err(anyhow!("the contents are neither Radiance HDR nor OpenEXR"));
        };
        let mut cleaned = 0u64;
        for texel in &mut radiance {
            let usable = texel.map(|sample| if sample.is_finite() && sample > 0.0 { sample } else { 0.0 });
            // Float comparison: NaN differs from everything and counts, −0 equals 0 and does not.
            cleaned += u64::from(*texel != usable);
            *texel = usable;
        }
        if cleaned > 0 {
            warnings.push(format!(
                "{name}: {cleaned} of {} texels were not finite or negative; those channels are 0",
                radiance.len()
            ));
        }
        if u64::from(width) != 2 * u64::from(height) {
            warnings.push(format!(
                "{name}: {width}x{height} is not two to one; it is stretched over the whole sphere all the same"
            ));
        }
        Ok((Self { name: name.to_owned(), width, height, radiance }, warnings))
    }

    /// A map of constant radiance; negative and non-finite channels are 0.
    pub fn constant(rgb: [f32; 3]) -> Self {
        let rgb = rgb.map(|sample| if sample.is_finite() { sample.max(0.0) } else { 0.0 });
        Self { name: "constant".into(), width: 4, height: 2, radiance: vec![rgb; 8] }
    }

    /// Whether the radiance is the same in all directions.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.radiance.iter().all(|texel| Some(texel) == self.radiance.first())
    }

    /// Whether all radiance is grey.
    #[must_use]
    pub fn is_grey(&self) -> bool {
        self.radiance.iter().all(|[r, g, b]| r == g && g == b)
    }

    /// A black map of the studio's size, so that it costs as much as the studio.
    #[must_use]
    pub fn dark() -> Self {
        let (width, height) = (512_u32, 256_u32);
        Self { name: "dark".into(), width, height, radiance: vec![[0.0; 3]; (width * height) as usize] }
    }

    /// Built-in environment for a scene without lights: a neutral photographic studio, 512x256.
    ///
    /// A bluish-white sky over a darker grey floor, and three soft boxes: the key light from the upper left in front
    /// (seen from a camera on +Z), a weaker fill light from the right, a rim light behind. Every edge is a C2 ramp
    /// several texels wide, so the map has no aliasing. Mean radiance is 0.83, the largest near 12.
    pub fn studio() -> Self {
        let (width, height) = (512u32, 256u32);
        let boxes = [
            // Direction, half width and half height as tangents of angles, radiance.
            SoftBox::new(DVec3::new(-0.62, 0.58, 0.68), [0.31, 0.40], [12.4, 12.0, 11.5]),
            SoftBox::new(DVec3::new(0.90, 0.22, 0.42), [0.30, 0.46], [2.7, 2.8, 3.0]),
            SoftBox::new(DVec3::new(0.38, 0.52, -0.86), [0.52, 0.17], [6.6, 6.7, 7.0]),
        ];
        let radiance = (0..height)
            .into_par_iter()
            .flat_map_iter(|row| {
                let boxes = &boxes;
                (0..width).map(move |column| {
                    let d = direction((f64::from(column) + 0.5) / 512.0, (f64::from(row) + 0.5) / 256.0);
                    studio_radiance(d, boxes).map(|sample| sample as f32)
                })
            })
            .collect();
        Self { name: "studio".into(), width, height, radiance }
    }

    /// Bilinear lookup of the radiance from a unit direction in world space: the f64 twin of the shader's lookup.
    ///
    /// Texel centres are at half-integers, u is periodic, v is clamped to the rows at the poles. A d.y outside −1 … 1
    /// by rounding is clamped. The code follows the convention literally, at the cost of speed.
    pub fn sample(&self, direction: DVec3) -> [f64; 3] {
        let u = direction.z.atan2(direction.x) / TAU + 0.5;
        let v = 0.5 - direction.y.clamp(-1.0, 1.0).asin() / PI;
        let (x, y) = (u * f64::from(self.width) - 0.5, v * f64::from(self.height) - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = (x - left, y - top);
        let texel = |column: f64, row: f64| {
            let column = (column as i64).rem_euclid(i64::from(self.width)) as usize;
            let row = (row as i64).clamp(0, i64::from(self.height) - 1) as usize;
            self.radiance[row * self.width as usize + column].map(f64::from)
        };
        let corners = [texel(left, top), texel(left + 1.0, top), texel(left, top + 1.0), texel(left + 1.0, top + 1.0)];
        [0, 1, 2].map(|c| {
            let upper = corners[0][c] * (1.0 - fx) + corners[1][c] * fx;
            let lower = corners[2][c] * (1.0 - fx) + corners[3][c] * fx;
            upper * (1.0 - fy) + lower * fy
        })
    }

    /// Mean radiance over all directions; texels are weighted by their exact solid angles.
    pub fn mean(&self) -> [f64; 3] {
        let dc = self.irradiance_sh9()[0];
        // The first harmonic is 1 / sqrt(4π); its integral over the sphere is sqrt(4π).
        dc.map(|coefficient| coefficient / (4.0 * PI).sqrt())
    }

    /// Projection of the radiance onto the nine real spherical harmonics up to degree 2, for [`irradiance`].
    ///
    /// Order and axes: 1; y, z, x; xy, yz, 3z²−1, xz, x²−y², all of the world direction, with the constants of
    /// Ramamoorthi & Hanrahan 2001, equation 3. A texel counts as constant over its cell, and the integrals of the
    /// harmonics over the cell are in closed form, so a constant map is projected without any error but rounding. Rows
    /// are added in order: the result does not depend on the number of threads.
    pub fn irradiance_sh9(&self) -> [[f64; 3]; 9] {
        let (width, height) = (self.width as usize, self.height as usize);
        // Integrals over a column of 1, cos, sin, cos 2, sin 2 of the longitude.
        let columns: Vec<[f64; 5]> = (0..width)
            .map(|column| {
                let at = |edge: usize| (edge as f64 / width as f64 - 0.5) * TAU;
                let (a, b) = (at(column), at(column + 1));
                [
                    b - a,
                    b.sin() - a.sin(),
                    a.cos() - b.cos(),
                    ((2.0 * b).sin() - (2.0 * a).sin()) / 2.0,
                    ((2.0 * a).cos() - (2.0 * b).cos()) / 2.0,
                ]
            })
            .collect();
        let rows: Vec<[[f64; 3]; 9]> = (0..height)
            .into_par_iter()
            .map(|row| {
                // Moments of the row's radiance against the five functions of longitude.
                let mut moments = [[0.0f64; 3]; 5];
                let texels = &self.radiance[row * width..(row + 1) * width];
                for (texel, weights) in texels.iter().zip(&columns) {
                    for (moment, weight) in moments.iter_mut().zip(weights) {
                        for (sum, sample) in moment.iter_mut().zip(texel) {
                            *sum += weight * f64::from(*sample);
                        }
                    }
                }
                row_harmonics(row, height, &moments)
            })
            .collect();
        let mut total = [[0.0; 3]; 9];
        for row in &rows {
            for (sum, part) in total.iter_mut().flatten().zip(row.iter().flatten()) {
                *sum += part;
            }
        }
        total
    }
}

/// Constants of the real spherical harmonics of degree 0, 1 and 2 (Ramamoorthi & Hanrahan 2001, equation 3):
/// sqrt(1/4π), sqrt(3/4π), sqrt(15/4π), sqrt(5/16π), sqrt(15/16π).
const K: [f64; 5] =
    [0.28209479177387814, 0.4886025119029199, 1.0925484305920792, 0.31539156525252005, 0.5462742152960396];

/// Contribution of one row of texels to the nine coefficients, from its moments over longitude.
fn row_harmonics(row: usize, height: usize, moments: &[[f64; 3]; 5]) -> [[f64; 3]; 9] {
    let latitude = |edge: usize| (0.5 - edge as f64 / height as f64) * PI;
    let (s1, c1) = latitude(row).sin_cos();
    let (s0, c0) = latitude(row + 1).sin_cos();
    let height_of_row = latitude(row) - latitude(row + 1);
    // Integrals over s = sin(latitude), the world's y, of 1, s, s², c, cs and c² with c = cos(latitude).
    let one = s1 - s0;
    let s = (s1 * s1 - s0 * s0) / 2.0;
    let ss = (s1 * s1 * s1 - s0 * s0 * s0) / 3.0;
    let c = ((s1 * c1 - s0 * c0) + height_of_row) / 2.0;
    let cs = (c0 * c0 * c0 - c1 * c1 * c1) / 3.0;
    let cc = one - ss;
    let mut sum = [[0.0; 3]; 9];
    for channel in 0..3 {
        let [m0, cos, sin, cos2, sin2] = moments.map(|moment| moment[channel]);
        // x = c cos, y = s, z = c sin of the longitude.
        let parts = [
            K[0] * one * m0,
            K[1] * s * m0,
            K[1] * c * sin,
            K[1] * c * cos,
            K[2] * cs * cos,
            K[2] * cs * sin,
            K[3] * (1.5 * cc * (m0 - cos2) - one * m0),
            K[2] * cc * sin2 / 2.0,
            K[4] * (cc * (m0 + cos2) / 2.0 - ss * m0),
        ];
        for (total, part) in sum.iter_mut().zip(parts) {
            total[channel] = part;
        }
    }
    sum
}

/// Irradiance in W/m² on a surface with unit normal `n`, from the radiance coefficients `sh9` in W/(m² sr).
///
/// E(n) = Σ A_l L_lm Y_lm(n) with the cosine lobe's A = π, 2π/3, π/4 (Ramamoorthi & Hanrahan 2001, equations 7 and
/// 8). Degrees above 2 are omitted; the cosine lobe damps them to a few per cent. The result may be slightly negative
/// opposite a small strong light. A diffuse surface reflects the radiance albedo / π times E.
pub fn irradiance(sh9: &[[f64; 3]; 9], n: DVec3) -> [f64; 3] {
    let harmonics = sh9_basis(n);
    let lobe = [PI, TAU / 3.0, TAU / 3.0, TAU / 3.0, PI / 4.0, PI / 4.0, PI / 4.0, PI / 4.0, PI / 4.0];
    [0, 1, 2].map(|channel| (0..9).map(|index| lobe[index] * sh9[index][channel] * harmonics[index]).sum())
}

/// The nine real spherical harmonics of a unit direction, in the order of [`Environment::irradiance_sh9`].
pub fn sh9_basis(d: DVec3) -> [f64; 9] {
    let DVec3 { x, y, z } = d;
    [
        K[0],
        K[1] * y,
        K[1] * z,
        K[1] * x,
        K[2] * x * y,
        K[2] * y * z,
        K[3] * (3.0 * z * z - 1.0),
        K[2] * x * z,
        K[4] * (x * x - y * y),
    ]
}

/// World direction of the map coordinates u and v, both in 0 … 1; the inverse of the lookup.
pub fn direction(u: f64, v: f64) -> DVec3 {
    let (sin_longitude, cos_longitude) = ((u - 0.5) * TAU).sin_cos();
    let (s, c) = ((0.5 - v) * PI).sin_cos();
    DVec3::new(c * cos_longitude, s, c * sin_longitude)
}

fn decode_hdr(name: &str, bytes: &[u8], warnings: &mut Vec<String>) -> Result<(u32, u32, Vec<[f32; 3]>)> {
    let plain = |error: image::ImageError| anyhow!("{error}");
    let decoder = image::codecs::hdr::HdrDecoder::new(Cursor::new(bytes)).map_err(plain)?;
    let metadata = decoder.metadata();
    let (width, height) = (metadata.width, metadata.height);
    let pixels = u64::from(width) * u64::from(height);
    ensure!(pixels > 0, "the picture has no pixels");
    ensure!(pixels <= MAX_PIXELS, "{width}x{height} pixels are too many; {MAX_PIXELS} are the most that are read");
    // Run-length coding expands 2 bytes to 127 at best in the usual form, and a few bytes to more in the oldest form.
    ensure!(
        pixels <= (bytes.len() as u64).saturating_mul(1024),
        "the file is damaged: {} bytes cannot hold {width}x{height} pixels",
        bytes.len()
    );
    let xyz = metadata.custom_attributes.iter().any(|(key, value)| key == "FORMAT" && value.contains("xyze"));
    ensure!(!xyz, "its colours are XYZ (32-bit_rle_xyze), only RGB is supported");
    let mut samples = vec![0u8; usize::try_from(decoder.total_bytes())?];
    let exposure = metadata.exposure.filter(|exposure| exposure.is_finite() && *exposure > 0.0).unwrap_or(1.0);
    decoder.read_image(&mut samples).map_err(plain)?;
    if exposure != 1.0 {
        warnings.push(format!("{name}: the recorded exposure {exposure} was divided out, as the format asks"));
    }
    let radiance = samples
        .chunks_exact(12)
        .map(|texel| {
            [0, 4, 8].map(|at| f32::from_ne_bytes([texel[at], texel[at + 1], texel[at + 2], texel[at + 3]]) / exposure)
        })
        .collect();
    Ok((width, height, radiance))
}

/// A bright rounded rectangle on the studio's wall.
struct SoftBox {
    towards: DVec3,
    right: DVec3,
    up: DVec3,
    half: [f64; 2],
    radiance: [f64; 3],
}

impl SoftBox {
    fn new(towards: DVec3, half: [f64; 2], radiance: [f64; 3]) -> Self {
        let towards = towards.normalize();
        let right = DVec3::Y.cross(towards).normalize();
        Self { towards, right, up: towards.cross(right), half, radiance }
    }

    /// Fraction of the box's radiance in a direction, 0 … 1.
    fn weight(&self, d: DVec3) -> f64 {
        let depth = d.dot(self.towards);
        if depth <= 0.1 {
            return 0.0;
        }
        let x = d.dot(self.right) / depth / self.half[0];
        let y = d.dot(self.up) / depth / self.half[1];
        // Superellipse of the fourth power: a rectangle with wide round corners and no crease.
        let radius = (x.powi(4) + y.powi(4)).sqrt().sqrt();
        let edge = 1.0 - ramp((radius - 0.78) / 0.44);
        // Brighter in the middle, like a lamp behind cloth.
        edge * (1.0 - 0.25 * (radius * radius).min(1.5))
    }
}

/// Smooth step of two continuous derivatives: 0 below 0, 1 above 1, 6t⁵ − 15t⁴ + 10t³ between.
fn ramp(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (t * (6.0 * t - 15.0) + 10.0)
}

fn studio_radiance(d: DVec3, boxes: &[SoftBox; 3]) -> [f64; 3] {
    let above = ramp((d.y + 0.25) / 0.5);
    let zenith = ramp(d.y);
    let floor = 0.10 + 0.06 * ramp(-d.y);
    let sky = [0.34, 0.36, 0.385].map(|horizon| horizon * (1.0 - zenith));
    let top = [0.50, 0.55, 0.62].map(|top| top * zenith);
    let lit = [0, 1, 2].map(|index: usize| boxes[index].weight(d));
    // Boxes cover the wall behind them; their radiance is not added to it.
    let hidden: f64 = lit.iter().map(|weight| 1.0 - weight).product();
    [0, 1, 2].map(|c| {
        let wall = floor * (1.0 - above) + (sky[c] + top[c]) * above;
        wall * hidden + boxes.iter().zip(&lit).map(|(light, weight)| weight * light.radiance[c]).sum::<f64>()
    })
}
