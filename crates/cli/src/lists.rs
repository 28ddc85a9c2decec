//! `etalon scenes` and `etalon knobs`: what is built in and what can be set. Names, rungs and sentences are those of
//! the library's own tables.

use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use comfy_table::{ContentArrangement, Table, presets};
use serde_json::{Value, json};
use strum::VariantArray as _;

use super::print;
use etalon::plan::{KNOBS, Knob, Model};
use etalon::study;

/// List the built-in study scenes, with one sentence each
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:\n    etalon scenes\n    etalon render study:pool -o pool.png")]
pub struct ScenesArgs {
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// List the knobs, with their rungs and the rung of each model; or describe one knob
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon knobs
    etalon knobs shadows
    etalon render study:lamps --set shadows=map -o lamps.png")]
pub struct KnobsArgs {
    /// The knob to describe: what it approximates, its rungs, and what they bring into a picture
    #[arg(value_parser = known_knob())]
    name: Option<&'static Knob>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Parser for the name of a knob.
fn known_knob() -> impl TypedValueParser<Value = &'static Knob> {
    let values = KNOBS.iter().map(|knob| PossibleValue::new(knob.name));
    PossibleValuesParser::new(values).try_map(|name| Knob::named(&name).ok_or("no such knob"))
}

fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING).set_content_arrangement(ContentArrangement::Dynamic).set_header(header);
    table
}

/// Lists the study scenes.
///
/// # Errors
/// When standard output cannot be written.
pub fn scenes(args: &ScenesArgs) -> Result<ExitCode> {
    if args.json {
        let scene = |(name, about): &(&str, &str)| json!({ "name": format!("study:{name}"), "about": about });
        let scenes: Vec<Value> = study::SCENES.iter().map(scene).collect();
        print(&serde_json::to_string_pretty(&json!({ "schema": "etalon.scenes/1", "scenes": scenes }))?)?;
    } else {
        let mut all = table(&["scene", "what it shows"]);
        for (name, about) in study::SCENES {
            all.add_row([&format!("study:{name}"), about]);
        }
        print(&all.to_string())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Lists the knobs, or describes one.
///
/// # Errors
/// When standard output cannot be written.
pub fn knobs(args: &KnobsArgs) -> Result<ExitCode> {
    match (args.name, args.json) {
        (name, true) => {
            let asked = KNOBS.iter().filter(|knob| name.is_none_or(|one| one.name == knob.name));
            let knobs: Vec<Value> = asked.map(document).collect();
            print(&serde_json::to_string_pretty(&json!({ "schema": "etalon.knobs/1", "knobs": knobs }))?)
        }
        (Some(knob), false) => print(&described(knob)),
        (None, false) => {
            let models = Model::VARIANTS.iter().map(|model| <&str>::from(*model));
            let header: Vec<&str> = ["knob", "rungs, from cheap to exact"].into_iter().chain(models).collect();
            let mut all = table(&header);
            for knob in KNOBS {
                let rungs = knob.rungs.join(" ");
                all.add_row([knob.name, &rungs].into_iter().chain(knob.presets));
            }
            print(&all.to_string())?;
            print("\netalon knobs NAME describes one; --set KNOB=RUNG sets it")
        }
    }?;
    Ok(ExitCode::SUCCESS)
}

fn document(knob: &Knob) -> Value {
    let presets = Model::VARIANTS.iter().zip(knob.presets).map(|(model, rung)| (<&str>::from(*model).to_owned(), rung));
    let presets: std::collections::BTreeMap<String, &str> = presets.collect();
    let effects = knob.effects.iter().map(|effect| {
        let [needs, brings] = effect.row();
        json!({ "name": effect.name(), "needed_by": needs, "brings": brings })
    });
    json!({
        "name": knob.name,
        "about": knob.about,
        "rungs": knob.rungs,
        "rung_about": knob.rung_about,
        "presets": presets,
        "exact": knob.exact,
        "lecture": knob.lecture,
        "effects": effects.collect::<Vec<_>>(),
    })
}

/// A knob in words: what it approximates, its rungs, and what its effects need and bring.
fn described(knob: &Knob) -> String {
    let mut rungs = table(&["rung", "what it does", "used by"]);
    for (rung, about) in knob.rungs.iter().zip(knob.rung_about) {
        let models = Model::VARIANTS.iter().zip(knob.presets).filter(|(_, preset)| preset == rung);
        let mut uses: Vec<String> = models.map(|(model, _)| format!("--model {}", <&str>::from(*model))).collect();
        if *rung == knob.exact {
            uses.push("the reference of `etalon cost`".to_owned());
        }
        rungs.add_row([*rung, *about, &uses.join(", ")]);
    }
    let mut text = format!("{}: {}\n\n{rungs}\n", knob.name, knob.about);
    if knob.effects.is_empty() {
        text += "\nIt concerns every surface of every scene.\n";
    } else {
        let mut effects = table(&["effect", "what in a scene needs it", "what it brings into a picture"]);
        for effect in knob.effects {
            let [needs, brings] = effect.row();
            effects.add_row([effect.name(), needs, brings]);
        }
        text += &format!("\n{effects}\n");
    }
    if !knob.lecture.is_empty() {
        text += &format!("\nStatements of docs/lecture.md: {}\n", knob.lecture.join(", "));
    }
    let others = knob.rungs.iter().find(|rung| **rung != knob.exact).unwrap_or(&knob.exact);
    let (name, exact) = (knob.name, knob.exact);
    text + &format!("\nError and time in a scene: etalon cost SCENE --compare {name}={others},{exact}")
}
