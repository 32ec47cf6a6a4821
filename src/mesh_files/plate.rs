//! A specimen whose shape another program meshed.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::mesh::{BoundaryEdge, ImportedMesh};
use super::quads::{halved, quads};
use super::regions::stack_of_elements;
use super::spec::{MeshAxis, MeshSpec, Spread};
use super::{file, raise, read};
use crate::error::Result;
use crate::files::hex;
use crate::geometry::{
    Boundary, Density, EdgeForce, Geometry, HIGH, HOLE, LOW, Mesh, Morph, not_offered,
};
use crate::numeric::range;

/// A mesh file as it was read, with what loads and holds it.
#[derive(Clone)]
pub struct Part {
    pub spec: MeshSpec,
    /// Quadratic, in mm, in the file's own axes.
    pub mesh: ImportedMesh,
    /// The stack of each element, as [`Mesh::region`].
    stacks: Vec<u8>,
    /// What a user should know of it.
    pub warnings: Vec<String>,
    /// SHA-256 of the files that it was read from, one after the other.
    hash: String,
}

/// The circle that an edge lies on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    pub center: [f64; 2],
    pub radius: f64,
}

/// Stacks that meet within so many radii of the hole's centre leave no room in which its changes could fade.
const BESIDE: f64 = 1.5;

/// Nodes may be this far off a circle, as a share of its radius: what a mesh file's digits leave.
const ROUND: f64 = 1e-4;

/// Corners below which an edge is a polygon, whatever they lie on.
const FEWEST: usize = 6;

impl fmt::Debug for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let MeshSpec {
            mm_per_unit,
            origin_mm,
            loads,
            supports,
            regions,
            file: _,
        } = &self.spec;
        write!(
            f,
            "Part {{ {} x {mm_per_unit} mm, {origin_mm:?}, {loads:?}, {supports:?}",
            self.hash
        )?;
        if !regions.is_empty() {
            write!(f, ", {regions:?}")?;
        }
        f.write_str(" }")
    }
}

impl Part {
    /// Read the mesh of a spec whose path is absolute, or relative to the current directory.
    ///
    /// # Errors
    /// The input's fault: those of [`MeshSpec::validate`] and [`read`], an edge or a region that the mesh does not have, regions
    /// that overlap.
    pub fn read(spec: MeshSpec) -> Result<Self> {
        spec.validate()?;
        let mut mesh = read(&spec.file)?;
        spec.check_edges(&mesh)?;
        let stacks = stack_of_elements(&spec.regions, &mesh, &spec.file)?;
        for x in mesh.nodes.iter_mut().flatten() {
            *x *= spec.mm_per_unit;
        }
        let mut warnings = mesh.warnings();
        if mesh.elements.iter().any(|e| !e.kind.is_quadratic()) {
            warnings.push("the mesh is linear: nodes were put in the middle of its sides, and on smooth curved edges, such as a circle of at least 12 sides, onto the curve".to_string());
        }
        if spec.origin_mm.is_none() && mesh.edges.contains_key(HOLE) && mesh.circle(HOLE).is_none()
        {
            warnings.push("the edge \"hole\" is no circle: the mesh's own origin, not the hole's centre, is put at hole_center_in_data_mm; mesh.origin_mm says another".to_string());
        }
        let mut hash = Sha256::new();
        for path in &mesh.files {
            hash.update(file::load(path)?);
        }
        let hash = hex(&hash.finalize());
        let mesh = raise(mesh);
        Ok(Self {
            spec,
            mesh,
            stacks,
            warnings,
            hash,
        })
    }

    /// The files that it was read from.
    pub fn files(&self) -> &[PathBuf] {
        &self.mesh.files
    }

    /// The circle of the edge `hole`, if that is one.
    pub fn hole(&self) -> Option<Circle> {
        self.mesh.circle(HOLE)
    }

