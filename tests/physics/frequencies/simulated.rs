//! Constants and assignments of simulated plates of which a peak is missing and one is too many.

use plychain::experiment::frequencies::assignment::{FrequencyPeak, PeakModel};
use plychain::experiment::frequencies::estimate::{AssignmentProblem, Unknown, estimates};
use plychain::experiment::frequencies::{
    PlateParameter, Ritz, Settings, Theory, TransverseShear, VibratingPlate, Weight,
};
use plychain::laminate::Ply;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use super::weigh::weigh;

fn peak(frequency_hz: f64, odd: Option<bool>) -> FrequencyPeak {
    FrequencyPeak {
        frequency_hz,
        sd_hz: 0.1,
        odd,
    }
}

/// A plate of the article's layup.
fn specimen(ply: Ply) -> VibratingPlate {
    VibratingPlate {
        length: 200.0,
        width: 150.0,
        thickness: 0.78,
        weight: Weight::Mass(37.44e-6),
        ply,
        transverse: TransverseShear::default(),
        angles: [45.0, -45.0, 0.0, 0.0, -45.0, 45.0]
            .map(f64::to_radians)
            .to_vec(),
        air_density: 0.0,
        point_mass: 0.0,
    }
}

fn gauss(rng: &mut Pcg64) -> f64 {
    StandardNormal.sample(rng)
}

/// What 20 simulated plates gave.
struct Tally {
    right: usize,
    total: usize,
    /// Sum of the stated probabilities of the assignments that were given.
    stated: f64,
    /// Wrong ones among those stated with more than 90 %.
    surely_wrong: usize,
    /// Constants outside their 95 % interval, of 80.
    outside: usize,
    /// Squared distance of the truth from the estimate, in posterior standard deviations: chi-squared of 4 degrees of freedom.
    distances: Vec<f64>,
}

