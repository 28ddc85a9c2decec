//! Rays per second of the traversal, beside Embree's rtcIntersect1 and rtcOccluded1 on as many threads in the same run,
//! where Debian's libembree-dev and a C++ compiler are there. By the CPU time of the process over the number of
//! threads: what other work on the machine does to wall time does not count. On a GPU by its own time.
//!
//! `./x bench --bench rays [-- FILE.glb ...]`; without files two generated scenes of 70 thousand and a million
//! triangles.
#![allow(missing_docs, clippy::print_stdout, reason = "a program whose figures go to standard output")]

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use etalon::gpu::{Device, DeviceChoice};
use etalon::pass::trace_rays::{Hit, Mode, Ray, Tracer};
use etalon::scene::{Camera, Instance, LoadOptions, Material, Mesh, Scene};
use etalon::transport::bvh::Bvh;
use etalon::upload::rays::Traversal;
use glam::{DAffine3, DVec3, Vec3};

const SIZE: [u32; 2] = [1024, 576];
const ROUNDS: usize = 4;
const REPEATS: u32 = 5;

/// A torus knot with bumps over a wavy floor, about `triangles` of them.
fn generated(triangles: u32) -> Scene {
    let mut mesh = Mesh { name: "knot".to_owned(), ..Mesh::default() };
    let mut grid = |across: u32, down: u32, point: &dyn Fn(f64, f64) -> DVec3| {
        let first = mesh.positions.len() as u32;
        for y in 0..=down {
            for x in 0..=across {
                let p = point(f64::from(x) / f64::from(across), f64::from(y) / f64::from(down));
                mesh.positions.push(p.as_vec3().to_array());
                mesh.normals.push([0.0, 1.0, 0.0]);
            }
        }
        for y in 0..down {
            for x in 0..across {
                let a = first + y * (across + 1) + x;
                mesh.indices.extend([a, a + across + 1, a + across + 2, a, a + across + 2, a + 1]);
            }
        }
    };
    let knot = |u: f64| {
        let (a, b) = (2.0 * TAU * u, 3.0 * TAU * u);
        DVec3::new(a.cos() * (2.0 + b.cos()), 1.6 + b.sin(), a.sin() * (2.0 + b.cos())) * 0.5
    };
    let side = (f64::from(triangles) / 4.0).sqrt();
    grid((side * 4.0) as u32, (side * 0.25) as u32, &|u, v| {
        let forward = (knot(u + 1e-4) - knot(u - 1e-4)).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let up = right.cross(forward);
        let bump = 0.22 + 0.02 * (40.0 * TAU * u).sin() * (6.0 * TAU * v).sin();
        knot(u) + (right * (TAU * v).cos() + up * (TAU * v).sin()) * bump
    });
    grid(side as u32, side as u32, &|u, v| {
        let (x, z) = (8.0 * u - 4.0, 8.0 * v - 4.0);
        DVec3::new(x, 0.06 * (5.0 * x).sin() * (4.0 * z).cos() - 0.1, z)
    });
    let camera = Camera::looking_at(DVec3::new(2.6, 2.0, 3.2), DVec3::new(0.0, 0.6, 0.0), DVec3::Y, 0.8);
    Scene {
        name: format!("generated, {} triangles", mesh.indices.len() / 3),
        meshes: vec![mesh],
        instances: vec![Instance { name: String::new(), mesh: 0, world_from_object: DAffine3::IDENTITY }],
        materials: vec![Material::default()],
        cameras: vec![camera.expect("a camera")],
        ..Scene::default()
    }
}

