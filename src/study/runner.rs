//! Does the runs of a study, one at a time.

use std::collections::VecDeque;
use std::fs::{self, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::file::{Budget, Study};
use super::jobs::{Prepared, StudyJob, keeps_images, reference_image, scene_words};
use super::metrics::{Errors, Reference};
use super::record::{JobEnd, JobHead, Moment, SharedFile};
use crate::checksum::Checksum;
use crate::embree::Device;
use crate::film::file::FileError;
use crate::film::{Plane, exr_file};
use crate::render::clock::cpu_time;
use crate::render::log::Log;
use crate::render::{self, Job, Observer, Picture, RunStart, Status, Stop};
use crate::scene::Scene;
use crate::tempering::RoundReport;

/// A study at work in its folder.
pub struct Runner<'a> {
    /// What is to be done.
    pub study: &'a Study,
    /// Its scenes.
    pub prepared: &'a [Prepared],
    /// Where results go.
    pub folder: &'a Folder,
    /// Version of relt with a checksum of the executable.
    pub program: String,
    /// Set from outside to stop early.
    pub stop: &'a AtomicBool,
}

/// Why a run came to nothing.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// It was stopped from outside; nothing of it is kept.
    #[error("stopped")]
    Stopped,
    /// Anything else.
    #[error("{0}")]
    Failed(String),
}

impl RunError {
    fn of(error: impl ToString) -> RunError {
        RunError::Failed(error.to_string())
    }
}

/// A study's folder, which is nobody else's as long as this lives.
pub struct Folder {
    path: PathBuf,
    _lock: fs::File,
}

