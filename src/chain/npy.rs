//! NumPy's `.npy`: a header that is a Python dictionary, then the numbers.

use std::io::{Read, Result, Write};

use super::codecs::NumberKind;

const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// Where numbers may begin: at multiples of it.
const ALIGNMENT: usize = 64;

/// Write the header of an array whose elements are of NumPy's type `kind`, last index fastest.
pub(super) fn begin(to: &mut dyn Write, kind: &str, shape: &[usize]) -> Result<()> {
    let shape: String = shape.iter().map(|n| format!("{n},")).collect();
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    let before = MAGIC.len() + 4;
    let length = (before + header.len() + 1).next_multiple_of(ALIGNMENT) - before;
    to.write_all(MAGIC)?;
    to.write_all(&[1, 0])?;
    to.write_all(&(length as u16).to_le_bytes())?;
    writeln!(to, "{header:<width$}", width = length - 1)
}

/// The numbers of an array in the order of the file, at most `most`; or what is wrong with it, in words.
pub fn read_npy(from: &mut dyn Read, most: u64) -> std::result::Result<Vec<f64>, String> {
    Ok(NpyArray::read(from, most)?.numbers)
}

/// An array of numbers or of text.
pub(super) struct NpyArray {
    pub shape: Vec<usize>,
    /// Numbers in the order of the file, the last axis fastest.
    pub numbers: Vec<f64>,
    /// Texts, where it is an array of them.
    pub texts: Vec<String>,
}

impl NpyArray {
    /// Reads an array of at most `most` elements; or what is wrong with it, in words.
    pub(super) fn read(from: &mut dyn Read, most: u64) -> std::result::Result<Self, String> {
        let words = |e: std::io::Error| e.to_string();
        let header = header(from).map_err(words)?;
        let after = |key: &str| {
            let at = header.find(&format!("'{key}':"));
            at.map(|k| header[k + key.len() + 3..].trim_start())
        };
        let kind = after("descr").and_then(|text| text.split('\'').nth(1));
        let inside = after("shape").and_then(|text| text.strip_prefix('(')?.split_once(')'));
        let (Some(kind), Some((inside, _))) = (kind, inside) else {
            return Err(format!("a header without type and shape: {header}"));
        };
        let sides = inside.split(',').map(str::trim).filter(|s| !s.is_empty());
        let shape: Option<Vec<usize>> = sides.map(|side| side.parse().ok()).collect();
        let shape = shape.ok_or_else(|| format!("a shape ({inside})"))?;
        let count = shape
            .iter()
            .fold(1, |n: u64, side| n.saturating_mul(*side as u64));
        if count > most {
            return Err(format!("{count} numbers, more than {most}"));
        }
        if after("fortran_order").is_some_and(|t| t.starts_with("True")) && shape.len() > 1 {
            return Err("an array whose first axis is the fastest".into());
        }
        let number = NumberKind::of_old(&kind.into());
        let letters = kind
            .strip_prefix("<U")
            .and_then(|n| n.parse::<usize>().ok());
        let width = match (number, letters) {
            (Some(number), _) => number.width(),
            (None, Some(letters)) => 4 * letters,
            (None, None) => return Err(format!("numbers of the type {kind}")),
        };
        let mut bytes = Vec::new();
        from.take(count * width as u64)
            .read_to_end(&mut bytes)
            .map_err(words)?;
        if bytes.len() as u64 != count * width as u64 {
            return Err(format!("{} bytes for {count} numbers", bytes.len()));
        }
        let elements = bytes.chunks_exact(width.max(1));
        let (mut numbers, mut texts) = (Vec::new(), Vec::new());
        match number {
            Some(number) => numbers.extend(elements.map(|b| number.number(b))),
            None => texts.extend(elements.map(text)),
        }
        Ok(Self {
            shape,
            numbers,
            texts,
        })
    }
}

/// Text in four bytes a letter, filled up with zeros.
fn text(bytes: &[u8]) -> String {
    let (letters, _) = bytes.as_chunks::<4>();
    let letters = letters.iter().map(|b| u32::from_le_bytes(*b));
    letters
        .take_while(|c| *c != 0)
        .filter_map(char::from_u32)
        .collect()
}

fn header(from: &mut dyn Read) -> Result<String> {
    let mut start = [0; 8];
    from.read_exact(&mut start)?;
    if start[..6] != MAGIC[..] {
        return Err(std::io::Error::other("no array of NumPy"));
    }
    let mut length = [0; 4];
    let digits = if start[6] == 1 { 2 } else { 4 };
    from.read_exact(&mut length[..digits])?;
    let length = u64::from(u32::from_le_bytes(length)).min(1 << 16);
    let mut text = String::new();
    from.take(length).read_to_string(&mut text)?;
    Ok(text)
}
