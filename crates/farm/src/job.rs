//! Job files for render-farm engines: each task runs the same command with its own share, and for a still picture a
//! last task joins the parts.
//!
//! Etalon has no scheduler. The templates are in `crates/farm/templates/`; placeholders between `@` are filled in here.

use anyhow::{Result, bail, ensure};
use strum::{EnumMessage, IntoStaticStr, VariantArray};

use crate::frames::Frames;

/// Engine that runs the tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, EnumMessage, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum Engine {
    /// Open Job Description: AWS Deadline Cloud, `openjd run`.
    Openjd,
    /// Slurm, job arrays.
    Slurm,
    /// HyperQueue, task arrays.
    Hyperqueue,
    /// Flamenco, a job type.
    Flamenco,
    /// OpenCue, an outline.
    Opencue,
    /// Kubernetes, an indexed Job.
    Kubernetes,
}

/// Work of a job, and its number of tasks.
#[derive(Debug, Clone)]
pub struct JobWork {
    /// Name for file names and labels.
    pub name: String,
    /// Path of the program on the workers.
    pub program: String,
    /// Folder in which the program runs.
    pub here: String,
    /// Arguments of `render`; for a single picture without its outputs.
    pub arguments: Vec<String>,
    /// Arguments of `render` without `--frames`.
    pub arguments_alone: Vec<String>,
    /// Outputs of a single picture; empty for a sequence, whose arguments contain them.
    pub outputs: Vec<String>,
    /// Frames of a sequence.
    pub frames: Option<Frames>,
    /// Number of tasks.
    pub count: u32,
    /// Seconds that a task should take.
    pub seconds: u32,
    /// Folder for parts and logs.
    pub folder: String,
}

/// A word of a command line, quoted for a POSIX shell if necessary.
#[must_use]
pub fn word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,=+%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

fn words(all: &[String]) -> String {
    all.iter().map(|text| word(text)).collect::<Vec<_>>().join(" ")
}

/// A name with the characters that DNS labels allow, at most 50.
fn dns(name: &str) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    let short: String = plain.trim_matches('-').chars().take(50).collect();
    let short = short.trim_end_matches('-');
    if short.is_empty() { "etalon".to_owned() } else { short.to_owned() }
}

