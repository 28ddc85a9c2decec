//! Every panel in windows of every size, at every scale: its controls by egui's own rectangles. Nothing is cut off at
//! the sides, nothing overlaps, and the keyboard reaches everything.

use std::collections::BTreeSet;
use std::sync::Arc;

use egui::{Context, Event, Key, Modifiers, PointerButton, Pos2, RawInput, Rect, Shape, Vec2, ViewportId};
use etalon::frame::Settings;
use etalon::gpu::{DeviceInfo, PassTime};
use etalon::pass::tonemap::Counts;
use etalon::plan::Knobs;
use etalon::scene::outline::{Animation, FilePart, Outline, OutlineNode};
use etalon::share::AovPixel;
use etalon_viewer::layout::{Docks, Pane};
use etalon_viewer::navigation::Navigation;
use etalon_viewer::panels::{self, PanelState};
use etalon_viewer::preferences::Preferences;
use etalon_viewer::shared::{FileChoice, Loaded, PixelSurfaces, RenderRequest, RenderState, SceneFacts, Shown, Side};

fn named(name: &str) -> FilePart {
    FilePart { name: name.to_owned(), key: name.to_owned() }
}

/// A scene with something in every list, and names that are too long.
fn loaded() -> Loaded {
    let mut scene = etalon::study::load("torture").expect("a scene");
    scene.name = "/home/somebody/a folder with a long name/models/a scene with a very long name indeed.gltf".to_owned();
    let long = |i: usize| format!("a node with a long name that does not fit into any panel of the window, number {i}");
    scene.outline = Outline {
        scenes: vec![named("one"), named(&long(0))],
        scene: 0,
        variants: vec![named(&long(1)), named("beach")],
        animations: vec![
            Animation { named: named("walk"), seconds: 1.0, plays: true },
            Animation { named: named(&long(2)), seconds: 9.5, plays: false },
        ],
        nodes: (0..40)
            .map(|i| OutlineNode {
                name: if i % 3 == 0 { long(i) } else { format!("node {i}") },
                key: i.to_string(),
                index: i,
                parent: (i % 5 != 0).then(|| i - 1),
                instances: if i < scene.instances.len() { vec![i] } else { Vec::new() },
                ..OutlineNode::default()
            })
            .collect(),
    };
    scene.duration = Some(1.0);
    let camera = scene.cameras[0].clone();
    let warning = "the optional extension EXT_something_with_a_long_name is not supported and is ignored";
    Loaded { warnings: vec![warning.to_owned()], ..Loaded::new(scene, camera) }
}

fn seen(loaded: &Loaded) -> RenderState {
    let settings = Settings::default();
    let facts = SceneFacts::of(&RenderRequest::new(settings), loaded).expect("facts");
    let plan = etalon::open::Opened::new(loaded.original.scene().clone(), None, false).plan(Settings::default());
    let shown = Shown {
        version: 1,
        rgba: Arc::new(vec![0; 4]),
        opaque: Arc::new(vec![0; 4]),
        has_alpha: false,
        of: Some(RenderRequest::new(Settings::default())),
        size: [1, 1],
        samples: [3, 16],
        moving: false,
        time: None,
        knobs: Knobs::default(),
        passes: ["G-buffer", "lighting", "reflection", "tone map"]
            .map(|name| PassTime { name: name.to_owned(), ms: 12.5 })
            .into_iter()
            .collect(),
        rays: 123_456,
        counts: Counts { nan: 3, inf: 0, negative: 0 },
        error: Some(0.1),
        seconds_left: 75.0,
        clipped: 0.5,
    };
    let side = Side {
        shown: Some(shown),
        effects: plan.expect("a plan").effects.into(),
        warnings: Arc::new([]),
        lit_by: Some("lit by the light \"lamp\" and the built-in studio at intensity 0.5 as fill light".to_owned()),
        refused: None,
    };
    RenderState { facts: Some(Arc::new(facts)), sides: [side, Side::default()], ..RenderState::default() }
}

