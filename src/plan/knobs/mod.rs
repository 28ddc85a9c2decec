//! Knobs: the settings of quality. Each knob is an approximation with rungs, as types ([`rungs`]) and as a table of
//! data.

#[macro_use]
mod macros;
pub mod rungs;

use super::refused::{Refused, Setting};
use anyhow::Result;
use rungs::{Caustics, Denoise, Guiding, Indirect, Reflection, Refraction, Shadows};
pub use rungs::{KNOBS, Knob, Knobs, Model};

impl Knob {
    /// The knob with a name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        KNOBS.iter().find(|knob| knob.name == name)
    }

    /// Index of the chosen rung.
    #[must_use]
    pub fn place(&self, knobs: &Knobs) -> usize {
        (self.chosen)(knobs)
    }

    /// Name of the chosen rung.
    #[must_use]
    pub fn rung(&self, knobs: &Knobs) -> &'static str {
        self.rungs[self.place(knobs)]
    }
}

impl Default for Knobs {
    fn default() -> Self {
        Self::of(Model::default())
    }
}

fn refused(why: String) -> anyhow::Error {
    Refused::error(Setting::Knob, why)
}

impl Knobs {
    /// Applies one `KNOB=RUNG`.
    ///
    /// # Errors
    /// One sentence when there is no such knob or rung.
    pub fn set(&mut self, choice: &str) -> Result<()> {
        let Some((name, rung)) = choice.split_once('=') else {
            return Err(refused(format!("{choice}: expected KNOB=RUNG, for example samples=16")));
        };
        let Some(knob) = Knob::named(name) else {
            let names: Vec<_> = KNOBS.iter().map(|knob| knob.name).collect();
            return Err(refused(format!("{choice}: no knob is called \"{name}\"; there are {}", names.join(", "))));
        };
        if let Some(found) = knob.rungs.iter().position(|r| *r == rung) {
            (knob.choose)(self, found);
            return Ok(());
        }
        if let (Ok(wanted), Some(nearest)) = (rung.parse::<f64>(), nearest(knob.rungs, rung)) {
            return Err(refused(format!(
                "{choice}: {name} has no rung {wanted}, it has {}; the nearest is {nearest}",
                knob.rungs.join(", ")
            )));
        }
        Err(refused(format!("{choice}: {name} has no rung \"{rung}\", it has {}", knob.rungs.join(", "))))
    }

    /// Applies several choices in order. The error for two contradictory choices, or a choice and a model, names both.
    ///
    /// # Errors
    /// As [`Knobs::set`], and one sentence for choices that contradict.
    pub fn set_all(&mut self, choices: &[String]) -> Result<()> {
        let (none, others): (Vec<&String>, Vec<&String>) =
            choices.iter().partition(|choice| choice.as_str() == "interfaces=0");
        others.into_iter().try_for_each(|choice| self.set(choice))?;
        self.check()?;
        let sends = match (self.refraction, self.reflection) {
            (Refraction::Ray, _) => Some(Refraction::NAME),
            (_, Reflection::Ray) => Some(Reflection::NAME),
            _ => None,
        };
        match (none.first(), sends) {
            (None, _) => Ok(()),
            (Some(choice), None) => self.set(choice),
            (Some(choice), Some(knob)) => Err(refused(format!(
                "{choice} contradicts {knob}=ray, whose rays meet at least one surface; the nearest choice is \
                 interfaces=1, or {knob}=screen"
            ))),
        }
    }

    /// Checks that no two rungs contradict each other.
    ///
    /// # Errors
    /// One sentence with both and the nearest choice.
    pub fn check(&self) -> Result<()> {
        let Self { shadows, reflection, refraction, indirect, guiding, caustics, denoise, .. } = *self;
        if indirect == Indirect::Path {
            let other = [
                (shadows != Shadows::Ray).then(|| (shadows.to_string(), Shadows::Ray.to_string())),
                (reflection != Reflection::Ray).then(|| (reflection.to_string(), Reflection::Ray.to_string())),
                (refraction != Refraction::Ray).then(|| (refraction.to_string(), Refraction::Ray.to_string())),
            ];
            if let Some((chosen, nearest)) = other.into_iter().flatten().next() {
                return Err(refused(format!(
                    "{chosen} contradicts indirect=path, whose paths meet every surface by rays; the nearest choice is \
                     {nearest}, or indirect=ambient with guiding=off, caustics=off and denoise=off"
                )));
            }
        } else if guiding != Guiding::Off {
            return Err(refused(format!(
                "{guiding} contradicts {indirect}: only paths are guided; the nearest choice is indirect=path, or \
                 guiding=off"
            )));
        } else if caustics != Caustics::Off {
            return Err(refused(format!(
                "{caustics} contradicts {indirect}: only paths look up photons; the nearest choice is indirect=path, or \
                 caustics=off"
            )));
        } else if denoise != Denoise::Off {
            return Err(refused(format!(
                "{denoise} contradicts {indirect}: only path tracing estimates its variance; the nearest choice is indirect=path, or \
                 denoise=off"
            )));
        }
        Ok(())
    }

