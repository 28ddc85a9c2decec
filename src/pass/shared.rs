//! What all programs of a renderer share: the descriptor set of the scene, and the specialization constants of
//! `shaders/lib/`. Both are filled in here and nowhere else.

use std::sync::Arc;

use anyhow::Result;

use super::environment::EnvironmentOnDevice;
use super::rays::RaysOnDevice;
use super::scene::SceneOnDevice;
use super::shadow_map::ShadowMaps;
use super::tiles::Tiles;
use crate::gpu::{BoundSet, Buffer, DescriptorSet, Device, Resource};
use crate::plan::{Knobs, March, Plan};
pub use crate::shader::Library;
use crate::shader::{SCENE, lib};

/// What the device holds of a scene.
#[derive(Clone, Copy)]
pub struct OnDevice<'a> {
    /// The camera's buffer.
    pub camera: &'a Buffer,
    /// Materials, lights, instances, textures.
    pub scene: &'a SceneOnDevice,
    /// What rays go through.
    pub rays: &'a RaysOnDevice,
    /// What lights see.
    pub shadow_maps: &'a ShadowMaps,
    /// Light from all around.
    pub environment: &'a EnvironmentOnDevice,
}

impl<'a> OnDevice<'a> {
    /// The descriptor set `scene`: slots and what is in them, file by file of `shaders/lib/`.
    fn entries(&self) -> Vec<(u32, Resource<'a>)> {
        let &Self { camera, scene, rays, shadow_maps, environment } = self;
        [
            lib::view::Scene { camera_block: camera }.entries(),
            lib::instances::Scene { instances: &scene.instances }.entries(),
            lib::material::Scene { material_texels: &scene.materials }.entries(),
            lib::light_table::Scene { lights: &scene.lights }.entries(),
            lib::spectrum::Scene { spectrum: &scene.spectrum.texels }.entries(),
            lib::sigma_grid::Scene { sigma_grids: &scene.grids.texels }.entries(),
            lib::hit::Scene { hit_corners: &rays.corners, texels: &scene.texels }.entries(),
            lib::primary::Scene { leaf_places: &rays.leaf_places }.entries(),
            rays.trace().entries(),
            rays.work().entries(),
            lib::emitters::Scene { emitters: &rays.emitters.table, sky_shares: &rays.emitters.sky }.entries(),
            lib::aims::Scene { aim_cells: &rays.aims.cells, aim_table: &rays.aims.balls }.entries(),
            lib::shadow::Scene { shadow_depth: shadow_maps.depth() }.entries(),
            lib::environment::Scene {
                environment: &environment.terms,
                sky: environment.sky(),
                prefiltered: environment.prefiltered(),
            }
            .entries(),
            lib::reflectance::Scene { reflectance: environment.reflectance() }.entries(),
        ]
        .concat()
    }

    /// Writes the set.
    ///
    /// # Errors
    /// When memory is short.
    pub fn write(&self, device: &Arc<Device>) -> Result<DescriptorSet> {
        DescriptorSet::new(device, &SCENE, &self.entries())
    }

