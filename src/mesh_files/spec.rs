//! The `mesh` object of an experiment: a mesh of another program in place of the strip's dimensions, what loads it and what holds it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use super::mesh::{ImportedMesh, named};
use super::regions::{self, RegionSpec, Regions};
use crate::error::{Error, Result};
use crate::files::unique;
use crate::geometry::INTRODUCTIONS;
use crate::laminate::Material;

/// An imported mesh, its place in the data, its loads and supports. Directions and places are those of the mesh's own x and y,
/// which are parallel to the data's.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshSpec {
    /// Gmsh's `.msh`, Abaqus' `.inp` or NASTRAN's `.bdf`.
    pub file: PathBuf,
    /// Length of the mesh's unit, mm; 1000 for a mesh in metres.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub mm_per_unit: f64,
    /// The point of the mesh, mm, that lies at `hole_center_in_data_mm` in the data: the centre of the edge `hole` where that is
    /// a circle, or the mesh's own origin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin_mm: Option<[f64; 2]>,
    /// Where the force acts.
    #[serde(rename = "load")]
    pub loads: OneOrMany<LoadedEdge>,
    /// What is held; none where the loads balance each other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub supports: Vec<HeldEdge>,
    /// What named regions have in place of the specimen's stack.
    #[serde(
        default,
        deserialize_with = "unique",
        skip_serializing_if = "BTreeMap::is_empty"
    )]
    pub regions: Regions,
}

/// One value, or a list of them.
#[derive(Debug, Clone, Serialize)]
#[serde(untagged)]
pub enum OneOrMany<T> {
    One(T),
    Many(Vec<T>),
}

impl<'de, T: DeserializeOwned> Deserialize<'de> for OneOrMany<T> {
    /// With what is wrong of the one, or of that of many, where the derived code would only say that neither fits.
    fn deserialize<D: Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
        let one = |value: Value| serde_json::from_value(value).map_err(D::Error::custom);
        match Value::deserialize(from)? {
            Value::Array(all) => {
                let all: std::result::Result<_, _> = all.into_iter().map(one).collect();
                Ok(Self::Many(all?))
            }
            value => one(value).map(Self::One),
        }
    }
}

impl<T> OneOrMany<T> {
    /// All of them.
    pub fn all(&self) -> &[T] {
        match self {
            OneOrMany::One(one) => std::slice::from_ref(one),
            OneOrMany::Many(many) => many,
        }
    }
}

/// A named edge, or several that act as one, on which the whole force of the test acts.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadedEdge {
    pub edge: OneOrMany<String>,
    /// Where a positive `force_N` pulls, along the mesh's x and y; only its direction counts.
    pub direction: [f64; 2],
    /// How the force is spread.
    #[serde(default, skip_serializing_if = "Spread::is_traction")]
    pub spread: Spread,
}

/// How a force is spread over an edge.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Spread {
    /// A uniform traction with the force as its resultant.
    #[default]
    Traction,
    /// A stiff grip: all of the edge moves alike along the direction and not across it; the tractions follow.
    Grip,
    /// As the measurement has it: only the resultant is the force, and its distribution is identified with the constants.
    Measured,
}

impl Spread {
    #[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
    fn is_traction(&self) -> bool {
        *self == Spread::Traction
    }
}

/// A named edge that is held.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldEdge {
    pub edge: String,
    /// The components of the displacement that are zero along it, of the mesh's x and y.
    #[serde(default = "both")]
    pub fixed: Vec<MeshAxis>,
}

/// An axis of the mesh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MeshAxis {
    X,
    Y,
}

fn both() -> Vec<MeshAxis> {
    vec![MeshAxis::X, MeshAxis::Y]
}

fn one() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_one(factor: &f64) -> bool {
    *factor == 1.0
}

impl MeshSpec {
    /// The same with an absolute path.
    #[must_use]
    pub fn below(mut self, directory: &Path) -> Self {
        self.file = directory.join(&self.file);
        self
    }

