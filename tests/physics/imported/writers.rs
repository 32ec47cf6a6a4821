//! Writers of what the readers read.

use std::collections::BTreeMap;
use std::fmt::Write;

use plychain::mesh_files::ElementKind;

use super::model::Model;

/// Numbers that files use for nodes: with gaps, not from 1.
pub fn number(index: usize) -> usize {
    3 * index + 10
}

fn gmsh_type(kind: ElementKind) -> i32 {
    match kind {
        ElementKind::T3 => 2,
        ElementKind::Q4 => 3,
        ElementKind::T6 => 9,
        ElementKind::Q8 => 16,
    }
}

/// Tags of physical groups: edges 101.., regions 201..
fn names(model: &Model) -> String {
    let mut text = format!(
        "$PhysicalNames\n{}\n",
        model.edges.len() + model.regions.len()
    );
    for (i, name) in model.edges.keys().enumerate() {
        writeln!(text, "1 {} \"{name}\"", 101 + i).unwrap();
    }
    for (i, name) in model.regions.keys().enumerate() {
        writeln!(text, "2 {} \"{name}\"", 201 + i).unwrap();
    }
    text + "$EndPhysicalNames\n"
}

/// A file's numbers, as text or in binary.
struct Sink {
    bytes: Vec<u8>,
    binary: bool,
}

impl Sink {
    fn text(&mut self, text: &str) {
        self.bytes.extend(text.as_bytes());
    }

    fn int(&mut self, n: i64) {
        match self.binary {
            true => self.bytes.extend((n as i32).to_le_bytes()),
            false => self.text(&format!("{n} ")),
        }
    }

    fn size(&mut self, n: usize) {
        match self.binary {
            true => self.bytes.extend((n as u64).to_le_bytes()),
            false => self.text(&format!("{n} ")),
        }
    }

    fn real(&mut self, x: f64) {
        match self.binary {
            true => self.bytes.extend(x.to_le_bytes()),
            false => self.text(&format!("{x:e} ")),
        }
    }

    fn end(&mut self) {
        if !self.binary {
            self.text("\n");
        }
    }

    fn start(model: &Model, version: &str, binary: bool) -> Self {
        let mut sink = Self {
            bytes: Vec::new(),
            binary,
        };
        sink.text(&format!("$MeshFormat\n{version} {} 8\n", u8::from(binary)));
        if binary {
            sink.int(1);
            sink.text("\n");
        }
        sink.text("$EndMeshFormat\n$Comments\nanything $Nodes\n$EndComments\n");
        sink.text(&names(model));
        sink
    }
}

/// MSH 2.2; elements of several groups are written once for each, as Gmsh does.
pub fn msh22(model: &Model, binary: bool) -> Vec<u8> {
    let mut sink = Sink::start(model, "2.2", binary);
    sink.text(&format!("$Nodes\n{}\n", model.nodes.len()));
    for (i, p) in model.nodes.iter().enumerate() {
        sink.int(number(i) as i64);
        p.iter().for_each(|x| sink.real(*x));
        sink.end();
    }
    let mut all: Vec<(i32, usize, Vec<usize>)> = Vec::new();
    for (i, lines) in model.edges.values().enumerate() {
        let kind = |line: &Vec<usize>| if line.len() == 3 { 8 } else { 1 };
        all.extend(lines.iter().map(|l| (kind(l), 101 + i, l.clone())));
    }
    for (cell, (kind, nodes)) in model.cells.iter().enumerate() {
        let regions = model.regions_of(cell);
        let tags = if regions.is_empty() {
            vec![0]
        } else {
            regions.iter().map(|r| 201 + r).collect()
        };
        all.extend(
            tags.into_iter()
                .map(|tag| (gmsh_type(*kind), tag, nodes.clone())),
        );
    }
    let points = usize::from(!model.nodes.is_empty());
    sink.text(if binary { "\n" } else { "" });
    sink.text(&format!("$EndNodes\n$Elements\n{}\n", all.len() + points));
    let all = (0..points).map(|_| (15, 0, vec![0])).chain(all);
    for (k, (kind, tag, nodes)) in all.enumerate() {
        let header = if binary {
            vec![i64::from(kind), 1, 2, k as i64 + 1]
        } else {
            vec![k as i64 + 1, i64::from(kind), 2]
        };
        header.into_iter().for_each(|n| sink.int(n));
        sink.int(tag as i64);
        sink.int(1);
        nodes.iter().for_each(|n| sink.int(number(*n) as i64));
        sink.end();
    }
    sink.text(if binary {
        "\n$EndElements\n"
    } else {
        "$EndElements\n"
    });
    sink.bytes
}

