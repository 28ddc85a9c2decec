//! Shader hot reload (feature `reload`): recompiles shaders when their files change, the same way as build.rs. A shader
//! that does not compile, or whose interface differs from the built one, changes nothing and is reported.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow};

use etalon::gpu::{Constant, Program, Replacement};
use etalon::shader::PROGRAMS;

/// Time without another change before shaders are compiled.
const SETTLED: Duration = Duration::from_millis(200);

/// Result of compiling: all stages that replace built ones, or the compiler's message.
pub type Compiled = Result<Arc<Vec<Replacement>>, String>;

/// Watches the shader folder `root`, recompiles programs whose files change, and calls `told` with each result, until
/// the returned watcher is dropped.
///
/// # Errors
/// When there is no such folder.
pub fn watch(root: &Path, told: impl Fn(Compiled) + Send + 'static) -> Result<notify::RecommendedWatcher> {
    let root = root.canonicalize().with_context(|| format!("watching {}", root.display()))?;
    let (changed, changes) = channel::<PathBuf>();
    let watched = move |event: notify::Result<notify::Event>| {
        let Ok(event) = event else { return };
        if event.kind.is_modify() || event.kind.is_create() {
            event.paths.into_iter().for_each(|path| drop(changed.send(path)));
        }
    };
    let mut watcher = notify::recommended_watcher(watched).context("watching shaders")?;
    notify::Watcher::watch(&mut watcher, &root, notify::RecursiveMode::Recursive)
        .with_context(|| format!("watching {}", root.display()))?;
    let work = move || {
        let mut compiled: BTreeMap<&'static str, Vec<Vec<u32>>> = BTreeMap::new();
        // Files whose programs did not compile are compiled again with the next change.
        let mut open: BTreeSet<PathBuf> = BTreeSet::new();
        while let Ok(path) = changes.recv() {
            open.insert(path);
            while let Ok(path) = changes.recv_timeout(SETTLED) {
                open.insert(path);
            }
            let made = programs_of(&root, &open).and_then(|names| {
                names
                    .into_iter()
                    .map(|program| Ok((program.name, compile(&root, program)?)))
                    .collect::<Result<Vec<_>, _>>()
            });
            match made {
                Ok(made) if made.is_empty() => open.clear(),
                Ok(made) => {
                    open.clear();
                    compiled.extend(made);
                    let of = |(program, stages): (&&'static str, &Vec<Vec<u32>>)| -> Vec<Replacement> {
                        let words = stages.iter().cloned().enumerate();
                        words.map(|(stage, words)| Replacement { program, stage, words }).collect()
                    };
                    told(Ok(Arc::new(compiled.iter().flat_map(of).collect())));
                }
                Err(message) => told(Err(message)),
            }
        }
    };
    std::thread::Builder::new().name("shaders".to_owned()).spawn(work).map_err(|e| anyhow!("watching shaders: {e}"))?;
    Ok(watcher)
}

/// Programs that include one of the changed files.
fn programs_of(root: &Path, changed: &BTreeSet<PathBuf>) -> Result<Vec<&'static Program>, String> {
    let mut found = Vec::new();
    for program in PROGRAMS {
        if !etalon_reflect::parts(root, program.name)?.is_disjoint(changed) {
            found.push(*program);
        }
    }
    Ok(found)
}

/// Compiles a program; its interface must equal that of the built program.
fn compile(root: &Path, program: &'static Program) -> Result<Vec<Vec<u32>>, String> {
    let new = etalon_reflect::program(root, program.name)?;
    let known = |list: &[Constant]| list.iter().map(|one| (one.id, one.name.to_owned())).collect::<Vec<_>>();
    let sets = program.sets.iter().map(|set| set.used);
    let is_built = (0..)
        .zip(std::iter::once(program.bindings).chain(sets))
        .flat_map(|(set, bindings)| bindings.iter().map(move |b| (set, b)))
        .map(|(set, b)| (set, b.name.to_owned(), b.slot, format!("{:?}", b.kind), format!("{:?}", b.access)))
        .eq(new.bindings.iter().map(|(set, name, slot, kind, access)| {
            (*set, name.clone(), *slot, (*kind).to_owned(), (*access).to_owned())
        }));
    let streams: Vec<(u32, u32)> = program.inputs.iter().map(|input| (input.location, input.components)).collect();
    let same = is_built
        && new.constants == known(program.constants)
        && new.inputs == streams
        && new.push_bytes == program.push_bytes
        && new.local_size == program.local_size;
    match same {
        true => Ok(new.stages),
        false => Err(format!(
            "shaders/pass/{}: bindings, constants, vertex inputs, push constants or workgroup size have changed; build Etalon again",
            program.name
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn copied(from: &Path, to: &Path) {
        std::fs::create_dir_all(to).expect("a folder");
        for entry in std::fs::read_dir(from).expect("a folder") {
            let path = entry.expect("an entry").path();
            let to = to.join(path.file_name().expect("a name"));
            if path.is_dir() {
                copied(&path, &to);
            } else {
                std::fs::copy(&path, &to).expect("a copy");
            }
        }
    }

    #[test]
    fn changes_are_compiled_and_mistakes_are_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("shaders");
        copied(Path::new(etalon::shader::SOURCES), &root);
        let (to, told) = channel();
        let _watcher = watch(&root, move |compiled| drop(to.send(compiled))).expect("it watches");
        let next = || told.recv_timeout(Duration::from_secs(60)).expect("something is told");
        let path = root.join("pass/tonemap.comp");
        let text = std::fs::read_to_string(&path).expect("a shader");
        std::fs::write(&path, text.replace("void main() {", "void main() { oops")).expect("it is written");
        let message = next().expect_err("a mistake");
        assert!(message.contains("tonemap.comp") && message.contains("error"), "{message}");
        std::fs::write(&path, format!("{text}\n// once more\n")).expect("it is written");
        let words = next().expect("it compiles");
        let tonemap = PROGRAMS.iter().find(|program| program.name == "tonemap").expect("a program");
        assert!(words.iter().any(|r| r.program == "tonemap" && r.words == tonemap.stages[0].words), "the same words");
        // A library file belongs to every program that includes it.
        let all = programs_of(
            &root.canonicalize().expect("a path"),
            &[root.canonicalize().expect("a path").join("lib/fresnel.glsl")].into(),
        );
        let names: Vec<_> = all.expect("programs").iter().map(|program| program.name).collect();
        assert!(names.contains(&"path") && names.contains(&"light") && !names.contains(&"accumulate"), "{names:?}");
        std::fs::write(&path, text.replace("binding = 0", "binding = 63")).expect("it is written");
        let message = next().expect_err("another interface");
        assert!(message.contains("build Etalon again"), "{message}");
    }
}
