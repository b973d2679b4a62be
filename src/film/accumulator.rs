//! Exact accumulation of splats from many threads.
//!
//! A float sum depends on its order and stalls once it is 2²⁴ times its addends. Here every value becomes a whole
//! multiple of one power of two, and sums are 128-bit integers: the same splats give the same bits in any order,
//! from any number of threads, and none is too small beside what is already there.
//!
//! Threads bring a few thousand splats at a time. The film is cut into *bands* of consecutive pixels, each behind
//! its own lock; a deposit sorts its splats by band, then takes every lock at most once. A band that another
//! thread is working on is left for later, so threads rarely wait.

use std::hint::black_box;
use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

use crate::saved::{Source, Unfit, expect};

/// One contribution to one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Splat {
    /// Row-major index of the pixel.
    pub pixel: u32,
    /// Linear RGB, finite.
    pub rgb: [f32; 3],
    /// What the splat adds to the pixel's sample density, finite.
    pub weight: f32,
}

/// Splats of one block of chains, one list a layer, waiting to be deposited.
///
/// Meant to be kept by a worker: nothing is allocated once the lists have grown to their usual lengths.
#[derive(Clone, Debug, Default)]
pub struct Splats {
    layers: Vec<Vec<Splat>>,
    /// The splats of the layer at work, in order of band.
    sorted: Vec<Splat>,
    /// Where each band's splats end in `sorted`.
    ends: Vec<u32>,
    /// Bands that were busy when their turn came.
    postponed: Vec<u32>,
}

impl Splats {
    /// No splats, for an accumulator of as many layers.
    pub fn new(layers: usize) -> Splats {
        Splats { layers: vec![Vec::new(); layers], ..Splats::default() }
    }

    /// Number of layers.
    pub fn layers(&self) -> usize {
        self.layers.len()
    }

    /// Adds a splat to a layer.
    #[inline]
    pub fn push(&mut self, layer: usize, splat: Splat) {
        self.layers[layer].push(splat);
    }

    /// The splats waiting for a layer, in the order they came.
    pub fn layer(&self, layer: usize) -> &[Splat] {
        &self.layers[layer]
    }

    /// Number of splats waiting, all layers together.
    pub fn len(&self) -> usize {
        self.layers.iter().map(Vec::len).sum()
    }

    /// Whether none is waiting.
    pub fn is_empty(&self) -> bool {
        self.layers.iter().all(Vec::is_empty)
    }

    /// Forgets all splats; keeps the memory.
    pub fn clear(&mut self) {
        self.layers.iter_mut().for_each(Vec::clear);
    }

    /// Counting sort of one layer's splats by band into `sorted`, ends of the bands into `ends`.
    fn sort_by_band(&mut self, layer: usize, pixels: usize, band_shift: u32) {
        let splats = &self.layers[layer];
        self.ends.clear();
        self.ends.resize(pixels.div_ceil(1 << band_shift), 0);
        for splat in splats {
            assert!((splat.pixel as usize) < pixels, "splat on pixel {} of {pixels}", splat.pixel);
            self.ends[(splat.pixel >> band_shift) as usize] += 1;
        }
        let mut start = 0;
        for end in &mut self.ends {
            start += std::mem::replace(end, start);
        }
        self.sorted.resize(splats.len(), Splat::default());
        for splat in splats {
            // Each entry starts as its band's start and has walked to the band's end when the loop is over.
            let place = &mut self.ends[(splat.pixel >> band_shift) as usize];
            self.sorted[*place as usize] = *splat;
            *place += 1;
        }
    }
}

/// Bits below the unit that are kept. A value of 2⁻⁴⁷ units still has all 24 bits of its mantissa.
const FRACTION_BITS: i32 = 70;
/// The lowest bit of a weight, a plain number around 1, is 2⁻⁶⁰.
const WEIGHT_FRACTION_BITS: i32 = 60;
/// Cells that are read before any of them is added to. The reads do not wait for one another, so the memory serves
/// them side by side; an addition is long enough that the processor looks only two or three splats ahead. On a film
/// of 1024² pixels, larger than the caches, this takes 31 ns a splat instead of 85; on one of 256² it stays at 15.
const FETCHED_AT_ONCE: usize = 64;
/// Bands to have at least, so that threads seldom meet in one.
const LEAST_BANDS: usize = 64;
/// Most pixels a band may have: 4096 · 64 bytes stay within a core's own cache.
const MOST_PIXELS_A_BAND: usize = 4096;

