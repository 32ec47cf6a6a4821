//! The finite elements against the reduced model at draws of the posterior.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::inverse::InverseProblem;
use crate::chain::Draws;
use crate::error::Result;
use crate::files::stored;
use crate::infer::{Posterior, Whitened};
use crate::numeric::{add_scaled, shares};
use crate::parameter::{Parameter, ParameterKind};
use crate::progress::Progress;
use crate::quantity::NM_PER_MM;
use crate::reduce::spread_over;
use crate::sample::LogDensity;

/// What the reduced model's error does to the posterior, measured where the posterior is.
#[derive(Debug, Clone)]
pub struct SurrogateError {
    /// Number of draws at which the finite elements were solved.
    pub draws: usize,
    /// Name of each constant and amplitude, and the largest shift of its posterior mode that the reduced model's
    /// error causes at any of the draws, in posterior standard deviations.
    pub shift_sd: Vec<(String, f64)>,
    /// The mean of those shifts with their signs: what does not average out.
    pub bias_sd: Vec<f64>,
    /// Log likelihood by the finite elements minus that by the reduced model, at each draw.
    pub log_weights: Vec<f64>,
    /// Moments of each parameter over those draws, plain and with the finite elements' likelihood.
    pub moments: Vec<Reweighted>,
    /// Largest difference of the fields at a measured point, nm.
    pub max_field_nm: f64,
    /// Root mean square difference of the fields, nm.
    pub rms_field_nm: f64,
    /// The same two, largest and root mean square, over random points of the box, where a reduced basis makes them known.
    pub over_the_box_nm: Option<[f64; 2]>,
    /// Bound of what the basis's own answers are off at a measured point, at any of those points and draws, nm.
    pub basis_bound_nm: Option<f64>,
}

/// Mean and sd of a parameter over the draws at which the finite elements were solved.
#[derive(Debug, Clone)]
pub struct Reweighted {
    pub name: String,
    /// With equal weights.
    pub plain: [f64; 2],
    /// With the importance weights of the finite elements' likelihood.
    pub weighted: [f64; 2],
}

/// Draws at which the finite elements are solved, one by one.
pub const CHECKED_DRAWS: usize = 32;

/// Draws at which they are known, where a reduced basis answers for them.
const SPANNED_DRAWS: usize = 2000;

/// Random points of the box at which they are known then, and their seed.
const BOX_POINTS: usize = 2000;
const BOX_SEED: u64 = 5;

/// Of all of them, those of the largest errors at which the field is looked at point by point.
const LOOKED_AT: usize = 8;

/// Largest error of a reduced model that needs no refinement, in posterior standard deviations.
pub const TOLERANCE: f64 = 0.01;

stored!(SurrogateError {
    draws,
    shift_sd,
    bias_sd,
    log_weights,
    moments,
    max_field_nm,
    rms_field_nm,
    over_the_box_nm,
    basis_bound_nm
});
stored!(Reweighted {
    name,
    plain,
    weighted
});

impl SurrogateError {
    /// The largest shift of any elastic constant, in posterior standard deviations.
    pub fn max_sd_of_constants(&self) -> f64 {
        let of = |name: &str| Parameter::read(name).kind == ParameterKind::Constant;
        let constants = self.shift_sd.iter().filter(|(name, _)| of(name));
        constants.fold(0.0, |a, (_, s)| a.max(*s))
    }

    /// The largest shift of any parameter, in posterior standard deviations.
    pub fn max_sd(&self) -> f64 {
        self.shift_sd.iter().fold(0.0, |a, (_, s)| a.max(*s))
    }

    /// Effective number of draws with the finite elements' likelihood: (sum w)^2 / sum w^2 of the importance weights.
    pub fn effective_draws(&self) -> f64 {
        let weights = shares(&self.log_weights);
        1.0 / weights.iter().map(|w| w * w).sum::<f64>()
    }

