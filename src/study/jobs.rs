//! The runs of a study: which there are, in which order, and under which names they are kept.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use super::file::{Budget, Study, StudyScene};
use super::file_name;
use super::metrics::Reference;
use crate::checksum::Checksum;
use crate::load::Reach;
use crate::render::Settings;
use crate::scene::SceneDescription;

/// One run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StudyJob {
    /// Index of the scene.
    pub scene: usize,
    /// Index of the method.
    pub method: usize,
    /// Seed of the run.
    pub seed: u64,
    /// Name of its files: scene, method and seed in letters that any file system takes, and a checksum of all that the
    /// result depends on, so that whatever is changed is done again and nothing else.
    pub id: String,
}

/// What is known of a scene of the study before anything is rendered.
pub struct Prepared {
    /// Pixels a row and rows.
    pub size: [u32; 2],
    /// The truth, at that size.
    pub reference: Reference,
    /// Checksum of scene and reference.
    checksum: u32,
}

impl Prepared {
    /// Of a scene as it was read, and its reference.
    pub fn new(description: &SceneDescription, reference: Reference) -> Prepared {
        let mut checksum = Checksum::of_scene(description);
        for image in [Some(&reference.image), reference.variance.as_ref()].into_iter().flatten() {
            image.pixels.as_flattened().iter().for_each(|value| checksum.add(&value.to_le_bytes()));
        }
        let size = [description.film.width, description.film.height];
        Prepared { size, reference, checksum: checksum.finish() }
    }
}

/// Reads scenes and references; every reason why one cannot be used, a line each.
pub fn prepare(study: &Study) -> Result<Vec<Prepared>, Vec<String>> {
    let mut faults = Vec::new();
    let mut prepared = Vec::new();
    for scene in &study.scenes {
        match prepare_scene(scene, study.reach) {
            Ok(scene) => prepared.push(scene),
            Err(fault) => faults.push(fault),
        }
    }
    if faults.is_empty() { Ok(prepared) } else { Err(faults) }
}

fn prepare_scene(scene: &StudyScene, reach: Reach) -> Result<Prepared, String> {
    let StudyScene { file, reference, .. } = scene;
    let description = scene.describe(reach).map_err(|error| format!("{:?}", miette::Report::new(error)))?;
    let found = Reference::read(reference).map_err(|faults| faults.join("\n"))?;
    let (film, size) = (&description.film, [found.image.width, found.image.height]);
    let fitting = match size == [film.width, film.height] {
        true => Some(found),
        // means over the same parts of the film, which with a box filter is what a smaller picture has
        false if film.filter == crate::film::Filter::Box => found.shrunk_to(film.width, film.height),
        false => None,
    };
    let fitting = fitting.ok_or_else(|| {
        format!(
            "{} has {} × {} pixels, {} has {} × {}; accepted are references of the same size and, with the box filter, \
             of a multiple of it",
            reference.display(),
            size[0],
            size[1],
            file.display(),
            film.width,
            film.height
        )
    })?;
    Ok(Prepared::new(&description, fitting))
}

/// All runs, in the order in which they are done: seed by seed, within a seed scene by scene, and within a scene method
/// by method, beginning with another one for each seed. So whatever drifts while a study is at work (other load, heat)
/// meets all methods alike, and a study that is stopped early has a few seeds of everything.
pub fn jobs(study: &Study, prepared: &[Prepared]) -> Vec<StudyJob> {
    let methods = study.methods.len();
    let mut jobs = Vec::new();
    for (turn, &seed) in study.seeds.iter().enumerate() {
        for (scene, prepared) in prepared.iter().enumerate() {
            for method in (0..methods).map(|i| (i + turn) % methods) {
                jobs.push(StudyJob { scene, method, seed, id: id(study, prepared, scene, method, seed) });
            }
        }
    }
    jobs
}

