//! What the person at the keyboard sees of a run: a line that moves on a terminal, a few plain ones elsewhere.

use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::settings::{LadderChoice, Method};
use super::status::{Observer, RunStart, Status, Summary};
use crate::tempering::RoundReport;

/// How much is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Verbosity {
    /// Nothing.
    Quiet,
    /// Progress, and how the run ended.
    #[default]
    Normal,
    /// Also a table of the rounds, and what was chosen after each.
    Verbose,
}

/// Who shows a run to a person.
pub trait Teller: Observer {
    /// A line that stays.
    fn say(&self, words: &str);
}

/// Shows a run on standard error.
pub struct Progress {
    stop: Arc<AtomicBool>,
    display: Display,
    /// For the table of rounds, where it is wanted.
    table: Option<Mutex<Table>>,
}

/// What the table of rounds remembers.
#[derive(Default)]
struct Table {
    /// Its header is written.
    begun: bool,
    /// Mutations per second so far.
    pace: f64,
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
    /// Shows on standard error what suits it. `stop` is raised once the run is to end early.
    pub fn new(verbosity: Verbosity, stop: Arc<AtomicBool>) -> Progress {
        if verbosity == Verbosity::Quiet {
            return Progress { stop, display: Display::Quiet, table: None };
        }
        if !io::stderr().is_terminal() {
            return Progress::plain(io::stderr(), verbosity, stop);
        }
        let bar = ProgressBar::with_draw_target(Some(BAR_STEPS), ProgressDrawTarget::stderr());
        bar.set_style(ProgressStyle::with_template("{bar:24} {msg}").expect("a template known to be right"));
        Progress { stop, display: Display::Terminal(bar), table: Table::of(verbosity) }
    }

    /// Plain lines to anything that can be written to.
    pub fn plain(file: impl Write + Send + 'static, verbosity: Verbosity, stop: Arc<AtomicBool>) -> Progress {
        let display = match verbosity {
            Verbosity::Quiet => Display::Quiet,
            _ => Display::Plain(Mutex::new(Plain { file: Box::new(file), tenths: 0, last: Duration::ZERO })),
        };
        Progress { stop, display, table: Table::of(verbosity) }
    }
}

impl Teller for Progress {
    fn say(&self, words: &str) {
        match &self.display {
            Display::Quiet => {}
            Display::Terminal(bar) => bar.suspend(|| drop(writeln!(io::stderr(), "{words}"))),
            // Nobody may be listening; that is no reason to stop rendering.
            Display::Plain(plain) => drop(writeln!(locked(plain).file, "{words}")),
        }
    }
}

