//! Makes sure that there is an Embree 4 to load when relt runs, without root and without failing the build.
//!
//! It takes what `RELT_EMBREE` names, or relies on the system's library, or on a copy that an earlier build
//! obtained, and otherwise obtains a pinned wheel from PyPI with pip, which checks its hash. Without pip or network
//! the build goes on with a warning, and relt says at its start how to install Embree. `RELT_EMBREE_FETCH=0`
//! switches the obtaining off.
//!
//! The crate gets `RELT_EMBREE_BUILT`, the library to fall back on where the loader finds none, or
//! `RELT_EMBREE_NOTE`, the reason why there is none. `src/embree/library.rs` reads both.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, SystemTime};

const LOCATION: &str = "RELT_EMBREE";
const FETCH: &str = "RELT_EMBREE_FETCH";

/// The wheel holds Embree 4.4.0 and its TBB and runs on any Linux with glibc ≥ 2.27; of Python itself, neither
/// library needs anything, so its version does not matter.
const WHEEL: &str = "embreex==4.4.0.post1";
const WHEEL_SHA256: &str = "2cd0f7d5c6342e6247e31f700761689cae7829454d8c6de0c41e62124a023e1f";
const WHEEL_TAGS: [&str; 10] = [
    "--python-version",
    "3.11",
    "--implementation",
    "cp",
    "--abi",
    "cp311",
    "--platform",
    "manylinux_2_27_x86_64",
    "--platform",
    "manylinux_2_28_x86_64",
];
const FOLDER: &str = "embree-4.4.0.post1";
const IN_WHEEL: [&str; 2] = ["embreex.libs/libembree4-4aef3270.so.4", "embreex.libs/libtbb-dcf63f8c.so.12"];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed={LOCATION}");
    println!("cargo:rerun-if-env-changed={FETCH}");
    match find() {
        Ok(library) => {
            println!("cargo:rerun-if-changed={}", library.display()); // also when it disappears
            println!("cargo:rustc-env=RELT_EMBREE_BUILT={}", library.display());
        }
        Err(why) => {
            println!("cargo:warning=Embree 4 is not installed: {why}. relt will say at its start how to install it.");
            println!("cargo:rustc-env=RELT_EMBREE_NOTE={why}");
        }
    }
}

fn find() -> Result<PathBuf, String> {
    if let Some(library) = named() {
        return library;
    }
    if let Some(library) = system() {
        return Ok(library);
    }
    let folder = shared_target_folder().join(FOLDER);
    if let Some(library) = unpacked(&folder) {
        return Ok(library);
    }
    if !wheel_fits_target() {
        return Err("the build obtains it only for Linux on x86-64 with glibc".to_owned());
    }
    if switched_off() {
        return Err(format!("{FETCH} keeps the build from obtaining it"));
    }
    // A path that is not there makes Cargo run this again with the next build.
    println!("cargo:rerun-if-changed={}", folder.join(IN_WHEEL[0]).display());
    obtain(&folder)
}

/// What `RELT_EMBREE` names, if it is set. The search within a folder is that of `src/embree/library.rs`, which
/// also is what complains if it is wrong when relt runs.
fn named() -> Option<Result<PathBuf, String>> {
    let value = PathBuf::from(env::var_os(LOCATION).filter(|value| !value.is_empty())?);
    let folders = [value.clone(), value.join("lib"), value.join("lib64")];
    let inside = folders.iter().filter_map(|folder| first_embree_in(folder));
    let found = Some(value.clone()).filter(|value| value.is_file()).into_iter().chain(inside).next();
    let absolute = found.and_then(|file| file.canonicalize().ok());
    Some(absolute.ok_or_else(|| format!("{LOCATION}={} holds no libembree4", value.display())))
}

fn first_embree_in(folder: &Path) -> Option<PathBuf> {
    let files = fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path()));
    files.filter(|file| file.file_name().is_some_and(|n| n.to_string_lossy().starts_with("libembree4"))).min()
}

/// The system's library, if relt is to run on this system.
fn system() -> Option<PathBuf> {
    if env::var("HOST") != env::var("TARGET") {
        return None;
    }
    let multiarch = format!("/usr/lib/{}-linux-gnu", env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default());
    let usual = [&multiarch, "/usr/lib64", "/usr/lib", "/usr/local/lib64", "/usr/local/lib", "/opt/homebrew/lib"];
    let names = ["libembree4.so.4", "libembree4.so", "libembree4.4.dylib", "libembree4.dylib"];
    let in_usual = usual.iter().flat_map(|folder| names.map(|name| Path::new(folder).join(name)));
    in_usual.chain(known_to_the_loader()).find(|file| file.exists())
}

