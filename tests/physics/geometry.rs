//! Every geometry of the registry: the mesh covers its area, its named edges lie where they should, distances.

use std::sync::Arc;

use plychain::effect::{self, EFFECTS};
use plychain::experiment::simulate::Truth;
use plychain::fem::element::{GAUSS, physical_gradient};
use plychain::fem::{Locator, Plate, Setup, end_forces};
use plychain::field::matrices::write_matrices;
use plychain::geometry::{Density, GEOMETRIES, Geometry, HIGH, HOLE, LOW, Morph, SIDES, declared};
use plychain::identify::{Options, identify};
use plychain::infer::{Model, simulated_field};
use plychain::laminate::{LoadSpec, Ply, SpecimenSpec};
use plychain::progress::Silent;
use plychain::sample::{SAMPLERS, Schedule};

use crate::loops::options;
use crate::reduce::{scene, small_test};

const HOLE_RADIUS: f64 = 3.0;

/// Strips of 90 x 20 mm: with or without a hole off the centre, free or clamped in fillets.
fn specimens() -> Vec<SpecimenSpec> {
    let hole = serde_json::json!({ "diameter_mm": 2.0 * HOLE_RADIUS, "center_mm": [4.0, -2.0] });
    let clamp =
        |end: &str| serde_json::json!({ "end": end, "width_mm": 30.0, "fillet_radius_mm": 8.0 });
    let mut all = Vec::new();
    for hole in [None, Some(hole)] {
        for clamp in [None, Some(clamp("low")), Some(clamp("high"))] {
            let specimen = serde_json::json!({
                "length_mm": 90.0, "width_mm": 20.0, "hole": hole, "clamp": clamp,
                "layup_deg": [0.0], "thickness_mm": { "mean": 1.0, "sd": 0.0 },
            });
            all.push(serde_json::from_value(specimen).unwrap());
        }
    }
    all
}

fn setup(specimen: &SpecimenSpec) -> Setup {
    Setup::nominal(specimen, &LoadSpec { force_n: 1000.0 }, 1.0)
}

/// Area of a strip: the rectangle, two fillets' corners (a rectangle less a segment of a circle) and the hole.
fn area(specimen: &SpecimenSpec) -> f64 {
    let hole = specimen
        .hole
        .map_or(0.0, |_| std::f64::consts::PI * HOLE_RADIUS.powi(2));
    let fillets = specimen.clamp.map_or(0.0, |clamp| {
        let r = clamp.fillet_radius_mm.unwrap();
        let drop: f64 = r - 0.5 * (clamp.width_mm.unwrap() - specimen.width_mm);
        let length = (r * r - drop * drop).sqrt();
        let under_arc = 0.5 * (length * drop + r * r * (length / r).asin());
        2.0 * (r * length - under_arc)
    });
    specimen.length_mm * specimen.width_mm + fillets - hole
}

fn mesh_area(mesh: &plychain::geometry::Mesh) -> f64 {
    let mut sum = 0.0;
    for e in 0..mesh.elements.len() {
        let x = mesh.corners(e);
        for (a, wa) in GAUSS {
            for (b, wb) in GAUSS {
                let det = physical_gradient(&x, a, b).1;
                assert!(det > 0.0, "element {e}");
                sum += wa * wb * det;
            }
        }
    }
    sum
}

#[test]
fn every_geometry_of_the_registry_is_declared_by_some_specimen() {
    for (k, build) in GEOMETRIES.iter().enumerate() {
        let takes = |s: &&SpecimenSpec| build(s).is_some_and(|g| *g == *declared(s));
        let specimens = specimens();
        let first = specimens.iter().find(takes);
        let geometry = first.map(declared).unwrap_or_else(|| panic!("number {k}"));
        assert!(!geometry.name().is_empty());
        geometry.validate().unwrap();
    }
}

#[test]
fn meshes_cover_the_specimen_and_elements_are_not_inverted() {
    for specimen in specimens() {
        let geometry = declared(&specimen);
        let of = |density: Density| mesh_area(&geometry.mesh(&geometry.counts(density)));
        let error = |density: Density| (of(density) / area(&specimen) - 1.0).abs();
        // Arcs are parabolas between three nodes; a fillet is a steep one and begins anywhere in an element.
        let errors = [Density(0.5), Density(2.0)].map(error);
        let most = if specimen.clamp.is_some() { 1e-3 } else { 1e-6 };
        assert!(
            errors[1] < most && errors[1] <= errors[0].max(1e-11),
            "{geometry:?} {errors:?}"
        );
    }
}

