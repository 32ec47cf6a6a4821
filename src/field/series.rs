//! A load series: the fields of its steps at the points that all of them have.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::agreement::{self, Judged};
use super::common::PointIndex;
use super::conventions;
use super::measured::{Field, Reason};
use super::outliers::outliers_of_steps;
use super::spec::{MeasurementSpec, OutlierRule};
use super::step::{self, StepSpec};
use super::table;
use crate::error::{Error, Result};

/// A measured load series, steps in the order in which they were taken.
#[derive(Debug)]
pub struct Series {
    /// Points, frame, subset and the reference step's displacement and standard deviations, at the points that all steps
    /// have. Its `rejected` is the reference step's, with the outliers of all; its files are those of all.
    pub field: Field,
    /// The reference step: that of the largest known force, or else the last.
    pub reference: usize,
    pub steps: Vec<Step>,
    /// What is odd about the steps, and should be known.
    pub warnings: Vec<String>,
}

/// A step at the points of the series.
#[derive(Debug)]
pub struct Step {
    /// Its file without the ending, or the whole path where that is another step's too.
    pub name: String,
    /// Force along direction 1, N; `None` where it is not known.
    pub force_n: Option<f64>,
    /// Displacements (u1, u2) in mm along direction 1 and 2, one a point of the series' field.
    pub displacement: Vec<[f64; 2]>,
    /// Standard deviations of the displacements, mm, where the export states them.
    pub sigma: Option<Vec<f64>>,
    /// Points of the file that another step lacks.
    pub lost: usize,
    /// Outliers of this step among the common points; all steps lose them.
    pub outliers: usize,
}

/// A step must have this share of the reference step's points, and the reference step of its.
const LEAST_COMMON: f64 = 0.5;

/// A step that loses a larger share of its points is worth a word.
const MANY_LOST: f64 = 0.1;

impl Series {
    /// Read the steps of a measurement. Relative paths start at `base_dir`; `window_mm` restricts the points used.
    ///
    /// # Errors
    /// Of the input: what [`MeasurementSpec::read`] refuses in a step's file; a file or a displacement that stands twice; steps
    /// that share less than half of their points; a step whose field or force contradicts the others'.
    pub fn read(
        measurement: &MeasurementSpec,
        steps: &[StepSpec],
        base_dir: &Path,
        window_mm: Option<[[f64; 2]; 2]>,
    ) -> Result<Self> {
        step::check(steps)?;
        check_files(steps, base_dir)?;
        let read: Vec<Result<Field>> = steps
            .par_iter()
            .map(|step| {
                let measurement = measurement.clone().with_path(step.file.clone());
                measurement.read_all(base_dir, window_mm)
            })
            .collect();
        let fields = read.into_iter().collect::<Result<Vec<Field>>>()?;
        let (fields, steps, left_out) = without_references(fields, steps);
        let steps = &steps[..];
        let mut series = Self::common(fields, steps)?;
        series.warnings.extend(left_out);
        agreement::check_different(&series.judged(steps))?;
        if measurement.outliers == OutlierRule::Reject {
            series.reject_outliers()?;
        }
        let odd = agreement::check(&series.field.points, &series.judged(steps))?;
        series.warnings.extend(odd);
        series
            .warnings
            .extend(otherwise(measurement, steps, base_dir)?);
        Ok(series)
    }

    /// The steps for their comparison.
    fn judged<'a>(&'a self, steps: &'a [StepSpec]) -> Vec<Judged<'a>> {
        let both = steps.iter().zip(&self.steps);
        let judged = |(spec, step): (&'a StepSpec, &'a Step)| Judged {
            file: &spec.file,
            force_n: spec.force_n,
            displacement: &step.displacement,
        };
        both.map(judged).collect()
    }

