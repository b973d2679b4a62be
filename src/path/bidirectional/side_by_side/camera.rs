//! Vertices of camera subpaths.

use glam::Vec3;
use pulp::NullaryFnOnce;

use super::{
    super::{
        Arrays, CameraEnd, Connection, ONE, Site, add_connection, collect_hit, connections, join, scatter_camera_one,
        subpath,
        weights::{self, Tail},
    },
    Steps,
};
use crate::{
    math::{Frame, widest},
    path::{
        Contributions, Mapping,
        lanes::{Aims, N, Vectors, frame_and_back},
        vertex::{self, Carried, Decisions, Edge, Roulette},
    },
    sample::Proposals,
    scene::{
        Camera, Eye, NO_LIGHT, Profile, ScatteringRef, Scene,
        lights::{SHORT_OF_LIGHT, surface_direction_pdf},
        materials::{Diffuse, Evaluation, Material, Scatter},
        on_triangle,
    },
};

/// Vertices of a group of camera subpaths, as a structure of arrays; truths are 0 or 1.
pub struct Group {
    /// The edges that led there: start, direction, and what they carry.
    from: Vectors,
    direction: Vectors,
    throughput: Vectors,
    pdf: [f32; N],
    eta: [f32; N],
    survival: [f32; N],
    step: Steps,
    /// What was hit: corners and barycentric coordinates.
    corners: [Vectors; 3],
    u: [f32; N],
    v: [f32; N],
    /// Position and unit normal of the front, and whether it was hit from behind.
    p: Vectors,
    ng: Vectors,
    back: [u32; N],
    /// What the tail follows from: place on the lens and density of the camera's rays there for first vertices, square of the
    /// distance for others, and |cos|.
    lens: [[f32; N]; 2],
    seen: [f32; N],
    distance2: [f32; N],
    cos: [f32; N],
    inverse_density: [f64; N],
    shorter: [f64; N],
    earlier: [f64; N],
    /// Number of the appearance, whether the normal is to be turned round, whether the material is diffuse, and whether the
    /// surface is a light.
    appearance: [u32; N],
    flip: [u32; N],
    diffuse: [u32; N],
    shines: [u32; N],
    reflectance: Vectors,
    /// Primary samples: direction, place on the light, roulette.
    chosen_direction: [[f32; N]; 2],
    aims: Aims,
    chosen_survival: [f32; N],
    /// Connections to lights, and whether there are any.
    connected: [u32; N],
    shadow_origin: Vectors,
    shadow_direction: Vectors,
    shadow_end: [f32; N],
    contribution: Vectors,
    /// How dense scattering makes them over how dense they are; and the density of the vertex from the light's side, per area,
    /// and that of the direction back to the one before.
    ratio: [f32; N],
    light_density: [f32; N],
    back_pdf: [f32; N],
    weight: [f32; N],
    /// Next edges, and whether there are any.
    goes_on: [u32; N],
    next_origin: Vectors,
    next_direction: Vectors,
    next_throughput: Vectors,
    next_eta: [f32; N],
    next_survival: [f32; N],
    /// Densities of their directions, forwards and back, |cos|, and what follows.
    next_pdf: [[f32; N]; 2],
    next_cos: [f32; N],
    next_step: Steps,
}

impl Default for Group {
    fn default() -> Group {
        Group {
            from: Vectors::ZERO,
            direction: Vectors::ZERO,
            throughput: Vectors::ZERO,
            pdf: [1.0; N],
            eta: [1.0; N],
            survival: [1.0; N],
            step: Steps::NOWHERE,
            corners: [Vectors::ZERO; 3],
            u: [0.0; N],
            v: [0.0; N],
            p: Vectors::ZERO,
            ng: Vectors::ZERO,
            back: [0; N],
            lens: [[0.0; N]; 2],
            seen: [0.0; N],
            distance2: [0.0; N],
            cos: [0.0; N],
            inverse_density: [0.0; N],
            shorter: [0.0; N],
            earlier: [0.0; N],
            appearance: [0; N],
            flip: [0; N],
            diffuse: [0; N],
            shines: [0; N],
            reflectance: Vectors::ZERO,
            chosen_direction: [[0.0; N]; 2],
            aims: Aims::NONE,
            chosen_survival: [0.0; N],
            connected: [0; N],
            shadow_origin: Vectors::ZERO,
            shadow_direction: Vectors::ZERO,
            shadow_end: [0.0; N],
            contribution: Vectors::ZERO,
            ratio: [0.0; N],
            light_density: [0.0; N],
            back_pdf: [0.0; N],
            weight: [0.0; N],
            goes_on: [0; N],
            next_origin: Vectors::ZERO,
            next_direction: Vectors::ZERO,
            next_throughput: Vectors::ZERO,
            next_eta: [1.0; N],
            next_survival: [1.0; N],
            next_pdf: [[1.0; N]; 2],
            next_cos: [0.0; N],
            next_step: Steps::NOWHERE,
        }
    }
}

