//! From the folder of a study to its results.

use super::file::Study;
use super::jobs::{Prepared, StudyJob, quoted, reference_image, scene_words};
use super::record::{Moment, Record, read};
use super::results::{Clock, LadderEnd, MethodResults, Results, Run, SceneResults, Snapshot, Stage};
use super::runner::Folder;
use crate::film::file::FileError;

/// Everything that the finished ones of `jobs` have found.
pub fn collect(
    study: &Study,
    prepared: &[Prepared],
    jobs: &[StudyJob],
    folder: &Folder,
    command: &str,
) -> Result<Results, FileError> {
    let mut results = outline(study, prepared, folder, command);
    let mut lacking = 0;
    for job in jobs {
        let path = job.record(folder.path());
        if !path.is_file() {
            lacking += 1;
            continue;
        }
        let record = read(&path)?;
        note_once(&mut results.machines, &record.machine);
        note_once(&mut results.programs, &format!("{}, Embree {}", record.head.program, record.embree));
        results.scenes[job.scene].methods[job.method].runs.push(run(study, folder, record));
    }
    for method in results.scenes.iter_mut().flat_map(|scene| &mut scene.methods) {
        method.runs.sort_by_key(|run| run.seed);
    }
    results.warnings = warnings(&results, lacking, jobs.len());
    Ok(results)
}

/// The results before any run.
fn outline(study: &Study, prepared: &[Prepared], folder: &Folder, command: &str) -> Results {
    let methods = study.methods.iter().map(|method| MethodResults {
        name: method.name.clone(),
        options: method.all_options().iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" "),
        variant: method.variant.clone(),
        runs: Vec::new(),
    });
    let methods: Vec<_> = methods.collect();
    let scenes = study.scenes.iter().zip(prepared).enumerate().map(|(i, (scene, prepared))| SceneResults {
        name: scene.name.clone(),
        scene: scene_words(study, i),
        size: prepared.size,
        reference: folder.path().join(reference_image(study, i)),
        target_errors: scene.target_errors.clone(),
        methods: methods.clone(),
    });
    Results {
        title: study.title.clone(),
        note: study.note.clone(),
        command: command.to_owned(),
        study_file: study.text.clone(),
        clock: study.clock,
        excluded: study.excluded.clone(),
        budget: study.budget_in_words(),
        baseline: study.methods[study.baseline].name.clone(),
        scenes: scenes.collect(),
        ..Results::default()
    }
}

fn note_once(list: &mut Vec<String>, item: &str) {
    if !list.iter().any(|known| known == item) {
        list.push(item.to_owned());
    }
}

fn run(study: &Study, folder: &Folder, record: Record) -> Run {
    let [calibration, bootstrap, adaptation] = record.end.set_up_seconds;
    let stages = [record.head.load_seconds, record.head.build_seconds, calibration, bootstrap, adaptation];
    let snapshot = |moment: &Moment| Snapshot {
        seconds: seconds(study, &stages, record.threads, moment),
        wall_seconds: moment.wall_seconds,
        cpu_seconds: moment.cpu_seconds.unwrap_or(f64::NAN),
        mutations: moment.mutations,
        rays: moment.rays,
        errors: moment.errors,
        stated_brightness_error: moment.stated_brightness_error.unwrap_or(f64::NAN),
        image: moment.image.as_ref().map(|image| folder.path().join(image)),
    };
    Run {
        seed: record.head.seed,
        threads: record.threads,
        command: record.head.command.clone(),
        stages,
        snapshots: record.moments.iter().map(snapshot).collect(),
        ladder: record.last_round.filter(|report| report.rejection.iter().any(|r| r.is_finite())).map(|report| {
            LadderEnd {
                replicas: report.replicas,
                betas: report.betas,
                swap_rates: report.rejection.iter().map(|rejection| 1.0 - rejection).collect(),
                round_trips: report.round_trips,
                round_trips_predicted: report.round_trips_predicted,
                restarts: report.restarts,
                ladders: report.ladders,
                barrier: report.barrier,
                uniform_share: report.uniform_share,
            }
        }),
        warnings: record.end.warnings.clone(),
    }
}

