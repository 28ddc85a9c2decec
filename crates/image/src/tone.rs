//! Tone mapping: scene-linear radiance to display values by tone curves and the sRGB transfer function, in f64.
//!
//! Read RTR 8.2; IEC 61966-2-1; the source of each curve is beside it. These functions are the reference for the GLSL
//! functions of the same names. A curve maps exposed linear Rec. 709 radiance to linear display light in 0..=1;
//! [`srgb_encode`] and [`quantise`] follow. Before the curve, NaN and negative samples become 0, and values above
//! [`LARGEST`], infinity included, become [`LARGEST`]: no curve returns NaN. The caller counts such samples beforehand.

use serde::{Deserialize, Serialize};
use strum::{EnumMessage, IntoStaticStr, VariantArray};

/// Upper bound of samples before a curve: the largest finite half float (row 43 of docs/numerics.md).
pub const LARGEST: f64 = 65504.0;

/// Tone curves.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, Default, EnumMessage, IntoStaticStr, VariantArray, Serialize, Deserialize,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum ToneMap {
    /// Radiance, clamped to 1.
    Linear,
    /// x / (1 + x) for each channel (Reinhard et al. 2002, equation 3, on channels instead of luminance).
    Reinhard,
    /// Stephen Hill's fit of the ACES RRT and sRGB ODT.
    Aces,
    /// Troy Sobotka's AgX, base look, in Benjamin Wrensch's polynomial form.
    Agx,
    /// Khronos PBR Neutral: preserves base colours under grey light.
    #[default]
    KhronosNeutral,
}

impl ToneMap {
    /// All tone curves.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// Name on the command line and in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Linear display light in 0..=1 for exposed linear Rec. 709 radiance.
    pub fn apply(self, rgb: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Linear => linear(rgb),
            Self::Reinhard => reinhard(rgb),
            Self::Aces => aces(rgb),
            Self::Agx => agx(rgb),
            Self::KhronosNeutral => khronos_neutral(rgb),
        }
    }

    /// Display bytes for exposed linear Rec. 709 radiance: curve, sRGB transfer, rounding.
    pub fn to_display(self, rgb: [f64; 3]) -> [u8; 3] {
        self.apply(rgb).map(|light| quantise(srgb_encode(light)))
    }
}

/// Replaces NaN and negative values by 0, and clamps to [`LARGEST`].
fn usable(sample: f64) -> f64 {
    if sample > 0.0 { sample.min(LARGEST) } else { 0.0 }
}

fn unit(rgb: [f64; 3]) -> [f64; 3] {
    rgb.map(|light| light.clamp(0.0, 1.0))
}

/// Product of a matrix, given by rows, and a column vector.
fn transform(rows: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Clamps to 1.
pub fn linear(rgb: [f64; 3]) -> [f64; 3] {
    unit(rgb.map(usable))
}

/// x / (1 + x), channel by channel; 1 is reached only in the limit.
pub fn reinhard(rgb: [f64; 3]) -> [f64; 3] {
    rgb.map(usable).map(|x| x / (1.0 + x))
}

/// sRGB to the RRT's working space, with its saturation, by rows (Hill, "ACES fitted", BakingLab `ACES.hlsl`).
pub const ACES_IN: [[f64; 3]; 3] =
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];

/// ODT saturation and conversion to sRGB, by rows (same source).
pub const ACES_OUT: [[f64; 3]; 3] =
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];

/// Stephen Hill's fit of the ACES reference rendering and output transforms for sRGB screens.
///
/// No exposure of 1/0.6 is applied before it, unlike in some engines: `--exposure` sets the exposure.
pub fn aces(rgb: [f64; 3]) -> [f64; 3] {
    let fitted = transform(&ACES_IN, rgb.map(usable)).map(|v| {
        let above = v * (v + 0.0245786) - 0.000090537;
        let below = v * (0.983729 * v + 0.4329510) + 0.238081;
        above / below
    });
    unit(transform(&ACES_OUT, fitted))
}

