//! Shaders stay small when every call is inlined: builds, validation and drivers take their time for these instructions
//! (docs/decisions/shaderc.md, Few copies).

use std::path::Path;

/// The largest stage, `path.comp`, has 240 thousand, a few hundred of them for random numbers that blocks of pixels
/// share; with each call written out it had 418.
const LARGEST: usize = 240_500;
/// All together have 1,525 thousand, 3 of them for what GPUs find anew, 5 for candidates of light samples, 1 for the
/// environment in rough lobes and 1 for denoising; they had 2,508.
const TOGETHER: usize = 1_525_000;

#[test]
fn formulas_stand_once_in_a_kernel() {
    let shaders = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders");
    let stages = etalon_reflect::inlined(&shaders).expect("shaders that compile");
    let sizes: Vec<(usize, &str)> =
        stages.iter().map(|(name, shares)| (shares.first().map_or(0, |entry| entry.whole), name.as_str())).collect();
    let (largest, name) = sizes.iter().max().copied().expect("a stage");
    let together: usize = sizes.iter().map(|(size, _)| size).sum();
    let most = etalon_reflect::by_function(&stages);
    assert!(largest <= LARGEST, "{name} has {largest} instructions; most are of {:?}", &stages[name][..20]);
    assert!(together <= TOGETHER, "{together} instructions; most are of {:?}", &most[..20]);
    // They are counted: a stage has its own, and those of its calls.
    let of = |name: &str| &stages[name];
    let path = &of("path.comp")[0];
    assert_eq!((path.function.as_str(), path.copies), ("main", 1), "the entry point comes first");
    assert!(path.whole > path.own, "{path:?}");
    let traces = of("trace_rays.comp").iter().find(|share| share.function == "traverse").expect("a traversal");
    assert!(traces.copies > 0 && traces.whole > traces.own, "{traces:?}");
}
