//! The density of the constants: their prior, and the likelihood of all block averages of all steps, with everything that enters linearly
//! integrated out.
//!
//! Of constants theta, amplitudes a and noise C the averages are normal about m(theta) + sum a_k c_k(theta). The mean m is a sum of POD modes
//! whose coefficients are response surfaces in [`Ratios`] (Gogu et al. 2013, in other variables); the columns c_k follow the constants to first
//! order about a point. Products of modes, columns and data under each noise are made once: a value costs microseconds, whatever the number
//! of points and steps.

mod by_component;
mod by_frames;
mod complete;
mod density;
mod equations;
mod evidence;
mod expansion;
mod full;
pub mod importance;
mod noise_choices;
mod point;
mod posed;
mod ratios;
mod space;
mod surface;
mod weighing;

pub use by_component::ComponentNoise;
pub use complete::{CompletedDraw, GivenChoice, Inclusion, birth_or_death, complete};
pub use density::{ConstantsPrior, MixtureChoice, NoiseScale, PosteriorDensity, REASON_SDS, lower};
pub use equations::Equations;
pub use evidence::{Compiled, PlacesOf, log_evidences};
pub use expansion::{About, CoarseForwards, TestExpansion};
pub use full::Full;
pub use importance::{FullModels, Importance, PosedDraws};
pub use noise_choices::{NoiseChoices, NoisePair, with_data};
pub use point::LinearisationPoint;
pub use posed::{Composition, Posed};
pub use ratios::Ratios;
pub use space::{LinearRole, Space, linear, monomials, shown, stacked, values};
pub use surface::{BlockSnapshots, MeanSurface};
pub use weighing::{Projected, Weighing};
