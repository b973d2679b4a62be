//! The same bits, however work is cut up.

use rayon::ThreadPoolBuilder;
use relt::{
    chain::Target,
    film::Image,
    path::Contributions,
    rng::Rng,
    sample::{self, Points, Proposals},
    tempering::{Block, Choices, Combine, Crew, Histogram, Ladder, RungCounts},
};

use crate::{
    elsewhere::Scattered,
    support::{Stage, exact_draws, replicas, sampler, two_peaks},
    toys::Toy,
};

/// All that a run tells, as bits.
fn bits(image: &Image, ln_z: &[f64], evaluations: u64) -> (Vec<u32>, Vec<u64>, u64) {
    let values = image.pixels.iter().flatten().map(|v| v.to_bits()).collect();
    (values, ln_z.iter().map(|v| v.to_bits()).collect(), evaluations)
}

/// A run of which `advance` is called with those numbers of sweeps in turn, on `threads` threads.
fn run(choices: &Choices, threads: usize, slices: &[u64]) -> (Vec<u32>, Vec<u64>, u64) {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let toy = two_peaks();
        let mut sampler = sampler::<Toy>(choices.clone(), 16, 1 << 15, 7);
        for slice in slices.iter().cycle() {
            sampler.advance(&toy, *slice, None);
            if sampler.sweeps_left() == Some(0) {
                break;
            }
        }
        let development = sampler.develop();
        bits(&development.image, &development.learnt.normalisers.ln_z, sampler.evaluations())
    })
}

#[test]
fn threads_and_slices_do_not_change_a_bit() {
    for choices in [
        Choices::default(),
        replicas(1, Combine::Balance),
        replicas(3, Combine::Balance),
        replicas(40, Combine::Balance),
        replicas(3, Combine::Power),
    ] {
        let whole = run(&choices, 1, &[u64::MAX]);
        for (threads, slices) in [(2, &[u64::MAX][..]), (1, &[1]), (2, &[1, 7, 2, 64]), (3, &[5, 1000])] {
            assert!(run(&choices, threads, slices) == whole, "{choices:?}, {threads} threads, slices {slices:?}");
        }
    }
}

#[test]
fn stops_come_at_the_same_evaluations_however_a_run_is_sliced() {
    let toy = two_peaks();
    for choices in [Choices::default(), replicas(3, Combine::Balance)] {
        let stops = |slice: u64| {
            let mut sampler = sampler::<Toy>(choices.clone(), 16, 1 << 18, 7);
            let stops = [1, 5_600, 40_000, 88_888, 160_000].map(|until| {
                while sampler.evaluations() < until {
                    sampler.advance(&toy, slice, Some(until));
                }
                let development = sampler.develop();
                bits(&development.image, &development.learnt.normalisers.ln_z, sampler.evaluations())
            });
            for ([until, next], stop) in [[1, 5_600], [5_600, 40_000], [40_000, 88_888]].into_iter().zip(&stops) {
                assert!((until..next).contains(&stop.2), "{} for {until}", stop.2);
            }
            stops
        };
        let whole = stops(u64::MAX);
        assert!(whole == stops(1) && whole == stops(17), "{choices:?}");
    }
}

#[test]
fn looking_at_the_picture_changes_nothing() {
    let toy = two_peaks();
    let [looked, not] = [true, false].map(|looks| {
        let mut sampler = sampler::<Toy>(replicas(3, Combine::Balance), 16, 1 << 14, 7);
        while sampler.sweeps_left() != Some(0) {
            sampler.advance(&toy, 5, None);
            if looks {
                let [first, second] = [(); 2].map(|()| sampler.develop());
                let [first, second] = [first, second].map(|d| bits(&d.image, &d.learnt.normalisers.ln_z, 0));
                assert!(first == second);
            }
        }
        let development = sampler.develop();
        bits(&development.image, &development.learnt.normalisers.ln_z, sampler.evaluations())
    });
    assert!(looked == not);
}

/// What a block of ladders on a target with g ≤ `largest` records in 40 sweeps in parts of `lanes_a_part`: film, histograms,
/// counts, round trips.
fn block<T: Target>(
    target: &T,
    largest: f64,
    lanes_a_part: usize,
    threads: usize,
) -> (Vec<[f64; 4]>, Vec<Histogram>, Vec<RungCounts>, [u64; 2]) {
    const LADDERS: usize = 5;
    let rng = Rng::new(3);
    let ladder = Ladder::new(vec![0.0, 0.1, 0.3, 0.6, 1.0]);
    let mut stage = Stage::new(ladder, &[0.0, -0.5, -1.2, -2.0, -3.0], 16, target.splats_elsewhere());
    stage.round.half = 20;
    let (canvas, round) = (stage.canvas(), &stage.round);
    let starts: Vec<_> =
        (1..5).map(|k| exact_draws(target, round.ladder.betas()[k], largest, LADDERS, rng, k as u32)).collect();
    let starts: Vec<_> = starts.iter().map(Vec::as_slice).collect();
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let mut block = Block::new(rng, (0, LADDERS), 5, 2, lanes_a_part, stage.layers.count, [16, 1]);
        block.start(target, &starts);
        block.advance(target, 20, &canvas, round);
        block.deposit(&canvas);
        block.set_offers(3);
        block.advance(target, 20, &canvas, round);
        block.flush(&canvas, round);
        block.deposit(&canvas);
        let mut histograms = vec![Histogram::default(); 5];
        block.add_histograms(&mut histograms);
        let mut counts = vec![RungCounts::default(); 5];
        block.add_counts(&mut counts);
        let film = (0..stage.layers.count).flat_map(|layer| stage.film.layer(layer)).collect();
        (film, histograms, counts, [block.trips().round_trips, block.trips().restarts])
    })
}

