//! Files to scene descriptions: one folder or file a format.
//!
//! A reader goes on after a fault, so that one [`LoadError`] tells all that is wrong with a file. To add a format:
//! a new module and a line in `FORMATS`.

pub(crate) mod access;
pub(crate) mod faults;
pub(crate) mod images;
mod mitsuba;
pub(crate) mod names;
mod watch;

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

pub use access::Reach;
pub use faults::{Fault, LoadError};
pub(crate) use mitsuba::parse_ply;
pub use watch::Watch;

use crate::scene::textures::Image;
use crate::scene::{Mesh, SceneDescription};

/// Makes a description of the scene from the text of a file at a path, with the `-D` values and within the reach given, and
/// lets it be watched.
type Reader = fn(&Path, String, &[(String, String)], Reach, &Watch) -> Result<SceneDescription, LoadError>;

/// File name extensions and their readers.
const FORMATS: &[(&str, Reader)] = &[("xml", mitsuba::read)];

/// Reads the scene file at `path`; `defines` are `-D` names and values, which go before defaults in the file.
pub fn scene(path: &Path, defines: &[(String, String)]) -> Result<SceneDescription, LoadError> {
    watched(path, defines, Reach::default(), &Watch::default())
}

/// As [`scene`], with names that lead as far as that; `watch` tells others, while it lasts, how far it has come.
pub fn watched(
    path: &Path,
    defines: &[(String, String)],
    reach: Reach,
    watch: &Watch,
) -> Result<SceneDescription, LoadError> {
    let read = reader(path)?;
    read(path, text_of(path).map_err(|reason| LoadError::of_file(path, reason))?, defines, reach, watch)
}

/// Reads the text of a scene file that would be at `path`, without looking there; files that it names are looked for in
/// that folder, and nowhere else.
pub fn text(path: &Path, text: String) -> Result<SceneDescription, LoadError> {
    reader(path)?(path, text, &[], Reach::Confined, &Watch::default())
}

/// Reads the content of a mesh file of that kind, a shape's `type` in a scene, and gives what of it would be rendered.
pub fn mesh(kind: &str, content: &[u8]) -> Result<Mesh, String> {
    mitsuba::mesh(kind, content)
}

/// Reads the content of a picture file.
pub fn picture(content: &[u8]) -> Result<Image, String> {
    images::decode(content)
}

/// Most bytes of a scene file, and of all text that a scene is made of. Places in it are kept as 32 bits by the XML reader,
/// and its elements take some twenty times as much memory.
pub(crate) const MOST_TEXT: u64 = 1 << 30;

/// The text of a file, or what is wrong with it.
pub(crate) fn text_of(path: &Path) -> Result<String, String> {
    let cannot = |error: io::Error| format!("cannot be read: {error}");
    let mut bytes = Vec::new();
    File::open(path).map_err(cannot)?.take(MOST_TEXT + 1).read_to_end(&mut bytes).map_err(cannot)?;
    if bytes.len() as u64 > MOST_TEXT {
        return Err(format!("is larger than {MOST_TEXT} bytes; put meshes into files of their own"));
    }
    String::from_utf8(bytes)
        .map_err(|error| format!("is not UTF-8 text: invalid at byte {}", error.utf8_error().valid_up_to()))
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
