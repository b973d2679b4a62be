//! `relt compare`: how far images are from a reference.

use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::{Path, PathBuf, absolute};

use clap::Args;
use serde::Serialize;

use super::failure::Failure;
use crate::film::file::{FileError, check_writable};
use crate::film::{Image, Plane, Value, exr_file, png_file};
use crate::render::progress::significant;
use crate::study::error_image::{relative, rising_colours, signed_colours};
use crate::study::flip::Flip;
use crate::study::metrics::{self, Errors, Reference};

/// Compares images with a reference: RMSE, relMSE, SMAPE, brightness, HDR-FLIP
///
/// RMSE is √mean((x − r)²), relMSE mean((x − r)² / (r² + 0.01)), SMAPE mean(2 |x − r| / (|x| + |r|)), all over pixels and
/// channels; brightness is Σ x / Σ r; HDR-FLIP (Andersson et al. 2021) is how different two images look to somebody who
/// flips between them, 0 to 1, at 67 pixels per degree. Where the reference's file holds the variance of its pixels
/// (`variance.R`, `.G`, `.B`), RMSE and relMSE are without the reference's own noise.
#[derive(Args)]
#[command(after_help = super::EXIT_CODES)]
pub(super) struct Compare {
    /// Images, OpenEXR, of the reference's size
    #[arg(value_name = "IMAGE", required = true)]
    images: Vec<PathBuf>,

    /// What counts as the truth, OpenEXR; `relt reference` makes one
    #[arg(long, value_name = "FILE")]
    reference: PathBuf,

    /// Prints JSON instead of a table
    #[arg(long)]
    json: bool,

    /// Draws errors: x.png gets the relative error of luminance, (x − r)/√(r² + 0.01), white for none, blue for too dark,
    /// red for too bright, and x-flip.png the HDR-FLIP map from black, 0, to pale yellow, 1; x.exr gets the former with
    /// the numbers in layers `error` (by channel) and `flip`; several images need a folder, which gets IMAGE-error.png
    /// and IMAGE-error-flip.png of each
    #[arg(short = 'o', long, value_name = "FILE or FOLDER")]
    error_image: Option<PathBuf>,

    /// Relative error that is drawn in full colour
    #[arg(long, value_name = "F", default_value_t = 0.5, allow_negative_numbers = true)]
    error_range: f32,

    /// Fails with exit code 3 where the relMSE of an image is above this
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    max_relmse: Option<f64>,

    /// Fails with exit code 3 where the brightness of an image is further than this from 1
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    max_brightness_error: Option<f64>,
}

/// Runs the subcommand.
pub(super) fn run(arguments: Compare) -> Result<(), Failure> {
    let drawings = arguments.drawings()?;
    let (reference, images) = arguments.open()?;
    let flips: Vec<Flip> = images.iter().map(|image| Flip::of(image, &reference.image)).collect();
    let compared = arguments.compared(&reference, &images, &flips);

    let text = if arguments.json { compared.json() } else { compared.table() };
    drop(write!(io::stdout(), "{text}")); // whoever reads may have read enough, as `head` does
    for (i, drawing) in drawings.iter().enumerate() {
        let name = arguments.images[i].display().to_string();
        drawing
            .write(&name, &images[i], &reference.image, &flips[i], arguments.error_range)
            .map_err(Failure::running)?;
    }
    match compared.exceeded() {
        exceeded if exceeded.is_empty() => Ok(()),
        exceeded => Err(Failure::Exceeded(exceeded)),
    }
}

impl Compare {
    /// Where the errors of each image are drawn, none if they are not; all places are known to be writable afterwards,
    /// and the options to make sense.
    fn drawings(&self) -> Result<Vec<Drawing>, Failure> {
        let mut faults = Vec::new();
        let limits = [("--max-relmse", self.max_relmse), ("--max-brightness-error", self.max_brightness_error)];
        for (name, limit) in limits.into_iter().filter_map(|(name, limit)| Some((name, limit?))) {
            if !(limit >= 0.0 && limit.is_finite()) {
                faults.push(format!("{name} {limit}: accepted are numbers from 0"));
            }
        }
        if !(self.error_range > 0.0 && self.error_range.is_finite()) {
            faults.push(format!("--error-range {}: accepted are numbers above 0", self.error_range));
        }
        let drawings = match &self.error_image {
            Some(output) => Drawing::of(output, &self.images).unwrap_or_else(|fault| {
                faults.push(fault);
                Vec::new()
            }),
            None => Vec::new(),
        };
        let place = |path: &Path| absolute(path).unwrap_or_else(|_| path.to_owned());
        for file in drawings.iter().flat_map(Drawing::files) {
            if self.images.iter().chain([&self.reference]).any(|input| place(input) == place(&file)) {
                faults.push(format!("--error-image: {} is compared and would be overwritten", file.display()));
            } else if let Err(error) = check_writable(&file) {
                faults.push(error.to_string());
            }
        }
        if faults.is_empty() { Ok(drawings) } else { Err(Failure::Input(faults)) }
    }

