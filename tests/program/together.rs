//! A field and the natural frequencies of a plate of the same material: what they say together, how far they disagree, and what a loop over
//! the field makes of it.

use nalgebra::{DMatrix, DVector};
use plychain::chain::read_zarr;
use plychain::infer::{ConstantsLikelihood, Marginal, Moments, Tension};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use serde_json::Value;

use crate::common::{changed, fresh, plychain, posterior, set_coarse, simulated, succeed};

const MODEL: &str = "openhole-and-plate.json";
const NAMES: [&str; 4] = ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"];
const TRUTH: [f64; 4] = [162.0, 7.58, 0.34, 4.41];

/// The model of both experiments on a coarse mesh with measurements simulated of it, in a folder of their own.
fn both(arguments: &str) -> String {
    let model = changed(MODEL, set_coarse);
    let folder = simulated(&model, &format!("--grid 61 --noise-nm 10 {arguments}"));
    folder.join("model.json").display().to_string()
}

fn report(folder: &str) -> Value {
    let text = std::fs::read_to_string(format!("{folder}/report.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// A linear measurement y = A c + e, e ~ N(0, s^2), of constants with N(0, 1) priors in units of theirs.
struct Linear {
    a: DMatrix<f64>,
    y: DVector<f64>,
    sd: f64,
}

impl Linear {
    fn of(constants: &DVector<f64>, rows: usize, sd: f64, rng: &mut Pcg64) -> Self {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let a = DMatrix::from_fn(rows, constants.len(), |_, _| normal());
        let y = &a * constants + DVector::from_fn(rows, |_, _| sd * normal());
        Self { a, y, sd }
    }

    /// Mean and covariance of the posterior in prior sds from the prior means.
    fn posterior(&self) -> (DVector<f64>, DMatrix<f64>) {
        let n = self.a.ncols();
        let weight = 1.0 / (self.sd * self.sd);
        let precision = self.a.tr_mul(&self.a) * weight + DMatrix::identity(n, n);
        let covariance = precision.try_inverse().unwrap();
        (&covariance * self.a.tr_mul(&self.y) * weight, covariance)
    }
}

/// log N(y; 0, A A' + s^2) of data stacked.
fn log_evidence(of: &[&Linear]) -> f64 {
    let rows: usize = of.iter().map(|l| l.y.len()).sum();
    let n = of[0].a.ncols();
    let (mut a, mut y, mut noise) = (
        DMatrix::zeros(rows, n),
        DVector::zeros(rows),
        DMatrix::zeros(rows, rows),
    );
    let mut at = 0;
    for l in of {
        let m = l.y.len();
        a.rows_mut(at, m).copy_from(&l.a);
        y.rows_mut(at, m).copy_from(&l.y);
        (at..at + m).for_each(|k| noise[(k, k)] = l.sd * l.sd);
        at += m;
    }
    let factor = (&a * a.transpose() + noise).cholesky().unwrap();
    let log_det: f64 = factor.l().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
    -0.5 * (y.dot(&factor.solve(&y)) + log_det + rows as f64 * std::f64::consts::TAU.ln())
}

const PRIORS: [[f64; 2]; 3] = [[160.0, 16.0], [8.0, 0.8], [0.3, 0.03]];

fn priors() -> Vec<Marginal> {
    let of = |[mean, sd]: [f64; 2]| Marginal {
        mean,
        sd,
        truncate: None,
    };
    PRIORS.map(of).to_vec()
}

fn moments((mean, covariance): (DVector<f64>, DMatrix<f64>)) -> Moments {
    Moments {
        mean: DVector::from_fn(3, |k, _| PRIORS[k][0] + PRIORS[k][1] * mean[k]),
        covariance: DMatrix::from_fn(3, 3, |i, j| {
            PRIORS[i][1] * PRIORS[j][1] * covariance[(i, j)]
        }),
    }
}

const MODULI: [bool; 3] = [true, true, false];

/// Logarithm of the normal density of mean zero.
fn log_normal(x: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let factor = covariance.clone().cholesky().unwrap();
    let log_det: f64 = factor.l().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
    -0.5 * (x.dot(&factor.solve(x)) + log_det + x.len() as f64 * std::f64::consts::TAU.ln())
}

/// An error of an experiment as a whole is found with its size, by the Bayes factor of the difference of the means; where there is none two
/// experiments are said to contradict each other in 1 case of 50, within 4 sds of that count.
#[test]
fn an_error_of_all_moduli_is_found_in_the_disagreement() {
    const CASES: usize = 2000;
    let mut rng = Pcg64::seed_from_u64(6);
    let (mut found, mut false_alarms, mut z) = (0, 0, [0.0; 2]);
    for case in 0..CASES {
        let c = DVector::from_fn(3, |_, _| StandardNormal.sample(&mut rng));
        let percent = if case % 2 == 0 { 0.0 } else { 8.0 };
        let wrong = DVector::from_fn(3, |k, _| match MODULI[k] {
            true => c[k] + 0.01 * percent * (PRIORS[k][0] / PRIORS[k][1] + c[k]),
            false => c[k],
        });
        let first = Linear::of(&wrong, 5, 0.2, &mut rng);
        let second = Linear::of(&c, 5, 0.2, &mut rng);
        let [p, q] = [&first, &second].map(Linear::posterior);
        let off = &p.0 - &q.0;
        let spread = &p.1 + &q.1 - &p.1 * &q.1 - &q.1 * &p.1;
        let [a, b] = [p, q].map(moments);
        let tension = Tension::between(&a, &b, &priors(), &MODULI).unwrap();
        let factor = tension.factor;
        if case < 50 {
            let one = DVector::from_fn(3, |k, _| match MODULI[k] {
                true => 0.01 * PRIORS[k][0] / PRIORS[k][1],
                false => 0.0,
            });
            let shrunk = DMatrix::from_fn(3, 3, |i, j| {
                a.covariance[(i, j)] / (PRIORS[i][1] * PRIORS[j][1])
            });
            let u = &one - shrunk * &one;
            let with = &spread + 25.0 * &u * u.transpose();
            let expected = log_normal(&off, &with) - log_normal(&off, &spread);
            assert!((factor.log_bayes_factor - expected).abs() < 1e-6);
        }
        if percent == 0.0 {
            false_alarms += usize::from(tension.contradicts());
            z[0] += factor.z;
            z[1] += factor.z * factor.z;
        } else {
            found += usize::from(tension.contradicts());
        }
    }
    let n = 0.5 * CASES as f64;
    let (mean, square) = (z[0] / n.sqrt(), (z[1] / n - 1.0) / (2.0 / n).sqrt());
    assert!(mean.abs() < 4.0 && square.abs() < 4.0, "{mean} {square}");
    assert!(
        false_alarms as f64 <= 0.02 * n + 4.0 * (0.02 * n).sqrt(),
        "{false_alarms}"
    );
    assert!(found as f64 > 0.5 * n, "{found}");
}

/// The Bayes factor is that of the data themselves, and over materials drawn from the prior the disagreement is chi^2.
#[test]
fn tension_of_linear_measurements_is_that_of_their_data() {
    const CASES: usize = 2000;
    let mut rng = Pcg64::seed_from_u64(5);
    let mut sum = 0.0;
    let mut below = 0;
    for case in 0..CASES {
        let c = DVector::from_fn(3, |_, _| StandardNormal.sample(&mut rng));
        let sd = rng.random_range(0.05..1.0);
        let first = Linear::of(&c, 5, sd, &mut rng);
        let second = Linear::of(&c, 4, 0.3, &mut rng);
        let [a, b] = [&first, &second].map(|l| moments(l.posterior()));
        let tension = Tension::between(&a, &b, &priors(), &MODULI).unwrap();
        assert_eq!(tension.directions, 3);
        sum += tension.chi2;
        below += usize::from(tension.p < 0.1);
        if case < 50 {
            let data = log_evidence(&[&first, &second])
                - log_evidence(&[&first])
                - log_evidence(&[&second]);
            let wrong = tension.log_bayes_factor - data;
            assert!(
                wrong.abs() < 1e-6 * data.abs().max(1.0),
                "{wrong} of {data}"
            );
        }
    }
    let n = CASES as f64;
    let z = (sum / n - 3.0) / (6.0 / n).sqrt();
    let share = (below as f64 / n - 0.1) / (0.09 / n).sqrt();
    assert!(z.abs() < 4.0 && share.abs() < 4.0, "{z} {share}");
}

/// What is passed on is the likelihood: a posterior without its prior, also where it says nothing of a direction.
#[test]
fn what_an_experiment_says_is_its_likelihood() {
    let mut rng = Pcg64::seed_from_u64(6);
    for rows in [2, 5] {
        let c = DVector::from_fn(3, |_, _| StandardNormal.sample(&mut rng));
        let linear = Linear::of(&c, rows, 0.2, &mut rng);
        let own = moments(linear.posterior());
        let mean: Vec<f64> = own.mean.iter().copied().collect();
        let known = ConstantsLikelihood::beyond_prior(&mean, &own.covariance, &priors()).unwrap();
        let again = known.moments().unwrap();
        assert!((&again.mean - &own.mean).amax() < 1e-9 * own.mean.amax());
        assert!((&again.covariance - &own.covariance).amax() < 1e-9 * own.covariance.amax());
        let likelihood = |d: &DVector<f64>| {
            -0.5 * (&linear.y - &linear.a * d).norm_squared() / (linear.sd * linear.sd)
        };
        let place = |d: &DVector<f64>| -> Vec<f64> {
            (0..3).map(|k| PRIORS[k][0] + PRIORS[k][1] * d[k]).collect()
        };
        let (p, q) = (
            DVector::from_element(3, 0.4),
            DVector::from_row_slice(&[-1.0, 0.5, 2.0]),
        );
        let said = known.log_density(&place(&p)) - known.log_density(&place(&q));
        let expected = likelihood(&p) - likelihood(&q);
        assert!(
            (said - expected).abs() < 1e-8 * expected.abs(),
            "{said} {expected}"
        );
        let (_, _, square) = known.equations();
        let best = known.towards.dot(
            &known
                .precision
                .clone()
                .pseudo_inverse(1e-9)
                .unwrap()
                .tr_mul(&known.towards),
        );
        assert!((square - best).abs() < 1e-6 * best, "{square} {best}");
    }
}

/// The posterior of field and frequencies sampled together, against what each says alone as a normal density.
#[test]
#[ignore = "slow: run by .ci/run"]
fn the_joint_posterior_is_near_that_of_moments() {
    let file = both("--seed 3");
    let out = fresh("joint").display().to_string();
    succeed(&["identify", &file, "--quiet", "--out", &out]);
    let found = report(&out);
    let priors = plychain::study::Study::load(std::path::Path::new(&file)).unwrap();
    let priors = priors.shared().priors();
    let said = ["tension", "ringing"].map(|name| {
        let place = format!("{out}/alone/{name}/chain.zarr");
        let draws = read_zarr(std::path::Path::new(&place), None).unwrap();
        let own = Moments::of(draws.points(), 4);
        let mean: Vec<f64> = own.mean.iter().copied().collect();
        ConstantsLikelihood::beyond_prior(&mean, &own.covariance, &priors).unwrap()
    });
    let normal = said[0].and(&said[1]).moments().unwrap();
    for (k, name) in NAMES.iter().enumerate() {
        let (mean, sd) = posterior(&found["rounds"][0], name);
        // neither need be normal: bounds of what changes no conclusion
        let shift = (mean - normal.mean[k]) / sd;
        let ratio = sd / normal.covariance[(k, k)].sqrt();
        assert!(
            shift.abs() < 0.15 && (ratio - 1.0).abs() < 0.1,
            "{name}: {shift} sd, {ratio}"
        );
    }
    let together = &found["together"];
    assert!(
        together["tension"]["p"].as_f64().unwrap() > 1e-3,
        "{together}"
    );
    assert!(together["tension"]["log_bayes_factor"].as_f64().unwrap() > 0.0);
}

/// Pixels that are half a percent larger than is said: both experiments contradict each other until the loop names the scale.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_loop_over_both_names_the_scale_that_they_disagree_about() {
    let file = both("--seed 1 --effect magnification=0.5");
    let out = fresh("loop").display().to_string();
    succeed(&["loop", &file, "--quiet", "--out", &out]);
    let found = report(&out);
    assert_eq!(
        found["verdict"]["effects"],
        serde_json::json!(["magnification"])
    );
    let together = &found["together"];
    let p = |key: &str| together[key]["p"].as_f64().unwrap();
    assert!(
        p("tension") < 1e-3 && p("tension_after") > 1e-3,
        "{together}"
    );
    assert!(together["tension"]["log_bayes_factor"].as_f64().unwrap() < -5.0);
    for (name, truth) in NAMES.iter().zip(TRUTH) {
        let quoted = &found["averaged_posterior"][*name];
        let of = |key: &str| quoted[key].as_f64().unwrap();
        assert!(
            (of("q2.5")..of("q97.5")).contains(&truth),
            "{name} {quoted}"
        );
    }
    let page = std::fs::read_to_string(format!("{out}/report.html")).unwrap();
    assert!(page.contains("id=\"all-experiments\""));
    for file in [
        "alone/ringing/chain.zarr",
        "alone/ringing/report.html",
        "alone/tension/chain.zarr",
    ] {
        assert!(std::path::Path::new(&out).join(file).exists(), "{file}");
    }
    // tracing the finished run again knows the frequencies
    let text = succeed(&["trace", &out]);
    assert!(text.contains("E2_GPa"), "{text}");
    let averaged = |found: &Value| {
        found["averaged_posterior"]["E2_GPa"]["mean"]
            .as_f64()
            .unwrap()
    };
    let traced: Value =
        serde_json::from_str(&std::fs::read_to_string(format!("{out}/trace.json")).unwrap())
            .unwrap();
    let sd = found["averaged_posterior"]["E2_GPa"]["sd"]
        .as_f64()
        .unwrap();
    assert!(
        (averaged(&traced) - averaged(&found)).abs() < 0.5 * sd,
        "{}",
        averaged(&traced)
    );
}

#[test]
fn experiments_that_do_not_fit_together_are_refused_by_place() {
    let refused = |change: &dyn Fn(&mut Value)| {
        let file = changed(MODEL, change);
        let output = plychain(&["identify", &file]);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).unwrap()
    };
    let error = refused(&|m| m["experiments"][1]["frequency_Hz"] = 3.into());
    assert!(error.contains("frequency_Hz"), "{error}");
    let error = refused(&|m| m["experiments"][1]["name"] = "tension".into());
    assert!(error.contains("a second tension"), "{error}");
    let error = refused(&|m| m["experiments"][1]["kind"] = "sound".into());
    assert!(
        error.contains("experiments[1].kind") && error.contains("frequencies"),
        "{error}"
    );
    let error = refused(&|m| m["experiments"][1]["sd_percent"] = 0.into());
    assert!(error.contains("experiments[1].sd_percent"), "{error}");
    // the line of the whole file
    let text = std::fs::read_to_string(crate::common::model(MODEL)).unwrap();
    let broken = text.replace("\"sd_percent\": 0.2", "\"sd_percent\": \"0.2\"");
    let line = 1 + broken[..broken.find("\"sd_percent\"").unwrap()]
        .matches('\n')
        .count();
    let file = fresh("broken.json");
    std::fs::write(&file, broken).unwrap();
    let output = plychain(&["identify", file.to_str().unwrap()]);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(
        error.contains(&format!("broken.json:{line}:")),
        "{line}: {error}"
    );
}
