//! Shaders stay small when every call is inlined: builds, validation and drivers take their time for these instructions
//! (docs/decisions/shaderc.md, Few copies).

use std::path::Path;

/// The largest program, `path`, has 227 thousand; with each call written out it had 418.
const LARGEST: usize = 240_000;
/// All together have 1,349 thousand; they had 2,512.
const TOGETHER: usize = 1_420_000;

#[test]
fn formulas_stand_once_in_a_kernel() {
    let shaders = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders");
    let programs = etalon_reflect::inlined(&shaders).expect("shaders that compile");
    let sizes: Vec<(usize, &str)> =
        programs.iter().map(|(name, shares)| (shares.first().map_or(0, |entry| entry.whole), name.as_str())).collect();
    let (largest, name) = sizes.iter().max().copied().expect("a program");
    let together: usize = sizes.iter().map(|(size, _)| size).sum();
    let most = etalon_reflect::in_all(&programs);
    assert!(largest <= LARGEST, "{name} has {largest} instructions; most are of {:?}", &programs[name][..20]);
    assert!(together <= TOGETHER, "{together} instructions; most are of {:?}", &most[..20]);
    // They are counted: a program has its own, and those of its calls.
    let of = |name: &str| &programs[name];
    let path = &of("path")[0];
    assert_eq!((path.function.as_str(), path.copies), ("main", 1), "the entry point comes first");
    assert!(path.whole > path.own, "{path:?}");
    let traces = of("trace_rays").iter().find(|share| share.function == "traverse").expect("a traversal");
    assert!(traces.copies > 0 && traces.whole > traces.own, "{traces:?}");
}
