//! Small maps on one scale: what is left of every step of a series, and the stiffness that would make what grows with its load.

use indexmap::IndexSet;
use plotters::style::text_anchor::HPos;

use super::canvas::{Area, Figure, Stretched, draw, say};
use super::maps::{MapAxes, Scale, bar, covering, framed};
use crate::error::Result;
use crate::report::numbers::{StepCell, StiffnessCell};

/// Maps beside each other, at most.
const ACROSS: usize = 5;

/// Width of a map and its largest height, room above, beside and below it, and room for the scale, pixels.
const WIDTH: u32 = 150;
const HIGHEST: f64 = 260.0;
const TOP: u32 = 22;
const LEFT: u32 = 42;
const RIGHT: u32 = 10;
const AXIS: u32 = 34;
const BAR: u32 = 56;
const BAR_WIDTH: u32 = 360;

/// A value at a place (x, y), mm.
type PlacedValue = ([f64; 2], f64);

/// Blocks of all maps on one lattice.
struct BlockLattice {
    x: Vec<f64>,
    y: Vec<f64>,
}

impl BlockLattice {
    fn of<'a>(spots: impl Iterator<Item = &'a PlacedValue> + Clone) -> Self {
        let axis = |k: usize| {
            let mut values: Vec<f64> = spots.clone().map(|(at, _)| at[k]).collect();
            values.sort_by(f64::total_cmp);
            values.dedup_by(|b, a| *b - *a < 1e-4);
            values
        };
        Self {
            x: axis(0),
            y: axis(1),
        }
    }

    /// Side of a block: the least distance along either axis, or a millimetre of a single block.
    fn side(&self) -> f64 {
        let gaps = [&self.x, &self.y].into_iter().flat_map(|a| a.windows(2));
        let least = gaps.map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 1.0 }
    }

    /// Columns or rows from the first to the last place, empty ones among them, and the edges.
    fn axis(&self, places: &[f64]) -> (usize, [f64; 2]) {
        let (first, last) = (places[0], places[places.len() - 1]);
        let side = self.side();
        let count = ((last - first) / side).round() as usize + 1;
        (count, [first - 0.5 * side, last + 0.5 * side])
    }

    /// Values from the top row down; NaN where there is no block.
    fn values(&self, spots: &[PlacedValue]) -> Vec<f64> {
        let [(columns, _), (rows, _)] = [self.axis(&self.x), self.axis(&self.y)];
        let mut values = vec![f64::NAN; columns * rows];
        let place = |at: f64, first: f64| ((at - first) / self.side()).round() as usize;
        for ([x, y], value) in spots {
            let (i, j) = (place(*x, self.x[0]), place(*y, self.y[0]));
            if let Some(v) = values.get_mut((rows - 1 - j.min(rows - 1)) * columns + i) {
                *v = *value;
            }
        }
        values
    }
}

/// One of several maps on one scale.
struct Small {
    /// Row and column.
    at: [usize; 2],
    title: String,
    spots: Vec<PlacedValue>,
}

/// What is left of each step: u1 above u2, step by step. None of a single field.
pub fn steps(cells: &[StepCell]) -> Result<Option<Figure>> {
    let names: IndexSet<&str> = cells.iter().map(|c| c.step.as_str()).collect();
    let small = |k: usize, name: &str, component: usize| Small {
        at: [2 * (k / ACROSS) + component - 1, k % ACROSS],
        title: format!("u{component} {name}"),
        spots: cells
            .iter()
            .filter(|c| c.step == name)
            .map(|c| {
                let of = [c.u1_residual_nm, c.u2_residual_nm][component - 1];
                ([c.x_mm, c.y_mm], of)
            })
            .collect(),
    };
    let of = |(k, name): (usize, &&str)| [1, 2].map(|component| small(k, name, component));
    let maps: Vec<Small> = names.iter().enumerate().flat_map(of).collect();
    let alt = format!(
        "Residual of each of {} steps after the last round, nm: block averages of u1 (along the load) and u2 (across), on one scale",
        names.len()
    );
    several("steps", alt, &maps, "nm")
}

/// The membrane stiffness that would make structure which grows with the load, with its sd. None where nothing asks for it.
pub fn stiffness(cells: &[StiffnessCell]) -> Result<Option<Figure>> {
    let small = |column: usize, title: &str, of: &dyn Fn(&StiffnessCell) -> f64| Small {
        at: [0, column],
        title: title.into(),
        spots: cells.iter().map(|c| ([c.x_mm, c.y_mm], of(c))).collect(),
    };
    let maps = [
        small(0, "change of the stiffness", &|c| c.change_percent),
        small(1, "its sd", &|c| c.sd_percent),
    ];
    let alt = "The relative change of the membrane stiffness that would make the structure which grows with the load, and its sd, percent, on one scale";
    several("stiffness", alt.into(), &maps, "%")
}

/// Maps on one lattice and one scale; none of no value.
fn several(
    name: &'static str,
    alt: String,
    maps: &[Small],
    unit: &'static str,
) -> Result<Option<Figure>> {
    let spots = maps.iter().flat_map(|m| &m.spots);
    if spots.clone().next().is_none() {
        return Ok(None);
    }
    let lattice = BlockLattice::of(spots.clone());
    let scale = Scale {
        unit,
        ..covering(spots.map(|s| s.1.abs()))
    };
    let [(_, x), (_, y)] = [lattice.axis(&lattice.x), lattice.axis(&lattice.y)];
    let aspect = (y[1] - y[0]) / (x[1] - x[0]);
    let height = (f64::from(WIDTH) * aspect).clamp(40.0, HIGHEST);
    let width = (height / aspect).clamp(40.0, f64::from(WIDTH)).round() as u32;
    let panel = (LEFT + width + RIGHT, TOP + height.round() as u32 + AXIS);
    let most = |k: usize| maps.iter().map(|m| m.at[k] as u32 + 1).max().unwrap_or(1);
    let size = ((most(1) * panel.0).max(BAR_WIDTH), most(0) * panel.1 + BAR);
    let figure = draw(name, alt, size, |root, images| {
        for Small {
            at: [row, column],
            title,
            spots,
        } in maps
        {
            let at = (*column as u32 * panel.0, *row as u32 * panel.1);
            let area = root.clone().shrink(at, panel);
            map(
                &area,
                images,
                (&lattice, &lattice.values(spots)),
                scale,
                title,
            )?;
        }
        let at = (0, size.1 - BAR);
        let lower = root.clone().shrink(at, (BAR_WIDTH, BAR));
        bar(&lower, images, scale)
    })?;
    Ok(Some(figure))
}

/// Letters of a map's title, at most.
const LETTERS: usize = 24;

fn map(
    area: &Area<'_>,
    images: &mut Vec<Stretched>,
    (lattice, values): (&BlockLattice, &[f64]),
    scale: Scale,
    title: &str,
) -> Result<()> {
    let [(columns, x), (_, y)] = [lattice.axis(&lattice.x), lattice.axis(&lattice.y)];
    let title: String = if title.chars().count() > LETTERS {
        let kept = title.chars().take(LETTERS - 1);
        kept.chain(['\u{2026}']).collect()
    } else {
        title.into()
    };
    say(area, title, (LEFT as i32, 12), 12, HPos::Left)?;
    let axes = MapAxes {
        edges: [x, y],
        margins: [TOP, RIGHT, AXIS, LEFT],
        numbers: [3, 7],
        letters: 10,
    };
    framed(area, images, (values, columns), scale, &axes)
}
