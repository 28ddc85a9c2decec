//! A display of its own for a test, the program's window on it, and a user's hands: XTEST, window sizes, drag and drop.
#![allow(dead_code, unreachable_pub, reason = "each test program includes this file and uses its own part of it")]

use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use x11rb::connection::Connection as _;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    AtomEnum, ClientMessageEvent, ConfigureWindowAux, ConnectionExt as _, EventMask, ImageFormat, InputFocus, PropMode,
    SelectionNotifyEvent, Window, WindowClass,
};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

/// An X server without a screen.
pub struct Display {
    server: Child,
    pub name: String,
    pub connection: RustConnection,
    root: Window,
}

impl Display {
    /// `None` with a message where there is no Xvfb.
    pub fn start() -> Option<Self> {
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "2000x1200x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let Ok(mut server) = server else {
            eprintln!("skipped: there is no Xvfb (Debian: xvfb)");
            return None;
        };
        // It writes the number of its display when it is ready.
        let mut number = String::new();
        BufReader::new(server.stdout.take().expect("a pipe")).read_line(&mut number).expect("a display");
        let name = format!(":{}", number.trim());
        let (connection, _) = RustConnection::connect(Some(&name)).expect("a connection");
        let root = connection.setup().roots[0].root;
        Some(Self { server, name, connection, root })
    }

    fn atom(&self, name: &str) -> u32 {
        self.connection.intern_atom(false, name.as_bytes()).expect("a request").reply().expect("an atom").atom
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// The program with its window.
pub struct Viewer<'a> {
    display: &'a Display,
    program: Child,
    said: Receiver<String>,
    pub window: Window,
}

impl<'a> Viewer<'a> {
    pub fn open(display: &'a Display, folder: &Path, arguments: &[&str]) -> Self {
        Self::open_with(display, folder, arguments, &[])
    }

    /// The same with some variables of the environment.
    pub fn open_with(display: &'a Display, folder: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Self {
        let mut program = super::program::command(folder)
            .arg("view")
            .args(arguments)
            .env("DISPLAY", &display.name)
            .env_remove("WAYLAND_DISPLAY")
            .env("XDG_CONFIG_HOME", folder.join("config"))
            .envs(variables.iter().copied())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let pipe = BufReader::new(program.stdout.take().expect("a pipe"));
        let (to, said) = channel();
        std::thread::spawn(move || pipe.lines().map_while(Result::ok).try_for_each(|line| to.send(line)));
        let mut viewer = Self { display, program, said, window: 0 };
        viewer.window = viewer.until("a window", |_| {
            let tree = display.connection.query_tree(display.root).ok()?.reply().ok()?;
            tree.children.into_iter().find(|&window| {
                let seen = display.connection.get_window_attributes(window).ok().and_then(|r| r.reply().ok());
                let titled = display
                    .connection
                    .get_property(false, window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, 64)
                    .ok()
                    .and_then(|r| r.reply().ok())
                    .is_some_and(|title| !title.value.is_empty());
                titled && seen.is_some_and(|w| w.map_state == x11rb::protocol::xproto::MapState::VIEWABLE)
            })
        });
        viewer.focus();
        viewer
    }

    fn focus(&self) {
        let connection = &self.display.connection;
        connection
            .set_input_focus(InputFocus::PARENT, self.window, x11rb::CURRENT_TIME)
            .expect("a request")
            .check()
            .expect("the window is there");
    }

