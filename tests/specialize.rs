//! Specialized shaders are valid SPIR-V without specialization constants, for all values of the constants, and they are
//! much smaller. All tests of pictures and equations check that they compute the same.

use etalon::gpu::{
    specialized, with_float_controls, with_loops_counted, with_tables_in_storage, without_primitive_ids,
};
use etalon::shader::PROGRAMS;
use etalon_testing::gpu::Gpu;
use spirv::Op;

fn instructions(words: &[u32]) -> Vec<&[u32]> {
    let mut rest = &words[5..];
    let mut all = Vec::new();
    while let Some(first) = rest.first() {
        let (one, more) = rest.split_at((first >> 16) as usize);
        all.push(one);
        rest = more;
    }
    all
}

fn op(instruction: &[u32]) -> Op {
    Op::from_u32(instruction[0] & 0xffff).expect("a known instruction")
}

/// Id of each specialization constant of a module, with the values that it may have here: what counts something is at
/// least 1.
fn constants(words: &[u32]) -> Vec<(u32, Vec<u32>)> {
    let all = instructions(words);
    let numbered = all.iter().filter(|one| op(one) == Op::Decorate && one[2] == spirv::Decoration::SpecId as u32);
    numbered
        .map(|decoration| {
            let forms = [Op::SpecConstant, Op::SpecConstantTrue, Op::SpecConstantFalse];
            let declared = |one: &&&[u32]| forms.contains(&op(one)) && one[2] == decoration[1];
            let constant = all.iter().find(declared).expect("what is decorated is declared");
            let values = match op(constant) {
                Op::SpecConstantTrue | Op::SpecConstantFalse => vec![0, 1],
                Op::SpecConstant if constant[3] == 0 => vec![0, 1, 2, 3],
                Op::SpecConstant => vec![1, 2, 3],
                other => panic!("{other:?} is no constant"),
            };
            (decoration[3], values)
        })
        .collect()
}

/// Variables that are buffers of texels.
fn reads_texels(words: &[u32]) -> usize {
    let all = instructions(words);
    let of = |operation: Op| all.iter().filter(move |one| op(one) == operation);
    let images: Vec<u32> =
        of(Op::TypeImage).filter(|one| one[3] == spirv::Dim::DimBuffer as u32).map(|one| one[1]).collect();
    let pointers: Vec<u32> = of(Op::TypePointer).filter(|one| images.contains(&one[3])).map(|one| one[1]).collect();
    of(Op::Variable).filter(|one| pointers.contains(&one[1])).count()
}

#[test]
fn what_is_left_is_valid_whatever_the_constants_are() {
    let gpu = Gpu::open();
    let mut seed = 1_u32;
    let mut random = |below: usize| {
        seed = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (seed >> 16) as usize % below
    };
    for stage in PROGRAMS.iter().flat_map(|program| program.stages.iter()) {
        let constants = constants(stage.words);
        let rounds = if constants.is_empty() { 1 } else { 24 };
        for round in 0..rounds {
            let told: Vec<(u32, u32)> = constants
                .iter()
                .map(|(id, values)| (*id, if round == 0 { values[0] } else { values[random(values.len())] }))
                .collect();
            let left = specialized(stage.words, &told);
            assert!(left.len() <= stage.words.len());
            let forms = [
                Op::SpecConstant,
                Op::SpecConstantTrue,
                Op::SpecConstantFalse,
                Op::SpecConstantOp,
                Op::SpecConstantComposite,
            ];
            assert!(instructions(&left).iter().all(|one| !forms.contains(&op(one))));
            gpu.device.try_module(&left).expect("a module");
            assert!(gpu.errors().is_empty(), "{told:?}: {:?}", gpu.errors());
            assert_eq!(specialized(&left, &[]), left, "{told:?}: a second time there is nothing to do");
            for counts in [false, true] {
                gpu.device.try_module(&with_loops_counted(&left, counts)).expect("a module");
                assert!(gpu.errors().is_empty(), "loops counted {counts}: {told:?}: {:?}", gpu.errors());
            }
            // For devices that fetch no texels and know no triangles in fragments.
            let controlled = with_float_controls(&left, gpu.device.offers());
            let other = with_tables_in_storage(&without_primitive_ids(&controlled));
            gpu.device.try_module(&other).expect("a module");
            assert!(gpu.errors().is_empty(), "tables in storage: {told:?}: {:?}", gpu.errors());
            let asks = |capability| {
                let is = |one: &&[u32]| op(one) == Op::Capability && one[1] == capability as u32;
                instructions(&other).iter().any(is)
            };
            assert!(!asks(spirv::Capability::Geometry) && asks(spirv::Capability::SignedZeroInfNanPreserve));
            assert!(reads_texels(&other) == 0 && (reads_texels(&left) == 0 || other.len() > left.len()), "{told:?}");
        }
    }
}