    /// The point of the mesh that the data's frame begins at, mm.
    pub fn origin(&self) -> [f64; 2] {
        let of_hole = || self.hole().map(|hole| hole.center);
        self.spec.origin_mm.or_else(of_hole).unwrap_or([0.0; 2])
    }
}

impl ImportedMesh {
    /// The circle of a named edge, if that is one: by its corners, between which a linear mesh is straight.
    pub fn circle(&self, name: &str) -> Option<Circle> {
        self.circle_along(self.edges.get(name)?)
    }

    /// The circle of edges, if they lie on one.
    pub(super) fn circle_along(&self, edges: &[BoundaryEdge]) -> Option<Circle> {
        let corners = edges.iter().map(|&e| self.edge_nodes(e).0);
        let points: Vec<[f64; 2]> = corners.map(|n| self.nodes[n as usize]).collect();
        (points.len() >= FEWEST).then(|| circle(&points))?
    }
}

impl Circle {
    /// The circle nearest to points by least squares (Kasa 1976).
    pub fn near(points: &[[f64; 2]]) -> Option<Self> {
        let count = points.len() as f64;
        let mean = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / count);
        // |p|^2 = 2 c p + d about the mean
        let mut normal = nalgebra::Matrix3::<f64>::zeros();
        let mut right = nalgebra::Vector3::<f64>::zeros();
        for p in points {
            let (x, y) = (p[0] - mean[0], p[1] - mean[1]);
            let row = nalgebra::Vector3::new(2.0 * x, 2.0 * y, 1.0);
            normal += row * row.transpose();
            right += row * (x * x + y * y);
        }
        let found = normal.try_inverse()? * right;
        Some(Self {
            center: [mean[0] + found.x, mean[1] + found.y],
            radius: (found.z + found.x * found.x + found.y * found.y).sqrt(),
        })
    }
}

/// The circle through points that lie on one, all around it.
fn circle(points: &[[f64; 2]]) -> Option<Circle> {
    let Circle { center, radius } = Circle::near(points)?;
    let off = |p: &[f64; 2]| ((p[0] - center[0]).hypot(p[1] - center[1]) - radius).abs();
    let is_round = points.iter().all(|p| off(p) <= ROUND * radius);
    let surrounds = [0, 1].iter().all(|&k| {
        let [low, high] = range(points.iter().map(|p| p[k] - center[k]));
        low < -0.5 * radius && high > 0.5 * radius
    });
    (is_round && surrounds).then_some(Circle { center, radius })
}

/// The geometry of a part in the frame of a measurement.
#[derive(Clone)]
pub struct ImportedPlate {
    part: Arc<Part>,
    morph: Morph,
    /// The mesh as Q8, along (direction 1, direction 2) from the origin, in its declared shape.
    base: Arc<Mesh>,
    /// Radius of the hole about the origin, mm, if there is one.
    hole: Option<f64>,
    /// Distance from the origin of the nearest node on another edge, or between two stacks, mm.
    reach: f64,
    /// Whether the hole may move or grow: no two stacks meet near it, which would move with it.
    changes: bool,
}

impl fmt::Debug for ImportedPlate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [s, t] = self.base.extents;
        write!(
            f,
            "ImportedPlate {{ {:?}, {s:?}, {t:?}, {:?} }}",
            self.part, self.morph
        )
    }
}

