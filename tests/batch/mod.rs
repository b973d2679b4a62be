//! `relt batch`: the same images as `relt render`, whatever happens on the way; and nobody writes another's files.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::program::{bits, done, ended, relt, render, said};

/// `[defaults]` on a scene at 24 × 24 pixels, as [`render`] has it, with more lines.
fn defaults(scene: &str, more: &str) -> String {
    let root = env!("CARGO_MANIFEST_DIR");
    format!("[defaults]\nscene = \"{root}/scenes/{scene}/scene.xml\"\ndefine = {{ res = 24 }}\n{more}\n")
}

fn batch(folder: &Path, options: &[&str]) -> Command {
    relt(folder, &[&["batch"], options].concat())
}

/// What happened, job by job.
fn events(folder: &Path) -> BTreeMap<String, Vec<String>> {
    let mut events = BTreeMap::<String, Vec<String>>::new();
    let text = fs::read_to_string(folder.join("jobs.toml.queue")).unwrap_or_default();
    for line in text.split_inclusive('\n').filter(|line| line.ends_with('\n')) {
        let line: Value = serde_json::from_str(line).unwrap();
        let [job, event] = ["job", "event"].map(|key| line[key].as_str().unwrap().to_owned());
        events.entry(job).or_default().push(event);
    }
    events
}

/// The summary's rows by image, as columns by name.
fn summary(folder: &Path, name: &str) -> BTreeMap<String, BTreeMap<String, String>> {
    let mut table = csv::Reader::from_path(folder.join(name)).unwrap();
    table
        .deserialize()
        .map(|row| row.unwrap())
        .map(|row: BTreeMap<String, String>| (row["output"].clone(), row))
        .collect()
}

/// Waits for something of a process that is still at work by then.
fn wait_until(child: &mut Child, what: impl Fn() -> bool) {
    let begin = Instant::now();
    while !what() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before");
        assert!(begin.elapsed() < Duration::from_secs(120), "nothing happens");
        sleep(Duration::from_millis(2));
    }
}

#[test]
fn jobs_come_to_the_bits_of_render() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let text = defaults("caustic", "mpp = 20")
        + "[[job]]\noutput = \"{method}/{seed:02}.exr\"\nmethod = [\"path\", \"re\"]\nseed = [3, 4]\nlayers = false\n\
           [[job]]\nscene = \"scenes/cornell-box/scene.xml\"\noutput = \"box-{frame}.exr\"\nframes = \"1..2\"\n\
           define.res = { from = 16, to = 24 }\nmapping = \"two-way\"\nlog = \"box-{frame}.jsonl\"\n";
    let text = text.replace("\"scenes", &format!("\"{}/scenes", env!("CARGO_MANIFEST_DIR")));
    fs::write(path.join("jobs.toml"), text).unwrap();
    let output = batch(path, &["jobs.toml", "--list"]).output().unwrap();
    let list = String::from_utf8(output.stdout).unwrap();
    assert!(list.ends_with("6 jobs on 3 scenes\n") && list.contains("waiting  path/03.exr"), "{list}");
    assert_eq!(fs::read_dir(path).unwrap().count(), 1, "listing writes nothing");

    let output = batch(path, &["jobs.toml"]).output().unwrap();
    let table = String::from_utf8(output.stdout.clone()).unwrap();
    said(output, 0);
    assert!(table.contains("6 jobs: 6 done"), "{table}");
    for (scene, options, image) in [
        ("caustic", &["--method", "path", "--seed", "3"][..], "path/03.exr"),
        ("caustic", &["--method", "path", "--seed", "4"], "path/04.exr"),
        ("caustic", &["--method", "re", "--seed", "4"], "re/04.exr"),
        ("cornell-box", &["--mapping", "two-way"], "box-2.exr"),
    ] {
        done(&mut render(path, scene, &[options, &["--mpp", "20", "-o", "alone.exr"]].concat()));
        assert!(bits(&path.join("alone.exr")) == bits(&path.join(image)), "{image}");
    }
    let rows = summary(path, "jobs.toml.summary.csv");
    assert_eq!(rows.len(), 6);
    let row = &rows["re/03.exr"];
    assert_eq!((row["status"].as_str(), row["attempts"].as_str(), row["job"].as_str()), ("done", "1", "3"));
    assert!(row["mutations"].parse::<u64>().unwrap() >= 20 * 24 * 24, "{row:?}");
    assert!(row["mean_luminance"].parse::<f64>().unwrap() > 0.0 && row["scene"].ends_with("scene.xml -D res=24"));
    assert!(fs::read_to_string(path.join("box-1.jsonl")).unwrap().contains("run_end"));
    assert!(!path.join(".box-1.exr.lock").exists(), "nothing is left");

    // several at once, from a table, come to the same
    let scene = format!("{}/scenes/caustic/scene.xml", env!("CARGO_MANIFEST_DIR"));
    let rows: String = (3..5).map(|seed| format!("{scene},csv-{{seed}}.exr,{seed},path,24,20\n")).collect();
    fs::write(path.join("jobs.csv"), format!("scene,output,seed,method,define.res,mpp\n{rows}")).unwrap();
    done(&mut batch(path, &["jobs.csv", "--at-once", "2", "--summary", "s.csv", "--quiet"]));
    for seed in [3, 4] {
        let [of_csv, of_toml] = [format!("csv-{seed}.exr"), format!("path/0{seed}.exr")];
        assert!(bits(&path.join(&of_csv)) == bits(&path.join(of_toml)), "{of_csv}");
        assert_eq!(summary(path, "s.csv")[&of_csv]["status"], "done");
    }
}

