//! The lecture's formulas as the textbooks write them, in f64: one twin for every tagged function of `shaders/lib/`, in
//! the file and under the name it has there.
//!
//! Twins are not transcriptions of the shaders, or they would share their mistakes. Inputs are values of f32, so that
//! products of two are exact in f64; directions are normalised first. Beside its twin each equation has the regions it is
//! tested in and the error that is promised there: [`Equation`].

pub mod catalogue;

pub mod arithmetic;
pub mod brdf;
pub mod colour;
pub mod encode;
pub mod frame;
pub mod fresnel;
pub mod light;
pub mod medium;
pub mod ray;
pub mod snell;
pub mod spectra;

pub use catalogue::{Axis, Case, Equation, Output, Region, SplitMix64, Tier, ulp};

/// Every equation, by subject.
pub fn equations() -> impl Iterator<Item = &'static Equation> {
    let subjects = [
        arithmetic::EQUATIONS,
        brdf::EQUATIONS,
        colour::EQUATIONS,
        encode::EQUATIONS,
        frame::EQUATIONS,
        fresnel::EQUATIONS,
        light::EQUATIONS,
        medium::EQUATIONS,
        ray::EQUATIONS,
        snell::EQUATIONS,
    ];
    subjects.into_iter().flatten()
}