    /// What `of` finds, within two minutes.
    #[track_caller]
    pub fn until<T>(&mut self, what: &str, mut of: impl FnMut(&Self) -> Option<T>) -> T {
        let begun = Instant::now();
        loop {
            if let Some(found) = of(self) {
                return found;
            }
            if let Some(code) = self.program.try_wait().expect("a child") {
                let mut words = String::new();
                let _ = self.program.stderr.take().expect("a pipe").read_to_string(&mut words);
                panic!("waiting for {what}: the program ended with {code}: {words}");
            }
            assert!(begun.elapsed() < Duration::from_secs(120), "waited in vain for {what}");
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    pub fn title(&self) -> String {
        let name = self.display.atom("_NET_WM_NAME");
        let connection = &self.display.connection;
        let asked = connection.get_property(false, self.window, name, AtomEnum::ANY, 0, 64).expect("a request");
        asked.reply().map_or_else(|_| String::new(), |title| String::from_utf8_lossy(&title.value).into_owned())
    }

    /// Pixels of the window, RGB.
    pub fn pixels(&self) -> Option<([u32; 2], Vec<[u8; 3]>)> {
        let connection = &self.display.connection;
        let place = connection.get_geometry(self.window).ok()?.reply().ok()?;
        let (width, height) = (place.width, place.height);
        let image =
            connection.get_image(ImageFormat::Z_PIXMAP, self.window, 0, 0, width, height, !0).ok()?.reply().ok()?;
        let pixels = image.data.chunks_exact(4).map(|p| [p[2], p[1], p[0]]).collect();
        Some(([width.into(), height.into()], pixels))
    }

    pub fn resize(&self, [width, height]: [u32; 2]) {
        let size = ConfigureWindowAux::new().width(width).height(height);
        self.display.connection.configure_window(self.window, &size).expect("a request").check().expect("a size");
    }

    /// Takes the window off the screen, and puts it there again.
    pub fn hide(&self) {
        self.display.connection.unmap_window(self.window).expect("a request").check().expect("it is hidden");
    }

    pub fn unhide(&self) {
        self.display.connection.map_window(self.window).expect("a request").check().expect("it is shown");
        self.focus();
    }

    /// Processor time of the program so far.
    pub fn cpu(&self) -> Duration {
        let text = std::fs::read_to_string(format!("/proc/{}/stat", self.program.id())).expect("a process");
        let after_name = text.rsplit(')').next().expect("numbers");
        let numbers: Vec<i64> = after_name.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        // Of the process, from the third on: utime and stime are the 14th and 15th, and the state is no number. In
        // ticks of 10 ms.
        Duration::from_millis(10 * (numbers[10] + numbers[11]) as u64)
    }

    /// Memory in use, in KiB.
    pub fn resident(&self) -> u64 {
        let text = std::fs::read_to_string(format!("/proc/{}/status", self.program.id())).expect("a process");
        let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("a line");
        line.split_whitespace().next().and_then(|number| number.parse().ok()).expect("a number")
    }

    fn fake(&self, kind: u8, detail: u8, [x, y]: [i16; 2]) {
        let connection = &self.display.connection;
        connection.xtest_fake_input(kind, detail, 0, self.display.root, x, y, 0).expect("a request");
        connection.flush().expect("a connection");
        std::thread::sleep(Duration::from_millis(4));
    }

    pub fn point(&self, at: [i16; 2]) {
        self.fake(6, 0, at);
    }

    /// From one place to another with a button held down.
    pub fn drag(&self, button: u8, from: [i16; 2], to: [i16; 2]) {
        self.point(from);
        self.fake(4, button, from);
        for i in 1..=8 {
            let between = |axis: usize| from[axis] + (to[axis] - from[axis]) * i / 8;
            self.point([between(0), between(1)]);
        }
        self.fake(5, button, to);
    }

    pub fn click(&self, button: u8, at: [i16; 2]) {
        self.point(at);
        self.fake(4, button, at);
        self.fake(5, button, at);
    }

    /// A key by its keysym, with another held down or not.
    pub fn key(&self, keysym: u32, with: Option<u32>) {
        let setup = self.display.connection.setup();
        let (first, count) = (setup.min_keycode, setup.max_keycode - setup.min_keycode + 1);
        let map = self.display.connection.get_keyboard_mapping(first, count).expect("a request").reply().expect("keys");
        let per = usize::from(map.keysyms_per_keycode);
        let code = |sym: u32| {
            let place = map.keysyms.iter().position(|&known| known == sym).expect("a key of that name");
            first + (place / per) as u8
        };
        let all: Vec<u8> = with.into_iter().chain([keysym]).map(code).collect();
        all.iter().for_each(|&key| self.fake(2, key, [0, 0]));
        all.iter().rev().for_each(|&key| self.fake(3, key, [0, 0]));
    }

    /// The next line of standard output.
    #[track_caller]
    pub fn line(&self) -> String {
        self.said.recv_timeout(Duration::from_secs(60)).expect("a line within a minute")
    }

    fn message(&self, kind: &str, data: [u32; 5]) {
        let event = ClientMessageEvent::new(32, self.window, self.display.atom(kind), data);
        let connection = &self.display.connection;
        connection.send_event(false, self.window, EventMask::NO_EVENT, event).expect("a request");
        connection.flush().expect("a connection");
    }

    /// Drops a file, as file managers do (XDND, version 5).
    pub fn drop_file(&self, path: &Path) {
        let (display, connection) = (self.display, &self.display.connection);
        let source = connection.generate_id().expect("an id");
        connection
            .create_window(0, source, display.root, 0, 0, 1, 1, 0, WindowClass::INPUT_ONLY, 0, &Default::default())
            .expect("a request");
        let selection = display.atom("XdndSelection");
        connection.set_selection_owner(source, selection, x11rb::CURRENT_TIME).expect("a request");
        let (list, copy) = (display.atom("text/uri-list"), display.atom("XdndActionCopy"));
        self.message("XdndEnter", [source, 5 << 24, list, 0, 0]);
        self.message("XdndPosition", [source, 0, 100 << 16 | 100, 0, copy]);
        let uri = format!("file://{}\r\n", path.display());
        let begun = Instant::now();
        let mut dropped = false;
        while begun.elapsed() < Duration::from_secs(10) {
            match connection.poll_for_event().expect("a connection") {
                Some(Event::SelectionRequest(asked)) => {
                    connection
                        .change_property8(
                            PropMode::REPLACE,
                            asked.requestor,
                            asked.property,
                            asked.target,
                            uri.as_bytes(),
                        )
                        .expect("a request");
                    let answer = SelectionNotifyEvent {
                        response_type: x11rb::protocol::xproto::SELECTION_NOTIFY_EVENT,
                        sequence: 0,
                        time: asked.time,
                        requestor: asked.requestor,
                        selection: asked.selection,
                        target: asked.target,
                        property: asked.property,
                    };
                    connection.send_event(false, asked.requestor, EventMask::NO_EVENT, answer).expect("a request");
                    connection.flush().expect("a connection");
                    if !dropped {
                        dropped = true;
                        self.message("XdndDrop", [source, 0, 0, 0, 0]);
                    }
                }
                Some(Event::ClientMessage(told)) if told.type_ == display.atom("XdndFinished") => return,
                _ => std::thread::sleep(Duration::from_millis(5)),
            }
        }
        panic!("the window did not take what was dropped");
    }

    /// Closes the window, as window managers do; the exit code and what was said.
    pub fn close(mut self) -> (Option<i32>, String) {
        let delete = self.display.atom("WM_DELETE_WINDOW");
        self.message("WM_PROTOCOLS", [delete, 0, 0, 0, 0]);
        let begun = Instant::now();
        while self.program.try_wait().expect("a child").is_none() {
            assert!(begun.elapsed() < Duration::from_secs(60), "the program goes on without its window");
            std::thread::sleep(Duration::from_millis(20));
        }
        let code = self.program.wait().expect("a child").code();
        let mut words = String::new();
        let _ = self.program.stderr.take().expect("a pipe").read_to_string(&mut words);
        (code, words)
    }
}

impl Drop for Viewer<'_> {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}
