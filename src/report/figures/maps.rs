//! Maps: measured, predicted, residual, in the data's frame at their true aspect, with colour bars.

use plotters::prelude::*;

use super::canvas::{
    Area, Figure, INK, NOT_MEASURED, Stretched, axes_mm, divisible, draw, span, step, text,
};
use super::colour::Palette;
use crate::error::Result;
use crate::numeric::quantile;
use crate::report::numbers::MapCell;

/// What of a round is mapped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mapped {
    Measured,
    Predicted,
    Residual,
}

impl Mapped {
    pub const ALL: [Self; 3] = [Self::Measured, Self::Predicted, Self::Residual];

    pub fn name(self) -> &'static str {
        ["measured", "predicted", "residual"][self as usize]
    }

    /// Its value in a cell; NaN where nothing was measured.
    fn of(self, cell: &MapCell, component: usize) -> f64 {
        match (self, component) {
            (Self::Measured, 1) => cell.u1_measured_um,
            (Self::Measured, _) => cell.u2_measured_um,
            (Self::Predicted, 1) => cell.u1_predicted_um,
            (Self::Predicted, _) => cell.u2_predicted_um,
            (Self::Residual, 1) => cell.u1_residual_nm,
            (Self::Residual, _) => cell.u2_residual_nm,
        }
    }
}

pub struct Raster {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    /// Row by row from the lowest y.
    pub values: Vec<f64>,
}

impl Raster {
    fn of(cells: &[MapCell], component: usize, what: Mapped) -> Self {
        let axis = |place: &dyn Fn(&MapCell) -> f64| {
            let mut values: Vec<f64> = cells.iter().map(place).collect();
            values.retain(|v| v.is_finite());
            values.sort_by(f64::total_cmp);
            values.dedup();
            values
        };
        let (x, y) = (axis(&|c| c.x_mm), axis(&|c| c.y_mm));
        let mut values: Vec<f64> = cells.iter().map(|c| what.of(c, component)).collect();
        values.resize(x.len() * y.len(), f64::NAN);
        Self { x, y, values }
    }

    /// Outer edges of the cells.
    fn edges(axis: &[f64]) -> [f64; 2] {
        let (first, last) = (axis[0], axis[axis.len() - 1]);
        let half = 0.5 * (last - first).max(1e-9) / (axis.len() - 1).max(1) as f64;
        [first - half, last + half]
    }

    /// Values from the top row down, as images have them.
    fn top_down(&self) -> Vec<f64> {
        let rows: Vec<&[f64]> = self.values.chunks(self.x.len()).collect();
        rows.into_iter().rev().flatten().copied().collect()
    }
}

/// Colours and range of a map.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    pub palette: Palette,
    /// Values at the ends.
    pub range: [f64; 2],
    pub unit: &'static str,
}

/// The scale of a component's field: what the measured and predicted values of a round span.
pub fn field_scale(cells: &[MapCell], component: usize) -> Scale {
    let of = |c: &MapCell| [Mapped::Measured, Mapped::Predicted].map(|w| w.of(c, component));
    Scale {
        palette: Palette::Field,
        range: span(cells.iter().flat_map(of)),
        unit: "\u{b5}m",
    }
}

/// Share of residuals that a scale covers.
const COVERED: f64 = 0.995;

/// The scale of residuals of both components over several rounds, symmetric about zero.
pub fn residual_scale(rounds: &[&[MapCell]]) -> Scale {
    let cells = rounds.iter().copied().flatten();
    covering(cells.flat_map(|c| [1, 2].map(|k| Mapped::Residual.of(c, k).abs())))
}

