//! Two tables of one scene laid side by side: what took how long on each device, with which error and which work.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::table::{Point, Table};
use etalon::gpu::Compiled;

/// A picture that both tables have.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Beside {
    /// Its name.
    pub picture: String,
    /// GPU time of each.
    pub gpu_ms: [f64; 2],
    /// Error of each against its own reference.
    pub error: [f64; 2],
    /// Whether all counts of work are the same.
    pub same_work: bool,
    /// Those that are not, as shares of the first.
    pub other_work: Vec<String>,
    /// What each driver's compiler made of the programs, where one of both tells.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub compiled: Vec<CompiledBeside>,
}

/// What two compilers made of a program.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CompiledBeside {
    /// Its name.
    pub program: String,
    /// Of each; empty where the driver does not tell.
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
    /// What both tables drew with the same rungs, in the order of the first.
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
