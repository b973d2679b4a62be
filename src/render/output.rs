//! From finished planes to files.

use std::path::{Path, PathBuf};

use super::settings::Method;
use super::status::{RunStart, Status};
use crate::film::file::{FileError, check_writable};
use crate::film::{Image, Plane, Value, exr_file, png_file};

/// An image with all that goes into its file.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The picture itself.
    pub image: Image,
    /// Further layers by name, such as `uniform` and `density`.
    pub layers: Vec<(String, Plane)>,
    /// How it was made; see [`metadata`].
    pub metadata: Vec<(String, Value)>,
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
            exr_file::write(exr, &picture.image, &picture.layers, &picture.metadata)?;
        }
        png_file::write(&self.png, &picture.image)
    }
}

/// What an image file says about how it was made.
///
/// Texts: `scene`, `method`, `features`, `embree`, `betas`, `acceptance` and `swap` (the latter three with a space
/// between numbers, as rungs and pairs are in order), `seed` (a number that a double may not hold), for `mlt`
/// `normalisation_from` and `kelemen_weights` (true or false).
/// Numbers: `mutations`, `rays`, `seconds`, `non_finite`, `normalisation`, `normalisation_error` and for `mlt`
/// `large_steps`.
pub fn metadata(start: &RunStart, status: &Status) -> Vec<(String, Value)> {
    let list = |numbers: &[f64]| numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
    let mut data: Vec<(&str, Value)> = vec![
        ("scene", start.scene.as_str().into()),
        ("method", start.settings.method.name().into()),
        ("seed", start.settings.seed.to_string().into()),
        ("features", start.features.join(", ").into()),
        ("embree", start.embree.as_str().into()),
        ("mutations", (status.mutations as f64).into()),
        ("rays", (status.rays as f64).into()),
        ("seconds", status.elapsed.as_secs_f64().into()),
        ("non_finite", (status.non_finite as f64).into()),
    ];
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
    data.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Settings;

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
            ..Status::default()
        };
        let image = Image::constant(4, 3, [0.5; 3]);
        let metadata = metadata(&start, &status);
        output.write(&Picture { image: image.clone(), layers: Vec::new(), metadata }).unwrap();
        let read = exr_file::read_file(&output.files()[0]).unwrap();
        assert_eq!(read.image, image);
        let value = |name: &str| read.metadata.iter().find(|(n, _)| n == name).map(|(_, value)| value.clone());
        assert_eq!(value("scene"), Some("scenes/x.xml".into()));
        assert_eq!(value("method"), Some("re".into()));
        assert_eq!(value("betas"), Some("0 1".into()));
        assert_eq!(value("mutations"), Some(77.0.into()));
        assert_eq!(value("normalisation_error"), Some(0.01.into()));
        assert!(output.files()[1].exists());
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
