//! Images inside the page: what methods show after equal time, and where they err.

use std::path::Path;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;

use crate::film::exr_file::read_file;
use crate::film::{Image, png_file};
use crate::study::error_image::{signed_colours, signed_strip};
use crate::study::results::{MethodResults, Run, SceneResults, Snapshot};

/// An image for the page.
pub struct Picture<'a> {
    /// The method; none for the reference.
    pub source: Option<Source<'a>>,
    /// The image as PNG, exposure 1.
    pub image: Vec<u8>,
    /// Its errors in colours, PNG; none for the reference.
    pub errors: Option<Vec<u8>>,
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
    let mut pictures = vec![Picture { source: None, image: png_file::encode(&reference), errors: None }];
    let mut faults = Vec::new();
    for source in scene.methods.iter().filter_map(|method| source(method, time?)) {
        let path = source.snapshot.image.as_deref().expect("asked for by `source`");
        match read_of_size(path, &reference) {
            Ok(image) => {
                let errors = png_file::encode(&signed_colours(&image, &reference, 1.0));
                let image = png_file::encode(&image);
                pictures.push(Picture { source: Some(source), image, errors: Some(errors) });
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

/// A PNG file inside a page.
pub fn embedded(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", BASE64_STANDARD.encode(png))
}

/// The colours of errors from −1 to 1 as a strip of one row, evenly by square root.
pub fn colour_strip() -> String {
    embedded(&png_file::encode(&signed_strip(201)))
}

#[cfg(test)]
mod tests {
    use super::*;

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
