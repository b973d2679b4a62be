//! `relt ladder`: what it draws of a run's log, and what it says of logs that it cannot use.

use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

use relt::render::log::Log;
use relt::render::{Observer, RunStart, Status};
use relt::tempering::{LnEstimate, Normaliser, NormaliserEstimates, RoundReport, RungReport, ScaleReport};

fn relt(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_relt")).args(arguments).current_dir(folder).output().unwrap()
}

/// The exit code, standard output and standard error of `relt ladder` with these arguments.
fn ladder(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = relt(folder, &[&["ladder"], arguments].concat());
    let [text, errors] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(!errors.contains("panicked") && !text.contains('\x1b'), "{errors}");
    (output.status.code(), text, errors)
}

/// A round with made-up figures that go together about as real ones do: λ(β) = 3.2/(1 + 6 β), Λ(β) its integral,
/// rejections those of independent states, errors falling as 1/√sweeps.
fn report(round: u32, betas: &[f64]) -> RoundReport {
    let k = betas.len();
    let sweeps = 128u64 << round;
    let local = |beta: f64| 3.2 / (1.0 + 6.0 * beta);
    let cumulative = |beta: f64| 3.2 / 6.0 * (1.0 + 6.0 * beta).ln();
    let grid: Vec<f64> = (0..=40).map(|i| f64::from(i) / 40.0).map(|t| t * t).collect();
    let rejection: Vec<f64> = betas.windows(2).map(|b| 1.0 - (-(cumulative(b[1]) - cumulative(b[0]))).exp()).collect();
    let c = |scale: f64, bias: f64| LnEstimate {
        ln_value: (0.25 * (1.0 + bias * scale / f64::from(round + 1))).ln(),
        relative_error: scale / f64::from(1 << round).sqrt(),
    };
    let rung = |(i, beta): (usize, f64)| RungReport {
        beta,
        evaluations: if i == 0 { 3 * 64 * sweeps } else { 64 * sweeps },
        acceptance: if i == 0 { f64::NAN } else { 0.62 - 0.2 * beta },
        scales: [1.0, 0.25, 0.0625, 0.0156]
            .iter()
            .filter(|_| i > 0)
            .map(|size| ScaleReport {
                size: 0.2 * size * (1.0 - 0.5 * beta),
                weight: 0.25,
                acceptance: 0.9 - 0.15 * (0.1 + beta) * f64::ln(1.0 + 60.0 * size),
                proposed: 16 * sweeps,
            })
            .collect(),
        mean_ln_g: -4.0 + 2.5 * beta,
        sd_ln_g: 1.8 - 0.9 * beta,
        dark_share: if i == 0 { 0.93 } else { 0.0 },
        tau_image: Some(1.0 + 3.0 * beta),
        tau_lineage: Some(2.0),
        effective: 64.0 * sweeps as f64 / (1.0 + 3.0 * beta),
        image_share: [0.1, 0.2, 0.3, 0.4, 0.0, 0.0][i.min(5)],
    };
    let walk = |start: usize| {
        let (mut at, mut up) = (start, start.is_multiple_of(2));
        let mut step = |i: usize| {
            if !(i * 7 + start * 3).is_multiple_of(5) {
                up = if at + 1 == k { false } else { at == 0 || up };
                at = if up { at + 1 } else { at - 1 };
            }
            at as u16
        };
        (0..64).map(&mut step).collect::<Vec<_>>()
    };
    RoundReport {
        round,
        sweeps,
        mutations: 384 * sweeps,
        ladders: 64,
        replicas: k,
        betas: betas.to_vec(),
        ln_z: betas.iter().map(|beta| -1.4 * beta).collect(),
        lit_share: 0.07,
        barrier: cumulative(1.0),
        barrier_curve: grid.iter().map(|beta| [*beta, cumulative(*beta)]).collect(),
        local_barrier: grid.iter().map(|beta| [*beta, local(*beta)]).collect(),
        predicted_rejection: rejection.iter().map(|r| 0.92 * r).collect(),
        rejection,
        round_trips: 1234,
        restarts: 1500,
        round_trips_predicted: 1602.5,
        longest_rejection_run: 312,
        normalisers: NormaliserEstimates { uniform: c(0.2, 0.3), stepping_stones: c(0.09, -0.4), mbar: c(0.05, -0.2) },
        used: Normaliser::Mbar,
        uniform_share: 0.5,
        offers: 3,
        chain_ratio: 0.31,
        split_r_hat: 1.004,
        split_r_hat_image: 1.009,
        rays: 2600 * sweeps,
        rungs: betas.iter().copied().enumerate().map(rung).collect(),
        index_process: (0..k.min(3)).map(walk).collect(),
        index_stride: sweeps / 64,
        choices: vec![format!("The ladder keeps {k} replicas: Λ is 1.0 and a fifth would cost more than it brings.")],
        ..RoundReport::default()
    }
}