    /// The steps at the points that all have.
    fn common(fields: Vec<Field>, steps: &[StepSpec]) -> Result<Self> {
        let reference = step::reference(steps);
        let base = &fields[reference];
        let places = PointIndex::new(&base.points, base.spacing_mm());
        let index: Vec<Vec<Option<usize>>> = fields
            .par_iter()
            .map(|field| places.among(&field.points))
            .collect();
        let count: Vec<usize> = index.iter().map(|i| i.iter().flatten().count()).collect();
        check_grids(&fields, &count, reference)?;
        let kept: Vec<usize> = (0..base.len())
            .filter(|&i| index.iter().all(|found| found[i].is_some()))
            .collect();
        let names = names(steps);
        let mut warnings = Vec::new();
        for ((field, found), other) in fields.iter().zip(&index).zip(&count) {
            let lacking = base.len() - other;
            if lacking as f64 > MANY_LOST * base.len() as f64 {
                let at_all = found.iter().filter(|f| f.is_none()).count();
                warnings.push(format!(
                    "{}: it lacks {at_all} of the {} points of {}, which are dropped from all steps: a file that was cut, or a picture that failed?",
                    field.place(),
                    base.len(),
                    base.place()
                ));
            }
        }
        let mut at_points = Vec::with_capacity(fields.len());
        for ((field, found), (spec, name)) in fields.iter().zip(&index).zip(steps.iter().zip(names))
        {
            let own: Vec<usize> = kept.iter().filter_map(|&i| found[i]).collect();
            let lost = field.len() - own.len();
            if lost as f64 > MANY_LOST * field.len() as f64 {
                warnings.push(format!(
                    "{}: {lost} of {} points are not used, because another step lacks them",
                    field.place(),
                    field.len()
                ));
            }
            let sigma = field.sigma.as_ref();
            at_points.push(Step {
                name,
                force_n: spec.force_n,
                displacement: own.iter().map(|&j| field.displacement[j]).collect(),
                sigma: sigma.map(|all| own.iter().map(|&j| all[j]).collect()),
                lost,
                outliers: 0,
            });
        }
        let files: Vec<PathBuf> = fields.iter().flat_map(|f| f.files.clone()).collect();
        let mut field = fields
            .into_iter()
            .nth(reference)
            .ok_or_else(|| Error::program("field::series", "a reference step among the steps"))?;
        let mut keep = vec![false; field.len()];
        kept.iter().for_each(|&i| keep[i] = true);
        field.retain(Reason::Unmatched, |i| keep[i]);
        field.check_enough(&field.place())?;
        field.files = files;
        // the noise of a series is measured by the steps themselves
        field.sigma = None;
        Ok(Self {
            field,
            reference,
            steps: at_points,
            warnings,
        })
    }

    /// Drop the points that are outliers in any step.
    fn reject_outliers(&mut self) -> Result<()> {
        let displacement: Vec<&[[f64; 2]]> =
            self.steps.iter().map(|s| &s.displacement[..]).collect();
        let found = outliers_of_steps(&self.field.points, &displacement);
        let mut keep = vec![true; self.field.len()];
        for (step, outliers) in self.steps.iter_mut().zip(&found) {
            step.outliers = outliers.len();
            outliers.iter().for_each(|o| keep[o.point] = false);
        }
        self.field.retain(Reason::Outlier, |i| keep[i]);
        self.field.forget_remote_outliers();
        for step in &mut self.steps {
            let mut kept = keep.iter().copied();
            step.displacement.retain(|_| kept.next().unwrap_or(true));
            let mut kept = keep.iter().copied();
            if let Some(sigma) = &mut step.sigma {
                sigma.retain(|_| kept.next().unwrap_or(true));
            }
        }
        self.field.check_enough(&self.field.place())
    }
}

/// The steps without those that are the reference picture itself, and what is said of these.
fn without_references(
    fields: Vec<Field>,
    steps: &[StepSpec],
) -> (Vec<Field>, Vec<StepSpec>, Vec<String>) {
    let is_reference = |f: &Field| f.displacement.iter().flatten().all(|u| *u == 0.0);
    if fields.iter().all(is_reference) {
        return (fields, steps.to_vec(), Vec::new());
    }
    let (references, rest): (Vec<_>, Vec<_>) = fields
        .into_iter()
        .zip(steps.iter().cloned())
        .partition(|(f, _)| is_reference(f));
    let said = |(field, _): &(Field, StepSpec)| {
        format!(
            "{}: all displacements are 0, so this is the reference picture itself: it is left out",
            field.place()
        )
    };
    let said = references.iter().map(said).collect();
    let (fields, steps) = rest.into_iter().unzip();
    (fields, steps, said)
}

