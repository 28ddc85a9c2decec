//! Node hierarchy of a glTF file at one time: local transforms, animation and world transforms, all in f64.
//!
//! Read glTF 2.0 sections 3.5 (scenes and nodes), 3.11 (animations) and appendix C (interpolation).

use anyhow::{Context, Result, bail, ensure};
use glam::{DAffine3, DMat4, DQuat, DVec3, DVec4};
use gltf::json::{
    self,
    animation::{Interpolation, Property},
    validation::Checked,
};

use super::{accessor::Accessor, container::Document};

/// All nodes with their world transforms.
pub(crate) struct Nodes {
    /// World transform of each node.
    pub(crate) world_from_node: Vec<DAffine3>,
    /// Nodes of the rendered scene, in the order of the file.
    pub(crate) shown: Vec<usize>,
    /// Morph weights of nodes whose weights are animated.
    pub(crate) animated_weights: Vec<Option<Vec<f32>>>,
    /// Time of the last keyframe of all animations, in seconds; `None` without animations.
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
    pub(crate) fn new(document: &Document<'_>, time: Option<f64>, warnings: &mut Vec<String>) -> Result<Self> {
        let nodes = &document.root.nodes;
        let mut locals: Vec<Local> =
            nodes.iter().enumerate().map(|(i, n)| local(n, &label(document, i), warnings)).collect();
        let mut animated_weights = vec![None; nodes.len()];
        if let Some(time) = time {
            animate(document, time, &mut locals, &mut animated_weights)?;
        }
        let parents = parents(document)?;
        let world_from_node = place(document, &parents, &locals)?;
        let shown = shown(document, &parents, warnings);
        Ok(Self { world_from_node, shown, animated_weights, duration: duration(document) })
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

/// World transforms, parents before children. Each node has at most one parent, so a node that no root reaches is in a cycle.
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

fn shown(document: &Document<'_>, parents: &[Option<usize>], warnings: &mut Vec<String>) -> Vec<usize> {
    let root = &document.root;
    let scene = root.scene.map_or(0, |s| s.value());
    let mut stack: Vec<usize> = match root.scenes.get(scene) {
        Some(scene) => scene.nodes.iter().map(json::Index::value).collect(),
        None => (0..root.nodes.len()).filter(|&i| parents[i].is_none()).collect(),
    };
    for &i in &stack {
        if let Some(parent) = parents.get(i).copied().flatten() {
            warnings.push(format!(
                "{} is named as a root of the scene although it is a child of node {parent}; it keeps its parent's placement",
                label(document, i)
            ));
        }
    }
    let mut is_shown = vec![false; root.nodes.len()];
    while let Some(i) = stack.pop() {
        if !std::mem::replace(&mut is_shown[i], true) {
            stack.extend(root.nodes[i].children.iter().flatten().map(json::Index::value));
        }
    }
    (0..root.nodes.len()).filter(|&i| is_shown[i]).collect()
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

/// Values of one channel: `width` values of `N` numbers per keyframe (`width` is 1 except for morph weights).
struct Track<const N: usize> {
    values: Vec<[f64; N]>,
    width: usize,
    interpolation: Interpolation,
    moment: Moment,
}

impl<const N: usize> Track<N> {
    fn at(&self, lane: usize, slerp: bool) -> [f64; N] {
        let Moment { key, fraction: t, span } = self.moment;
        let value = |key: usize, part: usize| {
            let parts = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
            self.values[(key * parts + part) * self.width + lane]
        };
        let blend = |f: &dyn Fn(usize) -> f64| std::array::from_fn(f);
        match self.interpolation {
            Interpolation::CubicSpline => {
                // A keyframe holds in-tangent, value and out-tangent; tangents are per second.
                let v0 = value(key, 1);
                if t == 0.0 {
                    return v0;
                }
                let (b0, a1, v1) = (value(key, 2), value(key + 1, 0), value(key + 1, 1));
                let (t2, t3) = (t * t, t * t * t);
                blend(&|i| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * v0[i]
                        + span * (t3 - 2.0 * t2 + t) * b0[i]
                        + (3.0 * t2 - 2.0 * t3) * v1[i]
                        + span * (t3 - t2) * a1[i]
                })
            }
            Interpolation::Linear if t > 0.0 => {
                let (v0, v1) = (value(key, 0), value(key + 1, 0));
                if slerp {
                    let q = |v: [f64; N]| unit_quaternion(std::array::from_fn(|i| v[i])).unwrap_or(DQuat::IDENTITY);
                    let turned = q(v0).slerp(q(v1), t).to_array();
                    return blend(&|i| turned[i]);
                }
                blend(&|i| v0[i] + t * (v1[i] - v0[i]))
            }
            _ => value(key, 0),
        }
    }
}

/// Time of the last keyframe of all animations. Unreadable samplers are skipped here; evaluation at a time reports them.
fn duration(document: &Document<'_>) -> Option<f64> {
    let samplers = document.root.animations.iter().flat_map(|animation| &animation.samplers);
    let times = samplers.filter_map(|sampler| Accessor::new(document, sampler.input.value()).ok()?.floats::<1>().ok());
    let ends = times.filter_map(|times| times.last().map(|time| f64::from(time[0])));
    ends.filter(|end| end.is_finite()).reduce(f64::max)
}

fn animate(document: &Document<'_>, time: f64, locals: &mut [Local], weights: &mut [Option<Vec<f32>>]) -> Result<()> {
    ensure!(time.is_finite(), "the animation time is not a number");
    for (a, animation) in document.root.animations.iter().enumerate() {
        for (c, channel) in animation.channels.iter().enumerate() {
            apply(document, animation, channel, time, locals, weights)
                .with_context(|| format!("animation {a} channel {c}"))?;
        }
    }
    Ok(())
}

fn apply(
    document: &Document<'_>,
    animation: &json::Animation,
    channel: &json::animation::Channel,
    time: f64,
    locals: &mut [Local],
    weights: &mut [Option<Vec<f32>>],
) -> Result<()> {
    let sampler = animation.samplers.get(channel.sampler.value()).context("it names a sampler that does not exist")?;
    let (Checked::Valid(interpolation), Checked::Valid(property)) = (&sampler.interpolation, &channel.target.path)
    else {
        bail!("its interpolation or target is unknown");
    };
    let times = Accessor::new(document, sampler.input.value())?.floats::<1>()?;
    ensure!(!times.is_empty(), "it has no keyframes");
    ensure!(
        times.iter().all(|t| t[0].is_finite()) && times.windows(2).all(|w| w[0][0] < w[1][0]),
        "its keyframe times do not increase"
    );
    let output = Accessor::new(document, sampler.output.value())?;
    let parts = if *interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let keys = times.len() * parts;
    let width = if *property == Property::MorphTargetWeights { output.count / keys } else { 1 };
    ensure!(
        output.count == keys * width && width > 0,
        "{} keyframes need a multiple of {keys} values, but accessor {} has {}",
        times.len(),
        sampler.output.value(),
        output.count
    );
    let node = channel.target.node.value();
    let moment = moment(&times, time);
    let interpolation = *interpolation;
    if *property == Property::MorphTargetWeights {
        let values = output.floats::<1>()?.into_iter().map(|v| v.map(f64::from)).collect();
        let track = Track { values, width, interpolation, moment };
        weights[node] = Some((0..width).map(|lane| track.at(lane, false)[0] as f32).collect());
        return Ok(());
    }
    if let Local::Matrix(m) = locals[node] {
        let (scale, rotation, translation) = m.to_scale_rotation_translation();
        locals[node] = Local::Parts { translation, rotation, scale };
    }
    let Local::Parts { translation, rotation, scale } = &mut locals[node] else { return Ok(()) };
    if *property == Property::Rotation {
        let values = output.floats::<4>()?.into_iter().map(|v| v.map(f64::from)).collect();
        let track = Track { values, width, interpolation, moment };
        *rotation = unit_quaternion(track.at(0, true)).context("its rotation at this time is no quaternion")?;
    } else {
        let values = output.floats::<3>()?.into_iter().map(|v| v.map(f64::from)).collect();
        let track = Track { values, width, interpolation, moment };
        let value = DVec3::from(track.at(0, false));
        *(if *property == Property::Scale { scale } else { translation }) = value;
    }
    Ok(())
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
            values: vec![[0.0], [0.0], [0.0], [12.0], [8.0], [0.0]],
            width: 1,
            interpolation: Interpolation::CubicSpline,
            moment: moment(&[[0.0], [2.0]], 1.5),
        };
        assert!((track.at(0, false)[0] - 3.375).abs() < 1e-12);
    }
}