impl Table {
    fn of(verbosity: Verbosity) -> Option<Mutex<Table>> {
        (verbosity == Verbosity::Verbose).then(Mutex::default)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Observer for Progress {
    fn started(&self, start: &RunStart) {
        if let Display::Terminal(bar) = &self.display {
            bar.set_message("starting");
        }
        self.say(&heading(start));
        start.mapping_trial.iter().for_each(|why| self.say(why));
    }

    fn progress(&self, status: &Status) {
        self.table.iter().for_each(|table| locked(table).pace = status.mutations_per_second());
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

    fn round(&self, report: &RoundReport) {
        let Some(table) = &self.table else { return };
        let mut table = locked(table);
        if !table.begun {
            self.say(&round_header());
            table.begun = true;
        }
        self.say(&round_row(report, table.pace));
        report.choices.iter().for_each(|choice| self.say(&format!("{:6}{choice}", "")));
    }

    fn finished(&self, summary: &Summary) {
        if let Display::Terminal(bar) = &self.display {
            bar.finish_and_clear();
        }
        self.say(&ending(summary));
    }
}

/// `scenes/door/scene.xml: 256 × 256, replica exchange with 4 replicas, light mapping, 64 mutations per pixel, 2 threads`
pub fn heading(start: &RunStart) -> String {
    let settings = &start.settings;
    let mut words = vec![format!("{}: {} × {}", start.scene, start.width, start.height)];
    match settings.method {
        Method::Path => words.push("path tracing".into()),
        Method::Mlt => words.push("Metropolis".into()),
        Method::ReplicaExchange => {
            words.push(match &settings.ladder {
                LadderChoice::Auto => "replica exchange".into(),
                LadderChoice::Replicas(1) => "replica exchange with the uniform replica alone".into(),
                LadderChoice::Replicas(k) => format!("replica exchange with {k} replicas"),
                LadderChoice::Betas(betas) => format!("replica exchange with {} replicas", betas.len()),
            });
        }
    }
    words.extend(settings.parts.in_words());
    words.push(format!("{} mapping", start.mapping.name()));
    let mpp = settings.mutations_per_pixel.map(|mpp| format!("{mpp} mutations per pixel"));
    let time = settings.time.map(|time| humantime::format_duration(time).to_string());
    match (mpp, time) {
        (Some(mpp), Some(time)) => words.push(format!("{mpp} or {time}")),
        (mpp, time) => words.extend(mpp.or(time)),
    }
    words.push(format!("{} thread{}", start.threads, if start.threads == 1 { "" } else { "s" }));
    words.extend(start.resumed_at.map(|mutations| format!("going on after {} mutations", with_unit(mutations as f64))));
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

/// The columns of the table of rounds, right-aligned.
const ROUND_COLUMNS: [(&str, usize); 9] = [
    ("round", 5),
    ("K", 4),
    ("Λ", 6),
    ("min", 6), // of swap acceptance over pairs
    ("mean swap", 10),
    ("round trips", 12),
    ("normalisation", 18),
    ("mut./s", 8),
    ("uniform", 8),
];

/// The header of [`round_row`]s, 77 columns wide.
pub fn round_header() -> String {
    ROUND_COLUMNS.iter().map(|(name, width)| format!("{name:>width$}")).collect()
}

/// One round: replicas, communication barrier, acceptance of swaps over the pairs (least and mean), round trips, the
/// estimate of c that is used with its standard error, mutations per second so far, share of uniform points.
pub fn round_row(report: &RoundReport, mutations_per_second: f64) -> String {
    let swaps = || report.rejection.iter().map(|rejection| 1.0 - rejection).filter(|swap| swap.is_finite());
    let pairs = swaps().count();
    let mean_swap = (pairs > 0).then(|| swaps().sum::<f64>() / pairs as f64);
    let c = report.normalisers.of(report.used);
    let decimals = |value: Option<f64>, n: usize| match value.filter(|value| value.is_finite()) {
        Some(value) => format!("{value:.n$}"),
        None => "–".into(),
    };
    let cells = [
        report.round.to_string(),
        report.replicas.to_string(),
        decimals(Some(report.barrier), 2),
        decimals(swaps().reduce(f64::min), 2),
        decimals(mean_swap, 2),
        report.round_trips.to_string(),
        if c.ln_value.is_finite() {
            format!("{} ± {} %", significant(c.value(), 4), decimals(Some(100.0 * c.relative_error), 2))
        } else {
            "–".into()
        },
        with_unit(mutations_per_second),
        format!("{} %", decimals(Some(100.0 * report.uniform_share), 0)),
    ];
    cells.iter().zip(ROUND_COLUMNS).map(|(cell, (_, width))| format!("{cell:>width$}")).collect()
}

/// `4 replicas, 83 % uniform`
fn choice(report: &RoundReport) -> String {
    let uniform = format!("{:.0} % uniform", 100.0 * report.uniform_share);
    let uniform = Some(uniform).filter(|_| report.uniform_share.is_finite());
    [Some(format!("{} replicas", report.replicas)), uniform].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// What is said at the end: files, effort, warnings, and what is wrong with the run.
pub fn ending(summary: &Summary) -> String {
    let status = &summary.status;
    let mut lines = Vec::new();
    if summary.interrupted {
        lines.push(format!("interrupted: the image holds what was done, {:.1} %", 100.0 * status.fraction()));
    }
    lines.extend(summary.warnings.iter().map(|warning| format!("warning: {warning}")));
    lines.extend(summary.health.lines());
    let files: Vec<String> = summary.outputs.iter().map(|path| path.display().to_string()).collect();
    lines.push(format!(
        "{} mutations in {} ({}/s{}); wrote {}",
        with_unit(status.mutations as f64),
        rough(status.elapsed),
        with_unit(status.mutations_per_second()),
        status.last_round.as_deref().map(|round| format!(", {}", choice(round))).unwrap_or_default(),
        if files.is_empty() { "nothing".into() } else { listed(&files) },
    ));
    lines.join("\n")
}

/// So many significant digits: `0.01235`, `12.35`; very small and large numbers as `1.235e-7`.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".into() } else { "–".into() };
    }
    // the power of ten after rounding to that many digits
    let scientific = format!("{value:.*e}", digits - 1);
    let power: i32 = scientific.split_once('e').and_then(|(_, power)| power.parse().ok()).unwrap_or(0);
    match power {
        -3..=4 => format!("{value:.*}", (digits as i32 - 1 - power).max(0) as usize),
        _ => scientific,
    }
}

/// `a`, `a and b`, `a, b and c`.
pub fn listed(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [others @ .., last] => format!("{} and {last}", others.join(", ")),
    }
}

/// Three digits and a power of thousand: `950`, `1.23 k`, `45.6 M`.
pub fn with_unit(value: f64) -> String {
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
pub fn rough(time: Duration) -> String {
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
    use crate::path::MappingKind;
    use crate::render::settings::Settings;
    use crate::tempering::{LnEstimate, Normaliser, NormaliserEstimates};

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
    fn the_heading_names_the_mapping_and_a_line_says_why() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let progress = Progress::plain(path.reopen().unwrap(), Verbosity::Normal, Arc::default());
        let start = RunStart {
            scene: "a.xml".into(),
            threads: 2,
            mapping: MappingKind::TwoWay,
            mapping_trial: Some("two-way mapping: so it is".into()),
            ..RunStart::default()
        };
        progress.started(&start);
        let heading = "a.xml: 0 × 0, replica exchange, two-way mapping, 64 mutations per pixel, 2 threads";
        let text = std::fs::read_to_string(path.path()).unwrap();
        assert_eq!(text, format!("{heading}\ntwo-way mapping: so it is\n"));
        progress.started(&RunStart { mapping_trial: None, ..start });
        assert_eq!(std::fs::read_to_string(path.path()).unwrap().lines().count(), 3, "no line without a trial");
    }

    #[test]
    fn plain_lines_come_at_tenths_and_hold_no_escape_codes() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let progress = Progress::plain(path.reopen().unwrap(), Verbosity::Normal, Arc::default());
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
            Some(
                "door.xml: 4 × 3, replica exchange with 4 replicas, unidirectional mapping, 64 mutations per pixel or 1m \
                 30s, 2 threads"
            )
        );
        assert_eq!(text.lines().count(), 1 + 9 + 1, "{text}");
        assert!(text.lines().last().unwrap().ends_with("wrote a.exr and a.png"), "{text}");
    }

