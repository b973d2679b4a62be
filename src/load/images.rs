//! Picture files: PNG, JPEG, Radiance HDR and OpenEXR.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::{DynamicImage, ImageReader, Limits};
use rayon::prelude::*;

use crate::film::exr_file;
use crate::memory;
use crate::scene::textures::{Image, Texels};

/// Widest and highest picture, in texels.
const MOST_TEXELS_ACROSS: u32 = 65_536;

/// Most memory that decoding a picture may take, in bytes. Keeps small files of huge pictures from exhausting memory.
const MOST_MEMORY: u64 = 4 << 30;

/// Texels that a byte of a file may stand for: PNG's compression makes up to 1032 bytes of one, with eight black or white texels
/// each; JPEG and HDR stay below. What a decoder makes up for files that end too soon is not theirs.
const TEXELS_OF_BYTE: u64 = 8 * 1032;
/// Texels that any file may have.
const TEXELS_OF_ANY: u64 = 1 << 24;

/// Bytes that a texel takes at most while its picture is decoded: as four numbers and, made of them, as three.
const BYTES_OF_TEXEL: u64 = 4 * 4 + 3 * 4;

/// Pictures by file, each read once.
pub struct Images(HashMap<PathBuf, Result<Arc<Image>, String>>);

impl Images {
    /// Reads files, in parallel.
    pub fn read(paths: Vec<PathBuf>) -> Images {
        let read = |path: PathBuf| {
            let image = self::read(&path).map(Arc::new);
            (path, image)
        };
        Images(paths.into_par_iter().map(read).collect())
    }

    /// The picture, or in a sentence why there is none.
    pub fn get(&self, path: &Path) -> Result<Arc<Image>, String> {
        self.0.get(path).cloned().unwrap_or_else(|| read(path).map(Arc::new))
    }
}

/// Reads one file; what its content is decides, not its name.
pub fn read(path: &Path) -> Result<Image, String> {
    let in_file = |message: String| format!("{}: {message}", path.display());
    let bytes = std::fs::read(path).map_err(|error| in_file(format!("cannot be read: {error}")))?;
    decode(&bytes).map_err(in_file)
}

/// Reads the content of a file.
pub fn decode(bytes: &[u8]) -> Result<Image, String> {
    let image = if bytes.starts_with(&OPENEXR) { decode_exr(bytes) } else { decode_other(bytes) }?;
    check(&image)?;
    Ok(image)
}

/// How OpenEXR files begin.
const OPENEXR: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// The colours of an OpenEXR file.
fn decode_exr(bytes: &[u8]) -> Result<Image, String> {
    let image = exr_file::read_from(Cursor::new(bytes))?.image;
    Ok(Image { width: image.width, height: image.height, texels: Texels::Floats(image.pixels) })
}

/// The other formats.
fn decode_other(bytes: &[u8]) -> Result<Image, String> {
    let open = || ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|error| error.to_string());
    let (sized, mut reader) = (open()?, open()?);
    if reader.format().is_none() {
        return Err("is no picture that relt reads; known: PNG, JPEG, HDR, OpenEXR".into());
    }
    let (width, height) = sized.into_dimensions().map_err(|error| format!("cannot be decoded: {error}"))?;
    if width.max(height) <= MOST_TEXELS_ACROSS {
        let texels = u64::from(width) * u64::from(height);
        if texels > TEXELS_OF_ANY + TEXELS_OF_BYTE * bytes.len() as u64 {
            return Err(format!("{} bytes cannot hold its {width} × {height} texels", bytes.len()));
        }
        memory::check(BYTES_OF_TEXEL * texels, format_args!("{width} × {height} texels"))?;
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(MOST_TEXELS_ACROSS);
    limits.max_image_height = Some(MOST_TEXELS_ACROSS);
    limits.max_alloc = Some(MOST_MEMORY);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|error| format!("cannot be decoded: {error}"))?;
    let (width, height) = (decoded.width(), decoded.height());
    let texels = match decoded {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => Texels::Words(decoded.into_rgb16().pixels().map(|p| p.0).collect()),
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            Texels::Floats(decoded.into_rgb32f().pixels().map(|p| p.0).collect())
        }
        _ => Texels::Bytes(decoded.into_rgb8().pixels().map(|p| p.0).collect()),
    };
    Ok(Image { width, height, texels })
}

/// Some texels, and finite ones.
fn check(image: &Image) -> Result<(), String> {
    if image.width == 0 || image.height == 0 {
        return Err("the picture is empty".into());
    }
    if image.width > MOST_TEXELS_ACROSS || image.height > MOST_TEXELS_ACROSS {
        let most = MOST_TEXELS_ACROSS;
        return Err(format!("it has {} × {} texels; accepted: up to {most} each way", image.width, image.height));
    }
    let Texels::Floats(texels) = &image.texels else { return Ok(()) };
    match texels.iter().position(|t| !t.iter().all(|c| c.is_finite())) {
        None => Ok(()),
        Some(i) => {
            let ([r, g, b], width) = (texels[i], image.width as usize);
            let (column, row) = (i % width, i / width);
            Err(format!("the texel at column {column}, row {row} is ({r}, {g}, {b}); it must be finite"))
        }
    }
}
