//! From finished planes to files.

use std::path::{Path, PathBuf};

use super::health::Health;
use super::settings::Method;
use super::status::{RunStart, Status};
use crate::film::file::{FileError, check_writable, write_somewhere};
use crate::film::{Image, PixelFormat, Plane, Value, Window, exr_file, png_file};
use crate::scene::description::FilmDescription;
use crate::tempering::{Normaliser, RoundReport, RungReport};

/// An image with all that goes into its file.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The picture itself.
    pub image: Image,
    /// What a pixel holds; without colours all channels of the image are the same.
    pub format: PixelFormat,
    /// Where it lies in the whole that it is a part of.
    pub window: Window,
    /// Further layers by name, such as `uniform` and `density`.
    pub layers: Vec<(String, Plane)>,
    /// How it was made; see [`metadata`].
    pub metadata: Vec<(String, Value)>,
}

impl Picture {
    /// A picture of that film.
    pub fn new(
        film: &FilmDescription,
        image: Image,
        layers: Vec<(String, Plane)>,
        metadata: Vec<(String, Value)>,
    ) -> Picture {
        let (format, window) = (film.format, film.window);
        match format {
            PixelFormat::Rgb => Picture { image, format, window, layers, metadata },
            PixelFormat::Luminance => {
                let gray = |plane: Plane| match plane {
                    Plane::Rgb(layer) => Plane::Gray(layer.without_colour().pixels.iter().map(|rgb| rgb[0]).collect()),
                    gray => gray,
                };
                let layers = layers.into_iter().map(|(name, plane)| (name, gray(plane))).collect();
                Picture { image: image.without_colour(), format, window, layers, metadata }
            }
        }
    }

    /// Writes all of it as OpenEXR.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        exr_file::write_part(path, &self.image, self.format, self.window, &self.layers, &self.metadata)
    }
}

/// Where pictures go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    exr: Option<PathBuf>,
    png: PathBuf,
}

impl Output {
    /// Files for the name given with `-o`: `.exr` has a `.png` preview beside it, `.png` is the preview alone.
    pub fn new(path: &Path) -> Result<Output, String> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("exr") => Ok(Output { exr: Some(path.to_owned()), png: path.with_extension("png") }),
            Some("png") => Ok(Output { exr: None, png: path.to_owned() }),
            _ => Err(format!(
                "cannot write {}: {}; supported are .exr (32-bit floats, with a .png preview beside it) and .png \
                 (preview only)",
                path.display(),
                extension.map_or("it has no extension".into(), |e| format!("the extension .{e} is not supported")),
            )),
        }
    }

    /// The files that will be written, the one asked for first.
    pub fn files(&self) -> Vec<PathBuf> {
        self.exr.iter().chain([&self.png]).cloned().collect()
    }

    /// Finds out now whether all files can be written; leaves nothing behind.
    pub fn check(&self) -> Result<(), FileError> {
        self.files().iter().try_for_each(|file| check_writable(file))
    }

    /// Writes all files; each appears whole or not at all.
    pub fn write(&self, picture: &Picture) -> Result<(), FileError> {
        if let Some(exr) = &self.exr {
            picture.write(exr)?;
        }
        png_file::write(&self.png, &picture.image)
    }

    /// Writes all files at the end of a run, each where it was wanted or else [somewhere](write_somewhere): those that are
    /// there, and what to say of those that are not where they were wanted.
    pub fn write_somewhere(&self, picture: &Picture) -> (Vec<PathBuf>, Vec<String>) {
        let (mut there, mut failures) = (Vec::new(), Vec::new());
        for file in self.files() {
            let written = write_somewhere(&file, |path| match &self.exr {
                Some(exr) if *exr == file => picture.write(path),
                _ => png_file::write(path, &picture.image),
            });
            match written {
                Ok(()) => there.push(file),
                Err(misplaced) => {
                    failures.push(misplaced.to_string());
                    there.extend(misplaced.instead.ok());
                }
            }
        }
        (there, failures)
    }
}

