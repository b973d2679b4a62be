//! References: the mean of independent passes, with what their spread says about its own error.
//!
//! Passes differ in their seeds alone, so they are independent and equally distributed: their mean has a variance of
//! 1/n of theirs, whatever the method does within a pass. A second estimate of the error comes from the halves of even
//! and odd passes. Neither sees what all passes miss alike: a bias of the method, or light so rare that no pass met it.
//!
//! A state file holds the exact sums, so a reference can be gone on with after any interruption, bit by bit as if there
//! had been none: passes are always added in their order, and only whole ones.

use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::metrics::{FLOOR, Reference};
use crate::checksum::Checksum;
use crate::film::Image;
use crate::film::file::{FileError, write_whole};
use crate::path::MappingKind;
use crate::rng::{Counter, Purpose, Rng};
use crate::scene::SceneDescription;

/// Passes at least, however good they look: below this their spread says little.
pub const FEWEST_PASSES: u64 = 8;

/// Adds passes until the reference is good enough.
///
/// `render` makes the image of the pass of that number, or nothing if it is to end; `after` hears of every pass that was
/// added. Returns whether the goal is reached: at least [`FEWEST_PASSES`], and both estimates of relMSE below `goal`.
pub fn accumulate<E>(
    passes: &mut Passes,
    goal: f64,
    mut render: impl FnMut(u64) -> Result<Option<Image>, E>,
    mut after: impl FnMut(&Passes) -> Result<(), E>,
) -> Result<bool, E> {
    while !passes.reached(goal) {
        let Some(image) = render(passes.number())? else { return Ok(false) };
        passes.add(&image);
        after(passes)?;
    }
    Ok(true)
}

/// Seed of the pass of that number, from the seed of the whole: a word of the stream for it.
pub fn pass_seed(seed: u64, pass: u64) -> u64 {
    Rng::new(seed).seed(Counter { ladder: 0, replica: 0, step: pass, purpose: Purpose::Pass })
}

/// What is known of all passes so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Passes {
    width: u32,
    height: u32,
    /// Of even and of odd passes.
    halves: [Moments; 2],
}

/// Estimates of a reference's own error, over pixels and channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnError {
    /// √mean(v), v the variance of the mean by the spread of passes.
    pub rmse: f64,
    /// mean(v / (r² + 0.01)).
    pub by_spread: f64,
    /// mean((a − b)² / 4 / (r² + 0.01)), a and b the means of even and odd passes; with an odd number of passes the
    /// factor is n_a n_b / n² in place of 1/4. Fluctuates more than the other, as it knows two numbers a value.
    pub by_halves: f64,
}

impl OwnError {
    /// The larger relMSE.
    pub fn rel_mse(&self) -> f64 {
        self.by_spread.max(self.by_halves)
    }
}

impl Passes {
    /// None yet, of images of that size.
    pub fn new(width: u32, height: u32) -> Passes {
        let values = 3 * width as usize * height as usize;
        Passes { width, height, halves: [0, 1].map(|_| Moments::new(values)) }
    }

    /// How many there are.
    pub fn number(&self) -> u64 {
        self.halves.iter().map(|half| half.passes).sum()
    }

    /// Adds the next one.
    ///
    /// # Panics
    /// If its size is another.
    pub fn add(&mut self, image: &Image) {
        assert_eq!((image.width, image.height), (self.width, self.height), "passes of different sizes");
        let half = (self.number() % 2) as usize;
        self.halves[half].add(image.pixels.as_flattened());
    }

    fn reached(&self, goal: f64) -> bool {
        self.number() >= FEWEST_PASSES && self.own_error().is_some_and(|error| error.rel_mse() < goal)
    }

