//! `relt convert`: scenes of other renderers to Mitsuba 3's XML.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::values;
use crate::convert::{ConvertError, Job, Kind, Note, convert};
use crate::load::Reach;

/// Converts a scene of Mitsuba 0.5, 0.6 or 2 (.xml) or of pbrt-v4 (.pbrt) to Mitsuba 3's XML
///
/// What has no counterpart is listed on standard error as `file:line:column: left out: …`, what has one that looks
/// different as `changed: …`. Files that have to be rewritten go to a folder OUT-files beside OUT.xml; all others are
/// referred to where they are.
#[derive(Args)]
#[command(after_help = super::EXIT_CODES)]
pub(super) struct Convert {
    /// Scene file to read
    #[arg(value_name = "IN")]
    input: PathBuf,

    /// Scene file to write
    #[arg(value_name = "OUT.xml")]
    output: PathBuf,

    /// Writes nothing where something would have to be left out
    #[arg(long)]
    strict: bool,

    /// Reads files of the scene's own folder only; without, also others that the scene names plainly
    #[arg(long)]
    confine: bool,

    /// Sets a parameter that the file declares as a `default`; may be repeated
    #[arg(short = 'D', long = "define", value_name = "NAME=VALUE", value_parser = values::define)]
    defines: Vec<(String, String)>,
}

/// Runs the subcommand.
pub(super) fn run(arguments: Convert) -> Result<(), Failure> {
    let Convert { input, output, strict, confine, defines } = arguments;
    if output.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("xml")) {
        return Err(Failure::input(format_args!("{}: a scene is written as .xml", output.display())));
    }
    if let (Ok(from), Ok(to)) = (input.canonicalize(), output.canonicalize())
        && from == to
    {
        return Err(Failure::input(format_args!("{}: that is the scene to read", output.display())));
    }
    let job = Job { input, output, defines, reach: Reach::confined(confine), strict };
    match convert(&job) {
        Ok(report) => {
            list(&report.notes);
            Ok(())
        }
        Err(ConvertError::Input(errors)) => {
            let shown = errors.into_iter().map(|error| Failure::shown(error).to_string()).collect();
            Err(Failure::Shown(shown))
        }
        Err(ConvertError::LeftOut(notes)) => {
            list(&notes);
            let count = notes.iter().filter(|note| note.kind == Kind::LeftOut).count();
            Err(Failure::input(format_args!("--strict: {count} would be left out, so nothing is written")))
        }
        Err(ConvertError::File(error)) => Err(Failure::input(error)),
    }
}

/// One line a note. Whoever reads may have read enough.
fn list(notes: &[Note]) {
    let mut stderr = io::stderr().lock();
    for note in notes {
        drop(writeln!(stderr, "{note}"));
    }
}
