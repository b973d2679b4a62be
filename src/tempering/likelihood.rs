//! The likelihood that MBAR maximises, and its maximum for up to a thousand rungs.
//!
//! Unknowns are x_l = ln Z_l of the tempered rungs (x₀ = 0). With n_l the weight of rung l and h_b that of bin b, of
//! mean ln g v_b, the probability that a state in the bin came from rung l is its *membership*
//!
//!   p_l(b) ∝ n_l e^{β_l v_b − x_l} ,  Σ_l p_l(b) = 1,
//!
//! and the likelihood is concave with gradient Σ_b h_b p_l(b) − n_l and negated Hessian
//! H = D − Σ_b h_b p(b) p(b)ᵀ, D = diag Σ_b h_b p(b).
//!
//! **Two savings** make that cheap. Memberships are computed once, with exponentials, for reference values of the
//! unknowns, each bin's only where they are not negligible; elsewhere in the neighbourhood p ∝ (table · factor), so
//! that a gradient costs two multiplications a table entry.
//!
//! And Newton's steps use a Hessian in which neighbouring bins are merged: H̃ = D − Σ_c h_c p̄(c) p̄(c)ᵀ with mean
//! memberships p̄. From ∂p/∂v = p (β − β̄) and Cauchy–Schwarz, Σ_{b∈c} h_b (y·(p(b) − p̄))² ≤ Δ² Σ_{b∈c} h_b Var_p y where the
//! bins' spread in t(v) = ∫ sd_p(β) dv is Δ at most (sd_p(β): of the inverse temperature of a state seen at v). So
//! H ⪯ H̃ ⪯ (1 + Δ²) H: steps never overshoot where the likelihood is quadratic, and each leaves Δ² = 1.6 % of the
//! error. The number of merged bins follows from the range of t, hardly from that of rungs; where they are fewer than rungs, the
//! Woodbury identity makes their number the size of the linear system.

use super::{Histogram, stepping::Stone};

/// Δ.
const MERGED: f64 = 0.125;
/// Memberships below e^−50 of a bin's largest are dropped; factors of 1/256 (discounts) and e^8 (`STRETCH`) can raise
/// them to 10⁻¹⁶.
const NEGLIGIBLE: f64 = 50.0;
/// Change of an unknown from which on the table is made anew.
const STRETCH: f64 = 8.0;

/// An occupied bin of the pooled histogram of uniform points or of that of tempered states.
struct Entry {
    number: i64,
    value: f64,
    weight: f64,
    tempered: bool,
    /// Where its memberships begin in the table, and with which rung.
    begin: usize,
    first: usize,
}

/// The likelihood, for states of tempered rungs that count in full; the methods take a discount.
pub(super) struct Likelihood {
    betas: Vec<f64>,
    counts: Vec<f64>,
    /// By ln g.
    entries: Vec<Entry>,
    /// Memberships at x = `reference`, relative to the largest, entry after entry.
    table: Vec<f64>,
    reference: Vec<f64>,
    /// Ranges of entries that are merged in the Hessian.
    merged: Vec<std::ops::Range<usize>>,
}

/// The maximum for one discount.
pub(super) struct Maximum {
    /// x; the uniform rung's is 0.
    pub x: Vec<f64>,
    /// `None` where states overlap so little that rounding leaves no curvature.
    system: Option<System>,
    factors: Vec<f64>,
    discount: f64,
}

impl Likelihood {
    /// From the inverse temperatures and pooled histograms of the rungs that have lit states, the uniform one first.
    pub fn new(betas: Vec<f64>, rungs: &[&Histogram]) -> Likelihood {
        let mut tempered = Histogram::default();
        rungs[1..].iter().for_each(|rung| tempered.merge(rung));
        let entry = |tempered: bool| {
            move |bin: super::histogram::Occupied| Entry {
                number: bin.number,
                value: bin.mean,
                weight: bin.weight,
                tempered,
                begin: 0,
                first: 0,
            }
        };
        let mut entries: Vec<Entry> =
            rungs[0].occupied().map(entry(false)).chain(tempered.occupied().map(entry(true))).collect();
        entries.sort_by(|a, b| a.value.total_cmp(&b.value));
        let counts = rungs.iter().map(|rung| rung.total()).collect();
        Likelihood { betas, counts, entries, table: Vec::new(), reference: Vec::new(), merged: Vec::new() }
    }