    fn report() -> RoundReport {
        RoundReport {
            round: 5,
            replicas: 4,
            barrier: 1.815,
            rejection: vec![0.25, f64::NAN, 0.5],
            round_trips: 1234,
            normalisers: NormaliserEstimates {
                mbar: LnEstimate { ln_value: 0.25f64.ln(), relative_error: 0.0031 },
                ..NormaliserEstimates::default()
            },
            used: Normaliser::Mbar,
            uniform_share: 0.834,
            choices: vec!["K stays at 4: Λ is 1.8".into()],
            ..RoundReport::default()
        }
    }

    #[test]
    fn a_round_is_a_row_under_its_header() {
        assert_eq!(
            [round_header(), round_row(&report(), 1.86e6)].join("\n"),
            "\
round   K     Λ   min mean swap round trips     normalisation  mut./s uniform
    5   4  1.81  0.50      0.62        1234   0.2500 ± 0.31 %  1.86 M    83 %"
        );
        let unknown = RoundReport { barrier: f64::NAN, uniform_share: 1.0, ..RoundReport::default() };
        assert_eq!(
            round_row(&unknown, 0.0),
            "    0   0     –     –         –           0                 –       0   100 %"
        );
    }

    #[test]
    fn rounds_are_told_when_asked_for_with_one_header() {
        for (verbosity, lines) in [(Verbosity::Quiet, 0), (Verbosity::Normal, 0), (Verbosity::Verbose, 1 + 2 + 2)] {
            let path = tempfile::NamedTempFile::new().unwrap();
            let progress = Progress::plain(path.reopen().unwrap(), verbosity, Arc::default());
            progress.round(&report());
            progress.round(&report());
            let text = std::fs::read_to_string(path.path()).unwrap();
            assert_eq!(text.lines().count(), lines, "{verbosity:?}: {text}");
            assert_eq!(text.matches("round trips").count(), lines.min(1), "{text}");
            assert_eq!(text.matches("\n      K stays at 4: Λ is 1.8\n").count(), lines / 2, "{text}");
        }
    }

    #[test]
    fn the_end_names_the_ladder_that_was_chosen() {
        let status = Status { last_round: Some(Arc::new(report())), ..Status::default() };
        let text = ending(&Summary { status, ..Summary::default() });
        assert!(text.contains("(0/s, 4 replicas, 83 % uniform); wrote"), "{text}");
    }

    #[test]
    fn digits_are_significant() {
        let expected = [
            (0.0, "0"),
            (0.0123456, "0.01235"),
            (0.99996, "1.000"),
            (-12.3456, "-12.35"),
            (12345.6, "12346"),
            (1.23456e-7, "1.235e-7"),
            (1e9, "1.000e9"),
            (f64::NAN, "–"),
        ];
        for (value, text) in expected {
            assert_eq!(significant(value, 4), text, "{value}");
        }
    }

    #[test]
    fn the_end_names_what_went_wrong() {
        let summary = Summary {
            status: Status { target_mutations: Some(100), mutations: 23, ..Status::default() },
            interrupted: true,
            warnings: vec!["the image is black".into()],
            ..Summary::default()
        };
        let text = ending(&summary);
        for part in ["interrupted", "23.0 %", "warning: the image is black"] {
            assert!(text.contains(part), "{text}");
        }
    }
}