fn id(study: &Study, prepared: &Prepared, scene: usize, method: usize, seed: u64) -> String {
    let (names, options) = (&study.scenes[scene], &study.methods[method]);
    let mut checksum = Checksum::default();
    let program = env!("CARGO_PKG_VERSION");
    let parts =
        (prepared.checksum, &options.options, seed, study.budget, study.snapshot_times(), keeps_images(study, seed));
    let how = (&options.launch, options.per_worker);
    write!(checksum, "{parts:?} {how:?} {program}").expect("checksums take all");
    format!("{}-{}-{seed}-{:08x}", file_name(&names.name), file_name(&options.name), checksum.finish())
}

/// The copy of a scene's reference, from the study's folder on.
pub fn reference_image(study: &Study, scene: usize) -> PathBuf {
    Path::new("images").join(format!("{}-reference-{}.exr", file_name(&study.scenes[scene].name), scene + 1))
}

/// Whether a run's images are kept at every snapshot, not only at its end: those of the first seed, for the viewer.
pub fn keeps_images(study: &Study, seed: u64) -> bool {
    study.seeds.first() == Some(&seed)
}

impl StudyJob {
    /// What is known of a run that is finished.
    pub fn record(&self, folder: &Path) -> PathBuf {
        folder.join("runs").join(format!("{}.jsonl", self.id))
    }

    /// The same while it is at work.
    pub fn unfinished_record(&self, folder: &Path) -> PathBuf {
        folder.join("runs").join(format!("{}.jsonl.part", self.id))
    }

    /// An image of the run, with the number of the snapshot or of the end; relative to the study's folder.
    pub fn image(&self, snapshot: Option<usize>) -> PathBuf {
        let number = snapshot.map(|number| format!("-at-{number:03}")).unwrap_or_default();
        Path::new("images").join(format!("{}{number}.exr", self.id))
    }

    /// Settings of the run but for a budget in time.
    pub fn settings(&self, study: &Study) -> Settings {
        let method = &study.methods[self.method];
        let mutations_per_pixel = match study.budget {
            Budget::Mutations(mpp) => Some(mpp * method.budgets()),
            Budget::Time(_) => None,
        };
        Settings { seed: self.seed, mutations_per_pixel, time: None, ..method.settings.clone() }
    }

    /// A command line that repeats the run.
    pub fn command(&self, study: &Study) -> String {
        let method = &study.methods[self.method];
        let launch: String = method.launch.iter().map(|word| quoted(word) + " ").collect();
        let words: Vec<String> = self.words(study).iter().map(|word| quoted(word)).collect();
        format!("{launch}relt {}", words.join(" "))
    }

    /// The words of that command line behind the program.
    pub fn words(&self, study: &Study) -> Vec<String> {
        let (scene, method) = (&study.scenes[self.scene], &study.methods[self.method]);
        let budget = match study.budget {
            Budget::Mutations(mpp) => ["--mpp".to_owned(), (mpp * method.budgets()).to_string()],
            Budget::Time(time) => ["--time".to_owned(), format!("{}ms", time.as_millis())],
        };
        let seed = ["--seed".to_owned(), self.seed.to_string()];
        let words = ["render".to_owned()].into_iter().chain(words_of_scene(scene, study.reach));
        words.chain(method.options.iter().cloned()).chain(seed).chain(budget).collect()
    }
}

/// A scene's file and definitions as they stand on a command line.
pub fn scene_words(study: &Study, scene: usize) -> String {
    let words = words_of_scene(&study.scenes[scene], study.reach);
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

fn words_of_scene(scene: &StudyScene, reach: Reach) -> Vec<String> {
    let defines = scene.defines.iter().flat_map(|(name, value)| ["-D".to_owned(), format!("{name}={value}")]);
    let confine = (reach == Reach::Confined).then(|| "--confine".to_owned());
    [scene.file.display().to_string()].into_iter().chain(defines).chain(confine).collect()
}

/// A word as a shell takes it.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}
