//! The charts of a report.

use super::figures::{self, short};
use crate::render::progress::significant;
use crate::study::file_name;
use crate::study::results::{Clock, Results};
use crate::study::statistics::compare::Bounded;
use crate::study::statistics::curves::{Against, Moment, spread_over};
use crate::study::statistics::scaling::{Row, Scaling, Varied};
use crate::study::statistics::{MethodSummary, SceneSummary, Spread};
use crate::study::svg::{Area, Axis, Marks, Page, Panel, Series, Style, points};

/// A chart with what it is called.
pub struct Chart {
    /// Name of its file.
    pub file: String,
    /// What it shows, for those who do not see it.
    pub words: String,
    /// The chart.
    pub svg: String,
}

/// How methods look: the same on all scenes.
pub struct Styles<'a> {
    baseline: &'a str,
    others: Vec<&'a str>,
}

impl Styles<'_> {
    /// By order of first appearance.
    pub fn of(results: &Results) -> Styles<'_> {
        let mut others: Vec<&str> = Vec::new();
        for method in results.scenes.iter().flat_map(|scene| &scene.methods) {
            if method.name != results.baseline && !others.contains(&&method.name[..]) {
                others.push(&method.name);
            }
        }
        Styles { baseline: &results.baseline, others }
    }

    /// Of a method.
    pub fn style(&self, method: &str) -> Style {
        match self.others.iter().position(|other| *other == method) {
            _ if method == self.baseline => Style::of_baseline(),
            Some(i) => Style::numbered(i),
            None => Style::guide(),
        }
    }
}

/// Pixels of a chart of curves.
const SIZE: [f64; 2] = [560.0, 430.0];

fn chart(scene: &SceneSummary, what: &str, words: String, [width, height]: [f64; 2], panel: &Panel) -> Chart {
    let mut page = Page::new(width, height);
    page.panel(Area { x: 4.0, y: 2.0, width: width - 8.0, height: height - 4.0 }, panel);
    Chart { file: format!("{}-{what}.svg", file_name(&scene.scene.name)), words, svg: page.finish() }
}

fn series(name: &str, style: Style, marks: Marks, data: impl IntoIterator<Item = [f64; 2]>) -> Series {
    Series { name: name.into(), style, marks, data: points(data) }
}

/// Error against time or mutations: medians with bands over runs, a line of slope −½, and short lines at the bottom
/// where runs are set up. None where nothing is known.
pub fn errors(results: &Results, styles: &Styles, scene: &SceneSummary, against: Against) -> Option<Chart> {
    let curves: Vec<(&MethodSummary, Vec<Moment>)> =
        scene.methods.iter().map(|method| (method, spread_over(&method.method.runs, against))).collect();
    let moments = || curves.iter().flat_map(|(_, moments)| moments);
    let first = moments().map(|moment| moment.at).reduce(f64::min)?;
    let last = moments().map(|moment| moment.at).reduce(f64::max)?;
    let x_label = match (against, results.clock) {
        (Against::Mutations, _) => "mutations",
        (Against::Seconds, Clock::Wall) => "seconds",
        (Against::Seconds, Clock::Cpu) => "processor seconds by thread",
    };
    let x = Axis::log(x_label, [first, last].into_iter());
    let bounds: Vec<f64> = moments()
        .flat_map(|Moment { error, .. }| if has_bands(scene) { [error.low, error.high] } else { [error.median; 2] })
        .collect();
    let y = Axis::log("√relMSE", bounds.iter().copied());
    let mut all = vec![guide(&x, &y, moments().map(|moment| [moment.at, moment.error.median]))];
    let [bottom, top] = y.ends();
    for (method, moments) in &curves {
        let style = styles.style(&method.method.name);
        let low = moments.iter().map(|moment| [moment.at, moment.error.low]);
        let high = moments.iter().rev().map(|moment| [moment.at, moment.error.high]);
        if has_bands(scene) {
            all.push(series("", style, Marks::Band, low.chain(high)));
        }
        let set_up = method.set_up.filter(|at| against == Against::Seconds && *at > x.ends()[0] && *at < x.ends()[1]);
        let short = bottom.powf(0.95) * top.powf(0.05);
        all.push(series(
            "",
            style.without_shape(),
            Marks::Segments,
            set_up.into_iter().flat_map(|at| [[at, bottom * 1.000_001], [at, short]]),
        ));
    }
    for (method, moments) in &curves {
        let medians = moments.iter().map(|moment| [moment.at, moment.error.median]);
        all.push(series(&method.method.name, styles.style(&method.method.name), Marks::Lines, medians));
    }
    // The guide's name comes last.
    all[0].name.clear();
    all.push(series("slope −½", Style::guide(), Marks::Lines, []));
    let (what, noun) = match against {
        Against::Seconds => ("error-time", "time"),
        Against::Mutations => ("error-mutations", "mutations"),
    };
    let title = format!("{}: error against {noun}", scene.scene.name);
    let words = format!("{title}, both logarithmic, a line for each of {} methods", scene.methods.len());
    Some(chart(scene, what, words, SIZE, &Panel { title, x, y, series: all }))
}

