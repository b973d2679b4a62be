//! `Camera`, `Film`, `PixelFilter`, `Sampler` and `Integrator`.
//!
//! pbrt's camera looks along +z with +x to the right, Mitsuba's along +z with +x to the left: its place in the world is
//! pbrt's with x turned round. All other coordinates stay what they are.

use glam::{DAffine3, DMat3, DVec3};

use super::Converter;
use super::parameters::Parameters;
use crate::convert::notes::Notes;
use crate::convert::xml::Element;
use crate::load::faults::list;

/// What pbrt renders without a `Film`.
const SIZE: [i64; 2] = [1280, 720];

/// pbrt sees without end, Mitsuba's cameras only as far as this, 10,000 where nothing is said.
const FAR: f64 = 1e6;

/// Largest deviation of a window's aspect from the picture's that is not a stretch.
const ASPECT_TOLERANCE: f64 = 1e-3;

impl Converter<'_> {
    /// The sensor with its film and sampler.
    pub fn sensor(&self) -> Option<Element> {
        let Some((camera, from_world)) = &self.world.camera else {
            self.notes.fault(self.world.start.as_ref()?, "the scene has no Camera");
            return None;
        };
        let [width, height] = self.size();
        let aspect = width as f64 / height as f64;
        let is_orthographic = camera.kind == "orthographic";
        if !matches!(&camera.kind[..], "perspective" | "orthographic") {
            let known = list(&["orthographic", "perspective"]);
            self.notes
                .left_out(&camera.place, format!("camera {:?}: a perspective one is written; {known}", camera.kind));
            camera.quiet(&["lensfile", "aperturediameter", "aperture", "mapping"]);
        }
        let (placed, scale) = self.rigid(camera, *from_world)?;
        let window = self.window(camera, aspect);
        let mut sensor = if is_orthographic {
            orthographic(placed, scale, window)
        } else {
            self.perspective(camera, placed, scale, window)
        };
        self.shutter(camera);
        camera.finish(self.notes);
        sensor = sensor.holding(self.film(width, height)).holding(self.sampler());
        Some(sensor)
    }

    /// Mitsuba's place of the camera without its scale, and the scale.
    fn rigid(&self, camera: &Parameters, from_world: DAffine3) -> Option<(DAffine3, f64)> {
        let to_world = from_world.inverse();
        let columns = [to_world.matrix3.x_axis, to_world.matrix3.y_axis, to_world.matrix3.z_axis];
        let scale = columns[2].length();
        let is_even = columns.iter().all(|column| (column.length() / scale - 1.0).abs() < 1e-3);
        let is_square =
            [(0, 1), (1, 2), (2, 0)].iter().all(|(i, j)| columns[*i].dot(columns[*j]).abs() < 1e-3 * scale * scale);
        if !(is_even && is_square) {
            self.notes.fault(
                &camera.place,
                "the camera's transform stretches or shears; only an even scale can be converted",
            );
            return None;
        }
        let [x, y, z] = columns.map(|column| column / scale);
        Some((DAffine3::from_mat3_translation(DMat3::from_cols(-x, y, z), to_world.translation), scale))
    }

    /// The window of the screen that the film shows: left, right, bottom, top; the shorter side from −1 to 1.
    fn window(&self, camera: &Parameters, aspect: f64) -> [f64; 4] {
        let frame = camera.float("frameaspectratio").unwrap_or(aspect);
        let mut window = if frame > 1.0 { [-frame, frame, -1.0, 1.0] } else { [-1.0, 1.0, -1.0 / frame, 1.0 / frame] };
        if let Some([left, right, bottom, top]) = camera.floats("screenwindow") {
            window = [*left, *right, *bottom, *top];
        }
        let [left, right, bottom, top] = window;
        if !(left < right && bottom < top) {
            self.notes.fault(camera.place_of("screenwindow"), "the window has no area");
            return [-1.0, 1.0, -1.0, 1.0];
        }
        if ((right - left) / (top - bottom) / aspect - 1.0).abs() > ASPECT_TOLERANCE {
            let message = "pixels that are not square: the window's height is made to fit its width";
            self.notes.left_out(&camera.place, message);
            let (middle, half) = ((bottom + top) / 2.0, (right - left) / aspect / 2.0);
            window = [left, right, middle - half, middle + half];
        }
        window
    }

    /// `fov` is that of the screen's −1 to 1.
    fn perspective(&self, camera: &Parameters, to_world: DAffine3, scale: f64, window: [f64; 4]) -> Element {
        let fov = match (camera.float("fov"), camera.float("halffov")) {
            (_, Some(half)) => 2.0 * half,
            (Some(fov), None) => fov,
            (None, None) => 90.0,
        };
        if !(fov > 0.0 && fov < 180.0) {
            self.notes.fault(camera.place_of("fov"), format!("fov is {fov} degrees; it must lie between 0 and 180"));
        }
        let tangent = libm::tan(fov.to_radians() / 2.0);
        let [left, right, bottom, top] = window;
        let across = 2.0 * libm::atan(tangent * (right - left) / 2.0).to_degrees();
        let lens = camera.float("lensradius").unwrap_or(0.0);
        let distance = camera.float("focaldistance").unwrap_or(1e6);
        let mut sensor = if lens > 0.0 {
            Element::plugin("sensor", "thinlens")
                .float("aperture_radius", lens * scale)
                .float("focus_distance", distance * scale)
        } else {
            Element::plugin("sensor", "perspective")
        };
        sensor = sensor.transform("to_world", to_world).float("fov", across).string("fov_axis", "x");
        sensor = sensor.float("far_clip", FAR);
        // positive ones look to the right and down
        let offset = [(left + right) / 2.0 / (right - left), -(bottom + top) / 2.0 / (top - bottom)];
        if lens > 0.0 && offset.iter().any(|offset| offset.abs() > 1e-6) {
            let message = "the window's distance from the axis: Mitsuba's cameras with a lens look straight ahead";
            self.notes.left_out(camera.place_of("screenwindow"), message);
            return sensor;
        }
        for (name, offset) in ["principal_point_offset_x", "principal_point_offset_y"].into_iter().zip(offset) {
            if offset.abs() > 1e-6 {
                sensor = sensor.float(name, offset);
            }
        }
        sensor
    }

    fn shutter(&self, camera: &Parameters) {
        camera.quiet(&["shutteropen", "shutterclose"]);
    }

    /// `xresolution` and `yresolution`.
    fn size(&self) -> [i64; 2] {
        let Some(film) = &self.world.film else { return SIZE };
        let axis = |name: &str, default: i64| match film.integer(name) {
            Some(given) if (1..=65536).contains(&given) => given,
            Some(given) => {
                self.notes.fault(film.place_of(name), format!("{name} is {given} pixels; accepted: 1 to 65536"));
                default
            }
            None => default,
        };
        [axis("xresolution", SIZE[0]), axis("yresolution", SIZE[1])]
    }

    fn film(&self, width: i64, height: i64) -> Element {
        let mut element = Element::plugin("film", "hdrfilm").integer("width", width).integer("height", height);
        if let Some(film) = &self.world.film {
            let full = [0, width, 0, height];
            let crop = match (film.integers("pixelbounds").as_deref(), film.floats("cropwindow")) {
                (Some([x0, x1, y0, y1]), _) => [*x0, *x1, *y0, *y1],
                (_, Some([x0, x1, y0, y1])) => {
                    let edge = |part: f64, size: i64| (part * size as f64).ceil() as i64;
                    [edge(*x0, width), edge(*x1, width), edge(*y0, height), edge(*y1, height)]
                }
                _ => full,
            };
            let [x0, x1, y0, y1] = crop;
            if !(0 <= x0 && x0 < x1 && x1 <= width && 0 <= y0 && y0 < y1 && y1 <= height) {
                self.notes
                    .fault(&film.place, format!("the part {x0} to {x1}, {y0} to {y1} of {width} × {height} pixels"));
            } else if crop != full {
                element = element.integer("crop_offset_x", x0).integer("crop_offset_y", y0);
                element = element.integer("crop_width", x1 - x0).integer("crop_height", y1 - y0);
            }
            film.quiet(&[
                "filename",
                "savefp16",
                "diagonal",
                "iso",
                "sensor",
                "lambdamin",
                "lambdamax",
                "nbuckets",
                "coordinatesystem",
            ]);
            film.left_out("maxcomponentvalue", "bright samples are not clipped", self.notes);
            film.left_out("whitebalance", "colours are not balanced", self.notes);
            film.finish(self.notes);
        }
        element.string("pixel_format", "rgb").holding(self.filter())
    }

    fn filter(&self) -> Element {
        let Some(filter) = &self.world.filter else {
            // pbrt's own default, a Gaussian of σ 0.5 that ends at 1.5 pixels
            return Element::plugin("rfilter", "gaussian").float("stddev", 0.5);
        };
        let radius = |default: f64| {
            let [x, y] = ["xradius", "yradius"].map(|name| filter.float(name).unwrap_or(default));
            if x != y {
                self.notes.changed(&filter.place, "the filter is as wide as it is high: its xradius is taken");
            }
            x
        };
        let sigma = filter.float("sigma").unwrap_or(0.5);
        let element = match &filter.kind[..] {
            "box" => {
                if radius(0.5) != 0.5 {
                    self.notes.changed(&filter.place, "a box filter is one pixel wide");
                }
                Element::plugin("rfilter", "box")
            }
            "triangle" => Element::plugin("rfilter", "tent").float("radius", radius(2.0)),
            "gaussian" => {
                if (radius(1.5) / sigma - 4.0).abs() > 1.0 {
                    self.notes.changed(&filter.place, "the Gaussian filter ends at four times its sigma");
                }
                Element::plugin("rfilter", "gaussian").float("stddev", sigma)
            }
            "mitchell" => {
                if radius(2.0) != 2.0 {
                    self.notes.changed(&filter.place, "Mitchell's filter is two pixels wide on either side");
                }
                let [b, c] = ["B", "C"].map(|name| filter.float(name).unwrap_or(1.0 / 3.0));
                Element::plugin("rfilter", "mitchell").float("B", b).float("C", c)
            }
            "sinc" => {
                let lobes = filter.float("tau").unwrap_or(3.0);
                if radius(4.0) != lobes {
                    self.notes.changed(&filter.place, "Lanczos' filter ends with its last lobe");
                }
                Element::plugin("rfilter", "lanczos").integer("lobes", lobes.round().max(1.0) as i64)
            }
            other => {
                let known = list(&["box", "gaussian", "mitchell", "sinc", "triangle"]);
                self.notes.left_out(&filter.place, format!("filter {other:?}: a Gaussian one is written; {known}"));
                Element::plugin("rfilter", "gaussian")
            }
        };
        filter.finish(self.notes);
        element
    }

    /// Whatever the sampler is, samples are independent.
    fn sampler(&self) -> Element {
        let mut count = 16;
        if let Some(sampler) = &self.world.sampler {
            count = sampler.integer("pixelsamples").unwrap_or(count);
            if let (Some(x), Some(y)) = (sampler.integer("xsamples"), sampler.integer("ysamples")) {
                count = x.saturating_mul(y);
            }
            sampler.quiet(&["xsamples", "ysamples", "randomization", "seed", "jitter"]);
            if sampler.kind != "independent" {
                let message = format!("sampler {:?} becomes \"independent\" with as many samples", sampler.kind);
                self.notes.changed(&sampler.place, message);
            }
            sampler.finish(self.notes);
        }
        Element::plugin("sampler", "independent").integer("sample_count", count.max(1))
    }

    /// Paths of the same lengths: pbrt counts what scatters, Mitsuba edges, one more.
    pub fn integrator(&self) -> Element {
        let Some(integrator) = &self.world.integrator else {
            return Element::plugin("integrator", "path").integer("max_depth", 6);
        };
        let depth = integrator.integer("maxdepth").unwrap_or(5).clamp(0, 1_000_000) + 1;
        match &integrator.kind[..] {
            "path" | "volpath" => {}
            "simplepath" | "simplevolpath" | "bdpt" | "mlt" | "lightpath" | "randomwalk" => {
                let message =
                    format!("integrator {:?} becomes \"path\" with the same limit on path length", integrator.kind);
                self.notes.changed(&integrator.place, message);
            }
            other => {
                let message = format!("integrator {other:?}: it does not trace whole paths; \"path\" is written");
                self.notes.left_out(&integrator.place, message);
            }
        }
        integrator.left_out("regularize", "roughness is not raised after a bounce", self.notes);
        integrator.quiet(&["lightsampler", "samplelights", "samplebsdf", "visualizestrategies", "visualizeweights"]);
        integrator.quiet(&["bootstrapsamples", "chains", "mutationsperpixel", "largestepprobability", "sigma"]);
        integrator.quiet(&["photonsperiteration", "radius", "seed", "cossample", "maxdistance", "pixelbounds"]);
        integrator.finish(self.notes);
        Element::plugin("integrator", "path").integer("max_depth", depth)
    }
}

