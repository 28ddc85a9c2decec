//! What tests of Etalon, and of what is built on it, stand on: a software device under validation ([`gpu`]), scenes made on the spot
//! ([`made`], [`gltf_builder`]), an f64 ray caster that shares nothing with the renderer but scenes ([`raycast`]), and equations run on
//! the device ([`probe`]) with distances in units in the last place ([`ulp`]), the white furnace ([`furnace`]), and the proof that
//! barriers are needed ([`barriers`]).

pub mod barriers;
pub mod document;
pub mod furnace;
pub mod gltf_builder;
pub mod gpu;
pub mod lobe;
pub mod made;
pub mod probe;
pub mod raycast;
pub mod shade;
pub mod ulp;
