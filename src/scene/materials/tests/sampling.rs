//! χ² of sampled directions against the density that materials state.
//!
//! Lobes may be as narrow as 10⁻⁴, so cells are made to measure: a first batch of samples splits either hemisphere into
//! cells that get about as many samples each, the density is integrated over them, and an independent second batch is
//! counted. One more cell is what is not sampled with a density at all: delta lobes and what the material takes.

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::*;

/// Samples that make the cells.
const FIRST: usize = 1 << 13;
/// Samples that are counted.
const SECOND: usize = 1 << 16;
/// Bisections of a hemisphere: 64 cells each where all samples are.
const SPLITS: u32 = 6;
/// Probability that the test fails although every member is right; each of its k comparisons has 1/k of that.
const LEVEL: f64 = 1e-3;

#[test]
fn smooth_lobes_are_sampled_with_the_density_they_state() {
    let materials: Vec<_> = Material::examples().into_iter().filter(|m| m.lobes().smooth).collect();
    let cases = materials.iter().flat_map(|m| outgoing().into_iter().map(move |wo| (m, wo)));
    let cases: Vec<_> = cases.filter(|(material, wo)| is_resolved(material, *wo)).collect();
    let compared: Vec<_> = cases.par_iter().filter_map(|(material, wo)| compare(material, *wo)).collect();
    assert!(compared.len() >= 3 * materials.len(), "every material is looked at from several directions");
    for (p, evidence) in &compared {
        assert!(*p > LEVEL / compared.len() as f64, "{evidence}");
    }
}

/// Whether directions of 24 bits tell one part of the lobes from another. At α = 10⁻⁴ and cos θ = 0.01 they do not: the
/// last bit turns the facet that reflects so by 0.06 α.
fn is_resolved(material: &Material, wo: Vec3) -> bool {
    let samples = randoms(64).filter_map(|[a, b, c]| material.sample(wo, [a, b], c)).filter(|s| s.pdf.is_finite());
    let unsure: Vec<f32> = samples.map(|s| rounding(material, wo, s.wi).1 / s.pdf).collect();
    unsure.iter().sum::<f32>() <= 0.2 * unsure.len() as f32
}

/// Probability of a χ² as large, and what it was made of; nothing where no direction is sampled.
fn compare(material: &Material, wo: Vec3) -> Option<(f64, String)> {
    let map = Map::around(wo);
    let directions = randoms((FIRST + SECOND) as u64).map(|[a, b, c]| {
        let sample = material.sample(wo, [a, b], c).filter(|s| s.pdf.is_finite());
        sample.map(|s| map.place(s.wi))
    });
    let (mut first, mut second): (Vec<_>, Vec<_>) = (directions.collect(), Vec::new());
    second.extend(first.drain(FIRST..));

    let mut cells = Vec::new();
    for upper in [true, false] {
        let mut inside: Vec<_> = first.iter().flatten().filter(|p| p.upper == upper).map(|p| p.at).collect();
        Cell { upper, low: [-1.0; 2], high: [1.0; 2] }.split(&mut inside, SPLITS, &mut |cell, points| {
            let density = |at| f64::from(material.evaluate(wo, map.direction(Place { upper, at })).pdf);
            cells.push((cell, SECOND as f64 * cell.integral(&density, points)));
        });
    }
    let mut counts = vec![0.0; cells.len()];
    for place in second.iter().flatten() {
        counts[cells.iter().position(|(cell, _)| cell.holds(place)).expect("cells cover the sphere")] += 1.0;
    }
    let total: f64 = cells.iter().map(|(_, expected)| expected).sum();
    if total == 0.0 {
        assert_eq!(counts.iter().sum::<f64>(), 0.0, "{material:?} from {wo} samples what has no density");
        return None;
    }

    let beside = (SECOND as f64 - counts.iter().sum::<f64>(), SECOND as f64 - total);
    let pairs = counts.into_iter().zip(cells.iter().map(|(_, expected)| *expected)).chain([beside]);
    let (many, few): (Vec<_>, Vec<_>) = pairs.partition(|(_, expected)| *expected >= 5.0);
    let pooled = few.into_iter().fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0, sum.1 + pair.1));
    let pooled = Some(pooled).filter(|(_, expected)| *expected >= 5.0);
    let terms: Vec<_> = many.into_iter().chain(pooled).map(|(n, e)| ((n - e).powi(2) / e, n, e)).collect();
    let chi2: f64 = terms.iter().map(|(term, ..)| term).sum();
    let p = 1.0 - ChiSquared::new(terms.len() as f64 - 1.0).expect("several cells").cdf(chi2);
    let worst = terms.iter().copied().fold((0.0, 0.0, 0.0), |a, b| if b.0 > a.0 { b } else { a });
    let evidence = format!(
        "{material:?} from {wo}: χ² = {chi2:.0} over {} cells, p = {p:.1e}; {:.5} sampled where {:.5} is expected; worst \
         cell {} for {:.1}",
        terms.len(),
        1.0 - beside.0 / SECOND as f64,
        total / SECOND as f64,
        worst.1,
        worst.2,
    );
    Some((p, evidence))
}

