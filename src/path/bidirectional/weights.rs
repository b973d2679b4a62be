//! Weights of techniques, by the power heuristic.
//!
//! Let a path have vertices x₀ (on the light) … x_n (on the lens), p_i the density with which technique s = i makes it,
//! →p_k the density of x_k per area when it comes from the light's side, ←p_k that when it comes from the camera's. Then
//! p_i/p_{i+1} = ←p_i/→p_i, so that what the other techniques count beside technique s,
//!
//! Σ_{i < s} (p_i/p_s)² = R_{s−1},   R_j = (←p_j/→p_j)² (a_j + R_{j−1}),   R_{−1} = 0,
//!
//! with a_j = 1 where technique i = j is one of those compared and both ends of its connection, x_{j−1} and x_j, scatter
//! smoothly there, otherwise 0. Of a subpath that ends at x_j, ←p_j and the density of the direction from x_j back to
//! x_{j−1}, ←ω_j, depend on where it will be connected; all else is known and kept in a [`Tail`]:
//!
//! R_j = (←p_j/→p_j)² (a_j + ←ω_j² C_j),   C_j = (g_{j−1}/→p_{j−1})² (a_{j−1} + ←ω_{j−1}² C_{j−1}),
//!
//! g_{j−1} = |cos|/d² what turns a density of direction at x_j into one of area at x_{j−1}. The camera's side is the same
//! with arrows reversed, so one recursion serves both. A perfect lobe has the density 1 both ways and a = 0 on both of its
//! edges: factors that only excluded techniques have one of are never looked at, and all others have both.
//!
//! At the light's end, densities are those by which light subpaths start: of a place per area and of a direction, for
//! lights at infinity of a direction and of a place per area of a disk that stands across it. Next-event estimation may
//! choose the place with another density: a₁ has the ratio of the two, squared, in the place of 1.
//!
//! Source: Veach 1997, sections 9.2 and 10.2; the recursion is that of Georgiev 2012, "Implementing vertex connection and
//! merging", with squares. Sums are f64: squares of densities leave the range of f32.

/// What the weight of a connection needs of one of its two subpaths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tail {
    /// 1/→p_j, the density of the last vertex per area.
    pub inverse_density: f64,
    /// a_j, were the technique compared: 1 where x_{j−1} scattered smoothly, 0 where it did not.
    pub shorter: f64,
    /// C_j.
    pub earlier: f64,
}

/// A subpath between two vertices: what is known of the next one's [`Tail`] before it is known where that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// →ω_j, the density of the direction; 1 for a perfect lobe.
    pub density: f64,
    /// |cos| of the direction at x_j, by the geometric normal.
    pub cos: f64,
    /// (a_j + ←ω_j² C_j)/→p_j².
    pub before: f64,
    /// As of the tail to come.
    pub shorter: f64,
}

/// Densities of directions, forwards and back, of scattering at a vertex; `None` for a perfect lobe.
pub type Densities = Option<[f32; 2]>;

fn square(x: f64) -> f64 {
    x * x
}

/// Cosines are kept from 0, which makes densities infinite: a ray that grazes a surface hit it all the same.
const LEAST_COSINE: f64 = 1e-12;
/// Squares of distances likewise: what leaves one wall within 2⁻¹⁶ of a corner may start right on the other and meet it there,
/// at a distance whose square is 0. Where rays start off surfaces is known to a billion times as much as this length.
const LEAST_DISTANCE2: f64 = LEAST_COSINE * LEAST_COSINE;

impl Tail {
    /// R_j, what the techniques with a shorter subpath count: with ←p_j = `reverse_density` per area and ←ω_j =
    /// `reverse_direction` per solid angle. `compared` says whether technique i = j is one of those compared.
    #[inline(always)]
    pub fn others(&self, reverse_density: f64, reverse_direction: f64, compared: bool) -> f64 {
        let shorter = if compared { self.shorter } else { 0.0 };
        square(reverse_density * self.inverse_density) * (shorter + square(reverse_direction) * self.earlier)
    }

    /// Goes on from the last vertex in a direction with those densities, `cos` by the geometric normal; `compared` as for
    /// [`others`](Tail::others).
    #[inline(always)]
    pub fn leave(&self, densities: Densities, cos: f32, compared: bool) -> Step {
        let ([forwards, back], smooth) = match densities {
            Some([forwards, back]) => ([f64::from(forwards), f64::from(back)], 1.0),
            None => ([1.0; 2], 0.0),
        };
        let shorter = if compared { smooth * self.shorter } else { 0.0 };
        Step {
            density: forwards,
            cos: f64::from(cos).max(LEAST_COSINE),
            before: square(self.inverse_density) * (shorter + square(back) * self.earlier),
            shorter: smooth,
        }
    }
}

impl Step {
    /// A place to be filled.
    pub const NOWHERE: Step = Step { density: 1.0, cos: 1.0, before: 0.0, shorter: 0.0 };

