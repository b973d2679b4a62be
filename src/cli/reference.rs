//! stub
use super::failure::Failure;
use clap::Args;
/// stub
#[derive(Args)]
pub(super) struct Reference {}
pub(super) fn run(_: Reference) -> Result<(), Failure> {
    Ok(())
}
