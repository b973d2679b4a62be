//! Engines do not notice how their sweeps are cut into slices, and know how precise they are.

use std::path::Path;

use super::{
    LadderChoice, Method, MltSettings, Normalisation, Parts, Settings,
    engine::{Counts, Engine, Stage},
    run::{engine, restored},
    shared::{Led, follow},
};
use crate::{
    embree::{Device, Width},
    film::{Footprint, Plane},
    path::{Mapping, MappingKind, Widths},
    ranks::threads::together,
    rng::Rng,
    saved::Source,
    scene::Scene,
    tempering::Estimate,
};

const MUTATIONS: u64 = 40_000;

/// Everything that can be seen of an engine, as bits.
fn bits(engine: &dyn Engine) -> Vec<u64> {
    let development = engine.develop();
    let mut planes = vec![development.image.pixels.as_flattened().to_vec()];
    planes.extend(development.layers.into_iter().map(|(_, plane)| match plane {
        Plane::Rgb(image) => image.pixels.into_flattened(),
        Plane::Gray(values) => values,
    }));
    let Counts { mutations, rays, faults, acceptance, swap, .. } = engine.counts();
    let estimate = development.normalisation.expect("every method has one");
    let numbers = [&acceptance[..], &swap[..], &[estimate.value, estimate.standard_error]].concat();
    let words = planes.concat().into_iter().map(|v| u64::from(v.to_bits())).chain([mutations, rays, faults.total()]);
    words.chain(numbers.into_iter().map(f64::to_bits)).collect()
}

/// Slices of lengths from `lengths`, over and over until all sweeps are done; a picture after each where `watched`.
fn run(stage: &Stage, settings: &Settings, lengths: &[u64], watched: bool) -> Vec<u64> {
    let mut engine = engine(stage, settings, Some(MUTATIONS));
    for length in lengths.iter().cycle() {
        if engine.sweeps_left() == Some(0) {
            break;
        }
        engine.advance(stage, *length, None);
        if watched {
            engine.develop();
        }
    }
    bits(engine.as_ref())
}

fn scene(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml");
    let description = crate::load::scene(&path, &[("res".into(), "24".into())]).unwrap();
    Scene::new(&Device::new("").unwrap(), description).unwrap()
}

fn stage(scene: &Scene) -> Stage<'_> {
    let widths = Widths { camera: Width::W8, bounce: Width::W8, shadow: Width::W8 };
    Stage {
        mapping: Mapping::new(scene, MappingKind::Unidirectional, widths),
        footprint: Footprint::new(scene.film.filter, scene.film.width, scene.film.height),
        rng: Rng::new(9),
    }
}

#[test]
fn before_chains_move_replica_exchange_is_a_path_tracer() {
    let scene = scene("cornell-box");
    let stage = stage(&scene);
    let picture = |method| {
        let settings = Settings { method, ..Settings::default() };
        let mut engine = engine(&stage, &settings, Some(MUTATIONS));
        engine.advance(&stage, 1, None);
        engine.develop().image
    };
    let image = picture(Method::ReplicaExchange);
    assert!(image.mean().iter().all(|channel| *channel > 0.01), "{:?}", image.mean());
    assert_eq!(image, picture(Method::Path));
}

/// Mean square of the reported standard errors of 32 runs (7 degrees of freedom or more each) against the variance of
/// what they estimate: F with 31 and 224 degrees of freedom lies in (0.3, 2.5) but for a probability of 2 · 10⁻⁴.
#[test]
fn the_normalisation_of_metropolis_varies_by_its_standard_error() {
    let scene = scene("cornell-box");
    for normalisation in Normalisation::ALL {
        let settings = Settings {
            method: Method::Mlt,
            mlt: MltSettings { normalisation, ..MltSettings::default() },
            ..Settings::default()
        };
        let estimates: Vec<Estimate> = (0..32)
            .map(|seed| {
                let stage = Stage { rng: Rng::new(seed), ..stage(&scene) };
                let mut engine = engine(&stage, &settings, Some(MUTATIONS));
                engine.advance(&stage, engine.sweeps_left().expect("a limited run"), None);
                engine.develop().normalisation.expect("every method has one")
            })
            .collect();
        let mean = estimates.iter().map(|e| e.value).sum::<f64>() / 32.0;
        let variance = estimates.iter().map(|e| (e.value - mean).powi(2)).sum::<f64>() / 31.0;
        let reported = estimates.iter().map(|e| e.standard_error.powi(2)).sum::<f64>() / 32.0;
        let f = variance / reported;
        assert!((0.3..2.5).contains(&f), "{normalisation:?}: {mean} varies by {variance:e}, said are {reported:e}");
    }
}

