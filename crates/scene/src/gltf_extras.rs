//! `extras.etalon` of glTF materials and lights: data without a glTF extension, such as spectra, n and κ, and grids of
//! σ.
//!
//! Read docs/scene-input.md, which lists all keys.

use std::f64::consts::{PI, TAU};
use std::{collections::BTreeMap, sync::Arc};

use anyhow::{Context, Result, anyhow, bail, ensure};
use glam::DVec3;
use gltf::json;
use serde::Deserialize;
use serde_json::{Value, value::RawValue};

use super::{
    Material, SigmaGrid,
    light::{Extent, Light, LightKind},
    substance::{self, INFINITE_IOR, Medium, SUBSTANCES, Substance},
};
use etalon_optics::spectra::{self, Dispersion, Emission, Spectrum};

/// Largest Phong shininess: the exponent at the smallest roughness (`MIN_ROUGHNESS`).
const MOST_SHINE: f64 = 1e8;

/// Reserved keys that are not read yet.
const NOT_READ_YET: &[&str] = &["brdf"];

/// Range in nm of wavelengths in spectra: that of the CIE colour matching functions.
const SEEN: [f64; 2] = [360.0, 830.0];

/// The `etalon` member of `extras`.
#[derive(Deserialize)]
struct Extras {
    /// Raw text until its type is known, as are its values until their key is known: error messages can then name the
    /// key.
    etalon: Option<Box<RawValue>>,
}