impl ImportedPlate {
    /// A part as the data's frame has it: `vector` turns components along the data's (x, y) into those along
    /// (direction 1, direction 2), and may mirror them.
    pub fn new(part: Part, vector: &dyn Fn([f64; 2]) -> [f64; 2]) -> Self {
        let mut mesh = quads(&part.mesh, &part.stacks);
        let origin = part.origin();
        for p in &mut mesh.nodes {
            *p = vector([p[0] - origin[0], p[1] - origin[1]]);
        }
        let [a, b] = [vector([1.0, 0.0]), vector([0.0, 1.0])];
        if a[0] * b[1] < a[1] * b[0] {
            mirror(&mut mesh);
        }
        mesh.extents = [0, 1].map(|k| range(mesh.nodes.iter().map(|p| p[k])));
        mesh.boundary = Some(Arc::new(boundary(&part.spec, vector)));
        let centered = |hole: &Circle| {
            (hole.center[0] - origin[0]).hypot(hole.center[1] - origin[1]) <= ROUND * hole.radius
        };
        let hole = part.hole().filter(centered).map(|hole| hole.radius);
        let nodes = mesh.edges.values().flatten().flatten();
        let far = |n: &u32| {
            let p = mesh.nodes[*n as usize];
            p[0].hypot(p[1])
        };
        let extent = mesh.extents.iter().flatten().map(|x| x.abs());
        let joint = joint(&mesh);
        let joint = joint.iter().map(far).fold(f64::INFINITY, f64::min);
        // the hole's own nodes may stand under another name too
        let beyond = hole.map_or(0.0, |radius| (1.0 + ROUND) * radius);
        let others = nodes.map(far).filter(|r| *r > beyond);
        let reach = others.chain(extent).fold(joint, f64::min);
        let changes = hole.is_some_and(|radius| joint > BESIDE * radius);
        Self {
            part: Arc::new(part),
            morph: Morph::NONE,
            base: Arc::new(mesh),
            hole,
            reach,
            changes,
        }
    }

    /// What it was made of.
    pub fn part(&self) -> &Part {
        &self.part
    }

    /// Where a point of the declared shape lies in the changed one. Nodes between the hole and the nearest other edge share the
    /// hole's change, less with the distance.
    fn changed(&self, p: [f64; 2]) -> [f64; 2] {
        let (Some(radius), r) = (self.hole, p[0].hypot(p[1])) else {
            return p;
        };
        let share = ((self.reach - r) / (self.reach - radius)).clamp(0.0, 1.0);
        let share = share * share * (3.0 - 2.0 * share);
        let grown = 1.0 + share * (self.morph.hole_size - 1.0) * radius / r;
        // the origin stays in the hole's centre: the plate moves
        [0, 1].map(|k| grown * p[k] - (1.0 - share) * self.morph.hole_offset[k])
    }
}

/// Nodes between elements of different stacks.
fn joint(mesh: &Mesh) -> Vec<u32> {
    let mut stack_of = vec![None; mesh.nodes.len()];
    let mut joint = Vec::new();
    if mesh.region.is_empty() {
        return joint;
    }
    for (e, nodes) in mesh.elements.iter().enumerate() {
        let own = mesh.region_of(e);
        for &node in nodes {
            if *stack_of[node as usize].get_or_insert(own) != own {
                joint.push(node);
            }
        }
    }
    joint
}

/// Run through elements and edges in the other sense, after a reflection.
fn mirror(mesh: &mut Mesh) {
    for element in &mut mesh.elements {
        let [a, b, c, d, ab, bc, cd, da] = *element;
        *element = [a, d, c, b, da, cd, bc, ab];
    }
    for edges in mesh.edges.values_mut() {
        edges.reverse();
        for edge in edges {
            edge.swap(0, 2);
        }
    }
}

fn boundary(spec: &MeshSpec, vector: &dyn Fn([f64; 2]) -> [f64; 2]) -> Boundary {
    let loads = spec.loads.all().iter().map(|load| {
        let [x, y] = load.direction;
        let length = x.hypot(y);
        EdgeForce {
            edges: load.edge.all().to_vec(),
            direction: vector([x / length, y / length]),
            is_grip: load.spread == Spread::Grip,
            is_measured: load.spread == Spread::Measured,
        }
    });
    let held = spec.supports.iter().map(|held| {
        let component = |axis| f64::from(held.fixed.contains(&axis));
        let fixed = vector([component(MeshAxis::X), component(MeshAxis::Y)]);
        (held.edge.clone(), fixed.map(|x| x != 0.0))
    });
    Boundary {
        loads: loads.collect(),
        held: held.collect(),
    }
}

