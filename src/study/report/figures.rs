//! Numbers as reports write them, and the tables they stand in.

use crate::render::progress::{significant, with_unit};
use crate::study::statistics::compare::{Bounded, Ratio};
use crate::study::statistics::{Brightness, Interval, Time};

/// What stands for a number that is not known.
pub const UNKNOWN: &str = "–";

/// A table for page and terminal.
pub struct Table {
    /// What it shows.
    pub caption: String,
    /// Names of columns.
    pub head: Vec<String>,
    /// Rows with as many cells; the first one names the row.
    pub rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// What it says.
    pub text: String,
    /// Further detail, less prominent; may be empty.
    pub detail: String,
    /// Whether it is the best of its kind.
    pub best: bool,
    /// What the reader should worry about; empty if nothing.
    pub flag: &'static str,
}

/// Stands at what should be looked at.
pub const FLAG: char = '⚑';
/// Stands at the best of its kind.
pub const BEST: char = '★';

impl Cell {
    /// With a detail behind it.
    pub fn with(self, detail: impl Into<String>) -> Cell {
        Cell { detail: detail.into(), ..self }
    }

    /// With a flag if there is reason.
    pub fn flagged(self, reason: bool, flag: &'static str) -> Cell {
        Cell { flag: if reason { flag } else { "" }, ..self }
    }

