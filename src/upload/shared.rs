//! Shared state of all programs of a renderer: the scene's descriptor sets, and the specialization constants of
//! `shaders/lib/`. No other file fills them.
//!
//! Read shaders/README.md; the Vulkan specification, sections Descriptor Sets and Specialization Constants.

use std::sync::Arc;

use anyhow::Result;

use super::environment::EnvironmentOnDevice;
use super::rays::RaysOnDevice;
use super::scene::SceneOnDevice;
use crate::gpu::{BoundSet, Buffer, DescriptorSet, Device, Resource, Sampled};
use crate::plan::{Architecture, Attenuation, Knobs, March, Plan, Rays};
pub use crate::shader::Library;
use crate::shader::{PATHS, SCENE, lib};

/// Waiting branches of a ray tree beyond one for each surface of a path: a surface may send four rays.
const SPARE_BRANCHES: u32 = 4;

/// The device resources of a scene.
#[derive(Clone, Copy)]
pub struct OnDevice<'a> {
    /// The camera's uniform buffer.
    pub camera: &'a Buffer,
    /// Materials, lights, instances, textures.
    pub scene: &'a SceneOnDevice,
    /// The BVH and the tables of rays and paths.
    pub rays: &'a RaysOnDevice,
    /// Shadow maps.
    pub shadow_depth: Sampled<'a>,
    /// The environment map.
    pub environment: &'a EnvironmentOnDevice,
}

impl<'a> OnDevice<'a> {
    /// Entries of the descriptor set `scene`: slots and resources, by file of `shaders/lib/`.
    fn scene_entries(&self) -> Vec<(u32, Resource<'a>)> {
        let &Self { camera, scene, rays, shadow_depth, environment } = self;
        [
            lib::view::Scene { camera_block: camera }.entries(),
            lib::instances::Scene { instances: &scene.instances }.entries(),
            lib::material::Scene { material_texels: &scene.materials }.entries(),
            lib::light_table::Scene { lights: &scene.lights }.entries(),
            lib::spectrum::Scene { spectrum: &scene.spectrum.texels }.entries(),
            lib::sigma_grid::Scene { sigma_grids: &scene.grids.texels }.entries(),
            lib::hit::Scene { hit_corners: &rays.corners, texels: &scene.textures.texels }.entries(),
            lib::primary::Scene { leaf_places: &rays.leaf_places }.entries(),
            rays.trace().entries(),
            rays.work().entries(),
            lib::shadow::Scene { shadow_depth }.entries(),
            lib::environment::Scene {
                environment: &environment.terms,
                sky: environment.sky(),
                prefiltered: environment.prefiltered(),
            }
            .entries(),
            lib::ambient_occlusion::Scene { sky_directions: &environment.sky_directions }.entries(),
            lib::reflectance::Scene { reflectance: environment.reflectance() }.entries(),
        ]
        .concat()
    }

    /// Entries of the descriptor set `paths`: light sampling, path guiding, photons.
    fn path_entries(&self) -> Vec<(u32, Resource<'a>)> {
        let RaysOnDevice { emitters, guiding, photons, .. } = self.rays;
        [
            lib::light_sampling::Paths { environment_cdf: &emitters.sky }.entries(),
            lib::path_guiding::Paths { guiding_cells: &guiding.cells, guiding_spheres: &guiding.spheres }.entries(),
            lib::photon_map::Paths { photon_map: &photons.map }.entries(),
        ]
        .concat()
    }

    /// Writes the two descriptor sets.
    ///
    /// # Errors
    /// When memory is short.
    pub fn write(&self, device: &Arc<Device>) -> Result<[DescriptorSet; 2]> {
        Ok([
            DescriptorSet::new(device, &SCENE, &self.scene_entries())?,
            DescriptorSet::new(device, &PATHS, &self.path_entries())?,
        ])
    }

