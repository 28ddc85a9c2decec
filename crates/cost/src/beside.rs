//! Comparison of two tables of one scene, for example from two devices: GPU time, error, work counts and compiler
//! statistics of each picture.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::table::{Point, Table};
use etalon::gpu::Compiled;

/// A picture that both tables have.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Beside {
    /// Name of the picture.
    pub picture: String,
    /// GPU milliseconds in each table.
    pub gpu_ms: [f64; 2],
    /// Error in each table, against the reference of that table.
    pub error: [f64; 2],
    /// Whether all work counts are equal.
    pub same_work: bool,
    /// Work counts that differ, as the ratio second over first.
    pub other_work: Vec<String>,
    /// Compiler statistics of the programs, if a driver reports any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub compiled: Vec<CompiledBeside>,
}

/// Compiler statistics of a program in both tables.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CompiledBeside {
    /// Name of the program.
    pub program: String,
    /// Statistics in each table; empty where the driver reports none.
    pub stages: [Vec<Compiled>; 2],
}

impl CompiledBeside {
    fn of(a: &BTreeMap<String, Vec<Compiled>>, b: &BTreeMap<String, Vec<Compiled>>) -> Vec<Self> {
        let programs: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
        let of =
            |table: &BTreeMap<String, Vec<Compiled>>, program: &String| table.get(program).cloned().unwrap_or_default();
        programs
            .into_iter()
            .map(|program| Self { program: program.clone(), stages: [of(a, program), of(b, program)] })
            .collect()
    }
}

impl Beside {
    /// The pictures that both tables have with the same rungs, in the order of the first table.
    #[must_use]
    pub fn of(a: &Table, b: &Table) -> Vec<Self> {
        let pair = |point: &Point| {
            let other = b.points.iter().find(|other| other.name == point.name && other.knobs == point.knobs)?;
            let count = |point: &Point, name: &str| point.work.get(name).copied().unwrap_or(0);
            let differs = |name: &&String| count(point, name) != count(other, name);
            let share = |name: &String| {
                format!("{name} {:.3}", count(other, name) as f64 / (count(point, name) as f64).max(1.0))
            };
            let other_work: Vec<String> = point.work.keys().filter(differs).map(share).collect();
            Some(Self {
                picture: point.name.clone(),
                gpu_ms: [point.gpu_ms.median, other.gpu_ms.median],
                error: [point.error(), other.error()],
                same_work: other_work.is_empty(),
                other_work,
                compiled: CompiledBeside::of(&point.compiled, &other.compiled),
            })
        };
        a.points.iter().filter_map(pair).collect()
    }
}
