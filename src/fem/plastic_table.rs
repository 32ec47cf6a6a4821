//! The plastic part of a plate's displacements, tabulated.
//!
//! J2 plasticity has no scale of its own: under an axial force F that grows from nothing, the plastic part over sigma_y / E depends on the
//! load level F / (sigma_y h W), on H / E and on nu alone. Under prescribed tractions the stresses of a plate in plane stress do not depend
//! on nu, plastic or not, so that the plastic part is linear in nu; with a clamped end nearly so.

use std::thread;

use super::initial_stress::gauss_points;
use super::load::{EndLoad, end_forces};
use super::plasticity::J2;
use super::solve::Factor;
use super::yielding::{Body, Walk};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::laminate::{Membrane, Ply, abd};

/// Load levels from the first yielding of a Gauss point to [`BEYOND`].
const LEVELS: usize = 14;

/// The last level over the first: where yielding begins at a hole the net section is then about to flow, and hardly hardening plates do not
/// come to rest far beyond.
const BEYOND: f64 = 2.2;

/// Levels lie closer where yielding begins: their distances from the onset grow with this power of their number.
const CROWDED: f64 = 1.3;

/// Tabulated H / E. The interpolation is quadratic in (H / E)^-1/2: exact where a section flows as a whole and strains by 1 / H, and good to 7 %
/// of the plastic part at a third of the nominal hardening (`tests/yielding/table.rs`).
const HARDENING: [f64; 3] = [0.06, 0.01, 0.01 / 6.0];

/// Share of the largest elastic displacement at which an increment ends: a thousandth of the noise of any camera.
const TOLERANCE: f64 = 1e-8;

/// Poisson's ratios between which the plastic part is linear.
const POISSON: [f64; 2] = [0.3, 0.2];

/// Nodal plastic parts of a plate of unit Young's modulus and yield stress.
pub struct PlasticTable {
    width: f64,
    /// Level at which the first Gauss point yields.
    onset: f64,
    /// Levels above it, increasing.
    levels: Vec<f64>,
    /// For each hardening and each level.
    fields: Vec<Vec<UnitField>>,
}

/// A nodal plastic part, mm, at the first Poisson's ratio, and its growth with Poisson's ratio.
struct UnitField {
    nodal: Vec<f64>,
    slope: Vec<f64>,
}

/// What a plastic part depends on.
#[derive(Debug, Clone, Copy)]
pub struct Metal {
    /// MPa.
    pub young: f64,
    pub poisson: f64,
    /// MPa.
    pub yield_stress: f64,
    /// Growth of the yield stress with the plastic strain, MPa.
    pub hardening: f64,
}

impl Metal {
    /// Load level F / (sigma_y h W) of an axial force (N) on a plate of some thickness and width, mm.
    pub fn level(&self, force: f64, thickness: f64, width: f64) -> f64 {
        force / (self.yield_stress * thickness * width)
    }
}

impl PlasticTable {
    /// Of a mesh under an axial force; `factor` makes factorisations of its stiffness.
    ///
    /// # Errors
    /// A stiffness that is not positive definite, a plate that does not come to rest.
    pub fn new<'f>(mesh: &Mesh, factor: &(dyn Fn() -> Factor<'f> + Sync)) -> Result<Self> {
        let width = width(mesh);
        let row = |hardening: f64| of_hardening(mesh, factor, hardening, LEVELS);
        let rows: Result<Vec<_>> = if rayon::current_num_threads() > 1 {
            // threads of their own: a worker of rayon that waits may take up a task that waits for this table
            thread::scope(|scope| {
                let started = HARDENING.map(|hardening| scope.spawn(move || row(hardening)));
                let joined = started.into_iter().map(|t| t.join());
                joined
                    .map(|row| row.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                    .collect()
            })
        } else {
            HARDENING.into_iter().map(row).collect()
        };
        let mut onset = 0.0;
        let mut levels = Vec::new();
        let mut fields = Vec::new();
        for (first, above, row) in rows? {
            (onset, levels) = (first, above);
            fields.push(row);
        }
        Ok(Self {
            width,
            onset,
            levels,
            fields,
        })
    }

    /// Level at which a mesh begins to yield, without its table.
    ///
    /// # Errors
    /// A stiffness that is not positive definite.
    pub fn onset_of<'f>(mesh: &Mesh, factor: &(dyn Fn() -> Factor<'f> + Sync)) -> Result<f64> {
        Ok(of_hardening(mesh, factor, HARDENING[0], 0)?.0)
    }

    /// Level F / (sigma_y h W) at which yielding begins.
    pub fn onset(&self) -> f64 {
        self.onset
    }

    /// Whether the table knows so large a force.
    pub fn reaches(&self, force: f64, thickness: f64, metal: &Metal) -> bool {
        let level = metal.level(force, thickness, self.width);
        self.levels.last().is_none_or(|last| level <= *last)
    }

    /// Nodal plastic part, mm, under an axial force (N) that grew from nothing; rigid motion as the plate's supports leave it.
    ///
    /// Unloading is taken as elastic: the plastic part stays what it was under the largest force.
    pub fn plastic(&self, force: f64, thickness: f64, metal: &Metal) -> Vec<f64> {
        let level = metal.level(force, thickness, self.width);
        let scale = metal.yield_stress / metal.young;
        let turn = metal.poisson - POISSON[0];
        let along = hardening_weights(metal.hardening / metal.young);
        let mut sum = vec![0.0; self.fields[0][0].nodal.len()];
        for (k, weight) in self.level_weights(level) {
            for (row, along) in self.fields.iter().zip(along) {
                let w = scale * weight * along;
                let field = row[k].nodal.iter().zip(&row[k].slope);
                for (sum, (u, slope)) in sum.iter_mut().zip(field) {
                    *sum += w * (u + turn * slope);
                }
            }
        }
        sum
    }

    /// Levels and their weights in the interpolation: cubics between levels whose slopes are those of parabolas through three levels, 0 with
    /// slope 0 at the onset, and a straight line beyond the last level, as linear hardening has it in the end.
    fn level_weights(&self, level: f64) -> Vec<(usize, f64)> {
        if level <= self.onset {
            return Vec::new();
        }
        let mut knots = vec![self.onset];
        knots.extend(&self.levels);
        let last = knots.len() - 1;
        let mut weights = vec![0.0; knots.len()];
        if level >= knots[last] {
            weights[last] = 1.0;
            add_slope(&knots, last, level - knots[last], &mut weights);
        } else {
            let k = knots.partition_point(|knot| *knot <= level) - 1;
            let length = knots[k + 1] - knots[k];
            let t = (level - knots[k]) / length;
            weights[k] += (1.0 + 2.0 * t) * (1.0 - t).powi(2);
            weights[k + 1] += t * t * (3.0 - 2.0 * t);
            add_slope(&knots, k, length * t * (1.0 - t).powi(2), &mut weights);
            add_slope(&knots, k + 1, length * t * t * (t - 1.0), &mut weights);
        }
        // nothing at the onset
        let used = weights.into_iter().enumerate().skip(1);
        used.filter(|(_, w)| *w != 0.0)
            .map(|(k, w)| (k - 1, w))
            .collect()
    }
}

