//! Optional device features that a plan needs.

use anyhow::{Result, bail};

use super::choice::Choice;
use super::effect::EffectState;
use super::knobs::Knob;
use super::knobs::rungs::{EffectId, Indirect, Lights, Reflection, Refraction, Shadows};
use super::work::Plan;

/// Optional features of the device that some rungs need.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ability {
    /// Name of the device.
    pub device: String,
    /// Subgroup arithmetic in compute shaders, with which rays count their work.
    pub adds_in_subgroups: bool,
}

impl Plan {
    /// Refuses a plan that the device cannot render.
    ///
    /// # Errors
    /// One sentence with the rung, the device and the nearest rung.
    pub fn check(&self, ability: &Ability) -> Result<()> {
        let rays = self.rays.unwrap_or_default();
        let counts = (!ability.adds_in_subgroups)
            .then(|| "has no addition within subgroups of compute shaders, by which rays count their work".to_owned());
        // Light samples send shadow rays on every rung of `shadows` but `off`.
        let sampled = self.effects.iter().find(|effect| {
            [EffectId::EmissiveLights, EffectId::AreaLights].contains(&effect.id) && effect.state == EffectState::Kept
        });
        if let (true, None, Some(lacks), Some(choice)) =
            (rays.shadows, self.paths, &counts, sampled.and_then(|effect| effect.choice))
        {
            let nearest = Lights::Points.choice();
            bail!("{choice}: the device \"{}\" {lacks}; the nearest choice is {nearest}", ability.device);
        }
        for (asked, choice, lacks) in [
            (self.paths.is_some(), Indirect::Path.choice(), &counts),
            (rays.shadows, Shadows::Ray.choice(), &counts),
            (rays.mirrors, Reflection::Ray.choice(), &counts),
            (rays.refraction, Refraction::Ray.choice(), &counts),
        ] {
            if let (true, Some(lacks)) = (asked, lacks) {
                bail!("{choice}: the device \"{}\" {lacks}; the nearest choice is {}", ability.device, below(choice));
            }
        }
        Ok(())
    }
}

/// The next cheaper rung of the choice's knob.
fn below(choice: Choice) -> Choice {
    let rungs = Knob::named(choice.knob).map_or(&[][..], |known| known.rungs);
    let place = rungs.iter().position(|known| *known == choice.rung).unwrap_or_default();
    Choice { rung: rungs.get(place.saturating_sub(1)).copied().unwrap_or_default(), ..choice }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Facts, ForcedEffects, Knobs, Surroundings};
    use crate::scene::Scene;

    #[test]
    fn what_a_device_cannot_do_is_said_with_the_nearest_choice() {
        let able = Ability { device: "toy".to_owned(), adds_in_subgroups: true };
        let plan = |choices: &[&str]| {
            let mut knobs = Knobs::default();
            choices.iter().for_each(|choice| knobs.set(choice).unwrap());
            let surroundings = Surroundings {
                environment: true,
                constant: false,
                grey: false,
                sky: true,
                blurred: false,
                interreflection: true,
                forced: ForcedEffects::All,
            };
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
