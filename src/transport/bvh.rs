//! Bounding volume hierarchy (BVH) over the triangles of a scene, and its memory layouts for traversal.
//!
//! Read pbrt (4th ed.), section 7.3; docs/decisions/rays.md. `ploc.rs` builds the topology (PLOC); the figure
//! [`Bvh::sah`] is the surface area heuristic.
//!
//! Rays need all triangles in one space whose coordinates f32 can represent: **bvh space**, the world's axes in metres
//! with the origin at the anchor, the centre of the scene. A view adds one vector to positions relative to its eye.
//!
//! The tree is binary. There are two layouts:
//!
//! - A **list with skip pointers** (threaded BVH, [`Bvh::links`]) for stackless traversal: nodes in depth-first order,
//!   each inner node with a link to the node after its subtree. A ray that hits a box continues with the next node, one
//!   that misses follows the link. Inner nodes whose box is hardly smaller than their parent's are omitted. A list
//!   fixes the order of siblings, so there is one list per octant of directions (nearest hit) and one that visits small
//!   boxes with many nodes first (any hit).
//! - **Nodes with both children's boxes** ([`Bvh::stack_nodes`]) for traversal with a stack.
//!
//! Boxes are centre and half extent, in f32 or in 16 bits of a [`Grid`] over the scene. All are conservative: they
//! contain their triangles with a margin, so a slab test in f32 misses none.

use std::sync::atomic::{AtomicU64, Ordering as Memory};

use anyhow::{Context, Result, bail, ensure};
use glam::{DVec3, Vec3};
use obvhs::bvh2::Bvh2;
use rayon::prelude::*;

pub use super::aabb::Aabb;
use super::ploc;
use crate::scene::Scene;
use crate::share::{FloatNode, GridNode, LEAF_BITS, SLAB_BITS, StackNode};

/// Largest number of triangles in a BVH: a leaf's word has a sign bit.
pub const MAX_TRIANGLES: usize = 1 << (31 - LEAF_BITS);

/// Largest number of triangles in a leaf.
pub const MAX_LEAF: u32 = 1 << LEAF_BITS;

/// Coordinates from this value on count as not finite: products of their differences would overflow.
const MAX_COORDINATE: f32 = 4.253_529_6e37; // 2^125

/// Margin around a quantised box in units of the grid: one unit, and more than the rounding of f64.
const SPARE_UNITS: f64 = 1.0 + 1.0 / 1_048_576.0;

/// Margin around a box in f32, relative to the largest coordinate: four rounding errors of f32, the error of a slab
/// test for rays from anywhere in the scene.
const SPARE_FLOAT: f64 = 1.0 / 4_194_304.0;

/// Ratio of surface areas, inner node to nearest listed ancestor, below which a list keeps the inner node. A box with
/// two children that a share p of the rays hits costs 1 + 2 p tests, or 2 without it: it pays for p under 1/2. With
/// deeper subtrees it pays a little longer: at 70 thousand triangles a ray took 36.9 tests with all boxes, 36.8, 35.5,
/// 35.3 and 36.0 with 0.4, 0.5, 0.6 and 0.7, and 35.0 with the optimum by dynamic programming.
const WORTH_TESTING: f64 = 0.6;

/// Unit of the grid along an axis without extent, relative to the largest coordinate: 16 rounding errors of f32.
const LEAST_UNIT: f64 = 1.0 / 1_048_576.0;

/// A triangle in bvh space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// Corners in bvh space, in the mesh's order. A vertex that triangles of one instance share is bit-identical in all
    /// of them.
    pub corners: [[f32; 3]; 3],
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Index of the triangle in its mesh.
    pub primitive: u32,
}

impl Triangle {
    /// The bounding box of the corners.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.corners.iter().fold(Aabb::EMPTY, |all, &corner| all.union(&Aabb { min: corner, max: corner }))
    }

    /// Whether a ray can hit the triangle: its corners are finite in f32, and its area is not zero. Differences of f32
    /// and their products are nearly exact in f64, so a sliver does not count as degenerate.
    fn is_solid(&self) -> bool {
        let held = self.corners.iter().flatten().all(|x| x.abs() < MAX_COORDINATE);
        let [a, b, c] = self.corners.map(|corner| Vec3::from(corner).as_dvec3());
        held && (b - a).cross(c - a) != DVec3::ZERO
    }
}

