//! The baseline on an analytic target, as the renderer does it.

use relt::{
    chain::{Baseline, Evaluator, LargeSteps, Plan, Recorder, Start, Target, Whereabouts, baseline_layer, resample},
    film::{Accumulator, Filter, Footprint, Splats},
    path::Contribution,
    rng::{Counter, Purpose, Rng},
    sample::{Move, Points},
};

/// The mean of g over each column of an image of one row, for grey targets; see [`pssmlt_images`].
pub fn pssmlt<T: Target>(
    target: &T,
    columns: u32,
    large_steps: LargeSteps,
    budget: [u64; 2],
    zeta: f64,
    seed: u64,
) -> [Vec<f64>; 2] {
    let footprint = Footprint::new(Filter::Box, columns, 1);
    pssmlt_images(target, (&footprint, [columns, 1]), large_steps, budget, zeta, seed)
        .0
        .map(|image| image.into_iter().map(|[grey, ..]| grey).collect())
}

/// An image as Metropolis chains estimate it: scaled by c from the first pass alone, and by c from that and all large
/// steps. And where their states were, but for what the last ones have gathered.
///
/// A first pass of `bootstrap` samples, then chains with what is left of `evaluations`. The ζ of the weights is `zeta`
/// times the first estimate of c.
pub fn pssmlt_images<T: Target>(
    target: &T,
    (footprint, size): (&Footprint, [u32; 2]),
    large_steps: LargeSteps,
    [bootstrap, evaluations]: [u64; 2],
    zeta: f64,
    seed: u64,
) -> ([Vec<[f64; 3]>; 2], Whereabouts) {
    let rng = Rng::new(seed);
    let counter = |step| Counter { ladder: 0, replica: 0, step, purpose: Purpose::Bootstrap };
    let mut samples = Vec::with_capacity(bootstrap as usize);
    let mut first_sum = 0.0;
    let mut batch = Evaluator::<T::Workspace>::new(rng, vec![counter(0); 1024]);
    while (samples.len() as u64) < bootstrap {
        let drawn = samples.len() as u64;
        let lanes = (bootstrap - drawn).min(1024) as usize;
        batch.moves.fill(Move::Rest);
        batch.moves[..lanes].fill(Move::Fresh);
        batch.counters.iter_mut().zip(drawn..).for_each(|(c, step)| c.step = step);
        batch.evaluate(target, &Points::new(0));
        let lit = batch.out.lanes[..lanes].iter().zip(&batch.counters);
        samples.extend(lit.map(|(c, counter)| Start { counter: *counter, ln_g: c.ln_g }));
        first_sum += batch.out.lanes[..lanes].iter().map(Contribution::luminance).sum::<f64>();
    }
    let two_pass = first_sum / bootstrap as f64;

    let plan = Plan::new(Some(evaluations - bootstrap), 1);
    let starts = resample(&samples, 1.0, plan.a_sweep() as usize, rng, 0);
    let mut chains = Baseline::new(target, rng, 0, &starts, large_steps);
    let unit = zeta * two_pass;
    let film = Accumulator::new(size[0], size[1], large_steps.layers(), unit);
    let mut splats = Splats::new(large_steps.layers());
    let sweeps = plan.sweeps.expect("limited");
    /// Steps between deposits, so that splats do not fill the memory.
    const SLICE: u64 = 64;
    for done in (0..sweeps).step_by(SLICE as usize) {
        let mut recorder = Recorder { footprint, size: size.map(|n| n as f32), splats: &mut splats };
        chains.advance(target, SLICE.min(sweeps - done), unit, &mut recorder);
        film.deposit(&mut splats);
    }
    chains.record_pending(unit, &mut Recorder { footprint, size: size.map(|n| n as f32), splats: &mut splats });
    film.deposit(&mut splats);

    let pooled = (first_sum + chains.large_sum) / (bootstrap + chains.large.1) as f64;
    let states = film.layer(baseline_layer::CHAINS);
    let proposals = large_steps.kelemen_weights.then(|| film.layer(baseline_layer::LARGE_STEPS));
    let a_pixel = chains.mutations() as f64 / states.len() as f64;
    let images = [two_pass, pooled].map(|c| {
        let value = |i: usize, ch: usize| states[i][ch] * c / unit + proposals.as_ref().map_or(0.0, |p| p[i][ch]);
        (0..states.len()).map(|i| [0, 1, 2].map(|ch| value(i, ch) / a_pixel)).collect()
    });
    let [mut whereabouts, later] = chains.whereabouts;
    whereabouts.merge(&later);
    (images, whereabouts)
}