    /// Of the mean so far; unknown before there are two passes.
    pub fn own_error(&self) -> Option<OwnError> {
        (self.number() >= 2).then_some(())?;
        let row = 3 * self.width as usize;
        let mut sums = [0.0; 3];
        for y in 0..self.height as usize {
            let mut of_row = [0.0; 3]; // rounding grows with the sides of the image, not with its area
            for i in y * row..(y + 1) * row {
                let Value { mean, variance, halves } = self.value(i);
                let weight = 1.0 / (mean * mean + FLOOR);
                [variance, variance * weight, halves * weight]
                    .iter()
                    .zip(&mut of_row)
                    .for_each(|(term, sum)| *sum += term);
            }
            sums.iter_mut().zip(of_row).for_each(|(sum, of_row)| *sum += of_row);
        }
        let [mse, by_spread, by_halves] = sums.map(|sum| sum / (row * self.height as usize) as f64);
        Some(OwnError { rmse: mse.sqrt(), by_spread, by_halves })
    }

    /// The mean with its variance, which is unknown before there are two passes; `None` before there is one.
    pub fn reference(&self) -> Option<Reference> {
        (self.number() >= 1).then_some(())?;
        let image = |of: fn(Value) -> f64| {
            let value = |i| of(self.value(i)) as f32;
            let pixels = (0..self.width as usize * self.height as usize).map(|i| [0, 1, 2].map(|c| value(3 * i + c)));
            Image::new(self.width, self.height, pixels.collect())
        };
        let variance = (self.number() >= 2).then(|| image(|value| value.variance));
        Some(Reference { image: image(|value| value.mean), variance })
    }

    /// Both halves taken together (Chan, Golub, LeVeque 1979).
    fn value(&self, i: usize) -> Value {
        let [a, b] = &self.halves;
        let (n_a, n_b) = (a.passes as f64, b.passes as f64);
        let n = n_a + n_b;
        let difference = b.mean[i] - a.mean[i];
        let spread = difference * difference * n_a * n_b / n;
        Value {
            mean: a.mean[i] + difference * n_b / n,
            variance: (a.squares[i] + b.squares[i] + spread) / (n - 1.0) / n,
            halves: spread / n,
        }
    }
}

/// `1 pass`, `2 passes`.
pub fn counted(passes: u64) -> String {
    format!("{passes} pass{}", if passes == 1 { "" } else { "es" })
}

/// What passes say about one value of the image.
struct Value {
    mean: f64,
    /// Of the mean, by the spread of passes.
    variance: f64,
    /// Of the mean, by the difference of its halves.
    halves: f64,
}

/// Running moments of every value (Welford 1962): a value that is the same in all passes has variance 0, exactly.
#[derive(Clone, Debug, PartialEq)]
struct Moments {
    passes: u64,
    mean: Vec<f64>,
    /// Sums of squared deviations from the mean.
    squares: Vec<f64>,
}

impl Moments {
    fn new(values: usize) -> Moments {
        Moments { passes: 0, mean: vec![0.0; values], squares: vec![0.0; values] }
    }

    fn add(&mut self, values: &[f32]) {
        self.passes += 1;
        let n = self.passes as f64;
        for ((value, mean), squares) in values.iter().zip(&mut self.mean).zip(&mut self.squares) {
            let before = f64::from(*value) - *mean;
            *mean += before / n;
            *squares += before * (f64::from(*value) - *mean);
        }
    }
}

/// All that decides what a pass of some number looks like: only passes of one recipe belong together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recipe {
    /// The program's version.
    pub relt: String,
    /// The scene file with its definitions, as in a command line. Only for people: the fingerprint decides.
    pub scene: String,
    /// [`fingerprint`] of what the scene's files hold.
    pub fingerprint: String,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Name of the method.
    pub method: String,
    /// Name of the mapping; states that do not tell are from before there was more than one.
    #[serde(default = "only_mapping_once")]
    pub mapping: String,
    /// Of one pass.
    pub mutations_per_pixel: f64,
    /// Of the whole.
    pub seed: u64,
}

fn only_mapping_once() -> String {
    MappingKind::Unidirectional.name().into()
}

