//! The measured rows of a table, in their order; what stands at one place twice is one point.

use std::collections::HashMap;
use std::path::Path;

use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::level::TiltedPlane;
use super::row::MeasuredRow;
use crate::error::{Error, Result};
use crate::numeric::median;

/// Rows that were read so far.
#[derive(Default)]
pub(super) struct TableRows {
    pub all: Vec<MeasuredRow>,
    /// Rows that stand in the table already, cell by cell.
    pub again: usize,
    /// Index of the first row at each place, by the bits of its coordinates, and the line of every row.
    first: HashMap<[u64; 2], usize>,
    lines: Vec<usize>,
    /// Further rows at places, with another displacement: index of the first one, and line.
    others: Vec<(usize, MeasuredRow, usize)>,
}

impl TableRows {
    /// A row at some line of the file.
    pub fn add(&mut self, row: MeasuredRow, line: usize) {
        // 0 is added to make one of both zeros
        let key = row.at.map(|x| (x + 0.0).to_bits());
        let first = *self.first.entry(key).or_insert(self.all.len());
        match self.all.get(first) {
            None => {
                self.all.push(row);
                self.lines.push(line);
            }
            Some(known) if known.u == row.u => self.again += 1,
            Some(_) => self.others.push((first, row, line)),
        }
    }

    /// The row of zeros alone goes.
    pub fn drop_unfilled(&mut self) {
        let Some(at) = self.all.iter().position(MeasuredRow::is_unfilled) else {
            return;
        };
        self.all.remove(at);
        self.lines.remove(at);
        self.others.retain(|(k, ..)| *k != at);
        for (k, ..) in &mut self.others {
            *k -= usize::from(*k > at);
        }
    }

    /// Rows at one place become one with their mean displacement, or none where they differ by more than the noise of the table (the faces of
    /// a crack); those that went are counted. Returns what is said.
    ///
    /// # Errors
    /// Of the input: most places have several displacements.
    pub fn settle(&mut self, path: &Path, repeated: &mut usize) -> Result<Option<String>> {
        /// Two rows differ if their difference is so many times that of neighbouring points.
        const FAR: f64 = 5.0;
        let mut at: Vec<Vec<&MeasuredRow>> = self.all.iter().map(|row| vec![row]).collect();
        for (k, row, _) in &self.others {
            at[*k].push(row);
        }
        let several = at.iter().filter(|rows| rows.len() > 1).count();
        let Some((k, _, line)) = self.others.first() else {
            return Ok(None);
        };
        if 2 * several > at.len() {
            let place = |line: usize| format!("{}:{line}", path.display());
            return Err(
                Error::input(place(*line), "one displacement of every point")
                    .found(format!(
                        "another one of the point of {}",
                        place(self.lines[*k])
                    ))
                    .hint("are these two steps in one file? give each step a file of its own"),
            );
        }
        let noise = self.neighbouring();
        let far = |rows: &[&MeasuredRow]| {
            let off = |row: &&MeasuredRow| apart(row.u, rows[0].u) > FAR * noise;
            rows.iter().any(off)
        };
        let odd: Vec<bool> = at.iter().map(|rows| far(rows)).collect();
        let mean = |rows: &Vec<&MeasuredRow>| {
            [0, 1].map(|k| rows.iter().map(|r| r.u[k]).sum::<f64>() / rows.len() as f64)
        };
        let means: Vec<[f64; 2]> = at.iter().map(mean).collect();
        let left_out: usize = at
            .iter()
            .zip(&odd)
            .filter(|(_, odd)| **odd)
            .map(|(r, _)| r.len())
            .sum();
        let merged = self.others.iter().filter(|(k, ..)| !odd[*k]).count();
        *repeated += left_out + merged;
        for (row, mean) in self.all.iter_mut().zip(means) {
            row.u = mean;
        }
        self.others.clear();
        let mut each = odd.iter();
        self.all.retain(|_| each.next() == Some(&false));
        let mut said = Vec::new();
        if merged > 0 {
            said.push(format!("{merged} rows at places that stand in the file already are merged: the point has their mean displacement"));
        }
        if left_out > 0 {
            said.push(format!("{left_out} rows are left out: at their places the file has displacements that differ by more than noise (the faces of a crack?)"));
        }
        Ok(Some(said.join("; ")))
    }

    /// Median difference of the displacements of neighbouring points, mm: it is that of the noise, or more.
    fn neighbouring(&self) -> f64 {
        let points = self.all.iter().enumerate();
        let tree = RTree::bulk_load(points.map(|(k, r)| GeomWithData::new(r.at, k)).collect());
        let differences = self.all.iter().filter_map(|row| {
            let next = tree.nearest_neighbor_iter(row.at).nth(1)?;
            Some(apart(self.all[next.data].u, row.u))
        });
        median(&mut differences.collect::<Vec<f64>>())
    }

    /// The plane through all points, where every row has both numbers out of the plane.
    pub fn plane(&self) -> Option<TiltedPlane> {
        let places = self.all.iter().map(|row| {
            let [z, uz] = row.out_of_plane;
            (z.is_finite() && uz.is_finite()).then_some([row.at[0], row.at[1], z])
        });
        TiltedPlane::through(&places.collect::<Option<Vec<_>>>()?)
    }
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}
