//! Reference implementations in f64 (twins) of all tagged functions of `shaders/lib/`, written from the textbook
//! formulas of the lecture. File and function names are those of the shader.
//!
//! Read docs/verified.md. A twin is not transcribed from the shader, because a transcription repeats its mistakes.
//! Inputs are values of f32, so that products of two are exact in f64; directions are normalised first. Beside its twin
//! each equation has its test regions and its error bounds: [`Equation`].

pub mod catalogue;

pub mod anisotropy;
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
pub mod thin_film;

pub use catalogue::{Axis, Case, Equation, Output, Region, SplitMix64, Tier, ulp};

/// All equations, by subject.
pub fn equations() -> impl Iterator<Item = &'static Equation> {
    let subjects = [
        anisotropy::EQUATIONS,
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
        thin_film::EQUATIONS,
    ];
    subjects.into_iter().flatten()
}
