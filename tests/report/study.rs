//! A study with made-up figures that go together about as real ones do.

use std::path::{Path, PathBuf};

use relt::film::{Image, exr_file};
use relt::rng::{Counter, Purpose, Rng, open_unit_f64};
use relt::study::metrics::{Errors, Reference};
use relt::study::results::{LadderEnd, MethodResults, Results, Run, SceneResults, Snapshot, Stage};

/// Pixels of all images.
pub const SIZE: [u32; 2] = [96, 64];
const SEEDS: u64 = 5;

/// √relMSE = `scale` · t^`power`, and how images come out.
struct Law {
    name: &'static str,
    options: &'static str,
    variant: Option<(&'static str, &'static str)>,
    scale: f64,
    power: f64,
    brightness: f64,
    threads: usize,
    replicas: usize,
}

/// Three scenes: methods, replicas and threads are compared.
pub fn study(folder: &Path) -> Results {
    let law = |name, options, scale: f64| Law {
        name,
        options,
        variant: None,
        scale,
        power: -0.5,
        brightness: 1.0,
        threads: 2,
        replicas: 0,
    };
    let replicas = |name, options, variant, scale: f64, replicas| Law {
        variant: Some(("replicas", variant)),
        replicas,
        ..law(name, options, scale)
    };
    let threads = |name, options, variant, scale: f64, threads| Law {
        variant: Some(("threads", variant)),
        threads,
        replicas: 4,
        ..law(name, options, scale)
    };
    let methods = |hardness: f64| {
        vec![
            law("mlt", "--method mlt", 0.30 * hardness),
            Law { brightness: 0.985, power: -0.32, ..law("path", "--method path", 0.8) },
            replicas("re, K = 2", "--method re --replicas 2", "2", 0.24 * hardness, 2),
            replicas("re, K = 4", "--method re --replicas 4", "4", 0.15 * hardness, 4),
            replicas("re, K = 8", "--method re --replicas 8", "8", 0.17 * hardness, 8),
        ]
    };
    let by_threads = vec![
        law("mlt", "--method mlt", 0.4),
        threads("re, 1 thread", "--method re --threads 1", "1", 0.30, 1),
        threads("re, 2 threads", "--method re --threads 2", "2", 0.30 / 1.97f64.sqrt(), 2),
        threads("re, 4 threads", "--method re --threads 4", "4", 0.30 / 3.8f64.sqrt(), 4),
        threads("re, 8 threads", "--method re --threads 8", "8", 0.30 / 6.9f64.sqrt(), 8),
    ];
    Results {
        title: "Doors, keyholes & <threads>".into(),
        note: "What replica exchange gains where light comes through small openings, at equal time on two pinned \
               cores.\n\nFigures are made up: this page is drawn by a test."
            .into(),
        command: "relt study doors.toml -o doors".into(),
        study_file: "title = \"Doors, keyholes & <threads>\"\nbudget = \"32 s\"\nseeds = 5\n".into(),
        programs: vec!["relt 0.1.0 (executable 1a2b3c4d), Embree 4.4.0".into()],
        machines: vec!["Some Processor, 8 cores, Linux".into()],
        excluded: vec![Stage::Load, Stage::Build],
        budget: "32 s".into(),
        baseline: "mlt".into(),
        scenes: vec![
            scene(folder, "door-ajar", 0, methods(1.0)),
            scene(folder, "keyhole", 1, methods(2.2)),
            scene(folder, "threads", 2, by_threads),
        ],
        warnings: vec!["keyhole: 1 of 25 runs was made while the machine had other work".into()],
        ..Results::default()
    }
}

/// One scene with so many methods.
pub fn many_methods(folder: &Path, number: usize) -> Results {
    let mut results = study(folder);
    results.scenes.truncate(1);
    let methods = &mut results.scenes[0].methods;
    let like = methods[3].clone();
    for i in methods.len()..number {
        let mut method = MethodResults { name: format!("re, K = {}", 2 * i), variant: Vec::new(), ..like.clone() };
        method.options = format!("--method re --replicas {}", 2 * i);
        for snapshot in method.runs.iter_mut().flat_map(|run| &mut run.snapshots) {
            snapshot.errors.rel_mse *= 1.25f64.powi(i as i32 - 6);
            snapshot.image = None;
        }
        methods.push(method);
    }
    results
}

fn scene(folder: &Path, name: &str, number: u32, laws: Vec<Law>) -> SceneResults {
    let truth = truth(number);
    let reference = folder.join(format!("{name}-reference.exr"));
    exr_file::write(&reference, &truth, &[], &[]).unwrap();
    let truth = Reference { image: truth, variance: None };
    SceneResults {
        name: name.into(),
        scene: format!("scenes/{name}/scene.xml -D res=64"),
        size: SIZE,
        reference,
        target_errors: Vec::new(),
        methods: laws.iter().map(|law| method(folder, name, &truth, law)).collect(),
    }
}

