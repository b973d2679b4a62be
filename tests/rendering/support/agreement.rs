//! Whether independent renderings agree with an image that is known.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use relt::film::{Filter, Image, Plane, exr_file, png_file};

use super::statistics::{f_test, mean, t_test, variance};

/// Probability with which one test fails although all is right. Some 110 sets of runs are checked, each by one F-test
/// and four t-tests: a false alarm in fewer than six of a thousand changes of all random numbers.
const LEVEL: f64 = 1e-5;
/// Relative error of values that are exact but for rounding to 32 bits along the way.
const ROUNDING: f64 = 3e-6;
/// Differences are taken relative to the expected value plus this share of the whole image's mean.
const FLOOR: f64 = 0.1;

/// An image that is known.
pub struct Expected {
    pub image: Image,
    /// Variance of each value; zero where it is known exactly.
    pub variance: Image,
}

/// How to compare.
pub struct Agreement<'a> {
    /// Of the folder for evidence.
    pub name: &'a str,
    /// Tiles a row and rows of tiles; extents of both images are multiples of them.
    pub tiles: [u32; 2],
    /// The largest relative standard error of the mean brightness for which the test says anything; a noisier set of
    /// runs fails, as it would agree with everything.
    pub precision: f64,
    /// What the runs were filtered with: only some filters make pixels negative.
    pub filter: Filter,
}

impl Expected {
    /// The same value everywhere, known exactly.
    pub fn constant(width: u32, height: u32, rgb: [f32; 3]) -> Expected {
        let variance = Image::constant(width, height, [0.0; 3]);
        Expected { image: Image::constant(width, height, rgb), variance }
    }

    /// The image and the layer `variance` of a file.
    pub fn read(path: &Path) -> Expected {
        let contents = exr_file::read_file(path).unwrap_or_else(|error| panic!("{error}"));
        let variance = contents.rgb("variance").expect("a reference with its variance").clone();
        Expected { image: contents.image, variance }
    }
}

