//! Points that contribute elsewhere than where they lie on the film, as light subpaths do: what they give must arrive
//! there, once, with every method, every combination and every filter.

use rayon::{ThreadPoolBuilder, prelude::*};
use relt::{
    chain::{LargeSteps, Measure, Target},
    film::{Filter, Footprint, Image, Plane},
    path::{Causes, Contribution, Contributions, FilmSplat, Outcome},
    rng::{Rng, unit_f32},
    sample::Proposals,
    scene::Rgb,
    tempering::{Choices, Combine, Sampler, Setup},
};

use crate::{
    pssmlt::pssmlt_images,
    statistics::{f_test, mean, t_test},
    support::{automatic, replicas},
};

/// A target of eight dimensions x, y, u, v, w, t, z, s that lights the film in red at (x, y), where its points lie, in
/// green at (u, v), and in blue at (2w, s) and at (√t, s).
///
/// Every one of these is there for a part of the points only, brighter by the inverse of that part, so that lists differ
/// in length, some points are dark at their own position and not elsewhere, and some altogether.
pub struct Scattered;

impl Scattered {
    /// No luminance is greater: 0.299 · 2 · 6.1 + 0.587 · 8/0.75 + 0.114 · (4 + 4).
    pub const LARGEST: f64 = 10.9;

    /// Radiance in red.
    fn own(x: f32, y: f32) -> f32 {
        0.1 + 6.0 * bell(x - 0.3, y - 0.4, 0.1)
    }

    /// Radiance in green.
    fn spot(u: f32, v: f32) -> f32 {
        8.0 * bell(u - 0.75, v - 0.6, 0.08)
    }

    /// The image before filtering. In blue: 2q from the points at (2w, s), which are spread evenly, and 2p from those at
    /// (√t, s), of which that is the density.
    fn radiance(p: f32, q: f32) -> [f32; 3] {
        [Scattered::own(p, q), Scattered::spot(p, q), 2.0 * q + 2.0 * p]
    }
}

/// A bump of height 1.
fn bell(x: f32, y: f32, width: f32) -> f32 {
    (-0.5 * (x * x + y * y) / (width * width)).exp()
}

impl Target for Scattered {
    type Workspace = Vec<u32>;

    fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, live: &mut Vec<u32>) {
        proposals.begin(live);
        (0..2).for_each(|block| proposals.draw(block, live));
        for &lane in &*live {
            let lane = lane as usize;
            let [x, y, u, v] = proposals.block(0, lane).map(unit_f32);
            let [w, t, z, s] = proposals.block(1, lane).map(unit_f32);
            out.elsewhere.clear(lane);
            let mut push = |p: f32, q: f32, rgb| out.elsewhere.push(lane, FilmSplat { film: [p, q], rgb });
            if z < 0.75 {
                push(u, v, Rgb::new(0.0, Scattered::spot(u, v) / 0.75, 0.0));
            }
            if w < 0.5 {
                push(2.0 * w, s, Rgb::new(0.0, 0.0, 2.0 * s / 0.5));
            }
            if u < 0.25 {
                push(t.sqrt(), s, Rgb::new(0.0, 0.0, 1.0 / 0.25));
            }
            let red = if t < 0.5 { Scattered::own(x, y) / 0.5 } else { 0.0 };
            let rgb = Rgb::new(red, 0.0, 0.0);
            let (whole, causes) = Contribution::settle_whole([x, y], rgb, &mut out.elsewhere, lane);
            out.lanes[lane] = whole;
            out.faults.count(causes);
        }
    }

    fn splats_elsewhere(&self) -> bool {
        true
    }
}

/// A target of the same image, whose points choose what they light: red, green, or blue in either way.
///
/// Open points have all of that at once, red after a roulette that points which choose do not play.
pub struct Choosing;

impl Choosing {
    /// Probabilities of the choices.
    const CHANCES: [f32; 4] = [0.4, 0.3, 0.2, 0.1];
    /// Probability that roulette leaves open points their red.
    const SURVIVAL: f32 = 0.5;

    /// Where and what is lit by each choice, and the first block's place.
    fn lit(proposals: &mut Proposals, lane: usize) -> ([f32; 2], [FilmSplat; 4]) {
        let [x, y, u, v] = proposals.block(0, lane).map(unit_f32);
        let [w, t, _, s] = proposals.block(1, lane).map(unit_f32);
        let splat = |p: f32, q: f32, rgb| FilmSplat { film: [p, q], rgb };
        let lit = [
            splat(x, y, Rgb::new(Scattered::own(x, y), 0.0, 0.0)),
            splat(u, v, Rgb::new(0.0, Scattered::spot(u, v), 0.0)),
            splat(w, s, Rgb::new(0.0, 0.0, 2.0 * s)),
            splat(t.sqrt(), s, Rgb::new(0.0, 0.0, 1.0)),
        ];
        ([x, y], lit)
    }