/// What an image file says about how it was made.
///
/// Texts: `scene`, `method`, `mapping`, `features`, `embree`, `betas`, `acceptance` and `swap` (the latter three with a space
/// between numbers, as rungs and pairs are in order), `seed` (a number that a double may not hold), for `mlt`
/// `normalisation_from` and `kelemen_weights` (true or false).
/// Numbers: `mutations`, `rays`, `seconds`, `non_finite`, `normalisation`, `normalisation_error`, `resumed_at`
/// (mutations done before the last process took over, if there was more than one) and for `mlt` `large_steps`.
/// `ladder.NAME`: the last round of replica exchange, with the meanings in [`RoundReport`].
pub fn metadata(start: &RunStart, status: &Status) -> Vec<(String, Value)> {
    let mut data: Vec<(&str, Value)> = vec![
        ("scene", start.scene.as_str().into()),
        ("method", start.settings.method.name().into()),
        ("mapping", start.mapping.name().into()),
        ("seed", start.settings.seed.to_string().into()),
        ("features", start.features.join(", ").into()),
        ("embree", start.embree.as_str().into()),
        ("mutations", (status.mutations as f64).into()),
        ("rays", (status.rays as f64).into()),
        ("seconds", status.elapsed.as_secs_f64().into()),
        ("non_finite", (status.non_finite as f64).into()),
    ];
    data.extend(start.resumed_at.map(|mutations| ("resumed_at", (mutations as f64).into())));
    if !start.betas.is_empty() {
        data.push(("betas", list(&start.betas).into()));
        data.push(("combine", start.settings.combine.name().into()));
    }
    if start.settings.method == Method::Mlt {
        let mlt = start.settings.mlt;
        data.push(("large_steps", mlt.large_steps.into()));
        data.push(("normalisation_from", mlt.normalisation.name().into()));
        data.push(("kelemen_weights", mlt.kelemen_weights.to_string().into()));
    }
    for (name, numbers) in [("acceptance", &status.acceptance), ("swap", &status.swap)] {
        if !numbers.is_empty() {
            data.push((name, list(numbers).into()));
        }
    }
    if let Some((value, error)) = status.normalisation {
        data.push(("normalisation", value.into()));
        data.push(("normalisation_error", error.into()));
    }
    let of_ladder = status.last_round.as_deref().map(ladder).unwrap_or_default();
    data.into_iter().map(|(name, value)| (name.to_owned(), value)).chain(of_ladder).collect()
}

/// What an image file says about whether it can be trusted: `health` (`good`, `doubtful` or `bad`) and, where it is not good,
/// `health.findings`, a line for each.
pub fn health_metadata(health: &Health) -> Vec<(String, Value)> {
    let mut data: Vec<(String, Value)> = vec![("health".into(), health.verdict.name().into())];
    if !health.findings.is_empty() {
        data.push(("health.findings".into(), health.lines().join("\n").into()));
    }
    data
}

/// `ladder.NAME` for the last round of replica exchange.
///
/// Texts: `betas`, `ln_z`, `rejection`, `predicted_rejection`, `rung_acceptance`, `image_share` (a space between
/// numbers, as rungs and pairs are in order), `normaliser` (the one that was used).
/// Numbers: those of [`RoundReport`] by their names, and c by each method with its standard error, such as
/// `normaliser.mbar` and `normaliser.mbar_error`.
fn ladder(report: &RoundReport) -> Vec<(String, Value)> {
    let of_rungs = |value: fn(&RungReport) -> f64| list(&report.rungs.iter().map(value).collect::<Vec<_>>());
    let mut data: Vec<(String, Value)> = [
        ("round", f64::from(report.round).into()),
        ("sweeps", (report.sweeps as f64).into()),
        ("ladders", (report.ladders as f64).into()),
        ("betas", list(&report.betas).into()),
        ("ln_z", list(&report.ln_z).into()),
        ("lit_share", report.lit_share.into()),
        ("barrier", report.barrier.into()),
        ("rejection", list(&report.rejection).into()),
        ("predicted_rejection", list(&report.predicted_rejection).into()),
        ("round_trips", (report.round_trips as f64).into()),
        ("round_trips_predicted", report.round_trips_predicted.into()),
        ("restarts", (report.restarts as f64).into()),
        ("longest_rejection_run", (report.longest_rejection_run as f64).into()),
        ("split_r_hat", report.split_r_hat.into()),
        ("split_r_hat_image", report.split_r_hat_image.into()),
        ("uniform_share", report.uniform_share.into()),
        ("offers", (report.offers as f64).into()),
        ("chain_ratio", report.chain_ratio.into()),
        ("rung_acceptance", of_rungs(|rung| rung.acceptance).into()),
        ("image_share", of_rungs(|rung| rung.image_share).into()),
        ("normaliser", report.used.name().into()),
    ]
    .map(|(name, value): (&str, Value)| (format!("ladder.{name}"), value))
    .into();
    for normaliser in Normaliser::ALL {
        let name = format!("ladder.normaliser.{}", normaliser.name().replace(' ', "_"));
        let estimate = report.normalisers.of(normaliser);
        data.push((format!("{name}_error"), estimate.standard_error().into()));
        data.push((name, estimate.value().into()));
    }
    data.extend(report.image_share_before.map(|share| ("ladder.image_share_before".into(), share.into())));
    data
}