    /// The reference and all images, or everything that is wrong with any of them.
    fn open(&self) -> Result<(Reference, Vec<Image>), Failure> {
        let mut faults = Vec::new();
        let reference = Reference::read(&self.reference).map_err(|found| faults.extend(found)).ok();
        let mut images = Vec::new();
        for path in &self.images {
            let image = match exr_file::read_file(path) {
                Ok(contents) => contents.image,
                Err(error) => {
                    faults.push(error.to_string());
                    continue;
                }
            };
            faults.extend(metrics::faults(&image).iter().map(|fault| format!("{}: {fault}", path.display())));
            if let Some(reference) = reference.as_ref().map(|reference| &reference.image)
                && (image.width, image.height) != (reference.width, reference.height)
            {
                faults.push(format!(
                    "{}: {} × {} pixels; accepted is the size of the reference {}, {} × {}",
                    path.display(),
                    image.width,
                    image.height,
                    self.reference.display(),
                    reference.width,
                    reference.height
                ));
            }
            images.push(image);
        }
        match reference {
            Some(reference) if faults.is_empty() => Ok((reference, images)),
            _ => Err(Failure::Input(faults)),
        }
    }

    /// All errors, and which of them are too large.
    fn compared(&self, reference: &Reference, images: &[Image], flips: &[Flip]) -> Compared {
        let of = |path: &Path, image: &Image, flip: &Flip| {
            let errors = Errors::of(image, reference);
            Row {
                file: path.display().to_string(),
                mse: errors.mse,
                rmse: errors.rmse(),
                rel_mse: errors.rel_mse,
                smape: errors.smape,
                mean_ratio: errors.mean_ratio,
                mean_ratio_error: errors.mean_ratio_error,
                flip: flip.mean(),
                exceeded: self.exceeded(&errors),
            }
        };
        let noise = reference.noise();
        Compared {
            reference: OfReference {
                file: self.reference.display().to_string(),
                width: reference.image.width,
                height: reference.image.height,
                corrected: noise.is_some(),
                rmse: noise.map(|noise| noise.mse.sqrt()),
                rel_mse: noise.map(|noise| noise.rel_mse),
            },
            images: (0..images.len()).map(|i| of(&self.images[i], &images[i], &flips[i])).collect(),
        }
    }

    /// The limits that these errors are beyond; an error that is no number is beyond all of them.
    fn exceeded(&self, errors: &Errors) -> Vec<String> {
        let off = (errors.mean_ratio - 1.0).abs();
        let limits = [
            ("relMSE", errors.rel_mse, "--max-relmse", self.max_relmse),
            ("brightness error", off, "--max-brightness-error", self.max_brightness_error),
        ];
        let beyond = |(what, value, name, limit): (&str, f64, &str, Option<f64>)| {
            let limit = limit.filter(|limit| value.is_nan() || value > *limit)?;
            Some(format!("{what} {} is above {name} {limit}", significant(value, 4)))
        };
        limits.into_iter().filter_map(beyond).collect()
    }
}

/// What is printed.
#[derive(Serialize)]
struct Compared {
    reference: OfReference,
    images: Vec<Row>,
}

/// The reference with the errors that its own noise amounts to, `null` where the file does not tell it.
#[derive(Serialize)]
struct OfReference {
    file: String,
    width: u32,
    height: u32,
    /// Errors of the images are without this noise.
    corrected: bool,
    rmse: Option<f64>,
    rel_mse: Option<f64>,
}

/// An image with its errors, with the names and meanings of [`Errors`].
#[derive(Serialize)]
struct Row {
    file: String,
    mse: f64,
    rmse: f64,
    rel_mse: f64,
    smape: f64,
    mean_ratio: f64,
    mean_ratio_error: f64,
    /// Mean of HDR-FLIP.
    flip: f64,
    /// Limits that it is beyond, in words.
    exceeded: Vec<String>,
}

