//! Every kind of element through every format.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::path::Path;

use plychain::error::Result;
use plychain::mesh_files::{BoundaryEdge, ElementKind, ImportedMesh, abaqus, gmsh};

use super::model::{INNER, KINDS, Model, OUTER, rectangle, ring};
use super::sizes::{edge_length, whole_area};
use super::writers::WRITERS;

/// Read bytes by the name of their format.
pub fn parse(name: &str, bytes: &[u8]) -> Result<ImportedMesh> {
    match name.ends_with("inp") {
        true => abaqus::parse(bytes, Path::new(name)),
        false => gmsh::parse(bytes, Path::new(name)),
    }
}

fn all(model: &Model) -> Vec<(&'static str, ImportedMesh)> {
    let read = |(name, write): (&'static str, fn(&Model) -> Vec<u8>)| {
        let mesh = parse(name, &write(model)).unwrap_or_else(|e| panic!("{name}: {e}"));
        (name, mesh)
    };
    WRITERS.into_iter().map(read).collect()
}

fn length(mesh: &ImportedMesh, name: &str) -> f64 {
    edge_length(mesh, name).unwrap()
}

/// Places of the nodes of a boundary edge.
fn places(mesh: &ImportedMesh, edge: BoundaryEdge) -> [[f64; 2]; 2] {
    let (a, _, b) = mesh.edge_nodes(edge);
    [a, b].map(|n| mesh.nodes[n as usize])
}

/// Whether every edge begins where the one before ends; closed chains end at their beginning.
fn is_chain(mesh: &ImportedMesh, name: &str, closed: bool) -> bool {
    let edges: Vec<[[f64; 2]; 2]> = mesh.edges[name].iter().map(|e| places(mesh, *e)).collect();
    let follows = edges.windows(2).all(|w| w[0][1] == w[1][0]);
    follows && (edges[0][0] == edges[edges.len() - 1][1]) == closed
}

#[test]
fn a_rectangle_keeps_nodes_elements_edges_and_regions() {
    for kind in KINDS {
        let model = rectangle(kind, [4, 3]);
        for (name, mesh) in all(&model) {
            assert_eq!(mesh.nodes.len(), model.nodes.len(), "{name} {kind:?}");
            assert_eq!(mesh.elements.len(), model.cells.len());
            assert!(mesh.elements.iter().all(|e| e.kind == kind));
            assert!(
                (whole_area(&mesh) - 300.0).abs() < 1e-9,
                "{name} {kind:?}: {}",
                whole_area(&mesh)
            );
            let names: Vec<&String> = mesh.edges.keys().collect();
            assert_eq!(names, ["u0", "u1", "v0", "v1"], "{name}");
            for (edge, expected) in [("u0", 10.0), ("u1", 10.0), ("v0", 30.0), ("v1", 30.0)] {
                assert!(
                    (length(&mesh, edge) - expected).abs() < 1e-9,
                    "{name} {edge}"
                );
                assert!(is_chain(&mesh, edge, false), "{name} {kind:?} {edge}");
            }
            let regions: Vec<&String> = mesh.regions.keys().collect();
            assert_eq!(regions, ["all", "half"], "{name}");
            let area = |region: &str| -> f64 {
                mesh.regions[region].iter().map(|e| mesh.area_of(*e)).sum()
            };
            assert!((area("all") - 300.0).abs() < 1e-9 && (area("half") - 150.0).abs() < 1e-9);
            assert_eq!(mesh.warnings(), Vec::<String>::new(), "{name}");
            assert_eq!(mesh.files, [Path::new(name)]);
        }
    }
}

#[test]
fn all_formats_give_the_same_mesh() {
    for kind in KINDS {
        let model = ring(kind, [2, 9]);
        let meshes = all(&model);
        let (_, first) = &meshes[0];
        for (name, mesh) in &meshes {
            let corners = |mesh: &ImportedMesh| -> BTreeSet<Vec<[u64; 2]>> {
                let nodes = |e: &plychain::mesh_files::Element| {
                    let at = |n: &u32| mesh.nodes[*n as usize].map(f64::to_bits);
                    e.nodes().iter().map(at).collect()
                };
                mesh.elements.iter().map(nodes).collect()
            };
            assert_eq!(corners(mesh), corners(first), "{name}");
            let edges = |mesh: &ImportedMesh, name: &str| -> BTreeSet<[[u64; 2]; 2]> {
                let ends = |e: &BoundaryEdge| places(mesh, *e).map(|p| p.map(f64::to_bits));
                mesh.edges[name].iter().map(ends).collect()
            };
            for edge in ["u0", "u1"] {
                assert_eq!(edges(mesh, edge), edges(first, edge), "{name}");
            }
        }
    }
}