/// Whether bands over runs can be told from one another.
pub fn has_bands(scene: &SceneSummary) -> bool {
    const MOST: usize = 8;
    scene.methods.len() <= MOST
}

/// A line of slope −½ through the middle of what is drawn, cut at the frame.
fn guide(x: &Axis, y: &Axis, all: impl Iterator<Item = [f64; 2]>) -> Series {
    let logarithms: Vec<[f64; 2]> = all.map(|[x, y]| [x.ln(), y.ln()]).collect();
    let mean = |i: usize| logarithms.iter().map(|point| point[i]).sum::<f64>() / logarithms.len() as f64;
    let [x_mean, y_mean] = [mean(0), mean(1)];
    let ([left, right], [bottom, top]) = (x.ends().map(f64::ln), y.ends().map(f64::ln));
    let x_at = |y: f64| x_mean - 2.0 * (y - y_mean);
    let (from, to) = (left.max(x_at(top)), right.min(x_at(bottom)));
    let y_at = |x: f64| y_mean - 0.5 * (x - x_mean);
    // A hair inside, for what is outside is left out.
    let inside = |x: f64| [x.exp(), y_at(x).exp().max(bottom.exp() * 1.000_001)];
    series("", Style::guide(), Marks::Lines, [inside(from), inside(to)])
}

/// A value of a method with its interval.
struct Whisker<'a> {
    method: &'a MethodSummary<'a>,
    /// Infinite where it is open.
    low: f64,
    /// None where only a bound is known.
    middle: Option<f64>,
    /// Infinite where it is open.
    high: f64,
    /// The value in words.
    words: String,
}

/// How much too bright images are, with intervals; none where nothing is known.
pub fn brightness<'a>(styles: &Styles, scene: &'a SceneSummary<'a>) -> Option<Chart> {
    let whisker = |method: &'a MethodSummary<'a>| {
        let error = method.brightness?.error;
        let half = if error.half.is_finite() { error.half } else { 0.0 };
        let [low, middle, high] = [error.mean - half, error.mean, error.mean + half].map(|share| 100.0 * share);
        Some(Whisker { method, low, middle: Some(middle), high, words: significant(middle, 2) + " %" })
    };
    let whiskers: Vec<Whisker> = scene.methods.iter().filter_map(whisker).collect();
    let furthest = whiskers.iter().flat_map(|at| [at.low.abs(), at.high.abs()]).reduce(f64::max)?;
    let furthest = if furthest > 0.0 { 1.05 * furthest } else { 1.0 };
    let x = Axis::linear("brightness error in %, 95 % interval", [-furthest, furthest]);
    let title = format!("{}: brightness against the reference", scene.scene.name);
    Some(whisker_chart(styles, scene, "brightness", title, x, 0.0, &whiskers))
}