/// Rays through the pixels in tiles of 8x8, each in Morton order.
fn primary(camera: &Camera, anchor: DVec3) -> Vec<Ray> {
    let [width, height] = SIZE.map(f64::from);
    let tan = match camera.projection {
        etalon::scene::Projection::Perspective { fov_y, .. } => (fov_y * 0.5).tan(),
        etalon::scene::Projection::Orthographic { .. } => 0.4,
    };
    let world = camera.world_from_camera;
    let origin = (world.translation - anchor).as_vec3().to_array();
    let mut rays = Vec::with_capacity((SIZE[0] * SIZE[1]) as usize);
    for tile in 0..SIZE[0] / 8 * (SIZE[1] / 8) {
        for i in 0..64 {
            let x = tile % (SIZE[0] / 8) * 8 + (i & 1 | i >> 1 & 2 | i >> 2 & 4);
            let y = tile / (SIZE[0] / 8) * 8 + (i >> 1 & 1 | i >> 2 & 2 | i >> 3 & 4);
            let (u, v) = ((f64::from(x) + 0.5) / width * 2.0 - 1.0, (f64::from(y) + 0.5) / height * 2.0 - 1.0);
            let d = world.matrix3 * DVec3::new(u * tan * width / height, -v * tan, -1.0);
            rays.push(Ray { origin, t_max: 1e30, direction: d.as_vec3().to_array(), from: Hit::NONE });
        }
    }
    rays
}

/// Uniform in 0 … 1, the same everywhere.
fn random(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 40) as f32 / (1_u32 << 24) as f32
}

/// Rays from where others ended: `aim` gives direction and length from the point, its normal and the ray that came.
fn secondary(
    from: &[Ray],
    hits: &[Hit],
    bvh: &Bvh,
    offset: f32,
    mut aim: impl FnMut(Vec3, Vec3, Vec3) -> (Vec3, f32),
) -> Vec<Ray> {
    from.iter()
        .zip(hits)
        .map(|(ray, hit)| {
            if hit.triangle == Hit::NONE {
                return Ray { t_max: -1.0, ..*ray };
            }
            let [a, b, c] = bvh.triangles[hit.triangle as usize].corners.map(Vec3::from);
            let came = Vec3::from(ray.direction).normalize();
            let n = (b - a).cross(c - a).normalize();
            let n = if n.dot(came) > 0.0 { -n } else { n };
            let p = a + hit.u * (b - a) + hit.v * (c - a) + n * offset;
            let (direction, t_max) = aim(p, n, came);
            Ray { origin: p.to_array(), t_max, direction: direction.to_array(), from: Hit::NONE }
        })
        .collect()
}

fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    let main: f64 = text.split_whitespace().next().and_then(|n| n.parse().ok()).unwrap_or(0.0);
    let others: f64 = std::fs::read_dir("/proc/self/task")
        .into_iter()
        .flatten()
        .filter_map(|task| std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok())
        .filter_map(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .sum();
    others.max(main) * 1e-9
}

struct Embree {
    program: PathBuf,
    folder: tempfile::TempDir,
}

impl Embree {
    fn build() -> Result<Self> {
        let folder = tempfile::tempdir()?;
        let program = folder.path().join("embree");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/embree.cpp");
        let mut compiler = Command::new("c++");
        compiler.args(["-O3", "-march=native", "-std=c++17"]).arg(source).arg("-o").arg(&program);
        let built = compiler.args(["-lembree3", "-lpthread"]).status().context("running c++")?;
        ensure!(built.success(), "compiling benches/embree.cpp failed (Debian: libembree-dev, g++)");
        Ok(Self { program, folder })
    }

    fn scene(&self, bvh: &Bvh) -> Result<()> {
        let corners: Vec<[[f32; 3]; 3]> = bvh.triangles.iter().map(|t| t.corners).collect();
        Ok(std::fs::write(self.folder.path().join("triangles"), bytemuck::cast_slice(&corners))?)
    }

    /// Hits and CPU seconds.
    fn trace(&self, rays: &[Ray], any: bool, threads: usize) -> Result<(usize, f64)> {
        let path = self.folder.path().join("rays");
        std::fs::write(&path, bytemuck::cast_slice(rays))?;
        let output = Command::new(&self.program)
            .arg(self.folder.path().join("triangles"))
            .arg(path)
            .args([if any { "any" } else { "nearest" }, &threads.to_string(), "5"])
            .output()?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let mut words = text.split_whitespace();
        let hits = words.next().context("no answer from Embree")?.parse()?;
        Ok((hits, words.next().context("no time from Embree")?.parse()?))
    }
}

