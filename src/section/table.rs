//! A table of typed cells.

use serde::{Deserialize, Serialize};

use super::cell::TableCell;

/// Rows under a header; the first column holds the rows' names.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Table {
    pub caption: String,
    pub header: Vec<String>,
    pub rows: Vec<Vec<TableCell>>,
    /// Whether rows may be put in another order.
    pub sortable: bool,
}

impl Table {
    /// A table without the columns that are blank in every row.
    pub fn new(
        caption: impl Into<String>,
        header: impl IntoIterator<Item = impl Into<String>>,
        rows: impl IntoIterator<Item = Vec<TableCell>>,
    ) -> Self {
        let header: Vec<String> = header.into_iter().map(Into::into).collect();
        let mut rows: Vec<Vec<TableCell>> = rows.into_iter().collect();
        for row in &mut rows {
            row.resize(header.len(), TableCell::Blank);
        }
        let is_kept = |k: usize| rows.is_empty() || rows.iter().any(|row| !row[k].is_blank());
        let kept: Vec<bool> = (0..header.len()).map(is_kept).collect();
        fn pick<T>(items: Vec<T>, kept: &[bool]) -> Vec<T> {
            let kept_items = items.into_iter().zip(kept).filter(|(_, keep)| **keep);
            kept_items.map(|(item, _)| item).collect()
        }
        Self {
            caption: caption.into(),
            header: pick(header, &kept),
            rows: rows.into_iter().map(|row| pick(row, &kept)).collect(),
            sortable: false,
        }
    }

    pub fn sortable(self) -> Self {
        Self {
            sortable: true,
            ..self
        }
    }

    /// Whether there is nothing to show.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

/// A row: its name and its cells.
pub fn row(
    name: impl Into<TableCell>,
    cells: impl IntoIterator<Item = TableCell>,
) -> Vec<TableCell> {
    std::iter::once(name.into()).chain(cells).collect()
}
