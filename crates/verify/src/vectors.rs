//! Vector files: CSV files of test cases. The header names inputs, and expected outputs with a leading `=`. See
//! crates/verify/tests/vectors/README.md.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};

use super::{Cases, Entry, find};

/// Reads a vector file for `function`, by default the stem of the file name. Empty cells and `nan` in expected outputs
/// expect nothing. Inputs are rounded to f32; whole-number inputs (a count, a seed) written without a fraction keep all
/// 32 bits.
///
/// # Errors
/// One sentence with the file and the line: the file is unreadable, the function is unknown, a column is unknown,
/// missing, duplicate or of uneven length, a cell is not a number, or an input is not a finite f32.
pub fn load(path: &Path, function: Option<&str>) -> Result<(Entry, Cases)> {
    let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    read(&text, function.unwrap_or(&stem)).with_context(|| format!("reading {}", path.display()))
}

/// Meaning of a column of the file.
enum Column {
    Input(usize),
    Expected(usize),
}

fn read(text: &str, function: &str) -> Result<(Entry, Cases)> {
    let entry = find(function)?;
    let probe = entry.probe;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
    let header = reader.headers().context("reading the header")?.clone();
    let mut columns = Vec::new();
    for (at, name) in header.iter().enumerate() {
        ensure!(header.iter().take(at).all(|other| other != name), "the column \"{name}\" occurs twice");
        columns.push(match name.strip_prefix('=') {
            Some(output) => Column::Expected(place(probe.outputs, output).with_context(|| {
                format!("{function} has no output \"{output}\"; its outputs are {}", probe.outputs.join(" "))
            })?),
            None => Column::Input(place(probe.inputs, name).with_context(|| {
                format!("{function} has no input \"{name}\"; its inputs are {}", probe.inputs.join(" "))
            })?),
        });
    }
    for (at, name) in probe.inputs.iter().enumerate() {
        let found = columns.iter().any(|column| matches!(column, Column::Input(place) if *place == at));
        ensure!(found, "the input \"{name}\" of {function} has no column");
    }
    let expects = columns.iter().any(|column| matches!(column, Column::Expected(_)));
    ensure!(
        expects,
        "the file has no expected output: add a column with a leading = for one of {}",
        probe.outputs.join(" ")
    );

    let mut rows = Vec::new();
    let mut given = Vec::new();
    for record in reader.records() {
        let record = record?;
        let line = record.position().map_or(0, csv::Position::line);
        let mut row = vec![0.0_f64; probe.inputs.len()];
        let mut outputs = vec![f64::NAN; probe.outputs.len()];
        for ((column, name), cell) in columns.iter().zip(&header).zip(&record) {
            let broken = || format!("line {line}: {name} is \"{cell}\", which is not a number");
            match *column {
                Column::Input(at) => {
                    let nearest: f32 = cell.parse().with_context(broken)?;
                    let digits = cell.parse::<u32>().ok().filter(|_| probe.whole.contains(&name));
                    row[at] = digits.map_or(f64::from(nearest), f64::from);
                    ensure!(
                        nearest.is_finite(),
                        "line {line}: {name} is \"{cell}\", but inputs must be finite f32 values"
                    );
                }
                Column::Expected(_) if cell.is_empty() => {}
                Column::Expected(at) => outputs[at] = cell.parse().with_context(broken)?,
            }
        }
        rows.push(row);
        given.push(outputs);
    }
    ensure!(!rows.is_empty(), "the file has no rows");
    let any = given.iter().flatten().any(|value| !value.is_nan());
    ensure!(any, "no cell of the expected outputs contains a number");
    let mut cases = Cases::from_rows(&entry, &rows);
    // Bounds depend on all outputs of a case; a column that the file lacks is taken from the twin and is not judged.
    let judged = |at: usize| columns.iter().any(|column| matches!(column, Column::Expected(place) if *place == at));
    let width = probe.outputs.len();
    for (row, outputs) in given.iter().enumerate() {
        for (at, &value) in outputs.iter().enumerate() {
            if judged(at) {
                cases.exact[row * width + at] = value;
            }
        }
    }
    cases.judged = (0..width).map(judged).collect();
    Ok((entry, cases))
}

fn place(names: &[&str], name: &str) -> Option<usize> {
    names.iter().position(|known| *known == name)
}
