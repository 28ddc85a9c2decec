//! What a device is, keeps and breaks: its capabilities, the errors of its arithmetic, `verify`, pictures of the study
//! scenes and speeds, in one JSON file (`etalon passport`). See docs/passport.md.
//!
//! [`measure`] makes a [`Passport`], [`Passport::read`] reads and checks one. [`Passport::found`] derives the verdicts
//! from the measurements: a file whose verdicts are others is refused. The tests take the capabilities of the passports
//! in `passports/` for devices that one does not own (crate `etalon-mask`).

pub mod arithmetic;
pub mod equations;
mod json;
pub mod pictures;
pub mod speed;

use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use etalon::gpu::{Capabilities, Device, DeviceChoice, DeviceInfo};
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, IntoStaticStr, VariantArray};

use arithmetic::Arithmetic;
use equations::EquationErrors;
use pictures::Pictures;
use speed::Speed;

/// Rust code that build.rs generated from `shaders/`.
#[allow(dead_code, unused_imports, missing_docs, unreachable_pub, reason = "generated")]
mod shader {
    use ash::vk;
    use bytemuck::{Pod, Zeroable};
    use etalon::gpu::*;

    include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
}

/// Schema of the file.
pub const SCHEMA: &str = "etalon.passport/1";

/// Part of a passport.
#[derive(Debug, Clone, Copy, PartialEq, Eq, EnumMessage, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum Section {
    /// Errors of built-in functions and operations.
    Arithmetic,
    /// Errors of Etalon's equations.
    Equations,
    /// Study scenes.
    Pictures,
    /// Speeds.
    Speed,
}

/// How much is measured.
#[derive(Debug, Clone)]
pub struct Scope {
    /// Sections.
    pub sections: Vec<Section>,
    /// Inputs of a built-in function.
    pub inputs: usize,
    /// Inputs of an equation in a tier.
    pub cases: usize,
    /// Names of scenes that are drawn.
    pub scenes: Vec<String>,
    /// Size of pictures in pixels.
    pub size: [u32; 2],
    /// Bytes that are copied and loaded: a multiple of 2^16.
    pub bytes: u64,
    /// Size of the pictures whose rays are timed.
    pub rays_at: [u32; 2],
    /// Milliseconds of a dispatch after which no longer one is tried.
    pub dispatch_ms: f64,
}

impl Default for Scope {
    fn default() -> Self {
        Self {
            sections: Section::VARIANTS.to_vec(),
            inputs: 1 << 22,
            cases: 100_000,
            scenes: etalon::study::NAMES.iter().map(|name| format!("study:{name}")).collect(),
            size: [64, 36],
            bytes: 64 << 20,
            rays_at: [160, 90],
            dispatch_ms: 500.0,
        }
    }
}

impl Scope {
    /// The default scope, with speeds by what fills a GPU where the device is one: up to ten times the 50 MB of the
    /// largest cache known (NVIDIA H100), as its memory, buffers and images allow, and more pixels than it has threads
    /// (270,336).
    #[must_use]
    pub fn of(device: &Arc<Device>) -> Self {
        let mut scope = Self::default();
        if !device.is_software() {
            // The smallest heap of a gigabyte or more: a smaller one is a window onto another.
            let heaps = Capabilities::of(device).heaps.into_iter();
            let memory = heaps.filter(|&bytes| bytes >= 1 << 30).min().unwrap_or(0);
            let rows = u64::from(device.max_image_size()) * speed::BYTES_OF_A_ROW;
            let most = (512 << 20).min(memory / 16).min(device.max_storage_bytes()).min(rows);
            scope.bytes = most.max(scope.bytes) & !(speed::BYTES_OF_A_ROW - 1);
            scope.rays_at = [1280, 720];
        }
        scope
    }
}

/// Device and system.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceIdentity {
    /// Marketing name.
    pub name: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Version number of the driver.
    pub version: String,
    /// `cpu`, `discrete`, `integrated`, `virtual` or `other`.
    #[serde(rename = "type")]
    pub kind: String,
    /// Vulkan version.
    pub api: String,
    /// Operating system and processor architecture.
    pub system: String,
    /// Processor cores.
    pub cores: usize,
}

/// Something that Etalon relies on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Promise {
    /// What should hold.
    pub promise: String,
    /// Whether it does.
    pub held: bool,
    /// The figure behind it.
    pub figure: String,
}

