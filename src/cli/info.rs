//! `relt info`: what a scene uses, and what is left out because it does not.

use std::collections::BTreeMap;
use std::io::{self, Write};

use clap::Args;

use super::failure::Failure;
use super::scene::{Opened, SceneArguments};
use crate::embree::{Device, Scene as Tracer};
use crate::film::{Accumulator, Filter, PixelFormat};
use crate::math;
use crate::path::{Layout, MappingKind};
use crate::render::trial;
use crate::scene::description::FilmDescription;
use crate::scene::{Appearance, Features, Kernel, Scene, materials};
use crate::tempering::{Choices, Layers};

/// Prints what a scene uses, and what is therefore left out
#[derive(Args)]
pub(super) struct Info {
    #[command(flatten)]
    scene: SceneArguments,
}

/// Runs the subcommand.
pub(super) fn run(arguments: Info) -> Result<(), Failure> {
    match arguments.scene.faults() {
        faults if faults.is_empty() => {}
        faults => return Err(Failure::Input(faults)),
    }
    let opened = arguments.scene.open(None, false)?;
    // Whoever reads may have read enough, as `head` does.
    drop(write!(io::stdout(), "{}", report(&opened)));
    Ok(())
}

/// One section after another, each with its name in the margin.
fn report(opened: &Opened) -> String {
    let Opened { device, scene, warnings } = opened;
    let sections = [
        ("film", film(&scene.film)),
        ("paths", paths(&scene.features)),
        ("shapes", shapes(&scene.features)),
        ("materials", materials(scene)),
        ("lights", lights(&scene.features)),
        ("mappings", mappings(&scene.features)),
        ("dimensions", dimensions(&scene.features)),
        ("kernel", kernel(&scene.features)),
        ("embree", embree(device, &scene.features)),
        ("warnings", warnings.clone()),
    ];
    let mut text = String::new();
    for (name, lines) in sections {
        for (i, line) in lines.iter().enumerate() {
            text += &format!("{:<12}{line}\n", if i == 0 { name } else { "" });
        }
    }
    text
}

fn film(film: &FilmDescription) -> Vec<String> {
    let filter = match film.filter {
        Filter::Box => "box filter: a sample goes to one pixel".into(),
        Filter::Tent { radius } => format!("tent filter of radius {radius}"),
        Filter::Gaussian { stddev } => format!("Gaussian filter of standard deviation {stddev}"),
        Filter::Mitchell { b, c } => format!("Mitchell filter with B = {b} and C = {c}"),
        Filter::Lanczos { lobes } => format!("Lanczos filter of {lobes} lobes"),
    };
    let [columns, rows] = film.window.whole;
    let part = match [film.width, film.height] == film.window.whole {
        true => String::new(),
        false => format!(
            " of {columns} × {rows}, from column {} and row {} on",
            film.window.offset[0], film.window.offset[1]
        ),
    };
    let format = match film.format {
        PixelFormat::Rgb => "",
        PixelFormat::Luminance => ", luminance alone",
    };
    let negative = match film.filter.has_negative_lobes() {
        true => " (pixels may be negative)",
        false => "",
    };
    let mebibytes = |layers: usize| {
        let bytes = film.width as usize * film.height as usize * Accumulator::BYTES_PER_PIXEL * layers;
        bytes as f64 / f64::from(1 << 20)
    };
    // of --method path, which is a ladder of one rung, and re
    let [[path, re], [path_elsewhere, re_elsewhere]] =
        [false, true].map(|elsewhere| [1, 2].map(|rungs| Layers::of(&Choices::default(), rungs, elsewhere).count));
    vec![
        format!("{} × {} pixels{part}, {filter}{negative}{format}", film.width, film.height),
        format!("memory: {:.1} MiB for path and mlt, {:.1} MiB for re", mebibytes(path), mebibytes(re)),
        format!(
            "memory with light subpaths: {:.1} MiB for mlt, {:.1} MiB for path, {:.1} MiB for re",
            mebibytes(1),
            mebibytes(path_elsewhere),
            mebibytes(re_elsewhere)
        ),
    ]
}

fn paths(features: &Features) -> Vec<String> {
    let longest = match features.integrator.max_depth {
        Some(1) => "1 edge: only lights seen directly".into(),
        Some(edges) => format!("up to {edges} edges"),
        None => "of any length".into(),
    };
    let roulette = match Layout::new(features, false).roulette_from() {
        Some(bounce) => format!("Russian roulette from bounce {} on", bounce + 1),
        None => "no Russian roulette".into(),
    };
    vec![format!("{longest}, {roulette}")]
}

