//! Shadow maps: depth maps from the lights, drawn once per scene (shaders/pass/shadow_map.*, lib/shadow.glsl).
//!
//! Read Williams 1978, "Casting Curved Shadows on Curved Surfaces"; Real-Time Rendering (4th ed.), section 7.4 (shadow
//! maps, shadow bias, slope offset). Neither lights nor geometry depend on the eye, so the maps are in bvh space and
//! serve all cameras. All maps are squares in one image, an atlas: the layers of an array would need one size.
//! docs/decisions/shadow-maps.md explains sizes and bias.

use std::f64::consts::FRAC_PI_3;
use std::sync::Arc;

use anyhow::{Result, bail};
use ash::vk;
use glam::{DVec3, DVec4};

use crate::gpu::{
    Buffer, DepthTarget, DescriptorSet, Device, Frame, Image, ImageDesc, PassTime, Raster, Sampled, SamplerDesc,
};
use crate::plan::Plan;
use crate::scene::{Bounds, Light, LightKind};
use crate::shader::lib::light_table::{LIGHT_TEXELS, SHADOW_MAP_TEXELS};
use crate::shader::{SCENE, lib, shadow_map};
use crate::upload::scene::{LightMaps, SceneOnDevice};

/// Largest side of the atlas in texels: every device allows it, and it is 64 MiB of depth.
const ATLAS: u32 = 4096;
/// Largest side of a light's single map, in texels.
const FLAT: u32 = 2048;
/// Largest side of each of the six maps of a cube, in texels; four of them go around the horizon.
const CUBE: u32 = FLAT / 2;
/// Smallest side of a cube's map. A texel is then 1.4° wide; coarser maps would show blotches.
const SMALLEST_CUBE: u32 = 64;
/// Border around the visible region, in texels, for the filter: 2x2 texels around a point, and one for rounding.
const BORDER: f64 = 2.0;
/// Largest half angle for a single map, of a spot light's cone or of the scene seen from outside. A plane is stretched
/// by the squared tangent towards its edge, so wider lights get a cube of six maps.
const WIDEST_CONE: f64 = FRAC_PI_3;
/// Distance of a light, in radii of the scene, from which on its depth range encloses the scene: depths relative to a
/// large distance would lose precision.
const FAR: f64 = 4.0;
/// Texels per map in the light table.
const FACE_TEXELS: usize = SHADOW_MAP_TEXELS as usize;

/// The atlas of shadow maps; a dummy where the plan has none.
pub struct ShadowMaps {
    depth: Image,
    /// GPU times of the passes that drew the maps.
    pub times: Vec<PassTime>,
}

/// One map: rows of the matrix clip_from_scene, where `scene` is bvh space.
#[derive(Debug, Clone, Copy)]
struct Face {
    clip: [DVec4; 4],
    /// First texel in x and y, and side in texels.
    square: [u32; 3],
}

