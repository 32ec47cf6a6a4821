//! Numbers of an MSH file, ASCII or binary, which hold the same ones in the same order.

use super::super::draft::FileSpot;
use crate::error::{Error, Result};

const CUT: &str = "the file is cut short: save or copy it again";

/// A file being read. An ASCII record is one line.
pub(super) struct MeshText<'a> {
    file: String,
    bytes: &'a [u8],
    at: usize,
    /// Lines of text that were begun.
    line: u32,
    is_binary: bool,
    /// What is left of the record in ASCII.
    record: &'a [u8],
}

impl<'a> MeshText<'a> {
    pub fn new(bytes: &'a [u8], file: String) -> Self {
        Self {
            file,
            bytes,
            at: 0,
            line: 0,
            is_binary: false,
            record: &[],
        }
    }

    /// File and line, or byte of a binary file.
    pub fn place(&self) -> String {
        if self.is_binary {
            format!("{}: byte {}", self.file, self.at)
        } else {
            format!("{}:{}", self.file, self.line.max(1))
        }
    }

    /// The present line; none in a binary file.
    pub fn spot(&self) -> FileSpot {
        let line = if self.is_binary { 0 } else { self.line };
        FileSpot { file: 0, line }
    }

    pub fn is_binary(&self) -> bool {
        self.is_binary
    }

    /// Go on in binary, after the number 1 that shows the byte order.
    pub fn binary(&mut self) -> Result<()> {
        self.is_binary = true;
        match self.take()? {
            [1, 0, 0, 0] => Ok(()),
            [0, 0, 0, 1] => Err(self
                .error("a little-endian file")
                .found("the byte order of another machine (big-endian)")
                .hint("save as ASCII there (Mesh.Binary = 0), or open and save it with Gmsh on this machine")),
            other => Err(self
                .error("the number 1 in binary")
                .found(format!("bytes {other:?}"))
                .hint("the file was changed on its way, perhaps copied as text: copy it as binary, or save as ASCII")),
        }
    }

    /// An error of the input at the present place.
    pub fn error(&self, expected: &str) -> Error {
        Error::input(self.place(), expected)
    }

    fn ended(&self, expected: &str) -> Error {
        self.error(expected).found("the end of the file").hint(CUT)
    }

    /// The bytes of a line without its end.
    fn raw_line(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..).filter(|r| !r.is_empty())?;
        let length = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
        self.at += (length + 1).min(rest.len());
        self.line = self.line.saturating_add(1);
        Some(&rest[..length])
    }

    /// A line of text, trimmed; none at the end of the file.
    pub fn text_line(&mut self) -> Result<Option<String>> {
        let Some(line) = self.raw_line() else {
            return Ok(None);
        };
        let text = String::from_utf8_lossy(line.trim_ascii()).into_owned();
        Ok(Some(text))
    }

    /// The next line of text that is not blank.
    pub fn more_text(&mut self, expected: &str) -> Result<String> {
        while let Some(line) = self.text_line()? {
            if !line.is_empty() {
                return Ok(line);
            }
        }
        Err(self.ended(expected))
    }

    /// A line of text that holds one count.
    pub fn count_line(&mut self, expected: &str) -> Result<u64> {
        let line = self.more_text(expected)?;
        let count = line.parse();
        count.map_err(|_| self.error(expected).found(&line))
    }

    /// The line that ends a section.
    pub fn require(&mut self, line: &str) -> Result<()> {
        let found = self.more_text(line)?;
        if found == line {
            return Ok(());
        }
        Err(self.error(line).found(found).hint(
            "the section has more lines than its count says, or the file is damaged: save it again",
        ))
    }

    /// Pass over a section that names no part of the mesh.
    pub fn skip_section(&mut self, name: &str) -> Result<()> {
        let end = format!("$End{name}");
        if self.is_binary {
            let rest = self.bytes.get(self.at..).unwrap_or(&[]);
            let last = end.as_bytes();
            match rest.windows(last.len()).position(|w| w == last) {
                Some(at) => self.at += at + last.len(),
                None => return Err(self.ended(&end)),
            }
            self.raw_line();
            return Ok(());
        }
        while let Some(line) = self.raw_line() {
            if line.trim_ascii() == end.as_bytes() {
                return Ok(());
            }
        }
        Err(self.ended(&end))
    }

    /// Begin a record; `expected` says what it is if the file ends here.
    pub fn open(&mut self, expected: &str) -> Result<()> {
        if self.is_binary {
            return Ok(());
        }
        loop {
            let Some(line) = self.raw_line() else {
                return Err(self.ended(expected));
            };
            self.record = line.trim_ascii();
            if !self.record.is_empty() {
                break;
            }
        }
        if self.record.starts_with(b"$") {
            let line = String::from_utf8_lossy(self.record).into_owned();
            return Err(self
                .error(expected)
                .found(line)
                .hint("the section has fewer lines than its count says: the file is damaged, save it again"));
        }
        Ok(())
    }

    /// End a record.
    pub fn close(&mut self) -> Result<()> {
        if self.is_binary || self.record.is_empty() {
            return Ok(());
        }
        let rest = String::from_utf8_lossy(self.record).into_owned();
        Err(self.error("the end of the line").found(rest))
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N]> {
        let bytes = self
            .bytes
            .get(self.at..)
            .and_then(|rest| rest.first_chunk::<N>());
        match bytes {
            Some(bytes) => {
                self.at += N;
                Ok(*bytes)
            }
            None => Err(self.ended("more numbers")),
        }
    }

    fn word<T: std::str::FromStr>(&mut self, expected: &str) -> Result<T> {
        let record = self.record;
        let end = record
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(record.len());
        let (word, rest) = record.split_at(end);
        if word.is_empty() {
            let error = self.error(expected).found("the end of the line");
            return Err(error.hint("a line is cut short, or has fewer numbers than its type or count says: save or copy the file again"));
        }
        self.record = rest.trim_ascii_start();
        let number = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        number.ok_or_else(|| self.error(expected).found(String::from_utf8_lossy(word)))
    }

    /// A whole number of 4 bytes.
    pub fn int(&mut self, expected: &str) -> Result<i64> {
        if self.is_binary {
            return Ok(i64::from(i32::from_le_bytes(self.take()?)));
        }
        self.word(expected)
    }

    /// A number of something, or of a node or element, of 8 bytes.
    pub fn size(&mut self, expected: &str) -> Result<u64> {
        if self.is_binary {
            return Ok(u64::from_le_bytes(self.take()?));
        }
        self.word(expected)
    }

    /// A number, finite or not.
    pub fn any_real(&mut self, expected: &str) -> Result<f64> {
        if self.is_binary {
            return Ok(f64::from_le_bytes(self.take()?));
        }
        self.word(expected)
    }

    /// A finite number.
    pub fn real(&mut self, expected: &str) -> Result<f64> {
        let value = self.any_real(expected)?;
        if value.is_finite() {
            return Ok(value);
        }
        Err(self
            .error("a finite number")
            .found(value)
            .hint("the geometry or its transformation is broken there: look at the node in Gmsh"))
    }
}
