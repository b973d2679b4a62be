//! How long the runs of a study will take, by trying.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::file::{Budget, Study};
use super::jobs::StudyJob;
use crate::embree::Device;
use crate::render::{self, Job, Settings};
use crate::scene::Scene;

/// Wall time of a trial.
const TRIAL: Duration = Duration::from_millis(500);

/// The time that each run should take. With a budget in mutations every method is tried on every scene for half a
/// second; the learning rounds and first samples of a run, slower or faster than the rest, make this a rough guide.
pub fn times(study: &Study, jobs: &[&StudyJob]) -> Result<Vec<Duration>, String> {
    let mpp = match study.budget {
        Budget::Time(time) => return Ok(vec![time; jobs.len()]),
        Budget::Mutations(mpp) => mpp,
    };
    let mut known: Vec<(usize, usize, Duration)> = Vec::new();
    let mut times = Vec::new();
    for job in jobs {
        let tried = known.iter().find(|(scene, method, _)| (*scene, *method) == (job.scene, job.method));
        let time = match tried {
            Some((_, _, time)) => *time,
            None => {
                let time = trial(study, job, mpp)?;
                known.push((job.scene, job.method, time));
                time
            }
        };
        times.push(time);
    }
    Ok(times)
}

fn trial(study: &Study, job: &StudyJob, mpp: f64) -> Result<Duration, String> {
    let begin = Instant::now();
    let scene = &study.scenes[job.scene];
    let description = scene.describe(study.reach).map_err(|error| error.to_string())?;
    let device = Device::new("").map_err(|error| error.to_string())?;
    let scene = Scene::new(&device, description).map_err(|error| error.to_string())?;
    let before = begin.elapsed();
    let settings = Settings { mutations_per_pixel: Some(mpp), time: Some(TRIAL), ..job.settings(study) };
    let job = Job { scene: &scene, scene_name: String::new(), settings, stop: &AtomicBool::new(false) };
    let status = render::run(&job, &()).map_err(|error| error.to_string())?.status;
    let all = status.target_mutations.unwrap_or(0) as f64;
    let rendering = Duration::try_from_secs_f64(all / status.mutations_per_second().max(1.0));
    Ok(before + rendering.map_err(|_| "a run would take longer than time is counted".to_owned())?)
}
