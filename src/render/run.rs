//! The render loop: slices of sweeps until the budget is spent.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use super::{
    baseline::Mlt,
    calibration,
    engine::{Engine, Stage},
    output::{Picture, metadata},
    replica_exchange::ReplicaExchange,
    settings::{Method, PacketChoice, Settings},
    status::{Observer, Packets, RunStart, Status},
};
use crate::{
    film::Footprint,
    path::unidirectional::{Mapping, Widths},
    rng::Rng,
    scene::Scene,
    tempering::RoundReport,
};

/// A scene and what to do with it.
pub struct Job<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// What it is called in logs.
    pub scene_name: String,
    /// How to render; [`Settings::validate`] has nothing to say about them.
    pub settings: Settings,
    /// Set from outside to end the run early.
    pub stop: &'a AtomicBool,
}

/// What a run came to.
pub struct Outcome {
    /// The picture with its layers and history.
    pub picture: Picture,
    /// Where the run stood at its end.
    pub status: Status,
    /// It was stopped before its budget was spent.
    pub interrupted: bool,
    /// What the person should know, one sentence each.
    pub warnings: Vec<String>,
}

/// Why a run could not take place.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The operating system gave no threads.
    #[error("cannot start {threads} threads: {reason}")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the system said.
        reason: String,
    },
}

/// How long a slice of sweeps should take: often enough for progress, snapshots and Ctrl-C, and long beside the
/// moment at its end when threads wait for the last of them.
const SLICE: Duration = Duration::from_millis(200);

/// Renders a job and tells `observer` how it goes.
pub fn run(job: &Job, observer: &dyn Observer) -> Result<Outcome, RenderError> {
    let begin = Instant::now();
    let threads = job.settings.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, |n| n.get()));
    let pool = thread_pool(threads, job.settings.pin)?;
    let widths = match job.settings.packet {
        PacketChoice::Auto => calibration::calibrate(job.scene),
        PacketChoice::Fixed(width) => Widths { camera: width, bounce: width, shadow: width },
    };
    let film = job.scene.film;
    let stage = Stage {
        mapping: Mapping::new(job.scene, widths),
        footprint: Footprint::new(film.filter, film.width, film.height),
        rng: Rng::new(job.settings.seed),
    };
    let start = run_start(job, threads, widths);
    observer.started(&start);
    let (mut engine, end) = pool.install(|| {
        let mutations = job.settings.mutations_per_pixel.map(|mpp| (mpp * stage.pixels() as f64).ceil() as u64);
        let mut engine = engine(&stage, &job.settings, mutations);
        let end = work(job, &stage, engine.as_mut(), &start, observer, begin);
        (engine, end)
    });
    Ok(conclude(job, &stage, engine.as_mut(), &start, end, begin))
}

fn thread_pool(threads: usize, pin: bool) -> Result<rayon::ThreadPool, RenderError> {
    let mut builder = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("relt {i}"));
    if pin && let Some(cores) = core_affinity::get_core_ids().filter(|cores| !cores.is_empty()) {
        builder = builder.start_handler(move |i| {
            core_affinity::set_for_current(cores[i % cores.len()]);
        });
    }
    builder.build().map_err(|e| RenderError::Threads { threads, reason: e.to_string() })
}

/// The method of those settings, ready to work on `mutations` evaluations or without end.
pub fn engine(stage: &Stage, settings: &Settings, mutations: Option<u64>) -> Box<dyn Engine> {
    match settings.method {
        Method::Mlt => Box::new(Mlt::new(stage, &settings.mlt, mutations)),
        Method::Path | Method::ReplicaExchange => Box::new(ReplicaExchange::new(stage, settings, mutations)),
    }
}

/// How the work came to an end.
struct End {
    /// It was stopped before its budget was spent.
    interrupted: bool,
    /// The last round that was over by then.
    last_round: Option<Arc<RoundReport>>,
}

/// Slice after slice until a budget is spent or the run is stopped.
fn work(
    job: &Job,
    stage: &Stage,
    engine: &mut dyn Engine,
    start: &RunStart,
    observer: &dyn Observer,
    begin: Instant,
) -> End {
    let mut last_round = None;
    let mut slice = 1;
    loop {
        let left = engine.sweeps_left().unwrap_or(u64::MAX);
        let time_left = job.settings.time.map_or(Duration::MAX, |time| time.saturating_sub(begin.elapsed()));
        if left == 0 || time_left.is_zero() {
            return End { interrupted: false, last_round };
        }
        if job.stop.load(Ordering::Relaxed) {
            return End { interrupted: true, last_round };
        }
        let slice_begin = Instant::now();
        let sweeps = slice.min(left);
        engine.advance(stage, sweeps);
        // the next slice fills its time, or what is left of the run's
        let a_sweep = slice_begin.elapsed().as_secs_f64() / sweeps as f64;
        let next = SLICE.min(job.settings.time.map_or(SLICE, |time| time.saturating_sub(begin.elapsed())));
        slice = ((next.as_secs_f64() / a_sweep) as u64).clamp(1, 2 * slice);

        let rounds: Vec<_> = engine.take_reports().into_iter().map(Arc::new).collect();
        last_round = rounds.last().cloned().or(last_round);
        let status = status(job, engine, last_round.clone(), begin);
        observer.progress(&status);
        rounds.iter().for_each(|round| observer.round(round));
        if observer.wants_picture(&status) {
            let development = engine.develop(stage);
            let status =
                Status { normalisation: development.normalisation.map(|e| (e.value, e.standard_error)), ..status };
            let metadata = metadata(start, &status);
            let picture = Picture { image: development.image, layers: development.layers, metadata };
            observer.snapshot(&status, &picture);
        }
    }
}

