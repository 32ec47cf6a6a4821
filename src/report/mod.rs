//! What a run leaves behind: numbers gathered once, and tables made of them.

pub mod numbers;
pub mod ranking;
pub mod tables;
pub mod terminal;
pub mod traced;
pub mod validation;
