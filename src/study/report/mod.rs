//! What a study ends with: a page, a table of all snapshots, charts as files and a summary for the terminal.

mod charts;
mod csv;
mod figures;
mod page;
mod pictures;
mod tables;
mod text;

use std::io::Write;
use std::path::Path;

use crate::film::FileError;
use crate::film::file::write_whole;
use crate::study::results::Results;

pub use csv::csv;
pub use text::text;

/// Writes `report.html` into `folder`: a page that needs nothing else, with statistics, charts, and images to compare.
///
/// Images that cannot be read are told on the page and do not fail it.
pub fn write(results: &Results, folder: &Path) -> Result<(), FileError> {
    let page = page::page(results);
    write_whole(&folder.join("report.html"), |file| file.write_all(page.as_bytes()).map_err(|error| error.to_string()))
}

/// The page's charts by file name, such as `door-error-time.svg`.
pub fn plots(results: &Results) -> Vec<(String, String)> {
    let mut plots: Vec<(String, String)> = Vec::new();
    for chart in page::all_charts(results) {
        // Names that differ in punctuation alone would meet.
        let stem = chart.file.trim_end_matches(".svg");
        let names = std::iter::once(chart.file.clone()).chain((2..).map(|i| format!("{stem}-{i}.svg")));
        let free = names.into_iter().find(|name| plots.iter().all(|(taken, _)| taken != name));
        plots.push((free.expect("numbers do not end"), chart.svg));
    }
    plots
}
