//! Plies of opposite angles are off by opposite angles.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::fem::Setup;
use crate::laminate::Material;

pub struct BalancedMisorientation;

/// Sine of twice four degrees: plies nearer to an axis count as along it, whatever error their own angle has beside this one.
const ALONG: f64 = 0.139;

/// +1 and -1 for plies on either side of the loading axis, 0 for those along it or across.
fn side(angle: f64) -> f64 {
    let twice = (2.0 * angle).sin();
    if twice.abs() < ALONG {
        0.0
    } else {
        twice.signum()
    }
}

impl Effect for BalancedMisorientation {
    fn entry(&self) -> Entry {
        Entry {
            name: "balanced_misorientation",
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::new("angle_deg", 1.0, 30.0)] },
            about: "All plies on either side of the loading axis are off by this angle, away from the axis: [45, -45] is [46, -46]. The laminate stays balanced, so its field hardly shows it, and the constants change.",
            confirm: "Measure the fibres' angles to both sides of the loading axis on a piece that is sectioned or burnt off. Without that, quote the constants with the declared angles' sd.",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let by = amplitude[0].to_radians();
        let own = setup.regions.iter_mut().filter_map(|r| r.layup.as_mut());
        for angle in setup.angles.iter_mut().chain(own.flatten()) {
            *angle += by * side(*angle);
        }
    }

    fn is_manufacturing(&self) -> bool {
        true
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        if scene.material == Material::Isotropic {
            return Some("an isotropic plate has no ply angles");
        }
        let has = |wanted: f64| scene.setup.angles.iter().any(|a| side(*a) == wanted);
        (!(has(1.0) && has(-1.0))).then_some("the layup has no plies of opposite angles")
    }
}
