//! `relt reference`: an image that others are compared with, to a stated error of its own.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use clap::Args;

use super::failure::Failure;
use super::scene::{Opened, SceneArguments};
use super::{signals, values};
use crate::film::file::{check_writable, write_whole};
use crate::film::{Image, PixelFormat, Plane, Value, exr_file};
use crate::path::MappingKind;
use crate::render::progress::significant;
use crate::render::{self, Job, MappingChoice, Method, Observer, PacketChoice, RenderError, Settings, Status};
use crate::scene::{Features, SceneDescription};
use crate::study::metrics::VARIANCE;
use crate::study::reference::{
    OwnError, Passes, Recipe, accumulate, counted, fingerprint, pass_seed, read_state, write_state,
};
use crate::study::reference_progress::ReferenceProgress;

/// Renders a reference: independent passes until its own error is small enough
///
/// Writes the mean of the passes with the variance of that mean by pixel (channels variance.R, .G, .B), and a text of the
/// same name that says how it was made and how good it is. Two estimates of its own relMSE, from the spread of passes and
/// from the difference of even and odd ones, must both be below the target, after 8 passes at least. Neither sees
/// light that no pass met, nor a bias that all passes share
#[derive(Args)]
#[command(after_help = super::EXIT_CODES)]
pub(super) struct Reference {
    #[command(flatten)]
    scene: SceneArguments,

    /// relMSE that the reference's own error is to be below: the mean of variance / (r² + 0.01) over pixels and channels
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    target_relmse: f64,

    /// Reference to write, .exr; beside it .txt and .state
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,

    /// path: independent samples, unbiased with the box filter, to be preferred; re: replica exchange, each pass biased
    /// by O(1/N) in its number of samples, which more passes do not take away and the estimates do not see: give it many
    /// --mpp; mlt: Metropolis, whose passes each have a brightness of their own, from 100,000 samples or fewer, that only
    /// many passes average out
    #[arg(long, default_value = "path", value_parser = values::method())]
    method: Method,

    /// From random numbers to light paths, as for relt render; one for all passes, so no trial chooses it. All but light
    /// give the same image in the end; light is refused where it would lack something
    #[arg(long, value_name = "HOW", default_value = "unidirectional", value_parser = values::one_mapping())]
    mapping: MappingKind,

    /// Mutations per pixel of a pass
    #[arg(long, value_name = "N", default_value_t = DEFAULT_MUTATIONS_PER_PIXEL, allow_negative_numbers = true)]
    mpp: f64,

    /// Ends after this wall time, with exit code 3 if the target is not reached by then; the same command goes on
    #[arg(long, value_parser = values::duration, allow_hyphen_values = true)]
    time: Option<Duration>,

    /// Seed that all passes have theirs from
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,

    /// Worker threads, from 1 [default: as render]; the reference does not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    threads: Option<usize>,

    /// Keeps every worker thread on a core of its own
    #[arg(long)]
    pin: bool,

    /// Rays that go to Embree at a time; auto measures at start; the reference does not depend on it
    #[arg(long, value_name = "RAYS", default_value = "auto", value_parser = values::packet())]
    packet: PacketChoice,

