//! What one picture costs and buys beside another that has one knob on another rung.

use anyhow::Result;

use super::difference::{Truth, display_mse, more_error, told_apart};
use super::sitting::Taken;
use super::table::{Family, INVISIBLE, Interval, Price};
use etalon::image::metric::{AnyPicture, Metric, compare};
use etalon::image::png::Display;
use etalon::plan::Knob;

/// The reference against which an error is computed.
pub(super) enum Against<'a> {
    /// A picture that is taken for the truth.
    Picture(&'a Display),
    /// A reference with noise of its own.
    Reference(&'a Truth),
}

/// The price of going from one rung to another, `taken` having been drawn in turns with its base. Pictures by paths are compared with
/// each other, others by their errors against `truth`. It is of no point yet, and `flip_delta` is FLIP between both.
///
/// # Errors
/// When the pictures cannot be compared.
pub(super) fn price(
    knob: &Knob,
    [from, to]: [&str; 2],
    taken: &Taken,
    base: &Taken,
    truth: Against<'_>,
) -> Result<Price> {
    let differences: Vec<f64> = taken.ms.iter().zip(&taken.others_ms).map(|(a, b)| a - b).collect();
    let gpu_ms_delta = Interval::of(&differences);
    let base_ms = Interval::of(&taken.others_ms).median;
    let shown = |taken: &Taken| AnyPicture::Display(taken.display.clone());
    let flip_between = compare(Metric::Flip, &shown(base), &shown(taken))?.value;
    let (family, (shown_delta, squares)) = match (&taken.halves, &base.halves, truth) {
        (Some(a), Some(b), _) => (Family::Exact, told_apart(a, b, taken.film.width as usize)),
        (_, _, Against::Picture(truth)) => {
            let more = display_mse(truth, &taken.display) - display_mse(truth, &base.display);
            (Family::Local, (Interval::around(more, 0.0), 1))
        }
        (_, _, Against::Reference(truth)) => {
            (Family::Local, (more_error(&taken.display, &base.display, &truth.shown), 1))
        }
    };
    let mut price = Price {
        knob: knob.name.to_owned(),
        from: from.to_owned(),
        to: to.to_owned(),
        base: family,
        point: String::new(),
        gpu_ms_delta,
        turns: differences.len(),
        share: if base_ms > 0.0 { gpu_ms_delta.median / base_ms } else { 0.0 },
        flip_between,
        flip_delta: flip_between,
        shown_delta,
        error_told: shown_delta.surely() > 0.0 || shown_delta.surely_below() < 0.0,
        squares,
        noise_ratio: match (by_chance(knob, from, to), taken.noise, base.noise) {
            (true, Some(noise), Some(before)) if before > 0.0 => Some(noise / before),
            _ => None,
        },
        same: bytemuck::cast_slice::<_, u8>(&taken.film.rgba) == bytemuck::cast_slice::<_, u8>(&base.film.rgba),
        called_for: true,
        verdict: String::new(),
    };
    price.verdict = verdict(&price);
    Ok(price)
}

/// Whether a change is one of chance alone: the light is the same in the mean.
fn by_chance(knob: &Knob, from: &str, to: &str) -> bool {
    match knob.name {
        "guiding" => true,
        "lights" => from != "points" && to != "points",
        _ => false,
    }
}

/// What a price says, in a sentence; nothing of errors that a reference cannot tell.
fn verdict(price: &Price) -> String {
    let median = price.gpu_ms_delta.median;
    let (longer, shorter) = (price.takes_longer(), price.saves());
    let time = if longer {
        format!("takes {median:.1} ms longer ({:+.0} %)", 100.0 * price.share)
    } else if shorter {
        format!("saves {:.1} ms ({:+.0} %)", -median, 100.0 * price.share)
    } else {
        "takes the same time as far as can be told".to_owned()
    };
    let flip = price.flip_between;
    let error = price.shown_delta;
    let seen = if price.same {
        "the picture is the same to the last bit".to_owned()
    } else if let Some(ratio) = price.noise_ratio {
        format!("the same light, {:.2} times the noise", ratio.sqrt())
    } else if flip < INVISIBLE {
        format!("nobody sees it (FLIP {flip:.4} between both)")
    } else if price.base != Family::Exact && !price.error_told {
        format!("which is nearer to the truth cannot be told from the reference's noise (FLIP {flip:.3} between both)")
    } else if price.base != Family::Exact && error.median < 0.0 {
        format!("less error by {:.2} % of what is shown (FLIP {flip:.3} between both)", 100.0 * (-error.median).sqrt())
    } else if price.is_seen() {
        // From the reference's rungs a cheaper one is wrong; a dearer one says what they leave out.
        let more = match (price.base, price.to_more_exact()) {
            (Family::Exact, false) => "an error of",
            (Family::Exact, true) => "another picture by",
            _ => "more error by",
        };
        let squares =
            if price.squares > 1 { format!(" in squares of {} pixels", price.squares) } else { String::new() };
        format!("{more} {:.2} % of what is shown{squares} (FLIP {flip:.3} between both)", 100.0 * error.median.sqrt())
    } else {
        format!("no error beyond noise (FLIP {flip:.3} between both)")
    };
    let nearer = price.base != Family::Exact && price.error_told && error.median < 0.0;
    let better = price.noise_ratio.is_some_and(|ratio| ratio < 1.0) || nearer;
    if longer && !better && !price.is_seen() {
        return format!("{time}; {seen}: wasted here");
    }
    format!("{time}; {seen}")
}