/// At every hit of a camera subpath, its vertex number `j`: emission, connections, and the next edge, which replaces the one
/// that led here. Returns how many subpaths go on.
pub fn scatter_camera<P: Profile, const HOW: u8>(
    mapping: &Mapping,
    j: u16,
    proposals: &Proposals,
    w: &mut Arrays,
    out: &mut Contributions,
) -> usize {
    let (scene, layout, techniques) = (mapping.scene(), mapping.layout(), mapping.kind().techniques());
    // the group and the lists are lent out while the other arrays are written to
    let mut group = w.camera_group.take().unwrap_or_default();
    let (slots, lanes) = (std::mem::take(&mut w.hit_slots), std::mem::take(&mut w.hit_lanes));
    let goes_on = j < layout.max_depth();
    let lit = scene.features.lights() > 0;
    let roulette = HOW != ONE && layout.roulette(j - 1);
    let compared = techniques.has(2, j);
    debug_assert!(techniques.hit && techniques.next_event && techniques.light, "weights that leave one of them out");
    let mut kept = 0;
    for (slots, lanes) in slots.chunks(N).zip(lanes.chunks(N)) {
        let g = &mut *group;
        fetch_hits(scene, w, j, [slots, lanes], g);
        widest(Meet { g, camera: &scene.camera, first: j == 1 });
        fetch_sides::<P>(scene, w, slots, g);
        if goes_on {
            let looks = fetch_choices::<HOW>(mapping, j, w, proposals, lanes, lit, g);
            let scatters = HOW != ONE || lanes.iter().any(|lane| w.chosen[*lane as usize].camera != j + 1);
            widest(Leave { g, looks, scatters, roulette, compared });
        }
        for (k, (&slot, &lane)) in slots.iter().zip(lanes).enumerate() {
            if !P::DIFFUSE && g.diffuse[k] == 0 {
                kept = scatter_camera_one::<P, HOW>(mapping, j, proposals, w, out, [slot, lane], kept);
                continue;
            }
            if g.shines[k] == 1 {
                let (i, tail) = (slot as usize, g.tail(k));
                let hit = w.hits.get(i).expect("misses are gone");
                let surface = scene.surface::<P>(hit, w.rays.origin(i), w.rays.direction(i));
                let end = CameraEnd { carried: w.carried[i], tail };
                collect_hit::<P, HOW>(mapping, j, w, out, [slot, lane], &surface, &end);
            }
            if !goes_on {
                continue;
            }
            let chosen = (HOW == ONE).then(|| w.chosen[lane as usize]);
            if lit && g.connected[k] == 1 && chosen.is_none_or(|chosen| chosen.is(1, j + 1)) {
                add_connection::<HOW>(mapping, w, lane, g.connection(k), [1, j + 1], g.survival[k]);
            }
            if techniques.inner {
                let end = CameraEnd { carried: g.carried(k), tail: g.tail(k) };
                join::<P, HOW>(mapping, j, proposals, w, lane, &end, &g.site(k, scene));
            }
            if g.goes_on[k] == 1 && chosen.is_none_or(|chosen| chosen.camera != j + 1) {
                w.go_on_from_camera(kept, [slot, lane], &g.edge(k), g.next_step.get(k));
                kept += 1;
            }
        }
    }
    (w.camera_group, w.hit_slots, w.hit_lanes) = (Some(group), slots, lanes);
    kept
}

/// Fetches what was hit, and from where.
#[inline(always)]
fn fetch_hits(scene: &Scene, w: &Arrays, j: u16, [slots, lanes]: [&[u32]; 2], g: &mut Group) {
    for (k, (&slot, &lane)) in slots.iter().zip(lanes).enumerate() {
        let i = slot as usize;
        let [a, b, c] = scene.flat_corners(w.hits.geometry[i], w.hits.primitive[i]);
        g.corners[0].set(k, a);
        g.corners[1].set(k, b);
        g.corners[2].set(k, c);
        (g.u[k], g.v[k]) = (w.hits.u[i], w.hits.v[i]);
        g.from.set(k, w.rays.origin(i));
        g.direction.set(k, w.rays.direction(i));
        let carried = &w.carried[i];
        g.throughput.set(k, carried.throughput);
        (g.pdf[k], g.eta[k], g.survival[k]) = (carried.pdf, carried.eta, carried.survival);
        if j == 1 {
            [g.lens[0][k], g.lens[1][k]] = w.lens[lane as usize];
        } else {
            g.step.set(k, w.steps[i]);
        }
    }
}