/// Applies `extras.etalon` to a material whose extensions have been read; `file_ior` is the index of
/// KHR_materials_ior. Returns warnings.
pub(crate) fn apply(extras: &json::Extras, file_ior: Option<f32>, m: &mut Material) -> Result<Vec<String>> {
    let entries = entries(extras)?;
    let mut warnings = Vec::new();
    let (mut preset, mut n, mut kappa) = (None, None, None);
    let (mut sellmeier, mut cauchy) = (None, None);
    let (mut kd, mut ks, mut shine) = (None, None, None);
    for (key, text) in &entries {
        let read = || -> Result<Value> { Ok(serde_json::from_str(text.get())?) };
        let blame = || format!("extras.etalon {key}");
        match key.as_str() {
            "priority" => m.priority = read().and_then(|v| integer(&v)).with_context(blame)?,
            "sigma" => m.sigma = Some(Arc::new(grid(text.get()).with_context(blame)?)),
            "preset" => preset = Some(read().and_then(|v| substance(&v)).with_context(blame)?),
            "n" => n = Some(read().and_then(|v| index(&v, key, &mut warnings)).with_context(blame)?),
            "kappa" => kappa = Some(read().and_then(|v| index(&v, key, &mut warnings)).with_context(blame)?),
            "kd" => kd = Some(read().and_then(|v| three(&v)).with_context(blame)?),
            "ks" => ks = Some(read().and_then(|v| three(&v)).with_context(blame)?),
            "shine" => shine = Some(read().and_then(|v| exponent(&v)).with_context(blame)?),
            "sellmeier" => sellmeier = Some(sellmeier_of(text.get()).with_context(blame)?),
            "cauchy" => cauchy = Some(cauchy_of(text.get()).with_context(blame)?),
            "reflectance" => m.reflectance = Some(reflectance(text.get(), &mut warnings).with_context(blame)?),
            "emission" => {
                let spectrum = light_spectrum(text.get(), &mut warnings).with_context(blame)?;
                m.emission = Some(Emission::new(spectrum, m.emissive));
            }
            _ if NOT_READ_YET.contains(&key.as_str()) => warnings.push(format!("extras.etalon {key} is not read yet")),
            _ => warnings.push(format!("extras.etalon has no key {:?}; it is ignored", shortened(key))),
        }
    }
    if m.sigma.is_some() && (m.transmission == 0.0 || m.thickness == 0.0) {
        let lacks = if m.transmission == 0.0 { "transmits nothing" } else { "is a thin sheet, of thickness 0" };
        warnings.push(format!("extras.etalon sigma is seen inside of bodies, and the material {lacks}"));
    }
    if kd.is_some() || ks.is_some() || shine.is_some() {
        phong(m, kd, ks, shine, &mut warnings)?;
    }
    if let Some(n) = n {
        ensure!(n.iter().all(|&x| x > 0.0), "extras.etalon n: an index of refraction lies above 0");
    }
    // Explicit numbers override those of the preset.
    let (preset_n, preset_kappa) = match preset {
        Some(Substance::Metal(metal)) => {
            let index = metal.index();
            (Some(index.map(|[n, _]| n)), index.map(|[_, kappa]| kappa))
        }
        Some(Substance::Dielectric(Medium { n, .. })) => (Some([n as f32; 3]), [0.0; 3]),
        None => (None, [0.0; 3]),
    };
    let by_wavelength = match preset {
        Some(Substance::Metal(metal)) if n.is_none() && kappa.is_none() => metal.spectra(),
        _ => None,
    };
    let (n, kappa) = (n.or(preset_n), kappa.unwrap_or(preset_kappa));
    if kappa.iter().any(|&k| k > 0.0) {
        let n = n.context("extras.etalon kappa: a metal has an n too, and there is none")?;
        conductor(m, [0, 1, 2].map(|i| [n[i], kappa[i]]), &mut warnings)?;
        m.conductor_spectra = by_wavelength;
    } else if let Some([red, green, blue]) = n {
        if red != green || green != blue {
            warnings.push(format!("extras.etalon n of each colour is read for metals only; green's {green} is taken"));
        }
        if let Some(ior) = file_ior.filter(|&ior| ior != green) {
            warnings.push(format!("extras.etalon n {green} replaces the {ior} of KHR_materials_ior"));
        }
        m.ior = green;
        m.dispersion = match preset {
            Some(Substance::Dielectric(Medium { n, dispersion })) if n as f32 == green => dispersion,
            _ => m.dispersion,
        };
    }
    ensure!(
        sellmeier.is_none() || cauchy.is_none(),
        "extras.etalon has both sellmeier and cauchy: one tells the index"
    );
    if let Some(dispersion) = sellmeier.or(cauchy) {
        let yellow = dispersion.index(0.0, spectra::FRAUNHOFER_D) as f32;
        if let Some(other) = n.map(|[_, green, _]| green).or(file_ior).filter(|other| (other - yellow).abs() > 1e-3) {
            warnings.push(format!("extras.etalon: n = {yellow} of the dispersion formula replaces {other}"));
        }
        (m.ior, m.dispersion) = (yellow, dispersion);
    }
    if let Some(reflectance) = &m.reflectance {
        ensure!(
            m.base_color_texture.is_none(),
            "extras.etalon reflectance tells the base by wavelength, and so does a base colour texture: one of them must go"
        );
        ensure!(
            m.conductor.is_none(),
            "extras.etalon reflectance beside a metal's n and kappa: one of them tells the base"
        );
        if m.unlit {
            warnings.push("extras.etalon reflectance: an unlit material is shown as its colour".to_owned());
        }
        let [r, g, b] = reflectance.reflectance_rgb().map(|x| x.clamp(0.0, 1.0) as f32);
        m.base_color = [r, g, b, m.base_color[3]];
    }
    if let Some(emission) = &m.emission {
        ensure!(
            m.emissive_texture.is_none(),
            "extras.etalon emission tells the light by wavelength, and so does an emissive texture: one of them must go"
        );
        if emission.luminance == 0.0 {
            warnings.push(
                "extras.etalon emission is seen where there is an emissive factor; it is 0, so it is dark".to_owned(),
            );
        }
        m.emissive = emission.rgb();
    }
    Ok(warnings)
}

/// Applies `extras.etalon` to a light; `across` is the direction of the first side of a rectangle.
/// Returns warnings.
pub(crate) fn apply_to_light(extras: &json::Extras, light: &mut Light, across: DVec3) -> Result<Vec<String>> {
    let mut warnings = Vec::new();
    for (key, text) in &entries(extras)? {
        if ["sphere", "disk", "rectangle"].contains(&key.as_str()) {
            ensure!(light.extent.is_none(), "extras.etalon: a light has one shape, sphere, disk or rectangle");
            let extent = extent(key, text.get(), light, across).with_context(|| format!("extras.etalon {key}"))?;
            light.extent = Some(extent);
        } else if key == "spectrum" {
            let spectrum = light_spectrum(text.get(), &mut warnings).context("extras.etalon spectrum")?;
            let emission = Emission::new(spectrum, light.color);
            light.color = emission.rgb();
            light.spectrum = Some(emission);
        } else {
            warnings.push(format!("extras.etalon of a light has no key {:?}; it is ignored", shortened(key)));
        }
    }
    Ok(warnings)
}