impl ShadowMaps {
    /// Draws the shadow maps of all lights.
    ///
    /// # Errors
    /// When there are too many lights, or memory is short.
    pub fn new(
        device: &Arc<Device>,
        plan: &Plan,
        name: &str,
        scene: &mut SceneOnDevice,
        anchor: DVec3,
    ) -> Result<Self> {
        let usage = vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | vk::ImageUsageFlags::SAMPLED;
        let image = |width, height| {
            Image::new(device, "shadow maps", ImageDesc::flat(vk::Format::D32_SFLOAT, width, height, usage))
        };
        let bounds = scene.bounds.filter(|_| plan.shadow_maps);
        let Some(bounds) = bounds else {
            let depth = Image::nothing(device, vk::Format::D32_SFLOAT, usage)?;
            return Ok(Self { depth, times: Vec::new() });
        };
        // Those after them are sampled, with shadow rays.
        let from_points = (plan.directional_lights + plan.local_lights) as usize;
        let all = scene.lights_in_order();
        let lights = &all[..from_points];
        let cubes = lights.iter().filter(|light| cone(light, bounds).is_none()).count();
        let Some([flat, cube]) = sides(lights.len() - cubes, cubes) else {
            bail!(
                "{name}: {} lights need {} shadow maps, more than {ATLAS}x{ATLAS} texels hold: choose shadows=ray or \
                 shadows=off",
                lights.len(),
                lights.len() + 5 * cubes
            );
        };
        let mut faces: Vec<Face> = Vec::new();
        let mut first = vec![0; lights.len()];
        let mut infinite = vec![false; lights.len()];
        // Large squares first: along the Morton curve each following square then starts at a multiple of its own size.
        let mut next = 0;
        for large in [true, false] {
            for (index, light) in lights.iter().enumerate().filter(|(_, light)| cone(light, bounds).is_some() == large)
            {
                first[index] = faces.len();
                let side = if large { flat } else { cube };
                infinite[index] = has_infinite_far(light, bounds, anchor);
                for clip in clip_rows(light, side, bounds, anchor) {
                    let [x, y] = along_curve(next);
                    faces.push(Face { clip, square: [x, y, side] });
                    next += (side / SMALLEST_CUBE) * (side / SMALLEST_CUBE);
                }
            }
        }
        let maps_at = all.len() * LIGHT_TEXELS as usize;
        let of_light = |(light, (first, infinite_far)): (&Light, (usize, bool))| LightMaps {
            first: maps_at + first * FACE_TEXELS,
            count: if cone(light, bounds).is_some() { 1 } else { 6 },
            infinite_far,
        };
        let mut of_lights: Vec<LightMaps> = lights.iter().zip(first.into_iter().zip(infinite)).map(of_light).collect();
        of_lights.resize(all.len(), LightMaps::default());
        let table: Vec<[f32; 4]> = faces.iter().flat_map(Face::texels).collect();
        let extent = |axis: usize| faces.iter().map(|f| f.square[axis] + f.square[2]).max().unwrap_or(1);
        let depth = image(extent(0), extent(1))?;
        let times = draw(device, scene, anchor, &faces, &depth)?;
        scene.keep_shadow_maps(of_lights, &table);
        Ok(Self { depth, times })
    }

    /// The atlas: reversed depth, 0 where nothing was drawn.
    #[must_use]
    pub fn depth(&self) -> Sampled<'_> {
        Sampled { image: &self.depth, sampler: SamplerDesc::NEAREST }
    }
}

impl Face {
    /// The light table's texels of the map: its square, and the matrix rows to (x, y, depth, 1) times w, in texels of
    /// the atlas.
    fn texels(&self) -> [[f32; 4]; FACE_TEXELS] {
        let [x, y, side] = self.square.map(f64::from);
        let [cx, cy, cz, cw] = self.clip;
        let across = cx * (0.5 * side) + cw * (x + 0.5 * side);
        let down = cy * (0.5 * side) + cw * (y + 0.5 * side);
        let row = |v: DVec4| v.as_vec4().to_array();
        [[x as f32, y as f32, side as f32, 0.0], row(across), row(down), row(cz), row(cw)]
    }

    /// Whether a box (centre, half extent) may intersect the map's frustum: it is not entirely outside of one plane. A
    /// NaN counts as visible.
    fn sees(&self, middle: DVec3, half: DVec3) -> bool {
        let [x, y, z, w] = self.clip;
        ![w + x, w - x, w + y, w - y, w - z].iter().any(|plane| {
            let (n, d) = (plane.truncate(), plane.w);
            n.dot(middle) + d < -n.abs().dot(half)
        })
    }

    fn clip_from_scene(&self) -> [[f32; 4]; 4] {
        [0, 1, 2, 3].map(|column| self.clip.map(|row| row[column] as f32))
    }
}

