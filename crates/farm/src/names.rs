//! File name patterns of a sequence, for example `out/{camera}.{frame:04}.png`.

use std::path::{Path, PathBuf};

/// A path with placeholders for frame number and camera name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern {
    text: String,
    pieces: Vec<NamePiece>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum NamePiece {
    Text(String),
    /// Frame number, with the least number of digits.
    Frame(usize),
    Camera,
}

/// Error of parsing a pattern.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotPattern {
    /// A brace is not closed.
    #[error("{0}: a brace is not closed")]
    Open(String),
    /// An unknown placeholder.
    #[error("{0}: {{{1}}} is not a placeholder; use {{frame}}, {{frame:04}} or {{camera}}")]
    Unknown(String, String),
}

impl Pattern {
    /// Parses a path.
    ///
    /// # Errors
    /// When a brace is not closed, or when a placeholder is unknown.
    pub fn of(path: &Path) -> Result<Self, NotPattern> {
        let text = path.to_string_lossy().into_owned();
        let mut pieces = Vec::new();
        let mut rest = text.as_str();
        while let Some((before, inside)) = rest.split_once('{') {
            let (name, after) = inside.split_once('}').ok_or_else(|| NotPattern::Open(text.clone()))?;
            pieces.push(NamePiece::Text(before.to_owned()));
            let digits = |width: &str| width.strip_prefix('0').and_then(|n| n.parse().ok()).filter(|n| *n <= 20);
            pieces.push(match name.split_once(':') {
                None if name == "frame" => NamePiece::Frame(1),
                None if name == "camera" => NamePiece::Camera,
                Some(("frame", width)) if digits(width).is_some() => NamePiece::Frame(digits(width).unwrap_or(1)),
                _ => return Err(NotPattern::Unknown(text.clone(), name.to_owned())),
            });
            rest = after;
        }
        pieces.push(NamePiece::Text(rest.to_owned()));
        Ok(Self { text, pieces })
    }

    /// Whether the path depends on the frame.
    #[must_use]
    pub fn has_frame(&self) -> bool {
        self.pieces.iter().any(|piece| matches!(piece, NamePiece::Frame(_)))
    }

    /// Whether the path depends on the camera.
    #[must_use]
    pub fn has_camera(&self) -> bool {
        self.pieces.contains(&NamePiece::Camera)
    }

    /// The pattern as given.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The path of one picture. In camera names, characters other than letters, digits, `.`, `_` and `-` become
    /// hyphens.
    #[must_use]
    pub fn path(&self, frame: i32, camera: &str) -> PathBuf {
        let plain = |c: char| if c.is_alphanumeric() || "._-".contains(c) { c } else { '-' };
        let text = |piece: &NamePiece| match piece {
            NamePiece::Text(text) => text.clone(),
            NamePiece::Frame(digits) if frame < 0 => format!("-{:0digits$}", frame.unsigned_abs()),
            NamePiece::Frame(digits) => format!("{frame:0digits$}"),
            NamePiece::Camera => camera.chars().map(plain).collect(),
        };
        PathBuf::from(self.pieces.iter().map(text).collect::<String>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(text: &str) -> Result<Pattern, NotPattern> {
        Pattern::of(Path::new(text))
    }

    #[test]
    fn names_are_filled_in() {
        let name = |text: &str, frame: i32| pattern(text).expect(text).path(frame, "left/eye").display().to_string();
        assert_eq!(name("a.{frame:04}.png", 7), "a.0007.png");
        assert_eq!(name("a.{frame:04}.png", 123_456), "a.123456.png");
        assert_eq!(name("a.{frame:04}.png", -7), "a.-0007.png");
        assert_eq!(name("{camera}/{frame}.exr", 7), "left-eye/7.exr");
        assert_eq!(name("plain.png", 7), "plain.png");
        let both = pattern("{camera}{frame}").expect("a pattern");
        assert!(both.has_frame() && both.has_camera());
    }

    #[test]
    fn mistakes_are_named() {
        assert_eq!(pattern("a{frame.png"), Err(NotPattern::Open("a{frame.png".to_owned())));
        for name in ["", "frames", "frame:4", "frame:0x", "shard", "camera:02"] {
            let text = format!("a{{{name}}}.png");
            assert_eq!(pattern(&text), Err(NotPattern::Unknown(text.clone(), name.to_owned())));
        }
    }
}