/// Extent of an area light: radius of a sphere or a disk, width and height of a rectangle, in metres of world space.
fn extent(key: &str, text: &str, light: &Light, across: DVec3) -> Result<Extent> {
    let lengths = match key {
        "rectangle" => serde_json::from_str::<[f64; 2]>(text),
        _ => serde_json::from_str::<f64>(text).map(|radius| [radius; 2]),
    };
    let [a, b] = lengths.map_err(|error| told(&error))?;
    ensure!(a.is_finite() && b.is_finite() && a > 0.0 && b > 0.0, "{} is no length above 0", shortened(text));
    match (key, light.kind) {
        ("sphere", LightKind::Point { .. }) => Ok(Extent::Sphere { radius: a }),
        ("disk", LightKind::Spot { .. }) => Ok(Extent::Disk { radius: a }),
        ("rectangle", LightKind::Spot { .. }) => {
            Ok(Extent::Rectangle { across: 0.5 * a * across, half_height: 0.5 * b })
        }
        ("sphere", _) => bail!("a ball is the shape of a point light, and this one is of another type"),
        _ => bail!("a face is the shape of a spot light, and this one is of another type"),
    }
}

/// The entries of `extras.etalon`; empty without this key.
fn entries(extras: &json::Extras) -> Result<BTreeMap<String, Box<RawValue>>> {
    // Other programs may store any JSON in `extras`; only an object can have our key.
    let Some(text) = extras.as_ref().map(|raw| raw.get()).filter(|text| text.starts_with('{')) else {
        return Ok(BTreeMap::new());
    };
    let Some(ours) = serde_json::from_str::<Extras>(text).context("extras")?.etalon else { return Ok(BTreeMap::new()) };
    ensure!(ours.get().starts_with('{'), "extras.etalon is not an object");
    serde_json::from_str(ours.get()).context("extras.etalon")
}

/// A parser's error without control characters, cut to 120 characters: parsers quote the file.
fn told(error: &serde_json::Error) -> anyhow::Error {
    anyhow!("{}", error.to_string().replace(char::is_control, " ").chars().take(120).collect::<String>())
}

/// The spectrum of a light: a name, `{"blackbody": kelvin}` or `{"table": [[nm, value], …]}`.
fn light_spectrum(text: &str, warnings: &mut Vec<String>) -> Result<Spectrum> {
    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase", deny_unknown_fields)]
    enum SpectrumJson {
        Blackbody(f64),
        Table(Vec<[f64; 2]>),
    }
    let spectrum = if let Ok(name) = serde_json::from_str::<String>(text) {
        spectra::illuminant(&name).with_context(|| {
            format!("{:?} is no illuminant; these are: {}", shortened(&name), spectra::LIGHTS.join(", "))
        })?
    } else {
        match serde_json::from_str(text).map_err(|error| told(&error))? {
            SpectrumJson::Blackbody(kelvin) => {
                ensure!(
                    (500.0..=1e6).contains(&kelvin),
                    "a black body of {kelvin} K: those of 500 to 1000000 K shine visibly"
                );
                Spectrum::BlackBody(kelvin)
            }
            SpectrumJson::Table(rows) => {
                check_table(&rows, warnings)?;
                Spectrum::light_table(&rows)
            }
        }
    };
    let luminance = spectrum.light_in(&spectra::VISIBLE)[1];
    ensure!(
        luminance > 0.0,
        "the spectrum has no light between {} and {} nm",
        spectra::VISIBLE.from,
        spectra::VISIBLE.to
    );
    Ok(spectrum)
}

