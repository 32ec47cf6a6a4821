//! NumPy `.npz`, as emcee users keep chains: `chain` (draw x walker x parameter), `log_prob` (draw x walker), `names`,
//! `ensemble`. A zip archive without compression.

use std::path::Path;

use super::draws::Chains;
use crate::error::{Error, Result};

/// Writes the file. Its arrays are draw by draw, so all draws are in memory at once.
///
/// # Errors
/// The input's fault (with the path) if it cannot be written.
pub fn write_npz(chains: &dyn Chains, path: &Path) -> Result<()> {
    let (count, dim) = (chains.count(), chains.names().len());
    let (mut chain, mut lp, mut ensemble) = (Vec::new(), Vec::new(), Vec::new());
    let mut draws = 0;
    for c in 0..count {
        let one = chains.chain(c)?;
        draws = one.draws();
        chain.resize(8 * draws * count * dim, 0);
        lp.resize(8 * draws * count, 0);
        let rows = chain.chunks_exact_mut(8 * dim).skip(c).step_by(count);
        for (row, point) in rows.zip(one.points()) {
            for (bytes, value) in row.chunks_exact_mut(8).zip(point) {
                bytes.copy_from_slice(&value.to_le_bytes());
            }
        }
        let rows = lp.chunks_exact_mut(8).skip(c).step_by(count);
        rows.zip(one.lp())
            .for_each(|(bytes, value)| bytes.copy_from_slice(&value.to_le_bytes()));
        ensemble.extend((one.ensemble()[0] as i64).to_le_bytes());
    }
    let width = chains
        .names()
        .iter()
        .map(|n| n.chars().count())
        .max()
        .unwrap_or(1);
    let names: Vec<u8> = chains
        .names()
        .iter()
        .flat_map(|n| n.chars().chain(std::iter::repeat('\0')).take(width))
        .flat_map(|c| u32::from(c).to_le_bytes())
        .collect();
    let members = [
        (
            "chain.npy",
            npy("<f8", &format!("({draws}, {count}, {dim})"), &chain),
        ),
        (
            "log_prob.npy",
            npy("<f8", &format!("({draws}, {count})"), &lp),
        ),
        (
            "names.npy",
            npy(&format!("<U{width}"), &format!("({dim},)"), &names),
        ),
        (
            "ensemble.npy",
            npy("<i8", &format!("({count},)"), &ensemble),
        ),
    ];
    if members
        .iter()
        .any(|(_, bytes)| bytes.len() > u32::MAX as usize / 4)
    {
        return Err(Error::input(path.display(), "less than 1 GiB an array")
            .hint("export to another format, or read chain.zarr"));
    }
    std::fs::write(path, zip(&members))
        .map_err(|e| Error::input(path.display(), "a writable file").found(e))
}

/// NumPy's format, version 1.0.
fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    while !(10 + header.len() + 1).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(data);
    out
}

/// A zip archive of stored members (PKWARE's APPNOTE, sections 4.3.7, 4.3.12 and 4.3.16).
fn zip(members: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in members {
        let offset = out.len() as u32;
        let mut common = Vec::new();
        // Version 2.0, no flags, stored, no time, 1 January 1980.
        for word in [20_u16, 0, 0, 0, 0x21] {
            common.extend(word.to_le_bytes());
        }
        for word in [crc32(bytes), bytes.len() as u32, bytes.len() as u32] {
            common.extend(word.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        common.extend(0_u16.to_le_bytes());
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.as_bytes());
        out.extend(bytes);
        directory.extend(b"PK\x01\x02");
        directory.extend(20_u16.to_le_bytes());
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (start, length) = (out.len() as u32, directory.len() as u32);
    out.extend(directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    for _ in 0..2 {
        out.extend((members.len() as u16).to_le_bytes());
    }
    out.extend(length.to_le_bytes());
    out.extend(start.to_le_bytes());
    out.extend([0; 2]);
    out
}

fn crc32(bytes: &[u8]) -> u32 {
    let mut table = [0_u32; 256];
    for (k, entry) in table.iter_mut().enumerate() {
        *entry = (0..8).fold(k as u32, |c, _| {
            if c & 1 == 1 {
                0xEDB8_8320 ^ (c >> 1)
            } else {
                c >> 1
            }
        });
    }
    !bytes.iter().fold(!0_u32, |c, b| {
        table[((c ^ u32::from(*b)) & 0xFF) as usize] ^ (c >> 8)
    })
}