/// Forces that the files state otherwise than the model.
fn otherwise(
    measurement: &MeasurementSpec,
    steps: &[StepSpec],
    base_dir: &Path,
) -> Result<Vec<String>> {
    /// Share of the force that is rounding.
    const ROUNDING: f64 = 1e-2;
    let mut said = Vec::new();
    for (k, step) in steps.iter().enumerate() {
        let Some(declared) = step.force_n else {
            continue;
        };
        for file in measurement
            .clone()
            .with_path(step.file.clone())
            .files(base_dir)?
        {
            if let Some(stated) = table::stated_force(&file)?
                && (stated - declared).abs() > ROUNDING * stated.abs().max(declared.abs())
            {
                said.push(format!(
                    "steps[{k}].force_N is {declared}, and {} states a force of {stated} N: the model's is taken",
                    file.display()
                ));
            }
        }
    }
    Ok(said)
}

/// Two paths may lead to one file.
fn check_files(steps: &[StepSpec], base_dir: &Path) -> Result<()> {
    let real = |s: &StepSpec| {
        let path = base_dir.join(&s.file);
        path.canonicalize().unwrap_or(path)
    };
    let paths: Vec<PathBuf> = steps.iter().map(real).collect();
    for (k, path) in paths.iter().enumerate() {
        if let Some(other) = paths[..k].iter().position(|p| p == path) {
            return Err(step::twice(
                [other, k],
                [&steps[other].file, &steps[k].file],
            ));
        }
    }
    Ok(())
}

/// Every step is measured at the places of the reference step, `count` of which it has.
fn check_grids(fields: &[Field], count: &[usize], reference: usize) -> Result<()> {
    let base = &fields[reference];
    let agrees = |k: usize| {
        let larger = fields[k].len().max(base.len());
        count[k] as f64 >= LEAST_COMMON * larger as f64
    };
    let Some(first) = (0..fields.len()).find(|&k| !agrees(k)) else {
        return Ok(());
    };
    let others = fields.len() - 1;
    let agreeing = (0..fields.len())
        .filter(|&k| k != reference && agrees(k))
        .count();
    // the reference step is the odd one if most of the others are
    let [odd, other] = if others > 1 && 2 * agreeing < others {
        [reference, first]
    } else {
        [first, reference]
    };
    let deformed = conventions::is_deformed(fields) == Some(true);
    let hint = if deformed {
        "the points have one grid if x and y are places in the deformed state, as GOM writes them: write \"deformed\": true in measurement.columns"
    } else {
        "was the file cut, or is it of another specimen or another grid? Export all steps at the reference picture's coordinates, on one grid. Or leave the step out of `steps`"
    };
    let expected = format!(
        "the points of the other steps, such as the {} of {}",
        fields[other].len(),
        fields[other].place()
    );
    Err(Error::input(fields[odd].place(), expected)
        .found(format!(
            "{} points, {} of which are at places that the other has",
            fields[odd].len(),
            count[first]
        ))
        .hint(hint))
}

/// A short name for each step, all different.
fn names(steps: &[StepSpec]) -> Vec<String> {
    let short = |s: &StepSpec| {
        let stem = s.file.file_stem().unwrap_or(s.file.as_os_str());
        stem.to_string_lossy().into_owned()
    };
    let all: Vec<String> = steps.iter().map(short).collect();
    let unique = |name: &String| all.iter().filter(|other| *other == name).count() == 1;
    let name = |(step, name): (&StepSpec, &String)| match unique(name) {
        true => name.clone(),
        false => step.file.display().to_string(),
    };
    steps.iter().zip(&all).map(name).collect()
}
