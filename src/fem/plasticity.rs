//! Metal plasticity at a point: the von Mises yield condition (J2) with its associated flow rule in plane stress and linear isotropic
//! hardening, integrated by the backward Euler method (Simo and Taylor, Int. J. Numer. Methods Eng. 22 (1986) 649).

use nalgebra::Vector3;

/// A metal: stresses in MPa. Strains are (e11, e22, gamma12), stresses (s11, s22, s12).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct J2 {
    pub young: f64,
    pub poisson: f64,
    /// Yield stress of the virgin material.
    pub yield_stress: f64,
    /// Growth of the yield stress with the equivalent plastic strain.
    pub hardening: f64,
}

/// What is left at a point of the plastic flow so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct Plastic {
    /// Plastic strain (e11, e22, gamma12).
    pub strain: Vector3<f64>,
    /// Equivalent plastic strain: its growth is that of the plastic strain in simple tension.
    pub equivalent: f64,
}

/// Von Mises stress in plane stress, MPa.
pub fn von_mises(s: &Vector3<f64>) -> f64 {
    (s.x * s.x - s.x * s.y + s.y * s.y + 3.0 * s.z * s.z).sqrt()
}

/// Newton's steps end when the stress lies this share of itself above the yield surface. From the elastic side the convex function falls to
/// its root without passing it.
const ON_SURFACE: f64 = 1e-14;

/// Most of Newton's steps; four to six are taken.
const MOST: usize = 60;

impl J2 {
    /// Stress of an elastic strain, MPa.
    pub fn stress(&self, elastic: &Vector3<f64>) -> Vector3<f64> {
        let q = self.young / (1.0 - self.poisson * self.poisson);
        Vector3::new(
            q * (elastic.x + self.poisson * elastic.y),
            q * (elastic.y + self.poisson * elastic.x),
            0.5 * self.young / (1.0 + self.poisson) * elastic.z,
        )
    }

    /// Stress at a strain with a plastic part, MPa.
    pub fn stress_at(&self, strain: &Vector3<f64>, plastic: &Plastic) -> Vector3<f64> {
        self.stress(&(strain - plastic.strain))
    }

    /// The plastic flow up to a strain, reached from a state `before` in one step.
    ///
    /// With the flow dep = g P s, P s = ((2 s11 - s22) / 3, (2 s22 - s11) / 3, 2 s12), the pairs s11 + s22 and (s11 - s22, s12) of the trial
    /// stress shrink by 1 + g E / (3 (1 - nu)) and 1 + 2 G g; g follows from the yield condition.
    pub fn advance(&self, before: &Plastic, strain: &Vector3<f64>) -> Plastic {
        let trial = self.stress_at(strain, before);
        let flow = self.yield_stress + self.hardening * before.equivalent;
        if von_mises(&trial) <= flow {
            return *before;
        }
        let sum = trial.x + trial.y;
        let difference = trial.x - trial.y;
        let shrink = [
            self.young / (3.0 * (1.0 - self.poisson)),
            self.young / (1.0 + self.poisson),
        ];
        // parts of the squared von Mises stress
        let parts = [
            0.25 * sum * sum,
            0.75 * difference * difference + 3.0 * trial.z * trial.z,
        ];
        let hardens = self.hardening * 2.0 / 3.0;
        let mut g = 0.0;
        for _ in 0..MOST {
            let [a, b] = shrink.map(|rate| 1.0 + rate * g);
            let [x, y] = [parts[0] / (a * a), parts[1] / (b * b)];
            let stress = (x + y).sqrt();
            let above = stress * (1.0 - hardens * g) - flow;
            if above <= ON_SURFACE * flow {
                break;
            }
            let falls = -(x * shrink[0] / a + y * shrink[1] / b) / stress;
            g -= above / (falls * (1.0 - hardens * g) - hardens * stress);
        }
        let sum = sum / (1.0 + shrink[0] * g);
        let [difference, shear] = [difference, trial.z].map(|s| s / (1.0 + shrink[1] * g));
        let stress = Vector3::new(0.5 * (sum + difference), 0.5 * (sum - difference), shear);
        let direction = Vector3::new(
            (2.0 * stress.x - stress.y) / 3.0,
            (2.0 * stress.y - stress.x) / 3.0,
            2.0 * stress.z,
        );
        Plastic {
            strain: before.strain + direction * g,
            equivalent: before.equivalent + g * von_mises(&stress) * 2.0 / 3.0,
        }
    }
}
