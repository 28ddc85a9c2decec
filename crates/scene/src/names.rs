//! Names by which a user chooses parts of a file: scenes, variants, animations, nodes.

use std::collections::HashMap;

use anyhow::{Context as _, Result};

/// Index of the item of a list with this name, or with this index; the error lists what there is.
pub(crate) fn by_name_or_index(kind: &str, wanted: &str, names: &[Option<&str>]) -> Result<usize> {
    let by_index = || wanted.parse::<usize>().ok().filter(|&index| index < names.len());
    names.iter().position(|name| *name == Some(wanted)).or_else(by_index).with_context(|| {
        let item = |(i, name): (usize, &Option<&str>)| name.map_or(i.to_string(), |name| format!("{i} \"{name}\""));
        let there: Vec<String> = names.iter().enumerate().map(item).collect();
        let there = if there.is_empty() { "none".to_owned() } else { there.join(", ") };
        format!("there is no {kind} \"{wanted}\"; the file has {there}")
    })
}

/// Keys of nodes: the name; the index for a name that two nodes have.
pub(crate) fn keys(names: &[Option<&str>]) -> Vec<String> {
    let mut counts = HashMap::new();
    for name in names.iter().flatten() {
        *counts.entry(*name).or_insert(0_usize) += 1;
    }
    let key = |(index, name): (usize, &Option<&str>)| match name {
        Some(name) if counts[name] == 1 && !name.is_empty() => (*name).to_owned(),
        _ => index.to_string(),
    };
    names.iter().enumerate().map(key).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_names_one_node() {
        let names = [Some("a"), Some("b"), Some("a"), None, Some("")];
        assert_eq!(keys(&names), ["0", "b", "2", "3", "4"]);
    }
}
