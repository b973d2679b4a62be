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
            Some(densities) => (densities.map(f64::from), 1.0),
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
    /// Arrives at a vertex at the square of that distance; `cos` of the edge by its geometric normal.
    #[inline(always)]
    pub fn arrive(&self, distance2: f32, cos: f32) -> Tail {
        let distance2 = f64::from(distance2);
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
