//! Runs that are interrupted, killed and gone on with come to the same picture, bit by bit, and what cannot be gone on
//! with is refused by its name.

#[path = "batch/mod.rs"]
mod batch;
#[path = "support/program.rs"]
mod program;

use std::fs;
use std::path::Path;
use std::process::{Child, Command};
use std::thread::sleep;
use std::time::{Duration, Instant};

use program::{bits, done, ended, number, relt, render, said};
use relt::checksum::Checksum;
use relt::render::{checkpoint, restored};
use relt::rng::Rng;

/// The first line of a checkpoint.
fn header(file: &Path) -> Option<serde_json::Value> {
    let bytes = fs::read(file).ok()?;
    let end = bytes.iter().position(|byte| *byte == b'\n')?;
    serde_json::from_slice(&bytes[..end]).ok()
}

/// Mutations that a checkpoint is of; 0 where there is none.
fn mutations(file: &Path) -> u64 {
    header(file).map_or(0, |header| header["done"]["mutations"].as_u64().unwrap())
}

/// Waits until the checkpoint is of so many mutations; whether the process still runs then.
fn wait_for(file: &Path, at_least: u64, child: &mut Child) -> bool {
    let begin = Instant::now();
    while mutations(file) < at_least {
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        assert!(begin.elapsed() < Duration::from_secs(120), "no checkpoint of {at_least} mutations in {file:?}");
        sleep(Duration::from_millis(5));
    }
    true
}

/// A run with a checkpoint that is killed at about each of those mutations, and then comes to its end. Returns how often it
/// was killed.
fn killed_and_finished(folder: &Path, scene: &str, options: &[&str], at: &[u64]) -> usize {
    let file = folder.join("pieces.checkpoint");
    let mut kills = 0;
    for (i, at) in at.iter().enumerate() {
        let threads = ["2", "1"][i % 2];
        let packet = ["8", "auto", "16", "1"][i % 4];
        let machine = ["--threads", threads, "--packet", packet, "--checkpoint", "1ms", "--resume", "auto"];
        let mut child = render(folder, scene, &[options, &machine, &["-o", "pieces.exr"]].concat()).spawn().unwrap();
        let alive = wait_for(&file, *at, &mut child);
        child.kill().unwrap(); // SIGKILL: nothing can be tidied up
        child.wait().unwrap();
        kills += usize::from(alive);
    }
    done(&mut render(folder, scene, &["--resume", "pieces.checkpoint", "-o", "pieces.exr"]));
    kills
}

