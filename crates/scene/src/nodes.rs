//! Node hierarchy of a glTF file at one time: local transforms, animation and world transforms, all in f64.
//!
//! Read glTF 2.0 sections 3.5 (scenes and nodes), 3.11 (animations) and appendix C (interpolation).

use std::collections::HashSet;

use anyhow::{Context, Result, anyhow, bail, ensure};
use glam::{DAffine3, DMat4, DQuat, DVec3, DVec4};
use gltf::json::{
    self,
    animation::{Interpolation, Property},
    validation::Checked,
};

use serde_json::Value;

use super::{LoadOptions, accessor::Accessor, document::Document, names::by_name_or_index, outline};

/// Largest number of copies of one node: more instances than the G-buffer's index holds.
const MOST_COPIES: usize = 1 << 23;

/// All nodes with their world transforms.
pub(crate) struct Nodes {
    /// World transform of each node.
    pub(crate) world_from_node: Vec<DAffine3>,
    /// Transforms of the copies of a node's mesh (EXT_mesh_gpu_instancing), in the node's space; `None` for one copy.
    pub(crate) copies: Vec<Option<Vec<DAffine3>>>,
    /// Nodes of the rendered scene, in the order of the file.
    pub(crate) in_scene: Vec<usize>,
    /// Those of them that are visible.
    pub(crate) shown: Vec<usize>,
    /// Which of all nodes the options hide: their meshes and lights are left out.
    pub(crate) hidden: Vec<bool>,
    /// Parent of each node.
    pub(crate) parents: Vec<Option<usize>>,
    /// Morph weights of nodes whose weights are animated.
    pub(crate) animated_weights: Vec<Option<Vec<f32>>>,
    /// Time of the last keyframe of the animations that play, in seconds; `None` without animations.
    pub(crate) duration: Option<f64>,
}

/// A local transform, in the form the file gives it.
#[derive(Clone, Copy)]
enum Local {
    Matrix(DAffine3),
    Parts { translation: DVec3, rotation: DQuat, scale: DVec3 },
}

impl Local {
    fn matrix(self) -> DAffine3 {
        match self {
            Self::Matrix(m) => m,
            Self::Parts { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation, translation)
            }
        }
    }
}

/// Name of a node for messages.
pub(crate) fn label(document: &Document<'_>, index: usize) -> String {
    match document.root.nodes.get(index).and_then(|n| n.name.as_deref()) {
        Some(name) => format!("node {index} \"{name}\""),
        None => format!("node {index}"),
    }
}

impl Nodes {
    /// Evaluates the hierarchy at `time` in seconds, or in the rest pose.
    pub(crate) fn new(
        document: &Document<'_>,
        options: &LoadOptions,
        plays: &[bool],
        warnings: &mut Vec<String>,
    ) -> Result<Self> {
        let nodes = &document.root.nodes;
        let mut locals: Vec<Local> =
            nodes.iter().enumerate().map(|(i, n)| local(n, &label(document, i), warnings)).collect();
        let mut animated_weights = vec![None; nodes.len()];
        if let Some(time) = options.time {
            animate(document, plays, time, &mut locals, &mut animated_weights)?;
        }
        let parents = parents(document)?;
        let world_from_node = place(document, &parents, &locals)?;
        let [in_scene, shown] = shown(document, options.scene.as_deref(), &parents, warnings)?;
        let mut copies = vec![None; nodes.len()];
        for &node in &shown {
            copies[node] = instances(document, node).with_context(|| label(document, node))?;
        }
        let names: Vec<Option<&str>> = nodes.iter().map(|node| node.name.as_deref()).collect();
        let hidden = outline::hidden(options, &names, &parents)?;
        let duration = document.root.animations.iter().zip(plays).filter(|(_, plays)| **plays);
        let duration = duration.filter_map(|(animation, _)| end(document, animation)).reduce(f64::max);
        Ok(Self { world_from_node, copies, in_scene, shown, hidden, parents, animated_weights, duration })
    }
}

