//! `relt replay`: one evaluation of a run once more, vertex by vertex.

use std::io::{self, Write};

use clap::Args;

use super::failure::Failure;
use super::run_options::RunOptions;
use super::scene::{Opened, SceneArguments};
use super::signals;
use crate::path::{Mapping, Origin, Widths};
use crate::render::replay::{self, Address};
use crate::render::{Method, Settings, trial};
use crate::rng::{Counter, Purpose};

/// Repeats one evaluation of a run and prints its path vertex by vertex, and where it stops being finite if it does
///
/// Stratified points, samples of the first pass and uniform points are drawn again by themselves. For a small step of a chain
/// the run is repeated up to it, so all options of the run count. What relt render says of contributions that are not finite
/// ends with the command that replays the first of them.
#[derive(Args)]
pub(super) struct Replay {
    #[command(flatten)]
    scene: SceneArguments,

    #[command(flatten)]
    run: RunOptions,

    /// A pixel, from 0,0 at the top left, whose stratified sample to replay; with --sample
    #[arg(long, value_name = "X,Y", value_parser = pixel, help_heading = "Which evaluation")]
    pixel: Option<[u32; 2]>,

    /// Number of the pixel's stratified sample, from 0; of --method path, re
    #[arg(long, value_name = "N", help_heading = "Which evaluation")]
    sample: Option<u64>,

    /// All outcomes of that sample, which leaves open what it chooses; of --method re with --mapping multiplexed
    #[arg(long, requires = "pixel", help_heading = "Which evaluation")]
    open: bool,

    /// Number of a sample of the first pass, from 0; of --method mlt
    #[arg(long, value_name = "N", help_heading = "Which evaluation")]
    bootstrap: Option<u64>,

    /// A chain of --method mlt, or a ladder and a replica of it of --method re such as 3:1, from 0; with --step
    #[arg(long, value_name = "C or L:R", value_parser = chain, help_heading = "Which evaluation")]
    chain: Option<(u32, u16)>,

    /// Number of the chain's step, from 0
    #[arg(long, value_name = "N", help_heading = "Which evaluation")]
    step: Option<u64>,

    /// The step drew a uniform point (a large step, or a point that was offered to the ladder): no run needs to be repeated
    #[arg(long, help_heading = "Which evaluation")]
    uniform: bool,

    /// The change of technique before the step, in the place of the step
    #[arg(long, help_heading = "Which evaluation")]
    technique_change: bool,
}

/// Runs the subcommand.
pub(super) fn run(arguments: Replay) -> Result<(), Failure> {
    let settings = arguments.settings()?;
    let Opened { scene, device: _device, .. } = arguments.scene.open(settings.threads, false)?;
    let [width, height] = [scene.film.width, scene.film.height];
    let address = arguments.address([width, height])?;
    let (kind, _) = trial::settle(&scene, &settings);
    let stop = signals::stop_flag()?;
    let found = replay::find(&scene, &settings, kind, address, &stop).map_err(Failure::running)?;
    let Some(evaluation) = found else {
        return Err(Failure::running("the run ends before that evaluation, or has no such chain"));
    };
    let one = crate::embree::Width::W1;
    let mapping = Mapping::new(&scene, kind, Widths { camera: one, bounce: one, shadow: one });
    let retraced = mapping.retrace(&evaluation);
    // Whoever reads may have read enough, as `head` does.
    drop(write!(io::stdout(), "{}", replay::tell(&evaluation, &retraced, kind, width)));
    Ok(())
}

impl Replay {
    /// The run that the evaluation belongs to, or everything that is wrong with it.
    fn settings(&self) -> Result<Settings, Failure> {
        let settings = self.run.settings(None);
        let mut faults = self.scene.faults();
        faults.extend(self.run.contradictions(&settings, &[]));
        faults.extend(settings.faults());
        faults.extend(self.contradictions(&settings));
        if faults.is_empty() { Ok(settings) } else { Err(Failure::Input(faults)) }
    }

    /// What is wrong with the options that name the evaluation.
    fn contradictions(&self, settings: &Settings) -> Vec<String> {
        let mut faults = Vec::new();
        let named = [self.pixel.is_some(), self.bootstrap.is_some(), self.chain.is_some()];
        if named.into_iter().filter(|named| *named).count() != 1 {
            faults.push("which evaluation: give one of --pixel, --bootstrap, --chain".into());
        }
        for (a, given, b, other) in [
            ("--pixel", self.pixel.is_some(), "--sample", self.sample.is_some()),
            ("--chain", self.chain.is_some(), "--step", self.step.is_some()),
        ] {
            if given != other {
                let (missing, there) = if given { (b, a) } else { (a, b) };
                faults.push(format!("{there} needs {missing}"));
            }
        }
        for (name, given) in [("--uniform", self.uniform), ("--technique-change", self.technique_change)] {
            if given && self.chain.is_none() {
                faults.push(format!("{name} says something about a step of --chain"));
            }
        }
        if self.uniform && self.technique_change {
            faults.push("--uniform and --technique-change: give one of them".into());
        }
        if self.technique_change && self.run.technique_changes != Some(true) {
            faults.push("--technique-change: there are none without --technique-changes on".into());
        }
        // a uniform point is the same whatever the run is otherwise
        if self.chain.is_some() && !self.uniform && settings.method == Method::Path {
            faults.push("--chain: --method path has no chains".into());
        }
        faults
    }

