//! Renders a scene with two rungs of one knob, and prints the difference of the pictures.
//!
//!     cargo run --release --example compare -- study:etalon shadows=map shadows=ray
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use etalon::frame::Settings;
use etalon::gpu::{Device, DeviceChoice};
use etalon::image::metric::{AnyPicture, Metric, compare};
use etalon::open::Opened;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, a, b] = <[String; 3]>::try_from(arguments)
        .unwrap_or_else(|_| ["study:etalon", "shadows=map", "shadows=ray"].map(str::to_owned));
    let (opened, device) = (Opened::load(&name)?, Device::open(&DeviceChoice::Best, false)?);
    let draw = |choice: &str| -> anyhow::Result<AnyPicture> {
        let mut settings = Settings { size: [320, 180], ..Settings::default() };
        settings.knobs.set(choice)?;
        let camera = opened.camera(settings.size)?;
        let mut renderer = opened.clone().renderer(&device, settings)?;
        renderer.render(&camera, &mut |_| ())?;
        Ok(AnyPicture::Linear(renderer.film()?))
    };
    let (first, second) = (draw(&a)?, draw(&b)?);
    for metric in [Metric::Flip, Metric::Relmse] {
        println!("{}: {:.4}", metric.name(), compare(metric, &first, &second)?.value);
    }
    Ok(())
}
