//! Choices in proportion to weights.

/// Shares of [0, 1] in proportion to weights: a choice by one number, by bisection. The number's place within the share is
/// left over, so that near numbers make near choices of both.
#[derive(Clone, Debug)]
pub struct Cumulative {
    /// Upper ends of the shares; the last is 1.
    ends: Vec<f32>,
}

impl Cumulative {
    /// Of some weights, finite and ≥ 0; all shares are alike where all weights are 0.
    ///
    /// # Panics
    /// Without weights.
    pub fn new(weights: impl Iterator<Item = f64> + Clone) -> Cumulative {
        let total: f64 = weights.clone().sum();
        let count = weights.clone().count();
        assert!(count > 0, "a choice among nothing");
        let mut sum = 0.0;
        let mut ends: Vec<f32> = weights
            .map(|weight| {
                sum += if total > 0.0 { weight / total } else { 1.0 / count as f64 };
                sum as f32
            })
            .collect();
        ends[count - 1] = 1.0;
        Cumulative { ends }
    }

    /// The number whose share holds `u` ∈ [0, 1), and where in that share it lies, within [0, 1].
    #[inline(always)]
    pub fn choose(&self, u: f32) -> (usize, f32) {
        let i = self.index(u);
        (i, place_within(u, self.range(i)))
    }

    /// The number whose share holds `u`.
    #[inline(always)]
    pub fn index(&self, u: f32) -> usize {
        let below = match self.ends.len() {
            2 => usize::from(self.ends[0] <= u) + usize::from(self.ends[1] <= u), // a lamp of two triangles
            _ => self.ends.partition_point(|&end| end <= u),
        };
        below.min(self.ends.len() - 1)
    }

    /// The share of number `i`: exactly the probability with which [`choose`](Cumulative::choose) gives it.
    #[inline(always)]
    pub fn share(&self, i: usize) -> f32 {
        self.ends[i] - self.start(i)
    }

    /// The numbers for which [`choose`](Cumulative::choose) gives number `i`: from the first to before the second.
    #[inline(always)]
    pub fn range(&self, i: usize) -> [f32; 2] {
        [self.start(i), self.ends[i]]
    }

    #[inline(always)]
    fn start(&self, i: usize) -> f32 {
        if i == 0 { 0.0 } else { self.ends[i - 1] }
    }
}

/// Where in the share from `start` to `end` the number `u` lies, within [0, 1].
#[inline(always)]
pub fn place_within(u: f32, [start, end]: [f32; 2]) -> f32 {
    ((u - start) / (end - start)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_follow_weights() {
        let choice = Cumulative::new([1.0, 0.0, 3.0].into_iter());
        assert_eq!([0, 1, 2].map(|i| choice.share(i)), [0.25, 0.0, 0.75]);
        assert_eq!(choice.choose(0.125), (0, 0.5));
        assert_eq!(choice.choose(0.25), (2, 0.0), "what has no share is never chosen");
        assert_eq!(choice.choose(0.625), (2, 0.5));
        assert_eq!(choice.index(1.0), 2);
    }

    #[test]
    fn without_weight_all_are_alike() {
        let choice = Cumulative::new([0.0; 4].into_iter());
        assert_eq!([0, 1, 2, 3].map(|i| choice.share(i)), [0.25; 4]);
    }
}
