//! The queue: which jobs were begun, done or given up, in a file beside the job file.
//!
//! One JSON object a line, added when something happens, so that whatever ends the process leaves all of it but perhaps
//! a last line that is cut off. A job is known by its image, and by a number that changes with whatever of it the file
//! tells; what was done of a job with another number counts for nothing.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use crate::film::file::FileError;

/// What a job came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Evaluations, those of earlier processes included.
    pub mutations: u64,
    /// Wall seconds that the job waited for its scene: to be read, or to be built by the job before it.
    pub load_seconds: f64,
    /// Wall seconds of rendering, those of earlier processes included.
    pub render_seconds: f64,
    /// Wall seconds from the last mutation on until all files were on the disk.
    pub write_seconds: f64,
    /// Mean luminance of the image.
    pub mean_luminance: f64,
    /// Whether the picture can be trusted: `good`, `doubtful` or `bad`.
    pub verdict: String,
    /// What the run warned of and what is wrong with it, one sentence each.
    pub remarks: Vec<String>,
}

/// Something that happened to a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// It is at work.
    Begun,
    /// All its files are on the disk.
    Done(Found),
    /// It came to nothing.
    Failed {
        /// Why.
        reason: String,
    },
    /// A signal ended it; it goes on with the next process.
    Interrupted,
}

/// A line of the file.
#[derive(Serialize, Deserialize)]
struct Line {
    /// The image's path as the job file has it.
    job: String,
    /// Number of all that the image depends on, in hexadecimal digits.
    digest: String,
    /// Seconds since 1970.
    at: f64,
    #[serde(flatten)]
    event: Event,
}

/// Where a job stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// Of the job that it is known of.
    pub digest: String,
    /// How often it was begun with that number.
    pub attempts: u64,
    /// What happened last.
    pub last: Event,
}

/// All jobs that anything is known of, by name.
pub type Standings = BTreeMap<String, Standing>;

/// A queue that nobody else works on as long as this lives.
pub struct Queue {
    path: PathBuf,
    file: Mutex<File>,
}

impl Queue {
    /// The queue's file of a job file.
    pub fn path_of(jobs: &Path) -> PathBuf {
        let mut name = jobs.as_os_str().to_owned();
        name.push(".queue");
        name.into()
    }

    /// Takes the queue up, or begins one, and tells where its jobs stand.
    pub fn open(path: &Path) -> Result<(Queue, Standings), FileError> {
        let failed = |error: io::Error| FileError::write(path, error);
        let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let mut file = options.map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(FileError::write(path, "another relt batch is at work on these jobs"));
            }
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        let (standings, whole) = read(path)?;
        // a line that was cut off would spoil the next one
        file.set_len(whole).and_then(|()| file.seek(SeekFrom::Start(whole))).map_err(failed)?;
        Ok((Queue { path: path.to_owned(), file: Mutex::new(file) }, standings))
    }

    /// Adds what happened to a job. A line is handed to the system in one piece; ends are also seen to the disk.
    pub fn note(&self, job: &str, digest: &str, event: Event) -> Result<(), FileError> {
        let failed = |error: io::Error| FileError::write(&self.path, error);
        let is_end = matches!(event, Event::Done(_) | Event::Failed { .. });
        let at = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64());
        let line = Line { job: job.to_owned(), digest: digest.to_owned(), at, event };
        let mut text = serde_json::to_vec(&line).map_err(|error| failed(error.into()))?;
        text.push(b'\n');
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let before = file.stream_position().map_err(failed)?;
        let written = file.write_all(&text).and_then(|()| if is_end { file.sync_data() } else { Ok(()) });
        written.map_err(|error| {
            // half a line, as on a full disk, must not stand before the next one
            drop(file.set_len(before).and_then(|()| file.seek(SeekFrom::Start(before))));
            failed(error)
        })
    }
}

/// Where the jobs of a queue stand, and the bytes of it that are whole lines; nothing where there is no queue.
pub fn read(path: &Path) -> Result<(Standings, u64), FileError> {
    let text = match fs::read(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Default::default()),
        text => text.map_err(|error| FileError::read(path, error))?,
    };
    let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    let mut standings = Standings::new();
    for (number, line) in (1..).zip(text[..whole].split_inclusive(|byte| *byte == b'\n')) {
        let line: Line = serde_json::from_slice(line)
            .map_err(|error| FileError::read(path, format_args!("line {number}: {error}; delete it to begin anew")))?;
        let before = standings.get(&line.job).filter(|before| before.digest == line.digest);
        let attempts = before.map_or(0, |before| before.attempts) + u64::from(line.event == Event::Begun);
        standings.insert(line.job, Standing { digest: line.digest, attempts, last: line.event });
    }
    Ok((standings, whole as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_queue_that_was_cut_off_anywhere_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = Queue::path_of(&folder.path().join("jobs.toml"));
        assert!(path.ends_with("jobs.toml.queue"));
        let found = Found { mutations: 7, mean_luminance: 0.1 + 0.2, verdict: "good".into(), ..Found::default() };
        let (queue, standings) = Queue::open(&path).unwrap();
        assert!(standings.is_empty());
        queue.note("a.exr", "1", Event::Begun).unwrap();
        queue.note("b.exr", "1", Event::Begun).unwrap();
        queue.note("a.exr", "1", Event::Done(found.clone())).unwrap();
        queue.note("b.exr", "1", Event::Failed { reason: "no\nroom".into() }).unwrap();
        queue.note("b.exr", "2", Event::Begun).unwrap();
        queue.note("b.exr", "2", Event::Interrupted).unwrap();
        queue.note("b.exr", "2", Event::Begun).unwrap();
        let told = Queue::open(&path).err().expect("it is taken").to_string();
        assert!(told.contains("another relt batch is at work"), "{told}");
        drop(queue);

        let standing = |digest: &str, attempts, last| Standing { digest: digest.into(), attempts, last };
        let expected = Standings::from([
            ("a.exr".into(), standing("1", 1, Event::Done(found.clone()))),
            ("b.exr".into(), standing("2", 2, Event::Begun)),
        ]);
        assert_eq!(read(&path).unwrap().0, expected);

        let text = fs::read(&path).unwrap();
        let last_line = text[..text.len() - 1].iter().rposition(|byte| *byte == b'\n').unwrap() + 1;
        for length in 0..text.len() {
            fs::write(&path, &text[..length]).unwrap();
            let (queue, _) = Queue::open(&path).unwrap();
            queue.note("c.exr", "3", Event::Begun).unwrap();
            drop(queue);
            let (standings, whole) = read(&path).unwrap();
            assert_eq!(standings["c.exr"], standing("3", 1, Event::Begun), "{length}");
            assert_eq!(whole, path.metadata().unwrap().len());
            assert_eq!(standings.get("b.exr").is_some_and(|b| b.last == Event::Interrupted), length >= last_line);
        }
    }

    #[test]
    fn a_line_that_is_none_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("q");
        fs::write(&path, "{}\nx").unwrap();
        let told = Queue::open(&path).err().expect("it is no queue").to_string();
        assert!(told.contains("q: line 1: missing field `job`"), "{told}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "{}\nx", "it is left as it was");
    }
}
