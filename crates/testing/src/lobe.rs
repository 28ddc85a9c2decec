//! Reference BRDF of a surface in f64, from the formulas: GGX, the Blinn-Phong lobes of the lecture (B5, B6), clear
//! coat, Fresnel equations with complex numbers. A convex dome of flat facets displays it; the facets neither shadow
//! nor light each other.
//!
//! Read glTF 2.0 appendix B; Walter et al. 2007 and Heitz 2014 (GGX); KHR_materials_clearcoat.

use std::f64::consts::{PI, TAU};

use etalon::frame::Settings;
use etalon::image::Picture;
use etalon::plan::rungs::Brdf;
use etalon::plan::{Knobs, Model};
use etalon::scene::{Camera, Instance, Material, Mesh, Projection, Scene};
use glam::{DAffine3, DVec2, DVec3};

/// All models of light transport.
pub const MODELS: [Model; 3] = [Model::Local, Model::Recursive, Model::Global];

/// Settings of a model with one sample per pixel and exact normals; `choices` sets further rungs. The local model
/// has no shadows: tests/shadow_map.rs covers the errors of shadow maps.
pub fn model(model: Model, size: [u32; 2], choices: &[&str]) -> Settings {
    let mut knobs = Knobs::of(model);
    let all = ["samples=1", "normals=f32"].iter().chain(choices);
    let mut all: Vec<String> = all.map(|&choice| choice.to_owned()).collect();
    if model == Model::Local {
        all.push("shadows=off".to_owned());
    }
    knobs.set_all(&all).expect("rungs");
    Settings { size, knobs, ..Settings::default() }
}

/// A complex number.
type Complex = [f64; 2];

fn over(a: Complex, b: Complex) -> Complex {
    let size = b[0] * b[0] + b[1] * b[1];
    [(a[0] * b[0] + a[1] * b[1]) / size, (a[1] * b[0] - a[0] * b[1]) / size]
}

