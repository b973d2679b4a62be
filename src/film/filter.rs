//! Reconstruction filters, and the pixels that one sample reaches.

use serde::{Deserialize, Serialize};

/// How a sample on the film spreads over pixels; all separable, lengths in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Filter {
    /// Constant over the pixel that the sample falls into.
    Box,
    /// 1 − |x|/radius.
    Tent {
        /// Half width.
        radius: f32,
    },
    /// exp(−x²/2σ²) − exp(−r²/2σ²) with r = 4σ.
    Gaussian {
        /// Standard deviation σ.
        stddev: f32,
    },
    /// The two-parameter cubic of radius 2. With B = 0 and C = ½ it is the Catmull-Rom spline.
    /// Source: Mitchell & Netravali 1988, "Reconstruction Filters in Computer Graphics", equation 8.
    Mitchell {
        /// B of the paper, blur; within [0, 1].
        b: f32,
        /// C of the paper, ringing; within [0, 1].
        c: f32,
    },
    /// sinc(x) sinc(x/n) with sinc(x) = sin(πx)/(πx), within a radius of n.
    /// Source: Duchon 1979, "Lanczos Filtering in One and Two Dimensions".
    Lanczos {
        /// n, ≥ 1.
        lobes: u32,
    },
}

impl Filter {
    /// Half width in pixels.
    pub fn radius(self) -> f32 {
        match self {
            Filter::Box => 0.5,
            Filter::Tent { radius } => radius,
            Filter::Gaussian { stddev } => 4.0 * stddev,
            Filter::Mitchell { .. } => 2.0,
            Filter::Lanczos { lobes } => lobes as f32,
        }
    }

    /// Whether h is negative anywhere, so that a pixel may be: beside an edge it swings below the darker side as it
    /// does above the brighter one.
    pub fn has_negative_lobes(self) -> bool {
        match self {
            Filter::Box | Filter::Tent { .. } | Filter::Gaussian { .. } => false,
            // from 1 to 2, h = (2 − x)² (2B + 6C − (B + 6C) x)/6 changes its sign where C > 0, near 2
            Filter::Mitchell { c, .. } => c > 0.0,
            Filter::Lanczos { lobes } => lobes > 1,
        }
    }

    /// h(x), the textbook's function along one axis; [`Footprint`] uses a close approximation.
    pub fn evaluate(self, x: f64) -> f64 {
        let radius = f64::from(self.radius());
        match self {
            Filter::Box => f64::from(x.abs() <= radius),
            Filter::Tent { .. } => (1.0 - x.abs() / radius).max(0.0),
            Filter::Gaussian { stddev } => {
                let bell = |x: f64| libm::exp(-x * x / (2.0 * f64::from(stddev).powi(2)));
                (bell(x) - bell(radius)).max(0.0)
            }
            Filter::Mitchell { b, c } => mitchell(x.abs(), f64::from(b), f64::from(c)),
            Filter::Lanczos { .. } if x.abs() >= radius => 0.0,
            Filter::Lanczos { .. } => sinc(x) * sinc(x / radius),
        }
    }
}

/// h of [`Filter::Mitchell`] at `x` ≥ 0.
fn mitchell(x: f64, b: f64, c: f64) -> f64 {
    if x < 1.0 {
        ((12.0 - 9.0 * b - 6.0 * c) * x + (-18.0 + 12.0 * b + 6.0 * c)) * x * x / 6.0 + (3.0 - b) / 3.0
    } else if x < 2.0 {
        (2.0 - x) * (2.0 - x) * (2.0 * b + 6.0 * c - (b + 6.0 * c) * x) / 6.0
    } else {
        0.0
    }
}

/// sin(πx)/(πx).
fn sinc(x: f64) -> f64 {
    let x = std::f64::consts::PI * x;
    if x == 0.0 { 1.0 } else { libm::sin(x) / x }
}