#[test]
fn a_run_that_is_killed_again_and_again_comes_to_the_same_bits() {
    for (scene, options) in [
        ("lattice", &["--method", "re", "--mapping", "bidirectional", "--replicas", "4", "--layers"][..]),
        ("caustic", &["--method", "re", "--mapping", "multiplexed", "--replicas", "3"]),
        ("caustic", &["--method", "re"]),
        ("cornell-box", &["--method", "mlt", "--normalisation", "pooled", "--kelemen-weights", "--mapping", "two-way"]),
        ("caustic", &["--method", "mlt", "--mapping", "multiplexed", "--technique-changes", "on"]),
        ("lattice", &["--method", "path", "--mapping", "light"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let options = [options, &["--seed", "3", "--mpp", "300"]].concat();
        done(&mut render(folder.path(), scene, &[&options[..], &["-o", "whole.exr"]].concat()));
        let kills = killed_and_finished(folder.path(), scene, &options, &[1, 9_000, 40_000, 80_000]);
        assert!(kills >= 3, "killed {kills} times only");
        let [whole, pieces] = ["whole.exr", "pieces.exr"].map(|name| folder.path().join(name));
        assert!(bits(&whole) == bits(&pieces), "{scene} {options:?}");
        for name in ["mutations", "rays", "normalisation", "normalisation_error"] {
            assert_eq!(number(&whole, name), number(&pieces, name), "{scene} {options:?}: {name}");
        }
    }
}

/// A short run that leaves `a.checkpoint` after half of its work and, before it, `a.checkpoint.previous`.
fn half_done(folder: &Path, options: &[&str]) {
    let options = [options, &["--mpp", "40", "--checkpoint-file", "a.checkpoint", "-o", "a.exr"]].concat();
    done(&mut render(folder, "cornell-box", &options));
    done(&mut render(
        folder,
        "cornell-box",
        &["--resume", "a.checkpoint", "--mpp", "80", "--checkpoint", "1h", "-o", "a.exr"],
    ));
}

#[test]
fn a_larger_budget_goes_on_with_what_the_run_was_planned_as() {
    let folder = tempfile::tempdir().unwrap();
    half_done(folder.path(), &["--seed", "5"]);
    let file = folder.path().join("a.checkpoint");
    let header = header(&file).unwrap();
    assert_eq!(header["planned_mutations_per_pixel"].as_f64(), Some(40.0));
    assert_eq!(header["start"]["settings"]["mutations_per_pixel"].as_f64(), Some(80.0), "the budget is the new one");
    let pixels = 24.0 * 24.0;
    let done_by_now = number(&folder.path().join("a.exr"), "mutations");
    assert!((80.0..100.0).contains(&(done_by_now / pixels)), "{done_by_now}");
    // with a budget that is spent already nothing more is done
    done(&mut render(folder.path(), "cornell-box", &["--resume", "a.checkpoint", "--mpp", "1", "-o", "b.exr"]));
    assert!(bits(&folder.path().join("a.exr")) == bits(&folder.path().join("b.exr")));
}

#[test]
fn any_damage_is_found_and_the_checkpoint_before_it_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    half_done(folder.path(), &["--method", "path"]);
    let file = folder.path().join("a.checkpoint");
    let good = fs::read(&file).unwrap();
    checkpoint::open_one(&file).unwrap();
    let copy = folder.path().join("b.checkpoint");
    let refused = |bytes: &[u8], how: &str| {
        fs::write(&copy, bytes).unwrap();
        let error = checkpoint::open_one(&copy).err().unwrap_or_else(|| panic!("{how} is taken")).to_string();
        assert!(
            error.contains("b.checkpoint") && (error.contains("damaged") || error.contains("no checkpoint")),
            "{error}"
        );
    };
    let step = (good.len() / 300).max(1);
    for at in (0..good.len()).step_by(step).chain(good.len() - 8..good.len()) {
        let mut bytes = good.clone();
        bytes[at] ^= 1 << (at % 8);
        refused(&bytes, &format!("a bit changed in byte {at}"));
        refused(&good[..at], &format!("the first {at} bytes"));
    }

    // the program goes on from the one before, says so, and comes to the same bits
    let previous = folder.path().join("a.checkpoint.previous");
    assert!(mutations(&previous) < mutations(&file));
    fs::write(&file, &good[..good.len() / 2]).unwrap();
    let resume = ["--resume", "a.checkpoint", "--mpp", "80", "-o", "b.exr"];
    let text = done(&mut render(folder.path(), "cornell-box", &resume));
    assert!(text.contains("warning: cannot read a.checkpoint: it is damaged or cut off"), "{text}");
    assert!(text.contains("going on from the checkpoint before it, a.checkpoint.previous"), "{text}");
    assert!(bits(&folder.path().join("a.exr")) == bits(&folder.path().join("b.exr")));
    // also where the process died between the two renamings
    fs::remove_file(&file).unwrap();
    done(&mut render(folder.path(), "cornell-box", &resume));
    // with neither there is nothing to go on from
    fs::write(&previous, b"{}").unwrap();
    let text = ended(&mut render(folder.path(), "cornell-box", &resume), 2);
    assert!(text.contains("a.checkpoint") && text.contains("a.checkpoint.previous"), "{text}");
}

/// The same content with another first line, and a checksum that is right again.
fn sealed_with(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    let end = bytes.iter().position(|byte| *byte == b'\n').unwrap();
    let line = std::str::from_utf8(&bytes[..end]).unwrap();
    assert!(line.contains(from), "{from} is not in {line}");
    let mut changed = [line.replacen(from, to, 1).as_bytes(), &bytes[end..bytes.len() - 4]].concat();
    changed.extend(Checksum::of(&changed).to_le_bytes());
    changed
}

#[test]
fn another_version_is_named() {
    let folder = tempfile::tempdir().unwrap();
    half_done(folder.path(), &["--method", "path"]);
    let file = folder.path().join("a.checkpoint");
    let good = fs::read(&file).unwrap();
    let version = env!("CARGO_PKG_VERSION");
    let header = String::from_utf8_lossy(&good).into_owned();
    let (_, format) = header.split_once("\"relt_checkpoint\":").unwrap();
    let format: String = format.chars().take_while(char::is_ascii_digit).collect();
    assert!(format.parse::<u32>().unwrap() < 77, "{format}");
    for (from, to, part) in [
        (format!("\"relt\":\"{version}\""), "\"relt\":\"99.1.2\"", format!("relt 99.1.2 (format {format})")),
        (format!("\"relt_checkpoint\":{format}"), "\"relt_checkpoint\":77", "(format 77)".into()),
    ] {
        fs::write(&file, sealed_with(&good, &from, to)).unwrap();
        let text = ended(&mut render(folder.path(), "cornell-box", &["--resume", "a.checkpoint"]), 2);
        let this = format!("this is relt {version} (format {format})");
        assert!(text.contains(&part) && text.contains(&this), "{text}");
    }
}

#[test]
fn state_that_cannot_be_is_refused_without_much_ado() {
    let folder = tempfile::tempdir().unwrap();
    for options in [&["--method", "mlt"][..], &["--method", "re", "--replicas", "3"]] {
        let name = format!("{}.checkpoint", options[1]);
        done(&mut render(
            folder.path(),
            "cornell-box",
            &[options, &["--mpp", "20", "--checkpoint-file", &name]].concat(),
        ));
        let mut resumed = checkpoint::open_one(&folder.path().join(name)).unwrap();
        let (header, mut body) = (resumed.header.clone(), Vec::new());
        {
            let mut source = resumed.body();
            body.resize(source.left() as usize, 0);
            source.fill(&mut body).unwrap();
        }
        let planned = Some((20.0 * 24.0 * 24.0) as u64);
        let take = |bytes: &[u8]| {
            let mut source = relt::saved::Source::new(bytes, bytes.len() as u64);
            restored(&header.sheet, Rng::new(0), &header.start.settings, planned, &mut source).map(drop)
        };
        take(&body).unwrap();
        // every length is too short, and what is changed at random is either refused or is state that could be
        for length in (0..body.len()).step_by((body.len() / 200).max(1)) {
            assert!(take(&body[..length]).is_err(), "{length} of {} bytes", body.len());
        }
        let mut refused = 0;
        for i in 0..400usize {
            let mut bytes = body.clone();
            // mostly in the statistics at the beginning, which are not as uniform as the film
            let at = if i % 2 == 0 { i * 2_654_435_761 % 4096 } else { i * 2_654_435_761 % body.len() };
            bytes[at] = bytes[at].wrapping_add(1 + (i % 255) as u8);
            refused += usize::from(take(&bytes).is_err());
        }
        assert!(refused > 40, "{refused} of 400 were refused");
    }
}

#[test]
fn another_scene_or_setting_is_named_with_what_the_checkpoint_has() {
    let folder = tempfile::tempdir().unwrap();
    half_done(folder.path(), &["--seed", "3", "--replicas", "3"]);
    let go_on = |scene: &str, options: &[&str]| {
        render(folder.path(), scene, &[&["--resume", "a.checkpoint"], options].concat())
    };
    for (options, parts) in [
        (&["--seed", "4"][..], &["--seed: the checkpoint has 3, asked for is 4"][..]),
        (&["--method", "mlt"], &["--method: the checkpoint has re, asked for is mlt"]),
        (
            &["--replicas", "5", "--error", "absolute"],
            &["the checkpoint has 3, asked for is 5", "has relative, asked for is absolute"],
        ),
        (&["--betas", "0,0.5,1"], &["the checkpoint has 3, asked for is 0,0.5,1"]),
        (&["--mapping", "light"], &["--mapping: the checkpoint has auto, asked for is light"]),
        (&["--combine", "target"], &["--combine: the checkpoint has balance, asked for is target"]),
        (&["--uniform-share", "0.5"], &["--uniform-share: the checkpoint has tuned, asked for is 0.5"]),
        (&["--layers"], &["--layers: the checkpoint has off, asked for is on"]),
    ] {
        let text = ended(&mut go_on("cornell-box", options), 2);
        for part in parts.iter().chain(&["a.checkpoint is of another run"]) {
            assert!(text.contains(part), "{options:?}: {part:?} is not in {text}");
        }
    }
    let text = ended(&mut go_on("lattice", &[]), 2);
    assert!(text.contains("the scene has other contents") && text.contains("cornell-box"), "{text}");
    // given again and the same, and whatever does not change the picture
    let same =
        ["--seed", "3", "--replicas", "3", "--method", "re", "--threads", "1", "--packet", "4", "-o", "other.exr"];
    done(&mut go_on("cornell-box", &same));
    assert!(bits(&folder.path().join("a.exr")) == bits(&folder.path().join("other.exr")));
    // a run that begins anew does not overwrite what another one left
    let text = ended(&mut render(folder.path(), "cornell-box", &["--checkpoint", "1m", "-o", "a.exr"]), 2);
    assert!(text.contains("there is a checkpoint already") && text.contains("--resume a.checkpoint"), "{text}");
}

#[test]
fn a_scene_is_known_by_its_contents_and_not_by_its_path() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, radiance: &str, texel: u8| {
        let place = folder.path().join(name);
        fs::create_dir(&place).unwrap();
        // a texture of one pixel, as plain PNG
        let mut png = Vec::new();
        let mut encoder = png::Encoder::new(&mut png, 1, 1);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header().unwrap().write_image_data(&[texel, 90, 90]).unwrap();
        fs::write(place.join("texture.png"), png).unwrap();
        fs::write(
            place.join("scene.xml"),
            format!(
                r#"<scene version="3.0.0"><integrator type="path"/>
                <sensor type="perspective"><transform name="to_world"><lookat origin="0,0,3" target="0,0,0" up="0,1,0"/>
                </transform><film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
                <shape type="rectangle"><bsdf type="diffuse"><texture type="bitmap" name="reflectance">
                <string name="filename" value="texture.png"/></texture></bsdf></shape>
                <emitter type="constant"><rgb name="radiance" value="{radiance}"/></emitter></scene>"#
            ),
        )
        .unwrap();
    };
    write("a", "1,1,1", 50);
    write("moved", "1,1,1", 50);
    write("brighter", "1,1,2", 50);
    write("repainted", "1,1,1", 51);
    let go_on = |name: &str| relt(folder.path(), &["render", &format!("{name}/scene.xml"), "--resume", "a.checkpoint"]);
    done(&mut relt(folder.path(), &["render", "a/scene.xml", "--mpp", "8", "-o", "a.exr", "--checkpoint", "1m"]));
    done(&mut go_on("moved"));
    for name in ["brighter", "repainted"] {
        let text = ended(&mut go_on(name), 2);
        assert!(text.contains("the scene has other contents than a/scene.xml had"), "{name}: {text}");
    }
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("sh").args(["-c", &format!("kill -{name} {}", child.id())]).status().unwrap();
    assert!(sent.success());
}

