//! What may change the time of a run and never a bit of its result: threads, packets, how it is cut, who watches.

use relt::embree::Width;
use relt::film::{Image, Plane};
use relt::path::MappingKind;
use relt::render::{
    Combine, LadderChoice, MappingChoice, Method, MltSettings, Normalisation, Observer, Outcome, PacketChoice, Picture,
    Settings, Status,
};
use relt::scene::Scene;

use crate::support::{OWN, own, render, settings};

/// Mutations a pixel of 24 × 24 pixels: enough for a bootstrap and three rounds after it.
const MUTATIONS: f64 = 60.0;

/// All methods, ladders of two and of five rungs, both combinations; Metropolis as it is and with all its options; changes of
/// technique.
fn methods() -> Vec<Settings> {
    let of = |method| settings(method, MUTATIONS, 11);
    let re = |k, combine| Settings { ladder: LadderChoice::Replicas(k), combine, ..of(Method::ReplicaExchange) };
    let mlt = MltSettings { large_steps: 0.5, normalisation: Normalisation::Pooled, kelemen_weights: true };
    let mlt = Settings { mlt, ..of(Method::Mlt) };
    vec![
        of(Method::Path),
        of(Method::Mlt),
        mlt,
        re(2, Combine::Balance),
        re(5, Combine::Balance),
        re(5, Combine::Target),
        Settings {
            mapping: MappingChoice::Fixed(MappingKind::Multiplexed),
            technique_changes: true,
            ..re(3, Combine::Balance)
        },
    ]
}

fn scenes() -> Vec<(&'static str, Scene)> {
    OWN.into_iter().map(|name| (name, own(name, &[("res", "24")]))).collect()
}

/// Every number that a run comes to, but for times.
fn bits(outcome: &Outcome) -> Vec<u64> {
    let of_image =
        |image: &Image| image.pixels.as_flattened().iter().map(|v| u64::from(v.to_bits())).collect::<Vec<_>>();
    let mut bits = of_image(&outcome.picture.image);
    for (_, plane) in &outcome.picture.layers {
        match plane {
            Plane::Rgb(image) => bits.extend(of_image(image)),
            Plane::Gray(values) => bits.extend(values.iter().map(|v| u64::from(v.to_bits()))),
        }
    }
    let status = &outcome.status;
    bits.extend([status.mutations, status.rays, status.non_finite]);
    bits.extend(status.acceptance.iter().chain(&status.swap).map(|v| v.to_bits()));
    let (value, error) = status.normalisation.expect("a normalisation");
    bits.extend([value.to_bits(), error.to_bits()]);
    bits
}

/// Takes a picture after every slice.
struct Photographer;

impl Observer for Photographer {
    fn wants_picture(&self, _status: &Status) -> bool {
        true
    }

    fn snapshot(&self, _status: &Status, picture: &Picture) {
        assert!(picture.image.pixels.as_flattened().iter().all(|v| v.is_finite()));
    }
}

#[test]
fn threads_packets_and_watchers_do_not_change_a_bit() {
    for (name, scene) in scenes() {
        for settings in methods() {
            let with = |threads, width| Settings {
                threads: Some(threads),
                packet: PacketChoice::Fixed(width),
                ..settings.clone()
            };
            let expected = bits(&render(&scene, &with(1, Width::W1), &()));
            for (threads, width) in [(1, Width::W8), (2, Width::W1), (3, Width::W16)] {
                let got = bits(&render(&scene, &with(threads, width), &()));
                assert!(got == expected, "{name}: {threads} threads, width {width}: {settings:?}");
            }
            let got = bits(&render(&scene, &with(2, Width::W4), &Photographer));
            assert!(got == expected, "{name}: with a snapshot after every slice: {settings:?}");
        }
    }
}

#[test]
fn threads_and_packets_do_not_change_a_bit_of_subpaths_from_both_ends() {
    let scene = own("lattice", &[("res", "24")]);
    for mapping in [MappingKind::Bidirectional, MappingKind::Multiplexed].map(MappingChoice::Fixed) {
        for method in Method::ALL {
            let with = |threads, width| Settings {
                mapping,
                threads: Some(threads),
                packet: PacketChoice::Fixed(width),
                ..settings(method, MUTATIONS, 11)
            };
            let expected = bits(&render(&scene, &with(1, Width::W1), &()));
            let got = bits(&render(&scene, &with(2, Width::W8), &()));
            assert!(got == expected, "{} mapping, {}", mapping.name(), method.name());
        }
    }
}

#[test]
fn another_seed_gives_another_image() {
    let scene = own("cornell-box", &[("res", "24")]);
    for settings in methods() {
        let other = Settings { seed: 12, ..settings.clone() };
        assert!(bits(&render(&scene, &settings, &())) != bits(&render(&scene, &other, &())), "{settings:?}");
    }
}
