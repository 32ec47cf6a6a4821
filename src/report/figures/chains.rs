//! How the chains behaved: traces and ranks.

use indexmap::IndexMap;
use plotters::prelude::*;

use super::canvas::{Area, Figure, GRID, INK, SERIES, draw, span, step, text};
use crate::error::Result;
use crate::report::json::Keyed;
use crate::report::numbers::{RankBin, TracePoint};

/// Panels of a parameter each, in rows of so many.
const ACROSS: usize = 3;
const PANEL: (u32, u32) = (300, 168);

/// One line of a panel.
struct Curve {
    points: Vec<(f64, f64)>,
    colour: RGBColor,
}

struct Panel {
    title: String,
    x: [f64; 2],
    y: [f64; 2],
    lines: Vec<Curve>,
    level: Option<f64>,
    steps: bool,
}

/// Traces of one chain of each ensemble.
pub fn traces(points: &[TracePoint]) -> Result<Option<Figure>> {
    let points = points.iter();
    let panels = panels(points.map(|p| (&p.parameter, p.ensemble, (p.draw as f64, p.value))));
    let alt = "Traces: one chain of each independent ensemble, by stored draw";
    grid(panels, alt, ["stored draw", ""])
}

pub fn ranks(bins: &[RankBin]) -> Result<Option<Figure>> {
    let bins = bins.iter();
    let bins = bins.map(|b| (&b.parameter, b.ensemble, (b.bin as f64, b.relative_count)));
    let mut panels = panels(bins);
    for panel in &mut panels {
        panel.level = Some(1.0);
        panel.steps = true;
        panel.y = [panel.y[0].min(0.8), panel.y[1].max(1.2)];
        panel.x = [0.5, panel.x[1] + 0.5];
    }
    let alt = "Rank plots: the share of each ensemble's draws in twenty bins of the ranks among all draws, relative to equal shares; level lines mean that the ensembles agree";
    grid(panels, alt, ["rank, twentieths", ""])
}

/// A panel for each title and in it a line for each number, in their order.
fn panels<'a>(points: impl Iterator<Item = (&'a String, usize, (f64, f64))>) -> Vec<Panel> {
    let mut series: Keyed<IndexMap<usize, Vec<(f64, f64)>>> = Keyed::new();
    for (title, number, point) in points {
        let lines = series.entry(title.clone()).or_default();
        lines.entry(number).or_default().push(point);
    }
    let panel = |(title, lines): (String, IndexMap<usize, Vec<(f64, f64)>>)| Panel {
        title,
        x: span(lines.values().flatten().map(|p| p.0)),
        y: span(lines.values().flatten().map(|p| p.1)),
        lines: lines
            .into_values()
            .zip(SERIES.into_iter().cycle())
            .map(|(points, colour)| Curve { points, colour })
            .collect(),
        level: None,
        steps: false,
    };
    series.into_iter().map(panel).collect()
}

fn grid(panels: Vec<Panel>, alt: &str, labels: [&str; 2]) -> Result<Option<Figure>> {
    if panels.is_empty() {
        return Ok(None);
    }
    let across = panels.len().min(ACROSS);
    let rows = panels.len().div_ceil(across);
    let size = (across as u32 * PANEL.0, rows as u32 * PANEL.1);
    draw("", alt, size, |root, _| {
        let areas = root.split_evenly((rows, across));
        for (panel, area) in panels.iter().zip(&areas) {
            show(area, panel, labels)?;
        }
        Ok(())
    })
    .map(Some)
}

fn show(area: &Area<'_>, panel: &Panel, labels: [&str; 2]) -> Result<()> {
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
