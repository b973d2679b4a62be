//! The render loop: slices of mutations until the budget is spent.

use std::{
    convert::Infallible,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use super::{
    allocation,
    baseline::Mlt,
    calibration,
    checkpoint::{Checkpoint, CheckpointError, Header, Resumed},
    clock::Clock,
    engine::{Diagnostics, Engine, Phase, Sheet, Stage},
    health::{self, Evidence, Health},
    output::{Picture, health_metadata, metadata},
    parts::{Agreement, Several},
    replica_exchange::ReplicaExchange,
    settings::{Method, PacketChoice, Settings},
    shared::{Led, follow},
    status::{Observer, Packets, RunStart, SetUp, Status, Stop},
    trial,
};
use crate::{
    film::Footprint,
    math::denormals,
    path::{Fault, MappingKind, Widths, first_fault},
    ranks::Company,
    rng::Rng,
    saved::{Source, Unfit},
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
    /// The mapping, in fact.
    pub mapping: MappingKind,
    /// Whether the parts that it had tell the same, where there were several.
    pub agreement: Option<Agreement>,
    /// It was stopped before its budget was spent.
    pub interrupted: bool,
    /// What the person should know, one sentence each.
    pub warnings: Vec<String>,
    /// Whether the picture can be trusted.
    pub health: Health,
}

/// Why a run could not take place.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A checkpoint cannot be gone on with.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Ranks do not work on the same run.
    #[error("rank {rank} has another version of relt, other settings or another scene than rank 0: give all the same")]
    Ranks {
        /// The first that differs.
        rank: usize,
    },
    /// The operating system gave no threads.
    #[error("cannot start {threads} threads: {reason}")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the system said.
        reason: String,
    },
}

/// How long a slice should take: often enough for progress, snapshots and Ctrl-C, and long beside the moment at its end
/// when threads wait for the last of them. Slices are counted in mutations, as a sweep may become many times as long from
/// one round to the next.
const SLICE: Duration = Duration::from_millis(200);
/// What a slice is cut to, at the least, where a look is due.
const SHORTEST_SLICE: Duration = Duration::from_millis(2);

/// Renders a job and tells `observer` how it goes.
pub fn run(job: &Job, observer: &dyn Observer) -> Result<Outcome, RenderError> {
    run_from(job, "", None, observer)
}

/// As [`run`], from a checkpoint on where there is one, of the same scene and with settings that
/// [agree](Resumed::agrees). `scene_digest` goes into the checkpoints that are taken.
pub fn run_from(
    job: &Job,
    scene_digest: &str,
    resumed: Option<Resumed>,
    observer: &dyn Observer,
) -> Result<Outcome, RenderError> {
    let outcome = run_on(None, job, scene_digest, resumed, observer)?;
    Ok(outcome.expect("the first rank, as there is no other"))
}

