//! The paper's combination of two estimates of one image, pixel by pixel and channel by channel.
//!
//! E_u is the uniform replica's own estimate (the mean of f), E_e that of the target rung (c times the mean of f/g).
//! Where noise is low both say the same; where it is not, a heuristic chooses by what the values themselves look like.
//! That makes every one of them biased at any number of samples, however unbiased E_u and E_e are, and consistent:
//! the result lies between the two, which converge to the same.
//!
//! Source: Kitaoka, Kitamura & Kishino, "Global Illumination with Replica-Exchange Monte Carlo Method", section 4.3
//! (definitions), section 5 and figure 1 (what they look like).

use super::Image;

/// How two values of one pixel and channel become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heuristic {
    /// E = max(E_e, E_u): too bright, since the maximum of two noisy values lies above both expectations (by 7 to
    /// 51 % of c on analytic targets, worst where one estimate has fireflies). Paper: section 4.3 a.
    Max,
    /// E = (a E_e + b E_u)/(a + b), a = E_e², b = E_u²: too bright like the maximum and a little less (2 to 42 %);
    /// fireflies of either estimate stay. 0 where both are 0, the other where one is. Paper: section 4.3 b, n = 2.
    Power,
    /// The same mean with a = exp(−2 (E_e − m)²/s²), b = exp(−2 (E_u − m)²/s²), where m is the median of both
    /// images' values in the pixel's neighbourhood and s their median absolute deviation |value − m|: what strays from
    /// its surroundings loses. Least noise and too dark, since values of skewed distributions have medians below their
    /// means, most where light arrives in rare bright samples.
    ///
    /// It departs from section 4.3 c of the paper in two points. The printed exponents are positive, which favours
    /// what strays and contradicts the paper's own figure 1 c; and they hold squared radiance, so that the choice
    /// would depend on the unit of radiance, which dividing by s takes out. Where s is 0 the limit s → 0 holds: the
    /// value nearer to m is the result, and the mean of both where they are as near.
    Median,
    /// As the paper prints the median, a = exp(+2 (E_e − m)²), b = exp(+2 (E_u − m)²): the value further from m wins,
    /// in bright images surely, in dim ones hardly. For reproduction only. Paper: section 4.3 c, n = 2.
    MedianAsPrinted,
}

/// Steepness of the weights, the paper's n.
const N: f64 = 2.0;
/// Pixels from the middle of a neighbourhood to its edge.
const REACH: i64 = 1;
/// Values in a neighbourhood of 3 × 3 pixels of two images. Pixels beyond the border count as the nearest on it.
const NEIGHBOURS: usize = 2 * 9;

impl Heuristic {
    /// All of them.
    pub const ALL: [Heuristic; 4] = [Heuristic::Max, Heuristic::Power, Heuristic::Median, Heuristic::MedianAsPrinted];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Heuristic::Max => "max",
            Heuristic::Power => "power",
            Heuristic::Median => "median",
            Heuristic::MedianAsPrinted => "median-printed",
        }
    }

    /// One image of E_u and E_e; the same if they are exchanged. Values are finite. Where a filter with negative lobes
    /// makes them negative, all this holds as it does above 0, with the maximum the one nearer to 0.
    ///
    /// # Panics
    /// If the images differ in size.
    pub fn combine(self, uniform: &Image, target: &Image) -> Image {
        assert_eq!((uniform.width, uniform.height), (target.width, target.height), "images of different sizes");
        let of_values = |combine: fn(f64, f64) -> f64| {
            per_value(uniform, |pixel, channel| combine(value(uniform, pixel, channel), value(target, pixel, channel)))
        };
        let of_deviations = |ln_weights: fn([f64; 2], f64) -> f64| {
            per_value(uniform, |pixel, channel| {
                let around = Neighbourhood::new([uniform, target], pixel, channel);
                let values = [uniform, target].map(|image| value(image, pixel, channel));
                let deviations = values.map(|value| (value - around.median).abs());
                weighted_mean(values, ln_weights(deviations, around.median_deviation))
            })
        };
        match self {
            Heuristic::Max => of_values(f64::max),
            Heuristic::Power => of_values(power_mean),
            Heuristic::Median => of_deviations(|[u, e], scale| {
                if u == e { 0.0 } else { -N * (u * u - e * e) / (scale * scale) } // never 0/0
            }),
            Heuristic::MedianAsPrinted => of_deviations(|[u, e], _| N * (u * u - e * e)),
        }
    }
}

