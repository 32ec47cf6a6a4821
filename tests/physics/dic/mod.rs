//! Load series of 2-D image correlation, simulated: a second implementation of camera, subsets, bending and noise, which shares with the program
//! nothing but the finite elements of the loaded plate. Other tests trace what it makes.

pub mod bending;
pub mod camera;
pub mod cases;
pub mod causes;
pub mod folder;
pub mod mechanics;
pub mod noise;
pub mod ordinary;
pub mod series;
pub mod subsets;

mod checks;
mod observation;
mod reference;
