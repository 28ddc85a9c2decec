//! The tree of boxes against what is true by counting: every triangle is once in it, every box holds what is under it,
//! and no form in which rays walk it loses a leaf that a ray meets.

use std::collections::BTreeSet;

use etalon::optics::catalogue::SplitMix64;
use etalon::scene::{Instance, Mesh, Scene};
use etalon::transport::bvh::{Aabb, Bvh, Format, Grid, MAX_TRIANGLES, Node, Order, Triangle};
use glam::{DAffine3, DQuat, DVec3, Vec3};

const FORMATS: [Format; 2] = [Format::Quantised, Format::Float];

fn orders() -> Vec<Order> {
    Order::OCTANTS.into_iter().chain([Order::AnyHit]).collect()
}

fn scene(name: &str, triangles: &[[DVec3; 3]], world_from_object: &[DAffine3]) -> Scene {
    let positions: Vec<[f32; 3]> = triangles.iter().flatten().map(|p| p.as_vec3().to_array()).collect();
    let mesh = Mesh { indices: (0..positions.len() as u32).collect(), positions: positions.into(), ..Mesh::default() };
    let place = |&world_from_object| Instance { name: String::new(), mesh: 0, world_from_object };
    let instances = world_from_object.iter().map(place).collect();
    Scene { name: name.into(), meshes: vec![mesh], instances, ..Scene::default() }
}

/// Triangles of very different sizes in a cube of 2 m.
fn soup(count: usize, seed: u64) -> Vec<[DVec3; 3]> {
    let mut d = SplitMix64::new(seed);
    let triangle = |_| {
        let center = DVec3::new(d.between(-1.0, 1.0), d.between(-1.0, 1.0), d.between(-1.0, 1.0));
        let size = d.log(1e-3, 0.5);
        [0; 3].map(|_| center + d.direction() * size)
    };
    (0..count).map(triangle).collect()
}

/// A flat square of `side` times `side` cells.
fn plane(side: usize) -> Vec<[DVec3; 3]> {
    let at = |i: usize, j: usize| DVec3::new(i as f64, 0.0, j as f64);
    let cells = (0..side * side).map(|k| (k / side, k % side));
    cells
        .flat_map(|(i, j)| [[at(i, j), at(i, j + 1), at(i + 1, j)], [at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]])
        .collect()
}

/// Slivers from one point: a hundred times longer than wide, boxes inside each other.
fn fan(count: usize) -> Vec<[DVec3; 3]> {
    let rim = |i: usize| {
        let (sin, cos) = (i as f64 / count as f64 * 1.5).sin_cos();
        DVec3::new(cos, 0.2 * sin * cos, sin) * (1.0 + i as f64)
    };
    (0..count).map(|i| [DVec3::ZERO, rim(i), rim(i + 1)]).collect()
}

/// Triangles of growing size around one point.
fn shells(count: usize) -> Vec<[DVec3; 3]> {
    let mut d = SplitMix64::new(3);
    let shell = |i| {
        let a = d.direction();
        let b = d.perpendicular(a);
        [a, b, -a - b].map(|p| p * (1.0 + f64::from(i / 3)))
    };
    (0..count as u32).map(shell).collect()
}

fn scenes() -> Vec<Scene> {
    let at = |x, y, z| DAffine3::from_translation(DVec3::new(x, y, z));
    let here = [DAffine3::IDENTITY];
    let one = [DVec3::ZERO, DVec3::X, DVec3::new(0.25, 1.0, 0.5)];
    let turned = DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, -3.0, 0.5),
        DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.0),
        DVec3::new(2.0, 0.5, -1.0),
    );
    vec![
        scene("soup", &soup(500, 1), &here),
        scene("plane", &plane(16), &here),
        scene("fan", &fan(200), &here),
        scene("shells", &shells(200), &here),
        scene("one", &[one], &here),
        scene("two in one place", &[one; 2], &here),
        scene("many in one place", &[one; 77], &here),
        scene("tiny", &soup(200, 2), &[DAffine3::from_scale(DVec3::splat(1e-4))]),
        scene("huge", &soup(200, 2), &[DAffine3::from_scale(DVec3::splat(1e6))]),
        scene("far", &soup(200, 2), &[at(3e6, -2e6, 1e6)]),
        scene("three", &soup(100, 4), &[at(0.0, 0.0, 0.0), turned, at(-4.0, 0.1, 0.0)]),
    ]
}

