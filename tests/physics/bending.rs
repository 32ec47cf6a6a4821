//! Plate bending: patch test, closed forms, rates without locking, holes against independent solutions; the effect that shows it.

mod effect;
mod exact;

use std::sync::Arc;

use nalgebra::{Matrix2, Matrix3, Vector3};
use plychain::fem::{
    BendingPattern, EndMoment, Locator, bend, edge_forces, plain_deflection, plain_rotation,
};
use plychain::geometry::{
    Density, Geometry, HIGH, HOLE, LOW, Mesh, Outline, PlainStrip, SIDES, StripWithHole,
};
use plychain::laminate::{PlateStiffness, Ply};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Dxsm;

use exact::{Biharmonic, IsotropicHole, LaminateHole, Quadratic, State, Thing};

const PLY: Ply = Ply {
    e1: 140e3,
    e2: 7.9e3,
    nu12: 0.33,
    g12: 5e3,
};

/// A stack with strong D16 and D26.
fn skew(thickness: f64) -> PlateStiffness {
    let angles = [30.0_f64, 10.0, 10.0, 30.0].map(f64::to_radians);
    PlateStiffness::of(&PLY, &angles, thickness)
}

fn isotropic(thickness: f64) -> PlateStiffness {
    PlateStiffness::of(&Ply::isotropic(70e3, 0.3), &[0.0], thickness)
}

fn rectangle([s, t]: [f64; 2], counts: [usize; 2]) -> Mesh {
    let outline = Outline {
        s: [-s, s],
        t: [-t, t],
        clamp: None,
    };
    PlainStrip { outline }.mesh(&counts)
}

fn holed([s, t]: [f64; 2], radius: f64, density: f64) -> Mesh {
    let geometry: Arc<dyn Geometry> = Arc::new(StripWithHole {
        outline: Outline {
            s: [-s, s],
            t: [-t, t],
            clamp: None,
        },
        radius,
    });
    geometry.mesh(&geometry.counts(Density(density)))
}

/// Move all inner nodes, corners and midsides, by up to a share of an element of side `side`: edges bend.
fn distorted(mut mesh: Mesh, share: f64, side: f64) -> Mesh {
    let mut rng = Pcg64Dxsm::seed_from_u64(5);
    let mut inner = vec![true; mesh.nodes.len()];
    for node in mesh.edges.values().flatten().flatten() {
        inner[*node as usize] = false;
    }
    for (node, inner) in mesh.nodes.iter_mut().zip(inner) {
        for x in node {
            let by: f64 = rng.random_range(-1.0..1.0);
            *x += if inner { share * side * by } else { 0.0 };
        }
    }
    mesh
}

/// Nodal solution of a plate under an exact state's moments and shear forces along its outer edges, less the rigid motion that takes
/// it farthest from that state: deflections, and rotations.
fn solved(mesh: &Mesh, plate: &PlateStiffness, exact: &dyn Thing) -> (Vec<f64>, Vec<[f64; 2]>) {
    let names: Vec<&str> = [LOW, HIGH, SIDES]
        .into_iter()
        .filter(|name| !mesh.edge(name).is_empty())
        .collect();
    let moments = edge_forces(mesh, &names, &|p, n| {
        let m = plate.bending * exact.at(p).curvature;
        [m[0] * n[0] + m[2] * n[1], m[2] * n[0] + m[1] * n[1]]
    });
    let shear = edge_forces(mesh, &names, &|p, n| {
        let q = exact.at(p).shear;
        [q[0] * n[0] + q[1] * n[1], 0.0]
    });
    let loads = moments.chunks(2).zip(shear.chunks(2));
    let mut u: Vec<f64> = loads.flat_map(|(m, q)| [q[0], m[0], m[1]]).collect();
    let pattern = BendingPattern::new(mesh).unwrap();
    let factor = pattern
        .factorise(pattern.stiffness(mesh, plate), &[0, 1, 2])
        .unwrap();
    factor.solve(&mut u);
    let n = mesh.nodes.len() as f64;
    let states: Vec<State> = mesh.nodes.iter().map(|&p| exact.at(p)).collect();
    let mut turn = [0.0; 2];
    for (u, state) in u.chunks(3).zip(&states) {
        for c in 0..2 {
            turn[c] += (state.rotation[c] - u[1 + c]) / n;
        }
    }
    let leaning = |p: &[f64; 2], w: f64| w - turn[0] * p[0] - turn[1] * p[1];
    let w: Vec<f64> = u
        .chunks(3)
        .zip(&mesh.nodes)
        .map(|(u, p)| leaning(p, u[0]))
        .collect();
    let lift: f64 = w
        .iter()
        .zip(&states)
        .map(|(w, s)| (s.deflection - w) / n)
        .sum();
    (
        w.into_iter().map(|w| w + lift).collect(),
        u.chunks(3)
            .map(|u| [u[1] + turn[0], u[2] + turn[1]])
            .collect(),
    )
}

