//! The specimen's shape: its mesh at a given density, its named edges, and what may be changed about it.
//!
//! A new geometry is one new file here and one line in [`GEOMETRIES`].

mod grading;
mod mesh;
mod outline;
mod plain_strip;
mod strip_with_hole;

use std::fmt::Debug;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::laminate::{End, SpecimenSpec};

pub use mesh::{Boundary, Edge, EdgeForce, INTRODUCTIONS, Mesh};
pub use outline::Outline;
pub use plain_strip::PlainStrip;
pub use strip_with_hole::StripWithHole;

/// The end that direction 1 points away from.
pub const LOW: &str = "low";
/// The end that direction 1 points to.
pub const HIGH: &str = "high";
/// Both edges along direction 1.
pub const SIDES: &str = "sides";
pub const HOLE: &str = "hole";

/// The edge at an end.
pub fn end(end: End) -> &'static str {
    match end {
        End::Low => LOW,
        End::High => HIGH,
    }
}

/// Makes a specimen's geometry, if it is of the kind.
pub type Builder = fn(&SpecimenSpec) -> Option<Arc<dyn Geometry>>;

/// Every kind of geometry that a specimen's dimensions make. A specimen's is the first whose builder takes it; that of a mesh file is
/// `mesh_files::ImportedPlate`.
pub static GEOMETRIES: &[Builder] = &[strip_with_hole::build, plain_strip::build];

pub fn declared(specimen: &SpecimenSpec) -> Arc<dyn Geometry> {
    GEOMETRIES
        .iter()
        .find_map(|build| build(specimen))
        .unwrap_or_else(|| Arc::new(PlainStrip::of(specimen)))
}

/// How fine a mesh is: a factor on the numbers of elements of a geometry's default mesh.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub struct Density(pub f64);

impl Density {
    /// The default mesh.
    pub const DEFAULT: Density = Density(1.0);

    /// The same with all numbers of elements multiplied by `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self(self.0 * factor)
    }

    /// The number of elements where the default mesh has `default`, at least 2.
    pub fn count(self, default: usize) -> usize {
        ((default as f64 * self.0).round() as usize).max(2)
    }
}

/// How the shape of a test differs from the declared one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Morph {
    /// Factor on the hole's radius.
    pub hole_size: f64,
    /// Displacement of the hole in the plate along both directions, mm. The origin stays at its centre.
    pub hole_offset: [f64; 2],
    /// Factor on the plate's width. Its sides stay as far from its middle as each other.
    pub width: f64,
}

impl Morph {
    /// The declared shape.
    pub const NONE: Morph = Morph {
        hole_size: 1.0,
        hole_offset: [0.0; 2],
        width: 1.0,
    };
}

/// The shape of a flat specimen. Points are (direction 1, direction 2) in mm, from the geometry's own origin: the
/// hole's centre, or the plate's where there is none. Two geometries are equal if they print the same numbers.
pub trait Geometry: Debug + Send + Sync {
    /// Name of its kind.
    fn name(&self) -> &'static str;

    /// Extents of the parallel part, `[low, high]` mm along both directions. Loads, tapers and the gauge refer to them.
    fn extents(&self) -> [[f64; 2]; 2];

    /// Largest width over that of the parallel part.
    fn widening(&self) -> f64 {
        1.0
    }

    /// Distance of a point from a named edge, mm, negative beyond it, off the plate; `None` if there is no such edge.
    fn distance(&self, edge: &str, point: [f64; 2]) -> Option<f64>;

    /// Radius of the hole, mm, if there is one.
    fn hole_radius(&self) -> Option<f64> {
        None
    }

    /// Whether edges `low` and `high` stand across direction 1, through which it can be bent.
    fn has_ends(&self) -> bool {
        true
    }

    /// Whether what loads it may be bent and turned in the plane, which stiff grips are not.
    fn yields_to_moments(&self) -> bool {
        true
    }

    /// How many edges the force enters through in a way that only the measurement tells.
    fn introductions(&self) -> usize {
        0
    }

    /// Distance of a point from the hole's centre over the hole's radius, if there is a hole.
    fn hole_radii(&self, point: [f64; 2]) -> Option<f64> {
        Some(1.0 + self.distance(HOLE, point)? / self.hole_radius()?)
    }

    /// Check that it can be meshed.
    ///
    /// # Errors
    /// A dimension that is not finite, or a hole too close to an edge.
    fn validate(&self) -> Result<()>;

    /// Whether its hole may have another size and place.
    fn has_movable_hole(&self) -> bool {
        false
    }

    /// Whether its width may be another.
    fn has_parallel_sides(&self) -> bool {
        false
    }

    /// The changed shape, which keeps the connectivity of the mesh.
    ///
    /// # Errors
    /// Of the program, for a change that is not on offer; otherwise those of [`Geometry::validate`] for the changed shape.
    fn morphed(&self, morph: &Morph) -> Result<Arc<dyn Geometry>>;

    /// The numbers of elements that make a mesh's connectivity, in an order of the geometry's own.
    fn counts(&self, density: Density) -> Vec<usize>;

    /// The mesh of these [`Geometry::counts`].
    fn mesh(&self, counts: &[usize]) -> Mesh;
}

impl PartialEq for dyn Geometry {
    fn eq(&self, other: &Self) -> bool {
        format!("{self:?}") == format!("{other:?}")
    }
}

/// A change that a geometry does not offer.
pub(crate) fn not_offered(geometry: &dyn Geometry, morph: &Morph) -> Error {
    Error::program("Geometry::morphed", "a change that the geometry offers")
        .found(format!("{morph:?} of a {}", geometry.name()))
}