impl Recipe {
    /// What is different here from what it is in `other`, one phrase each.
    fn differences(&self, other: &Recipe) -> Vec<String> {
        let mut differences = Vec::new();
        let mut differ = |what: &str, ours: String, theirs: String| {
            if ours != theirs {
                differences.push(format!("{what} {ours}, not {theirs}"));
            }
        };
        differ("relt", self.relt.clone(), other.relt.clone());
        differ("size", format!("{} × {}", self.width, self.height), format!("{} × {}", other.width, other.height));
        differ("--method", self.method.clone(), other.method.clone());
        differ("--mapping", self.mapping.clone(), other.mapping.clone());
        differ("--mpp", self.mutations_per_pixel.to_string(), other.mutations_per_pixel.to_string());
        differ("--seed", self.seed.to_string(), other.seed.to_string());
        if self.fingerprint != other.fingerprint {
            differences.push(if self.scene == other.scene {
                format!("other contents of the files of {}", self.scene)
            } else {
                format!("scene {}, not {}", self.scene, other.scene)
            });
        }
        differences
    }
}

/// [`Checksum`] of the scene's files, in hexadecimal digits.
pub fn fingerprint(scene: &SceneDescription) -> String {
    format!("{:08x}", Checksum::of_scene(scene).finish())
}

/// First line of a state file. After it: mean and sums of squares of all values of even passes and of odd ones as
/// little-endian doubles, and the [`Checksum`] of everything before it.
#[derive(Serialize, Deserialize)]
struct Header {
    /// Of the format.
    relt_reference_state: u32,
    recipe: Recipe,
    /// Even and odd ones.
    passes: [u64; 2],
}

/// Version of the format of state files.
const FORMAT: u32 = 1;

/// Writes all that is needed to go on; the file appears whole or not at all.
pub fn write_state(path: &Path, recipe: &Recipe, passes: &Passes) -> Result<(), FileError> {
    let counts = passes.halves.each_ref().map(|half| half.passes);
    let header = Header { relt_reference_state: FORMAT, recipe: recipe.clone(), passes: counts };
    let mut bytes = serde_json::to_vec(&header).map_err(|error| FileError::write(path, error))?;
    bytes.push(b'\n');
    for value in passes.halves.iter().flat_map(|half| half.mean.iter().chain(&half.squares)) {
        bytes.extend(value.to_le_bytes());
    }
    let check = Checksum::of(&bytes).to_le_bytes();
    bytes.extend(check);
    write_whole(path, |file| file.write_all(&bytes).map_err(|error| error.to_string()))
}

/// Why a state cannot be gone on with.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// It is not there, or the system refused.
    #[error(transparent)]
    File(#[from] FileError),
    /// It is of something else.
    #[error(
        "{path} is of another reference ({}); repeat the command it is of, choose another --output, or delete it to begin \
         anew",
        .differences.join("; ")
    )]
    Foreign {
        /// The file.
        path: String,
        /// What it is of and what was asked for.
        differences: Vec<String>,
    },
}

