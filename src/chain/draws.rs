//! The draws of a run, with axes chain, draw, parameter: a chain is one walker (or one adaptive chain), so that
//! autocorrelation is never computed across interleaved walkers.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Proposals and acceptances of one move over a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MoveTally {
    /// Name of the move (`stretch`, `de`, ...).
    pub name: String,
    /// Number of proposals.
    pub proposed: u64,
    /// Number of accepted proposals.
    pub accepted: u64,
}

/// What is worth knowing of how draws came about; no later step needs it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Info {
    /// Steps from one stored draw to the next.
    pub thin: usize,
    /// Steps of warm-up, not stored.
    pub warmup: usize,
    /// Acceptance rate of each chain after warm-up, in [0, 1]; empty if unknown.
    pub acceptance: Vec<f64>,
    /// Tally of each move after warm-up.
    pub moves: Vec<MoveTally>,
    /// Evaluations that gave NaN or +inf, counted as outside the support.
    pub nan: u64,
    /// Evaluations of the log density after warm-up.
    pub evaluations: u64,
    /// Columns that are not parameters (`stepsize__`), each of length chains x draws, chain by chain.
    pub columns: Vec<(String, Vec<f64>)>,
    /// What was done to the draws of a file while it was read, in words.
    pub remarks: Vec<String>,
}

/// One scalar over a run, chain by chain.
#[derive(Debug, Clone)]
pub struct ScalarDraws {
    /// Values, chain by chain: `values[chain * draws + draw]`.
    pub values: Vec<f64>,
    /// Number of draws of each chain.
    pub draws: usize,
    /// Ensemble of each chain; chains of one ensemble depend on each other.
    pub ensemble: Vec<usize>,
}

impl ScalarDraws {
    /// Chains that are their own ensembles: `values[chain * draws + draw]`.
    pub fn of_chains(values: Vec<f64>, draws: usize) -> Self {
        let chains = values.len().checked_div(draws).unwrap_or(0);
        Self {
            values,
            draws,
            ensemble: (0..chains).collect(),
        }
    }

    pub fn chains(&self) -> usize {
        self.ensemble.len()
    }

    /// The values of one chain in time order.
    pub fn chain(&self, chain: usize) -> &[f64] {
        &self.values[chain * self.draws..(chain + 1) * self.draws]
    }

    /// The chains of each ensemble, in order of first appearance.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        groups(&self.ensemble)
    }

    /// The same series cut to its first `draws` draws.
    pub fn first(&self, draws: usize) -> Self {
        let draws = draws.min(self.draws);
        let values = (0..self.chains())
            .flat_map(|c| self.chain(c)[..draws].iter().copied())
            .collect();
        Self {
            values,
            draws,
            ensemble: self.ensemble.clone(),
        }
    }
}

pub(super) fn groups(ensemble: &[usize]) -> Vec<Vec<usize>> {
    let mut ids: Vec<usize> = Vec::new();
    let mut members: Vec<Vec<usize>> = Vec::new();
    for (chain, &id) in ensemble.iter().enumerate() {
        match ids.iter().position(|&known| known == id) {
            Some(place) => members[place].push(chain),
            None => {
                ids.push(id);
                members.push(vec![chain]);
            }
        }
    }
    members
}

/// Chains that can be had one at a time, from memory or from a store.
pub trait Chains {
    /// Names of the parameters.
    fn names(&self) -> &[String];

    /// Number of chains.
    fn count(&self) -> usize;

    /// The chains of each ensemble.
    fn groups(&self) -> Vec<Vec<usize>>;

    /// One chain over all its draws.
    ///
    /// # Errors
    /// The input's fault if a store is damaged.
    fn chain(&self, chain: usize) -> Result<Draws>;
}

impl Chains for Draws {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn count(&self) -> usize {
        self.chains()
    }

    fn groups(&self) -> Vec<Vec<usize>> {
        groups(&self.ensemble)
    }

    fn chain(&self, chain: usize) -> Result<Draws> {
        let rows = chain * self.draws..(chain + 1) * self.draws;
        let values = self.values[rows.start * self.dim()..rows.end * self.dim()].to_vec();
        let lp = self.lp[rows].to_vec();
        Self::new(self.names.clone(), vec![self.ensemble[chain]], values, lp)
    }
}

/// Draws of a run: values `[chain][draw][parameter]` and the log density `[chain][draw]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Draws {
    names: Vec<String>,
    ensemble: Vec<usize>,
    draws: usize,
    values: Vec<f64>,
    lp: Vec<f64>,
    /// How the draws came about.
    pub info: Info,
}

impl Draws {
    /// Draws from their parts: `names` of the parameters, `ensemble` of each chain, `values` of shape chain x draw x
    /// parameter and `lp` of shape chain x draw, both contiguous.
    ///
    /// # Errors
    /// The program's fault if the shapes disagree.
    pub fn new(
        names: Vec<String>,
        ensemble: Vec<usize>,
        values: Vec<f64>,
        lp: Vec<f64>,
    ) -> Result<Self> {
        let chains = ensemble.len();
        let draws = lp.len().checked_div(chains).unwrap_or(0);
        if lp.len() != chains * draws || values.len() != lp.len() * names.len() {
            return Err(Error::program(
                "draws",
                format!(
                    "{chains} chains x draws x {} parameters and as many log densities",
                    names.len()
                ),
            )
            .found(format!("{} values, {} lp", values.len(), lp.len())));
        }
        Ok(Self {
            names,
            ensemble,
            draws,
            values,
            lp,
            info: Info {
                thin: 1,
                ..Info::default()
            },
        })
    }

    /// The values and the log densities alone.
    pub(crate) fn into_arrays(self) -> (Vec<f64>, Vec<f64>) {
        (self.values, self.lp)
    }