fn local(node: &json::Node, label: &str, warnings: &mut Vec<String>) -> Local {
    if let Some(m) = node.matrix {
        let m = DMat4::from_cols_array(&m.map(f64::from));
        if m.row(3) != DVec4::W {
            warnings.push(format!("the matrix of {label} is not affine; its last row is ignored"));
        }
        return Local::Matrix(DAffine3::from_mat4(m));
    }
    let translation = node.translation.map_or(DVec3::ZERO, |t| DVec3::from(t.map(f64::from)));
    let scale = node.scale.map_or(DVec3::ONE, |s| DVec3::from(s.map(f64::from)));
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |r| {
        unit_quaternion(r.0.map(f64::from)).unwrap_or_else(|| {
            warnings.push(format!("the rotation of {label} is no quaternion; it is left unturned"));
            DQuat::IDENTITY
        })
    });
    Local::Parts { translation, rotation, scale }
}

fn unit_quaternion(xyzw: [f64; 4]) -> Option<DQuat> {
    let q = DQuat::from_array(xyzw);
    let length = q.length();
    (length.is_finite() && length > 1e-12).then(|| q / length)
}

/// Parent of each node. A node with two parents, or a node that is its own ancestor, is an error.
fn parents(document: &Document<'_>) -> Result<Vec<Option<usize>>> {
    let nodes = &document.root.nodes;
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in node.children.iter().flatten() {
            let slot = parents.get_mut(child.value()).with_context(|| {
                format!("{} names child {}, but the file has {} nodes", label(document, i), child.value(), nodes.len())
            })?;
            if let Some(other) = *slot {
                bail!("{} is a child of both node {other} and node {i}", label(document, child.value()));
            }
            *slot = Some(i);
        }
    }
    Ok(parents)
}

/// World transforms, parents before children. Each node has at most one parent, so a node that no root reaches is in a
/// cycle.
fn place(document: &Document<'_>, parents: &[Option<usize>], locals: &[Local]) -> Result<Vec<DAffine3>> {
    let nodes = &document.root.nodes;
    let mut world: Vec<Option<DAffine3>> = vec![None; nodes.len()];
    let mut stack: Vec<usize> = (0..nodes.len()).filter(|&i| parents[i].is_none()).collect();
    while let Some(i) = stack.pop() {
        let parent = parents[i].and_then(|p| world[p]).unwrap_or(DAffine3::IDENTITY);
        let placed = parent * locals[i].matrix();
        ensure!(placed.is_finite(), "the placement of {} in the world is not finite", label(document, i));
        world[i] = Some(placed);
        stack.extend(nodes[i].children.iter().flatten().map(json::Index::value));
    }
    world
        .into_iter()
        .enumerate()
        .map(|(i, w)| w.with_context(|| format!("{} is its own ancestor", label(document, i))))
        .collect()
}

/// KHR_node_visibility: the node and everything below it can be hidden.
fn is_visible(node: &json::Node) -> bool {
    let extension = node.extensions.as_ref().and_then(|extensions| extensions.others.get("KHR_node_visibility"));
    extension.and_then(|value| value.get("visible")).and_then(Value::as_bool).unwrap_or(true)
}

/// EXT_mesh_gpu_instancing: the transforms of a node's copies.
fn instances(document: &Document<'_>, node: usize) -> Result<Option<Vec<DAffine3>>> {
    const NAME: &str = "EXT_mesh_gpu_instancing";
    let extensions = document.root.nodes[node].extensions.as_ref();
    let Some(value) = extensions.and_then(|extensions| extensions.others.get(NAME)) else { return Ok(None) };
    let attributes =
        value.get("attributes").and_then(Value::as_object).with_context(|| format!("{NAME}: attributes"))?;
    let accessor = |name: &str| -> Result<Option<Accessor<'_>>> {
        let Some(index) = attributes.get(name) else { return Ok(None) };
        let index = index.as_u64().and_then(|index| usize::try_from(index).ok());
        let index = index.with_context(|| format!("{NAME}: {name} is no index of an accessor"))?;
        Accessor::new(document, index).map(Some).with_context(|| format!("{NAME}: {name}"))
    };
    let (translations, rotations, scales) = (accessor("TRANSLATION")?, accessor("ROTATION")?, accessor("SCALE")?);
    let counts: Vec<usize> = [&translations, &rotations, &scales].into_iter().flatten().map(|a| a.count).collect();
    let Some(&count) = counts.first() else { return Ok(None) };
    ensure!(counts.iter().all(|&other| other == count), "{NAME}: its attributes have {counts:?} elements");
    ensure!(count <= MOST_COPIES, "{NAME}: {count} copies, more than {MOST_COPIES}");
    let translations = translations.map_or_else(|| Ok(vec![[0.0; 3]; count]), |a| a.floats::<3>())?;
    let rotations = rotations.map_or_else(|| Ok(vec![[0.0, 0.0, 0.0, 1.0]; count]), |a| a.floats::<4>())?;
    let scales = scales.map_or_else(|| Ok(vec![[1.0; 3]; count]), |a| a.floats::<3>())?;
    let copies = translations.iter().zip(&rotations).zip(&scales).enumerate().map(|(i, ((t, r), s))| {
        let rotation = unit_quaternion(r.map(f64::from)).with_context(|| format!("{NAME}: rotation {i}"))?;
        let [scale, translation] = [s, t].map(|v| DVec3::from(v.map(f64::from)));
        ensure!(scale.is_finite() && translation.is_finite(), "{NAME}: copy {i} is not finite");
        Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
    });
    copies.collect::<Result<_>>().map(Some)
}

