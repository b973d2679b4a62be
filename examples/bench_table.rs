//! Tables of what benchmarks have measured, in Markdown.
//!
//! After `cargo bench`, or the part of it that a filter lets through,
//!
//! `cargo run --release --example bench_table`
//!
//! reads what criterion keeps in `target/criterion` (or in the folder that is given) and prints, as far as it was ever
//! measured there: mutations a second of every method and ladder, and by packet width; nanoseconds a mutation of every
//! stage; rays a second; and the tables of `benches/in_turn.rs`. Times are those that criterion prints: of a straight line
//! through its samples, or their mean.
//! Beside a number is its ratio to a baseline; ± is half of the 95 % confidence interval, for ratios as if both were
//! measured independently. Intervals tell how samples scattered, not whether the machine was as fast for both.

use std::{
    collections::BTreeSet,
    env,
    error::Error,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use serde_json::Value;

fn main() -> Result<(), Box<dyn Error>> {
    let target = || env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
    let folder = env::args_os().nth(1).map_or_else(|| target().join("criterion"), PathBuf::from);
    let benchmarks = read(&folder)?;
    if benchmarks.is_empty() && measured_in_turn(&folder)?.is_empty() {
        return Err(
            format!("no benchmark in {}; run some first, such as: cargo bench -- ladders", folder.display()).into()
        );
    }
    let tables: Vec<String> = TABLES.iter().filter_map(|table| table.of(&benchmarks)).collect();
    print!("{}", [tables, measured_in_turn(&folder)?].concat().join("\n"));
    Ok(())
}

/// The tables that `benches/in_turn.rs` has made, as they are.
fn measured_in_turn(folder: &Path) -> Result<Vec<String>, Box<dyn Error>> {
    let folder = folder.join("in-turn");
    let names = ["embree", "rungs", "threads", "kernels"].map(|name| folder.join(format!("{name}.md")));
    let tables = names
        .iter()
        .filter(|path| path.is_file())
        .map(|path| fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()).into()));
    tables.collect()
}

/// A number with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Interval {
    low: f64,
    value: f64,
    high: f64,
}

/// What criterion knows of a benchmark.
#[derive(Clone, Debug, PartialEq)]
struct Benchmark {
    /// Group, function and parameter, such as `mutations/ladders/caustic/re/8`.
    id: String,
    /// Nanoseconds for each element of its throughput, or for each iteration where it has none.
    time: Interval,
}

/// The latest results of all benchmarks in a folder and those within.
fn read(folder: &Path) -> Result<Vec<Benchmark>, Box<dyn Error>> {
    let mut benchmarks = Vec::new();
    let entries = fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        if path.join("benchmark.json").is_file() {
            if path.ends_with("new") {
                benchmarks.push(benchmark(&json(&path.join("benchmark.json"))?, &json(&path.join("estimates.json"))?)?);
            }
        } else if path.is_dir() {
            benchmarks.extend(read(&path)?);
        }
    }
    Ok(benchmarks)
}

fn json(path: &Path) -> Result<Value, Box<dyn Error>> {
    let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?)
}

fn benchmark(about: &Value, estimates: &Value) -> Result<Benchmark, Box<dyn Error>> {
    let id = about["full_id"].as_str().ok_or("a benchmark.json without full_id")?.to_owned();
    let elements = about["throughput"]["Elements"].as_f64().unwrap_or(1.0);
    let estimate = if estimates["slope"].is_null() { &estimates["mean"] } else { &estimates["slope"] };
    let number = |value: &Value| value.as_f64().ok_or(format!("{id}: no time in estimates.json"));
    let time = Interval {
        low: number(&estimate["confidence_interval"]["lower_bound"])? / elements,
        value: number(&estimate["point_estimate"])? / elements,
        high: number(&estimate["confidence_interval"]["upper_bound"])? / elements,
    };
    Ok(Benchmark { id, time })
}

/// Which benchmarks are shown together: a column for each scene, a row for each of what was measured there.
struct Table {
    title: &'static str,
    /// Ids are this, the column, and the row.
    prefix: &'static str,
    /// Whether a column belongs to the table.
    has: fn(&str) -> bool,
    unit: Unit,
    /// The row that a row is compared with.
    baseline: fn(&str) -> Option<String>,
}

/// What is told of a benchmark.
#[derive(Clone, Copy, PartialEq)]
enum Unit {
    /// Million elements a second.
    Millions,
    /// Nanoseconds for each element.
    Nanoseconds,
}

