//! `relt stress`: numerical stability.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::failure::Failure;
use crate::film::file::{check_writable, write_whole};
use crate::stress::{self, Bench, Case, CaseReport, Check, Report, Verdict};

/// Checks numerical stability on generated scenes and targets at the ends of what numbers can be
///
/// Every case has a known answer or an invariance; tolerances are bounds on rounding, or standard errors over independent
/// runs times a quantile that chance exceeds with probability 10⁻⁶. Seeds are fixed.
#[derive(Args)]
#[command(after_help = super::EXIT_CODES)]
pub(super) struct Stress {
    /// Runs only cases whose names contain one of these, such as scale/ or furnace
    #[arg(value_name = "NAME")]
    filters: Vec<String>,

    /// Runs only what takes less than a minute in all
    #[arg(long)]
    quick: bool,

    /// Lists the cases and what should hold, and runs none
    #[arg(long)]
    list: bool,

    /// Prints all checks of all cases, and not the closest alone
    #[arg(short, long)]
    verbose: bool,

    /// Prints a table in Markdown in the end
    #[arg(long)]
    markdown: bool,

    /// Writes everything that was checked as JSON
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Runs the subcommand.
pub(super) fn run(arguments: Stress) -> Result<(), Failure> {
    let cases = stress::selected(&arguments.filters, arguments.quick);
    if cases.is_empty() {
        let which = if arguments.quick { "the quick suite" } else { "the suite" };
        return Err(Failure::input(format_args!(
            "no case of {which} has {} in its name; relt stress --list shows them",
            arguments.filters.join(" or ")
        )));
    }
    if arguments.list {
        cases.iter().for_each(|case| say(&format!("{:<28}{}{}\n", case.name, mark(case), case.statement)));
        return Ok(());
    }
    if let Some(output) = &arguments.output {
        check_writable(output).map_err(Failure::input)?;
    }
    let bench = Bench::new(arguments.quick).map_err(Failure::input)?;
    let report = arguments.report(&bench, &cases);
    if let Some(output) = &arguments.output {
        let json = serde_json::to_string_pretty(&report).expect("numbers and texts have a JSON form");
        let write = |file: &mut BufWriter<&mut File>| writeln!(file, "{json}").map_err(|error| error.to_string());
        write_whole(output, write).map_err(Failure::running)?;
    }
    match report.failed().map(|case| format!("{}: {}", case.case, case.verdict.name())).collect::<Vec<_>>() {
        failed if failed.is_empty() => Ok(()),
        failed => Err(Failure::Exceeded(failed)),
    }
}

impl Stress {
    /// Runs the cases and shows how each came out.
    fn report(&self, bench: &Bench, cases: &[Case]) -> Report {
        let begin = Instant::now();
        if !self.markdown {
            say(&row("case", "", ["expected", "got", "tolerance"], "verdict", ""));
        }
        let mut reports = Vec::new();
        for case in cases {
            let report = case.run(bench);
            if !self.markdown {
                say(&self.in_words(&report));
            }
            reports.push(report);
        }
        let report = Report::new(bench, reports, begin.elapsed());
        if self.markdown {
            say(&report.markdown());
        } else {
            let (all, failed) = (report.cases.len(), report.failed().count());
            say(&format!("{} of {all} cases pass; {:.0} s\n", all - failed, report.seconds));
        }
        report
    }

    /// The rows of a case: its closest check, and those that were not passed; or all.
    fn in_words(&self, report: &CaseReport) -> String {
        let seconds = format!("{}/{} in {:.1} s", report.passed(), report.checks.len(), report.seconds);
        let mut text = match report.closest() {
            Some(check) => of_check(&report.case, check, &seconds),
            None => row(&report.case, "nothing was checked", ["", "", ""], Verdict::Fail.name(), &seconds),
        };
        let shown = report.checks.iter().filter(|check| self.verbose || check.verdict != Verdict::Pass);
        shown.for_each(|check| text += &of_check("", check, ""));
        text
    }
}

fn of_check(name: &str, check: &Check, note: &str) -> String {
    let numbers = [check.expected_in_words(), stress::number(check.got), stress::number(check.tolerance)];
    row(name, &check.quantity, numbers.each_ref().map(String::as_str), check.verdict.name(), note)
}

fn row(name: &str, quantity: &str, [expected, got, tolerance]: [&str; 3], verdict: &str, note: &str) -> String {
    format!("{name:<28}{quantity:<52}{expected:>14}{got:>14}{tolerance:>14}  {verdict:<10}{note}\n")
}

fn mark(case: &Case) -> &'static str {
    if case.quick { "quick  " } else { "       " }
}

/// To standard output, whose reader may have read enough.
fn say(text: &str) {
    drop(io::stdout().write_all(text.as_bytes()));
}