/// A window of `size` pixels at a scale, with one panel of each stack in front.
struct Window {
    context: Context,
    state: PanelState,
    size: Vec2,
    scale: f32,
    time: f64,
}

impl Window {
    fn new(size: [f32; 2], scale: f32, theme: egui::ThemePreference, loaded: &Loaded, seen: &RenderState) -> Self {
        let device = DeviceInfo {
            name: "a graphics card with a long name".to_owned(),
            driver: "a driver".to_owned(),
            version: "1".to_owned(),
            kind: "cpu",
            api: "1.3".to_owned(),
        };
        let preferences = Preferences { docks: Some(Docks::new(size[0] / scale)), ..Preferences::default() };
        let mut state = PanelState::new(Settings::default(), FileChoice::default(), device, Vec::new(), preferences);
        let bounds = seen.facts.as_ref().expect("facts").bounds;
        state.navigation = Some(Navigation::new(loaded.camera.clone(), bounds, None));
        let context = Context::default();
        context.set_theme(theme);
        Self { context, state, size: Vec2::from(size) / scale, scale, time: 0.0 }
    }

    fn frame(&mut self, seen: &RenderState, events: Vec<Event>) -> egui::FullOutput {
        self.time += 0.1;
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(egui::Pos2::ZERO, self.size)),
            time: Some(self.time),
            events,
            focused: true,
            ..RawInput::default()
        };
        if let Some(viewport) = input.viewports.get_mut(&ViewportId::ROOT) {
            viewport.native_pixels_per_point = Some(self.scale);
        }
        let state = &mut self.state;
        let mut output = self.context.clone().run_ui(input, |ui| drop(panels::show(ui, state, seen)));
        // Nothing is drawn.
        output.textures_delta.clear();
        output
    }

    /// What is wrong with the controls of the last frame.
    fn faults(&self, output: &egui::FullOutput) -> Vec<String> {
        /// Overlap that nobody sees, in points.
        const SEEN: f32 = 2.0;
        let screen = Rect::from_min_size(egui::Pos2::ZERO, self.size).expand(0.6);
        let mut faults = Vec::new();
        self.context.viewport(|viewport| {
            for (layer, widgets) in viewport.prev_pass.widgets.layers() {
                let clickable: Vec<_> = widgets
                    .iter()
                    .filter(|w| w.sense.senses_click() && w.enabled && w.interact_rect.is_positive())
                    .collect();
                for (i, a) in clickable.iter().enumerate() {
                    let (whole, seen) = (a.rect, a.interact_rect);
                    if !screen.contains_rect(seen) {
                        faults.push(format!("{layer:?}: a control lies outside: {seen:?}"));
                    }
                    // A scroll area cuts controls above and below, never at the sides.
                    let is_control = whole.height() < 60.0;
                    if is_control && (whole.left() < seen.left() - SEEN || whole.right() > seen.right() + SEEN) {
                        faults.push(format!("{layer:?}: a control is cut off at the side: {whole:?} seen {seen:?}"));
                    }
                    for b in &clickable[i + 1..] {
                        // The grips between panels reach over their borders; the ends of the axes in the corner cover
                        // each other as axes do.
                        let is_grip = |r: Rect| r.size().min_elem() < 8.0;
                        let is_end = |r: Rect| r.width() == r.height() && r.width() <= 16.0;
                        if is_grip(seen) || is_grip(b.interact_rect) || is_end(seen) && is_end(b.interact_rect) {
                            continue;
                        }
                        let both = seen.intersect(b.interact_rect);
                        let inside = |a: Rect, b: Rect| a.expand(0.6).contains_rect(b);
                        if both.width() > SEEN
                            && both.height() > SEEN
                            && !inside(seen, b.interact_rect)
                            && !inside(b.interact_rect, seen)
                        {
                            faults.push(format!("{layer:?}: controls overlap: {seen:?} and {:?}", b.interact_rect));
                        }
                    }
                }
            }
        });
        for clipped in &output.shapes {
            let Shape::Text(text) = &clipped.shape else { continue };
            let rect = text.galley.rect.translate(text.pos.to_vec2());
            let (clip, words) = (clipped.clip_rect, text.galley.text());
            let in_sight = clip.is_positive() && rect.top() < clip.bottom() && rect.bottom() > clip.top();
            if in_sight
                && !words.trim().is_empty()
                && (rect.left() < clip.left() - 1.0 || rect.right() > clip.right() + 1.0)
            {
                faults.push(format!("words are cut off at the side: {words:?}: {rect:?} in {clip:?}"));
            }
        }
        faults
    }
}

