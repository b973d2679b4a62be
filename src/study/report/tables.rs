//! The tables of a report.

use super::figures::{
    Cell, Table, UNKNOWN, brightness, count, mark_best, number, percent, ratio, ratio_interval, short, short_with,
    slope, time,
};
use crate::render::progress::significant;
use crate::study::results::Stage;
use crate::study::statistics::scaling::{Ladder, Scaling};
use crate::study::statistics::{Brightness, MethodSummary, SceneSummary, Spread};

/// Why a brightness is flagged.
pub const BIASED: &str = "the interval excludes 0: images are too dark or too bright, or this is the one of twenty \
                          that does so by chance";
/// Why a slope is flagged.
pub const ODD_SLOPE: &str = "the interval excludes −0.6 to −0.4: the error does not fall as that of independent \
                             samples does";

/// What matters most of a scene, a method a row.
pub fn summary(scene: &SceneSummary) -> Table {
    let target = scene.headline.map(|i| (i, scene.targets[i]));
    let speed_up = |method: &MethodSummary| target.and_then(|(i, _)| method.speed_ups[i]);
    let rows = scene.methods.iter().map(|method| {
        let faster = speed_up(method);
        let [bias, bias_half] = brightness(method.brightness.as_ref());
        let [slope_mean, slope_half] = slope(method.slope);
        vec![
            name(method),
            Cell::from(number(method.end_error.map(|error| error.median))).with(largest(method.between_seeds.largest)),
            match method.is_baseline && faster.is_some() {
                true => "1".into(),
                false => Cell::from(ratio(faster.as_ref())).with(ratio_interval(faster.as_ref())),
            },
            Cell::from(bias)
                .with(bias_half)
                .flagged(method.brightness.is_some_and(|brightness| brightness.biased()), BIASED),
            Cell::from(slope_mean).with(slope_half).flagged(method.slope_is_odd(), ODD_SLOPE),
            match method.is_baseline {
                true => "1".into(),
                false => ratio(method.efficiency_ratio.as_ref()).into(),
            },
            number(method.speed.map(|speed| speed.median * 1e-6)).into(),
        ]
    });
    let mut rows: Vec<Vec<Cell>> = rows.collect();
    let of = |value: &dyn Fn(&MethodSummary) -> Option<f64>| scene.methods.iter().map(value).collect::<Vec<_>>();
    mark_best(&mut rows, 1, &of(&|method| method.end_error.map(|error| error.median)), false);
    mark_best(&mut rows, 2, &of(&|method| speed_up(method)?.value.at_least()), true);
    mark_best(&mut rows, 5, &of(&|method| method.efficiency_ratio?.value.at_least()), true);
    let [width, height] = scene.scene.size;
    let goal = target.map_or(String::new(), |(_, error)| format!(", speed-up to √relMSE {}", short(error)));
    Table {
        caption: format!("{} ({width} × {height}){goal}", scene.scene.name),
        head: ["method", "√relMSE", "speed-up", "brightness error", "slope", "efficiency", "M mut./s"]
            .map(Into::into)
            .into(),
        rows,
    }
}

fn name(method: &MethodSummary) -> Cell {
    let runs = match method.method.runs.len() {
        0 => "no runs yet",
        _ if method.is_baseline => "baseline",
        _ => "",
    };
    Cell::from(&method.method.name[..]).with(runs)
}

fn largest(quotient: Option<f64>) -> String {
    quotient.map_or(String::new(), |quotient| format!("(≤ {quotient:.2}×)"))
}

/// When errors are reached.
pub fn times(scene: &SceneSummary) -> Table {
    let rows = scene.methods.iter().map(|method| {
        let cells = method.times.iter().zip(&method.speed_ups).map(|((at, reached), faster)| {
            let runs = method.method.runs.len();
            let reached = if *reached < runs { format!(" ({reached} of {runs} runs)") } else { String::new() };
            match method.is_baseline {
                true => Cell::from(time(*at)).with(reached.trim_start()),
                false => Cell::from(time(*at) + &reached).with(format!(
                    "{} {}",
                    ratio(faster.as_ref()),
                    ratio_interval(faster.as_ref())
                )),
            }
        });
        [name(method)].into_iter().chain(cells).collect()
    });
    let targets = scene.targets.iter().map(|target| format!("to {}", short(*target)));
    let mut rows: Vec<Vec<Cell>> = rows.collect();
    for i in 0..scene.targets.len() {
        let values: Vec<_> = scene.methods.iter().map(|method| method.speed_ups[i]?.value.at_least()).collect();
        mark_best(&mut rows, i + 1, &values, true);
    }
    Table {
        caption: "Time to reach an error (√relMSE), and how many times as fast as the baseline".into(),
        head: ["method".into()].into_iter().chain(targets).collect(),
        rows,
    }
}