/// From lines of `ldconfig -p` such as "libembree4.so.4 (libc6,x86-64) => /usr/lib64/libembree4.so.4".
fn known_to_the_loader() -> Vec<PathBuf> {
    let listing =
        ["ldconfig", "/sbin/ldconfig"].iter().find_map(|ldconfig| output(Command::new(ldconfig).arg("-p")).ok());
    let listing = listing.unwrap_or_default();
    let lines = listing.lines().filter(|line| line.trim_start().starts_with("libembree4.so"));
    lines.filter_map(|line| Some(PathBuf::from(line.split_once(" => ")?.1))).collect()
}

/// The folder that all profiles share, `target` by default: Cargo marks it. Where it does not, our own folder.
fn shared_target_folder() -> PathBuf {
    let out = out_dir();
    let marked = out.ancestors().find(|folder| folder.join("CACHEDIR.TAG").exists());
    marked.unwrap_or(&out).to_path_buf()
}

fn out_dir() -> PathBuf {
    PathBuf::from(env::var_os("OUT_DIR").expect("Cargo sets OUT_DIR"))
}

fn unpacked(folder: &Path) -> Option<PathBuf> {
    let complete = IN_WHEEL.iter().all(|file| folder.join(file).is_file());
    complete.then(|| folder.join(IN_WHEEL[0]))
}

fn wheel_fits_target() -> bool {
    let is = |key: &str, value: &str| env::var(key).as_deref() == Ok(value);
    is("CARGO_CFG_TARGET_OS", "linux") && is("CARGO_CFG_TARGET_ARCH", "x86_64") && is("CARGO_CFG_TARGET_ENV", "gnu")
}

fn switched_off() -> bool {
    let value = env::var(FETCH).unwrap_or_default().to_lowercase();
    ["0", "off", "no", "false"].contains(&value.as_str())
}

/// Downloads and unpacks the wheel beside its final place, then renames: a build that is killed leaves nothing
/// half done, and of two builds at a time the second finds the first one's.
fn obtain(folder: &Path) -> Result<PathBuf, String> {
    let before = SystemTime::now() - Duration::from_secs(2); // Cargo took its time stamp a moment ago
    let work = out_dir().join("wheel"); // ours alone: Cargo lets no two builds share it
    let _ = fs::remove_dir_all(&work);
    let unpacking = work.join("unpacked");
    fs::create_dir_all(&unpacking).map_err(|error| format!("{}: {error}", unpacking.display()))?;
    download(&work)?;
    let wheel = fs::read_dir(&work).ok().and_then(|entries| {
        entries.filter_map(|entry| Some(entry.ok()?.path())).find(|path| path.extension().is_some_and(|e| e == "whl"))
    });
    let wheel = wheel.ok_or("pip downloaded no wheel")?;
    let unzip = |python| output(Command::new(python).args(["-m", "zipfile", "-e"]).arg(&wheel).arg(&unpacking));
    unzip("python3").or_else(|_| unzip("python")).map_err(|why| format!("the wheel cannot be unpacked: {why}"))?;
    date_back(&unpacking.join(IN_WHEEL[0]), before);
    let _ = fs::rename(&unpacking, folder); // fails if another build was faster
    let _ = fs::remove_dir_all(&work);
    unpacked(folder)
        .ok_or_else(|| format!("{WHEEL} does not hold what it should, or cannot be moved to {}", folder.display()))
}

/// Dates a file back to before this script began: Cargo would run the script again for a newer one. No further back,
/// so that a build of another profile that went without notices it.
fn date_back(file: &Path, time: SystemTime) {
    let _ = fs::File::options().append(true).open(file).and_then(|file| file.set_modified(time));
}

/// Any pip will do; what matters is the hash.
fn download(work: &Path) -> Result<(), String> {
    let requirements = work.join("requirements.txt");
    fs::write(&requirements, format!("{WHEEL} --hash=sha256:{WHEEL_SHA256}\n"))
        .map_err(|error| format!("{}: {error}", requirements.display()))?;
    let mut failure = "there is no pip to obtain it with".to_owned();
    for pip in [&["pip"][..], &["pip3"], &["python3", "-m", "pip"]] {
        let mut command = Command::new(pip[0]);
        command.args(&pip[1..]).args(["download", "--quiet", "--disable-pip-version-check", "--no-input"]);
        command.args(["--retries", "2", "--timeout", "20", "--no-deps", "--only-binary=:all:", "--require-hashes"]);
        command.args(WHEEL_TAGS).arg("--dest").arg(work).arg("--requirement").arg(&requirements);
        match output(&mut command) {
            Ok(_) => return Ok(()),
            Err(why) if why.contains("No module named pip") || why.contains("os error 2") => {}
            Err(why) => failure = format!("{} could not obtain {WHEEL}: {why}", pip.join(" ")),
        }
    }
    Err(failure)
}

/// Standard output of a command that succeeds, or the last line of its complaint.
fn output(command: &mut Command) -> Result<String, String> {
    let output = command.output().map_err(|error| error.to_string())?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let complaint = String::from_utf8_lossy(&output.stderr);
    let last = complaint.lines().map(str::trim).rfind(|line| !line.is_empty());
    Err(last.map_or_else(|| output.status.to_string(), str::to_owned))
}
