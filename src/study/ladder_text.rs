//! A ladder for the terminal: tables and small curves, 80 columns wide.

use super::run_log::RunLog;
use crate::render::progress::{significant, with_unit};
use crate::tempering::{LnEstimate, Normaliser, RoundReport};

/// Everything about a round, and the normalisers of all rounds.
pub fn draw(log: &RunLog, round: &RoundReport) -> String {
    let sections = [
        facts(log, round),
        rungs(round),
        scales(round),
        pairs(round),
        curves(round),
        index_process(round),
        normalisers(log),
        choices(round),
    ];
    let written: Vec<String> =
        sections.iter().filter(|lines| !lines.is_empty()).map(|lines| lines.join("\n")).collect();
    written.join("\n\n") + "\n"
}

/// The round in a few lines of at most 80 letters (but for the scene's name).
pub fn facts(log: &RunLog, round: &RoundReport) -> Vec<String> {
    let (first, last) = (log.rounds[0].round, log.rounds[log.rounds.len() - 1].round);
    let c = round.normalisers.of(round.used);
    let scene = if log.scene.is_empty() { "unknown scene" } else { &log.scene };
    let mut lines = vec![
        format!("{scene}: round {} of {first} to {last}", round.round),
        format!(
            "{} replicas on {} ladders; so far {} mutations, {} rays, {} not finite",
            round.replicas,
            round.ladders,
            with_unit(round.mutations as f64),
            with_unit(round.rays as f64),
            round.non_finite
        ),
        format!(
            "barrier Λ = {}, lit share p_s = {}, c = {} by {}",
            significant(round.barrier, 3),
            significant(round.lit_share, 3),
            with_error(c),
            round.used.name()
        ),
        format!(
            "{} of evaluations uniform, {} offers a sweep, chain states count ρ = {}",
            percent(round.uniform_share),
            round.offers,
            significant(round.chain_ratio, 3)
        ),
        format!(
            "{} round trips ({} predicted), {} restarts",
            round.round_trips,
            significant(round.round_trips_predicted, 3),
            round.restarts
        ),
        format!(
            "longest run of rejected mutations {}, split R̂ {} ({} of image blocks)",
            round.longest_rejection_run,
            significant(round.split_r_hat, 4),
            significant(round.split_r_hat_image, 4)
        ),
    ];
    let before = round.image_share_before;
    lines.extend(before.map(|share| format!("{} of the image from before the settings were frozen", percent(share))));
    lines
}

fn rungs(round: &RoundReport) -> Vec<String> {
    if round.rungs.is_empty() {
        return Vec::new();
    }
    let header = "rung         β      ln Ẑ  accept evaluations effective  image  dark    ln g ± sd";
    let rows = round.rungs.iter().enumerate().map(|(k, rung)| {
        format!(
            "{:>4}{:>10}{:>10}{:>8}{:>12}{:>10}{:>7}{:>6}{:>13}",
            k + 1,
            significant(rung.beta, 4),
            significant(round.ln_z.get(k).copied().unwrap_or(f64::NAN), 4),
            fixed(rung.acceptance, 2),
            with_unit(rung.evaluations as f64),
            with_unit_or_dash(rung.effective),
            percent(rung.image_share),
            percent(rung.dark_share),
            format!("{} ± {}", fixed(rung.mean_ln_g, 1), fixed(rung.sd_ln_g, 1)),
        )
    });
    [header.into()].into_iter().chain(rows).collect()
}

/// Step sizes with their weights and acceptance, those that are chosen at all.
fn scales(round: &RoundReport) -> Vec<String> {
    let tempered = round.rungs.iter().enumerate().filter(|(_, rung)| !rung.scales.is_empty());
    let rows: Vec<String> = tempered
        .flat_map(|(k, rung)| {
            let cells: Vec<String> = rung
                .scales
                .iter()
                .filter(|scale| scale.weight > 0.0)
                .map(|scale| {
                    let size = significant(scale.size, 2);
                    format!("{:<25}", format!("{size} ({}, {})", percent(scale.weight), fixed(scale.acceptance, 2)))
                })
                .collect();
            let rows = cells.chunks(3).map(<[String]>::concat).collect::<Vec<_>>();
            rows.into_iter().enumerate().map(move |(i, row)| match i {
                0 => format!("{:>4} {}", k + 1, row.trim_end()),
                _ => format!("{:>4} {}", "", row.trim_end()),
            })
        })
        .collect();
    match rows.is_empty() {
        true => rows,
        false => [vec!["rung step size (weight, acceptance)".into()], rows].concat(),
    }
}

/// Columns of a bar from 0 to 1.
const BAR: usize = 40;

fn pairs(round: &RoundReport) -> Vec<String> {
    if round.rejection.is_empty() {
        return Vec::new();
    }
    let header = format!("{:<9}{:>10}{:>11}  0{:BAR$}1", "swaps of", "rejected", "predicted", "");
    let rows = round.rejection.iter().enumerate().map(|(k, &measured)| {
        let predicted = round.predicted_rejection.get(k).copied().unwrap_or(f64::NAN);
        let pair = format!("{} and {}", k + 1, k + 2);
        let (measured_text, predicted_text) = (fixed(measured, 3), fixed(predicted, 3));
        format!("{pair:<9}{measured_text:>10}{predicted_text:>11}  |{}|", bar(measured, predicted))
    });
    [header].into_iter().chain(rows).collect()
}

