//! What a study ends with: a page, a table of all snapshots, charts as files and a summary for the terminal.

mod csv;

use std::path::Path;

use crate::film::FileError;
use crate::film::file::write_whole;
use crate::study::results::Results;

pub use csv::csv;

/// Writes `report.html` into `folder`, a page that needs nothing else.
pub fn write(_results: &Results, folder: &Path) -> Result<(), FileError> {
    write_whole(&folder.join("report.html"), |_| Ok(()))
}

/// The page's charts by file name, such as `door-error-time.svg`.
pub fn plots(_results: &Results) -> Vec<(String, String)> {
    Vec::new()
}

/// The summary as a table for the terminal.
pub fn text(_results: &Results) -> String {
    String::new()
}
