//! `relt convert` at the command line.

use std::path::Path;
use std::process::{Command, Output};

use crate::support::Folder;

fn relt(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_relt")).arg("convert").args(arguments).current_dir(folder).output().unwrap()
}

fn assert_output(output: &Output, code: i32, parts: &[&str]) {
    let text = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(code), "{text}");
    for part in parts {
        assert!(text.contains(part), "{part:?} is not in:\n{text}");
    }
    assert!(!text.contains("panicked"), "{text}");
    assert!(output.stdout.is_empty());
}

#[test]
fn notes_go_to_standard_error_and_the_scene_to_its_file() {
    let folder = Folder::new();
    let output = relt(&folder.path(""), &["mitsuba/everything.xml", "new.xml"]);
    assert_output(
        &output,
        0,
        &["mitsuba/everything.xml:107:17: left out: ", "mitsuba/everything.xml:52:17: changed: "],
    );
    let text = std::fs::read_to_string(folder.path("new.xml")).unwrap();
    // what is referred to is seen from the new scene
    assert!(text.contains("value=\"mitsuba/ball.obj\"") && text.contains("value=\"new-files/picture.exr\""), "{text}");
    assert!(folder.path("new-files/picture.exr").is_file());
}

#[test]
fn a_strict_conversion_leaves_nothing_out_and_nothing_behind() {
    let folder = Folder::new();
    let output = relt(&folder.path(""), &["--strict", "mitsuba/everything.xml", "new.xml"]);
    assert_output(&output, 2, &["left out: medium", "--strict: 6 would be left out, so nothing is written"]);
    assert!(!folder.path("new.xml").exists() && !folder.path("new-files").exists());
    assert_output(&relt(&folder.path(""), &["--strict", "mitsuba/plain.xml", "new.xml"]), 0, &[]);
    assert!(folder.path("new.xml").is_file() && !folder.path("new-files").exists());
}

#[test]
fn faults_are_shown_in_place_and_nothing_is_written() {
    let folder = Folder::new();
    std::fs::write(
        folder.path("a.pbrt"),
        "Camera \"perspective\"\nWorldBegin\nShape \"shpere\" \"float radius\" \"x\"\n",
    )
    .unwrap();
    let output = relt(&folder.path(""), &["a.pbrt", "new.xml"]);
    assert_output(&output, 2, &["a.pbrt:3:17: Shape: radius: these are no values of type float", "Shape \"shpere\""]);
    assert!(!folder.path("new.xml").exists());
}

#[test]
fn senseless_paths_are_refused() {
    let folder = Folder::new();
    for (arguments, parts) in [
        (["no.xml", "new.xml"], vec!["no.xml", "cannot be read"]),
        (["mitsuba/picture.png", "new.xml"], vec!["no scene format that can be converted", ".xml, .pbrt"]),
        (["mitsuba/plain.xml", "new.pbrt"], vec!["new.pbrt", "written as .xml"]),
        (["mitsuba/plain.xml", "mitsuba/plain.xml"], vec!["that is the scene to read"]),
        (["mitsuba/plain.xml", "nowhere/new.xml"], vec!["there is no folder nowhere"]),
    ] {
        let output = relt(&folder.path(""), &arguments);
        assert_output(&output, 2, &parts);
    }
}
