//! The program at work: files, log, signals, and what it says.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use relt::film::{Plane, Value, exr_file};

#[cfg(target_os = "linux")]
#[path = "cli_run/short.rs"]
mod short;

const CORNELL_BOX: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.xml");

/// `relt render` on the Cornell box at 32 × 32 pixels.
fn command(folder: &Path, options: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relt"));
    command.args(["render", CORNELL_BOX, "-D", "res=32"]).args(options).current_dir(folder);
    command
}

fn rendered(folder: &Path, options: &[&str]) -> (Output, String) {
    let output = command(folder, options).output().unwrap();
    let text = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(0), "{options:?}:\n{text}");
    assert!(!text.contains('\x1b') && !text.contains('\r'), "{options:?}: escape codes without a terminal:\n{text}");
    (output, text)
}

fn log_lines(path: &Path) -> Vec<serde_json::Value> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_run_leaves_image_preview_and_log() {
    for method in ["path", "mlt", "re"] {
        let folder = tempfile::tempdir().unwrap();
        let (output, text) = rendered(folder.path(), &["--method", method, "--mpp", "8", "--log", "run.jsonl"]);
        assert!(output.stdout.is_empty());
        assert!(text.contains("wrote cornell-box.exr and cornell-box.png"), "{text}");
        assert_eq!(names(folder.path()), ["cornell-box.exr", "cornell-box.png", "run.jsonl"]);

        let read = exr_file::read_file(&folder.path().join("cornell-box.exr")).unwrap();
        assert_eq!((read.image.width, read.image.height), (32, 32));
        assert!(read.image.mean().iter().all(|mean| mean.is_finite() && *mean > 0.0), "{:?}", read.image.mean());
        assert!(read.metadata.contains(&("method".into(), Value::from(method))), "{:?}", read.metadata);
        for (name, plane) in &read.layers {
            let finite = match plane {
                Plane::Rgb(image) => image.pixels.as_flattened().iter().all(|value| value.is_finite()),
                Plane::Gray(values) => values.iter().all(|value| value.is_finite()),
            };
            assert!(finite, "{method}: layer {name}");
        }

        let log = log_lines(&folder.path().join("run.jsonl"));
        let (first, last) = (&log[0], &log[log.len() - 1]);
        assert_eq!((&first["event"], &first["method"]), (&"run_start".into(), &method.into()));
        assert_eq!((&last["event"], &last["interrupted"]), (&"run_end".into(), &false.into()));
        assert!(last["mutations"].as_u64().unwrap() >= 8 * 32 * 32, "{last}");
        assert_eq!(last["outputs"], serde_json::json!(["cornell-box.exr", "cornell-box.png"]));
    }
}

/// 64 × 64 pixels at 32 mutations each leave a trial just the points that it needs.
#[test]
fn the_mapping_is_told_with_why_it_was_chosen() {
    let told = |options: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let files = ["-o", "a.exr", "--log", "run.jsonl"];
        let scene = CORNELL_BOX.replace("cornell-box", "lattice");
        let mut command = Command::new(env!("CARGO_BIN_EXE_relt"));
        command.args(["render", &scene, "--method", "path"]).args(options).args(files).current_dir(folder.path());
        let output = command.output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{text}");
        let read = exr_file::read_file(&folder.path().join("a.exr")).unwrap();
        let start = log_lines(&folder.path().join("run.jsonl"))[0].clone();
        let name = start["mapping"].as_str().unwrap().to_owned();
        assert!(read.metadata.contains(&("mapping".into(), Value::from(name.as_str()))), "{:?}", read.metadata);
        assert!(text.contains(&format!(", {name} mapping, ")), "{text}");
        (name, start["mapping_trial"].as_str().map(str::to_owned), text, read.image)
    };
    let with_trial = |threads| told(&["-D", "res=64", "--mpp", "32", "--threads", threads]);
    let (name, why, text, image) = with_trial("1");
    assert_ne!(name, "unidirectional", "{text}");
    let why = why.expect("a trial");
    assert!(why.starts_with(&name) && why.contains("bidirectional 0.") && text.contains(&why), "{text}");
    let two = with_trial("2");
    assert_eq!((two.0, two.1, two.3 == image), (name, Some(why), true));

    let (name, why, text, _) = told(&["-D", "res=16", "--mpp", "1"]);
    assert_eq!(name, "unidirectional");
    assert!(why.is_some_and(|why| why.contains("no room for a trial") && text.contains(&why)), "{text}");
    let (name, why, text, _) = told(&["-D", "res=16", "--mpp", "1", "--mapping", "multiplexed"]);
    assert_eq!((name.as_str(), why), ("multiplexed", None), "{text}");
}

#[test]
fn quiet_runs_say_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (output, text) = rendered(folder.path(), &["--mpp", "1", "--quiet", "-o", "a.png"]);
    assert!(output.stdout.is_empty() && text.is_empty(), "{text}");
    assert_eq!(names(folder.path()), ["a.png"]);
}

#[test]
fn time_ends_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let begin = Instant::now();
    rendered(folder.path(), &["--time", "500ms"]);
    assert!((0.5..30.0).contains(&begin.elapsed().as_secs_f64()), "{:?}", begin.elapsed());
}

#[cfg(unix)]
#[test]
fn a_signal_ends_a_run_with_the_image_of_what_is_done() {
    for signal in ["INT", "TERM"] {
        let folder = tempfile::tempdir().unwrap();
        let options = ["--time", "10m", "--snapshot", "200ms", "--log", "run.jsonl", "-o", "a.exr"];
        let child = command(folder.path(), &options).stderr(Stdio::piped()).spawn().unwrap();
        // The first snapshot shows that the run is under way.
        let patience = Instant::now() + Duration::from_secs(60);
        while !folder.path().join("a.png").exists() {
            assert!(Instant::now() < patience, "no snapshot within a minute");
            std::thread::sleep(Duration::from_millis(20));
        }
        let killed = Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).status().unwrap();
        assert!(killed.success());
        let output = child.wait_with_output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{text}");
        assert!(text.contains("interrupted") && text.contains("wrote a.exr and a.png"), "{text}");
        assert_eq!(names(folder.path()), ["a.exr", "a.png", "run.jsonl"], "no temporary files remain");
        let log = log_lines(&folder.path().join("run.jsonl"));
        assert_eq!(log[log.len() - 1]["interrupted"], true);
        assert!(log.iter().any(|line| line["event"] == "snapshot" && line["image_written"] == true));
    }
}

#[test]
fn threads_and_packets_do_not_change_a_bit() {
    let image = |options: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        rendered(folder.path(), &[&["--mpp", "8", "--seed", "3", "-o", "a.exr"], options].concat());
        let read = exr_file::read_file(&folder.path().join("a.exr")).unwrap();
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let mut planes = vec![bits(read.image.pixels.as_flattened())];
        planes.extend(read.layers.iter().map(|(_, plane)| match plane {
            Plane::Rgb(image) => bits(image.pixels.as_flattened()),
            Plane::Gray(values) => bits(values),
        }));
        planes
    };
    let expected = image(&["--threads", "1", "--packet", "1"]);
    for options in [["--threads", "2", "--packet", "1"], ["--threads", "3", "--packet", "8"]] {
        assert!(image(&options) == expected, "{options:?} gives another image");
    }
}
