//! Test utilities of Etalon and of crates built on it: a software device under validation ([`gpu`]), small scenes
//! ([`made`], [`gltf_builder`]), an f64 ray caster that shares only the scene types with the renderer ([`raycast`]),
//! equations evaluated on the device ([`probe`]), errors in units in the last place ([`ulp`]), the white furnace test
//! ([`furnace`]), and the test that barriers are necessary ([`barriers`]).

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
