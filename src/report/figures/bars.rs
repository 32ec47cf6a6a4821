//! Bars: how probable each effect is, what each unseen effect would do to the constants, and intervals of the constants.

use plotters::prelude::*;

use super::canvas::{
    Area, Drawn, Figure, GRID, INK, MAIN, PRIOR, TRUTH, cannot, draw, span, step, text, text_about,
    text_left_of, text_right_of,
};
use crate::error::Result;
use crate::report::sheet::Sheet;
use crate::report::traced::LINEAR_PERCENT;

const ROW: u32 = 20;
const NAMES: u32 = 168;

/// Effects of smaller probability have no bar.
pub const SMALLEST_BAR: f64 = 0.005;

/// Inclusion probability of each candidate of a round that has one to speak of; nothing if none has.
///
/// # Errors
/// The program's fault if the library cannot draw.
pub fn ranking(sheet: &Sheet, name: &str) -> Result<Option<Figure>> {
    let names = sheet.texts("effect");
    let accepted = sheet.texts("accepted");
    let probabilities = sheet.numbers("inclusion_probability");
    let rows = names.into_iter().zip(accepted).zip(probabilities);
    let effects: Vec<_> = rows.filter(|(_, p)| *p >= SMALLEST_BAR).collect();
    if effects.is_empty() {
        return Ok(None);
    }
    let size = (640, 44 + ROW * effects.len() as u32);
    let alt = "Probability that each effect acts, from the residual; accepted effects in red";
    draw(name, alt, size, |root, _| {
        let act = || -> Drawn<()> {
            scale(root, [0.0, 1.0], 70, "inclusion probability")?;
            let width = f64::from(size.0 - NAMES - 70);
            for (k, ((effect, accepted), p)) in effects.iter().enumerate() {
                let y = (k as u32 * ROW + ROW / 2 + 4) as i32;
                let colour = if *accepted == "yes" { TRUTH } else { MAIN };
                bar(
                    root,
                    [
                        NAMES as i32,
                        NAMES as i32 + (p.clamp(0.0, 1.0) * width) as i32,
                    ],
                    y,
                    colour,
                )?;
                label(root, effect, [NAMES, y as u32])?;
                let place = (NAMES as i32 + (p.clamp(0.0, 1.0) * width) as i32 + 5, y);
                root.draw(&Text::new(format!("{p:.3}"), place, text_right_of(11)))?;
            }
            Ok(())
        };
        act().map_err(|e| cannot(&e))
    })
    .map(Some)
}

/// Width of one of several panels.
const PANEL: u32 = 165;

/// RMS of the residual of both components by place.
///
/// # Errors
/// The program's fault if the library cannot draw.
pub fn breakdown(sheet: &Sheet, name: &str) -> Result<Option<Figure>> {
    let places = sheet.texts("place");
    if places.is_empty() {
        return Ok(None);
    }
    const NAMES: u32 = 140;
    const WIDE: u32 = PANEL + 60;
    let size = (NAMES + 2 * WIDE + 16, 34 + ROW * places.len() as u32);
    let alt = "RMS of the block averages of the residual, nm: in rings about the hole, and in quadrants (direction 1 along the load, direction 2 across it)";
    let panels = ["u1_nm", "u2_nm"].map(|column| sheet.numbers(column));
    let largest = span(panels.iter().flatten().copied().chain([0.0]))[1];
    draw(name, alt, size, |root, _| {
        let act = || -> Drawn<()> {
            for (c, values) in panels.iter().enumerate() {
                let left = (NAMES + WIDE * c as u32) as i32;
                let head = ["u1, RMS in nm", "u2, RMS in nm"][c];
                root.draw(&Text::new(head, (left, 12), text_right_of(12)))?;
                for (k, value) in values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
                    let y = (k as u32 * ROW + ROW / 2 + 26) as i32;
                    let end = left + (value / largest * f64::from(PANEL)) as i32;
                    bar(root, [left, end], y, MAIN)?;
                    let digits = decimals(*value).min(2);
                    let figure = format!("{value:.digits$}");
                    root.draw(&Text::new(figure, (end + 5, y), text_right_of(11)))?;
                }
                rule(root, left, 22, size.1 as i32 - 4, INK)?;
            }
            for (k, place) in places.iter().enumerate() {
                label(root, place, [NAMES, k as u32 * ROW + ROW / 2 + 26])?;
            }
            Ok(())
        };
        act().map_err(|e| cannot(&e))
    })
    .map(Some)
}

