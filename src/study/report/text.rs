//! The summary for the terminal.

use super::figures::{BEST, FLAG, Table};
use super::tables;
use crate::study::ladder_text::wrapped;
use crate::study::results::Results;
use crate::study::statistics::summary::summaries;

/// Letters a line for prose.
const WIDTH: usize = 100;

/// The summary as tables for the terminal, about 100 columns wide.
pub fn text(results: &Results) -> String {
    let mut sections =
        vec![vec![format!("{}: {} a run, baseline {}", results.title, results.budget, results.baseline)]];
    sections.extend(results.scenes.is_empty().then(|| vec!["no scenes".to_owned()]));
    let summaries = summaries(results);
    sections.extend(summaries.iter().map(|scene| lines(&tables::summary(scene))));
    let warnings: Vec<String> =
        results.warnings.iter().flat_map(|warning| wrapped(&format!("warning: {warning}"), WIDTH)).collect();
    sections.extend((!warnings.is_empty()).then_some(warnings));
    let legend = format!(
        "√relMSE at the end: median (≤ largest over median); speed-up: baseline's time to that error over ours \
         [95 % interval]; brightness error and slope ± 95 %; {BEST} best; {FLAG} brightness interval excludes 0, or \
         slope interval excludes −0.6 to −0.4"
    );
    sections.push(wrapped(&legend, WIDTH));
    sections.iter().map(|lines| lines.join("\n")).collect::<Vec<_>>().join("\n\n") + "\n"
}

/// A table with columns as wide as needed: names to the left, numbers to the right.
fn lines(table: &Table) -> Vec<String> {
    let cells = |row: &Vec<super::figures::Cell>| row.iter().map(|cell| cell.plain()).collect::<Vec<_>>();
    let rows: Vec<Vec<String>> = std::iter::once(table.head.clone()).chain(table.rows.iter().map(cells)).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..table.head.len()).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate().map(|(i, (cell, width))| match i {
            0 => format!("{cell:<width$}"),
            _ => format!("{cell:>width$}"),
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    std::iter::once(table.caption.clone()).chain(rows.iter().map(line)).collect()
}