#[test]
fn parts_of_a_block_do_not_change_a_bit() {
    parts_do_not_matter(&two_peaks(), 4.1);
    parts_do_not_matter(&Scattered, Scattered::LARGEST);
}

fn parts_do_not_matter<T: Target>(target: &T, largest: f64) {
    let whole = block(target, largest, 512, 1);
    assert!(whole.3[1] > 0, "some state climbs the ladder");
    for lanes_a_part in [1, 3, 4, 7, 16, 29, 30] {
        for threads in [1, 2] {
            let parts = block(target, largest, lanes_a_part, threads);
            assert!(parts.0 == whole.0, "film, {lanes_a_part} lanes a part, {threads} threads");
            assert!(parts.1 == whole.1, "histograms, {lanes_a_part} lanes a part, {threads} threads");
            assert_eq!(parts.2, whole.2, "counts, {lanes_a_part} lanes a part, {threads} threads");
            assert_eq!(parts.3, whole.3, "trips, {lanes_a_part} lanes a part, {threads} threads");
        }
    }
}

/// A target whose chains also mirror their points in the first dimension, as another way to say the same.
struct Mirrored<T>(T);

impl<T: Target> Target for Mirrored<T> {
    type Workspace = T::Workspace;

    fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, workspace: &mut T::Workspace) {
        self.0.evaluate(proposals, out, workspace);
    }

    fn changes_techniques(&self) -> bool {
        true
    }

    fn change_technique(
        &self,
        (current, lane): (&Points, usize),
        _: f64,
        random: &mut dyn FnMut() -> sample::Block,
        to: &mut Points,
        _: &mut u64,
    ) -> Option<f64> {
        let [x, y, z, w] = current.block(0, lane);
        to.reserve(0);
        to.set(0, lane, [!x, y, z, w]);
        (random()[0] & 1 == 0).then_some(0.0)
    }
}

#[test]
fn blocks_in_one_crew_come_to_what_each_comes_to_by_itself() {
    crews_do_not_matter(&two_peaks(), 4.1);
    crews_do_not_matter(&Mirrored(two_peaks()), 4.1);
    crews_do_not_matter(&Scattered, Scattered::LARGEST);
}

fn crews_do_not_matter<T: Target>(target: &T, largest: f64) {
    const BLOCKS: usize = 3;
    const LADDERS: usize = 2;
    let run = |sizes: &[usize]| {
        let (rng, betas) = (Rng::new(3), vec![0.0, 0.1, 0.3, 0.6, 1.0]);
        let stage = Stage::new(Ladder::new(betas), &[0.0, -0.5, -1.2, -2.0, -3.0], 16, target.splats_elsewhere());
        let (canvas, round) = (stage.canvas(), &stage.round);
        let block = |number: usize| {
            let mut block = Block::new(rng, (number, LADDERS), 5, 2, 512, stage.layers.count, [16, 1]);
            let starts = (1..5).map(|k| {
                let rung = (4 * number + k) as u32;
                exact_draws(target, round.ladder.betas()[k], largest, LADDERS, rng, rung)
            });
            let starts: Vec<_> = starts.collect();
            block.start(target, &starts.iter().map(Vec::as_slice).collect::<Vec<_>>());
            block
        };
        let mut blocks: Vec<Block<T::Workspace>> = (0..BLOCKS).map(block).collect();
        let (mut rays, mut changes) = (0, 0);
        for sweeps in [1, 20] {
            let mut left = &mut blocks[..];
            for size in sizes {
                let together = left.split_off_mut(..*size).expect("as many blocks as are in crews");
                let mut crew = Crew::new(together.iter_mut().collect());
                crew.advance(target, sweeps, &canvas, round);
                crew.advance(target, sweeps, &canvas, round);
            }
            rays += blocks.iter_mut().map(|block| block.take_rays_and_faults().0).sum::<u64>();
        }
        let seen = |block: &mut Block<T::Workspace>| {
            block.flush(&canvas, round);
            block.deposit(&canvas);
            let (mut histograms, mut counts) = (vec![Histogram::default(); 5], vec![RungCounts::default(); 5]);
            block.add_histograms(&mut histograms);
            block.add_counts(&mut counts);
            changes += counts.iter().map(|counts| counts.changes.proposed).sum::<u64>();
            (histograms, counts, [block.trips().round_trips, block.trips().restarts])
        };
        let seen: Vec<_> = blocks.iter_mut().map(seen).collect();
        let film: Vec<_> = (0..stage.layers.count).flat_map(|layer| stage.film.layer(layer)).collect();
        assert_eq!(changes > 0, target.changes_techniques());
        (film, seen, rays)
    };
    let alone = run(&[1, 1, 1]);
    for sizes in [&[3][..], &[2, 1], &[1, 2]] {
        assert!(run(sizes) == alone, "crews of {sizes:?}");
    }
}