#[cfg(unix)]
#[test]
fn a_batch_that_is_killed_or_stopped_goes_on_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let text = |to: &str| {
        defaults("lattice", "mpp = 800\ncheckpoint = \"20ms\"")
            + &format!("[[job]]\noutput = \"{to}-{{seed}}.exr\"\nseed = [1, 2, 3]\n")
    };
    fs::write(path.join("jobs.toml"), text("a")).unwrap();
    let checkpoint = |seed| path.join(format!("a-{seed}.checkpoint"));
    let mut child = batch(path, &["jobs.toml"]).spawn().unwrap();
    wait_until(&mut child, || checkpoint(2).exists() && events(path)["a-1.exr"].len() == 2);
    child.kill().unwrap(); // SIGKILL: nothing can be tidied up
    child.wait().unwrap();
    let after = events(path);
    assert_eq!(after["a-1.exr"], ["begun", "done"]);
    assert_eq!(after["a-2.exr"], ["begun"]);
    assert!(!checkpoint(1).exists(), "of what is done nothing needs to be gone on with");
    let before = fs::metadata(path.join("a-1.exr")).unwrap().modified().unwrap();

    let mut child = batch(path, &["jobs.toml"]).spawn().unwrap();
    wait_until(&mut child, || checkpoint(3).exists());
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let text_of_stop = said(child.wait_with_output().unwrap(), 130);
    assert!(text_of_stop.contains("the same command goes on"), "{text_of_stop}");
    assert_eq!(events(path)["a-3.exr"].last().unwrap(), "interrupted");
    assert!(!path.join("a-3.exr").exists(), "half an image could be taken for a whole one");
    assert_eq!(summary(path, "jobs.toml.summary.csv")["a-3.exr"]["status"], "interrupted");

    done(&mut batch(path, &["jobs.toml"]));
    assert_eq!(fs::metadata(path.join("a-1.exr")).unwrap().modified().unwrap(), before, "what is done stays");
    let rows = summary(path, "jobs.toml.summary.csv");
    assert_eq!(["a-1.exr", "a-2.exr", "a-3.exr"].map(|name| rows[name]["attempts"].as_str()), ["1", "2", "2"]);
    for seed in ["1", "2", "3"] {
        done(&mut render(path, "lattice", &["--mpp", "800", "--seed", seed, "-o", "whole.exr"]));
        assert!(bits(&path.join("whole.exr")) == bits(&path.join(format!("a-{seed}.exr"))), "{seed}");
        assert!(!checkpoint(seed.parse::<i32>().unwrap()).exists());
    }
}

