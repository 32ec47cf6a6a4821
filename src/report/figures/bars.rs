//! Bars: intervals of the constants.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{Area, Figure, GRID, INK, MAIN, PRIOR, TRUTH, draw, say, span, step, text};
use crate::error::Result;
use crate::report::json::Keyed;
use crate::report::numbers::IntervalLine;

const ROW: u32 = 20;

/// 95 % intervals of each constant: prior, each round, averaged; the truth where it is known.
pub fn intervals(lines: &[IntervalLine]) -> Result<Option<Figure>> {
    let mut constants: Keyed<Vec<&IntervalLine>> = Keyed::new();
    for line in lines {
        constants
            .entry(line.parameter.clone())
            .or_default()
            .push(line);
    }
    let Some(rows) = constants.values().map(Vec::len).max() else {
        return Ok(None);
    };
    const PANEL: u32 = 340;
    let across = constants.len().min(2) as u32;
    let down = constants.len().div_ceil(2) as u32;
    let height = 66 + ROW * rows as u32;
    let size = (across * PANEL, down * height);
    let alt = "Constants with 95 % intervals: prior, posterior of each round, and averaged over effects that may act unseen; the truth, where it is known, as a red line";
    draw("intervals", alt, size, |root, _| {
        let areas = root.split_evenly((down as usize, across as usize));
        for ((constant, lines), area) in constants.iter().zip(&areas) {
            panel(area, lines, constant)?;
        }
        Ok(())
    })
    .map(Some)
}

fn panel(area: &Area<'_>, lines: &[&IntervalLine], constant: &str) -> Result<()> {
    let truth = lines.first().map_or(f64::NAN, |l| l.truth);
    let [a, b] = span(lines.iter().flat_map(|l| [l.low, l.high, l.truth]));
    let room = 0.06 * (b - a);
    let rows = lines.len();
    area.draw(&Text::new(constant.to_string(), (92, 6), text(12)))?;
    let mut chart = ChartBuilder::on(area)
        .margin_top(24)
        .margin_right(18)
        .x_label_area_size(24)
        .y_label_area_size(92)
        .build_cartesian_2d((a - room)..(b + room), (rows as f64)..0.0)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style(text(10))
        .x_labels(6)
        .x_label_formatter(&step)
        .draw()?;
    if truth.is_finite() {
        let line = [(truth, 0.0), (truth, rows as f64)];
        chart.draw_series(LineSeries::new(line, TRUTH.stroke_width(2)))?;
    }
    for (k, line) in lines.iter().enumerate() {
        let y = k as f64 + 0.5;
        let colour = if line.what == "prior" { PRIOR } else { MAIN };
        chart.draw_series(LineSeries::new(
            [(line.low, y), (line.high, y)],
            colour.stroke_width(3),
        ))?;
        chart.draw_series([Circle::new((line.mean, y), 4, colour.filled())])?;
        let (_, at) = chart.backend_coord(&(a, y));
        let (_, top) = area.get_base_pixel();
        say(area, &line.what, (84, at - top), 11, HPos::Right)?;
    }
    Ok(())
}
