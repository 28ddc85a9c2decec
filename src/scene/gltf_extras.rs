//! `extras.etalon` of a glTF material: what the standard's extensions have no word for.

use std::{collections::BTreeMap, sync::Arc};

use anyhow::{Context, Result, anyhow, bail, ensure};
use glam::DVec3;
use gltf::json;
use serde::Deserialize;
use serde_json::{Value, value::RawValue};

use super::{
    Material, SigmaGrid,
    substance::{self, INFINITE_IOR, SUBSTANCES, Substance},
};

/// Keys that are planned and that nothing looks at yet.
const NOT_READ_YET: &[&str] = &["brdf", "kd", "ks", "shine", "sellmeier", "cauchy"];

/// The part of `extras` that is ours.
#[derive(Deserialize)]
struct Extras {
    /// Text until it is known to be an object, and its values until their key is known: what is wrong has a name then.
    etalon: Option<Box<RawValue>>,
}

/// Puts what `extras.etalon` says into a material whose extensions have been read; `file_ior` is the index that
/// KHR_materials_ior gave. Returns what is worth a warning.
pub(crate) fn apply(extras: &json::Extras, file_ior: Option<f32>, m: &mut Material) -> Result<Vec<String>> {
    // Other programs may keep anything in `extras`; only an object can have our key.
    let Some(text) = extras.as_ref().map(|raw| raw.get()).filter(|text| text.starts_with('{')) else {
        return Ok(Vec::new());
    };
    let Some(ours) = serde_json::from_str::<Extras>(text).context("extras")?.etalon else { return Ok(Vec::new()) };
    ensure!(ours.get().starts_with('{'), "extras.etalon is not an object");
    let entries: BTreeMap<String, Box<RawValue>> = serde_json::from_str(ours.get()).context("extras.etalon")?;

    let mut warnings = Vec::new();
    let (mut preset, mut n, mut kappa) = (None, None, None);
    for (key, text) in &entries {
        let read = || -> Result<Value> { Ok(serde_json::from_str(text.get())?) };
        let blame = || format!("extras.etalon {key}");
        match key.as_str() {
            "priority" => m.priority = read().and_then(|v| integer(&v)).with_context(blame)?,
            "sigma" => m.sigma = Some(Arc::new(grid(text.get()).with_context(blame)?)),
            "preset" => preset = Some(read().and_then(|v| substance(&v)).with_context(blame)?),
            "n" => n = Some(read().and_then(|v| index(&v, key, &mut warnings)).with_context(blame)?),
            "kappa" => kappa = Some(read().and_then(|v| index(&v, key, &mut warnings)).with_context(blame)?),
            _ if NOT_READ_YET.contains(&key.as_str()) => warnings.push(format!("extras.etalon {key} is not read yet")),
            _ => warnings.push(format!("extras.etalon has no key {:?}; it is ignored", shortened(key))),
        }
    }
    if m.sigma.is_some() && (m.transmission == 0.0 || m.thickness == 0.0) {
        let lacks = if m.transmission == 0.0 { "transmits nothing" } else { "is a thin sheet, of thickness 0" };
        warnings.push(format!("extras.etalon sigma is seen inside of bodies, and the material {lacks}"));
    }
    if let Some(n) = n {
        ensure!(n.iter().all(|&x| x > 0.0), "extras.etalon n: an index of refraction lies above 0");
    }
    // Numbers beside a preset replace its own.
    let (preset_n, preset_kappa) = match preset {
        Some(Substance::Metal(index)) => (Some(index.map(|i| i.0 as f32)), index.map(|i| i.1 as f32)),
        Some(Substance::Dielectric(n)) => (Some([n as f32; 3]), [0.0; 3]),
        None => (None, [0.0; 3]),
    };
    let (n, kappa) = (n.or(preset_n), kappa.unwrap_or(preset_kappa));
    if kappa.iter().any(|&k| k > 0.0) {
        let n = n.context("extras.etalon kappa: a metal has an n too, and there is none")?;
        conductor(m, [0, 1, 2].map(|i| [n[i], kappa[i]]), &mut warnings)?;
    } else if let Some([red, green, blue]) = n {
        if red != green || green != blue {
            warnings.push(format!("extras.etalon n of each colour is read for metals only; green's {green} is taken"));
        }
        if let Some(ior) = file_ior.filter(|&ior| ior != green) {
            warnings.push(format!("extras.etalon n {green} replaces the {ior} of KHR_materials_ior"));
        }
        m.ior = green;
    }
    Ok(warnings)
}

