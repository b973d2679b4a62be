//! `Texture`: images, checkerboards, and arithmetic with them.

use glam::{DAffine2, DVec2};

use super::Converter;
use super::parameters::{Parameter, Parameters};
use super::spectra::{self, COLOURS, Of};
use super::world::TextureKind;
use crate::convert::Rgb;
use crate::convert::textures::{Picture, Pixels, Texture, Wrap, uv_map};
use crate::load::faults::{did_you_mean, list};

/// Most textures inside one another; more refer to themselves.
const MAX_NESTING: usize = 32;

/// pbrt looks images up with (0, 0) at the lower left, Mitsuba at the upper left.
pub fn upside_down() -> DAffine2 {
    uv_map(DVec2::new(1.0, -1.0), DVec2::Y)
}

impl Converter<'_> {
    /// A parameter that is a colour, a number or the name of a texture.
    pub fn texture(&self, parameters: &Parameters, name: &str, kind: TextureKind) -> Option<Texture> {
        self.texture_at(parameters, name, kind, 0)
    }

    fn texture_at(&self, parameters: &Parameters, name: &str, kind: TextureKind, depth: usize) -> Option<Texture> {
        let kinds: &[&str] = if kind == TextureKind::Float {
            &["float", "texture"]
        } else {
            &["rgb", "spectrum", "blackbody", "texture"]
        };
        let parameter = parameters.get(name, kinds)?;
        if parameter.kind == "texture" {
            return self.named(parameter, kind, depth);
        }
        let value = spectra::value(parameter, Of::Surface, self.notes);
        debug_assert!(COLOURS.contains(&&parameter.kind[..]));
        value
            .map(Texture::Constant)
            .map_err(|message| self.notes.fault(&parameter.place, format!("{name}: {message}")))
            .ok()
    }

    /// The texture of a name.
    fn named(&self, parameter: &Parameter, kind: TextureKind, depth: usize) -> Option<Texture> {
        let name = parameter.string().unwrap_or_default();
        let Some(definition) = self.world.textures.get(&(name.to_owned(), kind)) else {
            let of_kind = self.world.textures.keys().filter(|(_, of)| *of == kind);
            let known: Vec<&str> = of_kind.map(|(name, _)| &name[..]).collect();
            let what = if kind == TextureKind::Float { "float" } else { "spectrum" };
            let message = format!("no {what} texture {name:?}{}; {}", did_you_mean(name, &known), list(&known));
            self.notes.fault(&parameter.place, message);
            return None;
        };
        if depth > MAX_NESTING {
            self.notes.fault(
                &parameter.place,
                format!("the texture {name:?} is made of itself, or of more than {MAX_NESTING} inside one another"),
            );
            return None;
        }
        let key = (name.to_owned(), kind);
        if let Some(known) = self.textures.borrow().get(&key) {
            return known.clone();
        }
        let made = self.made(definition, kind, depth);
        definition.finish(self.notes);
        self.textures.borrow_mut().insert(key, made.clone());
        made
    }

    /// The texture of a definition.
    fn made(&self, of: &Parameters, kind: TextureKind, depth: usize) -> Option<Texture> {
        let operand = |name: &str, default: f64| {
            self.texture_at(of, name, kind, depth + 1).unwrap_or(Texture::Constant([default; 3]))
        };
        match &of.kind[..] {
            "constant" => Some(operand("value", 1.0)),
            "imagemap" => self.imagemap(of),
            "scale" => {
                let scale = self.texture_at(of, "scale", TextureKind::Float, depth + 1);
                let (texture, scale) = (operand("tex", 1.0), scale.unwrap_or(Texture::Constant([1.0; 3])));
                let product = texture.combine(&scale, self.files, &|a, b| [0, 1, 2].map(|c| a[c] * b[c]));
                Some(self.or_first(product, texture, of))
            }
            "mix" => {
                let amount = self.texture_at(of, "amount", TextureKind::Float, depth + 1);
                let (first, second) = (operand("tex1", 0.0), operand("tex2", 1.0));
                let amount = amount.unwrap_or(Texture::Constant([0.5; 3]));
                let mixed = mix(self, &first, &second, &amount);
                Some(self.or_first(mixed, first, of))
            }
            "checkerboard" => {
                let values = Box::new([operand("tex1", 1.0), operand("tex2", 0.0)]);
                if of.integer("dimension").is_some_and(|dimension| dimension != 2) {
                    self.notes
                        .left_out(of.place_of("dimension"), "a checkerboard in space: its first texture is taken");
                    let [first, _] = *values;
                    return Some(first);
                }
                // pbrt's squares are 1 wide, Mitsuba's one half
                let to_uv = uv_map(DVec2::splat(0.5), DVec2::ZERO) * self.mapping(of);
                Some(Texture::Checkerboard { values, to_uv })
            }
            other => {
                let known = ["checkerboard", "constant", "imagemap", "mix", "scale"];
                let message = format!(
                    "texture {other:?}{}: what it is for keeps its default instead; {}",
                    did_you_mean(other, &known),
                    list(&known)
                );
                self.notes.left_out(&of.place, message);
                of.quiet(&of.list.iter().map(|parameter| &parameter.name[..]).collect::<Vec<_>>());
                None
            }
        }
    }

    /// What was computed, or the first operand where that cannot be.
    fn or_first(&self, computed: Result<Texture, String>, first: Texture, of: &Parameters) -> Texture {
        computed.unwrap_or_else(|message| {
            self.notes
                .left_out(&of.place, format!("texture {:?}: its first texture alone is taken: {message}", of.kind));
            first
        })
    }

    fn imagemap(&self, of: &Parameters) -> Option<Texture> {
        let path = of.file("filename", self.notes)?;
        of.quiet(&["maxanisotropy"]);
        let encoding = of.string("encoding").unwrap_or("sRGB");
        let raw = encoding == "linear";
        if !matches!(encoding, "sRGB" | "linear") {
            let message = format!("encoding {encoding:?} is taken as sRGB, the only curve that Mitsuba 3 has");
            self.notes.changed(of.place_of("encoding"), message);
        }
        let wrap = match of.string("wrap").unwrap_or("repeat") {
            "repeat" => Wrap::Repeat,
            "clamp" => Wrap::Clamp,
            other => {
                let message =
                    format!("beyond its border the picture is clamped, as Mitsuba 3 has no wrap_mode {other:?}");
                self.notes.changed(of.place_of("wrap"), message);
                Wrap::Clamp
            }
        };
        let picture = Texture::Picture(Picture {
            pixels: Pixels::File { path, raw },
            to_uv: upside_down() * self.mapping(of),
            is_nearest: of.string("filter") == Some("point"),
            wrap,
        });
        let scale = of.float("scale").unwrap_or(1.0);
        let is_inverted = of.boolean("invert").unwrap_or(false);
        if scale == 1.0 && !is_inverted {
            return Some(picture);
        }
        let value = |v: f64| if is_inverted { (1.0 - scale * v).max(0.0) } else { scale * v };
        let scaled = picture.map(self.files, &|rgb| rgb.map(value));
        Some(self.or_first(scaled, picture, of))
    }

    /// `mapping` of a texture; only "uv" has a counterpart.
    fn mapping(&self, of: &Parameters) -> DAffine2 {
        let mapping = of.string("mapping").unwrap_or("uv").to_owned();
        let number = |name: &str, default: f64| of.float(name).unwrap_or(default);
        let scale = DVec2::new(number("uscale", 1.0), number("vscale", 1.0));
        let offset = DVec2::new(number("udelta", 0.0), number("vdelta", 0.0));
        if mapping != "uv" {
            of.quiet(&["v1", "v2"]);
            let message = format!("mapping {mapping:?}: the texture coordinates of shapes are taken instead");
            self.notes.left_out(of.place_of("mapping"), message);
        }
        uv_map(scale, offset)
    }
}

/// a (1 − t) + b t.
fn mix(converter: &Converter, a: &Texture, b: &Texture, t: &Texture) -> Result<Texture, String> {
    let files = converter.files;
    let product = |a: Rgb, b: Rgb| [0, 1, 2].map(|c| a[c] * b[c]);
    let rest = t.map(files, &|t| t.map(|t| 1.0 - t))?;
    let (first, second) = (a.combine(&rest, files, &product)?, b.combine(t, files, &product)?);
    first.combine(&second, files, &|a, b| [0, 1, 2].map(|c| a[c] + b[c]))
}