    /// The descriptor sets with their resources, for a frame.
    #[must_use]
    pub fn bind(&self, [scene, paths]: &'a [DescriptorSet; 2]) -> Vec<BoundSet<'a>> {
        vec![scene.bind(self.scene_entries()), paths.bind(self.path_entries())]
    }

    /// Specialization constants of `shaders/lib/`; `tile_words` is the number of words of a tile's light mask. A pass
    /// that needs other values changes its own copy and states why.
    #[must_use]
    pub fn library(&self, plan: &Plan, knobs: &Knobs, tile_words: u32) -> Library {
        let &Self { scene, rays, .. } = self;
        let with = plan.rays.unwrap_or_default();
        let paths = plan.paths.unwrap_or_default();
        let emitters = &rays.emitters;
        let spectrum = scene.colours();
        let shadow_rays = with.shadows;
        Library {
            arithmetic: lib::arithmetic::Constants { arithmetic: knobs.arithmetic as u32 },
            path_guiding: lib::path_guiding::Constants { path_guiding: paths.guided },
            boundary: lib::boundary::Constants { coincident_interfaces: rays.constants.touching },
            emitters: lib::emitters::Constants {
                emitters: emitters.count,
                emitter_search_steps: binary_search_steps(emitters.count),
                punctual_emitters: emitters.punctual,
                area_emitters: plan.light_samples.shaped && emitters.punctual,
                emissive_triangles: emitters.triangles,
                light_hierarchy: emitters.nodes.is_some(),
                light_nodes: emitters.nodes.unwrap_or(0),
                light_samples: plan.light_samples.count,
            },
            light_sampling: lib::light_sampling::Constants {
                sampled_environment: emitters.rows > 0,
                cdf_columns: emitters.columns,
                cdf_rows: emitters.rows,
                cdf_search_steps: binary_search_steps(emitters.columns.max(emitters.rows)),
            },
            ambient_occlusion: lib::ambient_occlusion::Constants {
                occlusion_rays: with.occlusion,
                sample_directions: plan.occlusion_directions().iter().sum(),
                first_direction: 0,
                pattern_side: plan.occlusion_pattern(),
                // Screen-space reflection takes away the whole lobe of the environment, so it has to be whole.
                lobe_rays: if plan.screen.mirrors { 0 } else { with.occlusion.div_ceil(4) },
            },
            environment_light: lib::environment_light::Constants { ambient: plan.ambient, reflection: plan.reflection },
            environment: lib::environment::Constants {
                sky: plan.sky,
                blurred_background: plan.blurred,
                environment: plan.environment,
            },
            fresnel: lib::fresnel::Constants { faint_conductors: plan.faint_conductors },
            gbuffer: lib::gbuffer::Constants {
                normal_error2: plan.stored.normals.error2(),
                positions: plan.stored.positions,
                stored_emissive: plan.emissive,
                stored_layers: plan.layers,
                stored_lobes: plan.lobe_texels,
                stored_triangles: shadow_rays || rays.inside(),
                stored_transmission: with.refraction,
            },
            gbuffer_interface: lib::gbuffer_interface::Constants::default(),
            hit: rays.constants.hit,
            own_tiles: lib::own_tiles::Constants::default(),
            normals: lib::normals::Constants { normals: plan.stored.normals as u32 },
            layers: lib::layers::Constants {
                transmissive: with.transmissive,
                rough_transmission: plan.rough_transmission,
            },
            lighting: lib::lighting::Constants {
                // With tiled light culling no pixel loops over all local lights.
                local_lights: if plan.tiles { 0 } else { plan.local_lights },
                tile_words,
                light_budget: u32::MAX,
                light_candidates: plan.light_samples.candidates.max(1),
                screen_mirrors: false,
                sampled_apart: false,
                lit_at_hits: false,
                environment_apart: false,
                sky_rays: 0,
            },
            loops: lib::loops::Constants {
                loop_budget: match scene.device().limits_loops() {
                    true => lib::loops::Constants::default().loop_budget,
                    false => u32::MAX,
                },
                finds_anew: plan.architecture == Architecture::Gpu,
            },
            path: lib::path::Constants { emissive_lights: plan.light_samples.emitting },
            photon_map: lib::photon_map::Constants { photon_map: paths.photons > 0 },
            path_state: lib::path_state::Constants {
                keeps_media: with.transmissive,
                keeps_t_min: rays.constants.touching,
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
                absorption: match with.attenuation {
                    Attenuation::Off => lib::shadow::ABSORPTION_OFF,
                    Attenuation::Nominal => lib::shadow::ABSORPTION_NOMINAL,
                    Attenuation::Path => lib::shadow::ABSORPTION_PATH,
                },
            },
            sigma_grid: match with.march {
                March { steps: 0, .. } => lib::sigma_grid::Constants::default(),
                March { steps, rule, colours } => {
                    lib::sigma_grid::Constants { march_steps: steps, quadrature: rule as u32, march_colours: colours }
                }
            },
            ray_tree: lib::ray_tree::Constants {
                masked_hits: with.masked,
                pending: pending_branches(with),
                first_event: 0,
            },
            spectrum: lib::spectrum::Constants { spectral: spectrum.spectral, grid_side: spectrum.grid_side },
            surface: lib::surface::Constants {
                brdf: knobs.brdf as u32,
                fresnel: knobs.fresnel as u32,
                clearcoat: plan.clearcoat,
                rough: with.rough,
                conductors: plan.conductors,
                lobes_seen: plan.lobes,
                specular_colors: plan.lobe_texels,
                mirror_rays: with.mirrors,
                roughest_mirror: plan.roughest_mirror,
            },
            trace: lib::trace::Constants { traversal: rays.constants.traversal, octants: rays.constants.octants },
        }
    }
}

/// Largest number of waiting branches of a ray tree. Rays without a free place are counted as truncated.
#[must_use]
pub fn pending_branches(rays: Rays) -> u32 {
    rays.interfaces + SPARE_BRANCHES
}

/// Steps of a binary search among `count` entries.
fn binary_search_steps(count: u32) -> u32 {
    count.next_power_of_two().trailing_zeros()
}

/// The shaders receive a rung as its index in its knob; these assertions tie the indices to the shaders' names.
const _: () = {
    use crate::plan::rungs::{Brdf, Fresnel, Normals, Quadrature};
    assert!(Brdf::BlinnPhong as u32 == lib::surface::BRDF_BLINN_PHONG);
    assert!(Brdf::BlinnPhongReciprocal as u32 == lib::surface::BRDF_BLINN_PHONG_RECIPROCAL);
    assert!(Brdf::Ggx as u32 == lib::surface::BRDF_GGX && Brdf::GgxMulti as u32 == lib::surface::BRDF_GGX_MULTI);
    assert!(Fresnel::Schlick as u32 == lib::surface::FRESNEL_SCHLICK);
    assert!(Fresnel::Exact as u32 == lib::surface::FRESNEL_EXACT);
    assert!(
        Normals::Oct16 as u32 == lib::normals::NORMALS_OCT16 && Normals::Oct24 as u32 == lib::normals::NORMALS_OCT24
    );
    assert!(Normals::Oct32 as u32 == lib::normals::NORMALS_OCT32 && Normals::F32 as u32 == lib::normals::NORMALS_F32);
    assert!(Quadrature::Left as u32 == lib::medium::QUADRATURE_LEFT);
    assert!(Quadrature::Midpoint as u32 == lib::medium::QUADRATURE_MIDPOINT);
    assert!(Quadrature::Simpson as u32 == lib::medium::QUADRATURE_SIMPSON);
};
