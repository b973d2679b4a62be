//! What all shapes of triangles have in common: from vertices as files give them to a valid [`Mesh`].

use std::ops::AddAssign;
use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};

use super::Built;
use crate::scene::Mesh;
use crate::scene::description::ShapeGeometry;

/// Triangles in the shape's own coordinates, not yet checked.
#[derive(Debug, Default)]
pub struct RawMesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Normals of any length, one a vertex, or empty.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one a vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

/// How to put a mesh into the world.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Its own coordinates to world ones.
    pub to_world: Affine3A,
    /// The other side is the front.
    pub flip_normals: bool,
}

/// How much of the meshes could not be used as it was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Repairs {
    /// Triangles without area, left out.
    pub dropped: usize,
    /// Vertex normals without length, replaced by a triangle's.
    pub replaced_normals: usize,
}

impl AddAssign for Repairs {
    fn add_assign(&mut self, other: Repairs) {
        self.dropped += other.dropped;
        self.replaced_normals += other.replaced_normals;
    }
}

impl Repairs {
    /// One sentence a kind.
    pub fn warnings(self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.dropped > 0 {
            warnings.push(format!("triangles without area, left out: {}", self.dropped));
        }
        if self.replaced_normals > 0 {
            let count = self.replaced_normals;
            warnings.push(format!("vertex normals without length, replaced by those of triangles: {count}"));
        }
        warnings
    }
}

impl RawMesh {
    /// The mesh in the world with smooth normals where it has any.
    ///
    /// The front is where Mitsuba's shading frame points: along the vertex normals where there are any, else where
    /// corners run counter-clockwise *after* the transform. So a transform that mirrors turns a mesh without normals
    /// inside out and one with normals not.
    pub fn place(self, placement: Placement) -> Result<(Mesh, Repairs), String> {
        self.check()?;
        let to_world = placement.to_world;
        let positions: Vec<_> = self.positions.iter().map(|p| to_world.transform_point3(*p)).collect();
        if let Some(i) = positions.iter().position(|p| !p.is_finite()) {
            return Err(format!("vertex {} becomes infinite by to_world", i + 1));
        }
        let normal_to_world = to_world.matrix3.inverse().transpose();
        let mut normals: Vec<_> =
            self.normals.iter().map(|n| (normal_to_world * *n).try_normalize().unwrap_or(Vec3::ZERO)).collect();

        let mut triangles = Vec::with_capacity(self.triangles.len());
        let mut face_normals = vec![Vec3::ZERO; normals.len()];
        for [a, b, c] in &self.triangles {
            let corners = [*a, *b, *c].map(|i| i as usize);
            let Some(face_normal) = face_normal(corners.map(|i| positions[i])) else { continue };
            let is_against = if normals.is_empty() {
                placement.flip_normals
            } else {
                let towards = corners.map(|i| normals[i]).iter().sum::<Vec3>().dot(face_normal);
                (towards < 0.0) != placement.flip_normals
            };
            for i in corners {
                if let Some(kept) = face_normals.get_mut(i) {
                    *kept = face_normal;
                }
            }
            triangles.push(if is_against { [*a, *c, *b] } else { [*a, *b, *c] });
        }
        if triangles.is_empty() {
            return Err(format!("none of its {} triangles has an area", self.triangles.len()));
        }

        let mut repairs = Repairs { dropped: self.triangles.len() - triangles.len(), replaced_normals: 0 };
        for (normal, face_normal) in normals.iter_mut().zip(face_normals) {
            if *normal == Vec3::ZERO {
                repairs.replaced_normals += usize::from(face_normal != Vec3::ZERO);
                *normal = if face_normal == Vec3::ZERO { Vec3::Z } else { face_normal };
            }
            *normal *= if placement.flip_normals { -1.0 } else { 1.0 };
        }
        let mut mesh = Mesh::new(positions, triangles);
        mesh.normals = normals;
        mesh.uvs = self.uvs;
        Ok((mesh, repairs))
    }

    /// Finite values, indices in range, something there at all.
    fn check(&self) -> Result<(), String> {
        let count = self.positions.len();
        if self.triangles.is_empty() {
            return Err(format!("the mesh is empty: {count} vertices and no triangle"));
        }
        for (i, p) in self.positions.iter().enumerate() {
            if !p.is_finite() {
                return Err(format!("vertex {} is ({}, {}, {}); it must be finite", i + 1, p.x, p.y, p.z));
            }
        }
        if let Some(i) = self.normals.iter().position(|n| !n.is_finite()) {
            return Err(format!("the normal of vertex {} is not finite", i + 1));
        }
        if let Some(i) = self.uvs.iter().position(|uv| !uv.is_finite()) {
            return Err(format!("the texture coordinates of vertex {} are not finite", i + 1));
        }
        for (t, triangle) in self.triangles.iter().enumerate() {
            if let Some(index) = triangle.iter().find(|i| **i as usize >= count) {
                return Err(format!("triangle {} refers to vertex {} of {count}", t + 1, u64::from(*index) + 1));
            }
        }
        debug_assert!(self.normals.is_empty() || self.normals.len() == count);
        debug_assert!(self.uvs.is_empty() || self.uvs.len() == count);
        Ok(())
    }
}

/// Unit normal of a triangle, or `None` where single precision cannot tell it: that is what "no area" means here,
/// since intersection and shading compute it like this.
fn face_normal([a, b, c]: [Vec3; 3]) -> Option<Vec3> {
    (b - a).cross(c - a).try_normalize()
}

impl From<(Mesh, Repairs)> for Built {
    fn from((mesh, repairs): (Mesh, Repairs)) -> Built {
        Built { geometry: ShapeGeometry::Mesh(Arc::new(mesh)), repairs }
    }
}
