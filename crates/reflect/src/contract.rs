//! Checks of the SPIR-V of equations at every build, both on the unoptimised module and on the shipped one.
//!
//! - no RelaxedPrecision: every value has 32 bits;
//! - NoContraction wherever the source has `precise`; otherwise compensated sums have zero residuals (docs/numerics.md
//!   2);
//! - loop iterations stay below lavapipe's limit: it silently ends all loops of an invocation after 65,535;
//! - the built-ins of loose precision that each tier reaches, as a list for docs/equations.md.

use std::collections::{BTreeMap, BTreeSet};

use rspirv::dr::{Function, Module, Operand};
use rspirv::spirv::{Decoration, GlslStd450Op as GLOp, Op};

use crate::equations::Source;
use crate::files::Result;
use crate::reflect::Stage;
use crate::reflect::{Names, word};

/// Largest number of loop iterations of one call.
const HEADS: u32 = 60_000;

/// Facts about the code of an equation.
pub(crate) struct Facts {
    /// Extended instructions reached in each tier: fast, stable, compensated.
    pub(crate) builtins: [BTreeSet<String>; 3],
    /// Largest number of loop iterations in one call.
    pub(crate) heads: u32,
}

pub(crate) fn check(name: &str, module: &Module, shipped: &[u32], sources: &BTreeMap<String, Source>) -> Result<Facts> {
    let names = Names::new(module);
    let functions: BTreeMap<u32, &Function> =
        module.functions.iter().filter_map(|f| Some((f.def.as_ref()?.result_id?, f))).collect();
    let own_name = |id: u32| names.name(id).split('(').next().unwrap_or_default().to_owned();
    let mut loops: BTreeMap<String, usize> = BTreeMap::new();
    let mut marked: BTreeMap<String, bool> = BTreeMap::new();
    for (&id, function) in &functions {
        let lines = || function.blocks.iter().flat_map(|block| &block.instructions);
        let contracted =
            lines().filter_map(|line| line.result_id).any(|r| names.decorated(r, Decoration::NoContraction).is_some());
        *loops.entry(own_name(id)).or_default() += lines().filter(|line| line.class.opcode == Op::LoopMerge).count();
        *marked.entry(own_name(id)).or_default() |= contracted;
    }
    for (function, source) in sources {
        if source.precise && marked.get(function) == Some(&false) {
            return Err(format!("{name}: `precise` in {function} left no NoContraction"));
        }
        if calls_in_loops(function, &functions, &own_name, sources) {
            return Err(format!(
                "{name}: a loop of {function} calls a function that loops: heads multiply, unroll one"
            ));
        }
        if loops.get(function).is_some_and(|&found| found != source.heads.len()) {
            let (stated, found) = (source.heads.len(), loops[function]);
            return Err(format!("{name}: {function} has {found} loops and states `@iterations` of {stated}"));
        }
    }
    decorations(name, module, shipped)?;
    let mut facts = Facts { builtins: Default::default(), heads: 0 };
    let entry = module.entry_points.first().map_or(0, |line| word(&line.operands[1]));
    for tier in 0..3 {
        let mut heads = 0;
        reach(
            entry,
            tier,
            &names,
            &functions,
            &mut |function| {
                heads += sources.get(&own_name(function)).map_or(0, |source| source.heads.iter().sum());
            },
            &mut facts.builtins[tier as usize],
        );
        facts.heads = facts.heads.max(heads);
    }
    if facts.heads > HEADS {
        return Err(format!("{name}: {} loop heads in one call, more than {HEADS}", facts.heads));
    }
    Ok(facts)
}

/// Checks that the shipped module has no RelaxedPrecision, and has NoContraction where the source has `precise`.
pub(crate) fn decorations(name: &str, module: &Module, shipped: &[u32]) -> Result<()> {
    if shipped_decorations(shipped).any(|d| d == Decoration::RelaxedPrecision as u32) {
        return Err(format!("{name}: RelaxedPrecision in what ships"));
    }
    let contracted = |operand: &Operand| matches!(operand, Operand::Decoration(Decoration::NoContraction));
    let asked = module.annotations.iter().any(|line| line.operands.iter().any(contracted));
    if asked && !shipped_decorations(shipped).any(|d| d == Decoration::NoContraction as u32) {
        return Err(format!("{name}: optimisation dropped NoContraction"));
    }
    Ok(())
}

/// Names of the functions that a program calls (glslang removes functions without calls).
pub(crate) fn called(stages: &[Stage]) -> BTreeSet<String> {
    let of = |stage: &Stage| {
        let names = Names::new(&stage.module);
        let name = |f: &Function| {
            let id = f.def.as_ref().and_then(|line| line.result_id).unwrap_or(0);
            names.name(id).split('(').next().unwrap_or_default().to_owned()
        };
        stage.module.functions.iter().map(name).collect::<Vec<_>>()
    };
    stages.iter().flat_map(of).collect()
}

