//! Parts of a job, run apart and merged, are the job in one process, bit by bit; what does not belong together is refused by
//! its name.

#[path = "support/program.rs"]
mod program;

use std::fs;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use program::{bits, done, ended, number, relt, render};
use relt::film::exr_file;

/// Runs a part of a job on `scene` into `whole.I-of-N.part`.
fn part(folder: &Path, scene: &str, options: &[&str], which: &str) {
    done(&mut render(folder, scene, &[options, &["--part", which, "-o", "whole.exr"]].concat()));
}

/// Merges those files into `merged.exr`; what it said.
fn merged(folder: &Path, parts: &[&str]) -> String {
    done(&mut relt(folder, &[&["merge"], parts, &["-o", "merged.exr"]].concat()))
}

#[test]
fn merged_parts_are_the_job_in_one_process() {
    for (scene, options) in [
        ("lattice", &["--method", "re", "--replicas", "3", "--layers"][..]),
        ("cornell-box", &["--method", "re", "--mapping", "two-way"]),
        ("caustic", &["--method", "mlt", "--kelemen-weights", "--normalisation", "pooled"]),
        ("lattice", &["--method", "path", "--mapping", "bidirectional"]),
        ("caustic", &["--method", "re", "--mapping", "multiplexed"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let options = [options, &["--seed", "7", "--mpp", "150"]].concat();
        for (i, threads) in ["1", "2", "1"].into_iter().enumerate() {
            let machine = [&options[..], &["--threads", threads]].concat();
            part(folder.path(), scene, &machine, &format!("{}/3", i + 1));
        }
        let files = fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(files, 3, "a part has no image");
        merged(folder.path(), &["whole.3-of-3.part", "whole.1-of-3.part", "whole.2-of-3.part"]);
        done(&mut render(folder.path(), scene, &[&options[..], &["--parts", "3", "-o", "whole.exr"]].concat()));
        let [one, many] = ["whole.exr", "merged.exr"].map(|name| folder.path().join(name));
        assert!(bits(&one) == bits(&many), "{scene} {options:?}");
        for name in ["mutations", "rays", "normalisation", "normalisation_error", "parts_normalisation", "parts_tiles"]
        {
            assert_eq!(number(&one, name).to_bits(), number(&many, name).to_bits(), "{scene} {options:?}: {name}");
        }
        // parts differ, and all of them together are what was asked for
        let parts = [1, 2, 3].map(|i| {
            merged(folder.path(), &[&format!("whole.{i}-of-3.part")]);
            (bits(&many), number(&many, "mutations"))
        });
        assert!(parts[0].0 != parts[1].0 && parts[1].0 != parts[2].0 && parts[0].0 != parts[2].0);
        let all = parts.iter().map(|(_, mutations)| mutations).sum::<f64>();
        assert_eq!(all, number(&one, "mutations"));
        assert!((150.0..200.0).contains(&(all / (24.0 * 24.0))), "{all}"); // sweeps are whole
    }
}

#[test]
fn a_part_may_be_killed_and_the_job_in_one_process_too() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--replicas", "2", "--mpp", "400", "--mapping", "unidirectional"];
    for which in ["--part=1/2", "--part=2/2", "--parts=2"] {
        let name = if which == "--parts=2" { "one.exr" } else { "whole.exr" };
        let options = [&options[..], &[which, "--checkpoint", "1ms", "--resume", "auto", "-o", name]].concat();
        let file = match which {
            "--part=1/2" => "whole.1-of-2.part",
            "--part=2/2" => "whole.2-of-2.part",
            _ => "one.checkpoint",
        };
        let mut child = render(folder.path(), "lattice", &options).spawn().unwrap();
        let begin = Instant::now();
        while !folder.path().join(file).exists() {
            assert!(begin.elapsed() < Duration::from_secs(60));
            sleep(Duration::from_millis(5));
        }
        sleep(Duration::from_millis(100));
        child.kill().unwrap();
        child.wait().unwrap();
        done(&mut render(folder.path(), "lattice", &options));
    }
    merged(folder.path(), &["whole.1-of-2.part", "whole.2-of-2.part"]);
    let [one, many] = ["one.exr", "merged.exr"].map(|name| folder.path().join(name));
    assert!(bits(&one) == bits(&many));
}

#[test]
fn parts_that_have_come_less_far_count_less() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--method", "mlt", "--mapping", "unidirectional"];
    part(folder.path(), "cornell-box", &[&options[..], &["--mpp", "300"]].concat(), "1/4");
    // the second is stopped on its way
    let endless = [&options[..], &["--mpp", "300", "--part", "2/4", "--checkpoint", "1ms", "-o", "whole.exr"]].concat();
    let mut child = render(folder.path(), "cornell-box", &endless).spawn().unwrap();
    while !folder.path().join("whole.2-of-4.part").exists() {
        sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let picture = |parts: &[&str]| {
        let text = merged(folder.path(), parts);
        let file = folder.path().join("merged.exr");
        (exr_file::read_file(&file).unwrap().image, number(&file, "mutations"), text)
    };
    let (a, n_a, _) = picture(&["whole.1-of-4.part"]);
    let (b, n_b, _) = picture(&["whole.2-of-4.part"]);
    let (all, n, text) = picture(&["whole.1-of-4.part", "whole.2-of-4.part"]);
    assert!(text.contains("warning: 2 of 4 parts are missing (3, 4)"), "{text}");
    assert!(text.contains("part 2 of 4: ") && text.contains("2 parts: brightness scatters by"), "{text}");
    assert_eq!(n, n_a + n_b);
    for (i, value) in all.pixels.as_flattened().iter().enumerate() {
        let [a, b] = [&a, &b].map(|image| f64::from(image.pixels.as_flattened()[i]));
        assert_eq!(*value, ((n_a * a + n_b * b) / n) as f32, "value {i}");
    }
}

#[test]
fn what_does_not_belong_together_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let options = ["--mpp", "10", "--mapping", "unidirectional", "--seed", "1"];
    part(here, "cornell-box", &options, "1/2");
    part(here, "cornell-box", &options, "2/2");
    fs::copy(here.join("whole.2-of-2.part"), here.join("copy.part")).unwrap();
    let refused = |parts: &[&str], expected: &[&str]| {
        let text = ended(&mut relt(here, &[&["merge"], parts, &["-o", "merged.exr"]].concat()), 2);
        for part in expected {
            assert!(text.contains(part), "{parts:?}: {part:?} is not in {text}");
        }
        assert!(!here.join("merged.exr").exists());
    };
    refused(
        &["whole.1-of-2.part", "whole.2-of-2.part", "copy.part"],
        &["it is part 2, as", "counts once", "copy.part"],
    );
    let another = |name: &str, scene: &str, change: &[&str], which: &str| {
        let mut options =
            vec!["--mpp", "10", "--mapping", "unidirectional", "--part", which, "--checkpoint-file", name];
        let seed: &[&str] = if change.contains(&"--seed") { &[] } else { &["--seed", "1"] };
        options.retain(|option| !(change.contains(&"--mpp") && ["--mpp", "10"].contains(option)));
        options.retain(|option| !(change.contains(&"--mapping") && ["--mapping", "unidirectional"].contains(option)));
        done(&mut render(here, scene, &[&options[..], seed, change].concat()));
    };
    for (name, scene, change, which, expected) in [
        ("seed.part", "cornell-box", &["--seed", "2"][..], "2/2", "--seed: it has 2, whole.1-of-2.part has 1"),
        ("k.part", "cornell-box", &["--replicas", "2"], "2/2", "--betas: it has 2, whole.1-of-2.part has auto"),
        ("of.part", "cornell-box", &[], "2/3", "number of parts: it has 3, whole.1-of-2.part has 2"),
        (
            "mpp.part",
            "cornell-box",
            &["--mpp", "20"],
            "2/2",
            "--mpp at the beginning: it has 20, whole.1-of-2.part has 10",
        ),
        ("light.part", "cornell-box", &["--mapping", "light"], "2/2", "--mapping: it has light"),
        ("scene.part", "lattice", &[], "2/2", "other contents than that of whole.1-of-2.part"),
    ] {
        another(name, scene, change, which);
        refused(&["whole.1-of-2.part", name], &[name, expected]);
    }
    fs::write(here.join("no.part"), "part").unwrap();
    refused(&["whole.1-of-2.part", "no.part"], &["no.part: it is no checkpoint"]);
    refused(&["whole.1-of-2.part", "absent.part"], &["absent.part"]);
}