/// Root mean square errors of deflections and rotations over the exact ones' at the nodes for which `of` holds.
fn errors(
    mesh: &Mesh,
    plate: &PlateStiffness,
    exact: &dyn Thing,
    of: impl Fn([f64; 2]) -> bool,
) -> [f64; 2] {
    let (w, theta) = solved(mesh, plate, exact);
    let mut sums = [[0.0; 2]; 2];
    for ((&p, w), theta) in mesh
        .nodes
        .iter()
        .zip(w)
        .zip(theta)
        .filter(|((p, _), _)| of(**p))
    {
        let state = exact.at(p);
        sums[0][0] += (w - state.deflection).powi(2);
        sums[0][1] += state.deflection.powi(2);
        for (theta, exact) in theta.into_iter().zip(state.rotation) {
            sums[1][0] += (theta - exact).powi(2);
            sums[1][1] += exact.powi(2);
        }
    }
    sums.map(|[error, size]| (error / size).sqrt())
}

fn anywhere(_: [f64; 2]) -> bool {
    true
}

/// Rotations are exact whatever the mesh. So are deflections at corners, and at midsides where edges are straight: along a bent edge
/// a quadratic of the place is no quadratic of the local coordinate, and the midside takes what leaves no shear.
#[test]
fn constant_curvature_is_exact_on_distorted_meshes() {
    let plain = rectangle([10.0, 6.0], [6, 4]);
    let bent = distorted(plain.clone(), 0.12, 3.0);
    let mut straight = bent.clone();
    for [a, b, c, d, ab, bc, cd, da] in &plain.elements {
        for (from, to, middle) in [(a, b, ab), (b, c, bc), (c, d, cd), (d, a, da)] {
            let [p, q] = [from, to].map(|n| straight.nodes[*n as usize]);
            straight.nodes[*middle as usize] = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
        }
    }
    for (mesh, edges_are_straight) in [(bent, false), (straight, true)] {
        let corners: Vec<[f64; 2]> = mesh
            .elements
            .iter()
            .flat_map(|nodes| [0, 1, 2, 3].map(|k| mesh.nodes[nodes[k] as usize]))
            .collect();
        for plate in [skew(2.0), skew(0.02), isotropic(0.3)] {
            for curvature in [
                Vector3::new(1e-3, 0.0, 0.0),
                Vector3::new(0.0, 2e-3, 0.0),
                Vector3::new(-3e-4, 5e-4, 1e-3),
            ] {
                let exact = Quadratic { curvature };
                let [_, rotation] = errors(&mesh, &plate, &exact, anywhere);
                assert!(rotation < 1e-9, "{curvature:?}: {rotation:e}");
                let deflection = if edges_are_straight {
                    errors(&mesh, &plate, &exact, anywhere)[0]
                } else {
                    bulge(&mesh, &plate, &exact, &corners)
                };
                assert!(deflection < 1e-8, "{curvature:?}: {deflection:e}");
            }
        }
    }
}

/// Largest departure of deflections at some nodes from exact ones, less the constant between them, over the largest of those.
fn bulge(mesh: &Mesh, plate: &PlateStiffness, exact: &dyn Thing, nodes: &[[f64; 2]]) -> f64 {
    let (w, _) = solved(mesh, plate, exact);
    let pairs: Vec<[f64; 2]> = mesh
        .nodes
        .iter()
        .zip(w)
        .filter(|(p, _)| nodes.contains(p))
        .map(|(&p, w)| [w, exact.at(p).deflection])
        .collect();
    let lift = pairs[0][1] - pairs[0][0];
    let largest =
        |of: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().fold(0.0_f64, |m, p| m.max(of(p).abs()));
    largest(&|[a, b]| a + lift - b) / largest(&|p| p[1])
}

