//! The program as a process, and what it leaves behind.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use relt::film::{Plane, exr_file};

/// `relt render` on one of the scenes at 24 × 24 pixels.
pub fn render(folder: &Path, scene: &str, options: &[&str]) -> Command {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene).join("scene.xml");
    let mut command = relt(folder, &["render"]);
    command.arg(file).args(["-D", "res=24"]).args(options);
    command
}

/// `relt` with those arguments.
pub fn relt(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relt"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Runs it to the end, which must be a good one; what it said.
pub fn done(command: &mut Command) -> String {
    ended(command, 0)
}

/// Runs it to the end, which must come with that exit code; what it said.
pub fn ended(command: &mut Command, code: i32) -> String {
    said(command.output().unwrap(), code)
}

/// What it said, and that with that exit code and without a panic.
pub fn said(output: Output, code: i32) -> String {
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{text}");
    assert!(!text.contains("panicked"), "{text}");
    text
}

/// All pixels of all layers of an image file, as bits.
pub fn bits(file: &Path) -> Vec<u32> {
    let contents = exr_file::read_file(file).unwrap();
    let layers = contents.layers.into_iter().flat_map(|(_, plane)| match plane {
        Plane::Rgb(image) => image.pixels.into_flattened(),
        Plane::Gray(values) => values,
    });
    contents.image.pixels.into_flattened().into_iter().chain(layers).map(f32::to_bits).collect()
}

/// A number from an image file's metadata.
pub fn number(file: &Path, name: &str) -> f64 {
    let contents = exr_file::read_file(file).unwrap();
    match contents.metadata.iter().find(|(key, _)| key == name) {
        Some((_, relt::film::Value::Number(value))) => *value,
        other => panic!("{name} is {other:?}"),
    }
}