/// Distance of a point from the nearest of some edges, mm, negative on their right, off the plate.
fn signed_distance(mesh: &Mesh, name: &str, p: [f64; 2]) -> Option<f64> {
    let mut nearest: Option<(f64, f64)> = None;
    for edge in mesh.edge(name) {
        let [a, m, b] = edge.map(|n| mesh.nodes[n as usize]);
        for [a, b] in [[a, m], [m, b]] {
            let along = [b[0] - a[0], b[1] - a[1]];
            let from = [p[0] - a[0], p[1] - a[1]];
            let square = along[0] * along[0] + along[1] * along[1];
            let share = ((from[0] * along[0] + from[1] * along[1]) / square).clamp(0.0, 1.0);
            let off = [0, 1].map(|k| from[k] - share * along[k]);
            let distance = off[0].hypot(off[1]);
            let left = along[0] * from[1] - along[1] * from[0];
            if nearest.is_none_or(|(best, _)| distance < best) {
                nearest = Some((distance, left));
            }
        }
    }
    nearest.map(|(distance, left)| if left < 0.0 { -distance } else { distance })
}

impl Geometry for ImportedPlate {
    fn name(&self) -> &'static str {
        "imported"
    }

    fn extents(&self) -> [[f64; 2]; 2] {
        let [[s0, s1], [t0, t1]] = self.base.extents;
        let [s, t] = self.morph.hole_offset;
        [[s0 - s, s1 - s], [t0 - t, t1 - t]]
    }

    fn distance(&self, edge: &str, point: [f64; 2]) -> Option<f64> {
        match self.hole_radius() {
            Some(radius) if edge == HOLE => Some(point[0].hypot(point[1]) - radius),
            _ => signed_distance(&self.base, edge, point),
        }
    }

    fn hole_radius(&self) -> Option<f64> {
        self.hole.map(|radius| radius * self.morph.hole_size)
    }

    fn has_ends(&self) -> bool {
        // both ends straight and across direction 1
        [(LOW, 0), (HIGH, 1)].iter().all(|&(name, end)| {
            let limit = self.base.extents[0][end];
            let size = self.base.extents[0][1] - self.base.extents[0][0];
            let edges = self.base.edge(name);
            let nodes = edges.iter().flatten().map(|n| self.base.nodes[*n as usize]);
            !edges.is_empty()
                && nodes
                    .into_iter()
                    .all(|p| (p[0] - limit).abs() < ROUND * size)
        })
    }

    fn yields_to_moments(&self) -> bool {
        let boundary = self.base.boundary.as_ref();
        boundary.is_none_or(|b| b.loads.iter().any(|l| !l.is_grip))
    }

    fn introductions(&self) -> usize {
        self.base.introductions()
    }

    fn validate(&self) -> Result<()> {
        Ok(())
    }

    fn has_movable_hole(&self) -> bool {
        self.changes
    }

    fn morphed(&self, morph: &Morph) -> Result<Arc<dyn Geometry>> {
        if *morph != Morph::NONE && !self.changes {
            return Err(not_offered(self, morph));
        }
        Ok(Arc::new(Self {
            morph: *morph,
            ..self.clone()
        }))
    }

    /// How often the elements are halved.
    fn counts(&self, density: Density) -> Vec<usize> {
        vec![density.0.log2().round().max(0.0) as usize]
    }

    fn mesh(&self, counts: &[usize]) -> Mesh {
        let times = counts.first().copied().unwrap_or(0);
        let mut mesh = (0..times).fold((*self.base).clone(), |mesh, _| halved(mesh));
        if self.morph != Morph::NONE {
            for p in &mut mesh.nodes {
                *p = self.changed(*p);
            }
            mesh.extents = self.extents();
        }
        mesh
    }
}
