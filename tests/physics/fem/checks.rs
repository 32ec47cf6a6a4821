//! The finite elements against closed forms, section forces and symmetry.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use plychain::error::{Error, Result};
use plychain::fem::element::{self, GAUSS};
use plychain::fem::{Locator, Plate, Setup, edge_forces};
use plychain::geometry::{Density, HIGH, LOW, Mesh, Morph, Outline, SIDES, StripWithHole};
use plychain::laminate::{Membrane, Ply};

use crate::verify::{Check, difference, observe, window_convergence, window_points};

use super::lekhnitskii::HoleSolution;

/// All checks for one set-up and ply; `half` (mm) is half the side of the square window about the hole.
///
/// # Errors
/// A set-up that cannot be meshed or solved.
pub fn checks(setup: &Setup, ply: &Ply, half: f64) -> Result<Vec<Check>> {
    let a = setup.membrane(ply);
    let mut rows = vec![patch_test(&a)?];
    rows.extend(lekhnitskii(&a, "laminate")?);
    let turned = Setup {
        angles: setup.angles.iter().map(|x| x + 0.35).collect(),
        ..setup.clone()
    };
    let turned = turned.membrane(ply);
    rows.extend(lekhnitskii(&turned, "laminate turned by 20 deg")?);
    rows.push(concentration(
        &a,
        "stress concentration against the closed form, relative",
    )?);
    let isotropic = Setup {
        angles: vec![0.0],
        ..setup.clone()
    };
    let kirsch = isotropic.membrane(&Ply::isotropic(200e3, 0.3));
    rows.push(concentration(
        &kirsch,
        "stress concentration of an isotropic plate against 3, relative",
    )?);
    // both take one stack, and a strip that is symmetric
    if setup.regions.is_empty() {
        rows.extend([section_forces(setup, ply)?, mirror(setup, ply)?]);
    }
    rows.push(window_convergence(setup, ply, Density::DEFAULT, half)?);
    Ok(rows)
}

/// A linear displacement field on the mesh leaves no nodal force off the boundary: largest inner residual
/// over the largest nodal force.
///
/// # Errors
/// None for a mesh that fits into memory.
pub fn patch_test(a: &Membrane) -> Result<Check> {
    let plate = square(COARSE)?;
    let u: Vec<f64> = plate
        .mesh
        .nodes
        .iter()
        .flat_map(|[x, y]| [1e-3 * x + 2e-3 * y, -5e-4 * x + 3e-4 * y])
        .collect();
    let mut force = plate.assembly.multiply(plate.assembly.nominal(), &[*a], &u);
    let largest = force.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    // The boundary carries the tractions of the uniform stress.
    for &node in plate.mesh.edges.values().flatten().flatten() {
        force[2 * node as usize..2 * node as usize + 2].fill(0.0);
    }
    let residual = force.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    Ok(Check::new(
        "patch test, relative residual",
        residual / largest,
        1e-12,
    ))
}

/// Infinite plate with exact tractions on the outer edge: relative L2 displacement error on the finest of three
/// meshes, and the observed order of convergence.
///
/// # Errors
/// A membrane stiffness that is not positive definite.
pub fn lekhnitskii(a: &Membrane, name: &str) -> Result<Vec<Check>> {
    let exact = HoleSolution::new(a, 2.0, [100.0, 0.0, 0.0])?;
    let mut errors = Vec::new();
    for factor in [1.0, 2.0, 4.0] {
        let plate = square(COARSE.scaled(factor))?;
        errors.push(l2_error(
            &plate.mesh,
            &solve_exact(&plate, a, &exact)?,
            &exact,
        )?);
    }
    let order = (errors[1] / errors[2]).log2();
    Ok(vec![
        Check::new(
            format!("Lekhnitskii, {name}: relative L2 displacement error"),
            errors[2],
            1e-5,
        ),
        Check::new(
            format!("Lekhnitskii, {name}: by how much the observed order is below 2.8"),
            2.8 - order,
            0.0,
        ),
    ])
}