#[test]
fn a_strip_of_any_laminate_bends_as_laminate_theory_has_it() {
    let mesh = rectangle([100.0, 12.5], [10, 4]);
    for thickness in [2.0, 0.2] {
        let plate = skew(thickness);
        let load = EndMoment {
            moment: 3.0,
            gradient: 0.0,
        };
        let bent = bend(&mesh, &plate, &[load]).unwrap().remove(0);
        let kappa = plate.bending.try_inverse().unwrap() * Vector3::new(3.0, 0.0, 0.0);
        assert!(kappa[1] / kappa[0] < -0.1 && kappa[2].abs() > 0.3 * kappa[0]);
        let size = kappa[0] * 100.0;
        for ((n, [s, t]), rotation) in mesh.nodes.iter().enumerate().zip(bent.rotation.chunks(2)) {
            let expected = [
                kappa[0] * s + 0.5 * kappa[2] * t,
                0.5 * kappa[2] * s + kappa[1] * t,
            ];
            for c in 0..2 {
                assert!((rotation[c] - expected[c]).abs() < 1e-6 * size);
            }
            let w = -0.5 * (kappa[0] * s * s + kappa[1] * t * t + kappa[2] * s * t);
            assert!((bent.deflection[n] - w).abs() < 1e-6 * size * 100.0);
        }
        let wanted = EndMoment::bending(&plate, [kappa[0], 0.0]);
        assert!((wanted.moment - 3.0).abs() < 1e-12);
    }
}

/// Errors fall at the rates of the element's spaces, and a plate of a ten-thousandth of its side costs no accuracy.
#[test]
fn thin_plates_do_not_lock() {
    let side = 5.0;
    for share in [0.0, 0.1] {
        let mut finest = Vec::new();
        for thickness in [1.0, 0.01, 0.001] {
            let plate = isotropic(thickness);
            let exact = Biharmonic::new(0.35, &plate);
            let sequence: Vec<[f64; 2]> = [4_usize, 8, 16]
                .iter()
                .map(|&n| {
                    let mesh = rectangle([side; 2], [n, n]);
                    let mesh = distorted(mesh, share, 2.0 * side / n as f64);
                    errors(&mesh, &plate, &exact, anywhere)
                })
                .collect();
            for k in 0..2 {
                let rate = (sequence[1][k] / sequence[2][k]).log2();
                println!("distortion {share}, thickness {thickness}: {sequence:?}, rate {rate}");
                let least = if share == 0.0 { 2.7 } else { 1.7 };
                assert!(rate > least, "{k}: {sequence:?}");
            }
            finest.push(sequence[2]);
        }
        for k in 0..2 {
            assert!(finest[2][k] < 2.0 * finest[0][k], "{finest:?}");
            // an element that locks is worse the thinner the plate
            assert!(finest[2][k] < 1.05 * finest[1][k], "{finest:?}");
        }
    }
}

/// The rotation of the part that grows along the load is the gradient of its deflection.
#[test]
fn the_growing_part_turns_as_it_deflects() {
    let plate = skew(0.2);
    let step = 1e-3;
    for p in [[3.0, -2.0], [-7.0, 4.0], [0.5, 1.0]] {
        let rotation = plain_rotation(&plate, [0.0, 1.0], p);
        for (c, rotation) in rotation.into_iter().enumerate() {
            let at = |by: f64| {
                let mut p = p;
                p[c] += by;
                plain_deflection(&plate, p)
            };
            let slope = (at(step) - at(-step)) / (2.0 * step);
            assert!((rotation + slope).abs() < 1e-5, "{rotation} and {slope}");
        }
    }
}

/// M_theta over the remote moment at the ends of the diameter across the load: the edge is free, so that only the curvature along it counts.
fn concentration(mesh: &Mesh, plate: &PlateStiffness, exact: &dyn Thing, radius: f64) -> f64 {
    let (_, theta) = solved(mesh, plate, exact);
    let nodal: Vec<f64> = theta.into_iter().flatten().collect();
    let observer = Locator::new(mesh).observe(&[[0.0, radius]]).0;
    let along = observer.gradient(&nodal)[0][0][0];
    let d = &plate.bending;
    along * (d[(0, 0)] - d[(0, 1)] * d[(0, 1)] / d[(1, 1)])
}

/// Reissner's plate with a hole in closed form: its stress concentration tends to Kirchhoff's (5 + 3 nu) / (3 + nu) as the plate gets
/// thin, and to 3 as it gets thick; the elements have the same at every thickness.
#[test]
fn a_hole_concentrates_bending_as_plate_theory_has_it() {
    let kirchhoff = (5.0 + 3.0 * 0.3) / (3.0 + 0.3);
    let of = |thickness: f64| IsotropicHole::new(1.0, 1.0, 0.3, &isotropic(thickness));
    let at_edge = |h: f64| of(h).concentration();
    assert!((at_edge(1e-4) - kirchhoff).abs() < 1e-3);
    assert!((at_edge(100.0) - 3.0).abs() < 1e-2);
    let mesh = holed([6.0, 6.0], 1.0, 0.6);
    for thickness in [1.0, 0.39, 0.1, 0.01] {
        let plate = isotropic(thickness);
        let exact = of(thickness);
        let found = concentration(&mesh, &plate, &exact, 1.0);
        let errors = errors(&mesh, &plate, &exact, anywhere);
        println!(
            "h/R {thickness}: {found} for {}, {errors:?}",
            exact.concentration()
        );
        assert!(
            (found / exact.concentration() - 1.0).abs() < 0.01,
            "{found}"
        );
        assert!(errors.iter().all(|e| *e < 1e-3), "{errors:?}");
        if thickness < 0.05 {
            assert!((found / kirchhoff - 1.0).abs() < 0.015, "{found}");
        }
    }
}

