//! Numerical stability: generated cases at the ends of what numbers, scenes and ladders can be, each with a known answer
//! or an invariance.
//!
//! A case is a closure that makes [`Check`]s; a group of cases is one file, and a line in [`GROUPS`]. Expected values come
//! from theory. A tolerance is either a bound on rounding, or so many standard errors of the mean over independent runs
//! that chance exceeds it with probability [`LEVEL`]; where that is too wide to tell anything, the check fails as well.
//! Seeds are fixed: a check gives the same numbers every time, on any number of threads.

mod bench;
mod check;
mod film;
mod geometry;
mod ladder;
mod light_size;
mod long_runs;
mod machine;
mod materials;
mod radiance;
mod scale;
mod scenes;
mod targets;

use std::time::{Duration, Instant};

use serde::Serialize;

pub use bench::Bench;
pub use check::{Check, LEVEL, Relation, Verdict, number};

/// A group of cases.
pub struct Group {
    /// What the names of its cases begin with.
    pub name: &'static str,
    /// What it is about, in a few words.
    pub subject: &'static str,
    /// Makes the cases.
    pub cases: fn() -> Vec<Case>,
}

/// All groups, in the order in which they run.
pub const GROUPS: [Group; 9] = [
    Group { name: "scale", subject: "units of length, and distance from the origin", cases: scale::cases },
    Group { name: "radiance", subject: "units of light, and its range within one image", cases: radiance::cases },
    Group { name: "light", subject: "small, hidden and point-like lights", cases: light_size::cases },
    Group {
        name: "materials",
        subject: "limits of roughness, refraction, albedo and path length",
        cases: materials::cases,
    },
    Group { name: "geometry", subject: "coincident, thin, degenerate and many triangles", cases: geometry::cases },
    Group { name: "ladder", subject: "ladders and targets of all shapes", cases: ladder::cases },
    Group { name: "long-runs", subject: "sums and counters after a very long time", cases: long_runs::cases },
    Group { name: "film", subject: "sizes, filters and crops", cases: film::cases },
    Group { name: "machine", subject: "threads, instruction sets, denormal numbers", cases: machine::cases },
];

/// Makes the checks of a case.
type Run = Box<dyn Fn(&Bench) -> Vec<Check>>;

/// One case.
pub struct Case {
    /// Name, of the form `group/what`.
    pub name: String,
    /// What should hold, and why: a sentence for the table.
    pub statement: String,
    /// Part of the quick suite, which takes less than a minute.
    pub quick: bool,
    run: Run,
}

impl Case {
    /// A case of the full suite.
    fn new(
        name: impl Into<String>,
        statement: impl Into<String>,
        run: impl Fn(&Bench) -> Vec<Check> + 'static,
    ) -> Case {
        Case { name: name.into(), statement: statement.into(), quick: false, run: Box::new(run) }
    }

    /// The same, of the quick suite as well where `quick` holds.
    fn quick_if(self, quick: bool) -> Case {
        Case { quick, ..self }
    }

    /// The same, of the quick suite as well.
    fn quick(self) -> Case {
        self.quick_if(true)
    }

    /// Runs it.
    pub fn run(&self, bench: &Bench) -> CaseReport {
        let begin = Instant::now();
        let checks = (self.run)(bench);
        CaseReport {
            case: self.name.clone(),
            statement: self.statement.clone(),
            verdict: checks.iter().map(|check| check.verdict).max().unwrap_or(Verdict::Fail),
            seconds: begin.elapsed().as_secs_f64(),
            checks,
        }
    }
}

/// The cases whose names contain one of the filters, or all where there is none; only those of the quick suite if `quick`.
pub fn selected(filters: &[String], quick: bool) -> Vec<Case> {
    let wanted =
        |case: &Case| (!quick || case.quick) && (filters.is_empty() || filters.iter().any(|f| case.name.contains(f)));
    GROUPS.iter().flat_map(|group| (group.cases)()).filter(wanted).collect()
}

