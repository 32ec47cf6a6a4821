//! How other programs compress the chunks of a Zarr array: gzip, zlib, zstd, and the containers of Blosc.

use std::io::Read;

use flate2::read::{GzDecoder, ZlibDecoder};
use serde_json::Value;

/// Words on what is wrong with some bytes.
type CodecResult<T> = std::result::Result<T, String>;

/// A number as an array has it.
#[derive(Debug, Clone, Copy)]
pub(super) struct NumberKind {
    /// `f`, `i`, `u` or `b`, as NumPy has it.
    letter: char,
    width: usize,
    is_big_endian: bool,
}

impl NumberKind {
    /// Of a version 3 name: `float64`; none if it is no number.
    pub(super) fn of(name: &Value) -> Option<Self> {
        let name = name.as_str()?;
        let digits = name
            .find(|c: char| c.is_ascii_digit())
            .unwrap_or(name.len());
        let letter = match &name[..digits] {
            "float" => 'f',
            "int" => 'i',
            "uint" => 'u',
            "bool" => 'b',
            _ => return None,
        };
        let bits: usize = name[digits..].parse().unwrap_or(8);
        Self::checked(letter, bits / 8, false)
    }

    /// Of a NumPy name: `<f8`.
    pub(super) fn of_old(name: &Value) -> Option<Self> {
        let name = name.as_str()?;
        let mut letters = name.chars();
        let (order, letter) = (letters.next()?, letters.next()?);
        Self::checked(letter, letters.as_str().parse().ok()?, order == '>')
    }

    fn checked(letter: char, width: usize, is_big_endian: bool) -> Option<Self> {
        let widths: &[usize] = match letter {
            'f' => &[4, 8],
            'i' | 'u' => &[1, 2, 4, 8],
            'b' => &[1],
            _ => return None,
        };
        widths.contains(&width).then_some(Self {
            letter,
            width,
            is_big_endian,
        })
    }

    pub(super) fn width(self) -> usize {
        self.width
    }

    pub(super) fn number(self, bytes: &[u8]) -> f64 {
        let mut whole = [0; 8];
        for (k, byte) in bytes.iter().enumerate() {
            let place = if self.is_big_endian {
                self.width - 1 - k
            } else {
                k
            };
            whole[place] = *byte;
        }
        let bits = u64::from_le_bytes(whole);
        let unused = 64 - 8 * self.width as u32;
        match (self.letter, self.width) {
            ('f', 8) => f64::from_bits(bits),
            ('f', _) => f64::from(f32::from_bits(bits as u32)),
            ('i', _) => ((bits << unused) as i64 >> unused) as f64,
            _ => bits as f64,
        }
    }
}

/// A step of decoding.
#[derive(Debug, Clone, Copy)]
enum Filter {
    Gzip,
    Zlib,
    Zstd,
    Blosc,
    /// A checksum of four bytes at the end.
    Checksum,
}

/// Steps of decoding, in their order.
#[derive(Debug)]
pub(super) struct Filters {
    steps: Vec<Filter>,
    is_big_endian: bool,
}

impl Filters {
    fn step(name: &str) -> CodecResult<Filter> {
        match name {
            "gzip" => Ok(Filter::Gzip),
            "zlib" | "numcodecs.zlib" => Ok(Filter::Zlib),
            "zstd" => Ok(Filter::Zstd),
            "blosc" => Ok(Filter::Blosc),
            "crc32c" => Ok(Filter::Checksum),
            other => Err(format!("the codec {other}")),
        }
    }

    /// Of the list of codecs of version 3.
    pub(super) fn of(codecs: &Value) -> CodecResult<Self> {
        let (mut steps, mut is_big_endian) = (Vec::new(), false);
        for codec in codecs.as_array().into_iter().flatten().rev() {
            match codec["name"].as_str().unwrap_or_default() {
                "bytes" => is_big_endian = codec["configuration"]["endian"] == "big",
                name => steps.push(Self::step(name)?),
            }
        }
        Ok(Self {
            steps,
            is_big_endian,
        })
    }

    /// Of an array's metadata of version 2.
    pub(super) fn of_old(meta: &Value) -> CodecResult<Self> {
        if meta["filters"].as_array().is_some_and(|f| !f.is_empty()) {
            return Err(format!("the filters {}", meta["filters"]));
        }
        if meta["order"] == "F" {
            return Err("the first axis fastest".into());
        }
        let name = meta["compressor"]["id"].as_str();
        Ok(Self {
            steps: name.map(Self::step).transpose()?.into_iter().collect(),
            is_big_endian: false,
        })
    }

