//! Rayleigh-Ritz for a rectangular anisotropic laminate in products of orthogonal polynomials.
//!
//! All integrals are computed once; the stiffness is linear in D and S and the mass in its parts, so that other constants cost a sum of
//! stored matrices and the eigenvalues. Where the supports are symmetric, functions that are even and odd do not couple (with D16, D26
//! the sum of both parities decides), which splits the problem into families. Frequencies are upper bounds that fall with the order.
//! (W. Ritz, J. reine angew. Math. 135 (1909) 1; S. F. Bassily and S. M. Dickinson, J. Appl. Mech. 42 (1975) 858 for the polynomials.)

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::air;
use super::assembly::{Functions, IntegralFamily, Triangle, Whole};
use super::dense;
use super::plate::{HZ_LAMBDA, PlateCoefficients, PlateParameter, VibratingPlate, is_twisting};
use super::theory::{EdgeLayers, PlateSupports, Theory};
use crate::error::{Error, Result};

/// Places among the inertias.
const ROTATIONS: [usize; 2] = [1, 2];
const AIR: usize = 3;
const POINT: usize = 4;

/// What the stored matrices depend on.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    pub theory: Theory,
    pub supports: PlateSupports,
    /// Polynomials along each side; 12 is good to 1e-5 of the lowest ten frequencies with free edges.
    pub order: usize,
    /// Whether the plate's thickness has inertia against rotation.
    pub rotary_inertia: bool,
    /// Layers at the free edges of a sheared plate, [`VibratingPlate::edge_layers`].
    pub edge_layers: Option<EdgeLayers>,
    /// Length over width of the plate about which air moves; none leaves the air's matrix out.
    pub air_aspect: Option<f64>,
    /// Place of a point mass as shares of length and width, in [0, 1]; it breaks all symmetry.
    pub point: Option<[f64; 2]>,
}

impl Settings {
    /// A free plate with 12 x 12 polynomials, without air and point mass.
    pub fn free(theory: Theory) -> Self {
        Self {
            theory,
            supports: PlateSupports::all(super::PlateEdge::Free),
            order: 12,
            rotary_inertia: true,
            edge_layers: None,
            air_aspect: None,
            point: None,
        }
    }
}

/// The stored matrices of one set of supports; good for any constants and dimensions.
#[derive(Debug, Clone)]
pub struct Ritz {
    functions: Functions,
    /// Families of laminates without and with coupling of bending and twisting.
    pub(super) partitions: [Vec<IntegralFamily>; 2],
    /// Factors of lambda by partition, family and rank, where a hole has any.
    factors: BTreeMap<([usize; 2], usize), f64>,
}

/// A natural mode.
#[derive(Debug, Clone)]
pub struct VibrationMode {
    /// Square of the angular frequency, 1/s^2.
    pub lambda: f64,
    /// Whether the deflection changes its sign when the plate is turned by 180 degrees (m + n odd for half-waves m, n): the sign between
    /// two opposite points. None where supports or a point mass break the symmetry.
    pub odd: Option<bool>,
    /// Place by frequency among its family's modes: with the family it tells which mode this is where others cross it.
    pub rank: usize,
    /// What a hole makes of lambda; included in it.
    factor: f64,
    /// Which partition and which family of it.
    pub(super) place: [usize; 2],
    /// Amplitudes in the family's unknowns, of unit modal mass (t).
    pub(super) amplitudes: DVector<f64>,
}

impl VibrationMode {
    /// Whether this is the same mode as one of another solution of the same problem.
    pub fn is(&self, other: &VibrationMode) -> bool {
        (self.place, self.rank) == (other.place, other.rank)
    }

    /// Natural frequency, Hz.
    pub fn frequency_hz(&self) -> f64 {
        (self.lambda / HZ_LAMBDA).sqrt()
    }
}

impl Ritz {
    /// Integrate everything once.
    ///
    /// # Errors
    /// The input's fault: an order below 3 or above 30, a point outside the plate, a ratio of sides that is not above 0.
    pub fn new(settings: &Settings) -> Result<Self> {
        let Settings {
            theory, supports, ..
        } = settings;
        if !(3..=30).contains(&settings.order) {
            return Err(Error::input("polynomials a side", "3 to 30").found(settings.order));
        }
        let functions = Functions::new(*theory, supports, settings.order, settings.edge_layers);
        let mut whole = Whole::new(*theory, supports, &functions);
        if !settings.rotary_inertia {
            ROTATIONS.iter().for_each(|&i| whole.inertia[i].clear());
        }
        if let Some(aspect) = settings.air_aspect {
            if !(aspect.is_finite() && aspect > 0.0) {
                return Err(Error::input("length over width", "a number above 0").found(aspect));
            }
            whole.inertia[AIR] = air::added_mass(&functions, aspect)?;
        }
        if let Some(point) = settings.point {
            if !point.iter().all(|s| (0.0..=1.0).contains(s)) {
                let expected = "shares of length and width in [0, 1]";
                return Err(
                    Error::input("place of the point mass", expected).found(format!("{point:?}"))
                );
            }
            whole.inertia[POINT] = point_mass(&functions, point);
        }
        let lone = settings.point.is_some();
        let partitions = [false, true].map(|twisting| whole.families(&functions, twisting, lone));
        Ok(Self {
            functions,
            partitions,
            factors: BTreeMap::new(),
        })
    }

