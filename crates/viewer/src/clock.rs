//! Animation time of the viewer: stopped, played in a loop, or set by hand.

/// Resolution of the time in seconds; keeps `--time` in copied commands short.
const STEP: f64 = 1e-3;

/// Animation time of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// Seconds; `None` is the time of the command line, or the rest pose.
    pub time: Option<f64>,
    /// Time of the command line in seconds; `None` is the rest pose.
    pub rest: Option<f64>,
    /// Whether the animation plays.
    pub playing: bool,
    /// Seconds of the animation per second.
    pub speed: f64,
    /// Whether it begins again at its end.
    pub repeats: bool,
}

impl Default for Clock {
    fn default() -> Self {
        Self { time: None, rest: None, playing: false, speed: 1.0, repeats: true }
    }
}

impl Clock {
    /// The shown time in seconds; 0 for the rest pose.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.time.or(self.rest).unwrap_or_default()
    }

    /// Stops, and returns to the time of the command line.
    pub fn stop(&mut self) {
        (self.time, self.playing) = (None, false);
    }

    /// Plays or pauses; at the end of what does not repeat, it plays from the beginning.
    pub fn toggle(&mut self, duration: f64) {
        self.playing = !self.playing;
        if self.playing && !self.repeats && self.seconds() >= duration {
            self.time = Some(0.0);
        }
    }

    /// Sets the time in seconds, clamped to 0 … `duration` and rounded to milliseconds.
    pub fn set(&mut self, seconds: f64, duration: f64) {
        let steps = (seconds.clamp(0.0, duration) / STEP).round();
        self.time = Some(steps / STEP.recip());
    }

    /// Advances a playing clock by some seconds of the user's time; after `duration` it starts again at 0, or stops.
    pub fn advance(&mut self, seconds: f64, duration: f64) {
        if self.playing && duration > 0.0 {
            let at = self.seconds() + seconds * self.speed;
            self.playing = self.repeats || at < duration;
            self.set(if self.repeats { at.rem_euclid(duration) } else { at }, duration);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_in_a_circle_and_in_short_words() {
        let mut clock = Clock::default();
        clock.advance(0.3, 2.0);
        assert_eq!(clock.time, None, "it stands");
        clock.playing = true;
        (0..7).for_each(|_| clock.advance(0.333_333, 2.0));
        assert_eq!(clock.time.map(|time| time.to_string()), Some("0.331".to_owned()));
        clock.set(9.0, 2.0);
        assert_eq!(clock.time, Some(2.0));
        clock.advance(0.1, 0.0);
        assert_eq!(clock.time, Some(2.0), "what lasts no time stands");
        clock.stop();
        assert_eq!(clock, Clock::default());
        (clock.playing, clock.speed, clock.repeats) = (true, 4.0, false);
        clock.advance(0.1, 2.0);
        assert_eq!(clock.time, Some(0.4));
        clock.advance(1.0, 2.0);
        assert_eq!((clock.time, clock.playing), (Some(2.0), false), "once");
        clock.toggle(2.0);
        assert_eq!((clock.time, clock.playing), (Some(0.0), true), "and again");
        clock.advance(0.1, 2.0);
        clock.toggle(2.0);
        assert_eq!((clock.time, clock.playing), (Some(0.4), false), "paused");
    }

    #[test]
    fn it_goes_on_from_the_time_of_the_command_line() {
        let mut clock = Clock { rest: Some(1.5), playing: true, ..Clock::default() };
        assert_eq!(clock.seconds(), 1.5);
        clock.advance(0.25, 2.0);
        assert_eq!(clock.time, Some(1.75));
        clock.stop();
        assert_eq!((clock.time, clock.seconds()), (None, 1.5));
    }
}