const TABLES: [Table; 7] = [
    Table {
        title: "Million mutations a second on one thread (and by those of `mlt`)",
        prefix: "mutations/ladders/",
        has: |_| true,
        unit: Unit::Millions,
        baseline: |_| Some("mlt".into()),
    },
    Table {
        title: "Million mutations a second by packet width (and by those of single rays)",
        prefix: "mutations/packets/",
        has: |_| true,
        unit: Unit::Millions,
        baseline: single_rays,
    },
    Table {
        title: "Million paths a second by mapping, of path tracing and of Embree alone (and of path tracing by the latter)",
        prefix: "mutations/mappings/",
        has: |_| true,
        unit: Unit::Millions,
        baseline: |row| row.strip_prefix("path/").map(|mapping| format!("embree/{mapping}")),
    },
    Table {
        title: "Nanoseconds that stages take for each mutation (`shade` has `propose/fresh` in it, `evaluate` is both and `trace`)",
        prefix: "stages/",
        has: |column| column != "ladders",
        unit: Unit::Nanoseconds,
        baseline: |_| None,
    },
    Table {
        title: "Nanoseconds that swaps take for each mutation, by threads and rungs",
        prefix: "stages/",
        has: |column| column == "ladders",
        unit: Unit::Nanoseconds,
        baseline: |_| None,
    },
    Table {
        title: "Nanoseconds of a mutation whose target costs nothing (and by those of `mlt`)",
        prefix: "ladders/",
        has: |_| true,
        unit: Unit::Nanoseconds,
        baseline: |_| Some("mlt".into()),
    },
    Table {
        title: "Million rays a second by packet width, Embree alone (and by those of single rays)",
        prefix: "tracing/packets/",
        has: |_| true,
        unit: Unit::Millions,
        baseline: single_rays,
    },
];

/// The same with packets of one ray; ids end with the width.
fn single_rays(row: &str) -> Option<String> {
    row.rsplit_once('/').map(|(what, _)| format!("{what}/1"))
}

impl Table {
    /// The table, if anything in it was measured.
    fn of(&self, benchmarks: &[Benchmark]) -> Option<String> {
        let place = |benchmark: &Benchmark| {
            let (column, row) = benchmark.id.strip_prefix(self.prefix)?.split_once('/')?;
            (self.has)(column).then(|| (column.to_owned(), row.to_owned()))
        };
        let cells: Vec<((String, String), Interval)> =
            benchmarks.iter().filter_map(|benchmark| Some((place(benchmark)?, benchmark.time))).collect();
        let time = |column: &str, row: &str| {
            cells.iter().find(|((c, r), _)| c == column && r == row).map(|(_, interval)| *interval)
        };
        let columns: BTreeSet<_> = cells.iter().map(|((column, _), _)| in_order(column)).collect();
        let rows: BTreeSet<_> = cells.iter().map(|((_, row), _)| in_order(row)).collect();
        let mut text = format!("{}:\n\n| |", self.title);
        columns.iter().for_each(|(_, column)| write!(text, " `{column}` |").expect("a string"));
        text.push_str("\n|---|");
        text.push_str(&"---|".repeat(columns.len()));
        for (_, row) in &rows {
            write!(text, "\n| {row} |").expect("a string");
            for (_, column) in &columns {
                let baseline = (self.baseline)(row).filter(|baseline| baseline != row);
                let baseline = baseline.and_then(|baseline| time(column, &baseline));
                let cell = time(column, row).map(|time| self.unit.cell(time, baseline)).unwrap_or_default();
                write!(text, " {cell} |").expect("a string");
            }
        }
        text.push('\n');
        (!cells.is_empty()).then_some(text)
    }
}

/// Names in the order in which they are to be read; others behind them.
const ORDER: [&str; 22] = [
    "cornell-box",
    "caustic",
    "lattice",
    "embree",
    "path",
    "mlt",
    "best-mlt",
    "re-auto",
    "re",
    "camera",
    "bounce",
    "shadow",
    "propose",
    "fresh",
    "stratified",
    "small",
    "trace",
    "shade",
    "evaluate",
    "accept",
    "splat",
    "swap",
];

/// An id with what it is sorted by: known names as in [`ORDER`], numbers as numbers.
fn in_order(id: &str) -> (Vec<(usize, u64)>, String) {
    let key =
        |part: &str| (ORDER.iter().position(|name| *name == part).unwrap_or(ORDER.len()), part.parse().unwrap_or(0));
    (id.split('/').map(key).collect(), id.to_owned())
}

impl Unit {
    /// A number and its ratio to a baseline, from times.
    fn cell(self, time: Interval, baseline: Option<Interval>) -> String {
        match self {
            Unit::Millions => number(time.inverse().times(1e3)) + &ratio(baseline.map(|b| b.by(time))),
            Unit::Nanoseconds => number(time) + &ratio(baseline.map(|b| time.by(b))),
        }
    }
}

