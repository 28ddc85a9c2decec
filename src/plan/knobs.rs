//! Knobs as data: each approximation's rungs and what they are called.

use anyhow::{Result, bail};

/// One knob.
#[derive(Debug)]
pub struct Knob {
    /// Name on the command line.
    pub name: &'static str,
    /// Rungs that can be chosen, cheap to exact; `*` stands for a power of four.
    pub rungs: &'static [&'static str],
    /// What the presets `local`, `recursive` and `global` choose.
    pub presets: [&'static str; 3],
    /// The rung that approximates least.
    pub exact: &'static str,
    /// The lecture's statements that it is about.
    pub lecture: &'static [&'static str],
    /// The plan's effects that it shapes; none: every surface of every scene.
    pub effects: &'static [&'static str],
    /// What it approximates.
    pub about: &'static str,
}

/// Every knob. The command line, the report and the documentation read this table.
pub static KNOBS: &[Knob] = &[
    Knob {
        name: "shadows",
        rungs: &["off", "map", "ray"],
        presets: ["map", "ray", "ray"],
        exact: "ray",
        lecture: &["R5"],
        effects: &["shadows"],
        about: "visibility of lights",
    },
    Knob {
        name: "fresnel",
        rungs: &["schlick", "exact"],
        presets: ["schlick", "exact", "exact"],
        exact: "exact",
        lecture: &["F2", "F3"],
        effects: &[],
        about: "Fresnel curve",
    },
    Knob {
        name: "brdf",
        rungs: &["blinn-phong", "blinn-phong-reciprocal", "ggx", "ggx-multi"],
        presets: ["ggx", "ggx", "ggx-multi"],
        exact: "ggx-multi",
        lecture: &["B1", "B5", "B6"],
        effects: &[],
        about: "rough reflection",
    },
    Knob {
        name: "reflection",
        rungs: &["off", "environment", "screen", "ray"],
        presets: ["environment", "ray", "ray"],
        exact: "ray",
        lecture: &["F4"],
        effects: &["mirrors", "mirrored environment"],
        about: "what a surface mirrors: nothing, what is infinitely far, what is on the screen, the scene",
    },
    Knob {
        name: "lobes",
        rungs: &["0.2", "0.5", "1"],
        presets: ["0.2", "0.2", "1"],
        exact: "1",
        lecture: &["B6"],
        effects: &["rays by lobes"],
        about: "roughness up to which rays sample what a surface mirrors, one direction of its lobe for each of the samples",
    },
    Knob {
        name: "refraction",
        rungs: &["off", "screen", "ray"],
        presets: ["off", "ray", "ray"],
        exact: "ray",
        lecture: &["F5"],
        effects: &["refraction"],
        about: "bent transmission: none, one bend and a look at the screen, every bend",
    },
    Knob {
        name: "interfaces",
        rungs: &["1", "2", "4", "8", "16", "32"],
        presets: ["8", "8", "32"],
        exact: "32",
        lecture: &["R6"],
        effects: &["refraction", "mirrors", "paths"],
        about: "surfaces that a path of rays may meet",
    },
    Knob {
        name: "absorption",
        rungs: &["off", "thickness", "path", "march:4", "march:8", "march:16", "march:32", "march:64"],
        presets: ["thickness", "path", "march:32"],
        exact: "march:64",
        lecture: &["A1", "A2"],
        effects: &["absorption", "media that vary"],
        about: "light lost inside media; march:N goes through grids of sigma in N steps of each segment",
    },
    Knob {
        name: "quadrature",
        rungs: &["left", "midpoint", "simpson"],
        presets: ["midpoint", "midpoint", "midpoint"],
        exact: "simpson",
        lecture: &["A2"],
        effects: &["quadrature"],
        about: "rule of the sum over those steps, of order 1, 2 and 4",
    },
    Knob {
        name: "indirect",
        rungs: &["off", "ambient", "path"],
        presets: ["ambient", "ambient", "path"],
        exact: "path",
        lecture: &["R6"],
        effects: &["paths", "ambient light"],
        about: "light from all around: none, the environment as if nothing stood before it, paths from surface to surface",
    },
    Knob {
        name: "lights",
        rungs: &["points", "area:1", "area:4", "area:16"],
        presets: ["points", "points", "area:1"],
        exact: "area:1",
        lecture: &["R2"],
        effects: &["surfaces that light", "lights with a shape"],
        about: "extent of lights: with area:N surfaces that emit light others, by N places on them at each surface of a path",
    },
    Knob {
        name: "guiding",
        rungs: &["off", "aims"],
        presets: ["off", "off", "aims"],
        exact: "aims",
        lecture: &["R6"],
        effects: &["aims"],
        about: "where paths go: as surfaces scatter, or also where photons came from by way of mirrors and lenses; the same mean",
    },
    Knob {
        name: "samples",
        rungs: &["1", "4", "16", "64", "256", "1024", "4096"],
        presets: ["4", "4", "64"],
        exact: "64",
        lecture: &[],
        effects: &[],
        about: "samples per pixel",
    },
    Knob {
        name: "colour",
        rungs: &["rgb", "spectral:8", "spectral:16", "spectral:32"],
        presets: ["rgb", "rgb", "rgb"],
        exact: "spectral:32",
        lecture: &["C1", "C2", "C3"],
        effects: &["bands of wavelengths"],
        about: "wavelengths: three colours, or so many bands of 380 to 780 nm, each a picture of its own",
    },
    Knob {
        name: "upsampling",
        rungs: &["mallett-yuksel", "jakob-hanika"],
        presets: ["jakob-hanika", "jakob-hanika", "jakob-hanika"],
        exact: "jakob-hanika",
        lecture: &["C3"],
        effects: &["bands of wavelengths"],
        about: "reflectance by wavelength of what is told as a colour: a sum of three curves, a fitted sigmoid",
    },
    Knob {
        name: "arithmetic",
        rungs: &["fast", "stable", "compensated"],
        presets: ["stable", "stable", "stable"],
        exact: "compensated",
        lecture: &[],
        effects: &[],
        about: "form of the formulas (docs/numerics.md)",
    },
    Knob {
        name: "normals",
        rungs: &["oct16", "oct24", "oct32", "f32"],
        presets: ["oct32", "oct32", "oct32"],
        exact: "f32",
        lecture: &[],
        effects: &[],
        about: "normals in the G-buffer: as octahedra in so many bits each, or in floats",
    },
    Knob {
        name: "position",
        rungs: &["depth", "stored"],
        presets: ["depth", "depth", "depth"],
        exact: "depth",
        lecture: &[],
        effects: &[],
        about: "positions of the G-buffer's surfaces: from their depth, or stored themselves",
    },
];