    /// Compare at [`CHECKED_DRAWS`] draws, or many more where a reduced basis answers for the finite elements; spread over all chains, the
    /// same for the same draws.
    ///
    /// With an error d of the predicted field, the posterior's gradient changes by g = grad (log L(d) - log L) and its
    /// mode by one Newton step, Sigma g, with Sigma the covariance of the draws.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn measure(run: &InverseProblem, draws: &Draws, progress: &dyn Progress) -> Result<Self> {
        let d = run.posterior.structural();
        let whitened = Whitened::new(&run.columns, &run.noise);
        let Compared {
            chosen,
            errors,
            over_the_box_nm,
            basis_bound_nm,
        } = compared(run, &whitened, draws, progress)?;
        let covariance = covariance(draws, d);
        let sd = DVector::from_fn(d, |k, _| covariance[(k, k)].sqrt());
        let mut largest = vec![0.0_f64; d];
        let mut bias = vec![0.0; d];
        let mut log_weights = Vec::new();
        let (mut max_field, mut sum) = (0.0_f64, 0.0);
        for (x, error) in chosen.iter().zip(&errors) {
            max_field = max_field.max(error.largest);
            sum += error.mean_square / errors.len() as f64;
            log_weights.push(run.posterior.likelihood().log_likelihood_change(
                &x[..d],
                run.posterior.scale(x),
                &error.weighted,
            ));
            let shift = &covariance * gradient(&run.posterior, x, &sd, &error.weighted);
            for k in 0..d {
                largest[k] = largest[k].max((shift[k] / sd[k]).abs());
                bias[k] += shift[k] / sd[k] / chosen.len() as f64;
            }
        }
        let error = Self {
            draws: chosen.len(),
            shift_sd: run.posterior.names().iter().cloned().zip(largest).collect(),
            bias_sd: bias,
            moments: reweighted(run.posterior.names(), &chosen, &log_weights),
            log_weights,
            max_field_nm: max_field * NM_PER_MM,
            rms_field_nm: sum.sqrt() * NM_PER_MM,
            over_the_box_nm,
            basis_bound_nm,
        };
        progress.say(&format!(
            "{:.3} % of a posterior sd",
            100.0 * error.max_sd()
        ));
        progress.end();
        Ok(error)
    }
}

fn reweighted(names: &[String], draws: &[Vec<f64>], log_weights: &[f64]) -> Vec<Reweighted> {
    let moments = |weights: &[f64], k: usize| {
        let values = || draws.iter().zip(weights).map(|(x, w)| (x[k], w));
        let mean: f64 = values().map(|(x, w)| w * x).sum();
        let variance: f64 = values().map(|(x, w)| w * (x - mean).powi(2)).sum();
        [mean, variance.sqrt()]
    };
    let equal = shares(&vec![0.0; draws.len()]);
    let weights = shares(log_weights);
    let reweighted = |(k, name): (usize, &String)| Reweighted {
        name: name.clone(),
        plain: moments(&equal, k),
        weighted: moments(&weights, k),
    };
    names.iter().enumerate().map(reweighted).collect()
}

/// `count` draws at multiples of the golden ratio through the flattened draws: all chains, early and late.
fn spread(draws: &Draws, count: usize) -> Vec<Vec<f64>> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let n = draws.len();
    let mut chosen: Vec<usize> = (0..count.min(n))
        .map(|i| (((i as f64 + 0.5) * GOLDEN).fract() * n as f64) as usize)
        .collect();
    chosen.sort_unstable();
    chosen.dedup();
    chosen
        .iter()
        .map(|&i| draws.values()[i * draws.dim()..(i + 1) * draws.dim()].to_vec())
        .collect()
}

/// Draws at which the finite elements are known, their differences from the reduced model there, and what a basis says of the box
/// ([`SurrogateError::over_the_box_nm`]) and of itself ([`SurrogateError::basis_bound_nm`]).
struct Compared {
    chosen: Vec<Vec<f64>>,
    errors: Vec<FieldError>,
    over_the_box_nm: Option<[f64; 2]>,
    basis_bound_nm: Option<f64>,
}

