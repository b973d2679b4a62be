//! Error against run time: relMSE of the three methods on the three scenes of the project, beside their references.
//!
//! `cargo run --release --example error_table -- 5 15 45` renders each scene by each method once, for the longest of
//! the given times, and prints the error of the picture at each of them (wall time, all threads, from the moment the
//! scene is loaded; calibration, bootstrap and everything else included). `SEED=7` in the environment takes another
//! seed, `METHODS=path,re` some of the methods.

use std::{
    error::Error,
    path::Path,
    sync::{Mutex, atomic::AtomicBool},
    time::Duration,
};

use relt::{
    embree::Device,
    film::{Image, exr_file},
    load,
    render::{self, Job, Method, Observer, Picture, Settings, Status},
    scene::Scene,
};

const SCENES: [&str; 3] = ["cornell-box", "caustic", "lattice"];

fn main() -> Result<(), Box<dyn Error>> {
    let mut times: Vec<f64> = std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    times.sort_by(f64::total_cmp);
    let Some((&longest, earlier)) = times.split_last() else {
        return Err("give the times in seconds, such as: 5 15 45".into());
    };
    let seed = std::env::var("SEED").map_or(Ok(0), |seed| seed.parse())?;
    let wanted = std::env::var("METHODS").unwrap_or_else(|_| "path,mlt,re".into());
    let methods: Vec<Method> = Method::ALL.into_iter().filter(|m| wanted.split(',').any(|w| w == m.name())).collect();

    let device = Device::new("")?;
    println!("relMSE after{}", times.iter().map(|t| format!(" {t} s")).collect::<String>());
    for name in SCENES {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        let reference = exr_file::read_file(&folder.join("reference.exr"))?.image;
        let scene = Scene::new(&device, load::scene(&folder.join("scene.xml"), &[])?)?;
        for &method in &methods {
            let settings = Settings {
                method,
                seed,
                mutations_per_pixel: None,
                time: Some(Duration::from_secs_f64(longest)),
                ..Settings::default()
            };
            let job = Job { scene: &scene, scene_name: name.into(), settings, stop: &AtomicBool::new(false) };
            let watch = Watch { times: earlier, reference: &reference, errors: Mutex::default() };
            let outcome = render::run(&job, &watch)?;
            let mut errors = watch.errors.into_inner()?;
            errors.push(outcome.picture.image.rel_mse(&reference));
            let errors: String = errors.iter().map(|e| format!(" {e:9.2e}")).collect();
            let ratio = outcome.picture.image.mean_ratio(&reference);
            let speed = outcome.status.mutations_per_second() * 1e-6;
            println!("{name:12} {:4}{errors}   brightness {ratio:.4}, {speed:.2} M mutations/s", method.name());
        }
    }
    Ok(())
}

/// Takes the error of the first picture after each of some times.
struct Watch<'a> {
    times: &'a [f64],
    reference: &'a Image,
    errors: Mutex<Vec<f64>>,
}

impl Observer for Watch<'_> {
    fn wants_picture(&self, status: &Status) -> bool {
        let taken = self.errors.lock().map_or(usize::MAX, |errors| errors.len());
        self.times.get(taken).is_some_and(|time| status.elapsed.as_secs_f64() >= *time)
    }

    fn snapshot(&self, _: &Status, picture: &Picture) {
        if let Ok(mut errors) = self.errors.lock() {
            errors.push(picture.image.rel_mse(self.reference));
        }
    }
}