    /// The evaluation, on a film of that size.
    fn address(&self, [width, height]: [u32; 2]) -> Result<Address, Failure> {
        let counter = |ladder, replica, step, purpose| Counter { ladder, replica, step, purpose };
        if let (Some([x, y]), Some(sample)) = (self.pixel, self.sample) {
            if x >= width || y >= height {
                let message = format!("--pixel {x},{y}: the film has {width} × {height} pixels, numbered from 0");
                return Err(Failure::input(message));
            }
            let counter = counter(y * width + x, 0, sample, Purpose::Stratified);
            let origin = if self.open { Origin::Open } else { Origin::Stratified };
            return Ok(Address { counter, drawn: Some(origin) });
        }
        if let Some(sample) = self.bootstrap {
            return Ok(Address { counter: counter(0, 0, sample, Purpose::Bootstrap), drawn: Some(Origin::Uniform) });
        }
        let ((ladder, replica), step) = self.chain.zip(self.step).expect("checked among the settings");
        let purpose = if self.technique_change { Purpose::Technique } else { Purpose::Primary };
        Ok(Address { counter: counter(ladder, replica, step, purpose), drawn: self.uniform.then_some(Origin::Uniform) })
    }
}

/// `x,y`.
fn pixel(text: &str) -> Result<[u32; 2], String> {
    let parse = |(x, y): (&str, &str)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]);
    text.split_once(',').and_then(parse).ok_or_else(|| "write it as column,row, such as 17,33".into())
}

/// `chain`, or `ladder:replica`.
fn chain(text: &str) -> Result<(u32, u16), String> {
    let (ladder, replica) = text.split_once(':').unwrap_or((text, "0"));
    let parse = || Some((ladder.parse().ok()?, replica.parse().ok()?));
    parse().ok_or_else(|| "write it as a number, or as ladder:replica such as 3:1".into())
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::path::{Evaluation, MappingKind, Point};
    use crate::render::{Combine, LadderChoice, MappingChoice, Measure, MltSettings, Normalisation};

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        replay: Replay,
    }

    fn parsed(command: &str) -> Replay {
        Only::try_parse_from(command.split(' ').skip(1)).unwrap_or_else(|e| panic!("{command}: {e}")).replay
    }

    /// What relt says repeats an evaluation does: the same run, the same counter, the same way to draw it.
    #[test]
    fn the_command_that_is_printed_names_the_same_evaluation() {
        let mlt = MltSettings { large_steps: 0.25, normalisation: Normalisation::Pooled, kelemen_weights: true };
        let re = Settings { ladder: LadderChoice::Betas(vec![0.0, 0.125, 1.0]), seed: 3, ..Settings::default() };
        let time = Some(std::time::Duration::from_millis(90_250));
        let runs = [
            Settings { method: Method::Path, ..Settings::default() },
            Settings { method: Method::Mlt, mlt, technique_changes: true, ..Settings::default() },
            Settings { combine: Combine::Target, uniform_share: Some(0.3), measure: Measure::Absolute, ..re },
            Settings { ladder: LadderChoice::Replicas(7), mutations_per_pixel: None, time, ..Settings::default() },
            Settings { mutations_per_pixel: Some(0.3), time, seed: u64::MAX, ..Settings::default() },
        ];
        let origins = [
            (Origin::Stratified, Purpose::Stratified),
            (Origin::Open, Purpose::Stratified),
            (Origin::Uniform, Purpose::Bootstrap),
            (Origin::Uniform, Purpose::Primary),
            (Origin::Step, Purpose::Primary),
        ];
        for settings in &runs {
            for (origin, purpose) in origins {
                let replica = if purpose == Purpose::Primary { 5 } else { 0 };
                let ladder = if purpose == Purpose::Bootstrap { 0 } else { 77 };
                let counter = Counter { ladder, replica, step: 123, purpose };
                let evaluation = Evaluation { counter, origin, point: Point::default() };
                let kind = MappingKind::Multiplexed;
                let command = replay::command("a.xml", settings, kind, 20, &evaluation);
                let replay = parsed(&command);
                if origin == Origin::Step && settings.method == Method::Path {
                    continue;
                }
                let read = replay.settings().unwrap_or_else(|e| panic!("{command}: {e}"));
                assert_eq!(replay.address([20, 20]).unwrap(), Address::of(&evaluation), "{command}");
                let expected = Settings { mapping: MappingChoice::Fixed(kind), ..settings.clone() };
                if origin == Origin::Step {
                    assert_eq!(read, expected, "{command}");
                } else {
                    assert_eq!((read.seed, read.mapping), (expected.seed, expected.mapping), "{command}");
                }
            }
        }
    }

    #[test]
    fn what_names_no_evaluation_is_told() {
        for (options, part) in [
            ("", "give one of --pixel, --bootstrap, --chain"),
            (" --pixel 1,2", "--pixel needs --sample"),
            (" --bootstrap 3 --step 2", "--step needs --chain"),
            (" --pixel 1,2 --sample 1 --bootstrap 3", "give one of"),
            (" --bootstrap 1 --uniform", "--uniform says something about a step"),
            (" --chain 1:2 --step 3 --method path", "--method path has no chains"),
            (" --chain 1 --step 3 --technique-change", "--technique-changes on"),
        ] {
            let failure = parsed(&format!("relt replay a.xml{options}")).settings().unwrap_err().to_string();
            assert!(failure.contains(part), "{options}: {failure}");
        }
        let outside = parsed("relt replay a.xml --pixel 20,2 --sample 1").address([20, 20]).unwrap_err().to_string();
        assert!(outside.contains("20 × 20 pixels"), "{outside}");
        assert!(pixel("1").is_err() && chain("a:1").is_err() && chain("70000:70000").is_err());
    }
}
