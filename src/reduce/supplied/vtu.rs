//! VTK's unstructured grids as XML: points and one vector of point data, as text or base64, plain or zlib.

use std::io::Read;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use roxmltree::{Document, Node};

use super::nodes::Nodes;
use crate::error::{Error, Result};

/// What programs call the displacement, in lower case.
const DISPLACEMENTS: [&str; 5] = ["displacement", "displacements", "disp", "u", "depl"];

/// Read the grid of a file, lengths in mm.
pub(super) fn read(path: &Path) -> Result<Nodes> {
    let wanted = || {
        Error::input(
            path.display(),
            "an unstructured grid of VTK (XML, lengths in mm)",
        )
    };
    let bytes = std::fs::read(path).map_err(|e| wanted().found(e))?;
    let text = String::from_utf8(bytes).map_err(|_| {
        wanted()
            .found("raw binary data")
            .hint("write it as text or with inline base64: ASCII or Binary, not Appended")
    })?;
    let document = Document::parse(&text).map_err(|e| wanted().found(e))?;
    let root = document.root_element();
    let layout = BinaryLayout::of(root).map_err(|e| wanted().found(e))?;
    let pieces: Vec<Node> = root
        .descendants()
        .filter(|n| n.has_tag_name("Piece"))
        .collect();
    let [piece] = pieces[..] else {
        return Err(wanted().found(format!("{} pieces, not one", pieces.len())));
    };
    let child = |name: &str| piece.children().find(|n| n.has_tag_name(name));
    let arrays = |name: &str| -> Vec<Node> {
        let arrays = child(name).into_iter().flat_map(|n| n.children());
        arrays.filter(|n| n.has_tag_name("DataArray")).collect()
    };
    let vectors = |node: Node| -> Result<Vec<[f64; 2]>> {
        let values = layout.values(node).map_err(|e| wanted().found(e))?;
        Ok(values.chunks_exact(3).map(|v| [v[0], v[1]]).collect())
    };
    let points = arrays("Points");
    let points = points.first().ok_or_else(|| wanted().found("no Points"))?;
    let data = arrays("PointData");
    let is_named = |n: &&Node| {
        let name = n.attribute("Name").unwrap_or_default().to_lowercase();
        DISPLACEMENTS.contains(&&*name)
    };
    let displacement = data.iter().find(is_named).ok_or_else(|| {
        let names: Vec<&str> = data.iter().filter_map(|n| n.attribute("Name")).collect();
        wanted()
            .found(format!("point data {names:?}"))
            .hint(format!(
                "the displacement is named {}",
                DISPLACEMENTS.join(", ")
            ))
    })?;
    if displacement.attribute("NumberOfComponents") != Some("3") {
        return Err(wanted().found("a displacement without 3 components"));
    }
    let nodes = Nodes {
        points: vectors(*points)?,
        displacement: vectors(*displacement)?,
    };
    match nodes.points.len() == nodes.displacement.len() {
        true => Ok(nodes),
        false => Err(wanted().found("another number of displacements than of points")),
    }
}

/// How binary arrays are written.
struct BinaryLayout {
    little: bool,
    /// Bytes of the numbers in their headers.
    header: usize,
    is_compressed: bool,
}

impl BinaryLayout {
    fn of(root: Node) -> std::result::Result<Self, String> {
        let compressor = root.attribute("compressor");
        if let Some(other) = compressor.filter(|c| *c != "vtkZLibDataCompressor") {
            return Err(format!("the compressor {other}, not zlib"));
        }
        Ok(Self {
            little: root.attribute("byte_order") != Some("BigEndian"),
            header: if root.attribute("header_type") == Some("UInt64") {
                8
            } else {
                4
            },
            is_compressed: compressor.is_some(),
        })
    }

    fn values(&self, node: Node) -> std::result::Result<Vec<f64>, String> {
        let text = node.text().unwrap_or_default().trim();
        match node.attribute("format") {
            Some("ascii") | None => {
                let number = |t: &str| t.parse().map_err(|_| format!("{t:?}, no number"));
                text.split_ascii_whitespace().map(number).collect()
            }
            Some("binary") => {
                let bytes = self.bytes(text).ok_or("base64 that ends too early")?;
                let width = match node.attribute("type") {
                    Some("Float32") => 4,
                    Some("Float64") => 8,
                    other => return Err(format!("numbers of type {other:?}")),
                };
                Ok(bytes.chunks_exact(width).map(|b| self.float(b)).collect())
            }
            Some(other) => Err(format!("data as {other}, not as ascii or binary")),
        }
    }

    fn float(&self, bytes: &[u8]) -> f64 {
        let mut own = bytes.to_vec();
        if !self.little {
            own.reverse();
        }
        match <[u8; 4]>::try_from(&own[..]) {
            Ok(four) => f64::from(f32::from_le_bytes(four)),
            Err(_) => <[u8; 8]>::try_from(&own[..]).map_or(f64::NAN, f64::from_le_bytes),
        }
    }

    fn whole(&self, bytes: &[u8]) -> Option<usize> {
        let fold = |sum: u64, b: &u8| sum << 8 | u64::from(*b);
        let number = match self.little {
            true => bytes.iter().rev().fold(0, fold),
            false => bytes.iter().fold(0, fold),
        };
        usize::try_from(number).ok()
    }

    /// The bytes of an inline array: its header, encoded with the data or, of compressed blocks, by itself.
    fn bytes(&self, text: &str) -> Option<Vec<u8>> {
        let decoded = |text: &str| STANDARD.decode(text).ok();
        // base64 of so many bytes
        let encoded = |bytes: usize| bytes.div_ceil(3) * 4;
        if !self.is_compressed {
            let all = decoded(text)?;
            let count = self.whole(all.get(..self.header)?)?;
            return all
                .get(self.header..self.header.checked_add(count)?)
                .map(<[u8]>::to_vec);
        }
        let start = decoded(text.get(..encoded(self.header))?)?;
        let blocks = self.whole(start.get(..self.header)?)?;
        let length = encoded(self.header.checked_mul(blocks.checked_add(3)?)?);
        let head = decoded(text.get(..length)?)?;
        let data = decoded(text.get(length..)?)?;
        let (mut out, mut from) = (Vec::new(), 0_usize);
        for k in 0..blocks {
            let place = self.header * (k + 3);
            let size = self.whole(head.get(place..place + self.header)?)?;
            let block = data.get(from..from.checked_add(size)?)?;
            flate2::read::ZlibDecoder::new(block)
                .read_to_end(&mut out)
                .ok()?;
            from += size;
        }
        Some(out)
    }
}