fn shapes(features: &Features) -> Vec<String> {
    let counts = &features.shapes;
    used_and_left_out(&[
        (features.triangles, "triangles"),
        (counts.flat_meshes, "meshes without shading normals"),
        (counts.smooth_meshes, "meshes with shading normals"),
        (counts.spheres, "spheres"),
        (counts.disks, "disks"),
        (counts.cylinders, "cylinders"),
        (features.instances, "instances"),
    ])
}

fn lights(features: &Features) -> Vec<String> {
    used_and_left_out(&[
        (features.area_lights, "area"),
        (features.point_lights, "point or spot"),
        (features.directional_lights, "directional"),
        (features.infinite_lights, "constant or envmap"),
    ])
}

/// How many of each kind there are, and the kinds of which there is none.
fn used_and_left_out(kinds: &[(usize, &str)]) -> Vec<String> {
    let used: Vec<String> = kinds.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{what}: {n}")).collect();
    let unused: Vec<&str> = kinds.iter().filter(|(n, _)| *n == 0).map(|(_, what)| *what).collect();
    [used.join(", ")].into_iter().filter(|line| !line.is_empty()).chain(left_out(&unused)).collect()
}

fn left_out(what: &[&str]) -> Option<String> {
    (!what.is_empty()).then(|| format!("left out: {}", what.join(", ")))
}

/// The kinds of materials with their lobes.
fn materials(scene: &Scene) -> Vec<String> {
    let mut kinds = BTreeMap::new();
    for part in scene.appearances().iter().flat_map(Appearance::parts) {
        let material = &part.material;
        *kinds.entry((material.name(), material.lobes().in_words().join(" and "))).or_insert(0) += 1;
    }
    let used = kinds.iter().map(|((name, lobes), n)| format!("{n} {name}: {lobes}"));
    let unused: Vec<_> =
        materials::KNOWN.iter().copied().filter(|name| !scene.features.materials.contains_key(name)).collect();
    let variations = used_and_left_out(&[
        (scene.features.textures, "textures"),
        (scene.features.mixtures, "mixtures"),
        (scene.features.reliefs, "with bent normals"),
        (scene.features.anisotropic, "anisotropic"),
    ]);
    used.chain(left_out(&unused)).chain(variations).collect()
}