#[test]
fn signals_ask_for_checkpoints() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--mpp", "100000", "--checkpoint-file", "a.checkpoint", "-o", "a.exr", "--log", "a.jsonl"];
    let mut child = render(folder.path(), "cornell-box", &options).spawn().unwrap();
    let file = folder.path().join("a.checkpoint");
    let log = folder.path().join("a.jsonl");
    let begin = Instant::now();
    while fs::read(&log).unwrap_or_default().is_empty() {
        assert!(begin.elapsed() < Duration::from_secs(60));
        sleep(Duration::from_millis(5));
    }
    assert!(!file.exists(), "none without being asked");
    signal(&child, "USR1");
    assert!(wait_for(&file, 1, &mut child), "it goes on after SIGUSR1");
    let first = mutations(&file);
    signal(&child, "TERM");
    let text = said(child.wait_with_output().unwrap(), 0);
    assert!(text.contains("wrote a.checkpoint\n"), "{text}");
    assert!(text.contains("interrupted") && text.contains("wrote a.exr, a.png and a.checkpoint"), "{text}");
    let last = mutations(&file);
    assert!(last >= first && last as f64 == number(&folder.path().join("a.exr"), "mutations"));

    // the log goes on as well: one beginning, one end, and no moment twice
    let options =
        ["--resume", "auto", "--checkpoint-file", "a.checkpoint", "--mpp", "1", "-o", "a.exr", "--log", "a.jsonl"];
    done(&mut render(folder.path(), "cornell-box", &options));
    let text = fs::read_to_string(&log).unwrap();
    let lines: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let events: Vec<&str> = lines.iter().map(|line| line["event"].as_str().unwrap()).collect();
    assert_eq!(events.first(), Some(&"run_start"), "{events:?}");
    assert_eq!(events.last(), Some(&"run_end"), "{events:?}");
    for name in ["run_start", "run_resume", "run_end"] {
        assert_eq!(events.iter().filter(|event| **event == name).count(), 1, "{name} in {events:?}");
    }
}

