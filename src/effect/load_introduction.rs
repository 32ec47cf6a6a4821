//! The force enters through an edge otherwise than uniformly.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::fem::Setup;

/// On the `0`-th of the edges whose load introduction the measurement has to tell, counted from 0.
pub struct LoadIntroduction(pub usize);

/// The effects of the first and the second of these edges.
const NAMES: [&str; 2] = ["load_introduction_1", "load_introduction_2"];

impl Effect for LoadIntroduction {
    fn entry(&self) -> Entry {
        Entry {
            name: NAMES[self.0],
            kind: Kind::Mechanical,
            // a force that acts on half an edge has a second coefficient of 190 %, one at its middle 250 %
            parameters: const {
                &[
                    EffectParameter::new("along_p2_percent", 100.0, 1000.0),
                    EffectParameter::new("along_p3_percent", 100.0, 1000.0),
                    EffectParameter::new("along_p4_percent", 100.0, 1000.0),
                    EffectParameter::new("across_p1_percent", 50.0, 1000.0),
                    EffectParameter::new("across_p2_percent", 50.0, 1000.0),
                    EffectParameter::new("across_p3_percent", 50.0, 1000.0),
                ]
            },
            about: "The force is spread over the first or second edge that is declared \"measured\" as the field shows it. The amplitudes are Legendre polynomials of the place on the edge, in percent of the mean traction, along the force and across it. They have no resultant.",
            confirm: "Put pressure-sensitive film between grip and specimen, or bring the window nearer to the edge.",
        }
    }

    fn measured_edge(&self) -> Option<usize> {
        Some(self.0)
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let axial = setup.load.axial;
        let own = &mut setup.load.introduction[self.0];
        for (a, percent) in own.iter_mut().zip(amplitude) {
            *a += 0.01 * percent * axial;
        }
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        (scene.setup.geometry.introductions() <= self.0)
            .then_some("no loaded edge of a mesh is declared to be measured (mesh.load.spread)")
    }
}
