//! Runs to whom something is short: room on a disk, address space, numbers of the processor.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use relt::film::exr_file;
use relt::render::checkpoint;

use super::{log_lines, names};

/// `relt render` on the Cornell box at 24 × 24 pixels, by a program that sets limits before it, with temporary files in
/// the folder `tmp`.
fn limited(folder: &Path, limits: &[&str], options: &[&str]) -> Command {
    fs::create_dir_all(folder.join("tmp")).unwrap();
    let mut command = Command::new("prlimit"); // of util-linux
    command.args(limits).args(["--", env!("CARGO_BIN_EXE_relt"), "render", super::CORNELL_BOX, "-D", "res=24"]);
    command.args(options).current_dir(folder).env("TMPDIR", folder.join("tmp"));
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// What a run said that ends with that exit code.
fn said(child: Child, code: i32) -> String {
    let output = child.wait_with_output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{text}");
    assert!(!text.contains("panicked"), "{text}");
    text
}

/// Waits until something holds.
fn wait_until(what: &str, holds: impl Fn() -> bool) {
    let patience = Instant::now() + Duration::from_secs(60);
    while !holds() {
        assert!(Instant::now() < patience, "{what}: not within a minute");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The file of that name in the folder that was made among the temporary files.
fn among_temporary(folder: &Path, name: &str) -> PathBuf {
    let folders = names(&folder.join("tmp")).into_iter().map(|made| folder.join("tmp").join(made));
    let found: Vec<PathBuf> = folders.map(|made| made.join(name)).filter(|file| file.exists()).collect();
    let [file] = &found[..] else { panic!("{name} is there {} times", found.len()) };
    file.clone()
}

/// The limit of file sizes stands for a full disk: what is beyond it is refused in the same places. It is taken back while
/// the run is at work.
#[test]
fn a_run_goes_on_while_the_disk_is_full_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let intervals = ["--time", "10m", "--snapshot", "100ms", "--checkpoint", "100ms", "--threads", "1"];
    let files = ["--log", "run.jsonl", "-o", "a.exr"];
    let child = limited(folder.path(), &["--fsize=1000:"], &[&intervals[..], &files].concat()).spawn().unwrap();
    wait_until("a log up to its limit", || at("run.jsonl").metadata().is_ok_and(|file| file.len() == 1000));
    std::thread::sleep(Duration::from_millis(2500)); // snapshots, checkpoints and lines of the log are refused
    let files = || names(folder.path()).into_iter().filter(|name| !name.ends_with(".lock"));
    // but for the moment in which an attempt is made
    wait_until("no picture, no checkpoint, nothing half done", || files().eq(["run.jsonl", "tmp"]));
    let id = child.id().to_string();
    assert!(Command::new("prlimit").args(["--pid", &id, "--fsize=unlimited:"]).status().unwrap().success());
    wait_until("a picture", || at("a.png").exists());
    wait_until("a checkpoint", || at("a.checkpoint").exists());
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let text = said(child, 0);
    let refused = "it is larger than files may be here";
    for what in ["cannot write a.exr: ", "no checkpoint: cannot write a.checkpoint: ", "log: "] {
        assert!(text.contains(&format!("warning: {what}{refused}")), "{what}: {text}");
    }
    assert!(!text.contains("incomplete") && text.contains("wrote a.exr, a.png and a.checkpoint"), "{text}");
    let log = log_lines(&at("run.jsonl"));
    let (first, last) = (&log[0], &log[log.len() - 1]);
    assert_eq!((&first["event"], &last["event"]), (&"run_start".into(), &"run_end".into()));
    assert!(log.iter().any(|line| line["event"] == "snapshot" && line["seconds"].as_f64() < Some(2.0)), "{log:?}");
    exr_file::read_file(&at("a.exr")).unwrap();
    checkpoint::open_one(&at("a.checkpoint")).unwrap();
    assert!(names(&at("tmp")).is_empty(), "all found its place");
}

#[test]
fn pictures_and_parts_that_find_no_place_are_put_elsewhere_and_the_run_fails() {
    let run = |options: &[&str], files: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("disk");
        fs::create_dir(&place).unwrap();
        let options = [&["--time", "10m", "--threads", "1", "--log", "run.jsonl"], options].concat();
        let child = limited(folder.path(), &[], &options).spawn().unwrap();
        wait_until("a log", || folder.path().join("run.jsonl").metadata().is_ok_and(|file| file.len() > 0));
        fs::remove_dir_all(&place).unwrap(); // with the locks by which the run claims its files
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        let text = said(child, 1);
        let log = log_lines(&folder.path().join("run.jsonl"));
        for name in files {
            let there = among_temporary(folder.path(), name).display().to_string();
            assert!(
                text.contains("there is no folder disk") && text.contains(&format!("it is in {there} instead")),
                "{text}"
            );
            let told = log[log.len() - 1]["outputs"].as_array().unwrap();
            assert!(told.contains(&there.into()), "{told:?}");
        }
        folder
    };
    let folder = run(&["-o", "disk/a.exr"], &["a.exr", "a.png"]);
    let picture = exr_file::read_file(&among_temporary(folder.path(), "a.exr")).unwrap();
    assert!(picture.image.mean().iter().all(|mean| *mean > 0.0));
    let folder = run(&["--part", "1/2", "--checkpoint-file", "disk/a.part", "--mpp", "100000"], &["a.part"]);
    checkpoint::open_one(&among_temporary(folder.path(), "a.part")).unwrap();
}

#[test]
fn a_picture_that_finds_no_place_anywhere_is_an_error_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--mpp", "4", "--log", "run.jsonl", "-o", "a.exr", "--threads", "1"];
    let text = said(limited(folder.path(), &["--fsize=1000"], &options).spawn().unwrap(), 1);
    assert!(text.contains("error: cannot write a.exr: it is larger than files may be here"), "{text}");
    assert!(
        text.contains("; nor elsewhere: cannot write ") && text.contains("warning: the log is incomplete"),
        "{text}"
    );
    assert_eq!(
        (names(folder.path()), names(&folder.path().join("tmp"))),
        (vec!["run.jsonl".into(), "tmp".into()], vec![])
    );
}

