//! Starts of light subpaths: a place, and a direction in which light leaves it.
//!
//! Every light draws two pairs of numbers: `place` with the density [`Emission::pdf_place`], `direction` with
//! [`Emission::pdf_rest`]. For lights at infinity the place is a direction, and the rest a point of the disk through
//! which all their parallel rays pass that can meet the scene.
//! Source: Veach 1997, sections 8.3.2 and 10.3; Pharr, Jakob & Humphreys 2016, section 16.1.2.

use glam::Vec3;

use crate::{
    math::{Frame, warp},
    scene::Rgb,
};

/// A sphere around the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre.
    pub center: Vec3,
    /// Its radius, > 0.
    pub radius: f32,
}

impl Ball {
    /// A thousandth larger, so that what touches the sphere lies inside for all that rounding does, and rays that start
    /// on it start before all surfaces.
    pub fn enlarged(self) -> Ball {
        /// Thousands of steps of `f32` in a coordinate as large as the radius.
        const BY: f32 = 1.001;
        /// For scenes far from the origin, whose coordinates are coarser than their size suggests.
        const STEPS: f32 = 8.0 * f32::EPSILON;
        Ball { radius: self.radius * BY + self.center.abs().max_element() * STEPS, ..self }
    }

    /// The start of a ray in that direction, drawn from the disk that touches the ball on the side it comes from, and its
    /// density per area of that disk, 1/(πR²).
    #[inline(always)]
    fn start(&self, direction: Vec3, u: [f32; 2]) -> (Vec3, f32) {
        let Frame { s, t, .. } = Frame::new(direction);
        let d = warp::disk(u);
        let origin = self.center + (s * d.x + t * d.y - direction) * self.radius;
        (origin, self.pdf())
    }

    /// Density per area of a disk of its radius: 1/(πR²).
    #[inline(always)]
    pub(super) fn pdf(&self) -> f32 {
        warp::INV_PI / (self.radius * self.radius)
    }
}

/// Where lights are, and with it what can find them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmitterKind {
    /// On a surface: rays hit it.
    Surface,
    /// In a point, which no ray hits.
    Point,
    /// At infinity in a single direction, which no ray takes by chance.
    SingleDirection,
    /// At infinity all around: rays that leave the scene meet it.
    Surrounding,
}

/// The start of a light subpath.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Where the ray starts: on the light's surface (not yet offset), at the point light, or for lights at infinity (and
    /// single directions) on a disk just outside the scene's bounding sphere.
    pub origin: Vec3,
    /// Geometric normal there on the shining side, with the length that
    /// [`offset_origin`](crate::math::offset_origin) needs, 1; zero for lights without surface.
    pub ng: Vec3,
    /// Geometric and shading unit normal there, as in [`LightSample`](super::LightSample); zero for lights without
    /// surface.
    pub normals: [Vec3; 2],
    /// Unit direction in which light leaves.
    pub direction: Vec3,
    /// Radiance · |cos| / (`pdf_place` · `pdf_rest`), per channel: a power, W up to the unit of the scene. For points
    /// intensity stands for radiance · |cos|, for single directions irradiance.
    pub weight: Rgb,
    /// Radiance over `pdf_place`, whatever the direction; zero for lights without surface.
    pub of_place: Rgb,
    /// Density of the place: per area on surfaces; per solid angle of the direction for lights all around; 1 for points
    /// and single directions. Times the probability of choosing the light.
    pub pdf_place: f32,
    /// Density of the rest: of the direction per solid angle for surfaces and points; per area of the disk, 1/(πR²), for
    /// lights at infinity and single directions.
    pub pdf_rest: f32,
    /// What kind of light it is.
    pub kind: EmitterKind,
    /// Index of the light, as [`Emitters`](crate::scene::Emitters) count them; 0 from a light itself.
    pub light: u32,
}

/// The numbers for which a light starts a subpath at a certain place in a certain direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionInverse {
    /// Those of the place; `None` where any will do.
    pub place: Option<[f32; 2]>,
    /// Those of the direction.
    pub direction: [f32; 2],
}

