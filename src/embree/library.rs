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
    match version.0 {
        ..40000 => return Err(Unusable::OldGeneration(version)),
        40000..OLDEST => return Err(Unusable::OldRelease(version)),
        TOO_NEW.. => return Err(Unusable::NewGeneration(version)),
        OLDEST..TOO_NEW => {}
    }
    // SAFETY: the version was checked, `ffi` declares that version, and the library is never unloaded (below).
    let tracing = unsafe { Functions::load(&library) }.map_err(Unusable::NotEmbree)?;
    std::mem::forget(library);
    Ok(Embree { starting, tracing, version, path: path.to_path_buf(), origin })
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
