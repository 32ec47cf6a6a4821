//! What holds a plate: named edges, rigid grips, and the fewest nodes that fix a rigid motion without stress.

use nalgebra::{DMatrix, Vector3};

use super::load::{EndLoad, end_forces};
use crate::error::{Error, Result};
use crate::geometry::{Boundary, HIGH, LOW, Mesh};

/// Unknowns at zero, and nodes that move as others do.
#[derive(Debug, Clone, Default)]
pub struct Supports {
    /// Unknowns held at zero.
    pub pinned: Vec<usize>,
    /// For each node the one whose unknowns are its own; empty where each has its own.
    pub leader: Vec<u32>,
}

/// A load leaves this share of itself at most to supports that were not declared.
const BALANCED: f64 = 1e-6;

impl Supports {
    /// Those of a mesh: its own, or else those of a strip, whose edge `held` is held still, if there is one.
    ///
    /// # Errors
    /// Of the input: loads that nothing declared holds. Of the program: an edge that is not there.
    pub fn of(mesh: &Mesh, held: Option<&str>) -> Result<Self> {
        let Some(boundary) = &mesh.boundary else {
            return Ok(Self {
                pinned: pinned(mesh, held)?,
                ..Self::default()
            });
        };
        let leader = leaders(mesh, boundary);
        let mut pinned = Vec::new();
        for (name, fixed) in &boundary.held {
            for node in nodes_of(mesh, name) {
                let node = leader.get(node as usize).copied().unwrap_or(node);
                pinned.extend((0..2).filter(|k| fixed[*k]).map(|k| 2 * node as usize + k));
            }
        }
        for load in boundary.loads.iter().filter(|l| l.is_grip) {
            let nodes = load.edges.iter().flat_map(|name| nodes_of(mesh, name));
            if let Some(node) = nodes.map(|n| leader[n as usize]).min() {
                let across = usize::from(load.direction[0] != 0.0);
                pinned.push(2 * node as usize + across);
            }
        }
        pinned.sort_unstable();
        pinned.dedup();
        let mut supports = Self { pinned, leader };
        supports.complete(mesh)?;
        Ok(supports)
    }

    /// The node that a node's unknowns are those of.
    pub fn leader(&self, node: u32) -> u32 {
        self.leader.get(node as usize).copied().unwrap_or(node)
    }

    /// Pin further unknowns until no rigid motion is left; under the axial load they carry nothing.
    fn complete(&mut self, mesh: &Mesh) -> Result<()> {
        let size = mesh
            .extents
            .iter()
            .map(|[low, high]| high - low)
            .fold(1.0, f64::max);
        let middle = mesh.extents.map(|[low, high]| 0.5 * (low + high));
        // what a unit of each rigid motion does to an unknown
        let motion = |unknown: usize| {
            let p = mesh.nodes[unknown / 2];
            match unknown % 2 {
                0 => Vector3::new(1.0, 0.0, -(p[1] - middle[1]) / size),
                _ => Vector3::new(0.0, 1.0, (p[0] - middle[0]) / size),
            }
        };
        let load = end_forces(
            mesh,
            &EndLoad {
                axial: 1.0,
                ..EndLoad::default()
            },
        );
        let mut work = Vector3::zeros();
        for (unknown, force) in load.iter().enumerate() {
            work += motion(unknown) * *force;
        }
        if !self.leader.is_empty() {
            // a grip does not turn
            work.z = 0.0;
        }
        for _ in 0..3 {
            let rows: Vec<Vector3<f64>> = self.pinned.iter().map(|u| motion(*u)).collect();
            let grams: DMatrix<f64> =
                DMatrix::from_fn(3, 3, |i, j| rows.iter().map(|r| r[i] * r[j]).sum());
            let eigen = grams.symmetric_eigen();
            let scale = eigen.eigenvalues.max().max(1e-30);
            let free = (0..3).find(|k| eigen.eigenvalues[*k] <= 1e-9 * scale);
            let Some(free) = free else { return Ok(()) };
            let free = eigen.eigenvectors.column(free);
            let free = Vector3::new(free[0], free[1], free[2]);
            if work.dot(&free).abs() > BALANCED {
                return Err(unheld(work, free));
            }
            let own = |node: &usize| self.leader(*node as u32) as usize == *node;
            let nodes = (0..mesh.nodes.len()).filter(own);
            let all = nodes.flat_map(|n| [2 * n, 2 * n + 1]);
            let freest = all.map(|u| (motion(u).dot(&free).abs(), u));
            let best = freest.fold((0.0, 0), |best, x| if x.0 > best.0 { x } else { best });
            self.pinned.push(best.1);
        }
        Ok(())
    }
}

fn unheld(work: Vector3<f64>, free: Vector3<f64>) -> Error {
    const HOLD: &str = "hold an edge (\"supports\": [{\"edge\": \"low\"}]), or let a second load pull the other way";
    let (what, hint) = match free.iamax() {
        0 => ("along direction 1", HOLD),
        1 => ("along direction 2", HOLD),
        _ => (
            "about its middle",
            "two shear forces are a couple, which the jaws of a shear rig carry and a part cut out of the specimen does not: mesh the specimen into the jaws, and hold one (\"supports\": [{\"edge\": \"left\"}])",
        ),
    };
    Error::input(
        "mesh.supports",
        "supports for what the loads do not balance",
    )
    .found(format!(
        "loads that move the specimen {what} ({:.3} of the force)",
        work.dot(&free).abs()
    ))
    .hint(hint)
}

/// Nodes of a named edge, each once, increasing.
fn nodes_of(mesh: &Mesh, name: &str) -> Vec<u32> {
    let mut nodes: Vec<u32> = mesh.edge(name).iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

/// The first node of each grip leads the others.
fn leaders(mesh: &Mesh, boundary: &Boundary) -> Vec<u32> {
    if !boundary.loads.iter().any(|l| l.is_grip) {
        return Vec::new();
    }
    let mut leader: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    for load in boundary.loads.iter().filter(|l| l.is_grip) {
        let nodes: Vec<u32> = load
            .edges
            .iter()
            .flat_map(|name| nodes_of(mesh, name))
            .collect();
        if let Some(&first) = nodes.iter().min() {
            for node in nodes {
                leader[node as usize] = first;
            }
        }
    }
    leader
}

/// Of a strip: the unknowns of the held edge, or else three that fix the rigid motion without stress: both components at the middle of
/// the low end and the transverse one at the middle of the high end.
fn pinned(mesh: &Mesh, held: Option<&str>) -> Result<Vec<usize>> {
    let edge = |name: &str| match mesh.edge(name) {
        [] => Err(Error::program("supports", "an edge of the mesh").found(name)),
        edges => Ok(edges),
    };
    if let Some(name) = held {
        edge(name)?;
        let unknowns = nodes_of(mesh, name).into_iter().map(|n| 2 * n as usize);
        return Ok(unknowns.flat_map(|k| [k, k + 1]).collect());
    }
    let middle = |name: &str| edge(name).map(|edges| edges[edges.len() / 2][0] as usize);
    let (low, high) = (middle(LOW)?, middle(HIGH)?);
    Ok(vec![2 * low, 2 * low + 1, 2 * high + 1])
}