/// The log of a run of three rounds, the first a bootstrap without a ladder, as `run.jsonl` of a new folder.
fn three_rounds() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let log = Log::create(&folder.path().join("run.jsonl")).unwrap();
    log.started(&RunStart { scene: "scenes/door & sun/scene.xml".into(), ..RunStart::default() });
    let bootstrap = RoundReport {
        replicas: 3,
        ladders: 64,
        mutations: 49_152,
        lit_share: 0.07,
        normalisers: NormaliserEstimates {
            uniform: LnEstimate { ln_value: 0.2f64.ln(), relative_error: 0.3 },
            ..NormaliserEstimates::default()
        },
        barrier: f64::NAN,
        uniform_share: 1.0,
        ..RoundReport::default()
    };
    log.round(&bootstrap);
    log.progress(&Status { elapsed: Duration::from_secs(2), ..Status::default() });
    log.round(&report(1, &[0.0, 0.3, 1.0]));
    log.round(&report(2, &[0.0, 0.09, 0.35, 1.0]));
    assert_eq!(log.failure(), None);
    folder
}

const PANELS: [&str; 10] = [
    "Inverse temperatures",
    "Rejection of swaps",
    "Cumulative communication barrier",
    "Local communication barrier",
    "Rungs of replicas",
    "Normalisation by round, ± standard error",
    "Acceptance of mutations",
    "Sizes of small steps",
    "Luminance of lit states",
    "Where effort goes and the image comes from",
];

/// All texts of the SVG file.
fn texts(file: &Path) -> Vec<String> {
    let file = std::fs::read_to_string(file).unwrap();
    let document = roxmltree::Document::parse(&file).unwrap();
    assert_eq!(document.root_element().tag_name().name(), "svg");
    for number in document.descendants().flat_map(|node| node.attributes()).map(|attribute| attribute.value()) {
        assert!(!number.contains("NaN") && !number.contains("inf"), "{number}");
    }
    let texts = document.descendants().filter(|node| node.has_tag_name(("http://www.w3.org/2000/svg", "text")));
    texts.map(|node| node.text().unwrap_or("").to_owned()).collect()
}

#[test]
fn every_round_is_a_page_with_all_panels() {
    let folder = three_rounds();
    for (options, unmeasured) in [(&[][..], 0), (&["--round", "1"], 0), (&["--round", "0"], 9)] {
        let arguments = [&["run.jsonl", "-o", "ladder.svg"], options].concat();
        assert_eq!(ladder(folder.path(), &arguments), (Some(0), String::new(), String::new()));
        let texts = texts(&folder.path().join("ladder.svg"));
        for title in PANELS {
            assert!(texts.iter().any(|text| text == title), "{title} is not in {texts:?}");
        }
        assert_eq!(texts.iter().filter(|text| text.starts_with("not measured")).count(), unmeasured, "{options:?}");
        assert!(texts[0].starts_with("scenes/door & sun/scene.xml: round "), "{}", texts[0]);
    }
}

#[test]
fn a_long_ladder_keeps_its_ticks_apart() {
    let folder = tempfile::tempdir().unwrap();
    let log = Log::create(&folder.path().join("run.jsonl")).unwrap();
    let betas: Vec<f64> = (0..64).map(|k| (f64::from(k) / 63.0).powi(4)).collect();
    log.round(&report(1, &betas));
    assert_eq!(ladder(folder.path(), &["run.jsonl", "-o", "ladder.svg"]).0, Some(0));
    let texts = texts(&folder.path().join("ladder.svg"));
    assert!(texts.contains(&"60".into()) && !texts.contains(&"61".into()), "{texts:?}");
}