const SIZES: [([f32; 2], f32); 7] = [
    ([900.0, 600.0], 1.0),
    ([1280.0, 720.0], 1.0),
    ([1920.0, 1080.0], 1.0),
    ([1800.0, 1200.0], 2.0),
    ([1920.0, 1080.0], 2.0),
    ([3840.0, 2160.0], 1.0),
    ([3840.0, 2160.0], 2.0),
];

#[test]
fn nothing_is_cut_off_and_nothing_overlaps() {
    let loaded = loaded();
    let seen = seen(&loaded);
    let mut wrong = BTreeSet::new();
    for (size, scale) in SIZES {
        for theme in [egui::ThemePreference::Dark, egui::ThemePreference::Light] {
            let mut window = Window::new(size, scale, theme, &loaded, &seen);
            for (pane, title) in Pane::PANELS {
                for special in ["", "comparing", "light", "help", "message"] {
                    if let Some(docks) = &mut window.state.preferences.docks {
                        docks.bring_forward(pane);
                    }
                    window.state.other = (special == "comparing").then(Knobs::exact);
                    window.state.help = special == "help";
                    window.state.choice.key_light = (special == "light").then_some(etalon::scene::KeyLight {
                        azimuth: -45.0,
                        elevation: 45.0,
                        lux: 3.0,
                    });
                    if special == "light" {
                        window.state.settings.background = etalon::frame::Background::Color([200, 100, 50]);
                    }
                    if special == "message" {
                        window.state.notices.say("etalon render scene.glb ".repeat(12));
                        window.state.notices.fail("saving a picture: the disk is full".to_owned());
                    }
                    // egui finds the sizes of new panels in the first frames.
                    let mut output = window.frame(&seen, Vec::new());
                    for _ in 0..4 {
                        output = window.frame(&seen, Vec::new());
                    }
                    let found = window.faults(&output);
                    wrong
                        .extend(found.into_iter().map(|fault| format!("{title} {special} {size:?} ×{scale}: {fault}")));
                    window.state.notices.clear();
                }
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "{} faults:\n{}",
        wrong.len(),
        wrong.iter().take(60).cloned().collect::<Vec<_>>().join("\n")
    );
}

/// The figures of both sides of a comparison stand beside each other.
#[test]
fn figures_of_both_sides_do_not_overlap() {
    let loaded = loaded();
    let mut seen = seen(&loaded);
    seen.sides[1] = seen.sides[0].clone();
    seen.sides[1].shown.as_mut().expect("a picture").knobs = Knobs::exact();
    for (size, scale) in SIZES {
        let mut window = Window::new(size, scale, egui::ThemePreference::Dark, &loaded, &seen);
        window.state.other = Some(Knobs::exact());
        (0..4).for_each(|_| drop(window.frame(&seen, Vec::new())));
        let output = window.frame(&seen, Vec::new());
        let figures = output.shapes.iter().filter_map(|clipped| match &clipped.shape {
            Shape::Text(text) if text.galley.text().contains(" samples\n") => {
                Some(text.galley.rect.translate(text.pos.to_vec2()))
            }
            _ => None,
        });
        let figures: Vec<Rect> = figures.collect();
        assert!(figures.len() == 2 && !figures[0].intersects(figures[1]), "{size:?} ×{scale}: {figures:?}");
    }
}

/// A slow frame receives several presses at once: each counts, and a held key counts once.
#[test]
fn presses_in_one_frame_count() {
    let loaded = loaded();
    let seen = seen(&loaded);
    let key =
        |pressed| Event::Key { key: Key::G, physical_key: None, pressed, repeat: false, modifiers: Modifiers::NONE };
    let (held, twice) = (vec![key(true), key(true)], vec![key(true), key(false), key(true), key(false)]);
    for (presses, events) in [(1, held), (2, twice)] {
        let mut window = Window::new([1280.0, 720.0], 1.0, egui::ThemePreference::Dark, &loaded, &seen);
        drop(window.frame(&seen, Vec::new()));
        let before = window.state.preferences.overlays.grid;
        drop(window.frame(&seen, events));
        let changed = window.state.preferences.overlays.grid != before;
        assert_eq!(changed, presses == 1, "{presses} presses");
    }
}

/// A picture fills its area, but for a view that was framed for a wider one.
#[test]
fn a_framed_view_is_not_cut_off_in_a_narrower_window() {
    let loaded = loaded();
    let seen = seen(&loaded);
    let mut window = Window::new([1280.0, 720.0], 1.0, egui::ThemePreference::Dark, &loaded, &seen);
    window.state.panels = false;
    let aspect = |window: &Window| {
        let [left, top, right, bottom] = window.state.place;
        f64::from(right - left) / f64::from(bottom - top)
    };
    let press =
        |key: Key| Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers: Modifiers::NONE };
    drop(window.frame(&seen, Vec::new()));
    window.size = Vec2::new(800.0, 720.0);
    drop(window.frame(&seen, Vec::new()));
    assert!((aspect(&window) - 16.0 / 9.0).abs() < 0.01, "a camera of the file: {:?}", window.state.place);
    drop(window.frame(&seen, vec![press(Key::F)]));
    drop(window.frame(&seen, Vec::new()));
    assert!((aspect(&window) - 800.0 / 720.0).abs() < 0.01, "framed for all of the window: {:?}", window.state.place);
    window.size = Vec2::new(400.0, 720.0);
    drop(window.frame(&seen, Vec::new()));
    assert!((aspect(&window) - 800.0 / 720.0).abs() < 0.01, "the sides stay: {:?}", window.state.place);
}

#[test]
fn the_keyboard_reaches_every_control() {
    let loaded = loaded();
    let seen = seen(&loaded);
    let mut window = Window::new([1280.0, 720.0], 1.0, egui::ThemePreference::Dark, &loaded, &seen);
    for (pane, title) in Pane::PANELS {
        if let Some(docks) = &mut window.state.preferences.docks {
            docks.bring_forward(pane);
        }
        (0..3).for_each(|_| drop(window.frame(&seen, Vec::new())));
        let wanted: BTreeSet<_> = window.context.viewport(|viewport| {
            let widgets = viewport.prev_pass.widgets.layers().flat_map(|(_, widgets)| widgets.to_vec());
            widgets
                .filter(|w| w.sense.is_focusable() && w.enabled && w.interact_rect.is_positive())
                .map(|w| w.id.value())
                .collect()
        });
        let mut reached = BTreeSet::new();
        for _ in 0..400 {
            let tab = Event::Key {
                key: Key::Tab,
                physical_key: None,
                pressed: true,
                repeat: false,
                modifiers: Modifiers::NONE,
            };
            drop(window.frame(&seen, vec![tab]));
            reached.extend(window.context.memory(|memory| memory.focused()).map(|id| id.value()));
        }
        let missed: Vec<_> = wanted.difference(&reached).collect();
        assert!(
            missed.is_empty() && !wanted.is_empty(),
            "{title}: {} of {} are not reached",
            missed.len(),
            wanted.len()
        );
    }
}

/// A menu and a drop-down close by Escape, and the key does nothing else.
#[test]
fn escape_closes_what_is_open() {
    let loaded = loaded();
    let seen = seen(&loaded);
    let mut window = Window::new([1280.0, 720.0], 1.0, egui::ThemePreference::Dark, &loaded, &seen);
    if let Some(docks) = &mut window.state.preferences.docks {
        docks.bring_forward(Pane::Display);
    }
    window.state.selected = Some(0);
    (0..3).for_each(|_| drop(window.frame(&seen, Vec::new())));
    let press =
        |key: Key| Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers: Modifiers::NONE };
    // Of every control in turn: what a press of space opens is closed by Escape.
    let mut opened = 0;
    for _ in 0..60 {
        drop(window.frame(&seen, vec![press(Key::Tab)]));
        let before = (window.state.choice.clone(), window.state.selected);
        drop(window.frame(&seen, vec![press(Key::Enter)]));
        drop(window.frame(&seen, Vec::new()));
        if egui::Popup::is_any_open(&window.context) {
            opened += 1;
            drop(window.frame(&seen, vec![press(Key::Escape)]));
            drop(window.frame(&seen, Vec::new()));
            assert!(!egui::Popup::is_any_open(&window.context), "it is still open");
            assert_eq!((window.state.choice.clone(), window.state.selected), before, "Escape did something else");
        }
        window.state.selected = Some(0);
        if window.state.is_asking() {
            drop(window.frame(&seen, vec![press(Key::Escape)]));
        }
    }
    // Four menus, and the drop-downs of tone curve and layer at least.
    assert!(opened >= 6, "{opened} were opened");
}

