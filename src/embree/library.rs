//! Finding and loading the shared library of Embree.
//!
//! In this order: the environment variable `RELT_EMBREE` (the library, or a folder that holds it), the system's
//! library by the loader's own search, and the one that the build found or obtained (see `build.rs`). The variable
//! is a person's word: if it is wrong, that is an error and no other library is tried behind their back. The other
//! places are passed over where they hold nothing usable, and the error lists why.

use super::ffi::{Functions, PROPERTY_VERSION, VersionFunctions};
use libloading::Library;
use std::env;
use std::ffi::OsString;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Names an environment variable with the path of the library or of the folder that holds it.
pub const VARIABLE: &str = "RELT_EMBREE";

/// Names under which the loader finds an installed Embree 4.
#[cfg(target_os = "macos")]
const SYSTEM_NAMES: [&str; 2] = ["libembree4.4.dylib", "libembree4.dylib"];
#[cfg(windows)]
const SYSTEM_NAMES: [&str; 1] = ["embree4.dll"];
#[cfg(not(any(target_os = "macos", windows)))]
const SYSTEM_NAMES: [&str; 2] = ["libembree4.so.4", "libembree4.so"];

/// What the build found or obtained, and otherwise what kept it from that; set by `build.rs`.
const BUILT: Option<&str> = option_env!("RELT_EMBREE_BUILT");
const BUILD_NOTE: Option<&str> = option_env!("RELT_EMBREE_NOTE");

/// The oldest version whose hits have the layout of `ffi`, and the first version that may differ again; counted as
/// Embree does, 10000 · major + 100 · minor + patch.
const OLDEST: u32 = 40300;
const TOO_NEW: u32 = 50000;

/// What keeps us from tracing rays; the messages are for the person at the keyboard.
#[derive(Debug, thiserror::Error)]
pub enum EmbreeError {
    /// `RELT_EMBREE` does not lead to a usable library.
    #[error(
        "RELT_EMBREE={}: {reason}\nRELT_EMBREE takes the path of the shared library of Embree 4.3 or newer \
         (libembree4.so.4), or of the folder that holds it; unset it to use the system's library", .value.display()
    )]
    Variable {
        /// The variable's value.
        value: PathBuf,
        /// Why it cannot be used.
        reason: Unusable,
    },
    /// No place holds a usable library.
    #[error("relt needs Embree 4.3 or newer and found none.\n{}\n{INSTALL}", list(.tried))]
    NotFound {
        /// Every place that was tried, and why it is of no use.
        tried: Vec<(PathBuf, Unusable)>,
    },
    /// Embree refused to start.
    #[error("Embree did not start with the options {config:?}: {reason}")]
    Device {
        /// The options given to `rtcNewDevice`.
        config: String,
        /// Embree's error code in words.
        reason: &'static str,
    },
    /// Embree could not build its hierarchy.
    #[error("Embree could not build a scene of {geometries} shapes: {reason}")]
    Scene {
        /// Number of shapes.
        geometries: usize,
        /// Embree's error code in words.
        reason: &'static str,
    },
}

/// Why a library is of no use.
#[derive(Debug, thiserror::Error)]
pub enum Unusable {
    /// Nothing of that name.
    #[error("there is no such file or folder")]
    Missing,
    /// The folder holds no library of Embree 4.
    #[error("the folder holds no libembree4")]
    EmptyFolder,
    /// The loader refuses it.
    #[error("it cannot be loaded: {0}")]
    Unloadable(String),
    /// A library of something else.
    #[error("it is not Embree 4: the function {0} is missing")]
    NotEmbree(&'static str),
    /// It has all functions but does not start.
    #[error("it does not start on this machine: {0}")]
    NoDevice(&'static str),
    /// An older generation with other structures.
    #[error("it is Embree {0}, and relt needs Embree 4.3 or newer; the two differ and can be installed side by side")]
    OldGeneration(Version),
    /// Versions of Embree 4 whose hits have one field less.
    #[error("it is Embree {0}, and relt needs 4.3 or newer: up to 4.2 Embree lays its hits out differently")]
    OldRelease(Version),
    /// A generation that did not exist when this was written.
    #[error("it is Embree {0}, and relt knows only Embree 4, from 4.3 on")]
    NewGeneration(Version),
}

const INSTALL: &str = "\
To install it:
  Debian 13, Ubuntu 24.04 or newer   apt-get install libembree4-4
  Debian 12, Ubuntu 22.04            apt-get install python3-pip, then build relt again: the build obtains Embree
  Fedora, Arch, openSUSE             the package embree
  any other                          unpack a release of Embree 4.3 or newer from
                                     https://github.com/RenderKit/embree/releases and set RELT_EMBREE to its folder";

fn list(tried: &[(PathBuf, Unusable)]) -> String {
    let mut lines: Vec<String> =
        tried.iter().map(|(path, reason)| format!("  tried {}: {reason}", path.display())).collect();
    lines.extend(BUILD_NOTE.map(|note| format!("  when relt was built: {note}")));
    lines.join("\n")
}

/// Embree's version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Version(pub u32);

impl Version {
    /// Major, minor, patch.
    pub fn parts(self) -> (u32, u32, u32) {
        (self.0 / 10000, self.0 / 100 % 100, self.0 % 100)
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (major, minor, patch) = self.parts();
        write!(f, "{major}.{minor}.{patch}")
    }
}

/// Where a library came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// `RELT_EMBREE`.
    Variable,
    /// The loader's own search.
    System,
    /// Found or obtained by the build.
    Build,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Origin::Variable => "named by RELT_EMBREE",
            Origin::System => "the system's",
            Origin::Build => "found when relt was built",
        })
    }
}

