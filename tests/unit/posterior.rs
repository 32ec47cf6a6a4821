//! The density's parts against closed forms: coordinates, surfaces, what several experiments share.

use nalgebra::{DMatrix, DVector};

use plychain::infer::{ConstantsLikelihood, Joint, Marginal, Member};
use plychain::linearise::StepStack;
use plychain::posterior::{BlockSnapshots, MeanSurface, Ratios};
use plychain::reduce::latin_hypercube;
use plychain::sample::{DensityError, LogDensity};

const PLY: [f64; 4] = [150.0, 8.0, 0.32, 4.8];

#[test]
fn coordinates_and_constants_are_each_others_inverse() {
    for about in [&PLY[..], &[200.0, 0.3]] {
        let ratios = Ratios::about(about);
        let other: Vec<f64> = about
            .iter()
            .enumerate()
            .map(|(k, x)| x * (1.1 + 0.07 * k as f64))
            .collect();
        let back = ratios.constants(&ratios.of(&other));
        for (a, b) in other.iter().zip(&back) {
            assert!((a - b).abs() < 1e-12 * a.abs(), "{other:?} {back:?}");
        }
        // a common factor of the moduli changes the first alone
        let twice: Vec<f64> = (0..about.len())
            .map(|k| {
                if k == about.len().min(3) - 1 {
                    about[k]
                } else {
                    2.0 * about[k]
                }
            })
            .collect();
        let found = ratios.of(&twice);
        assert!((found[0] + 0.5).abs() < 1e-12, "{found:?}");
        assert!(found[1..].iter().all(|x| x.abs() < 1e-12), "{found:?}");
        // slopes are those of the constants
        for j in 0..about.len() {
            let step = 1e-6;
            let moved = |by: f64| {
                let mut x = vec![0.0; about.len()];
                x[j] = by;
                ratios.constants(&x)
            };
            let (high, low) = (moved(step), moved(-step));
            for (k, slope) in ratios.slope(j).into_iter().enumerate() {
                let expected = (high[k] - low[k]) / (2.0 * step);
                assert!(
                    (slope - expected).abs() < 1e-7 * about[k].max(1.0),
                    "{j} {k}"
                );
            }
        }
    }
}

/// The field of a strip under a force: 1 / E times (1, nu) at some places, and a part that is there without the force.
#[test]
fn a_surface_is_exact_where_the_field_is() {
    let about = [200.0, 0.3];
    let ratios = Ratios::about(&about);
    let field = |e: f64, nu: f64| -> StepStack {
        let at = |k: usize, c: usize| {
            let place = 0.1 * k as f64;
            let strain = 150.0 / e;
            match c {
                0 => strain * place + 0.02 * place * place,
                _ => -strain * nu * (1.0 - place) + 0.01 * nu,
            }
        };
        [0, 1].map(|c| DVector::from_fn(12, |k, _| at(k, c)))
    };
    let origin = field(about[0], about[1]);
    let change = |x: &[f64]| {
        let here = field(x[0], x[1]);
        [0, 1].map(|c| &here[c] - &origin[c])
    };
    let points = latin_hypercube(12, 2, 4);
    let points: Vec<Vec<f64>> = points
        .iter()
        .map(|u| vec![200.0 * (0.7 + 0.6 * u[0]), 0.2 + 0.2 * u[1]])
        .collect();
    let snapshots = BlockSnapshots {
        coordinates: points.iter().map(|x| ratios.of(x)).collect(),
        fields: points.iter().map(|x| change(x)).collect(),
    };
    let surface = MeanSurface::fit(ratios.clone(), 1, &snapshots).unwrap();
    for x in [[230.0, 0.37], [150.0, 0.22], about] {
        let left = surface.off(&ratios.of(&x), &change(&x));
        let largest = left.iter().map(|u| u.amax()).fold(0.0, f64::max);
        assert!(largest < 1e-12, "{x:?}: {largest:e}");
    }
}

/// y = (1 + g) theta and a normal error, with g of a prior of its own integrated out: what an experiment says of theta, and of g in prior sds.
struct Gained {
    names: Vec<String>,
    data: Vec<f64>,
    sd: f64,
    gain: f64,
}

