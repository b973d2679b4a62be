//! The inner loop allocates nothing: a run in full swing takes no memory from sweep to sweep.

#![expect(unsafe_code, reason = "an allocator that counts")]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    path::Path,
    sync::atomic::{AtomicU64, Ordering},
};

use relt::{
    embree::{Device, Width},
    film::Footprint,
    path::{Mapping, MappingKind, Widths},
    render::{
        self, LadderChoice, Method, Settings,
        engine::{Phase, Stage},
    },
    rng::Rng,
    scene::Scene,
};

/// The system's allocator, which counts how often it is asked for memory.
struct Counting;

static ASKED: AtomicU64 = AtomicU64::new(0);

// SAFETY: everything is left to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ASKED.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        ASKED.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ASKED.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.realloc(memory, layout, size) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Mutations of a run, and those that are gone through before anything is counted.
const PLANNED: u64 = 1 << 20;
const WARM: u64 = 1 << 18;
/// Of the image: so few pixels that many quarters of a pass, at whose ends histograms are handed over, lie in 16 sweeps.
const RESOLUTION: &str = "32";
/// Slices of each length, of which the one counts that asked least often: in others a round may have ended, or a state come
/// of a brightness that none had.
const SLICES: usize = 4;
/// So often, at most, may 16 sweeps more ask, in which some thousand batches are evaluated.
const BOUND: u64 = 256;

/// How often a run in full swing asks for memory in slices of 1 and of 17 sweeps.
fn asked(scene: &Scene, kind: MappingKind, method: Method) -> [u64; 2] {
    let widths = Widths { camera: Width::W8, bounce: Width::W8, shadow: Width::W8 };
    let mut settings = Settings { method, ..Settings::default() };
    if method == Method::ReplicaExchange {
        settings.ladder = LadderChoice::Replicas(4);
        settings.uniform_share = Some(0.5);
    }
    let film = scene.film;
    let stage = Stage {
        mapping: Mapping::new(scene, kind, widths),
        footprint: Footprint::new(film.filter, film.width, film.height),
        rng: Rng::new(0),
    };
    let mut engine = render::engine(&stage, &settings, Some(PLANNED));
    engine.set_wanted(None);
    while engine.phase() != Phase::Steady || engine.counts().mutations < WARM {
        engine.advance(&stage, 16, None);
    }
    [1, 17].map(|sweeps| {
        let slice = |_| {
            let before = ASKED.load(Ordering::Relaxed);
            assert_eq!(engine.advance(&stage, sweeps, None), sweeps, "the run is over");
            ASKED.load(Ordering::Relaxed) - before
        };
        (0..SLICES).map(slice).min().unwrap()
    })
}

#[test]
fn sweeps_take_no_memory() {
    let device = Device::new("").unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/caustic/scene.xml");
    let scene = Scene::new(&device, relt::load::scene(&path, &[("res".into(), RESOLUTION.into())]).unwrap()).unwrap();
    render::thread_pool(1, false).unwrap().install(|| {
        for kind in [MappingKind::Unidirectional, MappingKind::Bidirectional, MappingKind::Multiplexed] {
            for method in [Method::Path, Method::Mlt, Method::ReplicaExchange] {
                let [once, more] = asked(&scene, kind, method);
                eprintln!("{} by {}: {once}, {more}", kind.name(), method.name());
                assert!(more <= once + BOUND, "{} by {}: {once}, {more}", kind.name(), method.name());
            }
        }
    });
}
