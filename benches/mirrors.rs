//! What rays cost against the share of the picture that calls for them: a wall of 144 tiles of 80 pixels, of which none
//! to all are mirrors of a scene behind the eye. Prints the passes' times, the straight line through them, and how far
//! off it they are.
//!
//! `./x bench --bench mirrors`
#![allow(missing_docs, clippy::print_stdout, reason = "a program whose figures go to standard output")]

use anyhow::Result;
use etalon::frame::{Renderer, Settings};
use etalon::gpu::{Device, DeviceChoice};
use etalon::plan::{Knobs, Model};
use etalon::scene::{LightKind, Material};
use etalon::study::shape::Shape;
use etalon_testing::made::{Made, at, lambert, perspective};
use glam::{DAffine3, DVec3};

const SIZE: [u32; 2] = [1280, 720];
const CELLS: [u32; 2] = [16, 9];
const ROUNDS: u32 = 5;

fn wall(mirrors: u32) -> Made {
    let mut made = Made::new("wall");
    let mirror = Material { base_color: [0.9, 0.9, 0.9, 1.0], metallic: 1.0, roughness: 0.0, ..Material::default() };
    let cells = CELLS[0] * CELLS[1];
    let meshes = [mirror, lambert([0.5; 3])].map(|material| made.mesh(Shape::panel(1.0, 1.0), material));
    for i in 0..cells {
        // 89 has no factor in common with 144: every cell once, scattered.
        let turn = i * 89 % cells;
        let place = at(f64::from(i % CELLS[0]) - 7.5, f64::from(i / CELLS[0]) - 4.0, 0.0);
        made.place(meshes[usize::from(turn >= mirrors)], place);
    }
    let ball = made.mesh(Shape::sphere(0.7, 24), lambert([0.6, 0.4, 0.2]));
    for i in 0..60 {
        let place = DVec3::new(f64::from(i % 10) * 2.4 - 10.8, f64::from(i / 10) * 2.2 - 5.5, 11.0 + f64::from(i % 3));
        made.place(ball, DAffine3::from_translation(place));
    }
    made.add(
        Shape::panel(80.0, 60.0),
        lambert([0.3, 0.4, 0.5]),
        at(0.0, 0.0, 16.0) * DAffine3::from_rotation_y(std::f64::consts::PI),
    );
    made.light([1.0; 3], LightKind::Directional { direction: DVec3::new(0.3, -0.4, 0.6).normalize() });
    made.light([1.0; 3], LightKind::Directional { direction: DVec3::new(0.2, -0.5, -0.6).normalize() });
    made.camera(DVec3::Z * 8.0, DVec3::ZERO, perspective(2.0 * (4.5_f64 / 8.0).atan().to_degrees()));
    made
}

fn main() -> Result<()> {
    let device = Device::open(&DeviceChoice::Best, false)?;
    let mut knobs = Knobs::of(Model::Recursive);
    knobs.set("samples=1")?;
    let cells = CELLS[0] * CELLS[1];
    let mut points = Vec::new();
    println!("mirror pixels   classify ms   reflection ms   whole frame ms   (least of {ROUNDS})");
    for step in 0..=10 {
        let mirrors = cells * step / 10;
        let scene = wall(mirrors).0;
        let mut renderer = Renderer::new(
            &device,
            scene.clone(),
            None,
            Settings { size: SIZE, knobs: knobs.clone(), ..Settings::default() },
        )?;
        let (mut classify, mut rays, mut frame) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
        for _ in 0..=ROUNDS {
            let passes = renderer.render(&scene.cameras[0], &mut |_| ())?.passes;
            let of = |name: &str| passes.iter().filter(|p| p.name == name).map(|p| p.ms).sum::<f64>();
            classify = classify.min(of("classify ray tiles"));
            rays = rays.min(of("reflection and refraction"));
            frame = frame.min(passes.iter().map(|p| p.ms).sum());
        }
        let share = f64::from(mirrors) / f64::from(cells);
        println!("{:12.1} %  {classify:12.2}  {rays:14.2}  {frame:15.2}", share * 100.0);
        points.push((share, classify + rays));
    }
    // Least squares.
    let n = points.len() as f64;
    let mean = points.iter().fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
    let slope = points.iter().map(|p| (p.0 - mean.0) * (p.1 - mean.1)).sum::<f64>()
        / points.iter().map(|p| (p.0 - mean.0).powi(2)).sum::<f64>();
    let start = mean.1 - slope * mean.0;
    let off = points.iter().map(|p| (p.1 - start - slope * p.0).abs()).fold(0.0, f64::max);
    println!("both passes: {start:.2} ms + {slope:.2} ms times the share; off the line by at most {off:.2} ms");
    Ok(())
}
