//! Triangles on their way into a PLY file.

use std::io::{self, Write};

use glam::{DAffine3, DVec2, DVec3};

/// Triangles with what belongs to their vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mesh {
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// Normals, one a vertex, or empty.
    pub normals: Vec<DVec3>,
    /// Texture coordinates, one a vertex, or empty.
    pub uvs: Vec<DVec2>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Moves all of it by an affine map; triangles keep their order of corners.
    pub fn transform(&mut self, map: DAffine3) {
        self.positions.iter_mut().for_each(|p| *p = map.transform_point3(*p));
        let normal_map = map.matrix3.inverse().transpose();
        self.normals.iter_mut().for_each(|n| *n = (normal_map * *n).normalize_or_zero());
    }

    /// Turns it inside out.
    pub fn flip(&mut self) {
        self.triangles.iter_mut().for_each(|[_, b, c]| std::mem::swap(b, c));
        self.normals.iter_mut().for_each(|n| *n = -*n);
    }

    /// Orders the corners of each triangle so that they run counter-clockwise around its vertex normals.
    pub fn follow_normals(&mut self) {
        if self.normals.is_empty() {
            return;
        }
        for triangle in &mut self.triangles {
            let [a, b, c] = triangle.map(|i| i as usize);
            let face = (self.positions[b] - self.positions[a]).cross(self.positions[c] - self.positions[a]);
            if face.dot(self.normals[a] + self.normals[b] + self.normals[c]) < 0.0 {
                triangle.swap(1, 2);
            }
        }
    }

    /// Gives each triangle corners of its own with these texture coordinates.
    pub fn separate(&mut self, uvs: [DVec2; 3]) {
        let corners: Vec<usize> = self.triangles.iter().flatten().map(|i| *i as usize).collect();
        self.positions = corners.iter().map(|i| self.positions[*i]).collect();
        if !self.normals.is_empty() {
            self.normals = corners.iter().map(|i| self.normals[*i]).collect();
        }
        self.uvs = uvs.into_iter().cycle().take(corners.len()).collect();
        self.triangles = (0..corners.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    }

    /// Area of each triangle.
    pub fn areas(&self) -> Vec<f64> {
        let area = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|i| self.positions[i as usize]);
            (b - a).cross(c - a).length() / 2.0
        };
        self.triangles.iter().map(area).collect()
    }

    /// Moves every vertex by a length along the mean normal of the triangles around it.
    pub fn grow(&mut self, by: f64) {
        let mut directions = vec![DVec3::ZERO; self.positions.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| self.positions[i as usize]);
            let face = (b - a).cross(c - a);
            triangle.iter().for_each(|i| directions[*i as usize] += face);
        }
        self.positions.iter_mut().zip(directions).for_each(|(p, d)| *p += by * d.normalize_or_zero());
    }

    /// Length of the diagonal of its bounding box.
    pub fn extent(&self) -> f64 {
        let least = self.positions.iter().copied().reduce(DVec3::min);
        let most = self.positions.iter().copied().reduce(DVec3::max);
        least.zip(most).map_or(0.0, |(least, most)| (most - least).length())
    }

    /// Binary little-endian PLY with single-precision numbers; texture coordinates as `u` and `v`.
    pub fn write_ply(&self, file: &mut impl Write) -> io::Result<()> {
        let has_normals = !self.normals.is_empty();
        let has_uvs = !self.uvs.is_empty();
        write!(file, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", self.positions.len())?;
        let names: [(bool, &[&str]); 3] =
            [(true, &["x", "y", "z"]), (has_normals, &["nx", "ny", "nz"]), (has_uvs, &["u", "v"])];
        for name in names.iter().filter(|(is_there, _)| *is_there).flat_map(|(_, names)| *names) {
            writeln!(file, "property float {name}")?;
        }
        write!(file, "element face {}\nproperty list uchar int vertex_indices\nend_header\n", self.triangles.len())?;
        for i in 0..self.positions.len() {
            let mut put = |values: &[f64]| values.iter().try_for_each(|v| file.write_all(&(*v as f32).to_le_bytes()));
            put(&self.positions[i].to_array())?;
            if has_normals {
                put(&self.normals[i].to_array())?;
            }
            if has_uvs {
                put(&self.uvs[i].to_array())?;
            }
        }
        for triangle in &self.triangles {
            file.write_all(&[3])?;
            triangle.iter().try_for_each(|i| file.write_all(&i.to_le_bytes()))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Mesh {
        Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            normals: vec![DVec3::Z; 3],
            uvs: Vec::new(),
            triangles: vec![[0, 1, 2]],
        }
    }

    #[test]
    fn mirrors_turn_corners_but_not_normals() {
        let mut mesh = triangle();
        mesh.transform(DAffine3::from_scale(DVec3::new(-2.0, 1.0, 1.0)));
        assert_eq!(mesh.normals, vec![DVec3::Z; 3]);
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
        mesh.follow_normals();
        assert_eq!(mesh.triangles, [[0, 2, 1]]);
        assert_eq!(mesh.areas(), [1.0]);
    }

    #[test]
    fn grown_meshes_move_along_their_faces() {
        let mut mesh = triangle();
        mesh.grow(0.5);
        assert_eq!(mesh.positions[1], DVec3::new(1.0, 0.0, 0.5));
        mesh.flip();
        mesh.grow(0.5);
        assert_eq!(mesh.positions[1], DVec3::X);
    }
}