/// A node of the BVH.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    /// A node with two children.
    Inner {
        /// Box around both children.
        bounds: Aabb,
        /// Indices into [`Bvh::nodes`], both larger than this node's own.
        children: [u32; 2],
    },
    /// A leaf: a range of triangles.
    Leaf {
        /// Box around the triangles.
        bounds: Aabb,
        /// Index of the first triangle in [`Bvh::triangles`].
        first: u32,
        /// Number of triangles, 1 … 8.
        count: u32,
    },
}

impl Node {
    /// The node's box.
    #[must_use]
    pub fn bounds(&self) -> &Aabb {
        match self {
            Self::Inner { bounds, .. } | Self::Leaf { bounds, .. } => bounds,
        }
    }
}

/// The order of siblings in a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Front to back: the nearer child first, along the axis in which the children's centres differ most, for
    /// directions whose component i is negative where bit i is set.
    Octant(u8),
    /// The child with less surface area per node of its subtree first.
    AnyHit,
}

impl Order {
    /// The orders of all octants of directions; the index is formed by the sign bits.
    pub const OCTANTS: [Self; 8] = [
        Self::Octant(0),
        Self::Octant(1),
        Self::Octant(2),
        Self::Octant(3),
        Self::Octant(4),
        Self::Octant(5),
        Self::Octant(6),
        Self::Octant(7),
    ];
}

/// The encoding of boxes in a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// A [`GridNode`], in units of [`Bvh::grid`].
    Quantised,
    /// A [`FloatNode`].
    Float,
}

impl Format {
    /// Texels of four words per node.
    #[must_use]
    pub const fn texels(self) -> usize {
        match self {
            Self::Quantised => size_of::<GridNode>() / 16,
            Self::Float => size_of::<FloatNode>() / 16,
        }
    }
}

/// The lattice of [`Format::Quantised`]: coordinate k, -32768 … 32767, is `middle + k * unit`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Position of coordinate 0 in bvh space, the centre of the scene.
    pub middle: [f32; 3],
    /// Length of a unit in metres, along each axis.
    pub unit: [f32; 3],
}

impl Grid {
    /// Centre and half extent of a box, rounded outwards by at least a unit. Rays use the whole word as the centre; the
    /// half extent in its low bits then adds a fraction of a unit to the centre.
    fn encode(&self, bounds: &Aabb) -> [i32; 3] {
        [0, 1, 2].map(|axis| {
            let (middle, unit) = (f64::from(self.middle[axis]), f64::from(self.unit[axis]));
            let low = ((f64::from(bounds.min[axis]) - middle) / unit - SPARE_UNITS).floor() as i32;
            let high = ((f64::from(bounds.max[axis]) - middle) / unit + SPARE_UNITS).ceil() as i32;
            let center = (low + high).div_euclid(2);
            center << SLAB_BITS | (center + 1 - low)
        })
    }
}

/// The BVH over all triangles of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Bvh {
    /// Origin of bvh space in the world.
    pub anchor: DVec3,
    /// Triangles in leaf order.
    pub triangles: Vec<Triangle>,
    /// Nodes in depth-first order from the root; empty without triangles.
    pub nodes: Vec<Node>,
    /// Depth: edges from the root to the deepest leaf.
    pub depth: u32,
    /// Surface area heuristic (SAH): expected cost of a ray that hits the root's box, 1 for each inner node and each
    /// triangle of a leaf, weighted by the surface area of the node's box.
    pub sah: f64,
    /// Number of omitted triangles: corners that are not finite in bvh space, or no area.
    pub dropped: usize,
}

/// Number of BVHs that this process has built.
static BUILT: AtomicU64 = AtomicU64::new(0);

impl Bvh {
    /// Number of BVHs that this process has built so far; a scene needs one.
    #[must_use]
    pub fn built() -> u64 {
        BUILT.load(Memory::Relaxed)
    }