/// A place on one of two squares [−1, 1]², the upper and the lower hemisphere.
#[derive(Clone, Copy)]
struct Place {
    upper: bool,
    at: [f64; 2],
}

/// Equal-area maps of the hemispheres with their poles in the middle: Lambert's disk, made square by Shirley & Chiu's
/// concentric map, and turned so that a given direction is on the first axis: lobes seen at grazing angles are long and
/// narrow, and cells fit them only if they lie along an axis.
struct Map {
    /// Unit vector along the azimuth of that direction.
    first: [f64; 2],
}

impl Map {
    fn around(wo: Vec3) -> Map {
        let [x, y] = [f64::from(wo.x), f64::from(wo.y)];
        let r = x.hypot(y);
        Map { first: if r > 0.0 { [x / r, y / r] } else { [1.0, 0.0] } }
    }

    fn place(&self, w: Vec3) -> Place {
        let [x, y, z] = w.to_array().map(f64::from);
        let (scale, [c, s]) = (1.0 / (1.0 + z.abs()).sqrt(), self.first);
        let (x, y) = ((c * x + s * y) * scale, (c * y - s * x) * scale);
        let r = x.hypot(y);
        let eighth = std::f64::consts::FRAC_PI_4;
        let at = if x.abs() > y.abs() {
            let a = r.copysign(x);
            [a, a * (y / x).atan() / eighth]
        } else {
            let b = r.copysign(y);
            [if r > 0.0 { b * (x / y).atan() / eighth } else { 0.0 }, b]
        };
        Place { upper: w.z >= 0.0, at: at.map(|c| c.clamp(-1.0, 1.0)) }
    }

    fn direction(&self, place: Place) -> Vec3 {
        let [a, b] = place.at;
        let eighth = std::f64::consts::FRAC_PI_4;
        let (x, y) = if a.abs() > b.abs() {
            let (sin, cos) = (eighth * b / a).sin_cos();
            (a * cos, a * sin)
        } else if b != 0.0 {
            let (sin, cos) = (eighth * a / b).sin_cos();
            (b * sin, b * cos)
        } else {
            (0.0, 0.0)
        };
        let below = x * x + y * y; // 1 − |z|
        let (z, scale, [c, s]) = (1.0 - below, (2.0 - below).sqrt(), self.first);
        let (x, y) = ((c * x - s * y) * scale, (s * x + c * y) * scale);
        Vec3::new(x as f32, y as f32, if place.upper { z } else { -z } as f32)
    }
}

/// Solid angle over area of the squares.
const SOLID_ANGLE: f64 = std::f64::consts::FRAC_PI_2;

#[derive(Clone, Copy)]
struct Cell {
    upper: bool,
    low: [f64; 2],
    high: [f64; 2],
}

impl Cell {
    fn holds(&self, place: &Place) -> bool {
        let within = |i: usize| {
            self.low[i] <= place.at[i] && (place.at[i] < self.high[i] || self.high[i] == 1.0 && place.at[i] == 1.0)
        };
        self.upper == place.upper && within(0) && within(1)
    }

    /// Splits at medians across the way in which points spread further, and hands over the last cells with their points.
    fn split(self, points: &mut [[f64; 2]], splits: u32, each: &mut impl FnMut(Cell, &[[f64; 2]])) {
        /// Points of a cell that is worth splitting.
        const MANY: usize = 64;
        /// Extent of points that are not moved from cell to cell by rounding.
        const COARSE: f64 = 128.0 * f32::EPSILON as f64;
        let spread = [0, 1].map(|axis| extent(points, axis));
        let axis = usize::from(spread[1] > spread[0]);
        if splits == 0 || points.len() < MANY || spread[axis] < COARSE {
            return each(self, points);
        }
        points.sort_by(|p, q| p[axis].total_cmp(&q[axis]));
        let (left, right) = points.split_at_mut(points.len() / 2);
        let middle = 0.5 * (left[left.len() - 1][axis] + right[0][axis]);
        let [low, high] = self.halves(axis, middle);
        low.split(left, splits - 1, each);
        high.split(right, splits - 1, each);
    }