/// From too little for anything up to enough: an end with an error, or a picture, and never an end by a signal.
#[test]
fn little_address_space_ends_no_run_half_way() {
    let mut ends = Vec::new();
    for megabytes in (100..=1500).step_by(100) {
        let folder = tempfile::tempdir().unwrap();
        let limit = format!("--as={}", megabytes << 20);
        let options = ["--mpp", "4", "-o", "a.exr", "--threads", "2"];
        let output = limited(folder.path(), &[&limit], &options).output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        match output.status.code() {
            Some(0) => assert!(folder.path().join("a.exr").exists()),
            Some(2) => assert!(text.contains("memory is short: the run takes up to 0."), "{megabytes} MB: {text}"),
            code => panic!("{megabytes} MB: {code:?}, {text}"),
        }
        ends.push(output.status.code());
    }
    assert_eq!((ends[0], ends[ends.len() - 1]), (Some(2), Some(0)));
}

/// A library that sets FTZ and DAZ as it is loaded, as some that are compiled for speed do; threads inherit that.
#[cfg(target_arch = "x86_64")]
fn flushing_library(folder: &Path) -> PathBuf {
    let (source, library) = (folder.join("flush.c"), folder.join("flush.so"));
    let text = "__attribute__((constructor)) static void flush(void) {
        __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040); }";
    fs::write(&source, text).unwrap();
    let compiled = Command::new("cc").args(["-shared", "-fPIC", "-o"]).args([&library, &source]).status().unwrap();
    assert!(compiled.success());
    library
}

#[test]
#[cfg(target_arch = "x86_64")]
fn flushed_denormal_numbers_are_told_and_show_in_faint_light_alone() {
    let folder = tempfile::tempdir().unwrap();
    let library = flushing_library(folder.path());
    let picture = |flushed: bool, method: &str| {
        let mut command = super::command(folder.path(), &["--mpp", "32", "--method", method, "-o", "a.exr"]);
        if flushed {
            command.env("LD_PRELOAD", &library);
        }
        let output = command.output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(
            (output.status.code(), text.contains("take numbers below 1.2e-38 for 0")),
            (Some(0), flushed),
            "{text}"
        );
        exr_file::read_file(&folder.path().join("a.exr")).unwrap().image
    };
    for method in ["path", "mlt", "re"] {
        assert!(picture(false, method) == picture(true, method), "{method}");
    }
    let mut faint = Command::new(env!("CARGO_BIN_EXE_relt"));
    let faint = faint.args(["stress", "--quick", "machine/denormals"]).env("LD_PRELOAD", &library).output().unwrap();
    assert_eq!(faint.status.code(), Some(3), "the case notices: {}", String::from_utf8_lossy(&faint.stdout));
}