    /// Where to start: each rung's ratio to its neighbour by the two rungs' states alone.
    pub fn stepping_stones(&self, rungs: &[&Histogram]) -> Vec<f64> {
        let mut x = vec![0.0];
        for k in 1..rungs.len() {
            x.push(x[k - 1] + Stone::new(self.betas[k] - self.betas[k - 1], rungs[k - 1], rungs[k]).ln_ratio);
        }
        x
    }

    /// Maximises, from `x`, with states of tempered rungs counting for `discount`.
    pub fn maximise(&mut self, mut x: Vec<f64>, discount: f64) -> Maximum {
        let weights: Vec<f64> = self.weights(discount);
        let mut factors = self.factors(&x, discount);
        self.merge_entries(&factors);
        let mut sums = self.sums(&factors, discount);
        let mut last_step = f64::INFINITY;
        for _ in 0..200 {
            let gradient = gradient(&sums, &weights);
            let step = match System::new(&sums, weights.len()) {
                Some(system) => system.solve(&gradient),
                // some rung is out of reach of all states: the self-consistent iteration goes there
                None => expected(&sums, weights.len()).iter().zip(&weights).map(|(e, n)| ln_ratio(*e, *n)).collect(),
            };
            let longest = step.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
            if longest < 1e-13 || (longest < 1e-8 && longest > 0.5 * last_step) {
                break; // converged, or as near as rounding lets it
            }
            last_step = longest;
            let ascent = dot(&gradient, &step);
            let mut scale = 1.0;
            let x_before = x.clone();
            loop {
                for ((x, before), s) in x[1..].iter_mut().zip(&x_before[1..]).zip(&step) {
                    *x = before + scale * s;
                }
                factors = self.factors(&x, discount);
                sums = self.sums(&factors, discount);
                // past the maximum along the step, and as steep there as at its beginning, it went too far
                if longest < 1e-6 || scale < 1e-6 || dot(&self::gradient(&sums, &weights), &step) > -0.5 * ascent {
                    break;
                }
                scale *= 0.5;
            }
        }
        Maximum { x, system: System::new(&sums, weights.len()), factors, discount }
    }

    /// n_l of the tempered rungs.
    fn weights(&self, discount: f64) -> Vec<f64> {
        self.counts[1..].iter().map(|n| discount * n).collect()
    }

    /// n_l e^{−x_l} by that of the table, which is made anew if need be.
    fn factors(&mut self, x: &[f64], discount: f64) -> Vec<f64> {
        if self.reference.is_empty() || x.iter().zip(&self.reference).any(|(x, r)| (x - r).abs() > STRETCH) {
            self.tabulate(x);
            self.merge_entries(&vec![1.0; x.len()]);
        }
        let factor = |(l, (x, r)): (usize, (&f64, &f64))| libm::exp(r - x) * if l == 0 { 1.0 } else { discount };
        x.iter().zip(&self.reference).enumerate().map(factor).collect()
    }

    /// Fills the table at x.
    fn tabulate(&mut self, x: &[f64]) {
        self.reference = x.to_vec();
        self.table.clear();
        let heights: Vec<f64> = self.counts.iter().zip(x).map(|(n, x)| libm::log(*n) - x).collect();
        let mut exponents = vec![0.0; x.len()];
        for entry in &mut self.entries {
            for ((e, h), beta) in exponents.iter_mut().zip(&heights).zip(&self.betas) {
                *e = h + beta * entry.value;
            }
            let largest = exponents.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let counts = |e: &f64| *e > largest - NEGLIGIBLE;
            let first = exponents.iter().position(counts).unwrap_or(0);
            let last = exponents.iter().rposition(counts).unwrap_or(0);
            (entry.begin, entry.first) = (self.table.len(), first);
            self.table.extend(exponents[first..=last].iter().map(|e| libm::exp(e - largest)));
        }
    }

