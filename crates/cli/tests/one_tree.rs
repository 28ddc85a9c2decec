//! A scene is held once and its tree built once, whoever draws it how often: the window with two settings side by side
//! and a picked pixel, and `cost` with its dozens of renderers.

#[path = "support/program.rs"]
mod program;

use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

use anyhow::{Result, bail};
use etalon::frame::Settings;
use etalon::gpu::Device;
use etalon::open::Opened;
use etalon::plan::{Knobs, Model};
use etalon::prepare::Prepared;
use etalon::scene::{Camera, Scene};
use etalon::transport::bvh::Bvh;
use etalon_testing::gpu::Gpu;
use etalon_viewer::shared::{Loaded, OpenRequest, Pick, RenderRequest, SceneSource, SharedState};
use etalon_viewer::worker::Worker;

struct Pool;

impl SceneSource for Pool {
    fn open(&mut self, asked: OpenRequest<'_>, _: &Arc<Device>) -> Result<Loaded> {
        let opened = Opened::load("study:pool")?;
        let camera = opened.camera(asked.size)?;
        Ok(Loaded::new(opened.original, camera))
    }

    fn moment(&mut self, _: OpenRequest<'_>) -> Result<(Scene, Camera)> {
        bail!("nothing moves")
    }
}

fn settings(model: Model, more: &[&str]) -> Settings {
    let mut knobs = Knobs::of(model);
    ["samples=1"].iter().chain(more).for_each(|rung| knobs.set(rung).expect("a rung"));
    Settings { size: [32, 18], knobs, ..Settings::default() }
}

/// The window's thread, without the window.
#[test]
fn two_sides_and_a_picked_pixel_take_one_tree() {
    let gpu = Gpu::open();
    let left = settings(Model::Recursive, &[]);
    let right = settings(Model::Local, &["reflection=ray", "fresnel=exact"]);
    // The click was made in another view.
    let mut aside = etalon::study::load("pool").expect("a scene").cameras[0].clone();
    aside.world_from_camera.translation.x += 0.1;
    let wanted = RenderRequest {
        other: Some(right.knobs.clone()),
        picked: Some(Pick { number: 1, pixel: [16, 9], size: left.size, seen_from: aside.clone() }),
        ..RenderRequest::new(left.clone())
    };
    let shared = Arc::new(SharedState::new(wanted));
    let (to, woken) = channel();
    let before = Bvh::built();
    let thread = {
        let (device, shared) = (gpu.device.clone(), shared.clone());
        let wake = Arc::new(move || to.send(()).unwrap_or_default());
        std::thread::spawn(move || Worker::run(device, shared, Box::new(Pool), wake))
    };
    let begun = std::time::Instant::now();
    loop {
        let seen = shared.seen();
        if seen.sides.iter().all(|side| side.shown.is_some()) && seen.trace.is_some() {
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(120), "{:?}", seen.error);
        let _ = woken.recv_timeout(Duration::from_millis(200));
    }
    assert!(shared.seen().trace.is_some_and(|trace| trace.seen_from == aside), "the rays of another view");
    shared.want(|wanted| wanted.quit = true);
    thread.join().expect("the thread ends");
    assert_eq!(Bvh::built() - before, 1, "two renderers and the rays of a pixel");

    // What lies in memory is the same for all plans of a scene, but for what they do not read.
    let opened = Opened::load("study:pool").expect("a scene");
    let prepared: [Prepared; 2] = [left, right].map(|settings| opened.prepared(settings).expect("a plan"));
    assert_eq!(Bvh::built() - before, 2);
    let meshes = prepared.each_ref().map(|prepared| &prepared.scene.meshes);
    for (mesh, read) in meshes[0].iter().zip(&opened.scene().meshes).chain(meshes[1].iter().zip(&opened.scene().meshes))
    {
        assert!(mesh.positions.is_same(&read.positions) && mesh.indices.is_same(&read.indices), "{}", mesh.name);
    }
    let trees = prepared.each_ref().map(|prepared| &prepared.hierarchy.as_ref().expect("a tree").bvh);
    assert!(Arc::ptr_eq(trees[0], trees[1]));
}

#[test]
fn cost_builds_one_tree() {
    let folder = tempfile::tempdir().expect("a folder");
    let arguments = ["-v", "cost", "study:pool", "--device", "cpu", "--size", "16x9", "--compare", "shadows=off,ray"];
    let run = program::etalon(folder.path(), &arguments, &program::HASTY).succeeded();
    let built = run.stderr.lines().filter(|line| line.contains("built a BVH of")).count();
    assert_eq!(built, 1, "{}", run.stderr);
}