/// Relative error of the stress concentration at the hole's edge, from the finite elements with the exact
/// tractions on the outer edge, against the closed form at (0, R), which is
/// 1 + sqrt(2 (sqrt(Ex/Ey) - nu_xy) + Ex/Gxy) where A16 = A26 = 0.
///
/// # Errors
/// A membrane stiffness that is not positive definite.
pub fn concentration(a: &Membrane, what: &str) -> Result<Check> {
    let exact = HoleSolution::new(a, 2.0, [1.0, 0.0, 0.0])?;
    let plate = square(COARSE.scaled(4.0))?;
    let u = solve_exact(&plate, a, &exact)?;
    let (observer, _) = Locator::new(&plate.mesh).observe(&[[0.0, 2.0]]);
    let gradient = observer.gradient(&u);
    let Some(g) = gradient.first() else {
        return Err(Error::program(
            "stress concentration",
            "the hole's edge inside the mesh",
        ));
    };
    let found = resultants(&a.matrix(), g)[0];
    let expected = exact.resultants([0.0, 2.0])[0];
    Ok(Check::new(what, (found / expected - 1.0).abs(), 2e-3))
}

/// Integrals of N11 and N12 over up to five cross-sections against the end forces: largest difference over the load.
///
/// # Errors
/// A set-up that cannot be meshed or solved.
pub fn section_forces(setup: &Setup, ply: &Ply) -> Result<Check> {
    let plate = Plate::new(setup, Density::DEFAULT)?;
    let u = plate.solve(setup, ply)?.nodal;
    let a = setup.membrane(ply).matrix();
    let locator = Locator::new(&plate.mesh);
    let r = setup.geometry.hole_radius().unwrap_or(0.0);
    let [[first, last], [low, high]] = setup.geometry.extents();
    let bending = setup.load.moment.abs() / setup.width();
    let scale = bending
        .max(setup.load.axial.abs())
        .max(setup.load.shear.abs());
    let mut worst = 0.0_f64;
    let unit = if r > 0.0 { r } else { 0.1 * setup.width() };
    let sections = [-1.5, -0.5, 0.0, 0.7, 2.0].map(|f| f * unit);
    for s in sections.into_iter().filter(|&s| s > first && s < last) {
        let half = (r * r - s * s).max(0.0).sqrt();
        let mut sum = [0.0; 2];
        for [from, to] in [[low, -half], [half, high]] {
            let (points, weights) = gauss_line(s, from, to, 400);
            let (observer, _) = locator.observe(&points);
            for (g, w) in observer.gradient(&u).iter().zip(weights) {
                let n = resultants(&a, g);
                sum[0] += w * n[0];
                sum[1] += w * n[2];
            }
        }
        worst = worst
            .max((sum[0] - setup.load.axial).abs() / scale)
            .max((sum[1] - setup.load.shear).abs() / scale);
    }
    Ok(Check::new(
        "section forces against the load, relative",
        worst,
        1e-3,
    ))
}

/// The plate reflected in its long axis, with all angles reversed, gives the reflected field: largest difference
/// over the amplitude. The hole is taken on the axis.
///
/// # Errors
/// A set-up that cannot be meshed or solved.
pub fn mirror(setup: &Setup, ply: &Ply) -> Result<Check> {
    let half = 0.5 * setup.width();
    let mut here = setup.clone();
    let [_, [low, high]] = setup.geometry.extents();
    if low + high != 0.0 {
        let hole_offset = [0.0, 0.5 * (low + high)];
        here.geometry = here.geometry.morphed(&Morph {
            hole_offset,
            ..Morph::NONE
        })?;
    }
    // Turned plies: the check has to see the signs of A16 and A26.
    here.angles.iter_mut().for_each(|x| *x += 0.2);
    let mut there = here.clone();
    there.angles.iter_mut().for_each(|x| *x = -*x);
    there.load.shear = -here.load.shear;
    there.load.moment = -here.load.moment;
    let points = window_points(&*here.geometry, half);
    let reflected: Vec<[f64; 2]> = points.iter().map(|p| [p[0], -p[1]]).collect();
    let plate = Plate::new(&here, Density::DEFAULT.scaled(0.5))?;
    let u = observe(&plate, &here, ply, &points)?;
    let v: Vec<[f64; 2]> = observe(&plate, &there, ply, &reflected)?
        .iter()
        .map(|v| [v[0], -v[1]])
        .collect();
    Ok(Check::new(
        "mirror symmetry, relative difference",
        difference(&points, &u, &v),
        1e-9,
    ))
}