    /// The table's part for entry b: the first rung, and memberships from there on.
    fn row(&self, b: usize) -> (usize, &[f64]) {
        let end = self.entries.get(b + 1).map_or(self.table.len(), |next| next.begin);
        (self.entries[b].first, &self.table[self.entries[b].begin..end])
    }

    /// Merges neighbouring entries up to a spread of `MERGED` in t = ∫ sd(β) dv.
    ///
    /// Since dβ̄/dv = sd², a gap δv that β̄ crosses by δβ̄ spans at most √(δv δβ̄) of t, whatever is between.
    fn merge_entries(&mut self, factors: &[f64]) {
        let products: Vec<f64> = self.betas.iter().zip(factors).map(|(b, f)| b * f).collect();
        let mean_beta = |b: usize| {
            let (first, row) = self.row(b);
            dot(row, &products[first..first + row.len()]) / dot(row, &factors[first..first + row.len()])
        };
        let mut merged = Vec::new();
        let (mut begin, mut spread, mut mean_before) = (0, 0.0, mean_beta(0));
        for b in 1..self.entries.len() {
            let mean = mean_beta(b);
            let gap = self.entries[b].value - self.entries[b - 1].value;
            spread += (gap * (mean - mean_before)).max(0.0).sqrt();
            if spread > MERGED {
                merged.push(begin..b);
                (begin, spread) = (b, 0.0);
            }
            mean_before = mean;
        }
        merged.push(begin..self.entries.len());
        self.merged = merged;
    }

    /// Σ h p over each merged range.
    fn sums(&self, factors: &[f64], discount: f64) -> Vec<Merged> {
        let sum = |range: &std::ops::Range<usize>| {
            let first = range.clone().map(|b| self.row(b).0).min().unwrap_or(0);
            let end = range.clone().map(|b| self.row(b).0 + self.row(b).1.len()).max().unwrap_or(first);
            let mut memberships = vec![0.0; end - first];
            let mut weight = 0.0;
            for b in range.clone() {
                let (begin, row) = self.row(b);
                let h = self.entries[b].weight * if self.entries[b].tempered { discount } else { 1.0 };
                let share = h / dot(row, &factors[begin..begin + row.len()]);
                memberships[begin - first..].iter_mut().zip(row).for_each(|(m, t)| *m += share * t);
                weight += h;
            }
            memberships.iter_mut().zip(&factors[first..end]).for_each(|(m, f)| *m *= f);
            // the uniform rung is not an unknown
            if first == 0 {
                memberships.remove(0);
            }
            Merged { weight, first: first.saturating_sub(1), memberships }
        };
        self.merged.iter().map(sum).collect()
    }

    /// By how much each group moves the last x at a maximum, to first order, from its histograms of uniform points and
    /// of all tempered states and its weights by rung.
    ///
    /// What group j adds to the gradient moves x by H⁻¹ times that, and its weights move the n_l that x absorbs:
    /// i_j = y · (Σ_{b∈j} h_b p(b) − n_j) + n_jK/n_K − n_j1/n_1 with y = H⁻¹ e_K, for which H̃ does
    /// (it changes y by some 1.6 % at most). NaN where there is no curvature.
    pub fn influences<'g>(
        &self,
        maximum: &Maximum,
        groups: impl Iterator<Item = (&'g Histogram, &'g Histogram, &'g [f64])>,
    ) -> Vec<f64> {
        let Maximum { factors, discount, .. } = maximum;
        let last = self.betas.len() - 1;
        let mut target = vec![0.0; last];
        target[last - 1] = 1.0;
        let solution = maximum.system.as_ref().map_or_else(|| vec![f64::NAN; last], |system| system.solve(&target));
        let y = [vec![0.0], solution].concat();
        let expectations = self.expectations(factors, &y);
        let [of_uniform, of_tempered] = [false, true].map(|tempered| {
            let of_kind = self.entries.iter().zip(&expectations).filter(move |(e, _)| e.tempered == tempered);
            of_kind.map(|(e, x)| (e.number, e.value, *x)).collect::<Vec<_>>()
        });
        let influence = |(uniform, tempered, weights): (&Histogram, &Histogram, &[f64])| {
            let moved = sum_at(uniform, &of_uniform) + discount * sum_at(tempered, &of_tempered);
            moved - discount * dot(&y, weights) + weights[last] / self.counts[last] - weights[0] / self.counts[0]
        };
        groups.map(influence).collect()
    }

