//! Files that appear whole or not at all.

use std::fmt;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

/// Why an image file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system refused to write.
    #[error("cannot write {path}: {reason}", path = .path.display())]
    Write {
        /// The file meant.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// The system refused to read, or the content is not what it should be.
    #[error("cannot read {path}: {reason}", path = .path.display())]
    Read {
        /// The file meant.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

impl FileError {
    /// A failure to write `path`.
    pub fn write(path: &Path, reason: impl ToString) -> FileError {
        FileError::Write { path: path.to_owned(), reason: reason.to_string() }
    }

    /// A failure to read `path`.
    pub fn read(path: &Path, reason: impl ToString) -> FileError {
        FileError::Read { path: path.to_owned(), reason: reason.to_string() }
    }
}

/// Writes a file under a temporary name beside `path` and renames it once everything is on the disk: a reader,
/// or a machine that loses its power, sees the old file or the new one, never a part.
pub fn write_whole(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), String>,
) -> Result<(), FileError> {
    let failed = |reason: String| FileError::write(path, reason);
    let mut temporary = create_beside(path)?;
    let mut writer = BufWriter::new(temporary.as_file_mut());
    content(&mut writer).map_err(failed)?;
    writer.flush().map_err(|error| failed(plain(&error)))?;
    drop(writer);
    temporary.as_file().sync_all().map_err(|error| failed(plain(&error)))?;
    temporary.persist(path).map_err(|error| failed(plain(&error.error)))?;
    Ok(())
}

/// As [`write_whole`], for files that are long in the writing, and written again and again: the one that was there is kept
/// as `previous`, and what a killed process left half written is gone with the next one instead of adding up.
pub fn write_whole_and_keep(
    path: &Path,
    previous: &Path,
    content: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> Result<(), FileError> {
    let failed = |error: &io::Error| FileError::write(path, plain(error));
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".unfinished");
    let _ = std::fs::remove_file(path.with_file_name(&name)); // mostly it is not there
    let mut builder = Builder::new();
    builder.prefix(&name).rand_bytes(0);
    let mut temporary = create_named(path, &mut builder)?;
    let mut writer = BufWriter::with_capacity(1 << 20, temporary.as_file_mut());
    content(&mut writer).and_then(|()| writer.flush()).map_err(|error| failed(&error))?;
    drop(writer);
    temporary.as_file().sync_all().map_err(|error| failed(&error))?;
    match std::fs::rename(path, previous) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(FileError::write(previous, plain(&error))),
        _ => {}
    }
    temporary.persist(path).map_err(|error| failed(&error.error))?;
    Ok(())
}

/// A file that could not be written where it was wanted.
#[derive(Debug)]
pub struct Misplaced {
    /// Why not.
    pub error: FileError,
    /// Where it is instead, or why it is nowhere.
    pub instead: Result<PathBuf, FileError>,
}

impl fmt::Display for Misplaced {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let error = &self.error;
        match &self.instead {
            Ok(path) => write!(f, "{error}; it is in {} instead", path.display()),
            Err(other) => write!(f, "{error}; nor elsewhere: {other}"),
        }
    }
}

/// Writes a file that would be lost otherwise with the work that is in it: where `path` is refused, into a new folder among
/// the system's temporary files, under the same name. `write` is given the path.
pub fn write_somewhere(path: &Path, write: impl Fn(&Path) -> Result<(), FileError>) -> Result<(), Misplaced> {
    let Err(error) = write(path) else { return Ok(()) };
    let name = path.file_name().unwrap_or_default();
    let temporary = std::env::temp_dir();
    let instead = Builder::new()
        .prefix("relt-")
        .tempdir_in(&temporary)
        .map_err(|error| FileError::write(&temporary.join(name), plain(&error)))
        .and_then(|folder| {
            let other = folder.path().join(name);
            write(&other)?;
            drop(folder.keep()); // a path: the folder stays
            Ok(other)
        });
    Err(Misplaced { error, instead })
}

/// Finds out now whether [`write_whole`] will be able to write `path`; leaves nothing behind.
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    create_beside(path).map(drop)
}

/// A file that no other relt writes as long as this lives; see [`claim`].
#[derive(Debug)]
pub struct Claim {
    lock: PathBuf,
    _file: File,
}

