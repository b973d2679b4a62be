//! Limits of materials: roughness, refraction, grazing directions, albedo, path length, many interfaces.

use statrs::function::erf::erf;

use super::{
    Bench, Case, Check,
    bench::{Effort, Goal, camera_ways},
    check::ROUNDING,
    light_size::long_rounding,
    scenes::{SKY, diffuse, film, glowing, rectangle, series, sphere, view, without_roulette},
};

const EFFORT: Effort = Effort { runs: 16, mutations_per_pixel: 96.0 };
/// For images without noise: every path has the same value.
const SILENT: Effort = Effort { runs: 8, mutations_per_pixel: 16.0 };
/// Refractive index of glass, a number that f32 holds.
const GLASS: f64 = 1.5;

/// The cases.
pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for albedo in [0.0, 0.999_999, 1.0] {
        cases.push(
            Case::new(
                format!("materials/furnace-{albedo}"),
                format!("a sphere that glows by 1 and reflects {albedo} looks like Σ aⁱ, i < 1000"),
                move |bench| furnace(bench, albedo),
            )
            .quick_if(albedo == 0.0),
        );
    }
    for alpha in [1e-4, 1e-3, 1e-2, 0.1, 0.5, 1.0] {
        cases.push(
            Case::new(
                format!("materials/alpha-{alpha:e}"),
                format!("rough metal, α = {alpha:e}, shows of a white sky what its facets leave, by quadrature in f64; at 60° and at 89.9°"),
                move |bench| rough(bench, alpha),
            )
            .quick_if(alpha == 1e-4),
        );
    }
    cases.push(
        Case::new("materials/smooth", "smooth metal at the end of roughness shows the whole sky", smooth).quick(),
    );
    cases.push(Case::new(
        "materials/eta-near-1",
        "an interface of relative index 1 ± 10⁻⁶ shows of a white sky F + (1 − F)/η², by Fresnel in f64",
        |bench| [1.0 + 1e-6, 1.0 - 1e-6].into_iter().flat_map(|eta| interface(bench, eta, &[0.0, 60.0])).collect(),
    ));
    cases.push(
        Case::new(
            "materials/grazing",
            "glass seen at 90° − 10⁻⁴° shows of a white sky F + (1 − F)/η²; a diffuse floor shows its albedo",
            grazing,
        )
        .quick(),
    );
    cases.push(Case::new(
        "materials/shells",
        "50 concentric interfaces of glass and air are invisible in a white sky",
        shells,
    ));
    cases
}

fn furnace(bench: &Bench, albedo: f64) -> Vec<Check> {
    const EDGES: i32 = 1000;
    let text = view(1.0, [[0.5, 0.3, -0.2], [0.9, 0.1, -0.5]], 80.0, EDGES);
    let scene =
        bench.scene(&(without_roulette(&text) + &sphere([0.0; 3], 1.0, true, &(diffuse(albedo) + &glowing(1.0)))));
    let expected = series(f64::from(albedo as f32), EDGES);
    let goal = Goal { expected, rounding: long_rounding(EDGES), precision: 0.1 };
    bench.ways_give(&scene, &camera_ways(), goal, Effort { runs: 8, mutations_per_pixel: 1.0 })
}

/// What is seen of the plane z = 0 by parallel rays at `degrees` from its normal, under a white sky, with few edges.
fn seen_at(degrees: f64, edges: i32, with: &str) -> String {
    // what is seen is as long as this over the cosine
    let width = 0.01 * degrees.to_radians().cos();
    let [x, z] = [degrees.to_radians().sin(), (90.0 - degrees).to_radians().sin()].map(|x| 10.0 * x);
    format!(
        "<integrator type='path'><integer name='max_depth' value='{edges}'/><integer name='rr_depth' value='100'/></integrator>
         <sensor type='orthographic'><float name='near_clip' value='0.001'/><float name='far_clip' value='1e9'/>
           <transform name='to_world'><scale x='{width}' y='{width}'/>
             <lookat origin='{x}, 0, {z}' target='0, 0, 0' up='0, 1, 0'/></transform>{}</sensor>{SKY}{}",
        film(12, 8),
        rectangle([1.0, 1.0], "", [0.0; 3], with)
    )
}

