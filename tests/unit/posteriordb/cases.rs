//! Densities of posteriordb, each on the whole real space: positive parameters as logarithms, shares as log odds, with the Jacobian.

use std::f64::consts::{LN_2, PI};

use serde_json::Value;

/// A function of a point.
type Of<T> = Box<dyn Fn(&[f64]) -> T + Sync>;

/// A posterior with data of its own.
pub struct Case {
    /// `data-model`, as posteriordb has it.
    pub name: &'static str,
    /// Where a climb to the mode begins, and the scale of each coordinate there.
    pub start: Vec<(f64, f64)>,
    /// Log density of the coordinates.
    pub density: Of<f64>,
    /// The parameters of posteriordb's draws, in their order.
    pub parameters: Of<Vec<f64>>,
}

type Build = fn(&'static str, &Value) -> Case;

/// Every posterior that is written down here.
pub const CASES: [(&str, Build); 14] = [
    ("eight_schools-eight_schools_noncentered", eight_schools),
    ("kilpisjarvi_mod-kilpisjarvi", kilpisjarvi),
    ("garch-garch11", garch),
    ("arma-arma11", arma),
    ("arK-arK", autoregression),
    ("gp_pois_regr-gp_pois_regr", poisson_process),
    ("gp_pois_regr-gp_regr", gaussian_process),
    ("low_dim_gauss_mix-low_dim_gauss_mix", mixture),
    ("sblrc-blr", regression),
    ("sblri-blr", regression),
    ("kidiq-kidscore_momiq", regression),
    ("earnings-logearn_interaction", regression),
    ("mesquite-logmesquite_logvash", regression),
    ("nes2000-nes", regression),
];

fn numbers(data: &Value) -> Vec<f64> {
    let all = data.as_array().unwrap().iter();
    all.map(|v| v.as_f64().unwrap()).collect()
}

fn normal(x: f64, mean: f64, sd: f64) -> f64 {
    -0.5 * ((x - mean) / sd).powi(2) - sd.ln()
}

fn cauchy(x: f64, scale: f64) -> f64 {
    -(x / scale).powi(2).ln_1p()
}

/// A share and the logarithm of its derivative by the log odds.
fn share(odds: f64) -> (f64, f64) {
    let p = 1.0 / (1.0 + (-odds).exp());
    (p, (p * (1.0 - p)).ln())
}

/// y_j ~ N(theta_j, sigma_j), theta_j = mu + tau t_j, t_j ~ N(0, 1), mu ~ N(0, 5), tau ~ Cauchy+(0, 5).
fn eight_schools(name: &'static str, data: &Value) -> Case {
    let (y, sigma) = (numbers(&data["y"]), numbers(&data["sigma"]));
    let parameters = |x: &[f64]| {
        let (mu, tau) = (x[8], x[9].exp());
        let theta = x[..8].iter().map(|t| mu + tau * t);
        theta.chain([mu, tau]).collect::<Vec<f64>>()
    };
    Case {
        name,
        start: [vec![(0.0, 1.0); 8], vec![(5.0, 3.0), (1.0, 1.0)]].concat(),
        density: Box::new(move |x| {
            let all = parameters(x);
            let t: f64 = x[..8].iter().map(|t| normal(*t, 0.0, 1.0)).sum();
            let fit = all.iter().zip(&y).zip(&sigma);
            let fit: f64 = fit.map(|((theta, y), s)| normal(*y, *theta, *s)).sum();
            t + fit + normal(x[8], 0.0, 5.0) + cauchy(all[9], 5.0) + x[9]
        }),
        parameters: Box::new(parameters),
    }
}

/// y ~ N(alpha + beta x, sigma), alpha ~ N(9.31.., 100), beta ~ N(0, 0.0333..); sigma flat. The coordinate beside beta is the line's value
/// at the middle of x.
fn kilpisjarvi(name: &'static str, data: &Value) -> Case {
    let (x, y) = (numbers(&data["x"]), numbers(&data["y"]));
    let priors = ["pmualpha", "psalpha", "pmubeta", "psbeta"].map(|k| data[k].as_f64().unwrap());
    let middle = x.iter().sum::<f64>() / x.len() as f64;
    let parameters = move |p: &[f64]| vec![p[0] - p[1] * middle, p[1], p[2].exp()];
    Case {
        name,
        start: vec![(9.3, 0.3), (0.0, 0.01), (0.0, 0.1)],
        density: Box::new(move |p| {
            let all = parameters(p);
            let line = x.iter().zip(&y);
            let fit: f64 = line
                .map(|(x, y)| normal(*y, p[0] + p[1] * (x - middle), all[2]))
                .sum();
            let [m, s, mb, sb] = priors;
            fit + normal(all[0], m, s) + normal(all[1], mb, sb) + p[2]
        }),
        parameters: Box::new(parameters),
    }
}

/// y_t ~ N(mu, s_t), s_t^2 = alpha0 + alpha1 (y_(t-1) - mu)^2 + beta1 s_(t-1)^2 with alpha1 + beta1 < 1; all flat.
fn garch(name: &'static str, data: &Value) -> Case {
    let y = numbers(&data["y"]);
    let first = data["sigma1"].as_f64().unwrap();
    let parameters = |x: &[f64]| {
        let alpha1 = share(x[2]).0;
        vec![x[0], x[1].exp(), alpha1, (1.0 - alpha1) * share(x[3]).0]
    };
    Case {
        name,
        start: vec![(5.0, 0.3), (0.0, 0.5), (0.0, 0.5), (0.0, 0.5)],
        density: Box::new(move |x| {
            let all = parameters(x);
            let mut variance = first * first;
            let mut sum = x[1] + share(x[2]).1 + share(x[3]).1 + (1.0 - all[2]).ln();
            for (t, y_t) in y.iter().enumerate() {
                if t > 0 {
                    variance = all[1] + all[2] * (y[t - 1] - all[0]).powi(2) + all[3] * variance;
                }
                sum += normal(*y_t, all[0], variance.sqrt());
            }
            sum
        }),
        parameters: Box::new(parameters),
    }
}

/// err_t = y_t - mu - phi y_(t-1) - theta err_(t-1) ~ N(0, sigma), mu ~ N(0, 10), phi, theta ~ N(0, 2), sigma ~ Cauchy+(0, 2.5).
fn arma(name: &'static str, data: &Value) -> Case {
    let y = numbers(&data["y"]);
    let parameters = |x: &[f64]| vec![x[0], x[1], x[2], x[3].exp()];
    Case {
        name,
        start: vec![(0.0, 0.1), (0.9, 0.1), (0.0, 0.2), (-1.0, 0.3)],
        density: Box::new(move |x| {
            let sigma = x[3].exp();
            let priors = normal(x[0], 0.0, 10.0) + normal(x[1], 0.0, 2.0) + normal(x[2], 0.0, 2.0);
            let mut error = y[0] - x[0] - x[1] * x[0];
            let mut sum = priors + cauchy(sigma, 2.5) + x[3] + normal(error, 0.0, sigma);
            for pair in y.windows(2) {
                error = pair[1] - x[0] - x[1] * pair[0] - x[2] * error;
                sum += normal(error, 0.0, sigma);
            }
            sum
        }),
        parameters: Box::new(parameters),
    }
}

/// y_t ~ N(alpha + sum of beta_k y_(t-k), sigma), k to 5, alpha and beta ~ N(0, 10), sigma ~ Cauchy+(0, 2.5).
fn autoregression(name: &'static str, data: &Value) -> Case {
    let y = numbers(&data["y"]);
    let parameters = |x: &[f64]| [&x[..6], &[x[6].exp()]].concat();
    let mut start = vec![(0.0, 0.1); 6];
    start.push((-1.0, 0.3));
    Case {
        name,
        start,
        density: Box::new(move |x| {
            let sigma = x[6].exp();
            let priors: f64 = x[..6].iter().map(|b| normal(*b, 0.0, 10.0)).sum();
            let fit = y.windows(6).map(|w| {
                let lags = w[..5].iter().rev().zip(&x[1..6]);
                let mean = x[0] + lags.map(|(y, b)| y * b).sum::<f64>();
                normal(w[5], mean, sigma)
            });
            priors + fit.sum::<f64>() + cauchy(sigma, 2.5) + x[6]
        }),
        parameters: Box::new(parameters),
    }
}

/// Lower Cholesky factor of alpha^2 exp(-(x_i - x_j)^2 / (2 rho^2)) with `nugget` on the diagonal.
fn factor(x: &[f64], [rho, alpha, nugget]: [f64; 3]) -> Option<nalgebra::DMatrix<f64>> {
    let covariance = nalgebra::DMatrix::from_fn(x.len(), x.len(), |i, j| {
        let smooth = alpha * alpha * (-0.5 * ((x[i] - x[j]) / rho).powi(2)).exp();
        smooth + if i == j { nugget } else { 0.0 }
    });
    Some(covariance.cholesky()?.unpack())
}

/// Gamma(25, 4) of rho and N+(0, 2) of alpha, by their logarithms.
fn process_priors(log_rho: f64, log_alpha: f64) -> f64 {
    25.0 * log_rho - 4.0 * log_rho.exp() + normal(log_alpha.exp(), 0.0, 2.0) + log_alpha
}

/// k ~ Poisson(exp(f)), f = L z, z ~ N(0, 1), L of the covariance with a nugget of 1e-10.
fn poisson_process(name: &'static str, data: &Value) -> Case {
    let (x, k) = (numbers(&data["x"]), numbers(&data["k"]));
    let places = x.clone();
    let values = move |p: &[f64]| {
        let lower = factor(&places, [p[0].exp(), p[1].exp(), 1e-10])?;
        let z = nalgebra::DVector::from_column_slice(&p[2..]);
        Some((lower * z).as_slice().to_vec())
    };
    let shown = values.clone();
    let parameters = move |p: &[f64]| {
        let f = shown(p).unwrap();
        [vec![p[0].exp(), p[1].exp()], f].concat()
    };
    Case {
        name,
        start: [vec![(1.8, 0.2), (LN_2, 0.3)], vec![(0.0, 0.5); x.len()]].concat(),
        density: Box::new(move |p| {
            let Some(f) = values(p) else {
                return f64::NEG_INFINITY;
            };
            let z: f64 = p[2..].iter().map(|z| normal(*z, 0.0, 1.0)).sum();
            let counts = f.iter().zip(&k);
            let counts: f64 = counts.map(|(f, k)| k * f - f.exp()).sum();
            z + counts + process_priors(p[0], p[1])
        }),
        parameters: Box::new(parameters),
    }
}

/// y ~ N(0, covariance with sigma on the diagonal), sigma ~ N+(0, 1).
fn gaussian_process(name: &'static str, data: &Value) -> Case {
    let (x, y) = (numbers(&data["x"]), numbers(&data["y"]));
    Case {
        name,
        start: vec![(1.8, 0.2), (0.7, 0.3), (0.0, 0.3)],
        density: Box::new(move |p| {
            let sigma = p[2].exp();
            let Some(lower) = factor(&x, [p[0].exp(), p[1].exp(), sigma]) else {
                return f64::NEG_INFINITY;
            };
            let y = nalgebra::DVector::from_column_slice(&y);
            let white = lower.solve_lower_triangular(&y).unwrap();
            let size: f64 = lower.diagonal().iter().map(|d| d.ln()).sum();
            -0.5 * white.norm_squared() - size
                + process_priors(p[0], p[1])
                + normal(sigma, 0.0, 1.0)
                + p[2]
        }),
        parameters: Box::new(|p| p.iter().map(|v| v.exp()).collect()),
    }
}

/// y ~ theta N(mu1, sigma1) + (1 - theta) N(mu2, sigma2), mu1 < mu2 ~ N(0, 2), sigma ~ N+(0, 2), theta ~ Beta(5, 5).
fn mixture(name: &'static str, data: &Value) -> Case {
    let y = numbers(&data["y"]);
    let parameters = |x: &[f64]| {
        let theta = share(x[4]).0;
        vec![x[0], x[0] + x[1].exp(), x[2].exp(), x[3].exp(), theta]
    };
    Case {
        name,
        start: vec![(-3.0, 0.1), (1.7, 0.1), (0.0, 0.1), (0.0, 0.1), (0.0, 0.2)],
        density: Box::new(move |x| {
            let all = parameters(x);
            let (theta, jacobian) = share(x[4]);
            let priors: f64 = all[..4].iter().map(|v| normal(*v, 0.0, 2.0)).sum();
            let priors = priors + 4.0 * (theta.ln() + (1.0 - theta).ln());
            let norm = 0.5 * (2.0 * PI).ln();
            let one = |y: f64| {
                let first = theta.ln() + normal(y, all[0], all[2]) - norm;
                let second = (1.0 - theta).ln() + normal(y, all[1], all[3]) - norm;
                let high = first.max(second);
                high + ((first - high).exp() + (second - high).exp()).ln()
            };
            let fit: f64 = y.iter().map(|y| one(*y)).sum();
            fit + priors + x[1] + x[2] + x[3] + jacobian
        }),
        parameters: Box::new(parameters),
    }
}

/// y ~ N(X beta, sigma), of which n and the inner products of the columns of X and of y are all that the likelihood needs. The priors: beta
/// flat or normal about 0, sigma flat, N+(0, 10) or Cauchy+(0, 2.5). The coordinates are whitened by X'X.
fn regression(name: &'static str, data: &Value) -> Case {
    let n = data["n"].as_f64().unwrap();
    let gram: Vec<Vec<f64>> = data["gram"]
        .as_array()
        .unwrap()
        .iter()
        .map(numbers)
        .collect();
    let dim = gram.len() - 1;
    let inner = nalgebra::DMatrix::from_fn(dim, dim, |i, j| gram[i][j]);
    let with_y = nalgebra::DVector::from_fn(dim, |i, _| gram[i][dim]);
    let cholesky = inner.clone().cholesky().unwrap();
    let best = cholesky.solve(&with_y);
    let rest = gram[dim][dim] - with_y.dot(&best);
    let upper = cholesky.l().transpose();
    let parameters = move |x: &[f64]| {
        let white = nalgebra::DVector::from_column_slice(&x[..dim]);
        let beta = &best + upper.solve_upper_triangular(&white).unwrap();
        let sigma = x[dim].exp();
        beta.iter().copied().chain([sigma]).collect::<Vec<f64>>()
    };
    let (beta_sd, sigma_prior) = (data["beta_sd"].as_f64(), data["sigma"].to_string());
    let size = (rest / n).sqrt();
    let mut start = vec![(0.0, size); dim];
    start.push((size.ln(), 0.1));
    let shown = parameters.clone();
    Case {
        name,
        start,
        density: Box::new(move |x| {
            let all = parameters(x);
            let sigma = all[dim];
            let white: f64 = x[..dim].iter().map(|w| w * w).sum();
            let fit = -0.5 * (rest + white) / (sigma * sigma) - n * x[dim];
            let beta = all[..dim].iter();
            let prior = match &*sigma_prior {
                "\"normal(0, 10)\"" => normal(sigma, 0.0, 10.0),
                "\"cauchy(0, 2.5)\"" => cauchy(sigma, 2.5),
                "\"flat\"" => 0.0,
                other => panic!("{other}"),
            };
            let beta: f64 = beta_sd.map_or(0.0, |sd| beta.map(|b| normal(*b, 0.0, sd)).sum());
            fit + beta + prior + x[dim]
        }),
        parameters: Box::new(shown),
    }
}
