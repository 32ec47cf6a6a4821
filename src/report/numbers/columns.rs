//! Rows of a table as JSON columns: `{"x_mm": [0, 1], "u1_nm": [3, null]}`, as plotting scripts take them.

use serde::de::{DeserializeOwned, Error as _};
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value};

use crate::files::Keyed;

/// The columns of rows, in the order of the first row's keys.
pub fn columns(rows: &[impl Serialize]) -> serde_json::Result<Keyed<Vec<Value>>> {
    let mut columns: Keyed<Vec<Value>> = Keyed::new();
    for row in rows {
        let cells: Keyed<Value> = serde_json::from_value(serde_json::to_value(row)?)?;
        for (name, cell) in cells {
            columns.entry(name).or_default().push(cell);
        }
    }
    Ok(columns)
}

/// [`columns`] for a field of a struct.
pub fn serialize<S: Serializer, T: Serialize>(rows: &[T], to: S) -> Result<S::Ok, S::Error> {
    columns(rows).map_err(S::Error::custom)?.serialize(to)
}

/// Rows from [`columns`], all of one length.
pub fn deserialize<'de, D: Deserializer<'de>, T: DeserializeOwned>(
    from: D,
) -> Result<Vec<T>, D::Error> {
    let columns = Keyed::<Vec<Value>>::deserialize(from)?;
    let count = columns.values().map(Vec::len).max().unwrap_or(0);
    if columns.values().any(|column| column.len() != count) {
        return Err(D::Error::custom("columns of different lengths"));
    }
    let row = |k: usize| {
        let cells = columns
            .iter()
            .map(|(name, column)| (name.clone(), column[k].clone()));
        serde_json::from_value(Value::Object(cells.collect::<Map<_, _>>()))
    };
    let rows: serde_json::Result<Vec<T>> = (0..count).map(row).collect();
    rows.map_err(D::Error::custom)
}
