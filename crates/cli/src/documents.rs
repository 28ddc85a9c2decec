//! Tables of the documentation that the program writes itself: a page has a block between `<!-- generated: NAME -->`
//! and
//! `<!-- end -->`, and a test (`crates/cli/tests/documents.rs`) compares the block with what stands here.

use std::fmt::Write as _;
use std::sync::Arc;

use anyhow::Result;
use etalon::frame::Settings;
use etalon::gpu::{Access, Device, Program};
use etalon::open::Opened;
use etalon::plan::rungs::Model;
use etalon::plan::{EffectId, ForcedEffects, KNOBS, Knob, Knobs};
use etalon::shader;
use etalon::study;

use super::arguments::command;
use super::exit_codes::EXIT_CODES;

/// The blocks by name.
#[must_use]
pub fn blocks() -> Vec<(&'static str, String)> {
    vec![
        ("commands", commands()),
        ("render options", render_options()),
        ("knobs", knobs()),
        ("effects", effects()),
        ("study scenes", study_scenes()),
        ("exit codes", exit_codes()),
        ("bindings", bindings()),
        ("barrier", barrier()),
        #[cfg(feature = "window")]
        ("inputs", inputs()),
    ]
}

/// Mouse and keys of the viewer.
#[cfg(feature = "window")]
fn inputs() -> String {
    let mut table = String::from("| input | does |\n|---|---|\n");
    for (how, does) in etalon_viewer::panels::commands::inputs() {
        let does = does.trim_end_matches(" …").to_lowercase();
        let _ = writeln!(table, "| {how} | {does} |");
    }
    table
}

/// A cell of a Markdown table on one line.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ").trim().trim_end_matches('.').to_owned()
}

fn commands() -> String {
    let mut table = String::from("| command | what it does |\n|---|---|\n");
    for sub in command().get_subcommands() {
        let about = sub.get_about().map(ToString::to_string).unwrap_or_default();
        let _ = writeln!(table, "| `etalon {}` | {} |", sub.get_name(), cell(&about));
    }
    table
}

fn render_options() -> String {
    let mut table = String::from("| option | meaning | default |\n|---|---|---|\n");
    let command = command();
    let Some(render) = command.find_subcommand("render") else { return table };
    for option in render.get_arguments().filter(|argument| argument.get_long().is_some() && !argument.is_hide_set()) {
        let mut name = option.get_short().map_or(String::new(), |short| format!("-{short}, "));
        let _ = write!(name, "--{}", option.get_long().unwrap_or_default());
        if option.get_action().takes_values() {
            let values: Vec<String> = match option.get_value_names() {
                Some(names) => names.iter().map(ToString::to_string).collect(),
                None => vec![option.get_id().as_str().to_uppercase()],
            };
            let possible: Vec<String> =
                option.get_possible_values().iter().map(|value| value.get_name().to_owned()).collect();
            let _ = write!(name, " {}", if possible.is_empty() { values.join(" ") } else { possible.join("\\|") });
        }
        let help = option.get_help().map(ToString::to_string).unwrap_or_default();
        let default: Vec<_> = option.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
        let _ = writeln!(
            table,
            "| `{}` | {} | {} |",
            name.replace("\\|", "|").replace('|', "\\|"),
            cell(&help),
            default.join(" ")
        );
    }
    table
}

/// The rungs of a knob: that of `recursive` bold, that of `local` in italics, that of `global` underlined, where they
/// differ.
fn rungs(knob: &Knob) -> String {
    let [local, recursive, global] = knob.presets;
    let mark = |rung: &&'static str| match () {
        () if *rung == recursive => format!("**{rung}**"),
        () if *rung == local => format!("*{rung}*"),
        () if *rung == global => format!("<u>{rung}</u>"),
        () => (*rung).to_owned(),
    };
    knob.rungs.iter().map(mark).collect::<Vec<_>>().join(", ")
}