    /// Builds the BVH. The same scene gives the same BVH on any number of threads.
    ///
    /// # Errors
    /// One sentence when the scene has more than [`MAX_TRIANGLES`] triangles.
    pub fn build(scene: &Scene) -> Result<Self> {
        let building = || format!("building the tree of boxes over {}", scene.name);
        let count = scene.triangles();
        ensure!(count <= MAX_TRIANGLES, "{}: it has {count} triangles, and {MAX_TRIANGLES} are the most", building());
        BUILT.fetch_add(1, Memory::Relaxed);
        let anchor = anchor(scene);
        let (placed, dropped) = place(scene, anchor);
        let mut bvh = Self { anchor, triangles: Vec::new(), nodes: Vec::new(), depth: 0, sah: 0.0, dropped };
        if !placed.is_empty() {
            let boxes: Vec<Aabb> = placed.par_iter().map(Triangle::bounds).collect();
            bvh.unfold(&ploc::arrange(&boxes), &placed);
            bvh.sah = bvh.cost();
        }
        bvh.validate().with_context(building)?;
        Ok(bvh)
    }

    /// Converts a topology: nodes in depth-first order, triangles in leaf order, boxes computed from the triangles.
    fn unfold(&mut self, tree: &Bvh2, placed: &[Triangle]) {
        self.triangles.reserve_exact(placed.len());
        self.nodes.reserve_exact(tree.nodes.len());
        let mut open = vec![(0, None, 0)];
        while let Some((from, parent, depth)) = open.pop() {
            let (node, index) = (&tree.nodes[from as usize], self.nodes.len());
            // The left child follows its parent directly, the right child follows the left subtree.
            if let Some(parent) = parent
                && let Node::Inner { children, .. } = &mut self.nodes[parent]
            {
                let side = usize::from(index > parent + 1);
                children[side] = index as u32;
            }
            self.depth = self.depth.max(depth);
            self.nodes.push(if node.is_leaf() {
                let first = self.triangles.len();
                let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
                self.triangles.extend(tree.primitive_indices[range].iter().map(|&i| placed[i as usize]));
                let bounds = self.triangles[first..].iter().fold(Aabb::EMPTY, |all, t| all.union(&t.bounds()));
                Node::Leaf { bounds, first: first as u32, count: node.prim_count }
            } else {
                open.extend([1, 0].map(|side| (node.first_index + side, Some(index), depth + 1)));
                Node::Inner { bounds: Aabb::EMPTY, children: [0; 2] }
            });
        }
        for i in (0..self.nodes.len()).rev() {
            if let Node::Inner { children: [a, b], .. } = self.nodes[i] {
                let around = self.nodes[a as usize].bounds().union(self.nodes[b as usize].bounds());
                if let Node::Inner { bounds, .. } = &mut self.nodes[i] {
                    *bounds = around;
                }
            }
        }
    }

    fn cost(&self) -> f64 {
        let weighted = self.nodes.iter().map(|node| match node {
            Node::Inner { bounds, .. } => bounds.half_area(),
            Node::Leaf { bounds, count, .. } => bounds.half_area() * f64::from(*count),
        });
        weighted.sum::<f64>() / self.nodes[0].bounds().half_area()
    }

