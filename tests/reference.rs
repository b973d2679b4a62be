//! `relt reference`: what it leaves, how good that is, and that nothing interrupts it for good.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};

use relt::film::{Value, exr_file};
use relt::study::metrics::{Errors, Reference};

const CORNELL_BOX: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.xml");

/// `relt reference` on the Cornell box at 16 × 16 pixels, to `r.exr` of the folder.
fn command(folder: &Path, options: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relt"));
    command.args(["reference", CORNELL_BOX, "-D", "res=16", "-o", "r.exr"]).args(options).current_dir(folder);
    command
}

/// Exit code and standard error; standard output is empty.
fn reference(folder: &Path, options: &[&str]) -> (Option<i32>, String) {
    let output = command(folder, options).output().unwrap();
    assert!(output.stdout.is_empty());
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(!text.contains('\x1b') && !text.contains("panicked"), "{options:?}:\n{text}");
    (output.status.code(), text)
}

fn number(metadata: &[(String, Value)], name: &str) -> f64 {
    match metadata.iter().find(|(n, _)| n == name) {
        Some((_, Value::Number(number))) => *number,
        other => panic!("{name} is {other:?}"),
    }
}

/// Two references of other seeds and methods: their squared difference is the sum of the variances that they state,
/// leaving aside 256 pixels' worth of chance, some 15 % of relMSE (of six seeds by `path`: 0.8 to 1.2), and brightness
/// differs by no more than four standard errors.
#[test]
fn references_agree_within_the_errors_that_they_state() {
    let made = |options: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let (code, text) = reference(folder.path(), options);
        assert_eq!(code, Some(0), "{text}");
        let metadata = exr_file::read_file(&folder.path().join("r.exr")).unwrap().metadata;
        (Reference::read(&folder.path().join("r.exr")).unwrap(), metadata)
    };
    let (rough, metadata) = made(&["--target-relmse", "1e-2", "--mpp", "16"]);
    assert!(number(&metadata, "own_rel_mse") < 1e-2 && number(&metadata, "own_rel_mse_halves") < 1e-2);
    assert_eq!(number(&metadata, "mutations_per_pixel"), 16.0 * number(&metadata, "passes"));
    let (fine, _) = made(&["--target-relmse", "1e-3", "--mpp", "64", "--seed", "1"]);
    let (chains, _) = made(&["--target-relmse", "1e-2", "--mpp", "256", "--method", "re"]);
    for (name, other) in [("path", &rough), ("re", &chains)] {
        let errors = Errors::of(&other.image, &fine); // without the fine one's noise
        let ratio = errors.rel_mse / other.noise().unwrap().rel_mse;
        assert!((0.6..1.6).contains(&ratio), "{name}: the difference is {ratio} of what it should be");
        let uncertain = errors.mean_ratio_error.hypot(Errors::of(&fine.image, other).mean_ratio_error);
        let off = (errors.mean_ratio - 1.0) / uncertain;
        assert!(off.abs() < 4.0, "{name}: brightness {} is {off} standard errors off", errors.mean_ratio);
    }
}

#[test]
fn it_leaves_an_image_with_variance_a_text_and_a_state() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--target-relmse", "0.5", "--mpp", "4", "--threads", "1"];
    let (code, text) = reference(folder.path(), &options);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("8 passes, own relMSE") && text.contains("wrote r.exr, r.txt, r.state\n"), "{text}");
    let read = exr_file::read_file(&folder.path().join("r.exr")).unwrap();
    assert!(read.rgb("variance").unwrap().pixels.as_flattened().iter().any(|v| *v > 0.0));
    assert!(read.metadata.contains(&("method".into(), "path".into())), "{:?}", read.metadata);
    assert_eq!(number(&read.metadata, "passes"), 8.0);
    let words = std::fs::read_to_string(folder.path().join("r.txt")).unwrap();
    for part in [
        concat!("relt ", env!("CARGO_PKG_VERSION"), ", Embree 4."),
        "path, unidirectional mapping, 8 passes of 4 mutations per pixel, 32 mutations per pixel in all, seed 0\n",
        "16 × 16 pixels",
        "mean [0.",
        "estimated own RMSE ",
        "target 5e-1\n",
        " -D res=16 -o r.exr --target-relmse 0.5 --mpp 4 --threads 1\n",
    ] {
        assert!(words.contains(part), "{part:?} is not in:\n{words}");
    }
    let (code, text) = reference(folder.path(), &[&options[..], &["--quiet"]].concat());
    assert_eq!((code, text.as_str()), (Some(0), ""), "nothing is left to do, and nothing said");
}

