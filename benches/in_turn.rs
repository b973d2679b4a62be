//! What is compared with what, measured in turn.
//!
//! Criterion measures one thing after the other, and on a machine that others use as well the ratio of two such numbers is
//! a matter of luck. Here those that are to be compared take turns of a fraction of a second, in the order of the list and
//! then the other way round; times are of the processor, and ratios are medians over turns. Tables go to the terminal and
//! to `criterion/in-turn` in the target folder, where `bench_table` finds them.
//!
//! - `in-turn/embree` has, for each mapping and method, the mutations a second of a run in full swing and those that bare
//!   Embree reaches on the very same rays: recorded from that run and traced again in their batches, each kind at the
//!   packet width that is fastest for it. Their ratio is the share of its time that a run could not do without.
//! - `in-turn/rungs` has whole sweeps of blocks of ladders on scenes, with as many chains and as large a share of uniform
//!   points whatever the number of rungs, and the share of the time that swaps take. `alike` ladders have rungs at β from 0.99 to 1, which all sample the same paths, so
//!   that ladders are compared and not what chains prefer; nearly all their swaps are accepted, which makes them dear.
//! - `in-turn/threads` has two threads against one, by wall time, pinned to cores and not, and the part of their time in
//!   which two threads idle.
//! - `in-turn/kernels` has the kernel that a scene gets beside larger ones.
//!
//! `cargo bench --bench in_turn -- in-turn/embree/unidirectional` does a part of it.

use std::{
    cell::RefCell,
    env, fs,
    path::PathBuf,
    time::{Duration, Instant},
};

use relt::{
    chain::Start,
    embree::Hits,
    film::Footprint,
    path::{Mapping, MappingKind, RecordedRays, Widths, Workspace},
    render::{
        self, LadderChoice, Method, Settings,
        calibration::fastest_for,
        engine::{Engine, Phase, Stage},
    },
    rng::Rng,
    scene::{Kernel, Scene},
    tempering::Ladder,
};

use support::{
    Subject,
    ladders::{Film, Ladders, samples},
};

mod support;

/// Time of a turn.
const TURN: Duration = Duration::from_millis(200);
/// Turns of everything that is compared.
const TURNS: usize = 9;
/// Mutations that ladders are planned for: they learn for a quarter of that, and have two ladders a block.
const PLANNED: u64 = 1 << 23;
/// Points of the multiplexed mapping are open in runs of so many mutations a pixel.
const OPEN_FROM: u64 = 256;
/// Rungs of ladders where that is not what is compared.
const RUNGS: u32 = 4;
/// Share of uniform points.
const UNIFORM_SHARE: f64 = 0.5;

fn main() {
    let wanted = Wanted::from_arguments();
    type Group = fn(&Wanted, &str) -> Vec<String>;
    let groups: [(&str, &str, Group); 4] = [
        (
            "embree",
            "Million mutations a second of runs, by bare Embree on the same rays, and the share of the latter",
            embree,
        ),
        (
            "rungs",
            "Million mutations a second on ladders of K rungs (and by those of 2); share of the time for swaps",
            rungs,
        ),
        (
            "threads",
            "Million mutations a second of wall time (and by those of one thread); share of two threads' time idle",
            threads,
        ),
        ("kernels", "Million mutations a second by kernel (and by those of the full one)", kernels),
    ];
    for (name, title, group) in groups {
        let rows = group(&wanted, name);
        if !rows.is_empty() {
            let table = format!("{title}:\n\n{}\n", rows.join("\n"));
            println!("{table}");
            wanted.keep(name, &table);
        }
    }
}

/// What is asked for on the command line: everything whose name contains one of some words.
struct Wanted {
    words: Vec<String>,
    /// Everything is only tried once.
    smoke: bool,
}

impl Wanted {
    fn from_arguments() -> Wanted {
        let arguments: Vec<String> = env::args().skip(1).collect();
        let smoke = arguments.iter().any(|argument| argument == "--test");
        Wanted { words: arguments.into_iter().filter(|argument| !argument.starts_with('-')).collect(), smoke }
    }

    fn has(&self, name: &str) -> bool {
        let name = format!("in-turn/{name}");
        self.words.is_empty() || self.words.iter().any(|word| name.contains(word.as_str()))
    }

