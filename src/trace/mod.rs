//! What the residual of an identification says: sensitivities, evidence of effects, averaged posterior, conclusion.

mod alias;
mod attribute;
mod averaged;
mod close;
mod conclusion;
mod evidence;
mod extend;
mod fitted;
mod holdout;
mod layout;
mod recording;
mod ridge;
mod round;
mod sensitivities;
mod series;
mod sought;
mod subsets;
mod suspect;
mod tracing;
mod vetoes;
mod weighing;

pub use attribute::attribute;
pub use averaged::{BlindSpot, Interval};
pub use close::{Closed, close};
pub use conclusion::{Conclusion, Confirming, Status, texts};
pub use evidence::LARGEST_MULTIPLE;
pub use extend::extended;
pub use round::Round;
pub use sought::candidates;
pub use suspect::{Answer, Suspect, UNEXPLAINED};
pub use tracing::{Found, Named, Resembling, StepResidual, Tracing};
