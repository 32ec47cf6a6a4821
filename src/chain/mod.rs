//! Chains: the draws of a run with their axes, and the files that hold them. Nothing here knows of a sampler.

mod csv;
mod draws;
mod getdist;
mod npz;
mod reader;
mod store;
mod table;
mod zarr;

pub use csv::{read_csv, write_csv, write_stan};
pub use draws::{Chains, Draws, Info, MoveTally, Series};
pub use getdist::{read_getdist, write_getdist};
pub use npz::write_npz;
pub use reader::{Reader, TakeChunk, read as read_zarr};
pub use store::{Layout, Replay, Store, write_zarr};
pub use table::write_table;
