//! A ladder as a page of charts, SVG.

use super::ladder_text::{facts, interpolate, wrapped};
use super::run_log::RunLog;
use super::svg::{Area, Axis, COLOURS, GRAY, Mark, Marks, Page, Panel, Series, points};
use crate::tempering::{Normaliser, RoundReport};

/// Pixels from one panel to the next, across and down.
const CELL: [f64; 2] = [500.0, 300.0];
const MARGIN: f64 = 20.0;
const LINE: f64 = 18.0;

/// Everything about a round, and the normalisers of all rounds.
pub fn draw(log: &RunLog, round: &RoundReport) -> String {
    let panels = [
        schedule(round),
        rejection(round),
        cumulative_barrier(round),
        local_barrier(round),
        index_process(round),
        normalisation(log),
        acceptance(round),
        step_sizes(round),
        luminance(round),
        image_shares(round),
    ];
    let facts = facts(log, round);
    let choices: Vec<String> = round.choices.iter().flat_map(|choice| wrapped(choice, 150)).collect();
    let top = MARGIN + 8.0 + LINE * (facts.len() + choices.len()) as f64 + 16.0;
    let rows = panels.len().div_ceil(2);
    let mut page = Page::new(2.0 * MARGIN + 2.0 * CELL[0], top + CELL[1] * rows as f64 + MARGIN);
    for (i, line) in facts.iter().chain(&choices).enumerate() {
        page.words(MARGIN, MARGIN + 8.0 + LINE * i as f64, if i == 0 { 16.0 } else { 12.0 }, line);
    }
    for (i, panel) in panels.iter().enumerate() {
        let (column, row) = ((i % 2) as f64, (i / 2) as f64);
        let (x, y) = (MARGIN + CELL[0] * column, top + CELL[1] * row);
        page.panel(Area { x, y, width: CELL[0] - 10.0, height: CELL[1] - 10.0 }, panel);
    }
    page.finish()
}

/// Linear from 0 to 1, or logarithmic where the second rung would stick to the first.
fn beta_axis(round: &RoundReport) -> Axis {
    const CLOSE: f64 = 0.03;
    let label = "inverse temperature β";
    match round.betas.iter().copied().find(|beta| *beta > 0.0) {
        Some(first) if first < CLOSE => Axis::log(label, round.betas.iter().copied()),
        _ => Axis::linear(label, [0.0, 1.0]),
    }
}

fn rung_axis(round: &RoundReport) -> Axis {
    Axis::whole("rung k (1: uniform)", [1, round.replicas])
}

/// Values of rungs or pairs over their numbers, from 1.
fn numbered(values: impl IntoIterator<Item = f64>) -> Vec<Mark> {
    points((1..).zip(values).map(|(k, value)| [f64::from(k), value]))
}

fn series(name: &str, colour: &'static str, marks: Marks, data: Vec<Mark>) -> Series {
    Series { name: name.into(), style: colour.into(), marks, data }
}

fn highest(values: impl Iterator<Item = f64>) -> f64 {
    values.filter(|value| value.is_finite()).fold(0.0, f64::max)
}

/// From the least to the greatest, with some room for marks.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let ends = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], end| [low.min(end), high.max(end)]);
    let margin = 0.03 * (ends[1] - ends[0]);
    [ends[0] - margin, ends[1] + margin]
}

fn schedule(round: &RoundReport) -> Panel {
    let betas = numbered(round.betas.iter().copied());
    Panel {
        title: "Inverse temperatures".into(),
        x: rung_axis(round),
        y: beta_axis(round),
        series: vec![series("", COLOURS[0], Marks::Lines, betas.clone()), series("", COLOURS[0], Marks::Dots, betas)],
    }
}

fn rejection(round: &RoundReport) -> Panel {
    let predicted = numbered(round.predicted_rejection.iter().copied());
    let top = highest(round.rejection.iter().chain(&round.predicted_rejection).copied());
    Panel {
        title: "Rejection of swaps".into(),
        x: Axis::whole("pair of rungs k and k + 1", [1, round.rejection.len().max(1)]),
        y: Axis::linear("probability of rejection", [0.0, top]),
        series: vec![
            series("predicted from the density of states", COLOURS[5], Marks::Bars { beside: 0, of: 1 }, predicted),
            series("measured", COLOURS[1], Marks::Dots, numbered(round.rejection.iter().copied())),
        ],
    }
}

