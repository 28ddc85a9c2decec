//! Paired measurement of one approximation (`etalon cost --compare`): two rungs of one knob, timed interleaved, all
//! other knobs equal.

use anyhow::{Context as _, Result, bail, ensure};
use serde::Serialize;

use super::agenda::Change;
use super::difference::ShownReference;
use super::price::{Pair, PairedTimes, TimeNoise, price};
use super::reference::{LEAST_SAMPLES, Refined};
use super::statistics::{Interval, MANY, standard_errors};
use super::table::{Family, Price, WorstPixel};
use super::warm::{Bench, ENOUGH_MS};
use etalon::image::metric::{AnyPicture, Metric, compare, map_rgba};
use etalon::image::png::encode_png;
use etalon::plan::{Knob, Knobs};

/// Number of statements about the pair (for the Bonferroni correction): a time, and an error for three block sizes.
const STATEMENTS: usize = 4;

/// Result of comparing two rungs.
#[derive(Debug, Serialize)]
pub struct Compared {
    /// Name of the knob.
    pub knob: &'static str,
    /// The rungs; the last is the more exact one and the baseline for the error of the first.
    pub rungs: [&'static str; 2],
    /// GPU milliseconds of each rung.
    pub gpu_ms: [Interval; 2],
    /// Cost of the first rung relative to the last.
    pub price: Price,
    /// Pixel with the largest FLIP error.
    pub worst_pixel: WorstPixel,
    /// PNG files of the rungs and of FLIP's error map between them.
    #[serde(skip)]
    pub pictures: [Vec<u8>; 3],
}

/// The knob of `wanted` (`KNOB=A,B`) and `knobs` with each of its rungs, the more exact one last.
///
/// # Errors
/// When there are no such rungs, or when one of them contradicts another knob.
pub fn pair(knobs: &Knobs, wanted: &str) -> Result<(&'static Knob, [Knobs; 2])> {
    let parts = wanted.split_once('=').and_then(|(knob, rungs)| Some((knob, rungs.split_once(',')?)));
    let Some((name, (a, b))) = parts else {
        bail!("--compare {wanted}: expected KNOB=A,B, for example fresnel=schlick,exact");
    };
    let of = |rung: &str| -> Result<Knobs> {
        let mut knobs = knobs.clone();
        knobs.set(&format!("{name}={rung}"))?;
        knobs.check()?;
        Ok(knobs)
    };
    let [first, last] = [of(a), of(b)].map(|knobs| knobs.with_context(|| format!("--compare {wanted}")));
    let (first, last) = (first?, last?);
    let knob = Knob::named(name).context("a knob of the table")?;
    ensure!(first != last, "--compare {wanted}: both are the same rung");
    Ok((knob, if knob.place(&first) < knob.place(&last) { [first, last] } else { [last, first] }))
}

/// Draws and times both rungs of `wanted` (`KNOB=A,B`); `knobs` sets all other knobs.
///
/// # Errors
/// The errors of [`pair`], and when one of the rungs cannot be drawn.
pub fn compare_rungs(bench: &Bench<'_>, knobs: &Knobs, wanted: &str) -> Result<Compared> {
    let (knob, [first, last]) = pair(knobs, wanted)?;
    let mut exact = bench.warm_up(&last)?;
    let truth = bench.measure(&mut exact, None, ENOUGH_MS)?;
    let mut warm = bench.warm_up(&first)?;
    let measured = bench.measure(&mut warm, Some((&mut exact, &truth)), ENOUGH_MS)?;
    let shown = |display: &etalon::image::png::Display| AnyPicture::Display(display.clone());
    let flip = compare(Metric::Flip, &shown(&truth.display), &shown(&measured.display))?;
    let has_alpha = bench.settings.view_transform().background.is_none();
    let png = |display: &etalon::image::png::Display| {
        encode_png(display.width, display.height, display.rgba.as_flattened(), has_alpha)
    };
    let pictures =
        [png(&measured.display)?, png(&truth.display)?, encode_png(flip.width, flip.height, &map_rgba(&flip), false)?];
    let gpu_ms = [Interval::of(&measured.ms), Interval::of(&measured.baseline_ms)];
    let rungs = [knob.rung(&first), knob.rung(&last)];
    let change = Change { knob: knob.name.to_owned(), from: rungs[1].to_owned(), to: rungs[0].to_owned() };
    let pair = Pair::of(&change, &measured, &truth)?;
    let more = match (&measured.halves, &truth.halves) {
        (_, None) => Some(ShownReference::exact(&truth.display).error(&measured.display)),
        // Only the more exact rung traces paths: it is drawn once more, as a reference whose noise is known.
        (None, Some(_)) => {
            let reference = Refined::round(None, bench, &last, truth.samples.max(LEAST_SAMPLES), &mut |_| ())?;
            Some(reference.truth(&bench.settings.view_transform()).shown.error(&measured.display))
        }
        // The halves of a denoised picture are not denoised: both pictures are judged by a third one.
        (Some(_), Some(_)) if knob.name == "denoise" => {
            let reference = Refined::round(None, bench, &last, truth.samples.max(LEAST_SAMPLES), &mut |_| ())?;
            let judge = reference.truth(&bench.settings.view_transform()).shown;
            Some(judge.more_error(&measured.display, &truth.display))
        }
        (Some(_), Some(_)) => None,
    };
    let clock = TimeNoise::of([(&measured.ms[..], &measured.baseline_ms[..])].into_iter());
    let turns = PairedTimes { ms: &measured.ms, baseline_ms: &measured.baseline_ms, clock };
    let family = if more.is_some() { Family::Local } else { Family::Exact };
    let price = price(&change, (&pair, family), more, turns, STATEMENTS, standard_errors(STATEMENTS, MANY))
        .says_where_wasted("here");
    Ok(Compared {
        knob: knob.name,
        rungs,
        gpu_ms,
        price,
        worst_pixel: WorstPixel { x: flip.worst[0], y: flip.worst[1], error: flip.worst_error },
        pictures,
    })
}
