//! The joint posterior of several experiments: exact where the answer is, and twice the data for two copies.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use plychain::diagnose::{Rule, diagnose};
use plychain::experiment::simulate::Truth;
use plychain::field::matrices::write_matrices;
use plychain::identify::{inverse_problem, prepare};
use plychain::infer::{Joint, Marginal, Member, Model, simulated_field};
use plychain::posterior::PosteriorDensity;
use plychain::progress::Silent;
use plychain::sample::{DensityError, Ensemble, Quiet, Schedule, Start, run};
use plychain::sample::{Laplace, LogDensity, laplace};

/// A Gaussian likelihood of a linear model: y = design x + noise of known sd.
struct Linear {
    names: Vec<String>,
    design: DMatrix<f64>,
    data: DVector<f64>,
    sd: f64,
}

impl LogDensity for Linear {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> Result<f64, DensityError> {
        let residual = &self.data - &self.design * DVector::from_column_slice(x);
        Ok(-0.5 * residual.norm_squared() / (self.sd * self.sd))
    }
}

fn strings(names: &[&str]) -> Vec<String> {
    names.iter().map(|n| (*n).to_string()).collect()
}

fn normal(mean: f64, sd: f64) -> Marginal {
    Marginal {
        mean,
        sd,
        truncate: None,
    }
}

fn member(name: &str, density: Linear) -> Member {
    let dim = density.names.len();
    let start = (vec![0.0; dim], vec![1.0; dim]);
    Member::new(name, Box::new(density), start)
}

fn bending() -> Linear {
    Linear {
        names: strings(&["a", "offset", "b"]),
        design: DMatrix::from_row_slice(4, 3, &[1., 1., 0., 0.5, 1., 1., 0., 1., 2., -1., 1., 0.]),
        data: DVector::from_row_slice(&[1.0, 2.2, 3.1, -0.7]),
        sd: 0.3,
    }
}

fn tension() -> Linear {
    Linear {
        names: strings(&["b", "offset"]),
        design: DMatrix::from_row_slice(3, 2, &[1., 1., 2., 1., 3., 1.]),
        data: DVector::from_row_slice(&[0.4, 1.6, 2.3]),
        sd: 0.2,
    }
}

/// The shared a and b, and an offset of each: the conjugate answer is known.
fn mock() -> (Joint, DMatrix<f64>, DVector<f64>) {
    let priors = [normal(0.5, 2.0), normal(1.0, 0.5)];
    let shared = strings(&["a", "b"]).into_iter().zip(priors).collect();
    let members = vec![member("bending", bending()), member("tension", tension())];
    let joint = Joint::new(shared, members).unwrap();
    let expected = ["a", "b", "bending.offset", "tension.offset"];
    assert_eq!(joint.names(), expected);
    let mut precision = DMatrix::zeros(4, 4);
    let mut right = DVector::zeros(4);
    for (k, prior) in priors.iter().enumerate() {
        precision[(k, k)] += 1.0 / (prior.sd * prior.sd);
        right[k] += prior.mean / (prior.sd * prior.sd);
    }
    for (linear, index) in [(bending(), vec![0, 2, 1]), (tension(), vec![1, 3])] {
        let gram = linear.design.tr_mul(&linear.design) / (linear.sd * linear.sd);
        let weighted = linear.design.tr_mul(&linear.data) / (linear.sd * linear.sd);
        for (i, &a) in index.iter().enumerate() {
            right[a] += weighted[i];
            for (j, &b) in index.iter().enumerate() {
                precision[(a, b)] += gram[(i, j)];
            }
        }
    }
    let covariance = precision.try_inverse().unwrap();
    let mean = &covariance * right;
    (joint, covariance, mean)
}

fn mode(target: &Joint) -> Laplace {
    let (centre, sd) = target.start();
    laplace(target, &centre, &sd).unwrap()
}

#[test]
fn two_experiments_give_the_conjugate_answer() {
    let (joint, covariance, mean) = mock();
    let found = mode(&joint);
    for k in 0..4 {
        let sd = covariance[(k, k)].sqrt();
        assert!((found.mode[k] - mean[k]).abs() < 1e-4 * sd);
        for l in 0..4 {
            let scale = (covariance[(k, k)] * covariance[(l, l)]).sqrt();
            let wrong = found.covariance[4 * k + l] - covariance[(k, l)];
            assert!(wrong.abs() < 1e-4 * scale, "{k} {l}: {wrong}");
        }
    }
    let schedule = Schedule {
        seed: 3,
        max_draws: 120_000,
        ..Schedule::default()
    };
    let start = Start::Ball {
        centre: &found.mode,
        covariance: &found.covariance,
        spread: 1.0,
    };
    let sampler = Ensemble::default();
    let outcome = run(
        &joint,
        &sampler,
        &start,
        &schedule,
        &Rule::default(),
        &Quiet,
    )
    .unwrap();
    for (k, row) in diagnose(&outcome.draws, &Rule::default())
        .rows
        .iter()
        .enumerate()
    {
        let deviations = [
            (row.mean - mean[k]) / row.mcse_mean,
            (row.sd - covariance[(k, k)].sqrt()) / row.mcse_sd,
        ];
        assert!(
            deviations.iter().all(|z| z.abs() < 4.0),
            "{}: {deviations:?} standard errors",
            row.name
        );
    }
}

