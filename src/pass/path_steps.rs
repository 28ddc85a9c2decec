//! Path tracing on GPUs: each bounce is four dispatches with one path per invocation, which trace, draw light samples,
//! shade, and trace shadow rays (shaders/pass/path_extend.comp, path_sample.comp, path_shade.comp, path_shadow.comp).
//!
//! Read Laine, Karras and Aila 2013, "Megakernels Considered Harmful", and docs/decisions/architectures.md.

use std::sync::Arc;

use anyhow::Result;

use super::classify::{EMPTY, WORK_BYTES};
use super::lighting::Lighting;
use super::path_states::{PathStates, words};
use super::rows::rows_of;
use crate::gpu::{Buffer, Device, Frame, Image, IndirectGroups, Place};
use crate::plan::Plan;
use crate::shader::{lib, path_end, path_extend, path_sample, path_shade, path_shadow};
use crate::share::WorkSize;

/// Queues of even and odd bounces in one buffer, the sizes of all bounces, hits and shadow rays.
pub struct PathSteps {
    queues: Buffer,
    sizes: Buffer,
    first_sizes: Buffer,
    hits: Buffer,
    shadow_rays: [Buffer; 3],
}

impl PathSteps {
    /// Queues of up to `places` paths, in a picture of `size` pixels.
    pub(super) fn new(device: &Arc<Device>, plan: &Plan, places: u32, size: [u32; 2]) -> Result<Self> {
        let (rays, has_photons) = (plan.rays.unwrap_or_default(), plan.paths.is_some_and(|paths| paths.photons > 0));
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let [x, y, z] = rows_of(places.div_ceil(path_extend::PROGRAM.local_size[0]));
        let mut sizes = vec![WorkSize { x, y, z, count: places }];
        // A bounce appends to the queue of the next one, the last bounce too.
        sizes.resize(rays.interfaces as usize + 2, EMPTY);
        Ok(Self {
            queues: words(device, "queues of paths", true, 2 * u64::from(places))?,
            sizes: Buffer::new(device, "queue sizes", sizes.len() as u64 * WORK_BYTES, Place::Device)?,
            first_sizes: Buffer::with_data(device, "first queue sizes", &sizes)?,
            hits: words(device, "hits of paths", true, 4 * pixels)?,
            shadow_rays: [
                words(device, "directions of shadow rays", true, 4 * pixels)?,
                words(device, "contributions of shadow rays", true, 4 * pixels)?,
                words(device, "media of shadow rays", rays.transmissive || has_photons, 4 * pixels)?,
            ],
        })
    }

    /// Resets the sizes of all queues; returns the first queue.
    pub(super) fn first<'a>(&'a self, frame: &mut Frame<'a>) -> &'a Buffer {
        frame.copy_buffer("reset queue sizes", &self.first_sizes, &self.sizes, self.sizes.bytes());
        &self.queues
    }

    /// All bounces, then the light of all paths into `radiance`, by tiles in this stride.
    pub(super) fn bounces<'a>(
        &'a self,
        frame: &mut Frame<'a>,
        lighting: &Lighting<'a>,
        states: &'a PathStates,
        (radiance, stride): (&'a Image, u32),
    ) -> Result<()> {
        let (library, interfaces) = (lighting.library, lighting.plan.rays.unwrap_or_default().interfaces);
        let PathStates { places, width, .. } = *states;
        let path_steps = || lib::path_steps::Bind { queues: &self.queues, sizes: &self.sizes, hits: &self.hits };
        let path_shadow_ray = || {
            let [shadow_directions, shadow_contributions, shadow_media] = &self.shadow_rays;
            lib::path_shadow_ray::Bind { shadow_directions, shadow_contributions, shadow_media }
        };
        for bounce in 0..interfaces + 1 {
            let offset = u64::from(bounce) * WORK_BYTES;
            let groups = IndirectGroups {
                sizes: &self.sizes,
                offset,
                most: u64::from(places.div_ceil(path_extend::PROGRAM.local_size[0])),
            };
            let (bind, constants, push) = (
                path_extend::Bind { path_state: states.bind(), path_steps: path_steps() },
                path_extend::Constants { library },
                path_extend::Push { width, places, bounce },
            );
            frame.compute_indirect("extend paths", &bind, &constants, &push, groups)?;
            let has_shadow_rays = library.emitters.emitters > 0;
            if has_shadow_rays || library.photon_map.photon_map {
                let (bind, constants, push) = (
                    path_sample::Bind {
                        path_state: states.bind(),
                        path_steps: path_steps(),
                        path_shadow_ray: path_shadow_ray(),
                    },
                    path_sample::Constants { library },
                    path_sample::Push { width, places, bounce },
                );
                frame.compute_indirect("sample lights", &bind, &constants, &push, groups)?;
            }
            let (bind, constants, push) = (
                path_shade::Bind {
                    path_state: states.bind(),
                    path_steps: path_steps(),
                    path_shadow_ray: path_shadow_ray(),
                },
                path_shade::Constants { library },
                path_shade::Push { width, places, bounce },
            );
            frame.compute_indirect("shade paths", &bind, &constants, &push, groups)?;
            if !has_shadow_rays {
                continue;
            }
            let (bind, constants, push) = (
                path_shadow::Bind {
                    path_state: states.bind(),
                    path_steps: path_steps(),
                    path_shadow_ray: path_shadow_ray(),
                },
                path_shadow::Constants { library },
                path_shadow::Push { width, places, bounce },
            );
            frame.compute_indirect("shadow rays", &bind, &constants, &push, groups)?;
        }
        let bind = path_end::Bind { path_state: states.bind(), radiance };
        let push = path_end::Push { places, stride };
        let groups = rows_of(places.div_ceil(path_end::PROGRAM.local_size[0]));
        frame.compute("light of paths", &bind, &path_end::Constants { library }, &push, groups)
    }
}
