//! `LightSource` and `AreaLightSource`.
//!
//! pbrt scales every light's spectrum to luminance 1 before its `scale`; RGB values stay what they are by that.

use std::f64::consts::PI;
use std::rc::Rc;

use glam::{DAffine3, DMat3, DVec3};

use super::Converter;
use super::environment::{FROM_MITSUBA, by_longitude, illuminance};
use super::parameters::Parameters;
use super::spectra::{self, Of};
use super::textures::upside_down;
use crate::convert::Rgb;
use crate::convert::textures::{Picture, Pixels, Texture, Use, Wrap};
use crate::convert::xml::Element;
use crate::film::image::relative_luminance;
use crate::load::faults::{did_you_mean, list};

type Make = fn(&Converter, &Parameters, DAffine3) -> Option<Element>;

const LIGHTS: &[(&str, Make)] = &[("point", point), ("distant", distant), ("spot", spot), ("infinite", infinite)];

impl Converter<'_> {
    /// The emitter of a light source, or nothing where there is none like it.
    pub fn light(&self, light: &Parameters, to_world: DAffine3) -> Option<Element> {
        let Some((_, make)) = LIGHTS.iter().find(|(known, _)| *known == light.kind) else {
            let known: Vec<&str> = LIGHTS.iter().map(|(known, _)| *known).collect();
            let near = did_you_mean(&light.kind, &known);
            let message =
                format!("light source {:?}: not one that both renderers have{near}; {}", light.kind, list(&known));
            self.notes.left_out(&light.place, message);
            return None;
        };
        let emitter = make(self, light, to_world);
        light.finish(self.notes);
        emitter
    }

    /// The colour of a light, scaled; `by_power` is the factor that an intended power asks for.
    fn emission(&self, light: &Parameters, name: &str, by_power: f64) -> Rgb {
        let scale = light.float("scale").unwrap_or(1.0) * by_power * self.gain;
        spectra::colour(light, name, Of::Light, self.notes).unwrap_or([1.0; 3]).map(|value| value * scale)
    }

    /// `power` over the power of the light with its scale as it is given.
    fn by_power(&self, light: &Parameters, name: &str, of_one: f64) -> f64 {
        match light.float(name) {
            Some(wanted) if wanted > 0.0 && of_one > 0.0 => wanted / of_one,
            _ => 1.0,
        }
    }

    /// The emitter inside a shape of that area, in the world; `map` leads its texture coordinates to pbrt's.
    pub fn area_light(&self, light: &Parameters, area: f64, map: glam::DAffine2) -> Option<Element> {
        if light.kind != "diffuse" {
            self.notes.left_out(&light.place, format!("area light {:?}; known: diffuse", light.kind));
            return None;
        }
        let sides = if light.boolean("twosided") == Some(true) { 2.0 } else { 1.0 };
        let emitter = Element::plugin("emitter", "area");
        let emitter = match light.file("filename", self.notes) {
            None => {
                let by_power = self.by_power(light, "power", PI * area * sides);
                emitter.rgb("radiance", self.emission(light, "L", by_power))
            }
            Some(path) => {
                let picture = Texture::Picture(Picture {
                    pixels: Pixels::File { path, raw: false },
                    to_uv: upside_down() * map,
                    is_nearest: true,
                    wrap: Wrap::Clamp,
                });
                let radiance = self.picture_radiance(light, &picture, area * sides);
                emitter.holding(radiance.element("radiance", Use::Colour, self.files))
            }
        };
        light.finish(self.notes);
        Some(emitter)
    }

    /// A picture that shines, times its scale.
    fn picture_radiance(&self, light: &Parameters, picture: &Texture, area: f64) -> Texture {
        let mean = |texture: &Texture| match texture {
            Texture::Picture(Picture { pixels: Pixels::File { path, raw }, .. }) => {
                self.files.read_picture(path, *raw).map(|image| relative_luminance(image.mean()))
            }
            _ => Ok(1.0),
        };
        let by_power = match light.float("power") {
            Some(_) => mean(picture).map(|mean| self.by_power(light, "power", PI * area * mean)),
            None => Ok(1.0),
        };
        let scaled = by_power.and_then(|by_power| {
            let scale = light.float("scale").unwrap_or(1.0) * by_power * self.gain;
            if scale == 1.0 { Ok(picture.clone()) } else { picture.map(self.files, &|rgb| rgb.map(|v| v * scale)) }
        });
        scaled.unwrap_or_else(|message| {
            self.notes.left_out(&light.place, format!("scale and power of a light's picture: {message}"));
            picture.clone()
        })
    }
}

