//! Commands of the menus with their keys, written once: menus, keys and the help are made of this list.

use egui::{Key, KeyboardShortcut, ModifierNames, Modifiers};

use crate::navigation::ViewSide;

/// What a menu entry or a key does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MenuCommand {
    /// Open a file.
    Open,
    /// Save the picture under a name.
    Save,
    /// Copy the picture to the clipboard.
    CopyPicture,
    /// Copy the command that draws the picture.
    CopyCommand,
    /// Close the window.
    Quit,
    /// Take back the last change.
    Undo,
    /// Make the change again that was taken back.
    Redo,
    /// Hide what is selected.
    Hide,
    /// Show only what is selected.
    Isolate,
    /// Show everything.
    ShowAll,
    /// Frame what is selected, or the whole scene.
    Frame,
    /// Return to the initial camera.
    Reset,
    /// Look from a side.
    Look(ViewSide),
    /// Show or hide the panels.
    Panels,
    /// Full screen.
    FullScreen,
    /// Larger text.
    Larger,
    /// Smaller text.
    Smaller,
    /// Text of normal size.
    Normal,
    /// Compare two settings.
    Compare,
    /// Measure distances.
    Measure,
    /// Show or hide the grid.
    Grid,
    /// Play or pause.
    Play,
    /// Next frame of the animation.
    Forward,
    /// Previous frame of the animation.
    Back,
    /// Next knob.
    NextKnob,
    /// Previous knob.
    PreviousKnob,
    /// Next rung of the knob.
    NextRung,
    /// Previous rung of the knob.
    PreviousRung,
    /// Show or hide the help.
    Help,
}

/// A command with its place in the menus.
pub struct MenuEntry {
    /// The command.
    pub command: MenuCommand,
    /// Title of its menu.
    pub menu: &'static str,
    /// Name in the menu and in the help.
    pub name: &'static str,
    /// Keys; the first is shown.
    pub keys: &'static [KeyboardShortcut],
    /// Whether the command repeats while the key is held.
    pub repeats: bool,
}

const fn key(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::NONE, key)
}

const fn ctrl(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND, key)
}

const fn shift(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::SHIFT, key)
}

const fn alt(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::ALT, key)
}

const CTRL_SHIFT: Modifiers = Modifiers::COMMAND.plus(Modifiers::SHIFT);

const fn entry(
    menu: &'static str,
    command: MenuCommand,
    name: &'static str,
    keys: &'static [KeyboardShortcut],
) -> MenuEntry {
    let repeats = matches!(
        command,
        MenuCommand::NextKnob
            | MenuCommand::PreviousKnob
            | MenuCommand::NextRung
            | MenuCommand::PreviousRung
            | MenuCommand::Forward
            | MenuCommand::Back
    );
    MenuEntry { command, menu, name, keys, repeats }
}

