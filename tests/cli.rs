//! What the program says, and with which exit code, when it is asked for something that cannot be.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const CORNELL_BOX: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.xml");

fn relt(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_relt")).args(arguments).current_dir(folder).output().unwrap()
}

/// Runs `relt render` on the Cornell box with further options, expects exit code 2 and a message with all `parts`,
/// and that no file appeared.
fn refused(options: &[&str], parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    refused_in(folder.path(), options, parts);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{options:?} left files behind");
}

fn refused_in(folder: &Path, options: &[&str], parts: &[&str]) {
    let arguments = [&["render", CORNELL_BOX], options].concat();
    let output = relt(folder, &arguments);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{options:?}:\n{text}");
    for part in parts {
        assert!(text.contains(part), "{options:?}: {part:?} is not in:\n{text}");
    }
    assert!(!text.contains('\x1b'), "{options:?}: escape codes without a terminal:\n{text}");
    assert!(!text.contains("panicked") && !text.contains("RUST_BACKTRACE"), "{options:?}:\n{text}");
    assert!(output.stdout.is_empty());
}

#[test]
fn senseless_ladders_are_refused() {
    refused(&["--replicas", "0"], &["--replicas 0", "counts the uniform replica"]);
    refused(&["--uniform-share", "1"], &["--uniform-share 1", "--method path"]);
    refused(&["--uniform-share", "-0.5"], &["--uniform-share -0.5"]);
    refused(&["--error", "none"], &["--error", "relative", "absolute"]);
    refused(&["--replicas", "1025"], &["at most 1024"]);
    refused(&["--replicas", "-2"], &["--replicas", "-2"]);
    refused(&["--replicas", "many"], &["--replicas", "many", "auto"]);
    refused(&["--betas", "0,2,1"], &["2 is outside [0, 1]"]);
    refused(&["--betas", "0,-0.5,1"], &["-0.5 is outside [0, 1]"]);
    refused(&["--betas", "0,0.5,0.5,1"], &["0.5 after 0.5 does not rise"]);
    refused(&["--betas", "0.1,1"], &["the first is 0.1"]);
    refused(&["--betas", "0,0.9"], &["the last is 0.9"]);
    refused(&["--betas", "0,nan,1"], &["NaN is outside"]);
    refused(&["--betas", "0"], &["1 given"]);
    refused(&["--betas", "0,,1"], &["--betas"]);
    refused(&["--betas", "0,1", "--replicas", "2"], &["give one of them"]);
}

#[test]
fn a_ladder_needs_replica_exchange() {
    for method in ["path", "mlt"] {
        refused(&["--method", method, "--replicas", "4"], &["--replicas", method, "no ladder"]);
        refused(&["--method", method, "--betas", "0,1"], &["--betas", method, "no ladder"]);
        refused(&["--method", method, "--layers"], &["--layers", method, "no ladder"]);
        refused(&["--method", method, "--combine", "target"], &["--combine", method, "no ladder"]);
        refused(&["--method", method, "--verbose"], &["--verbose", method, "no ladder"]);
    }
    refused(&["--method", "magic"], &["magic", "path", "mlt", "re"]);
    refused(&["--combine", "mean"], &["median", "target", "balance"]);
}

#[test]
fn large_steps_need_metropolis() {
    for method in ["path", "re"] {
        refused(&["--method", method, "--large-steps", "0.5"], &["--large-steps", method, "only mlt"]);
        refused(&["--method", method, "--normalisation", "pooled"], &["--normalisation", method, "only mlt"]);
        refused(&["--method", method, "--kelemen-weights"], &["--kelemen-weights", method, "only mlt"]);
    }
    for p in ["0", "1", "-0.5", "NaN"] {
        refused(&["--method", "mlt", "--large-steps", p], &[&format!("--large-steps {p}"), "above 0", "below 1"]);
    }
    refused(&["--method", "mlt", "--large-steps", "often"], &["--large-steps", "often"]);
    refused(&["--method", "mlt", "--normalisation", "none"], &["none", "two-pass", "pooled"]);
}

#[test]
fn budgets_are_above_zero() {
    refused(&["--mpp", "0"], &["--mpp 0", "above 0"]);
    refused(&["--mpp", "-3"], &["--mpp -3", "above 0"]);
    refused(&["--mpp", "NaN"], &["--mpp NaN", "above 0"]);
    refused(&["--mpp", "inf"], &["--mpp inf", "at most"]);
    refused(&["--time", "0s"], &["--time 0s", "above 0"]);
    refused(&["--time", "60"], &["--time", "unit", "60s"]);
    refused(&["--time", "-5s"], &["--time"]);
    refused(&["--time", "9000000h"], &["more than a year"]);
    refused(&["--snapshot", "0s"], &["--snapshot", "above 0"]);
}

#[test]
fn a_run_is_quiet_or_verbose() {
    refused(&["-q", "-v"], &["--quiet and --verbose: give one of them"]);
}

#[test]
fn machines_have_limits() {
    refused(&["--threads", "0"], &["--threads 0", "1 to 4096"]);
    refused(&["--threads", "-1"], &["--threads"]);
    refused(&["--threads", "4096", "--pin"], &["--pin", "4096 threads"]);
    refused(&["--packet", "2"], &["--packet", "auto", "16"]);
    refused(&["--seed", "-1"], &["--seed"]);
}

