//! What the person at the keyboard sees of a run: a line that moves on a terminal, a few plain ones elsewhere.

use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::settings::{LadderChoice, Method};
use super::status::{Observer, RunStart, Status, Summary};

/// Shows a run on standard error.
pub struct Progress {
    stop: Arc<AtomicBool>,
    display: Display,
}

enum Display {
    /// Only [`Progress::say`]'s words, and those not.
    Quiet,
    /// A line that is drawn again and again.
    Terminal(ProgressBar),
    /// Lines that stay, for files and pipes: no escape codes.
    Plain(Mutex<Plain>),
}

struct Plain {
    file: Box<dyn Write + Send>,
    /// Tenths of the budget that have been told.
    tenths: u32,
    /// When the last line was written.
    last: Duration,
}

/// Steps of the bar on a terminal.
const BAR_STEPS: u64 = 1000;
/// Plain lines are this far apart at least.
const PLAIN_GAP: Duration = Duration::from_secs(1);

impl Progress {
    /// Shows on standard error what suits it, or nothing if `quiet`. `stop` is raised once the run is to end early.
    pub fn new(quiet: bool, stop: Arc<AtomicBool>) -> Progress {
        if quiet {
            return Progress { stop, display: Display::Quiet };
        }
        if !io::stderr().is_terminal() {
            return Progress::plain(io::stderr(), stop);
        }
        let bar = ProgressBar::with_draw_target(Some(BAR_STEPS), ProgressDrawTarget::stderr());
        bar.set_style(ProgressStyle::with_template("{bar:24} {msg}").expect("a template known to be right"));
        Progress { stop, display: Display::Terminal(bar) }
    }

    /// Plain lines to anything that can be written to.
    pub fn plain(file: impl Write + Send + 'static, stop: Arc<AtomicBool>) -> Progress {
        let plain = Plain { file: Box::new(file), tenths: 0, last: Duration::ZERO };
        Progress { stop, display: Display::Plain(Mutex::new(plain)) }
    }

    /// A line that stays.
    pub fn say(&self, words: &str) {
        match &self.display {
            Display::Quiet => {}
            Display::Terminal(bar) => bar.suspend(|| drop(writeln!(io::stderr(), "{words}"))),
            // Nobody may be listening; that is no reason to stop rendering.
            Display::Plain(plain) => drop(writeln!(locked(plain).file, "{words}")),
        }
    }
}

fn locked(plain: &Mutex<Plain>) -> std::sync::MutexGuard<'_, Plain> {
    plain.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Observer for Progress {
    fn started(&self, start: &RunStart) {
        if let Display::Terminal(bar) = &self.display {
            bar.set_message("starting");
        }
        self.say(&heading(start));
    }

    fn progress(&self, status: &Status) {
        let stopping = if self.stop.load(Relaxed) { ", stopping (again to quit at once)" } else { "" };
        match &self.display {
            Display::Quiet => {}
            Display::Terminal(bar) => {
                bar.set_position((status.fraction() * BAR_STEPS as f64) as u64);
                let rates = rates(status).map(|rates| format!("\n{rates}")).unwrap_or_default();
                bar.set_message(pace(status) + stopping + &rates); // two lines fit 80 columns, one would not
            }
            Display::Plain(plain) => {
                let mut plain = locked(plain);
                let tenths = (status.fraction() * 10.0) as u32;
                // The last tenth is the end, which `finished` tells.
                if tenths > plain.tenths && tenths < 10 && status.elapsed >= plain.last + PLAIN_GAP {
                    plain.tenths = tenths;
                    plain.last = status.elapsed;
                    drop(writeln!(plain.file, "{}{stopping}", line(status)));
                }
            }
        }
    }

    fn finished(&self, summary: &Summary) {
        if let Display::Terminal(bar) = &self.display {
            bar.finish_and_clear();
        }
        self.say(&ending(summary));
    }
}