impl Folder {
    /// Makes the folder and what is in it, or takes up one that is there.
    pub fn open(path: &Path) -> Result<Folder, FileError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |error: io::Error| FileError::write(&path, error)
        };
        for folder in ["runs", "images"] {
            let folder = path.join(folder);
            fs::create_dir_all(&folder).map_err(failed(&folder))?;
        }
        let lock = path.join("lock");
        let file = fs::File::create(&lock).map_err(failed(&lock))?;
        match file.try_lock() {
            Ok(()) => Ok(Folder { path: path.to_owned(), _lock: file }),
            Err(TryLockError::WouldBlock) => Err(FileError::write(path, "another relt is at work in it")),
            Err(TryLockError::Error(error)) => Err(FileError::write(&lock, error)),
        }
    }

    /// Keeps a copy of every scene's reference, at the size of the scene's picture, so that the folder has all that
    /// its report shows.
    pub fn keep_references(&self, study: &Study, prepared: &[Prepared]) -> Result<(), FileError> {
        for (i, prepared) in prepared.iter().enumerate() {
            let path = self.path.join(reference_image(study, i));
            let Reference { image, variance } = &prepared.reference;
            let layers: Vec<_> = variance.iter().map(|v| ("variance".to_owned(), Plane::Rgb(v.clone()))).collect();
            exr_file::write(&path, image, &layers, &[])?;
        }
        Ok(())
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Version of relt with a checksum of the executable at work, so that runs of different builds are told apart.
pub fn this_program() -> String {
    let version = concat!("relt ", env!("CARGO_PKG_VERSION"));
    match std::env::current_exe().and_then(fs::read) {
        Ok(bytes) => format!("{version} (executable {:08x})", Checksum::of(&bytes)),
        Err(_) => version.to_owned(),
    }
}

impl Runner<'_> {
    /// Whether the run is finished, so that it needs not be done again.
    pub fn is_done(&self, job: &StudyJob) -> bool {
        job.record(self.folder.path()).is_file()
    }

    /// Does a run, and tells `observer` how it goes. Its record appears when all of it is on the disk.
    pub fn run(&self, job: &StudyJob, observer: &dyn Observer) -> Result<(), RunError> {
        let unfinished = job.unfinished_record(self.folder.path());
        let done = self.run_to(&unfinished, job, observer);
        match done {
            Ok(()) => fs::rename(&unfinished, job.record(self.folder.path())).map_err(RunError::of),
            Err(error) => {
                drop(fs::remove_file(&unfinished)); // of no use to anybody
                Err(error)
            }
        }
    }

    fn run_to(&self, record: &Path, job: &StudyJob, observer: &dyn Observer) -> Result<(), RunError> {
        if !self.study.methods[job.method].launch.is_empty() {
            return self.launch(record, job);
        }
        let scene = &self.study.scenes[job.scene];
        let (begin, cpu_begin) = (Instant::now(), cpu_time());
        let description = scene.describe(self.study.reach).map_err(RunError::of)?;
        let loaded = begin.elapsed();
        let device = Device::new("").map_err(RunError::of)?;
        let built_scene = Scene::new(&device, description).map_err(RunError::of)?;
        let before = Before {
            wall: begin.elapsed(),
            cpu: cpu_time().zip(cpu_begin).map(|(end, begin)| end.saturating_sub(begin)),
        };
        let file = SharedFile::create(record).map_err(RunError::of)?;
        file.head(JobHead {
            load_seconds: loaded.as_secs_f64(),
            build_seconds: (before.wall - loaded).as_secs_f64(),
            ..self.head(job)
        })
        .map_err(RunError::of)?;

        let mut settings = job.settings(self.study);
        if let Budget::Time(time) = self.study.budget {
            // one that is spent before anything is rendered still takes a first look at the scene
            settings.time = Some(time.saturating_sub(before.wall).max(Duration::from_millis(1)));
        }
        let watch = Watch {
            runner: self,
            job,
            before,
            reference: &self.prepared[job.scene].reference,
            log: Log::new(file.clone()),
            file: &file,
            observer,
            due: Mutex::new(self.stops(before.wall, &built_scene)),
            failed: Mutex::default(),
        };
        let render_job =
            Job { scene: &built_scene, scene_name: scene_words(self.study, job.scene), settings, stop: self.stop };
        let outcome = render::run(&render_job, &watch).map_err(RunError::of)?;
        if outcome.interrupted {
            return Err(RunError::Stopped);
        }
        watch.note(&outcome.status, &outcome.picture, Some(job.image(None)));
        if let Some(failure) = locked(&watch.failed).take().or(watch.log.failure()) {
            return Err(RunError::Failed(failure));
        }
        let set_up = outcome.status.set_up;
        let set_up_seconds = [set_up.calibration, set_up.bootstrap, set_up.adaptation].map(|time| time.as_secs_f64());
        file.end(JobEnd { set_up_seconds, warnings: outcome.warnings }).map_err(RunError::of)
    }

    /// A run by processes of its own, which the study's launcher starts; it is looked at when it is over. Its time is that of
    /// its log: what launcher and loading take is left out.
    fn launch(&self, record: &Path, job: &StudyJob) -> Result<(), RunError> {
        let (launch, image) = (&self.study.methods[job.method].launch, self.folder.path().join(job.image(None)));
        let [log, told] = ["log", "told"].map(|extension| record.with_extension(extension));
        let program = std::env::current_exe().map_err(RunError::of)?;
        let mut command = Command::new(&launch[0]);
        command.args(&launch[1..]).arg(program).args(job.words(self.study));
        command.arg("--quiet").arg("--output").arg(&image).arg("--log").arg(&log);
        let errors = fs::File::create(&told).map_err(RunError::of)?;
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(errors);
        let mut child = command.spawn().map_err(|error| RunError::of(format!("{}: {error}", launch[0])))?;
        let status = loop {
            if let Some(status) = child.try_wait().map_err(RunError::of)? {
                break status;
            }
            if self.stop.load(Relaxed) {
                child.kill().and_then(|()| child.wait()).map_err(RunError::of)?;
                return Err(RunError::Stopped);
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        if !status.success() {
            let told = fs::read_to_string(&told).unwrap_or_default();
            return Err(RunError::Failed(format!("{}: {status}\n{}", job.command(self.study), told.trim_end())));
        }
        let file = SharedFile::create(record).map_err(RunError::of)?;
        file.head(self.head(job)).map_err(RunError::of)?;
        let end = file.take_log(&log).map_err(RunError::of)?;
        let picture = exr_file::read_file(&image).map_err(RunError::of)?.image;
        let moment = Moment {
            wall_seconds: end.seconds,
            cpu_seconds: None,
            mutations: end.mutations,
            rays: end.rays,
            errors: Errors::of(&picture, &self.prepared[job.scene].reference),
            stated_brightness_error: end.normalisation.zip(end.normalisation_error).map(|(value, error)| error / value),
            image: Some(job.image(None)),
        };
        file.moment(moment).map_err(RunError::of)?;
        file.end(JobEnd { set_up_seconds: [0.0; 3], warnings: end.warnings }).map_err(RunError::of)?;
        [log, told].iter().try_for_each(fs::remove_file).map_err(RunError::of)
    }

    fn head(&self, job: &StudyJob) -> JobHead {
        let (scene, method) = (&self.study.scenes[job.scene], &self.study.methods[job.method]);
        JobHead {
            scene: scene.name.clone(),
            method: method.name.clone(),
            options: method.options.clone(),
            seed: job.seed,
            command: job.command(self.study),
            program: self.program.clone(),
            ..JobHead::default()
        }
    }

    /// When to look at a run but for its end, with the number of each look.
    fn stops(&self, before: Duration, scene: &Scene) -> VecDeque<(usize, Stop)> {
        let pixels = f64::from(scene.film.width) * f64::from(scene.film.height);
        let times = self.study.snapshot_times().into_iter().enumerate();
        match self.study.budget {
            Budget::Mutations(_) => times.map(|(i, mpp)| (i, Stop::Mutations((mpp * pixels).ceil() as u64))).collect(),
            Budget::Time(_) => times
                .filter_map(|(i, at)| Some((i, Stop::Time(Duration::from_secs_f64(at).checked_sub(before)?))))
                .collect(),
        }
    }
}

/// What reading and building the scene took.
#[derive(Clone, Copy)]
struct Before {
    wall: Duration,
    cpu: Option<Duration>,
}

/// Takes errors and images at the times that are due, while the run's clock stands still.
struct Watch<'a> {
    runner: &'a Runner<'a>,
    job: &'a StudyJob,
    before: Before,
    reference: &'a Reference,
    log: Log,
    file: &'a SharedFile,
    observer: &'a dyn Observer,
    due: Mutex<VecDeque<(usize, Stop)>>,
    /// What first went wrong with files.
    failed: Mutex<Option<String>>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn is_reached(stop: &Stop, status: &Status) -> bool {
    match stop {
        Stop::Mutations(mutations) => status.mutations >= *mutations,
        Stop::Time(time) => status.elapsed >= *time,
    }
}

impl Watch<'_> {
    /// Writes down a moment, and its image where it is to be kept.
    fn note(&self, status: &Status, picture: &Picture, image: Option<PathBuf>) {
        let noted = image.as_ref().map_or(Ok(()), |image| {
            let path = self.runner.folder.path().join(image);
            picture.write(&path).map_err(|error| error.to_string())
        });
        let moment = Moment {
            wall_seconds: (self.before.wall + status.elapsed).as_secs_f64(),
            cpu_seconds: self.before.cpu.zip(status.cpu).map(|(before, cpu)| (before + cpu).as_secs_f64()),
            mutations: status.mutations,
            rays: status.rays,
            errors: Errors::of(&picture.image, self.reference),
            stated_brightness_error: status.normalisation.map(|(value, error)| error / value).filter(|e| e.is_finite()),
            image,
        };
        let noted = noted.and_then(|()| self.file.moment(moment).map_err(|error| error.to_string()));
        if let Err(failure) = noted {
            locked(&self.failed).get_or_insert(failure);
        }
    }
}

impl Observer for Watch<'_> {
    fn started(&self, start: &RunStart) {
        self.log.started(start);
        self.observer.started(start);
    }

    fn progress(&self, status: &Status) {
        self.log.progress(status);
        self.observer.progress(status);
    }

    fn round(&self, report: &RoundReport) {
        self.log.round(report);
    }

    fn next_stop(&self) -> Option<Stop> {
        locked(&self.due).front().map(|(_, stop)| *stop)
    }

    fn stops_the_clock(&self) -> bool {
        true
    }

    fn wants_picture(&self, status: &Status) -> bool {
        locked(&self.due).front().is_some_and(|(_, stop)| is_reached(stop, status))
    }

    fn snapshot(&self, status: &Status, picture: &Picture) {
        let mut number = None;
        {
            let mut due = locked(&self.due);
            while let Some((reached, _)) = due.front().filter(|(_, stop)| is_reached(stop, status)).copied() {
                number = Some(reached);
                due.pop_front();
            }
        }
        let keeps = keeps_images(self.runner.study, self.job.seed);
        let image = number.filter(|_| keeps).map(|number| self.job.image(Some(number)));
        self.note(status, picture, image);
    }
}
