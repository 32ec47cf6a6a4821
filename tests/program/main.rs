//! The program as a user starts it: processes, files, pages, clusters.

#[path = "../common/mod.rs"]
mod common;

mod bridge;
mod browser;
mod campaign;
mod chain_intake;
mod cli;
mod costs;
mod design;
mod dictionary;
mod doubts;
mod exports;
mod foreign_chains;
mod fringes;
mod fuzz;
mod identify;
mod intake;
mod library;
mod newcomer;
mod printed_results;
mod prose;
mod report;
mod resume;
mod schema;
mod series_input;
mod stores;
mod study;
mod terminal;
mod together;
mod validation;