    fn draw(proposals: &mut Proposals, live: &mut Vec<u32>) {
        proposals.begin(live);
        (0..3).for_each(|block| proposals.draw(block, live));
    }
}

impl Target for Choosing {
    type Workspace = Vec<u32>;

    fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, live: &mut Vec<u32>) {
        Choosing::draw(proposals, live);
        for &lane in &*live {
            let lane = lane as usize;
            let (film, lit) = Choosing::lit(proposals, lane);
            let [choice, ..] = proposals.block(2, lane).map(unit_f32);
            let chosen = [0.4, 0.7, 0.9].into_iter().position(|end| choice < end).unwrap_or(3);
            let FilmSplat { film: place, rgb } = lit[chosen];
            let rgb = rgb / Choosing::CHANCES[chosen];
            out.elsewhere.clear(lane);
            if chosen > 0 {
                out.elsewhere.push(lane, FilmSplat { film: place, rgb });
            }
            let own = if chosen == 0 { rgb } else { Rgb::ZERO };
            let (whole, faults) = Contribution::settle_whole(film, own, &mut out.elsewhere, lane);
            out.lanes[lane] = Contribution { chance: Choosing::CHANCES[chosen], ..whole };
            out.faults.count(faults);
        }
    }

    fn splats_elsewhere(&self) -> bool {
        true
    }

    fn has_outcomes(&self) -> bool {
        true
    }

    fn evaluate_open(&self, proposals: &mut Proposals, out: &mut Contributions, live: &mut Vec<u32>) {
        Choosing::draw(proposals, live);
        for &lane in &*live {
            let lane = lane as usize;
            let (film, lit) = Choosing::lit(proposals, lane);
            let [_, roulette, ..] = proposals.block(2, lane).map(unit_f32);
            out.outcomes.clear(lane);
            out.lanes[lane] = Contribution { film, ..Contribution::NONE };
            let mut causes = Causes::NONE;
            for (i, splat) in lit.into_iter().enumerate() {
                let survival = if i == 0 { Choosing::SURVIVAL } else { 1.0 };
                if i == 0 && roulette >= survival {
                    continue;
                }
                let splat = FilmSplat { rgb: splat.rgb / survival, ..splat };
                let chance = Choosing::CHANCES[i] / survival;
                let mut outcome = Outcome { splat, own: i == 0, chance, ..Outcome::default() };
                outcome.settle(&mut causes);
                out.outcomes.push(lane, outcome);
            }
            out.faults.count(causes);
        }
    }
}

const SIZE: [u32; 2] = [6, 4];
const EVALUATIONS: u64 = 1 << 15;
const RUNS: u64 = 16;
const FILTERS: [Filter; 2] = [Filter::Box, Filter::Gaussian { stddev: 0.5 }];

fn footprint(filter: Filter) -> Footprint {
    Footprint::new(filter, SIZE[0], SIZE[1])
}

/// The image by the midpoint rule on 64 × 64 positions a pixel: pixel and channel one after the other.
fn truth(filter: Filter) -> Vec<f64> {
    const FINE: u32 = 64;
    let footprint = footprint(filter);
    let mut image = vec![0.0; 3 * (SIZE[0] * SIZE[1]) as usize];
    for row in 0..FINE * SIZE[1] {
        for column in 0..FINE * SIZE[0] {
            let [x, y] = [column, row].map(|i| (i as f32 + 0.5) / FINE as f32);
            let radiance = Scattered::radiance(x / SIZE[0] as f32, y / SIZE[1] as f32);
            footprint.spread(x, y, &mut |pixel, share| {
                for (channel, value) in radiance.into_iter().enumerate() {
                    image[3 * pixel as usize + channel] += f64::from(share * value) / f64::from(FINE * FINE);
                }
            });
        }
    }
    image
}