/// A rung for every knob.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Knobs {
    rungs: Vec<usize>,
}

/// The lecture's three models (R6): presets of all knobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Model {
    /// Direct light with shadow maps, and the environment as ambient and mirrored light.
    Local,
    /// Plus rays for shadows, mirrors and what lets light through.
    #[default]
    Recursive,
    /// Paths from surface to surface: rough ones, too, light others.
    Global,
}

impl Default for Knobs {
    fn default() -> Self {
        Self::of(Model::default())
    }
}

impl Knobs {
    /// The rungs of a model.
    #[must_use]
    pub fn of(model: Model) -> Self {
        let rung = |knob: &Knob| knob.rungs.iter().position(|r| *r == knob.presets[model as usize]).unwrap_or_default();
        Self { rungs: KNOBS.iter().map(rung).collect() }
    }

    /// Applies one `KNOB=RUNG`.
    ///
    /// # Errors
    /// One sentence when there is no such knob or rung.
    pub fn set(&mut self, choice: &str) -> Result<()> {
        let Some((name, rung)) = choice.split_once('=') else {
            bail!("--set {choice}: expected KNOB=RUNG, for example samples=16");
        };
        let Some((index, knob)) = KNOBS.iter().enumerate().find(|(_, knob)| knob.name == name) else {
            let names: Vec<_> = KNOBS.iter().map(|knob| knob.name).collect();
            bail!("--set {choice}: no knob is called \"{name}\"; there are {}", names.join(", "));
        };
        if let Some(found) = knob.rungs.iter().position(|r| *r == rung) {
            self.rungs[index] = found;
            return Ok(());
        }
        if let (Ok(wanted), Some(nearest)) = (rung.parse::<f64>(), nearest(knob.rungs, rung)) {
            bail!(
                "--set {choice}: {name} has no rung {wanted}, it has {}; the nearest is {nearest}",
                knob.rungs.join(", ")
            );
        }
        bail!("--set {choice}: {name} has no rung \"{rung}\", it has {}", knob.rungs.join(", "));
    }

