//! Scene files become the descriptions they mean, and faulty ones say where and why.

use std::path::{Path, PathBuf};

use relt::scene::SceneDescription;
use relt::scene::description::ShapeGeometry;

/// A scene of the repository.
fn own_scene(name: &str) -> SceneDescription {
    load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml"))
}

fn load(path: &Path) -> SceneDescription {
    relt::load::scene(path, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// Number of triangles of each shape, 0 for what is no mesh.
fn triangle_counts(scene: &SceneDescription) -> Vec<(&str, usize)> {
    let count = |g: &ShapeGeometry| if let ShapeGeometry::Mesh(mesh) = g { mesh.triangles.len() } else { 0 };
    scene.shapes.iter().map(|s| (s.name.as_str(), count(&s.geometry))).collect()
}

#[test]
fn the_own_scenes_load() {
    for name in ["cornell-box", "caustic", "lattice"] {
        let scene = own_scene(name);
        println!("{name}: {:?} {:?} {:?} {:?}", triangle_counts(&scene), scene.camera, scene.film, scene.materials);
        println!("{:?} {:?}", scene.warnings, scene.integrator);
    }
}

#[test]
#[ignore = "needs RELT_SCENES, a folder of further scenes"]
fn further_scenes_load() {
    let folder = PathBuf::from(std::env::var("RELT_SCENES").expect("RELT_SCENES names a folder"));
    for name in ["bitterli-cornell-box", "veach-mis", "veach-bidir", "veach-door"] {
        match relt::load::scene(&folder.join(name).join("scene.xml"), &[]) {
            Ok(scene) => println!("{name}: {:?}", triangle_counts(&scene)),
            Err(error) => println!("{error}"),
        }
    }
}
