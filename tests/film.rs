//! The film loses nothing, depends on no order, keeps constants constant, and its files read back bit by bit.

use std::f64::consts::PI;
use std::path::PathBuf;

use relt::film::{
    Accumulator, Filter, Footprint, Image, PixelFormat, Plane, Splat, Splats, Value, Window, exr_file, png_file,
};

/// A small generator for test data; `seed` is fixed at every use.
struct Dice(u64);

impl Dice {
    /// SplitMix64 (Steele et al. 2014).
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    fn uniform(&mut self) -> f32 {
        (self.bits() >> 40) as f32 * 2f32.powi(-24)
    }

    /// Over twelve orders of magnitude around 1.
    fn heavy(&mut self) -> f32 {
        10f32.powf(12.0 * self.uniform() - 6.0)
    }
}

fn random_splats(count: usize, pixels: u32, scale: f32) -> Vec<Splat> {
    let mut dice = Dice(7);
    (0..count)
        .map(|_| Splat {
            pixel: (dice.bits() % u64::from(pixels)) as u32,
            rgb: [
                dice.heavy() * scale,
                dice.heavy() * scale,
                if dice.uniform() < 0.1 { 0.0 } else { dice.heavy() * scale },
            ],
            weight: dice.uniform(),
        })
        .collect()
}

fn deposit(film: &Accumulator, splats: &[Splat], batch: usize) {
    let mut waiting = Splats::new(1);
    for chunk in splats.chunks(batch) {
        chunk.iter().for_each(|splat| waiting.push(0, *splat));
        assert_eq!(waiting.len(), chunk.len());
        film.deposit(&mut waiting);
        assert!(waiting.is_empty());
    }
}

fn bits(sums: &[[f64; 4]]) -> Vec<u64> {
    sums.as_flattened().iter().map(|sum| sum.to_bits()).collect()
}

#[test]
fn any_order_and_any_number_of_threads_give_the_same_bits() {
    let (width, height) = (97, 31);
    let mut splats = random_splats(200_000, width * height, 1.0);
    let film = Accumulator::new(width, height, 1, 20.0);
    deposit(&film, &splats, 4096);
    let expected = bits(&film.layer(0));

    let mut dice = Dice(8);
    for shuffle in 0..5 {
        for i in (1..splats.len()).rev() {
            splats.swap(i, (dice.bits() % (i as u64 + 1)) as usize);
        }
        let film = Accumulator::new(width, height, 1, 20.0);
        deposit(&film, &splats, 100 + 1000 * shuffle);
        assert_eq!(bits(&film.layer(0)), expected, "shuffle {shuffle}");
    }
    for threads in [2, 3, 8] {
        let film = Accumulator::new(width, height, 1, 20.0);
        std::thread::scope(|scope| {
            for mine in splats.chunks(splats.len().div_ceil(threads)) {
                scope.spawn(|| deposit(&film, mine, 777));
            }
        });
        assert_eq!(bits(&film.layer(0)), expected, "{threads} threads");
        assert_eq!(film.overflowed(), 0);
    }
}

#[test]
fn threads_that_all_want_one_pixel_lose_nothing() {
    let film = Accumulator::new(1, 1, 2, 1.0);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let mut splats = Splats::new(2);
                for _ in 0..200 {
                    for _ in 0..500 {
                        splats.push(1, Splat { pixel: 0, rgb: [0.1, 1.0, 1e-8], weight: 0.25 });
                    }
                    film.deposit(&mut splats);
                }
            });
        }
    });
    let n = 4.0 * 200.0 * 500.0;
    assert_eq!(film.layer(1), [[n * f64::from(0.1f32), n, n * f64::from(1e-8f32), n / 4.0]]);
    assert_eq!(film.layer(0), [[0.0; 4]]);
}