fn main() -> Result<()> {
    let files: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let device = Device::open(&DeviceChoice::Best, false)?;
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let embree = Embree::build();
    if let Err(error) = &embree {
        println!("without Embree: {error:#}");
    }
    let scenes: Vec<Scene> = match files.is_empty() {
        true => vec![generated(70_000), generated(1_000_000)],
        false => {
            files.iter().map(|f| etalon::scene::load(Path::new(f), &LoadOptions::default())).collect::<Result<_>>()?
        }
    };
    for scene in &scenes {
        let bvh = Bvh::build(scene)?;
        let bounds = scene.bounds().context("nothing to trace")?;
        let camera = scene.cameras.first().cloned().unwrap_or_else(|| Camera::framing(bounds, 16.0 / 9.0, 0.7));
        if let Ok(embree) = &embree {
            embree.scene(&bvh)?;
        }
        println!("{}: tree of {} nodes, depth {}, cost {:.1}", scene.name, bvh.nodes.len(), bvh.depth, bvh.sah);
        let mut first = Tracer::new(&device, scene, None)?;
        let offset = first.rays().offset();
        let eye = primary(&camera, bvh.anchor);
        let (hits, ..) = first.trace(&eye, Mode::default(), 1)?;
        let light = (bounds.max - bvh.anchor).as_vec3() * Vec3::new(0.3, 1.6, 0.7);
        let reach = 0.1 * bounds.radius() as f32;
        let mut seed = 1;
        let sets = [
            ("primary", eye.clone(), false),
            ("mirror", secondary(&eye, &hits, &bvh, offset, |_, n, d| (d - 2.0 * d.dot(n) * n, 1e30)), false),
            ("shadow", secondary(&eye, &hits, &bvh, offset, |p, _, _| (light - p, 1.0)), true),
            (
                "AO",
                secondary(&eye, &hits, &bvh, offset, |_, n, _| {
                    let (z, turn) = (random(&mut seed) * 2.0 - 1.0, random(&mut seed) * TAU as f32);
                    let r = (1.0 - z * z).max(0.0).sqrt();
                    ((n + Vec3::new(r * turn.cos(), r * turn.sin(), z)).normalize_or(n), reach)
                }),
                true,
            ),
        ];
        println!(
            "  {:8} {:>10} {:>8} {:>9} {:>9} {:>7}  Mrays/s, {}",
            "rays",
            "way",
            "pairs",
            "ours",
            "Embree",
            "ratio",
            if device.is_software() {
                format!("CPU time / {threads}")
            } else {
                format!("GPU time; Embree CPU time / {threads}")
            }
        );
        for way in [Traversal::Links16, Traversal::Links32, Traversal::Stack] {
            let mut tracer = Tracer::new(&device, scene, Some(way))?;
            for (name, rays, any) in &sets {
                let pairs = way != Traversal::Stack;
                let mode = Mode { any_hit: *any, pairs, count: false };
                let (hits, ..) = tracer.trace(rays, mode, 1)?;
                let mine = hits.iter().filter(|h| h.triangle != Hit::NONE).count();
                let rate = |seconds: f64| rays.len() as f64 * threads as f64 / seconds * 1e-6;
                let mut best = f64::INFINITY;
                for _ in 0..ROUNDS {
                    // What is written and read back around them costs as much however often the rays are sent.
                    let mut spent = |repeats| -> Result<f64> {
                        let start = cpu_seconds();
                        tracer.trace(rays, mode, repeats)?;
                        Ok(cpu_seconds() - start)
                    };
                    if device.is_software() {
                        let once = spent(1)?;
                        best = best.min((spent(REPEATS + 1)? - once) / f64::from(REPEATS));
                    } else {
                        let times = tracer.trace(rays, mode, REPEATS)?.2;
                        best = times.into_iter().map(|ms| ms * 1e-3 * threads as f64).fold(best, f64::min);
                    }
                }
                match &embree {
                    Ok(embree) => {
                        let (theirs, seconds) = embree.trace(rays, *any, threads)?;
                        let ratio = seconds / best;
                        let differ = mine.abs_diff(theirs);
                        let (a, b) = (rate(best), rate(seconds));
                        println!(
                            "  {name:8} {:>10} {pairs:>8} {a:9.2} {b:9.2} {ratio:7.2}  hits differ by {differ}",
                            format!("{way:?}")
                        );
                    }
                    Err(_) => println!("  {name:8} {:>10} {pairs:>8} {:9.2}", format!("{way:?}"), rate(best)),
                }
            }
        }
    }
    Ok(())
}
