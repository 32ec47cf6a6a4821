//! Patches of what an account leaves of a test.

use nalgebra::{DMatrix, DVector};

use super::evidence::Evidence;
use super::noise_words::reference;
use super::patches::{
    Account, FoundPatch, LocalPatch, MaskedConstant, PatchPart, PatchedPoints, Patches, Scanned,
};
use crate::effect::Scene;
use crate::error::Result;
use crate::field::{Field, MaskShape, MaskedCircle};
use crate::laminate::{Material, MeanSd};
use crate::noise::series::FrameNoise;
use crate::quantity::UM_PER_MM;

/// From these z on a patch is found: in what grows with the load or all frames share, and in what one frame has of its own (prototype study:
/// above 5.2 in 0.4 % of the parts of 420 nulls, above 6 in 0.2 %).
const SURE: f64 = 5.2;
const SURE_OF_ONE_FRAME: f64 = 6.0;

/// Radius of the mask that is proposed, over that of the patch.
const MASKED: f64 = 2.0;

/// A patch in one frame leaves as much in what grows with the load: of two finds at one place the frame's own is the cause, unless its z is
/// less than this share of the other's.
const AS_CLEAR: f64 = 0.8;

/// Where the data are, and how their steps and pixels are called.
pub struct PatchedData<'a> {
    pub field: &'a Field,
    /// What the model expects of every point under the largest force, mm.
    pub displacement: &'a [[f64; 2]],
    pub steps: &'a [String],
    pub scene: &'a Scene,
    /// Size of a pixel, mm, where the data's coordinates count them.
    pub pixel_mm: Option<f64>,
}

/// Patches of what the base model and the best subset leave: of a series that knows its noise, new in each frame; nothing of others.
///
/// # Errors
/// Of the program: columns that are not finite.
pub(super) fn patches(evidence: &Evidence, data: &PatchedData<'_>) -> Result<Option<Patches>> {
    let Some(series) = evidence.weighing.noise.by_frames() else {
        return Ok(None);
    };
    if !series.noise.by_contrasts || series.noise.walks {
        return Ok(None);
    }
    let noise = (&series.noise, reference(&evidence.weighing));
    let loads = series.in_frames.loads();
    held_against(evidence, data, loads, noise).map(Some)
}

fn held_against(
    evidence: &Evidence,
    data: &PatchedData<'_>,
    loads: &[f64],
    (noise, reference): (&FrameNoise, f64),
) -> Result<Patches> {
    let own = evidence.taking_part();
    let residual = evidence.measured.residual(&evidence.sensitivities);
    let stacked = |c: usize| -> DMatrix<f64> {
        let all: Vec<_> = evidence.sensitivities.columns().collect();
        let columns = own.iter().map(|k| &all[*k].values[c]);
        let with_data: Vec<DVector<f64>> = columns.chain([&residual[c]]).cloned().collect();
        DMatrix::from_columns(&with_data)
    };
    let columns = [stacked(0), stacked(1)];
    let columns = columns.each_ref();
    let points = PatchedPoints {
        blocks: &evidence.measured.blocks,
        points: &data.field.points,
        displacement: data.displacement,
    };
    let places = points.places();
    let scanned = Scanned::of_frames(&places, loads, (noise, reference), columns);
    let found = distinct(scanned.patches()?);
    let account = Account {
        sensitivities: &evidence.sensitivities,
        own: &own,
        columns,
        noise,
        reference,
    };
    let clear: Vec<&FoundPatch> = found.iter().filter(|p| is_sure(p)).collect();
    let masked = masked(evidence, &account, &clear);
    Ok(Patches {
        all: found
            .into_iter()
            .map(|p| in_data_coordinates(p, data))
            .collect(),
        masked,
    })
}

/// What a mask of some patches does to the constants.
fn masked(
    evidence: &Evidence,
    account: &Account<'_>,
    found: &[&FoundPatch],
) -> Vec<MaskedConstant> {
    let inside = |p: &[f64; 2]| {
        let near = |f: &&FoundPatch| (p[0] - f.at[0]).hypot(p[1] - f.at[1]) < MASKED * f.radius_mm;
        found.iter().any(near)
    };
    let places = evidence.measured.blocks.centroid.iter().enumerate();
    let left_out: Vec<usize> = places.filter(|(_, p)| inside(p)).map(|(b, _)| b).collect();
    if left_out.is_empty() {
        return Vec::new();
    }
    let (Some(with), Some(without)) = (account.constants(&[]), account.constants(&left_out)) else {
        return Vec::new();
    };
    let change = |(k, (with, without)): (usize, (&MeanSd, &MeanSd))| {
        let by = without.mean - with.mean;
        MaskedConstant {
            name: evidence.sensitivities.base[k].name.clone(),
            percent: 100.0 * by / with.mean,
            sds: by / with.sd,
        }
    };
    with.iter().zip(&without).enumerate().map(change).collect()
}

fn is_sure(found: &FoundPatch) -> bool {
    let least = match found.part {
        PatchPart::Own(_) => SURE_OF_ONE_FRAME,
        _ => SURE,
    };
    found.z > least
}

/// Each patch once, the clearest first: of two finds at one place in two parts the one that is the other's cause.
fn distinct(mut found: Vec<FoundPatch>) -> Vec<FoundPatch> {
    let worth = |p: &FoundPatch| match p.part {
        PatchPart::Own(_) => p.z / AS_CLEAR,
        _ => p.z,
    };
    found.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    let mut kept: Vec<FoundPatch> = Vec::new();
    for patch in found {
        let near = |k: &FoundPatch| {
            let apart = (k.at[0] - patch.at[0]).hypot(k.at[1] - patch.at[1]);
            k.part != patch.part && apart < MASKED * k.radius_mm.max(patch.radius_mm)
        };
        if !kept.iter().any(near) {
            kept.push(patch);
        }
    }
    kept.sort_by(|a, b| b.z.total_cmp(&a.z));
    kept
}

/// Radii about the hole's centre within which a metal yields first.
const YIELDS_WITHIN: f64 = 2.5;

fn in_data_coordinates(found: FoundPatch, data: &PatchedData<'_>) -> LocalPatch {
    let setup = &data.scene.setup;
    let is_metal = data.scene.material == Material::Isotropic && setup.yield_stress.is_none();
    let radii = setup.geometry.hole_radii(found.at);
    let is_at_hole = radii.is_some_and(|radii| radii < YIELDS_WITHIN);
    let is_loaded = matches!(found.part, PatchPart::Own(_) | PatchPart::Load);
    let center_mm = data.field.frame.data_point(found.at);
    let rounded = |x: f64| (100.0 * x).round() / 100.0;
    LocalPatch {
        found: is_sure(&found),
        yields: is_metal && is_at_hole && is_loaded,
        part: found.part,
        family: found.family,
        center_px: data.pixel_mm.map(|px| center_mm.map(|x| x / px)),
        step: match found.part {
            PatchPart::Own(k) => data.steps.get(k).cloned(),
            _ => None,
        },
        mask: MaskShape::Circle(MaskedCircle {
            center_mm: center_mm.map(rounded),
            radius_mm: rounded(MASKED * found.radius_mm),
        }),
        center_mm,
        radius_mm: found.radius_mm,
        largest_um: found.largest_mm * UM_PER_MM,
        z: found.z,
        share_lost: found.share,
    }
}