fn cumulative_barrier(round: &RoundReport) -> Panel {
    let curve = &round.barrier_curve;
    let rungs = round.betas.iter().filter_map(|beta| interpolate(curve, *beta).map(|value| [*beta, value]));
    Panel {
        title: "Cumulative communication barrier".into(),
        x: beta_axis(round),
        y: Axis::linear("Λ(β), rejections", [0.0, highest(curve.iter().map(|[_, value]| *value))]),
        series: vec![
            series("Λ(β)", COLOURS[0], Marks::Lines, points(curve.iter().copied())),
            series("rungs", COLOURS[1], Marks::Dots, points(rungs)),
        ],
    }
}

fn local_barrier(round: &RoundReport) -> Panel {
    let curve = &round.local_barrier;
    Panel {
        title: "Local communication barrier".into(),
        x: beta_axis(round),
        y: Axis::linear("λ(β), rejections per unit of β", [0.0, highest(curve.iter().map(|[_, value]| *value))]),
        series: vec![series("λ(β) = dΛ/dβ", COLOURS[0], Marks::Lines, points(curve.iter().copied()))],
    }
}

fn index_process(round: &RoundReport) -> Panel {
    let longest = round.index_process.iter().map(Vec::len).max().unwrap_or(0);
    let stride = round.index_stride as f64;
    let path = |rungs: &[u16]| {
        let rungs = rungs.iter().map(|rung| f64::from(*rung) + 1.0);
        points(rungs.enumerate().map(|(i, rung)| [i as f64 * stride, rung]))
    };
    let replicas = round.index_process.iter().zip(COLOURS).enumerate();
    Panel {
        title: "Rungs of replicas".into(),
        x: Axis::linear("sweep of the round", [0.0, longest.saturating_sub(1).max(1) as f64 * stride.max(1.0)]),
        y: rung_axis(round),
        series: replicas
            .map(|(i, (rungs, colour))| {
                let number = if i == 0 { "replica 1".into() } else { format!("{}", i + 1) };
                series(&number, colour, Marks::Steps, path(rungs))
            })
            .collect(),
    }
}

fn normalisation(log: &RunLog) -> Panel {
    /// Rounds whose standard error is a larger share of the value do not decide the range of the axis.
    const VAGUE: f64 = 0.25;
    let estimates =
        |normaliser: Normaliser| log.rounds.iter().map(move |round| (round.round, round.normalisers.of(normaliser)));
    let all = || Normaliser::ALL.into_iter().flat_map(estimates).map(|(_, estimate)| estimate);
    let ends = all().filter(|estimate| estimate.ln_value.is_finite()).flat_map(|estimate| {
        let error = if estimate.relative_error < VAGUE { estimate.standard_error() } else { 0.0 };
        [estimate.value() - error, estimate.value() + error]
    });
    let rounds = [&log.rounds[0], &log.rounds[log.rounds.len() - 1]].map(|round| round.round as usize);
    let series_of = |(i, normaliser): (usize, Normaliser)| {
        let beside = 0.15 * (i as f64 - 1.0); // so that error bars do not hide one another
        let data = estimates(normaliser).map(|(round, estimate)| Mark {
            x: f64::from(round) + beside,
            y: estimate.value(),
            size: estimate.standard_error(),
        });
        series(normaliser.name(), [COLOURS[4], COLOURS[2], COLOURS[0]][i], Marks::Errors, data.collect())
    };
    Panel {
        title: "Normalisation by round, ± standard error".into(),
        x: Axis::whole("round (0: bootstrap)", rounds),
        y: Axis::linear("c, mean luminance", range(ends)),
        series: Normaliser::ALL.into_iter().enumerate().map(series_of).collect(),
    }
}

