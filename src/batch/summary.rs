//! What came of the jobs of a batch: a table for programs (CSV) and one for people.

use super::queue::{Event, Standing};
use crate::render::progress::{significant, with_unit};

/// A job with what came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Its number in the order of the job file, from 1.
    pub number: usize,
    /// The scene with its definitions, as on a command line.
    pub scene: String,
    /// The image as the job file has it.
    pub output: String,
    /// Where it stands; absent where it was never begun.
    pub standing: Option<Standing>,
}

/// Columns of the CSV.
const COLUMNS: [&str; 12] = [
    "job",
    "scene",
    "output",
    "status",
    "mutations",
    "load_seconds",
    "render_seconds",
    "write_seconds",
    "mean_luminance",
    "verdict",
    "attempts",
    "message",
];

impl Line {
    /// `waiting`, `begun`, `done`, `failed` or `interrupted`.
    pub fn status(&self) -> &'static str {
        match self.standing.as_ref().map(|standing| &standing.last) {
            None => "waiting",
            Some(Event::Begun) => "begun",
            Some(Event::Done(_)) => "done",
            Some(Event::Failed { .. }) => "failed",
            Some(Event::Interrupted) => "interrupted",
        }
    }

    /// Why it failed.
    pub fn failure(&self) -> Option<&str> {
        match self.standing.as_ref().map(|standing| &standing.last) {
            Some(Event::Failed { reason }) => Some(reason),
            _ => None,
        }
    }

    fn cells(&self) -> [String; 12] {
        let attempts = self.standing.as_ref().map_or(0, |standing| standing.attempts).to_string();
        let last = self.standing.as_ref().map(|standing| &standing.last);
        let found = match last {
            Some(Event::Done(found)) => Some(found),
            _ => None,
        };
        let number = |value: fn(&super::queue::Found) -> f64| found.map_or(String::new(), |f| value(f).to_string());
        let message = match last {
            Some(Event::Failed { reason }) => reason.clone(),
            _ => found.map_or(String::new(), |found| found.remarks.join("\n")),
        };
        [
            self.number.to_string(),
            self.scene.clone(),
            self.output.clone(),
            self.status().to_owned(),
            found.map_or(String::new(), |found| found.mutations.to_string()),
            number(|found| found.load_seconds),
            number(|found| found.render_seconds),
            number(|found| found.write_seconds),
            number(|found| found.mean_luminance),
            found.map_or(String::new(), |found| found.verdict.clone()),
            attempts,
            message,
        ]
    }
}

/// The table as CSV.
pub fn csv(lines: &[Line]) -> String {
    let mut table = ::csv::Writer::from_writer(Vec::new());
    let written = "memory takes what is written, and all lines are of the same length";
    table.write_record(COLUMNS).expect(written);
    lines.iter().for_each(|line| table.write_record(line.cells()).expect(written));
    String::from_utf8(table.into_inner().expect(written)).expect("made of strings")
}

/// The table in columns, with the reason of each failure below.
pub fn text(lines: &[Line]) -> String {
    let head = ["job", "status", "mutations", "load", "render", "write", "luminance", "verdict", "tries", "image"];
    let seconds = |value: f64| format!("{value:.2} s");
    let row = |line: &Line| -> [String; 10] {
        let nothing = String::new;
        let attempts = line.standing.as_ref().map_or(0, |standing| standing.attempts);
        let of_all = |middle: [String; 6]| {
            let [a, b, c, d, e, f] = middle;
            let (number, status) = (line.number.to_string(), line.status().to_owned());
            [number, status, a, b, c, d, e, f, attempts.to_string(), line.output.clone()]
        };
        match line.standing.as_ref().map(|standing| &standing.last) {
            Some(Event::Done(found)) => of_all([
                with_unit(found.mutations as f64),
                seconds(found.load_seconds),
                seconds(found.render_seconds),
                seconds(found.write_seconds),
                significant(found.mean_luminance, 4),
                found.verdict.clone(),
            ]),
            _ => of_all([nothing(), nothing(), nothing(), nothing(), nothing(), nothing()]),
        }
    };
    let rows: Vec<[String; 10]> = std::iter::once(head.map(str::to_owned)).chain(lines.iter().map(row)).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let mut text = String::new();
    for row in &rows {
        let cells = row.iter().enumerate().map(|(column, cell)| match column {
            1 | 7 | 9 => format!("{cell:width$}", width = widths[column]), // words
            _ => format!("{cell:>width$}", width = widths[column]),
        });
        text += cells.collect::<Vec<_>>().join("  ").trim_end();
        text.push('\n');
    }
    for line in lines {
        for (i, reason) in line.failure().into_iter().flat_map(str::lines).enumerate() {
            let before = if i == 0 { format!("failed: {}: ", line.output) } else { "    ".into() };
            text += &format!("{before}{reason}\n");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::queue::Found;
    use super::*;

    fn lines() -> Vec<Line> {
        let found = Found {
            mutations: 65_536,
            load_seconds: 0.5,
            render_seconds: 1.25,
            write_seconds: 0.0625,
            mean_luminance: 0.12345,
            verdict: "good".into(),
            remarks: vec!["a, b".into()],
        };
        let line = |number, output: &str, last: Option<Event>| Line {
            number,
            scene: "s.xml -D a=1".into(),
            output: output.into(),
            standing: last.map(|last| Standing { digest: "0".into(), attempts: 2, last }),
        };
        vec![
            line(1, "a.exr", Some(Event::Done(found))),
            line(2, "b/long.exr", Some(Event::Failed { reason: "no room\non the disk".into() })),
            line(3, "c.exr", None),
        ]
    }

    #[test]
    fn a_table_reads_back() {
        let text = csv(&lines());
        let mut table = ::csv::Reader::from_reader(text.as_bytes());
        assert_eq!(table.headers().unwrap(), COLUMNS.as_slice());
        let rows: Vec<Vec<String>> =
            table.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect();
        assert_eq!(
            rows[0],
            ["1", "s.xml -D a=1", "a.exr", "done", "65536", "0.5", "1.25", "0.0625", "0.12345", "good", "2", "a, b"]
        );
        assert_eq!((rows[1][3].as_str(), rows[1][11].as_str()), ("failed", "no room\non the disk"));
        assert_eq!((rows[2][3].as_str(), rows[2][10].as_str()), ("waiting", "0"));
    }

    #[test]
    fn people_read_columns() {
        let expected = "\
job  status   mutations    load  render   write  luminance  verdict  tries  image
  1  done        65.5 k  0.50 s  1.25 s  0.06 s     0.1235  good         2  a.exr
  2  failed                                                              2  b/long.exr
  3  waiting                                                             0  c.exr
failed: b/long.exr: no room
    on the disk
";
        assert_eq!(text(&lines()), expected);
    }
}
