//! The metal yields where the stress is highest.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::fem::{Setup, Yield};
use crate::laminate::{Material, MeanSd};

pub struct Yielding;

/// Place of the parameter that says how far the yield stress is from the declared one.
const YIELD_STRESS: usize = 1;

/// Growth of the yield stress with the plastic strain over Young's modulus, nominally: the slope of EN 1993-1-5, C.6, for finite elements of
/// structural steel with linear strain hardening, E / 100.
const HARDENING: f64 = 0.01;

impl Effect for Yielding {
    fn entry(&self) -> Entry {
        Entry {
            name: "yielding",
            kind: Kind::Mechanical,
            parameters: const {
                &[
                    EffectParameter::positive("amplitude", 1.0, 3.0),
                    EffectParameter::new("yield_percent", 30.0, 90.0),
                    EffectParameter::new("hardening_percent", 70.0, 210.0),
                ]
            },
            about: "The metal yields (von Mises, linear isotropic hardening) where the stress exceeds material.yield_MPa. The amplitude is the share of the plastic part: 1 is all of it. yield_percent is 100 times the change of ln sigma_y from the declared yield stress. hardening_percent is 100 times the change of ln H from H = E / 100.",
            confirm: "Take a picture after unloading: what has yielded stays. Or repeat on a new specimen at half the load, where little or nothing yields. A tension test of the sheet gives yield stress and hardening.",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let Some(declared) = setup.yield_stress.filter(|_| amplitude[0] != 0.0) else {
            return;
        };
        setup.yielding = Some(Yield {
            share: amplitude[0],
            stress: declared * (0.01 * amplitude[YIELD_STRESS]).exp(),
            hardening: HARDENING * (0.01 * amplitude[2]).exp(),
        });
    }

    fn yields(&self) -> bool {
        true
    }

    fn prior_sd_by_yield_stress(&self, k: usize, declared: MeanSd) -> Option<f64> {
        (k == YIELD_STRESS && declared.sd > 0.0).then(|| 100.0 * declared.sd / declared.mean)
    }

    /// The stress at which a metal yields does not scale with its moduli.
    fn scales(&self) -> bool {
        false
    }

    fn remains(&self) -> bool {
        true
    }

    fn inadmissible(&self, amplitude: &[f64]) -> Option<&'static str> {
        (amplitude[0] < 0.0).then_some("an amplitude of at least 0")
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        if scene.material != Material::Isotropic {
            return Some("a laminate does not yield as a metal does");
        }
        if !scene.setup.regions.is_empty() {
            return Some(
                "regions of the mesh have a thickness of their own (mesh.regions): yielding is tabulated for one thickness",
            );
        }
        let known = scene.setup.yield_stress.is_some();
        (!known).then_some("the yield stress is not known: material.yield_MPa is not given")
    }
}
