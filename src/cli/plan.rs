//! `etalon plan`: which effects a scene calls for and why, and what drawing it takes, without drawing it.

use std::collections::BTreeMap;
use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use comfy_table::{ContentArrangement, Table, presets};

use super::options::{DeviceOptions, PictureOptions, SceneOptions};
use super::print;
use super::report::PlanFacts;
use super::setup::Setup;

/// Say what a scene calls for, with reasons, and what drawing it takes
#[derive(Debug, Clone, Args)]
pub struct PlanArgs {
    #[command(flatten)]
    scene: SceneOptions,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    device: DeviceOptions,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// One sentence with what was being done, to what, and the cause.
pub fn run(args: &PlanArgs) -> Result<ExitCode> {
    let settings = args.picture.settings(&args.scene)?;
    let setup = Setup::load(&args.scene, args.picture.reads(&args.scene, &settings.knobs), &args.device)?;
    let mut warnings = setup.warnings.clone();
    let (mut renderer, camera) = setup.renderer(&args.scene, settings)?;
    warnings.extend(renderer.warnings.iter().cloned());
    let passes = renderer.passes(&camera)?;
    let mut pipelines = renderer.device().pipelines();
    pipelines.extend(passes.iter().flat_map(|pass| pass.pipelines.iter().cloned()));
    let mut names: Vec<String> = Vec::new();
    for pass in passes {
        if !names.contains(&pass.name) {
            names.push(pass.name);
        }
    }
    let mut facts = PlanFacts::of(&renderer.plan, renderer.device(), names, pipelines);
    facts.warnings.splice(0..0, warnings);
    if args.json {
        print(&serde_json::to_string_pretty(&facts)?)?;
    } else {
        print(&text(&facts))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn text(facts: &PlanFacts) -> String {
    let table = |header: &[&str]| {
        let mut table = Table::new();
        table.load_preset(presets::NOTHING).set_content_arrangement(ContentArrangement::Dynamic).set_header(header);
        table
    };
    let mut effects = table(&["effect", "state", "rung", "reason"]);
    for effect in &facts.effects {
        effects.add_row([effect.name, effect.state, effect.rung, &effect.reason]);
    }
    // Many draws share a program: they are told apart by constants alone, which --json has.
    let mut programs: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for pipeline in &facts.pipelines {
        let (count, bytes) = programs.entry(pipeline.name).or_default();
        *count += 1;
        *bytes += pipeline.spirv_bytes;
    }
    let mut pipelines = table(&["program", "pipelines", "KB of SPIR-V"]);
    for (name, (count, bytes)) in &programs {
        pipelines.add_row([(*name).to_owned(), count.to_string(), format!("{:.1}", *bytes as f64 / 1e3)]);
    }
    let bytes: u64 = facts.buffers.iter().map(|made| made.bytes).sum();
    let spirv: usize = facts.pipelines.iter().map(|pipeline| pipeline.spirv_bytes).sum();
    let warnings: String = facts.warnings.iter().map(|warning| format!("warning: {warning}\n")).collect();
    format!(
        "{effects}\n\n{} samples per pixel, each by the passes {}\n\n{pipelines}\n\n{} pipelines of {:.0} KB of SPIR-V; {} buffers \
         and images of {:.1} MB\n{warnings}",
        facts.samples,
        facts.passes.join(", "),
        facts.pipelines.len(),
        spirv as f64 / 1e3,
        facts.buffers.len(),
        bytes as f64 / 1e6,
    )
    .trim_end()
    .to_owned()
}
