//! Why the program ends without success, in words for the person at the keyboard.

use std::fmt;
use std::process::ExitCode;

use super::signals;

/// Messages and an exit code. Its text ends in a newline.
#[derive(Debug)]
pub(super) enum Failure {
    /// Nothing could be begun, for these reasons; code 2.
    Input(Vec<String>),
    /// The same with a text that needs no `error:` before it, such as a marked-up piece of a scene file, and in plain
    /// words; code 2.
    Shown { text: String, plain: String },
    /// It failed on the way, for these reasons; code 1.
    Running(Vec<String>),
    /// All was done, but what came of it is beyond these limits that were set; code 3.
    Exceeded(Vec<String>),
    /// A signal ended it with less than was asked for, which is written and can be gone on with; code 130.
    Interrupted(String),
}

impl Failure {
    /// A single reason not to begin.
    pub fn input(reason: impl fmt::Display) -> Failure {
        Failure::Input(vec![reason.to_string()])
    }

    /// A failure on the way.
    pub fn running(reason: impl fmt::Display) -> Failure {
        Failure::Running(vec![reason.to_string()])
    }

    /// A fault of an input file, shown in place; colours and frames only where standard error is a terminal.
    pub fn shown(report: impl miette::Diagnostic + Send + Sync + 'static) -> Failure {
        let plain = report.to_string();
        Failure::Shown { text: format!("{:?}\n", miette::Report::new(report)), plain }
    }

    /// The reasons alone, one a line.
    pub fn plain(&self) -> String {
        match self {
            Failure::Input(reasons) | Failure::Running(reasons) | Failure::Exceeded(reasons) => reasons.join("\n"),
            Failure::Shown { plain, .. } => plain.clone(),
            Failure::Interrupted(reason) => reason.clone(),
        }
    }

    pub fn code(&self) -> ExitCode {
        ExitCode::from(self.number())
    }

    /// The exit code's number.
    pub fn number(&self) -> u8 {
        match self {
            Failure::Running(_) => 1,
            Failure::Input(_) | Failure::Shown { .. } => 2,
            Failure::Exceeded(_) => 3,
            Failure::Interrupted(_) => signals::ENDED as u8,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::Input(reasons) | Failure::Running(reasons) | Failure::Exceeded(reasons) => {
                reasons.iter().try_for_each(|reason| writeln!(f, "error: {reason}"))
            }
            Failure::Shown { text, .. } => f.write_str(text),
            Failure::Interrupted(reason) => writeln!(f, "stopped: {reason}"),
        }
    }
}