impl Agreement<'_> {
    /// Means of tiles by an F-test and mean brightness, of each channel and of all, by t-tests; panics where any is
    /// improbable, and leaves evidence.
    pub fn check(&self, runs: &[Image], expected: &Expected) {
        let mut faults = Vec::new();
        let least = if self.filter.has_negative_lobes() { f32::NEG_INFINITY } else { 0.0 };
        if runs.iter().any(|run| !run.pixels.as_flattened().iter().all(|v| v.is_finite() && *v >= least)) {
            faults.push("some pixels are negative or not finite".to_owned());
        }
        let means: Vec<[f64; 3]> = runs.iter().map(Image::mean).collect();
        let pixels = expected.variance.pixels.len() as f64;
        let exact = expected.image.mean();
        let rounding = |value: f64| (ROUNDING * value).powi(2);
        let own = expected.variance.mean().map(|v| v / pixels);
        let mut line = format!("{}:", self.name);
        let mut brightness = |name: &str, values: &[f64], expected: f64, variance_of_expected: f64| {
            let (t, p) = t_test(values, expected, variance_of_expected + rounding(expected));
            let ratio = mean(values.iter().copied()) / expected;
            let error = (variance(values.iter().copied()) / values.len() as f64).sqrt() / expected;
            write!(line, " {name} × {ratio:.5} ± {error:.5} (t = {t:.1}, p = {p:.1e})").expect("a string");
            if p < LEVEL {
                faults.push(format!("mean of {name} is {ratio:.5} ± {error:.5} of what it should be (p = {p:.1e})"));
            }
            error
        };
        let all: Vec<f64> = means.iter().map(|rgb| rgb.iter().sum::<f64>() / 3.0).collect();
        let error = brightness("all", &all, exact.iter().sum::<f64>() / 3.0, own.iter().sum::<f64>() / 9.0);
        for (i, name) in ["R", "G", "B"].into_iter().enumerate() {
            let values: Vec<f64> = means.iter().map(|rgb| rgb[i]).collect();
            brightness(name, &values, exact[i], own[i]);
        }
        if error > self.precision {
            faults.push(format!("mean brightness has an error of {error:.4}, too large to tell anything"));
        }

        let tiles: Vec<Vec<f64>> = runs.iter().map(|run| self.tile_means(run)).collect();
        let expected_tiles = self.tile_means(&expected.image);
        let pixels_a_tile = pixels / f64::from(self.tiles[0] * self.tiles[1]);
        let variances: Vec<f64> = self
            .tile_means(&expected.variance)
            .iter()
            .zip(&expected_tiles)
            .map(|(v, e)| v / pixels_a_tile + rounding(*e))
            .collect();
        let floor = FLOOR * mean(exact.into_iter());
        let weight = |tile: usize| 1.0 / (expected_tiles[tile].max(0.0) + floor);
        let scaled = |values: &[f64]| -> Vec<f64> { values.iter().enumerate().map(|(i, v)| v * weight(i)).collect() };
        let scaled_variances: Vec<f64> = variances.iter().enumerate().map(|(i, v)| v * weight(i).powi(2)).collect();
        let scaled_runs: Vec<Vec<f64>> = tiles.iter().map(|run| scaled(run)).collect();
        let (f, p) = f_test(&scaled_runs, &scaled(&expected_tiles), &scaled_variances);
        println!("{line}; tiles F = {f:.2} (p = {p:.1e})");
        if p < LEVEL || p.is_nan() {
            faults.push(format!("tiles differ with F = {f:.2} (p = {p:.1e})"));
        }
        if !faults.is_empty() {
            let folder = self.leave_evidence(runs, expected, &tiles, &expected_tiles, &variances);
            panic!("{}: {}\n{line}\nevidence: {}", self.name, faults.join("; "), folder.display());
        }
    }

    /// Means of tiles, channels innermost.
    fn tile_means(&self, image: &Image) -> Vec<f64> {
        let [columns, rows] = self.tiles;
        assert!(
            image.width.is_multiple_of(columns) && image.height.is_multiple_of(rows),
            "{}: tiles do not fit",
            self.name
        );
        let (width, height) = (image.width / columns, image.height / rows);
        let mut sums = vec![0.0; (columns * rows * 3) as usize];
        for (i, rgb) in image.pixels.iter().enumerate() {
            let (x, y) = (i as u32 % image.width / width, i as u32 / image.width / height);
            for (channel, value) in rgb.iter().enumerate() {
                sums[((y * columns + x) * 3) as usize + channel] += f64::from(*value);
            }
        }
        sums.iter().map(|sum| sum / f64::from(width * height)).collect()
    }

    /// A table of tiles and images of the mean, of what was expected and of the difference, a tile a pixel.
    fn leave_evidence(
        &self,
        runs: &[Image],
        expected: &Expected,
        tiles: &[Vec<f64>],
        expected_tiles: &[f64],
        variances: &[f64],
    ) -> PathBuf {
        let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("a folder in target");
        let folder = target.join("test-evidence").join(self.name);
        std::fs::create_dir_all(&folder).expect("a folder for evidence");
        let mut table = "x\ty\tchannel\tmean\terror\texpected\terror of expected\tz\n".to_owned();
        let mut means = Vec::new();
        for (i, expected) in expected_tiles.iter().enumerate() {
            let values = tiles.iter().map(|run| run[i]);
            let (m, v) = (mean(values.clone()), variance(values) / tiles.len() as f64);
            means.push(m);
            let (tile, channel) = (i as u32 / 3, i % 3);
            let (x, y) = (tile % self.tiles[0], tile / self.tiles[0]);
            let z = (m - expected) / (v + variances[i]).sqrt();
            let (error, of_expected) = (v.sqrt(), variances[i].sqrt());
            writeln!(table, "{x}\t{y}\t{channel}\t{m:.6e}\t{error:.1e}\t{expected:.6e}\t{of_expected:.1e}\t{z:.2}")
                .expect("a string");
        }
        std::fs::write(folder.join("tiles.tsv"), table).expect("the table");
        let small = |values: &dyn Fn(usize) -> f64| {
            let pixel = |tile: usize| [0, 1, 2].map(|channel| values(3 * tile + channel) as f32);
            Image::new(self.tiles[0], self.tiles[1], (0..means.len() / 3).map(pixel).collect())
        };
        let (mean_of_tiles, of_expected) = (small(&|i| means[i]), small(&|i| expected_tiles[i]));
        let difference = small(&|i| means[i] - expected_tiles[i]);
        let layers = [("expected".to_owned(), Plane::Rgb(of_expected)), ("difference".into(), Plane::Rgb(difference))];
        exr_file::write(&folder.join("tiles.exr"), &mean_of_tiles, &layers, &[]).expect("an image of tiles");
        png_file::write(&folder.join("first-run.png"), &runs[0]).expect("a preview");
        png_file::write(&folder.join("expected.png"), &expected.image).expect("a preview");
        folder
    }
}