#[test]
fn a_log_forgets_what_comes_again() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--mpp", "400", "--replicas", "2", "--log", "whole.jsonl", "-o", "whole.exr"];
    done(&mut render(folder.path(), "lattice", &options));
    let options = ["--mpp", "400", "--replicas", "2", "--log", "pieces.jsonl"];
    killed_and_finished(folder.path(), "lattice", &options, &[1, 60_000]);
    // the last process kept neither log nor checkpoint, so that another one goes on from the same moment
    let options =
        ["--resume", "auto", "--checkpoint-file", "pieces.checkpoint", "--log", "pieces.jsonl", "-o", "pieces.exr"];
    done(&mut render(folder.path(), "lattice", &options));
    let rounds = |name: &str| -> Vec<serde_json::Value> {
        let text = fs::read_to_string(folder.path().join(name)).unwrap();
        let lines = text.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
        let rounds = lines.filter(|line| line["event"] == "round").map(|mut line| {
            line.as_object_mut().unwrap().remove("seconds");
            line
        });
        rounds.collect()
    };
    let (whole, pieces) = (rounds("whole.jsonl"), rounds("pieces.jsonl"));
    assert!(whole.len() >= 3, "{} rounds", whole.len());
    assert_eq!(whole, pieces);
}

#[test]
fn a_checkpoint_that_cannot_be_written_is_told_and_tried_again() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("disk");
    fs::create_dir(&place).unwrap();
    let options = ["--mpp", "100000", "--checkpoint", "50ms", "--checkpoint-file", "disk/a.checkpoint", "-o", "a.exr"];
    let mut child = render(folder.path(), "cornell-box", &options).spawn().unwrap();
    let file = place.join("a.checkpoint");
    assert!(wait_for(&file, 1, &mut child));
    let away = folder.path().join("away");
    fs::rename(&place, &away).unwrap();
    let before = mutations(&away.join("a.checkpoint"));
    sleep(Duration::from_millis(1500));
    assert_eq!(mutations(&away.join("a.checkpoint")), before, "what was there is kept");
    fs::rename(&away, &place).unwrap();
    assert!(wait_for(&file, before + 1, &mut child), "it goes on and tries again");
    signal(&child, "INT");
    let text = said(child.wait_with_output().unwrap(), 0);
    assert!(text.contains("warning: no checkpoint: cannot write disk/a.checkpoint: there is no folder disk"), "{text}");
}