/// Elements by their regions and type: the surfaces of version 4.1.
type Surfaces = BTreeMap<(Vec<usize>, i32), Vec<usize>>;

/// MSH 4.1: an entity for every edge and every combination of regions.
pub fn msh41(model: &Model, binary: bool) -> Vec<u8> {
    let mut sink = Sink::start(model, "4.1", binary);
    let mut surfaces = Surfaces::new();
    for (cell, (kind, _)) in model.cells.iter().enumerate() {
        let key = (model.regions_of(cell), gmsh_type(*kind));
        surfaces.entry(key).or_default().push(cell);
    }
    let gap = if binary { "\n" } else { "" };
    sink.text("$Entities\n");
    entities41(&mut sink, model, &surfaces);
    sink.text(&format!("{gap}$EndEntities\n$Nodes\n"));
    nodes41(&mut sink, model);
    sink.text(&format!("{gap}$EndNodes\n$Elements\n"));
    elements41(&mut sink, model, &surfaces);
    sink.text(&format!("{gap}$EndElements\n"));
    sink.bytes
}

/// One point, a curve for each edge, the surfaces.
fn entities41(sink: &mut Sink, model: &Model, surfaces: &Surfaces) {
    [1, model.edges.len(), surfaces.len(), 0]
        .into_iter()
        .for_each(|n| sink.size(n));
    sink.end();
    sink.int(1);
    (0..3).for_each(|_| sink.real(0.0));
    sink.size(0);
    sink.end();
    let mut entity = |tag: usize, groups: &[usize]| {
        sink.int(tag as i64);
        (0..6).for_each(|_| sink.real(-1.0));
        sink.size(groups.len());
        groups.iter().for_each(|g| sink.int(*g as i64));
        sink.size(2);
        sink.int(1);
        sink.int(-1);
        sink.end();
    };
    (0..model.edges.len()).for_each(|i| entity(7 + i, &[101 + i]));
    for (i, (regions, _)) in surfaces.keys().enumerate() {
        entity(7 + i, &regions.iter().map(|r| 201 + r).collect::<Vec<_>>());
    }
}

/// A block for each entity.
fn elements41(sink: &mut Sink, model: &Model, surfaces: &Surfaces) {
    let lines: usize = model.edges.values().map(Vec::len).sum();
    let blocks = model.edges.len() + surfaces.len();
    [blocks, lines + model.cells.len(), 1, 9999]
        .into_iter()
        .for_each(|n| sink.size(n));
    sink.end();
    let mut count = 0;
    let mut block = |header: [i64; 3], elements: &[&Vec<usize>]| {
        header.into_iter().for_each(|n| sink.int(n));
        sink.size(elements.len());
        sink.end();
        for nodes in elements {
            count += 1;
            sink.size(count);
            nodes.iter().for_each(|n| sink.size(number(*n)));
            sink.end();
        }
    };
    for (i, lines) in model.edges.values().enumerate() {
        let kind = if lines[0].len() == 3 { 8 } else { 1 };
        block([1, 7 + i as i64, kind], &lines.iter().collect::<Vec<_>>());
    }
    for (i, ((_, kind), cells)) in surfaces.iter().enumerate() {
        let nodes: Vec<&Vec<usize>> = cells.iter().map(|c| &model.cells[*c].1).collect();
        block([2, 7 + i as i64, i64::from(*kind)], &nodes);
    }
}

