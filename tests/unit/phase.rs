//! The phase-shift error: amplitudes within their standard errors, silence without one, misfit and correlation.

use plychain::field::{Blocks, Field};
use plychain::identify::phase::{PhaseError, Ripple, find};
use rayon::prelude::*;

use crate::field::{normal, open_hole, rng, simulated};

const ORDER: f64 = 1.0 / 2400.0;
const NM: f64 = 1e-6;
const PRIOR_SD_NM: [[f64; 2]; 2] = [[20.0; 2]; 2];

/// What a field holds besides the elastic displacement.
struct Case {
    n: usize,
    noise_nm: f64,
    correlation_mm: f64,
    sin_nm: [f64; 2],
    cos_nm: [f64; 2],
    /// Quadratic misfit of the model at the border, nm.
    misfit_nm: f64,
}

const PLAIN: Case = Case {
    n: 121,
    noise_nm: 10.0,
    correlation_mm: 0.0,
    sin_nm: [0.0; 2],
    cos_nm: [0.0; 2],
    misfit_nm: 0.0,
};

impl Case {
    /// An amplitude in both components.
    fn ripple(sin_nm: f64, cos_nm: f64) -> Self {
        Self {
            sin_nm: [sin_nm; 2],
            cos_nm: [cos_nm; 2],
            ..PLAIN
        }
    }

    /// The field, and the model that is fitted to it.
    fn field(&self, seed: u64) -> (Field, Vec<[f64; 2]>) {
        let white = if self.correlation_mm > 0.0 {
            0.0
        } else {
            self.noise_nm
        };
        let mut field = simulated(self.n, white * NM, seed);
        let mut random = rng(7000 + seed);
        let shift = [4e-4 * normal(&mut random), 4e-4 * normal(&mut random)];
        let coloured =
            [0, 1].map(|_| correlated(&field, self.correlation_mm, self.noise_nm, &mut random));
        let mut model = Vec::new();
        for (i, u) in field.displacement.iter_mut().enumerate() {
            let p = field.points[i];
            let [s, t] = p.map(|x| x / 12.15);
            let truth = open_hole(p);
            let misfit = [s * s - 0.5 * s * t + 0.3 * t, 0.7 * t * t - s * s]
                .map(|q| q * self.misfit_nm * NM);
            for c in 0..2 {
                u[c] += shift[c];
                let (sin, cos) =
                    (4.0 * std::f64::consts::PI * (truth[c] + shift[c]) / ORDER).sin_cos();
                u[c] += (self.sin_nm[c] * sin + self.cos_nm[c] * cos + coloured[c][i]) * NM;
            }
            model.push([0, 1].map(|c| truth[c] + shift[c] - misfit[c]));
        }
        (field, model)
    }

    fn find(&self, seed: u64) -> PhaseError {
        let (field, model) = self.field(seed);
        let blocks = Blocks::new(&field, Blocks::size_for(&field), |i| {
            field.points[i][0].hypot(field.points[i][1]) > 2.4
        });
        find(&field, &blocks, &model, ORDER, PRIOR_SD_NM)
    }
}

/// Noise (nm) of Matern-3/2 correlation by random waves: its spectral density is a Student-t law of three degrees.
fn correlated(field: &Field, length_mm: f64, sd_nm: f64, rng: &mut rand_pcg::Pcg64) -> Vec<f64> {
    const WAVES: usize = 400;
    if length_mm <= 0.0 {
        return vec![0.0; field.len()];
    }
    let waves: Vec<[f64; 4]> = (0..WAVES)
        .map(|_| {
            let chi2: f64 = (0..3).map(|_| normal(rng).powi(2)).sum();
            let scale = 3_f64.sqrt() / (length_mm * chi2.sqrt());
            [
                normal(rng) * scale,
                normal(rng) * scale,
                normal(rng),
                normal(rng),
            ]
        })
        .collect();
    let value = |p: &[f64; 2]| -> f64 {
        let wave = |w: &[f64; 4]| {
            let (sin, cos) = (w[0] * p[0] + w[1] * p[1]).sin_cos();
            w[2] * cos + w[3] * sin
        };
        sd_nm / (WAVES as f64).sqrt() * waves.iter().map(wave).sum::<f64>()
    };
    field.points.iter().map(value).collect()
}

fn all(case: &Case, seeds: std::ops::Range<u64>) -> Vec<PhaseError> {
    seeds.into_par_iter().map(|seed| case.find(seed)).collect()
}