/// Three digits.
fn number(interval: Interval) -> String {
    let digits = (2 - interval.value.abs().log10().floor() as i32).clamp(0, 3) as usize;
    format!("{:.digits$} ± {:.digits$}", interval.value, interval.half_width())
}

fn ratio(ratio: Option<Interval>) -> String {
    ratio.map_or_else(String::new, |ratio| format!(" ({:.2} ± {:.2})", ratio.value, ratio.half_width()))
}

impl Interval {
    fn inverse(self) -> Interval {
        Interval { low: 1.0 / self.high, value: 1.0 / self.value, high: 1.0 / self.low }
    }

    fn times(self, factor: f64) -> Interval {
        Interval { low: self.low * factor, value: self.value * factor, high: self.high * factor }
    }

    /// The ratio of two independent numbers: distances of logarithms add up as standard errors do.
    fn by(self, other: Interval) -> Interval {
        let value = self.value / other.value;
        let below = (self.value / self.low).ln().hypot((other.high / other.value).ln());
        let above = (self.high / self.value).ln().hypot((other.value / other.low).ln());
        Interval { low: value * (-below).exp(), value, high: value * above.exp() }
    }

    fn half_width(self) -> f64 {
        (self.high - self.low) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exactly(id: &str, time: f64) -> Benchmark {
        Benchmark { id: id.into(), time: Interval { low: time, value: time, high: time } }
    }

    #[test]
    fn errors_of_ratios_add_up_in_squares() {
        let [a, b] = [3.0, 4.0].map(|percent: f64| {
            let width = (percent / 100.0).exp();
            Interval { low: 2.0 / width, value: 2.0, high: 2.0 * width }
        });
        let ratio = a.by(b);
        assert!((ratio.value - 1.0).abs() < 1e-12, "{ratio:?}");
        assert!((ratio.high.ln() - 0.05).abs() < 1e-12 && (ratio.low.ln() + 0.05).abs() < 1e-12, "{ratio:?}");
    }

    #[test]
    fn a_table_has_scenes_and_ladders_in_their_order_and_what_was_not_measured_empty() {
        let benchmarks = [
            exactly("mutations/ladders/caustic/re/16", 4000.0),
            exactly("mutations/ladders/caustic/re/2", 2500.0),
            exactly("mutations/ladders/caustic/mlt", 2000.0),
            exactly("mutations/ladders/cornell-box/mlt", 1000.0),
            exactly("mutations/packets/caustic/mlt/1", 1000.0),
        ];
        let expected = "| | `cornell-box` | `caustic` |\n|---|---|---|\n\
            | mlt | 1.00 ± 0.00 | 0.500 ± 0.000 |\n\
            | re/2 |  | 0.400 ± 0.000 (0.80 ± 0.00) |\n\
            | re/16 |  | 0.250 ± 0.000 (0.50 ± 0.00) |\n";
        let table = TABLES[0].of(&benchmarks).expect("something was measured");
        assert!(table.ends_with(expected), "{table}");
        assert!(TABLES[2].of(&benchmarks).is_none());
    }

    #[test]
    fn tables_of_what_was_measured_in_turn_are_shown_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        assert!(measured_in_turn(folder.path()).unwrap().is_empty());
        fs::create_dir(folder.path().join("in-turn")).unwrap();
        fs::write(folder.path().join("in-turn/kernels.md"), "A table").unwrap();
        assert_eq!(measured_in_turn(folder.path()).unwrap(), ["A table"]);
        assert!(read(folder.path()).unwrap().is_empty());
    }

    #[test]
    fn times_are_for_each_element_and_of_the_latest_results_only() {
        let folder = tempfile::tempdir().unwrap();
        let estimate = r#"{ "confidence_interval": { "lower_bound": 90, "upper_bound": 120 }, "point_estimate": 100 }"#;
        for (which, elements) in [("base", 1), ("new", 10)] {
            let place = folder.path().join("mutations_ladders_caustic").join("mlt").join(which);
            fs::create_dir_all(&place).unwrap();
            let about = format!(
                r#"{{ "full_id": "mutations/ladders/caustic/mlt", "throughput": {{ "Elements": {elements} }} }}"#
            );
            fs::write(place.join("benchmark.json"), about).unwrap();
            fs::write(place.join("estimates.json"), format!(r#"{{ "mean": {estimate}, "slope": null }}"#)).unwrap();
        }
        let time = Interval { low: 9.0, value: 10.0, high: 12.0 };
        let expected = Benchmark { id: "mutations/ladders/caustic/mlt".into(), time };
        assert_eq!(read(folder.path()).unwrap(), [expected]);
    }
}