    fn turns(&self) -> usize {
        if self.smoke { 1 } else { TURNS }
    }

    fn turn(&self) -> Duration {
        if self.smoke { Duration::from_millis(1) } else { TURN }
    }

    /// Keeps a table for `bench_table`.
    fn keep(&self, name: &str, table: &str) {
        if self.smoke {
            return;
        }
        let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
        let folder = target.join("criterion").join("in-turn");
        let written = fs::create_dir_all(&folder).and_then(|()| fs::write(folder.join(format!("{name}.md")), table));
        written.unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    }
}

/// Something that works for about so long and tells how many mutations it did.
type Contender<'a> = Box<dyn FnMut(Duration) -> f64 + 'a>;

/// Seconds for each mutation, of the processor and of wall time.
#[derive(Clone, Copy)]
struct Turn {
    cpu: f64,
    wall: f64,
}

/// Lets contenders take turns; by contender, their turns in order.
fn in_turn(wanted: &Wanted, contenders: &mut [Contender]) -> Vec<Vec<Turn>> {
    let mut turns = vec![Vec::new(); contenders.len()];
    if !wanted.smoke {
        contenders.iter_mut().for_each(|work| _ = work(TURN / 2)); // caches and branches
    }
    for number in 0..wanted.turns() {
        let mut order: Vec<usize> = (0..contenders.len()).collect();
        if number % 2 == 1 {
            order.reverse();
        }
        for i in order {
            let (wall, cpu) = (Instant::now(), cpu_time());
            let done = contenders[i](wanted.turn());
            turns[i]
                .push(Turn { cpu: (cpu_time() - cpu).as_secs_f64() / done, wall: wall.elapsed().as_secs_f64() / done });
        }
    }
    turns
}

/// Processor time of all threads.
#[cfg(unix)]
fn cpu_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// Wall time, where nothing else is known.
#[cfg(not(unix))]
fn cpu_time() -> Duration {
    static BEGIN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    BEGIN.get_or_init(Instant::now).elapsed()
}

/// Least, median and most without the outer quarters.
fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|quarter| values[quarter * (values.len() - 1) / 4])
}

fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    quartiles(values.into_iter().collect())[1]
}

/// Millions a second.
fn millions(turns: &[Turn], time: fn(&Turn) -> f64) -> f64 {
    1e-6 / median(turns.iter().map(time))
}

/// What a time is of another one, turn by turn: `0.52 (0.51 to 0.53)`, the median and what half of the turns lie within.
fn ratio(of: &[Turn], by: &[Turn], time: fn(&Turn) -> f64) -> String {
    let [low, middle, high] = quartiles(of.iter().zip(by).map(|(a, b)| time(a) / time(b)).collect());
    format!("{middle:.3} ({low:.3} to {high:.3})")
}

fn head(columns: &[&str]) -> Vec<String> {
    vec![format!("| {} |", columns.join(" | ")), format!("|{}", "---|".repeat(columns.len()))]
}

/// A run with its stage.
struct Run<'s> {
    stage: Stage<'s>,
    engine: Box<dyn Engine>,
    /// Sweeps that take a turn.
    sweeps: f64,
}

