//! Mistakes that people make in the input, each as the model and the field would be without it.

use crate::field::{Axis, Field};
use crate::infer::{Model, PriorSpec};
use crate::laminate::Material;
use crate::parameter::is_modulus;

/// A mistake that may have been made.
pub struct Mistake {
    /// The question that names it.
    pub asked: String,
    /// The declared test without it.
    pub model: Model,
    /// What is measured without it, of a displacement (direction 1, direction 2).
    pub shown: Shown,
    /// Whether the load lies along the other axis, so that places and displacements change theirs.
    pub turned: bool,
    /// Whether it scales all moduli, and does nothing else.
    pub scales: bool,
}

/// What a displacement (direction 1, direction 2) is without a mistake.
pub type Shown = fn([f64; 2]) -> [f64; 2];

const THOUSAND: &str = "is the force in kN in place of N, or is a unit of the displacements 1000 times off (nm, um, mm, m)";

/// True force over the declared one, and what was done where it is that.
const FORCES: [(f64, &str); 6] = [
    (2.0, "is the force that of one grip, or of another range"),
    (
        0.5,
        "is the force that of both grips added, or of another range",
    ),
    (9.81, "is the force in kgf in place of N"),
    (
        1.0 / 9.81,
        "was the force multiplied by 9.81 once too often",
    ),
    (1000.0, THOUSAND),
    (0.001, THOUSAND),
];

/// What is done to the columns of the displacements.
const COLUMNS: [(&str, Shown); 4] = [
    (
        "Are the columns of the two displacements exchanged, while those of the coordinates are not",
        |[a, b]| [b, a],
    ),
    (
        "Has the displacement along the load the wrong sign, or does that axis count the other way",
        |[a, b]| [-a, b],
    ),
    (
        "Has the displacement across the load the wrong sign, or does that axis count the other way (y of a picture counts downwards)",
        |[a, b]| [a, -b],
    ),
    (
        "Are the reference and the deformed picture exchanged, or is the force compressive",
        |[a, b]| [-a, -b],
    ),
];

/// A ply's true angle of the declared one, degrees.
type TrueAngle = fn(f64) -> f64;

/// Ways to count the plies' angles: what is asked, and the true angle of a declared one, degrees.
const LAYUPS: [(&str, TrueAngle); 4] = [
    (
        "Does `layup_deg` count from the other axis? It has to count from the loading axis",
        |a| a - 90.0,
    ),
    (
        "Is `layup_deg` mirrored? It counts counter-clockwise in the data's x-y plane, and y of a picture counts downwards",
        |a| -a,
    ),
    ("Is `layup_deg` turned by 45 degrees", |a| a + 45.0),
    ("Is `layup_deg` turned by 45 degrees", |a| a - 45.0),
];

/// What may have been done to the input of a model and its field, whose points leave this void about the hole's centre.
pub fn mistakes(model: &Model, void: Option<Void>) -> Vec<Mistake> {
    let mut all = forces(model);
    all.extend(COLUMNS.map(|(asked, shown)| Mistake {
        shown,
        ..Mistake::of(format!("{asked}?"), model.clone())
    }));
    all.extend(other_axis(model));
    all.extend(holes(model, void));
    all.extend(layups(model));
    all.extend(minor_ratio(model));
    all
}

impl Mistake {
    fn of(asked: String, model: Model) -> Self {
        Self {
            asked,
            model,
            shown: |u| u,
            turned: false,
            scales: false,
        }
    }
}

/// The load along the other axis of the data. Of matrices the first displacement is that along the load wherever the load lies: places change
/// their axes, and displacements do not.
fn other_axis(model: &Model) -> [Mistake; 2] {
    let mut model = model.clone();
    let frame = &mut model.experiment_mut().measurement.frame;
    frame.loading_axis = match frame.loading_axis {
        Axis::X => Axis::Y,
        Axis::Y => Axis::X,
    };
    let asked = "Is the loading axis the other one? The field fits a load along that axis.";
    let turned = |shown: Shown| Mistake {
        turned: true,
        shown,
        ..Mistake::of(asked.into(), model.clone())
    };
    [turned(|u| u), turned(|[a, b]| [b, a])]
}

/// A wrong force or thickness: a common factor of all moduli.
fn forces(model: &Model) -> Vec<Mistake> {
    let plies = model.experiment().specimen.layup_deg.as_ref();
    let plies = plies.map(Vec::len).filter(|n| *n > 1);
    let of_force = FORCES.iter().map(|(f, asked)| (*f, (*asked).to_string()));
    let of_ply = plies.map(|n| {
        let asked = format!("is `thickness_mm` that of one ply? The laminate has {n}");
        (1.0 / n as f64, asked)
    });
    let wrong = |(factor, asked): (f64, String)| {
        let mut model = model.clone();
        let experiment = model.experiment_mut();
        let mut load = experiment.nominal_load();
        load.force_n *= factor;
        experiment.load = Some(load);
        experiment.steps = None;
        let low_or_high = if factor > 1.0 { "low" } else { "high" };
        let moduli = match model.constants().iter().filter(|n| is_modulus(n)).count() {
            1 => "The modulus is",
            _ => "All moduli are",
        };
        let end = if asked.contains('?') { "." } else { "?" };
        let by = match 1.0 / factor {
            by if by < 0.1 => format!("{by:.3}"),
            by if by < 100.0 => format!("{by:.2}"),
            by => format!("{by:.0}"),
        };
        let asked = format!("{moduli} {low_or_high} by one factor of {by}: {asked}{end}");
        Mistake {
            scales: true,
            ..Mistake::of(asked, model)
        }
    };
    of_force.chain(of_ply).map(wrong).collect()
}

