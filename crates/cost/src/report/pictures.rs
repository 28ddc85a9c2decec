//! Pictures embedded in the page and linked from it.

use std::path::Path;

use anyhow::Result;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use maud::{Markup, html};

use super::{COLOURS, command_line, digits, error, hex, percent, time, title, words};
use crate::table::{Family, Point, REFERENCE, Table};
use etalon::image::png::{Display, over, read_display};

/// JPEG quality of embedded pictures; the folder `pictures` has lossless files.
const QUALITY: u8 = 82;
/// What is behind transparent pixels.
const GREY: u8 = 119;
/// Largest number of pixels of an embedded picture.
const MOST_PIXELS: u32 = 640 * 360;

/// Size of the picture of the place that differs most.
pub(super) const WORST: [u32; 2] = [328, 160];

/// Size of the pictures for the layout, so that the page does not jump when they load.
pub(super) fn size(table: &Table) -> [u32; 2] {
    table.size
}

/// A picture, halved until it has at most [`MOST_PIXELS`] pixels.
fn small(path: &Path) -> Result<Display> {
    let mut picture = read_display(path)?;
    while picture.width * picture.height > MOST_PIXELS {
        picture = halved(&picture);
    }
    Ok(picture)
}

/// A picture as a data URL, with at most [`MOST_PIXELS`] pixels.
pub(super) fn embedded(path: &Path) -> Result<String> {
    jpeg(&small(path)?)
}

/// A picture at half the size: means of 2×2 pixels.
fn halved(picture: &Display) -> Display {
    let (width, height) = ((picture.width / 2).max(1), (picture.height / 2).max(1));
    let at =
        |x: u32, y: u32| picture.rgba[(y.min(picture.height - 1) * picture.width + x.min(picture.width - 1)) as usize];
    let mean = |x: u32, y: u32| {
        let four = [at(2 * x, 2 * y), at(2 * x + 1, 2 * y), at(2 * x, 2 * y + 1), at(2 * x + 1, 2 * y + 1)];
        std::array::from_fn(|c| (four.iter().map(|p| u32::from(p[c])).sum::<u32>() / 4) as u8)
    };
    let rgba = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect();
    Display { width, height, rgba }
}

fn jpeg(picture: &Display) -> Result<String> {
    let rgb: Vec<u8> = picture.rgba.iter().flat_map(|&pixel| over(pixel, GREY)).collect();
    let mut bytes = Vec::new();
    let encoder = &mut JpegEncoder::new_with_quality(&mut bytes, QUALITY);
    encoder.encode(&rgb, picture.width, picture.height, ExtendedColorType::Rgb8)?;
    Ok(format!("data:image/jpeg;base64,{}", STANDARD.encode(bytes)))
}

/// Gallery of all pictures with error maps, details and commands.
pub(super) fn gallery(table: &Table) -> Markup {
    let [width, height] = size(table);
    html! {
        p { label { "Filter pictures: " input.filter type="search" data-of="gallery"; } }
        div.gallery #gallery {
            @for point in table.points.iter().filter(|point| point.name != REFERENCE) {
                (shown(point, table, [width, height]))
            }
        }
    }
}

fn shown(point: &Point, table: &Table, [width, height]: [u32; 2]) -> Markup {
    let file = |end: &str| format!("pictures/{}{end}", point.picture);
    let e = &point.errors;
    let noise = point.noise.map(|noise| format!(", of which noise {}", percent(noise.sqrt())));
    html! {
        article id={ "p-" (point.picture) } data-name=(point.picture) {
            h3 { (title(point)) }
            div.three {
                figure { img loading="lazy" width=(width) height=(height) src=(file(".png")) alt={ (title(point)) ": the picture" }; }
                figure { img loading="lazy" width=(width) height=(height) src=(file(".error.png")) alt={ (title(point)) ": its error" }; }
                figure { img.pixels loading="lazy" width=(WORST[0]) height=(WORST[1]) src=(file(".worst.png")) alt="Where it differs most: the reference on the left, the picture on the right"; figcaption { "where it differs most: reference, picture" } }
            }
            p.figures {
                span { b { (time(point.gpu_ms.median)) } " (" (digits(point.gpu_ms.low)) " to " (digits(point.gpu_ms.high)) " ms, " (point.timed) (if point.timed == 1 { " render)" } else { " renders)" }) }
                span { (words::link("error", "error")) " " (error(point)) }
                span { (words::link("flip", "FLIP")) " " (digits(e.flip_mean)) ", 95th percentile " (digits(e.flip_p95)) }
                span { (words::link("relmse", "√relMSE")) " " (percent(e.relmse.median.max(0.0).sqrt())) (noise.unwrap_or_default()) }
                span { (words::link("delta-e", "ΔE2000")) " " (digits(e.delta_e_mean)) }
            }
            p.given { "Simplified: " (table.given_up(point)) }
            (command_line(&point.command))
        }
    }
}

