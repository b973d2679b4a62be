//! `relt ladder`: the ladder of a run, drawn from its log.

use std::io::{self, Write};
use std::path::{Path, PathBuf, absolute};

use clap::Args;

use super::failure::Failure;
use crate::film::file::{check_writable, write_whole};
use crate::study::run_log::RunLog;
use crate::study::{ladder_page, ladder_text, run_log};
use crate::tempering::RoundReport;

/// Draws the ladder of a replica exchange run from its log: inverse temperatures, barrier, swaps, mutations, normalisation
#[derive(Args)]
pub(super) struct Ladder {
    /// Log of a run, as `relt render --log LOG` writes it; a run still at work or killed will do
    #[arg(value_name = "LOG")]
    log: PathBuf,

    /// Drawing to write, .svg; without it tables and curves go to standard output, in 80 columns
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Round to draw, from 0, the bootstrap [default: the last one]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    round: Option<u32>,
}

/// Runs the subcommand.
pub(super) fn run(arguments: Ladder) -> Result<(), Failure> {
    if let Some(output) = &arguments.output {
        check(output, &arguments.log)?;
    }
    let log = run_log::read(&arguments.log).map_err(Failure::input)?;
    let round = arguments.round_of(&log)?;
    for warning in &log.warnings {
        drop(writeln!(io::stderr(), "warning: {warning}"));
    }
    match &arguments.output {
        Some(output) => {
            let page = ladder_page::draw(&log, round);
            write_whole(output, |file| file.write_all(page.as_bytes()).map_err(|error| error.to_string()))
                .map_err(Failure::running)
        }
        None => {
            // Whoever reads may have read enough, as `head` does.
            drop(write!(io::stdout(), "{}", ladder_text::draw(&log, round)));
            Ok(())
        }
    }
}

/// Finds out whether the drawing can go there.
fn check(output: &Path, log: &Path) -> Result<(), Failure> {
    let svg = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"));
    let place = |path: &Path| absolute(path).unwrap_or_else(|_| path.to_owned());
    if !svg {
        return Err(Failure::input(format_args!("cannot write {}: a drawing is .svg", output.display())));
    }
    if place(output) == place(log) {
        return Err(Failure::input(format_args!("--output {}: that is the log", output.display())));
    }
    check_writable(output).map_err(Failure::input)
}

impl Ladder {
    /// The round that is asked for.
    fn round_of<'a>(&self, log: &'a RunLog) -> Result<&'a RoundReport, Failure> {
        let (first, last) = (&log.rounds[0], &log.rounds[log.rounds.len() - 1]);
        let Some(number) = self.round else { return Ok(last) };
        log.rounds.iter().find(|round| round.round == number).ok_or_else(|| {
            let log = self.log.display();
            let (first, last) = (first.round, last.round);
            Failure::input(format_args!("--round {number}: {log} has rounds {first} to {last}"))
        })
    }
}
