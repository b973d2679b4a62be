//! One evaluation of a run once more: which it was, and all that happens along its path.
//!
//! Points that are drawn afresh (stratified ones, uniform ones, large steps) are functions of seed and counter: they are
//! drawn again at once. A chain's small step starts from where its history led, so the run is repeated up to it: same
//! scene, same settings, same budget, and thus the same bits for any number of threads, however long the clock lets it run.

use std::fmt::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};

use super::{
    engine::{Phase, Stage},
    progress::significant,
    run::{RenderError, engine, thread_pool},
    settings::Settings,
};
use crate::{
    embree::Width,
    film::Footprint,
    path::{Evaluation, Event, Mapping, MappingKind, Origin, Retraced, Widths, first_fault},
    rng::{Counter, Purpose, Rng},
    sample::{Move, Points, Proposals},
    scene::Scene,
};

/// Which evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    /// The words that were drawn for it.
    pub counter: Counter,
    /// What they were drawn for, where that makes the point; otherwise the run must be repeated.
    pub drawn: Option<Origin>,
}

impl Address {
    /// Of an evaluation that somebody kept.
    pub fn of(evaluation: &Evaluation) -> Address {
        let origin = evaluation.origin;
        Address { counter: evaluation.counter, drawn: Some(origin).filter(|origin| origin.is_addressed()) }
    }

    /// The options of `relt replay` that name it, on a film so many pixels wide.
    pub fn options(&self, width: u32) -> String {
        let Counter { ladder, replica, step, purpose } = self.counter;
        let chain = match (replica, self.drawn) {
            (0, None) => format!("--chain {ladder} --step {step}"),
            (_, None) => format!("--chain {ladder}:{replica} --step {step}"),
            (_, Some(_)) => format!("--chain {ladder}:{replica} --step {step} --uniform"),
        };
        match purpose {
            Purpose::Stratified => {
                let open = if self.drawn == Some(Origin::Open) { " --open" } else { "" };
                format!("--pixel {},{} --sample {step}{open}", ladder % width, ladder / width)
            }
            Purpose::Bootstrap => format!("--bootstrap {step}"),
            Purpose::Technique => format!("{chain} --technique-change"),
            _ => chain,
        }
    }
}

/// The command that repeats an evaluation of a run; `scene` names the scene and its parameters.
pub fn command(scene: &str, settings: &Settings, mapping: MappingKind, width: u32, evaluation: &Evaluation) -> String {
    let address = Address::of(evaluation);
    let options = match address.drawn {
        Some(_) => format!("--mapping {} --seed {}", mapping.name(), settings.seed),
        None => settings.options(mapping).join(" "),
    };
    format!("relt replay {scene} {options} {}", address.options(width))
}

/// Finds an evaluation: draws it again, or repeats the run until it comes by. `None` where the run ends before, or `stop`
/// is raised.
pub fn find(
    scene: &Scene,
    settings: &Settings,
    mapping: MappingKind,
    address: Address,
    stop: &AtomicBool,
) -> Result<Option<Evaluation>, RenderError> {
    let widths = Widths { camera: Width::W8, bounce: Width::W8, shadow: Width::W8 };
    let mapping = settings.mapping(scene, mapping, widths, settings.mutations_per_pixel);
    match address.drawn {
        Some(origin) => Ok(draw(&mapping, Rng::new(settings.seed), address.counter, origin)),
        None => repeat(mapping.watching(address.counter), settings, address.counter.step, stop),
    }
}

/// Draws a point that needs no history.
fn draw(mapping: &Mapping, rng: Rng, counter: Counter, origin: Origin) -> Option<Evaluation> {
    let film = &mapping.scene().film;
    let (nowhere, mut points) = (Points::new(1), Points::new(1));
    let stratified = matches!(origin, Origin::Stratified | Origin::Open);
    let moves = [if stratified { Move::Stratified } else { Move::Fresh }];
    let mut proposals = Proposals {
        rng,
        current: &nowhere,
        given: &nowhere,
        points: &mut points,
        counters: &[counter],
        moves: &moves,
        film: [film.width, film.height],
    };
    proposals.begin(&mut Vec::new());
    mapping.walk(&mut proposals, (0, origin == Origin::Open), &mut crate::path::Narration::unheard());
    let evaluation = Evaluation::of(&proposals, 0)?;
    Some(Evaluation { origin, ..evaluation })
}