fn acceptance(round: &RoundReport) -> Panel {
    let scales = (1..).zip(&round.rungs).flat_map(|(k, rung)| {
        rung.scales.iter().map(move |scale| Mark { x: f64::from(k), y: scale.acceptance, size: 0.5 * scale.weight })
    });
    let rungs = numbered(round.rungs.iter().map(|rung| rung.acceptance));
    Panel {
        title: "Acceptance of mutations".into(),
        x: rung_axis(round),
        y: Axis::linear("probability of acceptance", [0.0, 1.0]),
        series: vec![
            series("by step size (area: weight)", GRAY, Marks::Bubbles, scales.collect()),
            series("", COLOURS[0], Marks::Lines, rungs.clone()),
            series("all", COLOURS[0], Marks::Dots, rungs),
        ],
    }
}

fn step_sizes(round: &RoundReport) -> Panel {
    let all = || (1..).zip(&round.rungs).flat_map(|(k, rung)| rung.scales.iter().map(move |scale| (k, scale)));
    let used = || all().filter(|(_, scale)| scale.weight > 0.0 && scale.size > 0.0);
    let bubbles = used().map(|(k, scale)| Mark { x: f64::from(k), y: scale.size, size: scale.weight });
    let means = (1..).zip(&round.rungs).map(|(k, rung)| {
        let used = || rung.scales.iter().filter(|scale| scale.weight > 0.0 && scale.size > 0.0);
        let (sum, weight) =
            used().fold((0.0, 0.0), |(s, w), scale| (s + scale.weight * scale.size.ln(), w + scale.weight));
        [f64::from(k), (sum / weight).exp()]
    });
    Panel {
        title: "Sizes of small steps".into(),
        x: rung_axis(round),
        y: Axis::log("share of the unit interval", used().map(|(_, scale)| scale.size).collect::<Vec<_>>().into_iter()),
        series: vec![
            series("size (area: weight)", COLOURS[5], Marks::Bubbles, bubbles.collect()),
            series("geometric mean", COLOURS[0], Marks::Lines, points(means)),
        ],
    }
}

fn luminance(round: &RoundReport) -> Panel {
    let rungs = || (1..).zip(&round.rungs).filter(|(_, rung)| rung.mean_ln_g.is_finite());
    let ends = rungs().flat_map(|(_, rung)| {
        let sd = if rung.sd_ln_g.is_finite() { rung.sd_ln_g } else { 0.0 };
        [rung.mean_ln_g - sd, rung.mean_ln_g + sd]
    });
    let data = rungs().map(|(k, rung)| Mark { x: f64::from(k), y: rung.mean_ln_g, size: rung.sd_ln_g });
    Panel {
        title: "Luminance of lit states".into(),
        x: rung_axis(round),
        y: Axis::linear("ln g", range(ends)),
        series: vec![series("mean ± standard deviation", COLOURS[0], Marks::Errors, data.collect())],
    }
}

fn image_shares(round: &RoundReport) -> Panel {
    let shares = |values: Vec<f64>| {
        let sum: f64 = values.iter().filter(|value| value.is_finite()).sum();
        values.into_iter().map(|value| value / sum).collect::<Vec<_>>()
    };
    let evaluations = shares(round.rungs.iter().map(|rung| rung.evaluations as f64).collect());
    let effective = shares(round.rungs.iter().map(|rung| rung.effective).collect());
    let image: Vec<f64> = round.rungs.iter().map(|rung| rung.image_share).collect();
    let top = highest(evaluations.iter().chain(&effective).chain(&image).copied());
    let bars = |beside: usize| Marks::Bars { beside, of: 3 };
    Panel {
        title: "Where effort goes and the image comes from".into(),
        x: rung_axis(round),
        y: Axis::linear("share of all rungs", [0.0, top]),
        series: vec![
            series("evaluations", "#bbbbbb", bars(0), numbered(evaluations)),
            series("effective samples", COLOURS[5], bars(1), numbered(effective)),
            series("luminance of the image", COLOURS[0], bars(2), numbered(image)),
        ],
    }
}
