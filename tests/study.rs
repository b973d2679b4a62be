//! `relt study`: from a study file to runs, tables and a page; stopped, killed and taken up again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use relt::film::{Plane, exr_file};
use serde_json::Value;

const BOX: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.xml");

/// Two methods, one of them with two ladders, on a small Cornell box.
fn study(more: &str) -> String {
    format!(
        "title = \"Small\"\nmpp = 24\nseeds = 2\nsnapshots = 3\n{more}\n[[scene]]\nfile = \"{BOX}\"\n\
         define = {{ res = 32 }}\n[[method]]\nmethod = \"mlt\"\n[[method]]\nmethod = \"re\"\nreplicas = [1, 3]\n"
    )
}

fn relt(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relt"));
    command.arg("study").args(arguments).current_dir(folder);
    command
}

fn done(output: Output) -> (String, String) {
    let [text, errors] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert_eq!(output.status.code(), Some(0), "{errors}");
    (text, errors)
}

fn write_study(folder: &Path, text: &str) {
    std::fs::write(folder.join("small.toml"), text).unwrap();
}

/// Finished records by name, in the folder of a study.
fn records(folder: &Path) -> BTreeMap<String, Vec<Value>> {
    let Ok(entries) = std::fs::read_dir(folder.join("runs")) else { return BTreeMap::new() };
    let paths =
        entries.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "jsonl"));
    let lines = |path: &PathBuf| {
        let text = std::fs::read_to_string(path).unwrap();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    };
    paths.map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), lines(&path))).collect()
}

fn events<'a>(lines: &'a [Value], event: &str) -> Vec<&'a Value> {
    lines.iter().filter(|line| line["event"] == event).collect()
}

/// All that a study found but for times: mutations, rays and errors of every moment of every run, and its last image.
fn findings(folder: &Path) -> BTreeMap<String, (Vec<[Value; 4]>, Vec<u32>)> {
    let finding = |(name, lines): (String, Vec<Value>)| {
        let moments = events(&lines, "errors");
        let told = moments
            .iter()
            .map(|m| ["mutations", "rays", "errors", "stated_brightness_error"].map(|key| m[key].clone()));
        let image = folder.join(moments.last().unwrap()["image"].as_str().unwrap());
        let image = exr_file::read_file(&image).unwrap().image;
        (name, (told.collect(), image.pixels.as_flattened().iter().map(|value| value.to_bits()).collect()))
    };
    records(folder).into_iter().map(finding).collect()
}

#[test]
fn a_study_leaves_runs_images_tables_plots_and_a_page() {
    let folder = tempfile::tempdir().unwrap();
    write_study(folder.path(), &study("note = \"What for.\""));
    let (text, progress) = done(relt(folder.path(), &["small.toml"]).output().unwrap());
    assert!(text.contains("cornell-box") && text.contains("re, replicas 3"), "{text}");
    assert!(text.trim_end().ends_with("small/report.html"), "{text}");
    assert!(progress.contains("6/6 cornell-box, "), "{progress}");
    let result = folder.path().join("small");
    for name in ["report.html", "results.csv", "study.toml", "runs", "pictures/cornell-box-mlt-error.png"] {
        assert!(result.join(name).exists(), "{name}");
    }
    assert!(std::fs::read_to_string(result.join("report.html")).unwrap().contains("What for."));
    assert!(std::fs::read_dir(result.join("plots")).unwrap().count() > 0);

    let records = records(&result);
    assert_eq!(records.len(), 6);
    for (name, lines) in &records {
        assert_eq!(
            (&lines[0]["event"], &lines[lines.len() - 1]["event"]),
            (&"job".into(), &"job_end".into()),
            "{name}"
        );
        let start = events(lines, "run_start")[0];
        assert_eq!(start["settings"]["seed"], lines[0]["seed"], "{name}");
        let moments = events(lines, "errors");
        let of = |key: &str| moments.iter().map(|m| m[key].as_f64().unwrap()).collect::<Vec<_>>();
        assert!(of("wall_seconds").windows(2).all(|pair| pair[0] < pair[1]), "{name}: {:?}", of("wall_seconds"));
        assert!(of("mutations").last() >= Some(&(24.0 * 1024.0)), "{name}");
        let first_seed = lines[0]["seed"] == 1;
        let images = moments.iter().filter(|m| !m["image"].is_null()).count();
        assert_eq!(images, if first_seed { moments.len() } else { 1 }, "{name}");
    }
    let mut reader = csv::Reader::from_path(result.join("results.csv")).unwrap();
    let rows = reader.records().count();
    assert_eq!(rows, records.values().map(|lines| events(lines, "errors").len()).sum::<usize>());

    // nothing is left to do
    let (_, progress) = done(relt(folder.path(), &["small.toml"]).output().unwrap());
    assert_eq!(progress.trim_end(), "6 of 6 runs are finished already");
}