/// What is known of a device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Passport {
    /// [`SCHEMA`].
    pub schema: String,
    /// Version of Etalon.
    pub etalon: String,
    /// The device.
    pub device: DeviceIdentity,
    /// What it says of itself.
    pub capabilities: Capabilities,
    /// Errors of built-in functions.
    pub arithmetic: Option<Arithmetic>,
    /// Errors of Etalon's equations, by function and tier.
    pub equations: Option<Vec<EquationErrors>>,
    /// Study scenes.
    pub pictures: Option<Pictures>,
    /// Speeds.
    pub speed: Option<Speed>,
    /// What holds of what Etalon relies on.
    pub promises: Vec<Promise>,
    /// Seconds that the measurement took.
    pub seconds: f64,
}

/// Measures the device that `choice` opened, and opens it once more; `progress` is called with the name of each step. A
/// section that fails is left out, and the failure is a broken promise; sections after a lost device are left out as
/// well.
///
/// # Errors
/// When nothing can be measured.
pub fn measure(
    device: &Arc<Device>,
    choice: &DeviceChoice,
    scope: &Scope,
    progress: &mut dyn FnMut(&str),
) -> Result<Passport> {
    let begun = Instant::now();
    let DeviceInfo { name, driver, version, kind, api } = device.info().clone();
    let system = format!("{} {}", std::env::consts::OS, std::env::consts::ARCH);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut passport = Passport {
        schema: SCHEMA.to_owned(),
        etalon: env!("CARGO_PKG_VERSION").to_owned(),
        device: DeviceIdentity { name, driver, version, kind: kind.to_owned(), api, system, cores },
        capabilities: Capabilities::of(device),
        arithmetic: None,
        equations: None,
        pictures: None,
        speed: None,
        promises: Vec::new(),
        seconds: 0.0,
    };
    let scenes: Vec<&str> = scope.scenes.iter().map(String::as_str).collect();
    let mut failed = Vec::new();
    for &section in Section::VARIANTS {
        let name: &'static str = section.into();
        if !scope.sections.contains(&section) || failed.iter().any(|(_, error)| etalon::gpu::is_lost(error)) {
            continue;
        }
        progress(name);
        let result = match section {
            Section::Arithmetic => {
                arithmetic::measure(device, scope.inputs).map(|found| passport.arithmetic = Some(found))
            }
            Section::Equations => {
                equations::measure(device, scope.cases, progress).map(|found| passport.equations = Some(found))
            }
            Section::Pictures => {
                let found = pictures::measure(device, choice, &scenes, scope.size, progress);
                found.map(|found| passport.pictures = Some(found))
            }
            Section::Speed => {
                let first = scenes.first().context("timing rays: no scene was asked for");
                let Scope { bytes, rays_at, dispatch_ms, .. } = *scope;
                let found = first.and_then(|scene| speed::measure(device, bytes, scene, rays_at, dispatch_ms));
                found.map(|found| passport.speed = Some(found))
            }
        };
        failed.extend(result.err().map(|error| (name, error)));
    }
    passport.promises = passport.found();
    passport.promises.extend(failed.into_iter().map(|(name, error)| Promise {
        promise: format!("{FAILS}{name}"),
        held: false,
        figure: format!("{error:#}"),
    }));
    passport.seconds = json::short(begun.elapsed().as_secs_f64());
    Ok(passport)
}

/// Beginning of the promise that a section can be measured.
const FAILS: &str = "can be measured: ";

impl Passport {
    /// Reads a passport and checks it: its form, and its verdicts against its measurements.
    ///
    /// # Errors
    /// One sentence with what is wrong.
    pub fn read(text: &str) -> Result<Self> {
        let mut passport: Self = serde_json::from_str(text).context("reading a passport")?;
        ensure!(passport.schema == SCHEMA, "reading a passport: its schema is {:?}, not {SCHEMA:?}", passport.schema);
        passport.agrees()?;
        let (failed, own): (Vec<_>, Vec<_>) =
            std::mem::take(&mut passport.promises).into_iter().partition(|promise| promise.promise.starts_with(FAILS));
        let found = passport.found();
        let verdict = |promise: &Promise| (promise.promise.clone(), promise.held);
        let other = found.iter().zip(&own).find(|(found, own)| verdict(found) != verdict(own)).map(|(found, _)| found);
        if let Some(other) = other.or_else(|| found.get(own.len())) {
            anyhow::bail!(
                "reading a passport: by its measurements, \"{}\" is {}, {}; the file says otherwise",
                other.promise,
                if other.held { "held" } else { "broken" },
                other.figure
            );
        }
        ensure!(own.len() == found.len(), "reading a passport: it has verdicts without a measurement");
        for (i, Promise { promise, held, .. }) in failed.iter().enumerate() {
            let name = &promise[FAILS.len()..];
            let is_missing = |section: Section| name == <&str>::from(section) && !passport.has(section);
            let once = failed[..i].iter().all(|other| other.promise != *promise);
            ensure!(
                !held && once && Section::VARIANTS.iter().copied().any(is_missing),
                "reading a passport: \"{promise}\" is no broken promise of a part that is missing, or is there twice"
            );
        }
        passport.promises = [found, failed].concat();
        Ok(passport)
    }