    /// Names of the parameters, with their units.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Number of parameters.
    pub fn dim(&self) -> usize {
        self.names.len()
    }

    /// Number of chains (walkers of all ensembles).
    pub fn chains(&self) -> usize {
        self.ensemble.len()
    }

    /// Number of stored draws of each chain.
    pub fn draws(&self) -> usize {
        self.draws
    }

    /// Stored draws of all chains together.
    pub fn len(&self) -> usize {
        self.lp.len()
    }

    /// Whether nothing is stored.
    pub fn is_empty(&self) -> bool {
        self.lp.is_empty()
    }

    /// Ensemble of each chain.
    pub fn ensemble(&self) -> &[usize] {
        &self.ensemble
    }

    /// Number of independent ensembles.
    pub fn ensembles(&self) -> usize {
        groups(&self.ensemble).len()
    }

    /// All values, shape chain x draw x parameter.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Log density of each draw, shape chain x draw.
    pub fn lp(&self) -> &[f64] {
        &self.lp
    }

    /// The parameters of one draw.
    pub fn point(&self, chain: usize, draw: usize) -> &[f64] {
        let at = (chain * self.draws + draw) * self.dim();
        &self.values[at..at + self.dim()]
    }

    /// Every draw as a point, chain by chain.
    pub fn points(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks_exact(self.dim().max(1))
    }

    /// Refuses chains that are copies of others: they are not independent. `name` names them.
    ///
    /// # Errors
    /// The input's fault, with the names of both.
    pub fn refuse_copies(&self, name: &dyn Fn(usize) -> String) -> Result<()> {
        let size = self.draws * self.dim();
        let chain = |c: usize| &self.values[c * size..(c + 1) * size];
        let mut pairs = (0..self.chains()).flat_map(|b| (0..b).map(move |a| (a, b)));
        match pairs.find(|(a, b)| chain(*a) == chain(*b)) {
            Some((first, again)) if self.draws > 1 => Err(Error::input(name(again), "draws of its own")
                .found(format!("the draws of {}", name(first)))
                .hint("copies are not independent chains: give one of them (did all tasks of an array have one seed?)")),
            _ => Ok(()),
        }
    }

    /// One parameter over the run.
    pub fn series(&self, parameter: usize) -> ScalarDraws {
        self.map(|point| point[parameter])
    }

    /// A scalar function of the parameters over the run.
    pub fn map(&self, f: impl Fn(&[f64]) -> f64) -> ScalarDraws {
        ScalarDraws {
            values: self.points().map(f).collect(),
            draws: self.draws,
            ensemble: self.ensemble.clone(),
        }
    }

    /// The draws of each chain after the first `count`.
    ///
    /// # Errors
    /// The input's fault if none are left.
    pub fn after(&self, count: usize) -> Result<Self> {
        if count >= self.draws {
            let expected = format!("fewer than the {} draws of a chain", self.draws);
            return Err(Error::input("--burn-in", expected).found(count));
        }
        let late = |values: &[f64], width: usize| -> Vec<f64> {
            let chains = values.chunks((width * self.draws).max(1));
            let late = chains.flat_map(|chain| &chain[width * count..]);
            late.copied().collect()
        };
        let cut = |(name, values): &(String, Vec<f64>)| (name.clone(), late(values, 1));
        Ok(Self {
            draws: self.draws - count,
            values: late(&self.values, self.dim()),
            lp: late(&self.lp, 1),
            info: Info {
                columns: self.info.columns.iter().map(cut).collect(),
                ..self.info.clone()
            },
            ..self.clone()
        })
    }

    /// The last of every `stride` draws of each chain.
    ///
    /// # Errors
    /// Those of [`Draws::new`].
    pub fn every(&self, stride: usize) -> Result<Self> {
        let stride = stride.clamp(1, self.draws.max(1));
        let kept = || (0..self.draws / stride).map(move |k| (k + 1) * stride - 1);
        let (mut values, mut lp) = (Vec::new(), Vec::new());
        for chain in 0..self.chains() {
            for draw in kept() {
                values.extend_from_slice(self.point(chain, draw));
                lp.push(self.lp[chain * self.draws + draw]);
            }
        }
        let mut thinned = Self::new(self.names.clone(), self.ensemble.clone(), values, lp)?;
        thinned.info = Info {
            thin: self.info.thin * stride,
            columns: Vec::new(),
            ..self.info.clone()
        };
        Ok(thinned)
    }

    /// The index of the parameter called `name`.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }

    /// Declares that every `walkers` consecutive chains are one ensemble (a CSV file does not say it).
    ///
    /// # Errors
    /// The input's fault if the number of chains is no multiple of `walkers`.
    pub fn with_walkers(mut self, walkers: usize) -> Result<Self> {
        if walkers == 0 || !self.chains().is_multiple_of(walkers) {
            return Err(Error::input(
                "walkers",
                format!("a divisor of the {} chains", self.chains()),
            )
            .found(walkers));
        }
        self.ensemble = (0..self.chains()).map(|chain| chain / walkers).collect();
        Ok(self)
    }

    /// The draws of some variables alone.
    ///
    /// # Errors
    /// The input's fault: a variable that there is not.
    pub fn only(&self, names: &[String]) -> Result<Self> {
        let unknown = |name: &String| Error::input("variables", self.names.join(", ")).found(name);
        let at = |name: &String| self.index(name).ok_or_else(|| unknown(name));
        let places = names.iter().map(at).collect::<Result<Vec<usize>>>()?;
        let values = self.points().flat_map(|x| places.iter().map(|k| x[*k]));
        Ok(Self {
            names: names.to_vec(),
            values: values.collect(),
            ..self.clone()
        })
    }
}
