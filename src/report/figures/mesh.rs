//! The mesh of a specimen with its named edges, what acts on them, and the measured points: whether both lie in one frame is seen.

use indexmap::IndexSet;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{Area, Figure, GRID, INK, PRIOR, SERIES, TRUTH, axes_mm, draw, say, span};
use crate::error::Result;
use crate::report::numbers::{MeshPart, MeshPoint};

/// Pixels for the longer side of the plot, for its axes, and for the names of the edges.
const LONG: f64 = 760.0;
const LEFT: u32 = 52;
const BELOW: u32 = 40;
const NAMES: u32 = 190;

/// The mesh, its edges by name, forces, supports and measured points; none of nothing.
pub fn mesh(points: &[MeshPoint]) -> Result<Option<Figure>> {
    if points.is_empty() {
        return Ok(None);
    }
    let wide = |of: &dyn Fn(&MeshPoint) -> f64| {
        let [low, high] = span(points.iter().map(of));
        let room = 0.03 * (high - low);
        [low - room, high + room]
    };
    let (x, y) = (wide(&|p| p.x_mm), wide(&|p| p.y_mm));
    let scale = LONG / (x[1] - x[0]).max(y[1] - y[0]);
    let [width, height] = [x, y].map(|v| (scale * (v[1] - v[0])).max(60.0).round() as u32);
    let names = names(points);
    let least = 24 * (names.len() as u32 + 5);
    let size = (LEFT + width + NAMES, (height + BELOW + 10).max(least));
    let alt = "The mesh in the data's frame: named edges in colour, forces, supports, borders of regions, and measured points, in red where they are off the mesh";
    let figure = draw("mesh", alt, size, |root, _| {
        let plot = root
            .clone()
            .shrink((0, 0), (LEFT + width, height + BELOW + 10));
        lines_of(&plot, points, &names, (x, y))?;
        legend(root, points, &names, (LEFT + width + 14) as i32)
    })?;
    Ok(Some(figure))
}

/// Names of edges, in the order of the rows.
fn names(points: &[MeshPoint]) -> IndexSet<&str> {
    let edges = points.iter().filter(|p| p.part == MeshPart::Edge);
    edges.map(|p| p.name.as_str()).collect()
}

fn colour(names: &IndexSet<&str>, name: &str) -> RGBColor {
    let place = names.get_index_of(name).unwrap_or(0);
    SERIES[place % SERIES.len()]
}

fn lines_of(
    area: &Area<'_>,
    points: &[MeshPoint],
    names: &IndexSet<&str>,
    (x, y): ([f64; 2], [f64; 2]),
) -> Result<()> {
    let mut chart = ChartBuilder::on(area)
        .margin_top(10)
        .x_label_area_size(BELOW)
        .y_label_area_size(LEFT)
        .build_cartesian_2d(x[0]..x[1], y[0]..y[1])?;
    axes_mm(&mut chart, [6, 8], 10)?;
    let canvas = chart.plotting_area();
    let dot = |p: &MeshPoint, radius: i32, colour: RGBColor| {
        canvas.draw(&Circle::new((p.x_mm, p.y_mm), radius, colour.filled()))
    };
    for line in points.chunk_by(|a, b| a.line == b.line) {
        let path: Vec<(f64, f64)> = line.iter().map(|p| (p.x_mm, p.y_mm)).collect();
        let first = &line[0];
        let style = match first.part {
            MeshPart::Element => GRID.stroke_width(1),
            MeshPart::Boundary => INK.stroke_width(1),
            MeshPart::Joint => INK.stroke_width(2),
            MeshPart::Edge => colour(names, &first.name).stroke_width(3),
            MeshPart::Force => INK.stroke_width(2),
            MeshPart::Held => {
                dot(first, 3, INK)?;
                continue;
            }
            MeshPart::On => {
                dot(first, 1, PRIOR)?;
                continue;
            }
            MeshPart::Off => {
                dot(first, 2, TRUTH)?;
                continue;
            }
        };
        if let (MeshPart::Force, [from, to]) = (first.part, &path[..]) {
            canvas.draw(&PathElement::new(head(*from, *to), style))?;
        }
        canvas.draw(&PathElement::new(path, style))?;
    }
    Ok(())
}

/// The head of an arrow.
fn head(from: (f64, f64), to: (f64, f64)) -> Vec<(f64, f64)> {
    let back = [0.3 * (from.0 - to.0), 0.3 * (from.1 - to.1)];
    let barb = |side: f64| {
        (
            to.0 + back[0] - 0.5 * side * back[1],
            to.1 + back[1] + 0.5 * side * back[0],
        )
    };
    vec![barb(1.0), to, barb(-1.0)]
}

/// What the colours mean.
fn legend(area: &Area<'_>, points: &[MeshPoint], names: &IndexSet<&str>, left: i32) -> Result<()> {
    let has = |part: MeshPart, name: &str| points.iter().any(|p| p.part == part && p.name == name);
    let mut at = 20;
    let mut line = |words: String, colour: RGBColor| -> Result<()> {
        let mark = [(left, at - 4), (left + 14, at + 4)];
        area.draw(&Rectangle::new(mark, colour.filled()))?;
        say(area, words, (left + 22, at), 12, HPos::Left)?;
        at += 24;
        Ok(())
    };
    for name in names {
        let acts = match (has(MeshPart::Force, name), has(MeshPart::Held, name)) {
            (true, _) => ": force",
            (_, true) => ": held",
            _ => "",
        };
        line(format!("{name}{acts}"), colour(names, name))?;
    }
    for (part, words, colour) in [
        (MeshPart::Joint, "border of a region", INK),
        (MeshPart::On, "measured point", PRIOR),
        (MeshPart::Off, "measured, off the mesh", TRUTH),
    ] {
        if has(part, "") {
            line(words.into(), colour)?;
        }
    }
    Ok(())
}
