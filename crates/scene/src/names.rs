//! Names by which a user chooses parts of a file: scenes, variants, animations, nodes, cameras.

use std::collections::HashMap;

use anyhow::{Context as _, Result};

/// What an index is written after where the number alone is the name of another item.
pub(crate) const INDEX: &str = "index:";

/// Index of the item that a user means: `index:N` is item N; any other word is the first item of this name, or the
/// item of this index if none has the name. `None` where there is no such item.
pub(crate) fn position(wanted: &str, names: &[Option<&str>]) -> Option<usize> {
    let index = |digits: &str| digits.parse::<usize>().ok().filter(|&index| index < names.len());
    match wanted.strip_prefix(INDEX).and_then(index) {
        Some(index) => Some(index),
        None => names.iter().position(|name| *name == Some(wanted)).or_else(|| index(wanted)),
    }
}

/// [`position`], with an error that lists what there is.
pub(crate) fn by_name_or_index(kind: &str, wanted: &str, names: &[Option<&str>]) -> Result<usize> {
    position(wanted, names).with_context(|| {
        let item = |(i, name): (usize, &Option<&str>)| name.map_or(i.to_string(), |name| format!("{i} \"{name}\""));
        let there: Vec<String> = names.iter().enumerate().map(item).collect();
        let there = if there.is_empty() { "none".to_owned() } else { there.join(", ") };
        format!("there is no {kind} \"{wanted}\"; the file has {there}")
    })
}

/// Keys of items, by which [`position`] finds each of them: the name; the index where two items have the name or none
/// is given.
pub(crate) fn keys(names: &[Option<&str>]) -> Vec<String> {
    let mut counts = HashMap::new();
    for name in names.iter().flatten() {
        *counts.entry(*name).or_insert(0_usize) += 1;
    }
    let key = |(index, name): (usize, &Option<&str>)| match name {
        Some(name) if counts[name] == 1 && !name.is_empty() && !name.starts_with(INDEX) => (*name).to_owned(),
        _ if counts.contains_key(index.to_string().as_str()) => format!("{INDEX}{index}"),
        _ => index.to_string(),
    };
    names.iter().enumerate().map(key).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_names_one_item() {
        let names = [Some("a"), Some("b"), Some("a"), None, Some("")];
        assert_eq!(keys(&names), ["0", "b", "2", "3", "4"]);
        let nasty = [Some("2"), Some("index:0"), None, Some("2"), Some("7"), Some("4"), Some("index:x")];
        for names in [&names[..], &nasty[..]] {
            for (index, key) in keys(names).iter().enumerate() {
                assert_eq!(position(key, names), Some(index), "{key} of {names:?}");
            }
        }
        assert_eq!(keys(&nasty)[2..5], ["index:2", "3", "7"]);
        assert_eq!(position("index:9", &nasty), None);
    }
}