impl Gained {
    /// Precision and right side of g, and the square without it.
    fn equations(&self, theta: f64) -> [f64; 3] {
        let each = self.data.iter().map(|y| (y - theta) / self.sd);
        let slope = self.gain * theta / self.sd;
        let n = self.data.len() as f64;
        [
            n * slope * slope,
            slope * each.clone().sum::<f64>(),
            each.map(|r| r * r).sum(),
        ]
    }
}

impl LogDensity for Gained {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> Result<f64, DensityError> {
        let [g, z, rest] = self.equations(x[0]);
        Ok(-0.5 * (rest - z * z / (1.0 + g) + (1.0 + g).ln()))
    }
}

fn member(name: &str, data: &[f64], owner: Option<&str>) -> Member {
    let of = |data: &[f64]| Gained {
        names: vec!["theta".into()],
        data: data.to_vec(),
        sd: 0.02,
        gain: 0.01,
    };
    let member = Member::new(name, Box::new(of(data)), (vec![1.0], vec![0.1]));
    let Some(owner) = owner else { return member };
    let own = of(data);
    let given = move |x: &[f64]| {
        let [g, z, _] = own.equations(x[0]);
        let mean = DVector::from_element(1, z / (1.0 + g));
        (mean, DMatrix::from_element(1, 1, 1.0 / (1.0 + g)))
    };
    member.owning(vec![owner.into()], Box::new(given))
}

/// Two experiments with one gain are one experiment with all data; with a gain of each they are not.
#[test]
fn what_has_one_owner_is_integrated_out_once() {
    let (a, b) = ([1.01, 0.98, 1.03], [1.05, 1.02]);
    let all = [&a[..], &b].concat();
    let prior = Marginal {
        mean: 1.0,
        sd: 0.2,
        truncate: None,
    };
    let joint = |members: Vec<Member>| Joint::new(vec![("theta".into(), prior)], members).unwrap();
    let one = joint(vec![
        member("a", &a, Some("cell")),
        member("b", &b, Some("cell")),
    ]);
    let whole = joint(vec![member("all", &all, Some("cell"))]);
    let apart = joint(vec![
        member("a", &a, Some("left")),
        member("b", &b, Some("right")),
    ]);
    let plain = joint(vec![member("a", &a, None), member("b", &b, None)]);
    let at = |of: &Joint, x: f64| of.value(&[x]).unwrap();
    for x in [0.9, 1.0, 1.07] {
        assert!((at(&one, x) - at(&whole, x)).abs() < 1e-10, "{x}");
        assert!((at(&apart, x) - at(&plain, x)).abs() < 1e-12, "{x}");
    }
    assert!((at(&one, 1.07) - at(&apart, 1.07)).abs() > 0.1);
}

/// Of a common factor nothing is left, of what is orthogonal to it everything.
#[test]
fn a_common_factor_is_taken_out_of_what_is_known() {
    let priors = [(150.0, 15.0), (8.0, 0.8), (0.3, 0.03)].map(|(mean, sd)| Marginal {
        mean,
        sd,
        truncate: None,
    });
    let root = DMatrix::from_row_slice(3, 3, &[0.3, 0.1, 0.0, 0.0, 0.2, 0.05, 0.0, 0.0, 0.4]);
    let scaled = root.tr_mul(&root);
    let covariance = DMatrix::from_fn(3, 3, |i, j| scaled[(i, j)] * priors[i].sd * priors[j].sd);
    let known =
        ConstantsLikelihood::beyond_prior(&[151.0, 8.1, 0.31], &covariance, &priors).unwrap();
    let without = known.without_common_factor(&[true, true, false]);
    let along = DVector::from_vec(vec![10.0, 10.0, 0.0]);
    let scale = (&known.precision * &along).amax();
    assert!((&without.precision * &along).amax() < 1e-9 * scale);
    assert!(without.towards.dot(&along).abs() < 1e-9 * known.towards.dot(&along).abs());
    let ratio = |k: &ConstantsLikelihood| k.moments().unwrap().covariance[(2, 2)];
    assert!(ratio(&without) >= ratio(&known) - 1e-12);
}
