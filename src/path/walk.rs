//! A path told vertex by vertex, for people: what the scalar mappings do, with every number that a contribution is
//! made of.

use glam::Vec3;

use crate::scene::{
    NO_LIGHT, Ray, Rgb, Scene, Surface,
    lights::{Emission, EmitterKind},
};

/// One thing that happens along a path.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// In words, such as `camera vertex 2: diffuse`.
    pub what: String,
    /// The numbers that come with it, in the order in which they are made.
    pub quantities: Vec<Quantity>,
}

/// A number or a few of them, with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// What it is.
    pub name: &'static str,
    /// Its values: coordinates, channels, or one number.
    pub values: Vec<f64>,
    /// ∞ is a value like others: a density where there is nothing to choose.
    pub may_be_infinite: bool,
}

impl Quantity {
    /// Whether nothing is wrong with it.
    pub fn is_fine(&self) -> bool {
        let fine = |v: &f64| if self.may_be_infinite { !v.is_nan() } else { v.is_finite() };
        self.values.iter().all(fine)
    }
}

impl Event {
    fn new(what: String) -> Event {
        Event { what, quantities: Vec::new() }
    }

    fn with(mut self, name: &'static str, values: impl IntoIterator<Item = f32>) -> Event {
        let values = values.into_iter().map(f64::from).collect();
        self.quantities.push(Quantity { name, values, may_be_infinite: false });
        self
    }

    /// A density, which is infinite where there was nothing to choose.
    fn with_density(mut self, name: &'static str, value: f64) -> Event {
        self.quantities.push(Quantity { name, values: vec![value], may_be_infinite: true });
        self
    }

    /// The first of its numbers that something is wrong with.
    pub fn fault(&self) -> Option<&Quantity> {
        self.quantities.iter().find(|quantity| !quantity.is_fine())
    }
}

/// Where a path first had a number that is not finite: `camera vertex 3: diffuse: throughput`; `None` where all are.
pub fn first_fault(events: &[Event]) -> Option<String> {
    events.iter().find_map(|event| event.fault().map(|quantity| format!("{}: {}", event.what, quantity.name)))
}

/// Who listens to a path.
#[derive(Debug, Default)]
pub struct Narration(Option<Vec<Event>>);

impl Narration {
    /// Nobody.
    pub fn unheard() -> Narration {
        Narration(None)
    }

    /// Somebody who keeps all of it.
    pub fn kept() -> Narration {
        Narration(Some(Vec::new()))
    }

    /// Tells an event to who listens.
    pub(super) fn tell(&mut self, event: impl FnOnce() -> Event) {
        if let Some(events) = &mut self.0 {
            events.push(event());
        }
    }

    /// What was told.
    pub fn events(self) -> Vec<Event> {
        self.0.unwrap_or_default()
    }
}

/// The end of a path that a vertex belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Camera,
    Light,
}

impl Side {
    fn name(self) -> &'static str {
        match self {
            Side::Camera => "camera",
            Side::Light => "light",
        }
    }

    /// What its subpath carries.
    fn carried(self) -> &'static str {
        match self {
            Side::Camera => "throughput",
            Side::Light => "flux",
        }
    }
}

/// The camera's subpath starts.
pub(super) fn camera(film: [f32; 2], lens: [f32; 2], ray: &Ray) -> Event {
    Event::new("camera".into())
        .with("film", film)
        .with("lens", lens)
        .with("position", ray.origin.to_array())
        .with("direction", ray.direction.to_array())
}

/// The light's subpath starts.
pub(super) fn light(emission: &Emission) -> Event {
    let kind = match emission.kind {
        EmitterKind::Surface => "surface",
        EmitterKind::Point => "point",
        EmitterKind::SingleDirection => "single direction",
        EmitterKind::Surrounding => "surroundings",
    };
    Event::new(format!("light {}: {kind}", emission.light))
        .with("position", emission.origin.to_array())
        .with("normal", emission.normals[0].to_array())
        .with("direction", emission.direction.to_array())
        .with_density("density of place", f64::from(emission.pdf_place))
        .with_density("density of direction", f64::from(emission.pdf_rest))
        .with("flux", emission.weight.to_array())
}

/// A subpath arrives at its vertex number `number`, carrying that, in a direction of that density per solid angle.
pub(super) fn vertex(
    scene: &Scene,
    (side, number): (Side, u16),
    surface: &Surface,
    carried: Rgb,
    density: f64,
) -> Event {
    let parts = scene.appearances()[surface.appearance as usize].parts();
    let mut what = parts.iter().map(|part| part.material.name()).collect::<Vec<_>>().join(" + ");
    if surface.light != NO_LIGHT {
        what += &format!(", light {}", surface.light);
    }
    Event::new(format!("{} vertex {number}: {what}", side.name()))
        .with("position", surface.p.to_array())
        .with("geometric normal", surface.ng.to_array())
        .with("shading normal", surface.frame.n.to_array())
        .with("towards where it came from", surface.frame.to_world(surface.wo).to_array())
        .with_density("density of direction", density)
        .with(side.carried(), carried.to_array())
}

/// A subpath goes on from a vertex; `density` of the direction per solid angle, infinite for a perfect lobe.
pub(super) fn scattered(
    (side, number): (Side, u16),
    surface: &Surface,
    direction: Vec3,
    carried: Rgb,
    density: f64,
) -> Event {
    let through = (surface.frame.to_local(direction).z > 0.0) != (surface.wo.z > 0.0);
    let event = if through { "transmission" } else { "reflection" };
    let lobe = if density == f64::INFINITY { "perfect " } else { "" };
    Event::new(format!("{} vertex {number}: {lobe}{event}", side.name()))
        .with("direction", direction.to_array())
        .with_density("density of direction", density)
        .with(side.carried(), carried.to_array())
}

/// A subpath ends at a vertex, or beyond it.
pub(super) fn ended((side, number): (Side, u16), why: &str) -> Event {
    Event::new(format!("{} vertex {number}: {why}", side.name()))
}

/// What a technique contributes.
pub(super) struct Found<'a> {
    /// Vertices on the light's side and on the camera's, the place on the lens included.
    pub technique: [u16; 2],
    /// Its name.
    pub name: &'a str,
    /// What it is made of, channel by channel where that is how it is.
    pub factors: Vec<(&'static str, Rgb)>,
    /// Densities that it, or its weight, is made of.
    pub densities: Vec<(&'static str, f64)>,
    /// Weighed against other techniques.
    pub contribution: Rgb,
    /// Whether nothing is in the way.
    pub seen: bool,
    /// Where on the film, if it is a splat.
    pub film: Option<[f32; 2]>,
    /// What the point contributes there so far: where it lies, or all splats.
    pub sum: Rgb,
}

/// A contribution.
pub(super) fn found(found: Found) -> Event {
    let [s, t] = found.technique;
    let hidden = if found.seen { "" } else { ", hidden" };
    let mut event = Event::new(format!("{} (s = {s}, t = {t}){hidden}", found.name));
    for (name, density) in found.densities {
        event = event.with_density(name, density);
    }
    for (name, factor) in found.factors {
        event = event.with(name, factor.to_array());
    }
    if let Some(film) = found.film {
        event = event.with("film", film);
    }
    event.with("weighed contribution", found.contribution.to_array()).with("sum so far", found.sum.to_array())
}