    /// Its words with all marks.
    pub fn plain(&self) -> String {
        let mut words = self.text.clone();
        if !self.detail.is_empty() {
            words = format!("{words} {}", self.detail);
        }
        if self.best {
            words.push(BEST);
        }
        if !self.flag.is_empty() {
            words = format!("{FLAG}{words}");
        }
        words
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Cell {
        Cell { text: text.into(), ..Cell::default() }
    }
}

/// Marks the greatest (or least) of a column's values, if there are several; equals are marked together.
pub fn mark_best(rows: &mut [Vec<Cell>], column: usize, values: &[Option<f64>], greatest: bool) {
    let known = || values.iter().flatten().copied().filter(|value| value.is_finite());
    let best = if greatest { known().reduce(f64::max) } else { known().reduce(f64::min) };
    if known().count() > 1 {
        for (row, value) in rows.iter_mut().zip(values).filter(|(_, value)| **value == best) {
            row[column].best = value.is_some();
        }
    }
}

/// Three digits.
pub fn number(value: Option<f64>) -> String {
    value.map_or(UNKNOWN.into(), |value| significant(value, 3))
}

/// Up to three digits, without zeros at their end: `32`, `0.12`.
pub fn short(value: f64) -> String {
    let digits = significant(value, 3);
    match digits.contains('.') && !digits.contains('e') {
        true => digits.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => digits,
    }
}

/// The same with a unit.
pub fn short_with(value: Option<f64>, unit: &str) -> String {
    match value {
        Some(value) if value.is_finite() => format!("{} {unit}", short(value)),
        _ => UNKNOWN.into(),
    }
}

/// `12.3 s`, `> 30 s`
pub fn time(time: Option<Time>) -> String {
    match time {
        None => UNKNOWN.into(),
        Some(Time::Before(bound)) => format!("< {} s", short(bound)),
        Some(Time::At(time)) => format!("{} s", significant(time, 3)),
        Some(Time::After(bound)) => format!("> {} s", short(bound)),
    }
}

/// `4.2×`, `> 4.2×`
pub fn ratio(ratio: Option<&Ratio>) -> String {
    ratio.map_or(UNKNOWN.into(), |ratio| bounded(ratio.value) + "×")
}

/// `[3.1, 5.0]`, `[3.1, > 5.0]`; empty where there is no interval.
pub fn ratio_interval(ratio: Option<&Ratio>) -> String {
    match ratio.and_then(|ratio| ratio.interval) {
        Some([low, high]) => format!("[{}, {}]", bounded(low), bounded(high)),
        None => String::new(),
    }
}

fn bounded(value: Bounded) -> String {
    match value {
        Bounded::AtMost(value) => format!("< {}", significant(value, 3)),
        Bounded::Exactly(value) => significant(value, 3),
        Bounded::AtLeast(value) => format!("> {}", significant(value, 3)),
    }
}

/// `−0.12 %` and `± 0.30 %`, with as many decimals as the interval has two digits.
pub fn brightness(brightness: Option<&Brightness>) -> [String; 2] {
    match brightness {
        None => [UNKNOWN.into(), String::new()],
        Some(Brightness { error, .. }) => {
            let [mean, half] = signed([100.0 * error.mean, 100.0 * error.half]);
            [format!("{mean} %"), if half.is_empty() { half } else { format!("± {half} %") }]
        }
    }
}

/// `−0.51` and `± 0.03`.
pub fn slope(slope: Option<Interval>) -> [String; 2] {
    match slope {
        None => [UNKNOWN.into(), String::new()],
        Some(Interval { mean, half }) => {
            let half = if half.is_finite() { format!("± {half:.2}") } else { String::new() };
            [minus(format!("{mean:+.2}")), half]
        }
    }
}

/// A value with its sign, and half its interval with two digits; the latter empty where it is not known.
fn signed([value, half]: [f64; 2]) -> [String; 2] {
    let known = half.is_finite() && half > 0.0;
    let digits_of = if known { half } else { value.abs().max(1e-3) };
    let decimals = (1 - digits_of.log10().floor() as i32).clamp(0, 6) as usize;
    [minus(format!("{value:+.decimals$}")), if known { format!("{half:.decimals$}") } else { String::new() }]
}

/// With a real minus sign, which is as wide as a plus.
fn minus(number: String) -> String {
    number.replace('-', "−")
}

/// `4.56 M`, and a space between number and unit that does not break.
pub fn count(value: Option<f64>) -> String {
    match value {
        Some(value) if value.is_finite() => with_unit(value).replace(' ', "\u{a0}"),
        _ => UNKNOWN.into(),
    }
}

/// `37 %`
pub fn percent(value: Option<f64>) -> String {
    match value {
        Some(value) if value.is_finite() => match 100.0 * value {
            share if share.abs() < 10.0 => format!("{} %", significant(share, 2)),
            share => format!("{share:.0} %"),
        },
        _ => UNKNOWN.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_with_what_is_known_of_them() {
        assert_eq!(time(Some(Time::After(30.0))), "> 30 s");
        assert_eq!(time(None), "–");
        assert_eq!([short(32.0), short(0.12), short(1200.0), short(1e-7)], ["32", "0.12", "1200", "1.00e-7"]);
        let open =
            Ratio { value: Bounded::Exactly(4.2), interval: Some([Bounded::Exactly(3.1), Bounded::AtLeast(5.0)]) };
        assert_eq!((ratio(Some(&open)).as_str(), ratio_interval(Some(&open)).as_str()), ("4.20×", "[3.10, > 5.00]"));
        let bias = |mean, half| Brightness { error: Interval { mean, half }, deviation: None, reference_error: 0.0 };
        assert_eq!(brightness(Some(&bias(-0.001_23, 0.003))), ["−0.12 %", "± 0.30 %"]);
        assert_eq!(brightness(Some(&bias(0.0123, f64::INFINITY))), ["+1.2 %", ""]);
        assert_eq!(brightness(Some(&bias(0.0, f64::INFINITY)))[0], "+0.0000 %");
        assert_eq!(slope(Some(Interval { mean: -0.5, half: 0.04 })), ["−0.50", "± 0.04"]);
        assert_eq!([percent(Some(0.37)), percent(Some(0.0123)), percent(Some(f64::NAN))], ["37 %", "1.2 %", "–"]);
    }

    #[test]
    fn the_best_is_marked_among_several() {
        let mut rows = vec![vec![Cell::from("a")], vec!["b".into()], vec!["c".into()]];
        mark_best(&mut rows, 0, &[Some(2.0), None, Some(3.0)], true);
        assert_eq!(rows.iter().map(|row| row[0].plain()).collect::<Vec<_>>(), ["a", "b", "c★"]);
        let mut alone = vec![vec![Cell::from("a")]];
        mark_best(&mut alone, 0, &[Some(2.0)], true);
        assert!(!alone[0][0].best);
    }
}