#[test]
fn a_run_gives_the_same_bits_however_it_is_sliced() {
    for name in ["cornell-box", "caustic", "lattice"] {
        let scene = scene(name);
        let stage = stage(&scene);
        let ladder = |k| Settings { ladder: LadderChoice::Replicas(k), ..Settings::default() };
        let plain = |method| Settings { method, ..Settings::default() };
        let mlt = MltSettings { large_steps: 0.5, normalisation: Normalisation::Pooled, kelemen_weights: true };
        let mlt = Settings { mlt, ..plain(Method::Mlt) };
        for settings in [plain(Method::Path), plain(Method::Mlt), mlt, ladder(2), ladder(5)] {
            let whole = run(&stage, &settings, &[u64::MAX], false);
            for (lengths, watched) in [(&[1][..], false), (&[7, 1, 40], true), (&[64, 64, 3], false)] {
                let sliced = run(&stage, &settings, lengths, watched);
                assert!(sliced == whole, "{name}, {settings:?}: slices of {lengths:?}, watched: {watched}");
            }
        }
    }
}

/// The same, saved after every slice and gone on with by another engine.
fn run_in_pieces(stage: &Stage, settings: &Settings, lengths: &[u64]) -> Vec<u64> {
    let mut engine = engine(stage, settings, Some(MUTATIONS));
    for length in lengths.iter().cycle() {
        if engine.sweeps_left() == Some(0) {
            break;
        }
        engine.advance(stage, *length, None);
        engine.take_reports();
        let mut bytes = Vec::new();
        engine.save(&mut bytes).unwrap();
        let mut source = Source::new(&bytes[..], bytes.len() as u64);
        let later = restored(&stage.sheet(), stage.rng, settings, Some(MUTATIONS), &mut source).unwrap();
        assert!(bits(later.as_ref()) == bits(engine.as_ref()), "{settings:?}: already at once");
        assert_eq!(format!("{:?}", later.counts()), format!("{:?}", engine.counts()), "{settings:?}");
        engine = later;
    }
    bits(engine.as_ref())
}

#[test]
fn a_run_that_is_saved_and_gone_on_with_gives_the_same_bits() {
    let scene = scene("lattice");
    for kind in MappingKind::ALL {
        let widths = Widths { camera: Width::W8, bounce: Width::W8, shadow: Width::W8 };
        for changes in [false, true] {
            if changes && kind != MappingKind::Multiplexed {
                continue;
            }
            let mapping = Mapping::new(&scene, kind, widths).with_technique_changes(changes);
            let stage = Stage { mapping, ..stage(&scene) };
            let ladder = |k| Settings { ladder: LadderChoice::Replicas(k), layers: true, ..Settings::default() };
            let plain = |method| Settings { method, ..Settings::default() };
            let mlt = MltSettings { large_steps: 0.5, normalisation: Normalisation::Pooled, kelemen_weights: true };
            let mlt = Settings { mlt, ..plain(Method::Mlt) };
            for settings in [plain(Method::Path), plain(Method::ReplicaExchange), mlt, ladder(5)] {
                let whole = run(&stage, &settings, &[u64::MAX], false);
                let pieces = run_in_pieces(&stage, &settings, &[1, 30, 150]);
                assert!(pieces == whole, "{kind:?}, changes {changes}, {settings:?}");
            }
        }
    }
}

/// Metropolis and replica exchange in two parts, brought together amid the run and at its end: the first rank has all that a run
/// alone has. Eleven ranks are more than there are blocks.
#[test]
fn ranks_come_to_the_bits_of_one_process_by_mlt_and_in_parts() {
    let scene = scene("cornell-box");
    let stage = stage(&scene);
    let saved = |engine: &dyn Engine| {
        let mut bytes = Vec::new();
        engine.save(&mut bytes).unwrap();
        bytes
    };
    let go = |engine: &mut dyn Engine| {
        engine.advance(&stage, u64::MAX, Some(MUTATIONS / 3));
        engine.gather();
        let amid = saved(engine);
        while engine.sweeps_left() != Some(0) {
            engine.advance(&stage, u64::MAX, None);
        }
        engine.gather();
        (amid, saved(engine), bits(engine))
    };
    let mlt = MltSettings { large_steps: 0.5, normalisation: Normalisation::Pooled, kelemen_weights: true };
    for (method, of) in [(Method::Mlt, 2), (Method::ReplicaExchange, 2)] {
        let settings = Settings { method, mlt, parts: Parts { of, only: None }, ..Settings::default() };
        let make = || engine(&stage, &settings, Some(MUTATIONS));
        let alone = go(make().as_mut());
        for count in [2, 11] {
            let shared = together(count, |company| match company.is_first() {
                true => Some(go(&mut Led::new(make(), company))),
                false => {
                    follow(make(), &stage, &company);
                    None
                }
            });
            let first = shared[0].as_ref().expect("the first comes to something");
            assert!(*first == alone, "{method:?} in {of} parts on {count} ranks");
        }
    }
}