/// An `f32` sum would stall at 2²⁴ and an `f64` one would drop what lies 2⁵³ below.
#[test]
fn a_billion_splats_leave_room_for_the_smallest() {
    let film = Accumulator::new(1, 1, 1, 1.0);
    let mut splats = Splats::new(1);
    // Doubling by merging: 2³⁰ > 10⁹ times the same splat.
    splats.push(0, Splat { pixel: 0, rgb: [0.7, 134_217_720.0, 1e-7], weight: 0.9 });
    film.deposit(&mut splats);
    for _ in 0..30 {
        film.merge(&film);
    }
    let n = 2f64.powi(30);
    let full = [n * f64::from(0.7f32), n * 134_217_720.0, n * f64::from(1e-7f32), n * f64::from(0.9f32)];
    assert_eq!(film.layer(0), [full]);
    // On top of 2⁵⁷ units, a splat of 2⁻⁴⁷ units is still there once the large one is taken away.
    let tiny = 2f32.powi(-47) * 1.25;
    splats.push(0, Splat { pixel: 0, rgb: [tiny, tiny, tiny], weight: 0.0 });
    film.deposit(&mut splats);
    let away = Accumulator::new(1, 1, 1, 1.0);
    splats.push(0, Splat { pixel: 0, rgb: [-0.7, -134_217_720.0, -1e-7], weight: -0.9 });
    away.deposit(&mut splats);
    for _ in 0..30 {
        away.merge(&away);
    }
    film.merge(&away);
    let tiny = f64::from(tiny);
    assert_eq!(film.layer(0), [[tiny, tiny, tiny, 0.0]]);
    assert_eq!(film.overflowed(), 0);
}

#[test]
fn extreme_units_keep_the_same_precision() {
    for unit in [1e-30f32, 1e-12, 1.0, 1e12, 1e30] {
        let splats = random_splats(20_000, 4, unit);
        let film = Accumulator::new(2, 2, 1, f64::from(unit));
        deposit(&film, &splats, 1000);
        let mut expected = [[0f64; 3]; 4];
        for splat in &splats {
            for (sum, value) in expected[splat.pixel as usize].iter_mut().zip(splat.rgb) {
                *sum += f64::from(value);
            }
        }
        for (got, expected) in film.layer(0).iter().zip(&expected) {
            for (got, expected) in got.iter().zip(expected) {
                assert!((got / expected - 1.0).abs() < 1e-12, "unit {unit:e}: {got:e} instead of {expected:e}");
            }
        }
        assert_eq!(film.overflowed(), 0, "unit {unit:e}");
    }
}

#[test]
fn a_layer_can_be_cleared_alone() {
    let film = Accumulator::new(2, 1, 2, 1.0);
    let mut splats = Splats::new(2);
    for layer in [0, 1] {
        splats.push(layer, Splat { pixel: 1, rgb: [1.0, 2.0, 3.0], weight: 1.0 });
    }
    film.deposit(&mut splats);
    film.clear_layer(0);
    assert_eq!(film.layer(0), [[0.0; 4]; 2]);
    assert_eq!(film.layer(1), [[0.0; 4], [1.0, 2.0, 3.0, 1.0]]);
}

const CATMULL_ROM: Filter = Filter::Mitchell { b: 0.0, c: 0.5 };

const FILTERS: [Filter; 11] = [
    Filter::Box,
    Filter::Tent { radius: 1.0 },
    Filter::Tent { radius: 0.3 },
    Filter::Tent { radius: 20.0 },
    Filter::Gaussian { stddev: 0.5 },
    Filter::Gaussian { stddev: 0.45 },
    Filter::Gaussian { stddev: 9.0 },
    Filter::Mitchell { b: 0.2, c: 0.7 },
    CATMULL_ROM,
    Filter::Lanczos { lobes: 3 },
    Filter::Lanczos { lobes: 16 },
];

