//! A folder with the sample scenes, and what a conversion in it gives.

use std::path::{Path, PathBuf};

use relt::convert::{ConvertError, Job, Report, convert};
use relt::film::{Image, exr_file, png_file};

/// A folder with all samples, meshes and pictures, which vanishes afterwards.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Folder {
        let folder = Folder(tempfile::tempdir().expect("a temporary folder"));
        let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
        for (from, to) in [("tests/convert/mitsuba", "mitsuba"), ("tests/convert/pbrt", "pbrt")] {
            let to = folder.path(to);
            std::fs::create_dir(&to).expect("a folder in it");
            for from in [repository.join(from), repository.join("tests/mitsuba/meshes")] {
                for entry in std::fs::read_dir(from).expect("a folder of samples") {
                    let entry = entry.expect("a sample");
                    std::fs::copy(entry.path(), to.join(entry.file_name())).expect("a copy of it");
                }
            }
            png_file::write(&to.join("picture.png"), &picture()).expect("a picture");
            exr_file::write(&to.join("sky.exr"), &sky(), &[], &[]).expect("a sky");
            exr_file::write(&to.join("square.exr"), &square(), &[], &[]).expect("a sky");
        }
        folder
    }

    /// The path of a file in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a scene and converts it.
    pub fn convert_text(&self, name: &str, text: &str) -> Result<(Report, PathBuf), ConvertError> {
        std::fs::write(self.path(name), text).expect("a file in it");
        self.convert(name)
    }

    /// Converts a file.
    pub fn convert(&self, name: &str) -> Result<(Report, PathBuf), ConvertError> {
        let input = self.path(name);
        let output = input.with_file_name("out.xml");
        let job = Job { input, output: output.clone(), defines: Vec::new(), reach: Default::default(), strict: false };
        convert(&job).map(|report| (report, output))
    }
}

/// Four rows of six pixels, all different.
fn picture() -> Image {
    let pixel = |i: u32| [i as f32 / 24.0, (i * 7 % 24) as f32 / 24.0, (i * 11 % 24) as f32 / 24.0];
    Image::new(6, 4, (0..24).map(pixel).collect())
}

/// A sky by longitude and latitude with a sun.
fn sky() -> Image {
    let mut image = Image::constant(16, 8, [0.3; 3]);
    image.pixels[16 + 3] = [9.0, 7.0, 5.0];
    image
}

/// A sky in pbrt's square: red to −x, green to −y, bright at +z.
pub fn square() -> Image {
    let pixel = |i: u32| {
        let (x, y) = (i % 16, i / 16);
        let top = (7..9).contains(&x) && (7..9).contains(&y);
        [if x < 8 { 1.0 } else { 0.2 }, if y < 8 { 0.7 } else { 0.2 }, if top { 3.0 } else { 0.2 }]
    };
    Image::new(16, 16, (0..256).map(pixel).collect())
}

/// The text of the elements of that tag directly inside the scene, one after the other: each as
/// `tag:type(name=value, child(…))`, without ids.
pub fn shown(output: &Path, tag: &str) -> String {
    let text = std::fs::read_to_string(output).expect("the scene that was written");
    let document = roxmltree::Document::parse(&text).expect("XML");
    let elements = document.root_element().children().filter(|node| node.has_tag_name(tag));
    elements.map(show).collect::<Vec<_>>().join(" ")
}

fn show(node: roxmltree::Node) -> String {
    let attribute = |name: &str| node.attribute(name).unwrap_or_default();
    let kind = attribute("type");
    let mut head = match node.tag_name().name() {
        "ref" => return format!("→{}", attribute("id")),
        "transform" => String::new(),
        "bsdf" | "emitter" | "shape" | "film" | "rfilter" | "sampler" | "sensor" | "integrator" => kind.to_owned(),
        "texture" => format!("{}={kind}", attribute("name")),
        "float" | "integer" | "boolean" | "string" | "rgb" | "point" | "vector" => {
            return format!("{}={}", attribute("name"), attribute("value").replace(", ", ","));
        }
        step => {
            let values: Vec<_> = node.attributes().map(|a| a.value().replace(", ", ",")).collect();
            return format!("{step}:{}", values.join(";"));
        }
    };
    if node.has_tag_name("transform") {
        head = attribute("name").to_owned();
    }
    let children: Vec<String> = node.children().filter(|child| child.is_element()).map(show).collect();
    if children.is_empty() { head } else { format!("{head}({})", children.join(" ")) }
}