/// Add `by` times the slope at a knot, as a combination of the values at the knots: that of the parabola through the knot and its
/// neighbours, at the last knot through the last three; none at the first.
fn add_slope(knots: &[f64], k: usize, by: f64, weights: &mut [f64]) {
    if k == 0 {
        return;
    }
    let middle = k.min(knots.len() - 2);
    let own = [middle - 1, middle, middle + 1];
    for i in own {
        let [a, b] = match own.iter().filter(|j| **j != i).collect::<Vec<_>>()[..] {
            [a, b] => [*a, *b],
            _ => return,
        };
        let below = (knots[i] - knots[a]) * (knots[i] - knots[b]);
        weights[i] += by * (2.0 * knots[k] - knots[a] - knots[b]) / below;
    }
}

/// Weights of the tabulated hardenings.
fn hardening_weights(ratio: f64) -> [f64; 3] {
    let place = |ratio: f64| ratio.powf(-0.5);
    let x = place(ratio);
    let knots = HARDENING.map(place);
    [0, 1, 2].map(|i| {
        let others = (0..3).filter(|j| *j != i);
        others
            .map(|j| (x - knots[j]) / (knots[i] - knots[j]))
            .product()
    })
}

/// Extent of a mesh across the load, mm.
pub(super) fn width(mesh: &Mesh) -> f64 {
    let [_, [low, high]] = mesh.extents;
    high - low
}

/// The onset, so many levels above it, and the fields there, for one hardening.
fn of_hardening<'f>(
    mesh: &Mesh,
    factor: &(dyn Fn() -> Factor<'f> + Sync),
    hardening: f64,
    count: usize,
) -> Result<(f64, Vec<f64>, Vec<UnitField>)> {
    let factorised = |poisson: f64| -> Result<Factor<'f>> {
        let mut made = factor();
        let ply = Ply::isotropic(1.0, poisson);
        made.factorise(&Membrane::from(&abd(&ply, &[0.0], 1.0).a))?;
        Ok(made)
    };
    let law = |poisson: f64| J2 {
        young: 1.0,
        poisson,
        yield_stress: 1.0,
        hardening,
    };
    let [mut first, mut second] = [factorised(POISSON[0])?, factorised(POISSON[1])?];
    let gauss = gauss_points(mesh);
    let mut elastic = end_forces(
        mesh,
        &EndLoad {
            axial: width(mesh),
            ..EndLoad::default()
        },
    );
    first.solve(&mut elastic);
    let body = Body {
        law: law(POISSON[0]),
        mesh,
        thickness: vec![1.0; gauss.len()],
        gauss: &gauss,
        elastic,
    };
    let mut walk = Walk::new(&body, &mut first, 1.0).within(TOLERANCE);
    let onset = walk.onset;
    let top = BEYOND * onset;
    let level = |k: usize| onset + (top - onset) * (k as f64 / LEVELS as f64).powf(CROWDED);
    let levels: Vec<f64> = (1..=count).map(level).collect();
    let mut fields = Vec::with_capacity(count);
    for &level in &levels {
        let loaded = walk.to(level)?;
        let mut other = body.forces(&loaded.flow, &law(POISSON[1]));
        second.solve(&mut other);
        let nodal = loaded.plastic_part.clone();
        let pairs = other.iter().zip(&nodal);
        let slope = pairs.map(|(b, a)| (b - a) / (POISSON[1] - POISSON[0]));
        fields.push(UnitField {
            slope: slope.collect(),
            nodal,
        });
    }
    Ok((onset, levels, fields))
}
