//! Known shapes as meshes of all four kinds, with the edges and regions that they should have.

use std::collections::BTreeMap;

use plychain::mesh_files::ElementKind;

pub const KINDS: [ElementKind; 4] = [
    ElementKind::T3,
    ElementKind::T6,
    ElementKind::Q4,
    ElementKind::Q8,
];

/// A mesh to be written: indices from 0.
#[derive(Debug, Clone, Default)]
pub struct Model {
    pub nodes: Vec<[f64; 3]>,
    pub cells: Vec<(ElementKind, Vec<usize>)>,
    /// Lines along edges: corner, corner, midside if there is one.
    pub edges: BTreeMap<String, Vec<Vec<usize>>>,
    pub regions: BTreeMap<String, Vec<usize>>,
}

/// The map of the unit square.
pub type Map<'a> = &'a dyn Fn(f64, f64) -> [f64; 2];

/// A lattice of points, of which only those that elements use are made.
struct Lattice<'a> {
    map: Map<'a>,
    counts: [usize; 2],
    closed: bool,
    index: BTreeMap<(usize, usize), usize>,
    nodes: Vec<[f64; 3]>,
}

impl Lattice<'_> {
    /// The node at half steps (i, j).
    fn node(&mut self, i: usize, j: usize) -> usize {
        let j = if self.closed {
            j % (2 * self.counts[1])
        } else {
            j
        };
        let [u, v] = [
            i as f64 / (2 * self.counts[0]) as f64,
            j as f64 / (2 * self.counts[1]) as f64,
        ];
        let nodes = &mut self.nodes;
        let map = self.map;
        *self.index.entry((i, j)).or_insert_with(|| {
            let [x, y] = map(u, v);
            nodes.push([x, y, 0.0]);
            nodes.len() - 1
        })
    }

    /// Nodes of an element by half steps of its corners.
    fn cell(&mut self, kind: ElementKind, corners: &[(usize, usize)]) -> (ElementKind, Vec<usize>) {
        let mut nodes: Vec<usize> = corners.iter().map(|&(i, j)| self.node(i, j)).collect();
        if kind.is_quadratic() {
            for k in 0..corners.len() {
                let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                nodes.push(self.node((a.0 + b.0) / 2, (a.1 + b.1) / 2));
            }
        }
        (kind, nodes)
    }
}

/// The image of the unit square, `counts` elements each way; `closed` joins its second direction's ends. Edges `u0`, `u1` and,
/// unless closed, `v0`, `v1`; regions `all` and `half` (the first half along u).
pub fn grid(kind: ElementKind, counts: [usize; 2], closed: bool, map: Map<'_>) -> Model {
    let mut lattice = Lattice {
        map,
        counts,
        closed,
        index: BTreeMap::new(),
        nodes: Vec::new(),
    };
    let mut model = Model::default();
    for i in (0..2 * counts[0]).step_by(2) {
        for j in (0..2 * counts[1]).step_by(2) {
            let [a, b, c, d] = [(i, j), (i + 2, j), (i + 2, j + 2), (i, j + 2)];
            let first = model.cells.len();
            if kind.corners() == 4 {
                model.cells.push(lattice.cell(kind, &[a, b, c, d]));
            } else {
                model.cells.push(lattice.cell(kind, &[a, b, c]));
                model.cells.push(lattice.cell(kind, &[a, c, d]));
            }
            let last = model.cells.len();
            model
                .regions
                .entry("all".into())
                .or_default()
                .extend(first..last);
            if i < counts[0] {
                model
                    .regions
                    .entry("half".into())
                    .or_default()
                    .extend(first..last);
            }
        }
    }
    let mut line = |name: &str, a: (usize, usize), b: (usize, usize)| {
        let mut nodes = vec![lattice.node(a.0, a.1), lattice.node(b.0, b.1)];
        if kind.is_quadratic() {
            nodes.push(lattice.node((a.0 + b.0) / 2, (a.1 + b.1) / 2));
        }
        model.edges.entry(name.to_string()).or_default().push(nodes);
    };
    for j in (0..2 * counts[1]).step_by(2) {
        line("u0", (0, j), (0, j + 2));
        line("u1", (2 * counts[0], j), (2 * counts[0], j + 2));
    }
    for i in (0..2 * counts[0]).step_by(2).filter(|_| !closed) {
        line("v0", (i, 0), (i + 2, 0));
        line("v1", (i, 2 * counts[1]), (i + 2, 2 * counts[1]));
    }
    model.nodes = lattice.nodes;
    model
}

/// A rectangle of 30 x 10 mm from (-10, 5).
pub fn rectangle(kind: ElementKind, counts: [usize; 2]) -> Model {
    grid(kind, counts, false, &|u, v| {
        [-10.0 + 30.0 * u, 5.0 + 10.0 * v]
    })
}

pub const INNER: f64 = 3.0;
pub const OUTER: f64 = 8.0;

/// A ring; `u0` is its hole.
pub fn ring(kind: ElementKind, counts: [usize; 2]) -> Model {
    grid(kind, counts, true, &|u, v| {
        let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
        let r = INNER + (OUTER - INNER) * u;
        [r * cos, r * sin]
    })
}

impl Model {
    /// The same with all elements clockwise.
    pub fn mirrored(mut self) -> Self {
        for p in &mut self.nodes {
            p[1] = -p[1];
        }
        self
    }

    /// Another one beside it, with `gap` between, not joined.
    pub fn twice(mut self, shift: [f64; 2]) -> Self {
        let (nodes, cells) = (self.nodes.len(), self.cells.clone());
        let moved: Vec<[f64; 3]> = self
            .nodes
            .iter()
            .map(|p| [p[0] + shift[0], p[1] + shift[1], p[2]])
            .collect();
        self.nodes.extend(moved);
        for (kind, all) in cells {
            self.cells
                .push((kind, all.into_iter().map(|n| n + nodes).collect()));
        }
        self
    }

    /// Numbers of regions and edges that hold an element or line.
    pub fn regions_of(&self, cell: usize) -> Vec<usize> {
        let has = |cells: &Vec<usize>| cells.contains(&cell);
        (0..)
            .zip(self.regions.values())
            .filter(|(_, c)| has(c))
            .map(|(i, _)| i)
            .collect()
    }
}

/// What is simulated of a mesh runs from its folder, wherever that goes.
#[test]
fn a_simulated_mesh_has_its_mesh_beside_it() {
    let own = crate::common::model("two-holes.json");
    let out = crate::common::simulated(&own, "--grid 20");
    let moved = crate::common::fresh("moved");
    std::fs::rename(&out, &moved).unwrap();
    let model = plychain::infer::Model::load(&moved.join("model.json")).unwrap();
    let mesh = model.experiment().mesh.as_ref().unwrap();
    assert_eq!(mesh.file, std::path::Path::new("two-holes.msh"));
    assert!(model.read_field().unwrap().len() > 100);
}
