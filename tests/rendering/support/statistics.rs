//! Tests of means of independent runs against expectations that have errors of their own.

use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

/// Mean of some numbers.
pub fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    values.sum::<f64>() / n
}

/// Unbiased variance of some numbers.
pub fn variance(values: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let n = values.len() as f64;
    let mean = mean(values.clone());
    values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)
}

/// t of the mean of `runs` against `expected`, known up to a `variance_of_expected`, and the probability of one as
/// large by chance. Two-sided; degrees of freedom by Welch (1947).
pub fn t_test(runs: &[f64], expected: f64, variance_of_expected: f64) -> (f64, f64) {
    let n = runs.len() as f64;
    let own = variance(runs.iter().copied()) / n;
    let total = own + variance_of_expected;
    let difference = mean(runs.iter().copied()) - expected;
    if total == 0.0 {
        return if difference == 0.0 { (0.0, 1.0) } else { (f64::INFINITY, 0.0) };
    }
    let t = difference / total.sqrt();
    let freedom = ((n - 1.0) * (total / own).powi(2)).min(1e6);
    let student = StudentsT::new(0.0, 1.0, freedom).expect("positive degrees of freedom");
    (t, 2.0 * student.sf(t.abs()))
}

/// F of the *shape* that many correlated quantities have on average against the one they should have, and the
/// probability of one as large by chance. The shape is what is left when the part along the expected vector, the
/// common brightness, is taken out: in Metropolis runs that part varies most, and it has its own t-test.
///
/// F = |x̄ − r|² / tr(S/n + R), where S is the covariance of the n runs and R the (diagonal) one of r. Under the
/// hypothesis it is distributed as F(ν, ν′) about, with ν = (tr A)²/tr A², A = Σ/n + R, and tr Σ² estimated without
/// bias. Unlike χ² over quantities it minds that they are correlated, as pixels of Metropolis runs are; unlike
/// Hotelling's T² it needs fewer runs than quantities.
/// Source: Dempster 1958, "A high dimensional two sample significance test"; tr Σ²: Bai & Saranadasa 1996.
pub fn f_test(runs: &[Vec<f64>], expected: &[f64], variance_of_expected: &[f64]) -> (f64, f64) {
    let n = runs.len() as f64;
    let length2: f64 = expected.iter().map(|e| e * e).sum();
    let shape = |values: &Vec<f64>| -> Vec<f64> {
        let along = values.iter().zip(expected).map(|(v, e)| v * e).sum::<f64>() / length2;
        values.iter().zip(expected).map(|(v, e)| v - along * e).collect()
    };
    let runs: Vec<Vec<f64>> = runs.iter().map(shape).collect();
    let expected = vec![0.0; expected.len()];
    let mean: Vec<f64> = (0..expected.len()).map(|i| mean(runs.iter().map(|run| run[i]))).collect();
    let centred: Vec<Vec<f64>> = runs.iter().map(|run| run.iter().zip(&mean).map(|(v, m)| v - m).collect()).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();

    let diagonal: Vec<f64> =
        (0..expected.len()).map(|i| centred.iter().map(|c| c[i] * c[i]).sum::<f64>() / (n - 1.0)).collect();
    let trace: f64 = diagonal.iter().sum();
    let trace_of_square: f64 =
        centred.iter().flat_map(|a| centred.iter().map(move |b| dot(a, b).powi(2))).sum::<f64>() / (n - 1.0).powi(2);
    let scale = (n - 1.0).powi(2) / ((n - 2.0) * (n + 1.0));
    // never below what independent quantities of these variances would have
    let trace_of_square =
        (scale * (trace_of_square - trace * trace / (n - 1.0))).max(trace * trace / mean.len() as f64);

    let own_noise: f64 = variance_of_expected.iter().sum();
    let total = trace / n + own_noise;
    let distance: f64 = mean.iter().zip(&expected).map(|(m, e)| (m - e).powi(2)).sum();
    if total == 0.0 {
        return if distance == 0.0 { (0.0, 1.0) } else { (f64::INFINITY, 0.0) };
    }
    let square = trace_of_square / (n * n)
        + 2.0 / n * dot(&diagonal, variance_of_expected)
        + dot(variance_of_expected, variance_of_expected);
    let freedom = (total * total / square).max(1.0);
    let freedom_of_trace = if trace > 0.0 {
        (n - 1.0) * trace * trace / trace_of_square * (total / (trace / n)).powi(2)
    } else {
        f64::INFINITY
    };
    let f = distance / total;
    let fisher = FisherSnedecor::new(freedom, freedom_of_trace.min(1e6)).expect("positive degrees of freedom");
    (f, fisher.sf(f))
}

/// The test tested: p-values of true hypotheses are uniform, small ones not more frequent than they say.
#[test]
fn p_values_of_correlated_quantities_are_no_smaller_than_they_claim() {
    let mut state = 1u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24)
    };
    let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
    const TRIALS: usize = 2000;
    let (quantities, n) = (40, 8);
    let mut f_below = [0; 2];
    let mut t_below = [0; 2];
    for _ in 0..TRIALS {
        // a factor common to all quantities, as the normalisation of an image is, one common to every fifth, and
        // noise that grows to one side
        let truth = |i: usize| 2.0 + (i % 7) as f64;
        let runs: Vec<Vec<f64>> = (0..n)
            .map(|_| {
                let common = normal();
                let groups: Vec<f64> = (0..5).map(|_| normal()).collect();
                let mut noise = |i: usize| 0.3 * groups[i % 5] + normal() * (i + 1) as f64 / quantities as f64;
                (0..quantities).map(|i| truth(i) * (1.0 + 0.2 * common) + noise(i)).collect()
            })
            .collect();
        let expected: Vec<f64> = (0..quantities).map(|i| truth(i) + 0.3 * normal()).collect();
        let (_, p) = f_test(&runs, &expected, &vec![0.09; quantities]);
        let first: Vec<f64> = runs.iter().map(|run| run[0]).collect();
        let (_, p_t) = t_test(&first, expected[0], 0.09);
        for (i, level) in [0.1, 0.01].into_iter().enumerate() {
            f_below[i] += usize::from(p < level);
            t_below[i] += usize::from(p_t < level);
        }
    }
    // expected 200 and 20 of 2000 (sd 13 and 4.5); F, an approximation, may err by half of that
    for below in [f_below, t_below] {
        assert!((130..=290).contains(&below[0]) && below[1] <= 40, "F {f_below:?}, t {t_below:?} of {TRIALS}");
    }
}