fn per_value(like: &Image, combined: impl Fn(usize, usize) -> f64) -> Image {
    let pixels = (0..like.pixels.len()).map(|pixel| [0, 1, 2].map(|channel| combined(pixel, channel) as f32));
    Image::new(like.width, like.height, pixels.collect())
}

fn value(image: &Image, pixel: usize, channel: usize) -> f64 {
    f64::from(image.pixels[pixel][channel])
}

/// (x³ + y³)/(x² + y²), by the ratio of the smaller to the larger in magnitude.
fn power_mean(x: f64, y: f64) -> f64 {
    let (small, large) = if x.abs() < y.abs() { (x, y) } else { (y, x) };
    if large == 0.0 {
        return 0.0;
    }
    let ratio = small / large;
    large * (1.0 + ratio * ratio * ratio) / (1.0 + ratio * ratio)
}

/// (b x + a y)/(a + b) of [x, y] with ln(b/a) = `ln_ratio`, which may be infinite: the larger weight is taken as 1, so
/// that nothing overflows.
fn weighted_mean([x, y]: [f64; 2], ln_ratio: f64) -> f64 {
    let (heavy, light) = if ln_ratio >= 0.0 { (x, y) } else { (y, x) };
    let weight = libm::exp(-ln_ratio.abs());
    (heavy + weight * light) / (1.0 + weight)
}

/// What the values around a pixel are like.
struct Neighbourhood {
    median: f64,
    /// Median of |value − median|.
    median_deviation: f64,
}

impl Neighbourhood {
    fn new(images: [&Image; 2], pixel: usize, channel: usize) -> Neighbourhood {
        let [width, height] = [images[0].width, images[0].height].map(i64::from);
        let (x, y) = (pixel as i64 % width, pixel as i64 / width);
        let mut values = [0.0; NEIGHBOURS];
        let mut places = values.iter_mut();
        for row in y - REACH..=y + REACH {
            for column in x - REACH..=x + REACH {
                let neighbour = row.clamp(0, height - 1) * width + column.clamp(0, width - 1);
                for (image, place) in images.iter().zip(&mut places) {
                    *place = value(image, neighbour as usize, channel);
                }
            }
        }
        let median = median(&mut values);
        let mut deviations = values.map(|value| (value - median).abs());
        Neighbourhood { median, median_deviation: self::median(&mut deviations) }
    }
}