/// As [`run_from`], together with other ranks that call this with the same job and the same checkpoint: the first of them
/// alone tells its `observer` and comes to something.
pub fn run_on(
    company: Option<&Arc<Company>>,
    job: &Job,
    scene_digest: &str,
    mut resumed: Option<Resumed>,
    observer: &dyn Observer,
) -> Result<Option<Outcome>, RenderError> {
    let settings = &job.settings;
    let before = resumed.as_ref().map(|resumed| resumed.header.clone());
    let clock = before.as_ref().map_or_else(Clock::start, |b| Clock::going_on(b.done.elapsed, b.done.cpu));
    let began = clock.elapsed();
    let threads = settings.threads.unwrap_or_else(allocation::threads);
    let pool = thread_pool(threads, settings.pin)?;
    let (mapping, mapping_trial) = match &before {
        Some(before) => (before.start.mapping, before.start.mapping_trial.clone()),
        None => pool.install(|| trial::settle(job.scene, settings)),
    };
    let widths = match settings.packet {
        PacketChoice::Auto => calibration::calibrate(job.scene, mapping),
        PacketChoice::Fixed(width) => Widths { camera: width, bounce: width, shadow: width },
    };
    let film = job.scene.film;
    let planned = before.as_ref().map_or(settings.mutations_per_pixel, |before| before.planned_mutations_per_pixel);
    let stage = Stage {
        mapping: settings.mapping(job.scene, mapping, widths, planned),
        footprint: Footprint::new(film.filter, film.width, film.height),
        rng: Rng::new(settings.seed),
    };
    let resumed_at = before.as_ref().map(|before| before.done.mutations);
    let start = RunStart { mapping, mapping_trial, resumed_at, ..run_start(job, threads, widths) };
    company.map_or(Ok(()), |company| agree(company, &start, scene_digest))?;
    let leads = company.is_none_or(|company| company.is_first());
    if leads {
        observer.started(&start);
    }
    let frame = Frame {
        start: &start,
        scene_digest,
        arithmetic: job.scene.tracer.device().arithmetic(),
        sheet: stage.sheet(),
        planned,
    };
    let mut watch = Watch { clock, set_up: SetUp::default(), last_round: None };
    if let Some(Header { done, last_round, .. }) = before {
        (watch.set_up, watch.last_round) = (done.set_up, last_round.map(Arc::new));
    }
    watch.set_up.calibration += watch.clock.elapsed() - began;
    let done = pool.install(|| -> Result<_, CheckpointError> {
        let began = watch.clock.elapsed();
        let [planned, wanted] =
            [frame.planned, settings.mutations_per_pixel].map(|mpp| settings.parts.mutations(mpp, stage.pixels()));
        let mut engine = match &mut resumed {
            Some(resumed) => frame.restored(resumed)?,
            None => engine(&stage, settings, planned),
        };
        engine.set_wanted(wanted);
        if let Some(company) = company {
            // a checkpoint that all go on from is not replaced before all have read it
            company.everywhere(&());
            if !leads {
                follow(engine, &stage, company);
                return Ok(None);
            }
            engine = Box::new(Led::new(engine, company.clone()));
        }
        if resumed_at.is_none() {
            watch.set_up.bootstrap = watch.clock.elapsed() - began;
        }
        let interrupted = work(job, &stage, engine.as_mut(), &frame, observer, &mut watch);
        engine.gather();
        observer.ended(&frame.checkpoint(&status(job, engine.as_ref(), &watch), engine.as_ref()));
        Ok(Some((engine, interrupted)))
    })?;
    let Some((mut engine, interrupted)) = done else { return Ok(None) };
    let mut outcome = conclude(job, &stage, engine.as_mut(), &start, &watch, interrupted);
    if !pool.broadcast(|_| denormals::are_kept()).into_iter().all(|kept| kept) {
        outcome.warnings.push(FLUSHED.into());
    }
    Ok(Some(outcome))
}

/// Nothing where all ranks are about the same run, by the same program and with the same kind of arithmetic.
fn agree(company: &Company, start: &RunStart, scene_digest: &str) -> Result<(), RenderError> {
    let settings = Settings { threads: None, pin: false, packet: PacketChoice::Auto, ..start.settings.clone() };
    let own =
        (env!("CARGO_PKG_VERSION").to_owned(), start.mapping.name().to_owned(), settings, scene_digest.to_owned());
    let all = company.everywhere(&own);
    match all.iter().position(|other| *other != all[0]) {
        Some(rank) => Err(RenderError::Ranks { rank }),
        None => Ok(()),
    }
}

/// What is said where denormal numbers are not kept.
pub const FLUSHED: &str = "something that was loaded into this process makes its threads take numbers below 1.2e-38 for 0: \
                           light as faint as that is lost";

/// What is fixed about a run and goes into its checkpoints.
struct Frame<'a> {
    start: &'a RunStart,
    scene_digest: &'a str,
    arithmetic: String,
    sheet: Sheet,
    planned: Option<f64>,
}

impl Frame<'_> {
    fn checkpoint<'a>(&'a self, status: &'a Status, engine: &'a dyn Engine) -> Checkpoint<'a> {
        Checkpoint {
            start: self.start,
            scene_digest: self.scene_digest,
            arithmetic: &self.arithmetic,
            sheet: self.sheet,
            planned_mutations_per_pixel: self.planned,
            status,
            engine,
        }
    }

    /// The method as the checkpoint has it.
    fn restored(&self, resumed: &mut Resumed) -> Result<Box<dyn Engine>, CheckpointError> {
        if resumed.header.sheet != self.sheet {
            return Err(resumed.unfit("its film is another than the scene's"));
        }
        resumed.engine()
    }
}

/// What the render loop keeps about a run's course.
struct Watch {
    clock: Clock,
    set_up: SetUp,
    /// The last round that is over.
    last_round: Option<Arc<RoundReport>>,
}

/// Threads to work on, each on a core of its own if pinned.
pub fn thread_pool(threads: usize, pin: bool) -> Result<rayon::ThreadPool, RenderError> {
    let mut builder = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("relt {i}"));
    if pin && let Some(cores) = core_affinity::get_core_ids().filter(|cores| !cores.is_empty()) {
        builder = builder.start_handler(move |i| {
            core_affinity::set_for_current(cores[i % cores.len()]);
        });
    }
    builder.build().map_err(|e| RenderError::Threads { threads, reason: e.to_string() })
}

