//! The corner plot: marginals with prior, cut and truth on the diagonal, joint densities below it.

use plotters::element::DashedPathElement;
use plotters::prelude::*;

use super::canvas::{Area, Figure, GRID, INK, MAIN, PRIOR, TRUTH, draw, span, step, text};
use crate::error::Result;
use crate::report::numbers::{FigureData, JointBin, ParameterLine};
use crate::report::page::AXES;

/// What is known of one parameter.
struct CornerAxis {
    name: String,
    range: [f64; 2],
    marginal: Vec<(f64, f64)>,
    /// Mean and sd; NaN where they are not known, as the others are.
    prior: [f64; 2],
    cut: [f64; 2],
    truth: f64,
}

const CELL: u32 = 116;
const LEFT: u32 = 76;
const BOTTOM: u32 = 54;

pub fn corner(data: &FigureData) -> Result<Option<Figure>> {
    let axes = axes(data);
    let d = axes.len().min(AXES);
    if d == 0 {
        return Ok(None);
    }
    let size = (LEFT + d as u32 * CELL + 12, BOTTOM + d as u32 * CELL + 12);
    let names: Vec<&str> = axes.iter().take(d).map(|a| a.name.as_str()).collect();
    let alt = format!(
        "Corner plot of the posterior of {}: marginal densities, with the priors dashed, on the diagonal; joint densities below it",
        names.join(", ")
    );
    draw("", alt, size, |root, _| {
        for j in 0..d {
            for i in 0..=j {
                let at = [i, j].map(|k| k as u32 * CELL);
                let place = |x: u32, y: u32| (x as i32, y as i32);
                let cell = root
                    .clone()
                    .shrink(place(LEFT + at[0], 12 + at[1]), (CELL, CELL));
                let drawn = if i == j {
                    diagonal(&cell, &axes[i])
                } else {
                    joint(&cell, &axes[i], &axes[j], &data.corner)
                };
                drawn?;
            }
            labels(root, &axes[j], j as u32, d as u32)?;
        }
        Ok(())
    })
    .map(Some)
}

fn axes(data: &FigureData) -> Vec<CornerAxis> {
    let axis = |p: &ParameterLine| {
        let bins = data.marginals.iter().filter(|b| b.parameter == p.parameter);
        let marginal: Vec<(f64, f64)> = bins.map(|b| (b.value, b.density)).collect();
        CornerAxis {
            name: p.parameter.clone(),
            range: span(marginal.iter().map(|m| m.0)),
            marginal,
            prior: [p.prior_mean, p.prior_sd],
            cut: [p.cut_low, p.cut_high],
            truth: p.truth,
        }
    };
    data.parameters.iter().map(axis).collect()
}

/// A marginal with its prior, cut and truth.
fn diagonal(cell: &Area<'_>, axis: &CornerAxis) -> Result<()> {
    let [low, high] = axis.range;
    let top = 1.12 * axis.marginal.iter().fold(0.0_f64, |m, d| m.max(d.1));
    let mut chart = ChartBuilder::on(cell)
        .margin(2)
        .build_cartesian_2d(low..high, 0.0..top.max(f64::MIN_POSITIVE))?;
    chart.draw_series(AreaSeries::new(
        axis.marginal.iter().copied(),
        0.0,
        MAIN.mix(0.25),
    ))?;
    chart.draw_series(LineSeries::new(
        axis.marginal.iter().copied(),
        MAIN.stroke_width(2),
    ))?;
    let [mean, sd] = axis.prior;
    if mean.is_finite() {
        let density = |x: f64| {
            let z = (x - mean) / sd;
            (-0.5 * z * z).exp() / (sd * std::f64::consts::TAU.sqrt())
        };
        let points: Vec<(f64, f64)> = (0..=60)
            .map(|k| low + (high - low) * f64::from(k) / 60.0)
            .map(|x| (x, density(x).min(top)))
            .collect();
        chart
            .plotting_area()
            .draw(&DashedPathElement::new(points, 5, 4, PRIOR.stroke_width(1)))?;
    }
    let cuts = axis.cut.into_iter().map(|x| (x, INK));
    let lines = cuts.chain([(axis.truth, TRUTH)]);
    for (x, colour) in lines.filter(|(x, _)| (low..=high).contains(x)) {
        let line = vec![(x, 0.0), (x, top)];
        chart
            .plotting_area()
            .draw(&PathElement::new(line, colour.stroke_width(2)))?;
    }
    frame(cell)
}