impl Compared {
    fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and texts have a JSON form") + "\n"
    }

    fn table(&self) -> String {
        let width = self.images.iter().map(|row| row.file.chars().count()).max().unwrap_or(0).max("image".len());
        let mut text = format!(
            "{:width$}{:>10}{:>12}{:>10}{:>20}{:>10}\n",
            "image", "RMSE", "relMSE", "SMAPE", "brightness", "HDR-FLIP"
        );
        for row in &self.images {
            text += &format!(
                "{:width$}{:>10}{:>12}{:>10}{:>20}{:>10}\n",
                row.file,
                significant(row.rmse, 3),
                significant(row.rel_mse, 3),
                significant(row.smape, 3),
                if self.reference.corrected {
                    format!("{:.4} ± {:.4}", row.mean_ratio, row.mean_ratio_error)
                } else {
                    format!("{:.4}", row.mean_ratio)
                },
                format!("{:.4}", row.flip),
            );
        }
        text + &self.reference.in_words(self.images.iter().any(|row| row.mse < 0.0 || row.rel_mse < 0.0))
    }

    fn exceeded(&self) -> Vec<String> {
        let of = |row: &Row| row.exceeded.iter().map(|words| format!("{}: {words}", row.file)).collect::<Vec<_>>();
        self.images.iter().flat_map(of).collect()
    }
}

impl OfReference {
    /// What the errors of the images say about the reference's noise; `below`: some are smaller than that noise.
    fn in_words(&self, below: bool) -> String {
        let OfReference { file, width, height, .. } = self;
        let (Some(rmse), Some(rel_mse)) = (self.rmse, self.rel_mse) else {
            return format!(
                "reference {file}, {width} × {height}: no layer variance; errors include the reference's own noise\n"
            );
        };
        let mut text = format!(
            "reference {file}, {width} × {height}: its own noise is RMSE {}, relMSE {};\nRMSE and relMSE above are \
             without it, ± is what it leaves uncertain\n",
            significant(rmse, 3),
            significant(rel_mse, 3)
        );
        if below {
            text += "below 0 (RMSE: 0): closer to the reference than its noise lets expect; too close to tell\n";
        }
        text
    }
}

/// Files that the errors of one image are drawn in.
enum Drawing {
    Png { error: PathBuf, flip: PathBuf },
    Exr(PathBuf),
}

impl Drawing {
    /// A file for one image, files in a folder for several or if `output` has no extension.
    fn of(output: &Path, images: &[PathBuf]) -> Result<Vec<Drawing>, String> {
        let shown = output.display();
        let extension = output.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref().filter(|_| !output.is_dir()) {
            Some("png" | "exr") if images.len() > 1 => {
                Err(format!("--error-image {shown}: {} images need a folder", images.len()))
            }
            Some("png") => Ok(vec![Drawing::png(output.to_owned())]),
            Some("exr") => Ok(vec![Drawing::Exr(output.to_owned())]),
            _ if output.is_dir() => Drawing::in_folder(output, images),
            _ => Err(format!("--error-image {shown}: accepted are .png, .exr, and folders that are there")),
        }
    }

    fn png(error: PathBuf) -> Drawing {
        let flip = error.with_file_name(stem(&error) + "-flip.png");
        Drawing::Png { error, flip }
    }

    fn in_folder(folder: &Path, images: &[PathBuf]) -> Result<Vec<Drawing>, String> {
        let names: Vec<String> = images.iter().map(|image| stem(image)).collect();
        match (0..names.len()).find(|i| names[..*i].contains(&names[*i])) {
            Some(i) => Err(format!("--error-image: two images are called {}; draw them one by one", names[i])),
            None => Ok(names.iter().map(|name| Drawing::png(folder.join(format!("{name}-error.png")))).collect()),
        }
    }

    fn files(&self) -> Vec<PathBuf> {
        match self {
            Drawing::Png { error, flip } => vec![error.clone(), flip.clone()],
            Drawing::Exr(file) => vec![file.clone()],
        }
    }

    /// Draws the errors of `image`, which is called `name`.
    fn write(&self, name: &str, image: &Image, reference: &Image, flip: &Flip, range: f32) -> Result<(), FileError> {
        let colours = signed_colours(image, reference, range);
        match self {
            Drawing::Png { error, flip: map } => {
                png_file::write(error, &colours)?;
                png_file::write(map, &rising_colours(image.width, image.height, &flip.map))
            }
            Drawing::Exr(file) => {
                let numbers = Plane::Rgb(relative(image, reference));
                let layers = [("error".into(), numbers), ("flip".into(), Plane::Gray(flip.map.clone()))];
                let metadata: [(String, Value); 2] =
                    [("image".into(), name.into()), ("error_range".into(), f64::from(range).into())];
                exr_file::write(file, &colours, &layers, &metadata)
            }
        }
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or(OsStr::new("image")).to_string_lossy().into_owned()
}