/// A loaded library that suits us. It is never unloaded: its threads and static destructors outlive our handles.
pub struct Embree {
    pub starting: VersionFunctions,
    pub tracing: Functions,
    pub version: Version,
    pub path: PathBuf,
    pub origin: Origin,
}

/// The library of this process, found and loaded by the first call.
pub fn embree() -> Result<&'static Embree, EmbreeError> {
    static FOUND: OnceLock<Embree> = OnceLock::new();
    if let Some(found) = FOUND.get() {
        return Ok(found);
    }
    let found = find(env::var_os(VARIABLE).filter(|value| !value.is_empty()), &SYSTEM_NAMES, BUILT)?;
    Ok(FOUND.get_or_init(|| found)) // a race costs a second handle of the same library
}

/// The first usable library: the one the variable names, or the system's, or the build's.
pub fn find(variable: Option<OsString>, system: &[&str], built: Option<&str>) -> Result<Embree, EmbreeError> {
    if let Some(value) = variable {
        let value = PathBuf::from(value);
        return library_at(&value)
            .and_then(|path| load(&path, Origin::Variable))
            .map_err(|reason| EmbreeError::Variable { value, reason });
    }
    let system = system.iter().map(|name| (PathBuf::from(name), Origin::System));
    let built = built.iter().map(|path| (PathBuf::from(path), Origin::Build));
    let mut tried = Vec::new();
    for (path, origin) in system.chain(built) {
        match load(&path, origin) {
            Ok(embree) => return Ok(embree),
            Err(reason) => tried.push((path, reason)),
        }
    }
    Err(EmbreeError::NotFound { tried })
}

/// The library that a person's path means: itself, or one in that folder or its `lib`.
fn library_at(path: &Path) -> Result<PathBuf, Unusable> {
    if !path.exists() {
        return Err(Unusable::Missing);
    }
    if !path.is_dir() {
        return path.canonicalize().map_err(|error| Unusable::Unloadable(error.to_string()));
    }
    let folders = [path.to_path_buf(), path.join("lib"), path.join("lib64"), path.join("bin")];
    let exact = folders.iter().flat_map(|folder| SYSTEM_NAMES.map(|name| folder.join(name)));
    let hashed = folders.iter().filter_map(|folder| {
        // Python wheels put a hash into the name: libembree4-4aef3270.so.4.
        let names = fs::read_dir(folder).ok()?.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        let name = names.filter(|name| name.starts_with("libembree4") && !name.contains("sycl")).min()?;
        Some(folder.join(name))
    });
    let found = exact.chain(hashed).find(|file| file.is_file()).ok_or(Unusable::EmptyFolder)?;
    found.canonicalize().map_err(|error| Unusable::Unloadable(error.to_string()))
}

