//! What a file contains, for lists that a user chooses from: scenes, variants, animations, and the tree of nodes.

use anyhow::{Result, bail};

use super::names::{INDEX, by_name_or_index, keys, position};
use super::{LoadOptions, Scene};

/// A part of the file that a user chooses.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FilePart {
    /// Its name; without one, its index.
    pub name: String,
    /// The word that chooses it: the name if no other part has it, else the index.
    pub key: String,
}

impl FilePart {
    /// Parts with these names.
    pub(crate) fn list(names: &[Option<&str>]) -> Vec<Self> {
        let named = names.iter().zip(keys(names)).enumerate();
        named.map(|(i, (name, key))| Self { name: name.map_or_else(|| i.to_string(), str::to_owned), key }).collect()
    }

    /// Index of the part that a user means by a word: a key, else a name, else an index.
    #[must_use]
    pub fn position(list: &[Self], wanted: &str) -> Option<usize> {
        let digits = wanted.strip_prefix(INDEX).unwrap_or(wanted);
        let by_index = || digits.parse().ok().filter(|&index: &usize| index < list.len());
        let by_key = list.iter().position(|part| part.key == wanted);
        by_key.or_else(|| list.iter().position(|part| part.name == wanted)).or_else(by_index)
    }
}

/// The contents of a scene's file. Study scenes, OBJ, STL and PLY files have a flat tree: one node for each instance,
/// light and camera.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outline {
    /// Scenes of the file.
    pub scenes: Vec<FilePart>,
    /// Index of the scene that was read.
    pub scene: usize,
    /// Variants of the materials (KHR_materials_variants).
    pub variants: Vec<FilePart>,
    /// Animations of the file.
    pub animations: Vec<Animation>,
    /// Nodes of the scene; a parent comes before its children.
    pub nodes: Vec<OutlineNode>,
}

/// An animation of the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Animation {
    /// Its name, and what `animation` of the options calls it.
    pub named: FilePart,
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
    /// Its index in the file.
    pub index: usize,
    /// Whether [`LoadOptions::hide`] finds it by its name: it is the first of this name in the file.
    pub is_named: bool,
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

    /// The node that [`LoadOptions::hide`] means by a word; `None` where the scene has no such node.
    #[must_use]
    pub fn node(&self, wanted: &str) -> Option<usize> {
        let by_key = self.nodes.iter().position(|node| node.key == wanted);
        let by_name = || self.nodes.iter().position(|node| node.is_named && node.name == wanted);
        let by_index = || {
            let index = wanted.strip_prefix(INDEX).unwrap_or(wanted).parse::<usize>().ok()?;
            self.nodes.iter().position(|node| node.index == index)
        };
        by_key.or_else(by_name).or_else(by_index)
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
    let cameras = scene.cameras.iter().map(|camera| camera.name.clone());
    let all: Vec<String> = instances.chain(lights).chain(cameras).collect();
    let names: Vec<Option<&str>> = all.iter().map(|name| Some(name.as_str())).collect();
    let hidden = hidden(options, &names, &vec![None; names.len()])?;
    let count = scene.instances.len();
    let first_camera = count + scene.lights.len();
    let kept = |range: std::ops::Range<usize>| {
        hidden[range].iter().scan(0, |next, hidden| {
            *next += usize::from(!hidden);
            Some((!hidden).then_some(*next - 1))
        })
    };
    let places: Vec<Option<usize>> = kept(0..count).chain(kept(count..first_camera)).collect();
    let nodes = all.iter().zip(keys(&names)).enumerate().map(|(index, (name, key))| {
        let mut node = OutlineNode {
            name: name.clone(),
            key,
            index,
            is_named: position(name, &names) == Some(index),
            hidden: hidden[index],
            ..OutlineNode::default()
        };
        if index < first_camera {
            let users = if index < count { &mut node.instances } else { &mut node.lights };
            users.extend(places[index]);
        } else {
            node.cameras.push(index - first_camera);
        }
        node
    });
    scene.outline = Outline { nodes: nodes.collect(), ..Outline::default() };
    let mut at = hidden.iter();
    scene.instances.retain(|_| !at.next().copied().unwrap_or_default());
    scene.lights.retain(|_| !at.next().copied().unwrap_or_default());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_found_by_every_word_that_the_loader_knows() {
        let names = [Some("a"), Some("0"), None, Some("a")];
        let list = FilePart::list(&names);
        for wanted in ["a", "0", "1", "2", "3", "4", "index:0", "index:1", "index:3", "index:9", "b"] {
            assert_eq!(FilePart::position(&list, wanted), position(wanted, &names), "{wanted}");
        }
        let node = |name: &str, key: &str, index, is_named| OutlineNode {
            name: name.to_owned(),
            key: key.to_owned(),
            index,
            is_named,
            ..OutlineNode::default()
        };
        // The file's first node "a" is in another scene.
        let nodes = vec![node("a", "7", 7, false), node("b", "b", 4, true)];
        let outline = Outline { nodes, ..Outline::default() };
        let found = ["a", "7", "index:7", "b", "4", "5"].map(|word| outline.node(word));
        assert_eq!(found, [None, Some(0), Some(0), Some(1), Some(1), None]);
    }

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
