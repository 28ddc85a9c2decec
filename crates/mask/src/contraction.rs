//! Contracted arithmetic, as the compilers of GPUs make it: a product and a sum without `NoContraction` become one
//! fused multiply-add, and so do the steps of dot products and `fma`. Of a sum of two products the first is fused.
//!
//! Read the SPIR-V specification, decoration `NoContraction`. A fused multiply-add is computed in double precision,
//! where the product of two floats is exact and the sum has 29 more bits. Left as they are: products with matrices, and
//! what a driver makes of `mix`, `cross`, `normalize` and `length`.

use std::collections::{HashMap, HashSet};

use rspirv::binary::Assemble as _;
use rspirv::dr::{Builder, Instruction, Operand};
use rspirv::spirv::{Capability, Decoration, GlslStd450Op, Op, Word};

use crate::rewrite::{extended_set, float_size, loaded};

/// A product of floats or vectors of floats, the second factor of which may be a scalar.
#[derive(Clone, Copy)]
struct Product {
    factors: [Word; 2],
    scalar: bool,
}

/// What replaces an instruction.
enum Fused {
    /// (±) a product plus (±) a term.
    Sum { product: Product, negate_product: bool, term: Word, negate_term: bool },
    /// The sum of the products of components.
    Dot([Word; 2], u32),
}

/// The module with contracted sums; `None` if it is no module, or has none.
pub(crate) fn contracted(words: &[Word]) -> Option<Vec<Word>> {
    let (mut builder, modes) = loaded(words)?;
    let module = builder.module_ref();
    let extended = extended_set(module).map(Operand::IdRef);
    let kept: HashSet<Word> = module
        .annotations
        .iter()
        .filter(|a| a.operands.get(1) == Some(&Operand::Decoration(Decoration::NoContraction)))
        .filter_map(|a| a.operands.first().and_then(Operand::id_ref_any))
        .collect();
    let ids = |i: &Instruction| i.operands.iter().filter_map(Operand::id_ref_any).collect::<Vec<Word>>();
    let sizes: HashMap<Word, u32> = module
        .types_global_values
        .iter()
        .filter_map(|i| i.result_id)
        .filter_map(|kind| Some((kind, float_size(module, kind)?)))
        .collect();
    let mut found = Vec::new();
    for (f, function) in module.functions.iter().enumerate() {
        let free = |i: &&Instruction| i.result_id.is_some_and(|id| !kept.contains(&id));
        let all = function.blocks.iter().flat_map(|block| &block.instructions);
        let products: HashMap<Word, Product> = all
            .clone()
            .filter(free)
            .filter_map(|i| match (i.class.opcode, ids(i).as_slice()) {
                (Op::FMul, &[a, b]) => Some((i.result_id?, Product { factors: [a, b], scalar: false })),
                (Op::VectorTimesScalar, &[a, b]) => Some((i.result_id?, Product { factors: [a, b], scalar: true })),
                _ => None,
            })
            .collect();
        let kinds: HashMap<Word, Word> = all.filter_map(|i| Some((i.result_id?, i.result_type?))).collect();
        for (b, block) in function.blocks.iter().enumerate() {
            for (i, instruction) in block.instructions.iter().enumerate().filter(|(_, i)| free(i)) {
                let (Some(kind), Some(result)) = (instruction.result_type, instruction.result_id) else { continue };
                let Some(&size) = sizes.get(&kind) else { continue };
                let subtracts = instruction.class.opcode == Op::FSub;
                let operands = ids(instruction);
                let fused = match (instruction.class.opcode, operands.as_slice()) {
                    (Op::FAdd | Op::FSub, &[left, right]) => match (products.get(&left), products.get(&right)) {
                        (Some(&product), _) => {
                            Fused::Sum { product, negate_product: false, term: right, negate_term: subtracts }
                        }
                        (_, Some(&product)) => {
                            Fused::Sum { product, negate_product: subtracts, term: left, negate_term: false }
                        }
                        _ => continue,
                    },
                    (Op::ExtInst, &[_, a, b, term])
                        if instruction.operands.first() == extended.as_ref()
                            && instruction.operands.get(1)
                                == Some(&Operand::LiteralExtInstInteger(GlslStd450Op::Fma as u32)) =>
                    {
                        let product = Product { factors: [a, b], scalar: false };
                        Fused::Sum { product, negate_product: false, term, negate_term: false }
                    }
                    // Vectors that are no result of this function are constants, and fold.
                    (Op::Dot, &[a, b]) => match kinds.get(&a).or(kinds.get(&b)).and_then(|kind| sizes.get(kind)) {
                        Some(&size) => Fused::Dot([a, b], size),
                        None => continue,
                    },
                    _ => continue,
                };
                found.push(([f, b, i], [kind, result], size, fused));
            }
        }
    }
    if found.is_empty() {
        return None;
    }
    builder.capability(Capability::Float64);
    let changes: Vec<_> = found
        .into_iter()
        .map(|(place, [kind, result], size, fused)| {
            let mut writer = Writer { builder: &mut builder, kind, size, written: Vec::new() };
            match fused {
                Fused::Sum { product, negate_product, term, negate_term } => {
                    writer.sum(product, negate_product, (term, negate_term), result);
                }
                Fused::Dot(vectors, size) => writer.dot(vectors, size, result),
            }
            (place, writer.written)
        })
        .collect();
    let mut module = builder.module();
    module.execution_modes.extend(modes);
    // From the end, so that earlier places stay.
    for ([f, b, i], written) in changes.into_iter().rev() {
        module.functions[f].blocks[b].instructions.splice(i..=i, written);
    }
    Some(module.assemble())
}