/// Claims a file for this process, by a lock on `.NAME.lock` beside it, which the system gives back whatever becomes of the
/// process. `None` where the file system has no locks.
pub fn claim(path: &Path) -> Result<Option<Claim>, FileError> {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".lock");
    let lock = path.with_file_name(name);
    loop {
        let Ok(file) = OpenOptions::new().write(true).create(true).truncate(false).open(&lock) else {
            return Ok(None);
        };
        match file.try_lock() {
            // who had it before may have taken it away in the meantime
            Ok(()) if is_at(&file, &lock) => return Ok(Some(Claim { lock, _file: file })),
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(FileError::write(path, "another relt is at work on it"));
            }
            Err(TryLockError::Error(_)) => return Ok(None),
        }
    }
}

/// Whether the path still leads to the file.
fn is_at(file: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let place = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
        file.metadata().map(place).ok() == path.metadata().map(place).ok()
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        path.exists()
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        drop(std::fs::remove_file(&self.lock)); // left behind it would only be in the way of eyes
    }
}

fn create_beside(path: &Path) -> Result<NamedTempFile, FileError> {
    create_named(path, Builder::new().prefix(".relt-").suffix(".tmp"))
}

/// A temporary file in the folder of `path`, of the name that the builder is set to.
fn create_named(path: &Path, builder: &mut Builder) -> Result<NamedTempFile, FileError> {
    if path.is_dir() {
        return Err(FileError::write(path, "it is a folder"));
    }
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    #[cfg(unix)]
    {
        // A temporary file is its owner's alone by default; what it becomes should be as any other file.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => FileError::write(path, format_args!("there is no folder {}", folder.display())),
        _ => FileError::write(path, plain(&error)),
    })
}

/// The system's words without the name of the temporary file, which would only confuse.
pub fn plain(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::PermissionDenied => "permission denied".into(),
        io::ErrorKind::StorageFull => "the disk is full".into(),
        io::ErrorKind::QuotaExceeded => "the quota of disk space is used up".into(),
        io::ErrorKind::FileTooLarge => "it is larger than files may be here (ulimit -f, or the file system)".into(),
        io::ErrorKind::ReadOnlyFilesystem => "the file system is read-only".into(),
        io::ErrorKind::NotADirectory => "a part of its path is not a folder".into(),
        io::ErrorKind::InvalidFilename => "its name is too long or not allowed".into(),
        _ => error.get_ref().map_or_else(|| error.to_string(), ToString::to_string),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_finds_no_place_is_put_among_temporary_files_and_told_where() {
        let folder = tempfile::tempdir().unwrap();
        let write = |path: &Path| write_whole(path, |file| file.write_all(b"work").map_err(|error| error.to_string()));
        let good = folder.path().join("good");
        write_somewhere(&good, write).unwrap();
        assert_eq!(std::fs::read(&good).unwrap(), b"work");
        let misplaced = write_somewhere(&folder.path().join("nowhere/a.exr"), write).unwrap_err();
        let told = misplaced.to_string();
        let instead = misplaced.instead.unwrap();
        assert!(told.contains("there is no folder") && told.contains(&instead.display().to_string()), "{told}");
        assert_eq!((std::fs::read(&instead).unwrap(), instead.file_name()), (b"work".to_vec(), Some("a.exr".as_ref())));
        std::fs::remove_dir_all(instead.parent().unwrap()).unwrap();
    }

    #[test]
    fn what_finds_no_place_anywhere_leaves_nothing_behind() {
        let tried = std::cell::RefCell::new(Vec::new());
        let refuse = |path: &Path| {
            tried.borrow_mut().push(path.to_owned());
            Err(FileError::write(path, "the disk is full"))
        };
        let told = write_somewhere(Path::new("a.exr"), refuse).unwrap_err().to_string();
        assert!(told.starts_with("cannot write a.exr: the disk is full; nor elsewhere: cannot write /"), "{told}");
        let [wanted, other] = &tried.borrow()[..] else { panic!("two places") };
        assert!(wanted == Path::new("a.exr") && !other.parent().unwrap().exists(), "{}", other.display());
    }
}
