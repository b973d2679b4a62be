//! `relt merge`: one image of parts that ran apart.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use crate::render::progress::{listed, rough, with_unit};
use crate::render::{self, MergedPart, Output};

/// Makes one image of the parts of a job that relt render --part ran, or of any checkpoint
#[derive(Args)]
#[command(after_help = super::EXIT_CODES)]
pub(super) struct Merge {
    /// Files that relt render --part or --checkpoint wrote, each part of the job at most once
    #[arg(value_name = "PART", required = true)]
    parts: Vec<PathBuf>,

    /// Image to write: .exr (32-bit floats, with a .png preview beside it) or .png (preview only)
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,

    /// Shows nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the subcommand.
pub(super) fn run(arguments: Merge) -> Result<(), Failure> {
    let output = Output::new(&arguments.output).map_err(Failure::input)?;
    if let Some(part) = arguments.parts.iter().find(|part| output.files().contains(part)) {
        return Err(Failure::input(format_args!("{}: the image would go there", part.display())));
    }
    output.check().map_err(Failure::input)?;
    let merged = render::merge(&arguments.parts).map_err(Failure::input)?;
    output.write(&merged.picture).map_err(Failure::running)?;
    if arguments.quiet {
        return Ok(());
    }
    let mut lines: Vec<String> = merged.parts.iter().map(|part| line(part, merged.of)).collect();
    lines.extend(merged.warnings.iter().map(|warning| format!("warning: {warning}")));
    lines.extend(merged.agreement.map(|agreement| agreement.in_words()));
    let files: Vec<String> = output.files().iter().map(|file| file.display().to_string()).collect();
    lines.push(format!("wrote {}", listed(&files)));
    drop(writeln!(io::stderr(), "{}", lines.join("\n"))); // nobody may be listening
    Ok(())
}

/// `part 3 of 8: 12.3 M of 20.0 M mutations in 3 min 05 s (a.3-of-8.part)`
fn line(part: &MergedPart, of: u32) -> String {
    let what = match part.number {
        Some(number) => format!("part {number} of {of}"),
        None => "the whole".into(),
    };
    let (mutations, time) = (with_unit(part.mutations as f64), rough(part.elapsed));
    let wanted = part.wanted.map_or_else(String::new, |wanted| format!(" of {}", with_unit(wanted as f64)));
    format!("{what}: {mutations}{wanted} mutations in {time} ({})", part.path.display())
}
