//! Frame lists of a sequence, in the grammar of Open Job Description (template schema 2023-09, `<IntRangeExpr>`):
//! numbers and ranges with an optional step, separated by commas, for example `1-100:2,105`.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

/// Largest number of frames of a sequence, so that a typing mistake does not fill the memory.
const MOST: i64 = 1_000_000;

/// Frame numbers in ascending order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frames(Vec<i32>);

/// Error of parsing a frame list.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotFrames {
    /// An element is neither a number nor a range.
    #[error("\"{0}\" is neither a frame nor a range of frames; examples are 7, 1-100 and 1-100:2")]
    NoRange(String),
    /// A range runs backwards, or its step is not positive.
    #[error("\"{0}\" goes from a larger frame to a smaller one, or its step is not above 0")]
    Backwards(String),
    /// A frame is in two ranges.
    #[error("frame {0} is named twice")]
    Twice(i32),
    /// More than a million frames.
    #[error("the list has more than {MOST} frames")]
    TooMany,
}

impl Frames {
    /// Frames 0 to `count` − 1.
    #[must_use]
    pub fn first(count: u32) -> Self {
        Self((0..count as i32).collect())
    }

    /// The numbers.
    #[must_use]
    pub fn numbers(&self) -> &[i32] {
        &self.0
    }

    /// The share of process `index` (from 1) of `of`: every `of`-th frame from the `index`-th on. Neighbouring frames
    /// take similar time, and so do the shares.
    #[must_use]
    pub fn share(&self, [index, of]: [u32; 2]) -> Self {
        Self(self.0.iter().copied().skip(index as usize - 1).step_by(of as usize).collect())
    }
}

/// Parses a number at the start of a text; returns it with the rest of the text.
fn number(text: &str) -> Option<(i64, &str)> {
    let digits = text.strip_prefix('-').unwrap_or(text);
    let end = text.len() - digits.len() + digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
    Some((text[..end].parse::<i32>().ok()?.into(), &text[end..]))
}

/// Parses a range; returns first frame, last frame and step.
fn range(text: &str) -> Option<[i64; 3]> {
    let (first, rest) = number(text)?;
    if rest.is_empty() {
        return Some([first, first, 1]);
    }
    let (last, rest) = number(rest.strip_prefix('-')?)?;
    match rest.strip_prefix(':') {
        None if rest.is_empty() => Some([first, last, 1]),
        None => None,
        Some(step) => number(step).filter(|(_, rest)| rest.is_empty()).map(|(step, _)| [first, last, step]),
    }
}

impl FromStr for Frames {
    type Err = NotFrames;

    fn from_str(text: &str) -> Result<Self, NotFrames> {
        let mut all: Vec<i32> = Vec::new();
        for part in text.split(',').map(str::trim) {
            let [first, last, step] = range(part).ok_or_else(|| NotFrames::NoRange(part.to_owned()))?;
            if last < first || step < 1 {
                return Err(NotFrames::Backwards(part.to_owned()));
            }
            if (last - first) / step + 1 + all.len() as i64 > MOST {
                return Err(NotFrames::TooMany);
            }
            all.extend((first..=last).step_by(step as usize).map(|frame| frame as i32));
        }
        all.sort_unstable();
        match all.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(NotFrames::Twice(pair[0])),
            None => Ok(Self(all)),
        }
    }
}

impl Display for Frames {
    /// The shortest list of numbers and ranges without a step, for example `1-3,5`.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut runs: Vec<[i32; 2]> = Vec::new();
        for &frame in &self.0 {
            match runs.last_mut().filter(|run| run[1].checked_add(1) == Some(frame)) {
                Some(run) => run[1] = frame,
                None => runs.push([frame; 2]),
            }
        }
        let text = |[first, last]: &[i32; 2]| if first == last { first.to_string() } else { format!("{first}-{last}") };
        f.write_str(&runs.iter().map(text).collect::<Vec<_>>().join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(text: &str) -> Vec<i32> {
        text.parse::<Frames>().expect(text).0
    }

    #[test]
    fn ranges_are_those_of_open_job_description() {
        assert_eq!(frames("7"), [7]);
        assert_eq!(frames("1-4"), [1, 2, 3, 4]);
        assert_eq!(frames("1-10:3,105"), [1, 4, 7, 10, 105]);
        assert_eq!(frames("1-10:4"), [1, 5, 9]);
        assert_eq!(frames("-3--1,5, 2"), [-3, -2, -1, 2, 5]);
        assert_eq!("3,1-2,7".parse::<Frames>().expect("frames").to_string(), "1-3,7");
    }

    #[test]
    fn mistakes_are_named() {
        let error = |text: &str| text.parse::<Frames>().expect_err(text);
        for text in ["", "a", "1-", "1-2-3", "1:2", "1-2:", "1..3", "1-2:x", "99999999999"] {
            assert_eq!(error(text), NotFrames::NoRange(text.to_owned()));
        }
        assert_eq!(error("5-1"), NotFrames::Backwards("5-1".to_owned()));
        assert_eq!(error("1-5:0"), NotFrames::Backwards("1-5:0".to_owned()));
        assert_eq!(error("1-5,3"), NotFrames::Twice(3));
        assert_eq!(error("1-2000000"), NotFrames::TooMany);
    }

    #[test]
    fn shares_are_all_frames_once() {
        let all: Frames = "1-100:3,200".parse().expect("frames");
        for of in [1, 2, 5, 60] {
            let mut together: Vec<i32> = (1..=of).flat_map(|index| all.share([index, of]).0).collect();
            together.sort_unstable();
            assert_eq!(together, all.0, "{of}");
        }
    }
}
