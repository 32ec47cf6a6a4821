//! What `plychain fringes` found: `fringes.json`, a summary for the terminal, and the page.

use serde::Serialize;

use super::figures::{Figure, Palette, PixelPicture, Scale, span};
use super::html::html;
use crate::error::Result;
use crate::field::frame::Axis;
use crate::field::fringes::{COMPONENTS, Counts, DisplacementMap, Fringes, PhaseSteps, STATES};
use crate::quantity::NM_PER_MM;
use crate::section::{Document, Piece, Section, Table, TableCell, row};

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
    pub steps: PhaseSteps,
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

    /// How much was measured, and how well.
    pub fn section(&self) -> Section {
        let said = [&self.u, &self.v]
            .into_iter()
            .zip(COMPONENTS)
            .map(|(component, name)| {
                let total = (self.rows * self.cols) as f64;
                let share = 100.0 * component.pixels.measured as f64 / total;
                let said = format!(
                    "{share:.1} % of the picture measured, sd of a point {:.2} nm; {}",
                    component.sd_nm,
                    component.said_of_steps()
                );
                (name.to_string(), said)
            });
        Section::default()
            .say(format!(
                "{} x {} pixels of {} mm, an order is {:.2} nm",
                self.cols, self.rows, self.pixel_mm, self.order_nm
            ))
            .with(Piece::List(said.collect()))
            .with(Piece::Warnings(self.warnings.clone()))
    }
}

impl ComponentReport {
    fn new(fringes: &Fringes, component: &DisplacementMap) -> Self {
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
            PhaseSteps::Estimated => format!(
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
    let (mut sections, mut drawn) = (Vec::new(), Vec::new());
    let along = match report.u_along {
        Axis::X => ["x", "y"],
        Axis::Y => ["y", "x"],
    };
    for (c, found) in [&report.u, &report.v].into_iter().enumerate() {
        let figures = figures(fringes, c)?;
        let section = Section::new(format!("{}, along {}", COMPONENTS[c], along[c]))
            .with(frames_table(found))
            .with(pixels_table(found))
            .with(Piece::Gallery {
                heading: String::new(),
                names: figures.iter().map(|f| f.name.clone()).collect(),
            });
        sections.push(section);
        drawn.extend(figures);
    }
    let version = env!("CARGO_PKG_VERSION");
    let about = format!("plychain {version}, {} images", fringes.files.len() - 1);
    let document = Document {
        title: format!("{name}: plychain fringes"),
        heading: format!("Fringe images of {name}"),
        lead: std::iter::once(Piece::Note(about))
            .chain(report.section().pieces)
            .collect(),
        sections,
        folded: false,
        footer: "Displacements are known up to whole orders, and nothing is smoothed.".into(),
    };
    Ok(html(&document, &drawn))
}

fn frames_table(found: &ComponentReport) -> Table {
    let (errors, gains, ripples) = (&found.step_error_deg, &found.gain, &found.ripple_nm);
    let states = [
        (&errors.initial, &gains.initial, &ripples.initial),
        (&errors.loaded, &gains.loaded, &ripples.loaded),
    ];
    let rows = STATES
        .iter()
        .zip(states)
        .map(|(state, (steps, gains, ripple))| {
            let cells = [joined(steps, 2), joined(gains, 4), joined(ripple, 2)];
            row(*state, cells)
        });
    let header = [
        "state",
        "step errors, degrees",
        "brightness of frames",
        "remaining ripple at 1, 2, 3 times the fringes, nm",
    ];
    Table::new("", header, rows)
}

fn joined(values: &[f64], decimals: usize) -> TableCell {
    let values = values.iter().map(|v| TableCell::fixed(*v, decimals));
    TableCell::Several(values.collect())
}

fn pixels_table(found: &ComponentReport) -> Table {
    let counts = &found.pixels;
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
    let rows = rows.map(|(what, count)| row(what, [TableCell::count(count)]));
    Table::new("", ["pixels", ""], rows)
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
        let picture = PixelPicture {
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
