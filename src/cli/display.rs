//! What a person sees of many runs: a line that moves on a terminal, one for each run elsewhere.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// What the person sees.
pub(super) enum Display {
    Quiet,
    /// A line that is drawn again and again.
    Terminal(ProgressBar),
    /// A line for each finished run.
    Plain,
}

impl Display {
    pub fn new(quiet: bool) -> Display {
        match (quiet, io::stderr().is_terminal()) {
            (true, _) => Display::Quiet,
            (_, false) => Display::Plain,
            _ => {
                let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr());
                bar.set_style(ProgressStyle::with_template("{bar:24} {msg}").expect("a template known to be right"));
                Display::Terminal(bar)
            }
        }
    }

    /// Words that stay.
    pub fn say(&self, words: &str) {
        match self {
            Display::Quiet => {}
            Display::Terminal(bar) => bar.suspend(|| drop(writeln!(io::stderr(), "{words}"))),
            Display::Plain => drop(writeln!(io::stderr(), "{words}")),
        }
    }

    /// A run is over.
    pub fn done(&self, words: &str) {
        match self {
            Display::Terminal(bar) => bar.set_position(0),
            display => display.say(words),
        }
    }

    /// Nothing more is shown.
    pub fn finish(&self) {
        if let Display::Terminal(bar) = self {
            bar.finish_and_clear();
        }
    }

    /// How far it is, 0 to 1, for those who see a line that is drawn again.
    pub fn show(&self, part: f64, words: String) {
        if let Display::Terminal(bar) = self {
            bar.set_position((1000.0 * part) as u64);
            bar.set_message(words);
        }
    }
}

/// A time to two places, as people say it.
pub(super) fn in_words(time: Duration) -> String {
    match time.as_secs_f64() {
        seconds @ ..100.0 => format!("{seconds:.0} s"),
        seconds @ ..6000.0 => format!("{:.0} min", seconds / 60.0),
        seconds => format!("{:.1} h", seconds / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_read_well() {
        let words = [3.2, 99.0, 150.0, 7200.0].map(|seconds| in_words(Duration::from_secs_f64(seconds)));
        assert_eq!(words, ["3 s", "99 s", "2 min", "2.0 h"]);
    }
}