/// Unknown constants, 12 modes of which one is missing, 11 peaks of `error` and one that is no mode; with the parity of each, or without.
fn simulated(error: f64, with_parity: bool) -> Tally {
    let means = [160e3, 10e3, 0.3, 5e3];
    let parameters = [
        PlateParameter::E1,
        PlateParameter::E2,
        PlateParameter::Nu12,
        PlateParameter::G12,
    ];
    let unknowns: Vec<Unknown> = parameters
        .iter()
        .zip(means)
        .map(|(&parameter, mean)| Unknown {
            parameter,
            mean,
            sd: 0.1 * mean,
        })
        .collect();
    let full = Ritz::new(&Settings::free(Theory::Sheared)).unwrap();
    let nominal = specimen(Ply {
        e1: means[0],
        e2: means[1],
        nu12: means[2],
        g12: means[3],
    });
    let corners = parameters
        .iter()
        .flat_map(|&p| [0.8, 1.2].map(|s| nominal.clone().with(p, s * nominal.get(p))));
    let designs: Vec<_> = std::iter::once(nominal.clone())
        .chain(corners)
        .map(|p| p.coefficients())
        .collect();
    let ritz = full.reduced(&designs, 12).unwrap();
    let mut tally = Tally {
        right: 0,
        total: 0,
        stated: 0.0,
        surely_wrong: 0,
        outside: 0,
        distances: Vec::new(),
    };
    for seed in 0..20 {
        let mut rng = Pcg64::seed_from_u64(seed);
        let truth = means.map(|m| m * (1.0 + 0.1 * gauss(&mut rng).clamp(-2.0, 2.0)));
        let plate = specimen(Ply {
            e1: truth[0],
            e2: truth[1],
            nu12: truth[2],
            g12: truth[3],
        });
        let modes = full.modes(&plate.coefficients(), 13).unwrap();
        let band_hz = [
            30.0,
            0.5 * (modes[12].frequency_hz() + modes[11].frequency_hz()),
        ];
        let missing = rng.random_range(0..12);
        let mut peaks: Vec<(FrequencyPeak, Option<usize>)> = (0..12)
            .filter(|&j| j != missing)
            .map(|j| {
                let f = modes[j].frequency_hz() * (error * gauss(&mut rng)).exp();
                let flipped = rng.random_bool(0.02);
                let odd = modes[j]
                    .odd
                    .filter(|_| with_parity)
                    .map(|odd| odd != flipped);
                (peak(f.min(band_hz[1]), odd), Some(j))
            })
            .collect();
        let odd = with_parity.then(|| rng.random_bool(0.5));
        peaks.push((peak(rng.random_range(band_hz[0]..band_hz[1]), odd), None));
        peaks.sort_by(|a, b| a.0.frequency_hz.total_cmp(&b.0.frequency_hz));
        let list: Vec<FrequencyPeak> = peaks.iter().map(|p| p.0).collect();
        let model = PeakModel {
            model_error: error,
            missing: 1.0 / 12.0,
            additional: 1.0,
            wrong_parity: 0.02,
            band_hz,
        };
        let problem = AssignmentProblem {
            ritz: &ritz,
            plate: &plate,
            unknowns: &unknowns,
            peaks: &list,
            model: &model,
            modes: 16,
        };
        let tops = estimates(&problem, 4).unwrap();
        let found = &tops[0];
        let weighed = weigh(&problem, &tops, 400);
        assert!(weighed.effective > 40.0, "{}", weighed.effective);
        for (i, (_, mode)) in peaks.iter().enumerate() {
            let given = found.assigned.best.iter().position(|p| *p == Some(i));
            let stated = given.map_or(weighed.additional(i), |j| weighed.matched[(j, i)]);
            // ranks change where modes cross; what a mode is does not
            let is_right = match (given, mode) {
                (Some(j), Some(m)) => found.modes[j].is(&modes[*m]),
                (None, None) => true,
                _ => false,
            };
            tally.right += usize::from(is_right);
            tally.surely_wrong += usize::from(!is_right && stated > 0.9);
            tally.stated += stated;
            tally.total += 1;
        }
        let off = &weighed.mean - nalgebra::DVector::from_row_slice(&truth);
        let inverse = weighed.covariance.clone().try_inverse().unwrap();
        tally.distances.push(off.dot(&(inverse * &off)));
        tally.outside += (0..4)
            .filter(|&k| off[k].abs() > 1.96 * weighed.covariance[(k, k)].sqrt())
            .count();
    }
    let Tally {
        right,
        total,
        stated,
        surely_wrong,
        outside,
        ref distances,
    } = tally;
    let mean = distances.iter().sum::<f64>() / 20.0;
    println!(
        "error {error} parity {with_parity}: right {right} of {total}, stated {stated:.1}, surely wrong {surely_wrong}; outside {outside} of 80; distance {mean:.2} of 4"
    );
    tally
}

#[track_caller]
fn assert_covered(tally: &Tally) {
    assert!(tally.outside <= 10, "{} of 80 beyond 95 %", tally.outside);
    // chi-squared: 80 degrees of freedom, over 20, is below 6.2 and four below 18.5 with 99.9 %
    let mean = tally.distances.iter().sum::<f64>() / 20.0;
    assert!(
        mean < 6.2 && tally.distances.iter().all(|d| *d < 23.5),
        "{:?}",
        tally.distances
    );
}

fn with_parity(error: f64) {
    let tally = simulated(error, true);
    let (right, total) = (tally.right as f64, tally.total as f64);
    assert!(right >= 0.95 * total, "{right} of {total}");
    assert_covered(&tally);
}

/// Modes 7 and 8 of this plate often lie within 0.5 % of each other, and nothing but parity tells them apart.
fn without_parity(error: f64) {
    let tally = simulated(error, false);
    let wrong = (tally.total - tally.right) as f64;
    let stated = tally.total as f64 - tally.stated;
    assert!(tally.surely_wrong <= 2, "{}", tally.surely_wrong);
    // wrong ones come in pairs, which doubles the variance
    let sd = (2.0 * stated).sqrt();
    assert!(
        (wrong - stated).abs() < 3.0 * sd,
        "{wrong} wrong, {stated} stated"
    );
    assert_covered(&tally);
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn simulated_plates_with_parity_are_assigned_right_and_their_constants_covered() {
    with_parity(0.005);
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn without_parity_what_cannot_be_decided_is_said_to_be_open() {
    without_parity(0.005);
}

#[test]
#[ignore = "takes a minute: the same with better peaks"]
fn simulated_plates_with_peaks_good_to_two_permille() {
    with_parity(0.002);
    without_parity(0.002);
}
