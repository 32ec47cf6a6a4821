//! The numbers in an image file: PNG, TIFF, JPEG or BMP, of 8 or 16 bit, or a TIFF of floating-point numbers; and writing a grey PNG.

use std::io::Cursor;
use std::path::Path;

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::error::Result;
use crate::field::reader::unwritable;

/// A picture of more pixels is refused, and so is what would need more memory, bytes.
const MOST_PIXELS: usize = 64 << 20;
const MOST_BYTES: usize = 1 << 30;
const MOST_SIDE: usize = 1 << 16;

/// A grey picture, row by row.
pub struct ImageFile {
    pub size: [usize; 2],
    pub values: Vec<u16>,
    pub full_scale: u16,
}

/// What is wrong with a file, in words.
type Decoded<T> = std::result::Result<T, String>;

fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// Samples of a picture, channel by channel at every pixel.
struct Samples {
    size: [usize; 2],
    channels: usize,
    values: Vec<u16>,
    full_scale: u16,
}

/// Colours of a picture, in the order of its channels.
pub const COLOURS: [&str; 3] = ["red", "green", "blue"];

/// The picture in the bytes of a file (of several, the first), of a coloured one a channel of [`COLOURS`]; or what is wrong with it.
pub fn decode(bytes: &[u8], colour: Option<usize>) -> Decoded<ImageFile> {
    samples(bytes)?.grey(colour)
}

/// The channel of a coloured picture that varies most, as that of fringes in light of one colour; of a grey one none.
pub fn clearest_colour(bytes: &[u8]) -> Decoded<Option<usize>> {
    let samples = samples(bytes)?;
    if !samples.is_coloured() {
        return Ok(None);
    }
    let variance = |k: &usize| {
        let channel = samples.values.iter().skip(*k).step_by(samples.channels);
        let n = (samples.values.len() / samples.channels) as f64;
        let (sum, squares) = channel.fold((0.0, 0.0), |(a, b), v| {
            let v = f64::from(*v);
            (a + v, b + v * v)
        });
        squares / n - (sum / n).powi(2)
    };
    Ok((0..3).max_by(|a, b| variance(a).total_cmp(&variance(b))))
}

fn samples(bytes: &[u8]) -> Decoded<Samples> {
    let samples = match bytes {
        [0x89, b'P', b'N', b'G', ..] => png(bytes),
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => tiff(bytes),
        [0xff, 0xd8, 0xff, ..] => jpeg(bytes),
        [b'B', b'M', ..] => bmp(bytes),
        _ => Err("bytes of another format".into()),
    }?;
    let [width, height] = samples.size;
    match samples.values.len() == width * height * samples.channels {
        true => Ok(samples),
        false => Err("a picture that is cut".into()),
    }
}

impl Samples {
    /// Whether channels of colour differ; they do not in a palette of greys.
    fn is_coloured(&self) -> bool {
        let mut pixels = self.values.chunks_exact(self.channels);
        self.channels > 2 && pixels.any(|p| p[0] != p[1] || p[1] != p[2])
    }

    fn grey(self, colour: Option<usize>) -> Decoded<ImageFile> {
        let channel = match (self.is_coloured(), colour) {
            (true, None) => return Err("a coloured image beside grey ones".into()),
            (true, Some(k)) => k,
            (false, _) => 0,
        };
        let values = match self.channels {
            1 => self.values,
            n => self.values.into_iter().skip(channel).step_by(n).collect(),
        };
        Ok(ImageFile {
            size: self.size,
            values,
            full_scale: self.full_scale,
        })
    }
}

/// A bitmap of Windows as cameras write it: a palette of 8 bit, or 24 or 32 bit a pixel, not compressed.
fn bmp(bytes: &[u8]) -> Decoded<Samples> {
    let word = |at: usize| {
        let four = bytes.get(at..at + 4).and_then(|b| b.try_into().ok());
        four.map(u32::from_le_bytes)
            .ok_or_else(|| "a picture that is cut".to_string())
    };
    let (start, header) = (word(10)? as usize, word(14)? as usize);
    let (width, height) = (word(18)? as i32, word(22)? as i32);
    let (depth, kind) = ((word(26)? >> 16) as usize, word(30)?);
    // kind 3 states the masks of its channels, which are these wherever there are 32 bit
    let is_plain = kind == 0 || (kind == 3 && depth == 32 && word(54)? == 0x00ff_0000);
    if header < 40 || !is_plain || ![8, 24, 32].contains(&depth) {
        return Err(format!("a BMP of the kind {kind} with {depth} bit a pixel"));
    }
    let top_down = height < 0;
    let size = size(
        usize::try_from(width).unwrap_or(usize::MAX >> 32),
        height.unsigned_abs() as usize,
    )?;
    let palette = bytes.get(14 + header..start).unwrap_or_default();
    let (step, stride) = (depth / 8, (size[0] * depth).div_ceil(32) * 4);
    let mut values = Vec::with_capacity(3 * size[0] * size[1]);
    for row in 0..size[1] {
        let row = if top_down { row } else { size[1] - 1 - row };
        let at = start + row * stride;
        let row = bytes.get(at..at + size[0] * step);
        for pixel in row.ok_or("a picture that is cut")?.chunks_exact(step) {
            let own = match step {
                1 => palette.get(4 * usize::from(pixel[0])..).unwrap_or_default(),
                _ => pixel,
            };
            let [blue, green, red, ..] = own else {
                return Err("a palette that is cut".into());
            };
            values.extend([*red, *green, *blue].map(u16::from));
        }
    }
    Ok(Samples {
        size,
        channels: 3,
        values,
        full_scale: 255,
    })
}

