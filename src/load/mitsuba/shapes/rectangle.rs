//! `rectangle`: the square [−1, 1]² with its front towards +z; `to_world`, `flip_normals`.

use glam::{Vec2, Vec3};

use super::super::Folder;
use super::super::parameters::ElementParameters;
use super::Build;
use super::mesh::{Placement, RawMesh};
use crate::scene::parameters::Parameters;

/// Reads the rectangle.
pub fn read(p: &mut ElementParameters, _folder: &Folder) -> Option<Build> {
    let flip_normals = p.boolean("flip_normals").unwrap_or(false);
    let placement = Placement { to_world: p.to_world(), flip_normals, smooth: false };
    Some(Build::new(move || {
        let (mut mesh, repairs) = raw().place(placement)?;
        mesh.normals.clear(); // they told the front, and the faces are flat
        Ok((mesh, repairs).into())
    }))
}

/// Two triangles, with normals because a mirrored rectangle keeps its front.
fn raw() -> RawMesh {
    let uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    RawMesh {
        positions: uvs.iter().map(|uv| (2.0 * uv - Vec2::ONE).extend(0.0)).collect(),
        normals: vec![Vec3::Z; 4],
        uvs,
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}
