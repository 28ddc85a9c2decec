//! BVH construction: parallel locally-ordered clustering (PLOC), then two optimisations of the crate `obvhs`.
//!
//! Read Meister and Bittner 2018, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction" and
//! "Parallel Reinsertion for Bounding Volume Hierarchy Optimization". Clustering sorts boxes by Morton code. Each box
//! finds the neighbour within a search radius whose common box has the smallest surface area, and mutual nearest
//! neighbours merge, until one cluster is left. Reinsertion then moves subtrees to lower the surface area heuristic
//! (SAH), and small subtrees collapse into leaves.
//!
//! The clustering is implemented here, because a round of the crate's merges only mutual pairs, and in some scenes that
//! is one pair a round: 20 000 equal boxes in a row, such as the posts of a fence, took it 6.3 s and 20 000 nested
//! boxes 12.7 s, both growing with the square. Here both sides of a pair break ties the same way, and a round with too
//! few mutual pairs merges neighbours in order.

use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::bvh2::{Bvh2, DEFAULT_MAX_STACK_DEPTH};
use obvhs::ploc::morton::morton_encode_u64_unorm;
use rayon::prelude::*;

use super::aabb::Aabb;

/// Search radius: neighbours on either side. With 14 a million triangles of one surface take 0.1 s longer at equal
/// cost; a building of 390 000 costs 0.3 to 1.8 % less.
const RADIUS: usize = 8;

/// A round with fewer than one mutual pair in this many clusters merges in order instead. Of a million triangles one
/// pair in two to six clusters is mutual until ten thousand clusters are left; the first round in order comes below two
/// thousand.
const STALLED: usize = 16;

/// Share of the nodes in the first pass of reinsertion, before and after leaves collapse. 0.1 before takes 120 ms more
/// at a million triangles and gains 0.4 %.
const REINSERTED: [f32; 2] = [0.05, 0.1];

/// Largest number of triangles in a collapsed leaf.
const LEAF: u32 = 4;

/// Cost of an inner node relative to a triangle test, for collapsing (SAH). With 2 a third of the nodes disappears; a
/// ray takes 3 % fewer steps and tests 30 to 40 % more triangles.
const STEP: f32 = 1.0;

/// A BVH with one leaf entry per box. There must be at least one box; all are finite, and not all are one point.
///
/// The same boxes give the same tree on any number of threads. Only the topology of the result is meaningful: its boxes
/// are scaled.
pub(super) fn arrange(boxes: &[Aabb]) -> Bvh2 {
    let (mut tree, by_order) = cluster(boxes);
    // Many merges in order mean that boxes are nested. Reinsertion then takes time that grows with the square (200 000:
    // 4.3 s), gains nothing and makes the tree deep (14 000 levels instead of 26).
    let reinserted = if by_order * 4 > boxes.len() { [0.0; 2] } else { REINSERTED };
    let mut reinsertion = ReinsertionOptimizer::default();
    reinsertion.run(&mut tree, reinserted[0], None);
    collapse(&mut tree, LEAF, STEP);
    reinsertion.run(&mut tree, reinserted[1], None);
    tree
}

/// The boxes, scaled so that the longest side of the scene is 1 … 2: surface areas neither overflow nor underflow. A
/// power of two changes no comparison.
fn scaled(boxes: &[Aabb]) -> (Aabb, Vec<obvhs::aabb::Aabb>) {
    let all = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b));
    let side = (0..3).map(|axis| all.size(axis)).fold(0.0, f64::max);
    let scale = 2.0_f64.powi(-side.log2().floor() as i32);
    let part = |corner: [f32; 3]| corner.map(|x| (f64::from(x) * scale) as f32);
    let one = |b: &Aabb| Aabb { min: part(b.min), max: part(b.max) };
    let foreign = |b: &Aabb| obvhs::aabb::Aabb::new(one(b).min.into(), one(b).max.into());
    (one(&all), boxes.iter().map(foreign).collect())
}

/// Bottom-up clustering; also returns the number of merges that were made in order.
fn cluster(boxes: &[Aabb]) -> (Bvh2, usize) {
    let (all, boxes) = scaled(boxes);
    // Just below 1 at the far side: the Morton code has 21 bits per coordinate, and 1 would wrap to 0.
    let cells: [f64; 3] = [0, 1, 2].map(|axis| (1.0 - 1e-9) / all.size(axis).max(1e-30));
    let code = |b: &obvhs::aabb::Aabb| {
        let center: [f32; 3] = b.center().into();
        let unit = [0, 1, 2].map(|axis| (f64::from(center[axis]) - f64::from(all.min[axis])) * cells[axis]);
        morton_encode_u64_unorm(unit.into())
    };
    // The index makes all keys different, so an unstable sort has a unique result.
    let mut keys: Vec<(u64, u32)> = boxes.par_iter().enumerate().map(|(i, b)| (code(b), i as u32)).collect();
    keys.par_sort_unstable();

    let mut clusters: Vec<Bvh2Node> = keys.iter().map(|&(_, i)| Bvh2Node::new(boxes[i as usize], 1, i)).collect();
    let mut joined = Vec::with_capacity(clusters.len());
    let mut best: Vec<u32> = Vec::new();
    // Siblings are adjacent, and the array is filled from its end: parents precede their children, the root is first.
    let mut nodes = vec![Bvh2Node::default(); 2 * clusters.len() - 1];
    let mut free = nodes.len();
    let mut by_order = 0;
    while clusters.len() > 1 {
        let nearest = |i| nearest(&clusters, i) as u32;
        (0..clusters.len()).into_par_iter().with_min_len(2048).map(nearest).collect_into_vec(&mut best);
        let agreed = (0..best.len()).filter(|&i| best[i] as usize > i && best[best[i] as usize] as usize == i).count();
        if agreed * STALLED < clusters.len() {
            by_order += clusters.len() / 2;
            best = (0..clusters.len()).map(|i| (i ^ 1).min(clusters.len() - 1) as u32).collect();
        }
        joined.clear();
        for (i, cluster) in clusters.iter().enumerate() {
            let other = best[i] as usize;
            if other == i || best[other] as usize != i {
                joined.push(*cluster);
            } else if other > i {
                free -= 2;
                nodes[free] = *cluster;
                nodes[free + 1] = clusters[other];
                let bounds = cluster.aabb().union(clusters[other].aabb());
                joined.push(Bvh2Node::new(bounds, 0, free as u32));
            }
        }
        std::mem::swap(&mut clusters, &mut joined);
    }
    nodes[0] = clusters[0];
    let tree = Bvh2 {
        primitive_indices: (0..boxes.len() as u32).collect(),
        nodes,
        // Reinsertion then searches with a stack of fixed size, which skips candidates in deeper trees; a larger value
        // panics there.
        max_depth: DEFAULT_MAX_STACK_DEPTH,
        ..Bvh2::default()
    };
    (tree, by_order)
}