#[test]
fn what_constants_rule_out_is_gone() {
    let light = PROGRAMS.iter().find(|program| program.name == "light").expect("the program");
    let words = light.stages[0].words;
    let least: Vec<(u32, u32)> = constants(words).iter().map(|(id, values)| (*id, values[0])).collect();
    let left = specialized(words, &least);
    // No lights, no shadows, no rays: of 0.57 MB little is left.
    assert!(left.len() * 10 < words.len(), "{} of {} words", left.len(), words.len());
    let loops = |words: &[u32]| instructions(words).iter().filter(|one| op(one) == Op::LoopMerge).count();
    assert_eq!(loops(&left), 0);
    let adds = |words: &[u32]| {
        let capability = spirv::Capability::GroupNonUniformArithmetic as u32;
        instructions(words).iter().any(|one| op(one) == Op::Capability && one[1] == capability)
    };
    assert!(adds(words) && !adds(&left));
    assert!(loops(words) > 10);
}

/// A loop that is left in its first turn where constant 0 is true.
fn loop_with_an_end() -> Vec<u32> {
    let [main, void, signature, flag, uint, leave, zero, one] = [1, 2, 3, 4, 5, 6, 7, 8];
    let [entry, head, body, rest, goes_on, after, i, next] = [9, 10, 11, 12, 13, 14, 15, 16];
    let instructions: [(Op, &[u32]); 25] = [
        (Op::Capability, &[1]),
        (Op::MemoryModel, &[0, 1]),
        (Op::EntryPoint, &[5, main, u32::from_le_bytes(*b"main"), 0]),
        (Op::ExecutionMode, &[main, 17, 1, 1, 1]),
        (Op::Decorate, &[leave, spirv::Decoration::SpecId as u32, 0]),
        (Op::TypeVoid, &[void]),
        (Op::TypeFunction, &[signature, void]),
        (Op::TypeBool, &[flag]),
        (Op::TypeInt, &[uint, 32, 0]),
        (Op::SpecConstantFalse, &[flag, leave]),
        (Op::Constant, &[uint, zero, 0]),
        (Op::Constant, &[uint, one, 1]),
        (Op::Function, &[void, main, 0, signature]),
        (Op::Label, &[entry]),
        (Op::Branch, &[head]),
        (Op::Label, &[head]),
        (Op::Phi, &[uint, i, zero, entry, next, goes_on]),
        (Op::LoopMerge, &[after, goes_on, 0]),
        (Op::Branch, &[body]),
        (Op::Label, &[body]),
        (Op::SelectionMerge, &[rest, 0]),
        (Op::BranchConditional, &[leave, after, rest]),
        (Op::Label, &[rest]),
        (Op::Branch, &[goes_on]),
        (Op::Label, &[goes_on]),
    ];
    let end: [(Op, &[u32]); 5] = [
        (Op::IAdd, &[uint, next, i, one]),
        (Op::Branch, &[head]),
        (Op::Label, &[after]),
        (Op::Return, &[]),
        (Op::FunctionEnd, &[]),
    ];
    let mut words = vec![spirv::MAGIC_NUMBER, 0x10600, 0, 17, 0];
    for (op, operands) in instructions.iter().chain(&end) {
        words.push((operands.len() as u32 + 1) << 16 | *op as u32);
        words.extend_from_slice(operands);
    }
    words
}

#[test]
fn a_loop_that_never_goes_on_stays_a_loop() {
    let gpu = Gpu::open();
    let words = loop_with_an_end();
    gpu.device.try_module(&words).expect("a module");
    for (value, adds) in [(0, true), (1, false)] {
        let left = specialized(&words, &[(0, value)]);
        assert_eq!(specialized(&left, &[]), left, "a second time there is nothing to do");
        gpu.device.try_module(&left).expect("a module");
        assert_eq!(instructions(&left).iter().any(|one| op(one) == Op::IAdd), adds);
        assert_eq!(instructions(&left).iter().any(|one| op(one) == Op::Undef), !adds);
        assert_eq!(instructions(&left).iter().filter(|one| op(one) == Op::LoopMerge).count(), 1);
    }
    assert!(gpu.errors().is_empty(), "{:?}", gpu.errors());
}

#[test]
fn every_loop_counts_where_the_count_is_read() {
    let mut counted_programs = 0;
    for stage in PROGRAMS.iter().flat_map(|program| program.stages.iter()) {
        let loops = |words: &[u32]| instructions(words).iter().filter(|one| op(one) == Op::LoopMerge).count();
        let stores_before_loops = |words: &[u32]| {
            let all = instructions(words);
            all.windows(2).filter(|pair| op(pair[0]) == Op::Store && op(pair[1]) == Op::LoopMerge).count()
        };
        let counted = with_loops_counted(stage.words, true);
        let reads = counted != with_loops_counted(stage.words, false);
        let added = stores_before_loops(&counted) - stores_before_loops(stage.words);
        assert_eq!(added, if reads { loops(stage.words) } else { 0 });
        counted_programs += usize::from(reads);
    }
    // Lighting, reflection and refraction, transparent surfaces, paths.
    assert!(counted_programs >= 4, "{counted_programs}");
}
