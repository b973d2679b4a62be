//! Whatever a file holds, a conversion ends with a scene or with faults, never with a panic.

use std::panic::{AssertUnwindSafe, catch_unwind};

use relt::convert::ConvertError;

use crate::support::Folder;

/// Mutations of each sample. They are the same in every run.
const MUTATIONS: u64 = 250;

/// A generator of 64 bits (splitmix64).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }
}

/// Things that numbers and names are replaced by.
const PIECES: &[&str] =
    &["", "0", "-1", "1e39", "nan", "99999999999", "[", "]", "\"", "<", ">", "/", "x", "$a", "''", " ", "\n", "true"];

/// The text with a few words or bytes changed, or cut off.
fn mutated(text: &str, random: &mut Random) -> String {
    let mut words: Vec<String> =
        text.split_inclusive(|c: char| c.is_whitespace() || "\"<>[]='".contains(c)).map(str::to_owned).collect();
    for _ in 0..=random.below(2) {
        let i = random.below(words.len());
        let j = random.below(words.len());
        match random.below(5) {
            0 => words[i] = PIECES[random.below(PIECES.len())].to_owned(),
            1 => words.swap(i, j),
            2 => words[i] = words[j].clone(),
            3 => {
                // the end of the word stays, as it keeps words apart
                let end = words[i].pop().map_or(String::new(), String::from);
                words[i] = format!("{}{end}", PIECES[random.below(PIECES.len())]);
            }
            _ => words.truncate(i.max(1)),
        }
    }
    words.concat()
}

fn check(name: &str) {
    let folder = Folder::new();
    let text = std::fs::read_to_string(folder.path(name)).unwrap();
    let mutant = name.replace("everything", "mutant");
    let (mut faulty, mut sound) = (0, 0);
    for seed in 0..MUTATIONS {
        let text = mutated(&text, &mut Random(seed));
        let result = catch_unwind(AssertUnwindSafe(|| folder.convert_text(&mutant, &text)));
        match result.unwrap_or_else(|_| panic!("mutation {seed} of {name} panics:\n{text}")) {
            Ok((_, output)) => {
                sound += 1;
                let written = std::fs::read_to_string(&output).unwrap();
                assert!(roxmltree::Document::parse(&written).is_ok(), "mutation {seed} of {name}:\n{written}");
            }
            Err(ConvertError::Input(errors)) => {
                faulty += 1;
                assert!(errors.iter().all(|error| !error.faults().is_empty()), "mutation {seed} of {name}");
            }
            Err(other) => panic!("mutation {seed} of {name}: {other}"),
        }
    }
    assert!(faulty > 10 && sound > 10, "{faulty} faulty and {sound} sound: the mutations do not look at both");
}

#[test]
fn no_old_mitsuba_scene_makes_a_conversion_panic() {
    check("mitsuba/everything.xml");
}

#[test]
fn no_pbrt_scene_makes_a_conversion_panic() {
    check("pbrt/everything.pbrt");
}

#[test]
fn no_beginning_of_a_scene_makes_a_conversion_panic() {
    let folder = Folder::new();
    for (name, part) in [("mitsuba/everything.xml", "mitsuba/part.xml"), ("pbrt/everything.pbrt", "pbrt/part.pbrt")] {
        let text = std::fs::read_to_string(folder.path(name)).unwrap();
        for end in (0..text.len()).step_by(97).filter(|end| text.is_char_boundary(*end)) {
            let result = catch_unwind(AssertUnwindSafe(|| folder.convert_text(part, &text[..end])));
            assert!(result.is_ok(), "the first {end} bytes of {name} panic");
        }
    }
}
