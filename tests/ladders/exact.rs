//! The toys themselves: closed forms against many points.

use relt::tempering::Combine;

use crate::{
    statistics::{f_test, mean, t_test},
    support::{replicas, runs},
    toys,
};

/// Columns, c and the lit share of each of the six toys against 32 runs of 2¹⁵ stratified points: level 10⁻³ each, 0.02
/// together.
#[test]
fn closed_forms_of_the_toys_agree_with_points() {
    for toy in toys::table() {
        let runs = runs(&toy, &replicas(1, Combine::Balance), 8, 1 << 15, 32);
        let images: Vec<Vec<f64>> = runs.iter().map(|run| run.image.clone()).collect();
        let (f, p) = f_test(&images, &toy.columns(8), &[0.0; 8]);
        assert!(p > 1e-3, "{}: F = {f}, p = {p}, {:?}", toy.name, toy.columns(8));
        // f32 images of even points hardly vary where light is smooth
        let brightness: Vec<f64> = images.iter().map(|image| mean(image.iter().copied()) / toy.c()).collect();
        let (t, p) = t_test(&brightness, 1.0, 1e-12);
        assert!(p > 1e-3, "{}: t = {t}, p = {p}, {brightness:?}", toy.name);
        let lit: Vec<f64> = runs.iter().map(|run| run.learnt.density.lit_share()).collect();
        let (t, p) = t_test(&lit, toy.lit_share(), 1e-12);
        assert!(p > 1e-3, "{}: t = {t}, p = {p}, lit {lit:?}", toy.name);
        let columns: f64 = toy.columns(8).iter().sum();
        assert!((columns / 8.0 / toy.c() - 1.0).abs() < 1e-12, "{}", toy.name);
    }
}
