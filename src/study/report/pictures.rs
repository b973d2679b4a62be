//! Images inside the page: what methods show after equal time, and where they err.

use std::path::Path;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;

use crate::film::exr_file::read_file;
use crate::film::image::LUMINANCE;
use crate::film::{Image, png_file};
use crate::study::results::{MethodResults, Run, SceneResults, Snapshot};

/// An image for the page.
pub struct Picture<'a> {
    /// The method; none for the reference.
    pub source: Option<Source<'a>>,
    /// The image as PNG, exposure 1.
    pub image: String,
    /// Its errors in colours; none for the reference.
    pub errors: Option<String>,
}

/// Where an image comes from.
pub struct Source<'a> {
    /// The method.
    pub method: &'a MethodResults,
    /// Its first run.
    pub run: &'a Run,
    /// The moment.
    pub snapshot: &'a Snapshot,
}

/// The reference and an image of each method, of its first run's snapshot that is closest to `time`; and what is in the
/// way of those that lack.
pub fn pictures(scene: &SceneResults, time: Option<f64>) -> (Vec<Picture<'_>>, Vec<String>) {
    let reference = match read_file(&scene.reference) {
        Ok(contents) => contents.image,
        Err(error) => return (Vec::new(), vec![format!("{}: no images are shown: {error}", scene.name)]),
    };
    let mut pictures = vec![Picture { source: None, image: embedded(&png_file::encode(&reference)), errors: None }];
    let mut faults = Vec::new();
    for source in scene.methods.iter().filter_map(|method| source(method, time?)) {
        let path = source.snapshot.image.as_deref().expect("asked for by `source`");
        match read_of_size(path, &reference) {
            Ok(image) => {
                let errors = png_file::encode_bytes(scene_size(&reference), &error_colours(&image, &reference));
                let image = embedded(&png_file::encode(&image));
                pictures.push(Picture { source: Some(source), image, errors: Some(embedded(&errors)) });
            }
            Err(fault) => faults.push(format!("{}: no image of {}: {fault}", scene.name, source.method.name)),
        }
    }
    (pictures, faults)
}

fn source(method: &MethodResults, time: f64) -> Option<Source<'_>> {
    let run = method.runs.first()?;
    let kept = run.snapshots.iter().filter(|snapshot| snapshot.image.is_some() && snapshot.seconds > 0.0);
    let distance = |snapshot: &Snapshot| (snapshot.seconds / time).ln().abs();
    let snapshot = kept.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    Some(Source { method, run, snapshot })
}

fn read_of_size(path: &Path, reference: &Image) -> Result<Image, String> {
    let image = read_file(path).map_err(|error| error.to_string())?.image;
    match scene_size(&image) == scene_size(reference) {
        true => Ok(image),
        false => {
            let ([w, h], [rw, rh]) = (scene_size(&image), scene_size(reference));
            Err(format!("{} has {w} × {h} pixels, the reference {rw} × {rh}", path.display()))
        }
    }
}

fn scene_size(image: &Image) -> [u32; 2] {
    [image.width, image.height]
}

fn embedded(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", BASE64_STANDARD.encode(png))
}

/// Signed relative errors in colours, three bytes a pixel.
fn error_colours(image: &Image, reference: &Image) -> Vec<u8> {
    let pairs = image.pixels.iter().zip(&reference.pixels);
    pairs.flat_map(|(x, r)| colour(relative_error(luminance(*x), luminance(*r)))).collect()
}

fn luminance(rgb: [f32; 3]) -> f64 {
    rgb.iter().zip(LUMINANCE).map(|(value, weight)| f64::from(value * weight)).sum()
}

/// (x − r)/√(r² + 0.01) of luminances: the error whose mean square is relMSE, but for its channels.
pub fn relative_error(x: f64, r: f64) -> f64 {
    const FLOOR: f64 = 0.01;
    (x - r) / (r * r + FLOOR).sqrt()
}

/// From blue, where an image is too dark, over white to red, where it is too bright. Colours go with the square root of
/// the error, so that 1 % is visible and 100 % is not yet the same as 25 %; what is beyond ±1 is drawn as ±1.
pub fn colour(error: f64) -> [u8; 3] {
    /// sRGB at 0, ¼, ½, ¾ and 1; lightness falls in about equal steps on both sides.
    const DARK: [[f64; 3]; 5] =
        [[250.0, 250.0, 250.0], [176.0, 206.0, 232.0], [96.0, 157.0, 208.0], [30.0, 96.0, 166.0], [8.0, 36.0, 92.0]];
    const BRIGHT: [[f64; 3]; 5] =
        [[250.0, 250.0, 250.0], [246.0, 198.0, 168.0], [232.0, 130.0, 92.0], [190.0, 48.0, 38.0], [100.0, 4.0, 22.0]];
    let anchors = if error < 0.0 { DARK } else { BRIGHT };
    let place = error.abs().min(1.0).sqrt() * 4.0; // NaN.min(1) is 1: what is not a number is as wrong as can be
    let i = (place as usize).min(3);
    let share = place - i as f64;
    std::array::from_fn(|c| (anchors[i][c] + share * (anchors[i + 1][c] - anchors[i][c])).round() as u8)
}

/// The colours of errors from −1 to 1 as a strip of one row, evenly by square root.
pub fn colour_strip() -> String {
    const WIDTH: u32 = 201;
    let error = |i: u32| {
        let root = f64::from(i) / f64::from(WIDTH - 1) * 2.0 - 1.0;
        root * root.abs()
    };
    let bytes: Vec<u8> = (0..WIDTH).flat_map(|i| colour(error(i))).collect();
    embedded(&png_file::encode_bytes([WIDTH, 1], &bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_colours_are_blue_where_dark_and_red_where_bright() {
        let [white, blue, red] = [0.0, -0.3, 0.3].map(colour);
        assert!(white[0] == white[2] && white[0] >= 245);
        assert!(blue[2] > blue[0] + 60 && red[0] > red[2] + 60, "{blue:?} {red:?}");
        assert_eq!(colour(-7.0), colour(-1.0));
        assert_eq!(colour(f64::NAN), colour(1.0));
        let lightness = |error: f64| colour(error).iter().map(|byte| u32::from(*byte)).sum::<u32>();
        let falls = |sign: f64| {
            (0..100).all(|i| lightness(sign * f64::from(i + 1) / 100.0) <= lightness(sign * f64::from(i) / 100.0))
        };
        assert!(falls(1.0) && falls(-1.0));
    }

    #[test]
    fn the_first_runs_snapshot_closest_in_time_is_shown() {
        let at = |seconds: f64, kept: bool| Snapshot {
            seconds,
            image: kept.then(|| format!("{seconds}.exr").into()),
            ..Snapshot::default()
        };
        let run =
            Run { snapshots: vec![at(1.0, true), at(4.0, true), at(5.0, false), at(10.0, true)], ..Run::default() };
        let method = MethodResults { runs: vec![run], ..MethodResults::default() };
        assert_eq!(source(&method, 5.0).unwrap().snapshot.seconds, 4.0);
        assert_eq!(source(&method, 100.0).unwrap().snapshot.seconds, 10.0);
        assert!(source(&MethodResults::default(), 5.0).is_none());
    }

    #[test]
    fn what_cannot_be_read_is_told() {
        let scene = SceneResults { name: "door".into(), reference: "none.exr".into(), ..SceneResults::default() };
        let (pictures, faults) = pictures(&scene, Some(1.0));
        assert!(pictures.is_empty() && faults[0].contains("door") && faults[0].contains("none.exr"), "{faults:?}");
    }
}