/// For each pixel of `local` the change that brings it closest to the reference, as a picture with a legend; `None`
/// where no change is significant.
pub(super) fn causes(table: &Table, pictures: &Path) -> Result<Option<Markup>> {
    let Some(local) = table.points.iter().find(|point| point.name == "local") else { return Ok(None) };
    let open = |name: &str| small(&pictures.join(format!("{name}.png")));
    let (reference, base) = (open("reference")?, open(&local.picture)?);
    // Changes that are not significant would only show the noise of the reference.
    let others: Vec<&Point> = table
        .points
        .iter()
        .filter(|point| point.family == Family::Local)
        .filter(|point| table.prices.iter().any(|price| price.point == point.name && price.error_told))
        .collect();
    let distance = |a: &[u8; 4], b: &[u8; 4]| (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)).sum::<f64>();
    let mut best: Vec<(f64, usize)> =
        base.rgba.iter().zip(&reference.rgba).map(|(a, r)| (distance(a, r), usize::MAX)).collect();
    let before: Vec<f64> = best.iter().map(|(d, _)| *d).collect();
    for (index, point) in others.iter().enumerate() {
        let picture = open(&point.picture)?;
        for ((known, pixel), r) in best.iter_mut().zip(&picture.rgba).zip(&reference.rgba) {
            let found = distance(pixel, r);
            if found < known.0 {
                *known = (found, index);
            }
        }
    }
    if others.is_empty() {
        return Ok(None);
    }
    // Squared error that each change removes where it is the best.
    let mut gains = vec![0.0; others.len()];
    for ((after, index), before) in best.iter().zip(&before) {
        if let Some(gain) = gains.get_mut(*index) {
            *gain += before - after;
        }
    }
    let total: f64 = before.iter().sum::<f64>().max(1e-9);
    // Changes that remove less than half a percent get no colour.
    let mut order: Vec<usize> = (0..others.len()).filter(|&i| gains[i] > 0.005 * total).collect();
    order.sort_by(|&a, &b| gains[b].total_cmp(&gains[a]));
    order.truncate(COLOURS.len() - 1);
    let rgba: Vec<[u8; 4]> = best
        .iter()
        .zip(&before)
        .map(|((after, index), before)| {
            let colour = order.iter().position(|i| i == index).map_or([40; 3], |place| COLOURS[place]);
            // Brightness is the fraction of the pixel's error that the change removes.
            let share = if *before > 0.0 { ((before - after) / before).sqrt().max(0.25) } else { 0.0 };
            let [r, g, b] = colour.map(|c| (f64::from(c) * share) as u8);
            [r, g, b, 255]
        })
        .collect();
    let [map, picture] = [jpeg(&Display { rgba, ..base })?, jpeg(&base)?];
    Ok(Some(html! {
        div.pair {
            figure { img src=(picture) width=(base.width) height=(base.height) alt="The picture of the preset local"; figcaption { "local" } }
            figure { img src=(map) width=(base.width) height=(base.height) alt="Each pixel in the colour of its most helpful change"; figcaption { "most helpful change" } }
        }
        p.legend {
            @for (place, &index) in order.iter().enumerate() {
                span { i.key style={ "background:" (hex(place)) } {} (others[index].name) ", " (format!("{:.0}", 100.0 * gains[index] / total)) " % of the squared error" }
            }
        }
    }))
}
