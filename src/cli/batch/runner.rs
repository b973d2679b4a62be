//! Does the jobs of a batch: while one renders, the next is prepared and the last one written.
//!
//! Rendering has all the machine's threads to itself, so that its times mean what they mean for `relt render`; what needs few
//! of them, or the disk, happens beside it: reading the next scene, making the picture of the job before, encoding it,
//! waiting until it is on the disk.

use std::any::Any;
use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{
    AtomicBool, AtomicUsize,
    Ordering::{Relaxed, SeqCst},
};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use super::super::display::Display;
use super::super::failure::Failure;
use super::super::{render, signals};
use super::jobs::BatchJob;
use super::progress_in_words;
use super::scenes::Scenes;
use crate::batch::queue::{Event, Found, Queue, Standing, Standings};
use crate::batch::turns::{Turn, Turns};
use crate::path::luminance_of_sums;
use crate::render::progress::{Teller, rough, with_unit};
use crate::render::{Checkpoint, Observer, Status, Verdict, checkpoint};

/// A batch at work.
pub(super) struct Runner<'a> {
    jobs: &'a [BatchJob],
    /// Indices of the jobs to do, in order.
    due: Vec<usize>,
    at_once: usize,
    turns: Turns,
    /// Of the jobs to do, the next that nobody has taken.
    next: AtomicUsize,
    scenes: Scenes,
    queue: &'a Queue,
    display: &'a Display,
    stop: &'a AtomicBool,
    begin: Instant,
    board: Mutex<Board>,
}

/// What changes while jobs are done.
struct Board {
    standings: Standings,
    done: usize,
    failed: usize,
    /// The part that is done of each job that renders, by index.
    parts: BTreeMap<usize, f64>,
    /// Wall time of all turns.
    rendering: Duration,
}

/// How a job ended.
enum End {
    Done(Found),
    Interrupted,
}

