//! What all shapes of triangles have in common: from vertices as files give them to a valid [`Mesh`].

use std::ops::AddAssign;
use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use rayon::prelude::*;

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

/// Triangles whose normals are in memory at once: enough to keep many threads busy, and so few that they stay in the
/// cache between those threads and the one that adds.
const BLOCK: usize = 1 << 13;

/// How to put a mesh into the world.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Its own coordinates to world ones.
    pub to_world: Affine3A,
    /// The other side is the front.
    pub flip_normals: bool,
    /// A mesh without normals gets smooth ones.
    pub smooth: bool,
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
    /// The mesh in the world, with the normals that it has, or with smooth ones where it shall have some.
    ///
    /// The front is where Mitsuba's shading frame points: along the vertex normals where there are any, else where
    /// corners run counter-clockwise *after* the transform. So a transform that mirrors turns a mesh without normals
    /// inside out and one with normals not.
    ///
    /// All is done in place: a mesh may fill half of the memory.
    pub fn place(mut self, placement: Placement) -> Result<(Mesh, Repairs), String> {
        self.check()?;
        self.transform(placement.to_world)?;
        let dropped = self.drop_triangles_without_area()?;
        if placement.smooth && self.normals.is_empty() {
            self.make_smooth_normals();
        }
        self.turn_fronts(placement.flip_normals);
        let repairs = Repairs { dropped, replaced_normals: self.replace_normals_without_length() };
        let mut mesh = Mesh::new(self.positions, self.triangles);
        mesh.normals = self.normals;
        mesh.uvs = self.uvs;
        Ok((mesh, repairs))
    }

    /// Positions to the world; normals too, to unit length, 0 where they have none.
    fn transform(&mut self, to_world: Affine3A) -> Result<(), String> {
        if to_world != Affine3A::IDENTITY {
            self.positions.par_iter_mut().for_each(|p| *p = to_world.transform_point3(*p));
        }
        if let Some(i) = self.positions.par_iter().position_first(|p| !p.is_finite()) {
            return Err(format!("vertex {} becomes infinite by to_world", i + 1));
        }
        let normal_to_world = to_world.matrix3.inverse().transpose();
        let in_world = |n: Vec3| (normal_to_world * n).try_normalize().unwrap_or(Vec3::ZERO);
        self.normals.par_iter_mut().for_each(|n| *n = in_world(*n));
        Ok(())
    }

    /// Leaves those triangles out that [`face_normal`] cannot be told of, and says how many.
    fn drop_triangles_without_area(&mut self) -> Result<usize, String> {
        let (count, positions) = (self.triangles.len(), &self.positions);
        let has_area = |triangle: &[u32; 3]| face_normal(triangle.map(|i| positions[i as usize])).is_some();
        if self.triangles.par_iter().all(has_area) {
            return Ok(0);
        }
        self.triangles.retain(has_area);
        if self.triangles.is_empty() {
            return Err(format!("none of its {count} triangles has an area"));
        }
        Ok(count - self.triangles.len())
    }

    /// Gives each vertex the mean of its triangles' normals, weighted by the angles that they have there, as Mitsuba does.
    /// Source: Thürmer & Wüthrich 1998, "Computing vertex normals from polygonal facets".
    fn make_smooth_normals(&mut self) {
        let RawMesh { positions, normals, triangles, .. } = self;
        normals.resize(positions.len(), Vec3::ZERO);
        // Computed in parallel and added one by one, so that sums do not depend on threads.
        let mut weighted = Vec::new();
        for block in triangles.chunks(BLOCK) {
            let corners = block.par_iter().map(|triangle| triangle.map(|i| positions[i as usize]));
            corners.map(weighted_normals).collect_into_vec(&mut weighted);
            for (vertex, normal) in block.iter().zip(&weighted).flat_map(|(triangle, parts)| triangle.iter().zip(parts))
            {
                normals[*vertex as usize] += normal;
            }
        }
        normals.par_iter_mut().for_each(|n| *n = n.normalize_or_zero());
    }

    /// Makes corners run counter-clockwise, and normals point, where the front is.
    fn turn_fronts(&mut self, flip: bool) {
        let (positions, normals) = (&self.positions, &self.normals);
        self.triangles.par_iter_mut().for_each(|triangle| {
            let runs_with_normals = normals.is_empty() || {
                let [towards, face] = [normals, positions].map(|v| triangle.map(|i| v[i as usize]));
                let towards = towards.into_iter().sum::<Vec3>();
                face_normal(face).is_none_or(|normal| towards.dot(normal) >= 0.0)
            };
            if runs_with_normals == flip {
                triangle.swap(1, 2);
            }
        });
        if flip {
            self.normals.par_iter_mut().for_each(|n| *n = -*n);
        }
    }

    /// Gives vertices whose normal is 0 that of their last triangle, and says to how many.
    fn replace_normals_without_length(&mut self) -> usize {
        let zeros: Vec<u32> = (0..).zip(&self.normals).filter(|(_, n)| **n == Vec3::ZERO).map(|(i, _)| i).collect();
        if zeros.is_empty() {
            return 0;
        }
        for triangle in &self.triangles {
            let Some(normal) = face_normal(triangle.map(|i| self.positions[i as usize])) else { continue };
            for i in triangle.iter().filter(|i| zeros.binary_search(i).is_ok()) {
                self.normals[*i as usize] = normal;
            }
        }
        let (used, unused): (Vec<u32>, Vec<u32>) =
            zeros.into_iter().partition(|i| self.normals[*i as usize] != Vec3::ZERO);
        unused.into_iter().for_each(|i| self.normals[i as usize] = Vec3::Z); // no triangle sees it
        used.len()
    }

    /// Finite values, indices in range, something there at all.
    fn check(&self) -> Result<(), String> {
        let count = self.positions.len();
        if self.triangles.is_empty() {
            return Err(format!("the mesh is empty: {count} vertices and no triangle"));
        }
        if let Some(i) = self.positions.par_iter().position_first(|p| !p.is_finite()) {
            let p = self.positions[i];
            return Err(format!("vertex {} is ({}, {}, {}); it must be finite", i + 1, p.x, p.y, p.z));
        }
        if let Some(i) = self.normals.par_iter().position_first(|n| !n.is_finite()) {
            return Err(format!("the normal of vertex {} is not finite", i + 1));
        }
        if let Some(i) = self.uvs.par_iter().position_first(|uv| !uv.is_finite()) {
            return Err(format!("the texture coordinates of vertex {} are not finite", i + 1));
        }
        let beyond = |triangle: &[u32; 3]| triangle.iter().copied().find(|i| *i as usize >= count);
        if let Some(t) = self.triangles.par_iter().position_first(|triangle| beyond(triangle).is_some()) {
            let index = beyond(&self.triangles[t]).map_or(0, u64::from);
            return Err(format!("triangle {} refers to vertex {} of {count}", t + 1, index + 1));
        }
        debug_assert!(self.normals.is_empty() || self.normals.len() == count);
        debug_assert!(self.uvs.is_empty() || self.uvs.len() == count);
        Ok(())
    }
}