fn load(path: &Path, origin: Origin) -> Result<Embree, Unusable> {
    // SAFETY: loading runs the library's initialisers. That code is trusted as any system library is: the path comes
    // from the person who runs us, the system's loader or our own build.
    let library = unsafe { Library::new(path) }.map_err(|error| Unusable::Unloadable(loader_message(&error)))?;
    // SAFETY: these functions have had these signatures since Embree 3, and the library is never unloaded (below).
    let starting = unsafe { VersionFunctions::load(&library) }.map_err(Unusable::NotEmbree)?;
    let version = ask_version(&starting)?;
    check(version)?;
    // SAFETY: the version was checked, `ffi` declares that version, and the library is never unloaded (below).
    let tracing = unsafe { Functions::load(&library) }.map_err(Unusable::NotEmbree)?;
    std::mem::forget(library);
    Ok(Embree { starting, tracing, version, path: path.to_path_buf(), origin })
}

fn check(version: Version) -> Result<(), Unusable> {
    match version.0 {
        ..40000 => Err(Unusable::OldGeneration(version)),
        40000..OLDEST => Err(Unusable::OldRelease(version)),
        OLDEST..TOO_NEW => Ok(()),
        TOO_NEW.. => Err(Unusable::NewGeneration(version)),
    }
}

/// The loader's own words: `libloading` puts them into the source of its error.
fn loader_message(error: &libloading::Error) -> String {
    std::error::Error::source(error).map_or_else(|| error.to_string(), |source| source.to_string())
}

fn ask_version(functions: &VersionFunctions) -> Result<Version, Unusable> {
    // SAFETY: the options are a C string; the device is checked before it is used, and released once.
    unsafe {
        let device = (functions.new_device)(c"threads=1,set_affinity=0".as_ptr());
        if device.is_null() {
            return Err(Unusable::NoDevice(error_in_words((functions.device_error)(device))));
        }
        let version = (functions.device_property)(device, PROPERTY_VERSION);
        (functions.release_device)(device);
        Ok(Version(u32::try_from(version).unwrap_or(0)))
    }
}

/// `RTCError` in words.
pub fn error_in_words(code: i32) -> &'static str {
    match code {
        0 => "no error was reported",
        2 => "invalid argument",
        3 => "invalid operation",
        4 => "out of memory",
        5 => "this processor is not supported: Embree needs at least SSE2, and the options may ask for more",
        6 => "cancelled",
        _ => "unknown error",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What [`find`] says for these places; finding something is not an answer.
    fn complaint(variable: Option<&str>, system: &[&str], built: Option<&str>) -> String {
        match find(variable.map(OsString::from), system, built) {
            Ok(found) => panic!("found {}", found.path.display()),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn no_embree_anywhere_says_where_we_looked_and_how_to_install_it() {
        let said = complaint(None, &["libnowhere.so.4"], Some("/nowhere/libembree4.so.4"));
        assert!(said.contains("tried libnowhere.so.4: it cannot be loaded"), "{said}");
        assert!(said.contains("tried /nowhere/libembree4.so.4: it cannot be loaded"), "{said}");
        assert!(said.contains("apt-get install libembree4-4") && said.contains("RELT_EMBREE"), "{said}");
    }

    #[test]
    fn a_wrong_variable_is_an_error_even_where_the_system_has_embree() {
        let said = complaint(Some("/nowhere"), &SYSTEM_NAMES, BUILT);
        assert!(said.starts_with("RELT_EMBREE=/nowhere: there is no such file or folder"), "{said}");
    }

    #[test]
    fn another_library_is_told_from_embree() {
        let libc = "libc.so.6";
        assert!(complaint(None, &[libc], None).contains("it is not Embree 4: the function rtcNewDevice is missing"));
    }

    #[test]
    fn old_and_future_versions_get_a_message_of_their_own() {
        let said = |version| check(Version(version)).unwrap_err().to_string();
        assert!(said(31305).starts_with("it is Embree 3.13.5, and relt needs Embree 4.3 or newer"));
        assert!(said(40200).starts_with("it is Embree 4.2.0, and relt needs 4.3 or newer"));
        assert!(said(50000).starts_with("it is Embree 5.0.0, and relt knows only Embree 4"));
        assert!([40300, 40303, 40400, 49999].into_iter().all(|version| check(Version(version)).is_ok()));
    }

    #[test]
    fn a_folder_leads_to_the_library_in_it_or_in_its_lib_whatever_its_hash() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(library_at(folder.path()), Err(Unusable::EmptyFolder)));
        fs::create_dir(folder.path().join("lib")).unwrap();
        let hashed = folder.path().join("lib/libembree4-0123abcd.so.4");
        fs::write(&hashed, "").unwrap();
        assert_eq!(library_at(folder.path()).unwrap(), hashed.canonicalize().unwrap());
    }
}
