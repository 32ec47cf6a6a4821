//! What `plychain fringes` found: `fringes.json`, a summary for the terminal, and the page.

use std::fmt::Write;

use maud::{Markup, html};
use serde::Serialize;

use super::figures::{Figure, Palette, Picture, Scale, span};
use super::html;
use crate::error::Result;
use crate::field::frame::Axis;
use crate::field::fringes::{COMPONENTS, Component, Counts, Fringes, STATES, Steps};
use crate::quantity::NM_PER_MM;

/// The schema of `fringes.json`.
pub const SCHEMA: &str = "plychain-fringes-result/1";

/// `fringes.json`.
#[derive(Debug, Serialize)]
pub struct FringeReport {
    pub schema: &'static str,
    pub rows: usize,
    pub cols: usize,
    pub pixel_mm: f64,
    pub fringe_frequency_per_mm: f64,
    /// Displacement of a whole order, nm: what an error of unwrapping, or two parts of a field, differ by.
    pub order_nm: f64,
    #[serde(rename = "U_along")]
    pub u_along: Axis,
    #[serde(rename = "U")]
    pub u: ComponentReport,
    #[serde(rename = "V")]
    pub v: ComponentReport,
    pub warnings: Vec<String>,
}

/// One displacement.
#[derive(Debug, Serialize)]
pub struct ComponentReport {
    /// Whether nominal or estimated steps were taken.
    pub steps: Steps,
    /// Log likelihood of estimated over nominal steps, less the price of their parameters; absent where the file says which to take.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log_ratio: Option<f64>,
    /// Steps less nominal ones, degrees, about their mean: the mean is a rigid displacement.
    pub step_error_deg: PerState<Vec<f64>>,
    /// Brightness of each frame, 1 on average.
    pub gain: PerState<Vec<f64>>,
    /// The recorded intensity goes with about this power of the light, near half of full scale.
    pub detector_gamma: f64,
    /// Variance of an intensity, in the square of the recorded unit: the same everywhere, and for each unit of light.
    pub noise_variance: [f64; 2],
    /// Background and modulation of the final state over the initial one's.
    pub brightness: [f64; 2],
    /// Root mean square of the sds of the displacement, nm.
    pub sd_nm: f64,
    /// What of it the uncertainty of the steps leaves, nm.
    pub step_sd_nm: f64,
    /// Amplitudes of the ripple that remains at once, twice and three times the frequency of the fringes of either state, nm.
    pub ripple_nm: PerState<[f64; 3]>,
    pub pixels: Counts,
    /// Sizes of connected parts in pixels; whole orders between them are not known.
    pub parts: Vec<usize>,
}

#[derive(Debug, Serialize)]
pub struct PerState<T> {
    pub initial: T,
    #[serde(rename = "final")]
    pub loaded: T,
}

impl<T> PerState<T> {
    fn new([initial, loaded]: [T; 2]) -> Self {
        Self { initial, loaded }
    }
}

impl FringeReport {
    pub fn new(fringes: &Fringes) -> Self {
        let spec = &fringes.spec;
        let of = |c: usize| ComponentReport::new(fringes, &fringes.components[c]);
        Self {
            schema: SCHEMA,
            rows: fringes.rows,
            cols: fringes.cols,
            pixel_mm: spec.pixel_mm,
            fringe_frequency_per_mm: spec.fringe_frequency_per_mm,
            order_nm: NM_PER_MM / spec.fringe_frequency_per_mm,
            u_along: spec.u_along,
            u: of(0),
            v: of(1),
            warnings: fringes.warnings.clone(),
        }
    }

    /// A few lines.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{} x {} pixels of {} mm, an order is {:.2} nm\n",
            self.cols, self.rows, self.pixel_mm, self.order_nm
        );
        for (component, name) in [&self.u, &self.v].into_iter().zip(COMPONENTS) {
            let total = (self.rows * self.cols) as f64;
            let share = 100.0 * component.pixels.measured as f64 / total;
            // writing to a String cannot fail
            let _ = writeln!(
                text,
                "  {name}: {share:.1} % of the picture measured, sd of a point {:.2} nm; {}",
                component.sd_nm,
                component.said_of_steps()
            );
        }
        for warning in &self.warnings {
            let _ = writeln!(text, "  warning: {warning}");
        }
        text
    }
}

impl ComponentReport {
    fn new(fringes: &Fringes, component: &Component) -> Self {
        let spec = &fringes.spec;
        let frames = &component.frames;
        let nm_per_rad = spec.mm_per_rad() * NM_PER_MM;
        let errors = |state: usize| {
            let all = frames.shifts[state].step_rad.iter().enumerate();
            let errors = all.map(|(n, step)| step.to_degrees() - spec.step_deg * (n + 1) as f64);
            let errors: Vec<f64> = errors.collect();
            let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
            errors.iter().map(|e| e - mean).collect()
        };
        Self {
            steps: component.chosen.steps,
            log_ratio: component.chosen.log_ratio,
            step_error_deg: PerState::new([errors(0), errors(1)]),
            gain: PerState::new([0, 1].map(|s| frames.shifts[s].gain.clone())),
            detector_gamma: frames.response.gamma(),
            noise_variance: [frames.noise.even, frames.noise.per_light],
            brightness: frames.ratio,
            sd_nm: component.sd_nm(),
            step_sd_nm: frames.left_rad * nm_per_rad,
            ripple_nm: PerState::new(component.ripple_rad.map(|r| r.map(|r| r * nm_per_rad))),
            pixels: component.counts(),
            parts: component.parts.clone(),
        }
    }