/// The pointer over the middle of a control is over that control: nothing lies above it.
#[test]
fn the_mouse_reaches_every_control() {
    let loaded = loaded();
    let seen = seen(&loaded);
    let mut reached = 0;
    for (size, scale) in [([900.0, 600.0], 1.0), ([1280.0, 720.0], 1.0), ([3840.0, 2160.0], 2.0)] {
        for (pane, title) in Pane::PANELS {
            let mut window = Window::new(size, scale, egui::ThemePreference::Dark, &loaded, &seen);
            if let Some(docks) = &mut window.state.preferences.docks {
                docks.bring_forward(pane);
            }
            (0..5).for_each(|_| drop(window.frame(&seen, Vec::new())));
            let controls: Vec<_> = window.context.viewport(|viewport| {
                let widgets = viewport.prev_pass.widgets.layers().flat_map(|(_, widgets)| widgets.to_vec());
                let wanted = widgets.filter(|w| w.sense.is_focusable() && w.enabled && w.interact_rect.is_positive());
                wanted.map(|w| (w.id, w.interact_rect)).collect()
            });
            for (id, rect) in controls {
                // The ends of the axes in the corner cover each other; tabs have their cross at the side.
                if rect.width() == rect.height() && rect.width() <= 16.0 {
                    continue;
                }
                let at = rect.left_center().lerp(rect.center(), if rect.width() > 40.0 { 0.5 } else { 1.0 });
                drop(window.frame(&seen, vec![Event::PointerMoved(at)]));
                let response = window.context.read_response(id);
                let is_over = response.is_some_and(|response| response.contains_pointer());
                assert!(is_over, "{title} {size:?} ×{scale}: {rect:?} is not reached at {at:?}");
                reached += 1;
            }
        }
    }
    assert!(reached > 300, "{reached} controls");
}