/// `{"table": [[nm, value], …]}` with values in [0, 1].
fn reflectance(text: &str, warnings: &mut Vec<String>) -> Result<Spectrum> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct SpectrumJson {
        table: Vec<[f64; 2]>,
    }
    let mut rows = serde_json::from_str::<SpectrumJson>(text).map_err(|error| told(&error))?.table;
    check_table(&rows, warnings)?;
    let most = rows.iter().map(|row| row[1]).fold(0.0, f64::max);
    if most > 1.0 {
        warnings.push(format!("a reflectance of {most} sends back more light than there is; it is read as 1"));
        rows.iter_mut().for_each(|row| row[1] = row[1].min(1.0));
    }
    Ok(Spectrum::Table(rows.into()))
}

/// Checks that wavelengths ascend and that values are finite and not negative.
fn check_table(rows: &[[f64; 2]], warnings: &mut Vec<String>) -> Result<()> {
    ensure!(rows.len() > 1, "the table has {} rows, a spectrum at least two", rows.len());
    ensure!(rows.as_flattened().iter().all(|x| x.is_finite()), "the table has a number that is not finite");
    if let Some(pair) = rows.windows(2).find(|pair| pair[0][0] >= pair[1][0]) {
        bail!("wavelengths ascend in a table, and {} nm comes before {} nm", pair[0][0], pair[1][0]);
    }
    if let Some([nm, value]) = rows.iter().find(|row| row[1] < 0.0) {
        bail!("the value at {nm} nm, {value}, is negative");
    }
    if let Some([nm, _]) = rows.iter().find(|row| row[0] < SEEN[0] || row[0] > SEEN[1]) {
        warnings.push(format!(
            "a spectrum tells of {nm} nm, which nobody sees: what is not in {} to {} nm changes nothing",
            SEEN[0], SEEN[1]
        ));
    }
    Ok(())
}

/// `{"b": […], "c": […]}`, up to four terms each.
fn sellmeier_of(text: &str) -> Result<Dispersion> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct SpectrumJson {
        b: Vec<f64>,
        c: Vec<f64>,
    }
    let SpectrumJson { b, c } = serde_json::from_str(text).map_err(|error| told(&error))?;
    ensure!(
        b.len() == c.len() && (1..=4).contains(&b.len()),
        "{} B and {} C; there are as many of both, 1 to 4",
        b.len(),
        c.len()
    );
    let four = |list: &[f64]| std::array::from_fn(|i| list.get(i).copied().unwrap_or(0.0));
    check_index(Dispersion::Sellmeier { b: four(&b), c: four(&c) })
}

/// `[A, B]`, B in µm².
fn cauchy_of(text: &str) -> Result<Dispersion> {
    let [a, b] = serde_json::from_str(text).map_err(|error| told(&error))?;
    check_index(Dispersion::Cauchy { a, b })
}

/// Checks that the formula gives an index at all visible wavelengths.
fn check_index(dispersion: Dispersion) -> Result<Dispersion> {
    let visible = spectra::VISIBLE;
    for nm in (visible.from as u32..=visible.to as u32).map(f64::from) {
        let n = dispersion.index(1.0, nm);
        ensure!(n.is_finite() && n > 1.0 && n < 100.0, "the formula gives n = {n} at {nm} nm, which is no medium's");
    }
    Ok(dispersion)
}

/// Makes a material a conductor of that index. The base colour becomes the reflectance at normal incidence, so that
/// models without complex indices show the same metal.
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

/// The beginning of a text of arbitrary length, for messages.
fn shortened(text: &str) -> String {
    const MOST: usize = 40;
    if text.chars().count() <= MOST { text.to_owned() } else { text.chars().take(MOST).chain(['…']).collect() }
}

/// A value as JSON for messages.
fn shown(value: &Value) -> String {
    shortened(&value.to_string())
}

fn integer(value: &Value) -> Result<i32> {
    value
        .as_i64()
        .and_then(|i| i32::try_from(i).ok())
        .with_context(|| format!("{} is not a whole number of 32 bits", shown(value)))
}

/// Parses a grid of σ. Numbers are parsed directly into their list: as JSON values they would take ten times as much
/// memory.
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
    let Grid { size, values, min, max } = serde_json::from_str(text).map_err(|error| told(&error))?;
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