/// Σ rgb and Σ weight of one pixel; one cache line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
struct Cell([i128; 4]);

/// Sums of splats, `width` × `height` × `layers`, exact and independent of order.
///
/// With e the least integer for which 2^e ≥ `unit`, a channel is kept in whole multiples of 2^(e − 70) (a bit
/// that lies lower is rounded away, half a step at most a splat) and holds up to 2^(e + 57): 10⁹ splats of
/// 2²⁷ units. Beyond that it stays at its largest value, and [`overflowed`](Accumulator::overflowed) tells.
pub struct Accumulator {
    layers: Vec<Vec<Mutex<Box<[Cell]>>>>,
    pixels: usize,
    /// log₂ of the pixels in a band.
    band_shift: u32,
    rgb: FixedPoint,
    weight: FixedPoint,
    overflowed: AtomicU64,
    /// Where the next deposit begins its walk over the bands.
    turn: AtomicUsize,
}

impl Accumulator {
    /// Memory that a pixel takes in each layer: red, green, blue and weight, 128 bits each.
    pub const BYTES_PER_PIXEL: usize = size_of::<Cell>();

    /// All sums zero. `unit` is a typical magnitude of the values to come (the scene's largest radiance, say); only
    /// the binary order of magnitude matters, and 0, as a black scene would give, counts as 1.
    ///
    /// # Panics
    /// If `unit` is negative or not finite, or the film has no pixels or more than 2³².
    pub fn new(width: u32, height: u32, layers: usize, unit: f64) -> Accumulator {
        assert!(unit.is_finite() && unit >= 0.0, "the unit of a film is {unit}");
        let pixels = width as usize * height as usize;
        assert!(pixels > 0 && u32::try_from(pixels - 1).is_ok(), "a film of {width} × {height}");
        let band = pixels.div_ceil(LEAST_BANDS).next_power_of_two().min(MOST_PIXELS_A_BAND);
        let bands = || {
            (0..pixels)
                .step_by(band)
                .map(|start| Mutex::new(vec![Cell::default(); band.min(pixels - start)].into_boxed_slice()))
                .collect()
        };
        Accumulator {
            layers: (0..layers).map(|_| bands()).collect(),
            pixels,
            band_shift: band.trailing_zeros(),
            rgb: FixedPoint::new(exponent(unit) - FRACTION_BITS),
            weight: FixedPoint::new(-WEIGHT_FRACTION_BITS),
            overflowed: AtomicU64::new(0),
            turn: AtomicUsize::new(0),
        }
    }

    /// Adds all splats, and clears them.
    ///
    /// # Panics
    /// If a pixel or a layer lies outside.
    pub fn deposit(&self, splats: &mut Splats) {
        assert_eq!(splats.layers.len(), self.layers.len(), "splats and film differ in their layers");
        let first_band = self.turn.fetch_add(1, Relaxed).wrapping_mul(0x9E37_79B9); // spreads threads over the film
        for (layer, bands) in self.layers.iter().enumerate() {
            if splats.layers[layer].is_empty() {
                continue;
            }
            splats.sort_by_band(layer, self.pixels, self.band_shift);
            let Splats { sorted, ends, postponed, .. } = &mut *splats;
            let of_band =
                |band: usize| &sorted[if band == 0 { 0 } else { ends[band - 1] as usize }..ends[band] as usize];
            postponed.clear();
            for i in 0..bands.len() {
                let band = (first_band.wrapping_add(i)) % bands.len();
                let mine = of_band(band);
                if mine.is_empty() {
                    continue;
                }
                match bands[band].try_lock() {
                    Ok(mut cells) => self.add(&mut cells, mine),
                    Err(TryLockError::Poisoned(poisoned)) => self.add(&mut poisoned.into_inner(), mine),
                    Err(TryLockError::WouldBlock) => postponed.push(band as u32),
                }
            }
            for &band in &*postponed {
                self.add(&mut locked(&bands[band as usize]), of_band(band as usize));
            }
        }
        splats.clear();
    }