/// Where samples on a film of a certain size go, and with which weights.
///
/// A sample at x reaches every pixel j whose centre x_j is within the filter, with weight h(x − x_j)/H_j, where
/// H_j = ∫ h(x − x_j) dx over the film: samples come from nowhere else, so near a border H_j is smaller. With x
/// uniform over the w × h pixels of the film and splats scaled by w·h, the expectation of pixel j is
/// ∫ L h(x − x_j) dx / ∫ h(x − x_j) dx. A weight-normalised image block, as Mitsuba's, converges to the same; but
/// the weights here are known beforehand, so the estimate is unbiased and linear in L. Weights of filters with negative
/// lobes may be negative, and then so may pixels be; H_j is positive all the same, as ∫₀ˣ h is for every x > 0.
///
/// h is tabulated as a function linear between nodes. For the tent this is the filter itself. The others differ from it
/// by |h″|/8 times the square of a step: less than 2·10⁻⁶ of the peak for the Gaussian (h″ ≤ 1/σ², steps of σ/256),
/// 4·10⁻⁶ for Mitchell's (|h″| ≤ 6, steps of 1/512) and for Lanczos's (|h″| ≤ π²/2, such steps or smaller ones). H_j is
/// the integral of the tabulated function, so that a constant stays that constant.
#[derive(Clone, Debug)]
pub struct Footprint {
    width: u32,
    height: u32,
    /// `None` for the box.
    bell: Option<Bell>,
    negative_lobes: bool,
    /// 1/∫ h(x − x_j) dx for every column.
    columns: Vec<f32>,
    /// The same for every row.
    rows: Vec<f32>,
}

/// A column's or a row's coordinate as a sample sees it: first and last pixel within reach, if any.
type Reach = std::ops::RangeInclusive<i64>;

/// Columns whose weights are computed at once; a Gaussian of σ = 0.5 reaches 4.
const COLUMNS_AT_ONCE: usize = 16;

impl Footprint {
    /// Whether every film position goes to one pixel.
    pub fn is_box(&self) -> bool {
        self.bell.is_none()
    }

    /// Whether weights may be negative.
    pub fn has_negative_lobes(&self) -> bool {
        self.negative_lobes
    }

    /// Prepares the filter for a film.
    ///
    /// # Panics
    /// If the filter's radius is not positive and finite or the film is empty.
    pub fn new(filter: Filter, width: u32, height: u32) -> Footprint {
        assert!(width > 0 && height > 0, "a film of {width} × {height}");
        let bell = match filter {
            Filter::Box => None,
            _ => Some(Bell::new(filter)),
        };
        let inverse_integrals = |extent: u32| match &bell {
            None => Vec::new(),
            Some(bell) => (0..extent)
                .map(|j| {
                    let centre = f64::from(j) + 0.5;
                    (1.0 / (bell.integral(f64::from(extent) - centre) + bell.integral(centre))) as f32
                })
                .collect(),
        };
        let (columns, rows) = (inverse_integrals(width), inverse_integrals(height));
        Footprint { width, height, bell, negative_lobes: filter.has_negative_lobes(), columns, rows }
    }

    /// Calls `f` with the row-major index of every pixel that a sample at column `x` and row `y` reaches, and the
    /// sample's weight there. `x` ∈ [0, width) runs to the right and `y` ∈ [0, height) downwards; pixel centres are
    /// at halves. A position on the far border (by rounding) counts as inside.
    #[inline]
    pub fn spread(&self, x: f32, y: f32, f: &mut impl FnMut(u32, f32)) {
        debug_assert!(x >= 0.0 && y >= 0.0 && x <= self.width as f32 && y <= self.height as f32, "({x}, {y}) off film");
        match &self.bell {
            None => {
                let (column, row) = ((x as u32).min(self.width - 1), (y as u32).min(self.height - 1));
                f(row * self.width + column, 1.0);
            }
            Some(bell) => self.spread_bell(bell, x, y, f),
        }
    }

    fn spread_bell(&self, bell: &Bell, x: f32, y: f32, f: &mut impl FnMut(u32, f32)) {
        let (columns, rows) = (bell.reach(x, self.width), bell.reach(y, self.height));
        let (mut start, end) = (*columns.start(), *columns.end() + 1);
        while start < end {
            let mut weights = [0.0; COLUMNS_AT_ONCE];
            let chunk = &mut weights[..((end - start) as usize).min(COLUMNS_AT_ONCE)];
            for (i, weight) in chunk.iter_mut().enumerate() {
                let column = start as usize + i;
                *weight = bell.evaluate(x - (column as f32 + 0.5)) * self.columns[column];
            }
            for row in rows.clone() {
                let row_weight = bell.evaluate(y - (row as f32 + 0.5)) * self.rows[row as usize];
                let first = row as u32 * self.width + start as u32;
                for (pixel, weight) in (first..).zip(&*chunk) {
                    f(pixel, weight * row_weight);
                }
            }
            start += COLUMNS_AT_ONCE as i64;
        }
    }
}