/// Every scene with its tree.
fn built() -> Vec<(Scene, Bvh)> {
    let build = |scene: Scene| {
        let bvh = Bvh::build(&scene).expect("a tree");
        (scene, bvh)
    };
    scenes().into_iter().map(build).collect()
}

/// A node of a list: box in f64, fourth word.
struct Read {
    center: [f64; 3],
    half: [f64; 3],
    word: u32,
}

impl Read {
    fn leaf(&self) -> Option<(u32, u32)> {
        ((self.word as i32) < 0).then(|| (!self.word / 8, !self.word % 8 + 1))
    }

    /// How far the box goes beyond `inner`, at the side where it goes least, along each axis.
    fn room(&self, inner: &Aabb) -> [f64; 3] {
        [0, 1, 2].map(|i| {
            let low = f64::from(inner.min[i]) - (self.center[i] - self.half[i]);
            low.min(self.center[i] + self.half[i] - f64::from(inner.max[i]))
        })
    }
}

fn floats(texel: [u32; 4]) -> [f64; 3] {
    [0, 1, 2].map(|i| f64::from(f32::from_bits(texel[i])))
}

fn read(list: &[[u32; 4]], format: Format, grid: &Grid) -> Vec<Read> {
    let along = |i: usize, k: f64| k * f64::from(grid.unit[i]);
    let node = |texels: &[[u32; 4]]| match format {
        Format::Quantised => Read {
            center: [0, 1, 2].map(|i| f64::from(grid.middle[i]) + along(i, f64::from(texels[0][i] as i32) / 65536.0)),
            half: [0, 1, 2].map(|i| along(i, f64::from(texels[0][i] & 0xffff))),
            word: texels[0][3],
        },
        Format::Float => Read { center: floats(texels[0]), half: floats(texels[1]), word: texels[0][3] },
    };
    list.chunks(format.texels()).map(node).collect()
}

#[derive(Clone, Copy)]
struct Ray {
    origin: DVec3,
    direction: DVec3,
}

impl Ray {
    fn meets(&self, center: [f64; 3], half: [f64; 3]) -> bool {
        let (mut near, mut far) = (0.0_f64, f64::INFINITY);
        for i in 0..3 {
            let to_center = center[i] - self.origin[i];
            if self.direction[i] == 0.0 {
                // Between two planes, or not: there are no distances to them.
                if to_center.abs() > half[i] {
                    return false;
                }
            } else {
                let (middle, around) = (to_center / self.direction[i], half[i] / self.direction[i].abs());
                near = near.max(middle - around);
                far = far.min(middle + around);
            }
        }
        near <= far
    }

    /// The exact box, which is at most as large as those of lists.
    fn meets_box(&self, bounds: &Aabb) -> bool {
        let (min, max) = (Vec3::from(bounds.min).as_dvec3(), Vec3::from(bounds.max).as_dvec3());
        self.meets(((min + max) * 0.5).to_array(), ((max - min) * 0.5).to_array())
    }
}

/// Rays from around and inside the scene at points of its triangles, a quarter of them along an axis.
fn rays(bvh: &Bvh, count: usize) -> Vec<Ray> {
    let mut d = SplitMix64::new(7);
    let root = bvh.nodes[0].bounds();
    let size = (0..3).map(|i| root.size(i)).fold(0.0, f64::max);
    let aimed = |_| {
        let [a, b, c] = bvh.triangles[d.below(bvh.triangles.len())].corners.map(|p| Vec3::from(p).as_dvec3());
        let (u, v) = (d.unit(), d.unit());
        let target = a + (b - a) * u * (1.0 - v) + (c - a) * v;
        let direction = if d.below(4) == 0 { DVec3::AXES[d.below(3)] * d.sign() } else { d.direction() };
        Ray { origin: target - direction * size * d.log(0.01, 10.0), direction }
    };
    (0..count).map(aimed).collect()
}

