//! A plate that yields, loaded in increments. The plastic strains act as an initial stress of the elastic plate, whose factorised stiffness
//! serves every iteration of every increment.

use nalgebra::Vector3;

use super::anderson::Anderson;
use super::initial_stress::{Gauss, forces_of, strains};
use super::plasticity::{J2, Plastic, von_mises};
use super::solve::Factor;
use crate::error::{Error, Result};
use crate::geometry::Mesh;

/// An increment ends when an iteration changes no displacement by more than this share of the largest elastic one.
const TOLERANCE: f64 = 1e-10;

/// Most iterations of an increment.
const MOST: usize = 600;

/// Largest increment of the load over the load at which the first Gauss point yields. A quarter of it changes the plastic part by less than
/// 0.1 % (`tests/physics/yielding.rs`): under a load that only grows the stresses hardly turn.
const INCREMENT: f64 = 0.2;

/// An isotropic plate and its elastic answer to a load.
pub struct Body<'a> {
    pub law: J2,
    pub mesh: &'a Mesh,
    pub gauss: &'a [Gauss],
    /// Thickness at the Gauss points, mm.
    pub thickness: Vec<f64>,
    /// Displacements under the load without yielding, mm.
    pub elastic: Vec<f64>,
}

/// A plate under its load times a factor, in equilibrium.
#[derive(Debug, Clone)]
pub struct YieldingPlate {
    pub factor: f64,
    /// Nodal displacements beyond the factor times the elastic ones, mm.
    pub plastic_part: Vec<f64>,
    /// Plastic flow at the Gauss points.
    pub flow: Vec<Plastic>,
}

/// A plate on its way through a history of load factors.
pub struct Walk<'a, 'f> {
    body: &'a Body<'a>,
    factor: &'a mut Factor<'f>,
    /// Strains under the load without yielding.
    elastic: Vec<Vector3<f64>>,
    /// Load factor at which the first Gauss point yields.
    pub onset: f64,
    increment: f64,
    tolerance: f64,
    at: YieldingPlate,
    /// The equilibrium before.
    before: Option<(f64, Vec<f64>)>,
}

impl<'a, 'f> Walk<'a, 'f> {
    /// From the unloaded virgin plate; `factor` holds its elastic stiffness. Increments are `finer` times smaller than usual.
    pub fn new(body: &'a Body<'a>, factor: &'a mut Factor<'f>, finer: f64) -> Self {
        let elastic = strains(body.mesh, body.gauss, &body.elastic);
        let stress = |e: &Vector3<f64>| von_mises(&body.law.stress(e));
        let largest = elastic.iter().map(stress).fold(0.0, f64::max);
        let onset = body.law.yield_stress / largest;
        Self {
            at: YieldingPlate {
                factor: 0.0,
                plastic_part: vec![0.0; body.mesh.unknowns()],
                flow: vec![Plastic::default(); body.gauss.len()],
            },
            before: None,
            increment: INCREMENT * onset / finer,
            tolerance: TOLERANCE,
            onset,
            elastic,
            body,
            factor,
        }
    }

    /// The same, ending increments at a change of this share of the largest elastic displacement.
    pub fn within(self, tolerance: f64) -> Self {
        Self { tolerance, ..self }
    }

    /// Load or unload to a factor. What yields again on the way down is found as well: every increment follows the flow rule.
    ///
    /// # Errors
    /// An increment that does not come to rest.
    pub fn to(&mut self, target: f64) -> Result<&YieldingPlate> {
        let virgin = self.at.flow.iter().all(|p| p.equivalent == 0.0);
        let mut from = self.at.factor;
        if virgin && from.abs() < self.onset {
            // elastic up to there
            from = target.clamp(-self.onset, self.onset);
        }
        let count = ((target - from).abs() / self.increment).ceil().max(1.0);
        for k in 1..=count as usize {
            self.settle(from + (target - from) * k as f64 / count)?;
        }
        Ok(&self.at)
    }

    /// One increment.
    fn settle(&mut self, factor: f64) -> Result<()> {
        let size = self
            .body
            .elastic
            .iter()
            .fold(0.0_f64, |m, u| m.max(u.abs()))
            * factor.abs().max(self.at.factor.abs());
        let mut guess = self.predictor(factor);
        let mut acceleration = Anderson::default();
        for _ in 0..MOST {
            let (image, flow) = self.image(factor, &guess);
            let pairs = image.iter().zip(&guess);
            let change = pairs.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            if change <= self.tolerance * size {
                let now = YieldingPlate {
                    factor,
                    plastic_part: image,
                    flow,
                };
                let before = std::mem::replace(&mut self.at, now);
                self.before = Some((before.factor, before.plastic_part));
                return Ok(());
            }
            guess = acceleration.next(&guess, image);
        }
        let law = self.body.law;
        Err(
            Error::input("yielding metal", "a plate that comes to rest under its load")
                .found(format!(
                    "yield stress {:.4} and hardening {:.4} of Young's modulus, {:.2} times the load at which yielding begins",
                    law.yield_stress / law.young,
                    law.hardening / law.young,
                    factor / self.onset
                ))
                .hint("make the load smaller, or the yield stress or the hardening larger: the plate all but flows"),
        )
    }

    /// The plastic part at a factor as it went on from the equilibrium before.
    fn predictor(&self, factor: f64) -> Vec<f64> {
        let now = &self.at.plastic_part;
        let ahead = |before: &f64| (factor - self.at.factor) / (self.at.factor - before);
        match &self.before {
            Some((before, part)) if ahead(before) > 0.0 && ahead(before).is_finite() => {
                let share = ahead(before);
                let pairs = now.iter().zip(part);
                pairs.map(|(a, b)| a + share * (a - b)).collect()
            }
            _ => now.clone(),
        }
    }

    /// What the plastic strains under a guess of the plastic part make of it, and the flow.
    fn image(&mut self, factor: f64, guess: &[f64]) -> (Vec<f64>, Vec<Plastic>) {
        let body = self.body;
        let own = strains(body.mesh, body.gauss, guess);
        let strain = self
            .elastic
            .iter()
            .zip(own)
            .map(|(e, own)| e * factor + own);
        let advance = |(before, strain)| body.law.advance(before, &strain);
        let flow: Vec<Plastic> = self.at.flow.iter().zip(strain).map(advance).collect();
        let mut image = body.forces(&flow, &body.law);
        self.factor.solve(&mut image);
        (image, flow)
    }
}

impl Body<'_> {
    /// Nodal forces of the initial stress that plastic strains are, for elastic constants `law`, N.
    pub fn forces(&self, flow: &[Plastic], law: &J2) -> Vec<f64> {
        let points = flow.iter().zip(&self.thickness);
        let resultants: Vec<Vector3<f64>> =
            points.map(|(p, h)| law.stress(&p.strain) * *h).collect();
        forces_of(self.mesh, self.gauss, &resultants)
    }

    /// Stresses (s11, s22, s12) at the Gauss points, MPa.
    pub fn stresses(&self, loaded: &YieldingPlate) -> Vec<Vector3<f64>> {
        let pairs = self.elastic.iter().zip(&loaded.plastic_part);
        let nodal: Vec<f64> = pairs.map(|(e, p)| loaded.factor * e + p).collect();
        let strains = strains(self.mesh, self.gauss, &nodal);
        let points = strains.iter().zip(&loaded.flow);
        points
            .map(|(e, flow)| self.law.stress_at(e, flow))
            .collect()
    }
}
