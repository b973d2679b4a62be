//! Groups of paths that go through a vertex side by side.

use glam::Vec3;

use crate::{
    math::{Frame, place_within, warp},
    scene::{
        Scene,
        lights::{LightSample, on_face, towards_anyhow},
    },
};

/// Paths in a group: two vectors of AVX2.
pub(super) const N: usize = 16;

/// Vectors in step.
#[derive(Clone, Copy)]
pub(super) struct Vectors([[f32; N]; 3]);

impl Vectors {
    pub const ZERO: Vectors = Vectors([[0.0; N]; 3]);

    #[inline(always)]
    pub fn get(&self, j: usize) -> Vec3 {
        Vec3::new(self.0[0][j], self.0[1][j], self.0[2][j])
    }

    #[inline(always)]
    pub fn set(&mut self, j: usize, v: Vec3) {
        [self.0[0][j], self.0[1][j], self.0[2][j]] = v.to_array();
    }
}

/// Places on lights that paths look at in scenes lit by flat meshes: the chosen triangles, and the numbers that choose a place
/// on each.
pub(super) struct Aims {
    chosen: [[f32; N]; 2],
    /// Corner and edges, unit normal, and the range of the numbers that choose the triangle.
    face: [Vectors; 3],
    normal: Vectors,
    range: [[f32; N]; 2],
    radiance: Vectors,
    inverse_area: [f32; N],
    probability: [f32; N],
}

impl Aims {
    pub const NONE: Aims = Aims {
        chosen: [[0.0; N]; 2],
        face: [Vectors::ZERO; 3],
        normal: Vectors::ZERO,
        range: [[0.0; N]; 2],
        radiance: Vectors::ZERO,
        inverse_area: [0.0; N],
        probability: [0.0; N],
    };

    /// Fetches what these primary samples choose.
    #[inline(always)]
    pub fn fetch(&mut self, j: usize, scene: &Scene, place: [f32; 2], light: f32) {
        [self.chosen[0][j], self.chosen[1][j]] = place;
        let Some(target) = scene.emitters.target(place[0], light) else { return };
        let [corner, e1, e2] = target.face.corner_and_edges;
        self.face[0].set(j, corner);
        self.face[1].set(j, e1);
        self.face[2].set(j, e2);
        self.normal.set(j, target.face.normal);
        [self.range[0][j], self.range[1][j]] = target.face.range;
        self.radiance.set(j, target.mesh.constant_radiance());
        self.inverse_area[j] = target.mesh.inverse_area();
        self.probability[j] = target.probability;
    }

    /// The place as it is seen from `p`, and whether it shines there: what
    /// [`Emitters::sample`](crate::scene::Emitters::sample) gives, but for the number of the light and without a branch.
    #[inline(always)]
    pub fn sample_anyhow(&self, j: usize, p: Vec3, ng: Vec3) -> (LightSample, bool) {
        let within = place_within(self.chosen[0][j], [self.range[0][j], self.range[1][j]]);
        let face = [self.face[0].get(j), self.face[1].get(j), self.face[2].get(j)];
        let q = on_face(face, warp::triangle([within, self.chosen[1][j]]));
        let normal = self.normal.get(j);
        let (sample, shines) = towards_anyhow(p, ng, q, [normal, normal], self.radiance.get(j), self.inverse_area[j]);
        let probability = self.probability[j];
        (LightSample { weight: sample.weight / probability, pdf: sample.pdf * probability, ..sample }, shines)
    }
}

/// The shading frame of a flat surface with that normal, which is to be turned round or not, and where an edge in that
/// direction came from in it.
#[inline(always)]
pub(super) fn frame_and_back(ng: Vec3, flip: u32, direction: Vec3) -> (Frame, Vec3) {
    let frame = Frame::new(if flip == 1 { -ng } else { ng });
    (frame, frame.to_local(-direction))
}
