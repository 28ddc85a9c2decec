//! See-through surfaces lit and laid over what is behind them (shaders/pass/composite.comp).

use anyhow::Result;

use super::fragments::FragmentLists;
use super::light::Lighting;
use crate::gpu::{Frame, Image};
use crate::shader::composite;

/// Adds the fragments of one strip to `radiance`, nearest first.
///
/// # Errors
/// When the driver refuses the pipeline.
pub fn composite<'a>(
    frame: &mut Frame<'a>,
    lighting: Lighting<'a>,
    lists: &'a FragmentLists,
    radiance: &'a Image,
    rows: [u32; 2],
) -> Result<()> {
    let Lighting { scene, environment, camera, .. } = lighting;
    let bind = composite::Bind {
        camera_block: camera,
        materials: &scene.materials,
        heads: &lists.heads,
        nodes: &lists.nodes,
        radiance,
        dropped: &lists.dropped,
        instances: &scene.instances,
        lights: &scene.lights,
        tile_lights: &lighting.tiles.masks,
        environment: &environment.terms,
        tiles: &lists.work.tiles,
        work: &lists.work.sizes,
        prefiltered: environment.prefiltered(),
        reflectance: environment.reflectance(),
    };
    let push = [rows[1]];
    let constants = lighting.composite_constants().words();
    let push = bytemuck::cast_slice(&push);
    frame.compute_indirect("see-through lighting", &bind, constants, push, &lists.work.sizes, 0)
}