    /// Adds the splats of one band to its cells.
    fn add(&self, cells: &mut [Cell], splats: &[Splat]) {
        let in_band = (1usize << self.band_shift) - 1;
        let mut overflowed = 0;
        for splats in splats.chunks(FETCHED_AT_ONCE) {
            black_box(splats.iter().fold(0, |any, splat| any ^ cells[splat.pixel as usize & in_band].0[0] as u64));
            for splat in splats {
                let Cell(sums) = &mut cells[splat.pixel as usize & in_band];
                let mut over = false;
                let [r, g, b] = splat.rgb;
                let channels = [(r, self.rgb), (g, self.rgb), (b, self.rgb), (splat.weight, self.weight)];
                let mut values = [0; 4];
                for ((sum, kept), (value, fixed)) in sums.iter_mut().zip(&mut values).zip(channels) {
                    // dark points and splats of one channel are common
                    if value != 0.0 {
                        *kept = fixed.fixed(value, &mut over);
                        let (total, beyond) = sum.overflowing_add(*kept);
                        *sum = total;
                        over |= beyond;
                    }
                }
                if over {
                    overflowed += 1;
                    saturate(sums, values);
                }
            }
        }
        if overflowed > 0 {
            self.overflowed.fetch_add(overflowed, Relaxed);
        }
    }

    /// Σ rgb and Σ weight of every pixel of a layer, row by row, each rounded once to the nearest `f64`.
    pub fn layer(&self, layer: usize) -> Vec<[f64; 4]> {
        let (rgb, weight) = (self.rgb.step(), self.weight.step());
        let mut sums = Vec::with_capacity(self.pixels);
        for band in &self.layers[layer] {
            sums.extend(
                locked(band)
                    .iter()
                    .map(|Cell([r, g, b, w])| [*r as f64 * rgb, *g as f64 * rgb, *b as f64 * rgb, *w as f64 * weight]),
            );
        }
        sums
    }

    /// The same with splats that are not on the film yet.
    pub fn layer_with(&self, layer: usize, pending: &Splats) -> Vec<[f64; 4]> {
        let mut sums = self.layer(layer);
        for splat in pending.layer(layer) {
            let [r, g, b] = splat.rgb;
            let sum = &mut sums[splat.pixel as usize];
            sum.iter_mut().zip([r, g, b, splat.weight]).for_each(|(s, v)| *s += f64::from(v));
        }
        sums
    }

    /// Number of splats that exceeded what a pixel holds, or were not finite; their pixels are not exact.
    pub fn overflowed(&self) -> u64 {
        self.overflowed.load(Relaxed)
    }

    /// Sets a layer's sums to zero.
    pub fn clear_layer(&self, layer: usize) {
        self.layers[layer].iter().for_each(|band| locked(band).fill(Cell::default()));
    }

    /// Writes all sums, exactly: number of layers, pixels and splats beyond the range, unit, then the sums layer by layer,
    /// each as short as it may be.
    pub fn save(&self, out: &mut dyn Write) -> io::Result<()> {
        for number in [self.layers.len() as u64, self.pixels as u64, self.overflowed(), self.rgb.exponent as u64] {
            out.write_all(&number.to_le_bytes())?;
        }
        let mut bytes = Vec::new();
        for band in self.layers.iter().flatten() {
            bytes.clear();
            locked(band).iter().flat_map(|Cell(sums)| sums).for_each(|sum| encode(*sum, &mut bytes));
            out.write_all(&(bytes.len() as u64).to_le_bytes())?;
            out.write_all(&bytes)?;
        }
        Ok(())
    }

    /// Takes the sums that [`save`](Self::save) wrote, of an accumulator of the same shape and unit.
    pub fn restore(&mut self, from: &mut Source) -> Result<(), Unfit> {
        let found = [from.number()?, from.number()?, from.number()?, from.number()?];
        let expected = [self.layers.len() as u64, self.pixels as u64, found[2], self.rgb.exponent as u64];
        expect(found == expected, "film")?;
        self.overflowed = AtomicU64::new(found[2]);
        let mut bytes = Vec::new();
        for band in self.layers.iter_mut().flatten() {
            let cells = band.get_mut().unwrap_or_else(PoisonError::into_inner);
            let length = from.number()?;
            let most = (cells.len() * size_of::<Cell>()) as u64 * 17 / 16; // with the first byte of each sum
            expect(length <= most, "film")?;
            bytes.resize(length as usize, 0);
            from.fill(&mut bytes)?;
            let mut rest = &bytes[..];
            for sum in cells.iter_mut().flat_map(|Cell(sums)| sums) {
                *sum = decode(&mut rest).ok_or_else(|| Unfit::damaged("its film ends too early"))?;
            }
            expect(rest.is_empty(), "film")?;
        }
        Ok(())
    }

