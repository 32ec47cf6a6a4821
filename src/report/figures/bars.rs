//! Bars: the residual by place, and intervals of the constants.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{Area, Figure, GRID, INK, MAIN, PRIOR, TRUTH, draw, say, span, step, text};
use crate::error::Result;
use crate::report::json::Keyed;
use crate::report::numbers::{IntervalLine, PlaceRms};

const ROW: u32 = 20;

/// Width of one of several panels.
const PANEL: u32 = 165;

/// RMS of the residual of both components by place.
pub fn breakdown(places: &[PlaceRms]) -> Result<Option<Figure>> {
    if places.is_empty() {
        return Ok(None);
    }
    const NAMES: u32 = 140;
    const WIDE: u32 = PANEL + 60;
    let size = (NAMES + 2 * WIDE + 16, 34 + ROW * places.len() as u32);
    let alt = "RMS of the block averages of the residual, nm, in rings about the hole and in quadrants. Direction 1 is along the load";
    let of = |pick: fn(&PlaceRms) -> f64| places.iter().map(pick).collect::<Vec<f64>>();
    let panels = [of(|p| p.u1_nm), of(|p| p.u2_nm)];
    let largest = span(panels.iter().flatten().copied().chain([0.0]))[1];
    draw("", alt, size, |root, _| {
        for (c, values) in panels.iter().enumerate() {
            let left = (NAMES + WIDE * c as u32) as i32;
            let head = ["u1, RMS in nm", "u2, RMS in nm"][c];
            say(root, head, (left, 12), 12, HPos::Left)?;
            for (k, value) in values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
                let y = (k as u32 * ROW + ROW / 2 + 26) as i32;
                let end = left + (value / largest * f64::from(PANEL)) as i32;
                bar(root, [left, end], y, MAIN)?;
                let digits = decimals(*value).min(2);
                let figure = format!("{value:.digits$}");
                say(root, figure, (end + 5, y), 11, HPos::Left)?;
            }
            rule(root, left, 22, size.1 as i32 - 4, INK)?;
        }
        for (k, place) in places.iter().enumerate() {
            label(root, &place.place, [NAMES, k as u32 * ROW + ROW / 2 + 26])?;
        }
        Ok(())
    })
    .map(Some)
}

fn decimals(size: f64) -> usize {
    (1.0 - size.log10().floor()).clamp(0.0, 6.0) as usize
}

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

fn bar(root: &Area<'_>, [from, to]: [i32; 2], y: i32, colour: RGBColor) -> Result<()> {
    let corners = [(from, y - 6), (to.max(from + 1), y + 6)];
    Ok(root.draw(&Rectangle::new(corners, colour.filled()))?)
}

fn rule(root: &Area<'_>, x: i32, top: i32, bottom: i32, colour: RGBColor) -> Result<()> {
    let line = vec![(x, top), (x, bottom)];
    Ok(root.draw(&PathElement::new(line, colour.stroke_width(1)))?)
}

fn label(root: &Area<'_>, name: &str, [left, y]: [u32; 2]) -> Result<()> {
    let place = (left as i32 - 8, y as i32);
    say(root, name, place, 12, HPos::Right)
}
