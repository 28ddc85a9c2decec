//! See-through surfaces lit and laid over what is behind them (shaders/pass/composite.comp).

use anyhow::Result;

use super::fragments::FragmentLists;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::mirror::OnScreen;
use super::part::PartOnDevice;
use crate::gpu::{Buffer, Frame, Image};
use crate::shader::{composite, lib};

/// Adds the fragments of one strip to `radiance`, nearest first. What they show of the screen is the opaque
/// surfaces.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn composite<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    lists: &'a FragmentLists,
    radiance: &'a Image,
    screen: &'a OnScreen,
    rows: [u32; 2],
) -> Result<()> {
    lay_over(frame, "see-through lighting", lighting, gbuffer, lists, radiance, screen, &screen.seen, rows, false)
}

/// Weakens a part of the picture as the fragments of one strip do that lie before it.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn composite_part<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    lists: &'a FragmentLists,
    part: &'a PartOnDevice,
    screen: &'a OnScreen,
    rows: [u32; 2],
) -> Result<()> {
    let name = format!("see-through over {}", part.part.name());
    lay_over(frame, &name, lighting, gbuffer, lists, &part.radiance, screen, &part.seen, rows, true)
}

#[expect(clippy::too_many_arguments, reason = "the two ways to call it have names")]
fn lay_over<'a>(
    frame: &mut Frame<'a>,
    name: &str,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    lists: &'a FragmentLists,
    radiance: &'a Image,
    screen: &'a OnScreen,
    seen: &'a Buffer,
    rows: [u32; 2],
    behind_alone: bool,
) -> Result<()> {
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
        mirrors: lighting.plan.screen.see_through_mirrors,
        behind_alone,
    };
    let bind = composite::Bind {
        gbuffer: gbuffer.bind(),
        lighting: lighting.tiles.bind(),
        screen: lib::screen::Bind { seen, nearest_pieces: &screen.nearest_pieces },
        heads: &lists.heads,
        nodes: &lists.nodes,
        radiance,
        dropped: &lists.dropped,
        tiles: &lists.work.tiles,
        work: &lists.work.sizes,
    };
    let push = composite::Push { end_row: rows[1] };
    frame.compute_indirect(name, &bind, &constants, &push, &lists.work.sizes, 0)
}
