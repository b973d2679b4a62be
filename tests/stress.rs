//! `relt stress`: its quick suite, and its command line.

use std::process::{Command, Output};

use relt::stress::{Bench, Verdict, number, selected};

fn relt(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_relt")).arg("stress").args(arguments).output().expect("relt starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// All cases of the quick suite. Chance fails a statistical check with probability 10⁻⁶; seeds are fixed.
#[test]
fn the_quick_suite_passes() {
    let bench = Bench::new(true).unwrap_or_else(|error| panic!("{error}"));
    let mut failed = Vec::new();
    for case in selected(&[], true) {
        let report = case.run(&bench);
        for check in report.checks.iter().filter(|check| check.verdict != Verdict::Pass) {
            let (expected, got) = (check.expected_in_words(), number(check.got));
            let (what, within) = (&check.quantity, number(check.tolerance));
            failed.push(format!("{}: {what}: expected {expected} ± {within}, got {got}", report.case));
        }
        assert!(!report.checks.is_empty(), "{} checks nothing", report.case);
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn cases_are_listed_and_chosen_by_name() {
    let all = text(&relt(&["--list"]).stdout);
    let quick = text(&relt(&["--list", "--quick"]).stdout);
    let scales = text(&relt(&["--list", "scale/"]).stdout);
    assert!(all.lines().count() > quick.lines().count() && quick.lines().count() > 10, "{all}\n{quick}");
    assert!(scales.lines().count() > 5 && scales.lines().all(|line| line.starts_with("scale/")), "{scales}");
    let none = relt(&["no-such-case"]);
    assert_eq!(none.status.code(), Some(2));
    assert!(text(&none.stderr).contains("no case of the suite has no-such-case in its name"), "{}", text(&none.stderr));
}

#[test]
fn what_was_checked_is_shown_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("stress.json");
    let output = relt(&["long-runs/", "-o", file.to_str().unwrap()]);
    let shown = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{shown}");
    assert!(shown.contains("long-runs/film") && shown.contains("3 of 3 cases pass"), "{shown}");
    let report: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    let cases = report["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 3);
    for case in cases {
        assert_eq!(case["verdict"], "pass");
        for check in case["checks"].as_array().unwrap() {
            assert!(check["expected"].is_number() && check["got"].is_number() && check["tolerance"].is_number());
        }
    }
    let table = text(&relt(&["long-runs/", "--markdown"]).stdout);
    assert!(table.starts_with("| case |") && table.lines().count() == 5, "{table}");
}

#[test]
fn files_that_cannot_be_written_are_known_before() {
    let output = relt(&["long-runs/film", "-o", "/no/such/folder/a.json"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty(), "{}", text(&output.stdout));
}

/// 60,000² pixels in five layers would take more than a terabyte.
#[test]
#[cfg(target_os = "linux")]
fn films_that_cannot_be_had_are_refused_before_anything_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let scene = "<scene version='3.0.0'><sensor type='perspective'><film type='hdrfilm'>
        <integer name='width' value='60000'/><integer name='height' value='60000'/></film></sensor>
        <emitter type='constant'/></scene>";
    std::fs::write(folder.path().join("large.xml"), scene).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_relt"));
    let output = command.args(["render", "large.xml", "-o", "a.exr"]).current_dir(folder.path()).output().unwrap();
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("the film is too large: 60000 × 60000 pixels in 5 layers take 1152.0 GB"), "{message}");
    assert!(!folder.path().join("a.exr").exists());
}
