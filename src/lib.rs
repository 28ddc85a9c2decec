//! # Etalon: an explicit Vulkan renderer
//!
//! glTF (and OBJ/MTL) in, radiance out: raster G-buffer → deferred lighting → reflection and refraction by rays → tone map,
//! written directly against `ash`.
//!
//! ```text
//! cli ─► viewer ─► cost ─► etalon      the program; a window; what rungs and effects cost
//!  │                         ▲
//!  └───► verify ─────────────┘         the shaders' formulas, held against those in f64
//!
//! frame ─► pass ─► upload ─► prepare ─► plan ─► transport ─► scene ─► optics
//!           │         │      what a scene calls for,         what to draw: data, no Vulkan
//!           ▼         ▼      and why: no Vulkan
//!         shader ─► gpu                explicit Vulkan, no renderer in it
//! ```
//!
//! This crate is the second line. What lies below it is crates of their own, re-exported here: [`gpu`] (`etalon-vulkan`), [`scene`]
//! and [`study`] (`etalon-scene`), [`image`] (`etalon-image`), [`optics`] and [`spectra`] (`etalon-optics`).
//!
//! Start at [`frame::Renderer`]: its private `sample` is the whole frame, one call per pass, top to bottom. Then read one
//! pass, its shader and its formulas:
//!
//! 1. [`pass::light`]: names what it reads and writes, and asks for one dispatch;
//! 2. `shaders/pass/light.comp`: fetches, calls, stores;
//! 3. `shaders/lib/lighting.glsl`, `surface.glsl`, `brdf.glsl`: the equations;
//! 4. [`gpu::sync::barriers`]: the barriers of the whole frame, as a pure function of what the passes declare.
//!
//! Rays go through [`transport::bvh`], laid out by [`upload::rays`], along `shaders/lib/trace.glsl`; `shaders/pass/interact.comp` is
//! the tree of reflection and refraction, `shaders/lib/shadow.glsl` the way to a light.
//!
//! [`spectra`] has what light and matter are by wavelength; [`scene::wavelengths`] makes of a scene the same scene in one band of
//! them, and frames know no more of it than that.
//!
//! A pass declares nothing by hand. build.rs (`etalon-reflect`) reads `readonly` and `writeonly` out of the compiled GLSL and writes, per program, a
//! module in [`shader`]: `PROGRAM` with the access of each binding, `Bind` with one named field per binding, `Constants`.
//! [`gpu::Access`] is the one table that turns an access into Vulkan's stages, accesses and layouts. Structs that both sides
//! know are in [`share`], and differences from their GLSL twins do not compile.
//!
//! [`plan::Plan`] is made before any Vulkan object from the scene's values and the [`plan::Knobs`]: a pass, an image or a piece of
//! shader code exists only if it says so. [`prepare::Prepared`] is a scene with its plan and what its rays go through. [`scene`]
//! reads files that are not trusted; [`study`] generates scenes without files; [`image`] keeps and compares pictures.
//! [`transport`] has what rays and paths need before a device does: the tree of boxes, what light comes from.
//!
//! Each formula of `shaders/lib/` that is tagged `@eq` has a twin in [`optics`], under its name and in f64, with a bound; the crate
//! `etalon-verify` runs the shader's on the device and compares.
//!
//! Lengths are metres, the world is right-handed with +Y up. On the device positions are relative to the eye (`p_rel`);
//! differences are taken in f64. Depth is reversed. `unsafe` is allowed in [`gpu`] alone.
//!
//! The modules below are in reading order. `docs/tour.md` goes through them room by room, `docs/frame.md` through the passes.

pub mod open;

pub mod frame;

pub mod pass;

pub mod upload;

pub mod shader;

pub mod share;

pub mod prepare;

pub mod plan;

pub mod transport;

pub mod lecture;

pub use etalon_image as image;
pub use etalon_optics as optics;
pub use etalon_optics::spectra;
pub use etalon_scene as scene;
pub use etalon_scene::study;
pub use etalon_vulkan as gpu;
