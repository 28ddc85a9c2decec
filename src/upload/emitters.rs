//! What paths draw light from, as tables on the device (shaders/lib/emitters.glsl).

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use super::table::upload;
use crate::gpu::{Buffer, Device, NOTHING};
use crate::share::{EMITTER_NONE, EMITTER_PUNCTUAL, EMITTER_SKY, EMITTER_TRIANGLE, EMITTER_TWO_SIDED, Emitter};
use crate::transport::emitters::{Emitters, Source};

/// What paths draw light from; next to nothing without any.
pub struct EmittersOnDevice {
    /// An [`Emitter`] each.
    pub table: Buffer,
    /// Shares of the environment's cells.
    pub sky: Buffer,
    /// How many.
    pub count: u32,
    /// Some are lights without extent.
    pub punctual: bool,
    /// Some are triangles.
    pub triangles: bool,
    /// Cells of the environment across; 0 where it is none of them.
    pub columns: u32,
    /// And down.
    pub rows: u32,
}

impl EmittersOnDevice {
    /// `leaf_places` are those of the scene's triangles in the hierarchy.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, emitters: &Emitters, leaf_places: &[u32]) -> Result<Self> {
        let shared = |emitter: &crate::transport::emitters::Emitter| {
            let (kind, place) = match emitter.source {
                Source::Sky => (EMITTER_SKY, 0),
                Source::Punctual(light) => (EMITTER_PUNCTUAL, light),
                Source::Triangle { index, two_sided, .. } => {
                    match leaf_places[index as usize] {
                        // Rays leave it out, and so do the lights.
                        u32::MAX => (EMITTER_NONE, 0),
                        place => (EMITTER_TRIANGLE | if two_sided { EMITTER_TWO_SIDED } else { 0 }, place),
                    }
                }
            };
            Emitter { first: emitter.first, probability: emitter.probability as f32, kind, place }
        };
        let list: Vec<Emitter> = emitters.list.iter().map(shared).collect();
        let any = |test: fn(&Source) -> bool| emitters.list.iter().any(|emitter| test(&emitter.source));
        let name = |named: &'static str, empty: bool| if empty { NOTHING } else { named };
        Ok(Self {
            table: upload(device, name("emitters", list.is_empty()), &list, Some(vk::Format::R32G32B32A32_UINT))?,
            sky: upload(
                device,
                name("shares of the environment", emitters.sky.words.is_empty()),
                &emitters.sky.words,
                Some(vk::Format::R32_UINT),
            )?,
            count: list.len() as u32,
            punctual: any(|source| matches!(source, Source::Punctual(_))),
            triangles: any(|source| matches!(source, Source::Triangle { .. })),
            columns: emitters.sky.columns,
            rows: emitters.sky.rows,
        })
    }
}
