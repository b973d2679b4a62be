//! The file of one run of a study, `runs/NAME.jsonl`: the run's own log ([`log`](crate::render::log)) with three more
//! kinds of lines: `job` at its head, `errors` at each snapshot, `job_end` last.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use super::metrics::Errors;
use crate::film::file::FileError;
use crate::tempering::RoundReport;

/// What a run was, before it began.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JobHead {
    /// Name of the scene in the study.
    pub scene: String,
    /// Name of the method in the study.
    pub method: String,
    /// Options of `relt render`.
    pub options: Vec<String>,
    /// Seed.
    pub seed: u64,
    /// A command line that repeats it.
    pub command: String,
    /// Version of relt with a checksum of the executable.
    pub program: String,
    /// Wall seconds that reading the scene took.
    pub load_seconds: f64,
    /// Wall seconds that building the scene took.
    pub build_seconds: f64,
}

/// A moment of a run: times from the opening of the scene's file on, without pauses for snapshots.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// Wall time.
    pub wall_seconds: f64,
    /// Processor time of all threads; null where the system does not tell.
    pub cpu_seconds: Option<f64>,
    /// Mutations so far.
    pub mutations: u64,
    /// Rays so far.
    pub rays: u64,
    /// Of the image of this moment; numbers that are not finite are null and make the line unreadable, which no image
    /// of finite pixels and no reference with light comes to.
    pub errors: Errors,
    /// Standard error over value of c as the run states it; null where it states none.
    pub stated_brightness_error: Option<f64>,
    /// Where the image is kept, from the study's folder on.
    pub image: Option<PathBuf>,
}

/// How a run ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JobEnd {
    /// Wall seconds that calibration, bootstrap and adaptation took.
    pub set_up_seconds: [f64; 3],
    /// What the run warned of.
    pub warnings: Vec<String>,
}

/// A finished run as its file tells it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// What it was.
    pub head: JobHead,
    /// Worker threads.
    pub threads: usize,
    /// Processor, cores, operating system.
    pub machine: String,
    /// Embree's version.
    pub embree: String,
    /// Its moments, the end last.
    pub moments: Vec<Moment>,
    /// The last round of replica exchange that was whole.
    pub last_round: Option<RoundReport>,
    /// How it ended.
    pub end: JobEnd,
}

/// What is of interest in the last line of a run's log.
#[derive(Deserialize)]
pub struct LogEnd {
    /// Wall time since rendering began.
    pub seconds: f64,
    /// All of them.
    pub mutations: u64,
    /// Those that the process traced that wrote the log, and the others by what they told it last.
    pub rays: u64,
    /// c.
    pub normalisation: Option<f64>,
    /// Its standard error.
    pub normalisation_error: Option<f64>,
    /// What it warned of.
    pub warnings: Vec<String>,
}

/// A line of the file.
#[derive(Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Line {
    Job(JobHead),
    RunStart(RunHead),
    Round(Box<RoundReport>),
    Errors(Moment),
    JobEnd(JobEnd),
    /// Lines of the run's log that nothing here looks at.
    #[serde(other)]
    Other,
}

/// What is of interest in the log's first line.
#[derive(Serialize, Deserialize)]
struct RunHead {
    threads: usize,
    embree: String,
    machine: Machine,
}

#[derive(Serialize, Deserialize)]
struct Machine {
    cpu: Option<String>,
    cores: usize,
    os: String,
}

/// A file that the run's log and the study write to by turns, line by line.
#[derive(Clone)]
pub struct SharedFile(Arc<Mutex<File>>);

impl SharedFile {
    /// An empty file.
    pub fn create(path: &Path) -> Result<SharedFile, FileError> {
        let file = File::create(path).map_err(|error| FileError::write(path, error))?;
        Ok(SharedFile(Arc::new(Mutex::new(file))))
    }

    /// Adds the head.
    pub fn head(&self, head: JobHead) -> io::Result<()> {
        self.line(&Line::Job(head))
    }