    fn halves(self, axis: usize, middle: f64) -> [Cell; 2] {
        let (mut low, mut high) = (self, self);
        low.high[axis] = middle;
        high.low[axis] = middle;
        [low, high]
    }

    /// ∫ density dω by bisection until halves add up to the whole and the density at `points` is nothing out of the way,
    /// without which no rule would find the narrowest lobes.
    fn integral(&self, density: &impl Fn([f64; 2]) -> f64, points: &[[f64; 2]]) -> f64 {
        let probes: Vec<_> = points.iter().map(|at| (*at, density(*at))).collect();
        self.refined(density, &probes, self.gauss(density), 60)
    }

    fn refined(&self, density: &impl Fn([f64; 2]) -> f64, probes: &[([f64; 2], f64)], whole: f64, depth: u32) -> f64 {
        /// Of all samples; a cell has some hundredths of them.
        const PRECISION: f64 = 1e-6;
        let size = [0, 1].map(|axis| self.high[axis] - self.low[axis]);
        let area = size[0] * size[1] * SOLID_ANGLE;
        let outlying = probes.iter().filter(|(_, density)| density * area > 3.0 * whole + PRECISION);
        let outlying: Vec<_> = outlying.map(|(at, _)| *at).collect();
        // across the way in which those are closer together, or else the longer one
        let axis = if outlying.is_empty() {
            usize::from(size[1] > size[0])
        } else {
            let emptiness = [0, 1].map(|axis| size[axis] / extent(&outlying, axis).max(f64::from(f32::EPSILON)));
            usize::from(emptiness[1] > emptiness[0])
        };
        let middle = 0.5 * (self.low[axis] + self.high[axis]);
        let halves = self.halves(axis, middle);
        let [a, b] = halves.map(|half| half.gauss(density));
        if depth == 0 || outlying.is_empty() && (a + b - whole).abs() < PRECISION {
            return a + b;
        }
        let (low, high): (Vec<_>, Vec<_>) = probes.iter().partition(|(at, _)| at[axis] < middle);
        halves[0].refined(density, &low, a, depth - 1) + halves[1].refined(density, &high, b, depth - 1)
    }

    /// By Gauss's rule of 4 × 4 points.
    fn gauss(&self, density: &impl Fn([f64; 2]) -> f64) -> f64 {
        const INNER: (f64, f64) = (0.339_981_043_584_856_3, 0.652_145_154_862_546_1);
        const OUTER: (f64, f64) = (0.861_136_311_594_052_6, 0.347_854_845_137_453_9);
        let rule = [(-OUTER.0, OUTER.1), (-INNER.0, INNER.1), INNER, OUTER];
        let half = [0, 1].map(|axis| 0.5 * (self.high[axis] - self.low[axis]));
        let on = |axis: usize, x: f64| 0.5 * (self.high[axis] + self.low[axis]) + x * half[axis];
        let mut sum = 0.0;
        for (x, of_x) in rule {
            for (y, of_y) in rule {
                sum += of_x * of_y * density([on(0, x), on(1, y)]);
            }
        }
        sum * half[0] * half[1] * SOLID_ANGLE
    }
}

fn extent(points: &[[f64; 2]], axis: usize) -> f64 {
    let along = points.iter().map(|p| p[axis]);
    along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
}

#[test]
fn places_are_directions_and_back() {
    let map = Map::around(Vec3::new(0.6, -0.8, 0.0));
    for [a, b, _] in randoms(10_000) {
        let w = crate::math::warp::sphere([a, b]);
        let back = map.direction(map.place(w));
        assert!((back - w).length() < 1e-6, "{w} becomes {back}");
    }
    for (upper, integral) in [(true, std::f64::consts::PI), (false, -std::f64::consts::PI)] {
        let square = Cell { upper, low: [-1.0; 2], high: [1.0; 2] };
        let got = square.integral(&|at| f64::from(map.direction(Place { upper, at }).z), &[]);
        assert!((got - integral).abs() < 1e-4, "∫ cos θ dω is {got}, not {integral}");
    }
}
