//! What all figures share: colours, type, and an SVG canvas that takes images stretched over a plotting area.

use std::fmt::Write;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::error::{Error, Result};
use crate::numeric::range;

/// Axes and text.
pub const INK: RGBColor = RGBColor(34, 34, 34);
pub const GRID: RGBColor = RGBColor(222, 222, 222);
/// What was believed before: priors.
pub const PRIOR: RGBColor = RGBColor(140, 140, 140);
pub const MAIN: RGBColor = RGBColor(42, 111, 151);
/// What is known to be true.
pub const TRUTH: RGBColor = RGBColor(200, 85, 61);
/// Where nothing was measured.
pub const NOT_MEASURED: RGBColor = RGBColor(176, 180, 186);
/// Colours of ensembles and components.
pub const SERIES: [RGBColor; 6] = [
    RGBColor(42, 111, 151),
    RGBColor(200, 125, 42),
    RGBColor(90, 143, 86),
    RGBColor(148, 97, 158),
    RGBColor(121, 121, 121),
    RGBColor(178, 90, 95),
];

/// A drawing area of a figure.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Type at `size` pixels.
pub fn text(size: u32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// A chart of places on the specimen.
type MapChart<'a, 'b> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Axes of x and y in mm without a grid: how many numbers along each at most, and their size in pixels.
pub fn axes_mm(
    chart: &mut MapChart<'_, '_>,
    [along_x, along_y]: [usize; 2],
    size: u32,
) -> Result<()> {
    chart
        .configure_mesh()
        .disable_mesh()
        .axis_style(INK)
        .label_style(text(size))
        .x_desc("x, mm")
        .y_desc("y, mm")
        .x_labels(along_x)
        .y_labels(along_y)
        .x_label_formatter(&step)
        .y_label_formatter(&step)
        .draw()?;
    Ok(())
}

/// Words of a size at a place: from it to the right, up to it from the left, or about it.
pub fn say(
    area: &Area<'_>,
    words: impl Into<String>,
    place: (i32, i32),
    size: u32,
    side: HPos,
) -> Result<()> {
    let style = text(size).pos(Pos::new(side, VPos::Center));
    Ok(area.draw(&Text::new(words.into(), place, style))?)
}

/// An image to be stretched over an area.
pub struct Stretched {
    /// Data URI.
    pub data: String,
    /// Pixels from left to right and from top to bottom.
    pub over: (Range<i32>, Range<i32>),
    /// Attributes for whoever reads values off it: palette's range and unit.
    pub range: Option<([f64; 2], &'static str)>,
}

/// A figure: its file's stem, what it shows in words, and the drawing.
#[derive(Debug)]
pub struct Figure {
    /// File stem in `figures/`.
    pub name: String,
    /// What it shows, for those who cannot see it and as its caption.
    pub alt: String,
    pub svg: String,
    /// Whether it has a file of its own beside the page.
    pub has_file: bool,
}

/// Draw on an SVG canvas. Images come after everything that `act` draws. All figures fail as this does, with the program's fault if
/// the library cannot draw.
pub fn draw(
    name: impl Into<String>,
    alt: impl Into<String>,
    size: (u32, u32),
    act: impl FnOnce(&Area<'_>, &mut Vec<Stretched>) -> Result<()>,
) -> Result<Figure> {
    let (name, alt) = (name.into(), alt.into());
    let mut svg = String::new();
    let mut images = Vec::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        act(&root, &mut images)?;
        root.present()?;
    }
    if let Some(end) = svg.rfind("</svg>") {
        svg.truncate(end);
    }
    for image in &images {
        let (x, y) = &image.over;
        let range = image.range.map_or(String::new(), |([low, high], unit)| {
            format!(
                " class=\"map\" data-low=\"{low:?}\" data-high=\"{high:?}\" data-unit=\"{unit}\""
            )
        });
        let _ = writeln!(
            svg,
            "<image x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\" image-rendering=\"optimizeSpeed\"{range} href=\"{}\"/>",
            x.start,
            y.start,
            x.end - x.start,
            y.end - y.start,
            image.data
        );
    }
    svg.push_str("</svg>\n");
    Ok(Figure {
        name,
        alt,
        svg,
        has_file: true,
    })
}

/// What the library says when it cannot draw.
impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for Error {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Error::program("figure", "a drawing").found(error)
    }
}

/// A number for an axis: as short as it can be.
pub fn step(value: &f64) -> String {
    let value = if value.abs() < 1e-12 { 0.0 } else { *value };
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    text.replace('-', "\u{2212}")
}

/// The finite part of a range, widened where it is empty.
pub fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = range(values.filter(|v| v.is_finite()));
    match (low.is_finite(), high > low) {
        (true, true) => divisible([low, high]),
        (true, false) => {
            let room = 0.5 * low.abs().max(1e-9);
            divisible([low - room, low + room])
        }
        _ => [0.0, 1.0],
    }
}

/// Largest size of a number on an axis.
const LARGEST: f64 = 1e250;

/// Smallest length of an axis over the larger of its ends.
const SHORTEST: f64 = 1e-9;

/// A range that an axis can be divided over: ticks are found by adding up a fraction of its length, which never ends where that fraction is
/// lost in the rounding of the ends.
pub fn divisible(range: [f64; 2]) -> [f64; 2] {
    let [low, high] = range.map(|v| v.clamp(-LARGEST, LARGEST));
    let least = SHORTEST * low.abs().max(high.abs()).max(1.0 / LARGEST);
    if high - low >= least {
        return [low, high];
    }
    let middle = 0.5 * (low + high);
    [middle - least, middle + least]
}

impl Figure {
    /// The figure under another name.
    pub fn called(self, name: &str) -> Self {
        Self {
            name: name.into(),
            ..self
        }
    }

    /// The drawing as a file of its own: titled, on white.
    pub fn file(&self) -> String {
        let head = format!(
            "><title>{}</title><rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>",
            escaped(&self.alt)
        );
        self.svg.replacen('>', &head, 1)
    }

    /// The drawing as part of a page: labelled for those who cannot see it.
    pub fn inline(&self) -> String {
        let head = format!("<svg role=\"img\" aria-label=\"{}\" ", escaped(&self.alt));
        self.svg.replacen("<svg ", &head, 1)
    }
}

/// Text for an attribute or an element.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