fn compared(
    run: &InverseProblem,
    whitened: &Whitened,
    draws: &Draws,
    progress: &dyn Progress,
) -> Result<Compared> {
    let d = run.posterior.structural();
    let many = spread(draws, SPANNED_DRAWS);
    let what = "finite elements at posterior draws";
    let solved = |x: &Vec<f64>| field_error(run, whitened, &x[..d]);
    let answers = answers(run, &many, d);
    if answers.iter().filter(|a| a.is_none()).count() <= CHECKED_DRAWS {
        progress.begin(what, None);
        // what it holds at every point is gone before the fields are made
        let reach = {
            let experiment = &run.prepared.problem.experiment;
            let view = experiment.view(&run.prepared.observation.sight)?;
            view.map(|v| v.reach())
        };
        let spanned = Spanned::new(run, whitened);
        let known: Vec<&SpannedAnswer> = answers.iter().flatten().collect();
        let mut errors_there = spanned.errors(&known).into_iter();
        let mut errors = Vec::with_capacity(many.len());
        for (x, answer) in many.iter().zip(&answers) {
            let answered = answer.as_ref().and_then(|_| errors_there.next());
            errors.push(answered.map_or_else(|| solved(x), Ok)?);
        }
        let points = spread_over(&run.prepared.problem, BOX_POINTS, BOX_SEED);
        let box_answers = self::answers(run, &points, d);
        let over_the_box: Vec<&SpannedAnswer> = box_answers.iter().flatten().collect();
        let bounds = known.iter().chain(&over_the_box).map(|a| a.bound);
        let largest = bounds.fold(0.0, f64::max);
        return Ok(Compared {
            over_the_box_nm: (!over_the_box.is_empty())
                .then(|| summary(&spanned.errors(&over_the_box))),
            basis_bound_nm: reach.map(|reach| NM_PER_MM * reach * largest),
            chosen: many,
            errors,
        });
    }
    let few = spread(draws, CHECKED_DRAWS);
    progress.begin(what, Some(few.len() as u64));
    let error = |x: &Vec<f64>| {
        let error = solved(x);
        progress.step();
        error
    };
    let errors: Result<Vec<FieldError>> = few.par_iter().map(error).collect();
    Ok(Compared {
        chosen: few,
        errors: errors?,
        over_the_box_nm: None,
        basis_bound_nm: None,
    })
}

/// Finite elements minus reduced model at a point, as a sum of the fields of [`Spanned`].
struct SpannedAnswer {
    factors: DVector<f64>,
    /// Bound of the basis's own error in the energy norm, (N mm)^1/2.
    bound: f64,
}

/// Those at some points of the posterior or the design, where a basis answers for the finite elements.
fn answers(run: &InverseProblem, points: &[Vec<f64>], d: usize) -> Vec<Option<SpannedAnswer>> {
    let problem = &run.prepared.problem;
    let likelihood = run.posterior.likelihood();
    let answer = |x: &Vec<f64>| -> Option<SpannedAnswer> {
        let answer = problem.experiment.coordinates(&problem.state(&x[..d]))?;
        let coordinates = answer.coordinates.iter().copied();
        let surfaces = likelihood.surface_prediction(&x[..d]);
        let factors = coordinates.chain(surfaces.iter().map(|a| -a));
        Some(SpannedAnswer {
            factors: DVector::from_vec(factors.collect()),
            bound: answer.bound,
        })
    };
    points.par_iter().map(answer).collect()
}

/// Largest and root mean square difference, nm.
fn summary(errors: &[FieldError]) -> [f64; 2] {
    let square = errors.iter().map(|e| e.mean_square).sum::<f64>() / errors.len().max(1) as f64;
    let largest = errors.iter().fold(0.0_f64, |m, e| m.max(e.largest));
    [largest, square.sqrt()].map(|mm| mm * NM_PER_MM)
}

/// Finite elements minus reduced model at the measured points.
pub(super) struct FieldError {
    /// Largest component at a point, mm.
    largest: f64,
    /// Mean square of the components, mm^2.
    mean_square: f64,
    /// What it adds to the data's weighted coefficients, 1/mm.
    pub weighted: DVector<f64>,
}

/// Errors at many points, whose fields are sums of few: the basis of the finite elements and the modes of the reduced model.
struct Spanned<'a> {
    /// The fields, mm, and what each adds to the data's weighted coefficients.
    fields: Vec<Cow<'a, [[f64; 2]]>>,
    weighted: DMatrix<f64>,
    /// Their mean products over all points and components, mm^2.
    gram: DMatrix<f64>,
}