/// A joint density as shaded cells with two contours' cells framed by shade, and the truth.
fn joint(cell: &Area<'_>, x: &CornerAxis, y: &CornerAxis, bins: &[JointBin]) -> Result<()> {
    let of = bins
        .iter()
        .filter(|b| b.first == x.name && b.second == y.name);
    let cells: Vec<[f64; 3]> = of.map(|b| [b.x, b.y, b.relative_density]).collect();
    let mut chart = ChartBuilder::on(cell)
        .margin(2)
        .build_cartesian_2d(x.range[0]..x.range[1], y.range[0]..y.range[1])?;
    let half = [pitch(&cells, 0), pitch(&cells, 1)].map(|p| 0.5 * p);
    let levels = levels(&cells);
    // bands of equal shade, one run of cells a rectangle, keep the drawing small
    let runs_on = |a: &[f64; 3], b: &[f64; 3]| {
        a[1] == b[1] && shade(a[2], &levels) == shade(b[2], &levels) && b[0] - a[0] < 3.0 * half[0]
    };
    for run in cells.chunk_by(runs_on) {
        let ([left, y, density], right) = (run[0], run[run.len() - 1][0]);
        let opacity = [0.0, 0.18, 0.42, 0.8][shade(density, &levels)];
        if opacity > 0.0 {
            chart.plotting_area().draw(&Rectangle::new(
                [
                    (left - half[0], y - half[1]),
                    (right + half[0], y + half[1]),
                ],
                MAIN.mix(opacity).filled(),
            ))?;
        }
    }
    let inside = |axis: &CornerAxis| (axis.range[0]..=axis.range[1]).contains(&axis.truth);
    let across = inside(x).then(|| y.range.map(|b| (x.truth, b)));
    let along = inside(y).then(|| x.range.map(|a| (a, y.truth)));
    for line in across.into_iter().chain(along) {
        chart.draw_series(LineSeries::new(line, TRUTH.stroke_width(1)))?;
    }
    frame(cell)
}

/// Smallest step between coordinates.
fn pitch(cells: &[[f64; 3]], axis: usize) -> f64 {
    let mut values: Vec<f64> = cells.iter().map(|c| c[axis]).collect();
    values.sort_by(f64::total_cmp);
    values
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|d| *d > 0.0)
        .fold(f64::INFINITY, f64::min)
        .min(1e300)
}

/// Densities above which the densest cells hold 99, 86 and 39 % of the draws (3, 2 and 1 sd of a normal in two dimensions).
fn levels(cells: &[[f64; 3]]) -> [f64; 3] {
    let mut densities: Vec<f64> = cells.iter().map(|c| c[2]).collect();
    densities.sort_by(|a, b| b.total_cmp(a));
    let total: f64 = densities.iter().sum();
    [0.989, 0.865, 0.393].map(|share| {
        let mut sum = 0.0;
        let within = densities.iter().find(|d| {
            sum += **d;
            sum >= share * total
        });
        within.copied().unwrap_or(0.0)
    })
}

fn shade(density: f64, levels: &[f64; 3]) -> usize {
    levels.iter().filter(|l| density >= **l).count()
}

fn frame(cell: &Area<'_>) -> Result<()> {
    let (w, h) = cell.dim_in_pixel();
    let corners = [(2, 2), (w as i32 - 2, h as i32 - 2)];
    Ok(cell.draw(&Rectangle::new(corners, GRID.stroke_width(1)))?)
}

/// Name and two values along the lower and the left side.
fn labels(root: &Area<'_>, axis: &CornerAxis, k: u32, d: u32) -> Result<()> {
    use plotters::style::text_anchor::{HPos, Pos, VPos};
    let [low, high] = axis.range;
    let decimals = (1.0 - (high - low).log10().floor()).clamp(0.0, 9.0) as usize;
    let ends = [0.2, 0.8].map(|f| (f, low + f * (high - low)));
    let say = |v: f64| {
        let short = format!("{v:.decimals$}");
        short.parse().map_or(short, |v: f64| step(&v))
    };
    let bottom = (12 + d * CELL) as i32;
    let middle = Pos::new(HPos::Center, VPos::Top);
    let left = (LEFT + k * CELL) as i32;
    for (f, v) in ends {
        let x = left + (f * f64::from(CELL)) as i32;
        root.draw(&Text::new(say(v), (x, bottom + 4), text(10).pos(middle)))?;
    }
    let centre = left + CELL as i32 / 2;
    let lines: Vec<&str> = axis.name.split('.').collect();
    for (line, row) in lines.iter().zip(0..) {
        let place = (centre, bottom + 20 + 14 * row);
        root.draw(&Text::new((*line).to_string(), place, text(11).pos(middle)))?;
    }
    if k == 0 {
        return Ok(());
    }
    let right = Pos::new(HPos::Right, VPos::Center);
    let top = (12 + k * CELL) as i32;
    for (f, v) in ends {
        let y = top + ((1.0 - f) * f64::from(CELL)) as i32;
        root.draw(&Text::new(
            say(v),
            (LEFT as i32 - 3, y),
            text(10).pos(right),
        ))?;
    }
    let upright = text(11)
        .transform(FontTransform::Rotate270)
        .pos(Pos::new(HPos::Center, VPos::Center));
    for (line, row) in lines.iter().zip(0..) {
        let place = (12 + 14 * row, top + CELL as i32 / 2);
        root.draw(&Text::new((*line).to_string(), place, upright.clone()))?;
    }
    Ok(())
}