/// How many times as fast as the baseline methods reach the headline's error; none where nothing is known.
pub fn speed_ups<'a>(styles: &Styles, scene: &'a SceneSummary<'a>) -> Option<Chart> {
    let target = scene.headline?;
    let whisker = |method: &'a MethodSummary<'a>| {
        let ratio = method.speed_ups[target]?;
        let [low, high] = ratio.interval.unwrap_or([ratio.value; 2]);
        Some(Whisker {
            method,
            low: low.at_least().unwrap_or(f64::NEG_INFINITY),
            middle: matches!(ratio.value, Bounded::Exactly(_)).then_some(ratio.value.value()),
            high: high.at_most().unwrap_or(f64::INFINITY),
            words: figures::ratio(Some(&ratio)),
        })
    };
    let whiskers: Vec<Whisker> =
        scene.methods.iter().filter(|method| !method.is_baseline).filter_map(whisker).collect();
    if whiskers.is_empty() {
        return None;
    }
    let baseline = scene.methods.iter().find(|method| method.is_baseline).map_or("the baseline", |m| &m.method.name);
    let known = whiskers.iter().flat_map(|at| [at.low, at.middle.unwrap_or(f64::NAN), at.high]);
    let known: Vec<f64> = known.chain([1.0]).filter(|value| value.is_finite()).collect();
    let x = Axis::log(&format!("times as fast as {baseline}, 95 % interval"), known.into_iter());
    let title = format!("{}: speed-up to √relMSE {}", scene.scene.name, short(scene.targets[target]));
    Some(whisker_chart(styles, scene, "speed-up", title, x, 1.0, &whiskers))
}

/// A row for each method with a dot and its interval, to the frame where that is open; and a line at what counts as no
/// difference.
fn whisker_chart(
    styles: &Styles,
    scene: &SceneSummary,
    what: &str,
    title: String,
    x: Axis,
    neutral: f64,
    whiskers: &[Whisker],
) -> Chart {
    let names: Vec<String> = whiskers.iter().map(|at| at.method.method.name.clone()).collect();
    let bottom = 0.5 - whiskers.len() as f64;
    let mut all = vec![series("", Style::guide(), Marks::Lines, [[neutral, 0.5], [neutral, bottom]])];
    let [least, greatest] = x.ends();
    for (i, Whisker { method, low, middle, high, .. }) in whiskers.iter().enumerate() {
        let (style, y) = (styles.style(&method.method.name), -(i as f64));
        let ends = [low.max(least + 1e-9 * least.abs()), high.min(greatest)]; // a hair inside
        all.push(series("", style.colour.into(), Marks::Segments, ends.map(|end| [end, y])));
        all.push(series("", style, Marks::Dots, middle.map(|middle| [middle, y])));
    }
    let values: Vec<String> = whiskers.iter().map(|at| format!("{} {}", at.method.method.name, at.words)).collect();
    let words = format!("{title}: {}", values.join(", "));
    let size = [SIZE[0], 104.0 + 24.0 * whiskers.len() as f64];
    let panel = Panel { title, x, y: Axis::named("", &names), series: all };
    chart(scene, what, words, size, &panel)
}

/// Speed and error by threads, ranks or parts, or error and round trips by replicas.
pub fn scaling(styles: &Styles, scene: &SceneSummary, number: usize, scaling: &Scaling) -> Vec<Chart> {
    let charts = match scaling.varied {
        Varied::Replicas => [error_by(styles, scene, number, scaling), trips_by_replicas(scene, number, scaling)],
        _ => [speed_by(scene, number, scaling), error_by(styles, scene, number, scaling)],
    };
    charts.into_iter().flatten().collect()
}

/// Medians with bars over runs.
fn spread_series(name: &str, style: Style, spreads: &[(f64, Spread)]) -> [Series; 2] {
    let bars = spreads.iter().flat_map(|(x, spread)| [[*x, spread.low], [*x, spread.high]]);
    let medians = spreads.iter().map(|(x, spread)| [*x, spread.median]);
    [series("", style.without_shape(), Marks::Segments, bars), series(name, style, Marks::Lines, medians)]
}

fn spreads(scaling: &Scaling, of: impl Fn(&Row) -> Option<Spread>) -> Vec<(f64, Spread)> {
    scaling.rows.iter().filter_map(|row| Some((row.number as f64, of(row)?))).collect()
}