#[test]
fn the_boundary_has_the_material_on_its_left() {
    for kind in KINDS {
        for (name, mesh) in all(&ring(kind, [2, 12])) {
            assert!(
                is_chain(&mesh, "u0", true) && is_chain(&mesh, "u1", true),
                "{name}"
            );
            let turn = |edge: &str| -> f64 {
                let twice = |e: &BoundaryEdge| {
                    let [a, b] = places(&mesh, *e);
                    a[0] * b[1] - a[1] * b[0]
                };
                mesh.edges[edge].iter().map(twice).sum()
            };
            assert!(turn("u0") < 0.0, "clockwise about the hole");
            assert!(turn("u1") > 0.0, "counter-clockwise about the plate");
        }
    }
}

/// Errors of area and of the hole's length for n elements around.
fn errors(kind: ElementKind, around: usize) -> [f64; 2] {
    let (_, mesh) = all(&ring(kind, [around / 6, around])).swap_remove(2);
    let area = PI * (OUTER * OUTER - INNER * INNER);
    [
        (whole_area(&mesh) - area).abs(),
        (length(&mesh, "u0") - 2.0 * PI * INNER).abs(),
    ]
}

#[test]
fn area_and_length_of_a_ring_converge_with_the_square_and_the_fourth_power_of_the_element_size() {
    for kind in KINDS {
        let expected = if kind.is_quadratic() { 4.0 } else { 2.0 };
        let (coarse, fine) = (errors(kind, 12), errors(kind, 24));
        for k in 0..2 {
            let rate = (coarse[k] / fine[k]).log2();
            assert!((rate - expected).abs() < 0.2, "{kind:?}: {rate}");
        }
    }
}

#[test]
fn clockwise_elements_are_turned_with_their_midside_nodes_and_edges() {
    for kind in KINDS {
        for (name, mesh) in all(&ring(kind, [2, 24]).mirrored()) {
            let (_, plain) = all(&ring(kind, [2, 24])).swap_remove(0);
            assert!(
                (whole_area(&mesh) - whole_area(&plain)).abs() < 1e-9,
                "{name} {kind:?}"
            );
            assert!((length(&mesh, "u0") - length(&plain, "u0")).abs() < 1e-9);
            assert!(is_chain(&mesh, "u0", true));
        }
    }
}

#[test]
fn triangles_and_quadrilaterals_of_one_order_go_together() {
    for [a, b] in [
        [ElementKind::Q4, ElementKind::T3],
        [ElementKind::Q8, ElementKind::T6],
    ] {
        let mut model = rectangle(a, [4, 3]);
        let (_, nodes) = model.cells[0].clone();
        // a corner of the element is cut off by a third of its nodes: split along a diagonal, with a new midside node
        let split = if b == ElementKind::T3 {
            [
                vec![nodes[0], nodes[1], nodes[2]],
                vec![nodes[0], nodes[2], nodes[3]],
            ]
        } else {
            let [p, q] = [model.nodes[nodes[0]], model.nodes[nodes[2]]];
            model.nodes.push([0, 1, 2].map(|k| 0.5 * (p[k] + q[k])));
            let m = model.nodes.len() - 1;
            [
                vec![nodes[0], nodes[1], nodes[2], nodes[4], nodes[5], m],
                vec![nodes[0], nodes[2], nodes[3], m, nodes[6], nodes[7]],
            ]
        };
        let [first, second] = split;
        model.cells[0] = (b, first);
        model.cells.push((b, second));
        for (name, mesh) in all(&model) {
            assert!((whole_area(&mesh) - 300.0).abs() < 1e-9, "{name}");
            let kinds: BTreeSet<ElementKind> = mesh.elements.iter().map(|e| e.kind).collect();
            assert_eq!(kinds.len(), 2);
        }
    }
}

#[test]
fn a_mesh_may_lie_at_any_constant_z_and_nodes_of_no_element_are_dropped() {
    let mut model = rectangle(ElementKind::Q8, [2, 2]);
    model.nodes.iter_mut().for_each(|p| p[2] = 7.5);
    let used = model.nodes.len();
    model.nodes.push([500.0, 500.0, 80.0]);
    for (name, mesh) in all(&model) {
        assert_eq!(mesh.nodes.len(), used, "{name}");
        assert_eq!(mesh.bounds(), [[-10.0, 5.0], [20.0, 15.0]]);
    }
}

#[test]
fn a_mesh_in_metres_is_warned_of() {
    let mut model = rectangle(ElementKind::T6, [2, 2]);
    model.nodes.iter_mut().flatten().for_each(|x| *x *= 1e-3);
    for (name, mesh) in all(&model) {
        let warnings = mesh.warnings();
        assert!(
            warnings[0].contains("metres") && warnings[0].contains("1000"),
            "{name}"
        );
    }
}
