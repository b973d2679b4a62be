//! The run log: one JSON object a line, each with its `event`.
//!
//! `run_start` tells machine, versions, scene and settings; `snapshot` where the run stood at some time; `round` what a
//! round of replica exchange came to ([`RoundReport`]); `checkpoint` that one was written, `run_resume` that another process
//! goes on with it; `run_end` the same as a snapshot at the end, with the files
//! written, the warnings, and whether the run can be trusted ([`Health`]). Times are seconds, rates are probabilities. A line
//! is on its way to the disk once its event is over, so the log of a run that was killed is complete up to then. Lines that
//! find no room are kept and go with the next one that does.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::thread::available_parallelism;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::health::Health;
use super::output::Picture;
use super::settings::Settings;
use super::status::{Observer, RunStart, Status, Summary};
use crate::chain::TechniqueChanges;
use crate::film::file::{FileError, check_writable, plain, write_whole};
use crate::tempering::RoundReport;

/// Finds out now whether a log can be written to `path`; leaves it as it is.
pub fn check(path: &Path) -> Result<(), FileError> {
    match path.metadata() {
        // A file that exists is overwritten in place, whatever its folder allows.
        Ok(found) if found.is_file() => {
            OpenOptions::new().write(true).open(path).map(drop).map_err(|error| FileError::write(path, error))
        }
        Ok(found) if !found.is_dir() => Ok(()), // a pipe or device: opening it to try could disturb its reader
        _ => check_writable(path),
    }
}

/// Finds out now whether the log at `path` can be gone on with; a run's log is there or there is none.
pub fn check_resumable(path: &Path) -> Result<(), FileError> {
    before(path, u64::MAX).map(drop)
}

/// The lines of a log but for those of moments after so many mutations, that of a run's end, and a last one that is cut
/// off; nothing where there is no log.
fn before(path: &Path, mutations: u64) -> Result<Vec<u8>, FileError> {
    /// What tells whether a line stays.
    #[derive(Deserialize)]
    struct Head {
        event: String,
        #[serde(default)]
        mutations: u64,
    }
    let text = match std::fs::read(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        text => text.map_err(|error| FileError::read(path, error))?,
    };
    let mut kept = Vec::new();
    for line in text.split_inclusive(|byte| *byte == b'\n').filter(|line| line.ends_with(b"\n")) {
        let head: Head = serde_json::from_slice(line)
            .map_err(|_| FileError::write(path, "it is no log of relt, and --resume would go on in it"))?;
        if head.mutations <= mutations && head.event != "run_end" {
            kept.extend(line);
        }
    }
    Ok(kept)
}

/// Writes the log.
pub struct Log {
    state: Mutex<State>,
}

struct State {
    file: Box<dyn Write + Send>,
    /// When the next snapshot line is due.
    due: Duration,
    /// The wall time that was last heard of.
    elapsed: Duration,
    /// The run's beginning is in the log already.
    goes_on: bool,
    /// Bytes of lines that are yet to be written: more than none only while that fails.
    pending: Vec<u8>,
    /// What went wrong last, until all is written.
    failed: Option<io::Error>,
    /// That it failed has been told.
    told: bool,
}

/// Snapshot lines are this far apart at least, and their times grow by a quarter each: errors are plotted against
/// the logarithm of time, and a night's log stays short.
const SHORTEST_GAP: Duration = Duration::from_secs(1);

impl Log {
    /// Begins a log, replacing what the file held.
    pub fn create(path: &Path) -> Result<Log, FileError> {
        File::create(path).map(Log::new).map_err(|error| FileError::write(path, error))
    }

    /// Goes on in the log of a run that is gone on with from a checkpoint after so many mutations. What the log has of later
    /// moments is dropped, as they come again; a last line that was cut off as well.
    pub fn resume(path: &Path, mutations: u64, elapsed: Duration) -> Result<Log, FileError> {
        let kept = before(path, mutations)?;
        write_whole(path, |file| file.write_all(&kept).map_err(|error| error.to_string()))?;
        let file = OpenOptions::new().append(true).open(path).map_err(|error| FileError::write(path, error))?;
        let log = Log::new(file);
        {
            let mut state = log.state();
            (state.due, state.elapsed, state.goes_on) = (elapsed + SHORTEST_GAP, elapsed, !kept.is_empty());
        }
        Ok(log)
    }

    /// A checkpoint was written, which took so long.
    pub fn checkpoint(&self, status: &Status, path: &Path, took: Duration) {
        let bytes = path.metadata().map_or(0, |file| file.len());
        self.state().line(&Event::Checkpoint {
            seconds: status.elapsed.as_secs_f64(),
            mutations: status.mutations,
            file: path.display().to_string(),
            bytes,
            took: took.as_secs_f64(),
        });
    }

