//! Progress messages on stderr: a bar, plain lines, JSON lines, or the messages of Open Job Description.

use std::cell::Cell;
use std::io::IsTerminal as _;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::json;

use super::print;
use etalon::frame::Progress;

/// Form of the progress messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ProgressForm {
    /// A bar on a terminal, a line per step elsewhere
    Auto,
    /// A bar, even without a terminal
    Always,
    /// Nothing
    Never,
    /// A line per step
    Plain,
    /// A line of JSON per step on standard error: a status, or the progress from 0 to 1 and the seconds left
    Json,
    /// Messages of Open Job Description on standard output: openjd_status, openjd_progress, openjd_fail
    Openjd,
}

/// Least time between two progress lines.
const PAUSE: Duration = Duration::from_secs(1);

/// A bar for `of` parts of a step. A step of one part has no count, and nothing to estimate its end by.
fn bar_style(of: u32) -> ProgressStyle {
    let template = if of > 1 { "{msg:<24} {wide_bar} {pos}/{len} {elapsed}, {eta} left" } else { "{msg} {elapsed}" };
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// Prints the steps of a command in one of the forms of [`ProgressForm`].
pub(super) struct Steps {
    form: ProgressForm,
    bar: Option<ProgressBar>,
    begun: Instant,
    told: Cell<Option<Instant>>,
    /// Start and length of the current picture, as fractions of the whole work.
    share: Cell<[f64; 2]>,
}

impl Steps {
    pub(super) fn new(form: ProgressForm, quiet: bool) -> Self {
        let form = match form {
            ProgressForm::Json | ProgressForm::Openjd => form,
            _ if quiet => ProgressForm::Never,
            ProgressForm::Auto if std::io::stderr().is_terminal() => ProgressForm::Always,
            ProgressForm::Auto => ProgressForm::Plain,
            form => form,
        };
        let bar = (form == ProgressForm::Always).then(|| {
            let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr());
            bar.set_style(bar_style(1));
            bar
        });
        Self { form, bar, begun: Instant::now(), told: Cell::new(None), share: Cell::new([0.0, 1.0]) }
    }

    pub(super) fn step(&self, message: &str, of: u32) {
        if let Some(bar) = &self.bar {
            bar.set_style(bar_style(of));
            bar.set_message(message.to_owned());
            bar.set_length(u64::from(of));
            bar.set_position(0);
        }
        match self.form {
            ProgressForm::Plain => eprintln!("{message}"),
            ProgressForm::Json => eprintln!("{}", json!({ "status": message })),
            // A closed pipe does not stop the work.
            ProgressForm::Openjd => drop(print(&format!("openjd_status: {message}"))),
            _ => {}
        }
    }

    /// The following work is the fraction `share` of the whole, starting at the fraction `from`.
    pub(super) fn is_share(&self, from: f64, share: f64) {
        self.share.set([from, share]);
    }

    /// Reports the finished fraction of the current share, at most once a second.
    pub(super) fn done(&self, share: f64) {
        let [from, of] = self.share.get();
        let done = (from + of * share).clamp(0.0, 1.0);
        let pauses = self.told.get().is_some_and(|told| told.elapsed() < PAUSE) && done < 1.0;
        if pauses || !matches!(self.form, ProgressForm::Json | ProgressForm::Openjd) {
            return;
        }
        self.told.set(Some(Instant::now()));
        let left_s = self.begun.elapsed().as_secs_f64() * (1.0 - done) / done.max(1e-9);
        match self.form {
            ProgressForm::Json => eprintln!("{}", json!({ "progress": done, "left_s": left_s })),
            _ => drop(print(&format!("openjd_progress: {:.1}", 100.0 * done))),
        }
    }

    /// Reports the samples and the estimated error of a picture. Without a bar it is a line at powers of two, at most
    /// once a second.
    pub(super) fn sampled(&self, progress: Progress, begun: Instant, last: &mut Instant) {
        self.at(progress.done);
        self.done(f64::from(progress.done) / f64::from(progress.of.max(1)));
        let Some(error) = progress.error else { return };
        let relative = error.relmse.sqrt() * 100.0;
        if let Some(bar) = &self.bar {
            bar.set_message(format!("drawing, estimated error {relative:.1} %"));
        }
        if self.form == ProgressForm::Plain && last.elapsed() >= PAUSE {
            *last = Instant::now();
            let left =
                begun.elapsed().as_secs_f64() / f64::from(progress.done) * f64::from(progress.of - progress.done);
            eprintln!(
                "{}/{} samples, estimated error {relative:.1} %, at most {left:.0} s left",
                progress.done, progress.of
            );
        }
    }

    /// Reports that picture `done + 1` of `of` begins, with the seconds left for all.
    pub(super) fn of(&self, name: &str, done: usize, of: usize, left_s: f64) {
        let left = format!("about {left_s:.0} s left");
        if let Some(bar) = &self.bar {
            bar.set_style(bar_style(of as u32));
            bar.set_message(format!("{name}, {left}"));
            bar.set_length(of as u64);
            bar.set_position(done as u64);
        }
        if self.form == ProgressForm::Plain {
            eprintln!("{} of {of}: {name}, {left}", done + 1);
        }
        self.is_share(done as f64 / of.max(1) as f64, 1.0 / of.max(1) as f64);
        self.done(0.0);
    }

    pub(super) fn at(&self, position: u32) {
        if let Some(bar) = &self.bar {
            bar.set_position(u64::from(position));
        }
    }

    /// Prints a line as [`Steps::say`] does, if the form has a bar or plain lines.
    pub(super) fn tell(&self, line: &str) {
        if self.bar.is_some() || self.form == ProgressForm::Plain {
            self.say(line);
        }
    }

    /// Prints a line that stays above the bar.
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