/// Fails if the mean of the images differs from the truth: shape by F, brightness by t, at level 2 · 10⁻⁴ each, beside a
/// `tolerance` for biases O(1/N).
fn agrees(images: &[Vec<f64>], truth: &[f64], tolerance: f64, case: &str) {
    let c = mean(truth.iter().copied());
    let room: Vec<f64> = truth.iter().map(|v| (tolerance * v.max(0.1 * c)).powi(2)).collect();
    let (f, p_f) = f_test(images, truth, &room);
    let brightness: Vec<f64> = images.iter().map(|image| mean(image.iter().copied()) / c).collect();
    let (t, p_t) = t_test(&brightness, 1.0, tolerance * tolerance);
    let average: Vec<f64> = (0..truth.len()).map(|i| mean(images.iter().map(|image| image[i]))).collect();
    assert!(
        p_f > 2e-4 && p_t > 2e-4,
        "{case}: F = {f}, p = {p_f}; t = {t}, p = {p_t}\nmean {average:?}\nexact {truth:?}\nbrightness {brightness:?}"
    );
}

fn sampler(target: &impl Target, choices: &Choices, filter: Filter, seed: u64) -> Sampler<Vec<u32>> {
    Sampler::new(Setup {
        rng: Rng::new(seed),
        choices: choices.clone(),
        footprint: footprint(filter),
        size: SIZE,
        unit: 1.0,
        elsewhere: true,
        outcomes: target.has_outcomes(),
        evaluations: Some(EVALUATIONS),
    })
}

/// The image and the further layers of a whole run.
fn run(
    target: &impl Target<Workspace = Vec<u32>>,
    choices: &Choices,
    filter: Filter,
    seed: u64,
) -> (Image, Vec<(String, Plane)>) {
    let mut sampler = sampler(target, choices, filter, seed);
    while sampler.sweeps_left() != Some(0) {
        sampler.advance(target, u64::MAX, None);
    }
    let developed = sampler.develop();
    (developed.image, developed.layers)
}

fn values(image: &Image) -> Vec<f64> {
    image.pixels.iter().flatten().map(|v| f64::from(*v)).collect()
}

/// An image of each run: the picture itself, or a layer of that name.
fn images(
    target: &impl Target<Workspace = Vec<u32>>,
    choices: &Choices,
    filter: Filter,
    layer: Option<&str>,
) -> Vec<Vec<f64>> {
    let image = |seed| {
        let (image, layers) = run(target, choices, filter, seed);
        let Some(name) = layer else { return values(&image) };
        match layers.into_iter().find(|layer| layer.0 == name) {
            Some((_, Plane::Rgb(image))) => values(&image),
            _ => panic!("no layer {name}"),
        }
    };
    (0..RUNS).into_par_iter().map(image).collect()
}

/// 16 runs a case; 18 cases, level 0.008 together.
#[test]
fn images_of_path_tracing_and_of_ladders_agree_with_the_integrals() {
    let relative = Choices { measure: Measure::Relative, ..replicas(4, Combine::Balance) };
    let cases = [
        ("path tracing", replicas(1, Combine::Balance)),
        ("path tracing, uniform", replicas(1, Combine::Uniform)),
        ("K = 2", replicas(2, Combine::Balance)),
        ("K = 4", replicas(4, Combine::Balance)),
        ("K = 4, relative error", relative),
        ("auto", automatic()),
        ("K = 2, target", replicas(2, Combine::Target)),
        ("K = 4, target", replicas(4, Combine::Target)),
        ("K = 4, uniform", replicas(4, Combine::Uniform)),
    ];
    for filter in FILTERS {
        let truth = truth(filter);
        for (name, choices) in &cases {
            agrees(&images(&Scattered, choices, filter, None), &truth, 0.003, &format!("{name}, {filter:?}"));
        }
    }
}

/// 16 runs a case; twelve cases, level 0.005 together.
#[test]
fn images_of_points_that_choose_agree_with_the_integrals() {
    let relative = Choices { measure: Measure::Relative, ..replicas(4, Combine::Balance) };
    let cases = [
        ("path tracing", replicas(1, Combine::Balance)),
        ("K = 2", replicas(2, Combine::Balance)),
        ("K = 4", replicas(4, Combine::Balance)),
        ("K = 4, relative error", relative),
        ("auto", automatic()),
        ("K = 4, target", replicas(4, Combine::Target)),
    ];
    for filter in FILTERS {
        let truth = truth(filter);
        for (name, choices) in &cases {
            agrees(&images(&Choosing, choices, filter, None), &truth, 0.003, &format!("{name}, {filter:?}"));
        }
    }
}

/// However few open points are asked for, there are some, and what they lack in number they have in weight. 16 runs, level
/// 4 · 10⁻⁴.
#[test]
fn a_small_share_of_open_points_is_not_missing() {
    let choices = Choices { uniform_share: Some(0.001), ..replicas(2, Combine::Balance) };
    agrees(&images(&Choosing, &choices, Filter::Box, None), &truth(Filter::Box), 0.003, "a thousandth");
}

