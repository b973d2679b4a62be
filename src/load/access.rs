//! Which files a scene may have read.
//!
//! A scene file names others: meshes, pictures, files that it includes. Whoever renders a scene of somebody else's wants to
//! know what it reads. So only files are read, no devices or pipes, and from outside of the scene's folder only what the
//! scene names plainly, or nothing at all with [`Reach::Confined`].

use std::fs;
use std::path::{Component, Path, PathBuf};

/// How far from its folder the names in a scene may lead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reach {
    /// Into its folder and below; elsewhere where the name stands in the scene as it is, or comes from `-D`, and says itself
    /// that it leads out: not by a link in the folder, a `<default>` or a character reference.
    #[default]
    Plain,
    /// Into its folder and below.
    Confined,
}

impl Reach {
    /// What `--confine` says.
    pub fn confined(is_confined: bool) -> Reach {
        if is_confined { Reach::Confined } else { Reach::Plain }
    }
}

/// The rule for one scene.
#[derive(Clone, Debug)]
pub(crate) struct Access {
    /// The folder of the scene file, without links; as it was given where it does not exist.
    home: PathBuf,
    reach: Reach,
}

impl Access {
    /// Of a scene file in that folder.
    pub fn new(folder: &Path, reach: Reach) -> Access {
        Access { home: real(folder).unwrap_or_else(|| folder.to_owned()), reach }
    }

    /// The path of a file that is named in a folder, or in a sentence why it is not read. `is_plain` tells whether the name
    /// stands in the scene as it is. Whether there is such a file is found out by who opens it.
    pub fn file(&self, folder: &Path, name: &str, is_plain: bool) -> Result<PathBuf, String> {
        let path = folder.join(name);
        let refused = |why: &str| Err(format!("{} is not read: {why}", path.display()));
        if !self.is_within(&path) {
            let written = real(folder).map(|folder| tidy(&folder.join(name)));
            let says_so = written.as_ref().is_some_and(|written| !written.starts_with(&self.home));
            if self.reach == Reach::Confined {
                return refused("it is outside of the scene's folder, which --confine forbids");
            }
            if !says_so || written.is_some_and(|written| written.canonicalize().ok() != path.canonicalize().ok()) {
                return refused("a link leads out of the scene's folder; name the file that it leads to");
            }
            if !is_plain {
                return refused(
                    "it is outside of the scene's folder, and the scene does not name it plainly; write the name where the \
                     file is asked for, without a <default> or &, or give it with -D",
                );
            }
        }
        match fs::metadata(&path) {
            Ok(found) if !found.is_file() && !found.is_dir() => refused("it is a device or a pipe; accepted: files"),
            _ => Ok(path),
        }
    }

    /// Whether a file is in the scene's folder, all links followed; of one that is not there, whether it would be.
    fn is_within(&self, path: &Path) -> bool {
        if let Ok(path) = path.canonicalize() {
            return path.starts_with(&self.home);
        }
        let folder = path.parent().and_then(real);
        // of a folder that is not there nothing can be read either
        folder.unwrap_or_else(|| tidy(&self.home.join(path))).starts_with(&self.home)
    }
}

/// A folder without links, if it exists; the empty path is the folder that the process is in.
fn real(folder: &Path) -> Option<PathBuf> {
    if folder == Path::new("") { Path::new(".") } else { folder }.canonicalize().ok()
}

/// The path with every `name/..` taken out by its letters, whatever is a link.
pub(crate) fn tidy(path: &Path) -> PathBuf {
    let mut tidied = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => drop(tidied.pop()),
            part => tidied.push(part),
        }
    }
    tidied
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder `scene` with `in.obj` and `deep/in.obj`, beside it `out.obj`.
    fn folders() -> tempfile::TempDir {
        let around = tempfile::tempdir().unwrap();
        fs::create_dir_all(around.path().join("scene/deep")).unwrap();
        for file in ["scene/in.obj", "scene/deep/in.obj", "out.obj"] {
            fs::write(around.path().join(file), "").unwrap();
        }
        around
    }

    /// What becomes of a name with either reach, named plainly or not.
    fn outcomes(around: &Path, name: &str) -> [bool; 3] {
        let folder = around.join("scene");
        let is_read = |reach, is_plain| Access::new(&folder, reach).file(&folder, name, is_plain).is_ok();
        [is_read(Reach::Plain, true), is_read(Reach::Plain, false), is_read(Reach::Confined, true)]
    }

    #[test]
    fn what_is_in_the_folder_is_read_however_it_is_named() {
        let around = folders();
        let absolute = around.path().join("scene/in.obj").display().to_string();
        let names = ["in.obj", "./in.obj", "deep/in.obj", "deep/../in.obj", "../scene/in.obj", "absent.obj", &absolute];
        for name in names {
            assert_eq!(outcomes(around.path(), name), [true; 3], "{name}");
        }
    }

    #[test]
    fn what_is_outside_is_read_where_it_is_named_plainly_and_nothing_is_confined() {
        let around = folders();
        let absolute = around.path().join("out.obj").display().to_string();
        for name in ["../out.obj", "deep/../../out.obj", "../absent.obj", &absolute] {
            assert_eq!(outcomes(around.path(), name), [true, false, false], "{name}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_lead_out_of_no_scene() {
        use std::os::unix::fs::symlink;
        let around = folders();
        let scene = around.path().join("scene");
        symlink("../out.obj", scene.join("file")).unwrap();
        symlink("..", scene.join("folder")).unwrap();
        symlink("deep", scene.join("inside")).unwrap();
        for name in ["file", "folder/out.obj", "deep/../file", "folder/absent.obj"] {
            assert_eq!(outcomes(around.path(), name), [false; 3], "{name}");
        }
        assert_eq!(outcomes(around.path(), "inside/in.obj"), [true; 3]);
        // the scene's own folder may be reached by a link
        symlink(&scene, around.path().join("link")).unwrap();
        let link = around.path().join("link");
        assert!(Access::new(&link, Reach::Confined).file(&link, "in.obj", false).is_ok());
    }

    #[cfg(unix)]
    #[test]
    fn devices_are_no_files() {
        let fault = Access::new(Path::new("/"), Reach::Confined).file(Path::new("/"), "dev/zero", true).unwrap_err();
        assert_eq!(fault, "/dev/zero is not read: it is a device or a pipe; accepted: files");
    }
}
