//! Photons of punctual lights, each traced along smooth surfaces until it lands (shaders/pass/trace_photons.comp).
//!
//! Read Jensen 2001, "Realistic Image Synthesis Using Photon Mapping", chapter 5, and docs/decisions/paths.md.

use anyhow::Result;

use super::rows::rows_of;
use crate::gpu::Frame;
use crate::shader::{Library, lib, trace_photons as program};
use crate::upload::photon_map::PhotonFlight;

/// Records the tracing of all photons of a flight, and the reading of where they land.
///
/// # Errors
/// When the driver refuses what the pipeline binds.
pub fn trace_photons<'a>(frame: &mut Frame<'a>, library: Library, flight: &'a PhotonFlight) -> Result<()> {
    let PhotonFlight { rays, landings, count } = flight;
    // Photons are reflected by smooth surfaces alone: no direction of theirs is guided.
    let library = Library { path_guiding: lib::path_guiding::Constants { path_guiding: false }, ..library };
    let bind = program::Bind { rays, landings };
    let groups = rows_of(count.div_ceil(program::PROGRAM.local_size[0]));
    frame.compute("photons", &bind, &program::Constants { library }, &program::Push { count: *count }, groups)?;
    frame.read_back(landings);
    Ok(())
}