/// Ended by the clock, by a signal and by force, each time in the middle of it: the same bits as without a pause.
#[test]
fn interruptions_change_no_bit() {
    const OPTIONS: [&str; 4] = ["--target-relmse", "1e-4", "--mpp", "128"];
    let whole = tempfile::tempdir().unwrap();
    let (code, text) = reference(whole.path(), &OPTIONS);
    assert_eq!(code, Some(0), "{text}");

    let folder = tempfile::tempdir().unwrap();
    let (code, text) = reference(folder.path(), &[&OPTIONS[..], &["--time", "1us"]].concat());
    assert_eq!(code, Some(3), "{text}");
    assert!(
        text.contains("--time was over before its first pass was over") && text.contains("smaller --mpp"),
        "{text}"
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written of nothing");

    // A dozen passes are left when the third is told, far more time than a signal takes.
    let killed = |signal: &str| {
        let mut child =
            command(folder.path(), &OPTIONS).args(["--threads", "1"]).stderr(Stdio::piped()).spawn().unwrap();
        let mut errors = BufReader::new(child.stderr.take().unwrap());
        let mut text = String::new();
        while text.lines().count() < 4 {
            assert_ne!(errors.read_line(&mut text).unwrap(), 0, "it ended too early:\n{text}");
        }
        let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        errors.read_to_string(&mut text).unwrap();
        (child.wait().unwrap().code(), text)
    };
    let (code, text) = killed("-INT");
    assert_eq!(code, Some(130), "{text}");
    assert!(text.contains("stopped: interrupted after ") && text.contains("the same command goes on"), "{text}");
    let stopped = Reference::read(&folder.path().join("r.exr")).unwrap();
    assert!(stopped.noise().unwrap().rel_mse > 1e-4, "what is there is written");
    let (code, _) = killed("-KILL");
    assert_eq!(code, None);
    let (code, text) = reference(folder.path(), &OPTIONS);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("going on after "), "{text}");
    for file in ["r.state", "r.txt"] {
        let [a, b] = [&whole, &folder].map(|folder| std::fs::read(folder.path().join(file)).unwrap());
        assert!(a == b, "{file} differs");
    }
    // attributes are in any order in the file
    let [a, b] = [&whole, &folder].map(|folder| exr_file::read_file(&folder.path().join("r.exr")).unwrap());
    assert!(a == b, "r.exr differs: {:?} and {:?}", a.metadata, b.metadata);

    // a lower target goes on from where it was
    let (code, text) = reference(folder.path(), &["--target-relmse", "8e-5", "--mpp", "128"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("going on after "), "{text}");
    assert!(Reference::read(&folder.path().join("r.exr")).unwrap().noise().unwrap().rel_mse < 8e-5);
}

#[test]
fn what_belongs_to_something_else_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--target-relmse", "1", "--mpp", "4"];
    assert_eq!(reference(folder.path(), &options).0, Some(0));
    let refused = |folder: &Path, options: &[&str], parts: &[&str]| {
        let (code, text) = reference(folder, options);
        assert_eq!(code, Some(2), "{options:?}:\n{text}");
        for part in parts {
            assert!(text.contains(part), "{options:?}: {part:?} is not in:\n{text}");
        }
    };
    let others = ["--target-relmse", "1", "--mpp", "8", "--seed", "5", "--method", "re", "--mapping", "two-way"];
    refused(
        folder.path(),
        &others,
        &[
            "r.state is of another reference",
            "--mapping unidirectional, not two-way",
            "--mpp 4, not 8",
            "--seed 0, not 5",
            "--method path, not re",
            "delete it",
        ],
    );
    refused(folder.path(), &[&options[..], &["-D", "max_depth=2"]].concat(), &["scene ", "max_depth=2"]);
    std::fs::write(folder.path().join("r.state"), "hello").unwrap();
    refused(folder.path(), &options, &["cannot read r.state", "delete it to begin anew"]);
    std::fs::remove_file(folder.path().join("r.state")).unwrap();
    refused(folder.path(), &options, &["r.exr is there, but r.state is not", "--output"]);

    let empty = tempfile::tempdir().unwrap();
    let nonsense = ["--target-relmse", "0", "--mpp", "-1", "--threads", "0", "--time", "0s"];
    refused(empty.path(), &nonsense, &["--target-relmse 0: ", "--mpp -1", "--threads 0", "--time 0s"]);
    let output = Command::new(env!("CARGO_BIN_EXE_relt"))
        .args(["reference", CORNELL_BOX, "--target-relmse", "1", "-o", "r.png"])
        .current_dir(empty.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("a reference is .exr"));
    assert_eq!(std::fs::read_dir(empty.path()).unwrap().count(), 0);
}

#[test]
fn a_reference_by_light_tracing_is_refused_where_it_would_lack_something() {
    let folder = tempfile::tempdir().unwrap();
    let caustic = CORNELL_BOX.replace("cornell-box", "caustic");
    let output = Command::new(env!("CARGO_BIN_EXE_relt"))
        .args(["reference", &caustic, "--target-relmse", "1", "--mapping", "light", "-o", "r.exr"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("--mapping light: a reference of this scene would lack whatever is seen in"), "{text}");
}

#[test]
fn help_says_what_methods_are_good_for() {
    let output = Command::new(env!("CARGO_BIN_EXE_relt")).args(["reference", "--help"]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    for part in ["variance.R", "O(1/N)", "a brightness of their own", ".state", "Exit codes:", "130"] {
        assert!(text.contains(part), "{part:?} is not in:\n{text}");
    }
}
