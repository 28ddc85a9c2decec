//! How far something is.

use std::io::IsTerminal as _;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::options::When;
use etalon::frame::Progress;

/// Steps as a bar on a terminal, as lines elsewhere, or not at all.
pub(super) struct Steps {
    bar: Option<ProgressBar>,
    lines: bool,
}

impl Steps {
    pub(super) fn new(progress: When, quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let shown = !quiet && progress != When::Never;
        let bar = (shown && (terminal || progress == When::Always)).then(|| {
            let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr());
            let style = ProgressStyle::with_template("{msg:<24} {wide_bar} {pos}/{len} {elapsed}, {eta} left");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Self { lines: shown && bar.is_none(), bar }
    }

    pub(super) fn step(&self, message: &str, of: u32) {
        if let Some(bar) = &self.bar {
            bar.set_message(message.to_owned());
            bar.set_length(u64::from(of));
            bar.set_position(0);
        }
        if self.lines {
            eprintln!("{message}");
        }
    }

    /// How far a picture is. Where there is no bar, a line at powers of two, no more often than once a second.
    pub(super) fn sampled(&self, progress: Progress, begun: Instant, last: &mut Instant) {
        self.at(progress.done);
        let Some(error) = progress.error else { return };
        let relative = error.relmse.sqrt() * 100.0;
        if let Some(bar) = &self.bar {
            bar.set_message(format!("drawing, error {relative:.2} %"));
        }
        if self.lines && last.elapsed().as_secs() >= 1 {
            *last = Instant::now();
            let left =
                begun.elapsed().as_secs_f64() / f64::from(progress.done) * f64::from(progress.of - progress.done);
            eprintln!("{} of {} samples, error {relative:.2} %, {left:.0} s left at most", progress.done, progress.of);
        }
    }

    /// One of many pictures.
    pub(super) fn of(&self, name: &str, done: usize, of: usize, left_s: f64) {
        let left = format!("about {left_s:.0} s left");
        if let Some(bar) = &self.bar {
            bar.set_message(format!("{name}, {left}"));
            bar.set_length(of as u64);
            bar.set_position(done as u64);
        }
        if self.lines {
            eprintln!("{} of {of}: {name}, {left}", done + 1);
        }
    }

    pub(super) fn at(&self, position: u32) {
        if let Some(bar) = &self.bar {
            bar.set_position(u64::from(position));
        }
    }

    /// The same, unless nothing is to be said.
    pub(super) fn tell(&self, line: &str) {
        if self.bar.is_some() || self.lines {
            self.say(line);
        }
    }

    /// A line that stays, whatever the bar does.
    pub(super) fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
