//! Ncorr, as a table or as arrays of the displacements that it calls formatted.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, Program, columns};

pub const PROGRAM: Program = Program {
    exports: &[columns(
        "Ncorr (as a table of plot_u_ref_formatted, plot_v_ref_formatted)",
        ["x", "y", "plot_u_ref_formatted", "plot_v_ref_formatted"],
        Of("mm"),
    )],
    ..COLUMNS_ONLY
};