    fn said_of_steps(&self) -> String {
        let largest = [&self.step_error_deg.initial, &self.step_error_deg.loaded]
            .into_iter()
            .flatten()
            .fold(0.0_f64, |m, e| m.max(e.abs()));
        let by = self
            .log_ratio
            .map_or("as the file says".to_string(), |gain| {
                format!("log evidence of estimated ones {gain:+.0}")
            });
        match self.steps {
            Steps::Estimated => format!(
                "steps estimated ({by}), up to {largest:.1} degrees off, detector gamma {:.2}",
                self.detector_gamma
            ),
            _ => format!("nominal steps ({by})"),
        }
    }
}

/// The page.
///
/// # Errors
/// The program's fault if a figure cannot be drawn.
pub fn page(name: &str, fringes: &Fringes, report: &FringeReport) -> Result<String> {
    let mut sections = Vec::new();
    for (c, own) in [&report.u, &report.v].into_iter().enumerate() {
        let figures = figures(fringes, c)?;
        let body = html! {
            (frames_table(own))
            (pixels_table(own))
            div.maps { @for figure in &figures { (html::figure(figure)) } }
        };
        sections.push((COMPONENTS[c], body));
    }
    let along = [
        axis(report.u_along),
        axis(match report.u_along {
            Axis::X => Axis::Y,
            Axis::Y => Axis::X,
        }),
    ];
    let body = html! {
        header {
            h1 { "Fringe images of " (name) }
            p.soft { "plychain " (env!("CARGO_PKG_VERSION")) ", " (fringes.files.len() - 1) " images" }
            @for line in report.text().lines() { p { (line) } }
        }
        main {
            @for ((component, body), along) in sections.iter().zip(along) {
                section id=(component) { h2 { (component) ", along " (along) } (body) }
            }
        }
        footer.soft { "Displacements are known up to whole orders, and nothing is smoothed." }
    };
    Ok(html::document(&format!("{name}: plychain fringes"), &body))
}

fn axis(axis: Axis) -> &'static str {
    match axis {
        Axis::X => "x",
        Axis::Y => "y",
    }
}

fn frames_table(own: &ComponentReport) -> Markup {
    let states = [
        (
            &own.step_error_deg.initial,
            &own.gain.initial,
            &own.ripple_nm.initial,
        ),
        (
            &own.step_error_deg.loaded,
            &own.gain.loaded,
            &own.ripple_nm.loaded,
        ),
    ];
    html! {
        div.scroll { table {
            thead { tr {
                th { "state" } th { "step errors, degrees" } th { "brightness of frames" } th { "remaining ripple at 1, 2, 3 times the fringes, nm" }
            } }
            tbody { @for (state, (steps, gains, ripple)) in STATES.iter().zip(states) { tr {
                th { (state) }
                td { (joined(steps, 2)) } td { (joined(gains, 4)) } td { (joined(ripple, 2)) }
            } } }
        } }
    }
}

fn joined(values: &[f64], digits: usize) -> String {
    let values = values.iter().map(|v| format!("{v:.digits$}"));
    values.collect::<Vec<_>>().join(", ")
}

fn pixels_table(own: &ComponentReport) -> Markup {
    let counts = &own.pixels;
    let rows = [
        ("measured", counts.measured),
        ("left out because most frames are saturated", counts.clipped),
        ("without modulation", counts.dark),
        (
            "contradicted by a frame or by the other state",
            counts.spoiled,
        ),
        ("of fringes too fine to follow", counts.too_fine),
        ("in a part too small", counts.isolated),
    ];
    html! {
        table { tbody { @for (what, count) in rows { tr { th { "pixels " (what) } td { (count) } } } } }
    }
}

/// First frames, phase before and after unwrapping, modulation, sd.
fn figures(fringes: &Fringes, c: usize) -> Result<Vec<Figure>> {
    let own = &fringes.components[c];
    let name = COMPONENTS[c];
    let size = [fringes.rows, fringes.cols];
    let point = |row: usize, col: usize| fringes.spec.point(size, row, col);
    let at = |row: usize, col: usize| row * fringes.cols + col;
    let draw = |stem: &str, title: String, unit, middle, value: &dyn Fn(usize) -> f64| {
        let of = |row: usize, col: usize| value(at(row, col));
        let scale = Scale {
            palette: Palette::Field,
            range: span((0..size[0] * size[1]).step_by(7).map(value)),
            unit,
        };
        let picture = Picture {
            name: format!("{name}-{stem}"),
            title,
            size,
            point: &point,
            value: &of,
            scale,
            middle,
        };
        picture.draw()
    };
    let seen = |i: usize, value: f64| {
        if own.displacement_mm[i].is_finite() {
            value
        } else {
            f64::NAN
        }
    };
    let frame = |s: usize| {
        let values = &own.first[s];
        draw(
            STATES[s],
            format!("{name}, first frame of the {} state", STATES[s]),
            "recorded",
            true,
            &|i| f64::from(values[i]),
        )
    };
    Ok(vec![
        frame(0)?,
        frame(1)?,
        draw(
            "wrapped",
            format!("{name}, phase difference, wrapped"),
            "rad",
            true,
            &|i| seen(i, own.wrapped_rad[i]),
        )?,
        draw(
            "displacement",
            format!("{name}, displacement"),
            "\u{b5}m",
            false,
            &|i| own.displacement_mm[i] * 1e3,
        )?,
        draw(
            "modulation",
            format!("{name}, modulation of the initial state"),
            "recorded",
            false,
            &|i| own.modulation[i],
        )?,
        draw("sd", format!("{name}, sd of a point"), "nm", false, &|i| {
            own.sd_mm[i] * NM_PER_MM
        })?,
    ])
}