#[test]
fn a_run_of_a_study_is_the_run_that_its_command_repeats() {
    let folder = tempfile::tempdir().unwrap();
    write_study(folder.path(), &study(""));
    done(relt(folder.path(), &["small.toml", "--quiet"]).output().unwrap());
    let result = folder.path().join("small");
    for (name, lines) in records(&result).iter().filter(|(name, _)| name.contains("replicas-3-2")) {
        let command = lines[0]["command"].as_str().unwrap().strip_prefix("relt ").unwrap();
        let repeated = Command::new(env!("CARGO_BIN_EXE_relt"))
            .args(command.split(' '))
            .args(["-o", "again.exr", "--quiet"])
            .current_dir(folder.path())
            .status();
        assert!(repeated.unwrap().success(), "{command}");
        let image = events(lines, "errors").last().unwrap()["image"].as_str().unwrap().to_owned();
        let read = |path: &Path| exr_file::read_file(path).unwrap();
        let (kept, again) = (read(&result.join(image)), read(&folder.path().join("again.exr")));
        assert_eq!(kept.image, again.image, "{name}");
        assert!(matches!(&kept.layers[0], (name, Plane::Gray(_)) if name == "density"));
    }
}

/// Kills the study over and over as soon as another run is finished, until it ends by itself; no image changes.
#[cfg(unix)]
#[test]
fn a_study_that_is_killed_again_and_again_comes_to_the_same_as_one_that_is_not() {
    let folder = tempfile::tempdir().unwrap();
    write_study(folder.path(), &study(""));
    let whole = folder.path().join("whole");
    done(relt(folder.path(), &["small.toml", "-o", "whole", "-q"]).output().unwrap());
    let killed = folder.path().join("killed");
    let mut kills = 0;
    loop {
        let before = records(&killed).len();
        let mut child =
            relt(folder.path(), &["small.toml", "-o", "killed", "-q"]).stdout(Stdio::null()).spawn().unwrap();
        let begin = Instant::now();
        let ended = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break Some(status);
            }
            if records_by_name(&killed) > before {
                break None;
            }
            assert!(begin.elapsed() < Duration::from_secs(120), "it neither ends nor finishes a run");
            std::thread::sleep(Duration::from_millis(5));
        };
        match ended {
            Some(status) => {
                assert!(status.success());
                break;
            }
            None => {
                child.kill().unwrap();
                child.wait().unwrap();
                kills += 1;
            }
        }
    }
    assert!(kills >= 3, "killed {kills} times only");
    assert!(findings(&whole) == findings(&killed));
}