/// Nodes of the table between the centre and the radius; as many for every two pixels of a filter that oscillates.
const NODES: usize = 1024;

/// One side of a symmetric filter, linear between equidistant nodes.
#[derive(Clone, Debug)]
struct Bell {
    radius: f32,
    nodes_per_pixel: f32,
    /// Number of the last node, which lies at the radius.
    last_node: f32,
    /// Value at each node and its difference to the next; a zero at the end serves distances of exactly the radius.
    table: Vec<[f32; 2]>,
    /// ∫ from 0 to each node, in pixels.
    integrals: Vec<f64>,
}

impl Bell {
    fn new(filter: Filter) -> Bell {
        let radius = filter.radius();
        assert!(radius.is_finite() && radius > 0.0, "{filter:?} has no extent");
        let nodes = match filter {
            Filter::Lanczos { lobes } => NODES * (lobes as usize).div_ceil(2),
            _ => NODES,
        };
        let step = f64::from(radius) / nodes as f64;
        let value = |node: usize| if node < nodes { filter.evaluate(node as f64 * step) as f32 } else { 0.0 };
        let table: Vec<_> = (0..=nodes).map(|node| [value(node), value(node + 1) - value(node)]).collect();
        let integrals = (0..=nodes)
            .scan(0.0, |sum, node| {
                let before = *sum;
                *sum += f64::from(value(node) + value(node + 1)) / 2.0 * step;
                Some(before)
            })
            .collect();
        Bell { radius, nodes_per_pixel: nodes as f32 / radius, last_node: nodes as f32, table, integrals }
    }

    /// h(x).
    #[inline]
    fn evaluate(&self, x: f32) -> f32 {
        let place = (x.abs() * self.nodes_per_pixel).min(self.last_node);
        let node = place as usize;
        let [value, slope] = self.table[node];
        value + slope * (place - node as f32)
    }

    /// ∫ h from 0 to `x` ≥ 0.
    fn integral(&self, x: f64) -> f64 {
        let nodes = f64::from(self.last_node);
        let step = f64::from(self.radius) / nodes;
        let place = (x / step).min(nodes);
        let node = place as usize;
        let rest = place - node as f64;
        let [value, slope] = self.table[node].map(f64::from);
        self.integrals[node] + (value + slope * rest / 2.0) * rest * step
    }