/// A parallel view: Mitsuba's is 2 wide before its transform.
fn orthographic(to_world: DAffine3, scale: f64, [left, right, bottom, top]: [f64; 4]) -> Element {
    let middle = DVec3::new(-(left + right) / 2.0, (bottom + top) / 2.0, 0.0) * scale;
    let half = (right - left) / 2.0 * scale;
    let own = DAffine3::from_translation(middle) * DAffine3::from_scale(DVec3::new(half, half, 1.0));
    Element::plugin("sensor", "orthographic").transform("to_world", to_world * own).float("far_clip", FAR)
}

/// How much brighter the film makes the picture than what meets it: exposure time times ISO over 100.
pub fn gain(film: Option<&Parameters>, camera: Option<&Parameters>, notes: &Notes) -> f64 {
    let number =
        |list: Option<&Parameters>, name: &str, default: f64| list.and_then(|list| list.float(name)).unwrap_or(default);
    let time = number(camera, "shutterclose", 1.0) - number(camera, "shutteropen", 0.0);
    let gain = time * number(film, "iso", 100.0) / 100.0;
    let Some(film) = film else { return gain };
    if let Some(sensor) = film.string("sensor").filter(|sensor| *sensor != "cie1931") {
        notes
            .left_out(film.place_of("sensor"), format!("the sensor {sensor:?}: colours are those of the CIE observer"));
    }
    if gain <= 0.0 {
        notes.fault(&film.place, format!("the film makes {gain} times the light of the picture"));
        return 1.0;
    }
    if gain != 1.0 {
        notes.changed(&film.place, format!("the film's gain of {gain} (exposure time and iso) goes into all lights"));
    }
    gain
}
