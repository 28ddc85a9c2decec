//! File format for the part of a still picture that one process drew: an OpenEXR file with sums of samples.
//!
//! Any OpenEXR viewer shows a part. The first sum is stored as R G B A, the others as layers `sum1`, `sum2`, …, and
//! additional layers of the picture as `aov.NAME`. The text attribute `etalon.part` is a JSON document of schema
//! `etalon.part/1`. It identifies the picture and has a hash of all samples, which reveals a truncated or changed file.

use std::path::Path;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use etalon::frame::{Sums, Work};
use etalon::image::{Aov, AovData, Picture, exr, file};
use serde::{Deserialize, Serialize};

use crate::identity::Identity;
use crate::worker::FarmWorker;

const SCHEMA: &str = "etalon.part/1";
const ATTRIBUTE: &str = "etalon.part";

/// Division of a still picture into parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// By tiles: every n-th tile of 8x8 pixels, with all samples.
    Tiles,
    /// By samples: all pixels, with some of the samples.
    Samples,
}

/// Header of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartHeader {
    /// `etalon.part/1`.
    pub schema: String,
    /// Identity of the picture.
    pub identity: Identity,
    /// Index of the part, from 1, and number of parts.
    pub shard: [u32; 2],
    /// Division of the picture.
    pub split: Split,
    /// Samples per pixel of the whole picture.
    pub samples: u32,
    /// Bands of wavelengths per sample; 0 for RGB.
    pub bands: u32,
    /// Number of sums among which the samples alternate: 2 with half buffers, else 1.
    pub halves: usize,
    /// Names of additional pictures that are sums of samples.
    pub parts: Vec<String>,
    /// Sample ranges `[from, end)` of the sums. A part by tiles has one piece; a part by samples has one piece for each
    /// block of samples that a single process also adds separately.
    pub pieces: Vec<[u32; 2]>,
    /// Sample range of the complete part.
    pub wanted: [u32; 2],
    /// Work counts of the rays.
    pub work: Work,
    /// Pixels whose list of transparent surfaces was truncated.
    pub dropped: u32,
    /// Process that drew the part.
    pub worker: FarmWorker,
    /// Hash of all samples.
    hash: String,
}

/// A part in memory.
#[derive(Debug, Clone)]
pub struct Part {
    /// Header.
    pub head: PartHeader,
    /// Sums of each piece; those of additional pictures come last.
    pub sums: Vec<Vec<Picture>>,
    /// Layers of the whole picture; only in the first part.
    pub aovs: Vec<Aov>,
}

/// Pieces of a picture as drawn by the renderer, with the facts for the header.
#[derive(Debug)]
pub struct Drawn {
    /// Identity of the picture.
    pub identity: Identity,
    /// Index of the part, from 1, and number of parts.
    pub shard: [u32; 2],
    /// Division of the picture.
    pub split: Split,
    /// Samples per pixel of the whole picture.
    pub samples: u32,
    /// Bands of wavelengths per sample; 0 for RGB.
    pub bands: u32,
    /// Names of additional pictures.
    pub parts: Vec<String>,
    /// Sample range of the complete part.
    pub wanted: [u32; 2],
    /// Drawn pieces, in order.
    pub pieces: Vec<Sums>,
    /// Layers of the whole picture.
    pub aovs: Vec<Aov>,
    /// Process that drew the part.
    pub worker: FarmWorker,
}

fn hash(sums: &[Vec<Picture>]) -> String {
    let all: Vec<String> = sums.iter().flatten().map(|sum| file::hash(bytemuck::cast_slice(&sum.rgba))).collect();
    file::hash(all.concat().as_bytes())
}

impl Part {
    /// Makes a part of at least one drawn piece.
    ///
    /// # Errors
    /// When there are no pieces.
    pub fn of(drawn: Drawn) -> Result<Self> {
        let Drawn { identity, shard, split, samples, bands, parts, wanted, pieces, aovs, worker } = drawn;
        let Some(last) = pieces.last() else { bail!("no sample of the part is drawn yet") };
        // A part by tiles has one piece with all counts; a part by samples has counts for each piece.
        let work = pieces.iter().fold(Work::default(), |work, piece| work.with(&piece.work));
        let dropped = pieces.iter().map(|piece| piece.dropped).max().unwrap_or_default();
        let halves = last.sums.len() - parts.len();
        let ranges = pieces.iter().map(|piece| piece.samples).collect();
        let sums: Vec<Vec<Picture>> = pieces.into_iter().map(|piece| piece.sums).collect();
        let hash = hash(&sums);
        let head = PartHeader {
            schema: SCHEMA.to_owned(),
            identity,
            shard,
            split,
            samples,
            bands,
            halves,
            parts,
            pieces: ranges,
            wanted,
            work,
            dropped,
            worker,
            hash,
        };
        Ok(Self { head, sums, aovs })
    }

    /// End of the drawn sample range.
    #[must_use]
    pub fn drawn_to(&self) -> u32 {
        self.head.pieces.last().map_or(self.head.wanted[0], |piece| piece[1])
    }