/// Integrates by the midpoint rule over a regular grid of film positions; filters have bounded second derivatives
/// between a few kinks, so 400 points a pixel and axis leave errors below 10⁻⁴.
#[test]
fn a_constant_stays_that_constant_in_every_pixel() {
    for filter in FILTERS {
        for (width, height) in [(1, 1), (5, 3), (2, 7)] {
            let footprint = Footprint::new(filter, width, height);
            let mut pixels = vec![0f64; (width * height) as usize];
            let per_pixel = 400;
            let cell = 1.0 / f64::from(per_pixel * per_pixel);
            for y in 0..height * per_pixel {
                for x in 0..width * per_pixel {
                    let at = |i: u32| ((f64::from(i) + 0.5) / f64::from(per_pixel)) as f32;
                    footprint.spread(at(x), at(y), &mut |pixel, weight| {
                        assert!(weight >= 0.0 || filter.has_negative_lobes(), "{filter:?}: weight {weight}");
                        pixels[pixel as usize] += f64::from(weight) * cell;
                    });
                }
            }
            for (j, value) in pixels.iter().enumerate() {
                assert!((value - 1.0).abs() < 1e-4, "{filter:?}, {width} × {height}, pixel {j}: {value}");
            }
        }
    }
}

/// Far from borders the weights are h(x − x_j)/∫h themselves.
#[test]
fn inside_the_film_weights_are_the_normalised_filter() {
    let integral = |filter| match filter {
        Filter::Box => 1.0,
        Filter::Tent { radius } => f64::from(radius),
        Filter::Gaussian { stddev } => {
            let (s, edge) = (f64::from(stddev), (-8f64).exp());
            // ∫ exp(−x²/2σ²) over ±4σ is σ√(2π)·erf(2√2).
            s * (2.0 * PI).sqrt() * 0.999_936_657_516_33 - 8.0 * s * edge
        }
        Filter::Mitchell { .. } => 1.0,
        Filter::Lanczos { .. } => panic!("its integral has no closed form"),
    };
    for filter in [Filter::Box, Filter::Tent { radius: 1.0 }, Filter::Gaussian { stddev: 0.5 }, CATMULL_ROM] {
        let footprint = Footprint::new(filter, 11, 11);
        let mut dice = Dice(9);
        for _ in 0..1000 {
            let (x, y) = (4.0 + 3.0 * dice.uniform(), 4.0 + 3.0 * dice.uniform());
            let mut seen = [0f64; 121];
            footprint.spread(x, y, &mut |pixel, weight| seen[pixel as usize] += f64::from(weight));
            for (j, got) in seen.iter().enumerate() {
                let h = |x: f32, j: usize| filter.evaluate(f64::from(x) - j as f64 - 0.5) / integral(filter);
                let expected = h(x, j % 11) * h(y, j / 11);
                assert!((got - expected).abs() < 1e-5, "{filter:?} at ({x}, {y}), pixel {j}: {got} ≠ {expected}");
            }
        }
    }
}

/// White up to column 6 and black from there on, through the Catmull-Rom spline. A pixel is the integral of h over the
/// white side: ∫ h from ½ on is 31/384 and from 3/2 on −5/384, of 1 in all. What lies further is white or black.
#[test]
fn edges_swing_below_black_and_above_white() {
    let footprint = Footprint::new(CATMULL_ROM, 12, 1);
    let mut pixels = [0f64; 12];
    let (columns, rows) = (6 * 1000, 100);
    for (x, y) in (0..columns).flat_map(|x| (0..rows).map(move |y| (x, y))) {
        let [x, y] = [(x, 6.0 / columns as f32), (y, 1.0 / rows as f32)].map(|(i, step)| (i as f32 + 0.5) * step);
        footprint.spread(x, y, &mut |pixel, weight| {
            pixels[pixel as usize] += f64::from(weight) * 6.0 / f64::from(columns * rows);
        });
    }
    let expected =
        [384.0, 384.0, 384.0, 384.0, 389.0, 353.0, 31.0, -5.0, 0.0, 0.0, 0.0, 0.0].map(|share| share / 384.0);
    for (i, (got, expected)) in pixels.iter().zip(expected).enumerate() {
        assert!((got - expected).abs() < 1e-4, "pixel {i}: {got}, expected {expected}");
    }
}

