//! `<integrator>`: whatever the old one was, paths of the same lengths are traced.

use super::Context;
use super::document::Node;
use super::parameters::Parameters;
use super::parameters::Take::{Integer, Quiet};
use super::parameters::{Row, same};
use crate::convert::xml::Element;

const LENGTHS: &[Row] = &[same("max_depth", Integer), same("rr_depth", Integer)];

/// Settings of how to sample, which say nothing about the picture that all of these come to in the end.
const QUIET: &[Row] = &[
    same("strict_normals", Quiet),
    same("hide_emitters", Quiet),
    same("shading_samples", Quiet),
    same("emitter_samples", Quiet),
    same("bsdf_samples", Quiet),
    same("light_image", Quiet),
    same("sample_direct", Quiet),
    same("direct_samples", Quiet),
    same("direct_sampling", Quiet),
    same("separate_direct", Quiet),
    same("luminance_samples", Quiet),
    same("two_stage", Quiet),
    same("bidirectional", Quiet),
    same("bidirectional_mutation", Quiet),
    same("lens_perturbation", Quiet),
    same("caustic_perturbation", Quiet),
    same("multi_chain_perturbation", Quiet),
    same("manifold_perturbation", Quiet),
    same("lambda", Quiet),
    same("p_large", Quiet),
    same("max_chains", Quiet),
    same("chain_length", Quiet),
    same("num_chains", Quiet),
    same("granularity", Quiet),
    same("global_photons", Quiet),
    same("caustic_photons", Quiet),
    same("volume_photons", Quiet),
    same("photon_count", Quiet),
    same("max_passes", Quiet),
    same("initial_radius", Quiet),
    same("alpha", Quiet),
    same("resolution", Quiet),
    same("max_error", Quiet),
    same("p_value", Quiet),
    same("max_sample_factor", Quiet),
];

/// Integrators that trace complete paths, so that `path` comes to the same picture but for media.
const COMPLETE: &[&str] = &[
    "bdpt",
    "volpath",
    "volpath_simple",
    "volpathmis",
    "ptracer",
    "pssmlt",
    "mlt",
    "erpt",
    "photonmapper",
    "ppm",
    "sppm",
    "vpl",
];

/// Integrators around others.
const AROUND: &[&str] = &["adaptive", "irrcache", "multichannel", "moment"];

/// The new element.
pub fn convert(node: &Node, context: &Context) -> Element {
    let p = Parameters::new(node, context);
    if AROUND.contains(&node.plugin())
        && let [inner, ..] = p.nested(&["integrator"])[..]
    {
        let message = format!("integrator {:?}: what it is around is written alone", node.plugin());
        context.notes.changed(node.place_of("type"), message);
        return convert(inner, context);
    }
    let mut element = p.carry(LENGTHS, Element::plugin("integrator", "path"));
    let hides = p.boolean("hide_emitters") == Some(true);
    if hides {
        context.notes.left_out(p.place("hide_emitters"), "hide_emitters: lights are always seen");
    }
    p.carry(QUIET, Element::new("integrator"));
    match node.plugin() {
        "path" => {}
        "direct" | "directlighting" => {
            context.notes.changed(node.place_of("type"), "integrator \"direct\" becomes \"path\" with max_depth 2");
            element = element.integer("max_depth", 2);
        }
        name if COMPLETE.contains(&name) => {
            let message = format!("integrator {name:?} becomes \"path\" with the same limits on path length");
            context.notes.changed(node.place_of("type"), message);
        }
        name => {
            let message = format!("integrator {name:?}: it does not trace whole paths; \"path\" is written");
            context.notes.left_out(node.place_of("type"), message);
        }
    }
    p.finish();
    element
}