fn times(a: Complex, b: Complex) -> Complex {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// Unpolarised reflectance for the complex index n + iκ: the mean of |r_s|² and |r_p|² of the Fresnel equations.
pub fn fresnel(cos_in: f64, n: f64, kappa: f64) -> f64 {
    let m = [n, kappa];
    let [re, im] = over([1.0 - cos_in * cos_in, 0.0], times(m, m));
    // cosθ_t = √(1 − sin²θ/m²), the root with non-negative real part.
    let (re, im) = (1.0 - re, -im);
    let size = re.hypot(im);
    let cos_t = [((size + re) / 2.0).max(0.0).sqrt(), ((size - re) / 2.0).max(0.0).sqrt().copysign(im)];
    let across = times(m, cos_t);
    let s = over([cos_in - across[0], -across[1]], [cos_in + across[0], across[1]]);
    let along = times(m, [cos_in, 0.0]);
    let p = over([along[0] - cos_t[0], along[1] - cos_t[1]], [along[0] + cos_t[0], along[1] + cos_t[1]]);
    (s[0] * s[0] + s[1] * s[1] + p[0] * p[0] + p[1] * p[1]) / 2.0
}

/// Schlick's approximation.
pub fn schlick(f0: DVec3, f90: f64, cos: f64) -> DVec3 {
    f0 + (DVec3::splat(f90) - f0) * (1.0 - cos).max(0.0).powi(5)
}

/// Reflectance of the dielectric part; `cos` is V·H.
pub fn dielectric(m: &Material, exact: bool, cos: f64) -> DVec3 {
    let r0 = ((f64::from(m.ior) - 1.0) / (f64::from(m.ior) + 1.0)).powi(2);
    let specular = f64::from(m.specular);
    let f0 = (rgb(m.specular_color) * r0).min(DVec3::ONE) * specular;
    if exact {
        // Untinted, it is the exact Fresnel reflectance; tinted, the exact curve interpolates between F0 and F90.
        let share = (fresnel(cos, f64::from(m.ior), 0.0) - r0) / (1.0 - r0);
        return f0 + (DVec3::splat(specular) - f0) * share;
    }
    schlick(f0, specular, cos)
}

/// Reflectance of the metallic part; `cos` is V·H.
pub fn metal(m: &Material, exact: bool, cos: f64) -> DVec3 {
    match m.conductor {
        Some(index) if exact => DVec3::from(index.map(|[n, kappa]| fresnel(cos, f64::from(n), f64::from(kappa)))),
        _ => schlick(base(m), 1.0, cos),
    }
}

/// A colour as f64.
pub fn rgb(color: [f32; 3]) -> DVec3 {
    DVec3::from(color.map(f64::from))
}

/// The base colour of a material.
pub fn base(m: &Material) -> DVec3 {
    DVec3::new(m.base_color[0].into(), m.base_color[1].into(), m.base_color[2].into())
}

/// α of a roughness, which is clamped to at least 0.01 as in the shaders.
pub fn alpha(roughness: f32) -> f64 {
    f64::from(roughness).max(0.01).powi(2)
}

/// D G₂ / (4 cosθ_l cosθ_v): a GGX lobe without its Fresnel term.
pub fn ggx(n: DVec3, l: DVec3, v: DVec3, alpha: f64) -> f64 {
    let (cos_l, cos_v, cos_h) = (n.dot(l), n.dot(v), n.dot((l + v).normalize()));
    if cos_l <= 0.0 || cos_v <= 0.0 {
        return 0.0;
    }
    let a2 = alpha * alpha;
    let d = a2 / (PI * (cos_h * cos_h * (a2 - 1.0) + 1.0).powi(2));
    let lambda = |cos: f64| ((1.0 + a2 * (1.0 / (cos * cos) - 1.0)).sqrt() - 1.0) / 2.0;
    d / (1.0 + lambda(cos_l) + lambda(cos_v)) / (4.0 * cos_l * cos_v)
}

/// Directional albedo of a GGX lobe with F = 1, and with F = (1 − V·H)⁵ (midpoint rule in cosθ and φ).
pub fn reflectances(cos_v: f64, alpha: f64) -> [f64; 2] {
    const CELLS: i32 = 240;
    let v = DVec3::new((1.0 - cos_v * cos_v).sqrt(), 0.0, cos_v);
    let mut sum = [0.0; 2];
    for i in 0..CELLS {
        for j in 0..CELLS {
            let (z, phi) = ((f64::from(i) + 0.5) / f64::from(CELLS), PI * (f64::from(j) + 0.5) / f64::from(CELLS));
            let across = (1.0 - z * z).sqrt();
            let l = DVec3::new(across * phi.cos(), across * phi.sin(), z);
            let lobe = ggx(DVec3::Z, l, v, alpha) * z;
            sum[0] += lobe;
            sum[1] += lobe * (1.0 - v.dot((l + v).normalize())).powi(5);
        }
    }
    // By symmetry, half of the directions around the normal suffice.
    sum.map(|sum| sum * TAU / f64::from(CELLS * CELLS))
}

/// Rungs that choose formulas.
#[derive(Debug, Clone, Copy)]
pub struct Rungs {
    /// The specular lobe.
    pub brdf: Brdf,
    /// Exact Fresnel equations instead of Schlick's approximation.
    pub exact: bool,
}

/// BRDF times cosθ_l of an opaque rough surface.
pub fn reflected(m: &Material, rungs: Rungs, n: DVec3, l: DVec3, v: DVec3) -> DVec3 {
    let (cos_l, h) = (n.dot(l), (l + v).normalize());
    let metallic = f64::from(m.metallic);
    let diffuse = base(m) * (1.0 - metallic) / PI;
    let a = alpha(m.roughness);
    let mut result = DVec3::ZERO;
    if cos_l > 0.0 {
        let f_dielectric = dielectric(m, rungs.exact, h.dot(v));
        let f = f_dielectric.lerp(metal(m, rungs.exact, h.dot(v)), metallic);
        let f0 = dielectric(m, false, 1.0).lerp(base(m), metallic);
        // α² = 2/(shine + 2); k_s gives the reflectance F0 at normal incidence.
        let shine = 2.0 / (a * a) - 2.0;
        let k_s = f0 * (shine + 2.0) / TAU;
        let power = n.dot(h).max(0.0).powf(shine);
        result = match rungs.brdf {
            // B5 has no cosine factor in the lobe; the quarter is 1/|L + V|² of B6 at normal incidence.
            Brdf::BlinnPhong => diffuse * cos_l + k_s * power / 4.0,
            // The bound of B6, k_d π + k_s 2π/(shine + 2) ≤ 1: the diffuse base gets the energy left by F0.
            Brdf::BlinnPhongReciprocal => {
                let ground = diffuse * (1.0 - dielectric(m, false, 1.0).max_element());
                (ground + k_s * power / (l + v).length_squared()) * cos_l
            }
            Brdf::Ggx => (diffuse * (1.0 - f_dielectric.max_element()) + f * ggx(n, l, v, a)) * cos_l,
            Brdf::GgxMulti => {
                let [whole, grazing] = reflectances(n.dot(v), a);
                let compensation = DVec3::ONE + f0 * (1.0 / whole - 1.0);
                // The diffuse base gets the energy left under the specular layer.
                let f0 = dielectric(m, false, 1.0);
                let reflects = f0 * (whole - grazing) + DVec3::splat(f64::from(m.specular) * grazing);
                let kept = (reflects * compensation).max_element();
                (diffuse * (1.0 - kept) + f * compensation * ggx(n, l, v, a)) * cos_l
            }
        };
    }
    let coat = f64::from(m.clearcoat) * schlick(DVec3::splat(0.04), 1.0, h.dot(v)).x;
    result * (1.0 - coat) + DVec3::splat(coat * ggx(n, l, v, alpha(m.clearcoat_roughness)) * cos_l.max(0.0))
}

/// A flat facet of the dome, and the pixels that see only this facet.
#[derive(Clone)]
pub struct Facet {
    /// Normal.
    pub n: DVec3,
    /// Index of the material.
    pub material: usize,
    /// Indices of pixels inside the facet.
    pub pixels: Vec<usize>,
}

/// Angles in degrees between the facets' normals and the axis, towards the viewer.
pub const TILTS: [f64; 6] = [0.0, 18.0, 36.0, 52.0, 66.0, 78.0];
const SECTORS: usize = 24;
/// Radius of the flat top, and width of each ring around it, seen from the front.
const TOP: f64 = 4.0;
const RING: f64 = 2.0;
const HALF: f64 = TOP + 5.0 * RING + 0.5;
/// Size of a picture of the dome in pixels.
pub const DOME: [u32; 2] = [80, 80];

fn facet_at(p: DVec2) -> Option<(usize, usize)> {
    let sector = (p.y.atan2(p.x) / TAU * SECTORS as f64).round().rem_euclid(SECTORS as f64);
    let (sin, cos) = (sector / SECTORS as f64 * TAU).sin_cos();
    let along = p.x * cos + p.y * sin;
    let ring = ((along - TOP) / RING).floor() + 1.0;
    (ring < TILTS.len() as f64).then_some((ring.max(0.0) as usize, sector as usize))
}

/// A dome around the z axis in an orthographic view along the axis; the materials repeat over its sectors.
pub fn dome(materials: &[Material]) -> (Scene, Vec<Facet>) {
    assert!(SECTORS.is_multiple_of(materials.len()));
    let mut scene = Scene { name: "dome".to_owned(), materials: materials.to_vec(), ..Scene::default() };
    let (mut radii, mut heights) = (vec![0.0, TOP], vec![0.0, 0.0]);
    for (i, tilt) in TILTS.iter().enumerate().skip(1) {
        radii.push(TOP + RING * i as f64);
        heights.push(heights[i] - RING * tilt.to_radians().tan());
    }
    let mut facets = Vec::new();
    for (ring, tilt) in TILTS.iter().enumerate() {
        for sector in 0..SECTORS {
            let at = |edge: f64, level: usize| {
                let (sin, cos) = ((sector as f64 + edge) / SECTORS as f64 * TAU).sin_cos();
                // Corners are farther out than the middle of an edge.
                let out = radii[level] / (PI / SECTORS as f64).cos();
                DVec3::new(out * cos, out * sin, heights[level])
            };
            let corners = [at(-0.5, ring), at(-0.5, ring + 1), at(0.5, ring + 1), at(0.5, ring)];
            let ((sin, cos), (sin_z, cos_z)) =
                ((sector as f64 / SECTORS as f64 * TAU).sin_cos(), tilt.to_radians().sin_cos());
            let n = DVec3::new(sin_z * cos, sin_z * sin, cos_z);
            let material = sector % materials.len();
            scene.meshes.push(Mesh {
                name: format!("facet {ring} {sector}"),
                positions: corners.map(|p| p.as_vec3().to_array()).to_vec().into(),
                normals: vec![n.as_vec3().to_array(); 4].into(),
                // The two inner corners of a top facet coincide.
                indices: if ring == 0 { vec![0, 1, 2].into() } else { vec![0, 1, 2, 0, 2, 3].into() },
                material,
                ..Mesh::default()
            });
            let name = "facet".to_owned();
            scene.instances.push(Instance {
                name,
                mesh: scene.meshes.len() - 1,
                world_from_object: DAffine3::IDENTITY,
            });
            facets.push(Facet { n, material, pixels: Vec::new() });
        }
    }
    let depth = 12.0 - heights.last().copied().unwrap_or_default();
    scene.cameras.push(Camera {
        projection: Projection::Orthographic { half_height: HALF, near: 0.5, far: depth },
        ..Camera::looking_at(DVec3::Z * 10.0, DVec3::ZERO, DVec3::Y, 0.7).expect("a camera")
    });
    let [width, height] = DOME;
    for i in 0..width * height {
        let at = |dx: f64, dy: f64| {
            let (x, y) = (f64::from(i % width) + dx, f64::from(i / width) + dy);
            let across = HALF * f64::from(width) / f64::from(height);
            facet_at(DVec2::new(
                (2.0 * x / f64::from(width) - 1.0) * across,
                (1.0 - 2.0 * y / f64::from(height)) * HALF,
            ))
        };
        let middle = at(0.5, 0.5);
        let whole = [(-0.1, -0.1), (1.1, -0.1), (-0.1, 1.1), (1.1, 1.1)].into_iter().all(|(x, y)| at(x, y) == middle);
        if let (Some((ring, sector)), true) = (middle, whole) {
            facets[ring * SECTORS + sector].pixels.push(i as usize);
        }
    }
    assert!(facets.iter().all(|facet| !facet.pixels.is_empty()), "each facet has a pixel of its own");
    (scene, facets)
}

/// Largest error of a picture of the dome, relative to the expected value of each channel, or to `floor` times the
/// brightest value of the material if that is larger.
pub fn worst(film: &Picture, facets: &[Facet], floor: f64, expected: impl Fn(&Facet) -> DVec3) -> f64 {
    let wants: Vec<DVec3> = facets.iter().map(&expected).collect();
    let mut most = (0.0, String::new());
    for (facet, want) in facets.iter().zip(&wants) {
        let same = facets.iter().zip(&wants).filter(|(other, _)| other.material == facet.material);
        let brightest = same.fold(0.0_f64, |most, (_, want)| most.max(want.max_element()));
        for &pixel in &facet.pixels {
            for c in 0..3 {
                let got = f64::from(film.rgba[pixel][c]);
                // With shadows, fainter lobes are skipped (shaders/lib/lighting.glsl).
                if got == 0.0 && want[c] < 5.0 / 131_072.0 {
                    continue;
                }
                let error = (got - want[c]).abs() / want[c].max(floor * brightest).max(1e-30);
                if error.is_nan() || error > most.0 {
                    let tilt = facet.n.z.acos().to_degrees();
                    let got = film.rgba[pixel];
                    most = (error, format!("material {}, tilted {tilt:.0}°: {got:?} for {want}", facet.material));
                }
            }
        }
    }
    eprintln!("worst {:.2e}: {}", most.0, most.1);
    most.0
}
