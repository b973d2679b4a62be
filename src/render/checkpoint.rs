//! Checkpoints: all that it takes to go on with a run as if it had never been interrupted.
//!
//! A file is one line of JSON for people and for a first look ([`Header`]), then the state of the method as
//! [`Engine::save`] writes it, and at its end the CRC-32 of everything before as four bytes, little-endian. It appears
//! whole or not at all, and the one before it stays beside it, as `NAME.previous`, in case that the disk lies.
//!
//! Random numbers have no state of their own: they are functions of the seed and of counters that follow from the work done.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Read, Seek, Write},
    path::{Path, PathBuf},
    time::Duration,
};

use serde::{Deserialize, Serialize};

use super::{
    engine::{Engine, Sheet},
    run::restored,
    settings::{LadderChoice, MappingChoice, Method, Settings},
    status::{RunStart, SetUp, Status},
};
use crate::{
    checksum::{Checksum, Summed},
    film::file::{FileError, write_whole_and_keep},
    rng::Rng,
    saved::Source,
    tempering::RoundReport,
};

/// Version of the format; another one whenever what a file holds changes its meaning.
const FORMAT: u32 = 3;
/// Bytes of the first line, at most; what it holds of a long ladder takes some ten thousand.
const LONGEST_HEADER: u64 = 1 << 24;
/// Bytes of the checksum at the end.
const SEAL: u64 = 4;

/// The first line of a checkpoint.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Header {
    /// [`FORMAT`].
    relt_checkpoint: u32,
    /// The program's version.
    relt: String,
    /// How the run began, or was gone on with last: scene, settings with the budgets of the whole run, mapping, machine.
    pub start: RunStart,
    /// Number that is another one where anything of the scene is that could change the picture; see
    /// [`Checksum::of_scene`].
    pub scene_digest: String,
    /// What traced the rays; see [`Device::arithmetic`](crate::embree::Device::arithmetic).
    pub arithmetic: String,
    /// What was recorded to.
    pub sheet: Sheet,
    /// The budget in mutations per pixel that the run was planned for at its beginning: how many chains there are and how
    /// long settings are learnt follow from it, whatever the budget has become since.
    pub planned_mutations_per_pixel: Option<f64>,
    /// Where the run stood.
    pub done: Done,
    /// The last round that was over.
    pub last_round: Option<RoundReport>,
}

impl Header {
    /// Whether chains are yet to start, from samples that must then be found again.
    pub fn chains_are_to_start(&self) -> bool {
        let Settings { method, ladder, .. } = &self.start.settings;
        let has_chains = *method == Method::ReplicaExchange && *ladder != LadderChoice::Replicas(1);
        has_chains && self.last_round.is_none()
    }
}

/// Where a run stood when its checkpoint was taken.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Done {
    /// Evaluations so far.
    pub mutations: u64,
    /// Wall time so far, that of earlier processes included.
    pub elapsed: Duration,
    /// Processor time so far, likewise.
    pub cpu: Option<Duration>,
    /// The part of `elapsed` before the run worked at full pace.
    pub set_up: SetUp,
}

/// A run as it is at some moment, to be written.
pub struct Checkpoint<'a> {
    /// How it began.
    pub start: &'a RunStart,
    /// Of the scene; see [`Header::scene_digest`].
    pub scene_digest: &'a str,
    /// What traces the rays.
    pub arithmetic: &'a str,
    /// What is recorded to.
    pub sheet: Sheet,
    /// See [`Header::planned_mutations_per_pixel`].
    pub planned_mutations_per_pixel: Option<f64>,
    /// Where the run stands.
    pub status: &'a Status,
    /// The method at work.
    pub engine: &'a dyn Engine,
}

impl Checkpoint<'_> {
    /// Writes it; the file that was there becomes the [`previous`] one.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let header = Header {
            relt_checkpoint: FORMAT,
            relt: env!("CARGO_PKG_VERSION").into(),
            start: self.start.clone(),
            scene_digest: self.scene_digest.into(),
            arithmetic: self.arithmetic.into(),
            sheet: self.sheet,
            planned_mutations_per_pixel: self.planned_mutations_per_pixel,
            done: Done {
                mutations: self.status.mutations,
                elapsed: self.status.elapsed,
                cpu: self.status.cpu,
                set_up: self.status.set_up,
            },
            last_round: self.status.last_round.as_deref().cloned(),
        };
        write_whole_and_keep(path, &previous(path), |file| {
            let mut file = Summed::new(file);
            serde_json::to_writer(&mut file, &header)?;
            file.write_all(b"\n")?;
            self.engine.save(&mut file)?;
            file.seal()
        })
    }
}

