//! `--exposure`: stops, `auto`, or a default that is 0 unless the picture could not be read.

use std::sync::Arc;

use anyhow::Result;
use serde::Serialize;

use etalon::frame::Settings;
use etalon::gpu::Device;
use etalon::image::meter::Unreadable;
use etalon::open::Opened;
use etalon::scene::Camera;

/// The value of `--exposure`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Exposure {
    /// From the picture's own luminance.
    Auto,
    /// Stops.
    Stops(f32),
}

/// Exposure of a picture: `exposure` of the report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct ExposureFacts {
    /// Stops.
    pub(super) stops: f32,
    /// `given`, `default`, or `metered`.
    pub(super) from: &'static str,
    /// What metering found; one sentence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) sentence: Option<String>,
}

/// Chooses the exposure of a picture, or of all pictures of a sequence.
///
/// The default meters only scenes whose brightness is unknown, and only corrects what could not be read: everything
/// else keeps 0 stops, and costs nothing. Few pixels of the same picture are metered, so that a whole picture, its
/// parts on other machines, and each frame of a sequence get the same exposure.
///
/// # Errors
/// When the scene does not fit the device, or the driver fails.
pub(super) fn choose(
    asked: Option<Exposure>,
    opened: &Opened,
    device: &Arc<Device>,
    settings: &Settings,
    camera: &Camera,
) -> Result<ExposureFacts> {
    let default =
        |sentence: Option<&str>| ExposureFacts { stops: 0.0, from: "default", sentence: sentence.map(str::to_owned) };
    match asked {
        Some(Exposure::Stops(stops)) => return Ok(ExposureFacts { stops, from: "given", sentence: None }),
        None if !opened.is_of_unknown_brightness(settings) => return Ok(default(None)),
        Some(Exposure::Auto) | None => {}
    }
    let Some(meter) = opened.meter(device, settings, camera)? else {
        return Ok(default(Some("the camera sees no surface of the scene: the picture shows only the background")));
    };
    let Some(stops) = meter.stops() else {
        return Ok(default(Some("no light reaches what the camera sees: it is black at every exposure")));
    };
    let metered = |stops, sentence| ExposureFacts { stops, from: "metered", sentence: Some(sentence) };
    if asked.is_some() {
        return Ok(metered(stops, format!("exposure {stops:+.1}")));
    }
    Ok(meter.correction(0.0).map_or_else(
        || default(None),
        |(stops, why)| {
            let what = match why {
                Unreadable::White => format!("{:.0} % of the scene plain white", 100.0 * meter.white),
                Unreadable::Black => format!("{:.0} % of the scene nearly black", 100.0 * meter.black),
            };
            metered(stops, format!("exposure {stops:+.1}, because 0 would show {what} (--exposure 0 keeps 0)"))
        },
    ))
}
