//! `relt compare`: numbers, limits, pictures of errors, and what it refuses.

use std::path::Path;
use std::process::Command;

use relt::film::{Image, Plane, exr_file};

/// Exit code, standard output, standard error.
fn compare(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output =
        Command::new(env!("CARGO_BIN_EXE_relt")).arg("compare").args(arguments).current_dir(folder).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

fn write(folder: &Path, name: &str, image: &Image, variance: Option<&Image>) {
    let layers: Vec<_> = variance.map(|v| ("variance".to_owned(), Plane::Rgb(v.clone()))).into_iter().collect();
    exr_file::write(&folder.join(name), image, &layers, &[]).unwrap();
}

/// 8 × 4 pixels of 0.5; in `bright.exr` one pixel is 0.9, in `dark.exr` all are 0.4. `noisy.exr` is the reference with
/// variance 0.0025.
fn images() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let reference = Image::constant(8, 4, [0.5; 3]);
    let mut bright = reference.clone();
    bright.pixels[8 + 3] = [0.9; 3];
    write(folder.path(), "reference.exr", &reference, None);
    write(folder.path(), "noisy.exr", &reference, Some(&Image::constant(8, 4, [0.0025; 3])));
    write(folder.path(), "bright.exr", &bright, None);
    write(folder.path(), "dark.exr", &Image::constant(8, 4, [0.4; 3]), None);
    folder
}

#[test]
fn a_table_has_a_line_for_each_image() {
    let folder = images();
    let (code, text, errors) = compare(folder.path(), &["bright.exr", "dark.exr", "--reference", "reference.exr"]);
    assert_eq!((code, errors.as_str()), (Some(0), ""));
    let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(lines[0], ["image", "RMSE", "relMSE", "SMAPE", "brightness", "HDR-FLIP"]);
    // one of 32 pixels: RMSE √(0.16/32), relMSE 0.16/0.26/32, SMAPE 0.8/1.4/32, brightness 16.4/16
    assert_eq!(lines[1][..5], ["bright.exr", "0.0707", "0.0192", "0.0179", "1.0250"]);
    // everywhere: 0.1, 0.01/0.26, 0.2/0.9, 0.8
    assert_eq!(lines[2][..5], ["dark.exr", "0.100", "0.0385", "0.222", "0.8000"]);
    assert!(text.ends_with("8 × 4: no layer variance; errors include the reference's own noise\n"), "{text}");
}

#[test]
fn the_references_own_noise_is_taken_away_and_shown() {
    let folder = images();
    let (code, text, _) = compare(folder.path(), &["dark.exr", "reference.exr", "--reference", "noisy.exr"]);
    assert_eq!(code, Some(0));
    // dark: MSE 0.01 − 0.0025, relMSE 0.0075/0.26; Σ r = 48 has the standard error √32 · 3 · 0.05
    for part in ["0.0866", "0.0288", "0.8000 ± 0.0141", "1.0000 ± 0.0177", "-0.00962"] {
        assert!(text.contains(part), "{part:?} is not in:\n{text}");
    }
    assert!(text.contains("its own noise is RMSE 0.0500, relMSE 0.00962"), "{text}");
    assert!(text.contains("below 0 (RMSE: 0)"), "{text}");
}

#[test]
fn json_has_the_same_and_more() {
    let folder = images();
    let arguments = ["dark.exr", "bright.exr", "--reference", "noisy.exr", "--json", "--max-relmse", "0.02"];
    let (code, text, errors) = compare(folder.path(), &arguments);
    assert_eq!((code, errors.as_str()), (Some(3), "error: dark.exr: relMSE 0.02885 is above --max-relmse 0.02\n"));
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let near = |value: &serde_json::Value, expected: f64| {
        let value = value.as_f64().unwrap();
        assert!((value - expected).abs() < 1e-6, "{value}, not {expected}");
    };
    let reference = &json["reference"];
    assert_eq!(reference["corrected"], true);
    near(&reference["rmse"], 0.05);
    near(&reference["rel_mse"], 0.0025 / 0.26);
    let dark = &json["images"][0];
    assert_eq!((dark["file"].as_str(), dark["exceeded"].as_array().unwrap().len()), (Some("dark.exr"), 1));
    near(&dark["mse"], 0.0075);
    near(&dark["rmse"], 0.0075f64.sqrt());
    near(&dark["rel_mse"], 0.0075 / 0.26);
    near(&dark["smape"], 0.2 / 0.9);
    near(&dark["mean_ratio"], 0.8);
    near(&dark["mean_ratio_error"], 0.8 * 32.0f64.sqrt() * 3.0 * 0.05 / 48.0);
    assert!((0.01..1.0).contains(&dark["flip"].as_f64().unwrap()), "{dark}");
    assert_eq!(json["images"][1]["exceeded"].as_array().unwrap().len(), 0);
}

