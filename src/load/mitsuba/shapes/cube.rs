//! `cube`: [−1, 1]³ with its front outside; `to_world`, `flip_normals`, `face_normals`.

use glam::{Vec2, Vec3};

use super::super::Folder;
use super::super::parameters::ElementParameters;
use super::Build;
use super::mesh::{Placement, RawMesh};
use crate::scene::parameters::Parameters;

/// Normals of the faces and the directions in which their v grows; u grows along normal × v.
const FACES: [(Vec3, Vec3); 6] = [
    (Vec3::NEG_Y, Vec3::X),
    (Vec3::Y, Vec3::NEG_Z),
    (Vec3::X, Vec3::NEG_Z),
    (Vec3::Z, Vec3::X),
    (Vec3::NEG_X, Vec3::Z),
    (Vec3::NEG_Z, Vec3::X),
];

/// Reads the cube.
pub fn read(p: &mut ElementParameters, _folder: &Folder) -> Option<Build> {
    let flip_normals = p.boolean("flip_normals").unwrap_or(false);
    let face_normals = p.boolean("face_normals").unwrap_or(false);
    let placement = Placement { to_world: p.to_world(), flip_normals, smooth: false };
    Some(Build::new(move || {
        let mut raw = raw();
        if face_normals {
            raw.normals.clear(); // with them the front would be outside even if mirrored
        }
        let (mut mesh, repairs) = raw.place(placement)?;
        mesh.normals.clear(); // they told the front, and the faces are flat
        Ok((mesh, repairs).into())
    }))
}

/// Two triangles a face, with normals because a mirrored cube keeps its front.
fn raw() -> RawMesh {
    let mut raw = RawMesh::default();
    for (normal, v_axis) in FACES {
        let u_axis = normal.cross(v_axis);
        let first = raw.positions.len() as u32;
        for uv in [Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO] {
            let [u, v] = (2.0 * uv - Vec2::ONE).to_array();
            raw.positions.push(normal + u * u_axis + v * v_axis);
            raw.normals.push(normal);
            raw.uvs.push(uv);
        }
        raw.triangles.extend([[0, 1, 2], [3, 0, 2]].map(|corners: [u32; 3]| corners.map(|i| first + i)));
    }
    raw
}
