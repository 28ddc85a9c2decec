//! The light sampling tables on the device (shaders/lib/emitters.glsl and light_sampling.glsl): emitters with their
//! CDF, light hierarchy, environment CDF.
//!
//! [`crate::transport::emitters`] and [`crate::transport::light_hierarchy`] compute them.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use super::table::upload;
use crate::gpu::{Buffer, Device, NOTHING};
use crate::share::{
    EMITTER_ENVIRONMENT, EMITTER_NONE, EMITTER_PUNCTUAL, EMITTER_TRIANGLE, EMITTER_TWO_SIDED, Emitter, LightNode,
};
use crate::transport::emitters::{EmitterSource, Emitters};
use crate::transport::light_hierarchy::LightHierarchy;

/// The light sampling tables; dummies without lights. The emitters follow the triangles of the BVH in their buffer:
/// one [`Emitter`] per light, ordered by the CDF. With a light hierarchy its bin comes before the emitters in it, and
/// its nodes come last.
pub struct EmittersOnDevice {
    /// The environment CDF: marginal over rows, then conditional over columns.
    pub sky: Buffer,
    /// Number of bins of the CDF.
    pub count: u32,
    /// Texel of the first emitter in the buffer of triangles.
    pub first: u32,
    /// Texel of the root of the light hierarchy from there on, if there is one.
    pub nodes: Option<u32>,
    /// Whether some entries are punctual or analytic area lights.
    pub punctual: bool,
    /// Whether some entries are emissive triangles.
    pub triangles: bool,
    /// Columns of the environment CDF; 0 when the environment is not sampled.
    pub columns: u32,
    /// Rows of the environment CDF.
    pub rows: u32,
}

impl EmittersOnDevice {
    /// Uploads the environment CDF, and adds the other tables to the texels of the triangles; `leaf_places` maps the
    /// scene's triangles to their index among the BVH's leaves.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(
        device: &Arc<Device>,
        emitters: &Emitters,
        leaf_places: &[u32],
        hierarchy: Option<&LightHierarchy>,
        triangle_texels: &mut Vec<[u32; 4]>,
    ) -> Result<Self> {
        let first = triangle_texels.len() as u32;
        let shared = |emitter: &crate::transport::emitters::Emitter| {
            let (kind, place) = match emitter.source {
                EmitterSource::Environment => (EMITTER_ENVIRONMENT, 0),
                EmitterSource::Punctual(light) => (EMITTER_PUNCTUAL, light),
                EmitterSource::Triangle { index, two_sided, .. } => {
                    match leaf_places[index as usize] {
                        // A degenerate triangle is not in the BVH, so it is no light either.
                        u32::MAX => (EMITTER_NONE, 0),
                        place => (EMITTER_TRIANGLE | if two_sided { EMITTER_TWO_SIDED } else { 0 }, place),
                    }
                }
            };
            Emitter { first: emitter.first, probability: emitter.probability as f32, kind, place }
        };
        let mut list: Vec<Emitter> = emitters.list.iter().map(shared).collect();
        let mut count = list.len() as u32;
        if let Some(LightHierarchy { first, .. }) = hierarchy {
            let probability: f64 = emitters.list[*first..].iter().map(|emitter| emitter.probability).sum();
            let bin =
                Emitter { first: list[*first].first, probability: probability as f32, kind: EMITTER_NONE, place: 0 };
            list.insert(*first, bin);
            count = *first as u32 + 1;
        }
        let nodes: &[LightNode] = hierarchy.map_or(&[], |hierarchy| &hierarchy.nodes);
        triangle_texels.extend_from_slice(bytemuck::cast_slice(&list));
        triangle_texels.extend_from_slice(bytemuck::cast_slice(nodes));
        let any = |test: fn(&EmitterSource) -> bool| emitters.list.iter().any(|emitter| test(&emitter.source));
        let name = |named: &'static str, empty: bool| if empty { NOTHING } else { named };
        Ok(Self {
            sky: upload(
                device,
                name("shares of the environment", emitters.environment.words.is_empty()),
                &emitters.environment.words,
                Some(vk::Format::R32_UINT),
            )?,
            count,
            first,
            nodes: hierarchy.map(|_| list.len() as u32),
            punctual: any(|source| matches!(source, EmitterSource::Punctual(_))),
            triangles: any(|source| matches!(source, EmitterSource::Triangle { .. })),
            columns: emitters.environment.columns,
            rows: emitters.environment.rows,
        })
    }
}
