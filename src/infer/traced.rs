//! What is known of a series from tracing it.

use crate::experiment::series::SeriesState;
use crate::laminate::MeanSd;

/// What tracing found of a series.
#[derive(Clone)]
pub struct TracedSeries {
    /// Where to linearise it.
    pub state: SeriesState,
    /// What all its steps say of every amplitude, border units.
    pub amplitudes: Vec<(String, MeanSd)>,
}
