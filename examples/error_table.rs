//! Error against run time: relMSE of the methods on the three scenes of the project, beside their references.
//!
//! `cargo run --release --example error_table -- 5 15 45` renders each scene by each method for the longest of the given
//! times, and prints the error of the picture at each of them (wall time, all threads, from the moment the scene is
//! loaded; calibration, bootstrap and everything else included). In the environment, `SEEDS=1,2,3,4,5` takes several
//! seeds (the default is 0), interleaved over the methods, and prints their median and largest error;
//! `METHODS=path,mlt,best-mlt,re` and `SCENES=caustic,lattice` some of the methods and scenes. `best-mlt` is Metropolis at
//! the settings that served best on all three scenes: 10 % large steps, which also normalise and enter the image.

use std::{
    error::Error,
    path::Path,
    sync::{Mutex, atomic::AtomicBool},
    time::Duration,
};

use relt::{
    embree::Device,
    film::exr_file,
    load,
    render::{self, Job, Method, MltSettings, Normalisation, Observer, Picture, Settings, Status},
    scene::Scene,
    study::metrics::{Errors, Reference},
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut times: Vec<f64> = std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    times.sort_by(f64::total_cmp);
    if times.is_empty() {
        return Err("give the times in seconds, such as: 5 15 45".into());
    }
    let list = |name: &str, default: &str| -> Vec<String> {
        std::env::var(name).unwrap_or_else(|_| default.into()).split(',').map(str::to_owned).collect()
    };
    let seeds: Vec<u64> = list("SEEDS", "0").iter().map(|seed| seed.parse()).collect::<Result<_, _>>()?;
    let methods = list("METHODS", "path,mlt,best-mlt,re");
    println!("relMSE after{}; {} seeds", times.iter().map(|t| format!(" {t} s")).collect::<String>(), seeds.len());
    let device = Device::new("")?;
    for name in list("SCENES", "cornell-box,caustic,lattice") {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(&name);
        // without its variance: the table's errors include the references' own
        let image = exr_file::read_file(&folder.join("reference.exr"))?.image;
        let reference = Reference { image, variance: None };
        let scene = Scene::new(&device, load::scene(&folder.join("scene.xml"), &[])?)?;
        let mut runs: Vec<Vec<Run>> = methods.iter().map(|_| Vec::new()).collect();
        for &seed in &seeds {
            for (method, runs) in methods.iter().zip(&mut runs) {
                runs.push(run(&scene, settings(method)?, seed, &times, &reference)?);
            }
        }
        for (method, runs) in methods.iter().zip(&runs) {
            print(&name, method, runs, times.len());
        }
    }
    Ok(())
}

fn settings(method: &str) -> Result<Settings, String> {
    let best = MltSettings { large_steps: 0.1, normalisation: Normalisation::Pooled, kelemen_weights: true };
    let (method, mlt) = match method {
        "best-mlt" => (Method::Mlt, best),
        name => {
            let known = Method::ALL.into_iter().find(|m| m.name() == name);
            (known.ok_or(format!("unknown method {name}; known: path, mlt, best-mlt, re"))?, MltSettings::default())
        }
    };
    Ok(Settings { method, mlt, mutations_per_pixel: None, ..Settings::default() })
}

/// What became of one run.
struct Run {
    /// At each time.
    errors: Vec<f64>,
    /// Mean of the picture by that of the reference.
    brightness: f64,
    /// Brightness minus one, in standard errors as the run itself states them.
    deviation: f64,
    /// Million mutations a second.
    speed: f64,
}

fn run(
    scene: &Scene,
    settings: Settings,
    seed: u64,
    times: &[f64],
    reference: &Reference,
) -> Result<Run, Box<dyn Error>> {
    let (longest, earlier) = times.split_last().expect("there are times");
    let settings = Settings { seed, time: Some(Duration::from_secs_f64(*longest)), ..settings };
    let job = Job { scene, scene_name: String::new(), settings, stop: &AtomicBool::new(false) };
    let watch = Watch { times: earlier, reference, errors: Mutex::default() };
    let outcome = render::run(&job, &watch)?;
    let mut errors = watch.errors.into_inner()?;
    let end = Errors::of(&outcome.picture.image, reference);
    errors.push(end.rel_mse);
    let brightness = end.mean_ratio;
    let (value, error) = outcome.status.normalisation.unwrap_or((f64::NAN, f64::NAN));
    let speed = outcome.status.mutations_per_second() * 1e-6;
    Ok(Run { errors, brightness, deviation: (brightness - 1.0) / (error / value), speed })
}

fn print(scene: &str, method: &str, runs: &[Run], times: usize) {
    let sorted = |of: &dyn Fn(&Run) -> f64| {
        let mut values: Vec<f64> = runs.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let medians: String =
        (0..times).map(|i| format!(" {:9.2e}", sorted(&|run| run.errors[i])[runs.len() / 2])).collect();
    let last = sorted(&|run| run.errors[times - 1]);
    let brightness = sorted(&|run| run.brightness);
    let off = sorted(&|run| run.deviation.abs());
    println!(
        "{scene:12} {method:8}{medians}   largest/median {:.2}, brightness {:.4} to {:.4}, at most {:.1} stated errors off, \
         {:.2} M mutations/s",
        last[runs.len() - 1] / last[runs.len() / 2],
        brightness[0],
        brightness[runs.len() - 1],
        off[runs.len() - 1],
        sorted(&|run| run.speed)[runs.len() / 2]
    );
}

/// Takes the error of the first picture after each of some times.
struct Watch<'a> {
    times: &'a [f64],
    reference: &'a Reference,
    errors: Mutex<Vec<f64>>,
}

impl Observer for Watch<'_> {
    fn wants_picture(&self, status: &Status) -> bool {
        let taken = self.errors.lock().map_or(usize::MAX, |errors| errors.len());
        self.times.get(taken).is_some_and(|time| status.elapsed.as_secs_f64() >= *time)
    }

    fn snapshot(&self, _: &Status, picture: &Picture) {
        if let Ok(mut errors) = self.errors.lock() {
            errors.push(Errors::of(&picture.image, self.reference).rel_mse);
        }
    }
}
