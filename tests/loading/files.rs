//! Scenes written to a folder that vanishes afterwards.

use std::path::PathBuf;

use relt::load::LoadError;
use relt::scene::SceneDescription;
use relt::scene::description::ShapeGeometry;
use relt::scene::{Mesh, description::ShapeDescription};

/// What a scene needs besides what a test is about; on one line, so as to leave line numbers alone.
pub const REST: &str = "<sensor type='perspective'/><emitter type='constant'/>";

/// A folder with a scene file and others beside it.
pub struct Folder(tempfile::TempDir);

impl Folder {
    /// With files of these names and contents.
    pub fn new(files: &[(&str, &[u8])]) -> Folder {
        let folder = Folder(tempfile::tempdir().expect("a temporary folder"));
        for (name, content) in files {
            std::fs::write(folder.path(name), content).expect("a file in it");
        }
        folder
    }

    /// The path of a file in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Loads a text as its `scene.xml`.
    pub fn load(&self, text: &str, defines: &[(&str, &str)]) -> Result<SceneDescription, LoadError> {
        let path = self.path("scene.xml");
        std::fs::write(&path, text).expect("a file in it");
        let defines: Vec<_> = defines.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect();
        relt::load::scene(&path, &defines)
    }
}

/// A scene of these elements, which begin on line 2, and of [`REST`].
pub fn around(elements: &str) -> String {
    format!("<scene version='3.0.0'>\n{elements}\n{REST}</scene>")
}

/// The scene of these elements and of [`REST`].
pub fn scene_with(elements: &str) -> SceneDescription {
    scene_beside(&[], elements)
}

/// The scene of these elements and of [`REST`], beside these files.
pub fn scene_beside(files: &[(&str, &[u8])], elements: &str) -> SceneDescription {
    Folder::new(files).load(&around(elements), &[]).unwrap_or_else(|error| panic!("{elements}\n{error}"))
}

/// The only shape of the scene of these elements.
pub fn shape(files: &[(&str, &[u8])], elements: &str) -> ShapeDescription {
    let mut shapes = scene_beside(files, elements).shapes;
    assert_eq!(shapes.len(), 1, "{elements}");
    shapes.remove(0)
}

/// The shape's mesh.
pub fn mesh(shape: &ShapeDescription) -> &Mesh {
    match &shape.geometry {
        ShapeGeometry::Mesh(mesh) => mesh,
        other => panic!("{} is no mesh: {other:?}", shape.name),
    }
}
