//! `relt info`: what a scene uses, and what is left out because it does not.

use std::io::{self, Write};

use clap::Args;

use super::failure::Failure;
use super::scene::{Opened, SceneArguments};

/// Prints what a scene uses, and what is therefore left out
#[derive(Args)]
pub(super) struct Info {
    #[command(flatten)]
    scene: SceneArguments,
}

/// Runs the subcommand.
pub(super) fn run(arguments: Info) -> Result<(), Failure> {
    match arguments.scene.faults() {
        faults if faults.is_empty() => {}
        faults => return Err(Failure::Input(faults)),
    }
    let opened = arguments.scene.open()?;
    // Whoever reads may have read enough, as `head` does.
    drop(writeln!(io::stdout(), "{}", describe(&opened)));
    Ok(())
}

/// CONNECT: the report's text.
fn describe(opened: &Opened) -> String {
    let mut lines = vec![opened.device.description(), format!("{:#?}", opened.scene.features)];
    lines.extend(opened.warnings.iter().map(|warning| format!("warning: {warning}")));
    lines.join("\n")
}