/// The unit normal times the angle at each corner; 0 where there is no normal.
fn weighted_normals(corners: [Vec3; 3]) -> [Vec3; 3] {
    let mut normals = [Vec3::ZERO; 3];
    if let Some(normal) = face_normal(corners) {
        for (i, weighted) in normals.iter_mut().enumerate() {
            let (to_next, to_last) = (corners[(i + 1) % 3] - corners[i], corners[(i + 2) % 3] - corners[i]);
            *weighted = normal * libm::atan2f(to_next.cross(to_last).length(), to_next.dot(to_last));
        }
    }
    normals
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_normals_are_sums_in_the_order_of_the_triangles() {
        const VERTICES: u32 = 1000;
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            state >> 8
        };
        let mut coordinate = || next() as f32 * 2f32.powi(-24);
        let positions = (0..VERTICES).map(|_| Vec3::from([0; 3].map(|_| coordinate()))).collect();
        // some of them without area
        let triangles = (0..5 * BLOCK / 2).map(|_| [0; 3].map(|_| next() % VERTICES)).collect();
        let mut raw = RawMesh { positions, triangles, ..RawMesh::default() };

        let mut expected = vec![Vec3::ZERO; VERTICES as usize];
        for triangle in &raw.triangles {
            let weighted = weighted_normals(triangle.map(|i| raw.positions[i as usize]));
            (0..3).for_each(|i| expected[triangle[i] as usize] += weighted[i]);
        }
        raw.make_smooth_normals();
        let expected: Vec<_> = expected.into_iter().map(Vec3::normalize_or_zero).collect();
        assert_eq!(raw.normals, expected);
    }
}