    /// Checks the invariants of every traversal: each node but the root is the child of exactly one earlier node, each
    /// triangle is in exactly one leaf, boxes contain their contents, and the depth is correct.
    ///
    /// # Errors
    /// One sentence: the first thing that is wrong.
    pub fn validate(&self) -> Result<()> {
        ensure!(
            self.nodes.is_empty() == self.triangles.is_empty(),
            "{} triangles are in a tree of {} nodes",
            self.triangles.len(),
            self.nodes.len()
        );
        // Depth of each node; `None` until a parent has been seen.
        let mut depths: Vec<Option<u32>> = vec![None; self.nodes.len()];
        let mut covered = vec![false; self.triangles.len()];
        let mut deepest = 0;
        for (i, node) in self.nodes.iter().enumerate() {
            let depth = match depths[i] {
                None if i > 0 => bail!("node {i} is no node's child"),
                depth => depth.unwrap_or(0),
            };
            deepest = deepest.max(depth);
            match *node {
                Node::Inner { bounds, children } => {
                    for child in children {
                        ensure!(
                            (child as usize) > i,
                            "node {i} has node {child} as a child, which does not come after it"
                        );
                        let Some(slot) = depths.get_mut(child as usize) else {
                            bail!("node {i} has node {child} as a child, but there are {} nodes", self.nodes.len());
                        };
                        ensure!(
                            slot.replace(depth + 1).is_none(),
                            "node {child} is the child of two nodes or twice of one"
                        );
                        let inner = self.nodes[child as usize].bounds();
                        ensure!(
                            bounds.contains(inner),
                            "the box of node {i} does not contain its child's, node {child}"
                        );
                    }
                }
                Node::Leaf { bounds, first, count } => {
                    ensure!((1..=MAX_LEAF).contains(&count), "leaf {i} has {count} triangles, not 1 to {MAX_LEAF}");
                    let range = first as usize..first as usize + count as usize;
                    let Some(inside) = self.triangles.get(range.clone()) else {
                        bail!("leaf {i} ends at triangle {}, but there are {}", range.end, self.triangles.len());
                    };
                    for (t, triangle) in range.zip(inside) {
                        ensure!(
                            bounds.contains(&triangle.bounds()),
                            "the box of leaf {i} does not contain triangle {t}"
                        );
                        ensure!(!std::mem::replace(&mut covered[t], true), "triangle {t} is in two leaves");
                    }
                }
            }
        }
        if let Some(t) = covered.iter().position(|c| !c) {
            bail!("triangle {t} is in no leaf");
        }
        ensure!(deepest == self.depth, "the tree is {deepest} deep and says {}", self.depth);
        Ok(())
    }

    /// The largest absolute coordinate of any corner.
    fn reach(&self) -> f64 {
        let corners = self.nodes.first().map(|root| [root.bounds().min, root.bounds().max]);
        corners.iter().flatten().flatten().fold(0.0, |reach, x| f64::from(x.abs()).max(reach))
    }

    /// The lattice of [`Format::Quantised`]: 65 500 units across the scene along each axis.
    #[must_use]
    pub fn grid(&self) -> Grid {
        let Some(bounds) = self.nodes.first().map(Node::bounds) else {
            return Grid { middle: [0.0; 3], unit: [1.0; 3] };
        };
        let least = (self.reach() * LEAST_UNIT).max(f64::from(f32::MIN_POSITIVE));
        let unit = [0, 1, 2].map(|axis| ((bounds.size(axis) / 65_500.0).max(least) as f32).next_up());
        let middle = [0, 1, 2].map(|axis| (bounds.double_center(axis) * 0.5) as f32);
        Grid { middle, unit }
    }

    /// Whether 16-bit boxes are precise enough: at least half of the leaves' boxes are four or more units long along
    /// their longest axis.
    #[must_use]
    pub fn fits_grid(&self) -> bool {
        let unit = self.grid().unit;
        let fits = |bounds: &Aabb| {
            let axis = (1..3).fold(0, |best, i| if bounds.size(i) > bounds.size(best) { i } else { best });
            bounds.size(axis) >= 4.0 * f64::from(unit[axis])
        };
        let leaves = self.nodes.iter().filter(|node| matches!(node, Node::Leaf { .. }));
        let (count, fitting) =
            leaves.fold((0, 0), |(count, fitting), leaf| (count + 1, fitting + usize::from(fits(leaf.bounds()))));
        fitting * 2 >= count
    }

    /// Number of listed nodes in each node's subtree, including the node.
    fn sizes(&self, listed: &[bool]) -> Vec<u32> {
        let mut sizes: Vec<u32> = listed.iter().map(|&l| u32::from(l)).collect();
        for (i, node) in self.nodes.iter().enumerate().rev() {
            if let Node::Inner { children: [a, b], .. } = node {
                sizes[i] += sizes[*a as usize] + sizes[*b as usize];
            }
        }
        sizes
    }