impl<'a> Runner<'a> {
    /// To do the jobs that are due, so many at once.
    pub fn new(
        jobs: &'a [BatchJob],
        due: Vec<usize>,
        at_once: usize,
        queue: &'a Queue,
        standings: Standings,
        display: &'a Display,
        stop: &'a AtomicBool,
    ) -> Runner<'a> {
        let scenes = Scenes::new(due.iter().map(|index| &jobs[*index]));
        let board = Board { standings, done: 0, failed: 0, parts: BTreeMap::new(), rendering: Duration::ZERO };
        Runner {
            jobs,
            due,
            at_once,
            turns: Turns::new(at_once),
            next: AtomicUsize::new(0),
            scenes,
            queue,
            display,
            stop,
            begin: Instant::now(),
            board: Mutex::new(board),
        }
    }

    /// Does them; returns the time in which jobs rendered. With `one_by_one` nothing happens beside a job.
    pub fn run(&self, one_by_one: bool) -> Result<Duration, Failure> {
        let workers = if one_by_one { 1 } else { (self.at_once + 1).min(self.due.len().max(1)) };
        let flags = (0..workers).map(|_| signals::checkpoint_flag()).collect::<Result<Vec<_>, _>>()?;
        thread::scope(|threads| {
            for (i, asked) in flags.iter().enumerate() {
                let worker = thread::Builder::new().name(format!("job {i}"));
                let started = worker.spawn_scoped(threads, || self.work(asked));
                if let (0, Err(error)) = (i, started) {
                    return Err(Failure::running(format_args!("cannot start a thread: {error}")));
                }
            }
            Ok(())
        })?;
        Ok(self.board().rendering)
    }

    /// Where a job stands.
    pub fn standing(&self, job: &BatchJob) -> Option<Standing> {
        let standings = &self.board().standings;
        standings.get(&job.entry.name).filter(|standing| standing.digest == job.digest).cloned()
    }

    fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// One job after another until none is left.
    fn work(&self, asked: &Arc<AtomicBool>) {
        loop {
            let number = self.next.fetch_add(1, SeqCst);
            let Some(index) = self.due.get(number) else { return };
            let turn = self.turns.turn(number);
            if !self.stop.load(Relaxed) {
                self.job(*index, &turn, asked);
            }
        }
    }

    /// A job with all that comes of it, whatever that is.
    fn job(&self, index: usize, turn: &Turn, asked: &Arc<AtomicBool>) {
        let job = &self.jobs[index];
        let goes_on = self.prepare(job);
        let begun = AtomicBool::new(false);
        let ended = isolated(|| self.attempt(index, goes_on, turn, asked, &begun));
        turn.end();
        self.scenes.release(job);
        match (&ended, begun.load(Relaxed)) {
            (Ok(_), false) => return, // stopped before it was its turn
            (Err(_), false) => self.note(job, Event::Begun),
            (_, true) => {}
        }
        let name = &job.entry.name;
        let (event, words) = match ended {
            Ok(End::Done(found)) => {
                let (mutations, time) = (with_unit(found.mutations as f64), found.render_seconds);
                let words = format!("{name}: {mutations} mutations in {}", rough(Duration::from_secs_f64(time)));
                (Event::Done(found), words)
            }
            Ok(End::Interrupted) => (Event::Interrupted, format!("{name}: stopped")),
            Err(failure) => {
                let reason = failure.plain();
                let words = format!("{name}: failed: {reason}");
                (Event::Failed { reason }, words)
            }
        };
        let (done, failed) = {
            let mut board = self.board();
            board.parts.remove(&index);
            match event {
                Event::Done(_) => board.done += 1,
                Event::Failed { .. } => board.failed += 1,
                Event::Begun | Event::Interrupted => {}
            }
            (board.done, board.failed)
        };
        match event {
            Event::Failed { .. } => self.display.say(&words),
            _ => self.display.done(&format!("{}/{} {words}", done + failed, self.due.len())),
        }
        let is_done = matches!(event, Event::Done(_));
        self.note(job, event);
        if is_done {
            forget(job); // only now, as the queue knows that there is nothing to go on with
        }
    }

    /// Whether there may be something to go on with. What was done of a job that has changed since is taken away.
    fn prepare(&self, job: &BatchJob) -> bool {
        let before = self.board().standings.get(&job.entry.name).cloned();
        match before {
            Some(before) if before.digest == job.digest => !matches!(before.last, Event::Done(_)),
            Some(_) => {
                forget(job);
                false
            }
            None => false,
        }
    }

    /// Adds to the queue what happened. Work goes on where that cannot be written: at worst it is done again later.
    fn note(&self, job: &BatchJob, event: Event) {
        let (name, digest) = (&job.entry.name, &job.digest);
        if let Err(error) = self.queue.note(name, digest, event.clone()) {
            self.display.say(&format!("warning: {error}"));
        }
        let standings = &mut self.board().standings;
        let before = standings.get(name).filter(|before| before.digest == *digest).map_or(0, |before| before.attempts);
        let attempts = before + u64::from(event == Event::Begun);
        standings.insert(name.clone(), Standing { digest: digest.clone(), attempts, last: event });
    }

    /// From options to files on the disk; `begun` is raised when it renders.
    fn attempt(
        &self,
        index: usize,
        goes_on: bool,
        turn: &Turn,
        asked: &Arc<AtomicBool>,
        begun: &AtomicBool,
    ) -> Result<End, Failure> {
        let job = &self.jobs[index];
        if let Some(folder) = job.entry.output.parent() {
            fs::create_dir_all(folder)
                .map_err(|error| Failure::running(format_args!("cannot make {}: {error}", folder.display())))?;
        }
        let planned = job.arguments(goes_on)?.plan(None)?;
        let strict = planned.arguments.strict;
        let begin = Instant::now();
        let loaded = self.scenes.of(job, &planned.arguments.scene)?;
        let load_seconds = begin.elapsed().as_secs_f64();
        planned.fits(&loaded.opened.scene.film, &loaded.digest)?;

        turn.begin();
        if self.stop.load(Relaxed) {
            return Ok(End::Interrupted);
        }
        begun.store(true, Relaxed);
        self.note(job, Event::Begun);
        let voice = Voice { runner: self, index, turn, begin: Instant::now(), ended: Mutex::new(None) };
        let asked = job.keep.as_ref().map(|_| asked.clone());
        let rendered = planned.render(&loaded.opened, &loaded.digest, asked, self.stop, &voice)?;
        let rendered = rendered.expect("jobs of a batch have no company");
        if rendered.outcome.interrupted {
            return Ok(End::Interrupted);
        }
        let mean_luminance = luminance_of_sums(rendered.outcome.picture.image.mean());
        let summary = rendered.finish()?;
        let ended = voice.ended.lock().unwrap_or_else(PoisonError::into_inner).unwrap_or_else(Instant::now);
        if let Some(failure) = strict.then(|| render::untrusted(&summary.health)).flatten() {
            return Err(failure);
        }
        let verdict = summary.health.verdict;
        if verdict != Verdict::Good {
            summary.health.lines().iter().for_each(|line| voice.say(line));
        }
        Ok(End::Done(Found {
            mutations: summary.status.mutations,
            load_seconds,
            render_seconds: summary.status.elapsed.as_secs_f64(),
            write_seconds: ended.elapsed().as_secs_f64(),
            mean_luminance,
            verdict: verdict.name().into(),
            remarks: summary.warnings.into_iter().chain(summary.health.lines()).collect(),
        }))
    }

    fn show(&self, index: usize, part: f64) {
        let (done, failed, parts) = {
            let mut board = self.board();
            board.parts.insert(index, part);
            (board.done, board.failed, board.parts.values().sum::<f64>())
        };
        let all = self.due.len();
        let whole = ((done + failed) as f64 + parts) / all as f64;
        let words = progress_in_words(done + failed, failed, all, whole, self.begin);
        let stopping = if self.stop.load(Relaxed) { ", stopping (again to quit at once)" } else { "" };
        let name = &self.jobs[index].entry.name;
        self.display.show(whole, format!("{words}{stopping}\n{:.0} % of {name}", 100.0 * part));
    }
}