fn number_axis(scaling: &Scaling) -> Axis {
    let numbers: Vec<usize> = scaling.rows.iter().map(|row| row.number).collect();
    Axis::log_at(if scaling.varied == Varied::Replicas { "replicas K" } else { scaling.varied.option() }, &numbers)
}

fn speed_by(scene: &SceneSummary, number: usize, scaling: &Scaling) -> Option<Chart> {
    let measured: Vec<(f64, Spread)> = spreads(scaling, |row| row.speed);
    let (fewest, first) = *measured.first()?;
    let more = |workers: f64| if scaling.varied.is_of_workers() { workers / fewest } else { 1.0 };
    let ideal = measured.iter().map(|(workers, _)| [*workers, first.median * more(*workers)]);
    let values = measured.iter().flat_map(|(_, speed)| [speed.low, speed.high]).chain(ideal.clone().map(|at| at[1]));
    let y = Axis::log("mutations per second", values.collect::<Vec<_>>().into_iter());
    let like = if scaling.varied.is_of_workers() { "as many times the first" } else { "like the first" };
    let mut all = vec![series(like, Style::guide(), Marks::Lines, ideal)];
    all.extend(spread_series("measured", Style::numbered(0), &measured));
    let title = format!("{}: speed by {}", scene.scene.name, scaling.varied.option());
    let what = format!("{}-{}-speed", scaling.varied.option(), number + 1);
    let panel = Panel { title: title.clone(), x: number_axis(scaling), y, series: all };
    Some(chart(scene, &what, title, SIZE, &panel))
}

fn error_by(styles: &Styles, scene: &SceneSummary, number: usize, scaling: &Scaling) -> Option<Chart> {
    let measured = spreads(scaling, |row| row.equal_time_error);
    let ends = [measured.first()?.0, measured.last()?.0];
    let baseline = scene.methods.iter().find(|method| method.is_baseline);
    let baseline = baseline.filter(|method| scaling.rows.iter().all(|row| row.method != method.method.name));
    let baseline = baseline.and_then(|method| Some((&method.method.name, method.equal_time_error?.median)));
    let values = measured.iter().flat_map(|(_, error)| [error.low, error.high]);
    let values: Vec<f64> = values.chain(baseline.map(|(_, error)| error)).collect();
    let mut all: Vec<Series> = spread_series("median, bars over runs", Style::numbered(0), &measured).into();
    all.extend(baseline.map(|(name, error)| {
        let style = Style { dash: "4 4", ..styles.style(name).without_shape() };
        series(name, style, Marks::Lines, ends.map(|end| [end, error]))
    }));
    let option = scaling.varied.option();
    let time = short(scene.equal_time?);
    let title = format!("{}: error at {time} s by {option}", scene.scene.name);
    let y = Axis::log("√relMSE", values.into_iter());
    let what = format!("{option}-{}-error", number + 1);
    let panel = Panel { title: title.clone(), x: number_axis(scaling), y, series: all };
    Some(chart(scene, &what, title, SIZE, &panel))
}

/// Round trips by ladder, measured and as swaps alone predict.
fn trips_by_replicas(scene: &SceneSummary, number: usize, scaling: &Scaling) -> Option<Chart> {
    let ladders = || scaling.rows.iter().filter_map(|row| Some((row.number as f64, row.ladder?)));
    let measured = ladders().map(|(replicas, ladder)| [replicas, ladder.round_trips / ladder.ladders]);
    let predicted = ladders().map(|(replicas, ladder)| [replicas, ladder.predicted / ladder.ladders]);
    let top = measured.clone().chain(predicted.clone()).map(|at| at[1]).filter(|trips| trips.is_finite());
    let top = top.reduce(f64::max)?;
    let title = format!("{}: round trips by replicas", scene.scene.name);
    let all = vec![
        series("as swaps alone predict", Style::guide(), Marks::Lines, predicted),
        series("measured", Style::numbered(0), Marks::Lines, measured),
    ];
    let y = Axis::linear("round trips by ladder in the last round", [0.0, top]);
    let what = format!("replicas-{}-round-trips", number + 1);
    let panel = Panel { title: title.clone(), x: number_axis(scaling), y, series: all };
    Some(chart(scene, &what, title, SIZE, &panel))
}