fn knobs() -> String {
    let mut table = String::from("| knob | rungs | what it approximates | lecture |\n|---|---|---|---|\n");
    for knob in KNOBS {
        let _ = writeln!(
            table,
            "| `{}` | {} | {} | {} |",
            knob.name,
            rungs(knob),
            cell(knob.about),
            knob.lecture.join(", ")
        );
    }
    table
}

fn effects() -> String {
    let mut table = String::from("| effect | what in a scene needs it | what it brings |\n|---|---|---|\n");
    for effect in EffectId::all() {
        let [cause, brings] = effect.row();
        let _ = writeln!(table, "| {} | {cause} | {brings} |", effect.name());
    }
    table
}

fn study_scenes() -> String {
    let mut table = String::from("| scene | what it shows |\n|---|---|\n");
    for (name, about) in study::SCENES {
        let _ = writeln!(table, "| `study:{name}` | {about} |");
    }
    table
}

fn exit_codes() -> String {
    let mut table = String::from("| exit code | meaning |\n|---|---|\n");
    for (code, meaning) in EXIT_CODES {
        let _ = writeln!(table, "| {code} | {meaning} |");
    }
    table
}

/// The first sentence of the comment that opens a program's shader: the last stage that has a file says what the pass
/// computes.
fn purpose(program: &Program) -> Option<(String, String)> {
    ["comp", "frag", "vert"].into_iter().find_map(|stage| {
        let name = format!("{}.{stage}", program.name);
        let text = std::fs::read_to_string(format!("{}/pass/{name}", shader::SOURCES)).ok()?;
        let opening: Vec<&str> = text.lines().map_while(|line| line.strip_prefix("// ")).collect();
        let opening = opening.join(" ");
        let end = opening.find(". ").unwrap_or(opening.len());
        Some((name, opening[..end].to_owned()))
    })
}

/// Frames with passes that no preset of a model draws: a study scene, a model, and a further option.
const OTHER_FRAMES: &[(&str, Model, &str)] = &[
    ("metals", Model::Recursive, "--set reflection=screen"),
    ("nested", Model::Recursive, "--set refraction=screen"),
    ("cornell", Model::Recursive, "--plan full"),
];

/// The passes of the study scenes' frames in their order, with the first frame that has each: those of path tracing, or
/// all others. It draws nothing but what is drawn before the first sample (shadow maps).
///
/// # Errors
/// When a scene does not fit the device, or the driver fails.
pub fn passes(device: &Arc<Device>, of_paths: bool) -> Result<String> {
    let models: &[Model] = if of_paths { &[Model::Global] } else { &[Model::Local, Model::Recursive] };
    let presets = models.iter().flat_map(|model| study::NAMES.map(|name| (name, *model, "")));
    // Pass, its rank among the passes of its name in one frame, columns of the shader, first frame.
    let mut all: Vec<(String, usize, String, String)> = Vec::new();
    for (scene, model, choice) in presets.chain(OTHER_FRAMES.iter().copied().filter(|_| !of_paths)) {
        let mut settings = Settings { size: [32, 18], knobs: Knobs::of(model), ..Settings::default() };
        match choice.split_once(' ') {
            Some(("--set", choice)) => settings.knobs.set(choice)?,
            Some(("--plan", "full")) => settings.forced = ForcedEffects::All,
            _ => anyhow::ensure!(choice.is_empty(), "{choice}: OTHER_FRAMES has --set or --plan full"),
        }
        let opened = Opened::load(&format!("study:{scene}"))?;
        let camera = opened.camera(settings.size)?;
        let mut renderer = opened.renderer(device, settings)?;
        let mut next = 0;
        let mut before: Vec<String> = Vec::new();
        for pass in renderer.passes(&camera)? {
            let rank = before.iter().filter(|name| **name == pass.name).count();
            let again = before.last() == Some(&pass.name);
            before.push(pass.name.clone());
            // The next shadow map, or the next surface of the paths.
            if again || (of_paths && rank > 0) {
                continue;
            }
            let known = all.iter().position(|(name, of_name, ..)| *name == pass.name && *of_name == rank);
            if known.is_none() {
                let found = pass.pipelines.first().and_then(|(program, _)| purpose(program));
                let about = found.map_or(" | ".to_owned(), |(file, about)| format!("`{file}` | {}", cell(&about)));
                let model = format!("{model:?}").to_lowercase();
                let frame = format!("study:{scene} --model {model} {choice}").trim_end().to_owned();
                all.insert(next, (pass.name, rank, about, frame));
            }
            next = known.unwrap_or(next) + 1;
        }
    }
    let mut table = String::from("| pass | shader | what it is | first frame that has it |\n|---|---|---|---|\n");
    for (name, _, about, frame) in &all {
        let _ = writeln!(table, "| {name} | {about} | `{frame}` |");
    }
    Ok(table)
}