/// The leaves that a ray visits in a list.
fn visited(nodes: &[Read], ray: &Ray) -> Vec<(u32, u32)> {
    let mut leaves = Vec::new();
    let mut at = 0;
    while at + 1 < nodes.len() {
        let node = &nodes[at];
        let met = ray.meets(node.center, node.half);
        at = match node.leaf() {
            Some(leaf) => {
                leaves.extend(met.then_some(leaf));
                at + 1
            }
            None if met => at + 1,
            None => node.word as usize,
        };
    }
    leaves
}

/// The leaves that a ray visits in nodes with both children's boxes, and the most entries on its stack.
fn visited_with_stack(nodes: &[[u32; 4]], ray: &Ray) -> (Vec<(u32, u32)>, usize) {
    let (mut leaves, mut stack, mut most) = (Vec::new(), vec![0], 0);
    while let Some(node) = stack.pop() {
        let [a, b, c, d] = *nodes.as_chunks::<4>().0.get(node as usize).expect("an inner node");
        for (center, half, word) in [(c, d, b[3]), (a, b, a[3])] {
            let child = Read { center: floats(center), half: floats(half), word };
            if ray.meets(child.center, child.half) {
                match child.leaf() {
                    Some(leaf) => leaves.push(leaf),
                    None => stack.push(word),
                }
            }
        }
        most = most.max(stack.len());
    }
    (leaves, most)
}

fn leaves(bvh: &Bvh) -> impl Iterator<Item = (Aabb, u32, u32)> {
    bvh.nodes.iter().filter_map(|node| match *node {
        Node::Leaf { bounds, first, count } => Some((bounds, first, count)),
        Node::Inner { .. } => None,
    })
}

/// The box of triangles in bvh space.
fn around(triangles: &[Triangle]) -> Aabb {
    let corners = || triangles.iter().flat_map(|t| t.corners);
    let least = |i: usize| corners().map(|c| c[i]).fold(f32::INFINITY, f32::min);
    let most = |i: usize| corners().map(|c| c[i]).fold(f32::NEG_INFINITY, f32::max);
    Aabb { min: [0, 1, 2].map(least), max: [0, 1, 2].map(most) }
}

/// The largest coordinate of any corner, without its sign.
fn farthest(bvh: &Bvh) -> f64 {
    bvh.triangles.iter().flat_map(|t| t.corners).flatten().map(|x| f64::from(x.abs())).fold(0.0, f64::max)
}

#[test]
fn every_triangle_is_in_one_leaf() {
    for (scene, bvh) in built() {
        let mut seen = vec![0; bvh.triangles.len()];
        for (bounds, first, count) in leaves(&bvh) {
            assert!((1..=8).contains(&count), "{}", scene.name);
            (first..first + count).for_each(|t| seen[t as usize] += 1);
            assert_eq!(bounds, around(&bvh.triangles[first as usize..(first + count) as usize]), "{}", scene.name);
        }
        assert!(seen.iter().all(|&times| times == 1), "{}", scene.name);
        let names: BTreeSet<(u32, u32)> = bvh.triangles.iter().map(|t| (t.instance, t.primitive)).collect();
        assert_eq!((names.len(), bvh.triangles.len()), (scene.triangles(), scene.triangles()), "{}", scene.name);
        assert_eq!(bvh.dropped, 0, "{}", scene.name);
    }
}

#[test]
fn corners_are_the_worlds_minus_the_anchor() {
    for (scene, bvh) in built() {
        let bounds = scene.bounds().unwrap();
        assert_eq!(bvh.anchor, bounds.center(), "{}", scene.name);
        for triangle in &bvh.triangles {
            let instance = &scene.instances[triangle.instance as usize];
            let mesh = &scene.meshes[instance.mesh];
            for k in 0..3 {
                let object = mesh.positions[mesh.indices[triangle.primitive as usize * 3 + k] as usize];
                let p_world = instance.world_from_object.matrix3 * Vec3::from(object).as_dvec3()
                    + instance.world_from_object.translation;
                let off = (p_world - bvh.anchor - Vec3::from(triangle.corners[k]).as_dvec3()).abs().max_element();
                // Half an ulp of f32 at the largest coordinate there can be.
                assert!(off <= bounds.radius() * 6e-8, "{}: {off}", scene.name);
            }
        }
    }
}