fn status(job: &Job, engine: &dyn Engine, last_round: Option<Arc<RoundReport>>, begin: Instant) -> Status {
    let counts = engine.counts();
    Status {
        elapsed: begin.elapsed(),
        mutations: counts.mutations,
        target_mutations: engine.mutations_wanted(),
        time_budget: job.settings.time,
        rays: counts.rays,
        acceptance: counts.acceptance,
        swap: counts.swap,
        non_finite: counts.non_finite,
        normalisation: None,
        last_round,
    }
}

fn conclude(job: &Job, stage: &Stage, engine: &mut dyn Engine, start: &RunStart, end: End, begin: Instant) -> Outcome {
    let status = status(job, engine, end.last_round, begin);
    let development = engine.develop(stage);
    let status = Status { normalisation: development.normalisation.map(|e| (e.value, e.standard_error)), ..status };
    let mut warnings = development.warnings;
    if development.image.pixels.iter().flatten().all(|v| *v == 0.0) {
        warnings.push(
            "the image is black: no independent path met light; is a light in reach of what the camera sees?".into(),
        );
    }
    if status.non_finite > 0 {
        warnings.push(format!(
            "{} of {} paths had a contribution that was not finite; they count as dark",
            status.non_finite, status.mutations
        ));
    }
    let picture = Picture { image: development.image, layers: development.layers, metadata: metadata(start, &status) };
    Outcome { picture, status, interrupted: end.interrupted, warnings }
}

fn run_start(job: &Job, threads: usize, widths: Widths) -> RunStart {
    let device = job.scene.tracer.device();
    let (major, minor, patch) = device.version();
    RunStart {
        scene: job.scene_name.clone(),
        width: job.scene.film.width,
        height: job.scene.film.height,
        settings: job.settings.clone(),
        threads,
        betas: job.settings.betas_given().to_vec(),
        features: job.scene.features.in_words(),
        embree: format!("{major}.{minor}.{patch}"),
        embree_library: device.library_path().display().to_string(),
        packets: Packets {
            camera: widths.camera.lanes(),
            bounce: widths.bounce.lanes(),
            shadow: widths.shadow.lanes(),
        },
    }
}

#[cfg(test)]
mod tests {
    use std::{path::Path, sync::Mutex};

    use super::*;
    use crate::{
        embree::{Device, Width},
        film::Image,
        render::engine::{Counts, Development},
    };

    /// Three sweeps, of which the first ends rounds 0 and 1 and the second round 2.
    struct Rounds {
        sweeps: u64,
        reports: Vec<RoundReport>,
    }

    impl Engine for Rounds {
        fn sweeps_left(&self) -> Option<u64> {
            Some(3 - self.sweeps)
        }

        fn mutations_wanted(&self) -> Option<u64> {
            Some(3)
        }

        fn advance(&mut self, _: &Stage, sweeps: u64) {
            for sweep in self.sweeps..self.sweeps + sweeps {
                let ended = [&[0, 1][..], &[2], &[]][sweep as usize];
                self.reports.extend(ended.iter().map(|&round| RoundReport { round, ..RoundReport::default() }));
            }
            self.sweeps += sweeps;
        }

        fn counts(&self) -> Counts {
            Counts { mutations: self.sweeps, ..Counts::default() }
        }

        fn develop(&self, _: &Stage) -> Development {
            let image = Image::constant(1, 1, [1.0; 3]);
            Development { image, layers: Vec::new(), normalisation: None, warnings: Vec::new() }
        }

        fn take_reports(&mut self) -> Vec<RoundReport> {
            std::mem::take(&mut self.reports)
        }
    }

    /// Notes rounds, and the last round of each status.
    #[derive(Default)]
    struct Notes {
        rounds: Mutex<Vec<u32>>,
        last: Mutex<Vec<Option<u32>>>,
    }

    impl Observer for Notes {
        fn progress(&self, status: &Status) {
            self.last.lock().unwrap().push(status.last_round.as_ref().map(|report| report.round));
        }

        fn round(&self, report: &RoundReport) {
            self.rounds.lock().unwrap().push(report.round);
        }
    }

    #[test]
    fn rounds_reach_the_observer_in_order_and_the_last_one_the_image() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.xml");
        let description = crate::load::scene(&path, &[("res".into(), "4".into())]).unwrap();
        let scene = Scene::new(&Device::new("").unwrap(), description).unwrap();
        let settings = Settings { mutations_per_pixel: None, ..Settings::default() };
        let job = Job { scene: &scene, scene_name: "box".into(), settings, stop: &AtomicBool::new(false) };
        let stage = Stage {
            mapping: Mapping::new(&scene, Widths { camera: Width::W1, bounce: Width::W1, shadow: Width::W1 }),
            footprint: Footprint::new(scene.film.filter, scene.film.width, scene.film.height),
            rng: Rng::new(0),
        };
        let (mut engine, start) = (Rounds { sweeps: 0, reports: Vec::new() }, RunStart::default());
        let notes = Notes::default();
        let end = work(&job, &stage, &mut engine, &start, &notes, Instant::now());
        assert_eq!(*notes.rounds.lock().unwrap(), [0, 1, 2]);
        let last = notes.last.lock().unwrap();
        assert_eq!((last.first(), last.last()), (Some(&Some(1)), Some(&Some(2))), "{last:?}");
        let outcome = conclude(&job, &stage, &mut engine, &start, end, Instant::now());
        assert!(
            outcome.picture.metadata.contains(&("ladder.round".into(), 2.0.into())),
            "{:?}",
            outcome.picture.metadata
        );
    }
}