/// Sums of values of both signs against those in double precision.
#[test]
fn weights_below_zero_count_on_the_film() {
    let footprint = Footprint::new(Filter::Lanczos { lobes: 3 }, 9, 7);
    let film = Accumulator::new(9, 7, 1, 1.0);
    let (mut splats, mut dice) = (Splats::new(1), Dice(4));
    let mut expected = vec![[0f64; 4]; 63];
    for _ in 0..2000 {
        let rgb = [dice.heavy(), dice.uniform(), 1.0];
        footprint.spread(9.0 * dice.uniform(), 7.0 * dice.uniform(), &mut |pixel, weight| {
            let splat = Splat { pixel, rgb: rgb.map(|value| value * weight), weight };
            splats.push(0, splat);
            let values = splat.rgb.into_iter().chain([weight]);
            expected[pixel as usize].iter_mut().zip(values).for_each(|(sum, value)| *sum += f64::from(value));
        });
    }
    assert!(splats.layer(0).iter().any(|splat| splat.weight < -1e-3), "some weights are negative");
    film.deposit(&mut splats);
    for (got, expected) in film.layer(0).as_flattened().iter().zip(expected.as_flattened()) {
        assert!((got - expected).abs() < 1e-9 * expected.abs().max(1.0), "{got}, expected {expected}");
    }
}

#[test]
fn the_far_border_and_corners_stay_inside() {
    for filter in FILTERS {
        let footprint = Footprint::new(filter, 4, 3);
        for (x, y) in [(0.0, 0.0), (4.0, 3.0), (3.999_999_8, 2.999_999_8), (0.0, 3.0)] {
            footprint
                .spread(x, y, &mut |pixel, weight| assert!(pixel < 12 && weight.is_finite(), "{filter:?} {pixel}"));
        }
    }
}

fn test_image(seed: u64) -> Image {
    let mut dice = Dice(seed);
    Image::new(13, 7, (0..13 * 7).map(|_| [dice.heavy(), dice.heavy(), dice.uniform()]).collect())
}

#[test]
fn an_exr_file_reads_back_bit_by_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    let image = test_image(1);
    let layers = [
        ("density".to_owned(), Plane::Gray(test_image(3).luminance())),
        ("uniform".to_owned(), Plane::Rgb(test_image(2))),
    ];
    let metadata = [
        ("a name that is longer than thirty-one characters".to_owned(), Value::from(0.1 + 0.2)),
        ("exposure".to_owned(), Value::from("not the camera's")),
        ("scene".to_owned(), Value::from("scenes/türe/scene.xml")),
        ("seed".to_owned(), Value::from(42.0)),
    ];
    exr_file::write(&path, &image, &layers, &metadata).unwrap();
    let read = exr_file::read_file(&path).unwrap();
    assert_eq!(read.image, image);
    assert_eq!(read.layers, layers);
    assert_eq!(read.metadata, metadata);
    assert_eq!(read.rgb("uniform"), Some(&test_image(2)));
    assert_eq!(read.rgb("density"), None);
}

#[test]
fn a_part_of_a_picture_says_where_it_lies() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.exr");
    let window = Window { whole: [40, 30], offset: [9, 5] };
    exr_file::write_part(&path, &test_image(1), PixelFormat::Rgb, window, &[], &[]).unwrap();
    assert_eq!(exr_file::read_file(&path).unwrap().image, test_image(1));
    let meta = exr::meta::MetaData::read_from_file(&path, true).unwrap();
    let header = &meta.headers[0];
    let (display, data) = (header.shared_attributes.display_window, header.data_window());
    assert_eq!((display.position.into(), display.size.into()), ((0, 0), (40, 30)));
    assert_eq!((data.position.into(), data.size.into()), ((9, 5), (13, 7)));
}