/// Mean of the two values in the middle.
fn median(values: &mut [f64; NEIGHBOURS]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    (values[NEIGHBOURS / 2 - 1] + values[NEIGHBOURS / 2]) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gray(width: u32, height: u32, values: &[f32]) -> Image {
        Image::new(width, height, values.iter().map(|v| [*v; 3]).collect())
    }

    /// Values over ten powers of two, some of them 0, other ones for every seed.
    fn noise(seed: u32) -> Image {
        let value = |i: u32| {
            let hash = (i + 1000 * seed).wrapping_mul(0x9E37_79B9).rotate_left(13).wrapping_mul(0x85EB_CA6B);
            if hash.is_multiple_of(11) { 0.0 } else { 2f32.powf((hash >> 8) as f32 / 2f32.powi(24) * 10.0 - 5.0) }
        };
        Image::new(13, 9, (0..13 * 9).map(|i| [3 * i, 3 * i + 1, 3 * i + 2].map(value)).collect())
    }

    /// The same, with every third value below 0.
    fn noise_of_both_signs(seed: u32) -> Image {
        let mut image = noise(seed);
        image.pixels.as_flattened_mut().iter_mut().skip(seed as usize).step_by(3).for_each(|value| *value = -*value);
        image
    }

    #[test]
    fn an_image_combined_with_itself_stays_the_same() {
        for heuristic in Heuristic::ALL {
            for image in [noise(1), noise_of_both_signs(1)] {
                assert_eq!(heuristic.combine(&image, &image), image, "{heuristic:?}");
            }
        }
    }

    #[test]
    fn exchanging_the_images_changes_nothing() {
        for heuristic in Heuristic::ALL {
            for [a, b] in [[noise(1), noise(2)], [noise_of_both_signs(1), noise_of_both_signs(2)]] {
                assert_eq!(heuristic.combine(&a, &b), heuristic.combine(&b, &a), "{heuristic:?}");
            }
        }
    }

    #[test]
    fn every_value_lies_between_the_two() {
        let pairs = [[noise(3), noise(4)], [noise_of_both_signs(3), noise_of_both_signs(4)]];
        for (heuristic, [a, b]) in Heuristic::ALL.into_iter().flat_map(|h| pairs.each_ref().map(|pair| (h, pair))) {
            let (a, b) = (a.clone(), b.clone());
            let combined = heuristic.combine(&a, &b);
            let pairs = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened());
            for (got, (a, b)) in combined.pixels.as_flattened().iter().zip(pairs) {
                assert!((a.min(*b)..=a.max(*b)).contains(got), "{heuristic:?}: {got} of {a} and {b}");
            }
        }
    }

    /// Scaling by powers of two is exact in floating point, so the results agree bit by bit.
    #[test]
    fn only_the_printed_median_depends_on_exposure() {
        let scaled = |image: &Image, by: f32| {
            Image::new(image.width, image.height, image.pixels.iter().map(|rgb| rgb.map(|v| v * by)).collect())
        };
        for heuristic in Heuristic::ALL {
            let combined = heuristic.combine(&noise(5), &noise(6));
            for scale in [2f32.powi(-30), 0.25, 8.0, 2f32.powi(40)] {
                let of_scaled = heuristic.combine(&scaled(&noise(5), scale), &scaled(&noise(6), scale));
                let equivariant = of_scaled == scaled(&combined, scale);
                assert_eq!(equivariant, heuristic != Heuristic::MedianAsPrinted, "{heuristic:?}, × {scale}");
            }
        }
    }

    /// A firefly of 100 at the middle of a field of values near 1.
    #[test]
    fn an_outlier_is_suppressed_by_the_median_alone() {
        let field: Vec<f32> = (0..25).map(|i| 1.0 + 0.01 * (i % 7) as f32).collect();
        let mut with_firefly = field.clone();
        with_firefly[12] = 100.0;
        for [a, b] in [[&field, &with_firefly], [&with_firefly, &field]] {
            let middle = |heuristic: Heuristic| heuristic.combine(&gray(5, 5, a), &gray(5, 5, b)).pixels[12][0];
            assert_eq!(middle(Heuristic::Median), field[12]);
            assert_eq!(middle(Heuristic::MedianAsPrinted), 100.0);
            assert_eq!(middle(Heuristic::Max), 100.0);
            assert!((99.9..100.0).contains(&middle(Heuristic::Power)));
        }
    }

    /// The middle of three pixels in a row: E_u is 2 among 1, 2, 3 and E_e is 4 among 2, 4, 3, every row counted three
    /// times. The median of 1 1 1 2 2 2 2 2 2 3 3 3 3 3 3 4 4 4 is 2.5, deviations 0.5 (twelve) and 1.5 (six) have the
    /// median 0.5.
    #[test]
    fn small_cases_are_what_one_gets_by_hand() {
        let (uniform, target) = (gray(3, 1, &[1.0, 2.0, 3.0]), gray(3, 1, &[2.0, 4.0, 3.0]));
        let mean = |a: f64, b: f64| (4.0 * a + 2.0 * b) / (a + b);
        for (heuristic, expected) in [
            (Heuristic::Max, 4.0),
            (Heuristic::Power, 72.0 / 20.0),
            (Heuristic::Median, mean((-2.0f64 * 9.0).exp(), (-2.0f64).exp())),
            (Heuristic::MedianAsPrinted, mean((2.0f64 * 2.25).exp(), (2.0f64 * 0.25).exp())),
        ] {
            let got = heuristic.combine(&uniform, &target).pixels[1];
            assert!(got.iter().all(|v| (f64::from(*v) - expected).abs() < 1e-6), "{heuristic:?}: {got:?}, {expected}");
        }
    }

    /// Channels have neighbourhoods of their own, and those of border pixels repeat the border.
    #[test]
    fn channels_and_corners_are_their_own_neighbourhoods() {
        let image = Image::new(2, 1, vec![[1.0, 10.0, 0.0], [3.0, 30.0, 0.0]]);
        for (channel, values) in [(0, [1.0, 3.0]), (1, [10.0, 30.0]), (2, [0.0, 0.0])] {
            for (pixel, value) in values.into_iter().enumerate() {
                // of every row two columns are the border's pixel and one is the other's
                let around = Neighbourhood::new([&image, &image], pixel, channel);
                assert_eq!((around.median, around.median_deviation), (value, 0.0));
            }
        }
    }

    #[test]
    fn nothing_stays_nothing_and_one_dark_image_leaves_the_heuristic_its_choice() {
        let (dark, lit) = (gray(3, 3, &[0.0; 9]), gray(3, 3, &[5.0; 9]));
        for (heuristic, expected) in [
            (Heuristic::Max, 5.0),
            (Heuristic::Power, 5.0),
            // half of all values are 0 and half are 5: both are as far from 2.5
            (Heuristic::Median, 2.5),
            (Heuristic::MedianAsPrinted, 2.5),
        ] {
            assert_eq!(heuristic.combine(&dark, &dark), dark, "{heuristic:?}");
            assert_eq!(heuristic.combine(&dark, &lit), gray(3, 3, &[expected; 9]), "{heuristic:?}");
        }
    }

    #[test]
    fn below_zero_the_power_heuristic_weighs_by_squares_as_well() {
        for (x, y, expected) in [(-2.0, 0.0, -2.0), (-1.0, -3.0, -2.8), (3.0, -1.0, 2.6), (2.0, -2.0, 0.0)] {
            assert!((power_mean(x, y) - expected).abs() < 1e-12, "{x}, {y}: {}", power_mean(x, y));
        }
    }

    /// Sixteen values of 1 and two others: m = 1 and s = 0.
    #[test]
    fn without_deviation_the_value_nearer_to_the_median_is_taken() {
        let ones = gray(3, 3, &[1.0; 9]);
        let middle = |e: f32| gray(3, 3, &[1.0, 1.0, 1.0, 1.0, e, 1.0, 1.0, 1.0, 1.0]);
        let median = |a: &Image, b: &Image| Heuristic::Median.combine(a, b).pixels[4][0];
        assert_eq!(median(&ones, &middle(7.0)), 1.0);
        assert_eq!(median(&middle(1.5), &middle(7.0)), 1.5);
        assert_eq!(median(&middle(0.5), &middle(1.5)), 1.0, "as near: their mean");
    }

    #[test]
    fn the_largest_values_do_not_overflow() {
        let (dim, bright) = (gray(1, 1, &[1.0]), gray(1, 1, &[f32::MAX]));
        for heuristic in Heuristic::ALL {
            let combined = heuristic.combine(&dim, &bright).pixels[0][0];
            assert!(combined.is_finite() && combined >= 1.0, "{heuristic:?}: {combined}");
        }
    }

    #[test]
    fn names_are_all_different() {
        let names = Heuristic::ALL.map(Heuristic::name);
        assert!((1..names.len()).all(|i| !names[..i].contains(&names[i])), "{names:?}");
    }
}
