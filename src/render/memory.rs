//! Memory that a film takes, and whether it can be had: told before any of it is asked for.

use super::settings::{MappingChoice, Method, Settings};
use crate::chain::LargeSteps;
use crate::film::Accumulator;
use crate::memory::gigabytes;
pub use crate::memory::{available, space_left};
use crate::scene::description::FilmDescription;
use crate::tempering::{Choices, LadderChoice, Layers};

/// What the film of a run takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilmMemory {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Layers that sums are kept in.
    pub layers: usize,
    /// Bytes of these sums, all run long; of those of all parts that one process goes through.
    pub sums: u64,
    /// Bytes of them and of the picture that is made of them in the end.
    pub most: u64,
}

/// Sums of a layer as numbers, while a picture is made of them.
const BYTES_OF_PICTURE_A_LAYER: u64 = 32;
/// The picture, its density, and both again as they are written.
const BYTES_OF_PICTURE: u64 = 2 * (12 + 4);
/// Replicas where their number is free, at most two of which have layers of their own.
const REPLICAS: usize = 2;

/// Address space of a thread: a stack of 2 MiB, and an arena of the allocator of 64 MiB, for which glibc asks for 128 MiB
/// to find an aligned half. Very little of it is ever touched.
const SPACE_OF_A_THREAD: u64 = (2 + 128) << 20;
/// Address space that Embree and TBB take for their code and data (180 MiB of Embree 4.4), and what chains and tables may.
const SPACE_OF_EMBREE: u64 = 256 << 20;

impl FilmMemory {
    /// Of a run with those settings; of the mapping that takes most where a trial chooses it.
    pub fn of(film: &FilmDescription, settings: &Settings) -> FilmMemory {
        let elsewhere = match settings.mapping {
            MappingChoice::Auto => true,
            MappingChoice::Fixed(mapping) => mapping.splats_elsewhere(),
        };
        let layers = match settings.method {
            Method::Mlt => {
                let mlt = settings.mlt;
                LargeSteps { probability: mlt.large_steps, kelemen_weights: mlt.kelemen_weights }.layers()
            }
            Method::Path => Layers::of(&Choices::default(), 1, elsewhere).count,
            Method::ReplicaExchange => {
                let rungs = match &settings.ladder {
                    LadderChoice::Auto => REPLICAS,
                    LadderChoice::Replicas(k) => *k as usize,
                    LadderChoice::Betas(betas) => betas.len(),
                };
                Layers::of(&settings.ladder_choices(), rungs, elsewhere).count
            }
        };
        let pixels = u64::from(film.width) * u64::from(film.height);
        let films = settings.parts.numbers().count() as u64;
        let sums = films * pixels * (Accumulator::BYTES_PER_PIXEL * layers) as u64;
        let picture = pixels * (BYTES_OF_PICTURE_A_LAYER * layers as u64 + BYTES_OF_PICTURE);
        FilmMemory { size: [film.width, film.height], layers, sums, most: sums + picture }
    }

    /// Such as `16384 × 16384 pixels in 4 layers take 68.7 GB, 111.7 GB while the picture is made`.
    pub fn in_words(&self) -> String {
        let [width, height] = self.size;
        let layers = if self.layers == 1 { "layer" } else { "layers" };
        format!(
            "{width} × {height} pixels in {} {layers} take {}, {} while the picture is made",
            self.layers,
            gigabytes(self.sums),
            gigabytes(self.most)
        )
    }

    /// Why a run on so many threads cannot be had where only so much address space is left to be had; none if it can.
    pub fn fault_of_space(&self, threads: usize, left: u64) -> Option<String> {
        let of_threads = threads as u64 * SPACE_OF_A_THREAD;
        let all = self.most + of_threads + SPACE_OF_EMBREE;
        (all > left).then(|| {
            format!(
                "memory is short: the run takes up to {} of address space ({} for the film, {} for Embree and tables, {} for \
                 {threads} threads), and {} are left of its limit (ulimit -v); raise that, or use fewer --threads",
                gigabytes(all),
                gigabytes(self.most),
                gigabytes(SPACE_OF_EMBREE),
                gigabytes(of_threads),
                gigabytes(left)
            )
        })
    }

    /// Why the film cannot be had where only so much memory is to be had; none if it can.
    pub fn fault(&self, available: u64) -> Option<String> {
        (self.most > available).then(|| {
            format!(
                "the film is too large: {}, and {} are to be had; render it in parts (crop_width, crop_height), or with \
                 --method mlt, which keeps one layer",
                self.in_words(),
                gigabytes(available)
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Filter;
    use crate::path::MappingKind;
    use crate::render::Parts;

    #[test]
    fn films_take_what_their_layers_take() {
        let film = FilmDescription::new(16384, 16384, Filter::Box);
        let of = |method, mapping| {
            let settings = Settings { method, mapping: MappingChoice::Fixed(mapping), ..Settings::default() };
            FilmMemory::of(&film, &settings)
        };
        let memory = of(Method::Path, MappingKind::Unidirectional);
        assert_eq!((memory.layers, memory.sums), (1, 64 << 28), "sixteen bytes for each of four sums");
        assert_eq!(of(Method::Path, MappingKind::TwoWay).layers, 2);
        assert_eq!(of(Method::Mlt, MappingKind::TwoWay).layers, 1);
        assert!(of(Method::ReplicaExchange, MappingKind::TwoWay).layers > 2);
        let parts = Settings { parts: Parts { of: 3, only: None }, method: Method::Path, ..Settings::default() };
        let part = Settings { parts: Parts { of: 3, only: Some(2) }, ..parts.clone() };
        let [all, one] = [parts, part].map(|settings| FilmMemory::of(&film, &settings).sums);
        assert_eq!(all, 3 * one);
        let auto = FilmMemory::of(&film, &Settings::default());
        assert_eq!(auto, of(Method::ReplicaExchange, MappingKind::Bidirectional), "the mapping that takes most");
        assert!(memory.fault(memory.most).is_none());
        let fault = memory.fault(memory.most - 1).unwrap();
        assert!(fault.contains("16384 × 16384 pixels in 1 layer take 17.2 GB"), "{fault}");
    }

    #[test]
    fn limits_of_address_space_are_known_to_be_too_narrow() {
        let memory = FilmMemory::of(&FilmDescription::new(1000, 1000, Filter::Box), &Settings::default());
        let needed = memory.most + 2 * SPACE_OF_A_THREAD + SPACE_OF_EMBREE;
        assert!(memory.fault_of_space(2, needed).is_none());
        let fault = memory.fault_of_space(2, needed - 1).unwrap();
        assert!(fault.contains("0.3 GB for 2 threads") && fault.contains("ulimit -v"), "{fault}");
    }
}
