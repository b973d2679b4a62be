//! Run logs, read back.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::film::file::FileError;
use crate::tempering::RoundReport;

/// What a log tells of its rounds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunLog {
    /// The scene file; empty where the log does not begin with `run_start`.
    pub scene: String,
    /// The rounds, in order; at least one.
    pub rounds: Vec<RoundReport>,
    /// What the person should know about the log, one sentence each.
    pub warnings: Vec<String>,
}

/// Why a log cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A line is not what it should be.
    #[error("{}:{line}: {what}", path.display())]
    Line {
        /// The log.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong and what is accepted.
        what: String,
    },
    /// There is no round in it.
    #[error(
        "{} has no rounds ({events}); accepted are logs of `relt render --method re --log FILE` that ran to the end of \
         the first round",
        path.display()
    )]
    NoRounds {
        /// The log.
        path: PathBuf,
        /// What there is.
        events: String,
    },
}

/// What relt looks at in lines of every kind.
#[derive(Deserialize)]
struct Head {
    event: String,
    #[serde(default)]
    scene: String,
    #[serde(default)]
    method: String,
}

/// Reads the log of one run. A last line that was cut off, as by a kill, is left out with a warning; lines of events
/// other than `run_start` and `round` are passed over.
pub fn read(path: &Path) -> Result<RunLog, LogError> {
    let text = std::fs::read(path).map_err(|error| FileError::read(path, error))?;
    let fault = |line: usize, what: String| LogError::Line { path: path.to_owned(), line, what };
    let mut log = RunLog::default();
    let (mut method, mut starts, mut lines) = (String::new(), 0, 0);
    for (number, line) in (1..).zip(text.split_inclusive(|byte| *byte == b'\n')) {
        let head: Head = match serde_json::from_slice(line) {
            Ok(head) => head,
            Err(_) if !line.ends_with(b"\n") => {
                log.warnings.push(format!("{}:{number}: the line is cut off and left out", path.display()));
                break;
            }
            Err(error) => {
                let accepted = "a log has one JSON object a line, each with its `event`";
                return Err(fault(number, format!("{}; {accepted}", in_line(&error))));
            }
        };
        lines += 1;
        match head.event.as_str() {
            "run_start" if starts > 0 => {
                return Err(fault(number, "another run begins here; accepted are logs of one run".into()));
            }
            "run_start" => {
                starts += 1;
                (log.scene, method) = (head.scene, head.method);
            }
            "round" => log.rounds.push(serde_json::from_slice(line).map_err(|error| {
                let version = env!("CARGO_PKG_VERSION");
                fault(number, format!("{}; accepted are rounds as relt {version} writes them", in_line(&error)))
            })?),
            _ => {}
        }
    }
    if log.rounds.is_empty() {
        let events = match (lines, method.as_str()) {
            (0, _) => "it is empty".into(),
            (_, "") => "all events are others".into(),
            _ => format!("it is of --method {method}"),
        };
        return Err(LogError::NoRounds { path: path.to_owned(), events });
    }
    Ok(log)
}

/// A message with its column; the line is always the first to serde.
fn in_line(error: &serde_json::Error) -> String {
    let text = error.to_string();
    match text.split_once(" at line ") {
        Some((what, _)) => format!("{what} at column {}", error.column()),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: &str = r#"{"event":"run_start","scene":"door.xml","method":"re"}"#;

    fn round(number: u32) -> String {
        let mut line = serde_json::to_value(RoundReport { round: number, ..RoundReport::default() }).unwrap();
        line["event"] = "round".into();
        line.to_string()
    }

    /// The text of a file's log, `log.jsonl` for the name of the file.
    fn read_text(text: &str) -> Result<RunLog, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.jsonl");
        std::fs::write(&path, text).unwrap();
        let name = format!("{}/", folder.path().display());
        let plain = |text: String| text.replace(&name, "");
        let read = read(&path).map_err(|error| plain(error.to_string()))?;
        Ok(RunLog { warnings: read.warnings.into_iter().map(plain).collect(), ..read })
    }

    #[test]
    fn rounds_are_found_among_other_events() {
        let text = [START, r#"{"event":"snapshot"}"#, &round(0), r#"{"event":"later"}"#, &round(1), ""].join("\n");
        let log = read_text(&text).unwrap();
        assert_eq!(log.scene, "door.xml");
        assert_eq!(log.rounds.iter().map(|round| round.round).collect::<Vec<_>>(), [0, 1]);
        assert!(log.warnings.is_empty());
    }

    #[test]
    fn the_log_of_a_killed_run_is_read_up_to_the_cut() {
        let whole = [START, &round(0), &round(1)].join("\n");
        assert_eq!(read_text(&whole).unwrap().rounds.len(), 2, "a whole line may lack its end");
        for cut in [1, round(1).len() / 2, round(1).len() - 1] {
            let log = read_text(&whole[..whole.len() - cut]).unwrap();
            assert_eq!(log.rounds.len(), 1);
            assert_eq!(log.warnings, ["log.jsonl:3: the line is cut off and left out"]);
        }
        // in the midst of a letter of two bytes
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.jsonl");
        std::fs::write(&path, [round(0).as_bytes(), b"\n{\"event\":\"t\xc3"].concat()).unwrap();
        assert_eq!(read(&path).unwrap().warnings.len(), 1);
    }

    #[test]
    fn faults_are_told_with_their_place_and_what_is_accepted() {
        let lacking = round(1).replace(r#""barrier":0.0,"#, "");
        let cases = [
            (format!("{START}\nhello\n{}", round(1)), "log.jsonl:2: expected value at column 1; a log has one JSON"),
            ("{}\n".into(), "log.jsonl:1: missing field `event` at column 2; a log has one JSON object a line"),
            (format!("{START}\n{lacking}\n"), "log.jsonl:2: missing field `barrier` at column"),
            (format!("{}\n{START}\n{START}\n", round(0)), "log.jsonl:3: another run begins here"),
            (String::new(), "log.jsonl has no rounds (it is empty); accepted are logs of `relt render --method re"),
            (START.replace("\"re\"", "\"path\""), "log.jsonl has no rounds (it is of --method path)"),
        ];
        for (text, expected) in cases {
            let message = read_text(&text).unwrap_err();
            assert!(message.starts_with(expected), "{message}");
        }
        let missing = read(Path::new("nowhere.jsonl")).unwrap_err().to_string();
        assert!(missing.starts_with("cannot read nowhere.jsonl: "), "{missing}");
    }
}