/// Reads the passes of a state file, which must be of that recipe.
pub fn read_state(path: &Path, recipe: &Recipe) -> Result<Passes, StateError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::read(path, error))?;
    let unfit = |reason: &str| FileError::read(path, format_args!("{reason}; delete it to begin anew"));
    let header_end =
        bytes.iter().position(|byte| *byte == b'\n').ok_or_else(|| unfit("it is no state of a reference"))?;
    let header: Header =
        serde_json::from_slice(&bytes[..header_end]).map_err(|_| unfit("it is no state of a reference"))?;
    if header.relt_reference_state != FORMAT {
        return Err(unfit("its format is of another version of relt").into());
    }
    let damaged = || unfit("it is damaged");
    let (content, check) = bytes.split_last_chunk().ok_or_else(damaged)?;
    let values = 3 * header.recipe.width as usize * header.recipe.height as usize;
    let numbers = content.get(header_end + 1..).ok_or_else(damaged)?;
    if u32::from_le_bytes(*check) != Checksum::of(content) || numbers.len() != 4 * 8 * values {
        return Err(damaged().into());
    }
    let differences = header.recipe.differences(recipe);
    if !differences.is_empty() {
        return Err(StateError::Foreign { path: path.display().to_string(), differences });
    }
    let (numbers, _) = numbers.as_chunks();
    let part = |i: usize| numbers[i * values..][..values].iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let half = |i: usize| Moments { passes: header.passes[i], mean: part(2 * i), squares: part(2 * i + 1) };
    Ok(Passes { width: header.recipe.width, height: header.recipe.height, halves: [half(0), half(1)] })
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;
    use crate::rng::open_unit_f64;

    const SIZE: u32 = 32;

    /// A pass of an image that is 1 everywhere, with independent exponential noise of that standard deviation.
    fn pass(number: u64, sd: f64) -> Image {
        let noise = |pixel: u32, c: usize| {
            let counter = Counter { ladder: pixel, replica: 0, step: number, purpose: Purpose::Primary };
            let word = Rng::new(17).words(counter, 0)[c];
            (1.0 + sd * (-open_unit_f64(word).ln() - 1.0)) as f32
        };
        Image::new(SIZE, SIZE, (0..SIZE * SIZE).map(|i| [0, 1, 2].map(|c| noise(i, c))).collect())
    }

    fn of_passes(n: u64, sd: f64) -> Passes {
        let mut passes = Passes::new(SIZE, SIZE);
        (0..n).for_each(|number| passes.add(&pass(number, sd)));
        passes
    }

    /// relMSE of n passes of noise sd is sd²/n/1.01, nearly: r in the denominator is noisy as well, which makes up to 5 %.
    /// Over 3072 values of exponential noise (kurtosis 9) estimates have standard errors of 1.7 % (spread, n = 9), 2.7 %
    /// (halves) and, for a single pass, 5 %.
    #[test]
    fn a_reference_knows_its_own_error() {
        for n in [9, 16] {
            let passes = of_passes(n, 0.3);
            let expected = 0.09 / n as f64;
            let error = passes.own_error().unwrap();
            let truth = Reference { image: Image::constant(SIZE, SIZE, [1.0; 3]), variance: None };
            let reference = passes.reference().unwrap();
            let real = crate::study::metrics::Errors::of(&reference.image, &truth);
            for (name, value) in [
                ("rmse", error.rmse.powi(2) / expected),
                ("spread", 1.01 * error.by_spread / expected),
                ("halves", 1.01 * error.by_halves / expected),
                ("real", real.mse / expected),
            ] {
                assert!((value - 1.0).abs() < 0.15, "{name} of {n} passes: {value} of what it should be");
            }
            // the file's variance says the same, and corrects a comparison with an image of one pass
            let noise = reference.noise().unwrap();
            assert!((noise.mse.sqrt() / error.rmse - 1.0).abs() < 1e-6);
            let corrected = crate::study::metrics::Errors::of(&pass(1000, 0.3), &reference);
            assert!((corrected.mse / 0.09 - 1.0).abs() < 0.15, "{}", corrected.mse);
        }
    }

    /// Three passes of one value, by hand: 1, 2, 6 have mean 3, Σ(x − 3)² = 14.
    #[test]
    fn moments_are_those_of_a_calculation_by_hand() {
        let mut passes = Passes::new(1, 1);
        assert_eq!((passes.own_error(), passes.reference()), (None, None));
        passes.add(&Image::constant(1, 1, [1.0; 3]));
        assert_eq!(passes.reference().unwrap().variance, None, "one pass has no spread");
        passes.add(&Image::constant(1, 1, [2.0; 3]));
        passes.add(&Image::constant(1, 1, [6.0; 3]));
        let Value { mean, variance, halves } = passes.value(0);
        assert!((mean - 3.0).abs() < 1e-15 && (variance - 14.0 / 2.0 / 3.0).abs() < 1e-14, "{mean} {variance}");
        // even passes 1 and 6 have mean 3.5, the odd one is 2: 1.5² · 2 · 1 / 3²
        assert!((halves - 0.5).abs() < 1e-15, "{halves}");
        let error = passes.own_error().unwrap();
        assert!((error.by_halves - 0.5 / 9.01).abs() < 1e-15 && (error.by_spread - 7.0 / 3.0 / 9.01).abs() < 1e-15);
    }

    #[test]
    fn what_never_changes_has_no_variance() {
        let passes = of_passes(11, 0.0);
        assert_eq!(passes.own_error(), Some(OwnError { rmse: 0.0, by_spread: 0.0, by_halves: 0.0 }));
    }

    #[test]
    fn passes_end_when_both_estimates_are_below_the_goal() {
        let run = |passes: &mut Passes, goal: f64, most: u64| {
            let render = |number| Ok::<_, Infallible>((number < most).then(|| pass(number, 0.3)));
            accumulate(passes, goal, render, |_| Ok(())).unwrap()
        };
        let mut passes = Passes::new(SIZE, SIZE);
        assert!(run(&mut passes, 1.0, 100));
        assert_eq!(passes.number(), FEWEST_PASSES, "a goal that is easily reached takes the fewest passes");
        assert!(run(&mut passes, 0.09 / 20.0, 100));
        assert!((18..=24).contains(&passes.number()), "{}", passes.number());
        assert!(passes.own_error().unwrap().rel_mse() < 0.09 / 20.0);
        assert_eq!(passes, of_passes(passes.number(), 0.3), "going on is as if there had been no pause");
        assert!(!run(&mut passes, 1e-9, 30));
        assert_eq!(passes.number(), 30, "nothing more came");
    }

    fn recipe() -> Recipe {
        Recipe {
            relt: "0.1.0".into(),
            scene: "a.xml -D res=32".into(),
            fingerprint: "12ab".into(),
            width: SIZE,
            height: SIZE,
            method: "path".into(),
            mapping: "two-way".into(),
            mutations_per_pixel: 128.0,
            seed: u64::MAX,
        }
    }

    #[test]
    fn a_state_comes_back_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("r.state");
        let passes = of_passes(5, 0.3);
        write_state(&file, &recipe(), &passes).unwrap();
        let mut back = read_state(&file, &recipe()).unwrap();
        assert_eq!(back, passes);
        back.add(&pass(5, 0.3));
        assert_eq!(back, of_passes(6, 0.3));
        let renamed = Recipe { scene: "b.xml".into(), ..recipe() };
        assert_eq!(read_state(&file, &renamed).unwrap(), passes, "what a file is called is of no account");
    }

    #[test]
    fn states_of_something_else_are_refused_with_what_differs() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("r.state");
        write_state(&file, &recipe(), &of_passes(2, 0.3)).unwrap();
        let message = |recipe: &Recipe| read_state(&file, recipe).unwrap_err().to_string();
        let [method, mapping] = ["mlt", "light"].map(str::to_owned);
        let text = message(&Recipe { method, mapping, mutations_per_pixel: 0.5, seed: 3, ..recipe() });
        for part in [
            "--method path, not mlt",
            "--mapping two-way, not light",
            "--mpp 128, not 0.5",
            "not 3",
            "delete it to begin anew",
        ] {
            assert!(text.contains(part), "{part:?} is not in: {text}");
        }
        assert!(message(&Recipe { width: 16, ..recipe() }).contains("size 32 × 32, not 16 × 32"));
        assert!(message(&Recipe { relt: "9".into(), ..recipe() }).contains("relt 0.1.0, not 9"));
        let other = Recipe { fingerprint: "0".into(), ..recipe() };
        assert!(message(&other).contains("other contents of the files of a.xml -D res=32"), "{}", message(&other));
        let other = Recipe { scene: "b.xml".into(), ..other };
        assert!(message(&other).contains("scene a.xml -D res=32, not b.xml"), "{}", message(&other));
    }

    #[test]
    fn damaged_states_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("r.state");
        write_state(&file, &recipe(), &of_passes(2, 0.3)).unwrap();
        let whole = std::fs::read(&file).unwrap();
        let mut flipped = whole.clone();
        flipped[whole.len() / 2] ^= 1;
        for bytes in [&whole[..whole.len() - 1], &whole[..300], &whole[..50], b"", b"hello\n", b"{}\n", &flipped] {
            std::fs::write(&file, bytes).unwrap();
            let text = read_state(&file, &recipe()).unwrap_err().to_string();
            assert!(text.contains("cannot read") && text.contains("delete it to begin anew"), "{text}");
        }
    }

    #[test]
    fn seeds_of_passes_differ() {
        let mut seeds: Vec<u64> = (0..4).flat_map(|seed| (0..1000).map(move |pass| pass_seed(seed, pass))).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 4000);
        assert_eq!(pass_seed(3, 5), pass_seed(3, 5));
    }
}
