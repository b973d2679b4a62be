//! Changes of technique: the same path, made by another technique.
//!
//! A point u of the multiplexed mapping that makes the path x by technique s is taken to a point u′ that makes x by
//! technique s′ of as many edges: the primary samples that technique s′ turns into decisions are found by inverting the
//! sampling of lights, scattering and camera, those that it does not look at are drawn anew, and those that both use for
//! the same decision stay.
//!
//! *The step.* Let p_s(x) be the density with which technique s makes x, probabilities of choosing lights and lobes
//! included, and let s′ be drawn with probabilities q(s′|x). Between the samples that are used, the change has the Jacobian
//! |∂u′/∂u| = p_s′/p_s; what is drawn anew is uniform on either side, in a lobe's share of its dimension with the inverse
//! of that share as density, which is in p. With the target g^β on the cube, the step is reversible if accepted with
//!
//! α = min(1, (g(u′)/g(u))^β · p_s′/p_s · q(s|x)/q(s′|x))   (Green 1995).
//!
//! The mapping weighs techniques by the power heuristic and divides by p_s (all techniques of a length are equally
//! likely), so that g ∝ π_s²/p_s along a path, where π are the densities by which it weighs: those of [`weights`], which
//! take perfect lobes for 1. That gives the conditional distribution of the technique,
//!
//! q(s|x) ∝ (π_s²/p_s)^β p_s,
//!
//! by which s′ is drawn, the present technique included: a Gibbs step, whose α is 1 but for rounding,
//! α = min(1, (g(u′)/g(u) · e^−Δ)^β) with Δ the expected change of ln g. What rounding makes of the path shows in g(u′),
//! which is computed as ever. Where nothing changes, nothing is evaluated.
//!
//! *Perfect lobes.* Reflection and refraction conserve n² |cos| dA dω. So a lobe of probability F that leads across
//! an interface counts F |cos| for p, with the cosine where it leads, and towards the camera the square of the ratio
//! of refractive indices besides. Shading normals that lean do not conserve it; there, and at all else that is not
//! invertible, neither side of the vertex is exchanged with the other. Which techniques are exchanged then is a
//! partition that depends on the path alone.
//!
//! Source: Bitterli, Jakob, Novák & Jarosz 2017, "Reversible jump Metropolis light transport using inverse mappings";
//! Pantaleoni 2017, "Charted Metropolis light transport"; Green 1995, "Reversible jump Markov chain Monte Carlo".
//!
//! [`weights`]: super::weights

use glam::Vec3;

use super::subpath::Site;
use crate::{
    embree::MISS,
    math::{Frame, offset_origin},
    path::Mapping,
    rng::{open_unit_f64, unit_f32, word_of_unit},
    sample::{Block, Points},
    scene::{
        FullProfile, Mixture, NO_LIGHT, Scattering, ScatteringRef, Scene, Sight, Surface,
        lights::{EmissionInverse, EmitterKind, SHORT_OF_LIGHT},
        materials::{Inverse, Material},
    },
};
/// Any scene's; paths are few, so that it does not pay to have one for each kernel.
type P = FullProfile;

/// Draws a technique for the path of lane `lane` of `current`, and puts the blocks of which it decides into the same lane
/// of `to`: Δ, the expected change of ln g; `None` where the technique is the same, or the only one. `random` gives uniform
/// blocks, `rays` counts.
pub(in crate::path) fn change_technique(
    mapping: &Mapping,
    (current, lane): (&Points, usize),
    beta: f64,
    random: &mut dyn FnMut() -> Block,
    to: &mut Points,
    rays: &mut u64,
) -> Option<f64> {
    let old = Old { mapping, current, lane };
    let path = old.path(rays)?;
    let techniques = path.techniques(mapping.scene());
    let ln_weight = |t: &Technique| 2.0 * beta * t.ln_weighed + (1.0 - beta) * t.ln_density;
    let largest = techniques.iter().map(ln_weight).fold(f64::NEG_INFINITY, f64::max);
    let weight = |t: &Technique| libm::exp(ln_weight(t) - largest);
    let [choice, ..] = random();
    let mut left = open_unit_f64(choice) * techniques.iter().map(weight).sum::<f64>();
    let chosen = techniques.iter().find(|t| {
        left -= weight(t);
        left < 0.0
    })?;
    if chosen.light == path.light {
        return None;
    }
    old.write(&path, chosen.light, random, to)?;
    Some(2.0 * chosen.ln_weighed - chosen.ln_density)
}