/// Which mappings make whole images of the scene, and the techniques that are of use in it.
fn mappings(features: &Features) -> Vec<String> {
    let names = |kinds: &[MappingKind]| kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ");
    let (whole, part): (Vec<_>, Vec<_>) =
        MappingKind::ALL.into_iter().partition(|kind| kind.misses(features).is_empty());
    let tried = names(&trial::candidates(features, MappingKind::Bidirectional));
    let mut lines = vec![format!("{}; auto tries {tried} or multiplexed", names(&whole))];
    lines.extend(
        part.iter()
            .map(|kind| format!("left out: {}, which lacks {}", kind.name(), kind.misses(features).join(" and "))),
    );
    let depth = Layout::new(features, false).max_depth();
    let lit = (features.area_lights + features.infinite_lights > 0, "no light has an extent");
    let smooth = (features.smooth_lobes, "all materials are perfect mirrors or glass");
    let longer = |edges: u16| (depth >= edges, "paths are too short");
    let techniques = [
        ("camera subpaths that hit lights", vec![lit]),
        ("next-event estimation", vec![smooth, longer(2)]),
        ("light subpaths connected to the camera", vec![smooth, longer(2)]),
        ("light subpaths joined to camera subpaths", vec![smooth, longer(3)]),
    ];
    let reason = |needs: &[(bool, &'static str)]| needs.iter().find(|(met, _)| !met).map(|(_, reason)| *reason);
    let used: Vec<&str> =
        techniques.iter().filter(|(_, needs)| reason(needs).is_none()).map(|(name, _)| *name).collect();
    if !used.is_empty() {
        lines.push(format!("techniques: {}", used.join(", ")));
    }
    lines.extend(
        techniques.iter().filter_map(|(name, needs)| Some(format!("left out: {name}, for {}", reason(needs)?))),
    );
    lines
}

/// Primary dimensions of the film position and, bounce by bounce, of the decisions there; the same of the light subpath,
/// where mappings have one.
fn dimensions(features: &Features) -> Vec<String> {
    let layout = Layout::new(features, false);
    let of_camera = layout.describe_camera();
    let mut lines =
        vec![runs(&of_camera).map(|run| format!("{}: {}", run[0], run.len())).collect::<Vec<_>>().join(", ")];
    // the last vertex of the longest paths decides nothing
    let bounces = layout.max_depth() - 1;
    lines.extend(by_bounce(features, bounces, |bounce| {
        (layout.describe(bounce), if layout.choices(bounce).is_some() { 2 } else { 1 })
    }));
    lines.push(format!("start of a light subpath, for all mappings but unidirectional: {}", drawn(&layout)));
    // and the last of a light subpath is one before, as that is connected to the camera
    lines.extend(
        by_bounce(features, bounces.saturating_sub(1), |bounce| (layout.describe_light(bounce), 1))
            .into_iter()
            .map(|line| format!("its {line}")),
    );
    lines.push(format!("multiplexed: {}; no roulette", drawn(&Layout::new(features, true))));
    let mut unused = Vec::new();
    for (needed, what) in [
        (features.lens, "lens"),
        (features.lobe_choice, "choice of lobe"),
        (features.light_choice(), "choice of light"),
        (layout.roulette_from().is_some(), "roulette"),
    ] {
        if !needed {
            unused.push(what);
        }
    }
    lines.extend(left_out(&unused));
    lines
}

/// What the start of a light subpath takes.
fn drawn(layout: &Layout) -> String {
    let blocks = if layout.light_choices().is_some() { 2 } else { 1 };
    dimensions_and_blocks(&layout.describe_emission(), blocks)
}

/// A line for the bounces before roulette and one for those with it: names of dimensions and the blocks they are drawn in.
fn by_bounce(features: &Features, bounces: u16, describe: impl Fn(u16) -> (Vec<&'static str>, usize)) -> Vec<String> {
    let with_roulette = Layout::new(features, false).roulette_from();
    let mut firsts: Vec<u16> =
        [Some(0), with_roulette].into_iter().flatten().filter(|first| *first < bounces).collect();
    firsts.dedup();
    let line = |(i, &first): (usize, &u16)| {
        let next = firsts.get(i + 1).copied();
        let range = match next.or(features.integrator.max_depth.map(|_| bounces)) {
            Some(next) if next == first + 1 => format!("bounce {next}"),
            Some(next) => format!("bounces {} to {next}", first + 1),
            None => format!("bounces from {} on", first + 1),
        };
        let (names, blocks) = describe(first);
        format!("{range}: {}", dimensions_and_blocks(&names, blocks))
    };
    firsts.iter().enumerate().map(line).collect()
}

/// `3 (direction 2, roulette 1), drawn in one block of four`
fn dimensions_and_blocks(names: &[&'static str], blocks: usize) -> String {
    let blocks = if blocks > 1 { "two blocks" } else { "one block" };
    format!("{} ({}), drawn in {blocks} of four", names.len(), counted(names))
}

/// `direction 2, roulette 1`: names that follow each other, with how often each does.
fn counted(names: &[&'static str]) -> String {
    runs(names).map(|run| format!("{} {}", run[0], run.len())).collect::<Vec<_>>().join(", ")
}

/// Names that follow each other and are the same.
fn runs<'a>(names: &'a [&'static str]) -> impl Iterator<Item = &'a [&'static str]> {
    names.chunk_by(|a, b| a == b)
}

/// What the kernels for flat meshes lack.
const BEYOND_FLAT: &str = "shading normals, spheres, disks, cylinders, instances, background, points";
/// What the kernels for surfaces that do not vary lack.
const BEYOND_PLAIN: &str = "textures, mixtures of materials, bent normals, tangents";

fn kernel(features: &Features) -> Vec<String> {
    let mut lines = match features.kernel() {
        Kernel::Diffuse => vec![
            "diffuse: diffuse materials on flat meshes, lit by meshes".to_owned(),
            format!("left out: choice of material and lobe, delta lobes, {BEYOND_FLAT}"),
        ],
        Kernel::Flat => vec![
            format!("flat, for the scene has {}", features.beyond_diffuse().join(", ")),
            format!("left out: {BEYOND_FLAT}, {BEYOND_PLAIN}"),
        ],
        Kernel::Plain => vec![
            format!("plain, for the scene has {}", features.beyond_diffuse().join(", ")),
            format!("left out: {BEYOND_PLAIN}"),
        ],
        Kernel::Full => vec![format!("full, for the scene has {}", features.beyond_plain().join(", "))],
    };
    lines.push(format!("loops over lanes in the instructions of this processor: {}", math::in_use()));
    lines
}

fn embree(device: &Device, features: &Features) -> Vec<String> {
    let native: Vec<String> = device.native_widths().iter().map(ToString::to_string).collect();
    let mut lines = vec![
        device.description(),
        format!("{}; packets native to this processor: {}", Tracer::BUILT_WITH, native.join(", ")),
    ];
    if features.shapes.quadrics() == 0 {
        lines.push("left out: user geometry".to_owned());
    }
    lines
}
