//! OpenEXR files: what relt writes, and references to compare with.
//!
//! One part, 32-bit floats, ZIP compression (lossless). The image is in `R`, `G`, `B`, or in `Y` if it has no colours; a
//! further colour layer `name` is in `name.R`, `name.G`, `name.B`, a gray one in `name.Y`. Values are as they were found:
//! filters with negative lobes leave pixels below 0 beside edges. The display window is the whole picture, the data
//! window the part of it that the file has. Metadata are attributes `relt.NAME`, strings
//! or doubles; the prefix keeps them apart from the format's own.

use std::fs::File;
use std::io::{BufRead, BufReader, Seek};
use std::path::Path;

use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image as ExrImage, Layer};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, IntegerBounds, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::{ReadChannels, ReadLayers, WritableImage, read};

use super::file::{FileError, plain, write_whole};
use super::image::{Image, PixelFormat, Plane, Window};
use crate::memory;

/// A piece of metadata.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Words.
    Text(String),
    /// A number.
    Number(f64),
}

impl From<&str> for Value {
    fn from(text: &str) -> Value {
        Value::Text(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Value {
        Value::Text(text)
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Value {
        Value::Number(number)
    }
}

/// What an OpenEXR file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Contents {
    /// Channels `R`, `G`, `B`, each of them `Y` where the file has that in their place.
    pub image: Image,
    /// Further layers, sorted by name.
    pub layers: Vec<(String, Plane)>,
    /// Attributes `relt.NAME` under NAME, sorted by it.
    pub metadata: Vec<(String, Value)>,
}

impl Contents {
    /// The layer of that name, if it is there and in colour.
    pub fn rgb(&self, name: &str) -> Option<&Image> {
        self.layers.iter().find_map(|(layer, plane)| match plane {
            Plane::Rgb(image) if layer == name => Some(image),
            _ => None,
        })
    }

    /// The layer of that name, if it is there and gray.
    pub fn gray(&self, name: &str) -> Option<&[f32]> {
        self.layers.iter().find_map(|(layer, plane)| match plane {
            Plane::Gray(values) if layer == name => Some(&values[..]),
            _ => None,
        })
    }
}

/// Prefix of relt's attributes.
const PREFIX: &str = "relt.";
/// Channel names of a colour.
const RGB: [&str; 3] = ["R", "G", "B"];
/// Channel name of an image without colours.
const GRAY: &str = "Y";

/// Writes a whole image in colour with its layers and metadata.
///
/// # Panics
/// If a layer's size is not the image's.
pub fn write(
    path: &Path,
    image: &Image,
    layers: &[(String, Plane)],
    metadata: &[(String, Value)],
) -> Result<(), FileError> {
    write_part(path, image, PixelFormat::Rgb, Window::on_whole(image.width, image.height), layers, metadata)
}

/// Writes an image that is a part of another one, or has no colours (of which the first channel tells all).
///
/// # Panics
/// If a layer's size is not the image's.
pub fn write_part(
    path: &Path,
    image: &Image,
    format: PixelFormat,
    window: Window,
    layers: &[(String, Plane)],
    metadata: &[(String, Value)],
) -> Result<(), FileError> {
    let mut channels = match format {
        PixelFormat::Rgb => rgb_channels("", image),
        PixelFormat::Luminance => {
            vec![AnyChannel::new(text(GRAY), FlatSamples::F32(image.pixels.iter().map(|rgb| rgb[0]).collect()))]
        }
    };
    for (name, plane) in layers {
        match plane {
            Plane::Rgb(layer) => {
                assert_eq!((layer.width, layer.height), (image.width, image.height), "layer {name}");
                channels.extend(rgb_channels(&format!("{name}."), layer));
            }
            Plane::Gray(values) => {
                assert_eq!(values.len(), image.pixels.len(), "layer {name}");
                channels.push(AnyChannel::new(text(&format!("{name}.Y")), FlatSamples::F32(values.clone())));
            }
        }
    }
    let [columns, rows] = window.offset.map(|pixels| pixels as i32);
    let mut attributes = LayerAttributes {
        software_name: Some(text(concat!("relt ", env!("CARGO_PKG_VERSION")))),
        layer_position: Vec2(columns, rows),
        ..LayerAttributes::default()
    };
    for (name, value) in metadata {
        let value = match value {
            Value::Text(words) => AttributeValue::Text(text(words)),
            Value::Number(number) => AttributeValue::F64(*number),
        };
        attributes.other.insert(text(&format!("{PREFIX}{name}")), value);
    }
    let size = (image.width as usize, image.height as usize);
    let layer =
        Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels.into_iter().collect()));
    let [width, height] = window.whole.map(|pixels| pixels as usize);
    let whole = ImageAttributes::new(IntegerBounds::from_dimensions((width, height)));
    write_whole(path, |file| {
        ExrImage::new(whole, layer).write().non_parallel().to_buffered(file).map_err(|error| match error {
            exr::error::Error::Io(error) => plain(&error),
            other => other.to_string(),
        })
    })
}

