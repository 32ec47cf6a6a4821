//! What the replicates of a calibration come to: ranks of the true values, coverage and width of the intervals, right and wrong names.

use std::collections::BTreeMap;

use serde::Serialize;
use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF};

use super::calibration::{ActedEffect, LoopAccount, Recovered, Replicate};
use crate::files::Keyed;
use crate::parameter::{Parameter, ParameterKind};
use crate::trace::Status;

/// Levels of the central intervals of the draws whose coverage is counted.
pub const LEVELS: [f64; 3] = [0.5, 0.9, 0.95];

/// How one parameter fared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterCoverage {
    /// p-value of the Kolmogorov-Smirnov test of the shares of draws below the truth against uniformity.
    pub p_kolmogorov_smirnov: f64,
    /// p-value of the chi^2 test of the same shares over ten bins.
    pub p_chi2_of_ranks: f64,
    /// The shares in ten bins.
    pub ranks_in_ten_bins: [usize; 10],
    /// Truths inside the interval of each of [`LEVELS`].
    pub covered: [usize; 3],
    /// Mean and root mean square of (quoted mean - truth) / quoted sd.
    pub mean_z: f64,
    pub rms_z: f64,
    /// Mean quoted sd.
    pub mean_sd: f64,
}

impl ParameterCoverage {
    fn new(all: &[&Recovered]) -> Self {
        let below: Vec<f64> = all.iter().filter_map(|r| r.below).collect();
        let mut bins = [0; 10];
        for share in &below {
            bins[((10.0 * share) as usize).min(9)] += 1;
        }
        let inside = |level: f64| {
            let inside = below.iter().filter(|b| (*b - 0.5).abs() <= 0.5 * level);
            inside.count()
        };
        let n = all.len().max(1) as f64;
        let z = || all.iter().map(|r| (r.quoted.mean - r.truth) / r.quoted.sd);
        Self {
            p_chi2_of_ranks: chi_square(&bins),
            ranks_in_ten_bins: bins,
            covered: LEVELS.map(inside),
            mean_z: z().sum::<f64>() / n,
            rms_z: (z().map(|z| z * z).sum::<f64>() / n).sqrt(),
            mean_sd: all.iter().map(|r| r.quoted.sd).sum::<f64>() / n,
            p_kolmogorov_smirnov: kolmogorov(below),
        }
    }
}

/// How often something was so, of how many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct HowOften {
    pub found: usize,
    pub of: usize,
}

impl HowOften {
    fn new(all: impl IntoIterator<Item = bool>) -> Self {
        let (mut found, mut of) = (0, 0);
        for is_so in all {
            found += usize::from(is_so);
            of += 1;
        }
        Self { found, of }
    }

    pub fn share(self) -> f64 {
        self.found as f64 / self.of.max(1) as f64
    }

    /// The 95 % interval of the share (Wilson 1927, J. Am. Stat. Assoc. 22, 209).
    pub fn interval(self) -> [f64; 2] {
        const Z: f64 = 1.959_964;
        let (n, p) = (self.of.max(1) as f64, self.share());
        let middle = p + Z * Z / (2.0 * n);
        let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        [middle - half, middle + half].map(|x| (x / (1.0 + Z * Z / n)).clamp(0.0, 1.0))
    }
}

/// What replicates come to.
#[derive(Debug, Clone, Serialize)]
pub struct CalibrationSummary {
    pub replicates: usize,
    /// Those of which all chains converged.
    pub converged: usize,
    pub parameters: Keyed<ParameterCoverage>,
    /// For each of [`LEVELS`] the counts between which a calibrated posterior lies in 99 % of cases.
    pub bands_of_coverage: [[usize; 2]; 3],
    /// What was counted, by its key.
    #[serde(flatten)]
    pub counts: Keyed<HowOften>,
    /// F1 of the names: the harmonic mean of the share of right names and of the share of effects that are named, where "A or B" names both,
    /// and where only a name that stands alone counts.
    pub f1: f64,
    pub f1_alone: f64,
    /// Verdicts of the loop.
    pub status: BTreeMap<&'static str, usize>,
}

impl CalibrationSummary {
    pub fn new(all: &[Replicate]) -> Self {
        let mut parameters: Keyed<Vec<&Recovered>> = Keyed::new();
        for (name, recovered) in all.iter().flat_map(|r| &r.parameters) {
            parameters.entry(name.clone()).or_default().push(recovered);
        }
        let each = parameters.iter();
        let constants = each
            .clone()
            .filter(|(name, _)| Parameter::read(name).is(ParameterKind::Constant));
        let held = HowOften::new(constants.flat_map(|(_, all)| all.iter().map(|r| r.is_held())));
        let accounts: Vec<&LoopAccount> = all.iter().filter_map(|r| r.account.as_ref()).collect();
        let mut status = BTreeMap::new();
        for account in &accounts {
            *status.entry(account.status.words()).or_default() += 1;
        }
        let mut counts = names(&accounts);
        counts.insert("held".into(), held);
        let f1 = |right: &str, recalled: &str| harmonic(counts[right], counts[recalled]);
        Self {
            replicates: all.len(),
            converged: all.iter().filter(|r| r.converged).count(),
            bands_of_coverage: LEVELS.map(|level| band(all.len(), level)),
            f1: f1("right_groups", "recalled"),
            f1_alone: f1("right_alone", "recalled_alone"),
            parameters: each
                .map(|(name, all)| (name.clone(), ParameterCoverage::new(all)))
                .collect(),
            counts,
            status,
        }
    }
}

