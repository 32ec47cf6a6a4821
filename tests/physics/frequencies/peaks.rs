//! Assignment of peaks to modes whose frequencies are given.

use plychain::experiment::frequencies::assignment::{
    FrequencyPeak, PeakModel, PredictedFrequency, assign,
};

const MODEL: PeakModel = PeakModel {
    model_error: 0.02,
    missing: 0.1,
    additional: 0.7,
    wrong_parity: 0.05,
    band_hz: [80.0, 420.0],
};

fn peak(frequency_hz: f64, odd: Option<bool>) -> FrequencyPeak {
    FrequencyPeak {
        frequency_hz,
        sd_hz: 0.1,
        odd,
    }
}

fn mode(frequency_hz: f64, odd: Option<bool>) -> PredictedFrequency {
    PredictedFrequency { frequency_hz, odd }
}

/// Weight of every assignment, each mode to a peak or none, by enumeration and independent formulas.
fn enumerate(
    model: &PeakModel,
    peaks: &[FrequencyPeak],
    modes: &[PredictedFrequency],
) -> Vec<(Vec<Option<usize>>, f64)> {
    let mut all = vec![(Vec::new(), 1.0)];
    let band = model.band_hz;
    for mode in modes {
        let mut next = Vec::new();
        for (taken, weight) in &all {
            let normal = statistical_normal;
            let inside = normal((band[1] / mode.frequency_hz).ln() / model.model_error)
                - normal((band[0] / mode.frequency_hz).ln() / model.model_error);
            let mut longer: Vec<Option<usize>> = taken.clone();
            longer.push(None);
            next.push((longer, weight * (1.0 - (1.0 - model.missing) * inside)));
            for (i, peak) in peaks.iter().enumerate() {
                if taken.contains(&Some(i)) {
                    continue;
                }
                let s =
                    (model.model_error.powi(2) + (peak.sd_hz / peak.frequency_hz).powi(2)).sqrt();
                let z = (peak.frequency_hz / mode.frequency_hz).ln() / s;
                let parity = match (peak.odd, mode.odd) {
                    (None, _) => 1.0,
                    (Some(_), None) => 0.5,
                    (a, b) if a == b => 1.0 - model.wrong_parity,
                    _ => model.wrong_parity,
                };
                let density = (-0.5 * z * z).exp() / (s * std::f64::consts::TAU.sqrt());
                let mut longer: Vec<Option<usize>> = taken.clone();
                longer.push(Some(i));
                next.push((longer, weight * (1.0 - model.missing) * parity * density));
            }
        }
        all = next;
    }
    for (taken, weight) in &mut all {
        for (i, peak) in peaks.iter().enumerate() {
            if !taken.contains(&Some(i)) {
                let parity = if peak.odd.is_some() { 0.5 } else { 1.0 };
                *weight *= model.additional * parity * peak.frequency_hz / (band[1] - band[0]);
            }
        }
        *weight *= (-model.additional).exp();
    }
    all
}

/// Normal distribution function by quadrature.
fn statistical_normal(z: f64) -> f64 {
    let z = z.clamp(-9.0, 9.0);
    let n = 4000;
    let h = (z + 9.0) / n as f64;
    (0..n)
        .map(|i| {
            let x = -9.0 + (i as f64 + 0.5) * h;
            (-0.5 * x * x).exp() * h
        })
        .sum::<f64>()
        / std::f64::consts::TAU.sqrt()
}

fn example() -> (Vec<FrequencyPeak>, Vec<PredictedFrequency>) {
    let peaks = vec![
        peak(100.0, Some(true)),
        peak(205.0, None),
        peak(208.0, Some(false)),
        peak(250.0, Some(true)),
        peak(391.0, None),
    ];
    let modes = vec![
        mode(207.0, Some(false)),
        mode(101.0, Some(true)),
        mode(204.0, Some(true)),
        mode(330.0, None),
        mode(418.0, Some(false)),
    ];
    (peaks, modes)
}

#[test]
fn the_sum_is_that_of_all_assignments() {
    let (peaks, modes) = example();
    let all = enumerate(&MODEL, &peaks, &modes);
    let total: f64 = all.iter().map(|(_, w)| w).sum();
    let found = assign(&MODEL, &peaks, &modes).unwrap();
    assert!(
        (found.log_likelihood - total.ln()).abs() < 1e-6,
        "{} {}",
        found.log_likelihood,
        total.ln()
    );
    for j in 0..modes.len() {
        for i in 0..peaks.len() {
            let share: f64 = all
                .iter()
                .filter(|(a, _)| a[j] == Some(i))
                .map(|(_, w)| w / total)
                .sum();
            assert!((found.matched[(j, i)] - share).abs() < 1e-6);
        }
    }
    let best = all.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    assert_eq!(found.best, best.0);
    assert_eq!(
        found.log_likelihood.to_bits(),
        assign(&MODEL, &peaks, &modes)
            .unwrap()
            .log_likelihood
            .to_bits()
    );
}