/// Shift of each constant by each effect at its plausible amplitude; effects that would go unseen are the ones to fear.
///
/// # Errors
/// The program's fault if the library cannot draw.
pub fn blind_spots(sheet: &Sheet, name: &str) -> Result<Option<Figure>> {
    let effects = sheet.texts("effect");
    let seen = sheet.texts("would_be_seen");
    let constants: Vec<&str> = sheet
        .header
        .iter()
        .filter_map(|h| h.strip_suffix("_shift_percent"))
        .collect();
    if effects.is_empty() || constants.is_empty() {
        return Ok(None);
    }
    // effects stand with their parameters here
    const WIDE: u32 = 264;
    let size = (
        WIDE + PANEL * constants.len() as u32 + 16,
        64 + ROW * effects.len() as u32,
    );
    let alt = "Shift of each constant, in percent, if an effect acted at its plausible size and the model lacked it; red: these data would not show it, blue: they would; an arrow: more than 20 %, where the linear estimate ends";
    draw(name, alt, size, |root, _| {
        let act = || -> Drawn<()> {
            for (c, constant) in constants.iter().enumerate() {
                let shifts = sheet.numbers(&format!("{constant}_shift_percent"));
                let largest = span(shifts.iter().map(|s| s.abs()))[1];
                let reach = largest.clamp(1e-3, LINEAR_PERCENT);
                let left = (WIDE + PANEL * c as u32) as i32;
                let middle = left + PANEL as i32 / 2;
                let half = f64::from(PANEL) / 2.0 - 20.0;
                root.draw(&Text::new(
                    (*constant).to_string(),
                    (middle, 12),
                    text_about(12),
                ))?;
                rule(root, middle, 24, size.1 as i32 - 38, INK)?;
                for side in [-1.0, 1.0] {
                    let x = middle + (side * half) as i32;
                    rule(root, x, 24, size.1 as i32 - 38, GRID)?;
                    let place = (x, size.1 as i32 - 28);
                    let figure = format!("{:.1$}", side * reach, decimals(reach));
                    root.draw(&Text::new(
                        figure.replace('-', "\u{2212}"),
                        place,
                        text_about(10),
                    ))?;
                }
                let unit = (middle, size.1 as i32 - 12);
                root.draw(&Text::new("shift, %", unit, text_about(11)))?;
                for (k, shift) in shifts.iter().enumerate().filter(|(_, s)| s.is_finite()) {
                    let y = (k as u32 * ROW + ROW / 2 + 26) as i32;
                    let end = middle + ((shift / reach).clamp(-1.0, 1.0) * half) as i32;
                    let colour = if seen[k] == "yes" { MAIN } else { TRUTH };
                    bar(root, [middle.min(end), middle.max(end)], y, colour)?;
                    if shift.abs() > reach {
                        let tip = end + 9 * shift.signum() as i32;
                        let arrow = vec![(end, y - 6), (end, y + 6), (tip, y)];
                        root.draw(&Polygon::new(arrow, colour.filled()))?;
                    }
                }
            }
            for (k, effect) in effects.iter().enumerate() {
                label(root, effect, [WIDE, k as u32 * ROW + ROW / 2 + 26])?;
            }
            Ok(())
        };
        act().map_err(|e| cannot(&e))
    })
    .map(Some)
}