/// The size of a picture that is not too large.
fn size(width: usize, height: usize) -> Decoded<[usize; 2]> {
    let fits = width <= MOST_SIDE && height <= MOST_SIDE && width * height <= MOST_PIXELS;
    match fits {
        true => Ok([width, height]),
        false => Err(format!("{width} x {height} pixels")),
    }
}

fn png(bytes: &[u8]) -> Decoded<Samples> {
    let limits = png::Limits { bytes: MOST_BYTES };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(words)?;
    let (width, height) = reader.info().size();
    let size = size(width as usize, height as usize)?;
    let (colour, depth) = reader.output_color_type();
    let mut buffer = vec![0; reader.output_buffer_size().unwrap_or_default()];
    reader.next_frame(&mut buffer).map_err(words)?;
    let (values, full_scale) = if depth == png::BitDepth::Sixteen {
        let (pairs, _) = buffer.as_chunks::<2>();
        let values = pairs.iter().map(|pair| u16::from_be_bytes(*pair));
        (values.collect(), u16::MAX)
    } else {
        (buffer.into_iter().map(u16::from).collect(), 255)
    };
    Ok(Samples {
        size,
        channels: colour.samples(),
        values,
        full_scale,
    })
}

fn tiff(bytes: &[u8]) -> Decoded<Samples> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MOST_BYTES;
    limits.intermediate_buffer_size = MOST_BYTES;
    let decoder = Decoder::new(Cursor::new(bytes)).map_err(words)?;
    let mut decoder = decoder.with_limits(limits);
    let (width, height) = decoder.dimensions().map_err(words)?;
    let size = size(width as usize, height as usize)?;
    let colour = decoder.colortype().map_err(words)?;
    let (channels, bits) = match colour {
        ColorType::Gray(bits) => (1, bits),
        ColorType::GrayA(bits) => (2, bits),
        ColorType::RGB(bits) => (3, bits),
        ColorType::RGBA(bits) => (4, bits),
        _ => (0, 0),
    };
    if ![8, 16, 32, 64].contains(&bits) {
        return Err(format!("pixels of the kind {colour:?}"));
    }
    let mut decoded = DecodingResult::U8(Vec::new());
    let layout = decoder.read_image_to_buffer(&mut decoded);
    let planes = layout.map_err(words)?.planes;
    let (values, full_scale) = match decoded {
        DecodingResult::U8(values) => (values.into_iter().map(u16::from).collect(), 255),
        DecodingResult::U16(values) => (values, u16::MAX),
        DecodingResult::F32(values) => (floats(values.into_iter().map(f64::from))?, u16::MAX),
        DecodingResult::F64(values) => (floats(values.into_iter())?, u16::MAX),
        _ => return Err(format!("whole numbers of the kind {colour:?}")),
    };
    let pixels = size[0] * size[1];
    let apart = planes > 1 && values.len() == pixels * channels;
    let values = match apart {
        true => (0..pixels * channels)
            .map(|k| values[k % channels * pixels + k / channels])
            .collect(),
        false => values,
    };
    Ok(Samples {
        size,
        channels,
        values,
        full_scale,
    })
}

/// Floating-point numbers from 0 to 1, or counts of at most 16 bit.
fn floats(values: impl Iterator<Item = f64> + Clone) -> Decoded<Vec<u16>> {
    let full = f64::from(u16::MAX);
    if let Some(odd) = values.clone().find(|v| !(0.0..=full).contains(v)) {
        return Err(format!("{odd} in a picture of numbers from 0 to {full}"));
    }
    let counts = values.clone().any(|v| v > 1.0);
    let unit = if counts { 1.0 } else { full };
    Ok(values.map(|v| (v * unit).round() as u16).collect())
}

fn jpeg(bytes: &[u8]) -> Decoded<Samples> {
    // strict: a file that is cut is no picture with a grey rest
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(MOST_SIDE)
        .set_max_height(MOST_SIDE);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(words)?;
    let (width, height) = decoder.dimensions().unwrap_or_default();
    let size = size(width, height)?;
    let values = decoder.decode().map_err(words)?;
    let colours = decoder.output_colorspace();
    Ok(Samples {
        size,
        channels: colours.map_or(1, |c| c.num_components()),
        values: values.into_iter().map(u16::from).collect(),
        full_scale: 255,
    })
}

/// Write a grey PNG of 8 or 16 bit (`deep`); the values fit.
///
/// # Errors
/// Of the input: a place that cannot be written.
pub fn write_png(path: &Path, size: [usize; 2], values: &[u16], deep: bool) -> Result<()> {
    let failed = |e: png::EncodingError| unwritable(path, &std::io::Error::other(e));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size[0] as u32, size[1] as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_compression(png::Compression::Fast);
    let samples: Vec<u8> = if deep {
        encoder.set_depth(png::BitDepth::Sixteen);
        values.iter().flat_map(|v| v.to_be_bytes()).collect()
    } else {
        values.iter().map(|v| *v as u8).collect()
    };
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&samples).map_err(failed)?;
    writer.finish().map_err(failed)?;
    std::fs::write(path, bytes).map_err(|e| unwritable(path, &e))
}