/// `scenes/door/scene.xml: 256 × 256, replica exchange with 4 replicas, 64 mutations per pixel, 2 threads`
pub fn heading(start: &RunStart) -> String {
    let settings = &start.settings;
    let mut words = vec![format!("{}: {} × {}", start.scene, start.width, start.height)];
    match settings.method {
        Method::Path => words.push("path tracing".into()),
        Method::Mlt => words.push("Metropolis".into()),
        Method::ReplicaExchange => {
            let replicas = match &settings.ladder {
                LadderChoice::Replicas(k) => *k as usize,
                LadderChoice::Betas(betas) => betas.len(),
            };
            words.push(format!("replica exchange with {replicas} replicas"));
        }
    }
    let mpp = settings.mutations_per_pixel.map(|mpp| format!("{mpp} mutations per pixel"));
    let time = settings.time.map(|time| humantime::format_duration(time).to_string());
    match (mpp, time) {
        (Some(mpp), Some(time)) => words.push(format!("{mpp} or {time}")),
        (mpp, time) => words.extend(mpp.or(time)),
    }
    words.push(format!("{} thread{}", start.threads, if start.threads == 1 { "" } else { "s" }));
    words.join(", ")
}

/// ` 42.0 %, 1.23 M mutations/s, 12 s left, acceptance 0.43, swaps 0.61–0.70`
pub fn line(status: &Status) -> String {
    [Some(pace(status)), rates(status)].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// ` 42.0 %, 1.23 M mutations/s, 12 s left`
fn pace(status: &Status) -> String {
    let mut words = vec![
        format!("{:5.1} %", 100.0 * status.fraction()),
        format!("{} mutations/s", with_unit(status.mutations_per_second())),
    ];
    words.extend(status.time_left().map(|left| format!("{} left", rough(left))));
    words.join(", ")
}

/// `acceptance 0.43, swaps 0.61–0.70`; `None` without chains and before they move.
fn rates(status: &Status) -> Option<String> {
    if status.acceptance.iter().all(|rate| *rate == 0.0) {
        return None;
    }
    let acceptance = span(&status.acceptance).map(|rates| format!("acceptance {rates}"));
    let swaps = span(&status.swap).map(|rates| format!("swaps {rates}"));
    Some(acceptance.into_iter().chain(swaps).collect::<Vec<_>>().join(", "))
}

/// What is said at the end: files, effort, warnings.
pub fn ending(summary: &Summary) -> String {
    let status = &summary.status;
    let mut lines = Vec::new();
    if summary.interrupted {
        lines.push(format!("interrupted: the image holds what was done, {:.1} %", 100.0 * status.fraction()));
    }
    if status.non_finite > 0 {
        lines.push(format!("warning: {} contributions were not finite and count as black", status.non_finite));
    }
    lines.extend(summary.warnings.iter().map(|warning| format!("warning: {warning}")));
    let files: Vec<String> = summary.outputs.iter().map(|path| path.display().to_string()).collect();
    lines.push(format!(
        "{} mutations in {} ({}/s); wrote {}",
        with_unit(status.mutations as f64),
        rough(status.elapsed),
        with_unit(status.mutations_per_second()),
        if files.is_empty() { "nothing".into() } else { files.join(" and ") },
    ));
    lines.join("\n")
}

/// Three digits and a power of thousand: `950`, `1.23 k`, `45.6 M`.
fn with_unit(value: f64) -> String {
    // From this on a number would be rounded to one of four digits and belongs to the next unit.
    const NEXT: f64 = 999.5;
    let (mut value, mut unit) = (value, "");
    for next in [" k", " M", " G", " T"] {
        if value < NEXT {
            break;
        }
        (value, unit) = (value / 1000.0, next);
    }
    let decimals = match value {
        _ if unit.is_empty() => 0,
        ..9.995 => 2,
        ..99.95 => 1,
        _ => 0,
    };
    format!("{value:.decimals$}{unit}")
}

/// `0.4 s`, `12 s`, `3 min 05 s`, `2 h 07 min`.
fn rough(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    let whole = seconds.round() as u64;
    match whole {
        _ if seconds < 9.95 => format!("{seconds:.1} s"),
        0..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole % 3600 / 60),
    }
}

