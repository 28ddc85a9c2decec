//! # Etalon: a Vulkan renderer
//!
//! Etalon reads glTF (and OBJ/MTL) and writes radiance: a raster G-buffer, deferred lighting, reflection and refraction
//! by rays, or path tracing, then tone mapping. It is written directly against `ash`. The field's books are *Physically
//! Based Rendering* (pbrt, fourth edition), *Real-Time Rendering* (fourth edition) and the Vulkan specification.
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
//! This crate is the second line. The crates below it are re-exported here: [`gpu`] (`etalon-vulkan`), [`scene`]
//! and [`study`] (`etalon-scene`), [`image`] (`etalon-image`), [`optics`] and [`spectra`] (`etalon-optics`).
//!
//! Start at [`frame::Renderer`]: its private `sample` is the whole frame, one call per pass, top to bottom. Then read
//! one pass, its shader and its formulas:
//!
//! 1. [`pass::light`] names its inputs and outputs and records one dispatch;
//! 2. `shaders/pass/light.comp` fetches, calls, stores;
//! 3. `shaders/lib/lighting.glsl`, `surface.glsl`, `brdf.glsl` are the equations;
//! 4. [`gpu::sync::barriers`] derives the pipeline barriers of the whole frame from the passes' declared accesses.
//!
//! Rays traverse the BVH of [`transport::bvh`], in the memory layout of [`upload::rays`], by `shaders/lib/trace.glsl`.
//! `shaders/lib/ray_tree.glsl` is the recursive ray tree of reflection and refraction, `shaders/lib/shadow.glsl` the
//! shadow rays.
//!
//! [`spectra`] has spectra of light and matter. [`scene::wavelengths`] turns a scene into the same scene in one band of
//! wavelengths, and a frame draws one such band.
//!
//! A pass declares nothing by hand. build.rs (`etalon-reflect`) reads `readonly` and `writeonly` from the compiled GLSL
//! and writes, per program, a module in [`shader`]: `PROGRAM` with the access of each binding, `Bind` with one named
//! field per binding, `Constants`. [`gpu::Access`] is the one table that maps an access to Vulkan's stages, accesses
//! and layouts. Structs of host and shaders are in [`share`]; a difference from the GLSL does not compile.
//!
//! [`plan::Plan`] is made before any Vulkan object from the scene's values and the [`plan::Knobs`]: a pass, an image or
//! a piece of shader code exists only if the plan has it. [`prepare::Prepared`] is a scene with its plan and its BVH.
//! [`scene`] reads untrusted files; [`study`] generates scenes without files; [`image`] stores and compares pictures.
//! [`transport`] has the host's part of light transport: BVH, light sampling tables, photons for path guiding.
//!
//! Each formula of `shaders/lib/` with a tag `@eq` has a twin in [`optics`]: the same name, in f64, with an error
//! bound. The crate `etalon-verify` runs the shader's formula on the device and compares.
//!
//! Lengths are metres, the world is right-handed with +Y up. On the device positions are relative to the eye (`p_rel`);
//! differences are computed in f64. Depth is reversed. `unsafe` is allowed in [`gpu`] only.
//!
//! The modules below are in reading order. `docs/tour.md` goes through them one by one, `docs/frame.md` through the
//! passes.

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
