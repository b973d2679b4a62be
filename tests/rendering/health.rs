//! What is said of the health of whole runs: in the outcome, the picture, the log, and by the exit code.

use std::process::Command;

use relt::film::exr_file;
use relt::render::health::Health;
use relt::render::{Method, Verdict};

use crate::darkness::{hidden_lamp, lamp, room};
use crate::support::{own, render, scene_of, settings};

#[test]
fn healthy_runs_are_left_alone_by_all_methods() {
    for scene in [own("cornell-box", &[("res", "32")]), scene_of(&room(&lamp("2")))] {
        for method in Method::ALL {
            let outcome = render(&scene, &settings(method, 200.0, 2), &());
            assert_eq!(outcome.health, Health::default(), "{method:?}");
            assert!(outcome.picture.metadata.contains(&("health".into(), "good".into())));
        }
    }
}

#[test]
fn runs_that_nobody_can_trust_are_told_and_fail_where_asked_to() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, light: String| {
        let scene = format!("<scene version='3.0.0'>{}</scene>", room(&light));
        std::fs::write(folder.path().join(name), scene).unwrap();
    };
    write("dark.xml", hidden_lamp());
    write("lit.xml", lamp("2"));
    let run = |arguments: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_relt"))
            .args("render -o a.exr --log a.jsonl --threads 1".split(' ').chain(arguments.split(' ')))
            .current_dir(folder.path())
            .output()
            .unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let written = || {
        let read = exr_file::read_file(&folder.path().join("a.exr")).unwrap().metadata;
        let of = |name: &str| read.iter().find(|(n, _)| n == name).map(|(_, value)| format!("{value:?}"));
        let log = std::fs::read_to_string(folder.path().join("a.jsonl")).unwrap();
        let end: serde_json::Value = serde_json::from_str(log.lines().last().unwrap()).unwrap();
        (of("health").unwrap(), of("health.findings"), end["health"].clone())
    };
    for method in ["path", "mlt", "re"] {
        for (scene, budget, what) in
            [("dark.xml", "16", "no independent path met light"), ("lit.xml", "0.3", "mutations per pixel")]
        {
            let options = format!("{scene} --method {method} --mpp {budget}");
            let (code, said) = run(&options);
            assert_eq!(code, Some(0), "{options}: {said}");
            assert!(said.lines().any(|line| line.starts_with("bad: ") && line.contains(what)), "{options}: {said}");
            let (verdict, findings, log) = written();
            assert!(verdict.contains("bad") && findings.is_some_and(|f| f.contains(what)), "{options}: {verdict}");
            assert_eq!(log["verdict"], "bad", "{log}");
            assert!(log["findings"][0]["advice"].as_str().is_some_and(|advice| !advice.is_empty()), "{log}");
            std::fs::remove_file(folder.path().join("a.exr")).unwrap();
            let (code, said) = run(&format!("{options} --strict"));
            assert_eq!(code, Some(3), "{options}: {said}");
            assert!(said.contains("error: --strict: ") && said.contains(what), "{options}: {said}");
            assert_eq!(written().0, verdict, "the picture is written all the same");
        }
        let (code, said) = run(&format!("lit.xml --method {method} --mpp 300 --strict"));
        assert_eq!(code, Some(0), "{method}: {said}");
        assert!(!said.contains("bad:") && !said.contains("doubtful:"), "{method}: {said}");
        let (verdict, findings, log) = written();
        assert!(verdict.contains("good") && findings.is_none(), "{method}: {verdict}");
        assert_eq!(log["verdict"], Verdict::Good.name());
    }
}