#[test]
fn a_job_that_fails_keeps_no_other_from_being_done() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let text = defaults("cornell-box", "mpp = 2\nmethod = \"path\"")
        + "[[job]]\noutput = \"a.exr\"\n[[job]]\noutput = \"b.exr\"\nscene = \"bad.xml\"\n\
           [[job]]\noutput = \"place/c.exr\"\n[[job]]\noutput = \"d.exr\"\n";
    fs::write(path.join("jobs.toml"), &text).unwrap();
    fs::write(path.join("bad.xml"), "<scene version='3.0.0'><shape type='sfere'/></scene>").unwrap();
    fs::write(path.join("place"), "a file, so that there can be no folder").unwrap();
    let told = ended(&mut batch(path, &["jobs.toml"]), 1);
    assert!(
        told.contains("b.exr: failed: bad.xml: ") && told.contains("bad.xml:1:37: unknown shape \"sfere\""),
        "{told}"
    );
    assert!(told.contains("place/c.exr: failed: cannot make place") && told.contains("2 of 4 jobs failed"), "{told}");
    assert!(path.join("a.exr").exists() && path.join("d.exr").exists() && !path.join("b.exr").exists());
    let rows = summary(path, "jobs.toml.summary.csv");
    assert_eq!((rows["b.exr"]["status"].as_str(), rows["d.exr"]["status"].as_str()), ("failed", "done"));
    assert!(rows["b.exr"]["message"].contains("sfere"));

    fs::remove_file(path.join("place")).unwrap();
    let told = ended(&mut batch(path, &["jobs.toml"]), 1);
    assert!(told.contains("2 of 4 jobs are finished already") && told.contains("2 of 4 jobs failed before"), "{told}");
    assert!(!path.join("place").exists(), "not without being asked");
    let told = ended(&mut batch(path, &["jobs.toml", "--retry-failed"]), 1);
    assert!(told.contains("1 of 4 jobs failed") && path.join("place/c.exr").exists(), "{told}");
    assert_eq!(events(path)["place/c.exr"], ["begun", "failed", "begun", "done"]);

    // another scene is another job, and so is another number of mutations; an image that is gone is made anew
    let scene = format!("{}/scenes/cornell-box/scene.xml", env!("CARGO_MANIFEST_DIR"));
    let meshes = format!("'{}/scenes/cornell-box/meshes/", env!("CARGO_MANIFEST_DIR"));
    fs::write(path.join("bad.xml"), fs::read_to_string(scene).unwrap().replace("'meshes/", &meshes)).unwrap();
    fs::write(path.join("jobs.toml"), text + "mpp = 3\n").unwrap();
    fs::remove_file(path.join("a.exr")).unwrap();
    let told = done(&mut batch(path, &["jobs.toml"]));
    for (name, why) in [("a", "its image is gone"), ("b", "changed"), ("d", "changed")] {
        assert!(told.contains(&format!("{name}.exr: {why}, so it is rendered anew")), "{told}");
    }
    assert!(told.contains("1 of 4 jobs are finished already"), "{told}");
}

#[test]
fn what_cannot_be_meant_is_refused_before_anything_is_begun() {
    let folder = tempfile::tempdir().unwrap();
    for (more, what) in [
        (
            "[[job]]\noutput = \"a.exr\"\nseed = [1, 2]\n",
            "jobs.toml:5:1: a.exr would write a.exr: a.exr (jobs.toml:5:1) does",
        ),
        (
            "[[job]]\noutput = \"a.exr\"\nmmp = 3\n",
            "jobs.toml:7:1: unknown key `mmp` (did you mean \"mpp\"?); known: betas",
        ),
        ("[[job]]\noutput = \"a.exr\"\nmpp = 0\n", "--mpp 0: the number of mutations per pixel must be above 0"),
    ] {
        fs::write(folder.path().join("jobs.toml"), defaults("cornell-box", "") + more).unwrap();
        let told = ended(&mut batch(folder.path(), &["jobs.toml"]), 2);
        assert!(told.contains(what), "{told}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is begun");
    }
    let jobs = "[[job]]\noutput = \"a.exr\"\ntime = \"1s\"\n";
    fs::write(folder.path().join("jobs.toml"), defaults("cornell-box", "") + jobs).unwrap();
    let told = ended(&mut batch(folder.path(), &["jobs.toml", "--at-once", "2"]), 2);
    assert!(told.contains("--at-once: a job has a budget in time"), "{told}");
}

#[test]
fn nobody_writes_the_files_of_a_run_that_is_at_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let jobs = |output: &str, mpp: u32| {
        defaults("cornell-box", "") + &format!("[[job]]\noutput = \"{output}\"\nmpp = {mpp}\nsnapshot = \"1ms\"\n")
    };
    fs::write(path.join("jobs.toml"), jobs("a.exr", 100_000)).unwrap();
    let mut child = batch(path, &["jobs.toml"]).spawn().unwrap();
    wait_until(&mut child, || path.join("a.png").exists());
    let told = ended(&mut batch(path, &["jobs.toml"]), 2);
    assert!(told.contains("jobs.toml.queue: another relt batch is at work on these jobs"), "{told}");
    // the same image, its preview alone, and by another way
    for output in ["a.exr", "a.png", path.join("a.exr").to_str().unwrap()] {
        let told = ended(&mut render(path, "cornell-box", &["--mpp", "1", "-o", output]), 2);
        assert!(told.contains(&format!("cannot write {output}: another relt is at work on it")), "{told}");
    }
    fs::write(path.join("other.toml"), jobs("a.png", 1) + "[[job]]\noutput = \"b.exr\"\nmpp = 1\n").unwrap();
    let told = ended(&mut batch(path, &["other.toml"]), 1);
    assert!(told.contains("a.png: failed: cannot write a.png: another relt is at work on it"), "{told}");
    assert!(path.join("b.exr").exists());
    child.kill().unwrap();
    child.wait().unwrap();
    // the dead hold nothing
    done(&mut batch(path, &["other.toml", "--retry-failed"]));
    done(&mut render(path, "cornell-box", &["--mpp", "1", "-o", "a.exr"]));
    assert!(!path.join(".a.exr.lock").exists() && !path.join(".a.png.lock").exists());
}