    /// Adds a moment.
    pub fn moment(&self, moment: Moment) -> io::Result<()> {
        self.line(&Line::Errors(moment))
    }

    /// Adds the log of another process, and tells how it ended.
    pub fn take_log(&self, path: &Path) -> Result<LogEnd, FileError> {
        let failed = |error: String| FileError::read(path, error);
        let text = std::fs::read_to_string(path).map_err(|error| failed(error.to_string()))?;
        self.clone().write_all(text.as_bytes()).map_err(|error| failed(error.to_string()))?;
        serde_json::from_str(text.lines().last().unwrap_or_default()).map_err(|error| failed(error.to_string()))
    }

    /// Adds the end, and sees to it that all is on the disk.
    pub fn end(&self, end: JobEnd) -> io::Result<()> {
        self.line(&Line::JobEnd(end))?;
        self.0.lock().unwrap_or_else(PoisonError::into_inner).sync_all()
    }

    fn line(&self, line: &Line) -> io::Result<()> {
        let mut text = serde_json::to_vec(line)?;
        text.push(b'\n');
        self.clone().write_all(&text)
    }
}

impl Write for SharedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).flush()
    }
}

/// Reads the file of a finished run.
pub fn read(path: &Path) -> Result<Record, FileError> {
    let file = File::open(path).map_err(|error| FileError::read(path, error))?;
    let mut record = Record::default();
    let mut ended = false;
    for (number, line) in (1..).zip(BufReader::new(file).lines()) {
        let line = line.map_err(|error| FileError::read(path, error))?;
        let line: Line = serde_json::from_str(&line).map_err(|error| {
            FileError::read(path, format_args!("line {number}: {error}; delete it to redo the run"))
        })?;
        match line {
            Line::Job(head) => record.head = head,
            Line::RunStart(start) => {
                let Machine { cpu, cores, os } = start.machine;
                record.machine = format!("{}, {cores} cores, {os}", cpu.as_deref().unwrap_or("unknown processor"));
                (record.threads, record.embree) = (start.threads, start.embree);
            }
            Line::Round(report) => record.last_round = Some(*report),
            Line::Errors(moment) => record.moments.push(moment),
            Line::JobEnd(end) => {
                record.end = end;
                ended = true;
            }
            Line::Other => {}
        }
    }
    match ended && !record.moments.is_empty() {
        true => Ok(record),
        false => Err(FileError::read(path, "it is not the whole of a run; delete it to redo the run")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::log::Log;
    use crate::render::{Observer, RunStart, Settings};

    #[test]
    fn a_run_reads_back_with_its_log_between() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.jsonl");
        let file = SharedFile::create(&path).unwrap();
        let head = JobHead { scene: "box".into(), method: "re".into(), seed: 3, ..JobHead::default() };
        let moment = |seconds: f64| Moment { wall_seconds: seconds, mutations: 10, ..Moment::default() };
        let end = JobEnd { set_up_seconds: [0.1, 0.2, 0.3], warnings: vec!["dark".into()] };
        file.head(head.clone()).unwrap();
        let log = Log::new(file.clone());
        log.started(&RunStart {
            settings: Settings::default(),
            threads: 2,
            embree: "4.4.0".into(),
            ..RunStart::default()
        });
        file.moment(moment(1.0)).unwrap();
        for round in [0, 1] {
            log.round(&RoundReport { round, ..RoundReport::default() });
        }
        file.moment(moment(2.5)).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("not the whole of a run"));
        file.end(end.clone()).unwrap();

        let record = read(&path).unwrap();
        assert_eq!((record.head, record.end, record.threads), (head, end, 2));
        assert_eq!(record.moments, [moment(1.0), moment(2.5)]);
        assert_eq!(record.last_round.map(|report| report.round), Some(1));
        assert!(record.machine.contains(" cores, "), "{}", record.machine);

        std::fs::write(&path, "{\"event\":\"job\"}\n").unwrap();
        let message = read(&path).unwrap_err().to_string();
        assert!(message.contains("run.jsonl: line 1: missing field `scene`"), "{message}");
    }
}