/// The scene of the file that is rendered: by the index or the name that was asked for, else the default, else the
/// first.
pub(crate) fn chosen_scene(root: &json::Root, wanted: Option<&str>) -> Result<usize> {
    let Some(wanted) = wanted else { return Ok(root.scene.map_or(0, |scene| scene.value())) };
    let names: Vec<Option<&str>> = root.scenes.iter().map(|scene| scene.name.as_deref()).collect();
    by_name_or_index("scene", wanted, &names)
}

/// The nodes of the scene, and those of them that are visible.
fn shown(
    document: &Document<'_>,
    scene: Option<&str>,
    parents: &[Option<usize>],
    warnings: &mut Vec<String>,
) -> Result<[Vec<usize>; 2]> {
    let root = &document.root;
    let roots: Vec<usize> = match root.scenes.get(chosen_scene(root, scene)?) {
        Some(scene) => scene.nodes.iter().map(json::Index::value).collect(),
        None => (0..root.nodes.len()).filter(|&i| parents[i].is_none()).collect(),
    };
    for &i in &roots {
        if let Some(parent) = parents.get(i).copied().flatten() {
            warnings.push(format!(
                "{} is named as a root of the scene although it is a child of node {parent}; it keeps its parent's placement",
                label(document, i)
            ));
        }
    }
    let reached = |mut stack: Vec<usize>, passes: &dyn Fn(usize) -> bool| -> Vec<usize> {
        let mut is_reached = vec![false; root.nodes.len()];
        while let Some(i) = stack.pop() {
            if passes(i) && !std::mem::replace(&mut is_reached[i], true) {
                stack.extend(root.nodes[i].children.iter().flatten().map(json::Index::value));
            }
        }
        (0..root.nodes.len()).filter(|&i| is_reached[i]).collect()
    };
    Ok([reached(roots.clone(), &|_| true), reached(roots, &|i| is_visible(&root.nodes[i]))])
}

/// Position of a time among keyframes.
struct Moment {
    /// Last keyframe at or before the time.
    key: usize,
    /// Fraction of the way to the next keyframe; 0 before the first and after the last.
    fraction: f64,
    /// Seconds between the two keyframes.
    span: f64,
}

fn moment(times: &[[f32; 1]], time: f64) -> Moment {
    let after = times.partition_point(|t| f64::from(t[0]) <= time);
    if after == 0 || after == times.len() {
        return Moment { key: after.saturating_sub(1), fraction: 0.0, span: 0.0 };
    }
    let (a, b) = (f64::from(times[after - 1][0]), f64::from(times[after][0]));
    Moment { key: after - 1, fraction: (time - a) / (b - a), span: b - a }
}

/// Values of a sampler: `width` numbers per keyframe, and two tangents as wide with cubic splines.
struct Track {
    values: Vec<f64>,
    width: usize,
    interpolation: Interpolation,
    moment: Moment,
}