    /// The set as it was written, for a frame.
    #[must_use]
    pub fn bind(&self, set: &'a DescriptorSet) -> BoundSet<'a> {
        set.bind(self.entries())
    }

    /// What programs are specialised by. A pass that wants something else changes its copy, and says why.
    #[must_use]
    pub fn library(&self, plan: &Plan, knobs: &Knobs, tiles: &Tiles) -> Library {
        let &Self { scene, rays, .. } = self;
        let with = plan.rays.unwrap_or_default();
        let paths = plan.paths.unwrap_or_default();
        let emitters = &rays.emitters;
        let spectrum = scene.colours();
        let shadow_rays = with.shadows;
        Library {
            arithmetic: lib::arithmetic::Constants { arithmetic: knobs.index("arithmetic") },
            aims: lib::aims::Constants { aimed: paths.aimed },
            boundary: lib::boundary::Constants { touching: rays.constants.touching },
            bsdf: lib::bsdf::Constants { frosted: with.frosted },
            emitters: lib::emitters::Constants {
                emitters: emitters.count,
                emitter_steps: halvings(emitters.count),
                punctual_emitters: emitters.punctual,
                shaped_emitters: paths.shaped && emitters.punctual,
                emitting_triangles: emitters.triangles,
                emitting_sky: emitters.rows > 0,
                sky_columns: emitters.columns,
                sky_rows: emitters.rows,
                sky_steps: halvings(emitters.columns.max(emitters.rows)),
            },
            environment: lib::environment::Constants { sky: plan.sky, environment: plan.environment },
            gbuffer: lib::gbuffer::Constants {
                normals: plan.stored.normals as u32,
                normal_error2: plan.stored.normals.error2(),
                positions: plan.stored.positions,
                stored_emissive: plan.emissive,
                stored_layers: plan.layers,
                stored_triangles: shadow_rays || rays.inside(),
                stored_transmission: with.refraction,
            },
            gbuffer_interface: lib::gbuffer_interface::Constants::default(),
            hit: rays.constants.hit,
            layers: lib::layers::Constants { transmissive: with.transmissive },
            lighting: lib::lighting::Constants {
                // Where tiles list them, no pixel goes through all of them.
                local_lights: if plan.tiles { 0 } else { plan.local_lights },
                tile_words: tiles.words(),
                ambient: plan.ambient,
                reflection: plan.reflection,
                light_budget: u32::MAX,
            },
            loops: match scene.device().limits_loops() {
                true => lib::loops::Constants::default(),
                false => lib::loops::Constants { loop_budget: u32::MAX },
            },
            path: lib::path::Constants { lighting_surfaces: paths.emitting, light_places: knobs.light_places() },
            path_state: lib::path_state::Constants {
                keeps_media: with.transmissive,
                keeps_after: rays.constants.touching,
            },
            primary: lib::primary::Constants { in_medium: rays.inside() },
            punctual: lib::punctual::Constants { directional_lights: plan.directional_lights },
            shadow: lib::shadow::Constants {
                shadows: if plan.shadow_maps {
                    lib::shadow::SHADOW_MAP
                } else if shadow_rays {
                    lib::shadow::SHADOW_RAY
                } else {
                    lib::shadow::SHADOW_OFF
                },
                filters: with.filters,
                absorption: with.absorption,
            },
            sigma_grid: match with.march {
                March { steps: 0, .. } => lib::sigma_grid::Constants::default(),
                March { steps, rule, colours } => {
                    lib::sigma_grid::Constants { march_steps: steps, quadrature: rule, march_colours: colours }
                }
            },
            spectrum: lib::spectrum::Constants { spectral: spectrum.spectral, grid_side: spectrum.grid_side },
            surface: lib::surface::Constants {
                brdf: knobs.index("brdf"),
                fresnel: knobs.index("fresnel"),
                clearcoat: plan.clearcoat,
                rough: with.rough,
                conductors: plan.conductors,
                lobes_seen: plan.lobes,
                mirror_rays: with.mirrors,
                roughest_mirror: plan.roughest_mirror,
            },
            trace: lib::trace::Constants {
                traversal: rays.constants.traversal,
                octants: rays.constants.octants,
                stack_size: rays.constants.stack_size,
            },
        }
    }
}

/// Halvings that single out one of `count`.
fn halvings(count: u32) -> u32 {
    count.next_power_of_two().trailing_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::KNOBS;

    /// A rung reaches the shaders as its place among its knob's: they give each place a name.
    #[test]
    fn rungs_have_the_places_that_shaders_name() {
        use lib::gbuffer::{NORMALS_F32, NORMALS_OCT16, NORMALS_OCT24, NORMALS_OCT32};
        use lib::medium::{QUADRATURE_LEFT, QUADRATURE_MIDPOINT, QUADRATURE_SIMPSON};
        use lib::shadow::{SHADOW_MAP, SHADOW_OFF, SHADOW_RAY};
        use lib::surface::{
            BRDF_BLINN_PHONG, BRDF_BLINN_PHONG_RECIPROCAL, BRDF_GGX, BRDF_GGX_MULTI, FRESNEL_EXACT, FRESNEL_SCHLICK,
        };
        for (knob, names) in [
            (
                "brdf",
                &[
                    ("blinn-phong", BRDF_BLINN_PHONG),
                    ("blinn-phong-reciprocal", BRDF_BLINN_PHONG_RECIPROCAL),
                    ("ggx", BRDF_GGX),
                    ("ggx-multi", BRDF_GGX_MULTI),
                ][..],
            ),
            ("fresnel", &[("schlick", FRESNEL_SCHLICK), ("exact", FRESNEL_EXACT)]),
            ("shadows", &[("off", SHADOW_OFF), ("map", SHADOW_MAP), ("ray", SHADOW_RAY)]),
            (
                "normals",
                &[("oct16", NORMALS_OCT16), ("oct24", NORMALS_OCT24), ("oct32", NORMALS_OCT32), ("f32", NORMALS_F32)],
            ),
            (
                "quadrature",
                &[("left", QUADRATURE_LEFT), ("midpoint", QUADRATURE_MIDPOINT), ("simpson", QUADRATURE_SIMPSON)],
            ),
        ] {
            let rungs = KNOBS.iter().find(|known| known.name == knob).expect("a knob").rungs;
            assert_eq!(rungs.len(), names.len(), "{knob}");
            for &(rung, place) in names {
                assert_eq!(rungs.get(place as usize), Some(&rung), "{knob}");
            }
        }
    }
}
