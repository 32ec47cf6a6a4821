//! The question before it is answered: where the test is linearised, its noise, its posterior.

use std::sync::Arc;

use nalgebra::DVector;

use super::coarse::CoarseTest;
use super::forward::forward;
use super::prepared::{Prepared, is_clear, nominal_point};
use super::size::check_size;
use super::weighed::{NumberedPoint, made_of, weighed};
use crate::effect::Effect;
use crate::error::{Error, Result};
use crate::experiment::series::SeriesState;
use crate::field::{Blocks, Field};
use crate::files::KeptStages;
use crate::infer::{EffectUnderLaw, Marginal, Model};
use crate::linearise::{
    CandidateColumns, Column, Forward, Insoluble, Measured, STEPS, Sensitivities, StepStack,
    acting_in, candidates, insoluble, is_of_a_rotation, without_insoluble,
};
use crate::noise::series::Frames;
use crate::noise::{Noise, NormalEquations};
use crate::posterior::{
    About, CoarseForwards, Composition, LinearRole, LinearisationPoint, MixtureChoice, NoisePair,
    NoiseScale, Posed, PosteriorDensity, TestExpansion, Weighing, linear,
};
use crate::progress::Progress;
use crate::sample::{Laplace, laplace};

/// A posterior with everything it was made of, not sampled yet.
pub struct InverseProblem {
    /// What is solved.
    pub prepared: Prepared,
    /// The blocks of all steps.
    pub measured: Arc<Measured>,
    /// The test on a coarse mesh, where it has one.
    pub coarse: Option<CoarseTest>,
    /// Where the test is linearised, with what may act in it.
    pub point: LinearisationPoint,
    /// The test linearised there, with all candidates: what the noise is orthogonal to.
    pub sensitivities: Sensitivities,
    pub weighing: Weighing,
    /// Effects left out of the candidates, with the reason.
    pub left_out: Insoluble,
    /// The noise of a point: what a residual is looked at with.
    pub noise: Noise,
    /// Where the density is expanded, in the declared effects alone.
    pub about: LinearisationPoint,
    pub posed: Posed,
}

/// Reduce the measurement to a posterior.
///
/// # Errors
/// Of the input: a field that cannot be the model's, too few points for the noise, effects that depend on each other.
pub fn inverse_problem(
    model: &Model,
    prepared: Prepared,
    progress: &dyn Progress,
) -> Result<InverseProblem> {
    inverse_problem_kept(model, prepared, &KeptStages::default(), progress)
}

/// The same with stages that are kept.
///
/// # Errors
/// Those of [`inverse_problem`]; a folder that cannot be written.
pub(super) fn inverse_problem_kept(
    model: &Model,
    prepared: Prepared,
    kept: &KeptStages,
    progress: &dyn Progress,
) -> Result<InverseProblem> {
    let problem = &prepared.problem;
    let nominal = prepared.predict(&problem.state(&nominal_point(problem, model)))?;
    check_size(&prepared.observation.field, &nominal.field)?;
    let measured = blocks_of(&prepared, &prepared.observation.field);
    let coarse = CoarseTest::new(model, &prepared, &measured)?;
    let step = || progress.step();
    let fine = forward(model, &prepared, &measured, &step);
    let everywhere = coarse
        .as_ref()
        .map(|c| c.everywhere(model, &prepared, &measured));
    let beginning = Beginning {
        forward: &fine,
        coarse: everywhere.as_ref(),
        measured: &measured,
        kept,
        progress,
    };
    let begun = begun(&fine, &prepared);
    let (effects, left_out) = candidates(model);
    let (point, sensitivities, left_out) = without_insoluble(
        sought(&fine, &prepared, &effects, &begun),
        &|sought| insoluble(&fine, &begun, sought),
        &|sought, left| {
            let point = LinearisationPoint {
                state: begun.clone(),
                declared: fine.declared(),
                sought,
            };
            let (point, sensitivities) = beginning.at_ridge(point)?;
            Ok((point, sensitivities, [&left_out[..], &left].concat()))
        },
    )?;
    let numbered = NumberedPoint {
        sensitivities: &sensitivities,
        number: "1",
        before: prepared.begun.as_ref().map(|b| &b.weighing),
    };
    let weighing = weighed((&fine, &measured), numbered, (kept, progress))?;
    let chosen = DeclaredNoise::of(&weighing, &sensitivities)?;
    let noise = noise_of_a_point(&prepared, &weighing, &chosen, progress)?;
    progress.end();
    let few = coarse
        .as_ref()
        .map(|c| c.forwards(model, &prepared, &measured));
    let test = (&fine, few.as_ref(), &measured);
    let look = FirstLook {
        sensitivities: &sensitivities,
        weighing: &weighing,
        chosen: &chosen,
        reference_nm: noise.reference_nm(),
    };
    let (about, posed) = look.posed(model, test, &point)?;
    prepared.problem.experiment.drop_caches();
    drop((fine, everywhere, few));
    Ok(InverseProblem {
        prepared,
        measured,
        coarse,
        point,
        sensitivities,
        weighing,
        left_out,
        noise,
        about,
        posed,
    })
}

