//! Tagged functions of `shaders/lib/`, and the probe that evaluates each on a device.
//!
//! ```text
//! // @eq F3 N2: r_s = −(n² − 1)/(c + g)²
//! // @name refract          only if the function's own name is a GLSL built-in
//! // @out F                 only if it returns a plain value
//! // @host src/FILE: what   if no pass calls it: the host code that computes it for pictures
//! // @lab FUNCTION: test    if neither does: the function that passes call instead, and the test of their equality
//! FresnelDielectric fresnel_dielectric(float cos_in, float n) {
//! ```
//!
//! Parameters are the input columns in order, and members of the result are the output columns. A probe computes
//! `outputs = function(inputs)` for one case per invocation, and stores column after column. Inputs are words: the bits
//! of a float, or a `uint`, of which a float would hold 24 bits.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::files::{Result, files, stem};

/// One tagged function.
pub(crate) struct Equation {
    /// Name of the GLSL function.
    pub(crate) function: String,
    /// Name in tables and vector files.
    pub(crate) name: String,
    /// Ids of the lecture, and rows of docs/numerics.md.
    pub(crate) ids: Vec<String>,
    /// The formula, in one line.
    pub(crate) formula: String,
    /// File under `shaders/lib/`, without `.glsl`.
    pub(crate) subject: String,
    /// Line of the tag in the file, counted from 1.
    pub(crate) line: usize,
    pub(crate) inputs: Vec<String>,
    /// Inputs that are 32-bit integers.
    pub(crate) whole: Vec<String>,
    pub(crate) outputs: Vec<String>,
    /// Host code that computes the function for pictures: file, description.
    pub(crate) host: Option<(String, String)>,
    /// The function that passes call instead, and the test of their equality.
    pub(crate) lab: Option<(String, String)>,
    /// GLSL of the probe.
    pub(crate) probe: String,
}

/// Facts about the source of a function of `shaders/lib/`, for the contract check.
#[derive(Default)]
pub(crate) struct Source {
    /// Whether its body has `precise`.
    pub(crate) precise: bool,
    /// Number of loops in its body.
    pub(crate) loops: usize,
    /// The bounds `@iterations N` of its loops.
    pub(crate) heads: Vec<u32>,
}

/// All functions of `shaders/lib/`.
pub(crate) struct Library {
    pub(crate) equations: Vec<Equation>,
    /// Functions by name; overloads are joined.
    pub(crate) functions: BTreeMap<String, Source>,
}

type Structs = BTreeMap<String, Vec<(String, String)>>;

pub(crate) fn library(folder: &Path) -> Result<Library> {
    let mut texts = Vec::new();
    let mut structs = Structs::new();
    for path in files(folder)? {
        let text = fs::read_to_string(&path).map_err(|e| format!("reading {}: {e}", path.display()))?;
        find_structs(&text, &mut structs);
        texts.push((path, text));
    }
    let mut library = Library { equations: Vec::new(), functions: BTreeMap::new() };
    for (path, text) in &texts {
        read(path, text, &structs, &mut library)?;
    }
    let mut names: Vec<_> = library.equations.iter().map(|e| &e.name).collect();
    names.sort();
    if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(format!("two functions are tagged as the equation {}", pair[0]));
    }
    Ok(library)
}

fn without_comment(line: &str) -> &str {
    line.split("//").next().unwrap_or_default()
}

fn find_structs(text: &str, structs: &mut Structs) {
    let mut open: Option<(String, Vec<(String, String)>)> = None;
    for line in text.lines().map(without_comment) {
        if let Some(rest) = line.strip_prefix("struct ") {
            open = Some((rest.trim_end_matches(['{', ' ']).to_owned(), Vec::new()));
        } else if line.starts_with("};") {
            if let Some((name, members)) = open.take() {
                structs.insert(name, members);
            }
        } else if let Some((_, members)) = &mut open {
            members.extend(line.split(';').filter_map(|member| {
                let (ty, name) = member.trim().split_once(' ')?;
                Some((ty.to_owned(), name.trim().to_owned()))
            }));
        }
    }
}

/// A function's head as written: return type, name, parameters (type, name).
struct Head {
    returns: String,
    name: String,
    parameters: Vec<(String, String)>,
}

/// Parses the head in `text` up to its `{`; `None` if it is not a function.
fn head(text: &str) -> Option<Head> {
    let (before, rest) = text.split_once('(')?;
    let (parameters, _) = rest.split_once(')')?;
    let mut words = before.split_whitespace().filter(|word| *word != "precise");
    let (returns, name) = (words.next()?.to_owned(), words.next()?.to_owned());
    if words.next().is_some() || ["layout", "const", "struct"].contains(&returns.as_str()) {
        return None;
    }
    let parameters = parameters.split(',').filter(|p| !p.trim().is_empty()).map(|p| {
        let (ty, name) = p.trim().trim_start_matches("in ").split_once(' ')?;
        Some((ty.to_owned(), name.trim().to_owned()))
    });
    Some(Head { returns, name, parameters: parameters.collect::<Option<_>>()? })
}