/// Deviations of both amplitudes from the truth, in sd.
fn z(found: &Ripple, case: &Case, c: usize) -> [f64; 2] {
    [
        (found.sin_nm - case.sin_nm[c]) / found.sd_nm[0],
        (found.cos_nm - case.cos_nm[c]) / found.sd_nm[1],
    ]
}

#[test]
fn amplitudes_are_recovered_within_their_standard_errors() {
    let mut squares = Vec::new();
    for (sin, cos) in [(15.3, 12.9), (-3.8, 3.2), (0.0, 5.0), (2.3, -1.9)] {
        let case = Case::ripple(sin, cos);
        for (seed, found) in all(&case, 0..6).iter().enumerate() {
            assert!(found.both.log_bayes_factor > 4.0);
            for ripple in [
                (&found.both, 0),
                (&found.component[0], 0),
                (&found.component[1], 1),
            ] {
                for z in z(ripple.0, &case, ripple.1) {
                    assert!(z.abs() < 4.5, "({sin}, {cos}) nm, seed {seed}: z = {z}");
                    squares.push(z * z);
                }
            }
        }
    }
    // 144 values, of which 96 are independent: sd of the mean square 0.14
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((0.4..1.6).contains(&mean), "mean z^2 = {mean}");
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn no_error_raises_no_alarm_whatever_the_noise() {
    silent(10, 2);
}

#[test]
#[ignore = "144 fields, 1 minute"]
fn no_error_raises_no_alarm_in_many_fields() {
    silent(40, 8);
}

/// Each kind of noise in `plain` fields, and in fields with a misfit.
fn silent(plain: u64, misfits: u64) {
    for correlation_mm in [0.0, 0.3, 1.0] {
        for misfit_nm in [0.0, 300.0] {
            let case = Case {
                correlation_mm,
                misfit_nm,
                ..PLAIN
            };
            let seeds = 0..if misfit_nm > 0.0 { misfits } else { plain };
            for (seed, found) in all(&case, seeds).iter().enumerate() {
                let largest = found
                    .component
                    .iter()
                    .fold(found.both.log_bayes_factor, |m, r| {
                        m.max(r.log_bayes_factor)
                    });
                assert!(largest < 4.0, "{correlation_mm} mm, seed {seed}: {largest}");
            }
        }
    }
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn a_small_error_is_found_in_correlated_noise_and_misfit() {
    for correlation_mm in [0.0, 0.3, 1.0] {
        let case = Case {
            correlation_mm,
            misfit_nm: 300.0,
            ..Case::ripple(3.0, -4.0)
        };
        let found = all(&case, 60..68);
        for found in &found {
            assert!(found.both.log_bayes_factor > 4.0);
            // noise correlated over a block is noise of the argument: a phase of 0.3 rad, exp(-0.045) of the amplitude
            let off = (found.both.sin_nm - 3.0).hypot(found.both.cos_nm + 4.0);
            assert!(off < 0.5, "{correlation_mm} mm: {off} nm off");
        }
        if correlation_mm == 0.0 {
            let far = |p: &PhaseError| z(&p.both, &case, 0).iter().any(|z| z.abs() > 4.0);
            assert!(!found.iter().any(far));
        }
    }
}

#[test]
fn an_error_in_one_component_is_seen_in_that_one() {
    for c in 0..2 {
        let mut case = Case { ..PLAIN };
        case.sin_nm[c] = 4.0;
        for found in all(&case, 80..84) {
            assert!(found.component[c].log_bayes_factor > 4.0);
            assert!(found.component[1 - c].log_bayes_factor < 0.0);
            assert!(
                z(&found.component[c], &case, c)
                    .iter()
                    .all(|z| z.abs() < 4.0)
            );
        }
    }
}

#[test]
fn a_field_without_fringes_says_nothing() {
    let (mut field, mut model) = PLAIN.field(1);
    field.displacement.iter_mut().for_each(|u| *u = [0.0; 2]);
    model.iter_mut().for_each(|u| *u = [0.0; 2]);
    let blocks = Blocks::new(&field, 1.0, |_| true);
    let found = find(&field, &blocks, &model, ORDER, PRIOR_SD_NM);
    assert!(found.both.log_bayes_factor.abs() < 1e-9 && found.both.sin_nm.abs() < 1e-9);
    let none = Blocks::new(&field, 1.0, |_| false);
    assert!(
        find(&field, &none, &model, ORDER, PRIOR_SD_NM)
            .both
            .log_bayes_factor
            .abs()
            < 1e-9
    );
}