/// The noise of a point of the field that is looked at: of a series the sum of its steps'.
fn noise_of_a_point(
    prepared: &Prepared,
    weighing: &Weighing,
    chosen: &DeclaredNoise,
    progress: &dyn Progress,
) -> Result<Noise> {
    let observation = &prepared.observation;
    let steps = observation.steps.as_ref();
    let field = &observation.field;
    let of = |blocks: &Blocks| {
        let over = Frames {
            blocks,
            loads: steps.map(|s| s.loads.clone()).unwrap_or_default(),
            subset_mm: field.subset_mm,
        };
        weighing.noise.of_sum(&chosen.pair, &over)
    };
    let noise = Noise::over(field, &prepared.modes()?, of)?;
    progress.say(&format!(
        "{:.3} and {:.3} nm a point, n_eff {:.0}",
        noise.point_sd_nm(0),
        noise.point_sd_nm(1),
        noise.effective_points,
    ));
    Ok(noise)
}

/// The blocks of a field, of a series those of all steps.
pub fn blocks_of(prepared: &Prepared, field: &Field) -> Arc<Measured> {
    let Prepared {
        problem,
        observation,
        ..
    } = prepared;
    let geometry = &*problem.experiment.scene().setup.geometry;
    let used = |i: usize| is_clear(geometry, field.points[i]);
    let observed = (&observation.sight, observation.steps.as_ref());
    Arc::new(Measured::new(field, &*problem.experiment, observed, used))
}

/// Where the search for the point begins.
fn begun(forward: &Forward<'_>, prepared: &Prepared) -> SeriesState {
    let model = forward.model;
    let anew = || forward.beginning(model.state(&|_| None));
    let begun = prepared.begun.as_ref().map(|b| b.state.clone());
    begun.unwrap_or_else(anew)
}

/// How effects may act.
fn sought(
    forward: &Forward<'_>,
    prepared: &Prepared,
    effects: &[&'static dyn Effect],
    begun: &SeriesState,
) -> Vec<EffectUnderLaw> {
    let Some(steps) = &prepared.observation.steps else {
        return EffectUnderLaw::without_laws(effects);
    };
    let declared = forward.declared();
    let mut sought = acting_in(effects, &steps.loads);
    sought.retain(|acts| {
        let prior_sd = forward.prior_sd(acts, 0);
        !is_of_a_rotation(acts, &declared, begun, prior_sd)
    });
    sought
}

/// What the first linearisation is made of.
struct Beginning<'a> {
    forward: &'a Forward<'a>,
    coarse: Option<&'a Forward<'a>>,
    measured: &'a Arc<Measured>,
    kept: &'a KeptStages,
    progress: &'a dyn Progress,
}

impl Beginning<'_> {
    /// The test linearised about the ridge estimate, with all candidates.
    fn at_ridge(&self, point: LinearisationPoint) -> Result<(LinearisationPoint, Sensitivities)> {
        let LinearisationPoint {
            state,
            declared,
            sought,
        } = point;
        let columns = match self.coarse {
            // the steps of a series tell more of a column than one field does: there the discrepancy's probability went from 0.72 to 0.49
            Some(coarse) if !self.forward.observing.of_each_step() => CandidateColumns::On(coarse),
            _ => CandidateColumns::Here,
        };
        let test = made_of(self.forward.model, self.measured);
        let made_of = (test, &state, &declared, &sought, self.coarse.is_some());
        let always = state.shared.constants.len() + self.forward.count(&declared, &state);
        let most = (1 + STEPS) * always + self.forward.count(&sought, &state);
        let at_ridge = || {
            let what = format!("sensitivities to {} effects", sought.len());
            self.progress.begin(&what, Some(most as u64));
            let mut at = state.clone();
            let found = self
                .forward
                .at_ridge(self.measured, &mut at, &declared, &sought, columns);
            self.progress.end();
            Ok((at, found?))
        };
        let (state, found) =
            self.kept
                .stage("sensitivities-1", &made_of, at_ridge, self.progress)?;
        let point = LinearisationPoint {
            state,
            declared,
            sought,
        };
        Ok((point, found))
    }
}

