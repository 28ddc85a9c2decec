//! One equation of the shaders, run on the device in each tier, beside its twin in f64.
//!
//!     cargo run --example equation -p etalon-verify
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use etalon::gpu::{Device, DeviceChoice};
use etalon::optics::Tier;
use etalon_verify::{Cases, evaluate, find};

fn main() -> anyhow::Result<()> {
    let entry = find("fresnel_dielectric")?;
    let device = Device::open(&DeviceChoice::Best, false)?;
    // Cosines, and the index of glass: at normal incidence, at 60 degrees, and a hair above the horizon.
    let cases = Cases::from_rows(&entry, &[vec![1.0, 1.5], vec![0.5, 1.5], vec![1e-6, 1.5]]);
    for tier in [Tier::Fast, Tier::Stable, Tier::Compensated] {
        let outputs = evaluate(&device, entry.probe, tier, &cases.inputs, cases.count)?.outputs;
        // Columns of outputs, and rows of twins: the first of each is the reflectance.
        let twins = cases.exact.chunks(entry.probe.outputs.len()).map(|row| row[0]);
        for (row, (output, twin)) in outputs.iter().zip(twins).enumerate() {
            println!("{tier:?}: {}({:?}) = {output} on the device, {twin} in f64", entry.probe.name, cases.row(row));
        }
    }
    Ok(())
}