fn solve_exact(plate: &Plate, a: &Membrane, exact: &HoleSolution) -> Result<Vec<f64>> {
    let mut factor = plate.factor();
    factor.factorise(a)?;
    let mut u = edge_forces(&plate.mesh, &[LOW, HIGH, SIDES], &|p, n| {
        let [n11, n22, n12] = exact.resultants(p);
        [n11 * n[0] + n12 * n[1], n12 * n[0] + n22 * n[1]]
    });
    factor.solve(&mut u);
    Ok(u)
}

/// Relative L2 error over the plate; the rigid motion comes off both fields by weighted least squares.
fn l2_error(mesh: &Mesh, nodal: &[f64], exact: &HoleSolution) -> Result<f64> {
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    let mut samples = Vec::new();
    for (e, nodes) in mesh.elements.iter().enumerate() {
        let x = mesh.corners(e);
        for (a, wa) in GAUSS {
            for (b, wb) in GAUSS {
                let n = element::shape(a, b);
                let p = element::position(&x, &n);
                let w = wa * wb * element::physical_gradient(&x, a, b).1;
                let u = exact.displacement(p);
                let mut d = u.map(|u| -u);
                for (node, n) in nodes.iter().zip(n) {
                    d[0] += n * nodal[2 * *node as usize];
                    d[1] += n * nodal[2 * *node as usize + 1];
                }
                for (row, d) in [Vector3::new(1.0, 0.0, -p[1]), Vector3::new(0.0, 1.0, p[0])]
                    .iter()
                    .zip(d)
                {
                    normal += row * row.transpose() * w;
                    right += row * (w * d);
                }
                samples.push((w, p, d, u));
            }
        }
    }
    let Some(rigid) = normal.cholesky().map(|c| c.solve(&right)) else {
        return Err(Error::program("L2 error", "a plate of positive area"));
    };
    let (mut error, mut size) = (0.0, 0.0);
    for (w, p, d, u) in samples {
        let e = [
            d[0] - rigid[0] + rigid[2] * p[1],
            d[1] - rigid[1] - rigid[2] * p[0],
        ];
        error += w * (e[0] * e[0] + e[1] * e[1]);
        size += w * (u[0] * u[0] + u[1] * u[1]);
    }
    Ok((error / size).sqrt())
}

/// N11, N22, N12 of a displacement gradient.
fn resultants(a: &Matrix3<f64>, g: &[[f64; 2]; 2]) -> Vector3<f64> {
    a * Vector3::new(g[0][0], g[1][1], g[0][1] + g[1][0])
}

/// Points and weights of `n` Gauss panels on the line s = constant from t = `from` to `to`.
fn gauss_line(s: f64, from: f64, to: f64, n: usize) -> (Vec<[f64; 2]>, Vec<f64>) {
    let panel = (to - from) / n as f64;
    (0..n)
        .flat_map(|k| {
            GAUSS.map(|(x, w)| {
                (
                    [s, from + panel * (k as f64 + 0.5 + 0.5 * x)],
                    0.5 * w * panel,
                )
            })
        })
        .unzip()
}

/// A square of 16 mm with a hole of 4 mm.
fn square(density: Density) -> Result<Plate> {
    let square = StripWithHole {
        outline: Outline {
            s: [-8.0, 8.0],
            t: [-8.0, 8.0],
            clamp: None,
        },
        radius: 2.0,
    };
    Plate::meshed(Arc::new(square), None, density)
}

/// 8 elements a side, 10 from the hole to the box.
const COARSE: Density = Density(2.0 / 9.0);