fn json(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

impl JobWork {
    /// Text of the job file for an engine.
    ///
    /// # Errors
    /// When there are no tasks, or when an argument has a line break.
    pub fn file(&self, engine: Engine) -> Result<String> {
        let Self { count, folder, outputs, .. } = self;
        ensure!(*count > 0, "a job needs at least one task");
        let is_still = !outputs.is_empty();
        let arguments = words(&self.arguments);
        if arguments.contains('\n') {
            bail!("an argument contains a line break, which a job file cannot contain");
        }
        let merge = match is_still {
            true => {
                let parts: Vec<String> = (1..=*count).map(|i| word(&format!("{folder}/{i}.part"))).collect();
                let to: Vec<String> = outputs.iter().map(|output| format!("-o {}", word(output))).collect();
                format!("{} merge {} {}", self.program, parts.join(" "), to.join(" "))
            }
            false => String::new(),
        };
        let part = |index: &str| if is_still { format!(" -o {folder}/{index}.part") } else { String::new() };
        let quoted = |index: &str| if is_still { format!(" -o \"{folder}/{index}.part\"") } else { String::new() };
        let then = |text: &'static str| if is_still { text } else { "" };
        let chunked = engine == Engine::Openjd && self.frames.is_some();
        let template = match engine {
            Engine::Openjd if chunked => include_str!("../templates/openjd-chunks.yaml"),
            Engine::Openjd => include_str!("../templates/openjd.yaml"),
            Engine::Slurm => include_str!("../templates/slurm.sh"),
            Engine::Hyperqueue => include_str!("../templates/hyperqueue.sh"),
            Engine::Flamenco => include_str!("../templates/flamenco.js"),
            Engine::Opencue => include_str!("../templates/opencue.py"),
            Engine::Kubernetes => include_str!("../templates/kubernetes.yaml"),
        };
        let frames = self.frames.as_ref().map(ToString::to_string).unwrap_or_default();
        let all = self.frames.as_ref().map_or(1, |frames| frames.numbers().len() as u32);
        let flamenco = format!(
            "    const merge = author.Task(\"merge\", \"misc\");\n    merge.addCommand(shell({}));\n    \
             parts.forEach((task) => merge.addDependency(task));\n    job.addTask(merge);",
            json(&merge)
        );
        let opencue = format!(
            "merge = Shell(\"merge\", command=[\"bash\", \"-c\", \"cd '%s' && %s\" % (FOLDER, {})], range=\"1\")\n\
             merge.depend_all(render)\njob.add_layer(merge)\n",
            json(&merge)
        );
        let kubernetes = format!("\n# When it is complete: {merge}");
        let pieces: [(&str, String); 29] = [
            ("MERGE_SLURM", then(include_str!("../templates/slurm-merge.sh")).trim_end().to_owned()),
            ("MERGE_OPENJD", then(include_str!("../templates/openjd-merge.yaml")).trim_end().to_owned()),
            ("MERGE_FLAMENCO", if is_still { flamenco } else { String::new() }),
            ("MERGE_OPENCUE", if is_still { opencue } else { String::new() }),
            ("THEN_KUBERNETES", if is_still { kubernetes } else { String::new() }),
            ("THEN_COMMENT", then(", and a task that joins their parts").to_owned()),
            ("MERGE", merge),
            ("ABOUT", format!("etalon render {arguments}: {count} tasks{}", then(" and one that joins them"))),
            ("ARGUMENTS_ALONE", words(&self.arguments_alone)),
            ("JSON_ARGUMENTS", json(&arguments)),
            ("ARGUMENTS", arguments),
            ("JSON_PROGRAM", json(&self.program)),
            ("PROGRAM", self.program.clone()),
            ("JSON_HERE", json(&self.here)),
            ("HERE", word(&self.here)),
            ("DNS_NAME", dns(&self.name)),
            ("NAME", dns(&self.name)),
            ("JS_FOLDER", folder.clone()),
            ("FOLDER", folder.clone()),
            ("COUNT", count.to_string()),
            ("FRAMES", frames),
            ("CHUNK", all.div_ceil(*count).to_string()),
            ("SECONDS", self.seconds.to_string()),
            ("OUTPUT_SLURM", quoted("$SLURM_ARRAY_TASK_ID")),
            ("OUTPUT_HYPERQUEUE", quoted("$HQ_TASK_ID")),
            ("OUTPUT_OPENJD", part("{{Task.Param.Shard}}")),
            ("OUTPUT_KUBERNETES", part("$((JOB_COMPLETION_INDEX + 1))")),
            ("OUTPUT_OPENCUE", part("#IFRAME#")),
            ("JS_OUTPUT", if is_still { format!(" + \" -o {folder}/\" + i + \".part\"") } else { String::new() }),
        ];
        // Twice: some replacements contain placeholders.
        let mut text = template.to_owned();
        for _ in 0..2 {
            for (name, value) in &pieces {
                text = text.replace(&format!("@{name}@"), value);
            }
        }
        Ok(format!("{}\n", text.trim_end()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn work(outputs: &[&str], frames: Option<&str>) -> JobWork {
        let arguments = ["scene name.glb", "--set", "samples=64"].map(str::to_owned).to_vec();
        JobWork {
            name: "Scene name".to_owned(),
            program: "etalon".to_owned(),
            here: "/home/me/a folder".to_owned(),
            arguments_alone: arguments.clone(),
            arguments,
            outputs: outputs.iter().map(|&text| text.to_owned()).collect(),
            frames: frames.map(|text| text.parse().expect("frames")),
            count: 4,
            seconds: 300,
            folder: "scene.parts".to_owned(),
        }
    }

    #[test]
    fn every_place_of_every_template_is_filled() {
        for engine in Engine::VARIANTS {
            for work in [work(&["out.exr"], None), work(&[], Some("1-9"))] {
                let text = work.file(*engine).expect("a file");
                let open = text
                    .split('@')
                    .skip(1)
                    .step_by(2)
                    .find(|word| !word.is_empty() && word.chars().all(|c| c.is_ascii_uppercase() || c == '_'));
                assert_eq!(open, None, "{engine:?}: {text}");
                assert!(text.contains("samples=64"), "{engine:?}: {text}");
                assert_eq!(text.contains("etalon merge"), !work.outputs.is_empty(), "{engine:?}: {text}");
            }
        }
    }

    #[test]
    fn what_a_file_cannot_hold_is_refused() {
        let mut work = work(&["out.exr"], None);
        work.arguments.push("two\nlines".to_owned());
        let error = work.file(Engine::Slurm).expect_err("two lines");
        assert!(error.to_string().contains("a line break"), "{error}");
    }
}