#[test]
fn the_likelihood_integrates_to_one() {
    // over the number and the places of peaks: one mode in mid-band, up to two peaks
    let model = PeakModel {
        additional: 0.05,
        band_hz: [100.0, 200.0],
        ..MODEL
    };
    let modes = [mode(150.0, None)];
    let sharp = |f: f64| FrequencyPeak {
        frequency_hz: f,
        sd_hz: 0.0,
        odd: None,
    };
    let likelihood =
        |peaks: &[FrequencyPeak]| assign(&model, peaks, &modes).unwrap().log_likelihood.exp();
    let n = 400;
    let h = 2.0_f64.ln() / n as f64;
    let at = |i: usize| sharp(100.0 * ((i as f64 + 0.5) * h).exp());
    let one: f64 = (0..n).map(|i| likelihood(&[at(i)]) * h).sum();
    let two: f64 = (0..n)
        .flat_map(|i| (0..i).map(move |j| (i, j)))
        .map(|(i, j)| likelihood(&[at(i), at(j)]) * h * h)
        .sum();
    let sum = likelihood(&[]) + one + two;
    assert!((sum - 1.0).abs() < 2e-3, "{sum}");
}

#[test]
fn its_slope_is_that_of_finite_differences() {
    let (peaks, modes) = example();
    let found = assign(&MODEL, &peaks, &modes).unwrap();
    for j in 0..modes.len() {
        let at = |step: f64| {
            let mut moved = modes.clone();
            moved[j].frequency_hz *= f64::exp(step);
            assign(&MODEL, &peaks, &moved).unwrap().log_likelihood
        };
        let expected = (at(1e-5) - at(-1e-5)) / 2e-5;
        assert!(
            (found.slope[j] - expected).abs() < 1e-2 + 1e-4 * expected.abs(),
            "{j}: {} {expected}",
            found.slope[j]
        );
    }
}

#[test]
fn modes_that_cross_are_told_by_parity() {
    let model = PeakModel {
        model_error: 0.01,
        ..MODEL
    };
    let peaks = [peak(200.0, Some(true)), peak(203.0, Some(false))];
    let crossed = [mode(200.0, Some(false)), mode(203.0, Some(true))];
    let found = assign(&model, &peaks, &crossed).unwrap();
    assert_eq!(found.best, [Some(1), Some(0)]);
    assert!(found.matched[(0, 1)] > 0.9);
}

#[test]
fn forty_crowded_peaks_are_summed_in_time() {
    let model = PeakModel {
        model_error: 0.01,
        band_hz: [90.0, 700.0],
        ..MODEL
    };
    let peaks: Vec<FrequencyPeak> = (0..40)
        .map(|i| peak(100.0 + 15.0 * i as f64, None))
        .collect();
    let modes: Vec<PredictedFrequency> = (0..42)
        .map(|i| mode(103.0 + 14.7 * i as f64, None))
        .collect();
    let start = std::time::Instant::now();
    let found = assign(&model, &peaks, &modes).unwrap();
    assert!(start.elapsed().as_secs_f64() < 2.0);
    println!("forty peaks: {:?}", start.elapsed());
    for i in 0..40 {
        assert!((0.0..=1.0 + 1e-9).contains(&found.matched.column(i).sum()));
    }
}

#[test]
fn wrong_input_is_refused() {
    let refused = |model: PeakModel, peaks: &[FrequencyPeak]| {
        assign(&model, peaks, &[mode(100.0, None)]).is_err()
    };
    assert!(refused(
        PeakModel {
            missing: 0.0,
            ..MODEL
        },
        &[]
    ));
    assert!(refused(
        PeakModel {
            additional: 0.0,
            ..MODEL
        },
        &[]
    ));
    assert!(refused(
        PeakModel {
            band_hz: [3.0, 2.0],
            ..MODEL
        },
        &[]
    ));
    assert!(refused(MODEL, &[peak(50.0, None)]));
    assert!(refused(MODEL, &[peak(f64::NAN, None)]));
}