/// A path x₀ … x_n from the light to the lens.
struct Path<'s> {
    /// Vertices of its light subpath, s.
    light: usize,
    start: Start,
    /// x₁ … x_{n−1}.
    inner: Vec<Vertex<'s>>,
    lens: [f32; 2],
    /// Its edges, from x₀ on.
    edges: Vec<Edge>,
    sight: Option<Sight>,
}

/// What is kept of a [`Surface`].
struct Vertex<'s> {
    p: Vec3,
    ng: Vec3,
    lift: Vec3,
    frame: Frame,
    wo: Vec3,
    scattering: Kept<'s>,
}

/// A scattering function; mixtures are large, and few.
enum Kept<'s> {
    Plain(&'s Material),
    Mixed(Box<Mixture>),
}

impl<'s> From<Surface<'s>> for Vertex<'s> {
    fn from(surface: Surface<'s>) -> Vertex<'s> {
        let Surface { p, ng, lift, frame, wo, scattering, .. } = surface;
        let scattering = match scattering {
            Scattering::Plain(material) => Kept::Plain(material),
            Scattering::Mixed(mixture) => Kept::Mixed(Box::new(mixture)),
        };
        Vertex { p, ng, lift, frame, wo, scattering }
    }
}

/// What leads from one vertex to the next.
#[derive(Clone, Copy, Debug)]
struct Edge {
    /// Unit directions of rays from its vertices to one another, that on the side of the light first.
    directions: [Vec3; 2],
    /// The square of its length.
    length2: f64,
}

/// Where a path leaves a light.
#[derive(Clone, Copy, Debug)]
struct Start {
    light: u32,
    place: Vec3,
    normals: [Vec3; 2],
    /// Triangle of a mesh.
    triangle: u32,
}

/// A technique of a path, beside the one that made it.
struct Technique {
    light: usize,
    /// ln p_s by that of the present technique.
    ln_density: f64,
    /// ln π_s by that of the present technique.
    ln_weighed: f64,
}

/// The point that a path is made of.
struct Old<'a> {
    mapping: &'a Mapping<'a>,
    current: &'a Points,
    lane: usize,
}

impl<'a> Old<'a> {
    fn block(&self, block: u16) -> Option<Block> {
        self.current.has(block, self.lane).then(|| self.current.block(block, self.lane))
    }

    fn choices(&self) -> Option<Block> {
        self.block(self.mapping.layout().light_choices()?)
    }