/// A moment on the study's clock: without the stages it leaves out, as far as they were over by then.
///
/// Stages are measured in wall time; on the other clock, one that keeps all threads busy takes as long, and load and
/// build, which one thread does, 1/threads of it.
fn seconds(study: &Study, stages: &[f64; 5], threads: usize, moment: &Moment) -> f64 {
    let threads = threads.max(1) as f64;
    let (now, scale) = match study.clock {
        Clock::Wall => (moment.wall_seconds, [1.0; 5]),
        Clock::Cpu => {
            let alone = 1.0 / threads;
            (moment.cpu_seconds.map_or(f64::NAN, |cpu| cpu / threads), [alone, alone, alone, 1.0, 1.0])
        }
    };
    let (mut left_out, mut passed) = (0.0, 0.0);
    for ((stage, length), scale) in Stage::ALL.into_iter().zip(stages).zip(scale) {
        let length = length * scale;
        if study.excluded.contains(&stage) {
            left_out += length.min((now - passed).max(0.0));
        }
        passed += length;
    }
    now - left_out
}

fn warnings(results: &Results, lacking: usize, all: usize) -> Vec<String> {
    let mut warnings = Vec::new();
    if lacking > 0 {
        warnings.push(format!("{lacking} of {all} runs are not finished; the same command goes on with them"));
    }
    if results.machines.len() > 1 {
        warnings.push("runs of different machines are mixed; their times do not compare".into());
    }
    if results.programs.len() > 1 {
        warnings.push("runs of different builds of relt or Embree are mixed; their times may not compare".into());
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::file::{Budget, StudyMethod, StudyScene};

    fn study(clock: Clock, excluded: &[Stage]) -> Study {
        Study {
            title: String::new(),
            note: String::new(),
            budget: Budget::Mutations(1.0),
            seeds: vec![1],
            snapshots: 2,
            first_snapshot: 0.5,
            clock,
            excluded: excluded.to_vec(),
            baseline: 0,
            scenes: Vec::<StudyScene>::new(),
            methods: Vec::<StudyMethod>::new(),
            reach: Default::default(),
            text: String::new(),
        }
    }

    #[test]
    fn stages_are_left_out_as_far_as_they_are_over() {
        let stages = [1.0, 2.0, 0.5, 3.0, 4.0];
        let at = |wall: f64, excluded: &[Stage]| {
            let moment = Moment { wall_seconds: wall, cpu_seconds: Some(1.5 * wall), ..Moment::default() };
            seconds(&study(Clock::Wall, excluded), &stages, 2, &moment)
        };
        assert_eq!(at(20.0, &[]), 20.0);
        assert_eq!(at(20.0, &[Stage::Load, Stage::Build]), 17.0);
        assert_eq!(at(2.0, &[Stage::Build]), 1.0, "one second of building is over");
        assert_eq!(at(8.5, &[Stage::Adaptation]), 6.5);
        assert_eq!(at(20.0, &Stage::ALL), 9.5);
    }

    #[test]
    fn processor_time_is_told_by_thread() {
        let moment = Moment { wall_seconds: 9.0, cpu_seconds: Some(16.0), ..Moment::default() };
        let stages = [1.0, 1.0, 0.0, 2.0, 0.0];
        let at = |excluded: &[Stage]| seconds(&study(Clock::Cpu, excluded), &stages, 2, &moment);
        assert_eq!(at(&[]), 8.0);
        assert_eq!(at(&[Stage::Load]), 7.5);
        assert_eq!(at(&[Stage::Bootstrap]), 6.0);
        let unknown = Moment { cpu_seconds: None, ..moment };
        assert!(seconds(&study(Clock::Cpu, &[]), &stages, 2, &unknown).is_nan());
    }
}
