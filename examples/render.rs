//! Renders a glTF file or a built-in scene to a picture in memory, and encodes it as a PNG file.
//!
//!     cargo run --release --example render -- model.glb model.png
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use etalon::frame::Settings;
use etalon::gpu::{Device, DeviceChoice};
use etalon::open::Opened;

fn main() -> anyhow::Result<()> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "study:etalon".to_owned());
    let settings = Settings { size: [320, 180], ..Settings::default() };
    let opened = Opened::load(&name)?;
    let camera = opened.camera(settings.size)?;
    let device = Device::open(&DeviceChoice::Best, false)?;
    let mut renderer = opened.renderer(&device, settings)?;
    let picture = renderer.render(&camera, &mut |_| ())?;
    let png = renderer.png(&picture)?;
    println!("{} bytes of RGBA, {} of PNG", picture.display.len(), png.len());
    Ok(std::env::args().nth(2).map_or(Ok(()), |path| std::fs::write(path, &png))?)
}