/// Where the checkpoint before the last one is kept.
pub fn previous(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".previous");
    PathBuf::from(name)
}

/// Why a checkpoint cannot be gone on with.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// It cannot be read, or is damaged.
    #[error(transparent)]
    File(#[from] FileError),
    /// It is of another version of relt.
    #[error(
        "{} is of relt {relt} (format {format}), this is relt {} (format {FORMAT}): only the version that began a run can \
         go on with it",
        path.display(),
        env!("CARGO_PKG_VERSION")
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// The version that wrote it.
        relt: String,
        /// That version's format.
        format: u32,
    },
    /// It is of something else.
    #[error("{} is of another run: {}", path.display(), differences.join("; "))]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is of and what was asked for.
        differences: Vec<String>,
    },
}

/// A checkpoint that was read and is whole.
pub struct Resumed {
    /// What it says of itself.
    pub header: Header,
    /// The file.
    pub path: PathBuf,
    file: BufReader<File>,
    body: u64,
}

/// Opens the checkpoint of that name, or the one before it where that is damaged or missing, with a warning that says so.
pub fn open(path: &Path) -> Result<(Resumed, Option<String>), CheckpointError> {
    match open_one(path) {
        Err(CheckpointError::File(error)) => match open_one(&previous(path)) {
            Ok(resumed) => {
                let warning = format!("{error}; going on from the checkpoint before it, {}", resumed.path.display());
                Ok((resumed, Some(warning)))
            }
            // of a file that is not there nothing needs to be said
            Err(CheckpointError::File(other)) if previous(path).exists() => {
                Err(FileError::read(path, format_args!("{}; and {other}", reason(&error))).into())
            }
            Err(CheckpointError::File(_)) => Err(error.into()),
            Err(other) => Err(other),
        },
        found => found.map(|resumed| (resumed, None)),
    }
}

fn reason(error: &FileError) -> &str {
    match error {
        FileError::Read { reason, .. } | FileError::Write { reason, .. } => reason,
    }
}

/// What every format begins with, so that a foreign one can be named.
#[derive(Deserialize)]
struct Mark {
    relt_checkpoint: u32,
    relt: String,
}

/// Opens one file.
pub fn open_one(path: &Path) -> Result<Resumed, CheckpointError> {
    let unfit = |reason: &str| FileError::read(path, reason);
    let failed = |error: io::Error| FileError::read(path, error);
    let mut file = BufReader::new(File::open(path).map_err(failed)?);
    let length = file.get_ref().metadata().map_err(failed)?.len();
    if file.fill_buf().map_err(failed)?.first() != Some(&b'{') {
        return Err(unfit("it is no checkpoint").into());
    }
    if !is_sealed(&mut file, length).map_err(failed)? {
        return Err(unfit("it is damaged or cut off (its checksum is another)").into());
    }
    file.rewind().map_err(failed)?;
    let mut line = Vec::new();
    (&mut file).take(LONGEST_HEADER).read_until(b'\n', &mut line).map_err(failed)?;
    let Mark { relt_checkpoint, relt } = serde_json::from_slice(&line).map_err(|_| unfit("it is no checkpoint"))?;
    if (relt_checkpoint, relt.as_str()) != (FORMAT, env!("CARGO_PKG_VERSION")) {
        return Err(CheckpointError::Version { path: path.to_owned(), relt, format: relt_checkpoint });
    }
    let header: Header = serde_json::from_slice(&line).map_err(|error| unfit(&format!("its first line: {error}")))?;
    let faults = header.start.settings.faults();
    if !faults.is_empty() || header.sheet.pixels() == 0 || !(0.0..=f64::MAX).contains(&header.sheet.brightest) {
        return Err(unfit(&format!("it is damaged: {}", faults.join("; "))).into());
    }
    let body = length - line.len() as u64 - SEAL;
    Ok(Resumed { header, path: path.to_owned(), file, body })
}

/// Whether the last bytes of the file are the checksum of all others.
fn is_sealed(file: &mut impl Read, length: u64) -> io::Result<bool> {
    let Some(content) = length.checked_sub(SEAL) else { return Ok(false) };
    let mut summed = Summed::new(io::sink());
    let copied = io::copy(&mut file.take(content), &mut summed)?;
    let mut seal = [0; SEAL as usize];
    file.read_exact(&mut seal)?;
    Ok(copied == content && summed.finish() == u32::from_le_bytes(seal))
}

