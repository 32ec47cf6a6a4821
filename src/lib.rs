//! MCMC-first inference of ply elastic constants from full-field displacement measurements.
//!
//! Data flow one way: measured files -> [`field`] -> projections; specimen -> [`laminate`] -> finite-element
//! snapshots ([`fem`], [`effect`]) -> POD and response surfaces ([`reduce`]); prior and likelihood -> posterior
//! ([`infer`]) -> [`sample`] -> [`chain`] -> [`diagnose`]; [`identify`] -> residual -> [`trace`] -> [`report`].
//! Imports point only to the left of
//! `dense, error, files, lanes, numeric, quantity, progress, signals < chain < sample < diagnose < field, laminate < noise < geometry < fem < effect < experiment < reduce < infer < identify < trace < study < validate < report < campaign < cli`.

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
pub mod noise;
pub mod numeric;
pub mod progress;
pub mod quantity;
pub mod reduce;
pub mod report;
pub mod sample;
pub mod signals;
pub mod study;
pub mod trace;
pub mod validate;