/// Every command, in the order of the menus.
pub const COMMANDS: [MenuEntry; 34] = [
    entry("File", MenuCommand::Open, "Open …", &[ctrl(Key::O)]),
    entry("File", MenuCommand::Save, "Save picture …", &[ctrl(Key::S)]),
    entry("File", MenuCommand::CopyPicture, "Copy picture", &[KeyboardShortcut::new(CTRL_SHIFT, Key::C)]),
    entry("File", MenuCommand::CopyCommand, "Copy command", &[key(Key::C)]),
    entry("File", MenuCommand::Quit, "Quit", &[ctrl(Key::Q)]),
    entry("Edit", MenuCommand::Undo, "Undo", &[ctrl(Key::Z)]),
    entry("Edit", MenuCommand::Redo, "Redo", &[KeyboardShortcut::new(CTRL_SHIFT, Key::Z), ctrl(Key::Y)]),
    entry("Edit", MenuCommand::Hide, "Hide selection", &[key(Key::H)]),
    entry("Edit", MenuCommand::Isolate, "Show only selection", &[key(Key::Slash), shift(Key::H)]),
    entry("Edit", MenuCommand::ShowAll, "Show all", &[alt(Key::H)]),
    entry("Edit", MenuCommand::Compare, "Compare two settings", &[key(Key::V)]),
    entry("Edit", MenuCommand::Measure, "Measure", &[key(Key::M)]),
    entry("Edit", MenuCommand::PreviousKnob, "Previous option", &[key(Key::ArrowUp)]),
    entry("Edit", MenuCommand::NextKnob, "Next option", &[key(Key::ArrowDown)]),
    entry("Edit", MenuCommand::PreviousRung, "Previous setting", &[key(Key::ArrowLeft)]),
    entry("Edit", MenuCommand::NextRung, "Next setting", &[key(Key::ArrowRight)]),
    entry("View", MenuCommand::Frame, "Frame selection or scene", &[key(Key::F)]),
    entry("View", MenuCommand::Reset, "Initial camera", &[key(Key::R), key(Key::Home)]),
    entry("View", MenuCommand::Look(ViewSide::Front), "From the front", &[ctrl(Key::Num1)]),
    entry("View", MenuCommand::Look(ViewSide::Right), "From the right", &[ctrl(Key::Num3)]),
    entry("View", MenuCommand::Look(ViewSide::Top), "From above", &[ctrl(Key::Num7)]),
    entry("View", MenuCommand::Look(ViewSide::Back), "From behind", &[ctrl(Key::Num2)]),
    entry("View", MenuCommand::Look(ViewSide::Left), "From the left", &[ctrl(Key::Num4)]),
    entry("View", MenuCommand::Look(ViewSide::Bottom), "From below", &[ctrl(Key::Num8)]),
    entry("View", MenuCommand::Play, "Play or pause", &[key(Key::Space)]),
    entry("View", MenuCommand::Back, "Previous frame", &[key(Key::Comma)]),
    entry("View", MenuCommand::Forward, "Next frame", &[key(Key::Period)]),
    entry("View", MenuCommand::Grid, "Grid and axes", &[key(Key::G)]),
    entry("View", MenuCommand::Panels, "Panels", &[key(Key::P)]),
    entry("View", MenuCommand::FullScreen, "Full screen", &[key(Key::F11)]),
    entry("View", MenuCommand::Larger, "Larger text", &[ctrl(Key::Plus), ctrl(Key::Equals)]),
    entry("View", MenuCommand::Smaller, "Smaller text", &[ctrl(Key::Minus)]),
    entry("View", MenuCommand::Normal, "Normal text", &[ctrl(Key::Num0)]),
    entry("Help", MenuCommand::Help, "Keys", &[key(Key::F1), key(Key::Questionmark)]),
];

/// Every input with what it does: the help of the window, and the table of docs/view.md.
#[must_use]
pub fn inputs() -> Vec<(String, &'static str)> {
    let of = |entry: &MenuEntry| {
        let keys: Vec<String> = entry.keys.iter().map(|key| key.format(&ModifierNames::NAMES, false)).collect();
        (keys.join(", "), entry.name)
    };
    MOVEMENTS.iter().map(|(how, does)| ((*how).to_owned(), *does)).chain(COMMANDS.iter().map(of)).collect()
}

/// Movements of the mouse and held keys, which are in no menu.
const MOVEMENTS: &[(&str, &str)] = &[
    ("drag", "orbit"),
    ("Shift+drag, middle drag", "pan"),
    ("right drag", "look around"),
    ("wheel, pinch", "zoom"),
    ("W S A D Q E", "fly forwards, back, left, right, down, up"),
    ("1 to 9", "cameras of the file"),
    ("click", "select; with Measure: set a point"),
    ("double click", "turn to a point"),
    ("Ctrl+click", "inspect a pixel and its rays"),
    ("Tab, Shift+Tab", "next, previous control"),
    ("Escape", "close what is open"),
];