/// The inverse of [`from_surface`]'s direction.
pub(super) fn invert_surface(place: [f32; 2], normals: [Vec3; 2], direction: Vec3) -> Option<EmissionInverse> {
    let local = Frame::new(shining_side(normals)).to_local(direction);
    (local.z > 0.0).then(|| EmissionInverse { place: Some(place), direction: warp::from_cosine_hemisphere(local) })
}

/// The geometric normal on the side that shines: that of the shading normal.
#[inline(always)]
fn shining_side([geometric, shading]: [Vec3; 2]) -> Vec3 {
    geometric * geometric.dot(shading).signum()
}

/// From the place `q` of a surface that emits `radiance`, chosen with density `pdf_area`: a direction around the
/// geometric normal of the shining side in proportion to its cosine; of no weight where that is behind the shading normal.
///
/// [`Light::sample`](super::Light::sample) goes by the shading normal alone: where that leans, it also finds light behind
/// the geometric one, which no subpath starts with ([`surface_pdf`] is 0 there).
#[inline(always)]
pub(super) fn from_surface(q: Vec3, normals: [Vec3; 2], radiance: Rgb, pdf_area: f32, direction: [f32; 2]) -> Emission {
    let ng = shining_side(normals);
    let direction = Frame::new(ng).to_world(warp::cosine_hemisphere(direction));
    let [pdf_place, pdf_rest] = surface_pdf(pdf_area, normals, direction);
    let of_place = radiance / pdf_place;
    Emission {
        origin: q,
        ng,
        normals,
        direction,
        weight: if pdf_rest > 0.0 { of_place / warp::INV_PI } else { Rgb::ZERO }, // cos/pdf_rest is π
        of_place,
        pdf_place,
        pdf_rest,
        kind: EmitterKind::Surface,
        light: 0,
    }
}

/// The densities of [`from_surface`]: that of the place, and that of the direction, which is 0 behind either normal.
#[inline(always)]
pub(super) fn surface_pdf(pdf_area: f32, normals: [Vec3; 2], direction: Vec3) -> [f32; 2] {
    [pdf_area, surface_direction_pdf(normals, direction)]
}

/// The second of them.
#[inline(always)]
pub(crate) fn surface_direction_pdf(normals: [Vec3; 2], direction: Vec3) -> f32 {
    let in_front = direction.dot(normals[1]) > 0.0;
    if in_front { warp::cosine_hemisphere_pdf(direction.dot(shining_side(normals))) } else { 0.0 }
}

/// From a point whose intensity in that direction, drawn with density `pdf` per solid angle, is `intensity`.
#[inline(always)]
pub(super) fn from_point(position: Vec3, direction: Vec3, intensity: Rgb, pdf: f32) -> Emission {
    Emission {
        origin: position,
        ng: Vec3::ZERO,
        normals: [Vec3::ZERO; 2],
        direction,
        weight: intensity / pdf,
        of_place: Rgb::ZERO,
        pdf_place: 1.0,
        pdf_rest: pdf,
        kind: EmitterKind::Point,
        light: 0,
    }
}

