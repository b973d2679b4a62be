//! Chains, ladders and samplers on analytic targets, no scene needed: what is known exactly must come out.

mod baseline;
mod bits;
mod elsewhere;
mod exact;
mod health;
mod images;
mod kernels;
mod normalisers;
#[path = "../support/pssmlt.rs"]
mod pssmlt;
#[path = "../rendering/support/statistics.rs"]
mod statistics;
mod support;
mod swaps;
#[path = "../support/toys.rs"]
mod toys;
mod warnings;