/// Draws all shadow casters into all maps.
fn draw(
    device: &Arc<Device>,
    scene: &SceneOnDevice,
    anchor: DVec3,
    faces: &[Face],
    depth: &Image,
) -> Result<Vec<PassTime>> {
    let instances = Buffer::with_data(device, "instances around the scene", &scene.instances_around(anchor))?;
    let materials = || lib::material::Scene { material_texels: &scene.materials }.entries();
    let set = DescriptorSet::new(device, &SCENE, &materials())?;
    let mut frame = Frame::of(device, vec![set.bind(materials())]);
    let bind = shadow_map::Bind { casters: &instances };
    for face in faces {
        let [x, y, side] = face.square;
        let raster = Raster {
            name: "shadow maps",
            colors: Vec::new(),
            depth: Some(DepthTarget { image: depth, clear: true, write: true }),
            origin: [x, y],
            size: [side; 2],
            rows: [0, side],
        };
        let push = shadow_map::Push { clip_from_scene: face.clip_from_scene() };
        let casters = scene.casters(|middle, half| face.sees(middle - anchor, half));
        frame.raster(&raster, &bind, &scene.pages(), &push, casters)?;
    }
    frame.finish()
}

/// Axis and half angle of the cone of a light's single map: the narrower of the light's own cone and the one around the
/// scene. `None` when it is too wide for one map. The angle of a directional light is 0.
fn cone(light: &Light, bounds: Bounds) -> Option<(DVec3, f64)> {
    let around = |position: DVec3| {
        let to_middle = bounds.center() - position;
        let sine = bounds.radius() / to_middle.length();
        if sine < 1.0 { (to_middle.normalize(), sine.asin()) } else { (DVec3::Z, std::f64::consts::PI) }
    };
    let (axis, half) = match light.kind {
        LightKind::Directional { direction } => (direction, 0.0),
        LightKind::Point { position, .. } => around(position),
        LightKind::Spot { position, direction, outer, .. } => {
            let around = around(position);
            if around.1 < outer { around } else { (direction, outer) }
        }
    };
    (half <= WIDEST_CONE).then_some((axis, half))
}

/// Whether depth is near/z with an infinite far plane; otherwise the planes enclose the scene.
fn has_infinite_far(light: &Light, bounds: Bounds, anchor: DVec3) -> bool {
    match light.kind {
        LightKind::Directional { .. } => false,
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => {
            cone(light, bounds).is_none_or(|(axis, _)| (anchor - position).dot(axis) < FAR * bounds.radius())
        }
    }
}

/// Sides of single maps and of cube maps in texels, as large as fit the atlas together.
fn sides(flats: usize, cubes: usize) -> Option<[u32; 2]> {
    let fits = |&[flat, cube]: &[u32; 2]| {
        let area = |side: u32, count: usize| u64::from(side) * u64::from(side) * count as u64;
        area(flat, flats) + area(cube, 6 * cubes) <= u64::from(ATLAS) * u64::from(ATLAS)
    };
    (0..).map(|halved| [FLAT >> halved, CUBE >> halved]).take_while(|&[_, cube]| cube >= SMALLEST_CUBE).find(fits)
}

/// Position of smallest square number `index` along the Morton curve, which fills squares one after the other.
fn along_curve(index: u32) -> [u32; 2] {
    let every_second = |bits: u32| (0..16).fold(0, |sum, i| sum | (bits >> (2 * i) & 1) << i);
    [every_second(index) * SMALLEST_CUBE, every_second(index >> 1) * SMALLEST_CUBE]
}