/// Writes the instructions of one fused sum.
struct Writer<'b> {
    builder: &'b mut Builder,
    /// Type of the result, and its components.
    kind: Word,
    size: u32,
    written: Vec<Instruction>,
}

impl Writer<'_> {
    fn write(&mut self, op: Op, kind: Word, result: Option<Word>, operands: Vec<Operand>) -> Word {
        let result = result.unwrap_or_else(|| self.builder.id());
        self.written.push(Instruction::new(op, Some(kind), Some(result), operands));
        result
    }

    fn ids(&mut self, op: Op, kind: Word, operands: &[Word]) -> Word {
        self.write(op, kind, None, operands.iter().copied().map(Operand::IdRef).collect())
    }

    /// The type of doubles with as many components.
    fn double(&mut self, size: u32) -> Word {
        let double = self.builder.type_float(64, None);
        if size == 1 { double } else { self.builder.type_vector(double, size) }
    }

    fn sum(&mut self, of: Product, negate_product: bool, (term, negate_term): (Word, bool), result: Word) {
        let (double, one) = (self.double(self.size), self.double(1));
        let a = self.ids(Op::FConvert, double, &[of.factors[0]]);
        let b = self.ids(Op::FConvert, if of.scalar { one } else { double }, &[of.factors[1]]);
        let c = self.ids(Op::FConvert, double, &[term]);
        let mut product = self.ids(if of.scalar { Op::VectorTimesScalar } else { Op::FMul }, double, &[a, b]);
        if negate_product {
            product = self.ids(Op::FNegate, double, &[product]);
        }
        let whole = self.ids(if negate_term { Op::FSub } else { Op::FAdd }, double, &[product, c]);
        self.write(Op::FConvert, self.kind, Some(result), vec![Operand::IdRef(whole)]);
    }

    /// One product, to which the others are added, each with one rounding.
    fn dot(&mut self, [a, b]: [Word; 2], size: u32, result: Word) {
        let double = self.double(1);
        let mut sum = None;
        for k in 0..size {
            let [x, y] = [a, b].map(|vector| {
                let operands = vec![Operand::IdRef(vector), Operand::LiteralBit32(k)];
                let component = self.write(Op::CompositeExtract, self.kind, None, operands);
                self.ids(Op::FConvert, double, &[component])
            });
            let product = self.ids(Op::FMul, double, &[x, y]);
            let whole = match sum {
                None => product,
                Some(sum) => {
                    let sum = self.ids(Op::FConvert, double, &[sum]);
                    self.ids(Op::FAdd, double, &[product, sum])
                }
            };
            let last = (k + 1 == size).then_some(result);
            sum = Some(self.write(Op::FConvert, self.kind, last, vec![Operand::IdRef(whole)]));
        }
    }
}
