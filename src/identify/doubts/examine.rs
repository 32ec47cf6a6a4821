//! The input as it stands against the mistakes that may have been made in it.

use rayon::prelude::*;

use super::mistake::{Mistake, Shown, Void, is_another_size, mistakes};
use super::{NATS, NATS_OF_SCALE};
use crate::effect::{EFFECTS, Effect, Kind, why_not};
use crate::error::Result;
use crate::experiment::{FieldSolver, Gauge};
use crate::field::blocks::one_a_tile;
use crate::field::{Field, Reason, bounds, rigid};
use crate::identify::prepared::{Prepared, is_clear, nominal_point};
use crate::identify::size::is_on_another_scale;
use crate::infer::{EffectUnderLaw, Model, moved_experiment_over};
use crate::linearise::{
    AtPoints, CandidateColumns, Column, Forward, Measured, Sensitivities, Slopes,
};
use crate::noise::white;
use crate::parameter::Parameter;
use crate::quantity::plus_minus;

/// A constant that lies so many prior sds off makes the input worth a test, and is said where no mistake explains it.
const ODD: f64 = 2.3;
const FAR: f64 = 4.0;

/// What is left over the white noise of a point that makes the input worth a test.
const LEFT: f64 = 3.0;

/// Of the points so many are enough.
const POINTS: f64 = 2500.0;

/// Density of the mesh over the model's.
const DENSITY: f64 = 0.4;

/// Values that count as independent: what is left of a wrong model is smooth.
const INDEPENDENT: f64 = 100.0;

/// Log odds within which two mistakes are one as well as the other.
const ALIKE: f64 = 2.0;

/// Sentences that name a mistake of the input, or what no mistake explains; none where the input is as one would expect.
pub fn doubts(model: &Model, prepared: &Prepared) -> Vec<String> {
    let fine = &*prepared.problem.experiment;
    if fine.given().is_some() || fine.mesh_size()[0] == 0 {
        return Vec::new();
    }
    let measured = &prepared.observation.field;
    let field = few(measured, |u| u, false);
    let declared = Mistaken {
        model: plain(model),
        field: &field,
        window: fine,
    };
    // a test that cannot be fitted at all is refused elsewhere, with its reason
    let Ok(as_declared) = declared.fit(None) else {
        return Vec::new();
    };
    let noise = white(measured).sd_mm;
    let noise = (0.5 * (noise[0].powi(2) + noise[1].powi(2))).sqrt();
    let (farthest, z) = as_declared.farthest();
    let left = as_declared.variance.sqrt() / noise;
    let void = Void::of(measured);
    let odd = z.abs() > ODD || left > LEFT || as_declared.largest() > FAR;
    if !odd && !is_another_size(model, void) {
        return Vec::new();
    }
    let nominal = prepared
        .problem
        .state(&nominal_point(&prepared.problem, model));
    // another scale altogether stands in for everything else
    let is_scaled = (prepared.predict(&nominal).ok())
        .is_some_and(|shown| is_on_another_scale(measured, &shown.field));
    let mut possible = mistakes(model, void);
    possible.retain(|m| m.scales || !is_scaled);
    let named = likeliest(possible, (measured, fine), &as_declared);
    if !named.is_empty() {
        return named;
    }
    if z.abs() < FAR {
        return Vec::new();
    }
    let Column { mean, sd, .. } = &as_declared.sensitivities.base[farthest];
    let name = Parameter::read(model.constants()[farthest]);
    let beyond = if z > 0.0 { "above" } else { "below" };
    vec![format!(
        "{} would lie {:.1} prior sd {beyond} its prior of {}. Force, thickness, layup, hole and columns were tested. No single mistake there explains it.",
        name.symbol(),
        z.abs(),
        plus_minus(*mean, *sd)
    )]
}

/// Those of some mistakes that make the data much likelier than they are as declared, within [`ALIKE`] of the best.
fn likeliest(
    possible: Vec<Mistake>,
    (field, window): (&Field, &dyn FieldSolver),
    declared: &InputFit,
) -> Vec<String> {
    let weighed = |mistake: Mistake| {
        let field = few(field, mistake.shown, mistake.turned);
        let without = Mistaken {
            model: plain(&mistake.model),
            field: &field,
            window,
        };
        // columns of effects belong to the points as they lie and to the field's size
        let is_alike = !mistake.turned && !mistake.scales;
        let kept = is_alike.then_some(&declared.sensitivities);
        let fit = without.fit(kept).ok()?;
        let gain = declared.cost - fit.cost;
        let enough = if mistake.scales { NATS_OF_SCALE } else { NATS };
        (fit.farthest().1.abs() < FAR && gain > enough).then_some((gain, mistake.asked))
    };
    let all = possible.into_par_iter();
    let mut gains: Vec<(f64, String)> = all.filter_map(weighed).collect();
    gains.sort_by(|a, b| b.0.total_cmp(&a.0));
    let best = gains.first().map_or(0.0, |g| g.0);
    gains.retain(|(gain, _)| *gain > best - ALIKE);
    gains.into_iter().map(|(_, asked)| asked).collect()
}