/// The method of those settings with its parts, each ready to work on `mutations` evaluations or without end.
pub fn engine(stage: &Stage, settings: &Settings, mutations: Option<u64>) -> Box<dyn Engine> {
    let sheet = stage.sheet();
    let make = |rng: Rng| -> Result<Box<dyn Engine>, Infallible> {
        Ok(match settings.method {
            Method::Mlt => Box::new(Mlt::new(stage, rng, &settings.mlt, mutations)),
            Method::Path | Method::ReplicaExchange => Box::new(ReplicaExchange::new(&sheet, rng, settings, mutations)),
        })
    };
    let Ok(engine) = Several::engine(settings.parts, sheet, stage.rng, make);
    engine
}

/// The method that [`Engine::save`] wrote, of those settings, that sheet and those random numbers of the job, each part
/// planned for as many mutations.
pub fn restored(
    sheet: &Sheet,
    rng: Rng,
    settings: &Settings,
    planned: Option<u64>,
    from: &mut Source,
) -> Result<Box<dyn Engine>, Unfit> {
    let make = |rng: Rng| -> Result<Box<dyn Engine>, Unfit> {
        Ok(match settings.method {
            Method::Mlt => Box::new(Mlt::restored(sheet, rng, &settings.mlt, planned, from)?),
            Method::Path | Method::ReplicaExchange => {
                Box::new(ReplicaExchange::restored(sheet, rng, settings, planned, from)?)
            }
        })
    };
    let engine = Several::engine(settings.parts, *sheet, rng, make)?;
    from.end()?;
    Ok(engine)
}

/// Slice after slice until a budget is spent or the run is stopped from outside, which is what it returns.
fn work(
    job: &Job,
    stage: &Stage,
    engine: &mut dyn Engine,
    frame: &Frame,
    observer: &dyn Observer,
    watch: &mut Watch,
) -> bool {
    let mut slice = 1;
    loop {
        let done = engine.counts().mutations;
        let left = engine.sweeps_left().unwrap_or(u64::MAX);
        let time_left = job.settings.time.map_or(Duration::MAX, |time| time.saturating_sub(watch.clock.elapsed()));
        if left == 0 || time_left.is_zero() {
            return false;
        }
        if job.stop.load(Ordering::Relaxed) {
            return true;
        }
        let (until, look_in) = match observer.next_stop() {
            Some(Stop::Mutations(mutations)) if mutations > done => (mutations, Duration::MAX),
            Some(Stop::Time(time)) => (u64::MAX, time.saturating_sub(watch.clock.elapsed())),
            _ => (u64::MAX, Duration::MAX),
        };
        let (phase, slice_begin) = (engine.phase(), watch.clock.elapsed());
        engine.advance(stage, left, Some(until.min(done + slice)));
        let took = watch.clock.elapsed() - slice_begin;
        match phase {
            Phase::Bootstrap => watch.set_up.bootstrap += took,
            Phase::Adaptation => watch.set_up.adaptation += took,
            Phase::Steady => {}
        }
        // the next slice fills its time, or what is left until the next look or of the run's time
        let time_left = job.settings.time.map_or(SLICE, |time| time.saturating_sub(watch.clock.elapsed()));
        let next = SLICE.min(time_left).min(look_in.saturating_sub(took).max(SHORTEST_SLICE));
        let gone = engine.counts().mutations - done;
        if gone > 0 {
            let a_mutation = took.as_secs_f64() / gone as f64;
            slice = ((next.as_secs_f64() / a_mutation) as u64).clamp(1, 2 * gone);
        }

        let rounds: Vec<_> = engine.take_reports().into_iter().map(Arc::new).collect();
        watch.last_round = rounds.last().or(watch.last_round.as_ref()).cloned();
        let status = status(job, engine, watch);
        observer.progress(&status);
        rounds.iter().for_each(|round| observer.round(round));
        if observer.wants_picture(&status) {
            engine.gather();
            let look = || {
                let development = engine.develop();
                let normalisation = development.normalisation.map(|e| (e.value, e.standard_error));
                let status = Status { normalisation, ..status.clone() };
                let metadata = metadata(frame.start, &status);
                let picture = Picture::new(&job.scene.film, development.image, development.layers, metadata);
                observer.snapshot(&status, &picture);
            };
            if observer.stops_the_clock() { watch.clock.pause(look) } else { look() }
        }
        if observer.wants_checkpoint(&status) {
            engine.gather();
            observer.checkpoint(&frame.checkpoint(&status, engine));
        }
    }
}