/// A scale symmetric about zero that covers nearly all of some sizes, nm.
pub fn covering(sizes: impl Iterator<Item = f64>) -> Scale {
    let mut sizes: Vec<f64> = sizes.filter(|v| v.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    let reach = Some(quantile(&sizes, COVERED)).filter(|r| *r > 0.0);
    let reach = reach.unwrap_or(1.0);
    Scale {
        palette: Palette::Difference,
        range: divisible([-reach, reach]),
        unit: "nm",
    }
}

const LEFT: u32 = 48;
const RIGHT: u32 = 14;
const TOP: u32 = 24;
const AXIS: u32 = 34;
const BAR: u32 = 52;

/// Pixels that a title needs, and those below which a map has no room for five numbers.
const TITLE: u32 = 215;
const SLIM: u32 = 100;

/// Pixels of a panel whose map is at most `width` wide and 380 high.
pub fn panel(raster: &Raster, width: u32) -> (u32, u32) {
    let (width, height) = filled(raster, width);
    (width.max(LEFT + TITLE), height)
}

/// Those of them that the map fills with its axes: one of a tall strip is narrower than its title.
fn filled(raster: &Raster, width: u32) -> (u32, u32) {
    let [x, y] = [&raster.x, &raster.y].map(|a| Raster::edges(a));
    let aspect = (y[1] - y[0]) / (x[1] - x[0]);
    let height = (f64::from(width) * aspect).clamp(40.0, 380.0);
    let width = (height / aspect).clamp(60.0, f64::from(width));
    (
        width.round() as u32 + LEFT + RIGHT,
        height.round() as u32 + TOP + AXIS + BAR,
    )
}

/// One map on its own. Scales are those of fields and of residuals.
pub fn one(
    cells: &[MapCell],
    component: usize,
    what: Mapped,
    scales: [Scale; 2],
    name: &str,
) -> Result<Figure> {
    let raster = Raster::of(cells, component, what);
    let scale = scales[usize::from(what == Mapped::Residual)];
    let size = panel(&raster, 270);
    let title = title(component, what, scale.unit);
    let alt = format!(
        "Map of the {} displacement u{component}, {}",
        what.name(),
        scale.unit
    );
    draw(name, alt, size, |root, images| {
        map(root, images, &raster, scale, &title)
    })
}

fn title(component: usize, what: Mapped, unit: &str) -> String {
    let direction = ["along the load", "across"][component.clamp(1, 2) - 1];
    format!("u{component} {}, {unit} ({direction})", what.name())
}

/// Measured, predicted and residual of a component side by side, for a paper.
pub fn side_by_side(
    cells: &[MapCell],
    component: usize,
    scales: [Scale; 2],
    name: &str,
    alt: &str,
) -> Result<Figure> {
    let rasters = Mapped::ALL.map(|w| Raster::of(cells, component, w));
    let (width, height) = panel(&rasters[0], 270);
    draw(name, alt, (3 * width, height), |root, images| {
        let areas = root.split_evenly((1, 3));
        for ((area, raster), what) in areas.iter().zip(&rasters).zip(Mapped::ALL) {
            let scale = scales[usize::from(what == Mapped::Residual)];
            let title = title(component, what, scale.unit);
            map(area, images, raster, scale, &title)?;
        }
        Ok(())
    })
}

pub fn map(
    area: &Area<'_>,
    images: &mut Vec<Stretched>,
    raster: &Raster,
    scale: Scale,
    title: &str,
) -> Result<()> {
    let (width, height) = area.dim_in_pixel();
    area.draw(&Text::new(title.to_string(), (LEFT as i32, 4), text(13)))?;
    let (width, _) = filled(raster, width - LEFT - RIGHT);
    let (upper, lower) = area.split_vertically(height - BAR);
    let upper = upper.shrink((0, 0), (width, height - BAR));
    let edges = [&raster.x, &raster.y].map(|a| Raster::edges(a));
    let slim = width - LEFT - RIGHT < SLIM;
    let tall = edges[1][1] - edges[1][0] > 0.4 * (edges[0][1] - edges[0][0]);
    let axes = MapAxes {
        edges,
        margins: [TOP, RIGHT, AXIS, LEFT],
        numbers: [if slim { 4 } else { 5 }, if tall { 5 } else { 3 }],
        letters: 11,
    };
    let values = (&raster.top_down()[..], raster.x.len());
    framed(&upper, images, values, scale, &axes)?;
    bar(&lower, images, scale)
}

/// What stands about a map.
pub struct MapAxes {
    /// Places of its edges along x and y, mm.
    pub edges: [[f64; 2]; 2],
    /// Pixels above, on the right, below, on the left.
    pub margins: [u32; 4],
    /// Numbers along x and y, at most.
    pub numbers: [usize; 2],
    /// Size of the type, pixels.
    pub letters: u32,
}

/// Values from the top row down, so many to a row, with axes.
pub fn framed(
    area: &Area<'_>,
    images: &mut Vec<Stretched>,
    (values, columns): (&[f64], usize),
    scale: Scale,
    axes: &MapAxes,
) -> Result<()> {
    let ([above, right, below, left], [x, y]) = (axes.margins, axes.edges);
    let mut chart = ChartBuilder::on(area)
        .margin_top(above)
        .margin_right(right)
        .x_label_area_size(below)
        .y_label_area_size(left)
        .build_cartesian_2d(x[0]..x[1], y[0]..y[1])?;
    axes_mm(&mut chart, axes.numbers, axes.letters)?;
    let ends = [(x[0], y[0]), (x[1], y[1])];
    let blank = Rectangle::new(ends, NOT_MEASURED.filled());
    chart.plotting_area().draw(&blank)?;
    images.push(Stretched {
        data: scale.palette.image(values, columns, scale.range)?,
        over: chart.plotting_area().get_pixel_range(),
        range: Some((scale.range, scale.unit)),
    });
    Ok(())
}

/// The scale under maps.
pub fn bar(area: &Area<'_>, images: &mut Vec<Stretched>, scale: Scale) -> Result<()> {
    let [low, high] = scale.range;
    let mut chart = ChartBuilder::on(area)
        .margin_top(8)
        .margin_right(RIGHT)
        .margin_left(LEFT)
        .x_label_area_size(30)
        .build_cartesian_2d(low..high, 0.0..1.0)?;
    chart
        .configure_mesh()
        .disable_mesh()
        .disable_y_axis()
        .axis_style(INK)
        .label_style(text(11))
        .x_desc(scale.unit)
        .x_labels(5)
        .x_label_formatter(&step)
        .draw()?;
    let ramp: Vec<f64> = (0..255).map(|k| f64::from(k) / 254.0).collect();
    images.push(Stretched {
        data: scale.palette.image(&ramp, 255, [0.0, 1.0])?,
        over: chart.plotting_area().get_pixel_range(),
        range: None,
    });
    Ok(())
}
