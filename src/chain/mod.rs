//! Chains: the draws of a run with their axes, and the files that hold them. Nothing here knows of a sampler.

mod csv;
mod draws;
mod store;
mod zarr;

pub use csv::{read_csv, write_csv};
pub use draws::{Draws, Info, MoveTally, Series};
pub use store::{Layout, Store, read as read_zarr};
