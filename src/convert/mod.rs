//! Scene files of other renderers to Mitsuba 3's XML.
//!
//! A format is a folder: `mitsuba_old` for Mitsuba 0.5 to 2, `pbrt` for pbrt-v4. Either makes a tree of elements
//! (`xml`), files beside it where a scene's own cannot serve (`files`), and notes with their places (`notes`):
//! faults of the input, what is left out because there is no counterpart, and what will look different.
//!
//! What is written keeps to the part of Mitsuba 3 that relt reads as well.

mod cie;
mod files;
mod meshes;
mod mitsuba_old;
mod notes;
mod pbrt;
mod pictures;
mod spectra;
mod sums;
mod textures;
mod values;
mod xml;

use std::path::{Path, PathBuf};
use std::rc::Rc;

pub use notes::{Kind, Note};

use crate::film::file::{FileError, check_writable, write_whole};
use crate::load::{self, LoadError, Reach};
use files::Files;
use notes::Notes;
use xml::Element;

/// Linear red, green and blue.
type Rgb = [f64; 3];

/// What is to be converted, and how.
#[derive(Clone, Debug)]
pub struct Job {
    /// The scene file to read.
    pub input: PathBuf,
    /// The scene file to write.
    pub output: PathBuf,
    /// `-D` names and values, which go before defaults in the file.
    pub defines: Vec<(String, String)>,
    /// How far the names in the scene may lead.
    pub reach: Reach,
    /// Whether to write nothing where something would be left out.
    pub strict: bool,
}

/// What was written, and what there is to say about it.
#[derive(Clone, Debug)]
pub struct Report {
    /// What was left out or changed, in the order of the files.
    pub notes: Vec<Note>,
    /// The scene file and what was made beside it.
    pub written: Vec<PathBuf>,
}

/// Why nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// The input is faulty; one error for each faulty file.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Input(Vec<LoadError>),
    /// With [`Job::strict`]: something would be left out.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    LeftOut(Vec<Note>),
    /// A file could not be written.
    #[error(transparent)]
    File(#[from] FileError),
}

/// Makes the new scene's root element from the file of that path, number and text.
type Converter = fn(&Path, (usize, Rc<str>), &[(String, String)], &Files, &Notes) -> Option<Element>;

/// File name extensions and what converts them.
const FORMATS: &[(&str, Converter)] = &[("xml", mitsuba_old::convert), ("pbrt", pbrt::convert)];

/// Converts a scene file. Nothing is written where this fails.
pub fn convert(job: &Job) -> Result<Report, ConvertError> {
    let of_input = |message: String| ConvertError::Input(vec![LoadError::of_file(&job.input, message)]);
    let extension = job.input.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let Some((_, convert)) = FORMATS.iter().find(|(known, _)| *known == extension) else {
        let known: Vec<String> = FORMATS.iter().map(|(known, _)| format!(".{known}")).collect();
        return Err(of_input(format!("is no scene format that can be converted; known: {}", known.join(", "))));
    };
    check_writable(&job.output)?;
    let (notes, files) = (Notes::new(&job.input, job.reach), Files::new(&job.output));
    let text = load::text_of(&job.input).map_err(of_input)?;
    let source = notes.add(&job.input, text.into());
    let scene = convert(&job.input, source, &job.defines, &files, &notes);

    let notes = notes.settle().map_err(ConvertError::Input)?;
    let scene = scene.ok_or_else(|| of_input("gave neither a scene nor a fault; please report this".into()))?;
    if job.strict && notes.iter().any(|note| note.kind == Kind::LeftOut) {
        return Err(ConvertError::LeftOut(notes));
    }
    let mut written = files.settle()?;
    let from = job.input.file_name().unwrap_or_default().to_string_lossy();
    let text = scene.document(&format!("Converted from {from} by relt {}", env!("CARGO_PKG_VERSION")));
    write_whole(&job.output, |file| {
        std::io::Write::write_all(file, text.as_bytes()).map_err(|error| error.to_string())
    })?;
    written.insert(0, job.output.clone());
    Ok(Report { notes, written })
}

/// Single-precision numbers as they are.
fn numbers_of(rgb: [f32; 3]) -> Rgb {
    rgb.map(f64::from)
}

/// A sheet that scatters what it meets evenly on its other side; `base_color` is how much of it. Mitsuba 3's only diffuse
/// transmitter is the one inside of `principledthin`.
fn diffuse_transmitter(base_color: Element) -> Element {
    Element::plugin("bsdf", "principledthin").holding(base_color).float("diff_trans", 2.0)
}

/// A sheet that scatters what it meets on the side that it comes from, whichever that is. Beside something that transmits,
/// a `twosided` cannot do that; this one differs from a diffuse one at grazing angles.
fn diffuse_sheet(base_color: Element) -> Element {
    Element::plugin("bsdf", "principledthin").holding(base_color).float("diff_trans", 0.0).float("roughness", 0.5)
}