/// Whether a function with a loop calls another function with a loop. Stricter than a call inside the loop: the blocks
/// of the loop are not determined.
fn calls_in_loops(
    function: &str,
    functions: &BTreeMap<u32, &Function>,
    own_name: &impl Fn(u32) -> String,
    sources: &BTreeMap<String, Source>,
) -> bool {
    let loops = |name: &str| sources.get(name).is_some_and(|source| !source.heads.is_empty());
    let bodies = functions.iter().filter(|(id, _)| own_name(**id) == function);
    loops(function)
        && bodies
            .flat_map(|(_, body)| body.blocks.iter().flat_map(|block| &block.instructions))
            .filter(|line| line.class.opcode == Op::FunctionCall)
            .any(|line| loops(&own_name(word(&line.operands[0]))))
}

/// Extended instructions that are exact on every device.
const EXACT: &[GLOp] = &[
    GLOp::FAbs,
    GLOp::SAbs,
    GLOp::FSign,
    GLOp::SSign,
    GLOp::Floor,
    GLOp::Ceil,
    GLOp::Trunc,
    GLOp::RoundEven,
    GLOp::FMin,
    GLOp::UMin,
    GLOp::SMin,
    GLOp::FMax,
    GLOp::UMax,
    GLOp::SMax,
    GLOp::FClamp,
    GLOp::UClamp,
    GLOp::SClamp,
    GLOp::Ldexp,
    GLOp::FindILsb,
];

/// Decorations in SPIR-V of any version: rspirv 0.13 cannot load the version that ships.
fn shipped_decorations(words: &[u32]) -> impl Iterator<Item = u32> {
    let mut at = 5;
    std::iter::from_fn(move || {
        while at < words.len() {
            let (op, length) = (words[at] & 0xffff, (words[at] >> 16) as usize);
            let found = (op == Op::Decorate as u32).then(|| words[at + 2]);
            at += length.max(1);
            if found.is_some() {
                return found;
            }
        }
        None
    })
}

/// Traverses the blocks of `function` that the tier reaches, and recursively the functions of each call.
fn reach(
    function: u32,
    tier: u32,
    names: &Names,
    functions: &BTreeMap<u32, &Function>,
    enter: &mut impl FnMut(u32),
    builtins: &mut BTreeSet<String>,
) {
    enter(function);
    let Some(body) = functions.get(&function) else { return };
    let blocks: BTreeMap<u32, _> = body.blocks.iter().filter_map(|b| Some((b.label.as_ref()?.result_id?, b))).collect();
    let mut seen = BTreeSet::new();
    let mut open: Vec<u32> = body.blocks.first().and_then(|b| b.label.as_ref()?.result_id).into_iter().collect();
    while let Some(id) = open.pop() {
        if !seen.insert(id) {
            continue;
        }
        for line in &blocks[&id].instructions {
            match line.class.opcode {
                Op::ExtInst => {
                    if let Operand::LiteralExtInstInteger(number) = line.operands[1] {
                        let known = GLOp::from_u32(number);
                        if !known.is_some_and(|op| EXACT.contains(&op)) {
                            builtins.insert(known.map_or(format!("#{number}"), |op| format!("{op:?}")));
                        }
                    }
                }
                Op::FDiv => drop(builtins.insert("/".to_owned())),
                Op::Dot => drop(builtins.insert("Dot".to_owned())),
                Op::FunctionCall => reach(word(&line.operands[0]), tier, names, functions, enter, builtins),
                Op::Branch => open.push(word(&line.operands[0])),
                Op::BranchConditional => {
                    let [condition, yes, no] = [0, 1, 2].map(|k| word(&line.operands[k]));
                    match decided(condition, tier, names) {
                        Some(true) => open.push(yes),
                        Some(false) => open.push(no),
                        None => open.extend([yes, no]),
                    }
                }
                _ => {}
            }
        }
    }
}

/// The value of `ARITHMETIC == constant` or `ARITHMETIC != constant` in a tier.
fn decided(condition: u32, tier: u32, names: &Names) -> Option<bool> {
    let line = names.types.get(&condition).filter(|line| line.class.opcode == Op::SpecConstantOp)?;
    let [Operand::LiteralSpecConstantOpInteger(op), left, right] = &line.operands[..] else { return None };
    let value = |operand: &Operand| {
        let id = word(operand);
        let named = names.decorated(id, Decoration::SpecId).is_some() && names.name(id) == "ARITHMETIC";
        if named { tier } else { names.constant(id) }
    };
    match op {
        Op::IEqual => Some(value(left) == value(right)),
        Op::INotEqual => Some(value(left) != value(right)),
        _ => None,
    }
}

/// A list of names as a Rust array.
pub(crate) fn list<'a>(names: impl IntoIterator<Item = &'a String>) -> String {
    let quoted: Vec<_> = names.into_iter().map(|name| format!("{name:?}")).collect();
    format!("&[{}]", quoted.join(", "))
}