#[test]
fn shared_vertices_stay_shared() {
    let mut scene = scene("shared", &plane(8), &[DAffine3::from_translation(DVec3::new(0.1, 1e5 / 3.0, 0.7))]);
    scene.instances[0].world_from_object.matrix3 *= 1.0 / 3.0;
    // Each vertex of the plane occurs up to six times: as many different corners as there are vertices.
    let bvh = Bvh::build(&scene).unwrap();
    let corners: BTreeSet<[u32; 3]> =
        bvh.triangles.iter().flat_map(|t| t.corners).map(|c| c.map(f32::to_bits)).collect();
    assert_eq!(corners.len(), 81);
}

/// Every box of the lists with what is under it, and the boxes of the nodes with both children's.
fn assert_room(name: &str, bvh: &Bvh) {
    let grid = bvh.grid();
    let farthest = farthest(bvh);
    for format in FORMATS {
        let list = bvh.links(Order::AnyHit, format);
        let nodes = read(&list, format, &grid);
        // One unit; in f32 four of its roundings at the farthest corner, less what f64 rounds here.
        let least = match format {
            Format::Quantised => grid.unit.map(f64::from),
            Format::Float => [farthest * 2_f64.powi(-22) * 0.999; 3],
        };
        // More than the rounding asks for would be wasted: three units, or a rounding of f32 more.
        let most = match format {
            Format::Quantised => least.map(|unit| unit * 3.01),
            Format::Float => least.map(|room| room * 1.6),
        };
        for i in 0..nodes.len() - 1 {
            let end = if nodes[i].leaf().is_some() { i + 1 } else { nodes[i].word as usize };
            let under = nodes[i..end].iter().filter_map(Read::leaf).map(|(first, count)| {
                let first = first as usize;
                around(&bvh.triangles[first..first + count as usize])
            });
            let room = nodes[i].room(&under.reduce(|a, b| a.union(&b)).expect("a leaf"));
            let good = (0..3).all(|i| (least[i]..=most[i]).contains(&room[i]));
            assert!(good, "{name}, {format:?}, node {i}: {room:?}, {least:?}");
        }
        if format == Format::Float && bvh.nodes.len() > 1 {
            // The same boxes but for the root's, which is missing there.
            let stack = bvh.stack_nodes();
            let children = stack.as_chunks::<4>().0.iter().flat_map(|[a, b, c, d]| [(a, b), (c, d)]);
            let of_stack: BTreeSet<_> = children.map(|(c, h)| ([c[0], c[1], c[2]], [h[0], h[1], h[2]])).collect();
            let inside = &list.as_chunks::<2>().0[1..nodes.len() - 1];
            let of_list: BTreeSet<_> = inside.iter().map(|[c, h]| ([c[0], c[1], c[2]], [h[0], h[1], h[2]])).collect();
            assert!(of_list.is_subset(&of_stack) && !of_list.is_empty(), "{name}");
        }
    }
}

#[test]
fn boxes_hold_what_is_under_them_with_room() {
    for (scene, bvh) in built() {
        assert_room(&scene.name, &bvh);
    }
    // What is left of a scene may be far from its anchor: coordinates near a million of things 8 m across.
    let gone = [DVec3::splat(-1e6); 3];
    let kept = plane(8).into_iter().map(|triangle| triangle.map(|p| p + DVec3::splat(1e6)));
    let bvh = Bvh::build(&scene("lopsided", &kept.chain([gone]).collect::<Vec<_>>(), &[DAffine3::IDENTITY])).unwrap();
    assert_eq!((bvh.dropped, farthest(&bvh) > 9e5), (1, true));
    assert_room("lopsided", &bvh);
}

