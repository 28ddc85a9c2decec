//! Prints the effects that a scene calls for, with reasons; no device is needed.
//!
//!     cargo run --example plan -- study:pool
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use etalon::frame::Settings;
use etalon::open::Opened;
use etalon::plan::{EffectState, Knobs, Model};

fn main() -> anyhow::Result<()> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "study:pool".to_owned());
    let opened = Opened::load(&name)?;
    for model in [Model::Local, Model::Recursive, Model::Global] {
        let plan = opened.plan(Settings { knobs: Knobs::of(model), ..Settings::default() })?;
        println!("{model:?}, {} samples", plan.samples);
        for effect in &plan.effects {
            let mark = if effect.state == EffectState::Kept { '+' } else { '-' };
            println!("  {mark} {}: {}", effect.id.name(), effect.reason());
        }
    }
    Ok(())
}