    /// Check what the mesh need not be read for.
    ///
    /// # Errors
    /// The input's fault, at the key.
    pub fn validate(&self) -> Result<()> {
        if !(self.mm_per_unit.is_finite() && self.mm_per_unit > 0.0) {
            return Err(
                Error::input("mesh.mm_per_unit", "a length above 0, in mm").found(self.mm_per_unit)
            );
        }
        if self
            .origin_mm
            .is_some_and(|o| !o.iter().all(|x| x.is_finite()))
        {
            return Err(Error::input("mesh.origin_mm", "two finite numbers"));
        }
        if self.file.as_os_str().is_empty() {
            return Err(Error::input("mesh.file", "the path of a mesh").found("\"\""));
        }
        self.check_loads()?;
        if let Some(held) = self.supports.iter().find(|s| s.fixed.is_empty()) {
            return Err(
                Error::input("mesh.supports", "\"fixed\" with \"x\", \"y\" or both")
                    .found(format!("[] of {}", held.edge)),
            );
        }
        self.check_held()?;
        regions::validate(&self.regions)
    }

    /// How many loads enter in a way that the measurement has to tell.
    pub fn measured(&self) -> usize {
        let loads = self.loads.all().iter();
        loads.filter(|l| l.spread == Spread::Measured).count()
    }

    fn check_loads(&self) -> Result<()> {
        if self.loads.all().is_empty() {
            return Err(Error::input("mesh.load", "an edge on which the force acts").found("[]"));
        }
        if self.measured() > INTRODUCTIONS {
            let expected = format!("at most {INTRODUCTIONS} loads that are \"measured\"");
            return Err(Error::input("mesh.load.spread", expected).found(self.measured()));
        }
        for load in self.loads.all() {
            if load.edge.all().is_empty() {
                return Err(
                    Error::input("mesh.load.edge", "the name of an edge, or several").found("[]"),
                );
            }
            let size = load.direction[0].hypot(load.direction[1]);
            if !(size.is_finite() && size > 0.0) {
                let expected = "a direction (x, y), of any length but 0";
                return Err(Error::input("mesh.load.direction", expected)
                    .found(format!("{:?}", load.direction)));
            }
            let along_axis = load.direction.contains(&0.0);
            if load.spread == Spread::Grip && !along_axis {
                return Err(Error::input(
                    "mesh.load.direction",
                    "x or y, for a grip: one that guides along another direction is not known",
                )
                .found(format!("{:?}", load.direction))
                .hint("turn the mesh, or let a traction act"));
            }
        }
        Ok(())
    }

    /// What is held along a load's direction takes all of it, and nothing is strained.
    fn check_held(&self) -> Result<()> {
        for load in self.loads.all() {
            let along = |axis: &MeshAxis| load.direction[usize::from(*axis == MeshAxis::Y)] != 0.0;
            let mut supports = self.supports.iter();
            let held =
                supports.find(|s| load.edge.all().contains(&s.edge) && s.fixed.iter().any(along));
            if let Some(held) = held {
                return Err(Error::input(
                    "mesh.supports",
                    "an edge that is not loaded along what is fixed",
                )
                .found(format!("\"{}\", on which the force acts", held.edge))
                .hint("hold the other end, or fix the component across the force alone"));
            }
        }
        Ok(())
    }

    /// Refuse plies of an isotropic material.
    ///
    /// # Errors
    /// The input's fault, at the key.
    pub fn validate_material(&self, material: Material) -> Result<()> {
        regions::validate_material(&self.regions, material)
    }

    /// The different stacks of the named regions, in the order of their names. Elements of a mesh count them from 1
    /// ([`crate::geometry::Mesh::region`]).
    pub fn stacks(&self) -> Vec<RegionSpec> {
        regions::stacks(&self.regions)
    }

    /// The edges that the spec names are those of a mesh.
    ///
    /// # Errors
    /// The input's fault, with the names that the mesh has.
    pub(super) fn check_edges(&self, mesh: &ImportedMesh) -> Result<()> {
        let loaded = self.loads.all().iter().flat_map(|l| l.edge.all());
        let loaded = loaded.map(|name| ("mesh.load.edge", name));
        let held = self
            .supports
            .iter()
            .map(|s| ("mesh.supports.edge", &s.edge));
        for (place, name) in loaded.chain(held) {
            if !mesh.edges.contains_key(name) {
                let expected = named("edge", mesh.edges.keys(), &self.file);
                return Err(Error::input(place, expected).found(name).hint(
                    "name boundary lines by a physical group (Gmsh) or *SURFACE or *NSET (Abaqus)",
                ));
            }
        }
        Ok(())
    }
}
