//! What `relt info` says of the scenes that come with relt.

use std::path::Path;
use std::process::Command;

/// The report on a scene, lines folded into one.
fn report(scene: &str, options: &[&str]) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene).join("scene.xml");
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
fn glass_takes_the_plain_kernel_and_a_choice_of_lobe() {
    assert_says(
        "caustic",
        &[],
        &[
            "1 conductor: perfect reflection",
            "1 dielectric: perfect reflection and perfect refraction",
            "bounces 1 to 4: 5 (direction 2, place on light 2, lobe 1), drawn in two blocks of four",
            "left out: lens, choice of light",
            "kernel plain, for the scene has conductor materials, dielectric materials left out: textures",
        ],
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
    // 256² pixels of 64 bytes a layer: one layer, or three
    assert_says(
        "cornell-box",
        &[],
        &["256 × 256 pixels, box filter", "4.0 MiB for path and mlt, 12.0 MiB for re", "Embree 4.", "ROBUST"],
    );
}
