//! The noise of a load series, measured by the series itself, and the choices of it that the evidence of effects is averaged over.
//!
//! Values of component c in F frames of the same n blocks have the covariance
//!
//! C_c = (diag(d) + r 1 1') (x) N_c [+ delta s2_c w w' (x) M_l],   N_c = s2_c (K + rho M_l'),
//!
//! K that of white pixel noise through the correlation subset (or diag(nbar / n_b) without one), M_l a Matern-3/2 of length l averaged
//! over blocks, M_l' that or a squared exponential, whichever is likelier. d_s is the noise scale of frame s (geometric mean 1), r the share
//! of the reference picture, which is common to all
//! frames; the bracket is a smooth discrepancy of the model that is the same in all frames (w = 1) or grows with the load (w = f), the
//! rival of every named effect.
//!
//! N and d are estimated where nothing constant and nothing proportional to the load, known or unknown, can enter: by restricted
//! likelihood on the frame contrasts orthogonal to 1 and f ([`FrameNoise`]). Therefore N may have any length there. r and the rivals
//! are left to the evidence (`settings`). A recipe of which a prototype gave the figures: without the reference's share all of 25
//! series of known effects were called unexplained; it is its single most important part.

mod contrasts;
mod family;
mod frame_noise;
mod frames;
mod in_frames;
mod proportion;
mod restricted;
mod rivals;
mod scales;
mod settings;
mod shapes;
mod slices;
mod subset_kernel;

pub use family::SmoothKernel;
pub use frame_noise::{FrameNoise, SpatialNoise};
pub use frames::{Frames, Growth};
pub use in_frames::{FramesInformation, InFrames};
pub use proportion::{Linearity, Role};
pub use rivals::Rival;
pub use settings::{
    At, DISCREPANCY, SeriesNoise, Setting, found_noise, grams, settings, settings_under, steps,
};
pub use subset_kernel::subset_covariance;