/// Values of the command line beyond a slider's range, or with more decimals, are those of the command that is copied.
#[test]
fn showing_a_setting_does_not_change_it() {
    let loaded = loaded();
    let seen = seen(&loaded);
    let mut window = Window::new([1280.0, 2000.0], 1.0, egui::ThemePreference::Dark, &loaded, &seen);
    let light = etalon::scene::KeyLight { azimuth: 270.25, elevation: 12.345, lux: 5000.5 };
    let settings = &mut window.state.settings;
    (settings.exposure, settings.environment_rotation, settings.environment_intensity) = (-30.123_456, 270.0, 100.125);
    window.state.choice.key_light = Some(light);
    window.state.clock.time = Some(0.123_456_7);
    for (pane, _) in Pane::PANELS {
        if let Some(docks) = &mut window.state.preferences.docks {
            docks.bring_forward(pane);
        }
        (0..3).for_each(|_| drop(window.frame(&seen, Vec::new())));
    }
    let settings = &window.state.settings;
    let shown = (settings.exposure, settings.environment_rotation, settings.environment_intensity);
    assert_eq!(shown, (-30.123_456, 270.0, 100.125));
    assert_eq!((window.state.choice.key_light, window.state.clock.time), (Some(light), Some(0.123_456_7)));
}

