//! Frame times of generated scenes and of knobs' rungs, interleaved so that drift of the machine hits all alike,
//! printed as medians with their spread and as ratios to the first row of each group. `./x bench`.

use std::io::Write as _;
use std::sync::Arc;

use anyhow::Result;
use etalon::frame::{Renderer, Settings};
use etalon::gpu::{Device, DeviceChoice};
use etalon::plan::Knobs;
use etalon::scene::environment::Environment;
use etalon::scene::{Camera, Scene};
use etalon::study;

const ROUNDS: usize = 9;

struct Row {
    name: String,
    renderer: Renderer,
    camera: Camera,
    times: Vec<f64>,
}

fn row(device: &Arc<Device>, name: &str, scene: Scene, choices: &[&str], studio: bool) -> Result<Row> {
    let mut knobs = Knobs::default();
    knobs.set("samples=1")?;
    for choice in choices {
        knobs.set(choice)?;
    }
    let settings = Settings { knobs, ..Settings::default() };
    let camera = scene.cameras[0].clone();
    let environment = studio.then(Environment::studio);
    let renderer = Renderer::new(device, scene, environment.as_ref(), settings)?;
    Ok(Row { name: name.to_owned(), renderer, camera, times: Vec::new() })
}

fn measure(out: &mut impl std::io::Write, title: &str, mut rows: Vec<Row>) -> Result<()> {
    // The first round compiles the pipelines and is thrown away.
    for round in 0..=ROUNDS {
        for row in &mut rows {
            let rendered = row.renderer.render(&row.camera, &mut |_| {})?;
            if round > 0 {
                row.times.push(rendered.passes.iter().map(|pass| pass.ms).sum());
            }
        }
    }
    writeln!(out, "\n{title}")?;
    let mut first = None;
    for row in &mut rows {
        row.times.sort_by(f64::total_cmp);
        let median = row.times[ROUNDS / 2];
        let base = *first.get_or_insert(median);
        let (low, high) = (row.times[ROUNDS / 4], row.times[ROUNDS - 1 - ROUNDS / 4]);
        writeln!(out, "{:<32} {median:8.1} ms ({low:.1} .. {high:.1})   x{:.2}", row.name, median / base)?;
    }
    Ok(())
}

fn main() -> Result<()> {
    let device = Device::open(&DeviceChoice::Best, false)?;
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "{} ({}), 1280x720, GPU time of a frame: median (quartiles) of {ROUNDS}",
        device.info().name,
        device.info().driver
    )?;
    let lights = [1, 16, 100, 1000]
        .into_iter()
        .map(|count| row(&device, &format!("{count} lights"), study::generate::lights(count), &[], false))
        .collect::<Result<_>>()?;
    measure(&mut out, "point lights of range 5 over 1024 boxes", lights)?;
    let triangles = [10_000, 100_000, 1_000_000]
        .into_iter()
        .map(|count| row(&device, &format!("{count} triangles"), study::generate::sphere_field(count), &[], true))
        .collect::<Result<_>>()?;
    measure(&mut out, "a displaced sphere in the studio", triangles)?;
    for (knob, rungs) in [
        ("fresnel", &["schlick", "exact"][..]),
        ("brdf", &["blinn-phong", "blinn-phong-reciprocal", "ggx", "ggx-multi"][..]),
        ("reflection", &["off", "environment", "screen"][..]),
    ] {
        let rows = rungs
            .iter()
            .map(|rung| {
                let choice = format!("{knob}={rung}");
                row(&device, &choice, study::load("materials")?, &[&choice], true)
            })
            .collect::<Result<_>>()?;
        measure(&mut out, &format!("study:materials, knob {knob}"), rows)?;
    }
    Ok(())
}
