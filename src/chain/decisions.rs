//! Random words that decide on steps, of many chains at once.

use pulp::NullaryFnOnce;

use crate::{
    math::widest,
    rng::{Counter, Purpose, Rng, SIDE_BY_SIDE},
};

/// The words that decide on the step of every counter's chain, in order; what was in `words` is forgotten.
pub fn draw_decisions(rng: Rng, counters: &[Counter], words: &mut Vec<[u32; 4]>) {
    words.resize(counters.len(), [0; 4]);
    widest(Draw { rng, counters, words });
}

struct Draw<'a> {
    rng: Rng,
    counters: &'a [Counter],
    words: &'a mut [[u32; 4]],
}

impl NullaryFnOnce for Draw<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Draw { rng, counters, words } = self;
        let (counters, rest) = counters.as_chunks::<SIDE_BY_SIDE>();
        let (words, words_of_rest) = words.as_chunks_mut::<SIDE_BY_SIDE>();
        for (counters, words) in counters.iter().zip(words) {
            let mut counters = *counters;
            for counter in &mut counters {
                counter.purpose = Purpose::Step;
            }
            let drawn = rng.words_side_by_side(counters, 0);
            for (j, words) in words.iter_mut().enumerate() {
                *words = [drawn[0][j], drawn[1][j], drawn[2][j], drawn[3][j]];
            }
        }
        for (counter, words) in rest.iter().zip(words_of_rest) {
            *words = rng.words(Counter { purpose: Purpose::Step, ..*counter }, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decisions_are_the_same_in_any_company() {
        let counter = |lane| Counter { ladder: lane, replica: 3, step: 77, purpose: Purpose::Primary };
        let counters: Vec<Counter> = (0..29).map(counter).collect();
        let mut words = Vec::new();
        draw_decisions(Rng::new(5), &counters, &mut words);
        assert_eq!(words.len(), counters.len());
        for (counter, words) in counters.iter().zip(words) {
            assert_eq!(words, Rng::new(5).words(Counter { purpose: Purpose::Step, ..*counter }, 0));
        }
    }
}
