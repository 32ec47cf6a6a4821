//! MCMC-first inference of ply elastic constants from full-field displacement measurements.
//!
//! [`chain`], [`sample`] and [`diagnose`] know no physics: any [`sample::LogDensity`] will do. The physics: measured files -> [`field`] ->
//! projections; specimen -> [`laminate`], [`geometry`], [`mesh_files`] -> finite-element snapshots ([`fem`], [`effect`]) -> POD and response
//! surfaces ([`reduce`]); prior and likelihood -> posterior ([`infer`]), which is sampled; [`identify`] -> residual -> [`trace`] -> [`report`].
//! Imports point only to the left of
//! `dense, error, files, lanes, numeric, quantity, progress, signals < chain < sample < diagnose < laminate < geometry < mesh_files < field < noise < fem < effect < experiment < reduce < infer < linearise < identify < trace < validate < report < campaign < cli`.

pub mod campaign;
pub mod chain;
pub mod cli;
mod dense;
pub mod diagnose;
pub mod effect;
pub mod error;
pub mod experiment;
pub mod fem;
pub mod field;
pub mod files;
pub mod geometry;
pub mod identify;
pub mod infer;
pub mod laminate;
mod lanes;
pub mod linearise;
pub mod mesh_files;
pub mod noise;
pub mod numeric;
pub mod progress;
pub mod quantity;
pub mod reduce;
pub mod report;
pub mod sample;
pub mod signals;
pub mod trace;
pub mod validate;