/// Sweeps between looks, at most: what is done in vain.
const LONGEST_SLICE: u64 = 64;

/// Repeats the run until the evaluation that the mapping looks out for comes by, which is its chain's step number `step`.
fn repeat(
    mapping: Mapping,
    settings: &Settings,
    step: u64,
    stop: &AtomicBool,
) -> Result<Option<Evaluation>, RenderError> {
    let film = &mapping.scene().film;
    let footprint = Footprint::new(film.filter, film.width, film.height);
    let stage = Stage { mapping, footprint, rng: Rng::new(settings.seed) };
    let threads = settings.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, |n| n.get()));
    thread_pool(threads, settings.pin)?.install(|| {
        let mutations = settings.mutations_per_pixel.map(|mpp| (mpp * stage.pixels() as f64).ceil() as u64);
        let mut engine = engine(&stage, settings, mutations);
        // a chain makes a step in every sweep, or more
        let mut left = step + 1;
        while stage.mapping.watched().is_none() && left > 0 && !stop.load(Ordering::Relaxed) {
            let slice = engine.sweeps_left().unwrap_or(u64::MAX).min(LONGEST_SLICE).min(left);
            if slice == 0 {
                break;
            }
            let chains = engine.phase() != Phase::Bootstrap;
            let sweeps = engine.advance(&stage, slice, None);
            if chains {
                left = left.saturating_sub(sweeps);
            }
        }
        Ok(stage.mapping.watched().cloned())
    })
}

/// All that happens along a path, for people. Numbers that something is wrong with are marked, and the first of them named
/// at the end.
pub fn tell(evaluation: &Evaluation, retraced: &Retraced, mapping: MappingKind, width: u32) -> String {
    let Evaluation { counter, origin, .. } = evaluation;
    let how = match (origin, counter.purpose) {
        (_, Purpose::Stratified) => {
            let (x, y) = (counter.ladder % width, counter.ladder / width);
            let open = if *origin == Origin::Open { " with all its outcomes" } else { "" };
            format!("sample {} of pixel ({x}, {y}), a stratified point{open}", counter.step)
        }
        (_, Purpose::Bootstrap) => format!("sample {} of the first pass, a uniform point", counter.step),
        (origin, _) => {
            let what = match origin {
                Origin::Step => "a small step",
                Origin::Change => "a change of technique",
                _ => "a uniform point",
            };
            format!(
                "step {} of replica {} of ladder or chain {}, {what}",
                counter.step, counter.replica, counter.ladder
            )
        }
    };
    let mut text = format!("{how}; {} mapping\n", mapping.name());
    retraced.events.iter().for_each(|event| tell_event(&mut text, event));
    let c = &retraced.contribution;
    let elsewhere = retraced.elsewhere.of(0);
    let mut line = |name: &str, value: String| writeln!(text, "{name:<14}{value}").expect("a string");
    let rgb = |rgb: crate::scene::Rgb| numbers(&rgb.to_array().map(f64::from));
    line("contribution", format!("{} at film {}", rgb(c.rgb), numbers(&c.film.map(f64::from))));
    for splat in elsewhere {
        line("", format!("{} at film {}", rgb(splat.rgb), numbers(&splat.film.map(f64::from))));
    }
    line("luminance", format!("{}, ln g = {}", number(f64::from(c.luminance)), number(c.ln_g)));
    let mut settled = crate::path::Faults::default();
    settled.count(retraced.causes);
    if settled.total() > 0 {
        line("settled", format!("{}, which counts as dark", settled.in_words()));
    }
    if let Some(place) = first_fault(&retraced.events) {
        line("first", place);
    }
    text
}

fn tell_event(text: &mut String, event: &Event) {
    writeln!(text, "{}", event.what).expect("a string");
    for quantity in &event.quantities {
        let mark = if quantity.is_fine() { "" } else { "   <- not finite" };
        writeln!(text, "  {:<34}{}{mark}", quantity.name, numbers(&quantity.values)).expect("a string");
    }
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(" ")
}

/// A number with six digits; what is not finite by its name.
fn number(value: f64) -> String {
    if value.is_finite() { significant(value, 6) } else { value.to_string() }
}