    /// Shows nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

/// A pass is long beside its start and short beside all of them, and gives a value that is not mere noise.
const DEFAULT_MUTATIONS_PER_PIXEL: f64 = 128.0;

/// Runs the subcommand.
pub(super) fn run(arguments: Reference) -> Result<(), Failure> {
    let begin = Instant::now();
    let settings = arguments.settings()?;
    let files = Files::new(&arguments.output)?;
    let description = arguments.scene.describe(arguments.threads, arguments.quiet)?;
    arguments.misses_nothing(&description)?;
    let recipe = arguments.recipe(&description);
    let mut passes = files.passes(&recipe)?;

    let opened = Opened::of(description, arguments.threads, arguments.quiet)?;
    let stop = signals::stop_flag()?;
    let progress = ReferenceProgress::new(arguments.quiet, arguments.target_relmse, &passes, begin);
    opened.warnings.iter().for_each(|warning| progress.say(&format!("warning: {warning}")));
    progress.begun(&recipe, &passes);

    let work = Work {
        opened: &opened,
        settings,
        stop: &stop,
        end: arguments.time.map(|time| begin + time),
        progress: &progress,
    };
    let mut saved =
        Saved { files: &files, recipe: &recipe, passes: passes.number(), due: Instant::now() + SHORTEST_GAP };
    let reached = accumulate(
        &mut passes,
        arguments.target_relmse,
        |number| work.pass(number),
        |passes| {
            progress.added(passes);
            saved.when_due(passes)
        },
    )?;
    saved.now(&passes)?;
    let written = files.write(&recipe, &opened, &passes, arguments.target_relmse)?;
    progress.ended(&passes, if written { files.all() } else { Vec::new() });
    if reached { Ok(()) } else { Err(arguments.unfinished(&passes, stop.load(Relaxed))) }
}

impl Reference {
    /// The settings of every pass but for its seed, or everything that is wrong with the options.
    fn settings(&self) -> Result<Settings, Failure> {
        let settings = Settings {
            method: self.method,
            mapping: MappingChoice::Fixed(self.mapping),
            seed: self.seed,
            threads: self.threads,
            pin: self.pin,
            mutations_per_pixel: Some(self.mpp),
            packet: self.packet,
            ..Settings::default()
        };
        let mut faults = self.scene.faults();
        if !(self.target_relmse > 0.0 && self.target_relmse.is_finite()) {
            faults.push(format!("--target-relmse {}: accepted are numbers above 0, such as 1e-4", self.target_relmse));
        }
        faults.extend(Settings { time: self.time, ..settings.clone() }.faults());
        if faults.is_empty() { Ok(settings) } else { Err(Failure::Input(faults)) }
    }

    /// That passes by the mapping are whole images of the scene.
    fn misses_nothing(&self, description: &SceneDescription) -> Result<(), Failure> {
        let missed = self.mapping.misses(&Features::of(description));
        if missed.is_empty() {
            return Ok(());
        }
        let (name, missed) = (self.mapping.name(), missed.join(" and "));
        Err(Failure::input(format_args!(
            "--mapping {name}: a reference of this scene would lack {missed}; all others serve"
        )))
    }

    fn recipe(&self, description: &SceneDescription) -> Recipe {
        let defines = self.scene.defines.iter().map(|(name, value)| format!(" -D {name}={value}"));
        Recipe {
            relt: env!("CARGO_PKG_VERSION").into(),
            scene: self.scene.path.display().to_string() + &defines.collect::<String>(),
            fingerprint: fingerprint(description),
            width: description.film.width,
            height: description.film.height,
            method: self.method.name().into(),
            mapping: self.mapping.name().into(),
            mutations_per_pixel: self.mpp,
            seed: self.seed,
        }
    }

    /// Why it ended before the target was reached, and what to do.
    fn unfinished(&self, passes: &Passes, interrupted: bool) -> Failure {
        let so_far = match (passes.number(), passes.own_error()) {
            (0, _) => "before its first pass was over".into(),
            (n, None) => format!("after {}", counted(n)),
            (n, Some(error)) => format!("after {} with relMSE {}", counted(n), significant(error.rel_mse(), 3)),
        };
        let target = self.target_relmse;
        let go_on = match passes.number() {
            0 => "nothing is written; a smaller --mpp makes shorter passes",
            _ => "the same command goes on",
        };
        if interrupted {
            Failure::Interrupted(format!("interrupted {so_far}, target {target}; {go_on}"))
        } else {
            Failure::Exceeded(vec![format!("--time was over {so_far}, target {target}; {go_on}")])
        }
    }
}

/// How passes are rendered.
struct Work<'a> {
    opened: &'a Opened,
    settings: Settings,
    /// Raised by a signal.
    stop: &'a AtomicBool,
    /// When the time is over.
    end: Option<Instant>,
    progress: &'a ReferenceProgress,
}