    /// The same with factors of the lambdas of some modes; a mode beyond them has that of the one below it in its family.
    pub fn with_factors(mut self, modes: &[VibrationMode], factors: &[f64]) -> Self {
        let places = modes.iter().map(|m| (m.place, m.rank));
        self.factors = places.zip(factors.iter().copied()).collect();
        self
    }

    /// The factor of a mode, or that of the next lower one of its family.
    fn factor(&self, place: [usize; 2], rank: usize) -> f64 {
        let known = self.factors.range((place, 0)..=(place, rank));
        known.last().map_or(1.0, |(_, factor)| *factor)
    }

    /// The `count` lowest modes with strain, by increasing frequency; fewer if the polynomials have fewer.
    ///
    /// Motions of the rigid plate are not found and sorted out: their number and form follow from the supports, and a stiffness against them
    /// alone moves them to the upper end of the spectrum. Modes of different families may coincide; each then is still a shape of its own.
    ///
    /// # Errors
    /// The input's fault if the stiffness is not positive definite; the program's if there is air or a point mass whose matrix was not made.
    pub fn modes(&self, of: &PlateCoefficients, count: usize) -> Result<Vec<VibrationMode>> {
        let partition = usize::from(is_twisting(of));
        for (index, expected) in [
            (AIR, "a ratio of sides for the air"),
            (POINT, "a place of the point mass"),
        ] {
            let mut families = self.partitions[partition].iter();
            if of.inertia[index] != 0.0 && families.all(|f| f.inertia[index].is_empty()) {
                return Err(Error::program("natural frequencies", expected).found("none"));
            }
        }
        let mut modes = Vec::new();
        for family in 0..self.partitions[partition].len() {
            modes.extend(self.family_modes(of, count, [partition, family])?);
        }
        modes.sort_by(|a, b| a.lambda.total_cmp(&b.lambda));
        modes.truncate(count);
        Ok(modes)
    }

    /// The lowest modes of the family at a place.
    pub(super) fn family_modes(
        &self,
        of: &PlateCoefficients,
        count: usize,
        place: [usize; 2],
    ) -> Result<Vec<VibrationMode>> {
        let family = &self.partitions[place[0]][place[1]];
        let [mut k, m] = family.matrices(of);
        hold(&mut k, &m, &family.rigid);
        let (lambda, vectors) = dense::lowest(k, m, count.min(family.elastic()))?;
        let modes = lambda
            .into_iter()
            .enumerate()
            .map(|(i, lambda)| VibrationMode {
                lambda: lambda * self.factor(place, i),
                odd: family.odd,
                rank: i,
                factor: self.factor(place, i),
                place,
                amplitudes: vectors.column(i).into_owned(),
            });
        Ok(modes.collect())
    }

    /// Derivatives of a mode's lambda (1/s^2) by the coefficients of which it is the mode: Rayleigh's quotient,
    /// dlambda = c' dK c - lambda c' dM c.
    ///
    /// Where two modes *of one family* coincide, the derivative of each is not defined: what is returned is that of one shape among many,
    /// and only the sum over both is the derivative of the sum. Modes of different families (all pairs of an isotropic or cross-ply
    /// square plate are of this kind) keep their own derivative and simply cross.
    pub fn slope(&self, mode: &VibrationMode) -> PlateCoefficients {
        let family = &self.partitions[mode.place[0]][mode.place[1]];
        let (stiffness, inertia) = family.energies(&mode.amplitudes);
        PlateCoefficients {
            stiffness: stiffness.map(|energy| mode.factor * energy),
            inertia: inertia.map(|energy| -mode.lambda * energy),
        }
    }

    /// Derivatives of a mode's frequency (Hz) by parameters of the plate of which it is the mode; see [`Ritz::slope`].
    pub fn sensitivities_hz(
        &self,
        mode: &VibrationMode,
        plate: &VibratingPlate,
        to: &[PlateParameter],
    ) -> Vec<f64> {
        let slope = self.slope(mode);
        let scale = 0.5 / (HZ_LAMBDA * mode.frequency_hz());
        let along = |parameter: &PlateParameter| scale * slope.dot(&plate.slope(*parameter));
        to.iter().map(along).collect()
    }