/// 16 runs a case; four cases, level 0.002 together.
#[test]
fn layers_beside_an_image_of_open_points_agree_with_the_integrals() {
    let choices = Choices { layers: true, ..replicas(3, Combine::Balance) };
    for filter in FILTERS {
        let truth = truth(filter);
        for name in ["uniform", "target"] {
            agrees(&images(&Choosing, &choices, filter, Some(name)), &truth, 0.003, &format!("{name}, {filter:?}"));
        }
    }
}

/// 16 runs a case; four cases, level 0.002 together.
#[test]
fn layers_beside_the_image_agree_with_the_integrals() {
    let choices = Choices { layers: true, ..replicas(3, Combine::Balance) };
    for filter in FILTERS {
        let truth = truth(filter);
        for name in ["uniform", "target"] {
            agrees(
                &images(&Scattered, &choices, filter, Some(name)),
                &truth,
                0.003,
                &format!("layer {name}, {filter:?}"),
            );
        }
    }
}

/// 16 runs a case; twelve cases, level 0.005 together.
#[test]
fn images_of_the_baseline_agree_with_the_integrals() {
    for filter in FILTERS {
        let (footprint, truth) = (footprint(filter), truth(filter));
        for (kelemen_weights, zeta) in [(false, 1.0), (true, 1.0), (true, 3.0)] {
            let large_steps = LargeSteps { probability: 0.3, kelemen_weights };
            let budget = [1 << 12, EVALUATIONS];
            let run = |seed| pssmlt_images(&Scattered, (&footprint, SIZE), large_steps, budget, zeta, seed).0;
            let runs: Vec<[Vec<[f64; 3]>; 2]> = (0..RUNS).into_par_iter().map(run).collect();
            for (estimate, name) in ["two-pass", "pooled"].iter().enumerate() {
                let images: Vec<Vec<f64>> = runs.iter().map(|run| run[estimate].as_flattened().to_vec()).collect();
                agrees(&images, &truth, 0.003, &format!("{name}, {large_steps:?}, ζ = {zeta} c, {filter:?}"));
            }
        }
    }
}

#[test]
fn parts_of_all_rungs_sum_to_the_image() {
    for filter in FILTERS {
        parts_sum(&Scattered, filter);
        parts_sum(&Choosing, filter);
    }
}

fn parts_sum(target: &impl Target<Workspace = Vec<u32>>, filter: Filter) {
    let choices = Choices { layers: true, ..replicas(3, Combine::Balance) };
    let (image, layers) = run(target, &choices, filter, 3);
    let parts: Vec<Vec<f64>> = layers
        .iter()
        .filter(|layer| layer.0.starts_with("rung"))
        .map(|(name, plane)| match plane {
            Plane::Rgb(image) => values(image),
            Plane::Gray(_) => panic!("{name} is grey"),
        })
        .collect();
    assert_eq!(parts.len(), 3);
    for (i, value) in values(&image).into_iter().enumerate() {
        let sum: f64 = parts.iter().map(|part| part[i]).sum();
        assert!((sum / value - 1.0).abs() < 1e-5, "value {i}: {sum} for {value}");
    }
}

/// The density tells how many samples there were, wherever else they contribute.
#[test]
fn a_sample_counts_once_in_the_density() {
    for choices in [replicas(1, Combine::Balance), replicas(1, Combine::Uniform)] {
        let mut sampler = sampler(&Scattered, &choices, Filter::Box, 1);
        while sampler.sweeps_left() != Some(0) {
            sampler.advance(&Scattered, u64::MAX, None);
        }
        let layers = sampler.develop().layers;
        let [(name, Plane::Gray(density))] = &layers[..] else { panic!("{} layers", layers.len()) };
        assert_eq!(name, "density");
        assert_eq!(density.iter().map(|n| f64::from(*n)).sum::<f64>(), sampler.evaluations() as f64);
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    for choices in [automatic(), Choices::default(), replicas(3, Combine::Balance), replicas(40, Combine::Power)] {
        let [one, two] = [1, 2].map(|threads| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let (image, _) = pool.install(|| run(&Scattered, &choices, FILTERS[1], 7));
            image.pixels.into_iter().flatten().map(f32::to_bits).collect::<Vec<_>>()
        });
        assert!(one == two, "{choices:?}");
    }
}

#[test]
#[should_panic(expected = "no layers for what points contribute elsewhere")]
fn a_set_up_that_leaves_no_room_is_refused() {
    let mut sampler = crate::support::sampler::<Scattered>(automatic(), 16, 1 << 10, 0);
    sampler.advance(&Scattered, 1, None);
}
