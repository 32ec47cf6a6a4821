//! The strained specimen: finite elements of the program on a finer mesh than any analysis uses, and closed forms. Points and displacements
//! are along the data's (x, y), the load along y, mm, from the hole's centre.

use nalgebra::{Matrix3, Vector3};
use plychain::effect::{Acting, find, limit::alter_checked};
use plychain::fem::{Locator, Plate, Setup, end_forces};
use plychain::geometry::Density;
use plychain::laminate::{LoadSpec, Material, Ply, SpecimenSpec};
use serde_json::{Value, json};

/// A specimen as it is declared.
#[derive(Debug, Clone)]
pub struct Specimen {
    pub length_mm: f64,
    pub width_mm: f64,
    pub diameter_mm: f64,
    /// Ply angles; none of an isotropic plate.
    pub layup_deg: Option<Vec<f64>>,
    pub thickness_mm: [f64; 2],
    /// Along and across the fibres, 1/K.
    pub expansion_per_k: [f64; 2],
    /// Prior mean and sd of each constant, by its name in the model file.
    pub priors: Vec<(&'static str, [f64; 2])>,
}

impl Specimen {
    pub fn laminate() -> Self {
        Self {
            length_mm: 140.0,
            width_mm: 30.0,
            diameter_mm: 10.0,
            layup_deg: Some(vec![45.0, -45.0, 0.0, 0.0, -45.0, 45.0]),
            thickness_mm: [0.78, 0.005],
            expansion_per_k: [-0.2e-6, 32e-6],
            priors: vec![
                ("E1_GPa", [162.0, 16.2]),
                ("E2_GPa", [7.58, 0.758]),
                ("nu12", [0.34, 0.034]),
                ("G12_GPa", [4.41, 0.441]),
            ],
        }
    }

    pub fn steel() -> Self {
        Self {
            length_mm: 80.0,
            width_mm: 20.0,
            diameter_mm: 8.0,
            layup_deg: None,
            thickness_mm: [2.0, 0.01],
            expansion_per_k: [12e-6, 12e-6],
            priors: vec![("E_GPa", [200.0, 40.0]), ("nu", [0.3, 0.05])],
        }
    }

    pub fn is_laminate(&self) -> bool {
        self.layup_deg.is_some()
    }

    /// The `specimen` object of a model file.
    pub fn json(&self) -> Value {
        let mut value = json!({
            "length_mm": self.length_mm,
            "width_mm": self.width_mm,
            "hole": {"diameter_mm": self.diameter_mm, "center_mm": [0.0, 0.0]},
            "thickness_mm": {"mean": self.thickness_mm[0], "sd": self.thickness_mm[1]},
        });
        if let Some(layup) = &self.layup_deg {
            value["layup_deg"] = json!(layup);
        }
        value
    }

