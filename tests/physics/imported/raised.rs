//! Linear meshes made quadratic.

use std::collections::BTreeSet;

use plychain::mesh_files::{ElementKind, raise};

use super::model::{INNER, OUTER, rectangle, ring};
use super::round_trips::parse;
use super::sizes::whole_area;
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
fn raising_keeps_edges_and_regions_and_bends_circles() {
    for kind in [ElementKind::T3, ElementKind::Q4] {
        let mesh = read(&ring(kind, [2, 12]));
        let raised = raise(mesh.clone());
        assert_eq!(
            (&raised.edges, &raised.regions),
            (&mesh.edges, &mesh.regions)
        );
        let radius = |p: [f64; 2]| p[0].hypot(p[1]);
        for (name, radius_mm) in [("u0", INNER), ("u1", OUTER)] {
            for edge in &raised.edges[name] {
                let middle = raised.edge_nodes(*edge).1.unwrap() as usize;
                assert!((radius(raised.nodes[middle]) - radius_mm).abs() < 1e-9);
            }
        }
        // twelve parabolas through three points of a circle each miss 1.6e-4 of it, twelve chords 4.5 %
        let circles = std::f64::consts::PI * (OUTER * OUTER - INNER * INNER);
        let missed = |area: f64| (area / circles - 1.0).abs();
        assert!(missed(whole_area(&mesh)) > 0.04 && missed(whole_area(&raised)) < 2e-4);
        let on_a_circle = raised.nodes.iter().filter(|p| {
            let r = radius(**p);
            (r - INNER).abs() < 1e-9 || (r - OUTER).abs() < 1e-9
        });
        assert_eq!(on_a_circle.count(), 48, "sides within stay straight");
    }
}

/// Eight sides may be meant.
#[test]
fn an_octagon_stays_one() {
    let mesh = read(&ring(ElementKind::Q4, [2, 8]));
    assert!((whole_area(&raise(mesh.clone())) - whole_area(&mesh)).abs() < 1e-9);
}

#[test]
fn raising_leaves_a_quadratic_mesh_as_it_is() {
    let mesh = read(&ring(ElementKind::T6, [2, 12]));
    let raised = raise(mesh.clone());
    assert_eq!((raised.nodes, raised.elements), (mesh.nodes, mesh.elements));
}