impl<'a> Spanned<'a> {
    fn new(run: &'a InverseProblem, whitened: &Whitened) -> Self {
        let sight = &run.prepared.observation.sight;
        let spanning = run.prepared.problem.experiment.spanning(sight);
        let modes = run.columns.modes.iter();
        let fields: Vec<Cow<'_, [[f64; 2]]>> = spanning
            .into_iter()
            .map(Cow::Owned)
            .chain(modes.map(|m| Cow::Borrowed(m.as_slice())))
            .collect();
        let weighted: Vec<_> = fields
            .par_iter()
            .map(|field| run.statistics.weighted_of(whitened, &run.noise, field))
            .collect();
        let product = |a: &[[f64; 2]], b: &[[f64; 2]]| {
            let sum: f64 = a
                .iter()
                .zip(b)
                .map(|(u, v)| u[0] * v[0] + u[1] * v[1])
                .sum();
            sum / (2 * a.len()).max(1) as f64
        };
        let n = fields.len();
        Self {
            gram: DMatrix::from_fn(n, n, |i, j| product(&fields[i], &fields[j])),
            weighted: DMatrix::from_columns(&weighted),
            fields,
        }
    }

    fn errors(&self, answers: &[&SpannedAnswer]) -> Vec<FieldError> {
        let error = |SpannedAnswer { factors: f, .. }: &&SpannedAnswer| FieldError {
            largest: 0.0,
            mean_square: f.dot(&(&self.gram * f)).max(0.0),
            weighted: &self.weighted * f,
        };
        let mut errors: Vec<FieldError> = answers.par_iter().map(error).collect();
        let mut order: Vec<usize> = (0..errors.len()).collect();
        order.sort_by(|&a, &b| errors[b].mean_square.total_cmp(&errors[a].mean_square));
        for k in order.into_iter().take(LOOKED_AT) {
            let mut sum = vec![[0.0; 2]; self.fields[0].len()];
            for (field, factor) in self.fields.iter().zip(answers[k].factors.iter()) {
                add_scaled(&mut sum, field, *factor);
            }
            let all = sum.iter().flatten();
            errors[k].largest = all.fold(0.0, |m, u| m.max(u.abs()));
        }
        errors
    }
}

/// The error at one point.
///
/// # Errors
/// Those of a finite-element solution.
pub(super) fn field_error(
    run: &InverseProblem,
    whitened: &Whitened,
    theta: &[f64],
) -> Result<FieldError> {
    let state = run.prepared.problem.state(theta);
    let mut error = run.prepared.predict(&state)?.loaded;
    let alpha = run.posterior.likelihood().surface_prediction(theta);
    for (column, a) in run.columns.modes.iter().zip(alpha) {
        add_scaled(&mut error, column, -a);
    }
    let all = || error.iter().flatten();
    Ok(FieldError {
        largest: all().fold(0.0, |m, u| m.max(u.abs())),
        mean_square: all().map(|u| u * u).sum::<f64>() / (2 * error.len()).max(1) as f64,
        weighted: run.statistics.weighted_of(whitened, &run.noise, &error),
    })
}

/// Covariance of the first `d` parameters of the draws.
fn covariance(draws: &Draws, d: usize) -> DMatrix<f64> {
    let n = draws.len() as f64;
    let mean = draws.points().fold(DVector::zeros(d), |m, x| {
        m + DVector::from_column_slice(&x[..d]) / n
    });
    let mut sum = DMatrix::zeros(d, d);
    for x in draws.points() {
        let r = DVector::from_column_slice(&x[..d]) - &mean;
        sum.ger(1.0 / n, &r, &r, 1.0);
    }
    sum
}

/// Gradient of the change of the log likelihood, by central differences over a tenth of a posterior sd.
fn gradient(
    posterior: &Posterior,
    x: &[f64],
    sd: &DVector<f64>,
    weighted: &DVector<f64>,
) -> DVector<f64> {
    let scale = posterior.scale(x);
    let theta = &x[..sd.len()];
    DVector::from_fn(sd.len(), |k, _| {
        let step = 0.1 * sd[k];
        let change_at = |step: f64| {
            let mut moved = theta.to_vec();
            moved[k] += step;
            posterior
                .likelihood()
                .log_likelihood_change(&moved, scale, weighted)
        };
        (change_at(step) - change_at(-step)) / (2.0 * step)
    })
}