/// Inset matrix of AgX, by rows (Wrensch, "Minimal AgX Implementation", iolite-engine.com; GLSL has it by columns).
pub const AGX_IN: [[f64; 3]; 3] = [
    [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
    [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
    [0.0423756549057051, 0.0784336, 0.879142973793104],
];

/// Outset matrix of AgX, by rows (same source).
pub const AGX_OUT: [[f64; 3]; 3] = [
    [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
    [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
    [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
];

/// Smallest and largest log2 radiance of AgX: 10 stops below and 6.5 above middle grey 0.18.
pub const AGX_EV: [f64; 2] = [-12.47393, 4.026069];

/// AgX base look: inset, log2 encoding, the sixth-degree polynomial of its contrast curve, outset, exponent 2.2.
///
/// The exponent inverts the display encoding at the end of AgX, because the sRGB transfer function follows every curve
/// here.
pub fn agx(rgb: [f64; 3]) -> [f64; 3] {
    let [low, high] = AGX_EV;
    let curve = transform(&AGX_IN, rgb.map(usable)).map(|v| {
        // log2 of 0 is −∞ and is clamped to the lower end.
        let x = (v.log2().clamp(low, high) - low) / (high - low);
        let (x2, x4) = (x * x, x * x * x * x);
        15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232
    });
    unit(transform(&AGX_OUT, curve).map(|v| v.max(0.0).powf(2.2)))
}

/// Khronos PBR Neutral tone mapper (Khronos ToneMapping specification, `pbrNeutral.glsl`): F90 0.04, compression from
/// 0.8 - 0.04, desaturation 0.15.
pub fn khronos_neutral(rgb: [f64; 3]) -> [f64; 3] {
    const START: f64 = 0.8 - 0.04;
    const DESATURATION: f64 = 0.15;
    let rgb = rgb.map(usable);
    let low = rgb[0].min(rgb[1]).min(rgb[2]);
    let offset = if low < 0.08 { low - 6.25 * low * low } else { 0.04 };
    let rgb = rgb.map(|x| x - offset);
    let peak = rgb[0].max(rgb[1]).max(rgb[2]);
    if peak < START {
        return unit(rgb);
    }
    let d = 1.0 - START;
    let new_peak = 1.0 - d * d / (peak + d - START);
    let g = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    unit(rgb.map(|x| x * (new_peak / peak)).map(|x| x * (1.0 - g) + new_peak * g))
}

/// Desaturates a colour towards the grey of equal luminance until no component is negative, for colours outside
/// Rec. 709.
#[must_use]
pub fn desaturated(rgb: [f64; 3]) -> [f64; 3] {
    let luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
    let least = rgb.iter().copied().fold(f64::INFINITY, f64::min);
    match (least < 0.0, luminance > 0.0) {
        (false, _) => rgb,
        (true, false) => [0.0; 3],
        (true, true) => rgb.map(|x| (luminance + (x - luminance) * luminance / (luminance - least)).max(0.0)),
    }
}

/// sRGB transfer function of IEC 61966-2-1: linear light in 0..=1 (clamped, NaN as 0) to a display value in 0..=1.
pub fn srgb_encode(light: f64) -> f64 {
    let light = usable(light).min(1.0);
    if light <= 0.0031308 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// Inverse of [`srgb_encode`]: a display value in 0..=1 (clamped, NaN as 0) to linear light in 0..=1.
pub fn srgb_decode(display: f64) -> f64 {
    let display = usable(display).min(1.0);
    if display <= 0.04045 { display / 12.92 } else { ((display + 0.055) / 1.055).powf(2.4) }
}

/// Quantises a display value in 0..=1 (clamped, NaN as 0) to eight bits, rounding halves up: floor(255 x + 1/2).
pub fn quantise(display: f64) -> u8 {
    (usable(display).min(1.0) * 255.0 + 0.5).floor() as u8
}

/// The mapping of radiance to display values (shaders/pass/tonemap.comp): exposure, tone curve and background.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ViewTransform {
    /// The tone curve.
    pub curve: ToneMap,
    /// Exposure in stops.
    pub exposure: f32,
    /// Display-linear background colour for uncovered pixels; `None` leaves them transparent.
    pub background: Option<[f64; 3]>,
}

impl ViewTransform {
    /// Display values 0 to 1 of linear RGBA, not rounded to bytes. Negative components occur for spectral colours
    /// outside Rec. 709; such colours are desaturated at constant luminance.
    #[must_use]
    pub fn shown(&self, rgba: [f32; 4]) -> [f64; 3] {
        let alpha = f64::from(rgba[3]).clamp(0.0, 1.0);
        let scale = f64::from(self.exposure).exp2() / alpha;
        let over = |c: usize| f64::from(rgba[c]) * scale;
        let linear = if alpha > 0.0 { self.curve.apply(desaturated([over(0), over(1), over(2)])) } else { [0.0; 3] };
        let behind =
            self.background.map_or(linear, |behind| [0, 1, 2].map(|c| behind[c] + alpha * (linear[c] - behind[c])));
        behind.map(|light| srgb_encode(light.clamp(0.0, 1.0)))
    }
}
