//! The mesh of a specimen with its named edges, what acts on them, and the measured points: whether both lie in one frame is seen.

use std::collections::BTreeMap;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{Area, Figure, GRID, INK, PRIOR, SERIES, TRUTH, axes_mm, draw, say, span};
use super::data::{MeshPart, MeshPoint};
use crate::error::Result;
use crate::fem::Locator;
use crate::field::Frame;
use crate::geometry::{Edge, EdgeForce, HIGH, LOW, Mesh};

/// Elements are drawn up to this many; of a finer mesh the boundary alone is.
const MOST_ELEMENTS: usize = 6000;

/// Measured points that are drawn at most.
const MOST_POINTS: usize = 2000;

/// The picture's lines and points in the data's frame. `points` are measured places there.
pub fn lines(mesh: &Mesh, frame: &Frame, points: &[[f64; 2]]) -> Vec<MeshPoint> {
    let mut lines = Lines {
        found: Vec::new(),
        count: 0,
    };
    let at = |n: &u32| frame.data_point(mesh.nodes[*n as usize]);
    let Sides {
        inner,
        joint,
        boundary,
    } = sides(mesh);
    if mesh.elements.len() <= MOST_ELEMENTS {
        for trail in trails(mesh, &inner) {
            lines.add(MeshPart::Element, "", trail.iter().map(at));
        }
    }
    for (part, sides) in [(MeshPart::Joint, &joint), (MeshPart::Boundary, &boundary)] {
        for side in sides {
            lines.add(part, "", side.iter().map(at));
        }
    }
    for (name, edges) in &mesh.edges {
        for edge in edges {
            lines.add(MeshPart::Edge, name, edge.iter().map(at));
        }
    }
    let [s, t] = mesh.extents;
    let arrow = 0.08 * (s[1] - s[0]).hypot(t[1] - t[0]);
    for (name, direction) in pulled(mesh) {
        if let Some(middle) = middle(mesh, name) {
            let tip = [0, 1].map(|k| middle[k] + arrow * direction[k]);
            lines.add(
                MeshPart::Force,
                name,
                [middle, tip].map(|p| frame.data_point(p)),
            );
        }
    }
    let held = mesh.boundary.iter().flat_map(|b| &b.held);
    for (name, _) in held {
        let nodes = mesh.edge(name).iter().map(|edge| at(&edge[1]));
        nodes.for_each(|p| lines.add(MeshPart::Held, name, [p]));
    }
    let stride = points.len().div_ceil(MOST_POINTS).max(1);
    let shown: Vec<[f64; 2]> = points.iter().step_by(stride).copied().collect();
    for (p, holds) in shown.iter().zip(on_mesh(mesh, frame, &shown)) {
        let part = if holds { MeshPart::On } else { MeshPart::Off };
        lines.add(part, "", [*p]);
    }
    lines.found
}

/// Which of some measured places, in the data's frame, lie on the mesh.
pub fn on_mesh(mesh: &Mesh, frame: &Frame, points: &[[f64; 2]]) -> Vec<bool> {
    let points: Vec<[f64; 2]> = points.iter().map(|&p| frame.point(p)).collect();
    Locator::new(mesh).holds(&points)
}

struct Lines {
    found: Vec<MeshPoint>,
    count: usize,
}

impl Lines {
    fn add(&mut self, part: MeshPart, name: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        let line = self.count;
        let short = |x: f64| (1e4 * x).round() / 1e4;
        self.found.extend(points.into_iter().map(|p| MeshPoint {
            part,
            name: name.into(),
            line,
            x_mm: short(p[0]),
            y_mm: short(p[1]),
        }));
        self.count += 1;
    }
}

/// The edges that a force pulls and along which direction: of a strip, its ends.
fn pulled(mesh: &Mesh) -> Vec<(&str, [f64; 2])> {
    let Some(boundary) = &mesh.boundary else {
        return vec![(HIGH, [1.0, 0.0]), (LOW, [-1.0, 0.0])];
    };
    let of = |load: &EdgeForce| load.direction;
    let loads = boundary.loads.iter();
    loads
        .flat_map(|load| load.edges.iter().map(move |name| (name.as_str(), of(load))))
        .collect()
}

/// The mean of an edge's nodes.
fn middle(mesh: &Mesh, name: &str) -> Option<[f64; 2]> {
    let edges = mesh.edge(name);
    let count = edges.len() as f64;
    let mean = |k: usize| {
        edges
            .iter()
            .map(|e| mesh.nodes[e[1] as usize][k])
            .sum::<f64>()
            / count
    };
    (!edges.is_empty()).then(|| [mean(0), mean(1)])
}

/// Sides of elements.
#[derive(Default)]
struct Sides {
    /// Those that two of one stack share.
    inner: Vec<Edge>,
    /// Those between two stacks.
    joint: Vec<Edge>,
    /// Those of one element.
    boundary: Vec<Edge>,
}

fn sides(mesh: &Mesh) -> Sides {
    let mut seen: BTreeMap<[u32; 2], (Edge, Vec<usize>)> = BTreeMap::new();
    for (e, element) in mesh.elements.iter().enumerate() {
        for k in 0..4 {
            let (a, b) = (element[k], element[(k + 1) % 4]);
            let side = [a, element[4 + k], b];
            let of = seen.entry([a.min(b), a.max(b)]);
            of.or_insert((side, Vec::new())).1.push(mesh.region_of(e));
        }
    }
    let mut sides = Sides::default();
    for (side, stacks) in seen.into_values() {
        let kind = match &stacks[..] {
            [_] => &mut sides.boundary,
            [first, others @ ..] if others.iter().any(|s| s != first) => &mut sides.joint,
            _ => &mut sides.inner,
        };
        kind.push(side);
    }
    sides
}

/// Sides as few long lines: each goes on as long as there is a side that was not walked.
fn trails(mesh: &Mesh, sides: &[Edge]) -> Vec<Vec<u32>> {
    let mut at_node = vec![Vec::new(); mesh.nodes.len()];
    for (k, [a, _, b]) in sides.iter().enumerate() {
        at_node[*a as usize].push(k);
        at_node[*b as usize].push(k);
    }
    let mut walked = vec![false; sides.len()];
    let mut trails = Vec::new();
    for start in 0..sides.len() {
        if walked[start] {
            continue;
        }
        let mut here = sides[start][0];
        let mut trail = vec![here];
        while let Some(&k) = at_node[here as usize].iter().find(|k| !walked[**k]) {
            walked[k] = true;
            let [a, middle, b] = sides[k];
            here = if a == here { b } else { a };
            trail.extend([middle, here]);
        }
        trails.push(trail);
    }
    trails
}

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
    let alt = "The mesh in the data's frame: named edges in colour, where the force pulls, what is held, borders of regions, and the measured points, those off the mesh in red";
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
fn names(points: &[MeshPoint]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for p in points.iter().filter(|p| p.part == MeshPart::Edge) {
        if !names.contains(&p.name.as_str()) {
            names.push(&p.name);
        }
    }
    names
}

fn colour(names: &[&str], name: &str) -> RGBColor {
    let place = names.iter().position(|n| *n == name).unwrap_or(0);
    SERIES[place % SERIES.len()]
}

fn lines_of(
    area: &Area<'_>,
    points: &[MeshPoint],
    names: &[&str],
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
fn legend(area: &Area<'_>, points: &[MeshPoint], names: &[&str], left: i32) -> Result<()> {
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