#[test]
fn any_checkpoint_has_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--replicas", "2", "--mpp", "30", "--layers", "--checkpoint-file", "a.checkpoint", "-o", "a.exr"];
    done(&mut render(folder.path(), "caustic", &options));
    merged(folder.path(), &["a.checkpoint"]);
    assert!(bits(&folder.path().join("a.exr")) == bits(&folder.path().join("merged.exr")));
    // and the whole in one part is the whole
    done(&mut render(
        folder.path(),
        "caustic",
        &["--replicas", "2", "--mpp", "30", "--layers", "--part", "1/1", "-o", "b.exr"],
    ));
    merged(folder.path(), &["b.1-of-1.part"]);
    assert!(bits(&folder.path().join("a.exr")) == bits(&folder.path().join("merged.exr")));
}

#[test]
fn senseless_parts_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (options, part) in [
        (&["--part", "0/3"][..], "--part 0/3: parts are 1 to 3"),
        (&["--part", "4/3"], "--part 4/3: parts are 1 to 3"),
        (&["--part", "3"], "write it as 3/8"),
        (&["--parts", "0"], "--parts 0"),
        (&["--part", "1/2", "--parts", "2"], "give one of them"),
        (&["--part", "1/2", "--snapshot", "1s"], "--snapshot: a part has no image"),
        (&["--part", "slurm"], "SLURM_ARRAY_TASK_ID is not set"),
        (&["--part", "hq/3"], "HQ_TASK_ID is not set"),
        (&["--part", "auto/3"], "this is no task of an array"),
    ] {
        let mut command = render(folder.path(), "cornell-box", options);
        command.env_remove("SLURM_ARRAY_TASK_ID").env_remove("HQ_TASK_ID");
        let text = ended(&mut command, 2);
        assert!(text.contains(part), "{options:?}: {part:?} is not in {text}");
    }
    // ranks that know nothing of one another would write the same file
    let mut command = render(folder.path(), "cornell-box", &["-o", "whole.exr"]);
    let text = if cfg!(feature = "mpi") { String::new() } else { ended(command.env("OMPI_COMM_WORLD_SIZE", "4"), 2) };
    assert!(cfg!(feature = "mpi") || text.contains("one of 4 processes of MPI"), "{text}");
    // as a task of an array from 0 to 3
    let array = [("ID", "2"), ("COUNT", "4"), ("MIN", "0")];
    let options = ["--part", "slurm", "--mpp", "8", "--mapping", "unidirectional", "-o", "whole.exr"];
    let mut command = render(folder.path(), "cornell-box", &options);
    command.envs(array.map(|(name, value)| (format!("SLURM_ARRAY_TASK_{name}"), value)));
    let text = done(&mut command);
    assert!(text.contains("part 3 of 4 by SLURM_ARRAY_TASK_ID 2"), "{text}");
    assert!(text.contains("wrote whole.3-of-4.part"), "{text}");
    // as a task of HyperQueue that was given one core
    let options = ["--part", "auto/4", "--mpp", "8", "--mapping", "unidirectional", "-o", "whole.exr"];
    let mut command = render(folder.path(), "cornell-box", &options);
    command.env_remove("SLURM_ARRAY_TASK_ID").envs([("HQ_TASK_ID", "4"), ("HQ_CPUS", "1")]);
    let text = done(&mut command);
    assert!(text.contains("part 4 of 4 by HQ_TASK_ID 4"), "{text}");
    assert!(text.contains("wrote whole.4-of-4.part"), "{text}");
}

