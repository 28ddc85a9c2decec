//! The programs of `shaders/pass/` as the build generates them: one module each with `PROGRAM`, `Bind`, `Constants`,
//! `Push`; bindings and constants of each file of `shaders/lib/` ([`lib`], [`Library`]); and the tagged equations of
//! `shaders/lib/`, each with a program that evaluates it.
//!
//! Read shaders/README.md and docs/equations.md.

use ash::vk;

use bytemuck::{Pod, Zeroable};

use crate::gpu::{
    Access, Binding, BindingKind, Bindings, Buffer, Constant, Image, Program, Resource, Sampled, SetLayout, SharedSet,
    Specialization, Stage, VertexInput, limits,
};

/// The folder of the shaders' sources on the machine that built Etalon.
pub const SOURCES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/shaders");

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// A tagged function of `shaders/lib/` with the program that evaluates it, one case per invocation.
#[derive(Debug)]
pub struct Probe {
    /// Name in tables and vector files.
    pub name: &'static str,
    /// File under `shaders/lib/`, without `.glsl`.
    pub subject: &'static str,
    /// Line of the function's tag in that file.
    pub line: usize,
    /// The formula, in one line.
    pub formula: &'static str,
    /// Ids of the lecture's statements, and rows of docs/numerics.md as `N` and a number.
    pub ids: &'static [&'static str],
    /// Input columns: the function's parameters in order.
    pub inputs: &'static [&'static str],
    /// The inputs that are 32-bit integers.
    pub whole: &'static [&'static str],
    /// Output columns: the members of the function's result.
    pub outputs: &'static [&'static str],
    /// Built-ins and operations with implementation-defined precision, in the tiers fast, stable, compensated.
    pub builtins: [&'static [&'static str]; 3],
    /// Largest number of loop iterations in one call.
    pub loop_heads: u32,
    /// Programs of `shaders/pass/` that call the function.
    pub passes: &'static [&'static str],
    /// For a function that no program calls because the host computes it for pictures: file and purpose.
    pub host: Option<(&'static str, &'static str)>,
    /// For a laboratory form that no program calls: the function used instead, and the test that both are equal.
    pub lab: Option<(&'static str, &'static str)>,
    /// Programs that call the function used instead.
    pub drawn_by: &'static [&'static str],
    /// The program that evaluates the function.
    pub program: &'static Program,
}

impl Probe {
    /// An input as a 32-bit word for the program: the bits of a float, or an integer. Values out of range become the
    /// nearest representable one.
    #[must_use]
    pub fn word(&self, column: usize, value: f64) -> u32 {
        if self.whole.contains(&self.inputs[column]) { value as u32 } else { (value as f32).to_bits() }
    }
}

/// Bindings of every probe: columns of 32-bit words, one after the other.
#[derive(Clone, Copy)]
pub struct ProbeBind<'a> {
    /// The function to evaluate.
    pub probe: &'static Probe,
    /// [`Probe::inputs`] columns of [`Probe::word`]s.
    pub inputs: &'a Buffer,
    /// Columns of the results, one per [`Probe::outputs`].
    pub outputs: &'a Buffer,
}

impl<'a> Bindings<'a> for ProbeBind<'a> {
    type Constants = lib::arithmetic::Constants;
    /// Number of cases.
    type Push = u32;

    fn program(&self) -> &'static Program {
        self.probe.program
    }

    fn resources(&self) -> Vec<Resource<'a>> {
        vec![Resource::from(self.inputs), Resource::from(self.outputs)]
    }
}