/// Rows of clip_from_scene for each map of a light, of `side` texels.
fn clip_rows(light: &Light, side: u32, bounds: Bounds, anchor: DVec3) -> Vec<[DVec4; 4]> {
    let widen = f64::from(side) / (f64::from(side) - 2.0 * BORDER);
    let radius = bounds.radius().max(f64::MIN_POSITIVE);
    let from = |position: DVec3, forward: DVec3, right: DVec3, tan: f64| {
        let eye = position - anchor;
        let outside = (position - position.clamp(bounds.min, bounds.max)).length();
        // A corner's ray is this much longer than its depth.
        let slant = (1.0 + 2.0 * tan * tan).sqrt();
        // Reversed floating-point depth has the same relative precision for every near distance (numerics.md 42).
        let near = (0.5 * outside).max(1e-5 * radius) / slant;
        let row = |axis: DVec3, scale: f64| (axis * scale).extend(-axis.dot(eye) * scale);
        let down = forward.cross(right);
        let depth = if has_infinite_far(light, bounds, anchor) {
            DVec4::W * near
        } else {
            // Over z: 1 at the near end of the sphere around the scene, 0 at the far end.
            let reach = radius * (1.0 + 2.0_f64.powi(-8));
            (-forward).extend(reach) * ((-forward.dot(eye) - reach) / (2.0 * reach))
        };
        [row(right, 1.0 / tan), row(down, 1.0 / tan), depth, row(forward, 1.0)]
    };
    let cube = |position: DVec3| {
        // The order of `cube_face` in shaders/lib/shadow.glsl: +x, −x, +y, −y, +z, −z.
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        (0..6).map(|i| from(position, axes[i / 2] * [1.0, -1.0][i % 2], axes[(i / 2 + 1) % 3], widen)).collect()
    };
    match light.kind {
        LightKind::Directional { direction } => {
            let right = direction.any_orthonormal_vector();
            let down = direction.cross(right);
            // The box around the scene in the light's axes. Its centre is the anchor, except for scenes with vertices
            // that are not finite.
            let (middle, half) = (bounds.center() - anchor, (bounds.max - bounds.min) * 0.5);
            let reach = |axis: DVec3| axis.abs().dot(half).max(1e-6 * radius);
            let row = |axis: DVec3, scale: f64| (axis * scale).extend(-axis.dot(middle) * scale);
            // Depth is 1 − a where the scene begins and a where it ends, so rounding neither clips nor zeroes it.
            let depth = row(-direction, 0.5 * (1.0 - 2.0_f64.powi(-16)) / reach(direction)) + DVec4::W * 0.5;
            vec![[row(right, 1.0 / (widen * reach(right))), row(down, 1.0 / (widen * reach(down))), depth, DVec4::W]]
        }
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => match cone(light, bounds) {
            Some((axis, half)) => vec![from(position, axis, axis.any_orthonormal_vector(), half.tan() * widen)],
            None => cube(position),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_do_not_overlap_and_fit() {
        for (flats, cubes) in [(1, 0), (4, 0), (5, 0), (2, 1), (0, 1), (3, 7), (0, 682), (1024, 0), (100, 300)] {
            let [flat, cube] = sides(flats, cubes).expect("room");
            let mut taken = vec![false; ((ATLAS / SMALLEST_CUBE) * (ATLAS / SMALLEST_CUBE)) as usize];
            let mut next = 0;
            for side in std::iter::repeat_n(flat, flats).chain(std::iter::repeat_n(cube, 6 * cubes)) {
                let [x, y] = along_curve(next);
                let cells = side / SMALLEST_CUBE;
                next += cells * cells;
                assert!(x % side == 0 && y % side == 0 && x + side <= ATLAS && y + side <= ATLAS, "{x} {y} {side}");
                for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
                    let cell = (y / SMALLEST_CUBE + j) * (ATLAS / SMALLEST_CUBE) + x / SMALLEST_CUBE + i;
                    assert!(!std::mem::replace(&mut taken[cell as usize], true), "{flats} {cubes}: {x} {y}");
                }
            }
        }
        assert_eq!(sides(1, 0), Some([FLAT, CUBE]));
        assert_eq!(sides(0, 683), None);
        assert_eq!(sides(1025, 0), None);
    }
}