/// The noise of the declared model, and what it says of the parameters in closed form.
struct DeclaredNoise {
    pair: NoisePair,
    /// Sds of the constants, border units.
    sds: Vec<f64>,
}

impl DeclaredNoise {
    /// The likeliest choice under the declared effects that is no discrepancy.
    fn of(weighing: &Weighing, sensitivities: &Sensitivities) -> Result<Self> {
        let mut best: Option<(f64, NoisePair)> = None;
        for pair in weighing.pairs.iter().filter(|p| !p.discrepancy) {
            let log = weighing.project(pair)?.log_base;
            if best.is_none_or(|(most, _)| log > most) {
                best = Some((log, *pair));
            }
        }
        let none = || Error::program("identify", "a choice of the noise");
        let (_, pair) = best.ok_or_else(none)?;
        let gram = weighing.gram(&pair);
        let data = gram.nrows() - 1;
        let own: Vec<(usize, f64)> = (0..sensitivities.base.len()).map(|k| (k, 1.0)).collect();
        let fit = NormalEquations::of_columns(&gram, |k| gram[(k, data)], &own);
        let covariance = fit.map(|f| f.covariance());
        let constants = sensitivities.base[..sensitivities.constants].iter();
        let sd = |(k, c): (usize, &Column)| {
            let own = covariance.as_ref().map_or(1.0, |c| c[(k, k)].sqrt());
            c.sd * own.min(1.0)
        };
        Ok(Self {
            pair,
            sds: constants.enumerate().map(sd).collect(),
        })
    }
}

/// Posterior sds in prior sds, within these, beside which slopes are taken; so many times as far reaches the surface of the mean, within others.
const STEP: [f64; 2] = [0.03, 0.5];
const REACH: f64 = 8.0;
const BOX: [f64; 2] = [0.5, 3.0];

/// Steps beside which slopes are taken, and how far the surface reaches, border units, of constants with some posterior sds.
pub fn reaches(model: &Model, sds: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let each = model.marginals().into_iter().zip(sds);
    let of = |(m, sd): (Marginal, &f64)| {
        let own = sd / m.sd;
        let step = m.sd * own.clamp(STEP[0], STEP[1]);
        (step, m.sd * (REACH * own).clamp(BOX[0], BOX[1]))
    };
    each.map(of).unzip()
}

/// A mode farther from where the test was linearised than this share of the surface's box is where it is linearised next.
const OFF_CENTRE: f64 = 0.4;

/// The same of an amplitude of which the field is no multiple, prior sds. A loud effect bends: linearised where all candidates share what it does,
/// a hole 5 % larger moved nu12 by 0.13 posterior sd.
const OFF_AMPLITUDE: f64 = 0.1;

/// How often the box is moved.
const MOVES: usize = 2;

/// A test on its meshes with its measurement.
type OnMeshes<'a> = (
    &'a Forward<'a>,
    Option<&'a CoarseForwards<'a>>,
    &'a Arc<Measured>,
);

/// What the first linearisation says of a measurement.
struct FirstLook<'a> {
    sensitivities: &'a Sensitivities,
    weighing: &'a Weighing,
    chosen: &'a DeclaredNoise,
    reference_nm: f64,
}