/// Makes a material a metal of that index. Its base colour becomes the reflectance at normal incidence, so that models
/// that know no more than that show the same metal.
fn conductor(m: &mut Material, index: [[f32; 2]; 3], warnings: &mut Vec<String>) -> Result<()> {
    ensure!(
        m.transmission == 0.0,
        "extras.etalon kappa: with a kappa above 0 light ends within a wavelength of the surface, so the transmission \
         of {} is not possible",
        m.transmission
    );
    if m.metallic == 0.0 {
        warnings.push("the metallic factor 0 is read as 1, because extras.etalon gives a kappa".to_owned());
        m.metallic = 1.0;
    }
    let [r, g, b] = substance::f0(index.map(|[n, k]| (f64::from(n), f64::from(k))));
    m.base_color = [r, g, b, m.base_color[3]];
    m.conductor = Some(index);
    Ok(())
}

/// The beginning of a text that a file may have made as long as it likes.
fn shortened(text: &str) -> String {
    const MOST: usize = 40;
    if text.chars().count() <= MOST { text.to_owned() } else { text.chars().take(MOST).chain(['…']).collect() }
}

/// A value as JSON, for messages.
fn shown(value: &Value) -> String {
    shortened(&value.to_string())
}

fn integer(value: &Value) -> Result<i32> {
    value
        .as_i64()
        .and_then(|i| i32::try_from(i).ok())
        .with_context(|| format!("{} is not a whole number of 32 bits", shown(value)))
}

/// Numbers go from the text into their list: as values of any kind they would take ten times as much memory.
fn grid(text: &str) -> Result<SigmaGrid> {
    // An unknown key is an error here: a misspelt `min` would move the grid.
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Grid {
        size: [u64; 3],
        values: Vec<f32>,
        min: Option<[f64; 3]>,
        max: Option<[f64; 3]>,
    }
    let Grid { size, values, min, max } = serde_json::from_str(text).map_err(|error| {
        // It repeats what it finds, as long as it may be and with its line breaks.
        anyhow!("{}", error.to_string().replace(char::is_control, " ").chars().take(120).collect::<String>())
    })?;
    ensure!(min.is_some() == max.is_some(), "of a box there are both corners, min and max, or none");
    let bounds = min.zip(max).map(|(min, max)| [DVec3::from(min), DVec3::from(max)]);
    SigmaGrid::new(size, values, bounds)
}

fn substance(value: &Value) -> Result<Substance> {
    let found = SUBSTANCES.iter().find(|(name, _)| value.as_str() == Some(name));
    found.map(|(_, substance)| *substance).with_context(|| {
        let names: Vec<&str> = SUBSTANCES.iter().map(|(name, _)| *name).collect();
        format!("{} is no preset; these are: {}", shown(value), names.join(", "))
    })
}

/// A number, or one each for red, green and blue; never negative.
fn index(value: &Value, key: &str, warnings: &mut Vec<String>) -> Result<[f32; 3]> {
    let channels = match value {
        Value::Number(number) => [number.as_f64(); 3],
        Value::Array(list) if list.len() == 3 => [0, 1, 2].map(|i| list[i].as_f64()),
        _ => [None; 3],
    };
    let [Some(r), Some(g), Some(b)] = channels else { bail!("{} is neither a number nor three numbers", shown(value)) };
    ensure!(r >= 0.0 && g >= 0.0 && b >= 0.0, "{} is negative", shown(value));
    let greatest = r.max(g).max(b);
    if greatest > f64::from(INFINITE_IOR) {
        warnings.push(format!("extras.etalon {key} {greatest:e} is clamped to {INFINITE_IOR:e}"));
    }
    // The square of an index must still be a number.
    Ok([r, g, b].map(|x| x.min(f64::from(INFINITE_IOR)) as f32))
}