/// Takes away the checkpoints of a job.
fn forget(job: &BatchJob) {
    for file in job.keep.iter().flat_map(|keep| [keep.clone(), checkpoint::previous(keep)]) {
        drop(fs::remove_file(file)); // mostly there is none
    }
}

/// Does something, and makes a failure of a panic in it, whose place the program has told by then.
fn isolated<T>(job: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(job)).unwrap_or_else(|panic| Err(Failure::running(words_of(panic.as_ref()))))
}

fn words_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    format!("panicked: {}", text.unwrap_or("without a message"))
}

/// Who follows one job.
struct Voice<'a> {
    runner: &'a Runner<'a>,
    index: usize,
    turn: &'a Turn<'a>,
    /// When it began to render.
    begin: Instant,
    /// When its last mutation was done.
    ended: Mutex<Option<Instant>>,
}

impl Observer for Voice<'_> {
    fn progress(&self, status: &Status) {
        self.runner.show(self.index, status.fraction());
    }

    fn ended(&self, _checkpoint: &Checkpoint) {
        *self.ended.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        self.runner.board().rendering += self.begin.elapsed();
        // what is left to do needs few threads: the next one may begin
        self.turn.end();
    }
}

impl Teller for Voice<'_> {
    fn say(&self, words: &str) {
        let name = &self.runner.jobs[self.index].entry.name;
        self.runner.display.say(&format!("{name}: {words}"));
    }
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::*;

    #[test]
    fn a_panic_anywhere_in_a_job_is_its_failure() {
        let plain = |ended: Result<(), Failure>| ended.unwrap_err().plain();
        assert_eq!(plain(isolated(|| panic!("at {}", 3))), "panicked: at 3");
        assert_eq!(plain(isolated(|| std::panic::panic_any(3))), "panicked: without a message");
        assert_eq!(plain(isolated(|| Err(Failure::running("no room")))), "no room");
        let threads = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let of_a_thread = || {
            threads.install(|| (0..8).into_par_iter().for_each(|i| assert!(i < 5, "the {i}th")));
            Ok(())
        };
        assert!(plain(isolated(of_a_thread)).starts_with("panicked: the "));
        assert!(isolated(|| Ok(())).is_ok());
    }
}
