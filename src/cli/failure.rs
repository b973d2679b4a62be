//! Why the program ends without success, in words for the person at the keyboard.

use std::fmt;
use std::process::ExitCode;

use super::signals;

/// Messages and an exit code. Its text ends in a newline.
#[derive(Debug)]
pub(super) enum Failure {
    /// Nothing could be begun, for these reasons; code 2.
    Input(Vec<String>),
    /// The same with a text that needs no `error:` before it, such as a marked-up piece of a scene file; code 2.
    Shown(String),
    /// It failed on the way; code 1.
    Running(String),
    /// A signal ended it before it was done; what is finished is kept, and these words say how to go on; code 130.
    Stopped(String),
}

impl Failure {
    /// A single reason not to begin.
    pub fn input(reason: impl fmt::Display) -> Failure {
        Failure::Input(vec![reason.to_string()])
    }

    /// A failure on the way.
    pub fn running(reason: impl fmt::Display) -> Failure {
        Failure::Running(reason.to_string())
    }

    /// Ended by a signal, with words on how to go on.
    pub fn stopped(how_to_go_on: impl fmt::Display) -> Failure {
        Failure::Stopped(how_to_go_on.to_string())
    }

    /// A fault of an input file, shown in place; colours and frames only where standard error is a terminal.
    pub fn shown(report: impl miette::Diagnostic + Send + Sync + 'static) -> Failure {
        Failure::Shown(format!("{:?}\n", miette::Report::new(report)))
    }

    pub fn code(&self) -> ExitCode {
        match self {
            Failure::Running(_) => ExitCode::from(1),
            Failure::Stopped(_) => ExitCode::from(signals::ENDED_AT_ONCE as u8),
            Failure::Input(_) | Failure::Shown(_) => ExitCode::from(2),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::Input(reasons) => reasons.iter().try_for_each(|reason| writeln!(f, "error: {reason}")),
            Failure::Shown(text) => f.write_str(text),
            Failure::Running(reason) => writeln!(f, "error: {reason}"),
            Failure::Stopped(how) => writeln!(f, "stopped: {how}"),
        }
    }
}
