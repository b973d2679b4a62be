//! Sums of two lobes as blends, for Mitsuba 3 has no sum.

use super::files::Files;
use super::textures::Texture;

/// What makes a blend of two lobes equal their sum.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    /// Weight of the second lobe; 0 or 1 where only one of them is there.
    pub weight: f64,
    /// Reflectance of the first.
    pub first: Texture,
    /// Reflectance of the second.
    pub second: Texture,
    /// Greatest sum of reflectances that was asked for. What is above 1 has been scaled to 0.99.
    pub sum: f64,
}

/// A blend takes (1 − w) of the first and w of the second; reflectances of a/(1 − w) and b/w take that back. With
/// w = max b/(max a + max b), neither is above max a + max b.
pub(super) fn shares(first: &Texture, second: &Texture, files: &Files) -> Result<Shares, String> {
    let (a, b) = (first.greatest(files)?.max(0.0), second.greatest(files)?.max(0.0));
    let sum = a + b;
    let weight = if sum > 0.0 { b / sum } else { 0.0 };
    let scale = if sum > 1.0 { 0.99 / sum } else { 1.0 };
    let scaled = |texture: &Texture, share: f64| match share {
        0.0 => Ok(texture.clone()),
        share => texture.map(files, &|value| value.map(|v| v * scale / share)),
    };
    Ok(Shares { weight, first: scaled(first, 1.0 - weight)?, second: scaled(second, weight)?, sum })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn a_blend_of_the_shares_is_the_sum() {
        let files = Files::new(Path::new("out.xml"));
        let [a, b] = [[0.5, 0.1, 0.3], [0.1, 0.2, 0.0]].map(Texture::Constant);
        let Shares { weight, first, second, sum } = shares(&a, &b, &files).unwrap();
        assert!((sum - 0.7).abs() < 1e-12);
        let (Some(first), Some(second)) = (first.constant(), second.constant()) else { panic!("constants stay") };
        for (c, sum) in [0.6, 0.3, 0.3].into_iter().enumerate() {
            assert!(((1.0 - weight) * first[c] + weight * second[c] - sum).abs() < 1e-12);
            assert!(first[c] <= 0.7 + 1e-12 && second[c] <= 0.7 + 1e-12);
        }
    }

    #[test]
    fn what_reflects_more_than_it_gets_is_scaled() {
        let files = Files::new(Path::new("out.xml"));
        let one = Texture::Constant([1.0; 3]);
        let Shares { weight, first, sum, .. } = shares(&one, &one, &files).unwrap();
        assert_eq!((weight, sum), (0.5, 2.0));
        assert!((first.constant().unwrap()[0] - 0.99).abs() < 1e-12);
    }

    #[test]
    fn a_lobe_that_is_not_there_has_no_share() {
        let files = Files::new(Path::new("out.xml"));
        let [black, grey] = [0.0, 0.5].map(|v| Texture::Constant([v; 3]));
        assert_eq!(shares(&grey, &black, &files).unwrap().weight, 0.0);
        assert_eq!(shares(&black, &grey, &files).unwrap().weight, 1.0);
        assert_eq!(shares(&black, &black, &files).unwrap().weight, 0.0);
    }
}
