//! The lecture's formulas as the textbooks write them, in f64: one twin for every tagged function of `shaders/lib/`, in
//! the file and under the name it has there.
//!
//! Twins are not transcriptions of the shaders, or they would share their mistakes. Inputs are values of f32, so that
//! products of two are exact in f64; directions are normalised first. Beside its twin each equation has the regions it is
//! tested in and the error that is promised there: [`Equation`].

pub mod catalogue;

pub mod arithmetic;
pub mod brdf;
pub mod fresnel;
pub mod light;
pub mod snell;

pub use catalogue::{Axis, Case, Draw, Equation, Output, Region, Tier, ulp};

/// Every equation, by subject.
pub fn equations() -> impl Iterator<Item = &'static Equation> {
    [arithmetic::EQUATIONS, brdf::EQUATIONS, fresnel::EQUATIONS, light::EQUATIONS, snell::EQUATIONS]
        .into_iter()
        .flatten()
}
