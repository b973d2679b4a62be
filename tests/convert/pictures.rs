//! Converted scenes look like the same scenes written by hand.

use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use relt::embree::Device;
use relt::film::Image;
use relt::render::{Job, Method, Settings, run};
use relt::scene::Scene;

use crate::support::Folder;

/// Samples a pixel. All pictures have the same seed.
const SAMPLES: f64 = 256.0;

fn picture(path: &std::path::Path) -> Image {
    static DEVICE: OnceLock<Device> = OnceLock::new();
    let device = DEVICE.get_or_init(|| Device::new("").unwrap_or_else(|error| panic!("{error}")));
    let description = relt::load::scene(path, &[]).unwrap_or_else(|error| panic!("{error}"));
    let scene = Scene::new(device, description).unwrap_or_else(|error| panic!("{error}"));
    let settings =
        Settings { method: Method::Path, threads: Some(1), mutations_per_pixel: Some(SAMPLES), ..Settings::default() };
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
    let by_hand = picture(&output.with_file_name("plain.mitsuba3.xml"));
    let converted = picture(&output);
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
