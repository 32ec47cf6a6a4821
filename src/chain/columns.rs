//! What programs call the columns of a chain file that are no parameters.

/// What programs call the number of a chain (ours and ArviZ; posterior of R; coda of R), and that of a draw.
pub(super) const CHAIN: &[&str] = &["chain", ".chain", "CHAIN", "Chain", "chain_id"];
const DRAW: &[&str] = &[
    "draw",
    ".draw",
    "iteration",
    ".iteration",
    "ITER",
    "Iteration",
];

/// The same where it is the first column alone (BEAST, LALInference and others): further on it is a parameter.
const COUNTER: &[&str] = &["state", "Sample", "iter", "Iter", "Gen", "cycle"];

/// Whether the column number `at` counts draws.
pub(super) fn is_draw(at: usize, name: &str) -> bool {
    DRAW.contains(&name) || at == 0 && COUNTER.contains(&name)
}

/// What a sampler's column holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ColumnRole {
    LogDensity,
    Divergent,
    TreeDepth,
    /// Whether the trajectory ended at the largest depth that the user allows.
    Saturated,
    Energy,
    /// The sampler's own, of no use here.
    Other,
}

impl ColumnRole {
    /// Its name in [`crate::chain::Info::columns`], Stan's where Stan has one.
    pub fn name(self) -> Option<&'static str> {
        match self {
            Self::Divergent => Some("divergent__"),
            Self::TreeDepth => Some("treedepth__"),
            Self::Saturated => Some("saturated__"),
            Self::Energy => Some("energy__"),
            Self::LogDensity | Self::Other => None,
        }
    }
}

/// Columns of one program. Their names are words that a parameter may have too: they count where all of `marks` are there.
struct SamplerColumns {
    marks: &'static [&'static str],
    columns: &'static [(ColumnRole, &'static [&'static str])],
}

const SAMPLERS: &[SamplerColumns] = &[
    // sample_stats of PyMC, ArviZ, NumPyro and nuts-rs
    SamplerColumns {
        marks: &["diverging"],
        columns: &[
            (ColumnRole::LogDensity, &["lp", "logp", "model_logp"]),
            (ColumnRole::Divergent, &["diverging"]),
            (ColumnRole::TreeDepth, &["tree_depth", "depth"]),
            (
                ColumnRole::Saturated,
                &["reached_max_treedepth", "maxdepth_reached"],
            ),
            (ColumnRole::Energy, &["energy"]),
            (
                ColumnRole::Other,
                &[
                    "energy_error",
                    "max_energy_error",
                    "potential_energy",
                    "step_size",
                    "step_size_bar",
                    "acceptance_rate",
                    "mean_tree_accept",
                    "accept_prob",
                    "n_steps",
                    "num_steps",
                    "index_in_trajectory",
                    "perf_counter_diff",
                    "perf_counter_start",
                    "process_time_diff",
                    "largest_eigval",
                    "smallest_eigval",
                ],
            ),
        ],
    },
    // Turing, as MCMCChains writes it: with NUTS, and with any sampler
    SamplerColumns {
        marks: &["hamiltonian_energy"],
        columns: &[
            (ColumnRole::LogDensity, &["lp"]),
            (ColumnRole::Divergent, &["numerical_error"]),
            (ColumnRole::TreeDepth, &["tree_depth"]),
            (ColumnRole::Energy, &["hamiltonian_energy"]),
            (
                ColumnRole::Other,
                &[
                    "log_density",
                    "hamiltonian_energy_error",
                    "max_hamiltonian_energy_error",
                    "step_size",
                    "nom_step_size",
                    "n_steps",
                    "is_accept",
                    "is_adapt",
                    "acceptance_rate",
                    "logprior",
                    "loglikelihood",
                    "logjoint",
                ],
            ),
        ],
    },
    SamplerColumns {
        marks: &["iteration", "chain", "lp"],
        columns: &[
            (ColumnRole::LogDensity, &["lp"]),
            (
                ColumnRole::Other,
                &["logprior", "loglikelihood", "logjoint"],
            ),
        ],
    },
    SamplerColumns {
        marks: &["logl", "logprior"],
        columns: &[
            (ColumnRole::LogDensity, &["logpost"]),
            (
                ColumnRole::Other,
                &[
                    "logl",
                    "logprior",
                    "deltalogl",
                    "deltaloglh1",
                    "deltalogll1",
                    "deltaloglv1",
                    "temperature",
                ],
            ),
        ],
    },
];

/// What arrays of a role are called in `sample_stats`.
#[cfg(feature = "identify")]
pub(super) fn statistics(role: ColumnRole) -> &'static [&'static str] {
    let mut all = SAMPLERS[0].columns.iter();
    all.find(|(own, _)| *own == role)
        .map_or(&[], |(_, names)| names)
}

/// What the column `name` is for its sampler; none of a parameter.
pub(super) fn role(name: &str, columns: &[String]) -> Option<ColumnRole> {
    match name {
        "lp__" => return Some(ColumnRole::LogDensity),
        "divergent__" => return Some(ColumnRole::Divergent),
        "treedepth__" => return Some(ColumnRole::TreeDepth),
        "energy__" => return Some(ColumnRole::Energy),
        _ if name.ends_with("__") => return Some(ColumnRole::Other),
        _ => {}
    }
    let is_there = |mark: &&str| columns.iter().any(|c| c == mark);
    let of_sampler = |s: &SamplerColumns| {
        let mut all = s.columns.iter();
        all.find(|(_, names)| names.contains(&name))
            .filter(|_| s.marks.iter().all(is_there))
    };
    SAMPLERS.iter().find_map(of_sampler).map(|(role, _)| *role)
}