    /// A log to anything that can be written to.
    pub fn new(file: impl Write + Send + 'static) -> Log {
        Log {
            state: Mutex::new(State {
                file: Box::new(file),
                due: SHORTEST_GAP,
                elapsed: Duration::ZERO,
                goes_on: false,
                pending: Vec::new(),
                failed: None,
                told: false,
            }),
        }
    }

    /// What keeps the log from being complete, if anything does.
    pub fn failure(&self) -> Option<String> {
        self.state().failed.as_ref().map(plain)
    }

    /// The same where it has not been asked for before: once each time that writing begins to fail.
    pub fn new_failure(&self) -> Option<String> {
        let mut state = self.state();
        let fails = state.failed.is_some();
        let fresh = !std::mem::replace(&mut state.told, fails);
        state.failed.as_ref().filter(|_| fresh).map(plain)
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn line(&mut self, event: &Event) {
        let line = serde_json::to_vec(event).expect("events are plain data");
        self.pending.extend(line);
        self.pending.push(b'\n');
        self.failed = self.write().err();
    }

    /// Writes what is pending: what does not find room now goes with a later line, from the byte on that was refused.
    fn write(&mut self) -> io::Result<()> {
        while !self.pending.is_empty() {
            match self.file.write(&self.pending) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(written) => drop(self.pending.drain(..written)),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        self.file.flush()
    }
}

impl Observer for Log {
    fn started(&self, start: &RunStart) {
        let mut state = self.state();
        if state.goes_on {
            let (threads, settings) = (start.threads, &start.settings);
            let mutations = start.resumed_at.unwrap_or(0);
            state.line(&Event::RunResume { mutations, threads, settings, machine: Machine::this() });
            return;
        }
        state.line(&Event::RunStart {
            relt: env!("CARGO_PKG_VERSION"),
            method: start.settings.method.name(),
            seed: start.settings.seed,
            machine: Machine::this(),
            start,
        });
    }

    fn progress(&self, status: &Status) {
        let mut state = self.state();
        state.elapsed = status.elapsed;
        if status.elapsed >= state.due {
            state.due = status.elapsed + SHORTEST_GAP.max(status.elapsed / 4);
            state.line(&Event::Snapshot { now: status.into(), image_written: false });
        }
    }

    fn round(&self, report: &RoundReport) {
        let mut state = self.state();
        let seconds = state.elapsed.as_secs_f64();
        state.line(&Event::Round { seconds, report });
    }

    fn snapshot(&self, status: &Status, _picture: &Picture) {
        self.state().line(&Event::Snapshot { now: status.into(), image_written: true });
    }

    fn finished(&self, summary: &Summary) {
        self.state().line(&Event::RunEnd {
            now: (&summary.status).into(),
            interrupted: summary.interrupted,
            outputs: summary.outputs.iter().map(|path| path.display().to_string()).collect(),
            warnings: &summary.warnings,
            health: &summary.health,
        });
    }
}

/// A line of the log.
#[derive(Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event<'a> {
    RunStart {
        relt: &'static str,
        method: &'static str,
        seed: u64,
        machine: Machine,
        #[serde(flatten)]
        start: &'a RunStart,
    },
    /// Another process goes on with the run.
    RunResume {
        /// Done before.
        mutations: u64,
        threads: usize,
        settings: &'a Settings,
        machine: Machine,
    },
    Checkpoint {
        /// Wall time of the moment that it is of.
        seconds: f64,
        mutations: u64,
        file: String,
        bytes: u64,
        /// How long the run stood still for it, in seconds.
        took: f64,
    },
    Snapshot {
        #[serde(flatten)]
        now: Now<'a>,
        /// An image of this moment was made as well.
        image_written: bool,
    },
    Round {
        /// Wall time since rendering began when the end of the round was noticed.
        seconds: f64,
        #[serde(flatten)]
        report: &'a RoundReport,
    },
    RunEnd {
        #[serde(flatten)]
        now: Now<'a>,
        interrupted: bool,
        outputs: Vec<String>,
        warnings: &'a [String],
        health: &'a Health,
    },
}

/// What a snapshot and the end have in common.
#[derive(Serialize)]
struct Now<'a> {
    /// Wall time since rendering began.
    seconds: f64,
    /// Processor time of all threads in the same span; null where the system does not tell.
    cpu_seconds: Option<f64>,
    mutations: u64,
    mutations_per_second: f64,
    rays: u64,
    /// Of each tempered rung, coldest last.
    acceptance: &'a [f64],
    /// Of each pair of neighbours, hottest first.
    swap: &'a [f64],
    /// Absent where there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    technique_changes: Option<TechniqueChanges>,
    non_finite: u64,
    /// Numbers of them by cause; absent where there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    faults: Option<BTreeMap<&'static str, u64>>,
    normalisation: Option<f64>,
    normalisation_error: Option<f64>,
}

