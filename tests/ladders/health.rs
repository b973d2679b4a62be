//! Whether what is said of a ladder's health is true, and its advice helps.

use relt::render::health::{Evidence, Health, Verdict, judge};
use relt::render::{LadderChoice, Method, Settings, Status};
use relt::tempering::{Choices, Combine};

use crate::support::{Square, replicas, sampler};

/// A run on a row of 16 pixels, judged.
fn judged(target: &Square<impl Fn(f32, f32) -> f32 + Sync>, choices: Choices, evaluations: u64) -> Health {
    let ladder = choices.ladder.clone();
    let mut sampler = sampler::<Square<fn(f32, f32) -> f32>>(choices, 16, evaluations, 5);
    while sampler.sweeps_left() != Some(0) {
        sampler.advance(target, u64::MAX, None);
    }
    let development = sampler.develop();
    let luminance = development.learnt.luminance;
    let status = Status {
        mutations: sampler.evaluations(),
        normalisation: Some((luminance.value, luminance.standard_error)),
        last_round: sampler.take_reports().pop().map(Into::into),
        ..Status::default()
    };
    let settings = Settings { method: Method::ReplicaExchange, ladder, ..Settings::default() };
    judge(&Evidence {
        settings: &settings,
        status: &status,
        pixels: 16,
        round: Some(&development.round),
        chains: None,
        contradiction: false,
    })
}

/// g = e^{s y²}, whose barrier is large where s is: the top of a narrow ridge, which no chain finds by itself from below.
fn ridge(s: f32) -> Square<impl Fn(f32, f32) -> f32 + Sync> {
    Square(move |_: f32, y: f32| (s * (y * y - 1.0)).exp())
}

/// Two rungs cannot exchange over a large barrier: that is told, and gone with the number of replicas that is advised.
#[test]
fn rungs_that_cannot_exchange_are_told_and_the_advice_helps() {
    let target = ridge(300.0);
    let bad = judged(&target, replicas(2, Combine::Target), 1 << 19);
    let swaps = |health: &Health| health.findings.iter().find(|f| f.what.contains("of their swaps")).cloned();
    let finding = swaps(&bad).unwrap_or_else(|| panic!("{bad:?}"));
    assert_eq!(finding.verdict, Verdict::Bad, "{bad:?}");
    let advised = finding.advice.split("--replicas ").nth(1).expect("a number of replicas");
    let advised: u32 = advised.split(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap();
    assert!(advised > 3, "{finding:?}");
    let better = judged(&target, replicas(advised, Combine::Target), 1 << 19);
    assert_eq!(swaps(&better), None, "{better:?}");
    assert!(better.verdict < Verdict::Bad, "{better:?}");
}

/// Healthy ladders are left alone, whatever their seed; those of the automatic choice too.
#[test]
fn ladders_that_work_are_left_alone() {
    let target = ridge(8.0);
    for choices in [replicas(4, Combine::Balance), Choices { ladder: LadderChoice::Auto, ..Choices::default() }] {
        let health = judged(&target, choices.clone(), 1 << 19);
        assert_eq!(health, Health::default(), "{choices:?}");
    }
}
