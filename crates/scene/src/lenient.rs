//! Legal files that the schema crate cannot hold: they are rewritten until it can, and what it has no room for is kept
//! beside it.
//!
//! Read glTF 2.0 section 5 (schemas) and KHR_animation_pointer. A whole number may be written as 1.0; a scene may have
//! no nodes; a channel without a target node is ignored, or animates whatever its JSON pointer names.

use anyhow::{Context, Result, anyhow, bail};
use gltf::json::Root;
use serde_json::{Map, Number, Value, json};

use super::document::{Document, PointerChannel};
use super::nodes::sampled;

/// Reads JSON that the schema crate refuses as it is; channels with pointers are taken out of it.
pub(crate) fn read(bytes: &[u8], warnings: &mut Vec<String>) -> Result<(Root, Vec<PointerChannel>)> {
    let mut value: Value = serde_json::from_slice(bytes)?;
    whole_numbers(&mut value);
    complete(&mut value);
    let mut pointers = Vec::new();
    for (a, animation) in list(&mut value, "animations").iter_mut().enumerate() {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { continue };
        let mut index = 0;
        channels.retain(|channel| {
            let c = index;
            index += 1;
            let Some(target) = channel.get("target").filter(|target| target.get("node").is_none()) else { return true };
            let pointer = target.pointer("/extensions/KHR_animation_pointer/pointer").and_then(Value::as_str);
            let sampler = channel.get("sampler").and_then(Value::as_u64).and_then(|index| usize::try_from(index).ok());
            match (pointer, sampler) {
                (Some(pointer), Some(sampler)) => {
                    pointers.push(PointerChannel { animation: a, sampler, pointer: pointer.to_owned() });
                }
                _ => warnings.push(format!("animation {a} channel {c} has no target node and is ignored")),
            }
            false
        });
    }
    Ok((root_of(&value)?, pointers))
}

/// The document of a changed value. It is read by the schema crate's own function for bytes: a generic one would be
/// compiled here once more, which took a third of this crate's build.
fn root_of(value: &Value) -> Result<Root> {
    Root::from_slice(&serde_json::to_vec(value)?).map_err(|error| {
        // Line and column are left out: nobody sees this text.
        let message = error.to_string();
        anyhow!("{}", message.rsplit_once(" at line ").map_or(message.as_str(), |(what, _)| what))
    })
}

/// Adds the empty lists that the schema crate demands: a scene's nodes, an animation's channels.
fn complete(value: &mut Value) {
    for (objects, member) in [("scenes", "nodes"), ("animations", "channels")] {
        for object in list(value, objects).iter_mut().filter_map(Value::as_object_mut) {
            object.entry(member).or_insert_with(|| json!([]));
        }
    }
}

fn list<'v>(value: &'v mut Value, name: &str) -> &'v mut [Value] {
    value.get_mut(name).and_then(Value::as_array_mut).map_or(&mut [], Vec::as_mut_slice)
}

/// Writes whole numbers such as 1.0 as integers.
fn whole_numbers(value: &mut Value) {
    /// Integers up to here are exact in f64.
    const LARGEST: f64 = (1_u64 << 53) as f64;
    match value {
        Value::Number(number) => {
            let whole = number.as_f64().filter(|x| number.is_f64() && x.fract() == 0.0 && x.abs() <= LARGEST);
            if let Some(whole) = whole {
                *number = Number::from(whole as i64);
            }
        }
        Value::Array(values) => values.iter_mut().for_each(whole_numbers),
        Value::Object(members) => members.values_mut().for_each(whole_numbers),
        _ => {}
    }
}

/// Removes members that are null. JSON has no infinity, which is the default of `attenuationDistance`; what a file
/// leaves out has its default again.
fn drop_nulls(value: &mut Value) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(drop_nulls),
        Value::Object(members) => {
            members.retain(|_, member| !member.is_null());
            members.values_mut().for_each(drop_nulls);
        }
        _ => {}
    }
}

/// The file at a time of its animation: each property that a pointer animates has its value of that time.
pub(crate) fn at(document: &Document<'_>, plays: &[bool], time: f64) -> Result<Root> {
    // By its own function for bytes, as in `root_of`.
    let mut value: Value = serde_json::from_slice(&document.root.to_vec()?)?;
    drop_nulls(&mut value);
    complete(&mut value);
    for channel in document.pointers.iter().filter(|channel| plays.get(channel.animation) == Some(&true)) {
        let PointerChannel { animation, sampler, pointer } = channel;
        let place = || format!("animation {animation}: the pointer {pointer}");
        let json = document.root.animations.get(*animation).with_context(place)?;
        let numbers = sampled(document, json, *sampler, time, pointer.ends_with("/rotation")).with_context(place)?;
        let number = |x: f64| Number::from_f64(x).map(Value::Number).context("a value is not finite");
        let member = pointer.rsplit('/').next().unwrap_or_default();
        let new = match numbers[..] {
            // Booleans are stored as 0 and 1, and are not interpolated.
            [one] if member == "visible" => Value::Bool(one != 0.0),
            [one] if member != "weights" => number(one).with_context(place)?,
            _ => numbers.iter().map(|x| number(*x)).collect::<Result<_>>().with_context(place)?,
        };
        set(&mut value, pointer, new).with_context(place)?;
    }
    root_of(&value).context("the animated properties make no glTF 2.0")
}

/// Sets the value at a JSON pointer (RFC 6901). Members that are missing on the way are those with defaults; elements
/// of lists are there.
fn set(root: &mut Value, pointer: &str, new: Value) -> Result<()> {
    let mut at = root;
    for token in pointer.strip_prefix('/').context("it does not begin with /")?.split('/') {
        let token = token.replace("~1", "/").replace("~0", "~");
        at = match at {
            Value::Array(values) => {
                let index = token.parse::<usize>().ok();
                index.and_then(|index| values.get_mut(index)).with_context(|| format!("there is no element {token}"))?
            }
            Value::Object(members) => members.entry(token).or_insert(Value::Null),
            Value::Null => {
                *at = Value::Object(Map::new());
                at.as_object_mut().context("an object")?.entry(token).or_insert(Value::Null)
            }
            _ => bail!("{token} is below a value"),
        };
    }
    *at = new;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_become_integers() {
        let mut value = json!({ "a": [1.0, 0.5, -3.0], "b": 1e300 });
        whole_numbers(&mut value);
        assert_eq!(value, json!({ "a": [1, 0.5, -3], "b": 1e300 }));
    }

    #[test]
    fn a_value_that_makes_no_gltf_is_named_without_a_place() {
        let error = root_of(&json!({ "asset": { "version": "2.0" }, "scene": " at line " })).unwrap_err().to_string();
        assert!(error.contains("\" at line \"") && !error.contains("column"), "{error}");
    }

    #[test]
    fn pointers_make_missing_members_and_no_elements() {
        let mut value = json!({ "nodes": [{}] });
        set(&mut value, "/nodes/0/extensions/KHR_node_visibility/visible", json!(false)).unwrap();
        assert_eq!(value["nodes"][0]["extensions"]["KHR_node_visibility"]["visible"], json!(false));
        assert!(set(&mut value, "/nodes/1/translation", json!(0)).is_err());
        assert!(set(&mut value, "nodes", json!(0)).is_err());
    }
}