    /// Arrives at a vertex at the square of that distance; `cos` of the edge by its geometric normal.
    #[inline(always)]
    pub fn arrive(&self, distance2: f32, cos: f32) -> Tail {
        let distance2 = f64::from(distance2).max(LEAST_DISTANCE2);
        Tail {
            inverse_density: distance2 / (self.density * f64::from(cos).max(LEAST_COSINE)),
            shorter: self.shorter,
            earlier: square(self.cos / distance2) * self.before,
        }
    }

    /// Arrives at a light at infinity, whose places are directions.
    #[inline(always)]
    pub fn arrive_at_infinity(&self) -> Tail {
        Tail { inverse_density: 1.0 / self.density, shorter: self.shorter, earlier: square(self.cos) * self.before }
    }

    /// Arrives from a light at infinity, `density` being that of the place on a disk across the direction.
    #[inline(always)]
    pub fn arrive_from_infinity(&self, cos: f32) -> Tail {
        Tail {
            inverse_density: 1.0 / (self.density * f64::from(cos).max(LEAST_COSINE)),
            shorter: self.shorter,
            earlier: self.before,
        }
    }
}

/// Weight of a technique beside which the others count `others`.
#[inline(always)]
pub fn weight(others: f64) -> f32 {
    (1.0 / (1.0 + others)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        path::bidirectional::Techniques,
        rng::{Counter, Purpose, Rng, open_unit_f64},
    };

    /// In a corner; the path goes on from there.
    #[test]
    fn an_edge_without_length_leaves_weights_that_are_numbers() {
        let start = Tail { inverse_density: 2.0, shorter: 1.0, earlier: 0.5 };
        for distance2 in [0.0, 1e-44, 1e-30] {
            let corner = start.leave(Some([0.2, 0.3]), 0.7, true).arrive(distance2, 0.7);
            let next = corner.leave(Some([0.2, 0.3]), 0.7, true).arrive(1.0, 0.7);
            for tail in [corner, next] {
                for reverse_density in [0.0, 1e-20, 0.1, 1e20] {
                    let w = weight(tail.others(reverse_density, 0.3, true));
                    assert!((0.0..=1.0).contains(&w), "{w} at {distance2}, {tail:?}");
                }
            }
        }
    }

    /// A path x₀ … x_n by its densities: those of directions onwards to the lens and back to the light, cosines towards
    /// both neighbours, squared distances, and which vertices scatter perfectly.
    struct Path {
        onwards: Vec<f32>,
        back: Vec<f32>,
        cos_onwards: Vec<f32>,
        cos_back: Vec<f32>,
        distance2: Vec<f32>,
        perfect: Vec<bool>,
        /// Density of x₀ at the start of a light subpath, and by next-event estimation, per area.
        start: f64,
        direct: f64,
        /// Of the last vertex but one, as seen from the lens, per area that faces it.
        seen: f32,
        hittable: bool,
    }

    fn random_path(edges: usize, number: u64) -> Path {
        let rng = Rng::new(31);
        let mut block = 0;
        let mut next = || {
            let counter = Counter { ladder: edges as u32, replica: 0, step: number, purpose: Purpose::Primary };
            block += 1;
            open_unit_f64(rng.words(counter, block)[0])
        };
        let n = edges + 1;
        let mut list = |f: fn(f64) -> f64| -> Vec<f32> { (0..n).map(|_| f(next()) as f32).collect() };
        let wide = |u: f64| libm::exp(12.0 * (u - 0.5));
        let [onwards, back, distance2] = [list(wide), list(wide), list(wide)];
        let [cos_onwards, cos_back] = [list(|u| u), list(|u| u)];
        let perfect = (0..n).map(|k| (1..edges).contains(&k) && next() < 0.3).collect();
        let [start, direct, seen] = [wide(next()), wide(next()), wide(next())];
        let mut path = Path {
            onwards,
            back,
            cos_onwards,
            cos_back,
            distance2,
            perfect,
            start,
            direct,
            seen: seen as f32,
            hittable: next() < 0.7,
        };
        for k in 0..n {
            if path.perfect[k] {
                (path.onwards[k], path.back[k]) = (1.0, 1.0);
            }
        }
        path
    }

    impl Path {
        fn edges(&self) -> usize {
            self.onwards.len() - 1
        }

        /// Density of x_k per area when it comes from x_{k−1}.
        fn light_density(&self, k: usize) -> f64 {
            f64::from(self.onwards[k - 1]) * f64::from(self.cos_back[k]) / f64::from(self.distance2[k - 1])
        }

        /// Density of x_k per area when it comes from x_{k+1}.
        fn camera_density(&self, k: usize) -> f64 {
            let cos = f64::from(self.cos_onwards[k]);
            if k + 1 == self.edges() {
                return f64::from(self.seen) * cos;
            }
            f64::from(self.back[k + 1]) * cos / f64::from(self.distance2[k])
        }

        /// Whether technique s can make the path, and is to.
        fn has(&self, techniques: Techniques, s: usize) -> bool {
            let t = self.edges() + 1 - s;
            let joined = s == 0 || !self.perfect[s - 1] && !self.perfect[s];
            techniques.has(s as u16, t as u16) && joined && (s > 0 || self.hittable)
        }

        /// Its density, by the definition.
        fn density(&self, s: usize) -> f64 {
            let light: f64 = match s {
                0 => 1.0,
                1 => self.direct,
                _ => self.start * (1..s).map(|k| self.light_density(k)).product::<f64>(),
            };
            light * (s..self.edges()).map(|k| self.camera_density(k)).product::<f64>()
        }

        /// What the others count beside technique s ≥ 2, by the recursion from the light.
        fn light_tail(&self, techniques: Techniques, s: usize) -> Tail {
            let hit = if techniques.hit && self.hittable { 1.0 / (self.start * self.start) } else { 0.0 };
            let step = Step {
                density: f64::from(self.onwards[0]),
                cos: f64::from(self.cos_onwards[0]),
                before: hit,
                shorter: square(self.direct / self.start),
            };
            let mut tail = step.arrive(self.distance2[0], self.cos_back[1]);
            for j in 1..s - 1 {
                let densities = (!self.perfect[j]).then_some([self.onwards[j], self.back[j]]);
                tail = tail
                    .leave(densities, self.cos_onwards[j], techniques.has(j as u16, 2))
                    .arrive(self.distance2[j], self.cos_back[j + 1]);
            }
            tail
        }

        /// The same from the camera, of a subpath with t ≥ 2 vertices.
        fn camera_tail(&self, techniques: Techniques, t: usize) -> Tail {
            let n = self.edges();
            let seen = Step { density: f64::from(self.seen), cos: 0.0, before: 0.0, shorter: 1.0 };
            let mut tail = seen.arrive(1.0, self.cos_onwards[n - 1]);
            for j in 1..t - 1 {
                let k = n - j;
                let densities = (!self.perfect[k]).then_some([self.back[k], self.onwards[k]]);
                tail = tail
                    .leave(densities, self.cos_back[k], techniques.has(2, j as u16))
                    .arrive(self.distance2[k - 1], self.cos_onwards[k - 1]);
            }
            tail
        }

        /// The weight of technique s.
        fn weight(&self, techniques: Techniques, s: usize) -> f64 {
            let n = self.edges();
            let (t, back_of) = (n + 1 - s, |k: usize| f64::from(self.back[k]));
            let mut others = 0.0;
            if s == 1 && techniques.hit && self.hittable {
                others += square(self.camera_density(0) / self.direct);
            }
            if s >= 2 {
                let j = s - 1;
                let tail = self.light_tail(techniques, s);
                others += tail.others(self.camera_density(j), back_of(j), techniques.has(j as u16, 2));
            }
            if t >= 2 {
                let (j, k) = (t - 1, s);
                let tail = self.camera_tail(techniques, t);
                let onwards = f64::from(self.onwards[k]);
                others += match s {
                    0 => {
                        tail.others(self.direct, 0.0, techniques.has(1, j as u16))
                            + tail.others(self.start, onwards, false)
                    }
                    _ => {
                        let start = if s == 1 { square(self.start / self.direct) } else { 1.0 };
                        start * tail.others(self.light_density(k), onwards, techniques.has(2, j as u16))
                    }
                };
            }
            1.0 / (1.0 + others)
        }
    }

    /// The weights are those of the power heuristic, (p_s)²/Σ (p_i)², by the definition, for all sets of techniques,
    /// lights that rays hit and such that they do not, and perfect lobes anywhere: so they sum to one.
    #[test]
    fn weights_of_the_techniques_of_random_paths_are_those_of_the_power_heuristic() {
        let mut compared = 0;
        for techniques in [Techniques::CAMERA, Techniques::LIGHT, Techniques::TWO_WAY, Techniques::ALL] {
            for edges in 2..9 {
                for number in 0..200 {
                    let path = random_path(edges, number);
                    let possible: Vec<usize> = (0..=edges).filter(|s| path.has(techniques, *s)).collect();
                    let total: f64 = possible.iter().map(|s| square(path.density(*s))).sum();
                    let mut sum = 0.0;
                    for &s in &possible {
                        let expected = square(path.density(s)) / total;
                        let got = path.weight(techniques, s);
                        sum += got;
                        compared += 1;
                        assert!(
                            (got - expected).abs() < 1e-5,
                            "{techniques:?}, {edges} edges, path {number}, s = {s}: {got} for {expected}"
                        );
                    }
                    assert!(possible.is_empty() || (sum - 1.0).abs() < 1e-5, "{techniques:?}: {sum}");
                }
            }
        }
        assert!(compared > 5000, "{compared}");
    }
}