/// Edges end where the next ones begin, lie on one side only, leave the material on their left, and make the boundary.
#[test]
fn named_edges_are_the_boundary_in_order() {
    for specimen in specimens() {
        let geometry = declared(&specimen);
        let mesh = geometry.mesh(&geometry.counts(Density(0.5)));
        let mut sides = std::collections::BTreeMap::new();
        for e in &mesh.elements {
            for k in 0..4 {
                let (a, m, b) = (e[k], e[k + 4], e[(k + 1) % 4]);
                *sides.entry(m).or_insert((0, [0; 3])) = match sides.get(&m) {
                    None => (1, [a, m, b]),
                    Some((count, edge)) => (count + 1, *edge),
                };
            }
        }
        let mut boundary: Vec<[u32; 3]> = sides
            .values()
            .filter(|(count, _)| *count == 1)
            .map(|(_, edge)| *edge)
            .collect();
        // the element's own order, counter-clockwise, leaves the material on the left
        let mut named: Vec<[u32; 3]> = mesh.edges.values().flatten().copied().collect();
        boundary.sort_unstable();
        named.sort_unstable();
        assert_eq!(named, boundary, "{geometry:?}");
        for (name, edges) in &mesh.edges {
            let breaks = edges.windows(2).filter(|w| w[0][2] != w[1][0]).count();
            assert_eq!(breaks, usize::from(name == SIDES), "{name}");
            for node in edges.iter().flatten() {
                let distance = geometry.distance(name, mesh.nodes[*node as usize]).unwrap();
                assert!(distance.abs() < 1e-9, "{name}: {distance}");
            }
        }
        let expected = if specimen.hole.is_some() { 4 } else { 3 };
        assert_eq!(mesh.edges.len(), expected);
        assert!(mesh.edge("no such edge").is_empty());
        assert!(geometry.distance("no such edge", [0.0; 2]).is_none());
    }
}

#[test]
fn distances_are_those_of_the_nearest_nodes_of_the_edge() {
    for specimen in specimens() {
        let geometry = declared(&specimen);
        let mesh = geometry.mesh(&geometry.counts(Density::DEFAULT));
        for (name, edges) in &mesh.edges {
            let place = |&n: &u32| mesh.nodes[n as usize];
            let nodes: Vec<[f64; 2]> = edges.iter().flatten().map(place).collect();
            let between = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
            let steps = edges.iter().map(|e| between(place(&e[0]), place(&e[2])));
            let step = 0.51 * steps.fold(0.0, f64::max);
            for (k, p) in mesh.nodes.iter().enumerate().step_by(397) {
                let reach = |q: &[f64; 2]| between(*p, *q);
                let nearest = nodes.iter().map(reach).fold(f64::INFINITY, f64::min);
                let found = geometry.distance(name, *p).unwrap();
                assert!(found > -1e-9, "{name}, node {k}");
                // the nearest point of the edge is at most half a step of nodes from one of them
                let farthest = found.hypot(0.5 * step) + 0.1 * step;
                assert!(
                    found < nearest + 1e-9 && nearest < farthest,
                    "{name} of {geometry:?}, {p:?}: {found} {nearest}"
                );
            }
        }
    }
}

/// Uniform traction on both ends of a plate without a hole: the strain is uniform, and the laminate's.
#[test]
fn uniform_traction_gives_uniform_strain_where_nothing_disturbs_it() {
    let ply = Ply::isotropic(200e3, 0.3);
    for specimen in specimens() {
        let setup = setup(&specimen);
        if specimen.clamp.is_some() {
            continue;
        }
        let plate = Plate::new(&setup, Density(0.2)).unwrap();
        let solution = plate.solve(&setup, &ply).unwrap();
        let force = end_forces(&solution.mesh, &setup.load);
        let total: f64 = force.iter().step_by(2).sum();
        assert!(
            total.abs() < 1e-9 * 1000.0,
            "the ends pull against each other"
        );
        if specimen.hole.is_some() {
            continue;
        }
        let (observer, inside) = Locator::new(&plate.mesh).observe(&plate.mesh.nodes);
        assert!(inside.iter().all(|x| *x));
        let strain = 1000.0 / (20.0 * 1.0 * 200e3);
        for g in observer.gradient(&solution.nodal) {
            for (found, exact) in g.iter().flatten().zip([1.0, 0.0, 0.0, -0.3]) {
                assert!((found / strain - exact).abs() < 1e-9, "{g:?}");
            }
        }
    }
}

