//! The part of a still that one process drew: an OpenEXR file of sums, with what they are sums of.
//!
//! Any viewer of OpenEXR shows it. The first sum is the picture's R G B A; the others are layers `sum1`, `sum2`, …, and what the picture
//! has as layers beside it is `aov.NAME`. What the file is a part of is the text attribute `etalon.part`, a JSON document of schema
//! `etalon.part/1` with a hash of all samples: it reveals a truncated or changed file.

use std::path::Path;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use etalon::frame::{Sums, Work};
use etalon::image::{Aov, AovData, Picture, exr, file};
use serde::{Deserialize, Serialize};

use crate::identity::Identity;
use crate::worker::FarmWorker;

const SCHEMA: &str = "etalon.part/1";
const ATTRIBUTE: &str = "etalon.part";

/// How a still is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// Every n-th tile of 8x8 pixels, with all samples.
    Tiles,
    /// All pixels, with some of the samples.
    Samples,
}

/// What a part is a part of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartHeader {
    /// `etalon.part/1`.
    pub schema: String,
    /// The picture.
    pub identity: Identity,
    /// Which part, counted from 1, of how many.
    pub shard: [u32; 2],
    /// Of what kind.
    pub split: Split,
    /// Samples of each pixel that the whole picture has.
    pub samples: u32,
    /// Bands of wavelengths that each sample has; 0: three colours.
    pub bands: u32,
    /// Sums that the samples go to by turns.
    pub halves: usize,
    /// Further pictures beside it that are sums of samples, by name.
    pub parts: Vec<String>,
    /// What the sums are of: samples from, up to. Those of a part by tiles are one piece, those of one by samples a piece for each
    /// block that whoever draws all of them adds by itself.
    pub pieces: Vec<[u32; 2]>,
    /// The samples that make the part whole.
    pub wanted: [u32; 2],
    /// What rays did.
    pub work: Work,
    /// Pixels whose list of transparent surfaces was cut short.
    pub dropped: u32,
    /// Who drew it.
    pub worker: FarmWorker,
    /// Of all samples.
    hash: String,
}

/// A part in memory.
#[derive(Debug, Clone)]
pub struct Part {
    /// What it is.
    pub head: PartHeader,
    /// Of each piece its sums, those of parts last.
    pub sums: Vec<Vec<Picture>>,
    /// Layers of the whole picture; the first part has them.
    pub aovs: Vec<Aov>,
}

/// Pieces of a picture as the renderer tells them, with what they are pieces of.
#[derive(Debug)]
pub struct Drawn {
    /// The picture.
    pub identity: Identity,
    /// Which part, counted from 1, of how many.
    pub shard: [u32; 2],
    /// Of what kind.
    pub split: Split,
    /// Samples of each pixel that the whole picture has.
    pub samples: u32,
    /// Bands of wavelengths.
    pub bands: u32,
    /// Names of the pictures beside it.
    pub parts: Vec<String>,
    /// The samples that make the part whole.
    pub wanted: [u32; 2],
    /// What there is of them, in their order.
    pub pieces: Vec<Sums>,
    /// Layers of the whole picture.
    pub aovs: Vec<Aov>,
    /// Who drew it.
    pub worker: FarmWorker,
}

fn hash(sums: &[Vec<Picture>]) -> String {
    let all: Vec<String> = sums.iter().flatten().map(|sum| file::hash(bytemuck::cast_slice(&sum.rgba))).collect();
    file::hash(all.concat().as_bytes())
}

impl Part {
    /// Of what was drawn, at least one piece.
    ///
    /// # Errors
    /// When there is none.
    pub fn of(drawn: Drawn) -> Result<Self> {
        let Drawn { identity, shard, split, samples, bands, parts, wanted, pieces, aovs, worker } = drawn;
        let Some(last) = pieces.last() else { bail!("nothing of it is drawn yet") };
        // What a part by tiles knows is of all its samples, those of pieces are of each piece.
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

    /// The sample up to which it is drawn.
    #[must_use]
    pub fn drawn_to(&self) -> u32 {
        self.head.pieces.last().map_or(self.head.wanted[0], |piece| piece[1])
    }

    /// Whether nothing of it is missing.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.drawn_to() == self.head.wanted[1]
    }

    /// What to go on with, of a part by tiles.
    #[must_use]
    pub fn into_sums(self) -> Vec<Sums> {
        let PartHeader { pieces, work, dropped, .. } = self.head;
        // The counts of all pieces are with the first one.
        let known = |place: usize| if place == 0 { (work, dropped) } else { (Work::default(), 0) };
        let of = |(place, (samples, sums)): (usize, ([u32; 2], Vec<Picture>))| {
            let (work, dropped) = known(place);
            Sums { samples, sums, work, dropped }
        };
        pieces.into_iter().zip(self.sums).enumerate().map(of).collect()
    }

    /// The bytes of its file.
    ///
    /// # Errors
    /// When encoding fails.
    pub fn encode(&self) -> Result<Vec<u8>> {
        let mut all = self.sums.iter().flatten();
        let first = all.next().ok_or_else(|| anyhow!("a part without sums: our mistake"))?;
        let channels = || ["R", "G", "B", "A"].map(str::to_owned).to_vec();
        let layer = |(place, sum): (usize, &Picture)| Aov {
            name: format!("sum{}", place + 1),
            channels: channels(),
            samples: AovData::F32(sum.rgba.iter().flatten().copied().collect()),
        };
        let mut layers: Vec<Aov> = all.enumerate().map(layer).collect();
        layers.extend(self.aovs.iter().map(|aov| Aov { name: format!("aov.{}", aov.name), ..aov.clone() }));
        let head = serde_json::to_string(&self.head).context("writing what a part is of")?;
        exr::encode_exr(first, &layers, &[(ATTRIBUTE.to_owned(), head)])
    }

    /// Reads a part.
    ///
    /// # Errors
    /// When the file is none, or is not whole.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display();
        let bytes = file::read(path)?;
        let texts = exr::texts(&bytes).map_err(|_| anyhow!("{place} is no part of a picture, or was cut short"))?;
        let text = texts.iter().find(|(name, _)| name == ATTRIBUTE).map(|(_, text)| text);
        let text = text.ok_or_else(|| anyhow!("{place} is no part of a picture: render --shard writes those"))?;
        let head: PartHeader = serde_json::from_str(text).with_context(|| format!("{place}: what it is a part of"))?;
        ensure!(head.schema == SCHEMA, "{place} is of schema {}, this program reads {SCHEMA}", head.schema);
        let channels = exr::decode_channels(&bytes).map_err(|_| anyhow!("{place} was cut short, or is damaged"))?;
        let size = [channels.width, channels.height];
        ensure!(size == head.identity.size, "{place} is damaged: {size:?} pixels for {:?}", head.identity.size);
        let of = |prefix: &str| -> Result<Picture> {
            let samples = |channel: &str| -> Result<&Vec<f32>> {
                let name = format!("{prefix}{channel}");
                match channels.list.iter().find(|(known, _)| *known == name) {
                    Some((_, AovData::F32(samples))) => Ok(samples),
                    _ => bail!("{place} is damaged: there is no channel {name}"),
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
            "{place} is damaged: its samples are not those that were written"
        );
        Ok(Self { aovs: aovs(&channels), head, sums })
    }
}

/// Layers beside the sums, put together again of their channels.
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
