//! Lookup tables of shaders as storage buffers instead of storage texel buffers.
//!
//! Read the Vulkan specification, chapter Resource Descriptors (Storage Texel Buffer, Storage Buffer) and the SPIR-V
//! specification (`OpImageRead`, `OpAccessChain`). `imageBuffer` is the fastest fetch on lavapipe
//! (docs/decisions/lavapipe.md). Elsewhere its views hold too little: 65,536 texels on SwiftShader, 2^27 on NVIDIA and
//! Intel, which six textures of 4096 x 4096 fill. Shaders are written for texel buffers; this file rewrites their
//! SPIR-V: a texel buffer becomes an array of the same numbers in a storage buffer, and nothing else changes. Robust
//! buffer access (`device.rs`) keeps reads out of bounds harmless.

use std::collections::{BTreeMap, HashMap};

use spirv::{Decoration, Dim, ImageFormat, Op, StorageClass};

use super::specialize::{BOUND, HEADER, instructions, op};

/// The ids of a texel buffer's type and of the storage buffer types that replace it.
struct TexelTable {
    /// Type of a component, and of a texel after a read.
    scalar: u32,
    texel: u32,
    /// Stored components per texel; a texel after a read has four.
    stored: u32,
    /// Type of a stored texel, and of a pointer to it.
    element: u32,
    pointer: u32,
    array: u32,
    block: u32,
    pointer_to_block: u32,
}

fn stored(format: u32) -> u32 {
    match ImageFormat::from_u32(format) {
        Some(ImageFormat::R32f | ImageFormat::R32ui) => 1,
        Some(ImageFormat::Rg32f) => 2,
        Some(ImageFormat::Rgba32f | ImageFormat::Rgba32ui) => 4,
        other => panic!("a texel buffer of {other:?}: the build knows no such format"),
    }
}

fn put(out: &mut Vec<u32>, operation: Op, operands: &[u32]) {
    out.push((operands.len() as u32 + 1) << 16 | operation as u32);
    out.extend_from_slice(operands);
}

/// Ids of types and constants by their declaration: a module may not declare one twice.
struct KnownIds {
    by_words: HashMap<Vec<u32>, u32>,
    bound: u32,
    declared: Vec<u32>,
}

impl KnownIds {
    fn new_id(&mut self) -> u32 {
        self.bound += 1;
        self.bound - 1
    }

    /// The id of the type with this declaration.
    fn typed(&mut self, operation: Op, of: &[u32]) -> u32 {
        self.id(operation, of, 0)
    }

    fn constant(&mut self, ty: u32, bits: u32) -> u32 {
        self.id(Op::Constant, &[ty, bits], 1)
    }

    /// The id of a declaration; its result id stands after `before` operands.
    fn id(&mut self, operation: Op, of: &[u32], before: usize) -> u32 {
        let key = [&[operation as u32][..], of].concat();
        if let Some(&known) = self.by_words.get(&key) {
            return known;
        }
        let id = self.new_id();
        put(&mut self.declared, operation, &[&of[..before], &[id], &of[before..]].concat());
        self.by_words.insert(key, id);
        id
    }
}