/// Finds where subpaths arrive, which way that faces and how likely that was.
struct Meet<'g> {
    g: &'g mut Group,
    camera: &'g Camera,
    first: bool,
}

impl NullaryFnOnce for Meet<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Meet { g, camera, first } = self;
        for j in 0..N {
            let (p, ng) = on_triangle([g.corners[0].get(j), g.corners[1].get(j), g.corners[2].get(j)], g.u[j], g.v[j]);
            let cos = ng.dot(g.direction.get(j));
            g.back[j] = u32::from(cos >= 0.0);
            g.p.set(j, p);
            g.ng.set(j, ng);
            g.distance2[j] = (p - g.from.get(j)).length_squared();
            g.cos[j] = cos.abs();
        }
        if !first {
            for j in 0..N {
                let tail = g.step.get(j).arrive(g.distance2[j], g.cos[j]);
                Tail { inverse_density: g.inverse_density[j], shorter: g.shorter[j], earlier: g.earlier[j] } = tail;
            }
            return;
        }
        let camera = *camera; // what the loop writes to cannot be part of it
        match camera.eye() {
            Eye::Pinhole => see(&camera, Eye::Pinhole, g),
            eye => see(&camera, eye, g),
        }
        for j in 0..N {
            let tail = subpath::seen_with(g.seen[j], g.cos[j]);
            Tail { inverse_density: g.inverse_density[j], shorter: g.shorter[j], earlier: g.earlier[j] } = tail;
        }
    }
}

/// How dense the camera's rays are there.
#[inline(always)]
fn see(camera: &Camera, eye: Eye, g: &mut Group) {
    for j in 0..N {
        g.seen[j] = camera.density_from(eye, g.p.get(j), [g.lens[0][j], g.lens[1][j]]);
    }
}

/// Fetches the materials.
#[inline(always)]
fn fetch_sides<P: Profile>(scene: &Scene, w: &Arrays, slots: &[u32], g: &mut Group) {
    for (k, &slot) in slots.iter().enumerate() {
        let (side, material) = scene.side(w.hits.geometry[slot as usize], g.back[k] == 1);
        (g.appearance[k], g.flip[k]) = (side.appearance, u32::from(side.flip));
        g.shines[k] = u32::from(side.light != NO_LIGHT);
        g.diffuse[k] = match material {
            Material::Diffuse(diffuse) => {
                g.reflectance.set(k, diffuse.reflectance);
                1
            }
            _ if P::DIFFUSE => unreachable!("a profile with diffuse materials only"),
            _ => 0,
        };
    }
}

/// Fetches the primary samples and the triangles of lights that they choose; whether any lane looks at one.
#[inline(always)]
fn fetch_choices<const HOW: u8>(
    mapping: &Mapping,
    j: u16,
    w: &Arrays,
    proposals: &Proposals,
    lanes: &[u32],
    lit: bool,
    g: &mut Group,
) -> bool {
    let (scene, layout, bounce) = (mapping.scene(), mapping.layout(), j - 1);
    let (first, choices) = (layout.bounce(bounce), layout.choices(bounce));
    let mut looks = false;
    for (k, &lane) in lanes.iter().enumerate() {
        let at = lane as usize;
        let choices = choices.map(|block| proposals.block(block, at));
        let decisions = Decisions::new(layout, bounce, proposals.block(first, at), choices);
        [g.chosen_direction[0][k], g.chosen_direction[1][k]] = decisions.direction;
        g.chosen_survival[k] = decisions.roulette.unwrap_or(0.0);
        if lit && (HOW != ONE || w.chosen[at].is(1, j + 1)) {
            g.aims.fetch(k, scene, decisions.light_place, decisions.light);
            looks = true;
        }
    }
    looks
}

/// Connects vertices to lights, and scatters there.
struct Leave<'g> {
    g: &'g mut Group,
    /// Whether any look at a light.
    looks: bool,
    /// Whether any go on.
    scatters: bool,
    roulette: bool,
    /// Whether ending a light subpath at the next vertex is one of the techniques.
    compared: bool,
}

impl NullaryFnOnce for Leave<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Leave { g, looks, scatters, roulette, compared } = self;
        if looks {
            look_at_lights(g);
            weigh(compared, g);
        }
        if !scatters {
            return;
        }
        if roulette {
            scatter::<true>(g);
        } else {
            scatter::<false>(g);
        }
        for j in 0..N {
            let densities = Some([g.next_pdf[0][j], g.next_pdf[1][j]]);
            let step = g.tail(j).leave(densities, g.next_cos[j], compared);
            g.next_step.set(j, step);
        }
    }
}