/// Errors at equal time and at equal numbers of mutations, and how runs differ.
pub fn errors(scene: &SceneSummary) -> Table {
    let rows = scene.methods.iter().map(|method| {
        let spread = |spread: Option<Spread>| match spread {
            Some(spread) => Cell::from(number(Some(spread.median))).with(format!(
                "[{}, {}]",
                significant(spread.low, 3),
                significant(spread.high, 3)
            )),
            None => UNKNOWN.into(),
        };
        let [slope_mean, slope_half] = slope(method.slope);
        vec![
            name(method),
            spread(method.equal_time_error),
            spread(method.equal_mutations_error),
            spread(method.end_error),
            percent(method.between_seeds.error).into(),
            number(method.between_seeds.largest).into(),
            Cell::from(slope_mean).with(slope_half).flagged(method.slope_is_odd(), ODD_SLOPE),
        ]
    });
    let mut rows: Vec<Vec<Cell>> = rows.collect();
    for (column, error) in [
        (1, (|method| method.equal_time_error) as fn(&MethodSummary) -> Option<_>),
        (2, |method| method.equal_mutations_error),
        (3, |method| method.end_error),
    ] {
        let values: Vec<_> = scene.methods.iter().map(|method| error(method).map(|spread| spread.median)).collect();
        mark_best(&mut rows, column, &values, false);
    }
    Table {
        caption: "Error (√relMSE) and how runs differ".into(),
        head: vec![
            "method".into(),
            format!("at {}", short_with(scene.equal_time, "s")),
            format!("at {} mutations", count(scene.equal_mutations)),
            "at the end".into(),
            "deviation".into(),
            "largest/median".into(),
            "slope".into(),
        ],
        rows,
    }
}

/// What remains when noise is averaged away.
pub fn brightnesses(scene: &SceneSummary) -> Table {
    let rows = scene.methods.iter().map(|method| {
        let [bias, half] = brightness(method.brightness.as_ref());
        let of = |value: fn(&Brightness) -> Option<f64>| percent(method.brightness.as_ref().and_then(value));
        vec![
            name(method),
            Cell::from(bias)
                .with(half)
                .flagged(method.brightness.is_some_and(|brightness| brightness.biased()), BIASED),
            of(|brightness| brightness.deviation).into(),
            percent(method.stated_brightness_error).into(),
            of(|brightness| Some(brightness.reference_error)).into(),
        ]
    });
    Table {
        caption: "Brightness at the end; what runs state; the reference's own error".into(),
        head: ["method", "error", "deviation", "stated", "reference"].map(Into::into).into(),
        rows: rows.collect(),
    }
}

/// What work costs, and where time goes.
pub fn work(scene: &SceneSummary) -> Table {
    let rows = scene.methods.iter().map(|method| {
        let ahead = [
            name(method),
            number(method.speed.map(|speed| speed.median * 1e-6)).into(),
            number(method.rays_per_mutation).into(),
            number(method.efficiency.map(|efficiency| efficiency.median)).into(),
            match method.is_baseline {
                true => "1".into(),
                false => Cell::from(ratio(method.efficiency_ratio.as_ref()))
                    .with(ratio_interval(method.efficiency_ratio.as_ref())),
            },
        ];
        let stages = method.stages.iter().map(|seconds| match seconds {
            Some(seconds) => format!("{} s", significant(*seconds, 2)).into(),
            None => UNKNOWN.into(),
        });
        ahead.into_iter().chain(stages).collect()
    });
    let mut rows: Vec<Vec<Cell>> = rows.collect();
    let values: Vec<_> =
        scene.methods.iter().map(|method| method.efficiency.map(|efficiency| efficiency.median)).collect();
    mark_best(&mut rows, 3, &values, true);
    let head = ["method", "M mut./s", "rays/mut.", "efficiency", "× baseline"].map(String::from);
    Table {
        caption: "Work, efficiency 1/(relMSE · s) and wall time by stage".into(),
        head: head.into_iter().chain(Stage::ALL.map(|stage| stage.name().into())).collect(),
        rows,
    }
}

