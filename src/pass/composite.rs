//! See-through surfaces lit and laid over what is behind them (shaders/pass/composite.comp).

use anyhow::Result;

use super::fragments::FragmentLists;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::part::Part;
use super::screen::OnScreen;
use crate::gpu::{Buffer, Frame, Image};
use crate::shader::composite;

/// What fragments are laid over.
#[derive(Clone, Copy)]
pub struct Behind<'a> {
    /// Radiance, pixel by pixel.
    pub radiance: &'a Image,
    /// The same as the screen shows it.
    pub seen: &'a Buffer,
    /// A part of the picture, which fragments only weaken.
    pub part: Option<Part>,
}

/// Lays the fragments of one strip over what is behind them, nearest first. What they show of the screen is the opaque surfaces.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn composite<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    lists: &'a FragmentLists,
    screen: &'a OnScreen,
    behind: Behind<'a>,
    rows: [u32; 2],
) -> Result<()> {
    let name =
        behind.part.map_or("transparent lighting".to_owned(), |part| format!("transparent over {}", part.name()));
    let mut library = lighting.library;
    // What is mirrored here is the environment: rays are sent from the G-buffer alone.
    library.surface.mirror_rays = false;
    // Without rays a light is a single turn of a loop, and what may be too many is refused before.
    if lighting.shadow_rays() {
        library.lighting.light_budget = library.loops.loop_budget;
    }
    let constants = composite::Constants {
        library,
        bends: lighting.plan.screen.refraction,
        mirrors: lighting.plan.screen.transparent_mirrors,
        behind_alone: behind.part.is_some(),
    };
    let bind = composite::Bind {
        gbuffer: gbuffer.bind(),
        lighting: lighting.tiles.bind(),
        screen: screen.bind(behind.seen),
        heads: &lists.heads,
        nodes: &lists.nodes,
        radiance: behind.radiance,
        dropped: &lists.dropped,
        tiles: &lists.work.tiles,
        work: &lists.work.sizes,
    };
    let push = composite::Push { end_row: rows[1] };
    frame.compute_indirect(&name, &bind, &constants, &push, &lists.work.sizes, 0)
}
