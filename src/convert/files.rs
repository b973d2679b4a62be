//! Files beside the scene: those that are referred to where they are, and those that a conversion makes.
//!
//! What is made goes to a temporary folder first and to `NAME-files/` beside `NAME.xml` when all is done, so that a
//! conversion that fails leaves nothing behind.

use std::cell::RefCell;
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Component, Path, PathBuf, absolute};
use std::rc::Rc;

use tempfile::TempDir;

use super::meshes::Mesh;
use super::pictures;
use crate::film::file::FileError;
use crate::film::{Image, exr_file};
use crate::load::access::tidy;

/// Paths of a conversion's output, and what it has made so far.
pub(super) struct Files {
    /// The folder of the scene file that is written.
    home: PathBuf,
    /// Name of the folder beside it.
    name: String,
    made: RefCell<Made>,
}

#[derive(Default)]
struct Made {
    folder: Option<TempDir>,
    /// How often each stem was asked for.
    stems: HashMap<String, usize>,
    /// Pictures read, by path and whether their numbers were taken as they are.
    read: HashMap<(PathBuf, bool), Rc<Image>>,
    /// References of pictures written; holding them keeps their addresses their own.
    written: Vec<(Rc<Image>, String)>,
    /// What could not be written.
    failure: Option<FileError>,
}