fn rgb_channels(prefix: &str, image: &Image) -> Vec<AnyChannel<FlatSamples>> {
    let channel = |(c, name): (usize, &str)| {
        let values = image.pixels.iter().map(|rgb| rgb[c]).collect();
        AnyChannel::new(text(&format!("{prefix}{name}")), FlatSamples::F32(values))
    };
    RGB.into_iter().enumerate().map(channel).collect()
}

/// UTF-8 as it is, which is what OpenEXR's text is by now.
fn text(words: &str) -> Text {
    Text::from_slice_unchecked(words.as_bytes())
}

/// Reads a file's image, layers and metadata.
pub fn read_file(path: &Path) -> Result<Contents, FileError> {
    let file = File::open(path).map_err(|error| FileError::read(path, error))?;
    read_from(BufReader::new(file)).map_err(|reason| FileError::read(path, reason))
}

/// Reads what a file holds, or says in a sentence why it cannot.
pub fn read_from(mut source: impl BufRead + Seek) -> Result<Contents, String> {
    check_size(&mut source)?;
    source.rewind().map_err(|error| error.to_string())?;
    let reader = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let file = reader.non_parallel().from_buffered(source).map_err(|error| error.to_string())?;
    let layer = file.layer_data;
    let (width, height) = (layer.size.0 as u32, layer.size.1 as u32);
    let mut channels = Vec::new();
    for channel in layer.channel_data.list {
        if channel.sampling.0 != 1 || channel.sampling.1 != 1 {
            return Err(format!("channel {} is subsampled", words(&channel.name)));
        }
        channels.push((words(&channel.name), channel.sample_data.values_as_f32().collect()));
    }
    let mut planes = planes(width, height, channels);
    let image = match planes.iter().position(|(name, plane)| name.is_empty() && matches!(plane, Plane::Rgb(_))) {
        Some(root) => match planes.swap_remove(root) {
            (_, Plane::Rgb(image)) => image,
            _ => unreachable!("the match above asks for colours"),
        },
        None => match planes.iter().position(|(name, _)| name == GRAY).map(|root| planes.swap_remove(root)) {
            Some((_, Plane::Gray(values))) => Image::new(width, height, values.iter().map(|y| [*y; 3]).collect()),
            _ => return Err("it has no channels R, G, B, nor Y".into()),
        },
    };
    planes.sort_by(|a, b| a.0.cmp(&b.0));
    let mut metadata: Vec<_> = layer
        .attributes
        .other
        .iter()
        .filter_map(|(name, value)| {
            let name = words(name).strip_prefix(PREFIX)?.to_owned();
            match value {
                AttributeValue::Text(text) => Some((name, Value::Text(words(text)))),
                AttributeValue::F64(number) => Some((name, Value::Number(*number))),
                _ => None,
            }
        })
        .collect();
    metadata.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(Contents { image, layers: planes, metadata })
}

/// Widest and highest picture, in pixels: that of a film.
pub const MOST_PIXELS_ACROSS: usize = 65_536;
/// Bytes that a sample of a channel takes while a file is read: as it is in the file, as a number, and in its layer.
const BYTES_OF_SAMPLE: u64 = 4 + 4 + 4;

/// Whether a picture of the size that its header claims can be had: told before any memory is asked for.
fn check_size(source: &mut impl BufRead) -> Result<(), String> {
    let parts = MetaData::read_from_buffered(source, false).map_err(|error| error.to_string())?.headers;
    for part in parts {
        let Vec2(width, height) = part.layer_size;
        let channels = part.channels.list.len();
        if width.max(height) > MOST_PIXELS_ACROSS {
            return Err(format!("it has {width} × {height} pixels; accepted: up to {MOST_PIXELS_ACROSS} each way"));
        }
        let bytes = BYTES_OF_SAMPLE * (width * height) as u64 * channels as u64;
        memory::check(bytes, format_args!("{width} × {height} pixels in {channels} channels"))?;
    }
    Ok(())
}

/// Puts channels together again: `name.R`, `.G` and `.B` to colours, anything else to gray planes, `name.Y` under
/// `name`.
fn planes(width: u32, height: u32, mut channels: Vec<(String, Vec<f32>)>) -> Vec<(String, Plane)> {
    let mut planes = Vec::new();
    let find = |channels: &[(String, Vec<f32>)], name: String| channels.iter().position(|(n, _)| *n == name);
    let bases: Vec<String> = channels
        .iter()
        .filter_map(|(name, _)| name.strip_suffix('R'))
        .filter(|base| base.is_empty() || base.ends_with('.'))
        .map(str::to_owned)
        .collect();
    for base in bases {
        if RGB.iter().all(|c| find(&channels, format!("{base}{c}")).is_some()) {
            let [r, g, b] = RGB.map(|c| {
                let place = find(&channels, format!("{base}{c}")).expect("asked for just above");
                channels.swap_remove(place).1
            });
            let pixels = r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect();
            planes.push((base.trim_end_matches('.').to_owned(), Plane::Rgb(Image { width, height, pixels })));
        }
    }
    for (name, values) in channels {
        planes.push((name.strip_suffix(".Y").unwrap_or(&name).to_owned(), Plane::Gray(values)));
    }
    planes
}

fn words(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}