impl<'s> Run<'s> {
    /// In full swing, on the current threads.
    fn new(mapping: Mapping<'s>, settings: &Settings, smoke: bool) -> Run<'s> {
        let mut stage = stage(mapping);
        let open = u64::from(stage.mapping.has_outcomes()) * OPEN_FROM * stage.pixels();
        let planned = if smoke { 1 << 14 } else { PLANNED.max(open) };
        let ladders = settings.method == Method::ReplicaExchange;
        let a_pixel = ladders.then_some(planned as f64 / stage.pixels() as f64);
        let mapping = &stage.mapping;
        stage.mapping = settings.mapping(mapping.scene(), mapping.kind(), mapping.widths(), a_pixel);
        let mut engine = render::engine(&stage, settings, ladders.then_some(planned));
        engine.set_wanted(None);
        while ladders && !smoke && engine.phase() != Phase::Steady {
            engine.advance(&stage, u64::MAX, Some(engine.counts().mutations + (1 << 20)));
        }
        Run { stage, engine, sweeps: 1.0 }
    }

    /// Goes on as the render loop does, a slice for a turn.
    fn work(&mut self, turn: Duration) -> f64 {
        let (begin, time) = (self.engine.counts().mutations, Instant::now());
        let done = self.engine.advance(&self.stage, self.sweeps as u64, None);
        // a round may end: the same as few sweeps more
        let a_sweep = time.elapsed().as_secs_f64() / done.max(1) as f64;
        self.sweeps = (turn.as_secs_f64() / a_sweep).clamp(1.0, 2.0 * self.sweeps);
        (self.engine.counts().mutations - begin) as f64
    }

    /// So many slices that they fill a turn.
    fn fill(&mut self, turn: Duration) -> f64 {
        let (begin, mut done) = (Instant::now(), 0.0);
        while done == 0.0 || 2 * begin.elapsed() < turn {
            done += self.work(turn);
        }
        done
    }

    /// The rays of its next sweep, and how many mutations they are of.
    fn record(&mut self) -> (RecordedRays, f64) {
        let own = &self.stage.mapping;
        let mapping = Mapping::new(own.scene(), own.kind(), own.widths()).with_views_left_open(own.views_left_open());
        let stage = stage(mapping.recording());
        let begin = self.engine.counts();
        while self.engine.advance(&stage, 1, None) == 0 {}
        let end = self.engine.counts();
        let rays = stage.mapping.take_recorded();
        assert_eq!(rays.len() as u64, end.rays - begin.rays, "rays that were not recorded");
        (rays, (end.mutations - begin.mutations) as f64)
    }
}

fn stage(mapping: Mapping) -> Stage {
    let film = mapping.scene().film;
    let footprint = Footprint::new(film.filter, film.width, film.height);
    Stage { mapping, footprint, rng: Rng::new(0) }
}

fn settings(method: Method) -> Settings {
    let mut settings = Settings { method, ..Settings::default() };
    if method == Method::ReplicaExchange {
        settings.ladder = LadderChoice::Replicas(RUNGS);
        settings.uniform_share = Some(UNIFORM_SHARE);
    }
    settings
}

/// The scenes; the first only, where everything is only tried.
fn subjects(wanted: &Wanted) -> Vec<Subject> {
    support::SCENES[..if wanted.smoke { 1 } else { support::SCENES.len() }]
        .iter()
        .map(|name| Subject::new(name))
        .collect()
}

fn pool(threads: usize, pin: bool) -> rayon::ThreadPool {
    render::thread_pool(threads, pin).unwrap_or_else(|error| panic!("{error}"))
}

/// Runs beside their own rays.
fn embree(wanted: &Wanted, group: &str) -> Vec<String> {
    let pool = pool(1, false);
    let mut rows = Vec::new();
    for subject in subjects(wanted) {
        for mapping in MappingKind::ALL {
            for method in [Method::Path, Method::Mlt, Method::ReplicaExchange] {
                let name = format!("{group}/{}/{}/{}", mapping.name(), method.name(), subject.name);
                let tried = !wanted.smoke || (mapping, method) == (MappingKind::Unidirectional, Method::Path);
                if wanted.has(&name) && tried {
                    rows.push(pool.install(|| a_run_and_its_rays(wanted, &subject, mapping, method)));
                    eprintln!("{}", rows[rows.len() - 1]);
                }
            }
        }
    }
    let columns = ["scene", "mapping", "method", "rays", "run", "bare Embree", "packets", "Embree / run"];
    if rows.is_empty() { rows } else { [head(&columns), rows].concat() }
}

fn a_run_and_its_rays(wanted: &Wanted, subject: &Subject, mapping: MappingKind, method: Method) -> String {
    let scene = subject.scene();
    let mut run = Run::new(Mapping::new(scene, mapping, subject.widths(mapping)), &settings(method), wanted.smoke);
    let (rays, mutations) = run.record();
    let widths = fastest_for(scene, &rays);
    let turns = in_turn(
        wanted,
        &mut [Box::new(|turn| run.fill(turn)), Box::new(|turn| trace(turn, scene, &rays, widths) * mutations)],
    );
    format!(
        "| `{}` | {} | `{}` | {:.1} | {:.3} | {:.3} | {} {} {} | {} |",
        subject.name,
        mapping.name(),
        method.name(),
        rays.len() as f64 / mutations,
        millions(&turns[0], |turn| turn.cpu),
        millions(&turns[1], |turn| turn.cpu),
        widths.camera,
        widths.bounce,
        widths.shadow,
        ratio(&turns[1], &turns[0], |turn| turn.cpu),
    )
}

/// Traces those rays for a turn; how often.
fn trace(turn: Duration, scene: &Scene, rays: &RecordedRays, widths: Widths) -> f64 {
    let (begin, mut times) = (Instant::now(), 0.0);
    let (mut hits, mut occluded) = (Hits::default(), Vec::new());
    while times == 0.0 || begin.elapsed() < turn {
        rays.trace(scene, widths, &mut hits, &mut occluded);
        std::hint::black_box((&hits, &occluded));
        times += 1.0;
    }
    times
}

/// Ladders of all lengths.
fn rungs(wanted: &Wanted, group: &str) -> Vec<String> {
    const ALL: [usize; 5] = [2, 4, 8, 16, 32];
    /// Sweeps between two deposits on the film.
    const SWEEPS: usize = 16;
    let pool = pool(1, false);
    let mut rows = Vec::new();
    for subject in subjects(wanted) {
        for alike in [true, false] {
            let name = format!("{group}/{}/{}", if alike { "alike" } else { "even" }, subject.name);
            if !wanted.has(&name) {
                continue;
            }
            let kind = MappingKind::Unidirectional;
            let mapping = Mapping::new(subject.scene(), kind, subject.widths(kind));
            let turns = pool.install(|| {
                let samples = samples(&mapping);
                // a second phase of swaps after every sweep tells what one takes
                let ladders =
                    ALL.map(|rungs| [(); 2].map(|()| RefCell::new(ladders(&mapping, rungs, alike, &samples))));
                let work = |(ladders, again): (&RefCell<Ladders<Workspace>>, bool), turn: Duration| {
                    let (begin, mut done, mut ladders) = (Instant::now(), 0, ladders.borrow_mut());
                    while done == 0 || begin.elapsed() < turn {
                        ladders.work(|block, canvas, round| {
                            for _ in 0..SWEEPS {
                                block.advance(&mapping, 1, canvas, round);
                                if again {
                                    block.swap(canvas, round);
                                }
                            }
                        });
                        done += SWEEPS * ladders.lanes();
                    }
                    done as f64
                };
                let each = ladders.iter().flat_map(|[once, twice]| [(once, false), (twice, true)]);
                let mut contenders: Vec<Contender> =
                    each.map(|each| -> Contender { Box::new(move |turn| work(each, turn)) }).collect();
                in_turn(wanted, &mut contenders)
            });
            for (rungs, of) in ALL.iter().zip(turns.chunks(2)) {
                let (many, by) = (millions(&of[0], |turn| turn.cpu), ratio(&turns[0], &of[0], |turn| turn.cpu));
                let swaps = median(of[1].iter().zip(&of[0]).map(|(twice, once)| 1.0 - once.cpu / twice.cpu));
                let kind = if alike { "alike" } else { "even" };
                rows.push(format!("| `{}` | {kind} | {rungs} | {many:.3} | {by} | {swaps:.3} |", subject.name));
            }
        }
    }
    let columns = ["scene", "rungs", "K", "mutations", "by K = 2", "swaps"];
    if rows.is_empty() { rows } else { [head(&columns), rows].concat() }
}

/// Blocks of ladders on a scene.
fn ladders(mapping: &Mapping, rungs: usize, alike: bool, samples: &[Start]) -> Ladders<Workspace> {
    let film = mapping.scene().film;
    let film = Film {
        footprint: Footprint::new(film.filter, film.width, film.height),
        size: [film.width, film.height],
        brightest: f64::from(mapping.scene().emitters.brightest()),
    };
    let coldest = (rungs - 1) as f64;
    let beta = |k: usize| match (k, alike) {
        (0, _) => 0.0,
        (k, true) if rungs > 2 => 0.99 + 0.01 * (k as f64 - 1.0) / (coldest - 1.0),
        (k, _) => k as f64 / coldest,
    };
    let ladder = Ladder::new((0..rungs).map(beta).collect());
    let ln_z = vec![0.0; rungs];
    Ladders::new(mapping, film, (ladder, &ln_z), samples, (2, rungs - 1))
}

/// Two threads against one.
fn threads(wanted: &Wanted, group: &str) -> Vec<String> {
    const POOLS: [(usize, bool); 4] = [(1, false), (2, false), (1, true), (2, true)];
    let mut rows = Vec::new();
    for subject in subjects(wanted) {
        for method in [Method::Path, Method::Mlt, Method::ReplicaExchange] {
            if !wanted.has(&format!("{group}/{}/{}", method.name(), subject.name))
                || wanted.smoke && method != Method::Path
            {
                continue;
            }
            let kind = MappingKind::Unidirectional;
            let mapping = Mapping::new(subject.scene(), kind, subject.widths(kind));
            let run = RefCell::new(pool(2, false).install(|| Run::new(mapping, &settings(method), wanted.smoke)));
            let pools = POOLS.map(|(threads, pin)| (pool(threads, pin), RefCell::new(1.0)));
            let work = |(pool, sweeps): &'_ (rayon::ThreadPool, RefCell<f64>), turn: Duration| {
                let mut run = run.borrow_mut();
                let run = &mut *run;
                run.sweeps = *sweeps.borrow();
                let done = pool.install(|| run.fill(turn));
                *sweeps.borrow_mut() = run.sweeps;
                done
            };
            let mut contenders: Vec<Contender> =
                pools.iter().map(|pool| -> Contender { Box::new(|turn| work(pool, turn)) }).collect();
            let turns = in_turn(wanted, &mut contenders);
            for ((threads, pin), (of, one)) in POOLS.iter().zip(turns.iter().zip([0, 0, 2, 2].map(|one| &turns[one]))) {
                rows.push(format!(
                    "| `{}` | `{}` | {threads}{} | {:.3} | {} | {:.3} |",
                    subject.name,
                    method.name(),
                    if *pin { ", pinned" } else { "" },
                    millions(of, |turn| turn.wall),
                    ratio(one, of, |turn| turn.wall),
                    median(of.iter().map(|turn| 1.0 - turn.cpu / (*threads as f64 * turn.wall))),
                ));
            }
        }
    }
    let columns = ["scene", "method", "threads", "mutations", "by one thread", "idle"];
    if rows.is_empty() { rows } else { [head(&columns), rows].concat() }
}

