//! What a device must be able to do for a plan.

use anyhow::{Result, bail};

use super::{KNOBS, Plan};

/// What rungs ask of a device, beyond what every plan does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ability {
    /// Name of the device.
    pub device: String,
    /// Compute shaders add within subgroups: how rays count their work.
    pub adds_in_subgroups: bool,
}

impl Plan {
    /// Refuses a plan that the device cannot draw.
    ///
    /// # Errors
    /// One sentence with the rung, the device and the nearest rung.
    pub fn check(&self, ability: &Ability) -> Result<()> {
        let rays = self.rays.unwrap_or_default();
        let counts = (!ability.adds_in_subgroups)
            .then(|| "has no addition within subgroups of compute shaders, by which rays count their work".to_owned());
        for (asked, knob, rung, lacks) in [
            (self.paths.is_some(), "indirect", "path", &counts),
            (rays.shadows, "shadows", "ray", &counts),
            (rays.mirrors, "reflection", "ray", &counts),
            (rays.refraction, "refraction", "ray", &counts),
        ] {
            if let (true, Some(lacks)) = (asked, lacks) {
                let nearest = below(knob, rung);
                bail!(
                    "{knob}={rung}: the device \"{}\" {lacks}; the nearest choice is {knob}={nearest}",
                    ability.device
                );
            }
        }
        Ok(())
    }
}

/// The next cheaper rung.
fn below(knob: &str, rung: &str) -> &'static str {
    let rungs = KNOBS.iter().find(|known| known.name == knob).map_or(&[][..], |known| known.rungs);
    let place = rungs.iter().position(|known| *known == rung).unwrap_or_default();
    rungs.get(place.saturating_sub(1)).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Demand, Facts, Knobs, Surroundings};
    use crate::scene::Scene;

    #[test]
    fn what_a_device_cannot_do_is_said_with_the_nearest_choice() {
        let able = Ability { device: "toy".to_owned(), adds_in_subgroups: true };
        let plan = |choices: &[&str]| {
            let mut knobs = Knobs::default();
            choices.iter().for_each(|choice| knobs.set(choice).unwrap());
            let surroundings =
                Surroundings { environment: true, constant: false, grey: false, sky: true, demand: Demand::Full };
            Plan::new(&Scene::default(), &Facts::default(), surroundings, &knobs)
        };
        let refused = |choices: &[&str], ability: &Ability| plan(choices).check(ability).map_err(|e| e.to_string());
        assert!(refused(&[], &able).is_ok() && refused(&["reflection=screen"], &able).is_ok());
        let still = Ability { adds_in_subgroups: false, ..able };
        for (choices, asked, nearest) in [
            (&[][..], "shadows=ray", "shadows=map"),
            (&["shadows=map"], "reflection=ray", "reflection=screen"),
            (&["shadows=map", "reflection=off"], "refraction=ray", "refraction=screen"),
        ] {
            let said = refused(choices, &still).unwrap_err();
            assert!(said.starts_with(asked) && said.ends_with(nearest), "{said}");
        }
        assert!(refused(&["shadows=off", "reflection=off", "refraction=off"], &still).is_ok());
    }
}
