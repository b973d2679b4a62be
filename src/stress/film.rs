//! Films of all shapes, with filters wider than they are, and larger than memory.

use super::{
    Bench, Case, Check,
    bench::{Effort, Goal, way},
    scenes::{self, diffuse, glowing, series, sphere, view},
};
use crate::film::Filter;
use crate::path::MappingKind;
use crate::render::{MappingChoice, Method, Settings, memory, memory::FilmMemory};
use crate::scene::description::FilmDescription;

const ALBEDO: f64 = 0.5;
const EDGES: i32 = 4;
/// Mutations of a run.
const MUTATIONS: f64 = 16384.0;
/// As many times more of light subpaths towards a film one pixel wide, of which few meet it: in the time of the others
/// path tracing knows the mean by them to 56 % (tolerance over mean), `mlt` to 106 %, `re` with three replicas to 181 %.
const LIGHT_ON_STRIPS: f64 = 16.0;

/// The cases.
pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (width, height) in [(1, 1), (1, 257), (257, 1), (3, 2)] {
        cases.push(
            Case::new(
                format!("film/{width}x{height}"),
                format!(
                    "a glowing sphere looks like Σ aⁱ on {width} × {height} pixels, through filters wider than that"
                ),
                move |bench| of_size(bench, width, height),
            )
            .quick_if((width, height) == (1, 1)),
        );
    }
    cases.extend([
        Case::new("film/crop", "one pixel of 4096 × 4096 of a glowing sphere looks like Σ aⁱ", crop).quick(),
        Case::new(
            "film/memory",
            "what 16384 × 16384 pixels take is known before, and refused where it is not to be had",
            too_large,
        )
        .quick(),
    ]);
    cases
}

/// A glowing sphere from inside, through that film.
fn scene(bench: &Bench, film: &str) -> crate::scene::Scene {
    let text = view(1.0, [[0.5, 0.3, -0.2], [0.9, 0.1, -0.5]], 80.0, EDGES)
        .replace(&scenes::film(12, 8), film)
        .replace("<sensor type='perspective'>", "<sensor type='perspective'><string name='fov_axis' value='larger'/>");
    bench.scene(&(text + &sphere([0.0; 3], 1.0, true, &(diffuse(ALBEDO) + &glowing(1.0)))))
}

fn of_size(bench: &Bench, width: u32, height: u32) -> Vec<Check> {
    let mutations_per_pixel = MUTATIONS / f64::from(width * height);
    let is_strip = width.max(height) > 16 * width.min(height);
    let mut checks = Vec::new();
    for filter in ["box", "gaussian", "mitchell", "lanczos"] {
        let film = scenes::film(width, height).replace("type='box'", &format!("type='{filter}'"));
        let scene = scene(bench, &film);
        // light subpaths give to pixels what filters spread beyond the film, which camera paths keep in it
        let ways = bench.ways(&scene).into_iter().filter(|way| match way.settings.mapping {
            MappingChoice::Fixed(mapping) => !mapping.splats_elsewhere() || filter == "box",
            MappingChoice::Auto => false,
        });
        let goal = Goal::new(series(ALBEDO, EDGES), 0.6);
        for way in ways {
            let is_light = way.settings.mapping == MappingChoice::Fixed(MappingKind::Light);
            let longer = if is_strip && is_light { LIGHT_ON_STRIPS } else { 1.0 };
            let effort = Effort { runs: 16, mutations_per_pixel: longer * mutations_per_pixel };
            checks.extend(bench.ways_give(&scene, &[way], goal, effort).into_iter().map(|check| check.of(filter)));
        }
    }
    checks
}

fn crop(bench: &Bench) -> Vec<Check> {
    let crop = "<integer name='crop_offset_x' value='1000'/><integer name='crop_offset_y' value='3000'/>
        <integer name='crop_width' value='1'/><integer name='crop_height' value='1'/><rfilter";
    let scene = scene(bench, &scenes::film(4096, 4096).replace("<rfilter", crop));
    let size = [scene.film.width, scene.film.height];
    // no light subpath in a million is seen by one pixel of millions
    let ways: Vec<_> = Method::ALL.map(|method| way(method, MappingKind::Unidirectional)).into();
    let goal = Goal::new(series(ALBEDO, EDGES), 0.3);
    let mut checks = bench.ways_give(&scene, &ways, goal, Effort { runs: 16, mutations_per_pixel: MUTATIONS });
    checks.push(Check::holds("the film has one pixel", size == [1, 1]));
    checks
}

fn too_large(_: &Bench) -> Vec<Check> {
    let film = FilmDescription::new(16384, 16384, Filter::Box);
    let mut checks = Vec::new();
    // four sums of sixteen bytes in a layer
    let a_layer = 16384.0 * 16384.0 * 64.0;
    for (mapping, layers) in [(MappingKind::Unidirectional, 1.0), (MappingKind::Bidirectional, 2.0)] {
        let settings = way(Method::Path, mapping).settings;
        let memory = FilmMemory::of(&film, &settings);
        checks.push(Check::exactly(format!("bytes of path, {}", mapping.name()), layers * a_layer, memory.sums as f64));
        checks.push(Check::holds("refused below that", memory.fault(memory.sums).is_some()));
        checks.push(Check::holds("granted above", memory.fault(2 * memory.sums).is_none()));
    }
    let small = FilmMemory::of(&FilmDescription::new(64, 64, Filter::Box), &Settings::default());
    let told = memory::available();
    checks.push(Check::holds("what can be had is told, on Linux", told.is_some() || !cfg!(target_os = "linux")));
    checks.push(Check::holds("a small film is granted", told.is_none_or(|available| small.fault(available).is_none())));
    checks
}
