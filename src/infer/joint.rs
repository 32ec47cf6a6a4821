//! The posterior of several experiments on one material: their log likelihoods add, what they share has one prior.

use std::collections::BTreeSet;

use super::prior::Marginal;
use crate::error::{Error, Result};
use crate::sample::{DensityError, LogDensity};

/// What one experiment says of its parameters.
pub struct Member {
    /// The experiment's name, put before the name of a parameter of its own that another experiment has too.
    pub name: String,
    /// Log likelihood plus the log priors of the parameters that are its own: no prior of a shared one.
    pub density: Box<dyn LogDensity>,
    /// A point to start from, and the sd to start with.
    pub start: (Vec<f64>, Vec<f64>),
}

/// Log posterior over the shared parameters, in their order, and then each experiment's own.
pub struct Joint {
    names: Vec<String>,
    priors: Vec<Marginal>,
    members: Vec<Member>,
    /// `index[e][k]`: the joint parameter that parameter k of experiment e is.
    index: Vec<Vec<usize>>,
}

impl Joint {
    /// `shared` has the names and priors of what experiments with a parameter of that name have in common.
    ///
    /// # Errors
    /// Of the input: two experiments, or in the end two parameters, of one name; a shared parameter that no experiment has.
    pub fn new(shared: Vec<(String, Marginal)>, members: Vec<Member>) -> Result<Self> {
        let (mut names, priors): (Vec<String>, Vec<Marginal>) = shared.into_iter().unzip();
        let common = names.len();
        let mut used = vec![false; common];
        let mut index = Vec::new();
        for (e, member) in members.iter().enumerate() {
            let others = || members.iter().enumerate().filter(|(other, _)| *other != e);
            if others().any(|(_, other)| other.name == member.name) {
                return Err(Error::input("experiments", "a name of its own for each")
                    .found(format!("a second {}", member.name)));
            }
            let mut of_member = Vec::new();
            for name in member.density.names() {
                if let Some(k) = names[..common].iter().position(|n| n == name) {
                    used[k] = true;
                    of_member.push(k);
                    continue;
                }
                let collides = others().any(|(_, other)| other.density.names().contains(name));
                of_member.push(names.len());
                names.push(if collides {
                    format!("{}.{name}", member.name)
                } else {
                    name.clone()
                });
            }
            index.push(of_member);
        }
        if let Some(k) = used.iter().position(|used| !used) {
            return Err(Error::input(
                "experiments",
                "an experiment that depends on every shared parameter",
            )
            .found(format!("none with {}", names[k])));
        }
        let distinct: BTreeSet<&String> = names.iter().collect();
        if distinct.len() < names.len() {
            return Err(
                Error::input("experiments", "names that keep their parameters apart")
                    .found(names.join(", ")),
            );
        }
        Ok(Self {
            names,
            priors,
            members,
            index,
        })
    }

    /// Names of the parameters of experiment `e`, as it has them.
    pub fn names_of(&self, e: usize) -> &[String] {
        self.members[e].density.names()
    }

    /// The parameters of experiment `e` at a point.
    pub fn own(&self, e: usize, x: &[f64]) -> Vec<f64> {
        self.index[e].iter().map(|&k| x[k]).collect()
    }

    /// A point to start from and the sd to start with. What is shared starts where the first experiment has it, with the
    /// smallest of their sds.
    pub fn start(&self) -> (Vec<f64>, Vec<f64>) {
        let mut centre = vec![f64::NAN; self.dim()];
        let mut sd = vec![f64::INFINITY; self.dim()];
        for (member, index) in self.members.iter().zip(&self.index) {
            let (at, spread) = &member.start;
            for ((&k, &x), &s) in index.iter().zip(at).zip(spread) {
                if centre[k].is_nan() {
                    centre[k] = x;
                }
                sd[k] = sd[k].min(s);
            }
        }
        (centre, sd)
    }
}

impl LogDensity for Joint {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> std::result::Result<f64, DensityError> {
        let mut value = [0.0];
        self.values(x, &mut value)?;
        DensityError::sort(value[0])
    }

    fn values(&self, xs: &[f64], out: &mut [f64]) -> Result<()> {
        let count = out.len();
        let column = |k: usize| &xs[k * count..(k + 1) * count];
        out.fill(0.0);
        for (k, prior) in self.priors.iter().enumerate() {
            for (sum, &x) in out.iter_mut().zip(column(k)) {
                *sum += prior.log_density(x);
            }
        }
        let mut values = vec![0.0; count];
        let mut own = Vec::with_capacity(xs.len());
        for (member, index) in self.members.iter().zip(&self.index) {
            own.clear();
            index.iter().for_each(|&k| own.extend_from_slice(column(k)));
            member.density.values(&own, &mut values)?;
            for (sum, &value) in out.iter_mut().zip(&values) {
                // What one of them excludes is excluded, whatever the others say of it.
                let excluded = *sum == f64::NEG_INFINITY || value == f64::NEG_INFINITY;
                *sum = if excluded {
                    f64::NEG_INFINITY
                } else {
                    *sum + value
                };
            }
        }
        Ok(())
    }
}