    /// Amplitudes of all functions in a mode.
    fn amplitudes(&self, mode: &VibrationMode) -> Vec<f64> {
        let family = &self.partitions[mode.place[0]][mode.place[1]];
        let own = match &family.lift {
            Some(lift) => lift * &mode.amplitudes,
            None => mode.amplitudes.clone(),
        };
        let mut all = vec![0.0; self.functions.list.len()];
        for (&function, &amplitude) in family.functions.iter().zip(own.iter()) {
            all[function] = amplitude;
        }
        all
    }

    /// Deflection of a mode at points given as shares of length and width in [0, 1], in any one unit.
    pub fn deflection(&self, mode: &VibrationMode, points: &[[f64; 2]]) -> Vec<f64> {
        let amplitudes = self.amplitudes(mode);
        let [along, across] = &self.functions.bases[0];
        let at = |&[s, t]: &[f64; 2]| {
            let (x, y) = (along.jets(2.0 * s - 1.0), across.jets(2.0 * t - 1.0));
            let own = self.functions.list.iter().zip(&amplitudes);
            own.filter(|(f, _)| f.field == 0)
                .map(|(f, amplitude)| amplitude * x[f.m][0] * y[f.n][0])
                .sum()
        };
        points.iter().map(at).collect()
    }

    /// The polynomials (m, n) of the largest amplitude in a mode's deflection: with free edges its half-waves along and across.
    pub fn label(&self, mode: &VibrationMode) -> [usize; 2] {
        let amplitudes = self.amplitudes(mode);
        let own = self.functions.list.iter().zip(&amplitudes);
        let largest = own
            .filter(|(f, _)| f.field == 0)
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        largest.map_or([0, 0], |(f, _)| [f.m, f.n])
    }

    /// Mass (t) of the air of density `density` (t/mm^3) that moves with a free plate of sides `sides` (mm) as a whole; none where
    /// supports forbid that.
    pub fn heave_added_mass(&self, density: f64, sides: [f64; 2]) -> Option<f64> {
        let mut families = self.partitions[0].iter();
        // the motion without rotation is the first rigid one, even in both directions
        let family = families.find(|f| f.odd != Some(true) && f.rigid.len() == 1)?;
        let area = sides[0] * sides[1];
        let (_, inertia) = family.energies(&family.rigid[0]);
        Some(density * 0.25 * area * area.sqrt() * inertia[AIR])
    }
}

impl PlateCoefficients {
    /// Sum of products, of a derivative with a change.
    pub fn dot(&self, change: &PlateCoefficients) -> f64 {
        let sum = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        sum(&self.stiffness, &change.stiffness) + sum(&self.inertia, &change.inertia)
    }
}

/// Add s (M r)(M r)' for every rigid motion r of unit mass, which gives it the eigenvalue s and leaves all others, to which it is
/// orthogonal. s is the largest Rayleigh quotient of a single function: above any mode that is asked for.
fn hold(k: &mut DMatrix<f64>, m: &DMatrix<f64>, rigid: &[DVector<f64>]) {
    let quotients = (0..k.nrows()).filter(|&i| m[(i, i)] > 0.0);
    let s = quotients.map(|i| k[(i, i)] / m[(i, i)]).fold(0.0, f64::max);
    // motions of unit mass, orthogonal in M, and M times each
    let mut held: Vec<[DVector<f64>; 2]> = Vec::new();
    for motion in rigid {
        let mut r = motion.clone();
        for [earlier, image] in &held {
            r.axpy(-image.dot(&r), earlier, 1.0);
        }
        let image = m * &r;
        let scale = 1.0 / r.dot(&image).sqrt();
        let image = image * scale;
        k.ger(s, &image, &image, 1.0);
        held.push([r * scale, image]);
    }
}

/// Matrix of a unit mass at a point given in shares of length and width; the rotation of the body is left out.
fn point_mass(functions: &Functions, [s, t]: [f64; 2]) -> Triangle {
    let [along, across] = &functions.bases[0];
    let (x, y) = (along.jets(2.0 * s - 1.0), across.jets(2.0 * t - 1.0));
    let own: Vec<(u32, f64)> = (0..)
        .zip(&functions.list)
        .filter(|(_, f)| f.field == 0)
        .map(|(i, f)| (i, x[f.m][0] * y[f.n][0]))
        .collect();
    let mut triangle = Triangle::new();
    for (i, &(row, left)) in own.iter().enumerate() {
        triangle.extend(
            own[..=i]
                .iter()
                .map(|&(column, right)| (row, column, left * right)),
        );
    }
    triangle
}