impl<'a> From<&'a Status> for Now<'a> {
    fn from(status: &'a Status) -> Now<'a> {
        Now {
            seconds: status.elapsed.as_secs_f64(),
            cpu_seconds: status.cpu.map(|time| time.as_secs_f64()),
            mutations: status.mutations,
            mutations_per_second: status.mutations_per_second(),
            rays: status.rays,
            acceptance: &status.acceptance,
            swap: &status.swap,
            technique_changes: Some(status.technique_changes).filter(|changes| *changes != TechniqueChanges::default()),
            non_finite: status.non_finite,
            faults: Some(status.faults.by_cause()).filter(|causes| !causes.is_empty()),
            normalisation: status.normalisation.map(|(value, _)| value),
            normalisation_error: status.normalisation.map(|(_, error)| error),
        }
    }
}

/// What a run's speed depends on.
#[derive(Serialize)]
struct Machine {
    /// Processor model; null where the system does not tell.
    cpu: Option<String>,
    /// Threads that run at once.
    cores: usize,
    /// Operating system.
    os: String,
    /// Instruction set family.
    architecture: &'static str,
}

impl Machine {
    fn this() -> Machine {
        let of_file = |path: &str, key: &str, separator: char| {
            let text = std::fs::read_to_string(path).ok()?;
            let (_, value) =
                text.lines().find_map(|line| line.split_once(separator).filter(|(k, _)| k.trim() == key))?;
            Some(value.trim().trim_matches('"').to_owned())
        };
        Machine {
            cpu: of_file("/proc/cpuinfo", "model name", ':'),
            cores: available_parallelism().map_or(1, usize::from),
            os: of_file("/etc/os-release", "PRETTY_NAME", '=').unwrap_or_else(|| std::env::consts::OS.to_owned()),
            architecture: std::env::consts::ARCH,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use serde_json::Value;

    use super::*;
    use crate::film::{Filter, Image};
    use crate::render::settings::{LadderChoice, Settings};
    use crate::scene::description::FilmDescription;

    /// A file in memory that can be looked into.
    #[derive(Clone, Default)]
    struct Shared(Arc<Mutex<Vec<u8>>>);

    impl Write for Shared {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn lines(file: &Shared) -> Vec<Value> {
        let text = String::from_utf8(file.0.lock().unwrap().clone()).unwrap();
        assert!(text.is_empty() || text.ends_with('\n'));
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    fn status(seconds: u64) -> Status {
        Status {
            elapsed: Duration::from_secs(seconds),
            cpu: Some(Duration::from_millis(1875 * seconds)),
            mutations: 1000 * seconds,
            rays: 5000 * seconds,
            acceptance: vec![0.5, 0.25],
            swap: vec![0.75, f64::NAN],
            normalisation: Some((0.5, 0.125)),
            ..Status::default()
        }
    }

    #[test]
    fn a_run_reads_back() {
        let file = Shared::default();
        let log = Log::new(file.clone());
        let settings = Settings {
            seed: 5,
            time: Some(Duration::from_secs(90)),
            ladder: LadderChoice::Replicas(4),
            ..Settings::default()
        };
        log.started(&RunStart {
            scene: "scenes/tür/scene.xml".into(),
            settings,
            threads: 2,
            embree: "4.3.0".into(),
            ..RunStart::default()
        });
        log.progress(&status(2));
        let film = FilmDescription::new(1, 1, Filter::Box);
        let picture = Picture::new(&film, Image::constant(1, 1, [0.0; 3]), vec![], vec![]);
        log.snapshot(&status(3), &picture);
        log.finished(&Summary {
            health: Health::default(),
            status: status(4),
            outputs: vec!["a.exr".into()],
            interrupted: true,
            warnings: vec!["dark".into()],
        });

        let [start, snapshot, with_image, end] = &lines(&file)[..] else { panic!("four events, four lines") };
        assert_eq!(start["event"], "run_start");
        assert_eq!(start["relt"], env!("CARGO_PKG_VERSION"));
        assert_eq!(start["scene"], "scenes/tür/scene.xml");
        assert_eq!(start["method"], "re");
        assert_eq!(start["seed"], 5);
        assert_eq!(start["embree"], "4.3.0");
        assert_eq!(start["settings"]["time"], 90.0);
        assert_eq!(start["settings"]["ladder"]["replicas"], 4);
        assert_eq!(start["settings"]["packet"], "auto");
        assert!(start["machine"]["cores"].as_u64() >= Some(1));
        assert_eq!(snapshot["event"], "snapshot");
        assert_eq!(snapshot["seconds"], 2.0);
        assert_eq!(snapshot["mutations"], 2000);
        assert_eq!(snapshot["mutations_per_second"], 1000.0);
        assert_eq!(snapshot["acceptance"], serde_json::json!([0.5, 0.25]));
        assert_eq!(snapshot["swap"], serde_json::json!([0.75, null]), "a rate that is not known yet");
        assert_eq!(snapshot["normalisation_error"], 0.125);
        assert_eq!((&snapshot["image_written"], &with_image["image_written"]), (&false.into(), &true.into()));
        assert_eq!(end["event"], "run_end");
        assert_eq!(end["interrupted"], true);
        assert_eq!(end["outputs"], serde_json::json!(["a.exr"]));
        assert_eq!(end["warnings"], serde_json::json!(["dark"]));
        assert_eq!(end["cpu_seconds"], 7.5);
    }

    #[test]
    fn rounds_read_back() {
        let file = Shared::default();
        let log = Log::new(file.clone());
        let report = RoundReport {
            round: 3,
            betas: vec![0.0, 0.1, 1.0],
            ln_z: vec![0.0, f64::NAN, -2.5],
            choices: vec!["4 replicas, for Λ is 1.4".into()],
            ..RoundReport::default()
        };
        log.progress(&status(7));
        log.round(&report);
        let line = lines(&file).pop().unwrap();
        assert_eq!((&line["event"], &line["seconds"], &line["round"]), (&"round".into(), &7.0.into(), &3.into()));
        let read: RoundReport = serde_json::from_value(line).unwrap();
        assert_eq!(format!("{read:?}"), format!("{report:?}"), "as texts, for NaN equals nothing");
    }

    #[test]
    fn snapshots_thin_out_with_time() {
        let file = Shared::default();
        let log = Log::new(file.clone());
        for second in 0..10_000 {
            log.progress(&status(second));
        }
        let times: Vec<f64> = lines(&file).iter().map(|line| line["seconds"].as_f64().unwrap()).collect();
        assert_eq!(times[..6], [1.0, 2.0, 3.0, 4.0, 5.0, 7.0]);
        assert!((30..60).contains(&times.len()), "{} lines", times.len());
    }

    /// A disk of so many bytes, in which room can be made.
    #[derive(Clone, Default)]
    struct Disk {
        file: Shared,
        room: Arc<Mutex<usize>>,
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut room = self.room.lock().unwrap();
            let fits = bytes.len().min(*room);
            *room -= fits;
            if fits == 0 { Err(io::ErrorKind::StorageFull.into()) } else { self.file.write(&bytes[..fits]) }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn lines_that_a_full_disk_refused_come_later_from_the_byte_on_that_had_no_room() {
        let disk = Disk::default();
        let log = Log::new(disk.clone());
        let room = |bytes: usize| *disk.room.lock().unwrap() = bytes;
        room(40); // not enough for a line
        log.started(&RunStart::default());
        assert_eq!(log.failure(), Some("the disk is full".into()));
        assert_eq!(log.new_failure(), log.failure());
        log.progress(&status(1));
        assert_eq!((log.failure().is_some(), log.new_failure()), (true, None), "told once");
        assert_eq!(disk.file.0.lock().unwrap().len(), 40);
        room(1 << 20);
        log.progress(&status(2));
        assert_eq!((log.failure(), log.new_failure()), (None, None));
        let seconds = lines(&disk.file).iter().map(|line| line["seconds"].as_f64()).collect::<Vec<_>>();
        assert_eq!(seconds, [None, Some(1.0), Some(2.0)], "every line, in order");
        room(0);
        log.progress(&status(3));
        assert!(log.new_failure().is_some(), "told again when it begins again");
    }

    #[test]
    fn checking_changes_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.jsonl");
        check(&path).unwrap();
        assert!(!path.exists());
        std::fs::write(&path, "old\n").unwrap();
        check(&path).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old\n");
        assert!(check(folder.path()).is_err());
        assert!(check(&folder.path().join("nowhere/run.jsonl")).unwrap_err().to_string().contains("run.jsonl"));
    }
}
