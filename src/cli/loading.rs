//! What a person sees who waits for a large scene: after a second, on a terminal, a line that tells how far it is.

use std::io::{self, IsTerminal};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::load::Watch;

/// What loads sooner is shown by what follows it.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between two drawings of the line.
const BEAT: Duration = Duration::from_millis(100);
/// Steps of the bar.
const BAR_STEPS: u64 = 1000;

/// How far some work has come: the part that is done, 0 to 1, and what it is.
pub(super) trait Stage: Sync {
    fn state(&self) -> (f64, String);
}

/// Reading files.
impl Stage for Watch {
    fn state(&self) -> (f64, String) {
        let (read, expected) = self.bytes();
        // files may have grown since they were counted
        let (part, of) = (read as f64, read.max(expected).max(1) as f64);
        (part / of, format!("reading meshes, {:.0} of {:.0} MB", part / 1e6, of / 1e6))
    }
}

/// Building the hierarchy over a number of triangles.
pub(super) struct Building {
    pub triangles: usize,
    /// Bits of the part that is done.
    part: AtomicU64,
}

impl Building {
    pub fn new(triangles: usize) -> Building {
        Building { triangles, part: AtomicU64::new(0) }
    }

    /// Takes in the part that is done. Of what comes out of order the largest counts: a bar does not go backwards.
    pub fn tell(&self, part: f64) {
        self.part.fetch_max(part.clamp(0.0, 1.0).to_bits(), Relaxed); // bits of positive numbers are ordered as they are
    }
}

impl Stage for Building {
    fn state(&self) -> (f64, String) {
        let part = f64::from_bits(self.part.load(Relaxed));
        (part, format!("building the hierarchy over {:.1} million triangles", self.triangles as f64 / 1e6))
    }
}

/// Does the work, and meanwhile shows its stage if that is wanted and somebody can see it.
pub(super) fn shown<T>(is_wanted: bool, stage: &dyn Stage, work: impl FnOnce() -> T) -> T {
    if !is_wanted || !io::stderr().is_terminal() {
        return work();
    }
    thread::scope(|threads| {
        let (end, ended) = mpsc::channel::<()>();
        threads.spawn(move || show(stage, &ended));
        let result = work();
        drop(end);
        result
    })
}

/// Draws the line until the other end of the channel is gone.
fn show(stage: &dyn Stage, ended: &Receiver<()>) {
    if ended.recv_timeout(PATIENCE) != Err(RecvTimeoutError::Timeout) {
        return;
    }
    let bar = ProgressBar::with_draw_target(Some(BAR_STEPS), ProgressDrawTarget::stderr());
    bar.set_style(ProgressStyle::with_template("{bar:24} {msg}").expect("a template known to be right"));
    loop {
        let (part, words) = stage.state();
        bar.set_position((part * BAR_STEPS as f64) as u64);
        bar.set_message(words);
        if ended.recv_timeout(BEAT) != Err(RecvTimeoutError::Timeout) {
            break;
        }
    }
    bar.finish_and_clear();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_that_is_built_only_grows() {
        let building = Building::new(2_500_000);
        for (told, expected) in [(0.25, 0.25), (0.125, 0.25), (0.5, 0.5), (7.0, 1.0)] {
            building.tell(told);
            assert_eq!(building.state(), (expected, "building the hierarchy over 2.5 million triangles".to_owned()));
        }
    }

    #[test]
    fn nothing_to_read_is_a_state_too() {
        assert_eq!(Watch::default().state(), (0.0, "reading meshes, 0 of 0 MB".to_owned()));
    }
}