    /// The numbers of a chunk of so many elements of a kind.
    pub(super) fn decode(
        &self,
        bytes: Vec<u8>,
        (kind, count): (NumberKind, usize),
    ) -> CodecResult<Vec<f64>> {
        let kind = NumberKind {
            is_big_endian: kind.is_big_endian || self.is_big_endian,
            ..kind
        };
        let size = count * kind.width;
        let mut bytes = bytes;
        for step in &self.steps {
            bytes = match step {
                Filter::Gzip => unpacked(GzDecoder::new(&bytes[..]), size)?,
                Filter::Zlib => unpacked(ZlibDecoder::new(&bytes[..]), size)?,
                Filter::Zstd => zstd(&bytes, size)?,
                Filter::Blosc => blosc(&bytes, size)?,
                Filter::Checksum => {
                    bytes.truncate(bytes.len().saturating_sub(4));
                    bytes
                }
            };
        }
        if bytes.len() != size {
            return Err(format!("{} bytes", bytes.len()));
        }
        Ok(bytes
            .chunks_exact(kind.width)
            .map(|b| kind.number(b))
            .collect())
    }
}

/// Everything that a decoder gives, at most `size` bytes and a few of a checksum.
fn unpacked(decoder: impl Read, size: usize) -> CodecResult<Vec<u8>> {
    let mut whole = Vec::new();
    let read = decoder.take(size as u64 + 8).read_to_end(&mut whole);
    read.map_err(|e| e.to_string())?;
    Ok(whole)
}

fn zstd(bytes: &[u8], size: usize) -> CodecResult<Vec<u8>> {
    let decoder = ruzstd::decoding::StreamingDecoder::new(bytes).map_err(|e| e.to_string())?;
    unpacked(decoder, size)
}

/// A container of Blosc 1: a header of 16 bytes, where each block begins, and the blocks, split into one stream for each byte of an element.
fn blosc(bytes: &[u8], size: usize) -> CodecResult<Vec<u8>> {
    const HEADER: usize = 16;
    // streams of a block, at most, and the fewest elements of each
    const MOST_SPLITS: usize = 16;
    const FEWEST: usize = 128;
    let cut = || "a container that is cut".to_string();
    let word = |at: usize| -> CodecResult<usize> {
        let bytes = bytes.get(at..at + 4).ok_or_else(cut)?;
        Ok(bytes
            .iter()
            .rev()
            .fold(0, |sum, b| (sum << 8) | usize::from(*b)))
    };
    let [flags, width] = [2, 3].map(|at| bytes.get(at).copied().unwrap_or(0));
    let width = usize::from(width.max(1));
    let (length, block) = (word(4)?, word(8)?.max(1));
    if length != size {
        return Err(format!("{length} bytes"));
    }
    if flags & 0x2 != 0 {
        return Ok(bytes.get(HEADER..HEADER + length).ok_or_else(cut)?.to_vec());
    }
    if flags & 0x4 != 0 {
        return Err("bits that are shuffled".into());
    }
    let mut whole = Vec::with_capacity(length);
    for k in 0..length.div_ceil(block) {
        let own = block.min(length - k * block);
        let is_split =
            flags & 0x10 == 0 && width <= MOST_SPLITS && block / width >= FEWEST && own == block;
        let streams = if is_split { width } else { 1 };
        let mut at = word(HEADER + 4 * k)?;
        let mut packed = Vec::with_capacity(own);
        for _ in 0..streams {
            let stored = word(at)?;
            let stream = bytes.get(at + 4..at + 4 + stored).ok_or_else(cut)?;
            at += 4 + stored;
            let wanted = own / streams;
            match stored == wanted {
                true => packed.extend_from_slice(stream),
                false => packed.extend(inflate(flags >> 5, stream, wanted)?),
            }
        }
        if packed.len() != own {
            return Err(cut());
        }
        whole.extend(if flags & 0x1 != 0 {
            unshuffled(&packed, width)
        } else {
            packed
        });
    }
    Ok(whole)
}

/// A stream of one of Blosc's compressors.
fn inflate(compressor: u8, stream: &[u8], wanted: usize) -> CodecResult<Vec<u8>> {
    match compressor {
        1 => lz4_flex::block::decompress(stream, wanted).map_err(|e| e.to_string()),
        3 => unpacked(ZlibDecoder::new(stream), wanted),
        4 => zstd(stream, wanted),
        other => Err(format!("Blosc's compressor {other}")),
    }
}

/// The bytes of elements from the first bytes of all, the second bytes of all, ...
fn unshuffled(bytes: &[u8], width: usize) -> Vec<u8> {
    let count = bytes.len() / width;
    let mut whole = bytes.to_vec();
    for element in 0..count {
        for byte in 0..width {
            whole[element * width + byte] = bytes[byte * count + element];
        }
    }
    whole
}