    fn ply(&self, constants: &[f64]) -> Ply {
        let material = if self.is_laminate() {
            Material::Ply
        } else {
            Material::Isotropic
        };
        material.ply(constants)
    }
}

/// Stiffness that no effect of the dictionary has, as a factor over the plate.
#[derive(Debug, Clone, Copy)]
pub enum Stiffness {
    /// A soft patch: 1 - loss exp(-(r / radius)^2) about (x, y).
    Patch {
        at_mm: [f64; 2],
        radius_mm: f64,
        loss: f64,
    },
    /// Damage of a hole's edge that fades into the plate: 1 - loss exp(-(r - R) / depth), of a hole of radius R about the origin.
    Worn {
        hole_mm: f64,
        depth_mm: f64,
        loss: f64,
    },
    /// A ring of one loss about such a hole, up to `reach` times its radius.
    Ring { hole_mm: f64, reach: f64, loss: f64 },
    /// A sum of six waves of some length, of this sd in all.
    Waves { length_mm: f64, sd: f64, phase: f64 },
}

impl Stiffness {
    pub fn factor(&self, [x, y]: [f64; 2]) -> f64 {
        match *self {
            Self::Patch {
                at_mm: [a, b],
                radius_mm,
                loss,
            } => 1.0 - loss * (-((x - a).hypot(y - b) / radius_mm).powi(2)).exp(),
            Self::Worn {
                hole_mm,
                depth_mm,
                loss,
            } => 1.0 - loss * (-(x.hypot(y) - hole_mm) / depth_mm).exp(),
            Self::Ring {
                hole_mm,
                reach,
                loss,
            } => 1.0 - loss * f64::from(u8::from(x.hypot(y) < reach * hole_mm)),
            Self::Waves {
                length_mm,
                sd,
                phase,
            } => {
                let wave = |k: usize| {
                    let angle = 2.4 * k as f64 + phase;
                    let k = k as f64;
                    let number = std::f64::consts::TAU / length_mm * (0.7 + 0.12 * k);
                    (number * (x * angle.cos() + y * angle.sin()) + 1.7 * k * phase).cos()
                };
                1.0 + sd * (0..6).map(wave).sum::<f64>() / 3_f64.sqrt()
            }
        }
    }
}

/// What the loaded specimen is.
#[derive(Debug, Clone)]
pub struct Loaded {
    pub specimen: Specimen,
    /// True constants, in the order of the priors, border units.
    pub constants: Vec<f64>,
    pub thickness_mm: f64,
    /// Mechanical effects of the dictionary: names and amplitudes.
    pub effects: Vec<(&'static str, Vec<f64>)>,
    pub stiffness: Option<Stiffness>,
    /// Density of the mesh over the program's.
    pub finer: f64,
}

/// Data's (x, y) to the program's (along the load, across it), and back.
fn swapped([x, y]: [f64; 2]) -> [f64; 2] {
    [y, x]
}

impl Loaded {
    fn acting(&self) -> Vec<Acting> {
        let acting = |(name, amplitude): &(&str, Vec<f64>)| Acting {
            effect: find("simulator", name).unwrap(),
            amplitude: amplitude.clone(),
        };
        self.effects.iter().map(acting).collect()
    }

    fn amplitude(&self, name: &str, k: usize) -> f64 {
        let found = self.effects.iter().find(|(n, _)| *n == name);
        found.map_or(0.0, |(_, amplitude)| amplitude[k])
    }

    /// Whether a point is one of the specimen.
    pub fn holds(&self, [x, y]: [f64; 2]) -> bool {
        let radius =
            0.5 * self.specimen.diameter_mm * (1.0 + 0.01 * self.amplitude("hole_size", 0));
        let [dx, dy] = [0, 1].map(|k| self.amplitude("hole_offset", k));
        let inside = |x: f64, size: f64| x.abs() < 0.5 * size;
        x.hypot(y) > radius
            && inside(x + dx, self.specimen.width_mm)
            && inside(y + dy, self.specimen.length_mm)
    }

    /// The test under a force, as the mechanical effects leave it.
    fn setup(&self, force_n: f64) -> Setup {
        let specimen: SpecimenSpec = serde_json::from_value(self.specimen.json()).unwrap();
        let mut setup = Setup::nominal(&specimen, &LoadSpec { force_n }, -1.0);
        setup.thickness = self.thickness_mm;
        alter_checked("simulator", &self.acting(), &mut setup).unwrap();
        setup
    }

    /// Displacements at points of the specimen under some forces (N), free of the least-squares rigid motion over the points.
    pub fn displacements(&self, forces_n: &[f64], points: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
        let largest = forces_n.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let plate = Plate::new(&self.setup(largest), Density(self.finer)).unwrap();
        let places: Vec<[f64; 2]> = points.iter().map(|&p| swapped(p)).collect();
        let solved = |force: f64| -> Vec<[f64; 2]> {
            let setup = self.setup(force);
            let ply = self.specimen.ply(&self.constants);
            let mesh = plate.mesh_of(&setup).unwrap();
            let nodal = match self.stiffness {
                None => plate.solve_full_order(&setup, &ply).unwrap().nodal,
                Some(stiffness) => {
                    assert!(self.effects.is_empty(), "a stiffness beside other effects");
                    let factor = |p: [f64; 2]| stiffness.factor(swapped(p));
                    let integrals = plate.assembly.integrals(&mesh, &factor);
                    let mut solver = plate.factor();
                    let membranes = setup.membranes(&ply);
                    solver.factorise_with(&integrals, &membranes).unwrap();
                    let mut nodal = end_forces(&mesh, &setup.load);
                    solver.solve(&mut nodal);
                    nodal
                }
            };
            let observer = Locator::new(&mesh).observe_extended(&places);
            let u = observer.displacement(&nodal);
            let mut u: Vec<[f64; 2]> = u.into_iter().map(swapped).collect();
            hold(points, &mut u);
            u
        };
        let linear = self.acting().iter().all(|a| a.effect.scales());
        if !linear {
            let still = vec![[0.0; 2]; points.len()];
            let each = |&f: &f64| if f == 0.0 { still.clone() } else { solved(f) };
            return forces_n.iter().map(each).collect();
        }
        let full = solved(largest);
        let share = |f: &f64| full.iter().map(|u| u.map(|u| u * f / largest)).collect();
        forces_n.iter().map(share).collect()
    }