/// Kirchhoff's plate of any laminate by complex potentials: the elements approach it as the plate gets thin.
#[test]
fn a_hole_in_a_laminate_bends_as_complex_potentials_have_it() {
    let mesh = holed([6.0, 6.0], 1.0, 0.6);
    let ring = |p: [f64; 2]| (1.2..3.0).contains(&p[0].hypot(p[1]));
    let mut last = f64::INFINITY;
    for thickness in [0.2, 0.05, 0.0125] {
        let plate = skew(thickness);
        let exact = LaminateHole::new(1.0, &plate);
        assert!(exact.residual < 1e-6, "{}", exact.residual);
        let [_, theta] = errors(&mesh, &plate, &exact, ring);
        println!(
            "h/R {thickness}: {theta:e}; hole adds {:e}",
            exact.share(&mesh, ring)
        );
        assert!(theta < 0.5 * last, "{theta} after {last}");
        last = theta;
    }
    assert!(last < 2e-3, "{last}");
}

#[test]
fn work_is_reciprocal_and_fields_are_as_symmetric_as_the_plate() {
    let mesh = holed([20.0, 8.0], 2.0, 0.3);
    let plate = skew(0.5);
    let pattern = BendingPattern::new(&mesh).unwrap();
    let stiffness = pattern.stiffness(&mesh, &plate);
    let factor = pattern.factorise(stiffness.clone(), &[0, 1, 2]).unwrap();
    let [first, second] = [[1.0, 0.0], [0.0, 0.1]]
        .map(|[moment, gradient]| EndMoment { moment, gradient }.forces(&mesh));
    let mut both = [first.clone(), second.clone()].concat();
    factor.solve(&mut both);
    let (u, v) = both.split_at(first.len());
    let work = |f: &[f64], u: &[f64]| f.iter().zip(u).map(|(f, u)| f * u).sum::<f64>();
    let size = (work(&first, u) * work(&second, v)).sqrt();
    assert!((work(&first, v) - work(&second, u)).abs() < 1e-7 * size);
    // the supports carry nothing: K u is the whole load
    let inner = pattern.multiply(&stiffness, u);
    let largest = first.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    for (a, b) in inner.iter().zip(&first) {
        assert!((a - b).abs() < 1e-6 * largest, "{a} {b}");
    }
    // half a turn maps any laminate onto itself, and its rotations under a uniform moment to their opposites
    let nodal: Vec<f64> = u.chunks(3).flat_map(|u| [u[1], u[2]]).collect();
    let points = [[5.0, 3.0], [2.5, -1.0], [0.5, 4.0], [-11.0, 2.0]];
    let turned = points.map(|[s, t]| [-s, -t]);
    let [a, b, middle] = [&points[..], &turned[..], &[[0.0, 3.0], [0.0, -3.0]][..]]
        .map(|p| Locator::new(&mesh).observe(p).0.displacement(&nodal));
    let still = [0, 1].map(|c| 0.5 * (middle[0][c] + middle[1][c]));
    let top = a.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
    for (a, b) in a.iter().zip(&b) {
        for c in 0..2 {
            assert!((a[c] + b[c] - 2.0 * still[c]).abs() < 1e-6 * top);
        }
    }
    assert!(!mesh.edge(HOLE).is_empty());
}

#[test]
fn the_transverse_shear_stiffness_turns_with_the_plies() {
    let of = |angle: f64| PlateStiffness::of(&PLY, &[angle], 2.0).shear;
    let (g13, g23) = (5e3, 7.9e3 / (2.0 * 1.33));
    let along = Matrix2::new(g13, 0.0, 0.0, g23) * (2.0 * 5.0 / 6.0);
    assert!((of(0.0) - along).norm() < 1e-9);
    let (s, c) = 0.4_f64.sin_cos();
    let turn = Matrix2::new(c, s, -s, c);
    assert!((of(0.4) - turn.transpose() * along * turn).norm() < 1e-9);
    let metal = isotropic(3.0);
    let g = 70e3 / 2.6;
    assert!((metal.shear - Matrix2::identity() * (2.5 * g)).norm() < 1e-6);
    let d = 70e3 * 27.0 / 12.0 / 0.91;
    let bending = Matrix3::new(1.0, 0.3, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0, 0.35) * d;
    assert!((metal.bending - bending).norm() < 1e-6 * d);
}
