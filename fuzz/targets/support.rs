//! A folder for targets whose input must be a file.

use std::path::PathBuf;
use std::sync::LazyLock;

use relt::convert::{Job, convert};
use relt::load::Reach;

/// A folder of this process, in memory where there is such a place.
static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let memory = std::path::Path::new("/dev/shm");
    let made = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
    made.expect("there is room for a folder")
});

/// The path of a new file with that content.
#[allow(dead_code, reason = "each target takes what it needs")]
pub fn file(name: &str, content: &[u8]) -> PathBuf {
    let path = FOLDER.path().join(name);
    std::fs::write(&path, content).expect("there is room for a file");
    path
}

/// Converts a scene file of that name and content.
#[allow(dead_code, reason = "each target takes what it needs")]
pub fn converted(name: &str, content: &[u8]) {
    let input = file(name, content);
    let output = FOLDER.path().join("out.xml");
    let _ = convert(&Job { input, output, defines: Vec::new(), reach: Reach::Confined, strict: false });
    let _ = std::fs::remove_dir_all(FOLDER.path().join("out-files"));
}