#[test]
fn a_morph_keeps_the_connectivity_or_is_refused() {
    let larger = Morph {
        hole_size: 1.04,
        ..Morph::NONE
    };
    let moved = Morph {
        hole_offset: [0.3, -0.2],
        ..Morph::NONE
    };
    for specimen in specimens() {
        let geometry = declared(&specimen);
        let counts = geometry.counts(Density(0.5));
        let mesh = geometry.mesh(&counts);
        for morph in [larger, moved] {
            let morphed = geometry.morphed(&morph);
            assert_eq!(morphed.is_ok(), geometry.has_movable_hole(), "{morph:?}");
            let Ok(morphed) = morphed else { continue };
            let other = morphed.mesh(&counts);
            assert_eq!(
                (&other.elements, &other.edges),
                (&mesh.elements, &mesh.edges)
            );
            assert_ne!(other.nodes, mesh.nodes);
            let on_edge = |p: &&[f64; 2]| (morphed.hole_radii(**p).unwrap() - 1.0).abs() < 1e-9;
            let count = other.nodes.iter().filter(on_edge).count();
            assert_eq!(count, 2 * mesh.edge(HOLE).len());
        }
    }
}

#[test]
fn effects_on_a_hole_need_one() {
    let scene = scene(&small_test());
    assert!(
        EFFECTS
            .iter()
            .all(|e| !e.name().starts_with("hole") || e.why_not(&scene).is_none())
    );
    let mut plain = scene.clone();
    plain.setup = setup(&specimens()[0]);
    for name in ["hole_size", "hole_offset", "hole_edge_damage"] {
        let effect = effect::find("test", name).unwrap();
        assert!(
            effect.why_not(&plain).unwrap().contains("no hole"),
            "{name}"
        );
    }
    // altered all the same, the test is an error and no other test
    let mut altered = plain.setup.clone();
    effect::find("test", "hole_size")
        .unwrap()
        .alter(&[2.0], &mut altered);
    let plate = Plate::new(&plain.setup, Density(0.2)).unwrap();
    assert!(plate.solve(&altered, &Ply::isotropic(200e3, 0.3)).is_err());
    assert!(plate.solve(&scene.setup, &scene.ply).is_err());
}

#[test]
fn a_support_needs_its_edge() {
    let geometry: Arc<dyn Geometry> = declared(&specimens()[0]);
    for name in [LOW, HIGH, SIDES] {
        assert!(Plate::meshed(geometry.clone(), Some(name), Density(0.2)).is_ok());
    }
    assert!(Plate::meshed(geometry, Some(HOLE), Density(0.2)).is_err());
}

/// A square plate without a hole, from its declaration to its constants: in a uniform strain E follows from the strain along
/// the load, nu from that across.
#[test]
fn a_square_plate_without_a_hole_identifies_its_material() {
    let directory = tempfile::tempdir().unwrap();
    let prior = |mean: f64, sd: f64| serde_json::json!({ "prior": { "normal": { "mean": mean, "sd": sd } } });
    let json = serde_json::json!({
        "schema": "plychain-model/2", "name": "square",
        "material": { "kind": "isotropic", "parameters": { "E_GPa": prior(200.0, 20.0), "nu": prior(0.28, 0.05) } },
        "experiments": [{
            "name": "tension", "kind": "field",
            "specimen": { "length_mm": 30.0, "width_mm": 30.0, "thickness_mm": { "mean": 2.0, "sd": 0.0 } },
            "load": { "force_N": 6000.0 }, "gauge": "window", "mesh_density": 0.2,
            "measurement": { "format": "matrices", "dir": "measured", "loading_axis": "x" },
            "effects": [],
        }],
        "reduced_model": { "snapshots": 30, "modes": 1, "degree": 3 },
        "likelihood": { "model_error_fraction": 0.0 },
    });
    let model = Model::parse(&json.to_string(), &directory.path().join("square.json")).unwrap();
    let truth = Truth {
        constants: vec![190.0, 0.31],
        thickness_mm: 2.0,
        effects: Vec::new(),
        noise_nm: 20.0,
        correlation_mm: 0.0,
        grid: 41,
        seed: 3,
    };
    write_matrices(
        &directory.path().join("measured"),
        &simulated_field(&model, &truth).unwrap(),
        None,
    )
    .unwrap();
    let sampler = (SAMPLERS[0].build)();
    let options = Options {
        schedule: Schedule {
            seed: 1,
            max_draws: 4000,
            ..Schedule::default()
        },
        ..options(&*sampler)
    };
    let found = identify(&model, &options, &Silent).unwrap();
    // half a percent of the load is half a percent of E
    for (name, truth, most) in [("E_GPa", 190.0, 1.1), ("nu", 0.31, 0.003)] {
        let (mean, sd) = found.moments(name).unwrap();
        assert!(
            (mean - truth).abs() < 4.0 * sd && sd < most,
            "{name}: {mean} +- {sd}"
        );
    }
}