impl Track {
    /// The numbers at the moment; `as_rotation` interpolates linearly between unit quaternions by slerp.
    fn at(&self, as_rotation: bool) -> Vec<f64> {
        let Moment { key, fraction: t, span } = self.moment;
        let value = |key: usize, part: usize| {
            let parts = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
            let start = (key * parts + part) * self.width;
            &self.values[start..start + self.width]
        };
        match self.interpolation {
            Interpolation::CubicSpline => {
                // A keyframe holds in-tangent, value and out-tangent; tangents are per second.
                let v0 = value(key, 1);
                if t == 0.0 {
                    return v0.to_vec();
                }
                let (b0, a1, v1) = (value(key, 2), value(key + 1, 0), value(key + 1, 1));
                let (t2, t3) = (t * t, t * t * t);
                let hermite = |i: usize| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * v0[i]
                        + span * (t3 - 2.0 * t2 + t) * b0[i]
                        + (3.0 * t2 - 2.0 * t3) * v1[i]
                        + span * (t3 - t2) * a1[i]
                };
                (0..self.width).map(hermite).collect()
            }
            Interpolation::Linear if t > 0.0 => {
                let (v0, v1) = (value(key, 0), value(key + 1, 0));
                if let (true, &[ax, ay, az, aw], &[bx, by, bz, bw]) = (as_rotation, v0, v1) {
                    let q = |xyzw: [f64; 4]| unit_quaternion(xyzw).unwrap_or(DQuat::IDENTITY);
                    return q([ax, ay, az, aw]).slerp(q([bx, by, bz, bw]), t).to_array().to_vec();
                }
                v0.iter().zip(v1).map(|(v0, v1)| v0 + t * (v1 - v0)).collect()
            }
            _ => value(key, 0).to_vec(),
        }
    }
}

/// Time of the last keyframe of an animation. Unreadable samplers are skipped here; evaluation at a time reports them.
pub(crate) fn end(document: &Document<'_>, animation: &json::Animation) -> Option<f64> {
    let times = animation
        .samplers
        .iter()
        .filter_map(|sampler| Accessor::new(document, sampler.input.value()).ok()?.floats::<1>().ok());
    let ends = times.filter_map(|times| times.last().map(|time| f64::from(time[0])));
    ends.filter(|end| end.is_finite()).reduce(f64::max)
}

/// Which animations play: the one that is asked for, all of them, or those that move nothing that an earlier one moves.
pub(crate) fn playing(document: &Document<'_>, options: &LoadOptions, warnings: &mut Vec<String>) -> Result<Vec<bool>> {
    let animations = &document.root.animations;
    let names: Vec<Option<&str>> = animations.iter().map(|animation| animation.name.as_deref()).collect();
    match options.animation.as_deref() {
        Some("all") => return Ok(vec![true; animations.len()]),
        Some(wanted) => {
            let found = by_name_or_index("animation", wanted, &names)?;
            return Ok((0..animations.len()).map(|index| index == found).collect());
        }
        None => {}
    }
    let mut moved = HashSet::new();
    let mut plays = Vec::new();
    for (index, animation) in animations.iter().enumerate() {
        let nodes = animation.channels.iter().filter_map(|channel| match channel.target.path {
            Checked::Valid(path) => Some(format!("{} {path:?}", channel.target.node.value())),
            Checked::Invalid => None,
        });
        let pointers = document.pointers.iter().filter(|pointer| pointer.animation == index);
        let targets: Vec<String> = nodes.chain(pointers.map(|pointer| pointer.pointer.clone())).collect();
        plays.push(targets.iter().all(|target| !moved.contains(target)));
        if plays[index] {
            moved.extend(targets);
        }
    }
    let quoted = |wanted: bool| {
        let of = names.iter().zip(&plays).enumerate().filter(|(_, (_, plays))| **plays == wanted);
        let quoted = of.map(|(i, (name, _))| name.map_or(i.to_string(), |name| format!("\"{name}\"")));
        quoted.collect::<Vec<_>>().join(", ")
    };
    if options.time.is_some() && plays.contains(&false) {
        warnings.push(format!(
            "the animations {} do not play, for they move what others move: {} plays",
            quoted(false),
            quoted(true)
        ));
    }
    Ok(plays)
}

fn animate(
    document: &Document<'_>,
    plays: &[bool],
    time: f64,
    locals: &mut [Local],
    weights: &mut [Option<Vec<f32>>],
) -> Result<()> {
    ensure!(time.is_finite(), "the animation time is not a number");
    let all = document.root.animations.iter().enumerate();
    for (a, animation) in all.filter(|(a, _)| plays[*a]) {
        for (c, channel) in animation.channels.iter().enumerate() {
            apply(document, animation, channel, time, locals, weights)
                .with_context(|| format!("animation {a} channel {c}"))?;
        }
    }
    Ok(())
}

