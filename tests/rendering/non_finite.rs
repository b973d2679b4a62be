//! Contributions that are not finite: counted by cause, kept from everything, and replayed.

use std::process::Command;
use std::sync::atomic::AtomicBool;

use relt::path::{Cause, Causes, MappingKind, Origin, first_fault};
use relt::render::replay::{self, Address};
use relt::render::{LadderChoice, MappingChoice, Method, Settings};
use relt::rng::{Counter, Purpose};
use relt::scene::Scene;

use crate::darkness::{assert_finite, lamp, room};
use crate::support::{fixed_widths, own, render, scene_of, settings};

/// All methods with all mappings on a short run; chains change techniques where they can.
fn all_runs(mutations_per_pixel: f64) -> Vec<Settings> {
    let mut all = Vec::new();
    for kind in MappingKind::ALL {
        let of = |method| Settings {
            mapping: MappingChoice::Fixed(kind),
            technique_changes: kind == MappingKind::Multiplexed && method != Method::Path,
            ..settings(method, mutations_per_pixel, 3)
        };
        all.extend([of(Method::Path), of(Method::Mlt)]);
        for k in [2, 5] {
            all.push(Settings { ladder: LadderChoice::Replicas(k), ..of(Method::ReplicaExchange) });
        }
    }
    all
}

fn kind(settings: &Settings) -> MappingKind {
    match settings.mapping {
        MappingChoice::Fixed(kind) => kind,
        MappingChoice::Auto => panic!("the tests name their mappings"),
    }
}

/// Many lamps: one whose radiance leaves the range once it is divided by anything, some that leave it when summed up, and
/// two that a picture can be made of.
fn hot_room() -> Scene {
    scene_of(&room(&(lamp("3e38, 1e-30, 0") + &lamp("1e38").repeat(3) + &lamp("1") + &lamp("0.1"))))
}

/// Whatever method and mapping: values that are not finite are counted by cause and leave no trace in picture, acceptance
/// and normalisation, and the first of them can be drawn again, is at fault again for the same cause, and says where it
/// first was.
#[test]
fn faults_are_counted_by_cause_and_the_first_is_replayed() {
    let scene = hot_room();
    let mut by_cause = [0; Cause::ALL.len()];
    for settings in all_runs(40.0) {
        let what = format!("{settings:?}");
        let outcome = render(&scene, &settings, &());
        assert_finite(&outcome, &what);
        let (status, kind) = (&outcome.status, kind(&settings));
        let counts = Cause::ALL.map(|cause| status.faults.of(cause));
        assert_eq!(counts.iter().sum::<u64>(), status.non_finite, "{what}");
        assert!(status.non_finite > 0, "{what}: nothing left the range");
        by_cause.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
        assert_eq!(outcome.warnings.iter().filter(|w| w.contains("not finite")).count(), 1, "{:?}", outcome.warnings);

        let fault = status.faults.first().unwrap_or_else(|| panic!("{what}: no first"));
        assert!(fault.evaluation.origin.is_addressed(), "{what}: there are faulty points without a history");
        let address = Address::of(&fault.evaluation);
        let found = replay::find(&scene, &settings, kind, address, &AtomicBool::new(false)).unwrap();
        assert_eq!(found.as_ref(), Some(&fault.evaluation), "{what}");
        let mapping = relt::path::Mapping::new(&scene, kind, fixed_widths(relt::embree::Width::W1));
        let retraced = mapping.retrace(&fault.evaluation);
        assert!(retraced.causes.of(fault.cause) > 0, "{what}: {:?} for {:?}", retraced.causes, fault.cause);
        let place = first_fault(&retraced.events).unwrap_or_else(|| panic!("{what}: all is finite"));
        let told = replay::tell(&fault.evaluation, &retraced, kind, scene.film.width);
        assert!(told.contains("<- not finite") && told.contains(&place), "{told}");
    }
    let [nan, _, infinite, _] = by_cause;
    assert!(nan > 0 && infinite > 0, "{by_cause:?}");
}