/// Least ratio of the void to the declared diameter, and its inverse, that is worth a test.
const VOID: f64 = 1.08;

/// Whether the points leave a void about the hole's centre of another size than the declared hole.
pub fn is_another_size(model: &Model, void: Option<Void>) -> bool {
    let hole = model.experiment().specimen.hole;
    let both = hole.map(|h| h.diameter_mm).zip(void);
    both.is_some_and(|(declared, void)| {
        (void.least_mm / declared).max(declared / void.most_mm) > VOID
    })
}

/// A hole of another diameter.
fn holes(model: &Model, void: Option<Void>) -> Vec<Mistake> {
    let Some(hole) = model.experiment().specimen.hole else {
        return Vec::new();
    };
    let declared = hole.diameter_mm;
    let mut sizes = vec![
        (
            2.0 * declared,
            format!(
                "Is `hole.diameter_mm` = {declared} the radius? A diameter of {} fits the field.",
                2.0 * declared
            ),
        ),
        (
            0.5 * declared,
            format!(
                "Is `hole.diameter_mm` = {declared} twice the diameter? Half of it fits the field."
            ),
        ),
    ];
    if let Some(Void { most_mm, .. }) = void.filter(|_| is_another_size(model, void)) {
        let asked = format!(
            "`hole.diameter_mm` is {declared}, and the points leave a void of at most {most_mm:.1} mm. A hole of that size fits the field: measure the hole."
        );
        sizes.push((most_mm, asked));
    }
    let wrong = |(diameter_mm, asked): (f64, String)| {
        let mut model = model.clone();
        let hole = model.experiment_mut().specimen.hole.as_mut();
        hole.into_iter().for_each(|h| h.diameter_mm = diameter_mm);
        Mistake::of(asked, model)
    };
    sizes.into_iter().map(wrong).collect()
}

/// Another layup, where that is another membrane.
fn layups(model: &Model) -> Vec<Mistake> {
    let Some(declared) = &model.experiment().specimen.layup_deg else {
        return Vec::new();
    };
    let mut seen = vec![in_order(declared)];
    let mut wrong = Vec::new();
    for (asked, turn) in LAYUPS {
        let angles: Vec<f64> = declared.iter().map(|a| turn(*a)).collect();
        let plies = in_order(&angles);
        if seen.contains(&plies) {
            continue;
        }
        seen.push(plies);
        let mut model = model.clone();
        model.experiment_mut().specimen.layup_deg = Some(angles);
        let end = if asked.contains('?') { "." } else { "?" };
        wrong.push(Mistake::of(format!("{asked}{end}"), model));
    }
    wrong
}

/// Angles from 0 to 180 degrees in hundredths, whose order does not matter in the plane.
fn in_order(angles: &[f64]) -> Vec<i64> {
    let plain = |a: &f64| ((100.0 * a).round() as i64).rem_euclid(18_000);
    let mut angles: Vec<i64> = angles.iter().map(plain).collect();
    angles.sort_unstable();
    angles
}

/// The minor Poisson's ratio in place of the major one.
fn minor_ratio(model: &Model) -> Option<Mistake> {
    if model.material() != Material::Ply {
        return None;
    }
    let mut model = model.clone();
    let parameters = &mut model.file.material.parameters;
    let mean = |name: &str| {
        let PriorSpec::Normal { mean, .. } = parameters.get(name)?.prior;
        Some(mean)
    };
    let ratio = mean("E1_GPa")? / mean("E2_GPa")?;
    let nu = parameters.get_mut("nu12")?;
    let PriorSpec::Normal { mean, sd } = nu.prior;
    nu.prior = PriorSpec::Normal {
        mean: mean * ratio,
        sd: sd * ratio,
    };
    nu.truncate = None;
    let asked = format!(
        "Is the prior of nu12 that of nu21 = {mean}? nu12 is nu21 E1/E2 = {:.2}.",
        mean * ratio
    );
    let wrong = Mistake::of(asked, model);
    // beyond that no laminate's ply is
    (ratio > 1.5 && mean * ratio < 0.6).then_some(wrong)
}

/// The empty disc about the hole's centre, as diameters of the hole that may have left it, mm.
#[derive(Clone, Copy)]
pub struct Void {
    /// The largest, less twice the distance of neighbouring points. The nearest point lies up to one such distance outside the hole's edge.
    pub least_mm: f64,
    /// The disc's, less what a subset that was dropped at the edge adds.
    pub most_mm: f64,
}

impl Void {
    /// That of a field; none where points do not surround the centre.
    pub fn of(field: &Field) -> Option<Self> {
        let [low, high] = crate::field::bounds(&field.points);
        let surrounded = (0..2).all(|k| low[k] < 0.0 && high[k] > 0.0);
        let nearest = field.points.iter().map(|p| p[0].hypot(p[1]));
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        let most_mm = 2.0 * nearest - field.subset_mm.unwrap_or(0.0);
        (surrounded && most_mm > 0.0).then(|| Self {
            least_mm: most_mm - 2.0 * field.spacing_mm(),
            most_mm,
        })
    }
}