fn point(c: &Converter, light: &Parameters, to_world: DAffine3) -> Option<Element> {
    let position = to_world.transform_point3(light.point("from").unwrap_or(DVec3::ZERO));
    let by_power = c.by_power(light, "power", 4.0 * PI);
    Some(
        Element::plugin("emitter", "point")
            .point("position", position)
            .rgb("intensity", c.emission(light, "I", by_power)),
    )
}

fn distant(c: &Converter, light: &Parameters, to_world: DAffine3) -> Option<Element> {
    let (from, to) = (light.point("from").unwrap_or(DVec3::ZERO), light.point("to").unwrap_or(DVec3::Z));
    let Some(direction) = to_world.transform_vector3(to - from).try_normalize() else {
        c.notes.fault(&light.place, "the light has no direction: from and to are the same");
        return None;
    };
    let by_power = c.by_power(light, "illuminance", 1.0);
    let irradiance = c.emission(light, "L", by_power);
    Some(Element::plugin("emitter", "directional").vector("direction", direction).rgb("irradiance", irradiance))
}

/// pbrt's falls off smoothly in the cosine, Mitsuba's linearly in the angle.
fn spot(c: &Converter, light: &Parameters, to_world: DAffine3) -> Option<Element> {
    let (from, to) = (light.point("from").unwrap_or(DVec3::ZERO), light.point("to").unwrap_or(DVec3::Z));
    let (cone, delta) = (light.float("coneangle").unwrap_or(30.0), light.float("conedeltaangle").unwrap_or(5.0));
    let place = to_world.transform_point3(from);
    let Some(axis) = to_world.transform_vector3(to - from).try_normalize() else {
        c.notes.fault(&light.place, "the light has no direction: from and to are the same");
        return None;
    };
    if !(cone > 0.0 && delta >= 0.0 && delta < cone) {
        c.notes.fault(
            &light.place,
            format!("a cone of {cone}° that falls off over {delta}°; expected 0 ≤ {delta} < {cone}"),
        );
        return None;
    }
    if delta > 0.0 {
        c.notes.changed(
            &light.place,
            "between its two cones the spot falls off linearly in the angle, not smoothly in its cosine",
        );
    }
    let [outer, inner] = [cone, cone - delta].map(|degrees| libm::cos(degrees.to_radians()));
    let by_power = c.by_power(light, "power", 2.0 * PI * ((1.0 - inner) + (inner - outer) / 2.0));
    let across = axis.any_orthonormal_vector();
    let frame = DMat3::from_cols(across, axis.cross(across), axis);
    Some(
        Element::plugin("emitter", "spot")
            .transform("to_world", DAffine3::from_mat3_translation(frame, place))
            .rgb("intensity", c.emission(light, "I", by_power))
            .float("cutoff_angle", cone)
            .float("beam_width", cone - delta),
    )
}

/// Largest environment that is converted. What is made of it has twice as many pixels, each of sixteen samples.
const MOST_PIXELS_ACROSS: u32 = 8192;

fn infinite(c: &Converter, light: &Parameters, to_world: DAffine3) -> Option<Element> {
    light.left_out(
        "portal",
        "a portal only makes pbrt's picture less noisy, or hides light that is not behind it",
        c.notes,
    );
    let Some(path) = light.file("filename", c.notes) else {
        let by_power = c.by_power(light, "illuminance", PI);
        return Some(Element::plugin("emitter", "constant").rgb("radiance", c.emission(light, "L", by_power)));
    };
    let square = match c.files.read_picture(&path, false) {
        Ok(square) if square.width == square.height && square.width <= MOST_PIXELS_ACROSS => square,
        Ok(other) => {
            let message = format!(
                "{}: {} × {} pixels; pbrt's environments are square, and accepted up to {MOST_PIXELS_ACROSS} each way",
                path.display(),
                other.width,
                other.height
            );
            c.notes.fault(light.place_of("filename"), message);
            return None;
        }
        Err(message) => {
            c.notes.left_out(light.place_of("filename"), format!("the environment: {message}"));
            return None;
        }
    };
    let scale = light.float("scale").unwrap_or(1.0) * c.gain * c.by_power(light, "illuminance", illuminance(&square));
    // a mirror is put into the picture, so that the map into the world only turns
    let to_light = to_world.matrix3 * FROM_MITSUBA;
    let mirror =
        if to_light.determinant() < 0.0 { DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)) } else { DMat3::IDENTITY };
    let picture = Rc::new(by_longitude(&square, FROM_MITSUBA * mirror));
    let turn = to_light * mirror;
    let turn = DMat3::from_cols(turn.x_axis.normalize(), turn.y_axis.normalize(), turn.z_axis.normalize());
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Some(
        Element::plugin("emitter", "envmap")
            .string("filename", &c.files.picture(&stem, &picture))
            .float("scale", scale)
            .transform("to_world", DAffine3::from_mat3(turn)),
    )
}