/// Next-event estimation: the lights' contributions if nothing stands between.
#[inline(always)]
fn look_at_lights(g: &mut Group) {
    for j in 0..N {
        let (p, ng) = (g.p.get(j), g.ng.get(j));
        let (frame, wo) = g.towards_eye(j);
        let material = Diffuse { reflectance: g.reflectance.get(j) };
        let (light, shines) = g.aims.sample_anyhow(j, p, ng);
        let wi = frame.to_local(light.wi);
        let Evaluation { value, pdf } = material.evaluate(wo, wi);
        let (connection, lit) = connections::looked_at(&light, g.throughput.get(j) * value);
        g.connected[j] = u32::from(shines & lit);
        let Connection { origin, direction, tfar, contribution } = connection;
        g.shadow_origin.set(j, origin);
        g.shadow_direction.set(j, direction);
        g.shadow_end[j] = tfar;
        g.contribution.set(j, contribution);
        let distance = tfar / SHORT_OF_LIGHT;
        let rest = surface_direction_pdf(light.normals, -light.wi);
        g.ratio[j] = pdf / light.pdf;
        g.light_density[j] = rest * ng.dot(light.wi).abs() / (distance * distance);
        g.back_pdf[j] = material.evaluate(wi, wo).pdf;
    }
}

/// Weighs those by the other techniques.
#[inline(always)]
fn weigh(compared: bool, g: &mut Group) {
    for j in 0..N {
        let (tail, ratio) = (g.tail(j), f64::from(g.ratio[j]));
        let back = if tail.earlier > 0.0 { f64::from(g.back_pdf[j]) } else { 0.0 };
        let others = ratio * ratio + tail.others(f64::from(g.light_density[j]), back, compared);
        g.weight[j] = weights::weight(others);
    }
    for j in 0..N {
        g.contribution.set(j, g.contribution.get(j) * g.weight[j]);
    }
}

/// Scattering and, where it is played, roulette.
#[inline(always)]
fn scatter<const ROULETTE: bool>(g: &mut Group) {
    for j in 0..N {
        let (frame, wo) = g.towards_eye(j);
        let (p, ng) = (g.p.get(j), g.ng.get(j));
        let material = Diffuse { reflectance: g.reflectance.get(j) };
        let (sample, above) = material.sample_anyhow(wo, [g.chosen_direction[0][j], g.chosen_direction[1][j]]);
        let u = ROULETTE.then_some(g.chosen_survival[j]);
        let (edge, goes_on) = vertex::scattered((p, ng, &frame), sample, &g.carried(j), u, Roulette::Path);
        let Edge { origin, direction, carried } = edge;
        g.goes_on[j] = u32::from(above & goes_on);
        g.next_origin.set(j, origin);
        g.next_direction.set(j, direction);
        g.next_throughput.set(j, carried.throughput);
        (g.next_eta[j], g.next_survival[j]) = (carried.eta, carried.survival);
        let back = material.evaluate(frame.to_local(direction), wo).pdf;
        [g.next_pdf[0][j], g.next_pdf[1][j]] = [carried.pdf, back];
        g.next_cos[j] = ng.dot(direction).abs();
    }
}

impl Group {
    /// The frame on the side that is seen, and from where.
    #[inline(always)]
    fn towards_eye(&self, j: usize) -> (Frame, Vec3) {
        frame_and_back(self.ng.get(j), self.flip[j], self.direction.get(j))
    }

    #[inline(always)]
    fn tail(&self, j: usize) -> Tail {
        Tail { inverse_density: self.inverse_density[j], shorter: self.shorter[j], earlier: self.earlier[j] }
    }

    #[inline(always)]
    fn carried(&self, j: usize) -> Carried {
        Carried { throughput: self.throughput.get(j), pdf: self.pdf[j], eta: self.eta[j], survival: self.survival[j] }
    }

    #[inline(always)]
    fn connection(&self, j: usize) -> Connection {
        Connection {
            origin: self.shadow_origin.get(j),
            direction: self.shadow_direction.get(j),
            tfar: self.shadow_end[j],
            contribution: self.contribution.get(j),
        }
    }

    #[inline(always)]
    fn site<'s>(&self, j: usize, scene: &'s Scene) -> Site<'s> {
        let ((p, ng), (frame, wo)) = ((self.p.get(j), self.ng.get(j)), self.towards_eye(j));
        Site { p, ng, lift: ng, frame, wo, scattering: ScatteringRef::Plain(scene.material(self.appearance[j])) }
    }

    #[inline(always)]
    fn edge(&self, j: usize) -> Edge {
        let carried = Carried {
            throughput: self.next_throughput.get(j),
            pdf: self.next_pdf[0][j],
            eta: self.next_eta[j],
            survival: self.next_survival[j],
        };
        Edge { origin: self.next_origin.get(j), direction: self.next_direction.get(j), carried }
    }
}
