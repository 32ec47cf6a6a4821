//! Markov chain Monte Carlo for any log density, and the identification of elastic constants from measured displacement fields.
//!
//! # Sample a log density
//!
//! A density is a function of a slice, up to a constant factor. Chains start about its mode. Where it has none, give a guess of the
//! location and of the covariance instead of [`laplace`].
//!
//! ```
//! use plychain::{Ensemble, Quiet, Rule, Schedule, Start, density, diagnose, laplace, run};
//!
//! # fn main() -> plychain::Result<()> {
//! let banana = density(["x", "y"], |p| -0.5 * (p[0] * p[0] + (p[1] - p[0] * p[0]).powi(2)));
//! let mode = laplace(&banana, &[0.5, 0.5], &[1.0, 1.0])?;
//! let start = Start::Ball { centre: &mode.mode, covariance: &mode.covariance, spread: 1.5 };
//! let rule = Rule::default();
//! let outcome = run(&banana, &Ensemble::default(), &start, &Schedule::default(), &rule, &Quiet)?;
//! let verdict = diagnose(&outcome.draws, &rule);
//! for row in &verdict.rows {
//!     println!("{} = {:.3} +- {:.3}, Monte Carlo error {:.4}", row.name, row.mean, row.sd, row.mcse_mean);
//! }
//! assert!(verdict.converged, "{verdict}");
//! // x is standard normal, and the mean of y is that of x squared
//! assert!(verdict.rows[0].mean.abs() < 5.0 * verdict.rows[0].mcse_mean);
//! assert!((verdict.rows[1].mean - 1.0).abs() < 5.0 * verdict.rows[1].mcse_mean);
//! # Ok(())
//! # }
//! ```
//!
//! The same seed ([`Schedule`]) gives the same draws, to the bit, on any number of threads. [`run_kept`] stores the draws while the run
//! goes, and goes on with a run that was killed. [`read_csv`] and [`read_getdist`] read the chains of other programs for [`diagnose()`].
//! This part needs no feature: `default-features = false` leaves out everything else.
#![cfg_attr(feature = "identify", doc = include_str!("identify.md"))]

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod bridge;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod campaign;
#[doc(hidden)]
pub mod chain;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
#[cfg(feature = "identify")]
mod dense;
#[doc(hidden)]
pub mod diagnose;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod effect;
#[doc(hidden)]
pub mod error;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod experiment;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod fem;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod field;
#[doc(hidden)]
pub mod files;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod geometry;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod identify;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod infer;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod laminate;
#[doc(hidden)]
pub mod lanes;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod linearise;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod mesh_files;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod noise;
#[doc(hidden)]
pub mod numeric;
#[doc(hidden)]
pub mod parameter;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod posterior;
#[doc(hidden)]
pub mod progress;
#[doc(hidden)]
pub mod quantity;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod reduce;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod report;
#[doc(hidden)]
pub mod sample;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod section;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod signals;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod study;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod trace;
#[cfg(feature = "identify")]
#[doc(hidden)]
pub mod validate;

#[doc(inline)]
pub use chain::{Draws, read_csv, read_getdist};
#[doc(inline)]
pub use diagnose::{Row, Rule, Verdict, diagnose};
#[doc(inline)]
pub use error::{Error, Result};
#[doc(inline)]
pub use sample::{
    Adaptive, DensityError, Ensemble, Keeping, Laplace, LogDensity, Mixture, Outcome, Quiet,
    Regime, Schedule, Start, density, laplace, run, run_kept,
};

#[cfg(feature = "identify")]
#[doc(inline)]
pub use identify::{Identification, Options, identify};
#[cfg(feature = "identify")]
#[doc(inline)]
pub use infer::Model;
#[cfg(feature = "identify")]
#[doc(inline)]
pub use progress::Silent;
#[cfg(feature = "identify")]
#[doc(inline)]
pub use trace::{Closed, close};