fn decimals(size: f64) -> usize {
    (1.0 - size.log10().floor()).clamp(0.0, 6.0) as usize
}

/// 95 % intervals of each constant: prior, each round, averaged; the truth where it is known.
///
/// # Errors
/// The program's fault if the library cannot draw.
pub fn intervals(sheet: &Sheet, name: &str) -> Result<Option<Figure>> {
    let constants = sheet.distinct("parameter");
    let Some(rows) = constants
        .iter()
        .map(|c| sheet.only("parameter", c).rows.len())
        .max()
    else {
        return Ok(None);
    };
    const PANEL: u32 = 340;
    let across = constants.len().min(2) as u32;
    let down = constants.len().div_ceil(2) as u32;
    let height = 66 + ROW * rows as u32;
    let size = (across * PANEL, down * height);
    let alt = "Constants with 95 % intervals: prior, posterior of each round, and averaged over effects that may act unseen; the truth, where it is known, as a red line";
    draw(name, alt, size, |root, _| {
        let areas = root.split_evenly((down as usize, across as usize));
        for (constant, area) in constants.iter().zip(&areas) {
            panel(area, &sheet.only("parameter", constant), constant).map_err(|e| cannot(&e))?;
        }
        Ok(())
    })
    .map(Some)
}

fn panel(area: &Area<'_>, sheet: &Sheet, constant: &str) -> Drawn<()> {
    let (low, high) = (sheet.numbers("low"), sheet.numbers("high"));
    let (mean, truth) = (sheet.numbers("mean"), sheet.numbers("truth"));
    let all = low.iter().chain(&high).chain(&truth).copied();
    let [a, b] = span(all);
    let room = 0.06 * (b - a);
    let rows = sheet.rows.len();
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
    if let Some(truth) = truth.iter().find(|t| t.is_finite()) {
        let line = [(*truth, 0.0), (*truth, rows as f64)];
        chart.draw_series(LineSeries::new(line, TRUTH.stroke_width(2)))?;
    }
    for (k, what) in sheet.texts("what").iter().enumerate() {
        let y = k as f64 + 0.5;
        let colour = if *what == "prior" { PRIOR } else { MAIN };
        chart.draw_series(LineSeries::new(
            [(low[k], y), (high[k], y)],
            colour.stroke_width(3),
        ))?;
        chart.draw_series([Circle::new((mean[k], y), 4, colour.filled())])?;
        let (_, at) = chart.backend_coord(&(a, y));
        let (_, top) = area.get_base_pixel();
        area.draw(&Text::new(
            (*what).to_string(),
            (84, at - top),
            text_left_of(11),
        ))?;
    }
    Ok(())
}

fn bar(root: &Area<'_>, [from, to]: [i32; 2], y: i32, colour: RGBColor) -> Drawn<()> {
    root.draw(&Rectangle::new(
        [(from, y - 6), (to.max(from + 1), y + 6)],
        colour.filled(),
    ))
}

fn rule(root: &Area<'_>, x: i32, top: i32, bottom: i32, colour: RGBColor) -> Drawn<()> {
    root.draw(&PathElement::new(
        vec![(x, top), (x, bottom)],
        colour.stroke_width(1),
    ))
}

fn label(root: &Area<'_>, name: &str, [left, y]: [u32; 2]) -> Drawn<()> {
    let place = (left as i32 - 8, y as i32);
    root.draw(&Text::new(name.to_string(), place, text_left_of(12)))
}

/// Axis and grid lines from `low` to `high` under the rows, in quarters.
fn scale(root: &Area<'_>, [low, high]: [f64; 2], right: u32, name: &str) -> Drawn<()> {
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
        root.draw(&Text::new(
            step(&(low + f * (high - low))),
            place,
            text_about(10),
        ))?;
    }
    let middle = NAMES as i32 + (0.5 * reach) as i32;
    root.draw(&Text::new(
        name.to_string(),
        (middle, height as i32 - 12),
        text_about(11),
    ))
}