    /// A copy with another rung of one knob; `None` when there is no such rung or it contradicts another.
    #[must_use]
    pub fn with(&self, knob: &str, rung: &str) -> Option<Self> {
        let mut changed = self.clone();
        changed.set(&format!("{knob}={rung}")).ok()?;
        changed.check().ok()?;
        Some(changed)
    }

    /// Whether ambient occlusion can be visible: on the environment's light, or on screen-space reflections.
    #[must_use]
    pub fn show_occlusion(&self, environment: bool) -> bool {
        // Paths and rays of ambient occlusion compute it themselves.
        if self.indirect == Indirect::Path || self.indirect.occlusion_rays() > 0 {
            return false;
        }
        let around = self.indirect != Indirect::Off || self.reflection != Reflection::Off;
        self.reflection == Reflection::Screen || (environment && around)
    }

    /// (knob, rung) in table order.
    #[must_use]
    pub fn list(&self) -> Vec<(&'static str, &'static str)> {
        KNOBS.iter().map(|knob| (knob.name, knob.rung(self))).collect()
    }
}

/// The numeric rung whose ratio to `wanted` is nearest to 1.
fn nearest(rungs: &'static [&'static str], wanted: &str) -> Option<&'static str> {
    let wanted: f64 = wanted.parse().ok().filter(|number: &f64| number.is_finite())?;
    let number = |rung: &&&str| rung.parse::<f64>().ok();
    let far = |rung: &&str| (rung.parse::<f64>().unwrap_or(f64::NAN).ln() - wanted.max(1e-9).ln()).abs();
    rungs.iter().filter(|rung| number(rung).is_some()).min_by(|a, b| far(a).total_cmp(&far(b))).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique() {
        for (i, knob) in KNOBS.iter().enumerate() {
            assert!(KNOBS[..i].iter().all(|other| other.name != knob.name), "{}", knob.name);
            for (place, rung) in knob.rungs.iter().enumerate() {
                assert!(!knob.rungs[..place].contains(rung), "{}={rung}", knob.name);
                let mut knobs = Knobs::default();
                knobs.set(&format!("{}={rung}", knob.name)).unwrap();
                assert_eq!((knob.place(&knobs), knob.rung(&knobs)), (place, *rung), "{}", knob.name);
            }
        }
    }

    #[test]
    fn contradictions_name_both_sides() {
        let set = |choices: &[&str]| {
            let choices: Vec<String> = choices.iter().map(|&choice| choice.to_owned()).collect();
            Knobs::default().set_all(&choices).map_err(|e| e.to_string())
        };
        let said = set(&["interfaces=0", "refraction=ray"]).unwrap_err();
        assert!(said.contains("interfaces=0 contradicts refraction=ray") && said.contains("interfaces=1"), "{said}");
        let said = set(&["interfaces=0", "refraction=off"]).unwrap_err();
        assert!(said.contains("interfaces=0 contradicts reflection=ray"), "{said}");
        let said = set(&["reflection=off", "interfaces=0", "refraction=off"]).unwrap_err();
        assert!(said.contains("no rung 0") && said.contains("nearest is 1"), "{said}");
        assert!(set(&["reflection=off", "samples=16"]).is_ok());
    }

    #[test]
    fn wrong_choices_say_what_there_is() {
        let mut knobs = Knobs::default();
        for (choice, said) in [
            ("normals=f16", "it has oct16, oct24, oct32, f32"),
            ("lights=area:5", "it has points, area:1, area:4, area:16"),
            ("absorption=march:7", "it has off, thickness, path, march:4, march:8, march:16, march:32, march:64"),
            ("absorption=march", "no rung"),
            ("quadrature=right", "it has left, midpoint, simpson"),
            ("brdf=oren", "no rung"),
            ("samples=5", "the nearest is 4"),
            ("samples=100000", "the nearest is 4096"),
            ("interfaces=0", "the nearest is 1"),
            ("lobes=0.4", "the nearest is 0.5"),
            ("fresnel=3", "no rung \"3\""),
            ("gloss=1", "no knob"),
            ("samples", "KNOB=RUNG"),
        ] {
            let error = knobs.set(choice).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
        assert_eq!(knobs, Knobs::default());
    }
}