    /// Whether the part is complete.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.drawn_to() == self.head.wanted[1]
    }

    /// The sums, to continue drawing the part.
    #[must_use]
    pub fn into_sums(self) -> Vec<Sums> {
        let PartHeader { pieces, work, dropped, .. } = self.head;
        // The first piece carries the counts of all pieces.
        let known = |place: usize| if place == 0 { (work, dropped) } else { (Work::default(), 0) };
        let of = |(place, (samples, sums)): (usize, ([u32; 2], Vec<Picture>))| {
            let (work, dropped) = known(place);
            Sums { samples, sums, work, dropped }
        };
        pieces.into_iter().zip(self.sums).enumerate().map(of).collect()
    }

    /// The bytes of the part's file.
    ///
    /// # Errors
    /// When encoding fails.
    pub fn encode(&self) -> Result<Vec<u8>> {
        let mut all = self.sums.iter().flatten();
        let first = all.next().ok_or_else(|| anyhow!("a part has no sums: a bug of Etalon"))?;
        let channels = || ["R", "G", "B", "A"].map(str::to_owned).to_vec();
        let layer = |(place, sum): (usize, &Picture)| Aov {
            name: format!("sum{}", place + 1),
            channels: channels(),
            samples: AovData::F32(sum.rgba.iter().flatten().copied().collect()),
        };
        let mut layers: Vec<Aov> = all.enumerate().map(layer).collect();
        layers.extend(self.aovs.iter().map(|aov| Aov { name: format!("aov.{}", aov.name), ..aov.clone() }));
        let head = serde_json::to_string(&self.head).context("writing the header of a part")?;
        exr::encode_exr(first, &layers, &[(ATTRIBUTE.to_owned(), head)])
    }

    /// Reads a part.
    ///
    /// # Errors
    /// When the file is not a part, or when it is truncated or damaged.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display();
        let bytes = file::read(path)?;
        let texts =
            exr::texts(&bytes).with_context(|| format!("{place} is not a part of a picture, or it is truncated"))?;
        let text = texts.iter().find(|(name, _)| name == ATTRIBUTE).map(|(_, text)| text);
        let text = text.ok_or_else(|| anyhow!("{place} is not a part of a picture; render --shard writes parts"))?;
        let head: PartHeader =
            serde_json::from_str(text).with_context(|| format!("{place}: reading the header of the part"))?;
        ensure!(head.schema == SCHEMA, "{place} has schema {}, but this program reads {SCHEMA}", head.schema);
        let channels = exr::decode_channels(&bytes).with_context(|| format!("{place} is truncated or damaged"))?;
        let size = [channels.width, channels.height];
        ensure!(
            size == head.identity.size,
            "{place} is damaged: it has {size:?} pixels instead of {:?}",
            head.identity.size
        );
        let of = |prefix: &str| -> Result<Picture> {
            let samples = |channel: &str| -> Result<&Vec<f32>> {
                let name = format!("{prefix}{channel}");
                match channels.list.iter().find(|(known, _)| *known == name) {
                    Some((_, AovData::F32(samples))) => Ok(samples),
                    _ => bail!("{place} is damaged: the channel {name} is missing"),
                }
            };
            let [r, g, b, a] = [samples("R")?, samples("G")?, samples("B")?, samples("A")?];
            let rgba = (0..r.len()).map(|i| [r[i], g[i], b[i], a[i]]).collect();
            Ok(Picture { width: size[0], height: size[1], rgba })
        };
        let each = head.halves + head.parts.len();
        let sum = |place: usize| of(&if place == 0 { String::new() } else { format!("sum{place}.") });
        let piece = |at: usize| (at * each..(at + 1) * each).map(sum).collect::<Result<Vec<_>>>();
        let sums: Vec<Vec<Picture>> = (0..head.pieces.len()).map(piece).collect::<Result<_>>()?;
        ensure!(
            !sums.is_empty() && hash(&sums) == head.hash,
            "{place} is damaged: its samples have changed since it was written"
        );
        Ok(Self { aovs: aovs(&channels), head, sums })
    }
}

/// Additional layers, assembled from their channels.
fn aovs(channels: &exr::Channels) -> Vec<Aov> {
    let mut all: Vec<(String, Vec<(String, &AovData)>)> = Vec::new();
    for (name, samples) in &channels.list {
        let Some((layer, channel)) = name.strip_prefix("aov.").and_then(|name| name.rsplit_once('.')) else { continue };
        match all.last_mut().filter(|(known, _)| known == layer) {
            Some((_, list)) => list.push((channel.to_owned(), samples)),
            None => all.push((layer.to_owned(), vec![(channel.to_owned(), samples)])),
        }
    }
    let joined = |(name, list): (String, Vec<(String, &AovData)>)| {
        let count = list.first().map_or(0, |(_, samples)| samples.len());
        let floats: Vec<&Vec<f32>> =
            list.iter().filter_map(|(_, data)| if let AovData::F32(all) = data { Some(all) } else { None }).collect();
        let words: Vec<&Vec<u32>> =
            list.iter().filter_map(|(_, data)| if let AovData::U32(all) = data { Some(all) } else { None }).collect();
        let samples = match words.is_empty() {
            true => AovData::F32((0..count).flat_map(|i| floats.iter().map(move |all| all[i])).collect()),
            false => AovData::U32((0..count).flat_map(|i| words.iter().map(move |all| all[i])).collect()),
        };
        Aov { name, channels: list.into_iter().map(|(channel, _)| channel).collect(), samples }
    };
    all.into_iter().map(joined).collect()
}
