//! The density of the constants: their prior, and the likelihood of all block averages of all steps, with everything that enters linearly
//! integrated out.
//!
//! Of constants theta, amplitudes a and noise C the averages are normal about m(theta) + sum a_k c_k(theta). The mean m is a sum of POD modes
//! whose coefficients are response surfaces in [`Ratios`] (Gogu et al. 2013, in other variables); the columns c_k follow the constants to first
//! order about a point. Products of modes, columns and data under each noise are made once: a value costs microseconds, whatever the number
//! of points and steps.

mod complete;
mod density;
mod equations;
mod evidence;
mod expansion;
mod ratios;
mod space;
mod surface;

pub use complete::{CompletedDraw, GivenChoice, Inclusion, birth_or_death, complete};
pub use density::{ConstantsPrior, Density, MixtureChoice, lower};
pub use equations::Equations;
pub use evidence::{Compiled, PlacesOf, log_evidences};
pub use expansion::{About, CoarseForwards, Expansion};
pub use ratios::Ratios;
pub use space::{Space, Whose, linear, monomials, shown, stacked, values};
pub use surface::{Snapshots, Surface};
