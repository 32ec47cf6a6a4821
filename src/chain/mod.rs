//! Chains: the draws of a run with their axes, and the files that hold them. Nothing here knows of a sampler.

#[cfg(feature = "identify")]
mod arviz;
mod coda;
#[cfg(feature = "identify")]
mod codecs;
mod columns;
mod csv;
mod digest;
mod draws;
mod getdist;
mod header;
#[cfg(feature = "identify")]
mod npy;
#[cfg(feature = "identify")]
mod npz;
mod reader;
mod stan;
mod store;
mod zarr;

#[cfg(feature = "identify")]
pub use arviz::{is_groups, read_groups};
pub use coda::{coda_index, read_coda};
pub use csv::{read_csv, write_csv, write_stan};
pub use draws::{Chains, Draws, Info, MoveTally, ScalarDraws};
pub use getdist::{is_getdist, read_getdist, write_getdist};
#[cfg(feature = "identify")]
pub use npy::read_npy;
#[cfg(feature = "identify")]
pub use npz::{read_npz, write_npz};
pub use reader::{StoreReader, TakeChunk, check_stores, read as read_zarr};
pub use store::{Layout, Replay, Store, write_zarr};
