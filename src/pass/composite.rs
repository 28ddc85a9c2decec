//! Order-independent transparency, second pass: sorts, lights and composites the per-pixel linked lists of fragments
//! (A-buffer, shaders/pass/composite.comp).
//!
//! Read Carpenter 1984, "The A-buffer, an Antialiased Hidden Surface Method"; Real-Time Rendering (4th ed.), section
//! 5.5; docs/decisions/transparency.md.

use anyhow::Result;

use super::fragments::FragmentLists;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::part::Part;
use super::screen::OnScreen;
use crate::gpu::{Buffer, Frame, Image};
use crate::shader::composite;

/// The picture behind the fragments.
#[derive(Clone, Copy)]
pub struct Behind<'a> {
    /// Radiance per pixel, which the pass updates.
    pub radiance: &'a Image,
    /// A copy of the radiance for screen-space lookups.
    pub seen: &'a Buffer,
    /// A part of the picture, which fragments only attenuate.
    pub part: Option<Part>,
}

/// Composites the fragments of one strip over the picture behind them, nearest first. Screen-space lookups see the
/// opaque surfaces only.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
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
    // Transparent surfaces reflect the environment: reflection rays start from the G-buffer only.
    library.surface.mirror_rays = false;
    library.lighting.screen_mirrors = lighting.plan.screen.transparent_mirrors && lighting.plan.light_samples.emitting;
    // Without shadow rays and samples a light is one loop iteration, and too many lights were refused before.
    if lighting.shadow_rays() || lighting.plan.light_samples.count > 0 {
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
    frame.compute_indirect(&name, &bind, &constants, &push, lists.work.groups())
}