/// What a case came to.
#[derive(Clone, Debug, Serialize)]
pub struct CaseReport {
    /// Its name.
    pub case: String,
    /// What should hold.
    pub statement: String,
    /// The worst of its checks'; a case without checks fails.
    pub verdict: Verdict,
    /// Wall time that it took.
    pub seconds: f64,
    /// All that was checked.
    pub checks: Vec<Check>,
}

impl CaseReport {
    /// The check that came closest to its limit, or went furthest beyond.
    pub fn closest(&self) -> Option<&Check> {
        self.checks.iter().max_by(|a, b| (a.verdict, a.strain()).partial_cmp(&(b.verdict, b.strain())).expect("no NaN"))
    }

    /// Checks that were passed.
    pub fn passed(&self) -> usize {
        self.checks.iter().filter(|check| check.verdict == Verdict::Pass).count()
    }
}

/// What a suite came to.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of the program.
    pub version: &'static str,
    /// Version of Embree.
    pub embree: String,
    /// Only the quick suite was run.
    pub quick: bool,
    /// Probability that chance fails a statistical check.
    pub level: f64,
    /// Wall time of all cases.
    pub seconds: f64,
    /// Case by case, in the order in which they ran.
    pub cases: Vec<CaseReport>,
}

impl Report {
    /// Of those cases.
    pub fn new(bench: &Bench, cases: Vec<CaseReport>, took: Duration) -> Report {
        let (major, minor, patch) = bench.device().version();
        Report {
            version: env!("CARGO_PKG_VERSION"),
            embree: format!("{major}.{minor}.{patch}"),
            quick: bench.is_quick(),
            level: LEVEL,
            seconds: took.as_secs_f64(),
            cases,
        }
    }

    /// Cases with a check that was not passed.
    pub fn failed(&self) -> impl Iterator<Item = &CaseReport> {
        self.cases.iter().filter(|case| case.verdict != Verdict::Pass)
    }

    /// The report as a table in Markdown, a row for each case with the check that came closest to its limit.
    pub fn markdown(&self) -> String {
        let mut text = "| case | what should hold | closest check | expected | got | tolerance | checks | verdict |\n\
                        |---|---|---|---|---|---|---|---|\n"
            .to_owned();
        for case in &self.cases {
            let Some(check) = case.closest() else { continue };
            text += &format!(
                "| `{}` | {} | {} | {} | {} | {} | {} of {} | {} |\n",
                case.case,
                case.statement,
                check.quantity,
                check.expected_in_words(),
                check::number(check.got),
                check::number(check.tolerance),
                case.passed(),
                case.checks.len(),
                case.verdict.name(),
            );
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_the_group_and_are_unique() {
        let mut names = Vec::new();
        for group in &GROUPS {
            for case in (group.cases)() {
                assert!(case.name.starts_with(&format!("{}/", group.name)), "{} in {}", case.name, group.name);
                assert!(!case.statement.is_empty() && !case.statement.contains('|'), "{}", case.name);
                names.push(case.name);
            }
        }
        let all = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), all);
    }

    #[test]
    fn filters_choose_by_parts_of_names() {
        assert!(selected(&["no such case".into()], false).is_empty());
        let scale = selected(&["scale/".into()], false);
        assert!(!scale.is_empty() && scale.iter().all(|case| case.name.starts_with("scale/")));
        assert!(selected(&["scale/".into()], true).len() < scale.len());
    }

    #[test]
    fn a_case_is_as_good_as_its_worst_check() {
        let report = |checks: Vec<Check>| {
            let case = Case::new("a/b", "it holds", move |_| checks.clone());
            case.run(&Bench::new(true).unwrap())
        };
        let [good, bad] = [1.0, 2.0].map(|got| Check::about("x", 1.0, got, 0.5));
        assert_eq!(report(vec![good.clone(), good.clone()]).verdict, Verdict::Pass);
        let report_of_both = report(vec![good.clone(), bad.clone(), good]);
        assert_eq!((report_of_both.verdict, report_of_both.passed()), (Verdict::Fail, 2));
        assert_eq!(report_of_both.closest(), Some(&bad));
        assert_eq!(report(Vec::new()).verdict, Verdict::Fail);
    }
}