    /// Bytes that [`save`](Self::save) writes at the least for a film of that shape: what a file that claims to hold one must
    /// have before memory is taken for it.
    pub fn fewest_bytes(pixels: u64, layers: u64) -> u64 {
        pixels.saturating_mul(layers).saturating_mul(4)
    }

    /// Adds another accumulator's sums; it must have the same shape and unit.
    pub fn merge(&self, other: &Accumulator) {
        assert_eq!((self.pixels, self.layers.len(), self.rgb), (other.pixels, other.layers.len(), other.rgb));
        for (band, others) in self.layers.iter().flatten().zip(other.layers.iter().flatten()) {
            let others = locked(others).clone(); // never two locks at once: `other` may be merging `self`
            for (Cell(sums), Cell(values)) in locked(band).iter_mut().zip(&others) {
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum = sum.saturating_add(*value);
                }
            }
        }
        self.overflowed.fetch_add(other.overflowed(), Relaxed);
    }
}

/// The lock's content, even if another thread panicked with it in hand: sums are never left half made.
fn locked(band: &Mutex<Box<[Cell]>>) -> MutexGuard<'_, Box<[Cell]>> {
    band.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Mends sums that `values` were just added to with wrap-around: each stops at the end of its range instead.
#[cold]
fn saturate(sums: &mut [i128; 4], values: [i128; 4]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum = sum.wrapping_sub(value).saturating_add(value);
    }
}

/// A first byte of this means that all sixteen follow.
const ALL_BYTES: u8 = 0xFF;

/// Appends an integer without the bytes that tell nothing: those of the sign at its upper end, and zeros at its lower
/// one, where splats of the usual size leave a third of the bits empty. A first byte has the number of such zeros in its
/// upper half and the number of bytes that are kept in its lower one. A sum takes 6 to 8 bytes in the place of 16.
fn encode(sum: i128, bytes: &mut Vec<u8>) {
    let zeros = if sum == 0 { 0 } else { sum.trailing_zeros() / 8 };
    let rest = sum >> (8 * zeros);
    let bits = 1 + i128::BITS - (if rest < 0 { !rest } else { rest }).leading_zeros(); // one of them the sign
    let kept = if sum == 0 { 0 } else { bits.div_ceil(8) };
    if kept > 15 {
        bytes.push(ALL_BYTES);
        bytes.extend(sum.to_le_bytes());
    } else {
        bytes.push((zeros << 4 | kept) as u8);
        bytes.extend(&rest.to_le_bytes()[..kept as usize]);
    }
}

/// Takes an integer that [`encode`] appended off the front; nothing where it is cut off or nonsense.
fn decode(bytes: &mut &[u8]) -> Option<i128> {
    let (&first, rest) = bytes.split_first()?;
    if first == ALL_BYTES {
        let (sum, rest) = rest.split_first_chunk()?;
        *bytes = rest;
        return Some(i128::from_le_bytes(*sum));
    }
    let (zeros, kept) = (u32::from(first >> 4), usize::from(first & 15));
    let (found, rest) = rest.split_at_checked(kept)?;
    let sign = found.last().map_or(0, |last| if last & 0x80 == 0 { 0 } else { 0xFF });
    let mut all = [sign; 16];
    all[..kept].copy_from_slice(found);
    *bytes = rest;
    let value = i128::from_le_bytes(all);
    (value << (8 * zeros) >> (8 * zeros) == value).then_some(value << (8 * zeros))
}

/// The least e with 2^e ≥ `unit`, kept to where `f32` values are; 0 for 0.
fn exponent(unit: f64) -> i32 {
    if unit == 0.0 {
        return 0;
    }
    const MANTISSA_BITS: u32 = f64::MANTISSA_DIGITS - 1;
    const BIAS: i32 = f64::MAX_EXP - 1;
    let above_power = i32::from(unit.to_bits() & ((1 << MANTISSA_BITS) - 1) != 0);
    let floor = (unit.to_bits() >> MANTISSA_BITS) as i32 - BIAS; // subnormal units end up at the clamp's floor
    (floor + above_power).clamp(f32::MIN_EXP - f32::MANTISSA_DIGITS as i32, f32::MAX_EXP)
}

/// Conversion of `f32` to whole multiples of 2^`exponent`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FixedPoint {
    exponent: i32,
}