fn rough(bench: &Bench, alpha: f64) -> Vec<Check> {
    let mut checks = Vec::new();
    for facets in [Facets::Ggx, Facets::Beckmann] {
        let bsdf = format!(
            "<bsdf type='roughconductor'><string name='distribution' value='{}'/><float name='alpha' value='{alpha}'/></bsdf>",
            facets.name()
        );
        for degrees in [60.0, 89.9] {
            let scene = bench.scene(&seen_at(degrees, 2, &bsdf));
            // the quadrature errs by less than 10⁻⁴; the cosine of 89.9° is known to 2⁻²⁴ of the unit vector
            let cosine = f64::from(f32::EPSILON) / degrees.to_radians().cos();
            let goal = Goal {
                expected: facets.albedo(degrees.to_radians(), f64::from(alpha as f32)),
                rounding: ROUNDING + 1e-4 + cosine,
                precision: 0.3,
            };
            let of = format!("{} at {degrees}°", facets.name());
            let ways = if degrees == 60.0 { bench.ways(&scene) } else { camera_ways() };
            checks.extend(bench.ways_give(&scene, &ways, goal, EFFORT).into_iter().map(|check| check.of(&of)));
        }
    }
    checks
}

fn smooth(bench: &Bench) -> Vec<Check> {
    let of = |degrees: f64| {
        let scene = bench.scene(&seen_at(degrees, 2, "<bsdf type='conductor'/>"));
        bench.all_ways_give(&scene, Goal::new(1.0, 0.5), EFFORT)
    };
    let limit = [Facets::Ggx, Facets::Beckmann].map(|facets| {
        let albedo = facets.albedo(60f64.to_radians(), 1e-4);
        // what facets of slope α take away is of the order of α²
        Check::about(format!("albedo of {} at α = 10⁻⁴", facets.name()), 1.0, albedo, 1e-6)
    });
    [0.0, 60.0, 89.9].into_iter().flat_map(of).chain(limit).collect()
}

/// Distributions of facets, again, in f64.
#[derive(Clone, Copy)]
enum Facets {
    Ggx,
    Beckmann,
}

impl Facets {
    fn name(self) -> &'static str {
        match self {
            Facets::Ggx => "ggx",
            Facets::Beckmann => "beckmann",
        }
    }

    /// Smith's G₁ by the product of roughness and tangent.
    fn masking(self, slope: f64) -> f64 {
        match self {
            Facets::Ggx => 2.0 / (1.0 + (1.0 + slope * slope).sqrt()),
            Facets::Beckmann if slope < 0.1 => 1.0, // Λ < 10⁻⁴⁵
            Facets::Beckmann => {
                let a = 1.0 / slope;
                2.0 / (1.0 + erf(a) + (-a * a).exp() / (a * std::f64::consts::PI.sqrt()))
            }
        }
    }

    /// Albedo of a perfectly reflecting metal at an angle θ from the normal, with separable masking:
    /// ∫ P(s) (1 − tan θ s_x)⁺ G₁(wo) G₁(wi) ds over slopes s, wi above the surface. With s = α r (cos φ, sin φ) and
    /// v² = 1 − ∫ P up to r, dP = 2 v dv dφ/2π; r² is 1/v² − 1 (GGX) or −2 ln v (Beckmann).
    fn albedo(self, theta: f64, alpha: f64) -> f64 {
        const RADII: usize = 2000;
        const ANGLES: usize = 500;
        let (sin, cos) = theta.sin_cos();
        let mut sum = 0.0;
        for i in 0..RADII {
            let v = (i as f64 + 0.5) / RADII as f64;
            let r = match self {
                Facets::Ggx => (1.0 / (v * v) - 1.0).sqrt(),
                Facets::Beckmann => (-2.0 * v.ln()).sqrt(),
            };
            for j in 0..ANGLES {
                let phi = std::f64::consts::TAU * (j as f64 + 0.5) / ANGLES as f64;
                let [x, y] = [alpha * r * phi.cos(), alpha * r * phi.sin()];
                // m ∝ (−x, −y, 1)
                let along = cos - sin * x; // wo · m, but for the length of m
                let scale = 2.0 * along / (1.0 + x * x + y * y);
                let wi = [-scale * x - sin, -scale * y, scale - cos];
                if along <= 0.0 || wi[2] <= 0.0 {
                    continue;
                }
                let tan = wi[0].hypot(wi[1]) / wi[2];
                sum += 2.0 * v * along / cos * self.masking(alpha * tan);
            }
        }
        self.masking(alpha * sin / cos) * sum / (RADII * ANGLES) as f64
    }
}