#[test]
fn no_form_loses_a_leaf() {
    for (scene, bvh) in built() {
        let grid = bvh.grid();
        let all: BTreeSet<(u32, u32)> = leaves(&bvh).map(|(_, first, count)| (first, count)).collect();
        let lists = orders().into_iter().flat_map(|order| FORMATS.map(|format| (order, format)));
        let lists: Vec<_> = lists.map(|(o, f)| (o, f, read(&bvh.links(o, f), f, &grid))).collect();
        let stack = bvh.stack_nodes();
        let mut missed = 0;
        for ray in rays(&bvh, 200) {
            let met = leaves(&bvh).filter(|(bounds, ..)| ray.meets_box(bounds));
            let met: BTreeSet<(u32, u32)> = met.map(|(_, first, count)| (first, count)).collect();
            assert!(!met.is_empty(), "{}: the ray was aimed at a triangle", scene.name);
            missed += all.len() - met.len();
            for (order, format, nodes) in &lists {
                let found = visited(nodes, &ray);
                let once: BTreeSet<_> = found.iter().copied().collect();
                assert_eq!(once.len(), found.len(), "{}, {order:?}, {format:?}: a leaf twice", scene.name);
                assert!(met.is_subset(&once), "{}, {order:?}, {format:?}: {met:?} {once:?}", scene.name);
                assert!(once.is_subset(&all), "{}, {order:?}, {format:?}: a leaf that is none", scene.name);
            }
            let (found, most) = visited_with_stack(&stack, &ray);
            let once: BTreeSet<_> = found.iter().copied().collect();
            assert_eq!(once.len(), found.len(), "{}: a leaf twice", scene.name);
            assert!(met.is_subset(&once) && once.is_subset(&all), "{}: {met:?} {once:?}", scene.name);
            assert!(most <= bvh.depth as usize + 1, "{}: {most} on the stack", scene.name);
        }
        assert!(missed > 0 || all.len() == 1 || scene.name.contains("in one place"), "{}", scene.name);
    }
}

#[test]
fn links_lead_forwards_to_the_sentinel() {
    for (scene, bvh) in built() {
        let all: BTreeSet<(u32, u32)> = leaves(&bvh).map(|(_, first, count)| (first, count)).collect();
        for order in orders() {
            for format in FORMATS {
                let list = bvh.links(order, format);
                let nodes = read(&list, format, &bvh.grid());
                let name = format!("{}, {order:?}, {format:?}", scene.name);
                assert!(nodes.len() <= bvh.nodes.len() + 1, "{name}");
                let sentinel = nodes.len() as u32 - 1;
                let end = &list[sentinel as usize * format.texels()..];
                assert_eq!(end[0], [0, 0, 0, sentinel], "{name}");
                assert!(end[1..].iter().all(|texel| *texel == [0; 4]), "{name}");
                // Subtrees lie inside each other: the ends of those that are open.
                let mut open = vec![sentinel];
                for (i, node) in nodes[..sentinel as usize].iter().enumerate() {
                    while open.last() == Some(&(i as u32)) {
                        open.pop();
                    }
                    if node.leaf().is_none() {
                        assert!(node.word > i as u32 + 2 && node.word <= *open.last().unwrap(), "{name}: {i}");
                        open.push(node.word);
                    }
                }
                let found: BTreeSet<_> = nodes[..sentinel as usize].iter().filter_map(Read::leaf).collect();
                assert_eq!(found, all, "{name}");
            }
        }
    }
}

#[test]
fn boxes_that_save_no_tests_are_not_listed() {
    let mut left_out = 0;
    for (scene, bvh) in built() {
        let area = |half: [f64; 3]| half[0] * half[1] + half[1] * half[2] + half[2] * half[0];
        let nodes = read(&bvh.links(Order::AnyHit, Format::Float), Format::Float, &bvh.grid());
        // A node is tested by the rays that meet the nearest listed one around it.
        let mut open: Vec<(usize, f64)> = Vec::new();
        let mut listed = 0.0;
        for (i, node) in nodes[..nodes.len() - 1].iter().enumerate() {
            while open.last().is_some_and(|(end, _)| *end == i) {
                open.pop();
            }
            listed += open.last().map_or(0.0, |(_, area)| *area);
            if node.leaf().is_none() {
                open.push((node.word as usize, area(node.half)));
            }
        }
        let inner = bvh.nodes.iter().filter(|node| matches!(node, Node::Inner { .. }));
        // Halves of extents make a quarter of the area; the list has some room around each box.
        let all: f64 = inner.map(|node| 2.0 * node.bounds().half_area() / 4.0).sum();
        assert!(listed <= all * 1.001, "{}: {listed} {all}", scene.name);
        left_out += bvh.nodes.len() + 1 - nodes.len();
    }
    assert!(left_out > 200, "{left_out}");
}

