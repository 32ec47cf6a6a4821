//! What the residual of an identification says: sensitivities, evidence of effects, averaged posterior, conclusion.

mod alias;
mod attribute;
mod averaged;
mod close;
mod conclusion;
mod evidence;
mod holdout;
mod recording;
mod sensitivities;
mod subsets;
mod weighing;

pub use attribute::{Found, Named, Resembling, Tracing, attribute, candidates};
pub use averaged::{Averaged, BlindSpot};
pub use close::{Closed, Round, close, extended};
pub use conclusion::{Conclusion, Confirming, Status};
