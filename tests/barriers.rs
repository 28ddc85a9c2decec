//! The barriers are needed: the same passes without them are reported as hazards by synchronization validation, and
//! with them nothing is. Otherwise a validation that sees nothing would prove nothing.

use ash::vk;
use etalon::frame::TileShare;
use etalon::gpu::{Buffer, DescriptorSet, Frame, Image, ImageDesc, Place, Resource};
use etalon::pass::classify::{WorkLists, classify};
use etalon::pass::gbuffer::GBuffer;
use etalon::pass::tonemap::{Display, tonemap};
use etalon::plan::{Architecture, Facts, Knobs, Plan, Surroundings};
use etalon::scene::Scene;
use etalon::shader::{Library, SCENE, lib};
use etalon::share::Camera;
use etalon_testing::barriers::are_needed;
use etalon_testing::gpu::Gpu;

/// Of the scene, classification reads the camera alone.
fn view(camera: &Buffer) -> Vec<(u32, Resource<'_>)> {
    lib::view::Scene { camera_block: camera }.entries()
}

struct Things {
    scene: DescriptorSet,
    camera: Buffer,
    gbuffer: GBuffer,
    work: WorkLists,
    film: Image,
    display: Display,
    buffers: [Buffer; 3],
}

impl Things {
    fn new(gpu: &Gpu) -> Self {
        let size = [64, 36];
        let surroundings = Surroundings::DARK;
        let plan = Plan::new(&Scene::default(), &Facts::default(), surroundings, &Knobs::default());
        let desc = ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, size[0], size[1], vk::ImageUsageFlags::STORAGE);
        let buffer = |name| Buffer::new(&gpu.device, name, 256, Place::Device).expect("a buffer");
        let camera = Camera { size, tiles: [0, 1], ..bytemuck::Zeroable::zeroed() };
        let camera = Buffer::with_data(&gpu.device, "camera", &[camera]).expect("a buffer");
        Self {
            scene: DescriptorSet::new(&gpu.device, &SCENE, &view(&camera)).expect("a set"),
            camera,
            gbuffer: GBuffer::new(&gpu.device, &plan, size).expect("a G-buffer"),
            work: WorkLists::new(&gpu.device, size, TileShare::ALL).expect("work lists"),
            film: Image::new(&gpu.device, "film", desc).expect("a film"),
            display: Display::new(&gpu.device, size).expect("a display"),
            buffers: [buffer("a"), buffer("b"), buffer("c")],
        }
    }
}

/// Clean with barriers, a hazard without.
fn proves(name: &str, describe: impl for<'a> Fn(&'a Things, &mut Frame<'a>)) {
    are_needed(name, Things::new, |things, gpu| {
        let mut frame = Frame::of(&gpu.device, vec![things.scene.bind(view(&things.camera))]);
        describe(things, &mut frame);
        frame
    });
}

#[test]
fn sorting_tiles_waits_for_its_counters() {
    // copy → compute atomics on the sizes.
    proves("classify", |things, frame| {
        classify(frame, Library::default(), Architecture::default(), &things.gbuffer, &things.work).expect("the pass")
    });
}

#[test]
fn sorting_tiles_again_waits_for_the_first_time() {
    // compute → copy → compute on the same lists; the tiles are written twice.
    proves("classify twice", |things, frame| {
        classify(frame, Library::default(), Architecture::default(), &things.gbuffer, &things.work).expect("the pass");
        classify(frame, Library::default(), Architecture::default(), &things.gbuffer, &things.work).expect("the pass");
    });
}

#[test]
fn tone_mapping_waits_for_its_counters() {
    // fill → compute atomics.
    proves("tone map", |things, frame| {
        tonemap(frame, (&things.film, 1.0), &things.display, 0, 0.0, [0.0; 4], false).expect("the pass");
    });
}

#[test]
fn copies_wait_for_each_other() {
    // Write after write, read after write, write after read.
    let [waw, raw, war] = [0, 1, 2];
    for kind in [waw, raw, war] {
        proves(&format!("copies {kind}"), |things, frame| {
            let [a, b, c] = &things.buffers;
            match kind {
                0 => {
                    frame.copy_buffer("first", a, b, 256);
                    frame.copy_buffer("second", c, b, 256);
                }
                1 => {
                    frame.copy_buffer("first", a, b, 256);
                    frame.copy_buffer("second", b, c, 256);
                }
                _ => {
                    frame.copy_buffer("first", b, a, 256);
                    frame.copy_buffer("second", c, b, 256);
                }
            }
        });
    }
}
