//! Finite elements, effects, reduction, and what is inferred from fields whose truth is known.

#[path = "../common/mod.rs"]
mod common;

mod attacks;
mod bending;
mod copied;
mod dic;
mod every_effect;
mod evidence;
mod experiment;
mod fem;
mod foreign;
mod frequencies;
mod geometry;
mod imported;
mod joint;
mod layup;
mod load_mistakes;
mod loops;
mod marginal;
mod mechanics;
mod nulls;
mod patterns;
mod posterior;
mod priors_in_doubt;
mod quoted;
mod reduce;
mod reduced_basis;
mod ringing;
mod series;
mod simulated_series;
mod steps;
mod supplied;
mod suspect;
mod tracing;
mod unseen;
mod verify;
mod yielding;
