//! Regions of a mesh with a stack of their own.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

use super::mesh::{ImportedMesh, named};
use crate::error::{Error, Result};
use crate::laminate::Material;

/// What a region of the mesh has in place of the specimen's stack; at least one key is given. The ply is the same everywhere.
#[skip_serializing_none]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegionSpec {
    /// Ply angles in place of the specimen's, as its `layup_deg`: from the loading axis, counter-clockwise in the data's x-y plane.
    pub layup_deg: Option<Vec<f64>>,
    /// By which these angles, or the specimen's, are turned, counter-clockwise in the data's x-y plane.
    pub rotation_deg: Option<f64>,
    /// Total thickness where the specimen has the mean of its own. What is uncertain of that is a factor common to both.
    pub thickness_mm: Option<f64>,
}

/// Different stacks of a mesh, at most: the size of a reduced basis and the cost of a solution grow with their number.
const MOST: usize = 16;

impl RegionSpec {
    /// Check the keys of the region at `place`.
    fn validate(&self, place: &str) -> Result<()> {
        let Self {
            layup_deg,
            rotation_deg,
            thickness_mm,
        } = self;
        if layup_deg.is_none() && rotation_deg.is_none() && thickness_mm.is_none() {
            let expected = "layup_deg, rotation_deg or thickness_mm";
            return Err(Error::input(place, expected)
                .found("{}")
                .hint("a region that is not named has the specimen's stack"));
        }
        if let Some(angles) = layup_deg {
            let place = format!("{place}.layup_deg");
            if angles.is_empty() {
                return Err(Error::input(place, "at least one ply angle").found("[]"));
            }
            if let Some(angle) = angles.iter().find(|a| !a.is_finite()) {
                return Err(Error::input(place, "finite numbers").found(angle));
            }
        }
        if let Some(angle) = rotation_deg.filter(|a| !a.is_finite()) {
            let place = format!("{place}.rotation_deg");
            return Err(Error::input(place, "a finite number").found(angle));
        }
        match thickness_mm {
            Some(h) if !(h.is_finite() && *h > 0.0) => {
                let place = format!("{place}.thickness_mm");
                Err(Error::input(place, "a number above 0").found(h))
            }
            _ => Ok(()),
        }
    }
}

/// Regions by the name that the mesh has for them.
pub(super) type Regions = BTreeMap<String, RegionSpec>;

/// The different stacks of regions, in the order of their names.
pub(super) fn stacks(regions: &Regions) -> Vec<RegionSpec> {
    let mut stacks: Vec<RegionSpec> = Vec::new();
    for stack in regions.values() {
        if !stacks.contains(stack) {
            stacks.push(stack.clone());
        }
    }
    stacks
}

/// Check what the mesh need not be read for.
///
/// # Errors
/// The input's fault, at the key.
pub(super) fn validate(regions: &Regions) -> Result<()> {
    for (name, region) in regions {
        region.validate(&format!("mesh.regions.{name}"))?;
    }
    let count = stacks(regions).len();
    if count > MOST {
        let expected = format!("at most {MOST} different stacks");
        return Err(Error::input("mesh.regions", expected).found(count));
    }
    Ok(())
}

/// Refuse plies of an isotropic material.
///
/// # Errors
/// The input's fault, at the key.
pub(super) fn validate_material(regions: &Regions, material: Material) -> Result<()> {
    for (name, region) in regions {
        let given = [
            ("layup_deg", region.layup_deg.is_some()),
            ("rotation_deg", region.rotation_deg.is_some()),
        ];
        let plies = given.iter().find(|(_, given)| *given);
        if let (Material::Isotropic, Some((key, _))) = (material, plies) {
            let place = format!("mesh.regions.{name}.{key}");
            let expected = "no such key, because the material is isotropic";
            return Err(Error::input(place, expected).found("one"));
        }
    }
    Ok(())
}

/// The stack of every element of the mesh in `file`: 0 the specimen's, from 1 on [`stacks`]. Empty where no region is named.
///
/// # Errors
/// The input's fault: a region that the mesh does not have, an element with two stacks.
pub(super) fn stack_of_elements(
    regions: &Regions,
    mesh: &ImportedMesh,
    file: &Path,
) -> Result<Vec<u8>> {
    if regions.is_empty() {
        return Ok(Vec::new());
    }
    let stacks = stacks(regions);
    let mut owner: Vec<Option<&str>> = vec![None; mesh.elements.len()];
    let mut stack = vec![0; mesh.elements.len()];
    for (name, region) in regions {
        let Some(elements) = mesh.regions.get(name) else {
            return Err(unknown(name, mesh, file));
        };
        let own = stacks.iter().position(|s| s == region);
        let own = 1 + own.unwrap_or(0) as u8;
        for &e in elements {
            match owner[e] {
                Some(other) if stack[e] != own => {
                    let expected = format!("one stack for an element of both {other} and {name}");
                    return Err(Error::input("mesh.regions", expected)
                        .found("two")
                        .hint("give regions that overlap the same keys, or name regions that do not overlap"));
                }
                _ => (owner[e], stack[e]) = (Some(name.as_str()), own),
            }
        }
    }
    Ok(stack)
}

fn unknown(name: &str, mesh: &ImportedMesh, file: &Path) -> Error {
    Error::input("mesh.regions", named("region", mesh.regions.keys(), file))
        .found(name)
        .hint("name surfaces by a physical group (Gmsh) or elements by *ELSET (Abaqus)")
}