    /// φ = Σ_l p_l y_l at every entry's value, and its derivative Σ p β y − Σ p β · φ.
    fn expectations(&self, factors: &[f64], y: &[f64]) -> Vec<(f64, f64)> {
        let times = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<f64>>();
        let (with_y, with_beta) = (times(factors, y), times(factors, &self.betas));
        let with_both = times(&with_beta, y);
        let at = |b| {
            let (first, row) = self.row(b);
            let moment = |of: &[f64]| dot(row, &of[first..first + row.len()]);
            let sum = moment(factors);
            let phi = moment(&with_y) / sum;
            (phi, moment(&with_both) / sum - moment(&with_beta) / sum * phi)
        };
        (0..self.entries.len()).map(at).collect()
    }
}

/// Σ of weight · (φ + φ′ · (mean − value)) over a histogram's bins, all of which are among `at` = (number, value, (φ, φ′)).
fn sum_at(histogram: &Histogram, at: &[(i64, f64, (f64, f64))]) -> f64 {
    let mut at = at.iter();
    let term = |bin: super::histogram::Occupied| {
        let (_, value, (phi, slope)) = at.find(|a| a.0 == bin.number).expect("groups are part of the pool");
        bin.weight * (phi + slope * (bin.mean - value))
    };
    histogram.occupied().map(term).sum()
}

/// Σ h p over neighbouring bins, from unknown `first` on; memberships before and after are negligible.
struct Merged {
    weight: f64,
    first: usize,
    memberships: Vec<f64>,
}

/// Σ_b h_b p_l(b) of the n unknowns.
fn expected(sums: &[Merged], n: usize) -> Vec<f64> {
    let mut expected = vec![0.0; n];
    for sum in sums {
        expected[sum.first..].iter_mut().zip(&sum.memberships).for_each(|(e, m)| *e += m);
    }
    expected
}

fn gradient(sums: &[Merged], weights: &[f64]) -> Vec<f64> {
    let mut gradient = expected(sums, weights.len());
    gradient.iter_mut().zip(weights).for_each(|(g, n)| *g -= n);
    gradient
}

/// ln(a/b), within ±`STRETCH`.
fn ln_ratio(a: f64, b: f64) -> f64 {
    (libm::log(a) - libm::log(b)).clamp(-STRETCH, STRETCH)
}

/// H̃, factored.
enum System {
    /// As it is.
    Direct(Factor),
    /// By the Woodbury identity, H̃⁻¹ = D⁻¹ + D⁻¹ Rᵀ (W − R D⁻¹ Rᵀ)⁻¹ R D⁻¹ with R the sums over merged bins and W
    /// their weights.
    Woodbury { diagonal: Vec<f64>, rows: Vec<(usize, Vec<f64>)>, factor: Factor },
}

impl System {
    /// `None` where rounding has left no positive definite matrix.
    fn new(sums: &[Merged], n: usize) -> Option<System> {
        let diagonal = expected(sums, n);
        if sums.len() < n { System::woodbury(diagonal, sums) } else { System::direct(diagonal, sums) }
    }

    fn direct(diagonal: Vec<f64>, sums: &[Merged]) -> Option<System> {
        let mut rows: Vec<(usize, Vec<f64>)> = (0..diagonal.len()).map(|i| (i, Vec::new())).collect();
        for sum in sums {
            for row in &mut rows[sum.first..sum.first + sum.memberships.len()] {
                row.0 = row.0.min(sum.first);
            }
        }
        for (i, (first, row)) in rows.iter_mut().enumerate() {
            row.resize(i - *first + 1, 0.0);
            row[i - *first] = diagonal[i];
        }
        for sum in sums {
            for (i, &p) in sum.memberships.iter().enumerate() {
                let (first, row) = &mut rows[sum.first + i];
                let scale = p / sum.weight;
                row[sum.first - *first..].iter_mut().zip(&sum.memberships).for_each(|(h, q)| *h -= scale * q);
            }
        }
        Some(System::Direct(Factor::new(rows)?))
    }