/// Pairs of siblings in a list that have no others, first and second, with the nodes in their subtrees.
fn siblings(nodes: &[Read]) -> Vec<[(&Read, usize); 2]> {
    let end = |i: usize| if nodes[i].leaf().is_some() { i + 1 } else { nodes[i].word as usize };
    let inner = (0..nodes.len() - 1).filter(|&i| nodes[i].leaf().is_none());
    let children = inner.map(|i| (i, [i + 1, end(i + 1)])).filter(|&(i, [_, b])| end(b) == end(i));
    children.map(|(_, pair)| pair.map(|i| (&nodes[i], end(i) - i))).collect()
}

#[test]
fn near_children_come_first() {
    let (mut compared, mut swapped) = (0, 0);
    for (scene, bvh) in built() {
        for (octant, order) in Order::OCTANTS.into_iter().enumerate() {
            assert_eq!(order, Order::Octant(octant as u8));
            let nodes = read(&bvh.links(order, Format::Float), Format::Float, &bvh.grid());
            for [(first, _), (second, _)] in siblings(&nodes) {
                let ahead = [0, 1, 2].map(|i| second.center[i] - first.center[i]);
                let axis = (0..3).max_by(|&i, &j| ahead[i].abs().total_cmp(&ahead[j].abs())).unwrap();
                let gap = (0..3).filter(|&i| i != axis).map(|i| ahead[axis].abs() - ahead[i].abs());
                // Centres are rounded to f32 in the list; two axes that differ alike may go either way.
                if gap.fold(f64::INFINITY, f64::min) > 1e-6 * ahead[axis].abs() {
                    let negative = octant >> axis & 1 == 1;
                    assert_eq!(ahead[axis] < 0.0, negative, "{}, {octant}: {ahead:?}", scene.name);
                    compared += 1;
                    swapped += usize::from(negative);
                }
            }
        }
    }
    assert!(compared > 3000 && swapped * 2 == compared, "{compared} {swapped}");
}

#[test]
fn small_boxes_with_much_in_them_come_first_for_any_hit() {
    let mut larger_first = 0;
    for (scene, bvh) in built() {
        let nodes = read(&bvh.links(Order::AnyHit, Format::Float), Format::Float, &bvh.grid());
        for [(first, nodes_first), (second, nodes_second)] in siblings(&nodes) {
            let area = |node: &Read| {
                let [x, y, z] = node.half;
                x * y + y * z + z * x
            };
            let (a, b) = (area(first) / nodes_first as f64, area(second) / nodes_second as f64);
            // The list's boxes are the exact ones with the same margin around each; that is up to a tenth for the
            // smallest ones here.
            assert!(a <= b * 1.1, "{}: {a} {b}", scene.name);
            larger_first += usize::from(area(first) > area(second) * 1.1);
        }
    }
    assert!(larger_first > 20, "{larger_first}");
}

#[test]
fn the_cost_is_the_expected_one() {
    // A unit square's two triangles and the same 3 m away, as one leaf each: two halves of the root's length 4.
    let squares = [0.0, 3.0].map(|x| {
        let at = |i: f64, j: f64| DVec3::new(x + i, 0.0, j);
        [[at(0.0, 0.0), at(0.0, 1.0), at(1.0, 0.0)], [at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)]]
    });
    let mut bvh = Bvh::build(&scene("squares", &squares.concat(), &[DAffine3::IDENTITY])).unwrap();
    // Four triangles are too few for leaves of two: root 4, two inner nodes 1 each, four leaves 1 each.
    assert!((bvh.sah - (1.0 + 2.0 / 4.0 + 4.0 / 4.0)).abs() < 1e-12, "{}", bvh.sah);
    assert_eq!(bvh.depth, 2);
    bvh.depth = 3;
    assert_eq!(bvh.validate().unwrap_err().to_string(), "the tree is 2 deep and says 3");
}

#[test]
fn the_same_scene_gives_the_same_tree() {
    let scene = scene("soup", &[soup(2000, 5), plane(20)].concat(), &[DAffine3::IDENTITY]);
    let first = Bvh::build(&scene).unwrap();
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(|| Bvh::build(&scene)).unwrap() == first);
    }
    let lists = first.lists(&orders(), Format::Quantised);
    assert!(orders().into_iter().zip(lists).all(|(order, list)| first.links(order, Format::Quantised) == list));
}