impl FirstLook<'_> {
    /// The density of the declared model, about its own mode, and where that is.
    fn posed(
        &self,
        model: &Model,
        (fine, coarse, measured): OnMeshes<'_>,
        point: &LinearisationPoint,
    ) -> Result<(LinearisationPoint, Posed)> {
        let Self {
            sensitivities,
            weighing,
            chosen,
            reference_nm,
        } = *self;
        let mut own = LinearisationPoint {
            sought: Vec::new(),
            ..point.clone()
        };
        let mut moves = 0;
        loop {
            let (steps, reach) = reaches(model, &chosen.sds);
            let norms = |errors: &[StepStack]| weighing.norms(measured, &chosen.pair, errors);
            let about = About {
                state: &own.state,
                declared: &own.declared,
                sought: &[],
                here: (moves == 0).then(|| without_candidates(sensitivities)),
                steps,
                reach: reach.clone(),
                norms: &norms,
            };
            let expanded = Arc::new(TestExpansion::new(&about, fine, coarse)?);
            let posed =
                declared(model, (expanded, measured), weighing, chosen)?.without_contrasts();
            let scale = noise_scale(model, &posed, sensitivities, reference_nm);
            let posed = Posed {
                density: posed.density.clone().with_noise(scale),
                ..posed
            };
            let mode = start(&posed.density).ok();
            let mode = mode.filter(|m| posed.density.is_credible(&m.mode));
            let Some(mode) = mode.filter(|_| moves < MOVES) else {
                return Ok((own, posed));
            };
            let mut each = mode
                .mode
                .iter()
                .zip(&own.state.shared.constants)
                .zip(&reach);
            let is_off = each.any(|((x, at), reach)| (x - at).abs() > OFF_CENTRE * reach);
            let (amplitudes, _) = posed.amplitudes_at(&mode.mode);
            let mut next = own.state.clone();
            let found = (&posed.expanded.here, amplitudes.as_slice());
            let by = fine.amplitudes_moved(&mut next, &own.declared, found);
            if !is_off && by <= OFF_AMPLITUDE {
                return Ok((own, posed));
            }
            own.state = next;
            let constants = own.state.shared.constants.len();
            own.state.shared.constants = mode.mode[..constants].to_vec();
            moves += 1;
        }
    }
}

/// A linearisation without candidates, which lie at their prior means in it.
fn without_candidates(sensitivities: &Sensitivities) -> Sensitivities {
    Sensitivities {
        candidates: Vec::new(),
        near_edge: Vec::new(),
        ..sensitivities.clone()
    }
}

/// The density of the declared effects alone.
fn declared(
    model: &Model,
    (expanded, measured): (Arc<TestExpansion>, &Arc<Measured>),
    weighing: &Weighing,
    chosen: &DeclaredNoise,
) -> Result<Posed> {
    let count = linear(&expanded.here).len();
    let account = Composition {
        kept: (0..count).collect(),
        whose: vec![LinearRole::Always; count],
        largest: DVector::repeat(count, 1.0),
        pairs: vec![chosen.pair],
        parts: vec![MixtureChoice {
            noise: 0,
            own: Vec::new(),
            size: 0.0,
            rival: 0.0,
            log_weight: 0.0,
        }],
    };
    let test = (expanded, Arc::clone(measured));
    Posed::new(model, test, Arc::clone(&weighing.noise), account)
}

/// The noise of a point as a parameter. What is left orthogonally to all that the density can follow is taken out of it: that is the contrasts'.
fn noise_scale(
    model: &Model,
    posed: &Posed,
    sensitivities: &Sensitivities,
    reference_nm: f64,
) -> NoiseScale {
    let values: usize = posed.measured.averages.iter().map(DVector::len).sum();
    let explained = sensitivities.columns().count() + sensitivities.near_edge.len();
    NoiseScale {
        reference_nm,
        freedom: values.saturating_sub(explained).max(1) as f64,
        followed: posed.followed() as f64,
        declared_nm: model.file.likelihood.noise_nm,
    }
}

/// Where chains start: the mode without the priors' cuts, moved inside them.
///
/// # Errors
/// Those of [`laplace`].
pub fn start(density: &PosteriorDensity) -> Result<Laplace> {
    let (centre, sd) = density.start();
    let mut mode = laplace(&density.untruncated(), &centre, &sd)?;
    for (k, (x, m)) in mode.mode.iter_mut().zip(density.marginals()).enumerate() {
        let Some([low, high]) = m.truncate else {
            continue;
        };
        let room = (0.05 * (high - low)).min(sd[k]);
        *x = x.clamp(low + room, high - room);
    }
    Ok(mode)
}