/// Steps of chains are found by repeating the run: the same on any number of threads, and however long before the end.
#[test]
fn a_step_of_a_chain_is_found_by_repeating_the_run() {
    let scene = own("cornell-box", &[("res", "16")]);
    let runs = [(Method::Mlt, MappingKind::Unidirectional), (Method::ReplicaExchange, MappingKind::Bidirectional)];
    for (method, kind) in runs {
        let settings = Settings { ladder: LadderChoice::Replicas(3), ..settings(method, 600.0, 8) };
        let find = |step, threads, stopped| {
            let counter = Counter { ladder: 2, replica: 0, step, purpose: Purpose::Primary };
            let settings = Settings { threads: Some(threads), ..settings.clone() };
            let address = Address { counter, drawn: None };
            replay::find(&scene, &settings, kind, address, &AtomicBool::new(stopped)).unwrap()
        };
        let mapping = relt::path::Mapping::new(&scene, kind, fixed_widths(relt::embree::Width::W8));
        let mut lit = 0;
        let mut small = 0;
        for step in [0, 1, 77, 400] {
            let found = find(step, 1, false).unwrap_or_else(|| panic!("{method:?}: step {step} is not found"));
            assert_eq!(Some(&found), find(step, 3, false).as_ref(), "{method:?}, step {step}");
            assert_eq!(found.counter.step, step);
            let retraced = mapping.retrace(&found);
            assert_eq!(retraced.causes, Causes::NONE);
            assert_eq!(first_fault(&retraced.events), None);
            lit += u32::from(!retraced.contribution.is_dark());
            small += u32::from(found.origin == Origin::Step);
        }
        assert!(lit > 0 && small > 0, "{method:?}: {lit} lit, {small} small");
        assert_eq!(find(1 << 40, 1, false), None, "beyond the end of the run");
        assert_eq!(find(400, 1, true), None, "stopped");
    }
}

/// The command that a run ends with replays the path and says where it goes wrong.
#[test]
fn the_command_line_replays_what_it_says() {
    let folder = tempfile::tempdir().unwrap();
    let lamps = lamp("$heat") + &lamp("1");
    let scene = format!("<scene version='3.0.0'><default name='heat' value='1'/>{}</scene>", room(&lamps));
    std::fs::write(folder.path().join("hot.xml"), scene).unwrap();
    let relt = |arguments: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_relt"))
            .args(arguments.split_whitespace())
            .current_dir(folder.path())
            .output()
            .unwrap();
        let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        (output.status.code(), out, err)
    };
    for method in ["path", "mlt", "re"] {
        let run = "--mpp 40 --mapping bidirectional -o a.exr --log a.jsonl";
        let (code, _, said) = relt(&format!("render hot.xml -D heat=3e38 --method {method} {run}"));
        assert_eq!(code, Some(0), "{said}");
        let command = said.lines().find_map(|line| line.split_once(": relt ").map(|(_, command)| command));
        let (code, path, err) = relt(command.unwrap_or_else(|| panic!("no command in\n{said}")));
        assert_eq!(code, Some(0), "{err}");
        assert!(path.contains("<- not finite") && path.contains("settled  "), "{path}");
        let log = std::fs::read_to_string(folder.path().join("a.jsonl")).unwrap();
        let end: serde_json::Value = serde_json::from_str(log.lines().last().unwrap()).unwrap();
        let causes = end["faults"].as_object().expect("causes in the log");
        assert_eq!(causes.values().map(|n| n.as_u64().unwrap()).sum::<u64>(), end["non_finite"].as_u64().unwrap());
    }
    // a path that nothing is wrong with
    let (code, path, err) = relt("replay hot.xml --mapping unidirectional --pixel 3,4 --sample 2");
    assert_eq!(code, Some(0), "{err}");
    assert!(path.contains("camera vertex 1: diffuse") && path.contains("next-event estimation"), "{path}");
    assert!(!path.contains("not finite"), "{path}");
    let (code, _, err) = relt("replay hot.xml --method mlt --mpp 4 --chain 1 --step 1000000");
    assert_eq!(code, Some(1), "{err}");
    assert!(err.contains("the run ends before that evaluation"), "{err}");
}