#[test]
fn a_batch_is_its_points_and_what_one_excludes_is_excluded() {
    let (joint, ..) = mock();
    let points = [
        [0.1, 0.2, 0.3, 0.4],
        [1.0, -1.0, 0.5, 2.0],
        [3.0, 0.0, 0.0, 1.0],
    ];
    let columns: Vec<f64> = (0..4).flat_map(|k| points.map(|p| p[k])).collect();
    let mut values = [0.0; 3];
    joint.values(&columns, &mut values).unwrap();
    for (point, value) in points.iter().zip(values) {
        assert_eq!(joint.value(point).unwrap().to_bits(), value.to_bits());
    }
    let cut = Marginal {
        truncate: Some([0.0, 1.0]),
        ..normal(0.5, 1.0)
    };
    let shared = vec![("a".to_string(), cut), ("b".to_string(), normal(0.0, 1.0))];
    let joint = Joint::new(shared, vec![member("one", bending())]).unwrap();
    assert_eq!(joint.names(), ["a", "b", "offset"]);
    assert_eq!(joint.value(&[2.0, 0.0, 0.0]).unwrap(), f64::NEG_INFINITY);
    assert!(joint.value(&[0.5, 0.0, 0.0]).unwrap().is_finite());
}

#[test]
fn names_that_do_not_fit_are_refused() {
    let shared = |names: &[&str]| -> Vec<(String, Marginal)> {
        let normals = names.iter().map(|_| normal(0.0, 1.0));
        strings(names).into_iter().zip(normals).collect()
    };
    let twice = || vec![member("one", bending()), member("one", tension())];
    let error = Joint::new(shared(&["a", "b"]), twice()).err().unwrap();
    assert!(error.to_string().contains("a second one"), "{error}");
    let alone = vec![member("one", tension())];
    let error = Joint::new(shared(&["a", "b"]), alone).err().unwrap();
    assert!(error.to_string().contains("none with a"), "{error}");
}

/// The posterior of a simulated field on a coarse mesh whose noise, not the model, limits what it says.
fn field(directory: &Path) -> PosteriorDensity {
    let text = std::fs::read_to_string("models/openhole.json").unwrap();
    let mut file: serde_json::Value = serde_json::from_str(&text).unwrap();
    file["experiments"][0]["mesh_density"] = 0.3.into();
    file["experiments"][0]["specimen"]["thickness_mm"]["sd"] = 0.0.into();
    file["reduced_model"] = serde_json::json!({ "snapshots": 80, "modes": 4, "degree": 3 });
    file["likelihood"]["model_error_fraction"] = 0.0.into();
    let model = Model::parse(&file.to_string(), &directory.join("coarse.json")).unwrap();
    let truth = Truth {
        constants: vec![158.0, 7.7, 0.33, 4.6],
        thickness_mm: 0.78,
        effects: Vec::new(),
        noise_nm: 40.0,
        correlation_mm: 0.0,
        grid: 61,
        seed: 4,
    };
    let grid = simulated_field(&model, &truth).unwrap();
    write_matrices(&directory.join("openhole"), &grid, None).unwrap();
    let prepared = prepare(&model, &Silent).unwrap();
    inverse_problem(&model, prepared, &Silent)
        .unwrap()
        .posed
        .density
}

/// Two copies of a field halve the variance of the constants; each has a noise of its own.
#[test]
fn two_copies_of_a_field_are_twice_the_data() {
    let directory = tempfile::tempdir().unwrap();
    let posterior = field(directory.path());
    let constants = posterior.constant_names().to_vec();
    let joint = |copies: &[&str], wider: f64| {
        let marginals = posterior.marginals().iter();
        let priors = marginals.map(|m| normal(m.mean, wider * m.sd));
        let shared = constants.iter().cloned().zip(priors).collect();
        let members = copies.iter();
        let flat = posterior.marginals().iter().map(|m| Marginal::flat(m.mean));
        let flat = posterior.with_marginals(flat.collect());
        let members =
            members.map(|name| Member::new(name, Box::new(flat.clone()), posterior.start()));
        Joint::new(shared, members.collect()).unwrap()
    };
    // One copy with the priors as they are is the posterior itself, to rounding.
    let (x, _) = posterior.start();
    let alone = joint(&["one"], 1.0);
    assert_eq!(alone.names(), posterior.names());
    let [a, b] = [alone.value(&x).unwrap(), posterior.value(&x).unwrap()];
    assert!((a - b).abs() < 1e-9 * b.abs(), "{a} {b}");
    // Wide priors leave the constants to the data.
    let both = joint(&["one", "two"], 30.0);
    let noises = ["one.noise_nm", "two.noise_nm"];
    assert_eq!(both.names()[constants.len()..], noises);
    let (one, two) = (mode(&joint(&["one"], 30.0)), mode(&both));
    for (k, name) in constants.iter().enumerate() {
        let sd = |of: &Laplace| of.covariance[k * (of.mode.len() + 1)].sqrt();
        let ratio = sd(&two) / sd(&one);
        assert!(
            (ratio - 0.5f64.sqrt()).abs() < 0.01,
            "{name}: {ratio}, {} and {}",
            sd(&one),
            sd(&two)
        );
        assert!((two.mode[k] - one.mode[k]).abs() < 0.2 * sd(&one), "{name}");
    }
}
