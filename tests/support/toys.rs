//! Targets that are known exactly, on an image of one row: the toys of which the design speaks.
//!
//! A toy is g(x) = a + Σ_i h_i Π_d s((x_d − m_id)/w_id) on the unit cube, grey, with x_1 the position on the film. The
//! integral over any slab of x_1 is a sum of products of one-dimensional ones, each in closed form, so that images
//! have exact references. Each of the six stands for something that light does; with N = 2²⁰ independent uniform points
//! plain Monte Carlo errs by RMSE/c = √(128 M/N) on 128 columns, M = ∫g²/c² (M = 1 for a constant).

use relt::{
    chain::Target,
    path::{Contribution, Contributions},
    rng::unit_f32,
    sample::Proposals,
    scene::Rgb,
};
use statrs::function::erf::erf;

/// One-dimensional profile s of a bump, s(0) = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// e^{−t²/2}.
    Gaussian,
    /// 1/(1 + t²).
    Cauchy,
    /// 1 where |t| ≤ 1, else 0.
    Box,
}

impl Shape {
    /// ∫ s((x − m)/w) dx from a to b.
    fn integral(self, [a, b]: [f64; 2], m: f64, w: f64) -> f64 {
        match self {
            Shape::Gaussian => {
                let primitive = |x: f64| erf((x - m) / (w * std::f64::consts::SQRT_2));
                w * (std::f64::consts::PI / 2.0).sqrt() * (primitive(b) - primitive(a))
            }
            Shape::Cauchy => w * (((b - m) / w).atan() - ((a - m) / w).atan()),
            Shape::Box => (b.min(m + w) - a.max(m - w)).max(0.0),
        }
    }
}

/// One term of a toy's sum.
#[derive(Clone, Debug)]
struct Bump {
    height: f32,
    centre: Vec<f32>,
    width: Vec<f32>,
    inverse_width: Vec<f32>,
}

/// A target with known integrals.
#[derive(Clone, Debug)]
pub struct Toy {
    /// What it is called.
    pub name: &'static str,
    dimensions: usize,
    shape: Shape,
    floor: f32,
    bumps: Vec<Bump>,
    /// Block of primary samples that x_2, x_3, … are read from, and the blocks behind it; x_1 is dimension 0.
    block: u16,
}

/// A block behind those in which stratified points are low-discrepancy.
const DEEP: u16 = 4;

impl Toy {
    /// A toy of at most [`MOST_DIMENSIONS`] dimensions, with nothing but its floor a. Its coordinates are the first primary
    /// samples.
    pub fn new(name: &'static str, dimensions: usize, floor: f32, shape: Shape) -> Toy {
        assert!((1..=MOST_DIMENSIONS).contains(&dimensions));
        Toy { name, dimensions, shape, floor, bumps: Vec::new(), block: 0 }
    }

    /// The same with all coordinates but x_1 taken from later primary samples, where no point is low-discrepancy. What
    /// light does after some bounces is like that. In two dimensions low-discrepancy points integrate what no path tracer
    /// can: then K = 1 errs a hundred times less than anything random, and says nothing of scenes.
    pub fn deep(self) -> Toy {
        Toy { block: DEEP, ..self }
    }

    /// With one more bump of height h, centre m and width w.
    pub fn with(mut self, height: f32, centre: &[f32], width: &[f32]) -> Toy {
        assert!(centre.len() == self.dimensions && width.len() == self.dimensions);
        let inverse_width = width.iter().map(|w| 1.0 / w).collect();
        self.bumps.push(Bump { height, centre: centre.to_vec(), width: width.to_vec(), inverse_width });
        self
    }

    /// g at a point.
    #[inline(always)]
    pub fn g(&self, x: &[f32]) -> f32 {
        /// Beyond this e^{−t²/2} is below 10⁻³¹.
        const FAR: f32 = 144.0;
        let mut sum = self.floor;
        for bump in &self.bumps {
            let t = |d: usize| (x[d] - bump.centre[d]) * bump.inverse_width[d];
            sum += match self.shape {
                Shape::Gaussian => {
                    let square: f32 = (0..self.dimensions).map(|d| t(d) * t(d)).sum();
                    if square > FAR { 0.0 } else { bump.height * (-0.5 * square).exp() }
                }
                Shape::Cauchy => bump.height / (0..self.dimensions).map(|d| 1.0 + t(d) * t(d)).product::<f32>(),
                Shape::Box if (0..self.dimensions).all(|d| t(d).abs() <= 1.0) => bump.height,
                Shape::Box => 0.0,
            };
        }
        sum
    }

    /// Mean of g over each of `n` columns of equal width: the image.
    pub fn columns(&self, n: u32) -> Vec<f64> {
        let n = f64::from(n);
        (0..n as u32).map(|i| n * self.slab([f64::from(i) / n, f64::from(i + 1) / n])).collect()
    }

    /// c = ∫ g.
    pub fn c(&self) -> f64 {
        self.slab([0.0, 1.0])
    }

    /// p_s, the share of the cube where g > 0; boxes must not overlap.
    pub fn lit_share(&self) -> f64 {
        if self.floor > 0.0 || self.shape != Shape::Box {
            return 1.0;
        }
        self.bumps.iter().map(|bump| bump.integral(self.shape, [0.0, 1.0])).sum()
    }

    /// ∫ g over x_1 in the interval.
    fn slab(&self, x: [f64; 2]) -> f64 {
        let bumps = self.bumps.iter().map(|bump| f64::from(bump.height) * bump.integral(self.shape, x));
        f64::from(self.floor) * (x[1] - x[0]) + bumps.sum::<f64>()
    }
}