    /// Stiffness of each ply along (x, y), engineering shear, MPa: Q turned by the rotation of strains.
    pub fn ply_stiffness(&self) -> Vec<Matrix3<f64>> {
        let Some(layup) = &self.specimen.layup_deg else {
            let [e, nu] = [0, 1].map(|k| self.constants[k]);
            return vec![plane_stress([1e3 * e, 1e3 * e, nu, 500.0 * e / (1.0 + nu)])];
        };
        let [e1, e2, nu12, g12] = [0, 1, 2, 3].map(|k| self.constants[k]);
        let q = plane_stress([1e3 * e1, 1e3 * e2, nu12, 1e3 * g12]);
        let turned = |t: Matrix3<f64>| t.transpose() * q * t;
        layup.iter().map(|&angle| turned(to_ply(angle))).collect()
    }

    /// Free strain (xx, yy, xy) a kelvin: classical lamination theory, A^-1 of the sum over the plies of their stiffness times their own
    /// expansion.
    pub fn expansion_per_k(&self) -> [f64; 3] {
        let [along, across] = self.specimen.expansion_per_k;
        let layup = self.specimen.layup_deg.as_deref().unwrap_or(&[0.0]);
        let (mut stiffness, mut resultant) = (Matrix3::zeros(), Vector3::zeros());
        for (q, &angle) in self.ply_stiffness().iter().zip(layup) {
            let back = to_ply(angle).try_inverse().unwrap();
            stiffness += q;
            resultant += q * back * Vector3::new(along, across, 0.0);
        }
        let strain = stiffness.try_inverse().unwrap() * resultant;
        [strain.x, strain.y, 0.5 * strain.z]
    }
}

/// Q of E1, E2, nu12, G12.
fn plane_stress([e1, e2, nu12, g12]: [f64; 4]) -> Matrix3<f64> {
    let d = 1.0 - nu12 * nu12 * e2 / e1;
    let coupled = nu12 * e2 / d;
    Matrix3::from_row_slice(&[e1 / d, coupled, 0., coupled, e2 / d, 0., 0., 0., g12])
}

/// Strains (xx, yy, gamma) to those of a ply whose fibres are turned counter-clockwise from the load, along y, by an angle.
fn to_ply(angle_deg: f64) -> Matrix3<f64> {
    let (s, c) = (angle_deg + 90.0).to_radians().sin_cos();
    let (ss, cc, sc) = (s * s, c * c, s * c);
    let double = 2.0 * sc;
    Matrix3::from_row_slice(&[cc, ss, sc, ss, cc, -sc, -double, double, cc - ss])
}

/// Take the least-squares rigid motion (small rotation) over the points off a field.
pub fn hold(points: &[[f64; 2]], u: &mut [[f64; 2]]) {
    let [tx, ty, angle, x0, y0] = rigid(points, u);
    for (u, [x, y]) in u.iter_mut().zip(points) {
        *u = [u[0] - tx + angle * (y - y0), u[1] - ty - angle * (x - x0)];
    }
}

/// Least-squares translation of the points' centre, small rotation about it, and the centre.
pub fn rigid(points: &[[f64; 2]], u: &[[f64; 2]]) -> [f64; 5] {
    let n = points.len() as f64;
    let mean = |v: &[[f64; 2]], k: usize| v.iter().map(|v| v[k]).sum::<f64>() / n;
    let ([x0, y0], [tx, ty]) = ([0, 1].map(|k| mean(points, k)), [0, 1].map(|k| mean(u, k)));
    let (mut moment, mut inertia) = (0.0, 0.0);
    for ([x, y], u) in points.iter().zip(u) {
        moment += (x - x0) * (u[1] - ty) - (y - y0) * (u[0] - tx);
        inertia += (x - x0).powi(2) + (y - y0).powi(2);
    }
    [tx, ty, moment / inertia, x0, y0]
}
