//! Inputs of an equation as a person types them: `name=value`, and vectors by an angle in the plane of incidence.
//!
//! A vector `L` of the columns `Lx Ly Lz` is given as `L=30` (degrees from +Z, towards +X), as `L=0,3,4`, or column by
//! column. Values are rounded to f32, which is what the shader gets.

use std::collections::BTreeMap;

use anyhow::{Context as _, Result, bail, ensure};

use super::Entry;

/// Values by name, in the order of the alphabet.
pub type Values = BTreeMap<String, String>;

/// Splits `name=value`.
///
/// # Errors
/// One sentence with the argument that has no `=`, or the name that is given twice.
pub fn parse(arguments: &[String]) -> Result<Values> {
    let mut values = Values::new();
    for argument in arguments {
        let Some((name, value)) = argument.split_once('=') else {
            bail!("{argument}: expected NAME=VALUE, for example cos_in=0.5");
        };
        let before = values.insert(name.trim().to_owned(), value.trim().to_owned());
        ensure!(before.is_none(), "{argument}: {name} is given twice");
    }
    Ok(values)
}

/// The name of the vector that a column belongs to: `L` for `Lx`, where `Ly` and `Lz` are columns, too.
fn vector_of<'a>(entry: &Entry, column: &'a str) -> Option<&'a str> {
    let stem = column.strip_suffix(['x', 'y', 'z'])?;
    let all = ["x", "y", "z"].iter().all(|axis| entry.probe.inputs.contains(&format!("{stem}{axis}").as_str()));
    (all && !stem.is_empty()).then_some(stem)
}

/// What an equation may be given: its columns, with three columns of a vector as one name.
#[must_use]
pub fn names(entry: &Entry) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for column in entry.probe.inputs {
        let name = vector_of(entry, column).unwrap_or(column).to_owned();
        if names.last() != Some(&name) {
            names.push(name);
        }
    }
    names
}

fn number(name: &str, value: &str) -> Result<f64> {
    let number: f64 = value.parse().with_context(|| format!("{name}={value}: \"{value}\" is no number"))?;
    ensure!((number as f32).is_finite(), "{name}={value}: inputs are finite values of f32");
    Ok(f64::from(number as f32))
}

/// One component of a vector given by an angle or by three numbers.
fn component(name: &str, value: &str, axis: usize) -> Result<f64> {
    let parts: Vec<f64> = value.split(',').map(|part| number(name, part.trim())).collect::<Result<_>>()?;
    match parts[..] {
        [degrees] => {
            let (sin, cos) = degrees.to_radians().sin_cos();
            Ok(f64::from([sin, 0.0, cos][axis] as f32))
        }
        [x, y, z] => Ok([x, y, z][axis]),
        _ => bail!("{name}={value}: a vector is an angle in degrees or three numbers"),
    }
}

/// The input columns of one case. `used` gets the names that were read.
///
/// # Errors
/// One sentence that names the input that is missing, or the value that is no number.
pub fn row(entry: &Entry, values: &Values, used: &mut Vec<String>) -> Result<Vec<f64>> {
    let probe = entry.probe;
    let mut row = Vec::with_capacity(probe.inputs.len());
    for column in probe.inputs {
        if let Some(value) = values.get(*column) {
            used.push((*column).to_owned());
            let whole = value.parse::<u32>().ok().filter(|_| probe.whole.contains(column));
            row.push(whole.map_or_else(|| number(column, value), |whole| Ok(f64::from(whole)))?);
            continue;
        }
        let vector = vector_of(entry, column).and_then(|name| Some((name, values.get(name)?)));
        let Some((name, value)) = vector else {
            bail!("{} needs {column}: its inputs are {}", probe.name, names(entry).join(", "));
        };
        used.push(name.to_owned());
        let axis = usize::from(column.as_bytes()[column.len() - 1] - b'x');
        row.push(component(name, value, axis)?);
    }
    Ok(row)
}

/// Refuses names that no equation has read.
///
/// # Errors
/// One sentence with the first such name.
pub fn all_used(values: &Values, used: &[String], entries: &[Entry]) -> Result<()> {
    for name in values.keys() {
        if !used.contains(name) {
            let has: Vec<String> =
                entries.iter().map(|entry| format!("{} has {}", entry.probe.name, names(entry).join(", "))).collect();
            bail!("no input is called \"{name}\"; {}", has.join("; "));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::find;

    fn row_of(function: &str, arguments: &[&str]) -> Result<Vec<f64>> {
        let entry = find(function)?;
        let arguments: Vec<String> = arguments.iter().map(|argument| (*argument).to_owned()).collect();
        let values = parse(&arguments)?;
        let mut used = Vec::new();
        let row = row(&entry, &values, &mut used)?;
        all_used(&values, &used, &[entry])?;
        Ok(row)
    }

    #[test]
    fn a_vector_is_an_angle_three_numbers_or_three_columns() {
        let by_angle = row_of("lambert", &["N=0", "L=90", "Lin=1", "kd=0.5"]).unwrap();
        assert!((by_angle[3] - 1.0).abs() < 1e-7 && by_angle[5].abs() < 1e-7, "{by_angle:?}");
        let by_numbers = row_of("lambert", &["N=0,0,1", "L=0,3,4", "Lin=4", "kd=0.1"]).unwrap();
        assert_eq!(by_numbers[..7], [0.0, 0.0, 1.0, 0.0, 3.0, 4.0, 4.0]);
        let columns = row_of("lambert", &["Nx=0", "Ny=0", "Nz=1", "L=0,3,4", "Lin=4", "kd=0.1"]).unwrap();
        assert_eq!(columns, by_numbers);
    }

    #[test]
    fn wrong_arguments_are_named() {
        for (arguments, says) in [
            (&["n=1.5"][..], "needs cos_in: its inputs are cos_in, n"),
            (&["cos_in=0.5", "n=x"], "\"x\" is no number"),
            (&["cos_in=0.5", "n=1e300"], "finite values of f32"),
            (&["cos_in=0.5", "n=1.5", "k=1"], "no input is called \"k\""),
            (&["cos_in=0.5", "n=1.5", "n=2"], "given twice"),
            (&["cos_in"], "expected NAME=VALUE"),
        ] {
            let error = format!("{:#}", row_of("fresnel_dielectric", arguments).unwrap_err());
            assert!(error.contains(says), "{arguments:?}: {error}");
        }
    }
}
