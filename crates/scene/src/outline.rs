//! What a file contains, for lists that a user chooses from: scenes, variants, animations, and the tree of nodes.

use anyhow::{Result, bail};

use super::names::{by_name_or_index, keys};
use super::{LoadOptions, Scene};

/// The contents of a scene's file. Study scenes, OBJ, STL and PLY files have a flat tree: one node for each instance,
/// light and camera.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outline {
    /// Scenes of the file; a scene without name is called by its index.
    pub scenes: Vec<String>,
    /// Index of the scene that was read.
    pub scene: usize,
    /// Variants of the materials (KHR_materials_variants).
    pub variants: Vec<String>,
    /// Animations of the file.
    pub animations: Vec<Animation>,
    /// Nodes of the scene; a parent comes before its children.
    pub nodes: Vec<OutlineNode>,
}

/// An animation of the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Animation {
    /// Its name; without one, its index.
    pub name: String,
    /// Time of its last keyframe in seconds; 0 where it has none.
    pub seconds: f64,
    /// Whether it moves the scene.
    pub plays: bool,
}

/// A node of the tree.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OutlineNode {
    /// Its name; without one, its index in the file.
    pub name: String,
    /// What [`LoadOptions::hide`] calls it: the name if no other node has it, else the index in the file.
    pub key: String,
    /// Index of its parent into [`Outline::nodes`]; `None` for a root.
    pub parent: Option<usize>,
    /// Indices into [`Scene::instances`].
    pub instances: Vec<usize>,
    /// Indices into [`Scene::lights`].
    pub lights: Vec<usize>,
    /// Indices into [`Scene::cameras`].
    pub cameras: Vec<usize>,
    /// Whether the options of loading hide it, by itself or by a node above it.
    pub hidden: bool,
}

impl Outline {
    /// Whether a node is below another one, or is the same.
    #[must_use]
    pub fn is_within(&self, node: usize, above: usize) -> bool {
        std::iter::successors(Some(node), |&at| self.nodes[at].parent).any(|at| at == above)
    }

    /// The node that an instance belongs to.
    #[must_use]
    pub fn node_of(&self, instance: usize) -> Option<usize> {
        self.nodes.iter().position(|node| node.instances.contains(&instance))
    }

    /// Instances of a node and of all nodes below it.
    #[must_use]
    pub fn instances_within(&self, above: usize) -> Vec<usize> {
        let within = (0..self.nodes.len()).filter(|&node| self.is_within(node, above));
        within.flat_map(|node| self.nodes[node].instances.iter().copied()).collect()
    }
}

/// Which nodes the options hide; `parents` and `names` are those of all nodes.
pub(crate) fn hidden(options: &LoadOptions, names: &[Option<&str>], parents: &[Option<usize>]) -> Result<Vec<bool>> {
    let marked = |wanted: &[String]| -> Result<Vec<bool>> {
        let mut marked = vec![false; names.len()];
        for name in wanted {
            marked[by_name_or_index("node", name, names)?] = true;
        }
        Ok(marked)
    };
    let (hide, only) = (marked(&options.hide)?, marked(&options.only)?);
    let has = |marks: &[bool], node: usize| std::iter::successors(Some(node), |&at| parents[at]).any(|at| marks[at]);
    Ok((0..names.len()).map(|node| has(&hide, node) || (!options.only.is_empty() && !has(&only, node))).collect())
}

/// Gives a scene without a tree a flat one, and hides what the options hide.
pub(crate) fn flat(scene: &mut Scene, options: &LoadOptions) -> Result<()> {
    if options.animation.is_some() {
        bail!("{} has no animations to choose", scene.name);
    }
    let instances = scene.instances.iter().map(|instance| instance.name.clone());
    let lights = scene.lights.iter().map(|light| light.name.clone());
    let all: Vec<String> = instances.chain(lights).collect();
    let names: Vec<Option<&str>> = all.iter().map(|name| Some(name.as_str())).collect();
    let hidden = hidden(options, &names, &vec![None; names.len()])?;
    let count = scene.instances.len();
    let kept = |range: std::ops::Range<usize>| {
        hidden[range].iter().scan(0, |next, hidden| {
            *next += usize::from(!hidden);
            Some((!hidden).then_some(*next - 1))
        })
    };
    let places: Vec<Option<usize>> = kept(0..count).chain(kept(count..all.len())).collect();
    let nodes = all.iter().zip(keys(&names)).zip(&places).enumerate().map(|(index, ((name, key), place))| {
        let place: Vec<usize> = place.iter().copied().collect();
        let (instances, lights) = if index < count { (place, Vec::new()) } else { (Vec::new(), place) };
        OutlineNode { name: name.clone(), key, instances, lights, hidden: hidden[index], ..OutlineNode::default() }
    });
    let cameras = scene.cameras.iter().enumerate().map(|(index, camera)| OutlineNode {
        name: camera.name.clone(),
        key: (all.len() + index).to_string(),
        cameras: vec![index],
        ..OutlineNode::default()
    });
    scene.outline = Outline { nodes: nodes.chain(cameras).collect(), ..Outline::default() };
    let mut at = hidden.iter();
    scene.instances.retain(|_| !at.next().copied().unwrap_or_default());
    scene.lights.retain(|_| !at.next().copied().unwrap_or_default());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_below_a_hidden_node_is_hidden() {
        // 0 above 1 above 2; 3 alone.
        let parents = [None, Some(0), Some(1), None];
        let names = [Some("a"), Some("b"), Some("c"), Some("d")];
        let with = |hide: &[&str], only: &[&str]| {
            let list = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
            let options = LoadOptions { hide: list(hide), only: list(only), ..LoadOptions::default() };
            hidden(&options, &names, &parents)
        };
        assert_eq!(with(&["b"], &[]).unwrap(), [false, true, true, false]);
        assert_eq!(with(&[], &["b"]).unwrap(), [true, false, false, true]);
        assert_eq!(with(&["2"], &["a"]).unwrap(), [false, false, true, true]);
        assert!(format!("{:#}", with(&["x"], &[]).unwrap_err()).contains("there is no node \"x\""));
    }
}