/// Number of finished records, without reading them.
fn records_by_name(folder: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(folder.join("runs")) else { return 0 };
    entries.filter(|entry| entry.as_ref().unwrap().path().extension().is_some_and(|e| e == "jsonl")).count()
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_what_is_finished_and_reports_it() {
    let folder = tempfile::tempdir().unwrap();
    write_study(folder.path(), &study("").replace("mpp = 24", "mpp = 300"));
    let mut child = relt(folder.path(), &["small.toml"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let result = folder.path().join("small");
    let begin = Instant::now();
    while records_by_name(&result) == 0 {
        assert!(child.try_wait().unwrap().is_none() && begin.elapsed() < Duration::from_secs(120));
        std::thread::sleep(Duration::from_millis(5));
    }
    let interrupt = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(interrupt.success());
    let output = child.wait_with_output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{errors}");
    assert!(errors.contains("stopped: the same command goes on"), "{errors}");
    let page = std::fs::read_to_string(result.join("report.html")).unwrap();
    assert!(page.contains("of 6 runs are not finished"));
    assert!(std::fs::read_dir(result.join("runs")).unwrap().all(|e| !e.unwrap().path().ends_with(".part")));
}

#[test]
fn what_changes_is_done_again_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    write_study(folder.path(), &study(""));
    done(relt(folder.path(), &["small.toml", "-q"]).output().unwrap());
    // another seed, another ladder, another name for what stays
    let changed =
        study("").replace("seeds = 2", "seeds = 3").replace("[1, 3]", "[1, 2]").replace("\"Small\"", "\"Renamed\"");
    write_study(folder.path(), &changed);
    let (text, _) = done(relt(folder.path(), &["small.toml", "--dry-run"]).output().unwrap());
    assert!(text.contains("9 runs, 4 of them finished"), "{text}");
    let (_, progress) = done(relt(folder.path(), &["small.toml"]).output().unwrap());
    assert!(
        progress.starts_with("4 of 9 runs are finished already\n5/9 cornell-box, re, replicas 2, seed 1"),
        "{progress}"
    );
}

#[test]
fn a_dry_run_lists_commands_and_times_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    write_study(folder.path(), &study("").replace("mpp = 24", "time = \"90s\""));
    let (text, _) = done(relt(folder.path(), &["small.toml", "--dry-run"]).output().unwrap());
    assert!(
        text.contains("re, replicas 3, seed 2\n      relt render ")
            && text.contains(" --replicas 3 --seed 2 --time 90000ms"),
        "{text}"
    );
    assert!(text.ends_with("6 runs, 0 of them finished; the others take about 9 min\n"), "{text}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    write_study(folder.path(), &study(""));
    let (text, _) = done(relt(folder.path(), &["small.toml", "--dry-run"]).output().unwrap());
    assert!(text.contains("6 runs, 0 of them finished; the others take about "), "{text}");
}

#[test]
fn equal_time_means_equal_time_with_the_clock_stopped_for_looking() {
    let folder = tempfile::tempdir().unwrap();
    let text = study("").replace("mpp = 24", "time = \"1500ms\"").replace("snapshots = 3", "snapshots = 9");
    write_study(folder.path(), &text.replace("seeds = 2", "seeds = [5]"));
    done(relt(folder.path(), &["small.toml", "-q"]).output().unwrap());
    for (name, lines) in records(&folder.path().join("small")) {
        let seconds: Vec<f64> = events(&lines, "errors").iter().map(|m| m["wall_seconds"].as_f64().unwrap()).collect();
        assert!(seconds.windows(2).all(|pair| pair[0] < pair[1]), "{name}: {seconds:?}");
        // a slice may be under way when time is up; on a machine that others use as well it may take a while
        assert!(seconds.last().is_some_and(|end| (1.5..4.0).contains(end)), "{name}: {seconds:?}");
        assert!(seconds.len() >= 2, "{name}: {seconds:?}");
    }
}

#[test]
fn what_cannot_be_studied_is_told_before_anything_is_rendered() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |text: &str, expected: &[&str]| {
        write_study(folder.path(), text);
        let output = relt(folder.path(), &["small.toml"]).output().unwrap();
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{errors}");
        for part in expected {
            assert!(errors.contains(part), "{part:?} is not in:\n{errors}");
        }
        assert!(!folder.path().join("small").exists());
    };
    refused(
        &study("").replace("\"mlt\"", "\"mtl\"").replace("[1, 3]", "\"some\""),
        &[
            "small.toml:9:1: method `mtl`: invalid value 'mtl' for '--method",
            "small.toml:11:1: method `re`: invalid value 'some'",
        ],
    );
    refused(&study("").replace("scene.xml", "scen.xml"), &["scen.xml", "cannot be read"]);
    refused(
        &study("").replace("res = 32", "res = 33"),
        &["reference.exr has 256 × 256 pixels", "33 × 33; accepted are"],
    );
    refused(&study("").replace("res = 32 }", "res = 32 }\nreference = \"none.exr\""), &["none.exr"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_is_one_studys_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    write_study(folder.path(), &study(""));
    std::fs::create_dir(folder.path().join("small")).unwrap();
    let lock = std::fs::File::create(folder.path().join("small/lock")).unwrap();
    lock.lock().unwrap();
    let output = relt(folder.path(), &["small.toml"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("another relt is at work in it"));
}

/// A launcher that starts one process whatever it is told: with one rank the run is that of the study's own process; with two,
/// the budget of each worker is there twice.
#[test]
fn runs_by_a_launcher_come_to_the_same_and_scale() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "title = \"Ranks\"\nmpp = 24\nseeds = 1\n[[scene]]\nfile = \"{BOX}\"\n\
         define = {{ res = 32 }}\n[options]\nthreads = 1\nmethod = \"path\"\n[[method]]\nname = \"here\"\n[[method]]\n\
         name = \"on {{ranks}}\"\nranks = [1, 2]\nper-worker = true\n"
    );
    write_study(folder.path(), &text);
    let refused = relt(folder.path(), &["small.toml"]).output().unwrap();
    assert!(String::from_utf8_lossy(&refused.stderr).contains("method `on 1` is for 1 ranks: give --launch"));
    done(relt(folder.path(), &["small.toml", "--launch", "env RANKS={ranks}"]).output().unwrap());
    let result = folder.path().join("small");
    let records = records(&result);
    let run = |method: &str| {
        let lines = records.values().find(|lines| lines[0]["method"] == method).expect(method);
        let end = *events(lines, "errors").last().unwrap();
        (lines[0]["command"].as_str().unwrap().to_owned(), end["mutations"].as_f64().unwrap(), end["errors"].clone())
    };
    let [here, one, two] = ["here", "on 1", "on 2"].map(run);
    assert_eq!((here.1, &here.2), (one.1, &one.2));
    assert!((two.1 / one.1 - 2.0).abs() < 0.1, "{} and {}", one.1, two.1);
    assert!(two.0.starts_with("env RANKS=2 relt render ") && two.0.ends_with("--mpp 48"), "{}", two.0);
    let page = std::fs::read_to_string(result.join("report.html")).unwrap();
    assert!(page.contains("by ranks: --method path --threads 1 --per-worker"), "two runs that differ in ranks");
    assert_eq!(std::fs::read_dir(result.join("runs")).unwrap().count(), 3, "logs are in the records");
}
