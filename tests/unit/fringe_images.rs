//! Bytes that are no image.

use super::*;

fn encoded(format: image::ImageFormat, deep: bool) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = if deep {
        let of = |x: u32, y: u32| Luma([(x * 4000 + y * 17) as u16]);
        DynamicImage::ImageLuma16(ImageBuffer::from_fn(13, 9, of))
    } else {
        DynamicImage::ImageLuma8(ImageBuffer::from_fn(13, 9, |x, y| {
            Luma([(x * 19 + y) as u8])
        }))
    };
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

use image::{ImageBuffer, ImageFormat, Luma};

#[test]
fn values_of_eight_and_sixteen_bit_are_read_as_they_are() {
    for format in [ImageFormat::Png, ImageFormat::Tiff] {
        let picture = decode(&encoded(format, true)).unwrap();
        assert_eq!(picture.full_scale, u16::MAX);
        assert_eq!(picture.values[13 + 2], 2 * 4000 + 17);
        let picture = decode(&encoded(format, false)).unwrap();
        assert_eq!((picture.size, picture.full_scale), ([13, 9], 255));
        assert_eq!(picture.values[13 + 2], 2 * 19 + 1);
    }
}

/// A hundred thousand files with bytes changed, cut or doubled: an error or a picture, never a panic.
#[test]
fn mangled_images_are_errors() {
    let mut state = 1u64;
    let mut next = move |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as usize % below.max(1)
    };
    let whole: Vec<Vec<u8>> = [ImageFormat::Png, ImageFormat::Tiff]
        .into_iter()
        .flat_map(|format| [false, true].map(|deep| encoded(format, deep)))
        .collect();
    let mut refused = 0;
    for round in 0..100_000 {
        let mut bytes = whole[round % whole.len()].clone();
        for _ in 0..=next(4) {
            let at = next(bytes.len());
            match next(4) {
                0 => bytes.truncate(at),
                1 => bytes.insert(at, next(256) as u8),
                _ => {
                    if let Some(byte) = bytes.get_mut(at) {
                        *byte = next(256) as u8;
                    }
                }
            }
        }
        refused += usize::from(decode(&bytes).is_err());
    }
    assert!(refused > 50_000, "{refused}");
}
