//! The posterior of several experiments on one material: their log likelihoods add, what they share has one prior. The same field as front and
//! back of a coupon, each with a thickness and a force of its own, left E1 +- 0.80 GPa where these two alone leave 1.14.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector};

use super::prior::Marginal;
use crate::error::{Error, Result};
use crate::sample::{DensityError, LogDensity};

/// Means and covariance of linear parameters of unit normal priors at a point of an experiment's parameters, given its data.
pub type GivenLinear = Box<dyn Fn(&[f64]) -> (DVector<f64>, DMatrix<f64>) + Send + Sync>;

/// What one experiment says of its parameters.
pub struct Member {
    /// The experiment's name, put before the name of a parameter of its own that another experiment has too.
    pub name: String,
    /// Log likelihood plus the log priors of the parameters that are its own: no prior of a shared one.
    pub density: Box<dyn LogDensity>,
    /// A point to start from, and the sd to start with.
    pub start: (Vec<f64>, Vec<f64>),
    owned: Option<OwnedLinear>,
}

/// Linear parameters that a density has integrated out and other experiments may share: a specimen's thickness, the scale of a load cell.
struct OwnedLinear {
    owners: Vec<String>,
    given: GivenLinear,
}

impl Member {
    /// One that shares nothing but constants.
    pub fn new(name: &str, density: Box<dyn LogDensity>, start: (Vec<f64>, Vec<f64>)) -> Self {
        Self {
            name: name.into(),
            density,
            start,
            owned: None,
        }
    }

    /// The same with linear parameters of some owners.
    #[must_use]
    pub fn owning(self, owners: Vec<String>, given: GivenLinear) -> Self {
        Self {
            owned: Some(OwnedLinear { owners, given }),
            ..self
        }
    }

    fn owners(&self) -> &[String] {
        self.owned.as_ref().map_or(&[], |o| &o.owners)
    }
}

/// Log posterior over the shared parameters, in their order, and then each experiment's own.
pub struct Joint {
    names: Vec<String>,
    priors: Vec<Marginal>,
    members: Vec<Member>,
    /// `index[e][k]`: the joint parameter that parameter k of experiment e is.
    index: Vec<Vec<usize>>,
    /// Owners that several members have.
    shared: Vec<String>,
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
        let all: Vec<&String> = members.iter().flat_map(Member::owners).collect();
        let count = |owner: &String| all.iter().filter(|o| **o == owner).count();
        let mut shared: Vec<String> = all.iter().map(|o| (*o).clone()).collect();
        shared.retain(|o| count(o) > 1);
        shared.sort();
        shared.dedup();
        Ok(Self {
            names,
            priors,
            members,
            index,
            shared,
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

    /// What it changes at a point that some linear parameters are one and the same in several members: each has integrated them out for itself.
    /// With P = I + sum (C_e^-1 - I) and b = sum C_e^-1 m_e of what each says of them, m_e and C_e, the integral over one set of them is that of
    /// a normal density.
    fn shared_once(&self, x: &[f64]) -> f64 {
        let n = self.shared.len();
        let mut precision = DMatrix::identity(n, n);
        let mut right = DVector::zeros(n);
        let mut log = 0.0;
        for (e, member) in self.members.iter().enumerate() {
            let Some(OwnedLinear { owners, given }) = &member.owned else {
                continue;
            };
            let places = owners
                .iter()
                .map(|o| self.shared.iter().position(|s| s == o));
            let places: Vec<Option<usize>> = places.collect();
            let own: Vec<usize> = (0..places.len()).filter(|&k| places[k].is_some()).collect();
            if own.is_empty() {
                continue;
            }
            let (mean, covariance) = given(&self.own(e, x));
            let mean = mean.select_rows(&own);
            let Some(factor) = covariance.select_rows(&own).select_columns(&own).cholesky() else {
                return f64::NEG_INFINITY;
            };
            let towards = factor.solve(&mean);
            let inverse = factor.inverse();
            log -= 0.5 * mean.dot(&towards) + factor.l_dirty().diagonal().map(f64::ln).sum();
            for (i, &a) in own.iter().enumerate() {
                let Some(p) = places[a] else { continue };
                right[p] += towards[i];
                precision[(p, p)] -= 1.0;
                for (j, &b) in own.iter().enumerate() {
                    precision[(p, places[b].unwrap_or(p))] += inverse[(i, j)];
                }
            }
        }
        let Some(factor) = precision.cholesky() else {
            return f64::NEG_INFINITY;
        };
        let square = right.dot(&factor.solve(&right));
        log + 0.5 * square - factor.l_dirty().diagonal().map(f64::ln).sum()
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
        for (i, sum) in out.iter_mut().enumerate() {
            if !self.shared.is_empty() && sum.is_finite() {
                let x: Vec<f64> = (0..self.names.len()).map(|k| column(k)[i]).collect();
                *sum += self.shared_once(&x);
            }
        }
        Ok(())
    }
}
