//! What `relt info` says of the scenes that come with relt.

use std::path::Path;
use std::process::Command;

/// The report on a scene of `scenes`, or on a scene file of the repository, lines folded into one.
fn report(scene: &str, options: &[&str]) -> String {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = match scene.ends_with(".xml") {
        true => repository.join(scene),
        false => repository.join("scenes").join(scene).join("scene.xml"),
    };
    let output = Command::new(env!("CARGO_BIN_EXE_relt")).arg("info").arg(path).args(options).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn assert_says(scene: &str, options: &[&str], sentences: &[&str]) {
    let text = report(scene, options);
    for sentence in sentences {
        assert!(text.contains(sentence), "{scene} {options:?}: {sentence:?} is not in:\n{text}");
    }
}

#[test]
fn diffuse_scenes_with_one_light_spend_no_dimension_on_choices() {
    for (scene, triangles) in [("cornell-box", 36), ("lattice", 306)] {
        assert_says(
            scene,
            &[],
            &[
                &format!("triangles: {triangles}"),
                "film position: 2",
                "bounces 1 to 4: 4 (direction 2, place on light 2), drawn in one block of four",
                "bounces 5 to 15: 5 (direction 2, place on light 2, roulette 1), drawn in two blocks of four",
                "left out: lens, choice of lobe, choice of light",
                "left out: conductor, dielectric",
                "area: 1 left out: point or spot, directional, constant or envmap",
                "kernel diffuse",
            ],
        );
    }
}

#[test]
fn glass_takes_the_flat_kernel_and_a_choice_of_lobe() {
    assert_says(
        "caustic",
        &[],
        &[
            "1 conductor: perfect reflection",
            "1 dielectric: perfect reflection and perfect refraction",
            "bounces 1 to 4: 5 (direction 2, place on light 2, lobe 1), drawn in two blocks of four",
            "left out: lens, choice of light",
            "kernel flat, for the scene has conductor materials, dielectric materials left out: shading normals",
        ],
    );
}

#[test]
fn light_subpaths_have_dimensions_of_their_own() {
    assert_says(
        "cornell-box",
        &[],
        &[
            "start of a light subpath, for all mappings but unidirectional: 4 (place on light 2, direction 2), drawn in one \
             block of four its bounces 1 to 4: 2 (direction 2), drawn in one block of four its bounces 5 to 14: 3 \
             (direction 2, roulette 1), drawn in one block of four",
            "multiplexed: 6 (place on light 2, direction 2, length 1, technique 1), drawn in two blocks of four; no roulette",
        ],
    );
    assert_says("caustic", &[], &["its bounces 1 to 4: 3 (direction 2, lobe 1), drawn in one block of four"]);
}

#[test]
fn mappings_that_serve_are_told_from_those_that_do_not() {
    assert_says(
        "lattice",
        &[],
        &[
            "mappings unidirectional, light, two-way, bidirectional, multiplexed; auto tries unidirectional, light, two-way, \
             bidirectional or multiplexed techniques: camera subpaths that hit lights, next-event estimation, light subpaths connected to \
             the camera, light subpaths joined to camera subpaths dimensions",
        ],
    );
    assert_says(
        "water",
        &[],
        &[
            "mappings unidirectional, two-way, bidirectional, multiplexed; auto tries unidirectional, two-way, bidirectional \
             or multiplexed left out: light, which lacks whatever is seen in perfect mirrors, through smooth glass or through masks",
        ],
    );
    assert_says(
        "cornell-box",
        &["-D", "max_depth=2"],
        &["left out: light subpaths joined to camera subpaths, for paths are too short"],
    );
}

#[test]
fn limits_on_path_length_are_told() {
    assert_says("cornell-box", &["-D", "max_depth=1"], &["1 edge", "no Russian roulette", "left out: lens"]);
    assert_says("cornell-box", &["-D", "max_depth=3"], &["up to 3 edges, no Russian roulette", "bounces 1 to 2: 4"]);
    assert_says("cornell-box", &["-D", "max_depth=-1"], &["of any length", "bounces from 5 on: 5"]);
}

#[test]
fn the_film_and_embree_are_described() {
    // 256² pixels of 64 bytes a layer: one layer, or three; two and five where points splat elsewhere
    assert_says(
        "cornell-box",
        &[],
        &[
            "256 × 256 pixels, box filter",
            "4.0 MiB for path and mlt, 12.0 MiB for re",
            "light subpaths: 4.0 MiB for mlt, 8.0 MiB for path, 20.0 MiB for re",
            "Embree 4.",
            "ROBUST",
        ],
    );
}

#[test]
fn a_lens_takes_two_dimensions_and_no_block_of_its_own() {
    assert_says(
        "tests/mitsuba/thin-lens.xml",
        &[],
        &[
            "dimensions film position: 2, place on lens: 2 bounce 1: 4 (direction 2, place on light 2), drawn in one block",
            "left out: choice of lobe, choice of light",
        ],
    );
}

#[test]
fn parts_of_pictures_and_filters_are_described() {
    for (scene, sentence) in [
        (
            "tests/mitsuba/crop.xml",
            "24 × 16 pixels of 30 × 40, from column 5 and row 13 on, Gaussian filter of standard deviation 0.8",
        ),
        (
            "tests/mitsuba/mitchell.xml",
            "24 × 16 pixels, Mitchell filter with B = 0.2 and C = 0.6 (pixels may be negative)",
        ),
        ("tests/mitsuba/lanczos.xml", "Lanczos filter of 3 lobes (pixels may be negative)"),
    ] {
        assert_says(scene, &[], &[sentence]);
    }
}
