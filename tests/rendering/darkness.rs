//! No light, hardly any, and too much for the numbers.

use std::process::Command;

use relt::film::Plane;
use relt::render::{Combine, LadderChoice, Method, Outcome, Settings};

use crate::support::{render, scene_of, settings};

/// 16 × 16 pixels of a closed room with a box in it.
pub fn room(more: &str) -> String {
    format!(
        "<integrator type='path'><integer name='max_depth' value='6'/></integrator>
         <sensor type='perspective'><float name='fov' value='60'/>
           <transform name='to_world'><lookat origin='0, 0, 1.8' target='0, 0, 0' up='0, 1, 0'/></transform>
           <film type='hdrfilm'><integer name='width' value='16'/><integer name='height' value='16'/>
             <rfilter type='box'/></film></sensor>
         <shape type='cube'><transform name='to_world'><scale value='2'/></transform>
           <boolean name='flip_normals' value='true'/></shape>
         <shape type='cube'><transform name='to_world'><scale value='0.3'/><translate x='-0.5'/></transform></shape>{more}"
    )
}

/// A lamp at the ceiling.
pub fn lamp(radiance: &str) -> String {
    format!(
        "<shape type='rectangle'>
           <transform name='to_world'><rotate x='1' angle='90'/><scale value='0.5'/><translate y='1.9'/></transform>
           <emitter type='area'><rgb name='radiance' value='{radiance}'/></emitter></shape>"
    )
}

/// A lamp in a box of its own that is closed on all sides.
pub fn hidden_lamp() -> String {
    "<shape type='cube'><transform name='to_world'><scale value='0.2'/><translate x='0.8'/></transform>
       <bsdf type='twosided'><bsdf type='diffuse'/></bsdf></shape>
     <shape type='sphere'><point name='center' value='0.8, 0, 0'/><float name='radius' value='0.1'/>
       <emitter type='area'><rgb name='radiance' value='100'/></emitter></shape>"
        .into()
}

/// A lamp above a lid with a hole of 4 mm in a room 4 m wide.
fn pinhole_lamp() -> String {
    let slab = |low: [f32; 2], high: [f32; 2]| {
        let middle = |i: usize| 0.5 * (low[i] + high[i]);
        let half = |i: usize| 0.5 * (high[i] - low[i]);
        format!(
            "<shape type='rectangle'><transform name='to_world'>
               <rotate x='1' angle='90'/><scale x='{}' z='{}'/><translate x='{}' y='1.5' z='{}'/></transform>
               <bsdf type='twosided'><bsdf type='diffuse'/></bsdf></shape>",
            half(0),
            half(1),
            middle(0),
            middle(1)
        )
    };
    let (edge, hole) = (2.0, 0.002);
    lamp("1000")
        + &slab([-edge, -edge], [-hole, edge])
        + &slab([hole, -edge], [edge, edge])
        + &slab([-hole, -edge], [hole, -hole])
        + &slab([-hole, hole], [hole, edge])
}

/// All methods, ladders of two, four and six rungs, all combinations, on a short run.
fn methods(mutations_per_pixel: f64) -> Vec<Settings> {
    let mut all: Vec<_> = [Method::Path, Method::Mlt].map(|m| settings(m, mutations_per_pixel, 5)).into();
    for k in [2, 4, 6] {
        for combine in Combine::ALL {
            let ladder = LadderChoice::Replicas(k);
            let re = settings(Method::ReplicaExchange, mutations_per_pixel, 5);
            all.push(Settings { ladder, combine, ..re });
        }
    }
    all
}

/// Every number of a picture, its layers and what is said of it is finite; pixels are not negative.
pub fn assert_finite(outcome: &Outcome, what: &str) {
    let fine = |v: &f32| v.is_finite() && *v >= 0.0;
    assert!(outcome.picture.image.pixels.as_flattened().iter().all(fine), "{what}: the image");
    for (name, plane) in &outcome.picture.layers {
        let values = match plane {
            Plane::Rgb(image) => image.pixels.as_flattened(),
            Plane::Gray(values) => values,
        };
        assert!(values.iter().all(fine), "{what}: layer {name}");
    }
    let (value, error) = outcome.status.normalisation.expect("a normalisation");
    let rates = outcome.status.acceptance.iter().chain(&outcome.status.swap);
    assert!(value.is_finite() && error.is_finite(), "{what}: c = {value} ± {error}");
    assert!(rates.clone().all(|r| (0.0..=1.0).contains(r)), "{what}: rates {:?}", rates.collect::<Vec<_>>());
}

