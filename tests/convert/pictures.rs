//! Converted scenes look like the same scenes written by hand.

use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use relt::embree::Device;
use relt::film::Image;
use relt::render::{Job, Method, Settings, run};
use relt::scene::Scene;

use crate::support::Folder;

/// Directions into the upper half, one in each quadrant.
const QUADRANTS: [[f32; 3]; 4] = [[0.6, 0.5, 0.6], [-0.6, 0.5, 0.6], [-0.6, -0.5, 0.6], [0.6, -0.5, 0.6]];

/// Samples a pixel. All pictures have the same seed.
const SAMPLES: f64 = 256.0;

fn picture(path: &std::path::Path, samples: f64) -> Image {
    static DEVICE: OnceLock<Device> = OnceLock::new();
    let device = DEVICE.get_or_init(|| Device::new("").unwrap_or_else(|error| panic!("{error}")));
    let description = relt::load::scene(path, &[]).unwrap_or_else(|error| panic!("{error}"));
    let scene = Scene::new(device, description).unwrap_or_else(|error| panic!("{error}"));
    let settings =
        Settings { method: Method::Path, threads: Some(1), mutations_per_pixel: Some(samples), ..Settings::default() };
    let stop = AtomicBool::new(false);
    run(&Job { scene: &scene, scene_name: "test".into(), settings, stop: &stop }, &()).unwrap().picture.image
}

/// mean((x − r)²/(r² + 0.01))
fn relative_error(image: &Image, reference: &Image) -> f64 {
    let pairs = image.pixels.as_flattened().iter().zip(reference.pixels.as_flattened());
    let errors = pairs.map(|(x, r)| f64::from((x - r) * (x - r) / (r * r + 0.01)));
    errors.sum::<f64>() / image.pixels.as_flattened().len() as f64
}

fn mirrored(image: &Image) -> Image {
    let rows = image.pixels.chunks(image.width as usize);
    Image::new(image.width, image.height, rows.flat_map(|row| row.iter().rev().copied()).collect())
}

/// Compares a conversion with `plain.mitsuba3.xml` beside it. A mirrored picture would be off by 10 % or more, so that
/// the bound tells something.
fn check(name: &str, most: f64) {
    let folder = Folder::new();
    let (report, output) = folder.convert(name).unwrap();
    assert_eq!(report.notes, [], "the scene was chosen to lose nothing");
    let by_hand = picture(&output.with_file_name("plain.mitsuba3.xml"), SAMPLES);
    let converted = picture(&output, SAMPLES);
    let error = relative_error(&converted, &by_hand);
    assert!(error < most, "{name}: {error}");
    assert!(relative_error(&mirrored(&converted), &by_hand) > 0.1);
}

#[test]
fn an_old_mitsuba_scene_looks_as_it_did() {
    // the same shapes in the same order: the same paths but for the last bits of colours
    check("mitsuba/plain.xml", 1e-8);
}

#[test]
fn a_pbrt_scene_looks_as_it_did() {
    // meshes in place of rectangles: other places on lights. Measured: 4.6e-5, where noise of 256 samples is 4e-3.
    check("pbrt/plain.pbrt", 1e-3);
}

/// What a transform does to a direction.
type Turn = fn([f32; 3]) -> [f32; 3];

/// `square.exr` is red (1 rather than 0.2) towards −x and green (0.7) towards −y of the light's own coordinates.
#[test]
fn an_environment_is_seen_where_pbrt_has_it() {
    let folder = Folder::new();
    // each transform and where a direction of the world is in the light's own coordinates
    let transforms: [(&str, Turn); 4] = [
        ("", |d| d),
        ("Rotate 90 0 0 1", |[x, y, z]| [y, -x, z]),
        ("Scale -1 1 1", |[x, y, z]| [-x, y, z]),
        ("Scale -1 1 1 Rotate 90 0 0 1", |[x, y, z]| [y, x, z]),
    ];
    for (transform, to_light) in transforms {
        for d in QUADRANTS {
            let [x, y, z] = d;
            let text = format!(
                "LookAt 0 0 0 {x} {y} {z} 0 0 1 Camera \"perspective\" \"float fov\" 2
                 Film \"rgb\" \"integer xresolution\" 4 \"integer yresolution\" 4 WorldBegin
                 AttributeBegin {transform} LightSource \"infinite\" \"string filename\" \"square.exr\" AttributeEnd
                 Translate 0 0 -5 Shape \"sphere\""
            );
            let (_, output) = folder.convert_text("pbrt/case.pbrt", &text).unwrap();
            let [red, green, blue] = picture(&output, 4.0).mean();
            let [x, y, _] = to_light(d);
            let expected = [if x < 0.0 { 1.0 } else { 0.2 }, if y < 0.0 { 0.7 } else { 0.2 }, 0.2];
            for (seen, expected) in [red, green, blue].into_iter().zip(expected) {
                assert!((seen - expected).abs() < 1e-3, "{transform} {d:?}: {red} {green} {blue}");
            }
        }
    }
}

/// Whatever is written is read by relt: the samples with everything have every kind of element that is.
#[test]
fn everything_that_is_converted_is_rendered() {
    for name in ["mitsuba/everything.xml", "pbrt/everything.pbrt"] {
        let folder = Folder::new();
        let (_, output) = folder.convert(name).unwrap();
        let mean = picture(&output, 16.0).mean();
        assert!(mean.iter().all(|channel| (0.05..5.0).contains(channel)), "{name}: {mean:?}");
    }
}