impl Resumed {
    /// The state of the method.
    pub fn body(&mut self) -> Source<'_> {
        Source::new(&mut self.file, self.body)
    }

    /// The method with its parts, as it was saved.
    pub fn engine(&mut self) -> Result<Box<dyn Engine>, CheckpointError> {
        let Header { start, sheet, planned_mutations_per_pixel, .. } = self.header.clone();
        let settings = &start.settings;
        let planned = settings.parts.mutations(planned_mutations_per_pixel, sheet.pixels());
        let engine = restored(&sheet, Rng::new(settings.seed), settings, planned, &mut self.body());
        engine.map_err(|error| self.unfit(error))
    }

    /// An error about what the file holds.
    pub fn unfit(&self, reason: impl ToString) -> CheckpointError {
        FileError::read(&self.path, reason).into()
    }

    /// Whether its scene and settings are those of a run that is asked for. What changes no bit of the picture may differ:
    /// budgets, threads, packets of rays.
    pub fn agrees(&self, scene_digest: &str, settings: &Settings) -> Result<(), CheckpointError> {
        let mut differences = differences(&self.header, settings, ["the checkpoint has", "asked for is"]);
        if self.header.scene_digest != scene_digest {
            differences.insert(
                0,
                format!(
                    "the scene has other contents than {} had (shapes, materials, lights, camera, film or textures; -D)",
                    self.header.start.scene
                ),
            );
        }
        let [has, asked] = [self.header.start.settings.parts, settings.parts];
        if has.of == asked.of && has.only != asked.only {
            let part = |only: Option<u32>| only.map_or("all parts".into(), |part| format!("part {part}"));
            let (has, asked) = (part(has.only), part(asked.only));
            differences.push(format!("--part: the checkpoint has {has}, asked for is {asked}"));
        }
        if differences.is_empty() {
            return Ok(());
        }
        Err(CheckpointError::Foreign { path: self.path.clone(), differences })
    }
}

/// What differs between the settings of a checkpoint and others, in the words of the command line; `whose` says before each
/// what it is. Which of its parts a job runs is not looked at.
pub(super) fn differences(header: &Header, others: &Settings, whose: [&str; 2]) -> Vec<String> {
    // every setting is either compared or named as one that may differ
    let Settings {
        method,
        mapping,
        seed,
        ladder,
        combine,
        uniform_share,
        measure,
        layers,
        technique_changes,
        mlt,
        parts,
        threads: _,
        pin: _,
        mutations_per_pixel: _,
        time: _,
        packet: _,
    } = &header.start.settings;
    let mut differences = Vec::new();
    let mut compare = |option: &str, has: String, other: String| {
        if has != other {
            differences.push(format!("{option}: {} {has}, {} {other}", whose[0], whose[1]));
        }
    };
    compare("--method", method.name().into(), others.method.name().into());
    if others.mapping != MappingChoice::Fixed(header.start.mapping) {
        compare("--mapping", mapping.name().into(), others.mapping.name().into());
    }
    compare("--seed", seed.to_string(), others.seed.to_string());
    compare("--replicas or --betas", ladder.in_words(), others.ladder.in_words());
    compare("--combine", combine.name().into(), others.combine.name().into());
    let share = |share: Option<f64>| share.map_or("tuned".into(), |share| share.to_string());
    compare("--uniform-share", share(*uniform_share), share(others.uniform_share));
    compare("--error", measure.name().into(), others.measure.name().into());
    let switch = |on: bool| if on { "on".to_owned() } else { "off".into() };
    compare("--layers", switch(*layers), switch(others.layers));
    compare("--technique-changes", switch(*technique_changes), switch(others.technique_changes));
    compare("--large-steps", mlt.large_steps.to_string(), others.mlt.large_steps.to_string());
    compare("--normalisation", mlt.normalisation.name().into(), others.mlt.normalisation.name().into());
    compare("--kelemen-weights", switch(mlt.kelemen_weights), switch(others.mlt.kelemen_weights));
    compare("number of parts", parts.of.to_string(), others.parts.of.to_string());
    differences
}

/// Number of a scene for [`Header::scene_digest`], in hexadecimal digits.
pub fn scene_digest(scene: &crate::scene::SceneDescription) -> String {
    format!("{:08x}", Checksum::of_scene(scene).finish())
}