    /// The nodes that a list keeps: all leaves, and inner nodes so much smaller than their nearest listed ancestor that
    /// a miss of their box saves more tests than the test of the box costs.
    fn listed(&self) -> Vec<bool> {
        let mut listed = vec![true; self.nodes.len()];
        let mut area_above = vec![f64::INFINITY; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            if let Node::Inner { children, bounds } = node {
                let area = bounds.half_area();
                listed[i] = i == 0 || area < WORTH_TESTING * area_above[i];
                for &child in children {
                    area_above[child as usize] = if listed[i] { area } else { area_above[i] };
                }
            }
        }
        listed
    }

    /// Whether the first of two children comes first in an order.
    fn keeps_order(&self, children: [u32; 2], order: Order, sizes: &[u32]) -> bool {
        let [a, b] = children.map(|child| self.nodes[child as usize].bounds());
        match order {
            Order::Octant(negative) => {
                let ahead = [0, 1, 2].map(|axis| b.double_center(axis) - a.double_center(axis));
                let axis = (1..3).fold(0, |best, i| if ahead[i].abs() > ahead[best].abs() { i } else { best });
                if negative >> axis & 1 == 0 { ahead[axis] >= 0.0 } else { ahead[axis] <= 0.0 }
            }
            Order::AnyHit => {
                let [nodes_a, nodes_b] = children.map(|child| f64::from(sizes[child as usize]));
                a.half_area() * nodes_b <= b.half_area() * nodes_a
            }
        }
    }

    /// The nodes as a list with skip pointers, closed by a sentinel: a node of zeros whose link points to itself.
    /// Indices count nodes, not texels.
    #[must_use]
    pub fn links(&self, order: Order, format: Format) -> Vec<[u32; 4]> {
        let listed = self.listed();
        let count = listed.iter().filter(|&&l| l).count();
        let sizes = self.sizes(&listed);
        let (grid, spare) = (self.grid(), self.reach() * SPARE_FLOAT);
        let mut list = vec![[0; 4]; (count + 1) * format.texels()];
        let mut put = |place: usize, bounds: Option<&Aabb>, word: i32| {
            let at = place * format.texels();
            match format {
                Format::Quantised => {
                    let slabs = bounds.map(|bounds| grid.encode(bounds)).unwrap_or_default();
                    put_texels(&mut list[at..], &GridNode { slabs, word });
                }
                Format::Float => {
                    let (center, half_extent) = bounds.map(|bounds| float_box(bounds, spare)).unwrap_or_default();
                    put_texels(&mut list[at..], &FloatNode { center, word, half_extent, pad: 0 });
                }
            }
        };
        // Parents precede their children in `nodes`, so a node's place is known when the loop reaches it.
        let mut places = vec![0; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            let place = places[i];
            let word = match *node {
                Node::Inner { children, .. } => {
                    let [a, b] = children;
                    let [a, b] = if self.keeps_order(children, order, &sizes) { [a, b] } else { [b, a] };
                    places[a as usize] = place + u32::from(listed[i]);
                    places[b as usize] = places[a as usize] + sizes[a as usize];
                    if !listed[i] {
                        continue;
                    }
                    (place + sizes[i]) as i32
                }
                Node::Leaf { first, count, .. } => leaf_word(first, count),
            };
            put(place as usize, Some(node.bounds()), word);
        }
        put(count, None, count as i32);
        list
    }

    /// The lists of [`Bvh::links`] for several orders, computed in parallel.
    #[must_use]
    pub fn lists(&self, orders: &[Order], format: Format) -> Vec<Vec<[u32; 4]>> {
        orders.par_iter().map(|&order| self.links(order, format)).collect()
    }

    /// The inner nodes in depth-first order, one [`StackNode`] each, for traversal with a stack. The root is node 0. A
    /// missing child (the right one of a single leaf, both without triangles) has a box of negative extent that no ray
    /// hits.
    #[must_use]
    pub fn stack_nodes(&self) -> Vec<[u32; 4]> {
        let spare = self.reach() * SPARE_FLOAT;
        let mut inner = 0;
        let words: Vec<i32> = self
            .nodes
            .iter()
            .map(|node| match *node {
                Node::Leaf { first, count, .. } => leaf_word(first, count),
                Node::Inner { .. } => {
                    inner += 1;
                    inner - 1
                }
            })
            .collect();
        let child = |i: u32| {
            let (center, half_extent) = float_box(self.nodes[i as usize].bounds(), spare);
            Child { center, half_extent, word: words[i as usize] }
        };
        let nothing = Child { center: [0.0; 3], half_extent: [-3e38; 3], word: leaf_word(0, 1) };
        let list: Vec<StackNode> = match self.nodes.as_slice() {
            [] => vec![Child::both([nothing, nothing])],
            [Node::Leaf { .. }] => vec![Child::both([child(0), nothing])],
            nodes => {
                let inner = nodes.iter().filter_map(|node| match node {
                    Node::Inner { children, .. } => Some(children.map(child)),
                    Node::Leaf { .. } => None,
                });
                inner.map(Child::both).collect()
            }
        };
        bytemuck::cast_slice(&list).to_vec()
    }
}

