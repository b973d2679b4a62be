//! Light in plain view: lamps and sky that the camera sees directly or by way of perfect lobes only.
//!
//! Only camera subpaths find it (s = 0), nothing but the place on the film and the choices among lobes decide on it, and a lamp in
//! a mirror is as bright as ever while it may fill a ten-thousandth of a pixel. A chain that has found such a path is where nothing
//! around is as bright, up to 10⁴ times so: it stays for as many steps, and finds it as rarely. (On `caustic` these paths have 5 %
//! of the light in a few pixels of two balls.) So they are left to open points, and these look several times, as a look has a ray
//! or two where a point with all its connections has fifty.

use super::{Arrays, keep_hits, outcome, start_at_camera};
use crate::{
    embree::MISS,
    path::{
        Contributions, Mapping,
        tracing::{Kind, Tracing},
        vertex::{self, Decisions, Roulette},
    },
    rng::{Counter, Purpose, unit_f32},
    sample::Proposals,
    scene::{NO_LIGHT, Profile, Rgb},
};

/// Looks for each open point, in a grid of [`COLUMNS`] within its pixel.
const LOOKS: u16 = 8;
/// Columns of the grid, a power of two; the rows are half as many.
const COLUMNS: u16 = 4;

/// Adds what is in plain view as outcomes that nobody can choose.
pub(super) fn look<P: Profile>(
    mapping: &Mapping,
    proposals: &Proposals,
    tracing: &mut Tracing,
    w: &mut Arrays,
    out: &mut Contributions,
) {
    for number in 0..LOOKS {
        let words = |lane: u32, block: u16| {
            let counter = proposals.counters[lane as usize];
            proposals.rng.words(Counter { purpose: Purpose::View, replica: number, ..counter }, block)
        };
        for &lane in &w.live {
            let at = lane as usize;
            let [x, y, u, v] = proposals.beside(at, in_cell(number, words(lane, 0))).map(unit_f32);
            (w.film[at], w.lens[at]) = ([x, y], [u, v]);
        }
        start_at_camera(mapping, w);
        for j in 1..=mapping.layout().max_depth() {
            if w.lanes.is_empty() {
                break;
            }
            let kind = if j == 1 { Kind::Camera } else { Kind::Bounce };
            tracing.closest(mapping.scene(), mapping.widths(), kind, &w.rays, &mut w.hits, out);
            see_background::<P>(mapping, w, out);
            keep_hits(w);
            go_on::<P>(mapping, j, words, w, out);
        }
    }
}

/// Moves a place that is uniform in the pixel to a cell of the grid.
fn in_cell(number: u16, [x, y, u, v]: [u32; 4]) -> [u32; 4] {
    let (columns, rows) = (COLUMNS.trailing_zeros(), (LOOKS / COLUMNS).trailing_zeros());
    let [column, row] = [number % COLUMNS, number / COLUMNS].map(u32::from);
    [(column << (32 - columns)) | (x >> columns), (row << (32 - rows)) | (y >> rows), u, v]
}

/// Adds the sky where it is seen.
fn see_background<P: Profile>(mapping: &Mapping, w: &Arrays, out: &mut Contributions) {
    if P::FLAT_MESHES || mapping.scene().emitters.surrounding_light().is_none() {
        return;
    }
    for i in (0..w.lanes.len()).filter(|i| w.hits.geometry[*i] == MISS) {
        if let Some((radiance, _)) = mapping.scene().emitters.surrounding::<P>(w.rays.direction(i)) {
            add(w, out, w.lanes[i], w.carried[i].throughput * radiance);
        }
    }
}

/// At every hit, vertex number `j`: adds the light that the surface emits, and goes on by perfect lobes.
fn go_on<P: Profile>(
    mapping: &Mapping,
    j: u16,
    words: impl Fn(u32, u16) -> [u32; 4],
    w: &mut Arrays,
    out: &mut Contributions,
) {
    let (scene, layout) = (mapping.scene(), mapping.layout());
    let mut kept = 0;
    for k in 0..w.hit_slots.len() {
        let (i, lane) = (w.hit_slots[k] as usize, w.hit_lanes[k]);
        let (origin, direction) = (w.rays.origin(i), w.rays.direction(i));
        let surface = scene.surface::<P>(w.hits.get(i).expect("misses are gone"), origin, direction);
        let carried = w.carried[i];
        if surface.light != NO_LIGHT {
            let radiance = scene.emitters.radiance::<P>(surface.light, surface.uv);
            add(w, out, lane, carried.throughput * radiance);
        }
        if j == layout.max_depth() {
            continue;
        }
        let choices = layout.choices(j - 1).map(|_| words(lane, 2 * j));
        let decisions = Decisions::new(layout, j - 1, words(lane, 2 * j - 1), choices);
        let edge = vertex::scatter::<P>(&surface, &carried, &decisions, Roulette::Path);
        let Some(edge) = edge.filter(|edge| edge.carried.pdf == f32::INFINITY) else { continue };
        w.lanes[kept] = lane;
        w.carried[kept] = edge.carried;
        w.rays.set(kept, edge.origin, edge.direction, f32::MAX);
        kept += 1;
    }
    w.lanes.truncate(kept);
    w.carried.truncate(kept);
    w.rays.truncate(kept);
}

/// Adds what one look has seen.
fn add(w: &Arrays, out: &mut Contributions, lane: u32, radiance: Rgb) {
    if radiance != Rgb::ZERO {
        out.outcomes.push(lane as usize, outcome(w.film[lane as usize], radiance / f32::from(LOOKS), 0.0));
    }
}