#[test]
fn a_black_scene_gives_a_black_image_and_says_so() {
    for (what, light) in [("a light of radiance 0", lamp("0")), ("a light behind walls", hidden_lamp())] {
        let scene = scene_of(&room(&light));
        for settings in methods(30.0) {
            let outcome = render(&scene, &settings, &());
            let what = format!("{what}: {settings:?}");
            assert_finite(&outcome, &what);
            assert!(outcome.picture.image.pixels.as_flattened().iter().all(|v| *v == 0.0), "{what}");
            assert!(
                outcome.warnings.iter().any(|w| w.contains("the image is black")),
                "{what}: {:?}",
                outcome.warnings
            );
            assert_eq!((outcome.status.non_finite, outcome.interrupted), (0, false), "{what}");
            assert_eq!(outcome.status.normalisation.map(|n| n.0), Some(0.0), "{what}");
        }
    }
}

#[test]
fn a_black_scene_is_a_success_on_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let scene = format!("<scene version='3.0.0'>{}</scene>", room(&hidden_lamp()));
    std::fs::write(folder.path().join("black.xml"), scene).unwrap();
    for method in ["path", "mlt", "re"] {
        for budget in [["--mpp", "16"], ["--time", "300ms"]] {
            let output = Command::new(env!("CARGO_BIN_EXE_relt"))
                .args(["render", "black.xml", "--method", method, "--threads", "1", "-o", "a.exr"])
                .args(budget)
                .current_dir(folder.path())
                .output()
                .unwrap();
            let text = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(0), "{method}, {budget:?}:\n{text}");
            assert!(text.contains("the image is black"), "{method}, {budget:?}:\n{text}");
            assert!(!text.to_lowercase().contains("nan"), "{method}, {budget:?}:\n{text}");
        }
    }
}

/// From runs that meet no light at all to runs that meet it some hundred times.
#[test]
fn runs_that_meet_hardly_any_light_finish_with_numbers() {
    let scene = scene_of(&room(&pinhole_lamp()));
    let (mut lit, mut all) = (0, 0);
    for mutations_per_pixel in [4.0, 40.0, 400.0] {
        for settings in methods(mutations_per_pixel) {
            for seed in 0..4 {
                let settings = Settings { seed, ..settings.clone() };
                let outcome = render(&scene, &settings, &());
                assert_finite(&outcome, &format!("{settings:?}"));
                all += 1;
                lit += usize::from(outcome.picture.image.pixels.as_flattened().iter().any(|v| *v > 0.0));
            }
        }
    }
    assert!((all / 5..all * 4 / 5).contains(&lit), "{lit} of {all} runs met light: too many or too few to be hard");
}

/// What exceeds 32-bit floats is counted, said, and never reaches the film.
#[test]
fn overflowing_contributions_are_counted_and_left_out() {
    for radiance in ["3e38", "3e38, 1e-30, 0", "1e30, 3e38, 1"] {
        let scene = scene_of(&room(&(lamp(radiance) + &lamp("1e-3"))));
        let mut counted = 0;
        for settings in methods(30.0) {
            let outcome = render(&scene, &settings, &());
            assert_finite(&outcome, &format!("radiance {radiance}, {settings:?}"));
            let said = outcome.warnings.iter().any(|w| w.contains("not finite"));
            assert_eq!(said, outcome.status.non_finite > 0, "{:?}", outcome.warnings);
            counted += outcome.status.non_finite;
        }
        assert!(counted > 0, "radiance {radiance} overflows nowhere");
    }
}

/// The other end: light near or below the smallest normal number.
#[test]
fn light_that_underflows_is_dim_or_dark_and_no_fault() {
    for radiance in ["1e-30", "1e-37", "1e-44"] {
        let scene = scene_of(&room(&lamp(radiance)));
        for settings in methods(30.0) {
            let outcome = render(&scene, &settings, &());
            assert_finite(&outcome, &format!("radiance {radiance}, {settings:?}"));
            assert_eq!(outcome.status.non_finite, 0, "radiance {radiance}, {settings:?}");
        }
    }
}
