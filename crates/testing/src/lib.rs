//! What tests of Etalon, and of what is built on it, stand on: a software device under validation ([`gpu`]), scenes made on the spot
//! ([`made`], [`gltf_builder`]), an f64 ray caster that shares nothing with the renderer but scenes ([`raycast`]), and equations run on
//! the device ([`probe`]).

pub mod gltf_builder;
pub mod gpu;
pub mod lobe;
pub mod made;
pub mod probe;
pub mod raycast;
pub mod shade;
