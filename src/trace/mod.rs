//! What the residual of an identification says: sensitivities, evidence of effects, averaged posterior, conclusion.

mod alias;
mod attribute;
mod averaged;
mod close;
mod conclude;
mod holdout;
mod recording;
mod sensitivities;
mod state;
mod subsets;
mod verdict;
mod weighing;

pub use attribute::{Found, Named, Resembling, Tracing, attribute, candidates};
pub use averaged::{Averaged, BlindSpot};
pub use close::{Closed, Step, close, extended};
pub use state::State;
pub use verdict::{Conclusion, Confirming, Status};