/// A click waits for the surfaces at the pixels. It belongs to the view and the size that it was made in.
#[test]
fn a_click_into_another_view_is_forgotten() {
    let loaded = loaded();
    let mut seen = seen(&loaded);
    let surfaces = |state: &PanelState| {
        let size = state.settings.size;
        let pixel = AovPixel {
            p_rel: [0.0, 0.0, -1.0],
            normal: [0.0, 0.0, 1.0],
            geometric_normal: [0.0, 0.0, 1.0],
            albedo: [0.5; 3],
            distance: 1.0,
            roughness: 0.5,
            metallic: 0.0,
            emissive: [0.0; 3],
            material: 1,
            instance: 1,
        };
        PixelSurfaces {
            pixels: Arc::new(vec![pixel; (size[0] * size[1]) as usize]),
            radiance: Vec::new(),
            size,
            eye: glam::DVec3::ZERO,
            seen_from: state.navigation.as_ref().expect("a view").camera(),
            versions: [Some(1), None],
        }
    };
    for change in ["nothing", "the size", "the view"] {
        let mut window = Window::new([1280.0, 720.0], 1.0, egui::ThemePreference::Dark, &loaded, &seen);
        (0..3).for_each(|_| drop(window.frame(&seen, Vec::new())));
        let [_, _, right, bottom] = window.state.place;
        let at = Pos2::new(right as f32 - 200.0, bottom as f32 - 5.0);
        let button = |pressed| Event::PointerButton {
            pos: at,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        drop(window.frame(&seen, vec![Event::PointerMoved(at)]));
        drop(window.frame(&seen, vec![button(true)]));
        drop(window.frame(&seen, vec![button(false)]));
        assert!(window.state.wants_surfaces(), "the click waits");
        match change {
            "the size" => window.size *= 0.7,
            "the view" => window.state.navigation.as_mut().expect("a view").orbit(glam::DVec2::new(0.1, 0.0)),
            _ => {}
        }
        drop(window.frame(&seen, Vec::new()));
        seen.surfaces = Some(surfaces(&window.state));
        drop(window.frame(&seen, Vec::new()));
        seen.surfaces = None;
        assert!(!window.state.wants_surfaces(), "{change}: the click is answered or forgotten");
        assert_eq!(window.state.selected, (change == "nothing").then_some(0), "{change}");
    }
}

/// Undo returns to what was shown, never to a choice that could not be read.
#[test]
fn undo_passes_over_what_failed() {
    let loaded = loaded();
    let mut seen = seen(&loaded);
    let mut window = Window::new([1280.0, 720.0], 1.0, egui::ThemePreference::Dark, &loaded, &seen);
    let settle = |window: &mut Window, seen: &RenderState| (0..12).for_each(|_| drop(window.frame(seen, Vec::new())));
    let undo = Event::Key {
        key: Key::Z,
        physical_key: None,
        pressed: true,
        repeat: false,
        modifiers: Modifiers::COMMAND | Modifiers::CTRL,
    };
    let choose = |seen: &mut RenderState, choice: &FileChoice| {
        let facts = SceneFacts { choice: choice.clone(), ..(**seen.facts.as_ref().expect("facts")).clone() };
        seen.facts = Some(Arc::new(facts));
    };
    let hidden = FileChoice { hide: vec!["3".to_owned()], ..FileChoice::default() };
    settle(&mut window, &seen);
    window.state.choice = hidden.clone();
    choose(&mut seen, &hidden);
    settle(&mut window, &seen);
    // This one is never shown; the window then returns to the one before.
    window.state.choice = FileChoice { variant: Some("broken".to_owned()), ..hidden.clone() };
    settle(&mut window, &seen);
    window.state.choice = hidden;
    settle(&mut window, &seen);
    drop(window.frame(&seen, vec![undo]));
    assert_eq!(window.state.choice, FileChoice::default());
}
