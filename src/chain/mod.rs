//! Chains: the draws of a run with their axes, and the files that hold them. Nothing here knows of a sampler.

mod csv;
mod draws;
mod getdist;
mod npz;
mod store;
mod zarr;

pub use csv::{read_csv, write_csv, write_stan};
pub use draws::{Draws, Info, MoveTally, Series};
pub use getdist::{read_getdist, write_getdist};
pub use npz::write_npz;
pub use store::{Layout, Replay, Store, read as read_zarr};