#[test]
fn limits_end_with_code_3_and_say_which_was_exceeded() {
    let folder = images();
    let run = |options: &[&str]| {
        let arguments = [&["bright.exr", "dark.exr", "--reference", "reference.exr"], options].concat();
        let (code, text, errors) = compare(folder.path(), &arguments);
        assert_eq!(text.lines().count(), 4, "the table is printed all the same:\n{text}");
        (code, errors)
    };
    assert_eq!(run(&["--max-relmse", "0.04", "--max-brightness-error", "0.21"]), (Some(0), String::new()));
    let (code, errors) = run(&["--max-relmse", "0.03", "--max-brightness-error", "0.01"]);
    assert_eq!(code, Some(3));
    let expected = [
        "error: bright.exr: brightness error 0.02500 is above --max-brightness-error 0.01",
        "error: dark.exr: relMSE 0.03846 is above --max-relmse 0.03",
        "error: dark.exr: brightness error 0.2000 is above --max-brightness-error 0.01",
    ];
    assert_eq!(errors.lines().collect::<Vec<_>>(), expected);
    write(folder.path(), "black.exr", &Image::constant(8, 4, [0.0; 3]), None);
    let (code, text, errors) =
        compare(folder.path(), &["dark.exr", "--reference", "black.exr", "--max-brightness-error", "9"]);
    assert_eq!(
        code,
        Some(3),
        "brightness beside nothing is no number, and no number is within limits:\n{text}{errors}"
    );
}

#[test]
fn all_faults_of_all_files_are_told_with_their_places() {
    let folder = images();
    let mut broken = Image::constant(8, 4, [0.5; 3]);
    broken.pixels[8 + 2][1] = f32::NAN;
    broken.pixels[20][0] = f32::NEG_INFINITY;
    write(folder.path(), "broken.exr", &broken, None);
    write(folder.path(), "large.exr", &Image::constant(16, 8, [0.5; 3]), None);
    std::fs::write(folder.path().join("words.exr"), "hello").unwrap();
    let refused = |arguments: &[&str], parts: &[&str]| {
        let (code, text, errors) = compare(folder.path(), arguments);
        assert_eq!((code, text.as_str()), (Some(2), ""), "{arguments:?}: {errors}");
        assert_eq!(errors.lines().count(), parts.len(), "{errors}");
        for part in parts {
            assert!(errors.contains(part), "{arguments:?}: {part:?} is not in:\n{errors}");
        }
    };
    refused(
        &["broken.exr", "words.exr", "dark.exr", "large.exr", "nowhere.exr", "--reference", "reference.exr"],
        &[
            "broken.exr: pixel (2, 1), channel G: NaN is not finite (the first of 2 such values)",
            "cannot read words.exr",
            "large.exr: 16 × 8 pixels; accepted is the size of the reference reference.exr, 8 × 4",
            "cannot read nowhere.exr",
        ],
    );
    refused(&["dark.exr", "--reference", "large.exr"], &["dark.exr: 8 × 4 pixels; accepted is"]);
    refused(&["dark.exr", "--reference", "broken.exr"], &["broken.exr: pixel (2, 1), channel G"]);
    let negative = Image::constant(8, 4, [0.5, 0.5, -1.0]);
    write(folder.path(), "negative.exr", &negative, Some(&negative));
    refused(
        &["dark.exr", "--reference", "negative.exr"],
        &["pixel (0, 0), channel variance.B: -1 is not finite or below 0"],
    );
    let options = ["--max-relmse", "-1", "--max-brightness-error", "NaN", "--error-range", "0", "-o", "a.jpg"];
    refused(
        &[&["dark.exr", "--reference", "reference.exr"][..], &options].concat(),
        &[
            "--max-relmse -1: ",
            "--max-brightness-error NaN: ",
            "--error-range 0: ",
            "--error-image a.jpg: accepted are .png",
        ],
    );
    let (code, _, errors) = compare(folder.path(), &["--reference", "reference.exr"]);
    assert!(code == Some(2) && errors.contains("<IMAGE>"), "{errors}");
}