#[test]
fn an_image_without_colours_is_read_as_gray() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gray.exr");
    let gray = test_image(1).without_colour();
    let layers = [("variance".to_owned(), Plane::Rgb(test_image(2)))];
    exr_file::write_part(&path, &gray, PixelFormat::Luminance, Window::on_whole(13, 7), &layers, &[]).unwrap();
    let read = exr_file::read_file(&path).unwrap();
    assert_eq!(read.image, gray);
    assert_eq!(read.layers, layers);
}

#[test]
fn references_are_read_with_their_variance() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/reference.exr");
    let reference = exr_file::read_file(&path).unwrap();
    assert_eq!((reference.image.width, reference.image.height), (256, 256));
    // The means that reference.txt states.
    for (got, stated) in reference.image.mean().iter().zip([0.244355, 0.141455, 0.060014]) {
        assert!((got - stated).abs() < 1e-6, "{got} instead of {stated}");
    }
    let variance = reference.rgb("variance").expect("references carry their own variance");
    let rms: f64 = variance.mean().iter().sum::<f64>() / 3.0;
    assert!((rms.sqrt() - 2.17e-3).abs() < 1e-4, "{}", rms.sqrt());
}

#[test]
fn a_faulty_exr_file_is_refused_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.exr");
    let message = |path: &PathBuf| exr_file::read_file(path).unwrap_err().to_string();
    assert!(message(&path).contains("broken.exr"));
    std::fs::write(&path, b"no image at all").unwrap();
    assert!(message(&path).contains("broken.exr"));
    exr_file::write(&path, &test_image(1), &[], &[]).unwrap();
    let whole = std::fs::read(&path).unwrap();
    for length in [4, 100, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&path, &whole[..length]).unwrap();
        assert!(message(&path).contains("broken.exr"), "cut to {length} bytes");
    }
}

#[test]
fn a_png_preview_is_srgb() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.png");
    png_file::write(&path, &Image::new(2, 1, vec![[0.0, 0.18, 1.0], [0.5, -3.0, 9.0]])).unwrap();
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.width, info.height, info.color_type), (2, 1, png::ColorType::Rgb));
    assert_eq!(bytes, [0, 118, 255, 188, 0, 255]);
    assert!(reader.info().srgb.is_some());
}

#[test]
fn a_failed_write_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    exr_file::write(&path, &test_image(1), &[], &[]).unwrap();
    let before = std::fs::read(&path).unwrap();
    let failed = relt::film::file::write_whole(&path, |file| {
        std::io::Write::write_all(file, b"half an im").unwrap();
        Err("the power went out".to_owned())
    });
    let message = failed.unwrap_err().to_string();
    assert!(message.contains("image.exr") && message.contains("the power went out"), "{message}");
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn writing_replaces_the_old_file_with_ordinary_permissions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.png");
    std::fs::write(&path, b"old").unwrap();
    png_file::write(&path, &test_image(1)).unwrap();
    assert_ne!(std::fs::read(&path).unwrap(), b"old");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let plain = folder.path().join("plain");
        std::fs::write(&plain, b"").unwrap();
        let mode = |path: &PathBuf| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode(&path), mode(&plain));
    }
}

#[test]
fn what_cannot_be_written_is_known_beforehand() {
    let folder = tempfile::tempdir().unwrap();
    let check = |path: PathBuf| relt::film::file::check_writable(&path).map_err(|error| error.to_string());
    assert_eq!(check(folder.path().join("new.exr")), Ok(()));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    let missing = check(folder.path().join("nowhere/new.exr")).unwrap_err();
    assert!(missing.contains("there is no folder") && missing.contains("new.exr"), "{missing}");
    assert!(check(folder.path().to_owned()).unwrap_err().contains("it is a folder"));
}
