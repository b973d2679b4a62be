//! Triangle meshes.

use glam::{Vec2, Vec3};

/// Triangles over shared vertices, in world space, already validated: every index is in range, every value
/// finite, no triangle without area.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions, followed by one vertex of padding that no triangle uses: Embree reads vertices as four
    /// floats, so the last one must not end at the end of the allocation.
    positions: Vec<Vec3>,
    /// Unit shading normals, one a vertex, or empty where the faces are flat.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one a vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// Vertex indices of each triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// A mesh of flat triangles; add `normals` and `uvs` afterwards where there are any.
    pub fn new(mut positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
        debug_assert!(triangles.iter().flatten().all(|&i| (i as usize) < positions.len()));
        positions.reserve_exact(1); // and not twice as much as there is
        positions.push(Vec3::ZERO);
        Mesh { positions, normals: Vec::new(), uvs: Vec::new(), triangles }
    }

    /// Multiplies all positions.
    pub fn scale(&mut self, factor: f32) {
        self.positions.iter_mut().for_each(|p| *p *= factor);
    }

    /// Vertex positions, without the padding.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions[..self.positions.len() - 1]
    }

    /// Vertex positions and the one vertex of padding behind them.
    pub fn padded_positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The three corners of triangle `t`.
    #[inline(always)]
    pub fn corners(&self, t: u32) -> [Vec3; 3] {
        self.triangles[t as usize].map(|i| self.positions[i as usize])
    }

    /// Unit shading normal of triangle `t` at barycentric coordinates (1 − u − v, u, v); `flat`, its own normal, where
    /// the mesh has none or they cancel.
    #[inline(always)]
    pub fn shading_normal(&self, t: u32, u: f32, v: f32, flat: Vec3) -> Vec3 {
        if self.normals.is_empty() {
            return flat;
        }
        let [a, b, c] = self.triangles[t as usize].map(|i| self.normals[i as usize]);
        (a * (1.0 - u - v) + b * u + c * v).normalize_or(flat)
    }

    /// Texture coordinates of triangle `t` at barycentric coordinates (1 − b − c, b, c); (b, c) where the mesh has none.
    #[inline]
    pub fn uv(&self, t: u32, b: f32, c: f32) -> Vec2 {
        if self.uvs.is_empty() {
            return Vec2::new(b, c);
        }
        let [uv0, uv1, uv2] = self.triangles[t as usize].map(|i| self.uvs[i as usize]);
        uv0 * (1.0 - b - c) + uv1 * b + uv2 * c
    }

    /// Area of triangle `t`, in the square of the scene's unit, computed in f64.
    pub fn area(&self, t: u32) -> f64 {
        let [a, b, c] = self.corners(t).map(|p| p.as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    }
}
