//! The programs under `shaders/pass/`, as the build describes them: one module each with `PROGRAM`, `Bind`, `Constants`, `Push`;
//! what each file of `shaders/lib/` owns ([`lib`], [`Library`]); and the equations tagged in `shaders/lib/`, each with a program that evaluates it.

use ash::vk;

use bytemuck::{Pod, Zeroable};

use crate::gpu::{
    Access, Binding, BindingKind, Bindings, Buffer, Constant, Image, Program, Resource, Sampled, SetLayout, SharedSet,
    Specialization, Stage, VertexInput, limits,
};

/// The folder of the shaders' sources, where Etalon was built.
pub const SOURCES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/shaders");

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// A tagged function of `shaders/lib/` with the program that evaluates it, one case per invocation.
#[derive(Debug)]
pub struct Probe {
    /// Name in tables and vector files.
    pub name: &'static str,
    /// File under `shaders/lib/`, without `.glsl`.
    pub subject: &'static str,
    /// Line of its tag in that file.
    pub line: usize,
    /// The formula, in one line.
    pub formula: &'static str,
    /// Ids of the lecture, and rows of docs/numerics.md as `N` and a number.
    pub ids: &'static [&'static str],
    /// Input columns: the function's parameters in order.
    pub inputs: &'static [&'static str],
    /// Those of the inputs that are whole numbers of 32 bits.
    pub whole: &'static [&'static str],
    /// Output columns: the members of its result.
    pub outputs: &'static [&'static str],
    /// Built-ins and operations whose precision is the device's own, reached in the tiers fast, stable, compensated.
    pub builtins: [&'static [&'static str]; 3],
    /// Most evaluations of loop heads in one call.
    pub loop_heads: u32,
    /// Programs of `shaders/pass/` that call the function.
    pub passes: &'static [&'static str],
    /// Where none does, because the host computes it for pictures: file and what for.
    pub host: Option<(&'static str, &'static str)>,
    /// Where none does, because it is a laboratory form: the function that draws instead, and the test that both are equal.
    pub lab: Option<(&'static str, &'static str)>,
    /// Programs that call the function that draws instead.
    pub drawn_by: &'static [&'static str],
    /// The program.
    pub program: &'static Program,
}

impl Probe {
    /// An input as the program gets it: the bits of a float, or a whole number. What is none of 32 bits counts as the
    /// nearest one.
    #[must_use]
    pub fn word(&self, column: usize, value: f64) -> u32 {
        if self.whole.contains(&self.inputs[column]) { value as u32 } else { (value as f32).to_bits() }
    }
}

/// What every probe binds: columns of 32 bits, one after the other.
#[derive(Clone, Copy)]
pub struct ProbeBind<'a> {
    /// Which.
    pub probe: &'static Probe,
    /// [`Probe::inputs`] columns of [`Probe::word`]s.
    pub inputs: &'a Buffer,
    /// [`Probe::outputs`] columns.
    pub outputs: &'a Buffer,
}

impl<'a> Bindings<'a> for ProbeBind<'a> {
    type Constants = lib::arithmetic::Constants;
    /// How many cases.
    type Push = u32;

    fn program(&self) -> &'static Program {
        self.probe.program
    }

    fn resources(&self) -> Vec<Resource<'a>> {
        vec![Resource::from(self.inputs), Resource::from(self.outputs)]
    }
}
