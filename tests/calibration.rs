//! Calibration of the noise and of the constants on simulated measurements.

use std::path::Path;

use plychain::infer::{LogDensity, Model, Noise, Statistics, laplace};
use plychain::progress::Unwatched;
use plychain::trace;
use plychain::validate::twin::{Truth, Twin};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use crate::program::model;

/// z of constants and noise over simulated fields, from the normal approximation at the mode.
#[test]
#[ignore = "a measurement"]
fn measure_noise() {
    let var = |k: &str, d: f64| {
        std::env::var(k)
            .ok()
            .and_then(|v| v.parse().ok())
            .unwrap_or(d)
    };
    let (side, replicates) = (var("SIDE", 61.0) as usize, var("N", 24.0) as usize);
    let mut declared = Model::load(Path::new(&model("openhole.json"))).unwrap();
    declared.file.likelihood.model_error_fraction = 0.0;
    let lengths: Vec<f64> = std::env::var("L").map_or(vec![0.0, 1.0], |v| {
        v.split(',').map(|x| x.parse().unwrap()).collect()
    });
    for l in lengths {
        let prepared = trace::prepare(&declared, Path::new("runs/.cache"), &Unwatched).unwrap();
        let mut twin = Twin::new(&declared, prepared, side).unwrap();
        let mut zs: Vec<Vec<f64>> = Vec::new();
        let mut ratios = Vec::new();
        let began = std::time::Instant::now();
        let mut spent = 0.0;
        for k in 0..replicates {
            let mut rng = Pcg64Dxsm::seed_from_u64(1000 + k as u64);
            let theta: Vec<f64> = declared
                .marginals()
                .iter()
                .map(|m| {
                    let z: f64 = StandardNormal.sample(&mut rng);
                    m.mean + m.sd * z.clamp(-2.5, 2.5)
                })
                .collect();
            let z: f64 = StandardNormal.sample(&mut rng);
            let truth = Truth {
                theta,
                thickness_mm: 0.78 + 0.005 * z,
                additive: vec![0.0, 0.0],
                noise_nm: 3.0 * 10f64.powf(rng.random()),
            };
            let mut u = twin.reduced(&truth);
            for (u, e) in u
                .iter_mut()
                .zip(twin.noise(truth.noise_nm, l, 77 + k as u64))
            {
                u[0] += e[0];
                u[1] += e[1];
            }
            twin.prepared.observation.field.displacement = u;
            let t = std::time::Instant::now();
            let noise = Noise::estimate(&twin.prepared.observation, &twin.columns).unwrap();
            spent += t.elapsed().as_secs_f64();
            let statistics =
                Statistics::new(&twin.prepared.observation, &twin.columns, &noise).unwrap();
            let posterior =
                trace::posterior(&declared, &twin.prepared.reduced, &statistics, &noise).unwrap();
            let (centre, sd) = posterior.start();
            let mode = laplace(&posterior, &centre, &sd).unwrap();
            let d = posterior.dim();
            let mut truth_x = truth.theta.clone();
            truth_x.push(truth.noise_nm);
            let mut z: Vec<f64> = (0..d)
                .map(|i| (mode.mode[i] - truth_x[i]) / mode.covariance[i * d + i].sqrt())
                .collect();
            let s = mode.covariance[d * d - 1].sqrt() / mode.mode[4];
            z[4] = (mode.mode[4] / truth.noise_nm).ln() / s;
            if var("V", 0.0) > 0.0 {
                println!(
                    "{k}: noise {:.4} sd {:.4} z {:.2?} | {:?}",
                    mode.mode[4] / truth.noise_nm,
                    s,
                    z,
                    noise.summary()
                );
            }
            ratios.push((mode.mode[4] / truth.noise_nm, s));
            zs.push(z);
        }
        let n = zs.len() as f64;
        for i in 0..5 {
            let mean = zs.iter().map(|z| z[i]).sum::<f64>() / n;
            let rms = (zs.iter().map(|z| z[i] * z[i]).sum::<f64>() / n).sqrt();
            println!("l {l} parameter {i}: mean z {mean:+.2} rms z {rms:.2}");
        }
        let m = ratios.iter().map(|r| r.0).sum::<f64>() / n;
        let s = (ratios.iter().map(|r| (r.0 - m).powi(2)).sum::<f64>() / n).sqrt();
        let c = ratios.iter().map(|r| r.1).sum::<f64>() / n;
        println!(
            "l {l}: noise/truth {m:.4} spread {s:.4} claimed {c:.4}; estimate {:.2} s, all {:.2} s each",
            spent / n,
            began.elapsed().as_secs_f64() / n
        );
    }
}
