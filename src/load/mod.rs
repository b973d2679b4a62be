//! Files to scene descriptions: one folder or file a format.
//!
//! A reader goes on after a fault, so that one [`LoadError`] tells all that is wrong with a file. To add a format:
//! a new module and a line in `FORMATS`.

pub(crate) mod faults;
pub(crate) mod images;
mod mitsuba;
mod watch;

use std::path::Path;

pub use faults::{Fault, LoadError};
pub(crate) use mitsuba::parse_ply;
pub use watch::Watch;

use crate::scene::SceneDescription;

/// Makes a description of the scene from the text of a file at a path, with the `-D` values given, and lets it be
/// watched.
type Reader = fn(&Path, String, &[(String, String)], &Watch) -> Result<SceneDescription, LoadError>;

/// File name extensions and their readers.
const FORMATS: &[(&str, Reader)] = &[("xml", mitsuba::read)];

/// Reads the scene file at `path`; `defines` are `-D` names and values, which go before defaults in the file.
pub fn scene(path: &Path, defines: &[(String, String)]) -> Result<SceneDescription, LoadError> {
    watched(path, defines, &Watch::default())
}

/// As [`scene`]; `watch` tells others, while it lasts, how far it has come.
pub fn watched(path: &Path, defines: &[(String, String)], watch: &Watch) -> Result<SceneDescription, LoadError> {
    let read = reader(path)?;
    let bytes = std::fs::read(path).map_err(|error| LoadError::of_file(path, format!("cannot be read: {error}")))?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let place = error.utf8_error().valid_up_to();
        LoadError::of_file(path, format!("is not UTF-8 text: invalid at byte {place}"))
    })?;
    read(path, text, defines, watch)
}

/// Reads the text of a scene file that would be at `path`, without looking there; files that it names are looked for in
/// that folder.
pub fn text(path: &Path, text: String) -> Result<SceneDescription, LoadError> {
    reader(path)?(path, text, &[], &Watch::default())
}

/// The reader of the format that the file name's extension stands for.
fn reader(path: &Path) -> Result<Reader, LoadError> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if let Some((_, read)) = FORMATS.iter().find(|(known, _)| *known == extension) {
        return Ok(*read);
    }
    let known: Vec<String> = FORMATS.iter().map(|(name, _)| format!(".{name}")).collect();
    let given = if extension.is_empty() { "no extension".into() } else { format!("extension .{extension}") };
    Err(LoadError::of_file(path, format!("is not a known scene format ({given}); known: {}", known.join(", "))))
}