impl LoopAccount {
    fn acts(&self, name: &str) -> bool {
        self.acted.iter().any(|acted| acted.effect == name)
    }

    /// Whether an effect is named, alone or in a group.
    fn names(&self, effect: &str) -> bool {
        self.named.iter().flatten().any(|name| name == effect)
    }

    /// Names that stand alone.
    fn alone(&self) -> impl Iterator<Item = &String> {
        let alone = self.named.iter().filter(|group| group.len() == 1);
        alone.flatten()
    }

    /// Of each group that is named, whether a member acts.
    fn right(&self) -> impl Iterator<Item = bool> {
        let groups = self.named.iter();
        groups.map(|group| group.iter().any(|name| self.acts(name)))
    }

    /// Whether all that acts is named, and no group but those in which something acts.
    fn is_exact(&self) -> bool {
        self.acted.iter().all(|a| self.names(&a.effect)) && self.right().all(|right| right)
    }

    fn is_explained(&self) -> bool {
        self.status != Status::Unexplained
    }
}

/// Right and wrong names and verdicts, by their keys in files.
fn names(all: &[&LoopAccount]) -> Keyed<HowOften> {
    let all = || all.iter().copied();
    let nulls = || all().filter(|r| r.acted.is_empty());
    let acted = || all().filter(|r| !r.acted.is_empty());
    let effects = || all().flat_map(|r| r.acted.iter().map(move |a| (r, a)));
    let named = |(r, a): (&LoopAccount, &ActedEffect)| r.names(&a.effect);
    let named_alone =
        |(r, a): (&LoopAccount, &ActedEffect)| r.alone().any(|name| *name == a.effect);
    let shown = effects().filter(|(_, a)| a.shows);
    let alone = all().flat_map(|r| r.alone().map(|name| r.acts(name)));
    let is_wrong = |r: &LoopAccount| r.is_explained() && !r.right().all(|right| right);
    let counts = [
        (
            "named_in_nulls",
            HowOften::new(nulls().map(|r| !r.named.is_empty())),
        ),
        (
            "unexplained_nulls",
            HowOften::new(nulls().map(|r| !r.is_explained())),
        ),
        ("exact", HowOften::new(acted().map(LoopAccount::is_exact))),
        ("recalled", HowOften::new(effects().map(named))),
        ("recalled_of_shown", HowOften::new(shown.map(named))),
        ("recalled_alone", HowOften::new(effects().map(named_alone))),
        (
            "right_groups",
            HowOften::new(all().flat_map(LoopAccount::right)),
        ),
        ("right_alone", HowOften::new(alone)),
        ("sure_and_wrong", HowOften::new(all().map(is_wrong))),
        ("flagged", HowOften::new(all().map(|r| r.flagged))),
    ];
    let counts = counts.into_iter();
    counts
        .map(|(key, count)| (key.to_string(), count))
        .collect()
}

/// Harmonic mean of the share of names that are right and of the share of effects that are named.
fn harmonic(right: HowOften, recalled: HowOften) -> f64 {
    let (precision, recall) = (right.share(), recalled.share());
    match precision + recall > 0.0 {
        true => 2.0 * precision * recall / (precision + recall),
        false => f64::NAN,
    }
}

/// Central interval that holds a binomial count in at least 99 % of cases.
pub fn band(n: usize, level: f64) -> [usize; 2] {
    let Ok(distribution) = Binomial::new(level, n as u64) else {
        return [0, n];
    };
    [0.005, 0.995].map(|p| distribution.inverse_cdf(p) as usize)
}

/// p-value of equal expected counts.
fn chi_square(bins: &[usize]) -> f64 {
    let n: usize = bins.iter().sum();
    let expected = n as f64 / bins.len() as f64;
    if n == 0 {
        return f64::NAN;
    }
    let chi2: f64 = bins
        .iter()
        .map(|&b| (b as f64 - expected).powi(2) / expected)
        .sum();
    ChiSquared::new((bins.len() - 1) as f64).map_or(f64::NAN, |d| d.sf(chi2))
}

/// p-value of the Kolmogorov-Smirnov test of uniformity on [0, 1] (asymptotic, with Stephens' correction for few values).
pub fn kolmogorov(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len() as f64;
    let distance = values.iter().enumerate().fold(0.0_f64, |d, (i, &v)| {
        d.max(v - i as f64 / n).max((i + 1) as f64 / n - v)
    });
    let x = distance * (n.sqrt() + 0.12 + 0.11 / n.sqrt());
    if x < 0.2 {
        return 1.0;
    }
    let term = |k: i32| (-1.0_f64).powi(k - 1) * (-2.0 * f64::from(k * k) * x * x).exp();
    (2.0 * (1..=100).map(term).sum::<f64>()).clamp(0.0, 1.0)
}