/// The finite ones of some rates from the lowest to the highest, `0.31–0.52`; `None` where there is none.
fn span(rates: &[f64]) -> Option<String> {
    let finite = || rates.iter().copied().filter(|rate| rate.is_finite());
    let (low, high) = (finite().reduce(f64::min)?, finite().reduce(f64::max)?);
    let (low, high) = (format!("{low:.2}"), format!("{high:.2}"));
    Some(if low == high { low } else { format!("{low}–{high}") })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::settings::Settings;

    #[test]
    fn numbers_have_three_digits() {
        let expected = [
            (0.0, "0"),
            (999.4, "999"),
            (999.6, "1.00 k"),
            (1234.0, "1.23 k"),
            (45_600.0, "45.6 k"),
            (1_230_000.0, "1.23 M"),
            (999_600.0, "1.00 M"),
            (7.89e9, "7.89 G"),
            (1e16, "10000 T"),
        ];
        for (value, text) in expected {
            assert_eq!(with_unit(value), text, "{value}");
        }
    }

    #[test]
    fn times_are_rough() {
        let expected =
            [(0.42, "0.4 s"), (9.96, "10 s"), (59.6, "1 min 00 s"), (185.0, "3 min 05 s"), (7620.0, "2 h 07 min")];
        for (seconds, text) in expected {
            assert_eq!(rough(Duration::from_secs_f64(seconds)), text);
        }
    }

    #[test]
    fn a_line_tells_all_that_is_known() {
        let mut status = Status {
            elapsed: Duration::from_secs(10),
            mutations: 12_300_000,
            target_mutations: Some(49_200_000),
            ..Status::default()
        };
        assert_eq!(line(&status), " 25.0 %, 1.23 M mutations/s, 30 s left");
        status.acceptance = vec![0.434];
        status.swap = vec![0.61, 0.5, f64::NAN];
        assert_eq!(line(&status), " 25.0 %, 1.23 M mutations/s, 30 s left, acceptance 0.43, swaps 0.50–0.61");
    }

    #[test]
    fn plain_lines_come_at_tenths_and_hold_no_escape_codes() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let progress = Progress::plain(path.reopen().unwrap(), Arc::default());
        progress.started(&RunStart {
            scene: "door.xml".into(),
            width: 4,
            height: 3,
            threads: 2,
            settings: Settings {
                ladder: LadderChoice::Replicas(4),
                time: Some(Duration::from_secs(90)),
                ..Settings::default()
            },
            ..RunStart::default()
        });
        for step in 0..=1000 {
            let elapsed = Duration::from_millis(90 * step);
            progress.progress(&Status { elapsed, time_budget: Some(Duration::from_secs(90)), ..Status::default() });
        }
        progress.finished(&Summary { outputs: vec!["a.exr".into(), "a.png".into()], ..Summary::default() });
        let text = std::fs::read_to_string(path.path()).unwrap();
        assert!(!text.contains('\x1b') && !text.contains('\r'), "{text}");
        assert_eq!(
            text.lines().next(),
            Some("door.xml: 4 × 3, replica exchange with 4 replicas, 64 mutations per pixel or 1m 30s, 2 threads")
        );
        assert_eq!(text.lines().count(), 1 + 9 + 1, "{text}");
        assert!(text.lines().last().unwrap().ends_with("wrote a.exr and a.png"), "{text}");
    }

    #[test]
    fn the_end_names_what_went_wrong() {
        let summary = Summary {
            status: Status { non_finite: 3, target_mutations: Some(100), mutations: 23, ..Status::default() },
            interrupted: true,
            warnings: vec!["the image is black".into()],
            ..Summary::default()
        };
        let text = ending(&summary);
        for part in ["interrupted", "23.0 %", "3 contributions were not finite", "warning: the image is black"] {
            assert!(text.contains(part), "{text}");
        }
    }
}
