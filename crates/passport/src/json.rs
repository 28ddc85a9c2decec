//! The file's form: JSON with a line for each scene, function and format.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::ser::{Formatter, Serializer};

/// Depth down to which each item has a line of its own.
const DEPTH: usize = 3;

#[derive(Default)]
struct Lines {
    depth: usize,
    /// Whether the current list has an item, for each open list.
    filled: Vec<bool>,
}

impl Lines {
    fn line<W: ?Sized + Write>(&self, writer: &mut W) -> io::Result<()> {
        if self.depth > DEPTH { Ok(()) } else { write!(writer, "\n{}", " ".repeat(self.depth)) }
    }

    fn begin<W: ?Sized + Write>(&mut self, writer: &mut W, bracket: &[u8]) -> io::Result<()> {
        self.depth += 1;
        self.filled.push(false);
        writer.write_all(bracket)
    }

    fn end<W: ?Sized + Write>(&mut self, writer: &mut W, bracket: &[u8]) -> io::Result<()> {
        let inner = self.depth;
        self.depth -= 1;
        if self.filled.pop() == Some(true) && inner <= DEPTH {
            self.line(writer)?;
        }
        writer.write_all(bracket)
    }

    fn item<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        if let Some(filled) = self.filled.last_mut() {
            *filled = true;
        }
        writer.write_all(if first { b"" } else { b"," })?;
        self.line(writer)
    }
}

impl Formatter for Lines {
    fn begin_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.begin(writer, b"[")
    }

    fn end_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.end(writer, b"]")
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        self.item(writer, first)
    }

    fn begin_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.begin(writer, b"{")
    }

    fn end_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.end(writer, b"}")
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        self.item(writer, first)
    }
}

/// A value in the file's form.
pub(crate) fn text(value: &impl Serialize) -> serde_json::Result<String> {
    let mut bytes = Vec::new();
    value.serialize(&mut Serializer::with_formatter(&mut bytes, Lines::default()))?;
    bytes.push(b'\n');
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Four digits of a number; 0 for NaN and infinity, which JSON has not.
pub(crate) fn short(x: f64) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return 0.0;
    }
    let digits = 3 - x.abs().log10().floor() as i32;
    // A power of ten above 1 is exact, its reciprocal is not.
    let scale = 10.0_f64.powi(digits.abs());
    if digits >= 0 { (x * scale).round() / scale } else { (x / scale).round() * scale }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deep_values_share_a_line() {
        let value = serde_json::json!({ "a": [{ "b": [1, { "c": [2, 3] }] }], "d": [], "e": {} });
        let text = text(&value).unwrap();
        assert_eq!(text, "{\n \"a\":[\n  {\n   \"b\":[1,{\"c\":[2,3]}]\n  }\n ],\n \"d\":[],\n \"e\":{}\n}\n");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }

    #[test]
    fn numbers_have_four_digits() {
        let found = [123_456.0, 0.012_345_6, -9.999_9, 1e30, 0.0, f64::NAN].map(short);
        assert_eq!(found, [123_500.0, 0.012_35, -10.0, 1e30, 0.0, 0.0]);
    }
}