/// Numbers with a space between them.
fn list(numbers: &[f64]) -> String {
    numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::film::Filter;
    use crate::render::Settings;
    use crate::tempering::{LnEstimate, NormaliserEstimates};

    #[test]
    fn the_extension_decides() {
        let files = |path: &str| Output::new(Path::new(path)).map(|output| output.files());
        assert_eq!(files("a/b.exr"), Ok(vec!["a/b.exr".into(), "a/b.png".into()]));
        assert_eq!(files("B.EXR"), Ok(vec!["B.EXR".into(), "B.png".into()]));
        assert_eq!(files("b.png"), Ok(vec!["b.png".into()]));
        for wrong in ["b.jpg", "b", "b.", ".exr", "folder/"] {
            let message = files(wrong).unwrap_err();
            assert!(message.contains(".exr (") && message.contains(".png ("), "{message}");
        }
        assert!(files("b.tiff").unwrap_err().contains("extension .tiff"));
    }

    #[test]
    fn pictures_go_to_all_files_and_carry_their_history() {
        let folder = tempfile::tempdir().unwrap();
        let output = Output::new(&folder.path().join("a.exr")).unwrap();
        output.check().unwrap();
        let start = RunStart { scene: "scenes/x.xml".into(), betas: vec![0.0, 1.0], ..RunStart::default() };
        let status = Status {
            mutations: 77,
            acceptance: vec![0.5],
            swap: vec![0.25],
            normalisation: Some((0.1, 0.01)),
            last_round: Some(Arc::new(RoundReport {
                betas: vec![0.0, 0.5, 1.0],
                rejection: vec![0.25, f64::NAN],
                round_trips: 9,
                normalisers: NormaliserEstimates {
                    mbar: LnEstimate { ln_value: 0.0, relative_error: 0.5 },
                    ..NormaliserEstimates::default()
                },
                ..RoundReport::default()
            })),
            ..Status::default()
        };
        let image = Image::constant(4, 3, [0.5; 3]);
        let metadata = metadata(&start, &status);
        let film = FilmDescription::new(4, 3, Filter::Box);
        output.write(&Picture::new(&film, image.clone(), Vec::new(), metadata)).unwrap();
        let read = exr_file::read_file(&output.files()[0]).unwrap();
        assert_eq!(read.image, image);
        let value = |name: &str| read.metadata.iter().find(|(n, _)| n == name).map(|(_, value)| value.clone());
        assert_eq!(value("scene"), Some("scenes/x.xml".into()));
        assert_eq!(value("method"), Some("re".into()));
        assert_eq!(value("mapping"), Some("unidirectional".into()));
        assert_eq!(value("betas"), Some("0 1".into()));
        assert_eq!(value("mutations"), Some(77.0.into()));
        assert_eq!(value("normalisation_error"), Some(0.01.into()));
        assert_eq!(value("ladder.betas"), Some("0 0.5 1".into()), "those of the last round");
        assert_eq!(value("ladder.rejection"), Some("0.25 NaN".into()));
        assert_eq!(value("ladder.round_trips"), Some(9.0.into()));
        assert_eq!(value("ladder.normaliser.mbar"), Some(1.0.into()));
        assert_eq!(value("ladder.normaliser.mbar_error"), Some(0.5.into()));
        assert_eq!(value("ladder.image_share_before"), None);
        assert!(output.files()[1].exists());
    }

    #[test]
    fn a_picture_without_colours_has_none_in_its_layers_either() {
        let folder = tempfile::tempdir().unwrap();
        let output = Output::new(&folder.path().join("gray.exr")).unwrap();
        let film = FilmDescription { format: PixelFormat::Luminance, ..FilmDescription::new(4, 3, Filter::Box) };
        let [red, white] = [[1.0, 0.0, 0.0], [2.0; 3]].map(|rgb| Image::constant(4, 3, rgb));
        let layers = vec![("density".into(), Plane::Gray(vec![7.0; 12])), ("uniform".into(), Plane::Rgb(white))];
        output.write(&Picture::new(&film, red, layers, Vec::new())).unwrap();
        let read = exr_file::read_file(&output.files()[0]).unwrap();
        assert_eq!(read.image, Image::constant(4, 3, [0.212_671; 3]), "Y of red");
        assert_eq!(read.gray("density"), Some(&[7.0; 12][..]));
        assert!(read.gray("uniform").unwrap().iter().all(|y| (y - 2.0).abs() < 1e-6), "{read:?}");
    }

    #[test]
    fn what_was_chosen_about_metropolis_is_told_for_metropolis_alone() {
        let names = ["large_steps", "normalisation_from", "kelemen_weights"];
        let told = |method| {
            let settings = Settings { method, ..Settings::default() };
            let data = metadata(&RunStart { settings, ..RunStart::default() }, &Status::default());
            names.map(|name| data.iter().find(|(n, _)| n == name).map(|(_, value)| value.clone()))
        };
        assert_eq!(told(Method::Mlt), [Some(0.3.into()), Some("two-pass".into()), Some("false".into())]);
        assert_eq!(told(Method::ReplicaExchange), [None, None, None]);
    }
}