/// Whether a line without its comment begins a function: a word in the first column, a parenthesis, no assignment.
fn is_head(line: &str) -> bool {
    line.starts_with(|c: char| c.is_ascii_alphabetic()) && line.contains('(') && !line.contains('=')
}

/// Optional tags of a function.
#[derive(Default)]
struct Notes {
    renamed: Option<String>,
    out: Option<String>,
    host: Option<(String, String)>,
    lab: Option<(String, String)>,
}

/// Reads the tagged functions of a file. Functions start in the first column, and their bodies end with `}` in the
/// first column.
fn read(path: &Path, text: &str, structs: &Structs, library: &mut Library) -> Result<()> {
    let lines: Vec<&str> = text.lines().collect();
    let mut tag: Option<(usize, Vec<String>, String)> = None;
    let mut notes = Notes::default();
    let mut at = 0;
    while at < lines.len() {
        let line = lines[at];
        let place = || format!("{}:{}", path.display(), at + 1);
        // Tags are kept until the head of a function takes them.
        if let Some(rest) = line.strip_prefix("// @eq ") {
            let (ids, formula) =
                rest.split_once(": ").ok_or_else(|| format!("{}: expected `@eq IDS: formula`", place()))?;
            if let Some((other, ..)) = tag {
                return Err(format!("{}: the tag of line {} has no function", place(), other + 1));
            }
            tag = Some((at, ids.split_whitespace().map(str::to_owned).collect(), formula.to_owned()));
        } else if let Some(name) = line.strip_prefix("// @name ") {
            tag.as_ref().ok_or_else(|| format!("{}: `@name` without an `@eq` above it", place()))?;
            notes.renamed = Some(name.to_owned());
        } else if let Some(name) = line.strip_prefix("// @out ") {
            tag.as_ref().ok_or_else(|| format!("{}: `@out` without an `@eq` above it", place()))?;
            notes.out = Some(name.to_owned());
        } else if let Some((kind, rest)) =
            ["host", "lab"].iter().find_map(|kind| Some((*kind, line.strip_prefix(&format!("// @{kind} "))?)))
        {
            tag.as_ref().ok_or_else(|| format!("{}: `@{kind}` without an `@eq` above it", place()))?;
            let (name, what) =
                rest.split_once(": ").ok_or_else(|| format!("{}: expected `@{kind} NAME: what`", place()))?;
            let pair = Some((name.to_owned(), what.to_owned()));
            if kind == "host" {
                notes.host = pair
            } else {
                notes.lab = pair
            };
        } else if is_head(without_comment(line)) {
            // A head may span lines: up to its `{`.
            let mut joined = String::new();
            let mut end = at;
            while end < lines.len() && !joined.contains('{') {
                joined += without_comment(lines[end]);
                joined.push(' ');
                end += 1;
            }
            if let Some(head) = head(&joined) {
                // The body is read for what the contract check holds against the SPIR-V: `precise`, loops and their
                // bounds.
                let mut source = Source { precise: joined.contains("precise "), ..Source::default() };
                let one_line = joined.contains('}');
                while end < lines.len() && !one_line && lines[end] != "}" {
                    let code = without_comment(lines[end]);
                    source.precise |= code.contains("precise ");
                    source.loops += ["for (", "while ("].iter().map(|word| code.matches(word).count()).sum::<usize>();
                    if let Some(heads) = lines[end].trim().strip_prefix("// @iterations ") {
                        source.heads.push(heads.trim().parse().map_err(|e| format!("{}: @iterations: {e}", place()))?);
                    }
                    end += 1;
                }
                // Overloads count as one function.
                let known = library.functions.entry(head.name.clone()).or_default();
                known.precise |= source.precise;
                known.loops += source.loops;
                known.heads.extend(source.heads);
                if let Some(tag) = tag.take() {
                    let equation = equation(&stem(path), head, tag, std::mem::take(&mut notes), structs);
                    library.equations.push(equation.map_err(|e| format!("{}: {e}", place()))?);
                }
                at = end;
            }
        }
        at += 1;
    }
    match tag {
        Some((line, ..)) => Err(format!("{}:{}: the tag has no function", path.display(), line + 1)),
        None => Ok(()),
    }
}