impl Work<'_> {
    /// The pass of that number; nothing if a signal or the clock ended it, as a part of a pass would not weigh the same.
    fn pass(&self, number: u64) -> Result<Option<Image>, Failure> {
        let halt = AtomicBool::new(self.is_over());
        let settings = Settings { seed: pass_seed(self.settings.seed, number), ..self.settings.clone() };
        let job = Job { scene: &self.opened.scene, scene_name: String::new(), settings, stop: &halt };
        let watch = Watch { work: self, halt: &halt };
        let outcome = render::run(&job, &watch).map_err(|error: RenderError| Failure::running(error))?;
        if outcome.interrupted {
            return Ok(None);
        }
        outcome.warnings.iter().for_each(|warning| self.progress.warn(number, warning));
        Ok(Some(outcome.picture.image))
    }

    fn is_over(&self) -> bool {
        self.stop.load(Relaxed) || self.end.is_some_and(|end| Instant::now() >= end)
    }
}

/// Follows a pass.
struct Watch<'a> {
    work: &'a Work<'a>,
    halt: &'a AtomicBool,
}

impl Observer for Watch<'_> {
    fn progress(&self, status: &Status) {
        if self.work.is_over() {
            self.halt.store(true, Relaxed);
        }
        self.work.progress.within_pass(status.fraction(), self.work.stop.load(Relaxed));
    }
}

/// The files of a reference.
struct Files {
    image: PathBuf,
    text: PathBuf,
    state: PathBuf,
}

impl Files {
    /// Files for the name given with `-o`, which can be written.
    fn new(output: &Path) -> Result<Files, Failure> {
        if !output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
            return Err(Failure::input(format_args!("cannot write {}: a reference is .exr", output.display())));
        }
        let [text, state] = ["txt", "state"].map(|extension| output.with_extension(extension));
        let files = Files { image: output.to_owned(), text, state };
        let faults = [&files.image, &files.text, &files.state].map(|file| check_writable(file).err());
        match faults.into_iter().flatten().next() {
            Some(fault) => Err(Failure::input(fault)), // one folder has them all, so one fault tells
            None => Ok(files),
        }
    }

    fn all(&self) -> Vec<PathBuf> {
        vec![self.image.clone(), self.text.clone(), self.state.clone()]
    }

    /// The passes that are there already.
    fn passes(&self, recipe: &Recipe) -> Result<Passes, Failure> {
        if self.state.exists() {
            return read_state(&self.state, recipe).map_err(Failure::input);
        }
        if self.image.exists() {
            return Err(Failure::input(format_args!(
                "{} is there, but {} is not, without which it cannot be gone on with; choose another --output, or delete \
                 the image to begin anew",
                self.image.display(),
                self.state.display()
            )));
        }
        Ok(Passes::new(recipe.width, recipe.height))
    }

    /// Writes image and text; nothing, and false, if there is no pass yet.
    fn write(&self, recipe: &Recipe, opened: &Opened, passes: &Passes, target: f64) -> Result<bool, Failure> {
        let Some(reference) = passes.reference() else { return Ok(false) };
        let error = passes.own_error();
        let layers: Vec<_> = reference.variance.map(|v| (VARIANCE.to_owned(), Plane::Rgb(v))).into_iter().collect();
        let (major, minor, patch) = opened.device.version();
        let embree = format!("{major}.{minor}.{patch}");
        let metadata = metadata(recipe, &embree, passes, error);
        let (format, window) = (PixelFormat::Rgb, opened.scene.film.window); // with a variance by channel
        exr_file::write_part(&self.image, &reference.image, format, window, &layers, &metadata)
            .map_err(Failure::running)?;

        let text = description(recipe, &embree, passes, &reference.image, error, target);
        write_whole(&self.text, |file| file.write_all(text.as_bytes()).map_err(|error| error.to_string()))
            .map_err(Failure::running)?;
        Ok(true)
    }
}

