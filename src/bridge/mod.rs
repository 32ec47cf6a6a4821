//! UM-Bridge (Seelinger et al., Journal of Open Source Software 8 (2023) 4748): models as JSON over HTTP, so that one program computes a
//! density and another samples it.
//!
//! A model takes lists of numbers and gives lists of numbers. A log density takes one list, a point, and gives one of a single number. JSON
//! has no infinity: a point outside of the support has the log density -1.7976931348623157e308, the least number.

mod client;
mod server;

pub use client::{Patience, RemoteDensity};
pub use server::{BoundServer, HostedModel, ModelAnswer, serve};

/// Version of the protocol.
const VERSION: f64 = 1.0;

/// What a log density of -inf is sent as, and everything below.
const OUTSIDE: f64 = f64::MIN;