/// From infinity in a direction drawn with density `pdf`: of radiance per solid angle, or 1 for the irradiance of a
/// single direction.
#[inline(always)]
pub(super) fn from_infinity(
    scene: Ball,
    direction: Vec3,
    radiance: Rgb,
    pdf: f32,
    kind: EmitterKind,
    on_disk: [f32; 2],
) -> Emission {
    let (origin, pdf_rest) = scene.start(direction, on_disk);
    Emission {
        origin,
        ng: Vec3::ZERO,
        normals: [Vec3::ZERO; 2],
        direction,
        weight: radiance / (pdf * pdf_rest),
        of_place: Rgb::ZERO,
        pdf_place: pdf,
        pdf_rest,
        kind,
        light: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        rng::{Counter, Purpose, Rng, unit_f32},
        scene::{
            FullProfile, Mesh,
            description::tests::with_lights,
            emitters::{Emitters, tests::lights as that_are_hit},
            lights::{Directional, Light, MeshLight, Point, Spot, envmap},
        },
    };

    /// What the lights shine into.
    const SCENE: Ball = Ball { center: Vec3::new(0.1, -0.2, 0.3), radius: 2.0 };

    /// One of every kind.
    fn lights() -> Vec<Light> {
        let point = Point { position: Vec3::new(0.5, 0.1, 1.5), intensity: Rgb::new(1.0, 2.0, 3.0) };
        let downwards = Vec3::new(0.2, 0.1, -1.0).normalize();
        let mut lights = that_are_hit();
        lights.extend([
            Light::Point(point),
            Light::Spot(Spot::new(point, Vec3::new(-0.4, 0.0, -1.0).normalize(), 15.0, 40.0)),
            Light::Directional(Directional { direction: downwards, irradiance: Rgb::new(3.0, 2.0, 1.0) }),
            Light::Envmap(envmap::tests::sky()),
        ]);
        lights
    }

    /// Triangles whose shading normals lean up to 60° off, and one whose shading normals point to the other side.
    fn bent() -> Light {
        let corners = [[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [0.0, 1.0, 3.0], [3.0, 1.0, 1.0], [3.0, -1.0, 1.0]];
        let mut mesh = Mesh::new(corners.map(Vec3::from).to_vec(), vec![[0, 2, 1], [1, 3, 4]]);
        let normals = [[-1.5, 0.0, -1.0], [0.3, 0.0, -1.0], [0.0, 1.4, -1.0], [0.5, 0.5, 1.0], [-1.0, 0.0, -0.5]];
        mesh.normals = normals.map(|n| Vec3::from(n).normalize()).to_vec();
        Light::MeshLight(MeshLight::new(mesh.into(), Rgb::ONE.into()))
    }

    /// Emissions of a light, `None` among them, and for each a pair of numbers left over.
    fn emissions(light: &Light, replica: u16, count: u64) -> impl Iterator<Item = (Option<Emission>, [f32; 2])> {
        let rng = Rng::new(21);
        (0..count).map(move |step| {
            let counter = Counter { ladder: 0, replica, step, purpose: Purpose::Primary };
            let [a, b, c, d] = rng.words(counter, 0).map(unit_f32);
            let [e, f, ..] = rng.words(counter, 1).map(unit_f32);
            (light.emit::<FullProfile>([a, b], [c, d], SCENE), [e, f])
        })
    }

    /// What leaves the light there, as [`Light::sample`] and [`Light::surrounding`] have it: radiance times cosine, or
    /// what stands for that.
    fn leaving(light: &Light, e: &Emission) -> Rgb {
        match e.kind {
            EmitterKind::Surface => Rgb::splat(e.ng.dot(e.direction)), // all have radiance 1
            EmitterKind::Surrounding => light.surrounding(-e.direction).0,
            // at distance 1
            _ => light
                .sample::<FullProfile>(e.origin + e.direction, -e.direction, [0.0; 2])
                .map_or(Rgb::ZERO, |s| s.weight),
        }
    }

    #[test]
    fn weight_is_what_leaves_over_the_densities() {
        for light in lights().iter().chain([&bent()]) {
            let mut some = 0;
            for e in emissions(light, 0, 4096).filter_map(|(e, _)| e) {
                assert_eq!(e.kind, light.kind());
                if e.kind == EmitterKind::Surface {
                    assert!((e.of_place * e.pdf_place - Rgb::ONE).abs().max_element() < 1e-5, "{e:?} of {light:?}");
                }
                some += u32::from(e.weight != Rgb::ZERO);
                if e.pdf_rest == 0.0 {
                    continue; // behind the shading normal
                }
                assert!((e.direction.length() - 1.0).abs() < 1e-5, "{e:?}");
                let [place, rest] = light.emission_pdf::<FullProfile>(e.normals, e.direction, SCENE);
                assert_eq!(rest, e.pdf_rest, "{e:?} of {light:?}");
                // directions of a picture may be found in the neighbouring cell
                if !matches!(light, Light::Envmap(_)) || (place / e.pdf_place - 1.0).abs() < 1e-3 {
                    assert!((place / e.pdf_place - 1.0).abs() < 1e-5, "{place}, {e:?} of {light:?}");
                    let expected = leaving(light, &e);
                    let error = (e.weight * (e.pdf_place * e.pdf_rest) - expected).abs().max_element();
                    // what falls off to nothing has digits by its whole only
                    assert!(error < 2e-3 * expected.max_element() + 1e-4, "{expected}, {e:?} of {light:?}");
                }
            }
            assert!(some > 2000, "{some} of 4096 of {light:?}");
        }
    }

    /// All lights but those at infinity, spots and skies: the numbers that were drawn start the subpath again, and those
    /// found for a place look for it, up to rounding.
    #[test]
    fn starts_are_inverted() {
        for light in lights().iter().chain([&bent()]) {
            let mut inverted = 0;
            for (e, u) in emissions(light, 0, 1024) {
                let Some(e) = e.filter(|e| e.weight != Rgb::ZERO) else { continue };
                let rng = Rng::new(21);
                let counter = Counter { ladder: 0, replica: 0, step: 0, purpose: Purpose::Primary };
                let [a, b, ..] = rng.words(counter, 0).map(unit_f32);
                // of a light with one triangle, or of the one that has the place
                let triangle = (0..2).find(|t| {
                    light.invert_emission(e.origin, *t, e.normals, e.direction).is_some_and(|inverse| {
                        let again =
                            light.emit::<FullProfile>(inverse.place.unwrap_or([a, b]), inverse.direction, SCENE);
                        again.is_some_and(|again| {
                            (again.origin - e.origin).length() < 1e-4 && (again.direction - e.direction).length() < 1e-4
                        })
                    })
                });
                let Some(triangle) = triangle else { continue };
                inverted += 1;
                let from = e.origin + e.direction + 0.1 * warp::sphere(u);
                let normal = -e.direction;
                let Some(shape) = light.invert_sample(from, normal, e.origin, triangle) else {
                    panic!("{light:?} starts subpaths that next-event estimation does not find")
                };
                let hidden = (from - e.origin).dot(e.ng) < 0.0; // behind what is nearer, on spheres
                let sample = light.sample::<FullProfile>(from, normal, shape.unwrap_or([a, b]));
                if let Some(sample) = sample.filter(|_| !hidden) {
                    let found = sample.origin + sample.wi * (sample.tfar / crate::scene::lights::SHORT_OF_LIGHT);
                    assert!((found - e.origin).length() < 2e-3, "{found} for {e:?} of {light:?}");
                }
            }
            let known = matches!(
                light,
                Light::MeshLight(_) | Light::Disk(_) | Light::Cylinder(_) | Light::Sphere(_) | Light::Point(_)
            );
            assert!(if known { inverted > 500 } else { inverted == 0 }, "{inverted} of {light:?}");
        }
    }

    #[test]
    fn light_leaves_surfaces_before_both_normals() {
        for light in lights().iter().chain([&bent()]).filter(|l| l.kind() == EmitterKind::Surface) {
            for (e, u) in emissions(light, 0, 4096) {
                let Some(e) = e else { continue };
                let [geometric, shading] = e.normals;
                assert!(e.ng.dot(shading) >= 0.0 && (e.ng == geometric || e.ng == -geometric), "{e:?}");
                assert!(e.direction.dot(e.ng) > 0.0, "{e:?}");
                let leaves = e.direction.dot(shading) > 0.0;
                assert_eq!([e.weight != Rgb::ZERO, e.pdf_rest > 0.0], [leaves; 2], "{e:?}");
                let any = warp::sphere(u);
                let [_, rest] = light.emission_pdf::<FullProfile>(e.normals, any, SCENE);
                assert_eq!(rest > 0.0, any.dot(e.ng) > 0.0 && any.dot(shading) > 0.0, "{any}, {e:?}");
            }
        }
    }

    /// Integral over all directions by midpoints.
    fn all_around(of: impl Fn(Vec3) -> Rgb) -> glam::DVec3 {
        let (rows, columns) = (1000, 2000);
        let mut sum = glam::DVec3::ZERO;
        for i in 0..rows * columns {
            let [row, column] = [i / columns, i % columns].map(|i| i as f32 + 0.5);
            sum += of(warp::sphere([column / columns as f32, row / rows as f32])).as_dvec3();
        }
        sum * (4.0 * std::f64::consts::PI / f64::from(rows * columns))
    }

    /// By midpoints, bound 3·10⁻³ for the edges of cones.
    #[test]
    fn the_density_of_directions_integrates_to_one() {
        for light in lights() {
            let normals = [Vec3::new(0.6, 0.0, 0.8); 2];
            let of_direction = match light.kind() {
                EmitterKind::Surface | EmitterKind::Point => 1,
                EmitterKind::Surrounding => 0,
                EmitterKind::SingleDirection => continue,
            };
            let density = |d| light.emission_pdf::<FullProfile>(normals, d, SCENE)[of_direction];
            let one = all_around(|d| Rgb::splat(density(d))).x;
            assert!((one - 1.0).abs() < 3e-3, "{one}: {light:?}");
        }
    }

    /// Intensity or radiance integrated numerically where [`Light::power`] is approximate, else that.
    fn power(light: &Light) -> glam::DVec3 {
        match light {
            Light::Envmap(_) => all_around(|d| light.surrounding(d).0) / f64::from(SCENE.pdf()),
            Light::Spot(_) => {
                let origin = emissions(light, 0, 64).find_map(|(e, _)| e).unwrap().origin;
                // as seen from distance 1
                all_around(|d| light.sample::<FullProfile>(origin + d, -d, [0.0; 2]).map_or(Rgb::ZERO, |s| s.weight))
            }
            _ => light.power(SCENE.radius).as_dvec3(),
        }
    }

    /// Mean of weights against power: 2¹⁶ samples of each of 11 lights, bound five standard errors (level 6·10⁻⁷ each)
    /// and, for lights whose weights hardly vary, 10⁻³ for numerical integration.
    #[test]
    fn weights_are_the_power_in_the_mean() {
        let n = 1u64 << 16;
        for light in lights() {
            let (mut sum, mut squares) = (glam::DVec3::ZERO, glam::DVec3::ZERO);
            for (e, _) in emissions(&light, 0, n) {
                let weight = e.map_or(Rgb::ZERO, |e| e.weight).as_dvec3();
                sum += weight;
                squares += weight * weight;
            }
            let mean = sum / n as f64;
            let error = ((squares / n as f64 - mean * mean).max(glam::DVec3::ZERO) / n as f64).map(f64::sqrt);
            let exact = power(&light);
            let bound = 5.0 * error + 1e-3 * exact;
            assert!((mean - exact).abs().cmple(bound).all(), "{mean} ± {error} for {exact}: {light:?}");
        }
    }

    /// Irradiance of a disk around the origin, seen from above, by light paths that hit it and by [`Light::sample`] from
    /// places on it; what is between is ignored by both. Two means of 32 independent batches of 2¹³ samples each, for
    /// each of 11 lights: Welch's t with at least 31 degrees of freedom stays below 6.1 but for one in 10⁶.
    #[test]
    fn light_arrives_as_it_is_looked_for() {
        const RADIUS: f32 = 0.5;
        const BATCHES: u16 = 32;
        const SAMPLES: u64 = 1 << 13;
        /// Mean and the square of its standard error.
        fn of(batches: &[f64]) -> (f64, f64) {
            let n = batches.len() as f64;
            let mean = batches.iter().sum::<f64>() / n;
            (mean, batches.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / (n * (n - 1.0)))
        }
        let area = std::f32::consts::PI * RADIUS * RADIUS;
        let arriving = |e: &Emission| {
            let distance = -e.origin.z / e.direction.z;
            let hit = e.origin + e.direction * distance;
            let hits = e.direction.z < 0.0 && distance > 0.0 && hit.length() < RADIUS;
            if hits { e.weight.element_sum() / area } else { 0.0 }
        };
        for light in lights() {
            let (mut emitted, mut sampled) = (Vec::new(), Vec::new());
            for batch in 0..BATCHES {
                let sum = |values: &mut dyn Iterator<Item = f32>| values.map(f64::from).sum::<f64>() / SAMPLES as f64;
                emitted
                    .push(sum(&mut emissions(&light, batch, SAMPLES).map(|(e, _)| e.as_ref().map_or(0.0, arriving))));
                let rng = Rng::new(22);
                sampled.push(sum(&mut (0..SAMPLES).map(|step| {
                    let counter = Counter { ladder: 0, replica: batch, step, purpose: Purpose::Primary };
                    let [a, b, c, d] = rng.words(counter, 0).map(unit_f32);
                    let p = (warp::disk([a, b]) * RADIUS).extend(0.0);
                    let sample = light.sample::<FullProfile>(p, Vec3::Z, [c, d]);
                    sample.map_or(0.0, |s| s.weight.element_sum() * s.wi.z.max(0.0))
                })));
            }
            let ((a, var_a), (b, var_b)) = (of(&emitted), of(&sampled));
            let t = (a - b) / (var_a + var_b).sqrt();
            assert!(a > 0.0 && b > 0.0, "{light:?} does not shine: {a}, {b}");
            // alike but for rounding where nothing varies
            assert!(t.abs() < 6.1 || (a / b - 1.0).abs() < 1e-4, "{a} emitted, {b} sampled, t = {t}: {light:?}");
        }
    }

    #[test]
    fn rays_from_infinity_start_on_a_disk_before_the_scene() {
        for light in lights() {
            if matches!(light.kind(), EmitterKind::Surface | EmitterKind::Point) {
                continue;
            }
            for (e, _) in emissions(&light, 0, 1024) {
                let e = e.unwrap();
                let from_center = e.origin - SCENE.center;
                let before = -from_center.dot(e.direction);
                assert!((before / SCENE.radius - 1.0).abs() < 1e-5, "{e:?}");
                let off = (from_center + e.direction * before).length();
                assert!(off <= SCENE.radius * (1.0 + 1e-5), "{e:?}");
            }
        }
    }

    #[test]
    fn the_choice_of_the_light_is_part_of_place_and_weight() {
        let lights = lights();
        let (emitters, _) = Emitters::new(&with_lights(lights.clone()), SCENE);
        let ball = SCENE.enlarged();
        assert_eq!(emitters.surrounding_light(), Some(0));
        let mut met = vec![false; lights.len()];
        let rng = Rng::new(23);
        for step in 0..4096 {
            let counter = Counter { ladder: 0, replica: 0, step, purpose: Purpose::Primary };
            let [a, b, c, d] = rng.words(counter, 0).map(unit_f32);
            let [choice, ..] = rng.words(counter, 1).map(unit_f32);
            let Some(e) = emitters.emit::<FullProfile>([a, b], [c, d], choice) else { continue };
            met[e.light as usize] = true;
            let alone = lights[e.light as usize].emit::<FullProfile>([a, b], [c, d], ball).unwrap();
            let probability = e.pdf_place / alone.pdf_place;
            assert!((e.weight * probability / alone.weight - Rgb::ONE).abs().max_element() < 1e-5, "{e:?}, {alone:?}");
            assert_eq!((e.pdf_rest, e.kind), (alone.pdf_rest, emitters.kind(e.light)));
            let [place, rest] = emitters.emission_pdf::<FullProfile>(e.light, e.normals, e.direction);
            assert_eq!(rest, e.pdf_rest);
            let border = e.kind == EmitterKind::Surrounding; // of cells of a picture
            assert!((place / e.pdf_place - 1.0).abs() < 1e-5 || border, "{place}, {e:?}");
            // and a shadow ray tells whose it is
            if let Some(sample) = emitters.sample::<FullProfile>(Vec3::ZERO, Vec3::Z, [a, b], choice) {
                assert_eq!(sample.light, e.light);
                let unit = if e.kind == EmitterKind::Surface { 1.0 } else { 0.0 };
                assert!(sample.normals.iter().all(|n| (n.length() - unit).abs() < 1e-5), "{sample:?}");
            }
        }
        assert!(met.iter().all(|&m| m), "{met:?}");
    }
}