#[test]
fn what_no_ray_can_meet_is_dropped_and_counted() {
    let good = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let p = DVec3::new(0.3, 0.5, 0.7);
    let bad = [
        [DVec3::ZERO, DVec3::X, DVec3::NAN],
        [DVec3::ZERO, DVec3::X, DVec3::Y * f64::INFINITY],
        [p, p, DVec3::X],
        [p; 3],
        [DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 4.0, 6.0)],
    ];
    // A sliver of a micrometre by a kilometre has an area.
    let sliver = [DVec3::ZERO, DVec3::new(1000.0, 0.0, 0.0), DVec3::new(500.0, 1e-6, 0.0)];
    let mixed: Vec<_> = bad.into_iter().chain([good, sliver]).collect();
    let bvh = Bvh::build(&scene("mixed", &mixed, &[DAffine3::IDENTITY])).unwrap();
    assert_eq!((bvh.triangles.len(), bvh.dropped), (2, 5));
    let beyond = [DAffine3::IDENTITY, DAffine3::from_scale(DVec3::splat(1e300))];
    let bvh = Bvh::build(&scene("beyond f64", &[good.map(|p| p * 1e9)], &beyond)).unwrap();
    assert_eq!((bvh.triangles.len(), bvh.dropped, bvh.anchor), (1, 1, DVec3::new(5e8, 5e8, 0.0)));
    // Coordinates whose differences have differences that f32 cannot hold are as bad as infinity.
    let far = scene("far", &[good], &[DAffine3::from_scale(DVec3::splat(2e38))]);
    let bvh = Bvh::build(&far).unwrap();
    assert_eq!((bvh.triangles.len(), bvh.dropped), (0, 1));
    let near = scene("near", &[good], &[DAffine3::from_scale(DVec3::splat(8e37))]);
    let bvh = Bvh::build(&near).unwrap();
    assert_eq!((bvh.triangles.len(), bvh.dropped), (1, 0));
    assert!(bvh.sah == 1.0 && bvh.grid().middle.iter().all(|x| x.is_finite()));

    for empty in [scene("dropped", &bad, &[DAffine3::IDENTITY]), Scene::default()] {
        let bvh = Bvh::build(&empty).unwrap();
        assert_eq!((bvh.nodes.len(), bvh.triangles.len(), bvh.dropped), (0, 0, empty.triangles()));
        assert_eq!((bvh.depth, bvh.sah), (0, 0.0));
        assert!(bvh.fits_grid());
        for order in orders() {
            assert_eq!(bvh.links(order, Format::Quantised), [[0; 4]]);
            assert_eq!(bvh.links(order, Format::Float), [[0; 4]; 2]);
        }
        let stack = bvh.stack_nodes();
        assert_eq!(stack.len(), 4);
        let ray = Ray { origin: DVec3::new(0.1, 0.2, -3.0), direction: DVec3::new(0.0, 0.6, 0.8) };
        assert_eq!(visited_with_stack(&stack, &ray).0, []);
    }
}

#[test]
fn a_tree_of_one_leaf_has_one_child() {
    let one = scene("one", &[[DVec3::ZERO, DVec3::X, DVec3::Y]], &[DAffine3::IDENTITY]);
    let bvh = Bvh::build(&one).unwrap();
    let [left, left_half, right, right_half] = bvh.stack_nodes()[..] else { panic!("four texels") };
    assert_eq!((left[3], right[3], right_half[3]), (!0, 0, 0));
    assert_eq!(floats(left), [0.0; 3]);
    assert!(floats(left_half).iter().zip([0.5, 0.5, 0.0]).all(|(half, exact)| (half - exact).abs() < 1e-6));
    // The other is nothing that could be met, and its reference is a leaf's, so that nothing walks on.
    assert!((left_half[3] as i32) < 0);
    assert!(floats(right) == [0.0; 3] && floats(right_half).iter().all(|&half| half < -1e38));
}

