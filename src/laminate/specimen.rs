//! The specimen and its load as the model file declares them.

use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

use super::ply::Ply;
use crate::error::{Error, Result};
use crate::quantity;

/// The `specimen` object of a model file.
#[skip_serializing_none]
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpecimenSpec {
    /// Length along direction 1, mm; 0 where a mesh stands in place of the dimensions.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub length_mm: f64,
    /// Width along direction 2, mm; as the length.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub width_mm: f64,
    pub hole: Option<HoleSpec>,
    /// Ply angles from the loading axis, degrees, counter-clockwise in the data's x-y plane, from one face to the other; none
    /// of an isotropic material.
    pub layup_deg: Option<Vec<f64>>,
    /// Total thickness: mean and sd of its spatial average.
    pub thickness_mm: MeanSd,
    /// A clamped end; without one, both ends carry tractions.
    pub clamp: Option<ClampSpec>,
    /// Free text, for example which dimensions are assumed.
    pub note: Option<String>,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HoleSpec {
    pub diameter_mm: f64,
    /// Place of the hole relative to the plate's centre, (direction 1, direction 2), mm.
    pub center_mm: [f64; 2],
}

/// A quantity that is known with some uncertainty, in the unit of its key.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = r#"a mean and its sd, as { "mean": 4.0, "sd": 0.1 }"#
)]
pub struct MeanSd {
    pub mean: f64,
    /// Standard deviation; 0 if it is known exactly.
    pub sd: f64,
}

impl MeanSd {
    /// Refuse a mean that is not above 0, and a negative sd; `place` is the quantity's key.
    ///
    /// # Errors
    /// The input's fault.
    pub fn validate(&self, place: &str) -> Result<()> {
        positive(&format!("{place}.mean"), self.mean)?;
        if self.sd.is_finite() && self.sd >= 0.0 {
            return Ok(());
        }
        Err(Error::input(format!("{place}.sd"), "a number of at least 0").found(self.sd))
    }
}

/// A clamped end: both displacements are zero along it.
#[skip_serializing_none]
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClampSpec {
    /// Which end along direction 1.
    pub end: End,
    /// Width at the clamp, mm, where it is wider than the plate.
    pub width_mm: Option<f64>,
    /// Radius of the fillets between both widths, mm; they lie within `length_mm`.
    pub fillet_radius_mm: Option<f64>,
}

/// An end of the plate along direction 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum End {
    /// The end that direction 1 points away from.
    Low,
    /// The end that direction 1 points to.
    High,
}

/// The `load` object of a model file.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadSpec {
    /// Tensile force along direction 1, N.
    #[serde(rename = "force_N")]
    pub force_n: f64,
}

/// How the ply's stiffness is parameterised.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Material {
    /// Plies with E1, E2, nu12, G12.
    Ply,
    /// One isotropic sheet with E, nu.
    Isotropic,
}

impl Material {
    /// Names of the elastic constants at the border.
    pub fn constants(self) -> &'static [&'static str] {
        match self {
            Material::Ply => &["E1_GPa", "E2_GPa", "nu12", "G12_GPa"],
            Material::Isotropic => &["E_GPa", "nu"],
        }
    }

    /// The ply of the given constants, in border units and the order of [`Material::constants`].
    #[inline(always)]
    pub fn ply(self, constants: &[f64]) -> Ply {
        let mpa = quantity::MPA_PER_GPA;
        match self {
            Material::Ply => Ply {
                e1: constants[0] * mpa,
                e2: constants[1] * mpa,
                nu12: constants[2],
                g12: constants[3] * mpa,
            },
            Material::Isotropic => Ply::isotropic(constants[0] * mpa, constants[1]),
        }
    }
}

impl SpecimenSpec {
    /// Ply angles in degrees; an isotropic sheet is one ply at 0.
    pub fn angles_deg(&self) -> &[f64] {
        self.layup_deg.as_deref().unwrap_or(&[0.0])
    }

    /// Check every dimension, which are the mesh's where the specimen is `meshed`; errors name the key.
    pub fn validate(&self, material: Material, meshed: bool) -> Result<()> {
        if meshed {
            self.validate_meshed()?;
        } else {
            positive("specimen.length_mm", self.length_mm)?;
            positive("specimen.width_mm", self.width_mm)?;
        }
        self.thickness_mm.validate("specimen.thickness_mm")?;
        if self.thickness_mm.sd > 0.1 * self.thickness_mm.mean {
            return Err(Error::input("specimen.thickness_mm.sd", "at most a tenth of the mean")
                .found(self.thickness_mm.sd)
                .hint("the thickness is marginalised to first order, which holds for small relative deviations"));
        }
        let MeanSd { mean, .. } = self.thickness_mm;
        if !meshed && mean >= self.width_mm {
            let expected = "a plate thinner than it is wide";
            let found = format!("{mean} mm thick and {} mm wide", self.width_mm);
            return Err(Error::input("specimen.thickness_mm", expected)
                .found(found)
                .hint(format!("is it in um? {mean} um are {} mm", 1e-3 * mean)));
        }
        if let Some(hole) = &self.hole {
            self.validate_hole(hole)?;
        }
        self.validate_clamp()?;
        self.validate_layup(material)
    }