    /// Applies several, in order. What two of them or a model say against each other is told with both.
    ///
    /// # Errors
    /// As [`Knobs::set`], and one sentence for choices that contradict.
    pub fn set_all(&mut self, choices: &[String]) -> Result<()> {
        let (none, others): (Vec<&String>, Vec<&String>) =
            choices.iter().partition(|choice| choice.as_str() == "interfaces=0");
        others.into_iter().try_for_each(|choice| self.set(choice))?;
        self.check()?;
        let sends = ["refraction", "reflection"].into_iter().find(|knob| self.rung(knob) == "ray");
        match (none.first(), sends) {
            (None, _) => Ok(()),
            (Some(choice), None) => self.set(choice),
            (Some(choice), Some(knob)) => bail!(
                "--set {choice} contradicts {knob}=ray, whose rays meet at least one surface; the nearest choice is \
                 interfaces=1, or {knob}=screen"
            ),
        }
    }

    /// Says whether two rungs contradict.
    ///
    /// # Errors
    /// One sentence with both and the nearest choice.
    pub fn check(&self) -> Result<()> {
        if self.rung("indirect") == "path" {
            let other = ["shadows", "reflection", "refraction"].into_iter().find(|knob| self.rung(knob) != "ray");
            if let Some(knob) = other {
                bail!(
                    "--set {knob}={} contradicts indirect=path, whose paths meet every surface by rays; the nearest choice is \
                     {knob}=ray, or indirect=ambient with lights=points",
                    self.rung(knob)
                );
            }
        } else if self.rung("lights") != "points" {
            bail!(
                "--set lights={} contradicts indirect={}: surfaces light others along paths; the nearest choice is \
                 indirect=path, or lights=points",
                self.rung("lights"),
                self.rung("indirect")
            );
        } else if self.rung("guiding") != "off" {
            bail!(
                "--set guiding={} contradicts indirect={}: only paths are guided; the nearest choice is indirect=path, or \
                 guiding=off",
                self.rung("guiding"),
                self.rung("indirect")
            );
        }
        Ok(())
    }

    /// The rungs of paths that approximate least, with the samples of `global`.
    #[must_use]
    pub fn exact() -> Self {
        let rung = |knob: &Knob| knob.rungs.iter().position(|r| *r == knob.exact).unwrap_or_default();
        Self { rungs: KNOBS.iter().map(rung).collect() }
    }

    /// The same with another rung of one knob; `None` where there is no such rung or it contradicts another.
    #[must_use]
    pub fn with(&self, knob: &str, rung: &str) -> Option<Self> {
        let mut changed = self.clone();
        changed.set(&format!("{knob}={rung}")).ok()?;
        changed.check().ok()?;
        Some(changed)
    }