#[test]
fn the_terminal_has_it_all_in_80_columns() {
    let folder = three_rounds();
    let (code, text, errors) = ladder(folder.path(), &["run.jsonl"]);
    assert_eq!((code, errors.as_str()), (Some(0), ""), "{errors}");
    for line in text.lines() {
        assert!(line.chars().count() <= 80, "{} letters: {line}", line.chars().count());
    }
    for part in [
        "round 2 of 0 to 2",
        "4 replicas on 64 ladders",
        "\n1234 round trips (1602 predicted), 1500 restarts\n",
        "\nlongest run of rejected mutations 312, split R̂ 1.004 (1.009 of image blocks)\n",
        "c = 0.2492 ± 2.5 % by mbar",
        "\n   4     1.000    -1.400    0.42",
        "\n1 and 2 ",
        "\nΛ(β)  ▁",
        "\nreplica 3 ",
        "\n    0      49.2 k        0.2000 ± 30 %",
        "\nThe ladder keeps 4 replicas",
    ] {
        assert!(text.contains(part), "{part:?} is not in:\n{text}");
    }
    let (code, bootstrap, _) = ladder(folder.path(), &["run.jsonl", "--round", "0"]);
    assert_eq!(code, Some(0));
    assert!(bootstrap.contains("round 0 of 0 to 2") && !bootstrap.contains("NaN"), "{bootstrap}");
}

#[test]
fn the_log_of_a_killed_run_is_drawn_with_a_warning() {
    let folder = three_rounds();
    let path = folder.path().join("run.jsonl");
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() - 100]).unwrap();
    let (code, text, errors) = ladder(folder.path(), &["run.jsonl"]);
    assert_eq!((code, errors.as_str()), (Some(0), "warning: run.jsonl:5: the line is cut off and left out\n"));
    assert!(text.contains("round 1 of 0 to 1"), "{text}");
}

#[test]
fn what_cannot_be_drawn_is_refused_with_what_is_accepted() {
    let folder = three_rounds();
    let refused = |arguments: &[&str], part: &str| {
        let (code, text, errors) = ladder(folder.path(), arguments);
        assert_eq!((code, text.as_str()), (Some(2), ""), "{arguments:?}: {errors}");
        assert!(errors.contains(part), "{arguments:?}: {part:?} is not in:\n{errors}");
    };
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("path.jsonl", "{\"event\":\"run_start\",\"scene\":\"a.xml\",\"method\":\"path\"}\n");
    write("words.jsonl", "{\"event\":\"run_start\"}\nhello\n");
    write("other.jsonl", "{\"event\":\"round\",\"round\":\"one\"}\n");
    refused(&["nowhere.jsonl"], "cannot read nowhere.jsonl");
    refused(&["path.jsonl"], "path.jsonl has no rounds (it is of --method path); accepted are logs of `relt render");
    refused(&["words.jsonl"], "words.jsonl:2: expected value at column 1; a log has one JSON object a line");
    refused(&["other.jsonl"], "other.jsonl:1: invalid type: string \"one\", expected u32 at column 30");
    refused(&["run.jsonl", "--round", "7"], "--round 7: run.jsonl has rounds 0 to 2");
    refused(&["run.jsonl", "--round", "-1"], "--round");
    refused(&["run.jsonl", "-o", "ladder.png"], "cannot write ladder.png: a drawing is .svg");
    refused(&["run.jsonl", "-o", "nowhere/a.svg"], "there is no folder nowhere");
    std::fs::rename(folder.path().join("run.jsonl"), folder.path().join("run.svg")).unwrap();
    refused(&["run.svg", "-o", "run.svg"], "that is the log");
}

#[test]
fn help_says_what_a_log_is() {
    let (code, text, _) = ladder(Path::new("."), &["--help"]);
    assert_eq!(code, Some(0));
    for part in ["relt render --log", ".svg", "80 columns", "[default: the last one]"] {
        assert!(text.contains(part), "{part:?} is not in:\n{text}");
    }
}
