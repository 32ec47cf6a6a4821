//! Birth and death against the evidence itself, and draws against the exact posterior.

use nalgebra::{DMatrix, DVector};

use plychain::laminate::Material;
use plychain::posterior::{
    ConstantsPrior, GivenChoice, Inclusion, LinearRole, MeanSurface, MixtureChoice,
    PosteriorDensity, Ratios, Space, birth_or_death,
};
use plychain::sample::Key;
use plychain::sample::Stream;

const COLUMNS: usize = 6;

/// Numbers between -1 and 1.
fn scattered(rng: &mut Stream, rows: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| 2.0 * rng.uniform() - 1.0)
}

struct Toy {
    answer: PosteriorDensity,
    gram: DMatrix<f64>,
    /// G and z in the directions, and in the columns.
    right: DVector<f64>,
    whole: (DMatrix<f64>, DVector<f64>),
}

/// One column that always acts, candidates of one, two and two columns; the data see every direction.
fn toy() -> Toy {
    let mut rng = Stream::at(
        Key {
            seed: 7,
            ensemble: 0,
        },
        0,
        0,
    );
    let whose = [0, 1, 1, 2, 2].map(LinearRole::Candidate);
    let whose: Vec<LinearRole> = std::iter::once(LinearRole::Always).chain(whose).collect();
    let largest = DVector::from_vec(vec![1.0, 3.0, 3.0, 3.0, 3.0, 3.0]);
    let x = scattered(&mut rng, 20, COLUMNS) * 3.0;
    let y = &x * DVector::from_vec(vec![0.5, 0.3, -0.2, 0.1, 1.5, -1.0])
        + scattered(&mut rng, 20, 1).column(0);
    let whole = (x.tr_mul(&x), x.tr_mul(&y));
    let space = Space::new(whose, largest, &whole.0);
    assert_eq!(space.directions(), COLUMNS);
    let mut by = space.seen.clone();
    for (mut row, sd) in by.row_iter_mut().zip(space.largest.iter()) {
        row *= *sd;
    }
    Toy {
        gram: by.tr_mul(&whole.0) * &by,
        right: by.tr_mul(&whole.1),
        answer: PosteriorDensity::new(
            ConstantsPrior {
                material: Material::Isotropic,
                marginals: Vec::new(),
                known: None,
            },
            MeanSurface::flat(Ratios::about(&[])),
            space,
            Vec::new(),
            Vec::new(),
        ),
        whole,
    }
}

fn choice(own: &[usize]) -> MixtureChoice {
    MixtureChoice {
        noise: 0,
        own: own.to_vec(),
        size: 0.1,
        rival: 0.0,
        log_weight: 0.0,
    }
}

/// Prior sds of the columns with some candidates acting.
fn sds(own: &[usize]) -> DVector<f64> {
    let of = |k: usize| match k {
        0 => 1.0,
        k if own.contains(&((k - 1).div_ceil(2))) => 1.0,
        _ => 0.1,
    };
    DVector::from_fn(COLUMNS, |k, _| of(k))
}

/// Log evidence, mean and covariance by the columns themselves.
fn exact(toy: &Toy, own: &[usize]) -> (f64, DVector<f64>, DMatrix<f64>) {
    let sds = sds(own);
    let scale = DMatrix::from_diagonal(&sds);
    let precision = DMatrix::identity(COLUMNS, COLUMNS) + &scale * &toy.whole.0 * &scale;
    let right = &scale * &toy.whole.1;
    let factor = precision.cholesky().unwrap();
    let solved = factor.solve(&right);
    let log = 0.5 * right.dot(&solved) - factor.l().diagonal().map(f64::ln).sum();
    (log, &scale * solved, &scale * factor.inverse() * &scale)
}

#[test]
fn a_step_takes_the_ratio_of_the_evidences() {
    let toy = toy();
    for own in [&[][..], &[1], &[0, 2]] {
        let given = GivenChoice::new(&toy.answer, (&toy.gram, &toy.right), &choice(own));
        for candidate in 0..3 {
            let inside = own.contains(&candidate);
            let mut other: Vec<usize> = own.iter().copied().filter(|k| *k != candidate).collect();
            if !inside {
                other.push(candidate);
            }
            let wanted = exact(&toy, &other).0 - exact(&toy, own).0;
            let found = given.log_ratio(candidate, if inside { 0.1 } else { 1.0 });
            assert!(
                (found - wanted).abs() < 1e-8 * (1.0 + wanted.abs()),
                "{own:?} {candidate}: {found} {wanted}"
            );
        }
    }
}

/// Birth and death visit every set of candidates by its probability, and amplitudes have the exact moments.
#[test]
fn sets_and_amplitudes_are_drawn_by_their_probability() {
    const STEPS: usize = 60_000;
    let toy = toy();
    let inclusion = Inclusion {
        candidates: 3,
        log_prior: &|n| (n < 4).then(|| -(n as f64)),
        excludes: &|_, _| false,
    };
    let sets: Vec<Vec<usize>> = (0..8)
        .map(|bits: usize| (0..3).filter(|k| bits >> k & 1 == 1).collect())
        .collect();
    let log = |own: &Vec<usize>| exact(&toy, own).0 - own.len() as f64;
    let most = sets.iter().map(log).fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = sets.iter().map(|s| (log(s) - most).exp()).collect();
    let total: f64 = weights.iter().sum();
    let mut rng = Stream::at(
        Key {
            seed: 5,
            ensemble: 0,
        },
        0,
        0,
    );
    let mut now = choice(&[]);
    let mut given = GivenChoice::new(&toy.answer, (&toy.gram, &toy.right), &now);
    let mut visits = [0.0; 8];
    for _ in 0..STEPS {
        given = birth_or_death(
            given,
            (&toy.gram, &toy.right),
            &mut now,
            &inclusion,
            &mut rng,
        );
        visits[now.own.iter().map(|k| 1 << k).sum::<usize>()] += 1.0;
    }
    println!("{visits:?} {weights:?}");
    for ((set, visits), weight) in sets.iter().zip(visits).zip(&weights) {
        let p = weight / total;
        // steps depend on each other over some tens
        let error = (30.0 * p * (1.0 - p) / STEPS as f64).sqrt();
        let share = visits / STEPS as f64;
        assert!(
            (share - p).abs() < 5.0 * error + 1e-4,
            "{set:?}: {share} {p}"
        );
    }
    let (_, mean, covariance) = exact(&toy, &[1]);
    let given = GivenChoice::new(&toy.answer, (&toy.gram, &toy.right), &choice(&[1]));
    let draws: Vec<DVector<f64>> = (0..20_000).map(|_| given.amplitudes(&mut rng)).collect();
    let n = draws.len() as f64;
    for k in 0..COLUMNS {
        let found = draws.iter().map(|d| d[k]).sum::<f64>() / n;
        let sd = covariance[(k, k)].sqrt();
        assert!((found - mean[k]).abs() < 5.0 * sd / n.sqrt(), "{k}");
        let square = draws.iter().map(|d| (d[k] - found).powi(2)).sum::<f64>() / n;
        assert!(
            (square.sqrt() / sd - 1.0).abs() < 5.0 / (2.0 * n).sqrt(),
            "{k}"
        );
    }
}