    /// The chosen rung of a knob.
    ///
    /// # Panics
    /// When there is no such knob: our mistake.
    #[must_use]
    pub fn rung(&self, name: &str) -> &'static str {
        let index = KNOBS.iter().position(|knob| knob.name == name).expect("a knob of the table");
        KNOBS[index].rungs[self.rungs[index]]
    }

    /// Place of the chosen rung in the knob's list.
    ///
    /// # Panics
    /// As [`Knobs::rung`].
    #[must_use]
    pub fn index(&self, name: &str) -> u32 {
        let index = KNOBS.iter().position(|knob| knob.name == name).expect("a knob of the table");
        self.rungs[index] as u32
    }

    /// Surfaces that a path may meet.
    #[must_use]
    pub fn interfaces(&self) -> u32 {
        1 << self.index("interfaces")
    }

    /// Perceptual roughness up to which rays sample what a surface mirrors.
    ///
    /// # Panics
    /// When the table has a rung that is no number: our mistake.
    #[must_use]
    pub fn roughest_lobe(&self) -> f32 {
        self.rung("lobes").parse().expect("a number")
    }

    /// Places on lights that are looked for at each surface of a path.
    #[must_use]
    pub fn light_places(&self) -> u32 {
        self.rung("lights").strip_prefix("area:").and_then(|n| n.parse().ok()).unwrap_or(1)
    }

    /// Steps of each segment through a medium that varies; 0: none is marched.
    #[must_use]
    pub fn march_steps(&self) -> u32 {
        self.rung("absorption").strip_prefix("march:").and_then(|n| n.parse().ok()).unwrap_or(0)
    }

    /// Whether occlusion may be seen: on light from all around, if there is any, and on mirror images of the screen.
    #[must_use]
    pub fn show_occlusion(&self, environment: bool) -> bool {
        // Paths find what is occluded themselves.
        if self.rung("indirect") == "path" {
            return false;
        }
        let around = self.rung("indirect") != "off" || self.rung("reflection") != "off";
        self.rung("reflection") == "screen" || (environment && around)
    }

    /// Bands of wavelengths; 0: three colours.
    #[must_use]
    pub fn bands(&self) -> u32 {
        self.rung("colour").strip_prefix("spectral:").and_then(|n| n.parse().ok()).unwrap_or(0)
    }

    /// Samples per pixel.
    #[must_use]
    pub fn samples(&self) -> u32 {
        4_u32.pow(self.index("samples"))
    }

    /// (knob, rung) in table order.
    #[must_use]
    pub fn list(&self) -> Vec<(&'static str, &'static str)> {
        KNOBS.iter().map(|knob| (knob.name, self.rung(knob.name))).collect()
    }
}

/// Of rungs that are numbers the one whose ratio to a number is nearest to 1.
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
    fn numbers_are_as_named() {
        let mut knobs = Knobs::default();
        for rung in ["1", "2", "4", "8", "16", "32"] {
            knobs.set(&format!("interfaces={rung}")).unwrap();
            assert_eq!(knobs.interfaces().to_string(), rung);
        }
        for rung in ["0.2", "0.5", "1"] {
            knobs.set(&format!("lobes={rung}")).unwrap();
            assert_eq!(knobs.roughest_lobe().to_string(), rung);
        }
        assert_eq!(knobs.march_steps(), 0);
        for steps in [4, 8, 16, 32, 64] {
            knobs.set(&format!("absorption=march:{steps}")).unwrap();
            assert_eq!(knobs.march_steps(), steps);
        }
        for rung in ["1", "4", "16", "64", "256", "1024", "4096"] {
            knobs.set(&format!("samples={rung}")).unwrap();
            assert_eq!(knobs.samples().to_string(), rung);
        }
    }

    #[test]
    fn defaults_exist_and_names_are_unique() {
        for (i, knob) in KNOBS.iter().enumerate() {
            assert!(knob.presets.iter().all(|preset| knob.rungs.contains(preset)), "{}", knob.name);
            assert!(KNOBS[..i].iter().all(|other| other.name != knob.name), "{}", knob.name);
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