/// `words` with every texel buffer as a storage buffer of the same set and slot.
///
/// # Panics
/// When the module uses texel buffers for anything but reads and writes, which no shader of Etalon does.
#[must_use]
pub fn with_tables_in_storage(words: &[u32]) -> Vec<u32> {
    let places = instructions(words, HEADER);
    let all = |operation: Op| {
        let found = places.iter().filter(move |at| op(words, at) == Some(operation));
        found.map(|at| &words[at.start + 1..at.end])
    };
    let is_texels = |of: &&[u32]| of[2] == Dim::DimBuffer as u32;
    if !all(Op::TypeImage).any(|of| is_texels(&of)) {
        return words.to_vec();
    }
    let mut known = KnownIds { by_words: HashMap::new(), bound: words[BOUND], declared: Vec::new() };
    for (operation, before) in
        [(Op::TypeInt, 0), (Op::TypeFloat, 0), (Op::TypeVector, 0), (Op::TypePointer, 0), (Op::Constant, 1)]
    {
        for of in all(operation) {
            let key = [&[operation as u32], &of[..before], &of[before + 1..]].concat();
            known.by_words.insert(key, of[before]);
        }
    }
    let storage = StorageClass::StorageBuffer as u32;
    let uint = known.typed(Op::TypeInt, &[32, 0]);
    let first = known.constant(uint, 0);
    let mut tables = BTreeMap::new();
    for of in all(Op::TypeImage).filter(is_texels) {
        let (scalar, stored) = (of[1], stored(of[7]));
        let texel = known.typed(Op::TypeVector, &[scalar, 4]);
        let element = if stored == 1 { scalar } else { known.typed(Op::TypeVector, &[scalar, stored]) };
        let pointer = known.typed(Op::TypePointer, &[storage, element]);
        // Arrays and structs may be declared twice, because their decorations differ.
        let [array, block, pointer_to_block] = [known.new_id(), known.new_id(), known.new_id()];
        put(&mut known.declared, Op::TypeRuntimeArray, &[array, element]);
        put(&mut known.declared, Op::TypeStruct, &[block, array]);
        put(&mut known.declared, Op::TypePointer, &[pointer_to_block, storage, block]);
        tables.insert(of[0], TexelTable { scalar, texel, stored, element, pointer, array, block, pointer_to_block });
    }
    let pointers: HashMap<u32, &TexelTable> =
        all(Op::TypePointer).filter_map(|of| Some((of[0], tables.get(&of[2])?))).collect();
    let mut variables = HashMap::new();
    for of in all(Op::Variable) {
        if let Some(&table) = pointers.get(&of[0]) {
            put(&mut known.declared, Op::Variable, &[table.pointer_to_block, of[1], storage]);
            variables.insert(of[1], table);
        }
    }

    let mut out = words[..HEADER].to_vec();
    // Texel buffers that the function has loaded: variable and table, by the id of the load.
    let mut loaded: HashMap<u32, (u32, &TexelTable)> = HashMap::new();
    let mut bodies = Vec::new();
    let first_function = places.iter().position(|at| op(words, at) == Some(Op::Function)).unwrap_or(places.len());
    for at in &places[first_function..] {
        let operands = &words[at.start + 1..at.end];
        match op(words, at) {
            Some(Op::Load) if variables.contains_key(&operands[2]) => {
                loaded.insert(operands[1], (operands[2], variables[&operands[2]]));
            }
            Some(Op::ImageRead) if loaded.contains_key(&operands[2]) => {
                let (variable, table) = loaded[&operands[2]];
                let is_whole = table.stored == 4;
                let (place, value) = (known.new_id(), if is_whole { operands[1] } else { known.new_id() });
                put(&mut bodies, Op::AccessChain, &[table.pointer, place, variable, first, operands[3]]);
                put(&mut bodies, Op::Load, &[table.element, value, place]);
                if !is_whole {
                    // Missing components are 0, and 1 for the last, as in an image of that format.
                    let is_float = known.by_words.get(&vec![Op::TypeFloat as u32, 32]) == Some(&table.scalar);
                    let zero = known.constant(table.scalar, 0);
                    let one = known.constant(table.scalar, if is_float { 1.0_f32.to_bits() } else { 1 });
                    let zeros = vec![zero; 3 - table.stored as usize];
                    let parts = [&[table.texel, operands[1], value], &zeros[..], &[one]].concat();
                    put(&mut bodies, Op::CompositeConstruct, &parts);
                }
            }
            Some(Op::ImageWrite) if loaded.contains_key(&operands[0]) => {
                let (variable, table) = loaded[&operands[0]];
                let (place, texel) = (known.new_id(), operands[2]);
                put(&mut bodies, Op::AccessChain, &[table.pointer, place, variable, first, operands[1]]);
                let value = if table.stored == 4 { texel } else { known.new_id() };
                match table.stored {
                    1 => put(&mut bodies, Op::CompositeExtract, &[table.element, value, texel, 0]),
                    2 => put(&mut bodies, Op::VectorShuffle, &[table.element, value, texel, texel, 0, 1]),
                    _ => {}
                }
                put(&mut bodies, Op::Store, &[place, value]);
            }
            operation => {
                let other = matches!(operation, Some(Op::ImageQuerySize | Op::ImageTexelPointer));
                assert!(!other || !loaded.contains_key(&operands[2]), "a texel buffer is read and written, no more");
                bodies.extend_from_slice(&words[at.clone()]);
            }
        }
    }

    let mut are_decorated = false;
    for at in &places[..first_function] {
        let instruction = &words[at.clone()];
        if !are_decorated && (Op::TypeVoid as u32..=Op::TypeForwardPointer as u32).contains(&(instruction[0] & 0xffff))
        {
            are_decorated = true;
            for table in tables.values() {
                put(&mut out, Op::Decorate, &[table.array, Decoration::ArrayStride as u32, 4 * table.stored]);
                put(&mut out, Op::Decorate, &[table.block, Decoration::Block as u32]);
                put(&mut out, Op::MemberDecorate, &[table.block, 0, Decoration::Offset as u32, 0]);
            }
        }
        let is_replaced = op(words, at) == Some(Op::Variable) && variables.contains_key(&instruction[2]);
        if !is_replaced {
            out.extend_from_slice(instruction);
        }
    }
    // These come last, after all declarations that they refer to.
    out.extend(known.declared);
    out.extend(bodies);
    out[BOUND] = known.bound;
    out
}
