//! Areas and lengths of imported meshes, by which tests know that what was read is what was written.

use plychain::mesh_files::{BoundaryEdge, ImportedMesh};

/// Area of all elements, mm^2; curved sides are parabolas through their three nodes.
pub fn whole_area(mesh: &ImportedMesh) -> f64 {
    (0..mesh.elements.len()).map(|e| mesh.area_of(e)).sum()
}

/// Length of a named edge, mm, by the 3-point Gauss rule; `None` if there is no such edge.
pub fn edge_length(mesh: &ImportedMesh, name: &str) -> Option<f64> {
    let length = |edge: &BoundaryEdge| {
        let (a, m, b) = mesh.edge_nodes(*edge);
        let at = |n: u32| mesh.nodes[n as usize];
        let (a, b) = (at(a), at(b));
        let middle = m.map_or([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])], at);
        line_length(a, middle, b)
    };
    Some(mesh.edges.get(name)?.iter().map(length).sum())
}

/// Length of the parabola from `a` through `m` (at the middle of its parameter) to `b`.
fn line_length(a: [f64; 2], m: [f64; 2], b: [f64; 2]) -> f64 {
    let gauss = 0.774_596_669_241_483_4;
    let speed = |xi: f64| {
        let along = |k: usize| (xi - 0.5) * a[k] - 2.0 * xi * m[k] + (xi + 0.5) * b[k];
        along(0).hypot(along(1))
    };
    (5.0 * speed(-gauss) + 8.0 * speed(0.0) + 5.0 * speed(gauss)) / 9.0
}
