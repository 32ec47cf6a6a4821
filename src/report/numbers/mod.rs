//! The numbers of figures: gathered from a finished run, kept as one JSON a figure, and read back.

mod cells;
mod columns;
mod data;
mod gather;
mod lines;
mod mesh;

pub use cells::FieldCells;
pub use columns::columns;
pub use data::{
    FigureData, JointBin, MapCell, MeshPart, MeshPoint, ParameterLine, RankBin, StepCell,
    StiffnessCell, TracePoint, write,
};
pub use lines::{CandidateLine, IntervalLine};
pub use mesh::{lines as mesh_lines, on_mesh};
