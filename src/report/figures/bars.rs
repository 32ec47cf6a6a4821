//! Bars: how probable each effect is, what each unseen effect would do to the constants, and intervals of the constants.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{Area, Figure, GRID, INK, MAIN, PRIOR, TRUTH, draw, say, span, step, text};
use crate::error::Result;
use crate::report::json::Keyed;
use crate::report::numbers::{IntervalLine, PlaceRms};
use crate::report::tracing::{BlindSpotReport, TracingReport};
use crate::report::words::LINEAR_PERCENT;

const ROW: u32 = 20;
const NAMES: u32 = 200;

/// Effects of smaller probability have no bar.
pub const SMALLEST_BAR: f64 = 0.005;

/// Inclusion probability of each candidate of a round that has one to speak of; nothing if none has.
pub fn ranking(tracing: &TracingReport) -> Result<Option<Figure>> {
    let candidates = tracing.candidates.iter();
    let effects: Vec<_> = candidates
        .filter(|c| c.inclusion_probability >= SMALLEST_BAR)
        .collect();
    if effects.is_empty() {
        return Ok(None);
    }
    let size = (640, 44 + ROW * effects.len() as u32);
    let alt = "Probability that each effect acts, from the residual; accepted effects in red";
    draw("", alt, size, |root, _| {
        scale(root, [0.0, 1.0], 70, "inclusion probability")?;
        let width = f64::from(size.0 - NAMES - 70);
        for (k, candidate) in effects.iter().enumerate() {
            let y = (k as u32 * ROW + ROW / 2 + 4) as i32;
            let accepted = tracing.accepted.contains(&candidate.effect);
            let colour = if accepted { TRUTH } else { MAIN };
            let p = candidate.inclusion_probability;
            let end = NAMES as i32 + (p.clamp(0.0, 1.0) * width) as i32;
            bar(root, [NAMES as i32, end], y, colour)?;
            label(root, &candidate.name(), [NAMES, y as u32])?;
            let figure = format!("{p:.3}");
            say(root, figure, (end + 5, y), 11, HPos::Left)?;
        }
        Ok(())
    })
    .map(Some)
}

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

/// Shift of each constant by each effect at its plausible amplitude; effects that would go unseen are the ones to fear.
pub fn blind_spots(spots: &[BlindSpotReport], constants: &[&str]) -> Result<Option<Figure>> {
    if spots.is_empty() || constants.is_empty() {
        return Ok(None);
    }
    // effects stand with their parameters here
    const WIDE: u32 = 300;
    let size = (
        WIDE + PANEL * constants.len() as u32 + 16,
        64 + ROW * spots.len() as u32,
    );
    let alt = "Shift of each constant, in percent, if an effect acted at its plausible size and the model lacked it; red: these data would not show it, blue: they would; an arrow: more than 20 %, where the linear estimate ends";
    draw("blind-spots", alt, size, |root, _| {
        for (c, constant) in constants.iter().enumerate() {
            let shifts = spots.iter().map(|s| s.shift(constant).unwrap_or(f64::NAN));
            let shifts: Vec<f64> = shifts.collect();
            let largest = span(shifts.iter().map(|s| s.abs()))[1];
            let reach = largest.clamp(1e-3, LINEAR_PERCENT);
            let left = (WIDE + PANEL * c as u32) as i32;
            let middle = left + PANEL as i32 / 2;
            let half = f64::from(PANEL) / 2.0 - 20.0;
            say(root, *constant, (middle, 12), 12, HPos::Center)?;
            rule(root, middle, 24, size.1 as i32 - 38, INK)?;
            for side in [-1.0, 1.0] {
                let x = middle + (side * half) as i32;
                rule(root, x, 24, size.1 as i32 - 38, GRID)?;
                let place = (x, size.1 as i32 - 28);
                let figure = format!("{:.1$}", side * reach, decimals(reach));
                say(
                    root,
                    figure.replace('-', "\u{2212}"),
                    place,
                    10,
                    HPos::Center,
                )?;
            }
            let unit = (middle, size.1 as i32 - 12);
            say(root, "shift, %", unit, 11, HPos::Center)?;
            for (k, shift) in shifts.iter().enumerate().filter(|(_, s)| s.is_finite()) {
                let y = (k as u32 * ROW + ROW / 2 + 26) as i32;
                let end = middle + ((shift / reach).clamp(-1.0, 1.0) * half) as i32;
                let colour = if spots[k].would_be_seen { MAIN } else { TRUTH };
                bar(root, [middle.min(end), middle.max(end)], y, colour)?;
                if shift.abs() > reach {
                    let tip = end + 9 * shift.signum() as i32;
                    let arrow = vec![(end, y - 6), (end, y + 6), (tip, y)];
                    root.draw(&Polygon::new(arrow, colour.filled()))?;
                }
            }
        }
        for (k, spot) in spots.iter().enumerate() {
            label(root, &spot.name(), [WIDE, k as u32 * ROW + ROW / 2 + 26])?;
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
    let truth = lines.iter().find_map(|l| l.truth);
    let [a, b] = span(lines.iter().flat_map(|l| [l.low, l.high]).chain(truth));
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
    if let Some(truth) = truth {
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

/// Axis and grid lines from `low` to `high` under the rows, in quarters.
fn scale(root: &Area<'_>, [low, high]: [f64; 2], right: u32, name: &str) -> Result<()> {
    let (width, height) = root.dim_in_pixel();
    let reach = f64::from(width - NAMES - right);
    for k in 0..=4 {
        let f = f64::from(k) / 4.0;
        let x = NAMES as i32 + (f * reach) as i32;
        rule(
            root,
            x,
            4,
            height as i32 - 36,
            if k == 0 { INK } else { GRID },
        )?;
        let place = (x, height as i32 - 28);
        say(
            root,
            step(&(low + f * (high - low))),
            place,
            10,
            HPos::Center,
        )?;
    }
    let middle = NAMES as i32 + (0.5 * reach) as i32;
    say(root, name, (middle, height as i32 - 12), 11, HPos::Center)
}