/// What leaving out gains.
fn kernels(wanted: &Wanted, group: &str) -> Vec<String> {
    const ALL: [Kernel; 4] = [Kernel::Diffuse, Kernel::Flat, Kernel::Plain, Kernel::Full];
    let pool = pool(1, false);
    let mut rows = Vec::new();
    let quadrics = ("quadrics", support::build(support::quadrics()));
    let plain = support::SCENES.map(|name| (name, support::build(support::describe(name))));
    for (name, scene) in plain.iter().chain([&quadrics]) {
        for kind in [MappingKind::Unidirectional, MappingKind::Bidirectional] {
            if !wanted.has(&format!("{group}/{}/{name}", kind.name())) || wanted.smoke && rows.len() > 4 {
                continue;
            }
            let fitting: Vec<Kernel> = ALL.into_iter().filter(|kernel| *kernel >= scene.features.kernel()).collect();
            let widths = render::calibration::calibrate(scene, kind);
            let turns = pool.install(|| {
                let settings = settings(Method::Path);
                let mut runs: Vec<Run> = fitting
                    .iter()
                    .map(|kernel| Run::new(Mapping::with_kernel(scene, kind, widths, *kernel), &settings, wanted.smoke))
                    .collect();
                let mut contenders: Vec<Contender> =
                    runs.iter_mut().map(|run| -> Contender { Box::new(|turn| run.fill(turn)) }).collect();
                in_turn(wanted, &mut contenders)
            });
            let full = &turns[turns.len() - 1];
            for (kernel, of) in fitting.iter().zip(&turns) {
                let (many, by) = (millions(of, |turn| turn.cpu), ratio(full, of, |turn| turn.cpu));
                rows.push(format!("| `{name}` | {} | {} | {many:.3} | {by} |", kind.name(), kernel.name()));
            }
        }
    }
    if rows.is_empty() {
        return rows;
    }
    [head(&["scene", "mapping", "kernel", "mutations", "by the full one"]), rows].concat()
}