impl Files {
    /// For a scene file that is to be written at `output`.
    pub fn new(output: &Path) -> Files {
        let home = match output.parent() {
            Some(folder) if folder != Path::new("") => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        let stem = output.file_stem().unwrap_or_default().to_string_lossy();
        Files { home, name: format!("{stem}-files"), made: RefCell::default() }
    }

    /// A file's path as seen from the scene file.
    pub fn reference(&self, path: &Path) -> String {
        let relative = relative(&settled(path), &settled(&self.home));
        relative.to_string_lossy().replace('\\', "/")
    }

    /// Writes a mesh as binary PLY; gives its reference.
    pub fn mesh(&self, stem: &str, mesh: &Mesh) -> String {
        self.make(stem, "ply", |path| {
            let failed = |error: std::io::Error| FileError::write(path, error);
            let mut file = BufWriter::new(File::create(path).map_err(failed)?);
            mesh.write_ply(&mut file).and_then(|()| file.flush()).map_err(failed)
        })
    }

    /// Writes a picture as OpenEXR, unless it is written already; gives its reference.
    pub fn picture(&self, stem: &str, image: &Rc<Image>) -> String {
        if let Some((_, reference)) = self.made.borrow().written.iter().find(|(known, _)| Rc::ptr_eq(known, image)) {
            return reference.clone();
        }
        let reference = self.make(stem, "exr", |path| exr_file::write(path, image, &[], &[]));
        self.made.borrow_mut().written.push((image.clone(), reference.clone()));
        reference
    }

    /// Reads a picture as linear colours; with `raw`, the numbers of the file as they are.
    pub fn read_picture(&self, path: &Path, raw: bool) -> Result<Rc<Image>, String> {
        let key = (path.to_owned(), raw);
        if let Some(image) = self.made.borrow().read.get(&key) {
            return Ok(image.clone());
        }
        let image = Rc::new(pictures::read(path, raw)?);
        self.made.borrow_mut().read.insert(key, image.clone());
        Ok(image)
    }

    /// Puts everything that was made where it belongs; gives the paths.
    pub fn settle(self) -> Result<Vec<PathBuf>, FileError> {
        let made = self.made.into_inner();
        if let Some(failure) = made.failure {
            return Err(failure);
        }
        let Some(temporary) = made.folder else { return Ok(Vec::new()) };
        let folder = self.home.join(&self.name);
        std::fs::create_dir_all(&folder).map_err(|error| FileError::write(&folder, error))?;
        let mut names: Vec<_> = std::fs::read_dir(temporary.path())
            .and_then(|entries| entries.map(|entry| entry.map(|entry| entry.file_name())).collect())
            .map_err(|error| FileError::read(temporary.path(), error))?;
        names.sort();
        let settle = |name| {
            let to = folder.join(&name);
            std::fs::rename(temporary.path().join(&name), &to).map_err(|error| FileError::write(&to, error))?;
            Ok(to)
        };
        names.into_iter().map(settle).collect()
    }

    /// Makes a file of a name that is not taken; gives its reference. The first failure is told at the end.
    fn make(&self, stem: &str, extension: &str, write: impl FnOnce(&Path) -> Result<(), FileError>) -> String {
        let mut made = self.made.borrow_mut();
        let stem = tame(stem);
        let count = made.stems.entry(format!("{stem}.{extension}")).or_insert(0);
        *count += 1;
        // "-2" after a name could be another's own name; "--" cannot, for `tame` leaves none
        let name = if *count == 1 { format!("{stem}.{extension}") } else { format!("{stem}--{count}.{extension}") };
        if made.folder.is_none() && made.failure.is_none() {
            match tempfile::Builder::new().prefix(".relt-").tempdir_in(&self.home) {
                Ok(folder) => made.folder = Some(folder),
                Err(error) => made.failure = Some(FileError::write(&self.home.join(&self.name), error)),
            }
        }
        let path = made.folder.as_ref().map(|folder| folder.path().join(&name));
        if let (Some(path), None) = (path, &made.failure) {
            made.failure = write(&path).err();
        }
        format!("{}/{name}", self.name)
    }
}

/// A stem of letters, digits and single hyphens.
fn tame(stem: &str) -> String {
    let mut tame = String::new();
    for c in stem.chars().take(80) {
        if c.is_ascii_alphanumeric() || c == '_' || c == '.' {
            tame.push(c);
        } else if !tame.ends_with('-') {
            tame.push('-');
        }
    }
    let tame = tame.trim_matches(['-', '.']);
    if tame.is_empty() { "unnamed".into() } else { tame.to_ascii_lowercase() }
}

/// The path without links and without `..`, as far as it exists.
fn settled(path: &Path) -> PathBuf {
    if let Ok(path) = path.canonicalize() {
        return path;
    }
    let settled = tidy(&absolute(path).unwrap_or_else(|_| path.to_owned()));
    match (settled.parent().map(Path::canonicalize), settled.file_name()) {
        (Some(Ok(folder)), Some(name)) => folder.join(name),
        _ => settled,
    }
}

/// The way from a folder to a file; the file's own path where they have nothing in common.
fn relative(path: &Path, folder: &Path) -> PathBuf {
    let common = path.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return path.to_owned();
    }
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    up.chain(path.components().skip(common)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_lead_from_the_scene_to_the_file() {
        for (path, folder, way) in
            [("/a/b/c.ply", "/a/b", "c.ply"), ("/a/b/c.ply", "/a/d/e", "../../b/c.ply"), ("/c.ply", "/", "c.ply")]
        {
            assert_eq!(relative(Path::new(path), Path::new(folder)), Path::new(way));
        }
    }

    #[test]
    fn no_two_files_have_the_same_name() {
        let folder = tempfile::tempdir().unwrap();
        let files = Files::new(&folder.path().join("out.xml"));
        let names: Vec<_> =
            ["a b", "a/b", "a-b", "", "../..", "A B"].iter().map(|stem| files.mesh(stem, &Mesh::default())).collect();
        assert_eq!(names[0], "out-files/a-b.ply");
        assert_eq!(names[1], "out-files/a-b--2.ply");
        assert_eq!(names[3], "out-files/unnamed.ply");
        let made = files.settle().unwrap();
        assert_eq!(made.len(), names.len());
        assert!(names.iter().all(|name| made.contains(&folder.path().join(name))));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "only the folder stays");
    }

    #[test]
    fn nothing_is_left_of_a_conversion_that_is_given_up() {
        let folder = tempfile::tempdir().unwrap();
        let files = Files::new(&folder.path().join("out.xml"));
        files.mesh("a", &Mesh::default());
        drop(files);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
