//! Linear meshes made quadratic.

use std::collections::BTreeSet;

use plychain::mesh_files::{ElementKind, raise};

use super::model::{rectangle, ring};
use super::round_trips::parse;
use super::writers::msh41;

fn read(model: &super::model::Model) -> plychain::mesh_files::ImportedMesh {
    parse("plate.msh", &msh41(model, false)).unwrap()
}

#[test]
fn a_raised_rectangle_is_the_quadratic_rectangle() {
    for (linear, quadratic) in [
        (ElementKind::T3, ElementKind::T6),
        (ElementKind::Q4, ElementKind::Q8),
    ] {
        let raised = raise(read(&rectangle(linear, [5, 3])));
        let other = read(&rectangle(quadratic, [5, 3]));
        assert!(raised.elements.iter().all(|e| e.kind == quadratic));
        let places = |mesh: &plychain::mesh_files::ImportedMesh| -> BTreeSet<[i64; 2]> {
            mesh.nodes
                .iter()
                .map(|p| p.map(|x| (x * 1e6).round() as i64))
                .collect()
        };
        assert_eq!(places(&raised), places(&other));
        assert_eq!(
            raised.nodes.len(),
            other.nodes.len(),
            "midside nodes are shared"
        );
    }
}

#[test]
fn raising_keeps_area_edges_and_regions() {
    for kind in [ElementKind::T3, ElementKind::Q4] {
        let mesh = read(&ring(kind, [2, 12]));
        let raised = raise(mesh.clone());
        assert!((raised.area() - mesh.area()).abs() < 1e-9);
        assert_eq!(
            (&raised.edges, &raised.regions),
            (&mesh.edges, &mesh.regions)
        );
        for name in mesh.edges.keys() {
            let lengths = [&mesh, &raised].map(|m| m.edge_length(name).unwrap());
            assert!((lengths[0] - lengths[1]).abs() < 1e-9);
        }
        for edge in &raised.edges["u0"] {
            let (a, middle, b) = raised.edge_nodes(*edge);
            let [a, m, b] = [a, middle.unwrap(), b].map(|n| raised.nodes[n as usize]);
            assert!((0..2).all(|k| (0.5 * (a[k] + b[k]) - m[k]).abs() < 1e-12));
        }
    }
}

#[test]
fn raising_leaves_a_quadratic_mesh_as_it_is() {
    let mesh = read(&ring(ElementKind::T6, [2, 12]));
    let raised = raise(mesh.clone());
    assert_eq!((raised.nodes, raised.elements), (mesh.nodes, mesh.elements));
}