    fn validate_meshed(&self) -> Result<()> {
        let given = [
            ("length_mm", self.length_mm != 0.0),
            ("width_mm", self.width_mm != 0.0),
            ("hole", self.hole.is_some()),
            ("clamp", self.clamp.is_some()),
        ];
        match given.iter().find(|(_, given)| *given) {
            Some((key, _)) => Err(Error::input(
                format!("specimen.{key}"),
                "no such key, because the mesh has the specimen's shape and what holds it",
            )
            .found("one")),
            None => Ok(()),
        }
    }

    fn validate_hole(&self, hole: &HoleSpec) -> Result<()> {
        positive("specimen.hole.diameter_mm", hole.diameter_mm)?;
        for (&c, key) in hole.center_mm.iter().zip(["[0]", "[1]"]) {
            finite(&format!("specimen.hole.center_mm{key}"), c)?;
        }
        let radius = 0.5 * hole.diameter_mm;
        let half = [0.5 * self.length_mm, 0.5 * self.width_mm];
        for (axis, half) in half.into_iter().enumerate() {
            let ligament = half - hole.center_mm[axis].abs() - radius;
            if ligament < 0.05 * radius {
                return Err(Error::input("specimen.hole", "a hole that stays clear of the plate's edge")
                    .found(format!(
                        "diameter {} mm at {:?} mm in a plate of {} x {} mm, which leaves {ligament:.3} mm along direction {}",
                        hole.diameter_mm, hole.center_mm, self.length_mm, self.width_mm, axis + 1
                    ))
                    .hint("hole.center_mm is measured from the plate's centre, (direction 1 along the load, direction 2)"));
            }
        }
        Ok(())
    }

    fn validate_clamp(&self) -> Result<()> {
        const PLACE: &str = "specimen.clamp";
        let Some(clamp) = self.clamp else {
            return Ok(());
        };
        let (width, radius) = match (clamp.width_mm, clamp.fillet_radius_mm) {
            (None, None) => return Ok(()),
            (Some(width), Some(radius)) => (width, radius),
            _ => {
                return Err(Error::input(
                    PLACE,
                    "width_mm and fillet_radius_mm together, or neither",
                ));
            }
        };
        positive("specimen.clamp.fillet_radius_mm", radius)?;
        let rise = 0.5 * (width - self.width_mm);
        if !(rise.is_finite() && (0.0..=radius).contains(&rise)) {
            return Err(Error::input(
                "specimen.clamp.width_mm",
                "at least the plate's width, and a fillet radius of at least half the difference",
            )
            .found(format!("width {width} mm, fillet radius {radius} mm")));
        }
        let sign = if clamp.end == End::Low { 1.0 } else { -1.0 };
        let (center, reach) = self.hole.map_or((0.0, 0.0), |hole| {
            (hole.center_mm[0], 0.5 * (self.width_mm + hole.diameter_mm))
        });
        let to_clamp = 0.5 * self.length_mm + sign * center;
        let fillet = (radius.powi(2) - (radius - rise).powi(2)).sqrt();
        let free = to_clamp - fillet;
        if free < reach {
            return Err(Error::input(
                PLACE,
                "fillets that stay at least half a width away from the hole, or short of the middle of a plate without one",
            )
            .found(format!(
                "fillets {fillet:.3} mm long with the hole's centre, or the middle, {to_clamp:.3} mm from the clamp"
            )));
        }
        Ok(())
    }

    fn validate_layup(&self, material: Material) -> Result<()> {
        const PLACE: &str = "specimen.layup_deg";
        match (material, &self.layup_deg) {
            (Material::Ply, None) => {
                Err(Error::input(PLACE, "the ply angles in degrees").found("no such key"))
            }
            (Material::Ply, Some(angles)) if angles.is_empty() => {
                Err(Error::input(PLACE, "at least one ply angle").found("[]"))
            }
            (Material::Isotropic, Some(angles)) => Err(Error::input(
                PLACE,
                "no layup, because the material is isotropic",
            )
            .found(format!("{angles:?}"))),
            (Material::Ply, Some(angles)) => {
                angles.iter().try_for_each(|&angle| finite(PLACE, angle))
            }
            (Material::Isotropic, None) => Ok(()),
        }
    }
}

impl LoadSpec {
    pub fn validate(&self) -> Result<()> {
        positive("load.force_N", self.force_n)
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_zero(length: &f64) -> bool {
    *length == 0.0
}

fn finite(place: &str, value: f64) -> Result<()> {
    if value.is_finite() {
        return Ok(());
    }
    Err(Error::input(place, "a finite number").found(value))
}

fn positive(place: &str, value: f64) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Error::input(place, "a number above 0").found(value))
}