/// What the image's file says about how it was made: nothing that differs between a run and one with interruptions.
///
/// Texts: `scene` (with definitions), `scene_fingerprint`, `method`, `mapping`, `seed`, `embree`. Numbers: `passes`,
/// `pass_mutations_per_pixel`, `mutations_per_pixel` and, from two passes on, `own_rmse`, `own_rel_mse` (by the spread of
/// passes) and `own_rel_mse_halves`.
fn metadata(recipe: &Recipe, embree: &str, passes: &Passes, error: Option<OwnError>) -> Vec<(String, Value)> {
    let number = passes.number() as f64;
    let mut data: Vec<(&str, Value)> = vec![
        ("scene", recipe.scene.as_str().into()),
        ("scene_fingerprint", recipe.fingerprint.as_str().into()),
        ("method", recipe.method.as_str().into()),
        ("mapping", recipe.mapping.as_str().into()),
        ("seed", recipe.seed.to_string().into()),
        ("embree", embree.into()),
        ("passes", number.into()),
        ("pass_mutations_per_pixel", recipe.mutations_per_pixel.into()),
        ("mutations_per_pixel", (number * recipe.mutations_per_pixel).into()),
    ];
    if let Some(error) = error {
        data.push(("own_rmse", error.rmse.into()));
        data.push(("own_rel_mse", error.by_spread.into()));
        data.push(("own_rel_mse_halves", error.by_halves.into()));
    }
    data.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// The text beside the image.
fn description(
    recipe: &Recipe,
    embree: &str,
    passes: &Passes,
    image: &Image,
    error: Option<OwnError>,
    target: f64,
) -> String {
    let number = passes.number();
    let [r, g, b] = image.mean();
    let quality = match error {
        Some(error) => format!(
            "estimated own RMSE {:.2e}, relMSE {:.2e} by the spread of passes and {:.2e} by its halves, target {target:e}",
            error.rmse, error.by_spread, error.by_halves
        ),
        None => "one pass tells nothing about its own error".into(),
    };
    format!(
        "relt {}, Embree {embree}; {}, {} × {} pixels\n{}, {} mapping, {} of {} mutations per pixel, {} mutations per pixel \
         in all, seed {}\nmean [{r:.6}, {g:.6}, {b:.6}]; {quality}\n{}\n",
        recipe.relt,
        recipe.scene,
        recipe.width,
        recipe.height,
        recipe.method,
        recipe.mapping,
        counted(number),
        recipe.mutations_per_pixel,
        number as f64 * recipe.mutations_per_pixel,
        recipe.seed,
        command_line(std::env::args().skip(1)),
    )
}

/// The command as one could type it.
fn command_line(arguments: impl Iterator<Item = String>) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    let quoted = arguments.map(|word| {
        let plain = !word.is_empty() && word.chars().all(plain);
        if plain { word } else { format!("'{}'", word.replace('\'', r"'\''")) }
    });
    [String::from("relt")].into_iter().chain(quoted).collect::<Vec<_>>().join(" ")
}

/// What is on the disk.
struct Saved<'a> {
    files: &'a Files,
    recipe: &'a Recipe,
    /// How many passes.
    passes: u64,
    /// When it may be written again.
    due: Instant,
}

/// A killed run loses little more than this.
const SHORTEST_GAP: Duration = Duration::from_secs(5);
/// At most one part in this many of the time goes to saving.
const SAVING_SHARE: u32 = 20;

impl Saved<'_> {
    fn when_due(&mut self, passes: &Passes) -> Result<(), Failure> {
        if Instant::now() >= self.due { self.now(passes) } else { Ok(()) }
    }

    fn now(&mut self, passes: &Passes) -> Result<(), Failure> {
        if passes.number() > self.passes {
            let begin = Instant::now();
            write_state(&self.files.state, self.recipe, passes).map_err(Failure::running)?;
            self.passes = passes.number();
            self.due = Instant::now() + SHORTEST_GAP.max(SAVING_SHARE * begin.elapsed());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_line_can_be_typed_again() {
        let words = ["reference", "a b.xml", "-D", "res=16", "it's", "", "$HOME"].map(str::to_owned);
        let expected = r"relt reference 'a b.xml' -D res=16 'it'\''s' '' '$HOME'";
        assert_eq!(command_line(words.into_iter()), expected);
    }
}
