//! Published figures of Gogu et al., Experimental Mechanics 53 (2013).

/// Names of the four constants.
pub const NAMES: [&str; 4] = ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"];

/// Table 1: values of Noh from a four-point bending test of the same prepreg roll.
pub const NOH: [f64; 4] = [144.0, 7.99, 0.34, 7.78];

/// Table 5: truncation bounds of the prior.
pub const TRUNCATION: [[f64; 2]; 4] = [[118.0, 162.0], [6.0, 9.5], [0.26, 0.36], [4.25, 5.75]];

/// Table 6: mean of the identified distribution.
pub const MEAN: [f64; 4] = [140.0, 7.48, 0.33, 5.02];

/// Table 6: coefficient of variation, %.
pub const COV_PERCENT: [f64; 4] = [3.3, 9.5, 10.3, 4.3];

/// Table 7: correlation.
pub const CORRELATION: [[f64; 4]; 4] = [
    [1.0, 0.023, -0.043, 0.51],
    [0.023, 1.0, -0.005, -0.17],
    [-0.043, -0.005, 1.0, 0.24],
    [0.51, -0.17, 0.24, 1.0],
];

/// Table 4: sd of the priors.
pub const PRIOR_SD: [f64; 4] = [16.0, 0.75, 0.03, 0.5];

/// What the published figures cannot be compared with, in sentences.
pub fn caveats() -> Vec<String> {
    vec![
        format!(
            "The published sd of nu12, {:.3}, exceeds that of its own prior, {:.2}. No data can widen a prior so, least of all a truncated one.",
            MEAN[2] * COV_PERCENT[2] / 100.0,
            PRIOR_SD[2]
        ),
        "The published grid was converged to 1 % in the means, 8 % in the sd and 10 % in the correlations.".into(),
        "The published sd are of measured fields. Their noise and gauge are not stated, and the specimen's drawing is missing. Length, width and hole are assumed here.".into(),
    ]
}