/// A dim room with a bright gap and a ball.
fn truth(number: u32) -> Image {
    let [width, height] = SIZE;
    let pixel = |i: u32| {
        let (x, y) = ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
        let gap = (-((x - 0.2 - 0.2 * number as f32) / 0.03).powi(2)).exp() * if y > 0.2 { 1.6 } else { 0.0 };
        let ball = (0.03 - (x - 0.7).powi(2) - (y - 0.65).powi(2)).max(0.0) * 18.0;
        let floor = if y > 0.75 { 0.25 * (1.0 - x) } else { 0.08 };
        [floor + gap + ball, floor + 0.9 * gap + 0.4 * ball, 0.8 * floor + 0.6 * gap + 0.2 * ball]
    };
    Image::new(width, height, (0..width * height).map(pixel).collect())
}

fn method(folder: &Path, scene: &str, truth: &Reference, law: &Law) -> MethodResults {
    MethodResults {
        name: law.name.into(),
        options: law.options.into(),
        variant: law.variant.iter().map(|(option, value)| (option.to_string(), value.to_string())).collect(),
        runs: (1..=SEEDS).map(|seed| run(folder, scene, truth, law, seed)).collect(),
    }
}

fn run(folder: &Path, scene: &str, truth: &Reference, law: &Law, seed: u64) -> Run {
    let stages = [0.05, 0.1, 0.0, 0.4, if law.replicas > 0 { 0.8 } else { 0.0 }];
    let speed = 450_000.0 * law.threads as f64 / (1.0 + 0.02 * law.threads as f64);
    let luck = (0.12 * normal(seed, law, 0)).exp();
    let snapshot = |i: u32| {
        let seconds = 0.5 * 2f64.powf(f64::from(i) / 2.0);
        let error = luck * law.scale * seconds.powf(law.power) * (0.06 * normal(seed, law, i + 1)).exp();
        let mut errors = Errors { rel_mse: error * error, ..Errors::default() };
        errors.mean_ratio = law.brightness + 0.02 * error * normal(seed, law, i + 40);
        errors.mean_ratio_error = 0.0004;
        errors.reference_rel_mse = 2.5e-5;
        let keep = i == 12 || seed == 1 && i == 8;
        let image = (keep && seed == 1).then(|| noisy(folder, scene, &truth.image, law, error, i));
        Snapshot {
            seconds,
            wall_seconds: seconds + 0.15,
            cpu_seconds: seconds * law.threads as f64,
            mutations: (speed * seconds) as u64,
            rays: (5.2 * speed * seconds) as u64,
            errors,
            stated_brightness_error: 0.02 * error,
            image,
        }
    };
    let k = law.replicas;
    let ladder = (k > 0).then(|| LadderEnd {
        replicas: k,
        betas: (0..k).map(|i| i as f64 / (k - 1) as f64).collect(),
        swap_rates: vec![1.0 - 1.4 / k as f64; k - 1],
        round_trips: (4000.0 / (k as f64 + 3.0)) as u64,
        round_trips_predicted: 4600.0 / (k as f64 + 2.5),
        restarts: 310,
        ladders: 64,
        barrier: 1.4,
        uniform_share: 1.0 / k as f64,
    });
    let warnings = match (seed, k) {
        (2, 8) => vec!["3 samples were not finite".into()],
        _ => Vec::new(),
    };
    Run {
        seed,
        threads: law.threads,
        command: format!("relt render scenes/{scene}/scene.xml {} --seed {seed} --time 32s -o out.exr", law.options),
        stages,
        snapshots: (0..=12).map(snapshot).collect(),
        ladder,
        warnings,
    }
}

fn noisy(folder: &Path, scene: &str, truth: &Image, law: &Law, error: f64, number: u32) -> PathBuf {
    let rng = Rng::new(u64::from(number));
    let pixel = |(i, rgb): (usize, &[f32; 3])| {
        let counter =
            Counter { ladder: i as u32, replica: 0, step: law.options.len() as u64, purpose: Purpose::Primary };
        let [a, b, ..] = rng.words(counter, 0).map(open_unit_f64);
        let normal = (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos();
        rgb.map(|value| (f64::from(value) * law.brightness * (1.0 + 3.0 * error * normal).max(0.0)) as f32)
    };
    let image = Image::new(truth.width, truth.height, truth.pixels.iter().enumerate().map(pixel).collect());
    let name: String = law.name.chars().filter(|c| c.is_ascii_alphanumeric()).collect();
    let path = folder.join(format!("{scene}-{name}-{number}.exr"));
    exr_file::write(&path, &image, &[], &[]).unwrap();
    path
}

/// Standard normal by seed, method and number.
fn normal(seed: u64, law: &Law, number: u32) -> f64 {
    let step = law.name.bytes().fold(0, |hash, byte| hash * 31 % 1_000_003 + u64::from(byte));
    let counter = Counter { ladder: number, replica: 0, step, purpose: Purpose::Step };
    let [a, b, ..] = Rng::new(seed).words(counter, 0).map(open_unit_f64);
    (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}