/// The numbers of a sampler at a time.
pub(crate) fn sampled(
    document: &Document<'_>,
    animation: &json::Animation,
    sampler: usize,
    time: f64,
    as_rotation: bool,
) -> Result<Vec<f64>> {
    let sampler = animation.samplers.get(sampler).context("it names a sampler that does not exist")?;
    let Checked::Valid(interpolation) = sampler.interpolation else { bail!("its interpolation is unknown") };
    let times = Accessor::new(document, sampler.input.value())?.floats::<1>()?;
    ensure!(!times.is_empty(), "it has no keyframes");
    ensure!(
        times.iter().all(|t| t[0].is_finite()) && times.windows(2).all(|w| w[0][0] < w[1][0]),
        "its keyframe times do not increase"
    );
    let values = Accessor::new(document, sampler.output.value())?.numbers()?;
    let keys = times.len() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let width = values.len() / keys;
    ensure!(
        values.len() == keys * width && width > 0,
        "{} keyframes need a multiple of {keys} values, but accessor {} has {}",
        times.len(),
        sampler.output.value(),
        values.len()
    );
    let values = values.into_iter().map(f64::from).collect();
    Ok(Track { values, width, interpolation, moment: moment(&times, time) }.at(as_rotation))
}

fn apply(
    document: &Document<'_>,
    animation: &json::Animation,
    channel: &json::animation::Channel,
    time: f64,
    locals: &mut [Local],
    weights: &mut [Option<Vec<f32>>],
) -> Result<()> {
    let Checked::Valid(property) = channel.target.path else { bail!("its target is unknown") };
    let values = sampled(document, animation, channel.sampler.value(), time, property == Property::Rotation)?;
    let node = channel.target.node.value();
    if property == Property::MorphTargetWeights {
        weights[node] = Some(values.into_iter().map(|weight| weight as f32).collect());
        return Ok(());
    }
    if let Local::Matrix(m) = locals[node] {
        let (scale, rotation, translation) = m.to_scale_rotation_translation();
        locals[node] = Local::Parts { translation, rotation, scale };
    }
    let Local::Parts { translation, rotation, scale } = &mut locals[node] else { return Ok(()) };
    let (into, numbers) = match property {
        Property::Rotation => {
            let xyzw = values.try_into().map_err(|values: Vec<f64>| wrong_width(values.len(), 4))?;
            *rotation = unit_quaternion(xyzw).context("its rotation at this time is no quaternion")?;
            return Ok(());
        }
        Property::Scale => (scale, values),
        _ => (translation, values),
    };
    let xyz: [f64; 3] = numbers.try_into().map_err(|values: Vec<f64>| wrong_width(values.len(), 3))?;
    *into = DVec3::from(xyz);
    Ok(())
}

fn wrong_width(found: usize, expected: usize) -> anyhow::Error {
    anyhow!("a keyframe has {found} numbers, not {expected}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_clamped_to_the_keyframes() {
        let times = [[1.0], [2.0], [4.0]];
        let at = |t| moment(&times, t);
        assert_eq!((at(0.0).key, at(0.0).fraction), (0, 0.0));
        assert_eq!((at(1.0).key, at(1.0).fraction), (0, 0.0));
        assert_eq!((at(3.5).key, at(3.5).fraction, at(3.5).span), (1, 0.75, 2.0));
        assert_eq!((at(4.0).key, at(4.0).fraction), (2, 0.0));
        assert_eq!((at(9.0).key, at(9.0).fraction), (2, 0.0));
    }

    #[test]
    fn a_cubic_spline_follows_its_hermite_polynomial() {
        // The cubic x³ on [0, 2]: values 0 and 8, slopes 0 and 12 per second.
        let track = Track {
            values: vec![0.0, 0.0, 0.0, 12.0, 8.0, 0.0],
            width: 1,
            interpolation: Interpolation::CubicSpline,
            moment: moment(&[[0.0], [2.0]], 1.5),
        };
        assert!((track.at(false)[0] - 3.375).abs() < 1e-12);
    }
}
