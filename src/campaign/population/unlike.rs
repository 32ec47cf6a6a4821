//! Specimens unlike the others, by the intervals that the specimens have themselves.

use crate::quantity::chance;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::specimen::Specimen;

/// Fewer others have no spread to speak of.
const LEAST_OTHERS: usize = 3;

/// Probability that in a population of one kind some specimen is called unlike the others.
const RARE: f64 = 0.05;

/// A specimen that is unlike the others.
#[derive(Debug, PartialEq)]
pub struct Unlike {
    pub specimen: String,
    pub constant: String,
    /// Mean and sd of its constant, and of the others' mean.
    pub own: [f64; 2],
    pub others: [f64; 2],
    /// Probability that one of the others' kind lies as far off.
    pub p: f64,
}

impl Unlike {
    /// What it says, in a sentence.
    pub fn words(&self) -> String {
        let Self {
            specimen,
            constant,
            own,
            others,
            p,
        } = self;
        format!(
            "{specimen} is unlike the others: its {constant} is {:.4} +- {:.2}, theirs {:.4} +- {:.2} ({})",
            own[0],
            own[1],
            others[0],
            others[1],
            chance(*p)
        )
    }
}

/// The specimens that are unlike all others, each with the constant in which it is most.
pub fn unlike(specimens: &[Specimen]) -> Vec<Unlike> {
    let of = |k: usize| {
        let constants = specimens[k].constants.len();
        let all = (0..constants).filter_map(|c| apart(specimens, k, c));
        let most = all.min_by(|a, b| a.p.total_cmp(&b.p))?;
        let tried = constants * specimens.len();
        (most.p < RARE / tried as f64).then_some(most)
    };
    (0..specimens.len()).filter_map(of).collect()
}

/// How far a constant of a specimen lies from the mean of the others, by Student's t: in units of their scatter or of the intervals that they
/// and the specimen have themselves, whichever is larger.
fn apart(specimens: &[Specimen], k: usize, constant: usize) -> Option<Unlike> {
    let value = |s: &Specimen| [s.mean[constant], s.covariance[(constant, constant)].sqrt()];
    let others = specimens.iter().enumerate().filter(|(i, _)| *i != k);
    let others: Vec<[f64; 2]> = others.map(|(_, s)| value(s)).collect();
    if others.len() < LEAST_OTHERS {
        return None;
    }
    let own = value(&specimens[k]);
    let n = others.len() as f64;
    let mean_of = |of: &dyn Fn(&[f64; 2]) -> f64| others.iter().map(of).sum::<f64>() / n;
    let middle = mean_of(&|v| v[0]);
    let scatter = mean_of(&|v| (v[0] - middle).powi(2)) * n / (n - 1.0);
    let open = mean_of(&|v| v[1].powi(2));
    let variance = scatter.max(open);
    let sd = (variance.max(own[1].powi(2)) + variance / n).sqrt();
    let tail = StudentsT::new(0.0, 1.0, n - 1.0).ok()?;
    let tail = tail.sf(((own[0] - middle) / sd).abs());
    Some(Unlike {
        specimen: specimens[k].name.clone(),
        constant: specimens[k].constants[constant].clone(),
        own,
        others: [middle, (variance / n).sqrt()],
        p: 2.0 * tail,
    })
    .filter(|found| found.p.is_finite())
}