/// The neighbour whose common box with cluster `i` has the smallest surface area. Ties are broken by `i ^ j`, which is
/// the same from both sides: in a row of equal boxes 0 finds 1 and 2 finds 3.
fn nearest(clusters: &[Bvh2Node], i: usize) -> usize {
    let own = *clusters[i].aabb();
    let (mut best, mut least) = (i, f32::INFINITY);
    let mut look = |j: usize| {
        let surface = own.union(clusters[j].aabb()).half_area();
        if surface < least || (surface == least && i ^ j < i ^ best) {
            (best, least) = (j, surface);
        }
    };
    (i.saturating_sub(RADIUS)..i).for_each(&mut look);
    (i + 1..(i + RADIUS + 1).min(clusters.len())).for_each(&mut look);
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(count: u32, shape: impl Fn(f32) -> ([f32; 3], [f32; 3])) -> Vec<Aabb> {
        (0..count).map(|i| shape(i as f32)).map(|(min, max)| Aabb { min, max }).collect()
    }

    fn depth(tree: &Bvh2) -> usize {
        let mut deepest = 0;
        let mut open = vec![(0, 0)];
        while let Some((i, depth)) = open.pop() {
            deepest = deepest.max(depth);
            let node = &tree.nodes[i];
            if !node.is_leaf() {
                let child = node.first_index as usize;
                open.extend([(child, depth + 1), (child + 1, depth + 1)]);
            }
        }
        deepest
    }

    fn row(count: u32) -> Vec<Aabb> {
        boxes(count, |x| ([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]))
    }

    fn pile(count: u32) -> Vec<Aabb> {
        boxes(count, |_| ([-1.0; 3], [1.0; 3]))
    }

    /// A grid of equal squares, which has many ties.
    fn grid(count: u32) -> Vec<Aabb> {
        boxes(count, |i| {
            let (x, z) = (i % 77.0, (i / 77.0).floor());
            ([x, 0.0, z], [x + 1.0, 0.0, z + 1.0])
        })
    }

    /// The topology of a tree, without its boxes.
    fn shape(tree: Bvh2) -> (Vec<(u32, u32)>, Vec<u32>) {
        (tree.nodes.iter().map(|n| (n.prim_count, n.first_index)).collect(), tree.primitive_indices)
    }

    /// One pair per round would make these trees as deep as their number of boxes, in time that grows with the square.
    #[test]
    fn rows_piles_and_nests_of_boxes_give_flat_trees() {
        let n = 4096;
        let nest = boxes(n, |x| ([-x - 1.0; 3], [x + 1.0; 3]));
        let corner = boxes(n, |x| ([0.0; 3], [x + 1.0; 3]));
        for (name, boxes) in [("row", row(n)), ("pile", pile(n)), ("nest", nest), ("corner", corner)] {
            let depth = depth(&arrange(&boxes));
            assert!((10..=24).contains(&depth), "{name}: {depth}");
        }
    }

    /// Merges in order ignore positions, so ties must not cause them.
    #[test]
    fn equal_costs_need_no_pairs_by_order() {
        for boxes in [row(5000), pile(5000), grid(5000)] {
            assert_eq!(cluster(&boxes).1, 0);
        }
    }

    #[test]
    fn the_unit_of_length_changes_nothing() {
        let in_metres = grid(3000);
        let expected = shape(arrange(&in_metres));
        for power in [-100, -30, 30, 100] {
            let scale = |corner: [f32; 3]| corner.map(|x| x * 2.0_f32.powi(power));
            let scaled: Vec<Aabb> = in_metres.iter().map(|b| Aabb { min: scale(b.min), max: scale(b.max) }).collect();
            assert!(shape(arrange(&scaled)) == expected, "2^{power}");
        }
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let boxes = grid(6000);
        let build = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            shape(pool.install(|| arrange(&boxes)))
        };
        let one = build(1);
        assert!([2, 3, 7].iter().all(|&threads| build(threads) == one));
    }
}