    fn woodbury(diagonal: Vec<f64>, sums: &[Merged]) -> Option<System> {
        let mut matrix: Vec<(usize, Vec<f64>)> = Vec::with_capacity(sums.len());
        for (c, sum) in sums.iter().enumerate() {
            let scaled: Vec<f64> = sum.memberships.iter().zip(&diagonal[sum.first..]).map(|(m, d)| m / d).collect();
            let overlap = |other: &Merged| {
                let begin = sum.first.max(other.first);
                let end = (sum.first + scaled.len()).min(other.first + other.memberships.len());
                if begin >= end {
                    return 0.0;
                }
                dot(
                    &scaled[begin - sum.first..end - sum.first],
                    &other.memberships[begin - other.first..end - other.first],
                )
            };
            let meets = |other: &Merged| other.first + other.memberships.len() > sum.first;
            let first = sums[..c].iter().position(meets).unwrap_or(c);
            let mut row: Vec<f64> = sums[first..=c].iter().map(|other| -overlap(other)).collect();
            row[c - first] += sum.weight;
            matrix.push((first, row));
        }
        let rows = sums.iter().map(|s| (s.first, s.memberships.clone())).collect();
        Some(System::Woodbury { diagonal, rows, factor: Factor::new(matrix)? })
    }

    /// H̃⁻¹ b.
    fn solve(&self, b: &[f64]) -> Vec<f64> {
        match self {
            System::Direct(factor) => factor.solve(b),
            System::Woodbury { diagonal, rows, factor } => {
                let mut x: Vec<f64> = b.iter().zip(diagonal).map(|(b, d)| b / d).collect();
                let sums: Vec<f64> = rows.iter().map(|(first, row)| dot(row, &x[*first..*first + row.len()])).collect();
                for ((first, row), y) in rows.iter().zip(factor.solve(&sums)) {
                    let range = *first..*first + row.len();
                    for ((x, m), d) in x[range.clone()].iter_mut().zip(row).zip(&diagonal[range]) {
                        *x += y * m / d;
                    }
                }
                x
            }
        }
    }
}

/// L of L Lᵀ = a symmetric matrix. Rows are kept from the first column that is not zero to the diagonal; elimination
/// fills nothing outside.
struct Factor {
    rows: Vec<(usize, Vec<f64>)>,
}

impl Factor {
    /// `None` where the matrix is not positive definite.
    fn new(mut rows: Vec<(usize, Vec<f64>)>) -> Option<Factor> {
        for i in 0..rows.len() {
            let (done, rest) = rows.split_at_mut(i);
            let (first, row) = &mut rest[0];
            for j in *first..i {
                let (first_j, row_j) = &done[j];
                let begin = (*first).max(*first_j);
                let (known, unknown) = row.split_at_mut(j - *first);
                let eliminated =
                    if begin < j { dot(&known[begin - *first..], &row_j[begin - first_j..j - first_j]) } else { 0.0 };
                unknown[0] = (unknown[0] - eliminated) / row_j[j - first_j];
            }
            let (known, diagonal) = row.split_at_mut(i - *first);
            let rest = diagonal[0] - dot(known, known);
            if rest.is_nan() || rest <= 0.0 {
                return None;
            }
            diagonal[0] = rest.sqrt();
        }
        Some(Factor { rows })
    }

    /// (L Lᵀ)⁻¹ b.
    fn solve(&self, b: &[f64]) -> Vec<f64> {
        let mut x = b.to_vec();
        for (i, (first, row)) in self.rows.iter().enumerate() {
            x[i] = (x[i] - dot(&row[..i - first], &x[*first..i])) / row[i - first];
        }
        for (i, (first, row)) in self.rows.iter().enumerate().rev() {
            x[i] /= row[i - first];
            let known = x[i];
            x[*first..i].iter_mut().zip(row).for_each(|(x, l)| *x -= known * l);
        }
        x
    }
}

/// Σ a b, in eight sums that the compiler turns into vectors; always in this order.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        for i in 0..LANES {
            sums[i] += a[i] * b[i];
        }
    }
    sums.iter().sum::<f64>() + rest
}