/// Ladders at the end of runs; none where no method has one.
pub fn ladders(scene: &SceneSummary) -> Option<Table> {
    let with_ladders = scene.methods.iter().filter_map(|method| method.ladder.map(|ladder| (method, ladder)));
    let rows: Vec<Vec<Cell>> = with_ladders
        .map(|(method, ladder)| {
            let trips = |trips: f64| number(Some(trips / ladder.ladders));
            vec![
                name(method),
                number(Some(ladder.swap_rate)).into(),
                number(Some(ladder.barrier)).into(),
                Cell::from(trips(ladder.round_trips)).with(format!("of {}", trips(ladder.predicted))),
                Cell::from(trips(ladder.restarts)),
                format!("{:.0}", ladder.ladders).into(),
                percent(Some(ladder.uniform_share)).into(),
            ]
        })
        .collect();
    let head = ["method", "swaps accepted", "barrier Λ", "round trips", "restarts", "ladders", "uniform"];
    (!rows.is_empty()).then(|| Table {
        caption: "Ladders in the last round: round trips and restarts by ladder, of those that swaps alone predict"
            .into(),
        head: head.map(Into::into).into(),
        rows,
    })
}

/// What changes with threads, ranks, parts or replicas.
pub fn scaling(scene: &SceneSummary, scaling: &Scaling) -> Table {
    let workers = scaling.varied.is_of_workers();
    let laddered = scaling.rows.iter().any(|row| row.ladder.is_some());
    let rows = scaling.rows.iter().map(|row| {
        let mut cells: Vec<Cell> = vec![
            Cell::from(row.number.to_string()).with(&row.method[..]),
            number(row.speed.map(|speed| speed.median * 1e-6)).into(),
            row.speed_up.map_or(UNKNOWN.into(), |speed_up| format!("{}×", significant(speed_up, 3))).into(),
        ];
        if workers {
            cells.push(percent(row.parallel_efficiency).into());
        }
        cells.extend([
            number(row.equal_time_error.map(|error| error.median)).into(),
            number(row.end_error.map(|error| error.median)).into(),
            number(row.efficiency).into(),
        ]);
        if laddered {
            let of = |value: fn(&Ladder) -> f64| row.ladder.as_ref().map(value);
            cells.extend([
                number(of(|ladder| ladder.swap_rate)).into(),
                Cell::from(number(of(|ladder| ladder.round_trips)))
                    .with(format!("of {}", number(of(|ladder| ladder.predicted)))),
                Cell::from(number(of(|ladder| ladder.round_trips / ladder.ladders)))
                    .with(format!("of {}", number(of(|ladder| ladder.predicted / ladder.ladders)))),
                number(of(|ladder| ladder.restarts)).into(),
                number(of(|ladder| ladder.barrier)).into(),
                percent(of(|ladder| ladder.uniform_share)).into(),
            ]);
        }
        cells
    });
    let mut rows: Vec<Vec<Cell>> = rows.collect();
    let errors: Vec<_> = scaling.rows.iter().map(|row| row.equal_time_error.map(|error| error.median)).collect();
    mark_best(&mut rows, if workers { 4 } else { 3 }, &errors, false);
    let mut head = vec![scaling.varied.option().to_owned(), "M mut./s".into(), "speed-up".into()];
    head.extend(workers.then(|| "parallel eff.".into()));
    head.extend([
        format!("√relMSE at {}", short_with(scene.equal_time, "s")),
        "at the end".into(),
        "efficiency".into(),
    ]);
    if laddered {
        let names = ["swaps", "round trips", "by ladder", "restarts", "Λ", "uniform"];
        head.extend(names.map(String::from));
    }
    Table { caption: format!("{}, by {}: {}", scene.scene.name, scaling.varied.option(), scaling.shared), head, rows }
}
