//! A custom compute pass after Etalon's passes: it counts the pixels of the film by stops, on the device. Bindings,
//! access and barriers are derived from its GLSL.
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use etalon::frame::Settings;
use etalon::gpu::{Buffer, Device, DeviceChoice, Frame, Place};
use etalon::open::Opened;

/// Rust code that build.rs generated from `shaders/`.
#[allow(dead_code, unused_imports, missing_docs, unreachable_pub, reason = "generated")]
mod shader {
    use ash::vk;
    use bytemuck::{Pod, Zeroable};
    use etalon::gpu::*;

    include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
}

fn main() -> anyhow::Result<()> {
    let settings = Settings { size: [320, 180], ..Settings::default() };
    let opened = Opened::load("study:etalon")?;
    let camera = opened.camera(settings.size)?;
    let device = Device::open(&DeviceChoice::Best, std::env::args().any(|argument| argument == "--validate"))?;
    let mut renderer = opened.renderer(&device, settings)?;
    renderer.render(&camera, &mut |_| ())?;

    let histogram = Buffer::new(&device, "histogram", 16 * 4, Place::Readback)?;
    let mut frame = Frame::new(&device);
    frame.fill("no pixel yet", &histogram, 0);
    let bind = shader::stops::Bind { film: renderer.film_on_device(), histogram: &histogram };
    let push = shader::stops::Push { grey: 0.18 };
    frame.compute_over("stops", &bind, &shader::stops::Constants {}, &push, [320, 180])?;
    frame.read_back(&histogram);
    frame.finish()?;

    let counts: Vec<u32> = histogram.read(|bytes| bytemuck::cast_slice(bytes).to_vec());
    for (stop, count) in (-8..).zip(&counts) {
        println!("{stop:>3} {count:>6} {}", "#".repeat(*count as usize / 400));
    }
    match device.messages().first() {
        Some(message) => anyhow::bail!("validation: {}", message.text),
        None => Ok(()),
    }
}
