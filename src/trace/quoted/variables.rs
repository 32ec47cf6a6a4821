//! The variables of the quoted draws: what a file of them has, in border units.

use super::Scenario;
use super::pose::PosedAnswer;
use crate::chain::Draws;
use crate::error::Result;
use crate::linearise::Column;
use crate::parameter::{HYPER, Parameter};
use crate::posterior::{
    CompletedDraw, FullModels, Importance, Inclusion, PosedDraws, complete, linear,
};
use crate::sample::{Key, Stream};
use crate::trace::subsets::SIZES;

/// Most draws that are completed and kept: each has some sixty variables, of which correlations and intervals are taken.
const MOST_COMPLETED: usize = 1 << 10;

/// Streams with which draws are completed, apart from those of any ensemble.
const COMPLETION: u64 = u64::MAX - 1;

/// Names of which no two are the same: motions in the plane have one for all steps.
fn distinct(names: &[String]) -> Vec<String> {
    let number = |k: usize| names[..k].iter().filter(|n| **n == names[k]).count();
    let of = |k: usize| match number(k) {
        0 => names[k].clone(),
        n => format!("{}_{}", names[k], n + 1),
    };
    (0..names.len()).map(of).collect()
}

/// Completed draws.
pub(super) struct Completed {
    pub draws: Draws,
    pub importance: Importance,
}

impl PosedAnswer<'_> {
    /// Names of the completed draws' variables.
    fn names(&self) -> Vec<String> {
        let here = &self.posed.expanded.here;
        let mut names: Vec<String> = here.base[..here.constants]
            .iter()
            .map(|c| c.name.clone())
            .collect();
        names.extend(HYPER.map(String::from));
        names.extend(here.base[here.constants..].iter().map(|c| c.name.clone()));
        let candidates = || here.candidates.iter().map(|c| (c, c.law.map(|l| l.key())));
        for (candidate, law) in candidates() {
            let under = |c: &Column| Parameter::read(&c.name).under(law.clone()).name();
            names.extend(candidate.columns.iter().map(under));
        }
        let acts = candidates().map(|(c, law)| Parameter::acts(c.effect.name()).under(law));
        names.extend(acts.map(|p| p.name()));
        distinct(&names)
    }

    /// The draws of the answer's density with all that was integrated out of it drawn, in border units, and how those of the account itself fare
    /// under the `full` model, by which they are moved where that is more than its error. Other answers only widen an interval.
    ///
    /// # Errors
    /// Of the program, for draws of another density.
    pub fn completed(&self, draws: &Draws, full: FullModels<'_>, seed: u64) -> Result<Completed> {
        let subsets = &self.traced.evidence.subsets;
        let draws = &draws.every(draws.len().div_ceil(MOST_COMPLETED))?;
        let points: Vec<Vec<f64>> = draws.points().map(<[f64]>::to_vec).collect();
        let candidates = if self.supposing == Scenario::Small {
            self.posed.expanded.here.candidates.len()
        } else {
            0
        };
        let most = SIZES.len().min(candidates + 1);
        let inclusion = Inclusion {
            candidates,
            log_prior: &|n| (n < most).then(|| subsets.log_prior(n)),
            excludes: &|a, b| subsets.layout.same(a, b),
        };
        let key = Key {
            seed,
            ensemble: COMPLETION,
        };
        let stream = |k: usize| Stream::at(key, k as u64, 0);
        let found = complete(&self.posed.density, &points, &inclusion, &stream);
        let of = PosedDraws {
            posed: &self.posed,
            points: &points,
            drawn: &found,
        };
        let mut importance = match self.supposing {
            Scenario::Small => of.importance(full)?,
            _ => Importance::default(),
        };
        let by = of.correction(&importance);
        importance.corrected = by.iter().any(|by| *by != 0.0);
        let mut values = Vec::new();
        for (x, drawn) in points.iter().zip(&found) {
            let by = by.iter().chain(std::iter::repeat(&0.0));
            let moved: Vec<f64> = x.iter().zip(by).map(|(x, by)| x + by).collect();
            self.write(&moved, drawn, &mut values);
        }
        let (ensemble, lp) = (draws.ensemble().to_vec(), draws.lp().to_vec());
        let mut completed = Draws::new(self.names(), ensemble, values, lp)?;
        completed.info = draws.info.clone();
        Ok(Completed {
            draws: completed,
            importance,
        })
    }

    /// A completed draw.
    fn write(&self, x: &[f64], drawn: &CompletedDraw, values: &mut Vec<f64>) {
        let here = &self.posed.expanded.here;
        let n = here.constants;
        let pair = &self.posed.pairs[drawn.choice.noise];
        let [first, second] = self.traced.evidence.weighing.noise.lengths_mm(pair);
        values.extend(&x[..n]);
        let size = match self.supposing {
            Scenario::None => 0.0,
            _ => drawn.choice.size,
        };
        values.extend([size, f64::from(pair.discrepancy), first, second]);
        let amplitudes = linear(here)
            .into_iter()
            .zip(self.posed.amplitudes(&drawn.amplitudes));
        values.extend(amplitudes.map(|(c, a)| c.mean + c.sd * a));
        let acts = |k: usize| match self.supposing {
            Scenario::Small => drawn.choice.own.contains(&k),
            Scenario::All => true,
            Scenario::None => false,
        };
        values.extend((0..here.candidates.len()).map(|k| f64::from(acts(k))));
    }
}
