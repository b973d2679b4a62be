//! Which primary dimensions decide what.

use crate::{
    sample::LIGHT_STREAM,
    scene::{Features, description::Integrator},
};

/// The primary dimensions of a camera path, laid out by bounce so that a small step in one decision moves that
/// decision and no other.
///
/// Block 0 is the film position and, where there is a lens, the place on it: a block has four dimensions whether they are
/// used or not, so neither costs anything more. Each bounce has one block (direction: 2, place on a light: 2) and, only
/// where the scene needs any of them, a second one (lobe, light, roulette).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Bounces choose among lobes or lights.
    choices: bool,
    /// The bounce, counted from 0, from which on paths end by Russian roulette.
    roulette_from: u16,
    /// Longest path in edges.
    max_depth: u16,
    lens: bool,
    lobe_choice: bool,
    light_choice: bool,
    technique_choice: bool,
}

impl Layout {
    /// The layout for that scene; points choose a technique or have all of them.
    pub fn new(features: &Features, technique_choice: bool) -> Layout {
        let max_depth =
            features.integrator.max_depth.map_or(Integrator::LONGEST, |d| d.min(Integrator::LONGEST)) as u16;
        Layout {
            choices: features.lobe_choice || features.light_choice(),
            // a path has bounce + 1 edges when its roulette is played
            roulette_from: features.integrator.rr_depth.saturating_sub(1).min(Integrator::LONGEST) as u16,
            max_depth,
            lens: features.lens,
            lobe_choice: features.lobe_choice,
            light_choice: features.light_choice(),
            technique_choice,
        }
    }

    /// Longest path in edges.
    #[inline(always)]
    pub fn max_depth(&self) -> u16 {
        self.max_depth
    }

    /// First block of a bounce: direction and place on a light.
    #[inline(always)]
    pub fn bounce(&self, bounce: u16) -> u16 {
        let seconds = if self.choices { bounce } else { bounce.saturating_sub(self.roulette_from) };
        1 + bounce + seconds
    }

    /// The block of a bounce that holds lobe, light and roulette, where there is one.
    #[inline(always)]
    pub fn choices(&self, bounce: u16) -> Option<u16> {
        (self.choices || self.roulette(bounce)).then(|| self.bounce(bounce) + 1)
    }

    /// Whether roulette is played after that bounce.
    #[inline(always)]
    pub fn roulette(&self, bounce: u16) -> bool {
        bounce >= self.roulette_from
    }

    /// The block of a light subpath that chooses the light and the technique, where there is any choice.
    #[inline(always)]
    pub fn light_choices(&self) -> Option<u16> {
        (self.light_choice || self.technique_choice).then_some(LIGHT_STREAM)
    }

    /// The block of a light subpath that says where it starts and in which direction.
    #[inline(always)]
    pub fn emission(&self) -> u16 {
        LIGHT_STREAM + u16::from(self.light_choices().is_some())
    }

    /// The block of a bounce of a light subpath, counted from 0.
    #[inline(always)]
    pub fn light_bounce(&self, bounce: u16) -> u16 {
        self.emission() + 1 + bounce
    }

    /// Names of the dimensions that decide something before the first bounce, for people.
    pub fn describe_camera(&self) -> Vec<&'static str> {
        let mut names = vec!["film position", "film position"];
        if self.lens {
            names.extend(["place on lens", "place on lens"]);
        }
        names
    }

    /// Names of the dimensions that decide something at that bounce, for people.
    pub fn describe(&self, bounce: u16) -> Vec<&'static str> {
        let mut names = vec!["direction", "direction", "place on light", "place on light"];
        if self.lobe_choice {
            names.push("lobe");
        }
        if self.light_choice {
            names.push("light");
        }
        if self.roulette(bounce) {
            names.push("roulette");
        }
        names
    }

    /// Names of the dimensions that decide how a light subpath starts, for people.
    pub fn describe_emission(&self) -> Vec<&'static str> {
        let mut names = vec!["place on light", "place on light", "direction", "direction"];
        if self.light_choice {
            names.push("light");
        }
        if self.technique_choice {
            names.extend(["length", "technique"]);
        }
        names
    }

    /// Names of the dimensions that decide something at that bounce of a light subpath, for people.
    pub fn describe_light(&self, bounce: u16) -> Vec<&'static str> {
        let mut names = vec!["direction", "direction"];
        if self.lobe_choice {
            names.push("lobe");
        }
        if self.roulette(bounce) {
            names.push("roulette");
        }
        names
    }

    /// The bounce from which on roulette is played, if paths get so long.
    pub fn roulette_from(&self) -> Option<u16> {
        (self.roulette_from + 1 < self.max_depth).then_some(self.roulette_from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_follow_each_other_without_gap_or_overlap() {
        for choices in [false, true] {
            for roulette_from in [0, 4, 100] {
                let layout = Layout {
                    choices,
                    roulette_from,
                    max_depth: 50,
                    lens: choices,
                    lobe_choice: choices,
                    light_choice: false,
                    technique_choice: false,
                };
                let mut next = 1;
                for bounce in 0..50 {
                    assert_eq!(layout.bounce(bounce), next);
                    next += 1;
                    if let Some(block) = layout.choices(bounce) {
                        assert_eq!(block, next);
                        next += 1;
                    }
                    assert_eq!(layout.choices(bounce).is_some(), choices || bounce >= roulette_from);
                }
            }
        }
    }
}
