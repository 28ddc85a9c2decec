//! What a setting loses: its rungs that are less exact than those of the reference, with the visible difference and the
//! error that more exact ones were measured to take away.

use std::fmt::{self, Display, Formatter};

use super::table::{Family, KnobState, Point, Price, Table};
use etalon::plan::Knob;

/// What a rung loses against more exact ones.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Loss {
    /// Largest visible difference (FLIP); 0 if none was visible.
    pub flip: f64,
    /// Largest error of display values 0 to 1 that a more exact rung takes away; 0 if none is significant.
    pub error: f64,
}

/// The largest differences that were measured between a rung and more exact ones with all other knobs alike; `None` if
/// no such pair was drawn. A rung that was not drawn loses what the next more exact one does that was. Pairs with this
/// base count. If none of them reaches the knob's exact rung, those with the other base do too, but for pairs that
/// differ in the noise of their paths alone.
fn loss(prices: &[Price], knob: &Knob, rung: &str, base: Family) -> Option<Loss> {
    let place = knob.rungs.iter().position(|known| *known == rung)?;
    let of_pair = |price: &Price| {
        let nearer = if price.to_more_exact() && price.base == Family::Local { -1.0 } else { 1.0 };
        let error = (nearer * price.shown_delta.median).max(0.0).sqrt();
        Loss {
            flip: if price.shows() { price.flip_between } else { 0.0 },
            error: if price.error_told { error } else { 0.0 },
        }
    };
    let most = |a: Loss, b: Loss| Loss { flip: a.flip.max(b.flip), error: a.error.max(b.error) };
    let pairs_of = |rung: &&str| {
        let pairs = prices.iter().filter(|price| price.knob == knob.name && price.cheaper_rung() == *rung);
        let (mut counted, others): (Vec<&Price>, Vec<&Price>) = pairs.partition(|price| price.base == base);
        if !counted.iter().any(|price| price.to == knob.exact || price.from == knob.exact) {
            counted.extend(others.into_iter().filter(|price| price.noise_ratio.is_none()));
        }
        counted.into_iter().map(of_pair).reduce(most)
    };
    knob.rungs[place..].iter().find_map(pairs_of)
}

/// A knob of a point whose rung is less exact than in the reference.
#[derive(Debug, Clone, Copy)]
pub struct Simplified<'a> {
    /// The knob.
    pub knob: &'a KnobState,
    /// Its rung in the point.
    pub rung: &'a str,
    /// What the rung loses here, if that was measured.
    pub loss: Option<Loss>,
}

impl Simplified<'_> {
    /// The rung's sentence: what it does, and what it loses.
    #[must_use]
    pub fn about(&self) -> &'static str {
        let sentence = |knob: &'static Knob| {
            let place = knob.rungs.iter().position(|rung| *rung == self.rung)?;
            knob.rung_about.get(place).copied()
        };
        Knob::named(&self.knob.knob).and_then(sentence).unwrap_or_default()
    }
}

impl Display for Simplified<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.knob.knob, self.rung)
    }
}

impl Table {
    /// The simplified knobs of a point: those that the scene calls for and whose rungs are less exact than in the
    /// reference.
    #[must_use]
    pub fn simplified<'a>(&'a self, point: &'a Point) -> Vec<Simplified<'a>> {
        let base = if point.is_path_traced() { Family::Exact } else { Family::Local };
        let other = |state: &'a KnobState| {
            let knob = Knob::named(&state.knob)?;
            let (rung, exact) = (point.knobs.get(&state.knob)?, self.reference.knobs.get(&state.knob)?);
            // The samples of a reference of several pictures are no rung.
            let number = |rung: &String| rung.parse::<u32>().ok();
            let less_exact = match (number(rung), number(exact)) {
                (Some(rung), Some(exact)) => rung < exact,
                _ => {
                    let place = |rung: &String| knob.rungs.iter().position(|known| known == rung);
                    place(rung) < place(exact)
                }
            };
            less_exact.then(|| Simplified { knob: state, rung, loss: loss(&self.prices, knob, rung, base) })
        };
        self.knobs.iter().filter(|knob| knob.called_for).filter_map(other).collect()
    }

    /// [`simplified`](Self::simplified) as a list of `knob=rung`.
    #[must_use]
    pub fn given_up(&self, point: &Point) -> String {
        let all: Vec<String> = self.simplified(point).iter().map(ToString::to_string).collect();
        if all.is_empty() { "nothing".to_owned() } else { all.join(", ") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::Interval;

    #[test]
    fn a_rung_shows_in_pictures_of_its_own_base() {
        let nothing = Interval { median: 0.0, low: 0.0, high: 0.0 };
        let price = |base: Family, [knob, from, to]: [&str; 3], flip_between: f64, error_told: bool| Price {
            knob: knob.to_owned(),
            from: from.to_owned(),
            to: to.to_owned(),
            base,
            point: String::new(),
            gpu_ms_delta: nothing,
            turns: 1,
            share: 0.0,
            flip_between,
            flip_delta: 0.0,
            shown_delta: nothing,
            error_told,
            time_told: false,
            squares: 1,
            noise_ratio: None,
            brightness: None,
            same: false,
            called_for: true,
            verdict: String::new(),
        };
        let noise = Price {
            noise_ratio: Some(1.5),
            ..price(Family::Exact, ["light-sampler", "hierarchy", "power"], 0.05, false)
        };
        let all = [
            price(Family::Local, ["shadows", "map", "off"], 0.02, true),
            Price {
                shown_delta: Interval { median: -0.0004, ..nothing },
                ..price(Family::Local, ["shadows", "map", "ray"], 0.01, true)
            },
            price(Family::Exact, ["shadows", "ray", "map"], 0.5, true),
            price(Family::Exact, ["normals", "f32", "oct16"], 0.03, false),
            price(Family::Local, ["indirect", "ambient", "off"], 0.01, true),
            price(Family::Exact, ["indirect", "path", "occlusion:16"], 0.2, true),
            noise,
        ];
        let loss = |knob: &str, rung: &str, base: Family| loss(&all, Knob::named(knob).expect("a knob"), rung, base);
        let seen = |knob: &str, rung: &str, base: Family| loss(knob, rung, base).map(|loss| loss.flip);
        // A map differs from a ray; that no shadows differ from a map is no fault of the map.
        assert_eq!(loss("shadows", "map", Family::Local), Some(Loss { flip: 0.01, error: 0.02 }));
        assert_eq!(seen("shadows", "off", Family::Local), Some(0.02));
        assert_eq!(seen("shadows", "map", Family::Exact), Some(0.5));
        // Where only the other base has a pair, or one with the exact rung, it counts, if paths alone did not make it.
        assert_eq!(seen("indirect", "occlusion:16", Family::Local), Some(0.2));
        // A rung that was not drawn loses what a more exact one does.
        assert_eq!(seen("indirect", "ambient", Family::Local), Some(0.2));
        assert_eq!(seen("indirect", "occlusion:64", Family::Local), None);
        assert_eq!(seen("normals", "oct16", Family::Local), Some(0.0));
        assert_eq!(seen("light-sampler", "power", Family::Local), None);
        assert_eq!(seen("light-sampler", "power", Family::Exact), Some(0.05));
        assert_eq!(seen("fresnel", "schlick", Family::Local), None);
    }
}
