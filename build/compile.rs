//! GLSL to SPIR-V by glslang: what build.rs does for all shaders, and the viewer for those that change (feature `reload`).

use std::fs;
use std::path::{Path, PathBuf};

use rspirv::dr::Module;

pub(crate) type Result<T> = std::result::Result<T, String>;

pub(crate) fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(|e| format!("reading {}: {e}", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect();
    paths.sort();
    Ok(paths)
}

pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// One compiled shader: what it declares, and the words that ship.
pub(crate) struct Stage {
    pub(crate) kind: shaderc::ShaderKind,
    pub(crate) module: Module,
    pub(crate) words: Vec<u32>,
    pub(crate) path: String,
}

/// How shaders are compiled.
pub(crate) struct Recipe {
    compiler: shaderc::Compiler,
    /// The folder `shaders`, which all includes are written from: one rule, whatever file includes.
    pub(crate) root: PathBuf,
    /// Names of specialization constants whose code is left out.
    without: Vec<String>,
}

impl Recipe {
    pub(crate) fn new(root: &Path, without: Vec<String>) -> Result<Self> {
        let compiler = shaderc::Compiler::new().map_err(|e| format!("shaderc: {e}"))?;
        Ok(Self { compiler, root: root.to_owned(), without })
    }

    /// Compiles a file of `shaders/pass/`.
    pub(crate) fn file(&self, path: &Path) -> Result<Stage> {
        let kind = match path.extension().and_then(|e| e.to_str()) {
            Some("vert") => shaderc::ShaderKind::Vertex,
            Some("frag") => shaderc::ShaderKind::Fragment,
            Some("comp") => shaderc::ShaderKind::Compute,
            _ => return Err(format!("{}: expected .vert, .frag or .comp", path.display())),
        };
        let source = fs::read_to_string(path).map_err(|e| format!("reading {}: {e}", path.display()))?;
        self.source(kind, path.display().to_string(), &source)
    }

    /// Compiles a text of that name.
    pub(crate) fn source(&self, kind: shaderc::ShaderKind, name: String, source: &str) -> Result<Stage> {
        // rspirv 0.13 cannot load SPIR-V 1.6's OpExecutionModeId; the declarations are the same in 1.5.
        let (zero, performance) = (shaderc::OptimizationLevel::Zero, shaderc::OptimizationLevel::Performance);
        let plain = self.words(kind, &name, source, zero, shaderc::SpirvVersion::V1_5, &[])?;
        let module = rspirv::dr::load_words(plain).map_err(|e| format!("{name}: reflection: {e:?}"))?;
        let words = self.words(kind, &name, source, performance, shaderc::SpirvVersion::V1_6, &self.without)?;
        Ok(Stage { kind, module, words, path: name })
    }

    fn words(
        &self,
        kind: shaderc::ShaderKind,
        name: &str,
        source: &str,
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
            let content = ruled_out(&content, without);
            Ok(shaderc::ResolvedInclude { resolved_name: resolved.display().to_string(), content })
        });
        let compiled =
            self.compiler.compile_into_spirv(&ruled_out(source, without), kind, name, "main", Some(&options));
        let artifact = compiled.map_err(|e| match e {
            shaderc::Error::CompilationError(_, log) => log,
            other => format!("{name}: {other}"),
        })?;
        Ok(artifact.as_binary().to_vec())
    }
}

/// Shader text in which some specialization constants are ordinary ones, false or 0: the compiler leaves out what they guard.
fn ruled_out(source: &str, without: &[String]) -> String {
    let line = |line: &str| {
        let (_, rest) = line.split_once(") const ").filter(|_| line.starts_with("layout(constant_id"))?;
        let (kind, name) = rest.split_once(" = ")?.0.split_once(' ')?;
        let value = if kind == "bool" { "false" } else { "0" };
        without.iter().any(|known| known == name).then(|| format!("const {kind} {name} = {value};"))
    };
    source.lines().map(|text| line(text).unwrap_or_else(|| text.to_owned()) + "\n").collect()
}
