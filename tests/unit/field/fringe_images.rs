//! Bytes that are an image, and bytes that are none.

use std::io::Cursor;

use plychain::field::fringes::picture::{clearest_colour, decode};

use crate::common::pictures::{Format, Raster};

const FORMATS: [Format; 2] = [Format::Png, Format::Tiff];
const SIZE: [u32; 2] = [13, 9];

fn encoded(format: Format, deep: bool) -> Vec<u8> {
    if deep {
        Raster::of(SIZE, |x, y| [(x * 4000 + y * 17) as u16]).file(format)
    } else {
        Raster::of(SIZE, |x, y| [(x * 19 + y) as u8]).file(format)
    }
}

fn jpeg() -> Vec<u8> {
    Raster::of(SIZE, |x, y| [(x * 19 + y) as u8]).jpeg()
}

#[test]
fn values_of_eight_and_sixteen_bit_are_read_as_they_are() {
    for format in FORMATS {
        let picture = decode(&encoded(format, true), None).unwrap();
        assert_eq!(picture.full_scale, u16::MAX);
        assert_eq!(picture.values[13 + 2], 2 * 4000 + 17);
        let picture = decode(&encoded(format, false), None).unwrap();
        assert_eq!((picture.size, picture.full_scale), ([13, 9], 255));
        assert_eq!(picture.values[13 + 2], 2 * 19 + 1);
    }
}

/// What a camera of colours writes is grey where its channels agree, and the colour that varies most where they do not.
#[test]
fn colours_are_grey_where_their_channels_agree() {
    for format in FORMATS {
        let grey = Raster::of(SIZE, |x, y| [(x * 19 + y) as u8; 3]);
        let picture = decode(&grey.file(format), None).unwrap();
        assert_eq!((picture.values.len(), picture.values[15]), (13 * 9, 39));
        let opaque = Raster::of(SIZE, |x, y| {
            let value = (x * 19 + y) as u16 * 257;
            [value, value, value, u16::MAX]
        });
        let picture = decode(&opaque.file(format), None).unwrap();
        assert_eq!(
            (picture.values[15], picture.full_scale),
            (39 * 257, u16::MAX)
        );
        let coloured = Raster::of(SIZE, |x, y| [y as u8, (x * 19 + y) as u8, 0]);
        let file = coloured.file(format);
        let refused = decode(&file, None).err().unwrap();
        assert!(refused.contains("coloured image"), "{refused}");
        assert_eq!(clearest_colour(&file), Ok(Some(1)));
        assert_eq!(decode(&file, Some(1)).unwrap().values[15], 39);
    }
}

#[test]
fn a_jpeg_is_read_about_as_it_was_and_refused_if_it_is_cut() {
    let smooth = Raster::of([40, 24], |x, y| [(60 + 3 * x + y) as u8]);
    let file = smooth.jpeg();
    let picture = decode(&file, None).unwrap();
    assert_eq!((picture.size, picture.full_scale), ([40, 24], 255));
    for (read, true_value) in picture.values.iter().zip(&smooth.values) {
        assert!(
            read.abs_diff(u16::from(*true_value)) <= 6,
            "{read} {true_value}"
        );
    }
    assert!(decode(&file[..file.len() / 2], None).is_err());
}

#[test]
fn floating_point_numbers_are_shares_of_one_or_counts() {
    use tiff::encoder::{TiffEncoder, colortype::Gray32Float};
    let file = |values: [f32; 4]| {
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
        encoder.write_image::<Gray32Float>(2, 2, &values).unwrap();
        decode(&bytes.into_inner(), None)
    };
    let read = |values| file(values).unwrap().values;
    assert_eq!(read([0.0, 0.2, 0.4, 1.0]), [0, 13107, 26214, 65535]);
    assert_eq!(read([0.0, 12.0, 4095.0, 7.0]), [0, 12, 4095, 7]);
    for odd in [-1.0, 1e6, f32::NAN] {
        assert!(file([0.0, odd, 1.0, 1.0]).is_err(), "{odd}");
    }
}

/// A header may claim any size.
#[test]
fn a_picture_that_claims_to_be_huge_is_refused_before_it_is_made() {
    let mut file = encoded(Format::Png, false);
    file[16..20].copy_from_slice(&60_000u32.to_be_bytes());
    file[20..24].copy_from_slice(&60_000u32.to_be_bytes());
    let checksum = crc32(&file[12..29]).to_be_bytes();
    file[29..33].copy_from_slice(&checksum);
    let refused = decode(&file, None).err().unwrap();
    assert!(refused.contains("60000 x 60000 pixels"), "{refused}");
}

/// The checksum of PNG's chunks.
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
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
    let mut whole: Vec<Vec<u8>> = FORMATS
        .into_iter()
        .flat_map(|format| [false, true].map(|deep| encoded(format, deep)))
        .collect();
    whole.push(jpeg());
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
        refused += usize::from(decode(&bytes, None).is_err());
    }
    assert!(refused > 50_000, "{refused}");
}

/// A bitmap as the format describes it: rows from the bottom or the top, each filled up to four bytes.
fn bitmap(depth: u16, top_down: bool, pixel: &dyn Fn(usize, usize) -> Vec<u8>) -> Vec<u8> {
    let (width, height) = (13, 9_i32);
    let palette = match depth {
        8 => (0..=255).flat_map(|k: u8| [k, k, k, 0]).collect(),
        _ => Vec::new(),
    };
    let start = 54 + palette.len() as u32;
    let mut file = b"BM".to_vec();
    for value in [0, 0, start, 40, width as u32] {
        file.extend(value.to_le_bytes());
    }
    file.extend((if top_down { -height } else { height }).to_le_bytes());
    file.extend([1, 0]);
    file.extend(depth.to_le_bytes());
    file.extend([0; 24]);
    file.extend(palette);
    for k in 0..9 {
        let y = if top_down { k } else { 8 - k };
        let row: Vec<u8> = (0..width).flat_map(|x| pixel(x, y)).collect();
        file.extend(&row);
        file.extend(vec![0; row.len().next_multiple_of(4) - row.len()]);
    }
    file
}

#[test]
fn bitmaps_are_read_as_they_are() {
    let value = |x: usize, y: usize| (x * 19 + y) as u8;
    for top_down in [false, true] {
        let grey = |x: usize, y: usize| vec![value(x, y)];
        let bgr = |x: usize, y: usize| vec![3, 2, value(x, y)];
        let bgra = |x: usize, y: usize| vec![value(x, y); 4];
        let picture = |file: &[u8], colour| decode(file, colour).unwrap();
        let expected: Vec<u16> = (0..9)
            .flat_map(|y| (0..13).map(move |x| (x * 19 + y) as u16))
            .collect();
        let file = bitmap(8, top_down, &grey);
        let found = picture(&file, None);
        assert_eq!((found.size, found.full_scale), ([13, 9], 255));
        assert_eq!(found.values, expected);
        assert_eq!(picture(&bitmap(32, top_down, &bgra), None).values, expected);
        let file = bitmap(24, top_down, &bgr);
        assert_eq!(clearest_colour(&file), Ok(Some(0)));
        assert_eq!(picture(&file, Some(0)).values, expected);
        for end in [10, 40, 300, file.len() - 2] {
            assert!(decode(&file[..end], Some(0)).is_err());
        }
        let mut packed = file.clone();
        packed[30] = 1;
        assert!(decode(&packed, Some(0)).err().unwrap().contains("BMP"));
    }
}