/// Reflectance of an interface of relative index `eta` for unpolarised light. Source: Fresnel 1823.
pub(super) fn fresnel(cos: f64, eta: f64) -> f64 {
    let sin2 = (1.0 - cos * cos) / (eta * eta);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin2).sqrt();
    let parallel = (eta * cos - cos_t) / (eta * cos + cos_t);
    let across = (cos - eta * cos_t) / (cos + eta * cos_t);
    0.5 * (parallel * parallel + across * across)
}

/// One interface, in a sky on both of its sides: what is transmitted is seen with 1/η² of its radiance.
fn interface(bench: &Bench, eta: f64, angles: &[f64]) -> Vec<Check> {
    let bsdf = format!(
        "<bsdf type='dielectric'><float name='int_ior' value='{eta}'/><float name='ext_ior' value='1'/></bsdf>"
    );
    let of_angle = |degrees: &f64| {
        let eta = f64::from(eta as f32);
        let reflected = fresnel((90.0 - degrees).to_radians().sin(), eta);
        let expected = reflected + (1.0 - reflected) / (eta * eta);
        let scene = bench.scene(&seen_at(*degrees, 2, &bsdf));
        bench.ways_give(&scene, &camera_ways(), Goal::new(expected, 0.3), EFFORT)
    };
    let name = |check: Check| check.of(&format!("η = {eta}"));
    angles.iter().flat_map(of_angle).map(name).collect()
}

fn grazing(bench: &Bench) -> Vec<Check> {
    const NEARLY_FLAT: f64 = 90.0 - 1e-4;
    let mut checks = interface(bench, GLASS, &[NEARLY_FLAT]);
    let floor = bench.scene(&seen_at(NEARLY_FLAT, 2, &diffuse(0.5)));
    checks.extend(bench.all_ways_give(&floor, Goal::new(0.5, 0.3), EFFORT));
    checks
}

/// Shells of glass with air between, with air in the middle.
fn shells(bench: &Bench) -> Vec<Check> {
    // every path that comes out has the weight 1
    let mut scene = without_roulette(&view(1.0, [[0.3, 0.2, 3.0], [0.0, 0.0, 0.0]], 30.0, -1)) + SKY;
    for i in 0..50 {
        let [inside, outside] = if i % 2 == 0 { [GLASS, 1.0] } else { [1.0, GLASS] };
        let bsdf = format!(
            "<bsdf type='dielectric'><float name='int_ior' value='{inside}'/><float name='ext_ior' value='{outside}'/></bsdf>"
        );
        scene += &sphere([0.0; 3], 1.0 - 0.019 * f64::from(i), false, &bsdf);
    }
    let scene = bench.scene(&scene);
    // some hundred interfaces a path
    let goal = Goal { expected: 1.0, rounding: long_rounding(200), precision: 0.3 };
    bench.ways_give(&scene, &camera_ways(), goal, SILENT)
}