fn status(job: &Job, engine: &dyn Engine, watch: &Watch) -> Status {
    let counts = engine.counts();
    Status {
        elapsed: watch.clock.elapsed(),
        cpu: watch.clock.cpu(),
        set_up: watch.set_up,
        mutations: counts.mutations,
        target_mutations: engine.mutations_wanted(),
        time_budget: job.settings.time,
        rays: counts.rays,
        acceptance: counts.acceptance,
        swap: counts.swap,
        technique_changes: counts.technique_changes,
        non_finite: counts.faults.total(),
        faults: counts.faults,
        normalisation: None,
        last_round: watch.last_round.clone(),
    }
}

fn conclude(
    job: &Job,
    stage: &Stage,
    engine: &mut dyn Engine,
    start: &RunStart,
    watch: &Watch,
    interrupted: bool,
) -> Outcome {
    let status = status(job, engine, watch);
    let development = engine.develop();
    let status = Status { normalisation: development.normalisation.map(|e| (e.value, e.standard_error)), ..status };
    let mut warnings = development.warnings;
    if development.image.pixels.iter().flatten().all(|v| *v == 0.0) {
        warnings.push(
            "the image is black: no independent path met light; is a light in reach of what the camera sees?".into(),
        );
    }
    let missed = start.mapping.misses(&job.scene.features);
    if !missed.is_empty() {
        let (name, missed) = (start.mapping.name(), missed.join(" and "));
        warnings.push(format!("the image lacks {missed}: --mapping {name} makes no paths to that, all others do"));
    }
    warnings.extend(non_finite(stage, &status));
    let Diagnostics { round, chains, contradiction } = development.diagnostics;
    let health = health::judge(&Evidence {
        settings: &job.settings,
        status: &status,
        pixels: stage.pixels(),
        round: telling(round.as_ref(), status.last_round.as_deref()),
        chains: chains.as_ref(),
        contradiction,
    });
    let mut metadata = metadata(start, &status);
    metadata.extend(health_metadata(&health));
    metadata.extend(development.agreement.iter().flat_map(Agreement::metadata));
    let picture = Picture::new(&job.scene.film, development.image, development.layers, metadata);
    Outcome { picture, status, mapping: start.mapping, agreement: development.agreement, interrupted, warnings, health }
}

/// The one of the round at work and the last that ended that knows more.
fn telling<'a>(now: Option<&'a RoundReport>, last: Option<&'a RoundReport>) -> Option<&'a RoundReport> {
    let steps = |round: &RoundReport| round.rungs.last().map_or(0, |rung| rung.evaluations);
    match (now, last) {
        (Some(now), Some(last)) if !now.rungs.is_empty() && steps(now) < steps(last) => Some(last),
        (now, _) => now,
    }
}

/// What to say of contributions that were settled: how many, why, and where the first of them went wrong.
fn non_finite(stage: &Stage, status: &Status) -> Option<String> {
    let place = |fault: &Fault| first_fault(&stage.mapping.retrace(&fault.evaluation).events);
    let place = status.faults.first().and_then(place);
    let place = place.map_or(String::new(), |place| format!("; the first went wrong here: {place}"));
    (status.non_finite > 0).then(|| {
        format!(
            "{} contributions of {} paths were not finite or negative ({}) and count as dark{place}",
            status.non_finite,
            status.mutations,
            status.faults.in_words()
        )
    })
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
        ..RunStart::default()
    }
}

#[cfg(test)]
mod tests {
    use std::{
        io::{self, Write},
        path::Path,
        sync::Mutex,
    };

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

        fn advance(&mut self, _: &Stage, sweeps: u64, until: Option<u64>) -> u64 {
            let sweeps = sweeps.min(until.map_or(u64::MAX, |until| until - self.sweeps));
            for sweep in self.sweeps..self.sweeps + sweeps {
                let ended = [&[0, 1][..], &[2], &[]][sweep as usize];
                self.reports.extend(ended.iter().map(|&round| RoundReport { round, ..RoundReport::default() }));
            }
            self.sweeps += sweeps;
            sweeps
        }

        fn phase(&self) -> Phase {
            if self.sweeps == 0 { Phase::Bootstrap } else { Phase::Steady }
        }

        fn counts(&self) -> Counts {
            Counts { mutations: self.sweeps, ..Counts::default() }
        }

        fn develop(&self) -> Development {
            let image = Image::constant(1, 1, [1.0; 3]);
            Development {
                image,
                layers: Vec::new(),
                normalisation: None,
                warnings: Vec::new(),
                diagnostics: Diagnostics::default(),
                agreement: None,
            }
        }