#[test]
fn all_contradictions_are_told_at_once() {
    refused(
        &["--replicas", "0", "--mpp", "0", "--time", "0s", "--threads", "0", "-D", "a=1", "-D", "a=2"],
        &["--replicas 0", "--mpp 0", "--time 0s", "--threads 0", "-D a: given more than once"],
    );
}

#[test]
fn definitions_are_name_and_value() {
    refused(&["-D", "res"], &["--define", "name=value"]);
}

#[test]
fn unsupported_image_formats_are_refused_with_those_supported() {
    for name in ["out.jpg", "out", "out.exr.gz"] {
        refused(&["-o", name], &[name, ".exr", ".png"]);
    }
}

#[test]
fn what_cannot_be_written_is_refused_before_anything_is_read() {
    refused(&["-o", "nowhere/out.exr"], &["nowhere/out.exr", "there is no folder nowhere"]);
    refused(&["--log", "nowhere/run.jsonl"], &["nowhere/run.jsonl", "there is no folder nowhere"]);
    refused(&["-o", "a.exr", "--log", "a.png"], &["--log a.png", "the image goes there"]);
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("taken.png")).unwrap();
    refused_in(folder.path(), &["-o", "taken.exr"], &["taken.png", "it is a folder"]);
    std::fs::write(folder.path().join("file"), "").unwrap();
    refused_in(folder.path(), &["-o", "file/out.exr"], &["file/out.exr"]);
}

/// Root may write anywhere, so this says something only where tests run as somebody else.
#[cfg(unix)]
#[test]
fn a_folder_without_permission_is_refused() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let locked: PathBuf = folder.path().join("locked");
    std::fs::create_dir(&locked).unwrap();
    std::fs::set_permissions(&locked, std::fs::Permissions::from_mode(0o555)).unwrap();
    if std::fs::write(locked.join("try"), "").is_err() {
        refused_in(folder.path(), &["-o", "locked/out.exr"], &["locked/out.exr", "permission denied"]);
        refused_in(folder.path(), &["--log", "locked/run.jsonl"], &["locked/run.jsonl", "permission denied"]);
    }
}

#[test]
fn a_missing_scene_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["render", "info"] {
        let output = relt(folder.path(), &[command, "missing.xml"]);
        assert_eq!(output.status.code(), Some(2));
        assert!(String::from_utf8(output.stderr).unwrap().contains("missing.xml"));
    }
}

#[test]
fn help_tells_exit_codes_defaults_and_units() {
    let folder = tempfile::tempdir().unwrap();
    let output = relt(folder.path(), &["render", "--help"]);
    assert_eq!(output.status.code(), Some(0));
    // lines are broken where the window ends
    let text = String::from_utf8(output.stdout).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
    for part in ["Exit codes:", "[default: auto]", "[possible values: path, mlt, re]", "60s", "130"] {
        assert!(text.contains(part), "{part:?} is not in:\n{text}");
    }
    assert_eq!(relt(folder.path(), &["--version"]).status.code(), Some(0));
    assert_eq!(relt(folder.path(), &[]).status.code(), Some(2));
    assert_eq!(relt(folder.path(), &["paint"]).status.code(), Some(2));
}

#[test]
fn a_confined_scene_reads_nothing_from_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    std::fs::create_dir(folder.path().join("scene")).unwrap();
    write("out.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let shape = "<shape type='obj'><string name='filename' value='../out.obj'/></shape>";
    let film = "<film type='hdrfilm'><integer name='width' value='4'/><integer name='height' value='4'/></film>";
    let around = "<sensor type='perspective'>".to_owned() + film + "</sensor><emitter type='constant'/>";
    write("scene/scene.xml", &format!("<scene version='3.0.0'>{shape}{around}</scene>"));
    write("scene/old.xml", &format!("<scene version='2.0.0'>{shape}{around}</scene>"));
    let method = "[[method]]\nmethod = 'path'\n";
    write("study.toml", &format!("title = 'a'\nmpp = 1\n[[scene]]\nfile = 'scene/scene.xml'\n{method}"));
    let run = |arguments: &[&str]| {
        let output = relt(folder.path(), arguments);
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let commands: [&[&str]; 6] = [
        &["render", "scene/scene.xml", "-o", "a.exr"],
        &["info", "scene/scene.xml"],
        &["reference", "scene/scene.xml", "--target-relmse", "1", "-o", "b.exr"],
        &["replay", "scene/scene.xml", "--method", "path", "--mpp", "1", "--pixel", "0,0", "--sample", "0"],
        &["study", "study.toml", "--dry-run"],
        &["convert", "scene/old.xml", "scene/new.xml"],
    ];
    for command in commands {
        let (code, text) = run(&[command, &["--confine"]].concat());
        assert_eq!(code, Some(2), "{command:?}:\n{text}");
        let words: String = text.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
        for part in ["../out.obj is not read", "outside of the scene's folder", "--confine forbids"] {
            assert!(words.contains(part), "{command:?}: {part:?} is not in:\n{text}");
        }
    }
    for command in [commands[1], commands[5]] {
        let (code, text) = run(command);
        assert_eq!(code, Some(0), "without --confine:\n{text}");
    }
    // no key of a study: it would have no effect there
    write(
        "study.toml",
        &format!("title = 'a'\nmpp = 1\n[[scene]]\nfile = 'scene/scene.xml'\n{method}confine = true\n"),
    );
    let (code, text) = run(&["study", "study.toml", "--dry-run"]);
    assert!(code == Some(2) && text.contains("`confine` is no option of a method"), "{text}");
}