impl Bump {
    /// ∫ Π_d s, over x_1 in the interval and the whole range of the others.
    fn integral(&self, shape: Shape, x: [f64; 2]) -> f64 {
        let ranges = std::iter::once(x).chain(std::iter::repeat([0.0, 1.0]));
        let places = self.centre.iter().zip(&self.width).map(|(m, w)| (f64::from(*m), f64::from(*w)));
        ranges.zip(places).map(|(range, (m, w))| shape.integral(range, m, w)).product()
    }
}

/// Dimensions of a toy, at most.
pub const MOST_DIMENSIONS: usize = 20;

impl Target for Toy {
    type Workspace = Vec<u32>;

    fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, live: &mut Vec<u32>) {
        proposals.begin(live);
        // x_2 is word 1 of the first block or word 0 of a later one
        let skipped = if self.block == 0 { 1 } else { 0 };
        let end = self.block + (self.dimensions - 1 + skipped).div_ceil(4).max(1) as u16;
        (0..end).for_each(|block| proposals.draw(block, live));
        for &lane in &*live {
            let lane = lane as usize;
            let mut x = [0.0; MOST_DIMENSIONS + 4];
            x[0] = unit_f32(proposals.block(0, lane)[0]);
            for (block, x) in (self.block..end).zip(x[1 - skipped..].chunks_mut(4)) {
                x.iter_mut().zip(proposals.block(block, lane)).for_each(|(x, word)| *x = unit_f32(word));
            }
            out.lanes[lane] = Contribution::settle([x[0], 0.5], Rgb::splat(self.g(&x))).0;
        }
    }
}

/// The six of the design's table, in its order.
pub fn table() -> [Toy; 6] {
    [smooth(), dark(), islands(), peaks(), golf(), heavy()]
}

/// A room lit evenly: one wide bump on a floor. c = 1.17, p_s = 1, M = 1.01: RMSE/c 0.011.
pub fn smooth() -> Toy {
    Toy::new("smooth", 2, 1.0, Shape::Gaussian).with(0.4, &[0.3, 0.6], &[0.25, 0.4])
}

/// A dark room with a few lights of many sizes: half of the cube is below 1/10 of the mean, g from 10⁻³ to 16.
/// c = 0.144, p_s = 1, M = 9.8: RMSE/c 0.035.
pub fn dark() -> Toy {
    Toy::new("dark", 2, 1e-3, Shape::Gaussian)
        .with(0.02, &[0.5, 0.5], &[0.25, 0.25])
        .with(1.0, &[0.2, 0.3], &[0.05, 0.12])
        .with(0.3, &[0.55, 0.7], &[0.2, 0.1])
        .with(2.0, &[0.8, 0.2], &[0.06, 0.06])
        .with(16.0, &[0.42, 0.85], &[0.008, 0.02])
}

/// Light through openings: four boxes about equally bright with nothing between. c = 0.0068, p_s = 0.0069, M = 150:
/// RMSE/c 0.135.
pub fn islands() -> Toy {
    Toy::new("islands", 2, 0.0, Shape::Box)
        .with(1.0, &[0.15, 0.3], &[0.02, 0.02])
        .with(1.25, &[0.4, 0.75], &[0.025, 0.0175])
        .with(0.75, &[0.62, 0.25], &[0.0175, 0.025])
        .with(1.0, &[0.85, 0.6], &[0.02, 0.022])
}

/// Caustics: eight peaks that rise about as r^−2.2 from r = 0.05 down to 0.05/3^i, i from 0 to 4, made of Gaussians of as
/// many widths. c = 494, p_s = 1, M = 1.5·10⁴: RMSE/c 1.4.
pub fn peaks() -> Toy {
    let centres =
        [[0.11, 0.62], [0.23, 0.21], [0.34, 0.83], [0.46, 0.37], [0.58, 0.71], [0.69, 0.12], [0.81, 0.55], [0.92, 0.9]];
    let mut toy = Toy::new("peaks", 2, 1.0, Shape::Gaussian);
    for (i, centre) in centres.iter().enumerate() {
        let brightness = 0.5 + (5 * i % 8) as f32 / 8.0;
        for level in 0..=i % 5 {
            let width = 0.05 / 3f32.powi(level as i32);
            toy = toy.with(brightness * width.powf(-2.2), centre, &[width; 2]);
        }
    }
    toy
}

/// Bright needles far apart on a plain that does not lead to them (eight of width 0.0017 with six tenths of the light).
/// c = 2.6, p_s = 1, M = 1.3·10³: RMSE/c 0.39. No ladder on g can find them: tempering keeps a needle as narrow as it is.
pub fn golf() -> Toy {
    let centres =
        [[0.09, 0.35], [0.2, 0.8], [0.31, 0.15], [0.43, 0.6], [0.56, 0.9], [0.67, 0.3], [0.78, 0.7], [0.9, 0.1]];
    let plain = Toy::new("golf", 2, 1.0, Shape::Gaussian);
    centres.iter().fold(plain, |toy, centre| toy.with(11_000.0, centre, &[0.0017; 2]))
}

/// Several rough bounces: a product of Cauchy densities in five dimensions, widths 0.015 to 0.1. c = 1.0·10⁻⁵, p_s = 1,
/// M = 4.2·10³: RMSE/c 0.71.
pub fn heavy() -> Toy {
    Toy::new("heavy", 5, 0.0, Shape::Cauchy).with(1.0, &[0.5, 0.3, 0.7, 0.4, 0.6], &[0.1, 0.05, 0.03, 0.02, 0.015])
}