        fn share(&mut self, _: &Arc<Company>) {}

        fn gather(&mut self) {}

        fn set_wanted(&mut self, _: Option<u64>) {}

        fn save(&self, _: &mut dyn Write) -> io::Result<()> {
            Ok(())
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

    /// Takes a picture at a given number of mutations, slowly.
    struct Slow {
        at: u64,
        stops_the_clock: bool,
        seen: Mutex<Vec<u64>>,
    }

    impl Slow {
        const LOOK: Duration = Duration::from_millis(300);
    }

    impl Observer for Slow {
        fn next_stop(&self) -> Option<Stop> {
            Some(Stop::Mutations(self.at))
        }

        fn stops_the_clock(&self) -> bool {
            self.stops_the_clock
        }

        fn wants_picture(&self, status: &Status) -> bool {
            status.mutations >= self.at && self.seen.lock().unwrap().is_empty()
        }

        fn snapshot(&self, status: &Status, _: &Picture) {
            self.seen.lock().unwrap().push(status.mutations);
            std::thread::sleep(Slow::LOOK);
        }
    }

    #[test]
    fn looks_come_at_the_mutations_asked_for_and_take_time_only_where_the_clock_goes_on() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.xml");
        let description = crate::load::scene(&path, &[("res".into(), "16".into())]).unwrap();
        let scene = Scene::new(&Device::new("").unwrap(), description).unwrap();
        let look = |stops_the_clock: bool| {
            let packet = PacketChoice::Fixed(Width::W8);
            let settings = Settings { packet, mutations_per_pixel: Some(512.0), ..Settings::default() };
            let job = Job { scene: &scene, scene_name: String::new(), settings, stop: &AtomicBool::new(false) };
            let slow = Slow { at: 60_000, stops_the_clock, seen: Mutex::default() };
            let begin = std::time::Instant::now();
            let status = run(&job, &slow).unwrap().status;
            let beside = begin.elapsed() - status.elapsed;
            let SetUp { bootstrap, adaptation, .. } = status.set_up;
            assert!(!bootstrap.is_zero() && !adaptation.is_zero(), "{:?}", status.set_up);
            assert!(bootstrap + adaptation <= status.elapsed);
            (slow.seen.into_inner().unwrap(), beside)
        };
        let ((with, stopped), (without, gone_on)) = (look(true), look(false));
        assert_eq!(with, without, "the same moment of the same run");
        // a sweep of chains with their uniform points is some thousand evaluations
        assert!((60_000..70_000).contains(&with[0]), "{with:?}");
        // what the clock of the run leaves out: that of one run, as other work on the machine makes runs differ
        assert!(stopped >= Slow::LOOK && gone_on < Slow::LOOK, "{stopped:?} and {gone_on:?}");
    }

    #[test]
    fn rounds_reach_the_observer_in_order_and_the_last_one_the_image() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.xml");
        let description = crate::load::scene(&path, &[("res".into(), "4".into())]).unwrap();
        let scene = Scene::new(&Device::new("").unwrap(), description).unwrap();
        let settings = Settings { mutations_per_pixel: None, ..Settings::default() };
        let job =
            Job { scene: &scene, scene_name: "box".into(), settings: settings.clone(), stop: &AtomicBool::new(false) };
        let stage = Stage {
            mapping: settings.mapping(
                &scene,
                MappingKind::Unidirectional,
                Widths { camera: Width::W1, bounce: Width::W1, shadow: Width::W1 },
                None,
            ),
            footprint: Footprint::new(scene.film.filter, scene.film.width, scene.film.height),
            rng: Rng::new(0),
        };
        let (mut engine, start) = (Rounds { sweeps: 0, reports: Vec::new() }, RunStart::default());
        let notes = Notes::default();
        let mut watch = Watch { clock: Clock::start(), set_up: SetUp::default(), last_round: None };
        let (arithmetic, sheet) = (String::new(), stage.sheet());
        let frame = Frame { start: &start, scene_digest: "", arithmetic, sheet, planned: None };
        assert!(!work(&job, &stage, &mut engine, &frame, &notes, &mut watch));
        assert_eq!(*notes.rounds.lock().unwrap(), [0, 1, 2]);
        let last = notes.last.lock().unwrap();
        assert_eq!((last.first(), last.last()), (Some(&Some(1)), Some(&Some(2))), "{last:?}");
        let outcome = conclude(&job, &stage, &mut engine, &start, &watch, false);
        assert!(
            outcome.picture.metadata.contains(&("ladder.round".into(), 2.0.into())),
            "{:?}",
            outcome.picture.metadata
        );
    }
}
