//! Wavefront path tracing: the paths' states in memory, and the two forms in which bounces follow each other: pairs of
//! paths in one kernel per bounce (path_pairs.rs), or four kernels per bounce with one path per invocation
//! (path_steps.rs).
//!
//! Read pbrt (4th ed.), chapter 15 (wavefront rendering) and sections 13.2 to 13.4; Laine, Karras and Aila 2013,
//! "Megakernels Considered Harmful"; docs/decisions/paths.md and architectures.md. Estimates use next event estimation
//! with multiple importance sampling.

use std::sync::Arc;

use anyhow::Result;

use super::lighting::Lighting;
use super::path_pairs::PathPairs;
use super::path_states::PathStates;
use super::path_steps::PathSteps;
use super::rows::{TileShare, rows_of, stride};
use crate::gpu::{Device, Frame, Image};
use crate::plan::{Architecture, Plan};
use crate::shader::{lib, path_begin};

/// Pixels per tile; the first queue consists of whole tiles.
const TILE: u32 = lib::work_tile::WORK_TILE * lib::work_tile::WORK_TILE;

/// Size of the picture, and the share of its tiles that is drawn.
type Pixels = ([u32; 2], TileShare);

/// State of all paths between two dispatches.
pub struct PathsOnDevice {
    states: PathStates,
    form: Form,
}

enum Form {
    Pairs(PathPairs),
    Steps(PathSteps),
}

impl PathsOnDevice {
    /// Buffers for a share of a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, plan: &Plan, touching: bool, pixels: Pixels) -> Result<Self> {
        let (size, share) = pixels;
        let (rays, places) = (plan.rays.unwrap_or_default(), share.tiles(size) * TILE);
        Ok(Self {
            states: PathStates::new(device, rays, touching, size, places)?,
            form: match plan.architecture {
                Architecture::Cpu => Form::Pairs(PathPairs::new(device, places)?),
                Architecture::Gpu => Form::Steps(PathSteps::new(device, plan, places, size)?),
            },
        })
    }
}

/// Records one sample of every pixel into `radiance`.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn paths<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    paths: &'a PathsOnDevice,
    radiance: &'a Image,
) -> Result<()> {
    let (library, places, tiles) = (lighting.library, paths.states.places, paths.states.places / TILE);
    let stride = stride(lighting.plan.architecture, tiles);
    let queue = match &paths.form {
        Form::Pairs(pairs) => pairs.first(frame),
        Form::Steps(steps) => steps.first(frame),
    };
    let bind = path_begin::Bind { path_state: paths.states.bind(), queue };
    let push = path_begin::Push { places, stride };
    frame.compute("camera rays", &bind, &path_begin::Constants { library }, &push, rows_of(tiles))?;
    match &paths.form {
        Form::Pairs(pairs) => pairs.bounces(frame, lighting, &paths.states, radiance),
        Form::Steps(steps) => steps.bounces(frame, lighting, &paths.states, (radiance, stride)),
    }
}