/// An `f32` with exponent field E > 0 is its 24-bit mantissa times 2^(E − 150).
const F32_SCALE: i32 = 150;
/// Bits of an `f32` below its exponent.
const F32_FRACTION: u32 = f32::MANTISSA_DIGITS - 1;
/// The largest shift of a 24-bit mantissa that leaves an `i128` its sign.
const MOST_SHIFT: i32 = (i128::BITS - 1 - f32::MANTISSA_DIGITS) as i32;

impl FixedPoint {
    fn new(exponent: i32) -> FixedPoint {
        FixedPoint { exponent }
    }

    /// What 1 stands for.
    fn step(self) -> f64 {
        2f64.powi(self.exponent)
    }

    /// The nearest multiple. What is too large or not finite becomes ±`i128::MAX` and sets `over`.
    #[inline]
    fn fixed(self, value: f32, over: &mut bool) -> i128 {
        debug_assert!(value.is_finite(), "contributions are settled before they reach the film");
        let bits = value.to_bits();
        let field = (bits >> F32_FRACTION) & 0xFF;
        let shift = field as i32 - F32_SCALE - self.exponent;
        // Normal numbers that need no rounding, in two machine words; all else is rare and goes the long way.
        if field.wrapping_sub(1) < 0xFE && (0..=MOST_SHIFT).contains(&shift) {
            let mantissa = u64::from(bits & ((1 << F32_FRACTION) - 1) | 1 << F32_FRACTION);
            let magnitude = ((mantissa as u128) << shift) as i128;
            let sign = -i128::from(bits >> 31);
            (magnitude ^ sign) - sign
        } else {
            self.fixed_slowly(value, over)
        }
    }