    /// The path, as the mapping traces it.
    fn path(&self, rays: &mut u64) -> Option<Path<'a>> {
        let layout = self.mapping.layout();
        let chosen = self.mapping.lengths().choose(self.choices()?);
        let (s, t) = (usize::from(chosen.light), usize::from(chosen.camera));
        if s + t < 3 {
            return None; // lamps that are seen directly have one technique
        }
        let [x, y, u, v] = self.block(0)?.map(unit_f32);
        let mut path = Path {
            light: s,
            start: Start::NONE,
            inner: Vec::with_capacity(s + t),
            lens: [u, v],
            edges: Vec::new(),
            sight: None,
        };
        if s > 1 {
            self.follow_light(&mut path, rays)?;
        }
        let light_vertices = path.inner.len();
        if t > 1 {
            let ray = self.mapping.scene().camera.ray([x, y], [u, v]);
            self.follow_camera(&mut path, (ray.origin, ray.direction, ray.tfar), t - 1, rays)?;
        }
        if s == 1 {
            let block = self.block(layout.bounce(t as u16 - 2))?.map(unit_f32);
            let choice = layout.choices(t as u16 - 2).map_or(Some([0; 4]), |b| self.block(b))?;
            path.start = self.looked_for(path.inner.last()?, [block[2], block[3]], unit_f32(choice[1]))?;
        }
        path.inner[light_vertices..].reverse();
        path.connect(self.mapping.scene())?;
        Some(path)
    }

    fn follow_light(&self, path: &mut Path<'a>, rays: &mut u64) -> Option<()> {
        let (scene, layout) = (self.mapping.scene(), self.mapping.layout());
        let [a, b, c, d] = self.block(layout.emission())?.map(unit_f32);
        let emission = scene.emitters.emit::<P>([a, b], [c, d], unit_f32(self.choices()?[0]))?;
        path.start = Start {
            light: emission.light,
            place: emission.origin,
            normals: emission.normals,
            triangle: scene.emitters.light(emission.light).triangle([a, b]),
        };
        let mut ray = (super::subpath::start_of(&emission), emission.direction);
        for j in 1..path.light {
            let surface = trace(self.mapping, (ray.0, ray.1, f32::MAX), rays)?.0;
            if j + 1 < path.light {
                let [a, b, lobe, _] = self.block(layout.light_bounce(j as u16 - 1))?.map(unit_f32);
                ray = scattered(&surface, [a, b], lobe)?;
            }
            path.inner.push(surface.into());
        }
        Some(())
    }

    /// Adds `count` vertices, but for the last where it is one on a light that was hit.
    fn follow_camera(
        &self,
        path: &mut Path<'a>,
        mut ray: (Vec3, Vec3, f32),
        count: usize,
        rays: &mut u64,
    ) -> Option<()> {
        let layout = self.mapping.layout();
        for j in 1..=count {
            let (surface, triangle) = trace(self.mapping, ray, rays)?;
            if j == count && path.light == 0 {
                if surface.light == NO_LIGHT {
                    return None;
                }
                let normals = [surface.ng, surface.frame.n];
                path.start = Start { light: surface.light, place: surface.p, normals, triangle: triangle? };
                return Some(());
            }
            if j < count {
                let [a, b, ..] = self.block(layout.bounce(j as u16 - 1))?.map(unit_f32);
                let lobe = layout.choices(j as u16 - 1).map_or(Some([0; 4]), |block| self.block(block))?[0];
                let (origin, direction) = scattered(&surface, [a, b], unit_f32(lobe))?;
                ray = (origin, direction, f32::MAX);
            }
            path.inner.push(surface.into());
        }
        Some(())
    }

    /// The place on a light that next-event estimation finds.
    fn looked_for(&self, from: &Vertex, place: [f32; 2], choice: f32) -> Option<Start> {
        let emitters = &self.mapping.scene().emitters;
        let found = emitters.sample::<P>(from.p, from.lift, place, choice)?;
        let kind = emitters.kind(found.light);
        (kind == EmitterKind::Surface || kind == EmitterKind::Point).then(|| Start {
            light: found.light,
            place: found.origin + found.wi * (found.tfar / SHORT_OF_LIGHT),
            normals: found.normals,
            triangle: emitters.light(found.light).triangle(place),
        })
    }

    /// The blocks by which technique `s` makes the path.
    fn write(&self, path: &Path, s: usize, random: &mut dyn FnMut() -> Block, to: &mut Points) -> Option<()> {
        let (scene, layout) = (self.mapping.scene(), self.mapping.layout());
        let (edges, old_s) = (path.length(), path.light);
        let (t, old_t) = (edges + 1 - s, edges + 1 - old_s);
        let start = &path.start;
        let light = scene.emitters.light(start.light);
        let mut set = |number: u16, block: Block| {
            to.reserve(number);
            to.set(number, self.lane, block);
        };

        let mut first = self.block(0)?;
        let fresh = random();
        if t == 1 {
            first[..2].copy_from_slice(&fresh[..2]);
        } else if old_t == 1 {
            let film = path.sight?.film;
            (first[0], first[1]) = (word_of_unit(film[0], fresh[0]), word_of_unit(film[1], fresh[1]));
        }
        set(0, first);
        for j in 1..t {
            let (number, at, mut block, mut choices) = (j as u16 - 1, edges - j, random(), random());
            if j + 1 < old_t.min(t) {
                block = self.block(layout.bounce(number))?;
                if let Some(number) = layout.choices(number) {
                    choices = self.block(number)?;
                }
            } else if j + 1 < t {
                let inverse = path.invert(at, Way::ToLight)?;
                (block, choices[0]) = shaped(&inverse, block, choices[0]);
            } else if s == 1 {
                let Vertex { p, lift, .. } = path.inner[at - 1];
                if let Some([a, b]) = light.invert_sample(p, lift, start.place, start.triangle)? {
                    (block[2], block[3]) = (word_of_unit(a, block[2]), word_of_unit(b, block[3]));
                }
                choices[1] = within(scene.emitters.choice_of(start.light), choices[1]);
            }
            // nothing is decided where a light was hit
            if s > 0 || j + 1 < t {
                set(layout.bounce(number), block);
                if let Some(number) = layout.choices(number) {
                    set(number, choices);
                }
            }
        }

        let (mut choices, fresh) = (self.choices()?, random());
        if s < 2 {
            choices[0] = fresh[0];
        } else if old_s < 2 {
            choices[0] = within(scene.emitters.choice_of(start.light), fresh[0]);
        }
        choices[2] = self.mapping.lengths().technique_word(edges, s, fresh[2]);
        set(layout.light_choices()?, choices);
        if s < 2 {
            return Some(());
        }
        let mut block = random();
        if old_s >= 2 {
            block = self.block(layout.emission())?;
        } else {
            let EmissionInverse { place, direction } = path.emission(scene)?;
            let [a, b, c, d] = block;
            let place = place.map_or([a, b], |place| [word_of_unit(place[0], a), word_of_unit(place[1], b)]);
            block = [place[0], place[1], word_of_unit(direction[0], c), word_of_unit(direction[1], d)];
        }
        set(layout.emission(), block);
        for j in 1..s - 1 {
            let mut block = random();
            if j + 1 < old_s {
                block = self.block(layout.light_bounce(j as u16 - 1))?;
            } else {
                let inverse = path.invert(j, Way::ToCamera)?;
                let lobe = block[2];
                (block, block[2]) = shaped(&inverse, block, lobe);
            }
            set(layout.light_bounce(j as u16 - 1), block);
        }
        Some(())
    }
}

