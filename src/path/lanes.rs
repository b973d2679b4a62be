//! Groups of paths that go through a vertex side by side.

use glam::Vec3;

use super::vertex::{Connection, Decisions};
use crate::{
    embree::{Hits, Rays},
    math::{Frame, place_within, warp},
    scene::{
        Profile, Scene, Side,
        lights::{LightSample, on_face, towards_anyhow},
        materials::{Diffuse, Material},
        on_triangle,
    },
};

/// Paths in a group: two vectors of AVX2.
pub(super) const N: usize = 16;

/// Vectors in step.
#[derive(Clone, Copy, Default)]
pub(super) struct Vectors([[f32; N]; 3]);

impl Vectors {
    #[inline(always)]
    pub fn get(&self, j: usize) -> Vec3 {
        Vec3::new(self.0[0][j], self.0[1][j], self.0[2][j])
    }

    #[inline(always)]
    pub fn set(&mut self, j: usize, v: Vec3) {
        [self.0[0][j], self.0[1][j], self.0[2][j]] = v.to_array();
    }
}

/// Where edges of paths end on flat meshes; truths are 0 or 1.
#[derive(Default)]
pub(super) struct Ends {
    pub direction: Vectors,
    /// What was hit: corners and barycentric coordinates.
    corners: [Vectors; 3],
    u: [f32; N],
    v: [f32; N],
    /// Position and unit normal of the front, and whether it was hit from behind.
    pub p: Vectors,
    pub ng: Vectors,
    back: [u32; N],
    /// Number of the appearance, whether the normal is to be turned round, whether the material is diffuse.
    pub appearance: [u32; N],
    flip: [u32; N],
    diffuse: [u32; N],
    reflectance: Vectors,
}

impl Ends {
    /// Fetches what ray number `i` hit.
    #[inline(always)]
    pub fn fetch(&mut self, j: usize, scene: &Scene, rays: &Rays, hits: &Hits, i: usize) {
        let [a, b, c] = scene.flat_corners(hits.geometry[i], hits.primitive[i]);
        self.corners[0].set(j, a);
        self.corners[1].set(j, b);
        self.corners[2].set(j, c);
        (self.u[j], self.v[j]) = (hits.u[i], hits.v[i]);
        self.direction.set(j, rays.direction(i));
    }

    /// Finds where that is and which way it faces; the cosine between edge and normal of the front.
    #[inline(always)]
    pub fn meet(&mut self, j: usize) -> f32 {
        let corners = [self.corners[0].get(j), self.corners[1].get(j), self.corners[2].get(j)];
        let (p, ng) = on_triangle(corners, self.u[j], self.v[j]);
        let cos = ng.dot(self.direction.get(j));
        self.back[j] = u32::from(cos >= 0.0);
        self.p.set(j, p);
        self.ng.set(j, ng);
        cos
    }

    /// Fetches what is on the side that was met.
    #[inline(always)]
    pub fn fetch_side<P: Profile>(&mut self, j: usize, scene: &Scene, hits: &Hits, i: usize) -> Side {
        let (side, material) = scene.side(hits.geometry[i], self.back[j] == 1);
        (self.appearance[j], self.flip[j]) = (side.appearance, u32::from(side.flip));
        self.diffuse[j] = match material {
            Material::Diffuse(diffuse) => {
                self.reflectance.set(j, diffuse.reflectance);
                1
            }
            _ if P::DIFFUSE => unreachable!("a profile with diffuse materials only"),
            _ => 0,
        };
        side
    }

    /// Whether the material is one that goes side by side.
    #[inline(always)]
    pub fn is_diffuse<P: Profile>(&self, j: usize) -> bool {
        P::DIFFUSE || self.diffuse[j] == 1
    }

    #[inline(always)]
    pub fn material(&self, j: usize) -> Diffuse {
        Diffuse { reflectance: self.reflectance.get(j) }
    }

    /// The shading frame on the side that was met, and where the edge came from in it.
    #[inline(always)]
    pub fn seen(&self, j: usize) -> (Frame, Vec3) {
        let ng = self.ng.get(j);
        let frame = Frame::new(if self.flip[j] == 1 { -ng } else { ng });
        (frame, frame.to_local(-self.direction.get(j)))
    }
}

/// [`Connection`]s in step, and whether there are any.
#[derive(Default)]
pub(super) struct Connections {
    any: [u32; N],
    origin: Vectors,
    direction: Vectors,
    end: [f32; N],
    contribution: Vectors,
}

impl Connections {
    #[inline(always)]
    pub fn set(&mut self, j: usize, connection: Connection, any: bool) {
        let Connection { origin, direction, tfar, contribution } = connection;
        self.any[j] = u32::from(any);
        self.origin.set(j, origin);
        self.direction.set(j, direction);
        self.end[j] = tfar;
        self.contribution.set(j, contribution);
    }

    #[inline(always)]
    pub fn get(&self, j: usize) -> Connection {
        Connection {
            origin: self.origin.get(j),
            direction: self.direction.get(j),
            tfar: self.end[j],
            contribution: self.contribution.get(j),
        }
    }

    #[inline(always)]
    pub fn any(&self, j: usize) -> bool {
        self.any[j] == 1
    }

    #[inline(always)]
    pub fn scale(&mut self, j: usize, weight: f32) {
        self.contribution.set(j, self.contribution.get(j) * weight);
    }
}

/// The primary samples of which next edges are made, in step: direction and roulette.
#[derive(Default)]
pub(super) struct Choices {
    direction: [[f32; N]; 2],
    survival: [f32; N],
}

impl Choices {
    #[inline(always)]
    pub fn set(&mut self, j: usize, decisions: &Decisions) {
        [self.direction[0][j], self.direction[1][j]] = decisions.direction;
        self.survival[j] = decisions.roulette.unwrap_or(0.0);
    }

    #[inline(always)]
    pub fn direction(&self, j: usize) -> [f32; 2] {
        [self.direction[0][j], self.direction[1][j]]
    }

    /// Where roulette is played.
    #[inline(always)]
    pub fn survival<const ROULETTE: bool>(&self, j: usize) -> Option<f32> {
        ROULETTE.then_some(self.survival[j])
    }
}

/// Next edges in step, and whether there are any; what they carry is up to the path.
#[derive(Default)]
pub(super) struct Edges {
    any: [u32; N],
    origin: Vectors,
    direction: Vectors,
}

impl Edges {
    #[inline(always)]
    pub fn set(&mut self, j: usize, [origin, direction]: [Vec3; 2], any: bool) {
        self.any[j] = u32::from(any);
        self.origin.set(j, origin);
        self.direction.set(j, direction);
    }

    #[inline(always)]
    pub fn any(&self, j: usize) -> bool {
        self.any[j] == 1
    }

    /// Start and direction.
    #[inline(always)]
    pub fn get(&self, j: usize) -> [Vec3; 2] {
        [self.origin.get(j), self.direction.get(j)]
    }
}

/// Places on lights that paths look at in scenes lit by flat meshes: the chosen triangles, and the numbers that choose a place
/// on each.
#[derive(Default)]
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