    fn fixed_slowly(self, value: f32, over: &mut bool) -> i128 {
        if value == 0.0 {
            return 0;
        }
        let bits = value.to_bits();
        let field = (bits >> F32_FRACTION) as i32 & 0xFF;
        let hidden = u32::from(field > 0) << F32_FRACTION;
        let mantissa = i128::from(bits & ((1 << F32_FRACTION) - 1) | hidden);
        let shift = field.max(1) - F32_SCALE - self.exponent;
        let magnitude = match shift {
            0..=MOST_SHIFT if field < 0xFF => mantissa << shift,
            -30..0 => (mantissa + (1 << (-shift - 1))) >> -shift,
            ..-30 => 0, // less than 2²⁴⁻³⁰ steps
            _ => {
                *over = true;
                i128::MAX
            }
        };
        if value.is_sign_negative() { -magnitude } else { magnitude }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_one_cache_line_and_a_splat_twenty_bytes() {
        assert_eq!((size_of::<Cell>(), align_of::<Cell>(), size_of::<Splat>()), (64, 64, 20));
    }

    #[test]
    fn fixed_point_is_the_value_to_the_nearest_step() {
        for exponent in [-219, -170, -70, -60, 0, 58] {
            let fixed = FixedPoint::new(exponent);
            let limit = 2f64.powi(127);
            for value in sample_values() {
                let steps = f64::from(value) / fixed.step();
                let mut over = false;
                let got = fixed.fixed(value, &mut over);
                assert_eq!(over, steps.abs() >= limit, "{value:e} in steps of 2^{exponent}");
                if over {
                    assert_eq!(got.abs(), i128::MAX, "{value:e} in steps of 2^{exponent}");
                } else {
                    // An f32 over a power of two is exact in f64, and so is its rounding.
                    let expected = steps.abs().round().copysign(steps);
                    assert_eq!(got as f64, expected, "{value:e} in steps of 2^{exponent}");
                }
            }
        }
    }

    /// Powers of two over the whole range of `f32` with several mantissas and both signs, and the ends.
    fn sample_values() -> impl Iterator<Item = f32> {
        let mantissas = [0, 1, 0x40_0000, 0x55_5555, 0x7F_FFFF];
        (0..255u32).flat_map(move |e| mantissas.map(|m| f32::from_bits(e << F32_FRACTION | m))).flat_map(|v| [v, -v])
    }

    #[test]
    fn the_exponent_of_a_unit_covers_it() {
        for (unit, e) in [(1.0, 0), (1.5, 1), (2.0, 1), (18.4, 5), (0.25, -2), (0.3, -1), (0.0, 0), (1e-300, -149)] {
            assert_eq!(exponent(unit), e, "unit {unit}");
        }
        assert_eq!(exponent(f64::from(f32::MAX)), 128);
        assert_eq!(exponent(f64::MAX), 128);
    }

    #[test]
    fn a_billion_splats_of_two_to_the_27_units_fit() {
        let fixed = FixedPoint::new(exponent(1.0) - FRACTION_BITS);
        assert!(fixed.fixed(2f32.powi(27), &mut false).checked_mul(1_000_000_000).is_some());
    }

    #[test]
    fn too_much_saturates_and_is_counted() {
        let film = Accumulator::new(2, 1, 1, 1.0);
        let mut splats = Splats::new(1);
        for value in [2f32.powi(56), 2f32.powi(56), 1.0] {
            splats.push(0, Splat { pixel: 1, rgb: [value, 0.0, 1.0], weight: 1.0 });
        }
        splats.push(0, Splat { pixel: 0, rgb: [f32::MAX, 1.0, 1.0], weight: 1.0 });
        film.deposit(&mut splats);
        let sums = film.layer(0);
        let full = 2f64.powi(57);
        assert_eq!(sums[1], [full, 0.0, 3.0, 3.0]);
        assert_eq!(sums[0], [full, 1.0, 1.0, 1.0]);
        assert_eq!(film.overflowed(), 3);
    }

    #[test]
    fn every_integer_is_encoded_and_decoded() {
        let mut values = vec![0, 1, -1, i128::MAX, i128::MIN, 0x80, -0x80, 0xFF, 0x7F00, -0x100];
        for shift in 0..127 {
            for bits in [1i128, 0x55, 0x8000_0001, 0x0123_4567_89AB_CDEF] {
                values.extend([bits << shift, -(bits << shift), (bits << shift) - 1]);
            }
        }
        let mut bytes = Vec::new();
        values.iter().for_each(|value| encode(*value, &mut bytes));
        let mut rest = &bytes[..];
        for value in &values {
            assert_eq!(decode(&mut rest), Some(*value), "{value:#x}");
        }
        assert!(rest.is_empty());
        for length in 0..17 {
            let mut all = vec![ALL_BYTES];
            all.extend([1; 16]);
            assert_eq!(decode(&mut &all[..length]), None, "{length} of 17 bytes");
        }
    }

    #[test]
    fn a_saved_film_is_the_film_and_fits_no_other() {
        let mut splats = Splats::new(2);
        for i in 0..1000u32 {
            let rgb = [i as f32 * 0.1, -1e-9, f32::MAX];
            splats.push((i % 2) as usize, Splat { pixel: i * 7 % 150, rgb, weight: 0.7 });
        }
        let film = Accumulator::new(50, 3, 2, 4.0);
        film.deposit(&mut splats);
        let mut bytes = Vec::new();
        film.save(&mut bytes).unwrap();
        let restore = |film: &mut Accumulator, bytes: &[u8]| film.restore(&mut Source::new(bytes, bytes.len() as u64));
        let mut back = Accumulator::new(50, 3, 2, 4.0);
        restore(&mut back, &bytes).unwrap();
        assert_eq!((film.layer(0), film.layer(1)), (back.layer(0), back.layer(1)));
        assert_eq!(film.overflowed(), back.overflowed());
        assert!(bytes.len() as u64 >= Accumulator::fewest_bytes(150, 2));
        for mut other in
            [Accumulator::new(50, 3, 1, 4.0), Accumulator::new(5, 3, 2, 4.0), Accumulator::new(50, 3, 2, 8.0)]
        {
            assert!(restore(&mut other, &bytes).is_err());
        }
        for length in (0..bytes.len()).step_by(101) {
            assert!(restore(&mut back, &bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
        }
    }

    #[test]
    fn merging_equals_depositing_into_one() {
        let [a, b, both] = [(); 3].map(|()| Accumulator::new(5, 3, 2, 4.0));
        for i in 0..100u32 {
            let splat = Splat { pixel: i * 7 % 15, rgb: [i as f32 * 0.1, 1e-9, 3.3], weight: 0.7 };
            for film in [if i % 3 == 0 { &a } else { &b }, &both] {
                let mut splats = Splats::new(2);
                splats.push((i % 2) as usize, splat);
                film.deposit(&mut splats);
            }
        }
        a.merge(&b);
        assert_eq!(a.layer(0), both.layer(0));
        assert_eq!(a.layer(1), both.layer(1));
    }
}
