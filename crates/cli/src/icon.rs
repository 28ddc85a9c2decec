//! The program's icon: an etalon, two half-silvered plates between which a ray is reflected, with a part of its light
//! leaving at each reflection. One list of shapes is drawn as SVG and as pixels.

use maud::{PreEscaped, html};

/// Units along a side of the drawing.
const SIDE: f32 = 64.0;
/// The inner faces of the two plates.
const FACES: [f32; 2] = [24.0, 40.0];
/// Where the ray comes from, and where it meets the right plate's inner face first.
const FROM: [f32; 2] = [8.0, 16.0];
const FIRST: f32 = 25.0;
/// Where the transmitted rays end, across.
const END: f32 = 57.0;
/// Colours of the transmitted rays, from above.
const TRANSMITTED: [[u8; 3]; 3] = [[0xff, 0xd1, 0x66], [0xff, 0x9f, 0x5a], [0xf4, 0x6d, 0x75]];

/// An outline in units of the drawing, y down.
enum IconOutline {
    /// A rectangle with round corners: left, top, width, height, radius.
    Rectangle([f32; 5]),
    /// Lines of a width with round ends and joints.
    Lines(Vec<[f32; 2]>, f32),
}

struct IconShape {
    outline: IconOutline,
    colour: [u8; 3],
    opacity: f32,
}

/// The drawing, from back to front.
fn shapes() -> Vec<IconShape> {
    let shape = |outline, colour, opacity| IconShape { outline, colour, opacity };
    let mut all = vec![shape(IconOutline::Rectangle([2.0, 2.0, 60.0, 60.0, 13.0]), [0x15, 0x1f, 0x2c], 1.0)];
    // Reflections keep the ray's slope: it goes down by the same amount on each way between the faces.
    let slope = (FIRST - FROM[1]) / (FACES[1] - FROM[0]);
    let down = slope * (FACES[1] - FACES[0]);
    let mut ray = vec![FROM];
    for (index, colour) in TRANSMITTED.into_iter().enumerate() {
        let y = FIRST + 2.0 * down * index as f32;
        let leaves = [FACES[1], y];
        ray.push(leaves);
        if index + 1 < TRANSMITTED.len() {
            ray.push([FACES[0], y + down]);
        }
        all.push(shape(IconOutline::Lines(vec![leaves, [END, y + slope * (END - FACES[1])]], 3.0), colour, 1.0));
    }
    all.push(shape(IconOutline::Lines(ray, 3.0), [0xff, 0xff, 0xff], 1.0));
    for left in [FACES[0] - 5.0, FACES[1]] {
        all.push(shape(IconOutline::Rectangle([left, 9.0, 5.0, 46.0, 2.0]), [0x8f, 0xc1, 0xea], 0.85));
    }
    all
}

impl IconOutline {
    /// Signed distance from a point, negative inside.
    fn distance(&self, [x, y]: [f32; 2]) -> f32 {
        match self {
            Self::Rectangle([left, top, width, height, radius]) => {
                let beyond = |at: f32, from: f32, length: f32| (at - from - length / 2.0).abs() - length / 2.0 + radius;
                let [dx, dy] = [beyond(x, *left, *width), beyond(y, *top, *height)];
                dx.max(0.0).hypot(dy.max(0.0)) + dx.max(dy).min(0.0) - radius
            }
            Self::Lines(points, width) => {
                let to_line = |[[ax, ay], [bx, by]]: [[f32; 2]; 2]| {
                    let [dx, dy] = [bx - ax, by - ay];
                    let along = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy);
                    let along = along.clamp(0.0, 1.0);
                    (x - ax - along * dx).hypot(y - ay - along * dy)
                };
                points.array_windows().map(|line| to_line(*line)).fold(f32::INFINITY, f32::min) - width / 2.0
            }
        }
    }
}

/// The icon as `side` * `side` pixels, four bytes each: sRGB-encoded colour and straight alpha, rows from the top.
#[must_use]
pub fn pixels(side: u32) -> Vec<u8> {
    let shapes = shapes();
    let unit = SIDE / side as f32;
    let pixel = |index: u32| {
        let at = [(index % side) as f32 + 0.5, (index / side) as f32 + 0.5].map(|x| x * unit);
        // Colours are multiplied by their alpha, until the last shape is drawn.
        let mut drawn = [0.0_f32; 4];
        for IconShape { outline, colour, opacity } in &shapes {
            // The area of the pixel inside a straight edge at this distance.
            let alpha = opacity * (0.5 - outline.distance(at) / unit).clamp(0.0, 1.0);
            let [r, g, b] = colour.map(|c| f32::from(c) / 255.0);
            for (below, above) in drawn.iter_mut().zip([r, g, b, 1.0]) {
                *below = *below * (1.0 - alpha) + above * alpha;
            }
        }
        let [r, g, b, alpha] = drawn;
        [r, g, b].map(|c| if alpha > 0.0 { c / alpha } else { 0.0 }).into_iter().chain([alpha])
    };
    (0..side * side).flat_map(pixel).map(|c| (c * 255.0).round() as u8).collect()
}

/// The icon as SVG.
#[must_use]
pub fn svg() -> String {
    let shape = |IconShape { outline, colour: [r, g, b], opacity }: IconShape| {
        let colour = format!("#{r:02x}{g:02x}{b:02x}");
        match outline {
            IconOutline::Rectangle([x, y, width, height, radius]) => html! {
                rect x=(x) y=(y) width=(width) height=(height) rx=(radius) fill=(colour) fill-opacity=(opacity) {}
            },
            IconOutline::Lines(points, width) => {
                let points: Vec<String> = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
                html! {
                    polyline points=(points.join(" ")) fill="none" stroke=(colour) stroke-width=(width)
                        stroke-opacity=(opacity) stroke-linecap="round" stroke-linejoin="round" {}
                }
            }
        }
    };
    html! {
        (PreEscaped("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"))
        svg xmlns="http://www.w3.org/2000/svg" width=(SIDE) height=(SIDE) viewBox={ "0 0 " (SIDE) " " (SIDE) } {
            @for shape in shapes().into_iter().map(shape) { (shape) }
        }
        (PreEscaped("\n"))
    }
    .into_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_show_the_same_drawing() {
        for side in [16, 48, 256] {
            let pixels = pixels(side);
            assert_eq!(pixels.len() as u32, side * side * 4);
            let at = |x: f32, y: f32| {
                let index = |c: f32| (c / SIDE * side as f32) as usize;
                let start = 4 * (index(y) * side as usize + index(x));
                pixels[start..start + 4].to_vec()
            };
            assert_eq!(at(0.5, 0.5)[3], 0, "the corner is clear at {side}");
            assert_eq!(at(32.0, 58.0), [0x15, 0x1f, 0x2c, 255], "the ground at {side}");
            let plate = at(42.5, 50.0);
            assert!(plate[2] > 150 && plate[2] > plate[0], "a plate at {side}: {plate:?}");
        }
    }

    #[test]
    fn svg_has_every_shape() {
        let svg = svg();
        let document = roxmltree::Document::parse(&svg).expect("XML");
        assert_eq!(document.root_element().children().count(), shapes().len());
        assert_eq!(document.root_element().attribute("viewBox"), Some("0 0 64 64"));
    }
}