    /// The pixels whose centres lie within the radius of `x`; empty where there are none.
    #[inline]
    fn reach(&self, x: f32, extent: u32) -> Reach {
        let first = (x - self.radius - 0.5).ceil() as i64;
        let last = (x + self.radius - 0.5).floor() as i64;
        first.max(0)..=last.min(i64::from(extent) - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_as_close_to_the_filter_as_stated() {
        for (filter, stated) in [
            (Filter::Tent { radius: 1.0 }, 2e-6),
            (Filter::Tent { radius: 2.7 }, 2e-6),
            (Filter::Gaussian { stddev: 0.5 }, 2e-6),
            (Filter::Mitchell { b: 0.0, c: 0.0 }, 4e-6),
            (Filter::Mitchell { b: 0.0, c: 0.5 }, 4e-6),
            (Filter::Mitchell { b: 1.0, c: 1.0 }, 4e-6),
            (Filter::Lanczos { lobes: 1 }, 4e-6),
            (Filter::Lanczos { lobes: 2 }, 4e-6),
            (Filter::Lanczos { lobes: 3 }, 4e-6),
            (Filter::Lanczos { lobes: 16 }, 4e-6),
        ] {
            let bell = Bell::new(filter);
            for i in 0..100_000 {
                let x = i as f32 * filter.radius() * 1e-5;
                let error = f64::from(bell.evaluate(x)) - filter.evaluate(f64::from(x));
                assert!(error.abs() < stated, "{filter:?} at {x}: off by {error:e}");
            }
        }
    }

    #[test]
    fn integrals_are_those_of_the_tabulated_function() {
        let tent = Bell::new(Filter::Tent { radius: 2.0 });
        assert!((tent.integral(2.0) - 1.0).abs() < 1e-7);
        assert!((tent.integral(1.0) - 0.75).abs() < 1e-7);
        assert_eq!(tent.integral(5.0), tent.integral(2.0));
        let gaussian = Bell::new(Filter::Gaussian { stddev: 0.5 });
        // ∫ exp(−2x²) from 0 to 2 is √(π/8)·erf(2√2); erf(2√2) = 0.99993665751633.
        let expected = (std::f64::consts::PI / 8.0).sqrt() * 0.999_936_657_516_33 - 2.0 * (-8f64).exp();
        assert!((gaussian.integral(2.0) - expected).abs() < 2e-6, "{} {expected}", gaussian.integral(2.0));
    }

    /// At 0 the cubics are 1 − B/3 and at 1 they are B/6; the Catmull-Rom spline is (−1, 9, 9, −1)/16 at the halves.
    /// sinc(½) sinc(1/6) = (2/π)(3/π), as sin(π/6) = ½.
    #[test]
    fn filters_have_the_values_that_one_gets_by_hand() {
        let catmull_rom = Filter::Mitchell { b: 0.0, c: 0.5 };
        let recommended = Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 };
        let lanczos = Filter::Lanczos { lobes: 3 };
        for (filter, x, expected) in [
            (catmull_rom, 0.0, 1.0),
            (catmull_rom, 0.5, 9.0 / 16.0),
            (catmull_rom, 1.0, 0.0),
            (catmull_rom, 1.5, -1.0 / 16.0),
            (catmull_rom, 2.5, 0.0),
            (recommended, 0.0, 8.0 / 9.0),
            (recommended, 1.0, 1.0 / 18.0),
            (Filter::Mitchell { b: 1.0, c: 0.0 }, 1.0, 1.0 / 6.0),
            (lanczos, 0.0, 1.0),
            (lanczos, 0.5, 6.0 / std::f64::consts::PI.powi(2)),
            (lanczos, 2.0, 0.0),
            (lanczos, 3.1, 0.0),
        ] {
            for x in [x, -x] {
                let got = filter.evaluate(x);
                assert!((got - expected).abs() < 1e-7, "{filter:?} at {x}: {got}, expected {expected}");
            }
        }
    }

    /// Copies of a cubic of the family at whole distances sum to 1, whatever B and C are.
    #[test]
    fn cubics_add_up_to_one() {
        for (b, c) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.2, 0.7)] {
            let filter = Filter::Mitchell { b, c };
            for x in [0.0, 0.1, 0.5, 0.77] {
                let sum: f64 = (-3..3).map(|j| filter.evaluate(x - f64::from(j))).sum();
                assert!((sum - 1.0).abs() < 1e-6, "{filter:?} at {x}: {sum}");
            }
        }
    }

    #[test]
    fn a_filter_says_whether_it_is_negative_anywhere() {
        let mut filters = vec![Filter::Box, Filter::Tent { radius: 1.3 }, Filter::Gaussian { stddev: 0.5 }];
        filters.extend((1..5).map(|lobes| Filter::Lanczos { lobes }));
        filters.extend(
            [0.0, 0.01, 0.5, 1.0]
                .into_iter()
                .flat_map(|b| [0.0, 0.01, 0.5, 1.0].map(|c| (b, c)))
                .map(|(b, c)| Filter::Mitchell { b, c }),
        );
        for filter in filters {
            // rounding of the sine leaves −10⁻¹⁷ at the zeros of a square
            let least = (0..5000).map(|i| filter.evaluate(f64::from(i) * 1e-3)).fold(0.0, f64::min);
            assert_eq!(filter.has_negative_lobes(), least < -1e-12, "{filter:?}: down to {least:e}");
        }
    }

    #[test]
    fn what_lies_on_the_film_is_positive_however_narrow_it_is() {
        for filter in [
            Filter::Mitchell { b: 0.0, c: 1.0 },
            Filter::Mitchell { b: 1.0, c: 1.0 },
            Filter::Lanczos { lobes: 2 },
            Filter::Lanczos { lobes: 16 },
        ] {
            let bell = Bell::new(filter);
            for i in 1..2000 {
                let x = f64::from(i) * 0.01;
                assert!(bell.integral(x) > 0.0, "{filter:?}: ∫ up to {x} is {}", bell.integral(x));
            }
        }
    }

    #[test]
    fn the_box_gives_one_pixel() {
        let footprint = Footprint::new(Filter::Box, 3, 2);
        for (x, y, pixel) in [(0.0, 0.0, 0), (0.999, 0.2, 0), (1.0, 0.0, 1), (2.5, 1.5, 5), (3.0, 2.0, 5)] {
            let mut got = Vec::new();
            footprint.spread(x, y, &mut |pixel, weight| got.push((pixel, weight)));
            assert_eq!(got, [(pixel, 1.0)], "at ({x}, {y})");
        }
    }
}