fn equation(
    subject: &str,
    head: Head,
    (at, ids, formula): (usize, Vec<String>, String),
    notes: Notes,
    structs: &Structs,
) -> Result<Equation> {
    let Notes { renamed, out, host, lab } = notes;
    // Parameters become input columns, and the call's arguments fetch them.
    let (mut inputs, mut whole) = (Vec::new(), Vec::new());
    let mut arguments = Vec::new();
    for (ty, name) in &head.parameters {
        arguments.push(argument(ty, name, structs, &mut inputs)?);
        if ty == "uint" {
            whole.push(name.clone());
        }
    }
    // The result becomes output columns: members of a struct by their names, a plain value by `@out`.
    let mut outputs = Vec::new();
    let mut stores = String::new();
    if let Some(members) = structs.get(&head.returns) {
        for (ty, name) in members {
            store(ty, name, &format!("result.{name}"), &mut outputs, &mut stores)?;
        }
        if out.is_some() {
            return Err(format!("{}: the members of {} name the outputs, not `@out`", head.name, head.returns));
        }
    } else {
        let name = out.ok_or("a plain result needs `@out NAME`")?;
        store(&head.returns, &name, "result", &mut outputs, &mut stores)?;
    }
    // The probe calls the function for one case per invocation.
    let Head { returns, name: function, .. } = head;
    let probe = format!(
        "#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include \"lib/{subject}.glsl\"
layout(pass, scalar) readonly buffer Inputs {{ uint inputs[]; }};
layout(pass, scalar) writeonly buffer Outputs {{ float outputs[]; }};
layout(push_constant, scalar) uniform Push {{ uint cases; }};
void main() {{
    uint i = gl_GlobalInvocationID.x;
    if (i >= cases) return;
    {returns} result = {function}({});
{stores}}}
",
        arguments.join(", ")
    );
    let name = renamed.unwrap_or_else(|| function.clone());
    Ok(Equation {
        function,
        name,
        ids,
        formula,
        subject: subject.to_owned(),
        line: at + 1,
        inputs,
        whole,
        outputs,
        host,
        lab,
        probe,
    })
}

fn components(ty: &str) -> Option<usize> {
    match ty {
        "float" => Some(1),
        "vec2" => Some(2),
        "vec3" => Some(3),
        "vec4" => Some(4),
        _ => None,
    }
}

/// GLSL expression that fetches one parameter; its columns are appended to `inputs`.
fn argument(ty: &str, name: &str, structs: &Structs, inputs: &mut Vec<String>) -> Result<String> {
    let mut word = |column: String| {
        inputs.push(column);
        format!("inputs[{} * cases + i]", inputs.len() - 1)
    };
    if ty == "uint" {
        return Ok(word(name.to_owned()));
    }
    let mut fetch = |column: String| format!("uintBitsToFloat({})", word(column));
    if let Some((array, rest)) = name.split_once('[') {
        // A spectrum in steps of 5 nm from 380 nm: s380, s385, …
        let count: usize = rest.trim_end_matches(']').parse().map_err(|_| format!("{name}: a literal length"))?;
        let values: Vec<_> = (0..count).map(|k| fetch(format!("{array}{}", 380 + 5 * k))).collect();
        return Ok(format!("{ty}[{count}]({})", values.join(", ")));
    }
    if let Some(members) = structs.get(ty) {
        let values: Vec<_> = members.iter().map(|(_, member)| fetch(format!("{name}{member}"))).collect();
        return Ok(format!("{ty}({})", values.join(", ")));
    }
    match (ty, components(ty)) {
        (_, Some(1)) => Ok(fetch(name.to_owned())),
        (_, Some(count)) => {
            let values: Vec<_> = "xyzw"[..count].chars().map(|axis| fetch(format!("{name}{axis}"))).collect();
            Ok(format!("{ty}({})", values.join(", ")))
        }
        ("bool", _) => Ok(format!("{} != 0.0", fetch(name.to_owned()))),
        _ => Err(format!("parameter {name}: no columns for the type {ty}")),
    }
}

fn store(ty: &str, name: &str, value: &str, outputs: &mut Vec<String>, stores: &mut String) -> Result<()> {
    let mut line = |column: String, expression: String| {
        *stores += &format!("    outputs[{} * cases + i] = {expression};\n", outputs.len());
        outputs.push(column);
    };
    match (ty, components(ty)) {
        (_, Some(1)) => line(name.to_owned(), value.to_owned()),
        (_, Some(count)) => {
            "xyzw"[..count].chars().for_each(|axis| line(format!("{name}{axis}"), format!("{value}.{axis}")));
        }
        ("DoubleFloat", _) => {
            line(format!("{name}hi"), format!("{value}.hi"));
            line(format!("{name}lo"), format!("{value}.lo"));
        }
        ("bool", _) => line(name.to_owned(), format!("{value} ? 1.0 : 0.0")),
        ("uint", _) => line(name.to_owned(), format!("float({value})")),
        _ => return Err(format!("result {name}: no columns for the type {ty}")),
    }
    Ok(())
}