/// The model of one load whose rigid motion does not matter.
fn plain(model: &Model) -> Model {
    let mut model = model.clone();
    let experiment = model.experiment_mut();
    experiment.load = Some(experiment.nominal_load());
    experiment.steps = None;
    experiment.gauge = Gauge::Window;
    model
}

/// Some of a field's points with their displacements as they are meant, without the rigid motion of these.
fn few(field: &Field, shown: Shown, turned: bool) -> Field {
    let mut few = field.clone();
    if turned {
        let both = few.points.iter_mut().chain(&mut few.displacement);
        both.for_each(|v| v.swap(0, 1));
    }
    few.displacement.iter_mut().for_each(|u| *u = shown(*u));
    let motion = rigid::fit(&few.points, &few.displacement);
    for (u, p) in few.displacement.iter_mut().zip(&few.points) {
        let moved = motion.at(*p);
        *u = [u[0] - moved[0], u[1] - moved[1]];
    }
    let [low, high] = bounds(&few.points);
    let area = (high[0] - low[0]) * (high[1] - low[1]);
    let kept = one_a_tile(&few.points, (area / POINTS).sqrt().max(f64::MIN_POSITIVE));
    few.retain(Reason::OutsideWindow, |i| kept[i]);
    few.outlying.clear();
    few
}

/// A test as it may have been meant.
struct Mistaken<'a> {
    model: Model,
    field: &'a Field,
    window: &'a dyn FieldSolver,
}

/// What the constants would be in a test, and how likely that is.
struct InputFit {
    sensitivities: Sensitivities,
    /// Of all parameters, prior sds from their means.
    solution: Vec<f64>,
    /// Of a point, mm^2.
    variance: f64,
    /// Minus the log of the likelihood of what is left and of the parameters' priors, up to a constant.
    cost: f64,
}

impl InputFit {
    /// The largest of all parameters, prior sds.
    fn largest(&self) -> f64 {
        self.solution.iter().fold(0.0, |most, z| most.max(z.abs()))
    }

    /// The constant that is farthest from its prior's mean, and by how many prior sds.
    fn farthest(&self) -> (usize, f64) {
        let all = self.solution[..self.sensitivities.constants].iter();
        let all = all.copied().enumerate();
        all.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
            .unwrap_or((0, 0.0))
    }
}

impl Mistaken<'_> {
    /// The ridge estimate, with the candidates' columns of another fit where there is one.
    fn fit(&self, kept: Option<&Sensitivities>) -> Result<InputFit> {
        let Self { model, window, .. } = self;
        let experiment =
            moved_experiment_over(model, bounds(&self.field.points), window.motion(), DENSITY)?;
        let experiment = &*experiment;
        let (sight, inside) = experiment.locate(&self.field.points, &[]);
        let mut field = self.field.clone();
        field.retain(Reason::OutsidePlate, |i| inside[i]);
        let geometry = &*experiment.scene().setup.geometry;
        let used = |i: usize| is_clear(geometry, field.points[i]);
        let measured = Measured::new(&field, experiment, (&sight, None), used);
        let forward = Forward {
            model,
            observing: Box::new(AtPoints {
                experiment,
                slopes: Slopes::new(experiment, &sight, &measured.blocks),
                size_mm: measured.size_mm,
            }),
            solves_width: false,
            step: &|| (),
        };
        let declared = forward.declared();
        let mut state = forward.beginning(model.state(&|_| None));
        let candidates = EffectUnderLaw::without_laws(&candidates(model));
        // a hole of another size leaves other points
        let alike = |of: &&Sensitivities| of.predicted[0].len() == measured.blocks.len();
        let columns =
            kept.filter(alike)
                .map_or(CandidateColumns::Here, |of| CandidateColumns::Kept {
                    of,
                    moved: &[],
                });
        let sensitivities =
            forward.at_ridge(&measured, &mut state, &declared, &candidates, columns)?;
        let found = sensitivities.ridge(&measured);
        let square: f64 = found.solution.iter().map(|z| z * z).sum();
        Ok(InputFit {
            cost: 0.5 * (INDEPENDENT * found.variance.ln() + square),
            solution: found.solution.iter().copied().collect(),
            variance: found.variance,
            sensitivities,
        })
    }
}

/// Effects that may act beside what a model declares. Yielding takes long to solve, and no mistake looks like it.
fn candidates(model: &Model) -> Vec<&'static dyn Effect> {
    let scene = model.scene();
    let may_act = |e: &&&'static dyn Effect| {
        let is_declared = model.effects.iter().any(|d| d.name() == e.name());
        let has_columns = e.kind() != Kind::Recorded && !e.is_of_every_test() && !e.yields();
        !is_declared && has_columns && why_not(**e, &scene).is_none()
    };
    EFFECTS.iter().filter(may_act).copied().collect()
}
