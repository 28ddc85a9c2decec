//! What the viewer remembers between its runs: preferences, recent files, and small pictures of them.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use serde::{Deserialize, Serialize};

use etalon::image::file;

use super::layout::Docks;

/// Width of a small picture in pixels.
const SMALL: u32 = 96;
/// Number of recent files.
const RECENT: usize = 10;

/// What is drawn over the picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Overlays {
    /// A grid on the floor of the scene, with the axes.
    pub grid: bool,
    /// Axes in the corner, whose ends choose views.
    pub gizmo: bool,
    /// The box of each instance.
    pub boxes: bool,
    /// Marks of lights and cameras.
    pub lights: bool,
}

impl Default for Overlays {
    fn default() -> Self {
        Self { grid: false, gizmo: true, boxes: false, lights: false }
    }
}

/// Preferences, kept as JSON in the user's configuration folder.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Preferences {
    /// Dark, light, or as the desktop says.
    pub theme: egui::ThemePreference,
    /// Factor of the size of text and controls.
    pub zoom: f32,
    /// Width and height of the window in pixels.
    pub size: Option<[u32; 2]>,
    /// Place and size of the panels; `None`: the default for the window's size.
    pub docks: Option<Docks>,
    /// What is drawn over the picture.
    pub overlays: Overlays,
    /// Folder where a picture was last saved.
    pub saved_in: Option<PathBuf>,
}

impl Default for Preferences {
    fn default() -> Self {
        Self {
            theme: egui::ThemePreference::Dark,
            zoom: 1.0,
            size: None,
            docks: None,
            overlays: Overlays::default(),
            saved_in: None,
        }
    }
}

fn preferences_file() -> Option<PathBuf> {
    Some(file::config_folder()?.join("viewer.json"))
}

impl Preferences {
    /// The preferences of the last run. A file that cannot be understood counts as none.
    #[must_use]
    pub fn load() -> Self {
        let Some(text) = preferences_file().and_then(|path| std::fs::read_to_string(path).ok()) else {
            return Self::default();
        };
        let mut known: Self = serde_json::from_str(&text).unwrap_or_else(|error| {
            tracing::info!("the viewer's preferences cannot be read, and begin anew: {error}");
            Self::default()
        });
        known.docks = known.docks.filter(Docks::is_complete);
        known.zoom = if known.zoom.is_finite() { known.zoom.clamp(0.5, 4.0) } else { 1.0 };
        known
    }

    /// Writes the preferences.
    pub fn save(&self) {
        let write = |path: PathBuf| write_whole(&path, &serde_json::to_vec_pretty(self)?);
        if let Some(Err(error)) = preferences_file().map(write) {
            tracing::info!("the viewer's preferences cannot be written: {error:#}");
        }
    }
}

fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
    file::write(path, bytes)
}

fn recent_file() -> Option<PathBuf> {
    Some(file::cache_folder()?.join("recent"))
}

/// Recently opened files that still exist, the latest first.
#[must_use]
pub fn recent() -> Vec<PathBuf> {
    let text = recent_file().and_then(|path| std::fs::read_to_string(path).ok()).unwrap_or_default();
    text.lines().map(PathBuf::from).filter(|path| path.is_file()).collect()
}

/// Moves a file to the front of the recent ones, and stores their list.
pub fn remember(recent: &mut Vec<PathBuf>, path: &Path) {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    recent.retain(|known| *known != path);
    recent.insert(0, path);
    recent.truncate(RECENT);
    let text: String = recent.iter().map(|path| format!("{}\n", path.display())).collect();
    if let Some(Err(error)) = recent_file().map(|path| write_whole(&path, text.as_bytes())) {
        tracing::info!("the list of recent files cannot be written: {error:#}");
    }
}

/// Where the small picture of a scene file is kept.
fn small_file(scene: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(scene).ok()?;
    let name = file::hash(path.as_os_str().as_encoded_bytes());
    Some(file::cache_folder()?.join("small").join(format!("{name}.png")))
}

/// Keeps a small picture of a scene file.
///
/// # Errors
/// When it cannot be written.
pub fn keep_small(scene: &Path, rgba: &[u8], [width, height]: [u32; 2]) -> Result<()> {
    let Some(path) = small_file(scene) else { return Ok(()) };
    let whole = image::RgbaImage::from_raw(width, height, rgba.to_vec()).context("a picture")?;
    let rows = (SMALL * height).div_ceil(width).clamp(1, SMALL);
    let small = image::imageops::thumbnail(&whole, SMALL, rows);
    let mut bytes = std::io::Cursor::new(Vec::new());
    small.write_to(&mut bytes, image::ImageFormat::Png)?;
    write_whole(&path, &bytes.into_inner())
}

/// The small picture of a scene file, if there is one.
#[must_use]
pub fn small(scene: &Path) -> Option<egui::ColorImage> {
    let picture = image::open(small_file(scene)?).ok()?.to_rgba8();
    let size = [picture.width() as usize, picture.height() as usize];
    Some(egui::ColorImage::from_rgba_unmultiplied(size, picture.as_raw()))
}
