//! What the person at the keyboard sees while a reference is made: error so far, passes and time left.

use std::collections::HashSet;
use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::reference::{FEWEST_PASSES, Passes, Recipe, counted};
use crate::render::progress::{rough, significant};

/// Shows on standard error how far it is.
pub struct ReferenceProgress {
    target: f64,
    begin: Instant,
    /// Passes that were there at the beginning.
    before: u64,
    quiet: bool,
    /// On a terminal: a line that is drawn again and again. Elsewhere lines that stay.
    bar: Option<ProgressBar>,
    state: Mutex<Shown>,
}

struct Shown {
    /// Passes so far, and how many it takes, as far as can be told.
    passes: u64,
    needed: Option<f64>,
    /// What is said about them.
    words: String,
    /// Passes at which the next line that stays is due.
    due: u64,
    /// Warnings that were told.
    warnings: HashSet<String>,
}

const BAR_STEPS: u64 = 1000;

impl ReferenceProgress {
    /// Shows nothing if `quiet`. There are `passes` already, and it began at `begin`.
    pub fn new(quiet: bool, target: f64, passes: &Passes, begin: Instant) -> ReferenceProgress {
        let bar = (!quiet && io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::with_draw_target(Some(BAR_STEPS), ProgressDrawTarget::stderr());
            bar.set_style(ProgressStyle::with_template("{bar:24} {msg}").expect("a template known to be right"));
            bar
        });
        let state = Shown {
            passes: passes.number(),
            needed: None,
            words: "first pass".into(),
            due: passes.number() + 1,
            warnings: HashSet::new(),
        };
        ReferenceProgress { target, begin, before: passes.number(), quiet, bar, state: Mutex::new(state) }
    }

    fn state(&self) -> MutexGuard<'_, Shown> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A line that stays.
    pub fn say(&self, words: &str) {
        let say = || drop(writeln!(io::stderr(), "{words}")); // nobody may be listening
        match &self.bar {
            _ if self.quiet => {}
            Some(bar) => bar.suspend(say),
            None => say(),
        }
    }

    /// What a pass warned of; the same words only once.
    pub fn warn(&self, pass: u64, warning: &str) {
        if self.state().warnings.insert(warning.to_owned()) {
            self.say(&format!("warning: pass {}: {warning}", pass + 1));
        }
    }

    /// The work begins.
    pub fn begun(&self, recipe: &Recipe, passes: &Passes) {
        let Recipe { scene, width, height, method, mapping, mutations_per_pixel: mpp, .. } = recipe;
        let words =
            format!("{scene}: {width} × {height}, passes of {mpp} mutations per pixel by {method}, {mapping} mapping");
        match passes.number() {
            0 => self.say(&words),
            n => self.say(&format!("{words}, going on after {}", counted(n))),
        }
    }

    /// A pass was added.
    pub fn added(&self, passes: &Passes) {
        let words = self.progress(passes);
        let line = {
            let mut state = self.state();
            state.passes = passes.number();
            state.needed = self.needed(passes);
            state.words = words.clone();
            let line = self.bar.is_none() && state.passes >= state.due;
            if line {
                state.due = state.passes + (state.passes / 4).max(1); // a night's worth of lines stays short
            }
            line
        };
        if line {
            self.say(&words);
        } else {
            self.within_pass(0.0, false);
        }
    }

    /// `12 of about 40 passes, relMSE 3.2e-4 (halves 2.9e-4), 43 s left`
    fn progress(&self, passes: &Passes) -> String {
        let Some(error) = passes.own_error() else { return counted(passes.number()) };
        let needed = self.needed(passes).filter(|needed| needed.is_finite());
        let rate = (passes.number() - self.before) as f64 / self.begin.elapsed().as_secs_f64();
        let left = needed.and_then(|needed| {
            Duration::try_from_secs_f64(((needed - passes.number() as f64).max(0.0)) / rate).ok() // none past all ages
        });
        let of = needed.map(|needed| format!(" of about {needed:.0}")).unwrap_or_default();
        format!(
            "{}{of} passes, relMSE {} (halves {}){}",
            passes.number(),
            significant(error.by_spread, 3),
            significant(error.by_halves, 3),
            left.map(|left| format!(", {} left", rough(left))).unwrap_or_default()
        )
    }

    /// Passes that it takes, as the error falls like one over their number.
    fn needed(&self, passes: &Passes) -> Option<f64> {
        let needed = passes.number() as f64 * passes.own_error()?.rel_mse() / self.target;
        Some(needed.ceil().max(FEWEST_PASSES as f64).max(passes.number() as f64))
    }

    /// A part of the next pass is done; `stopping`: and no more will be.
    pub fn within_pass(&self, fraction: f64, stopping: bool) {
        let Some(bar) = &self.bar else { return };
        let state = self.state();
        let share = state.needed.map_or(0.0, |needed| (state.passes as f64 + fraction) / needed);
        bar.set_position((share.min(1.0) * BAR_STEPS as f64) as u64);
        let stopping = if stopping { ", stopping (again to quit at once)" } else { "" };
        bar.set_message(format!("{}{stopping}", state.words));
    }

    /// The work is over and these files are written.
    pub fn ended(&self, passes: &Passes, files: Vec<PathBuf>) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        if files.is_empty() {
            return;
        }
        let error = passes.own_error().map_or("own error unknown".into(), |error| {
            let [spread, halves] = [error.by_spread, error.by_halves].map(|value| significant(value, 3));
            format!("own relMSE {spread} by their spread, {halves} by their halves (target {})", self.target)
        });
        let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        let (number, time) = (counted(passes.number()), rough(self.begin.elapsed()));
        self.say(&format!("{number}, {error}, in {time}; wrote {}", files.join(", ")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Image;

    /// Passes of one pixel that is 0, 0, 1, 1, 0, 0 and so on: relMSE is 0.5²/(n − 1)/0.26 for n a multiple of 4.
    fn passes(n: u64) -> Passes {
        let mut passes = Passes::new(1, 1);
        (0..n).for_each(|i| passes.add(&Image::constant(1, 1, [(i / 2 % 2) as f32; 3])));
        passes
    }

    #[test]
    fn the_error_falls_like_one_over_passes() {
        let before = Passes::new(1, 1);
        let begin = Instant::now() - Duration::from_secs(12);
        let error = passes(12).own_error().unwrap().rel_mse();
        let of = |target: f64| ReferenceProgress::new(true, target, &before, begin).progress(&passes(12));
        assert!(of(error / 4.0).starts_with("12 of about 48 passes, relMSE 0.0874 (halves "), "{}", of(error / 4.0));
        assert!(of(error / 4.0).ends_with(", 36 s left"), "{}", of(error / 4.0));
        assert!(of(2.0 * error).contains("12 of about 12 passes") && of(2.0 * error).ends_with(", 0.0 s left"));
        let few = ReferenceProgress::new(true, 9.0, &before, begin).progress(&passes(4));
        assert!(few.starts_with("4 of about 8 passes"), "{few}");
        assert_eq!(ReferenceProgress::new(true, 1.0, &before, begin).progress(&passes(1)), "1 pass");
    }
}