/// What a ray meets, and the triangle if that is not part of an instance.
fn trace<'s>(
    mapping: &Mapping<'s>,
    (origin, direction, tfar): (Vec3, Vec3, f32),
    rays: &mut u64,
) -> Option<(Surface<'s>, Option<u32>)> {
    let scene = mapping.scene();
    *rays += 1;
    let hit = scene.tracer.closest_one(origin, direction, tfar)?;
    Some((scene.surface::<P>(hit, origin, direction), (hit.instance == MISS).then_some(hit.primitive)))
}

/// Where a path goes on: start and direction of its next ray.
fn scattered(surface: &Surface, shape: [f32; 2], lobe: f32) -> Option<(Vec3, Vec3)> {
    let sample = surface.scattering.sample::<P>(surface.wo, shape, lobe)?;
    let direction = surface.frame.to_world(sample.wi);
    Some((Site::of(surface).start_towards(direction), direction))
}

/// A block and a word of choice, drawn at random, made those that scatter in a certain direction.
fn shaped(inverse: &Inverse, mut block: Block, choice: u32) -> (Block, u32) {
    if let Some([a, b]) = inverse.shape {
        (block[0], block[1]) = (word_of_unit(a, block[0]), word_of_unit(b, block[1]));
    }
    (block, within(inverse.choice, choice))
}

/// A uniform word as one that is uniform within a range.
fn within([start, end]: [f32; 2], word: u32) -> u32 {
    if [start, end] == [0.0, 1.0] {
        return word;
    }
    word_of_unit(start + unit_f32(word) * (end - start), word)
}

/// The end that a direction at a vertex, or a density, leads to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    ToLight,
    ToCamera,
}

impl Start {
    const NONE: Start = Start { light: NO_LIGHT, place: Vec3::ZERO, normals: [Vec3::ZERO; 2], triangle: 0 };
}