/// Rows of RGB bytes.
fn png(path: &Path) -> Vec<[u8; 3]> {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.width, info.height, info.color_type), (8, 4, png::ColorType::Rgb));
    bytes.as_chunks().0.to_vec()
}

#[test]
fn errors_are_drawn_in_colours() {
    let folder = images();
    let at = |name: &str| folder.path().join(name);
    let arguments = ["bright.exr", "--reference", "reference.exr", "-o", "e.png"];
    assert_eq!(compare(folder.path(), &arguments).0, Some(0));
    let error = png(&at("e.png"));
    for (i, [r, g, b]) in error.iter().enumerate() {
        match i {
            11 => assert!(*r > 150 && *g < 80 && *b < 80, "too bright is red: {r} {g} {b}"),
            _ => assert_eq!([r, g, b], [&255; 3], "no error is white"),
        }
    }
    let arguments = ["reference.exr", "--reference", "noisy.exr", "-o", "none.png"];
    assert_eq!(compare(folder.path(), &arguments).0, Some(0));
    assert!(png(&at("none.png")).iter().all(|pixel| *pixel == [255; 3]), "no error anywhere is white");
    assert!(png(&at("none-flip.png")).iter().all(|pixel| *pixel == [0; 3]), "and nothing to see is black");

    let arguments = ["dark.exr", "--reference", "reference.exr", "-o", "dark.png"];
    assert_eq!(compare(folder.path(), &arguments).0, Some(0));
    assert!(png(&at("dark-flip.png")).iter().all(|pixel| *pixel != [0; 3]), "a darker picture is seen everywhere");

    let arguments = ["dark.exr", "--reference", "reference.exr", "--error-image", "e.exr", "--error-range", "0.1"];
    assert_eq!(compare(folder.path(), &arguments).0, Some(0));
    let read = exr_file::read_file(&at("e.exr")).unwrap();
    let [r, _, b] = read.image.pixels[0];
    assert!(b > 4.0 * r, "too dark is blue: {:?}", read.image.pixels[0]);
    assert!((read.rgb("error").unwrap().pixels[5][1] + 0.1 / 0.26f32.sqrt()).abs() < 1e-6);
    assert!(read.gray("flip").unwrap().iter().all(|value| *value > 0.01));
}

#[test]
fn several_images_are_drawn_in_a_folder() {
    let folder = images();
    let at = |name: &str| folder.path().join(name);
    let both = ["bright.exr", "dark.exr", "--reference", "reference.exr", "-o"];
    let (code, _, errors) = compare(folder.path(), &[&both[..], &["e.png"]].concat());
    assert!(code == Some(2) && errors.contains("2 images need a folder"), "{errors}");
    let (code, _, errors) = compare(folder.path(), &[&both[..], &["nowhere"]].concat());
    assert!(code == Some(2) && errors.contains("folders that are there"), "{errors}");
    std::fs::create_dir(at("errors")).unwrap();
    assert_eq!(compare(folder.path(), &[&both[..], &["errors"]].concat()).0, Some(0));
    let mut names: Vec<_> = std::fs::read_dir(at("errors"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["bright-error-flip.png", "bright-error.png", "dark-error-flip.png", "dark-error.png"]);

    std::fs::copy(at("dark.exr"), at("errors/dark.exr")).unwrap();
    let twins = ["dark.exr", "errors/dark.exr", "--reference", "reference.exr", "-o", "errors"];
    let (code, _, errors) = compare(folder.path(), &twins);
    assert!(code == Some(2) && errors.contains("two images are called dark"), "{errors}");
    let (code, _, errors) = compare(folder.path(), &["dark.exr", "--reference", "reference.exr", "-o", "./dark.exr"]);
    assert!(code == Some(2) && errors.contains("would be overwritten"), "{errors}");
}

#[test]
fn help_says_what_is_measured_and_what_codes_mean() {
    let (code, text, _) = compare(Path::new("."), &["--help"]);
    assert_eq!(code, Some(0));
    for part in ["relMSE", "SMAPE", "HDR-FLIP", "variance.R", "--max-relmse", "Exit codes:", "  3  "] {
        assert!(text.contains(part), "{part:?} is not in:\n{text}");
    }
}
