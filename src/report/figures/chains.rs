//! How the chains behaved: traces, ranks, autocorrelation; and the residual's variogram.

use plotters::prelude::*;

use super::canvas::{Area, Drawn, Figure, GRID, INK, SERIES, cannot, draw, span, step, text};
use crate::error::Result;
use crate::report::sheet::Sheet;

/// Panels of a parameter each, in rows of so many.
const ACROSS: usize = 3;
const PANEL: (u32, u32) = (300, 168);

/// One line of a panel.
struct Line {
    points: Vec<(f64, f64)>,
    colour: RGBColor,
}

/// One panel.
struct Panel {
    title: String,
    x: [f64; 2],
    y: [f64; 2],
    lines: Vec<Line>,
    level: Option<f64>,
    steps: bool,
}

/// Traces of one chain of each ensemble.
///
/// # Errors
/// The program's fault if the library cannot draw.
pub fn traces(sheet: &Sheet, name: &str) -> Result<Option<Figure>> {
    let panels = by_ensemble(sheet, "draw", "value", false);
    let alt = "Traces: one chain of each independent ensemble, by stored draw";
    grid(panels, name, alt, ["stored draw", ""])
}

/// Rank plots.
///
/// # Errors
/// The program's fault if the library cannot draw.
pub fn ranks(sheet: &Sheet, name: &str) -> Result<Option<Figure>> {
    let mut panels = by_ensemble(sheet, "bin", "relative_count", true);
    for panel in &mut panels {
        panel.level = Some(1.0);
        panel.y = [panel.y[0].min(0.8), panel.y[1].max(1.2)];
        panel.x = [0.5, panel.x[1] + 0.5];
    }
    let alt = "Rank plots: the share of each ensemble's draws in twenty bins of the ranks among all draws, relative to equal shares; level lines mean that the ensembles agree";
    grid(panels, name, alt, ["rank, twentieths", ""])
}

/// Autocorrelation functions.
///
/// # Errors
/// The program's fault if the library cannot draw.
pub fn autocorrelation(sheet: &Sheet, name: &str) -> Result<Option<Figure>> {
    let panel = |parameter: String| {
        let of = sheet.only("parameter", &parameter);
        let lags = of.numbers("lag");
        let points: Vec<(f64, f64)> = lags
            .into_iter()
            .zip(of.numbers("autocorrelation"))
            .collect();
        Panel {
            title: parameter,
            x: span(points.iter().map(|p| p.0)),
            y: [span(points.iter().map(|p| p.1))[0].min(-0.1), 1.0],
            lines: vec![Line {
                points,
                colour: SERIES[0],
            }],
            level: Some(0.0),
            steps: false,
        }
    };
    let panels = sheet.distinct("parameter").into_iter().map(panel).collect();
    let alt = "Autocorrelation of the walkers by lag in stored draws";
    grid(panels, name, alt, ["lag, stored draws", ""])
}

/// The variogram of the residual's block averages.
///
/// # Errors
/// The program's fault if the library cannot draw.
pub fn variogram(sheet: &Sheet, name: &str) -> Result<Option<Figure>> {
    let distance = sheet.numbers("distance_mm");
    let panel = |c: usize| {
        let values = sheet.numbers(&format!("u{c}_nm2"));
        let points: Vec<(f64, f64)> = distance.iter().copied().zip(values).collect();
        Panel {
            title: format!("u{c}, semivariance in nm\u{b2}"),
            x: [0.0, span(distance.iter().copied())[1]],
            y: [0.0, 1.08 * span(points.iter().map(|p| p.1))[1].max(1e-12)],
            lines: vec![Line {
                points,
                colour: SERIES[c - 1],
            }],
            level: None,
            steps: false,
        }
    };
    let panels = if distance.is_empty() {
        Vec::new()
    } else {
        [1, 2].map(panel).into()
    };
    let alt = "Variogram of the residual's block averages: level for noise without structure, rising where neighbours are alike";
    grid(panels, name, alt, ["distance, mm", ""])
}

fn by_ensemble(sheet: &Sheet, x: &str, y: &str, steps: bool) -> Vec<Panel> {
    let panel = |parameter: String| {
        let of = sheet.only("parameter", &parameter);
        let lines = of
            .distinct("ensemble")
            .iter()
            .enumerate()
            .map(|(e, ensemble)| {
                let of = of.only("ensemble", ensemble);
                Line {
                    points: of.numbers(x).into_iter().zip(of.numbers(y)).collect(),
                    colour: SERIES[e % SERIES.len()],
                }
            })
            .collect();
        Panel {
            title: parameter,
            x: span(of.numbers(x).into_iter()),
            y: span(of.numbers(y).into_iter()),
            lines,
            level: None,
            steps,
        }
    };
    sheet.distinct("parameter").into_iter().map(panel).collect()
}

fn grid(panels: Vec<Panel>, name: &str, alt: &str, labels: [&str; 2]) -> Result<Option<Figure>> {
    if panels.is_empty() {
        return Ok(None);
    }
    let across = panels.len().min(ACROSS);
    let rows = panels.len().div_ceil(across);
    let size = (across as u32 * PANEL.0, rows as u32 * PANEL.1);
    draw(name, alt, size, |root, _| {
        let areas = root.split_evenly((rows, across));
        for (panel, area) in panels.iter().zip(&areas) {
            show(area, panel, labels).map_err(|e| cannot(&e))?;
        }
        Ok(())
    })
    .map(Some)
}

fn show(area: &Area<'_>, panel: &Panel, labels: [&str; 2]) -> Drawn<()> {
    area.draw(&Text::new(panel.title.clone(), (56, 4), text(12)))?;
    let mut chart = ChartBuilder::on(area)
        .margin_top(22)
        .margin_right(14)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(panel.x[0]..panel.x[1], panel.y[0]..panel.y[1])?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style(text(10))
        .x_desc(labels[0])
        .x_labels(5)
        .y_labels(4)
        .x_label_formatter(&step)
        .y_label_formatter(&step)
        .draw()?;
    if let Some(level) = panel.level {
        let line = [(panel.x[0], level), (panel.x[1], level)];
        chart.draw_series(LineSeries::new(line, INK.stroke_width(1)))?;
    }
    for line in &panel.lines {
        let points: Vec<(f64, f64)> = if panel.steps {
            let steps = line.points.iter();
            steps
                .flat_map(|(x, y)| [(x - 0.5, *y), (x + 0.5, *y)])
                .collect()
        } else {
            line.points.clone()
        };
        chart.draw_series(LineSeries::new(
            points.into_iter().filter(|p| p.1.is_finite()),
            line.colour.stroke_width(1),
        ))?;
    }
    Ok(())
}
