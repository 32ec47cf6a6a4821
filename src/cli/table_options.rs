//! What the user says of tables: `--columns`, `--units`, `--mm-per-pixel`.

use clap::Args;
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::field::{Columns, programs};

/// Arguments of verbs that read tables.
#[derive(Debug, Args)]
pub struct TableArguments {
    /// Size of a pixel on the specimen, mm, for exports in pixels
    #[arg(long, value_name = "MM", requires = "csv", value_parser = length_mm)]
    pub mm_per_pixel: Option<f64>,
    /// Columns of a table of any program: x=NAME,y=NAME,ux=NAME,uy=NAME[,uz=NAME,sigma=NAME,correlation=NAME]
    #[arg(long, value_name = "KEY=NAME,..", requires = "csv")]
    pub columns: Option<String>,
    /// Unit of a table that states none: mm, m, um, nm or in. Two units, as in mm,um, are those of coordinates and displacements
    #[arg(long, value_name = "UNIT", requires = "csv")]
    pub units: Option<String>,
    /// y counts downwards, as in a picture: turn y and uy, so that angles count counter-clockwise as the camera sees the specimen
    #[arg(long, requires = "csv")]
    pub y_down: bool,
    /// Side of a subset of the image correlation, mm
    #[arg(long, value_name = "MM", group = "subset", value_parser = length_mm)]
    pub subset_mm: Option<f64>,
    /// The same in pixels, if the size of a pixel is known (--mm-per-pixel, or columns in pixels and mm)
    #[arg(long, value_name = "PX", group = "subset", requires = "csv", value_parser = pixels)]
    pub subset_px: Option<f64>,
    /// Distance of the camera from the specimen, mm (a rough value is enough)
    #[arg(long, value_name = "MM", requires = "subset", value_parser = length_mm)]
    pub camera_distance_mm: Option<f64>,
}

impl TableArguments {
    /// How the images were correlated.
    pub fn images(&self, subset_mm: f64) -> Value {
        let mut images = json!({ "subset_mm": subset_mm });
        if let Some(distance) = self.camera_distance_mm {
            images["camera_distance_mm"] = json!(distance);
        }
        images
    }
}

/// A size as it is typed.
fn length_mm(text: &str) -> std::result::Result<f64, String> {
    above_0(text, "a length in mm")
}

fn pixels(text: &str) -> std::result::Result<f64, String> {
    above_0(text, "a number of pixels")
}

fn above_0(text: &str, what: &str) -> std::result::Result<f64, String> {
    let size = text.trim().parse::<f64>().ok();
    let size = size.filter(|s| s.is_finite() && *s > 0.0);
    size.ok_or_else(|| format!("expected {what} above 0"))
}

/// What the user says of the tables.
pub struct TableOptions {
    pub columns: Option<Columns>,
    /// Column of the displacement out of the plane.
    pub uz: Option<String>,
    /// Units of the coordinates and of the displacements.
    pub units: Option<[&'static str; 2]>,
    pub mm_per_pixel: Option<f64>,
    pub subset_px: Option<f64>,
    pub y_down: bool,
}

impl TableOptions {
    /// Columns as `--columns x=A,y=B,ux=C,uy=D` names them, with units as `--units mm` or `mm,um` does.
    ///
    /// # Errors
    /// Of the input: an unknown or repeated key, a key that is missing, an unknown unit.
    pub fn of(arguments: &TableArguments) -> Result<Self> {
        let columns = arguments.columns.as_deref().map(parsed).transpose()?;
        let (columns, uz) = columns.unzip();
        let units = arguments.units.as_deref().map(|text| {
            let parts: Vec<_> = text.split(',').map(programs::unit_of).collect();
            match parts[..] {
                [Some(both)] => Ok([both; 2]),
                [Some(a), Some(b)] => Ok([a, b]),
                _ => Err(Error::input("--units", "one of m, mm, um, nm, in, px, or two with a comma between: coordinates,displacements").found(text)),
            }
        });
        Ok(Self {
            columns,
            uz: uz.flatten(),
            units: units.transpose()?,
            mm_per_pixel: arguments.mm_per_pixel,
            subset_px: arguments.subset_px,
            y_down: arguments.y_down,
        })
    }
}

fn parsed(text: &str) -> Result<(Columns, Option<String>)> {
    const KEYS: [&str; 7] = ["x", "y", "ux", "uy", "uz", "sigma", "correlation"];
    let wrong = |found: &str| {
        Error::input(
            "--columns",
            "x=NAME,y=NAME,ux=NAME,uy=NAME, and if need be uz=, sigma=, correlation=, each once",
        )
        .found(found)
    };
    let mut values: [Option<String>; 7] = Default::default();
    let mut last: Option<usize> = None;
    // a comma belongs to a name if no key follows
    for part in text.split(',') {
        let key = part
            .split_once('=')
            .and_then(|(key, name)| Some((KEYS.iter().position(|k| *k == key.trim())?, name)));
        match (key, last) {
            (Some((k, name)), _) => {
                if values[k].replace(name.trim().to_string()).is_some() {
                    return Err(wrong(part));
                }
                last = Some(k);
            }
            (None, Some(k)) => {
                let name = values[k].take().unwrap_or_default();
                values[k] = Some(format!("{name},{part}"));
            }
            (None, None) => return Err(wrong(part)),
        }
    }
    let [x, y, ux, uy, uz, sigma, correlation] = values;
    let (Some(x), Some(y), Some(ux), Some(uy)) = (x, y, ux, uy) else {
        return Err(wrong(text));
    };
    Ok((
        Columns {
            sigma,
            correlation,
            ..Columns::new([x, y, ux, uy])
        },
        uz,
    ))
}