impl Path<'_> {
    /// Number of edges.
    fn length(&self) -> usize {
        self.inner.len() + 1
    }

    /// x_i, 0 < i < n.
    fn site(&self, i: usize) -> Site<'_> {
        let &Vertex { p, ng, lift, frame, wo, ref scattering } = &self.inner[i - 1];
        let scattering = match scattering {
            Kept::Plain(material) => ScatteringRef::Plain(material),
            Kept::Mixed(mixture) => ScatteringRef::Mixed(mixture),
        };
        Site { p, ng, lift, frame, wo, scattering }
    }

    /// Finds its edges, and how the camera sees it; `None` where it does not.
    fn connect(&mut self, scene: &Scene) -> Option<()> {
        let Start { place, normals: [geometric, shading], .. } = self.start;
        let leaving = geometric * geometric.dot(shading).signum();
        let first = self.inner[0].p;
        let mut edges = Vec::with_capacity(self.length());
        let rays = [(offset_origin(place, leaving), first), (self.site(1).start_towards(place - first), place)];
        edges.push(Edge::of(rays));
        for i in 1..self.inner.len() {
            let (a, b) = (self.site(i), self.site(i + 1));
            edges.push(Edge::of([(a.start_towards(b.p - a.p), b.p), (b.start_towards(a.p - b.p), a.p)]));
        }
        let sight = scene.camera.sight(self.inner.last()?.p, self.lens)?;
        edges.push(Edge { directions: [sight.direction, -sight.direction], length2: 1.0 });
        (self.edges, self.sight) = (edges, Some(sight));
        Some(())
    }

    /// The unit direction of the ray from x_i, 0 < i < n, that way.
    fn direction(&self, i: usize, way: Way) -> Vec3 {
        match way {
            Way::ToLight => self.edges[i - 1].directions[1],
            Way::ToCamera => self.edges[i].directions[0],
        }
    }

    /// Its cosine by the geometric normal.
    fn cos(&self, i: usize, way: Way) -> f64 {
        f64::from(self.site(i).cos(self.direction(i, way)))
    }

    /// Directions at x_i in its frame, from where a subpath that goes that way comes and where it leads.
    fn turn(&self, i: usize, way: Way) -> [Vec3; 2] {
        let frame = &self.inner[i - 1].frame;
        let [light, camera] = [Way::ToLight, Way::ToCamera].map(|way| frame.to_local(self.direction(i, way)));
        if way == Way::ToLight { [camera, light] } else { [light, camera] }
    }

    fn is_smooth(&self, i: usize) -> bool {
        self.site(i).scattering.is_smooth::<P>()
    }

    /// The primary samples by which a subpath that goes that way scatters at x_i.
    fn invert(&self, i: usize, way: Way) -> Option<Inverse> {
        let [wo, wi] = self.turn(i, way);
        self.site(i).scattering.invert(wo, wi)
    }

    /// Whether x_i may be made by either subpath.
    fn is_invertible(&self, i: usize) -> bool {
        /// Shading normals lean by no more than rounding.
        const UPRIGHT: f32 = 1.0 - 1e-5;
        let upright = |vertex: &Vertex| vertex.ng.dot(vertex.frame.n).abs() > UPRIGHT;
        (self.is_smooth(i) || upright(&self.inner[i - 1]))
            && [Way::ToLight, Way::ToCamera].iter().all(|way| self.invert(i, *way).is_some())
    }

    /// The primary samples by which a light subpath starts.
    fn emission(&self, scene: &Scene) -> Option<EmissionInverse> {
        let Start { light, place, normals, triangle } = self.start;
        scene.emitters.light(light).invert_emission(place, triangle, normals, self.edges[0].directions[0])
    }

    /// Whether the light may be found by either subpath and by next-event estimation.
    fn is_light_invertible(&self, scene: &Scene) -> bool {
        let Start { light, place, triangle, .. } = self.start;
        let Vertex { p, lift, .. } = self.inner[0];
        self.emission(scene).is_some() && scene.emitters.light(light).invert_sample(p, lift, place, triangle).is_some()
    }

    /// All techniques that are exchanged with the present one, which is among them.
    fn techniques(&self, scene: &Scene) -> Vec<Technique> {
        let n = self.length();
        let invertible: Vec<bool> =
            (0..n).map(|i| if i == 0 { self.is_light_invertible(scene) } else { self.is_invertible(i) }).collect();
        let exchange = |s: usize| {
            let around = &invertible[s.saturating_sub(1)..=(s + 1).min(n - 1)];
            if around.contains(&false) { None } else { self.exchange(scene, s) }
        };
        let mut all = vec![Technique { light: self.light, ln_density: 0.0, ln_weighed: 0.0 }];
        let (mut ln_density, mut ln_weighed) = (0.0, 0.0);
        for s in self.light..n {
            let Some([density, weighed]) = exchange(s) else { break };
            (ln_density, ln_weighed) = (ln_density + density, ln_weighed + weighed);
            all.push(Technique { light: s + 1, ln_density, ln_weighed });
        }
        (ln_density, ln_weighed) = (0.0, 0.0);
        for s in (0..self.light).rev() {
            let Some([density, weighed]) = exchange(s) else { break };
            (ln_density, ln_weighed) = (ln_density - density, ln_weighed - weighed);
            all.push(Technique { light: s, ln_density, ln_weighed });
        }
        all.retain(|technique| self.has(scene, technique.light));
        all
    }

    /// Whether technique `s` can make the path.
    fn has(&self, scene: &Scene, s: usize) -> bool {
        let n = self.length();
        match s {
            0 => scene.emitters.kind(self.start.light) == EmitterKind::Surface,
            1 => self.is_smooth(1),
            _ => self.is_smooth(s - 1) && (s == n || self.is_smooth(s)),
        }
    }

    /// ln (p_{s+1}/p_s) and ln (π_{s+1}/π_s), of x_s that comes from the light or from the camera; `None` where either does
    /// not.
    fn exchange(&self, scene: &Scene, s: usize) -> Option<[f64; 2]> {
        let (light, camera) = (self.ln_from_light(scene, s), self.ln_from_camera(s)?);
        let ratio = [0, 1].map(|i| light[i] - camera[i]);
        ratio.iter().all(|ratio| ratio.is_finite()).then_some(ratio)
    }

    /// ln of the two densities of x_s per area when it comes from the light; of x₁ with what else changes when
    /// next-event estimation gives way to light subpaths.
    fn ln_from_light(&self, scene: &Scene, s: usize) -> [f64; 2] {
        let Start { light, place, normals, .. } = self.start;
        let edge = &self.edges[s.max(1) - 1];
        let [place_density, rest] = scene.emitters.emission_pdf::<P>(light, normals, self.edges[0].directions[0]);
        let looked_for = if scene.emitters.kind(light) == EmitterKind::Surface {
            let from = self.inner[0].p;
            let per_angle = f64::from(scene.emitters.pdf::<P>(light, from, place, normals[0]));
            per_angle * self.light_cos() / self.edges[0].length2
        } else {
            f64::from(place_density)
        };
        match s {
            0 => [looked_for.ln(); 2],
            1 => {
                let started = f64::from(place_density) * f64::from(rest) * self.cos(1, Way::ToLight) / edge.length2;
                [(started / looked_for).ln(); 2]
            }
            _ => {
                let per_area = (self.cos(s, Way::ToLight) / edge.length2).ln();
                self.ln_scatter(s - 1, Way::ToCamera).map(|ln| ln + per_area)
            }
        }
    }

    /// ln of the two densities of x_s per area when it comes from the camera.
    fn ln_from_camera(&self, s: usize) -> Option<[f64; 2]> {
        if s + 1 == self.length() {
            return Some([(f64::from(self.sight?.density) * self.cos(s, Way::ToCamera)).ln(); 2]);
        }
        let cos = if s == 0 { self.light_cos() } else { self.cos(s, Way::ToCamera) };
        let per_area = (cos / self.edges[s].length2).ln();
        Some(self.ln_scatter(s + 1, Way::ToLight).map(|ln| ln + per_area))
    }

    /// |cos| at the light.
    fn light_cos(&self) -> f64 {
        f64::from(self.start.normals[0].dot(self.edges[0].directions[0]).abs())
    }

    /// ln of the density of the direction in which a subpath that goes that way leaves x_i: as it is, and as it counts for
    /// the weights.
    fn ln_scatter(&self, i: usize, way: Way) -> [f64; 2] {
        let [wo, wi] = self.turn(i, way);
        let scattering = self.site(i).scattering;
        if self.is_smooth(i) {
            return [f64::from(scattering.evaluate::<P>(wo, wi).pdf).ln(); 2];
        }
        let Some(Inverse { choice: [start, end], .. }) = scattering.invert(wo, wi) else { return [f64::NAN; 2] };
        let eta = scattering.sample::<P>(wo, [0.5; 2], 0.5 * (start + end)).map_or(f64::NAN, |s| f64::from(s.eta));
        let narrowing = if way == Way::ToCamera { eta * eta } else { 1.0 };
        [(f64::from(end - start) * self.cos(i, way) * narrowing).ln(), 0.0]
    }
}

impl Edge {
    /// By rays from one end to the other and back: their origins and the points that they lead to.
    fn of(rays: [(Vec3, Vec3); 2]) -> Edge {
        Edge {
            directions: rays.map(|(from, to)| (to - from).normalize()),
            length2: rays[0].0.as_dvec3().distance_squared(rays[0].1.as_dvec3()),
        }
    }
}