/// What each program reads and writes, as the reflection of its SPIR-V has it.
fn bindings() -> String {
    let mut table = String::from("| program | reads | writes |\n|---|---|---|\n");
    for program in shader::PROGRAMS {
        let mut reads = Vec::new();
        let mut writes = Vec::new();
        for binding in program.bindings.iter().chain(program.sets.iter().flat_map(|set| set.used)) {
            let name = format!("`{}`", binding.name);
            if binding.access != Access::StorageWrite {
                reads.push(name.clone());
            }
            if matches!(binding.access, Access::StorageWrite | Access::StorageReadWrite) {
                writes.push(name);
            }
        }
        let _ = writeln!(table, "| `{}` | {} | {} |", program.name, reads.join(" "), writes.join(" "));
    }
    table
}

/// The line of a shader of `shaders/pass/` that declares a binding.
fn declaration(program: &str, name: &str) -> String {
    let path = format!("{}/pass/{program}.comp", shader::SOURCES);
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("layout(") && line.contains(&format!(" {name};")));
    line.and_then(|line| line.split("//").next()).unwrap_or_default().trim().to_owned()
}

/// How the barrier of one image comes to be: the tour's example, from the reflection.
fn barrier() -> String {
    let found = |program: &str| {
        let program: &'static Program = shader::PROGRAMS.iter().copied().find(|p| p.name == program)?;
        program.bindings.iter().find(|binding| binding.name == "radiance")
    };
    let (Some(light), Some(composite)) = (found("light"), found("composite")) else { return String::new() };
    let masks = light.access.masks(light.stages);
    let after = composite.access.masks(composite.stages);
    // A barrier makes writes available; reads need only be waited for.
    let writes = Access::StorageWrite.masks(light.stages).access;
    format!(
        r#"```text
shaders/pass/light.comp           {declaration}
        │                         the qualifier, or none, decides the access
        ▼
crates/reflect/src/reflect.rs     Binding {{ name: "radiance", kind: {kind:?}, access: {access:?} }}
        │                         light::Bind gets a field `radiance`: without it nothing compiles
        ▼
src/pass/light.rs                 frame.compute_indirect("lighting", &light::Bind {{ radiance, .. }}, ..)
        ▼
crates/vulkan/src/frame.rs        Use {{ resource: radiance, access: {access:?} }}
        ▼
crates/vulkan/src/access.rs       masks(): stages {stages:?}, access {reads:?}, layout {layout:?}
        ▼
crates/vulkan/src/sync.rs         barriers(): the uses of all passes in order → the barriers before each pass
        ▼
crates/vulkan/src/recording.rs    vkCmdPipelineBarrier2 before the pass "transparent lighting":
                                  wait for {stages:?}, make {writes:?} available → before {next:?} does {then:?}
```
"#,
        declaration = declaration("light", "radiance"),
        kind = light.kind,
        access = light.access,
        stages = masks.stages,
        reads = masks.access,
        layout = masks.layout,
        next = after.stages,
        then = after.access,
    )
}