/// A child in its parent's [`StackNode`].
#[derive(Clone, Copy)]
struct Child {
    center: [f32; 3],
    half_extent: [f32; 3],
    /// The child's word: index of an inner node, or [`leaf_word`].
    word: i32,
}

impl Child {
    fn both([left, right]: [Self; 2]) -> StackNode {
        StackNode {
            left_center: left.center,
            left: left.word,
            left_half_extent: left.half_extent,
            right: right.word,
            right_center: right.center,
            pad_center: 0,
            right_half_extent: right.half_extent,
            pad_half_extent: 0,
        }
    }
}

/// Writes a node to the start of `texels`.
fn put_texels<T: bytemuck::NoUninit>(texels: &mut [[u32; 4]], node: &T) {
    let words = bytemuck::cast_slice(std::slice::from_ref(node));
    texels[..words.len()].copy_from_slice(words);
}

/// A leaf in one word; the complement makes it negative, unlike an index.
fn leaf_word(first: u32, count: u32) -> i32 {
    !(first << LEAF_BITS | (count - 1)) as i32
}

/// Centre and half extent in f32 of a box that contains `bounds` with a margin of `spare` metres.
fn float_box(bounds: &Aabb, spare: f64) -> ([f32; 3], [f32; 3]) {
    let center = [0, 1, 2].map(|axis| (bounds.double_center(axis) * 0.5) as f32);
    let half = [0, 1, 2].map(|axis| {
        let middle = f64::from(center[axis]);
        let reach = (f64::from(bounds.max[axis]) - middle).max(middle - f64::from(bounds.min[axis]));
        // The next larger value is always outwards.
        ((reach + spare) as f32).next_up()
    });
    (center, half)
}

/// Centre of the bounding box of all vertices with finite world positions.
fn anchor(scene: &Scene) -> DVec3 {
    let mut bounds: Option<(DVec3, DVec3)> = None;
    for instance in &scene.instances {
        for &position in &scene.meshes[instance.mesh].positions {
            let p_world = instance.world_from_object.transform_point3(Vec3::from(position).as_dvec3());
            if p_world.is_finite() {
                let (min, max) = bounds.unwrap_or((p_world, p_world));
                bounds = Some((min.min(p_world), max.max(p_world)));
            }
        }
    }
    // Halved first: the sum of two finite values may overflow.
    bounds.map_or(DVec3::ZERO, |(min, max)| min * 0.5 + max * 0.5)
}

/// Triangles of all instances in bvh space, and the number of omitted ones.
fn place(scene: &Scene, anchor: DVec3) -> (Vec<Triangle>, usize) {
    let count = scene.triangles();
    let mut triangles = Vec::with_capacity(count);
    for (instance, placed) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[placed.mesh];
        let p_bvh = |position: &[f32; 3]| {
            let p_world = placed.world_from_object.transform_point3(Vec3::from(*position).as_dvec3());
            (p_world - anchor).as_vec3().to_array()
        };
        let positions: Vec<[f32; 3]> = mesh.positions.iter().map(p_bvh).collect();
        let all = mesh.indices.as_chunks::<3>().0.iter().enumerate().map(|(primitive, corners)| Triangle {
            corners: corners.map(|i| positions[i as usize]),
            instance: instance as u32,
            primitive: primitive as u32,
        });
        triangles.extend(all.filter(Triangle::is_solid));
    }
    let dropped = count - triangles.len();
    (triangles, dropped)
}
