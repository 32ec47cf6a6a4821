//! A specimen whose field is known in closed form: for tests of everything that is not physics.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::{CameraField, Gauge, Mechanics, Places, PointSet, Spanning, State};
use crate::effect::{Scene, Seen};
use crate::error::Result;
use crate::geometry::HOLE;
use crate::laminate::abd;

/// A rectangular sheet under stress resultants that vary linearly, N11 = N (1 + 2 t / W), N22 = N / 2, N12 = N / 4 with
/// N the force over the width W, so that one field determines all four constants. Its displacement is quadratic.
/// Mechanical effects act as far as they change load, angles or thickness.
pub struct MockExperiment {
    scene: Scene,
    gauge: Gauge,
    window: [[f64; 2]; 2],
    support: PointSet,
}

/// Points of the support along each side of the window: they determine a quadratic.
const SIDE: usize = 4;

impl MockExperiment {
    /// Over a window, low and high corner (s, t) in mm.
    pub fn new(scene: Scene, gauge: Gauge, window: [[f64; 2]; 2]) -> Self {
        let [low, high] = window;
        let at = |k: usize, i: usize| low[k] + (high[k] - low[k]) * i as f64 / (SIDE - 1) as f64;
        let support: Vec<[f64; 2]> = (0..SIDE * SIDE)
            .map(|i| [at(0, i / SIDE), at(1, i % SIDE)])
            .collect();
        Self {
            scene,
            gauge,
            window,
            support: PointSet::anywhere(&support, &[]),
        }
    }

    /// Compliance of the laminate times N, and the sheet's width.
    fn compliance(&self, state: &State) -> Result<(Matrix3<f64>, f64)> {
        let ply = self.scene.material.ply(&state.constants);
        let ply = ply.admissible("elastic constants")?;
        let mut setup = self.scene.setup.clone();
        setup.thickness = state.thickness_mm;
        for a in state.acting() {
            a.effect.alter(&a.amplitude, &mut setup);
        }
        let width = setup.width();
        let a = abd(&ply, &setup.angles, setup.thickness).a;
        // an admissible ply has a positive definite A
        let inverse = a.cholesky().map_or_else(Matrix3::zeros, |a| a.inverse());
        Ok((inverse * (setup.load.axial / width), width))
    }
}

impl Mechanics for MockExperiment {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn gauge(&self) -> Gauge {
        self.gauge
    }

    fn shows(&self, _state: &State, points: &[[f64; 2]]) -> Result<Vec<bool>> {
        // nothing is measured in the declared hole, which the sheet itself does not have
        let geometry = &self.scene.setup.geometry;
        let beside = |&p: &[f64; 2]| geometry.distance(HOLE, p).is_none_or(|d| d > 0.0);
        Ok(points.iter().map(beside).collect())
    }

    fn look(&self, state: &State, sight: &PointSet, _gradient: bool) -> Result<CameraField> {
        let (a, width) = self.compliance(state)?;
        let camera = Seen::new(state.acting(), &self.scene);
        let uniform = a * Vector3::new(1.0, 0.5, 0.25);
        // strains that grow with t: u1 = e1 s t + g t^2 / 2, u2 = e2 t^2 / 2 - e1 s^2 / 2
        let slope = a.column(0) * (2.0 / width);
        let (mut displacement, mut loaded, mut gradient) = (Vec::new(), Vec::new(), Vec::new());
        for &p in sight.all() {
            let [s, t] = camera.true_point(p);
            let shear = 0.5 * uniform[2];
            let u = [
                uniform[0] * s + shear * t + slope[0] * s * t + 0.5 * slope[2] * t * t,
                shear * s + uniform[1] * t + 0.5 * slope[1] * t * t - 0.5 * slope[0] * s * s,
            ];
            loaded.push(u);
            displacement.push(camera.report(p, u));
            gradient.push([
                [
                    uniform[0] + slope[0] * t,
                    shear + slope[0] * s + slope[2] * t,
                ],
                [shear - slope[0] * s, uniform[1] + slope[1] * t],
            ]);
        }
        Ok(CameraField {
            displacement,
            loaded,
            gradient,
        })
    }
}

impl Places for MockExperiment {
    fn window(&self) -> [[f64; 2]; 2] {
        self.window
    }

    fn support(&self) -> &PointSet {
        &self.support
    }

    /// The quadratic through the values at the support, by least squares.
    fn spread(&self, at_support: &[[f64; 2]], sight: &PointSet) -> Vec<[f64; 2]> {
        let mut gram = SMatrix::<f64, 6, 6>::zeros();
        let mut right = SMatrix::<f64, 6, 2>::zeros();
        for (&p, u) in self.support.points().iter().zip(at_support) {
            let row = quadratic(p);
            gram += row * row.transpose();
            right += row * SMatrix::<f64, 1, 2>::from_row_slice(u);
        }
        let Some(factor) = gram.cholesky() else {
            return vec![[0.0; 2]; sight.all().len()];
        };
        let fit = factor.solve(&right);
        let value = |&p: &[f64; 2]| {
            let u = fit.tr_mul(&quadratic(p));
            [u[0], u[1]]
        };
        sight.all().iter().map(value).collect()
    }

    fn locate(&self, points: &[[f64; 2]], further: &[[f64; 2]]) -> (PointSet, Vec<bool>) {
        (
            PointSet::anywhere(points, further),
            vec![true; points.len()],
        )
    }
}

impl Spanning for MockExperiment {
    fn mesh_size(&self) -> [usize; 2] {
        [0, 0]
    }
}

/// All monomials to degree 2.
fn quadratic([s, t]: [f64; 2]) -> SVector<f64, 6> {
    SVector::from([1.0, s, t, s * s, s * t, t * t])
}
