//! Command lines to typed jobs: one file a subcommand.

mod batch;
mod compare;
mod convert;
mod display;
mod failure;
mod info;
mod ladder;
mod loading;
mod merge;
mod reference;
mod render;
mod replay;
mod run_options;
mod scene;
mod signals;
mod stress;
mod study;
mod values;

use std::io::{self, Write};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Renders images by replica-exchange light transport: many Metropolis chains on ladders of inverse temperatures.
#[derive(Parser)]
#[command(name = "relt", version, arg_required_else_help = true, after_help = EXIT_CODES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Render(Box<render::Render>),
    Batch(batch::Batch),
    Merge(merge::Merge),
    Info(info::Info),
    Replay(Box<replay::Replay>),
    Ladder(ladder::Ladder),
    Study(study::StudyArguments),
    Compare(compare::Compare),
    Reference(Box<reference::Reference>),
    Convert(convert::Convert),
    Stress(stress::Stress),
}

const EXIT_CODES: &str = "\
Exit codes:
  0    the image was written, whole or up to a first Ctrl-C, SIGTERM or SIGHUP
  1    something failed while running, such as a full disk
       relt batch: also where a job failed, after all others
  2    nothing was begun: faulty options, scene or images, no Embree, unwritable files, checkpoints of something else
       relt convert: also with --strict where something would be left out
  3    relt render --strict: the picture cannot be trusted
       relt compare: an image exceeds a --max-… that was given
       relt reference: --time was over before --target-relmse was reached
       relt stress: a case failed
  130  ended at once by a second signal, without an image
       relt reference, relt study, relt batch: also by the first, before all was done; the same command goes on";

/// Runs the program on the process's arguments.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(message) => {
            // Help and version are messages too, to standard output and with code 0.
            drop(message.print());
            return ExitCode::from(message.exit_code() as u8);
        }
    };
    signals::survive_limits_of_files();
    let done = match arguments.command {
        Command::Render(arguments) => render::run(*arguments),
        Command::Batch(arguments) => batch::run(arguments),
        Command::Merge(arguments) => merge::run(arguments),
        Command::Info(arguments) => info::run(arguments),
        Command::Replay(arguments) => replay::run(*arguments),
        Command::Ladder(arguments) => ladder::run(arguments),
        Command::Study(arguments) => study::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Reference(arguments) => reference::run(*arguments),
        Command::Convert(arguments) => convert::run(arguments),
        Command::Stress(arguments) => stress::run(arguments),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            // A closed standard error is no reason to panic; the code still tells.
            drop(write!(io::stderr(), "{failure}"));
            failure.code()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        use clap::CommandFactory;
        Arguments::command().debug_assert();
    }
}