/// Two blocks of nodes, the second with parameters.
fn nodes41(sink: &mut Sink, model: &Model) {
    [2, model.nodes.len(), 1, 9999]
        .into_iter()
        .for_each(|n| sink.size(n));
    sink.end();
    let half = model.nodes.len() / 2;
    for (range, parametric) in [(0..half, 0), (half..model.nodes.len(), 1)] {
        [2, 7, parametric].into_iter().for_each(|n| sink.int(n));
        sink.size(range.len());
        sink.end();
        for i in range.clone() {
            sink.size(number(i));
            sink.end();
        }
        for i in range {
            model.nodes[i].iter().for_each(|x| sink.real(*x));
            (0..2 * parametric).for_each(|_| sink.real(f64::from(parametric as i32)));
            sink.end();
        }
    }
}

pub fn abaqus_type(kind: ElementKind) -> &'static str {
    match kind {
        ElementKind::T3 => "CPS3",
        ElementKind::Q4 => "CPS4R",
        ElementKind::T6 => "STRI65",
        ElementKind::Q8 => "S8R",
    }
}

/// An input file without parts: edges as node sets, regions as element sets.
pub fn inp(model: &Model) -> String {
    let mut text = "*Heading\n made for a test\n** nodes\n*Node\n".to_string();
    text += &nodes(model);
    text += &elements(model);
    for (name, lines) in &model.edges {
        let mut all: Vec<usize> = lines.iter().flatten().map(|n| number(*n)).collect();
        all.sort_unstable();
        all.dedup();
        writeln!(text, "*Nset, nset={name}\n{}", data(&all)).unwrap();
    }
    for (name, cells) in &model.regions {
        let all: Vec<usize> = cells.iter().map(|c| c + 1).collect();
        writeln!(text, "*Elset, elset={name}\n{}", data(&all)).unwrap();
    }
    text + "*Step\n*Static\n1., 1.\n*Node Output\nU\n*End Step\n"
}

pub fn nodes(model: &Model) -> String {
    let line = |(i, p): (usize, &[f64; 3])| format!("{:>7}, {:>20}, {}\n", number(i), p[0], p[1]);
    model.nodes.iter().enumerate().map(line).collect()
}

/// Elements, each in a block of its own type, long ones on two lines.
pub fn elements(model: &Model) -> String {
    let mut text = String::new();
    for (c, (kind, nodes)) in model.cells.iter().enumerate() {
        writeln!(text, "*Element, type={}", abaqus_type(*kind)).unwrap();
        let numbers: Vec<String> = nodes.iter().map(|n| number(*n).to_string()).collect();
        let (first, rest) = numbers.split_at(3);
        let rest = if rest.is_empty() {
            String::new()
        } else {
            format!(",\n {}", rest.join(","))
        };
        writeln!(text, "{},{}{rest}", c + 1, first.join(", ")).unwrap();
    }
    text
}

/// Numbers in lines of at most 16.
fn data(numbers: &[usize]) -> String {
    let line = |chunk: &[usize]| {
        chunk
            .iter()
            .map(usize::to_string)
            .collect::<Vec<_>>()
            .join(", ")
    };
    numbers.chunks(16).map(line).collect::<Vec<_>>().join(",\n")
}

/// A file format by name, and its writer.
pub type Writer = (&'static str, fn(&Model) -> Vec<u8>);

pub const WRITERS: [Writer; 5] = [
    ("2.2.msh", |m| msh22(m, false)),
    ("2.2-binary.msh", |m| msh22(m, true)),
    ("4.1.msh", |m| msh41(m, false)),
    ("4.1-binary.msh", |m| msh41(m, true)),
    ("sets.inp", |m| inp(m).into_bytes()),
];
