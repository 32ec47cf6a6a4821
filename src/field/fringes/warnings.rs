//! What a user should know before believing displacements from fringes.

use super::component::DisplacementMap;
use super::phase::FINEST;
use super::spec::{COMPONENTS, FringeImages};
use crate::quantity::NM_PER_MM;

/// Shares above which a word is worth it: of the picture that is clipped, of the measured pixels where fringes are too fine, and of those
/// of either displacement where the other is not measured.
const CLIPPED: f64 = 0.02;
const FINE: f64 = 1e-3;
const ALONE: f64 = 0.2;
/// Share of the noise above which the uncertainty of the steps is.
const STEPS: f64 = 0.5;

/// All of it.
pub fn of(spec: &FringeImages, components: &[DisplacementMap; 2]) -> Vec<String> {
    let both = components.iter().zip(COMPONENTS);
    let mut said: Vec<String> = both
        .flat_map(|(own, name)| of_one(spec, own, name))
        .collect();
    let [u, v] = [0, 1].map(|c| &components[c].displacement_mm);
    let measured = |u: &[f64]| u.iter().filter(|u| u.is_finite()).count();
    let together = u
        .iter()
        .zip(v)
        .filter(|(u, v)| u.is_finite() && v.is_finite())
        .count();
    let least = measured(u).min(measured(v)) as f64;
    if (together as f64) < (1.0 - ALONE) * least {
        said.push(format!("U and V are measured together at {together} pixels only, of {} and {}: are the pictures of one specimen at one place?", measured(u), measured(v)));
    }
    said
}

fn of_one(spec: &FringeImages, own: &DisplacementMap, name: &str) -> Vec<String> {
    let counts = own.counts();
    let percent = |n: usize| 100.0 * n as f64 / own.pixel.len() as f64;
    let mut said = Vec::new();
    if percent(counts.clipped + own.partly_clipped) > 100.0 * CLIPPED {
        said.push(format!(
            "{name}: the detector saturates. {:.1} % of the picture are left out. {:.1} % are clipped in some frames, at the top or at black, and measured by the others. Adjust exposure and black level",
            percent(counts.clipped), percent(own.partly_clipped)
        ));
    }
    if counts.too_fine as f64 > FINE * counts.measured as f64 {
        said.push(format!("{name}: at {} pixels the fringes are finer than {FINEST} a pixel and left out; where they are finer than 0.5 they cannot be told from coarser ones: magnify, or load less", counts.too_fine));
    }
    if own.parts.len() > 1 {
        said.push(format!("{name}: the field falls into {} parts; whole orders ({:.0} nm) between them are not known: the effect fringe_order_jump measures them", own.parts.len(), NM_PER_MM / spec.fringe_frequency_per_mm));
    }
    let noise_rad = own.sd_nm() / NM_PER_MM / spec.mm_per_rad();
    if own.frames.left_rad > STEPS * noise_rad {
        said.push(format!("{name}: the phase steps are known to {:.3} rad only, a good part of the noise. Their errors are smooth over the picture. Take more frames, or some ten fringes in the initial state", own.frames.left_rad));
    }
    said
}
