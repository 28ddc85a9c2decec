//! GLSL to SPIR-V by glslang: used by build.rs for all shaders, and by the viewer for changed shaders (feature
//! `reload`).

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rspirv::dr::Module;

use super::cache::{Cache, Key};
use super::compact::compacted;
use super::files::Result;
use super::interface::{Interface, PassSlots};
use super::optimise::Optimiser;
use super::reflect::Stage;

/// Maps each named item of `work` in parallel, from the last one on, with one thread per core; each thread has its own
/// `tool`.
pub(crate) fn on_all_cores<Tool, W: Send, R: Send>(
    work: impl IntoIterator<Item = (String, W)>,
    tool: impl Fn() -> Result<Tool> + Sync,
    make: impl Fn(&Tool, W) -> Result<R> + Sync,
) -> Result<BTreeMap<String, R>> {
    let queue = Mutex::new(work.into_iter().collect::<Vec<_>>());
    let made = Mutex::new(BTreeMap::new());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let run = || -> Result<()> {
        let tool = tool()?;
        loop {
            let next = queue.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let Some((name, work)) = next else { return Ok(()) };
            let result = make(&tool, work)?;
            made.lock().unwrap_or_else(PoisonError::into_inner).insert(name, result);
        }
    };
    std::thread::scope(|scope| {
        let all: Vec<_> = (0..threads).map(|_| scope.spawn(run)).collect();
        all.into_iter().try_for_each(|thread| thread.join().map_err(|_| "a thread of the build panicked")?)
    })?;
    Ok(made.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// A program: its compiled stages.
pub(crate) struct Program {
    pub(crate) stages: Vec<Stage>,
    pub(crate) slots: PassSlots,
}

/// Configuration of shader compilation.
pub(crate) struct Recipe {
    compiler: shaderc::Compiler,
    /// The folder `shaders`; all includes are relative to it, in whichever file.
    pub(crate) root: PathBuf,
    /// All declarations with their numbers.
    pub(crate) interface: Interface,
    /// Specialization constants whose code is removed.
    without: Vec<String>,
    /// Optimised code of earlier builds.
    pub(crate) cache: Cache,
    /// What optimises the compiler's code.
    optimiser: Optimiser,
    /// Code of a small shader, by which another version of the compiler is known.
    sample: String,
}

/// A shader of a few instructions with something to optimise.
const SAMPLE: &str = "#version 460\nlayout(binding = 0) buffer B { float x[]; };\n\
    void main() { float s = 0.0; for (int i = 0; i < 4; i++) { s += x[i] * 2.0; } x[0] = s; }";

/// Path and text of each file.
type Texts = Vec<(String, String)>;

/// Reads the files of a program: the stage of each, its path and its text.
fn read(paths: &[PathBuf]) -> Result<(Vec<shaderc::ShaderKind>, Texts)> {
    let mut texts = Vec::new();
    for path in paths {
        let text = fs::read_to_string(path).map_err(|e| format!("reading {}: {e}", path.display()))?;
        texts.push((path.display().to_string(), text));
    }
    let kind = |path: &PathBuf| match path.extension().and_then(|e| e.to_str()) {
        Some("vert") => Ok(shaderc::ShaderKind::Vertex),
        Some("frag") => Ok(shaderc::ShaderKind::Fragment),
        Some("comp") => Ok(shaderc::ShaderKind::Compute),
        _ => Err(format!("{}: expected .vert, .frag or .comp", path.display())),
    };
    Ok((paths.iter().map(kind).collect::<Result<_>>()?, texts))
}

impl Recipe {
    pub(crate) fn new(root: &Path, without: Vec<String>, cache: Cache) -> Result<Self> {
        let compiler = shaderc::Compiler::new().map_err(|e| format!("shaderc: {e}"))?;
        let interface = Interface::read(root)?;
        let (root, sample, optimiser) = (root.to_owned(), String::new(), Optimiser::installed());
        let mut new = Self { compiler, root, interface, without, cache, optimiser, sample };
        let level = shaderc::OptimizationLevel::Performance;
        let sample = shaderc::CompileOptions::new().map_err(|e| format!("shaderc: {e}")).and_then(|mut options| {
            options.set_optimization_level(level);
            let kind = shaderc::ShaderKind::Compute;
            let made = new.compiler.compile_into_spirv(SAMPLE, kind, "sample", "main", Some(&options));
            made.map(|made| format!("{:?}", made.as_binary())).map_err(|e| format!("shaderc: {e}"))
        })?;
        new.sample = sample;
        Ok(new)
    }

    /// Compiles the files of a program; its stages share their bindings.
    pub(crate) fn program(&self, paths: &[PathBuf]) -> Result<Program> {
        let (kinds, texts) = read(paths)?;
        self.compile(&kinds, &texts)
    }

    /// The files of a program as unoptimised modules.
    pub(crate) fn plain_program(&self, paths: &[PathBuf]) -> Result<Vec<Module>> {
        let (kinds, texts) = read(paths)?;
        let slots = self.interface.pass_slots(&texts)?;
        let stages = kinds.iter().zip(&texts);
        stages.map(|(&kind, (name, text))| Ok(self.plain(kind, name, text, &slots)?.1)).collect()
    }

    /// The module that is reflected, and its words. rspirv 0.13 cannot load SPIR-V 1.6's OpExecutionModeId; the
    /// declarations are the same in 1.5.
    fn plain(
        &self,
        kind: shaderc::ShaderKind,
        name: &str,
        text: &str,
        slots: &PassSlots,
    ) -> Result<(Vec<u32>, Module)> {
        let zero = shaderc::OptimizationLevel::Zero;
        let words = self.words(kind, name, text, slots, zero, shaderc::SpirvVersion::V1_5, &[])?;
        let module = rspirv::dr::load_words(&words).map_err(|e| format!("{name}: reflection: {e:?}"))?;
        Ok((words, module))
    }

    /// Compiles a source text under a name.
    pub(crate) fn source(&self, kind: shaderc::ShaderKind, name: String, source: &str) -> Result<Program> {
        self.compile(&[kind], &[(name, source.to_owned())])
    }

    fn compile(&self, kinds: &[shaderc::ShaderKind], texts: &[(String, String)]) -> Result<Program> {
        let slots = self.interface.pass_slots(texts)?;
        let stage = |(&kind, (name, text)): (&shaderc::ShaderKind, &(String, String))| -> Result<Stage> {
            let (words, module) = self.plain(kind, name, text, &slots)?;
            let version = shaderc::SpirvVersion::V1_6;
            // What the compiler made of the text, and all else that decides the code. What follows a `discard` in its
            // block counts in SPIR-V 1.6 alone: no shader has such.
            let mut key = Key::new();
            key.add(&words);
            let settings = format!("{kind:?} {version:?} {:?}", self.without);
            [&*settings, &*self.sample, self.optimiser.version()].into_iter().for_each(|text| key.add(text));
            let code = [
                include_str!("compile.rs"),
                include_str!("interface.rs"),
                include_str!("compact.rs"),
                include_str!("optimise.rs"),
            ];
            code.iter().for_each(|code| key.add(*code));
            let level = self.optimiser.level_of_compiler();
            let make = || {
                let words = self.words(kind, name, text, &slots, level, version, &self.without)?;
                compacted(self.optimiser.optimised(name, words)?)
            };
            let words = self.cache.words(&key, make)?;
            Ok(Stage { kind, module, words, path: name.clone() })
        };
        let stages = kinds.iter().zip(texts).map(stage).collect::<Result<_>>()?;
        Ok(Program { stages, slots })
    }

    #[allow(clippy::too_many_arguments, reason = "the options of glslang, called twice above")]
    fn words(
        &self,
        kind: shaderc::ShaderKind,
        name: &str,
        source: &str,
        slots: &PassSlots,
        level: shaderc::OptimizationLevel,
        version: shaderc::SpirvVersion,
        without: &[String],
    ) -> Result<Vec<u32>> {
        let mut options = shaderc::CompileOptions::new().map_err(|e| format!("shaderc: {e}"))?;
        options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
        options.set_target_spirv(version);
        options.set_optimization_level(level);
        options.set_warnings_as_errors();
        options.set_include_callback(|wanted, _, from, _| {
            let resolved = self.root.join(wanted);
            let content = fs::read_to_string(&resolved).map_err(|e| format!("{from} includes \"{wanted}\": {e}"))?;
            let content = self.interface.numbered(&content, slots, without)?;
            Ok(shaderc::ResolvedInclude { resolved_name: resolved.display().to_string(), content })
        });
        let source = self.interface.numbered(source, slots, without)?;
        let compiled = self.compiler.compile_into_spirv(&source, kind, name, "main", Some(&options));
        let artifact = compiled.map_err(|e| match e {
            shaderc::Error::CompilationError(_, log) => log,
            other => format!("{name}: {other}"),
        })?;
        Ok(artifact.as_binary().to_vec())
    }
}
