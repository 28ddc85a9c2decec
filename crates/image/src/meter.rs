//! Exposure metering: whether a picture can be read at a given exposure, and the exposure that makes it readable.
//!
//! Read Reinhard et al. 2002, section 3.1, for exposure from the picture's own luminance. Theirs is the logarithmic
//! mean, which a black shadow beside a sunlit wall drags towards black, so that the wall is white again; a percentile
//! of the bright end is not moved by shadows, and not by few lamps and highlights.

use serde::Serialize;

use crate::tone::ViewTransform;

/// The luminance that this part of the lit pixels exceeds is set to [`TARGET`].
const BRIGHT: f64 = 0.1;
/// Exposed luminance of the bright pixels: below the shoulder of the curves, which compress from about 0.8.
const TARGET: f64 = 0.5;
/// A pixel is plain white when no display value is less than this. It is what a radiance of 2 gives under the default
/// curve; white paper in the studio has 1, and stays below.
const WHITE: f64 = 250.0 / 255.0;
/// Part of the pixels that may be plain white: highlights and lamps cover less.
const MOST_WHITE: f64 = 0.25;
/// A pixel is nearly black below this luminance, the display value 38 of 255.
const BLACK: f64 = 0.02;
/// Part of the pixels that must be brighter than [`BLACK`].
const LEAST_SEEN: f64 = 0.1;
/// Smallest correction in stops: a smaller one makes no unreadable picture readable.
const LEAST_STOPS: f32 = 0.5;

/// Luminance of the pixels that show the scene, without its background.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Meter {
    /// Number of pixels.
    pub pixels: usize,
    /// Luminance in scene units that a tenth of the lit pixels exceeds; 0 where no pixel is lit.
    pub bright: f64,
    /// Part of the pixels that the view transform shows plain white.
    pub white: f64,
    /// Part of the pixels that are nearly black.
    pub black: f64,
}

/// Why a picture cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unreadable {
    /// Much of it is plain white.
    White,
    /// Nearly all of it is nearly black.
    Black,
}

impl Meter {
    /// Meters pixels of linear RGBA with premultiplied alpha, as `view` shows them. `None` where there are none.
    /// NaN, infinite and negative luminances count as black.
    #[must_use]
    pub fn of(pixels: impl Iterator<Item = [f32; 4]>, view: &ViewTransform) -> Option<Self> {
        let scale = f64::from(view.exposure).exp2();
        let (mut lit, mut count, mut white, mut black) = (Vec::new(), 0_usize, 0_usize, 0_usize);
        for rgba in pixels.filter(|rgba| rgba[3] > 0.0) {
            let [r, g, b, alpha] = rgba.map(f64::from);
            // Rec. 709.
            let luminance = (0.2126 * r + 0.7152 * g + 0.0722 * b) / alpha.min(1.0);
            let luminance = if luminance.is_finite() && luminance > 0.0 { luminance } else { 0.0 };
            count += 1;
            white += usize::from(view.shown(rgba).iter().all(|value| *value >= WHITE));
            black += usize::from(luminance * scale < BLACK);
            if luminance > 0.0 {
                lit.push(luminance);
            }
        }
        lit.sort_by(f64::total_cmp);
        let at = (lit.len() as f64 * (1.0 - BRIGHT)) as usize;
        let part = |n: usize| n as f64 / count as f64;
        let bright = lit.get(at.min(lit.len().saturating_sub(1))).copied().unwrap_or_default();
        (count > 0).then(|| Self { pixels: count, bright, white: part(white), black: part(black) })
    }

    /// Why the picture cannot be read; `None` where it can.
    #[must_use]
    pub fn unreadable(&self) -> Option<Unreadable> {
        if self.white > MOST_WHITE {
            Some(Unreadable::White)
        } else if self.black > 1.0 - LEAST_SEEN {
            Some(Unreadable::Black)
        } else {
            None
        }
    }

    /// The exposure in stops that makes the picture readable, in tenths, so that a sentence can say it and an option
    /// repeat it. `None` where no pixel is lit.
    #[must_use]
    pub fn stops(&self) -> Option<f32> {
        let stops = ((TARGET / self.bright).log2() * 10.0).round() / 10.0;
        // Adding 0 makes no -0.
        stops.is_finite().then_some(stops as f32 + 0.0)
    }

    /// The exposure of a picture that cannot be read at `given` stops; `None` where it can, or where no exposure helps.
    #[must_use]
    pub fn correction(&self, given: f32) -> Option<(f32, Unreadable)> {
        let why = self.unreadable()?;
        let stops = self.stops().filter(|stops| (stops - given).abs() >= LEAST_STOPS)?;
        Some((stops, why))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tone::ToneMap;

    const VIEW: ViewTransform = ViewTransform { curve: ToneMap::KhronosNeutral, exposure: 0.0, background: None };

    fn grey(radiance: f32) -> [f32; 4] {
        [radiance, radiance, radiance, 1.0]
    }

    fn metered(pixels: &[[f32; 4]]) -> Meter {
        Meter::of(pixels.iter().copied(), &VIEW).unwrap()
    }

    #[test]
    fn a_wall_in_the_sun_gets_the_logarithm_of_its_luminance() {
        // A white wall in 68,300 lx has radiance 68,300 / π; log2(0.5 π / 68,300) is −15.408.
        let wall = metered(&[grey(68_300.0 / std::f32::consts::PI); 100]);
        assert_eq!(wall.correction(0.0), Some((-15.4, Unreadable::White)));
        // With three quarters of the picture in the shadow at 1/1000 of it, the wall decides still.
        let mut shadow = vec![grey(21.74); 74];
        shadow.extend([grey(21_740.5); 26]);
        assert_eq!(metered(&shadow).correction(0.0), Some((-15.4, Unreadable::White)));
        // Moonlight: log2(0.5 / 0.001) is 8.966.
        assert_eq!(metered(&[grey(0.001); 10]).correction(0.0), Some((9.0, Unreadable::Black)));
    }

    #[test]
    fn what_can_be_read_keeps_its_exposure() {
        // Grey, white paper in the studio, a dark object with a tenth of it visible, and one with small lamps.
        for pixels in [
            vec![grey(0.18); 100],
            vec![grey(1.0); 100],
            [vec![grey(0.001); 89], vec![grey(0.1); 11]].concat(),
            [vec![grey(0.1); 80], vec![grey(1000.0); 20]].concat(),
        ] {
            assert_eq!(metered(&pixels).correction(0.0), None, "{:?}", metered(&pixels));
        }
        // No exposure shows a scene without light.
        assert_eq!((metered(&[grey(0.0); 9]).stops(), metered(&[grey(0.0); 9]).correction(0.0)), (None, None));
        assert_eq!(metered(&[grey(0.0); 9]).unreadable(), Some(Unreadable::Black));
    }

    #[test]
    fn coverage_and_invalid_pixels_do_not_count() {
        assert_eq!(Meter::of([[9.0, 9.0, 9.0, 0.0]].into_iter(), &VIEW), None);
        // A pixel that is half covered has the radiance of what covers it.
        assert_eq!(metered(&[[0.2, 0.2, 0.2, 0.5]; 4]).stops(), Some(0.3), "log2(0.5 / 0.4) is 0.32");
        let invalid = metered(&[[f32::NAN, 0.0, 0.0, 1.0], [f32::INFINITY, 0.0, 0.0, 1.0], [-1.0, 0.0, 0.0, 1.0]]);
        assert_eq!((invalid.bright, invalid.black), (0.0, 1.0));
    }
}
