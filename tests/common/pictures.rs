//! Pictures as other programs write them, by encoders alone.

use std::io::Cursor;

use png::{BitDepth, ColorType, Encoder};
use tiff::encoder::{TiffEncoder, colortype};

/// A picture of one, three or four channels: its side lengths, and the values of all channels pixel by pixel.
pub struct Raster<T> {
    pub size: [u32; 2],
    pub channels: usize,
    pub values: Vec<T>,
}

impl<T> Raster<T> {
    pub fn of<const N: usize>(size: [u32; 2], pixel: impl Fn(u32, u32) -> [T; N]) -> Self {
        let places = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y)));
        Self {
            size,
            channels: N,
            values: places.flat_map(|(x, y)| pixel(x, y)).collect(),
        }
    }
}

fn png_of(size: [u32; 2], channels: usize, depth: BitDepth, bytes: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, size[0], size[1]);
    encoder.set_depth(depth);
    encoder.set_color(match channels {
        1 => ColorType::Grayscale,
        3 => ColorType::Rgb,
        4 => ColorType::Rgba,
        n => panic!("{n} channels"),
    });
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(bytes).unwrap();
    writer.finish().unwrap();
    file
}

/// A file of PNG or TIFF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Format {
    Png,
    Tiff,
}

impl Raster<u8> {
    pub fn file(&self, format: Format) -> Vec<u8> {
        let ([w, h], values) = (self.size, &self.values);
        if format == Format::Png {
            return png_of(self.size, self.channels, BitDepth::Eight, values);
        }
        let mut file = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap();
        match self.channels {
            1 => encoder.write_image::<colortype::Gray8>(w, h, values),
            3 => encoder.write_image::<colortype::RGB8>(w, h, values),
            n => panic!("{n} channels"),
        }
        .unwrap();
        file.into_inner()
    }

    pub fn jpeg(&self) -> Vec<u8> {
        let mut file = Vec::new();
        let size = self.size.map(|n| u16::try_from(n).unwrap());
        jpeg_encoder::Encoder::new(&mut file, 90)
            .encode(
                &self.values,
                size[0],
                size[1],
                jpeg_encoder::ColorType::Luma,
            )
            .unwrap();
        file
    }
}

impl Raster<u16> {
    pub fn file(&self, format: Format) -> Vec<u8> {
        let ([w, h], values) = (self.size, &self.values);
        if format == Format::Png {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
            return png_of(self.size, self.channels, BitDepth::Sixteen, &bytes);
        }
        let mut file = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap();
        match self.channels {
            1 => encoder.write_image::<colortype::Gray16>(w, h, values),
            4 => encoder.write_image::<colortype::RGBA16>(w, h, values),
            n => panic!("{n} channels"),
        }
        .unwrap();
        file.into_inner()
    }
}