/// With the box filter and camera paths alone a pixel of a path tracer is the mean of its points, and `density` counts them:
/// parts that end amid a pass have pixels with one more point than others.
#[test]
fn points_of_path_tracers_are_pooled_pixel_by_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--method", "path", "--mapping", "unidirectional", "--mpp", "7", "--seed", "2"];
    for which in ["1/2", "2/2"] {
        part(folder.path(), "cornell-box", &options, which);
    }
    let [a, b, all] = [&["whole.1-of-2.part"][..], &["whole.2-of-2.part"], &["whole.1-of-2.part", "whole.2-of-2.part"]]
        .map(|parts| {
            merged(folder.path(), parts);
            exr_file::read_file(&folder.path().join("merged.exr")).unwrap()
        });
    let [n_a, n_b, n] = [&a, &b, &all].map(|file| file.gray("density").unwrap());
    assert!(n_a.contains(&3.0) && n_a.contains(&4.0), "whole passes only");
    for (i, pixel) in all.image.pixels.iter().enumerate() {
        assert_eq!(n[i], n_a[i] + n_b[i]);
        for (channel, value) in pixel.iter().enumerate() {
            let [a, b] = [&a, &b].map(|file| file.image.pixels[i][channel]);
            let expected = (n_a[i] * a + n_b[i] * b) / n[i];
            assert!((value - expected).abs() <= 1e-6 * expected, "{value} at {i}, not {expected}");
        }
    }
}