#[test]
fn too_many_triangles_are_an_error_of_one_sentence() {
    let mesh = Mesh { positions: vec![[0.0; 3]; 3].into(), indices: vec![0; 3 << 20].into(), ..Mesh::default() };
    let one = Instance { name: String::new(), mesh: 0, world_from_object: DAffine3::IDENTITY };
    let scene = Scene { name: "crowd".into(), meshes: vec![mesh], instances: vec![one; 257], ..Scene::default() };
    assert_eq!(scene.triangles(), MAX_TRIANGLES + (1 << 20));
    let error = format!("{:#}", Bvh::build(&scene).unwrap_err());
    assert_eq!(error, "building the tree of boxes over crowd: it has 269484032 triangles, and 268435456 are the most");
}

#[test]
fn the_grid_is_judged_by_the_median_leaf() {
    // Triangles of one size apart by 1 m, in a row of 655 m: a unit of the grid is 1 cm.
    let row = |size: f64| {
        let at = |i: u32| DVec3::X * f64::from(i);
        let small = (0..655).map(|i| [at(i), at(i) + DVec3::X * size, at(i) + DVec3::Y * size * 0.5]);
        let end = [at(655), at(655) - DVec3::X * size, at(655) + DVec3::Y * size * 0.5];
        scene("row", &small.chain([end]).collect::<Vec<_>>(), &[DAffine3::IDENTITY])
    };
    let fits = |size| Bvh::build(&row(size)).unwrap().fits_grid();
    assert!(fits(0.041) && !fits(0.039));
    let unit = Bvh::build(&row(0.041)).unwrap().grid().unit;
    assert!((unit[0] - 0.01).abs() < 1e-5, "{unit:?}");
    // Flat along z: a unit of 16 roundings of f32 at the farthest coordinate, 327.5 m.
    assert!((f64::from(unit[2]) / 327.5 * 2_f64.powi(20) - 1.0).abs() < 1e-3, "{unit:?}");
}

#[test]
fn validation_names_what_is_wrong() {
    let bvh = Bvh::build(&scene("soup", &soup(40, 6), &[DAffine3::IDENTITY])).unwrap();
    let wrong = |change: &dyn Fn(&mut Bvh)| {
        let mut bvh = bvh.clone();
        change(&mut bvh);
        bvh.validate().expect_err("something is wrong").to_string()
    };
    let leaf = bvh.nodes.iter().position(|n| matches!(n, Node::Leaf { .. })).unwrap();
    let set_leaf = |bvh: &mut Bvh, change: &dyn Fn(&mut u32, &mut u32)| {
        if let Node::Leaf { first, count, .. } = &mut bvh.nodes[leaf] {
            change(first, count);
        }
    };
    let set_root = |bvh: &mut Bvh, change: &dyn Fn(&mut Aabb, &mut [u32; 2])| {
        if let Node::Inner { bounds, children } = &mut bvh.nodes[0] {
            change(bounds, children);
        }
    };
    let cases = [
        (wrong(&|b| set_leaf(b, &|_, count| *count = 0)), "has 0 triangles"),
        (wrong(&|b| set_leaf(b, &|_, count| *count = 9)), "has 9 triangles"),
        (wrong(&|b| set_leaf(b, &|first, _| *first = 40)), "ends at triangle"),
        (wrong(&|b| set_leaf(b, &|first, _| *first += 1)), "does not contain triangle"),
        (wrong(&|b| set_root(b, &|_, children| children[1] = children[0])), "the child of two nodes or twice of one"),
        (wrong(&|b| set_root(b, &|_, children| children[0] = 0)), "does not come after it"),
        (wrong(&|b| set_root(b, &|_, children| children[1] = 4000)), "but there are"),
        (wrong(&|b| set_root(b, &|_, children| children[1] += 1)), "is no node's child"),
        (
            wrong(&|b| set_root(b, &|bounds, _| bounds.max[1] = bounds.max[1].next_down())),
            "does not contain its child's",
        ),
        (wrong(&|b| b.triangles.push(b.triangles[0])), "triangle 40 is in no leaf"),
        (wrong(&|b| b.nodes.push(b.nodes[leaf])), "is no node's child"),
        (wrong(&|b| b.nodes.clear()), "40 triangles are in a tree of 0 nodes"),
        (wrong(&|b| b.depth += 1), "deep and says"),
    ];
    for (message, part) in cases {
        assert!(message.contains(part), "{message} has no {part}");
    }
}