/// A number, or one for each of red, green and blue; none negative.
fn three(value: &Value) -> Result<[f64; 3]> {
    let channels = match value {
        Value::Number(number) => [number.as_f64(); 3],
        Value::Array(list) if list.len() == 3 => [0, 1, 2].map(|i| list[i].as_f64()),
        _ => [None; 3],
    };
    let [Some(r), Some(g), Some(b)] = channels else { bail!("{} is neither a number nor three numbers", shown(value)) };
    ensure!(r >= 0.0 && g >= 0.0 && b >= 0.0, "{} is negative", shown(value));
    Ok([r, g, b])
}

/// A number that is not negative.
fn exponent(value: &Value) -> Result<f64> {
    let number = value.as_f64().with_context(|| format!("{} is not a number", shown(value)))?;
    ensure!(number >= 0.0, "{} is negative", shown(value));
    Ok(number)
}

/// Converts k_d and k_s (in 1/sr) of lecture B5 and B6 to the base layer that the non-Phong rungs of `brdf` evaluate.
fn phong(
    m: &mut Material,
    kd: Option<[f64; 3]>,
    ks: Option<[f64; 3]>,
    shine: Option<f64>,
    warnings: &mut Vec<String>,
) -> Result<()> {
    ensure!(m.transmission == 0.0, "extras.etalon kd, ks, shine: the model has no light that is transmitted");
    let ks = ks.unwrap_or_default();
    ensure!(shine.is_some() || ks == [0.0; 3], "extras.etalon ks: a lobe has a shine too, and there is none");
    let shine = shine.unwrap_or(0.0).min(MOST_SHINE);
    let albedo = match kd {
        Some(kd) => kd.map(|k| PI * k),
        None => [0, 1, 2].map(|i| f64::from(m.base_color[i])),
    };
    // Tolerates k_d = 0.3183, which is 1/π rounded up.
    if let Some(&most) = albedo.iter().find(|&&x| x > 1.0001) {
        warnings.push(format!("extras.etalon kd {} sends more light than it receives and is read as 1/π", most / PI));
    }
    let albedo = albedo.map(|x| x.min(1.0));
    let f0 = ks.map(|k| TAU * k / (shine + 2.0));
    let most = (0..3).map(|i| albedo[i] + f0[i]).fold(0.0, f64::max);
    if most > 1.0001 {
        warnings.push(format!(
            "extras.etalon kd, ks, shine: π kd + 2π ks/(shine + 2) is {most:.3}, more light than there is; with \
             brdf=blinn-phong-reciprocal of kd the share is drawn that ks leaves"
        ));
    }
    if m.metallic_roughness_texture.take().is_some() {
        warnings
            .push("extras.etalon kd, ks, shine: the metallic-roughness texture has no meaning beside them".to_owned());
    }
    let of_index = ((f64::from(m.ior) - 1.0) / (f64::from(m.ior) + 1.0)).powi(2);
    ensure!(of_index > 0.0 || ks == [0.0; 3], "extras.etalon ks: a surface between equal indices mirrors nothing");
    m.phong = true;
    m.metallic = 0.0;
    m.base_color[..3].copy_from_slice(&albedo.map(|x| x as f32));
    m.specular = if ks == [0.0; 3] { 0.0 } else { 1.0 };
    m.specular_color = f0.map(|f| if of_index > 0.0 { (f / of_index) as f32 } else { 1.0 });
    m.roughness = (2.0 / (shine + 2.0)).sqrt().sqrt() as f32;
    Ok(())
}

/// An index of refraction, or one for each of red, green and blue.
fn index(value: &Value, key: &str, warnings: &mut Vec<String>) -> Result<[f32; 3]> {
    let [r, g, b] = three(value)?;
    let greatest = r.max(g).max(b);
    if greatest > f64::from(INFINITE_IOR) {
        warnings.push(format!("extras.etalon {key} {greatest:e} is clamped to {INFINITE_IOR:e}"));
    }
    // The square of an index must be finite in f32.
    Ok([r, g, b].map(|x| x.min(f64::from(INFINITE_IOR)) as f32))
}