    /// Whether a section was measured.
    fn has(&self, section: Section) -> bool {
        match section {
            Section::Arithmetic => self.arithmetic.is_some(),
            Section::Equations => self.equations.is_some(),
            Section::Pictures => self.pictures.is_some(),
            Section::Speed => self.speed.is_some(),
        }
    }

    /// Checks that no section is empty, and that what it says of a figure is what the figure says.
    fn agrees(&self) -> Result<()> {
        let arithmetic = self.arithmetic.as_ref().is_none_or(|found| !found.builtins.is_empty());
        let equations = self.equations.as_ref().is_none_or(|found| !found.is_empty());
        let pictures = self.pictures.as_ref().is_none_or(|found| {
            // What was not drawn was refused.
            !found.refused.is_empty() || !(found.scenes.is_empty() || found.ways.is_empty())
        });
        ensure!(arithmetic && equations && pictures, "reading a passport: a list of measurements is empty");
        for of in self.equations.iter().flatten() {
            // The ratio has four digits: what is just above 1 is 1.
            let agrees = if of.held { of.of_bound <= 1.0 } else { of.of_bound >= 1.0 };
            let (function, tier, ratio) = (&of.function, &of.tier, of.of_bound);
            ensure!(
                agrees,
                "reading a passport: an error of {function} ({tier}) is {ratio} of its bound; the file says otherwise"
            );
        }
        for way in self.pictures.iter().flat_map(|pictures| &pictures.ways) {
            ensure!(
                !way.same || way.largest == 0.0,
                "reading a passport: the picture {} differs by {:.1e}; the file says otherwise",
                way.way,
                way.largest
            );
        }
        Ok(())
    }

    /// What holds of what Etalon relies on, by the measurements.
    #[must_use]
    pub fn found(&self) -> Vec<Promise> {
        let mut found = Vec::new();
        let mut promise = |promise: &str, held: bool, figure: String| {
            found.push(Promise { promise: promise.to_owned(), held, figure });
        };
        if let Some(arithmetic) = &self.arithmetic {
            for of in &arithmetic.builtins {
                let figure = format!("{:.3} of what Vulkan allows, {:.1} ulp", of.of_allowed, of.max_ulp);
                promise(&format!("{} keeps Vulkan's bound", of.name), of.of_allowed <= 1.0, figure);
            }
            let percent = 100.0 * arithmetic.precise_fused;
            promise("precise products are rounded", percent == 0.0, format!("{percent:.1} % are not"));
            let special = arithmetic.knows_nan && arithmetic.knows_infinity;
            promise("NaN and infinity are kept", special, format!("min(NaN, 1) is {}", arithmetic.min_of_nan));
            let rounds = matches!(arithmetic.half_rounds.as_str(), "nearest" | "down" | "up");
            promise("halves are a neighbour", rounds, format!("they round {}", arithmetic.half_rounds));
        }
        if let Some(equations) = &self.equations {
            let broken: Vec<String> =
                equations.iter().filter(|e| !e.held).map(|e| format!("{} ({})", e.function, e.tier)).collect();
            let figure = match broken.len() {
                0 => format!("{} of {}", equations.len(), equations.len()),
                count => format!("not {count} of {}: {}", equations.len(), broken.join(", ")),
            };
            promise("equations keep their bounds", broken.is_empty(), figure);
        }
        if let Some(pictures) = &self.pictures {
            let count = pictures.scenes.len();
            let all = count + pictures.refused.len();
            promise("study scenes are drawn", pictures.refused.is_empty(), format!("{count} of {all}"));
            let not_finite: u64 = pictures.scenes.iter().map(|scene| scene.not_finite).sum();
            promise("radiance is finite", not_finite == 0, format!("{not_finite} pixels or paths are not"));
            for way in &pictures.ways {
                let figure = format!("largest difference {:.1e}", way.largest);
                promise(&format!("the same bits {}", way.way), way.same, figure);
            }
        }
        if let Some(speed) = &self.speed {
            let figure = format!("{:.0} ms", speed.longest_dispatch_ms);
            promise("long dispatches end", !speed.lost, figure);
        }
        found
    }

    /// The file: JSON with a line for each scene and function.
    ///
    /// # Errors
    /// Never: all values can be written.
    pub fn to_json(&self) -> Result<String> {
        Ok(json::text(self)?)
    }
}
