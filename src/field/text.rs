//! The text of a file of any program: its encoding, and what is no text at all.

use std::fs;
use std::path::Path;

use encoding_rs::{Encoding, UTF_16BE, UTF_16LE, WINDOWS_1252};

use super::reader::unreadable;
use super::{matlab, programs};
use crate::error::{Error, Result};
use crate::files::{in_place_of, is_hierarchical};

/// Bytes that Windows-1252 does not have.
const UNDEFINED: [u8; 5] = [0x81, 0x8d, 0x8f, 0x90, 0x9d];

/// A text in Windows-1252 has fewer bytes beyond ASCII than one in so many.
const FEW: usize = 5;

/// The text of the table at `path`, and the encoding if it is worth a word. Arrays of MATLAB become a table.
///
/// # Errors
/// Of the input: a file that cannot be read, or is no text.
pub(super) fn read(path: &Path) -> Result<(String, Option<&'static str>)> {
    let bytes = fs::read(path).map_err(|e| unreadable(path, &e))?;
    if let Some((what, hint)) = in_place_of(&bytes) {
        return Err(Error::input(
            path.display(),
            "a table of text, or a .mat file of MATLAB 4 to 7",
        )
        .found(what)
        .hint(match is_hierarchical(&bytes) {
            true => format!("{}; of MATLAB save with '-v7'", programs::as_text()),
            false => hint.into(),
        }));
    }
    if let Some(text) = matlab::as_text(path, &bytes)? {
        return Ok((text, Some("MATLAB arrays")));
    }
    let (mut text, encoding) = decoded(path, &bytes)?;
    if !text.contains('\n') {
        // lines as the first Macintosh ended them
        text = text.replace('\r', "\n");
    }
    if let Some(at) = text.find('\0') {
        let line = 1 + text[..at].matches('\n').count();
        return Err(Error::input(format!("{}:{line}", path.display()), "text")
            .found("byte 0x00")
            .hint("a binary file? export the points as a table of text"));
    }
    Ok((text, encoding))
}

/// The text of a file of settings, in whatever encoding an editor saves.
///
/// # Errors
/// Of the input: a file that is no text.
pub fn of_settings(path: &Path, bytes: &[u8]) -> Result<String> {
    Ok(decoded(path, bytes)?.0)
}

/// The same of a file that is still to be read.
///
/// # Errors
/// Of the input: a file that cannot be read or is no text.
pub(in crate::field) fn read_settings(path: &Path) -> Result<String> {
    let bytes = fs::read(path).map_err(|e| unreadable(path, &e))?;
    of_settings(path, &bytes)
}

fn decoded(path: &Path, bytes: &[u8]) -> Result<(String, Option<&'static str>)> {
    if let Some((encoding, mark)) = Encoding::for_bom(bytes).or_else(|| unmarked_utf16(bytes)) {
        let (text, failed) = encoding.decode_without_bom_handling(&bytes[mark..]);
        if !failed {
            let name = (encoding != encoding_rs::UTF_8).then(|| encoding.name());
            return Ok((text.into_owned(), name));
        }
    }
    let error = match std::str::from_utf8(bytes) {
        Ok(text) => return Ok((text.to_string(), None)),
        Err(error) => error.valid_up_to(),
    };
    let beyond = bytes.iter().filter(|b| !b.is_ascii()).count();
    let is_text = beyond * FEW < bytes.len() && !bytes.iter().any(|b| UNDEFINED.contains(b));
    if is_text {
        let (text, _) = WINDOWS_1252.decode_without_bom_handling(bytes);
        return Ok((text.into_owned(), Some("Windows-1252")));
    }
    let line = 1 + bytes[..error].iter().filter(|b| **b == b'\n').count();
    let place = format!("{}:{line}", path.display());
    Err(Error::input(place, "text in UTF-8, UTF-16 or Windows-1252")
        .found(format!(
            "byte 0x{:02x}",
            bytes.get(error).copied().unwrap_or(0)
        ))
        .hint("save the file as plain UTF-8 text"))
}

/// UTF-16 without a mark: every other byte of a text in Latin letters is 0.
fn unmarked_utf16(bytes: &[u8]) -> Option<(&'static Encoding, usize)> {
    let head = &bytes[..bytes.len().min(400) / 2 * 2];
    let zeros = |odd: usize| head.chunks(2).filter(|pair| pair[odd] == 0).count();
    let most = |odd: usize| head.len() >= 8 && 10 * zeros(odd) > 9 * (head.len() / 2);
    match (most(0), most(1)) {
        (true, false) => Some((UTF_16BE, 0)),
        (false, true) => Some((UTF_16LE, 0)),
        _ => None,
    }
}
