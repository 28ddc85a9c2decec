//! The price of one approximation: two rungs of one knob, drawn in turns, all others alike.

use anyhow::{Context as _, Result, bail, ensure};
use serde::Serialize;

use super::difference::{display_mse, told_apart};
use super::sitting::Bench;
use super::sweep::{by_chance, verdict};
use super::table::{Family, Interval, Price, WorstPixel};
use crate::image::metric::{AnyPicture, Metric, compare};
use crate::plan::{KNOBS, Knobs};

/// Two rungs.
#[derive(Debug, Serialize)]
pub struct Compared {
    /// The knob.
    pub knob: &'static str,
    /// The rungs: of the two the more exact one last, against which the other is in error.
    pub rungs: [&'static str; 2],
    /// GPU time of each.
    pub gpu_ms: [Interval; 2],
    /// What the first costs and buys beside the last.
    pub price: Price,
    /// Where an eye sees most of it.
    pub worst_pixel: WorstPixel,
}

/// Draws both, `knobs` being those of all others.
///
/// # Errors
/// When there are no such two rungs, or one of them contradicts another knob or cannot be drawn.
pub fn compare_rungs(bench: &Bench<'_>, knobs: &Knobs, wanted: &str) -> Result<Compared> {
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
    let knob = KNOBS.iter().find(|knob| knob.name == name).context("a knob of the table")?;
    ensure!(first != last, "--compare {wanted}: both are the same rung");
    let [first, last] = if first.index(knob.name) < last.index(knob.name) { [first, last] } else { [last, first] };
    let mut exact = bench.sit(&last)?;
    let truth = bench.take(&mut exact, None)?;
    let mut sitting = bench.sit(&first)?;
    let taken = bench.take(&mut sitting, Some(&mut exact))?;
    let shown = |display: &crate::image::png::Display| AnyPicture::Display(display.clone());
    let flip = compare(Metric::Flip, &shown(&truth.display), &shown(&taken.display))?;
    let differences: Vec<f64> = taken.ms.iter().zip(&taken.others_ms).map(|(a, b)| a - b).collect();
    let gpu_ms_delta = Interval::of(&differences);
    let gpu_ms = [Interval::of(&taken.ms), Interval::of(&taken.others_ms)];
    let ((shown_delta, squares), base) = match (&taken.halves, &truth.halves) {
        (Some(a), Some(b)) => (told_apart(a, b, taken.film.width as usize), Family::Exact),
        _ => ((Interval::around(display_mse(&truth.display, &taken.display), 0.0), 1), Family::Local),
    };
    let mut price = Price {
        knob: knob.name.to_owned(),
        from: last.rung(knob.name).to_owned(),
        to: first.rung(knob.name).to_owned(),
        base,
        point: String::new(),
        gpu_ms_delta,
        share: gpu_ms_delta.median / gpu_ms[1].median.max(1e-9),
        flip_between: flip.value,
        flip_delta: flip.value,
        turns: differences.len(),
        shown_delta,
        squares,
        noise_ratio: match (by_chance(knob, last.rung(knob.name), first.rung(knob.name)), taken.noise, truth.noise) {
            (true, Some(noise), Some(before)) if before > 0.0 => Some(noise / before),
            _ => None,
        },
        same: bytemuck::cast_slice::<_, u8>(&taken.film.rgba) == bytemuck::cast_slice::<_, u8>(&truth.film.rgba),
        called_for: true,
        verdict: String::new(),
    };
    price.verdict = verdict(&price);
    Ok(Compared {
        knob: knob.name,
        rungs: [first.rung(knob.name), last.rung(knob.name)],
        gpu_ms,
        price,
        worst_pixel: WorstPixel { x: flip.worst[0], y: flip.worst[1], error: flip.worst_error },
    })
}
