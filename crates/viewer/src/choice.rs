//! What of a file is shown, and what lights it.

use etalon::scene::{KeyLight, Outline};

/// What of a file is shown, and what lights it. As options of the command line.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FileChoice {
    /// Scene of the file, by name or index; `None`: the one that the file names.
    pub scene: Option<String>,
    /// Variant of the materials; `None`: the materials of the primitives.
    pub variant: Option<String>,
    /// Animation that plays, or `all`; `None`: those that do not move the same nodes.
    pub animation: Option<String>,
    /// Nodes that are left out.
    pub hide: Vec<String>,
    /// Nodes that alone are shown; empty: all.
    pub only: Vec<String>,
    /// Environment map, `studio` or `none`; `None`: the default.
    pub environment: Option<String>,
    /// A directional light beside those of the file.
    pub key_light: Option<KeyLight>,
}

impl FileChoice {
    /// The choice for another file: its light alone.
    #[must_use]
    pub fn of_another_file(&self) -> Self {
        Self::default().lit_as(self)
    }

    /// This choice with the light of another one.
    #[must_use]
    pub fn lit_as(&self, other: &Self) -> Self {
        Self { environment: other.environment.clone(), key_light: other.key_light, ..self.clone() }
    }

    /// Hides a node with everything below it.
    pub fn hide(&mut self, outline: &Outline, node: usize) {
        let key = &outline.nodes[node].key;
        if !self.hide.iter().any(|hidden| outline.node(hidden) == Some(node)) {
            self.hide.push(key.clone());
        }
    }

    /// Shows a node again: neither it nor a node above it is hidden, and it is among those that alone are shown.
    pub fn show(&mut self, outline: &Outline, node: usize) {
        let is_above = |word: &str| outline.node(word).is_some_and(|above| outline.is_within(node, above));
        self.hide.retain(|word| !is_above(word));
        if !self.only.is_empty() && !self.only.iter().any(|word| is_above(word)) {
            self.only.push(outline.nodes[node].key.clone());
        }
    }

    /// Shows one node alone, with everything below it.
    pub fn isolate(&mut self, outline: &Outline, node: usize) {
        self.show(outline, node);
        self.only = vec![outline.nodes[node].key.clone()];
    }
}

#[cfg(test)]
mod tests {
    use etalon::scene::outline::OutlineNode;

    use super::*;

    /// 0 above 1 above 2, and 3 alone; the names of 1 and 3 are the same.
    fn outline() -> Outline {
        let node = |name: &str, key: &str, index, parent| OutlineNode {
            name: name.to_owned(),
            key: key.to_owned(),
            index,
            parent,
            is_named: key != "8",
            ..OutlineNode::default()
        };
        let nodes = vec![
            node("root", "root", 5, None),
            node("arm", "6", 6, Some(0)),
            node("hand", "hand", 7, Some(1)),
            node("arm", "8", 8, None),
        ];
        Outline { nodes, ..Outline::default() }
    }

    #[test]
    fn nodes_are_hidden_once_and_shown_whichever_word_hides_them() {
        let outline = outline();
        let mut choice = FileChoice::default();
        choice.hide(&outline, 2);
        choice.hide(&outline, 2);
        assert_eq!(choice.hide, ["hand"]);
        // The command line may name a node by its index.
        for words in [["5", "hand"], ["index:6", "7"], ["root", "arm"]] {
            choice.hide = words.map(str::to_owned).to_vec();
            choice.hide(&outline, 2);
            choice.show(&outline, 2);
            assert_eq!(choice, FileChoice::default(), "{words:?}");
        }
        choice.hide = vec!["8".to_owned()];
        choice.show(&outline, 2);
        assert_eq!(choice.hide, ["8"], "a node elsewhere");
    }

    #[test]
    fn what_is_hidden_can_be_shown_alone() {
        let outline = outline();
        let mut choice = FileChoice { hide: vec!["root".to_owned(), "8".to_owned()], ..FileChoice::default() };
        choice.isolate(&outline, 1);
        assert_eq!((choice.hide.clone(), choice.only.clone()), (vec!["8".to_owned()], vec!["6".to_owned()]));
        choice.show(&outline, 2);
        assert_eq!(choice.only, ["6"], "it is below");
        choice.show(&outline, 3);
        assert_eq!((choice.hide.len(), choice.only), (0, vec!["6".to_owned(), "8".to_owned()]));
    }

    #[test]
    fn another_file_keeps_the_light() {
        let light = Some(KeyLight { azimuth: 1.0, elevation: 2.0, lux: 3.0 });
        let chosen = FileChoice { hide: vec!["a".to_owned()], key_light: light, ..FileChoice::default() };
        assert_eq!(chosen.of_another_file(), FileChoice { key_light: light, ..FileChoice::default() });
        let asked = FileChoice { scene: Some("two".to_owned()), ..FileChoice::default() };
        assert_eq!(asked.lit_as(&chosen), FileChoice { key_light: light, ..asked });
    }
}