/// A bar as long as `value`, 0 to 1, with a mark where `other` is.
fn bar(value: f64, other: f64) -> String {
    let column = |value: f64| (value.clamp(0.0, 1.0) * BAR as f64).round() as usize; // NaN is 0
    let mark = other.is_finite().then(|| column(other).min(BAR - 1));
    let filled = column(value);
    (0..BAR)
        .map(|i| {
            if mark == Some(i) {
                '┃'
            } else if i < filled {
                '▒'
            } else {
                ' '
            }
        })
        .collect()
}

/// Columns of a curve.
const CURVE: usize = 56;

fn curves(round: &RoundReport) -> Vec<String> {
    let curves = [("Λ(β)", &round.barrier_curve), ("λ(β)", &round.local_barrier)];
    let rows: Vec<String> = curves
        .iter()
        .filter_map(|(name, curve)| {
            let highest = curve.iter().map(|[_, value]| *value).fold(f64::NAN, f64::max);
            let samples: Vec<f64> =
                (0..CURVE).map(|i| interpolate(curve, i as f64 / (CURVE - 1) as f64)).collect::<Option<_>>()?;
            Some(format!("{name:<6}{}  0 to {}", sparkline(&samples, highest), significant(highest, 3)))
        })
        .collect();
    match rows.is_empty() {
        true => rows,
        false => [vec![format!("{:<6}β = 0{:>width$}", "", "1", width = CURVE - 5)], rows].concat(),
    }
}

/// The value of a curve of ascending [x, y] at x, from the straight line between neighbours; the end beyond its ends.
pub fn interpolate(curve: &[[f64; 2]], x: f64) -> Option<f64> {
    let right = curve.partition_point(|[at, _]| *at < x);
    match (right.checked_sub(1).map(|left| curve[left]), curve.get(right)) {
        (Some([x0, y0]), Some([x1, y1])) => Some(y0 + (y1 - y0) * (x - x0) / (x1 - x0)),
        (Some([_, y]), None) => Some(y),
        (None, Some([_, y])) => Some(*y),
        (None, None) => None,
    }
}

/// Eighths of a letter's height by value from 0 to `highest`.
fn sparkline(values: &[f64], highest: f64) -> String {
    const EIGHTHS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let letter = |value: &f64| match value / highest {
        share if share.is_finite() => EIGHTHS[((share * 8.0) as usize).min(7)],
        _ => ' ',
    };
    values.iter().map(letter).collect()
}

/// The rungs of replicas as time goes by: low is the uniform rung, high the target.
fn index_process(round: &RoundReport) -> Vec<String> {
    let rows: Vec<String> = round
        .index_process
        .iter()
        .enumerate()
        .filter(|(_, rungs)| !rungs.is_empty())
        .map(|(replica, rungs)| {
            let columns = rungs.len().min(66);
            let shown: Vec<f64> = (0..columns).map(|i| f64::from(rungs[i * rungs.len() / columns])).collect();
            format!("replica {:<3} {}", replica + 1, sparkline(&shown, round.replicas.saturating_sub(1).max(1) as f64))
        })
        .collect();
    match round.index_process.iter().map(Vec::len).max() {
        Some(longest) if longest > 0 => {
            let header = format!(
                "rungs of replicas over {} sweeps (low: uniform, high: target)",
                (longest as u64 - 1) * round.index_stride
            );
            [vec![header], rows].concat()
        }
        _ => Vec::new(),
    }
}

fn normalisers(log: &RunLog) -> Vec<String> {
    let names: String =
        Normaliser::ALL.iter().map(|normaliser| format!("{:>21}", format!("c, {}", normaliser.name()))).collect();
    let rows = log.rounds.iter().map(|round| {
        let estimates: String =
            Normaliser::ALL.iter().map(|n| format!("{:>21}", with_error(round.normalisers.of(*n)))).collect();
        format!("{:>5}{:>12}{estimates}", round.round, with_unit(round.mutations as f64))
    });
    [format!("{:>5}{:>12}{names}", "round", "mutations")].into_iter().chain(rows).collect()
}

fn choices(round: &RoundReport) -> Vec<String> {
    round.choices.iter().flat_map(|choice| wrapped(choice, 80)).collect()
}

/// Lines of at most `width` letters, broken at spaces.
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().expect("there is one");
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= width {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.into());
        }
    }
    lines
}

/// `0.2500 ± 0.31 %`
fn with_error(estimate: &LnEstimate) -> String {
    match (estimate.ln_value.is_finite(), estimate.relative_error.is_finite()) {
        (false, _) => "–".into(),
        (true, false) => significant(estimate.value(), 4),
        (true, true) => {
            format!("{} ± {} %", significant(estimate.value(), 4), significant(100.0 * estimate.relative_error, 2))
        }
    }
}

fn fixed(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}") } else { "–".into() }
}

fn percent(share: f64) -> String {
    if share.is_finite() { format!("{:.0} %", 100.0 * share) } else { "–".into() }
}

fn with_unit_or_dash(value: f64) -> String {
    if value.is_finite() { with_unit(value) } else { "–".into() }
}
