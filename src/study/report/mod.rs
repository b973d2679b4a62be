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
use crate::study::file_name;
use crate::study::results::Results;
use crate::study::statistics::summary::summaries;

pub use csv::csv;
pub use text::text;

/// Writes `report.html` into `folder`: a page that needs nothing else, with statistics, charts, and images to compare.
///
/// Images that cannot be read are told on the page and do not fail it.
pub fn write(results: &Results, folder: &Path) -> Result<(), FileError> {
    let page = page::page(results);
    write_whole(&folder.join("report.html"), |file| file.write_all(page.as_bytes()).map_err(|error| error.to_string()))
}

/// The page's images as PNG files by name: `door-reference.png`, and of each method `door-NAME.png` at equal time and
/// `door-NAME-error.png`, its errors in the page's colours.
pub fn images(results: &Results) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for scene in summaries(results) {
        let name = file_name(&scene.scene.name);
        for picture in pictures::pictures(scene.scene, scene.equal_time).0 {
            let what = picture.source.map_or("reference".into(), |source| file_name(&source.method.name));
            files.extend(picture.errors.map(|errors| (format!("{name}-{what}-error.png"), errors)));
            files.push((format!("{name}-{what}.png"), picture.image));
        }
    }
    files
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
