//! The phase-shift error of a moire measurement: a ripple of twice the fringe frequency on the displacement itself.
//!
//! Steps of the phase that miss their nominal value add A sin(4 pi f_s F) + B cos(4 pi f_s F) to a measured component,
//! F being that component without the error. The ripple's period, 1/(2 f_s), passes several times within a
//! block, where the elastic field is all but a plane: the error is sought in what a plane a block does not take.
//! The argument is the model plus that plane, free of the pixels' noise; the ripple's own share in
//! the plane is taken out by repetition. What the same regression finds at other multiples of the fringe
//! frequency is the null distribution, so that correlated noise raises no alarm.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use rayon::prelude::*;

use crate::field::{Blocks, Field};
use crate::quantity::NM_PER_MM;

/// Prior sd of the sine's and the cosine's amplitude, nm: an ordinary piezo.
pub const TAU_NM: f64 = 20.0;

/// Sine and cosine amplitudes of a ripple.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ripple {
    /// Posterior mean of the sine's amplitude, nm.
    pub sin_nm: f64,
    /// Posterior mean of the cosine's amplitude, nm.
    pub cos_nm: f64,
    /// Posterior sds of the two, nm.
    pub sd_nm: [f64; 2],
    /// Log Bayes factor of amplitudes N(0, tau^2) against none.
    pub log_bayes_factor: f64,
}

/// The phase-shift error of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phase {
    /// One amplitude pair for both components, as one camera and one piezo give it.
    pub both: Ripple,
    /// Each component by itself, for errors in one of them only.
    pub component: [Ripple; 2],
    /// Prior sd of the amplitudes, nm.
    pub tau_nm: f64,
    /// Sd of (u1, u2) within the blocks, nm, the ripple aside.
    pub within_nm: [f64; 2],
    /// Variance of the amplitudes at other multiples of the fringe frequency over that of white noise of `within_nm`, for
    /// (u1, u2); at least 1.
    pub inflation: [f64; 2],
}

/// Multiples of the fringe frequency at which there is nothing to find.
const DECOYS: [f64; 20] = [
    1.30, 1.35, 1.40, 1.45, 1.50, 1.55, 1.60, 1.65, 1.70, 1.75, 2.25, 2.30, 2.35, 2.40, 2.45, 2.50,
    2.55, 2.60, 2.65, 2.70,
];
/// Degrees of freedom of the variance that the decoys give: neighbouring decoys overlap, two are as good as one.
const FREEDOM: f64 = 20.0;
/// A block of fewer points gets a constant instead of a plane.
const FEWEST_FOR_PLANE: usize = 8;
/// Repetitions of argument and fit, and the change of the amplitudes that ends them, nm.
const REPETITIONS: usize = 12;
const SETTLED_NM: f64 = 1e-3;

/// Estimate the phase-shift error of `field` within `blocks`.
///
/// `model` is the fitted displacement (u1, u2) in mm at every point, its translation included or not: the blocks' own
/// planes are added to it. `order_mm` is the fringe order 1/f_s. Points outside of all blocks are not used. The log Bayes
/// factor of a field without an error is about -10 (Occam); above 4 an error should be accepted.
pub fn find(field: &Field, blocks: &Blocks, model: &[[f64; 2]], order_mm: f64) -> Phase {
    let tiles = Tiles::new(field, blocks, order_mm);
    let components = [0, 1].map(|c| {
        let value = |i: usize| field.displacement[i][c] - model[i][c];
        let misfit: Vec<f64> = tiles.members.iter().map(|&i| value(i)).collect();
        let model: Vec<f64> = tiles.members.iter().map(|&i| model[i][c]).collect();
        Component {
            residual: tiles.without_planes(&misfit),
            misfit,
            model,
        }
    });
    let mut amplitude = [Vector2::zeros(); 2];
    let mut joint = Vector2::zeros();
    for _ in 0..REPETITIONS {
        // with the error of both components, then with their own: each estimate has its own argument
        let next = [0, 1].map(|c| components[c].normal(&tiles, amplitude[c]));
        let pair = [0, 1].map(|c| components[c].normal(&tiles, joint));
        let own = next.map(|n| n.solution());
        let total = Normal {
            gram: pair[0].gram / pair[0].variance + pair[1].gram / pair[1].variance,
            right: pair[0].right / pair[0].variance + pair[1].right / pair[1].variance,
            variance: 1.0,
        };
        let all = total.solution();
        let change = (0..2)
            .map(|c| (own[c] - amplitude[c]).norm())
            .fold((all - joint).norm(), f64::max);
        (amplitude, joint) = (own, all);
        if change * NM_PER_MM < SETTLED_NM {
            break;
        }
    }
    let own = [0, 1].map(|c| components[c].scaled(&tiles, amplitude[c]));
    let pair = [0, 1].map(|c| components[c].scaled(&tiles, joint));
    let information = |n: &Scaled| {
        let variance = n.normal.variance * n.inflation;
        let kept = n.kept(&tiles);
        Information {
            precision: n.normal.gram * (kept * kept / variance),
            right: n.normal.right * (kept / variance),
            lost: 1.0 - kept,
        }
    };
    let weighted = pair.each_ref().map(information);
    let weight = weighted.each_ref().map(|w| w.precision.trace());
    let both = Information {
        precision: weighted[0].precision + weighted[1].precision,
        right: weighted[0].right + weighted[1].right,
        lost: (weight[0] * weighted[0].lost + weight[1] * weighted[1].lost)
            / (weight[0] + weight[1]).max(f64::MIN_POSITIVE),
    };
    Phase {
        both: both.ripple(),
        component: own.each_ref().map(|n| information(n).ripple()),
        tau_nm: TAU_NM,
        within_nm: [0, 1].map(|c| own[c].normal.variance.sqrt() * NM_PER_MM),
        inflation: [0, 1].map(|c| own[c].inflation),
    }
}

/// What the data say of an amplitude pair a (mm): exp(right' a - a' precision a / 2).
struct Information {
    precision: Matrix2<f64>,
    right: Vector2<f64>,
    /// Share of the amplitude that the noise of the argument took, already put back; it is no better known than itself.
    lost: f64,
}

impl Information {
    fn ripple(&self) -> Ripple {
        let tau = TAU_NM / NM_PER_MM;
        let total = self.precision + Matrix2::identity() / (tau * tau);
        let prior = Matrix2::identity() * (tau * tau);
        let covariance = total.try_inverse().unwrap_or(prior);
        let mean = covariance * self.right;
        let growth = (Matrix2::identity() + self.precision * (tau * tau)).determinant();
        // the variance is itself estimated: Student's law instead of the normal one
        let without = self
            .precision
            .try_inverse()
            .map_or(0.0, |inverse| self.right.dot(&(inverse * self.right)));
        let with = (without - self.right.dot(&mean)).max(0.0);
        let evidence =
            0.5 * (FREEDOM + 2.0) * ((1.0 + without / FREEDOM).ln() - (1.0 + with / FREEDOM).ln());
        Ripple {
            sin_nm: mean[0] * NM_PER_MM,
            cos_nm: mean[1] * NM_PER_MM,
            sd_nm: [0, 1].map(|k| covariance[(k, k)].sqrt().hypot(self.lost * mean[k]) * NM_PER_MM),
            log_bayes_factor: evidence - 0.5 * growth.ln(),
        }
    }
}

/// Points by block, and an orthonormal basis of the planes over each block's points.
struct Tiles {
    /// The points, block by block.
    members: Vec<usize>,
    /// Where each block begins in `members`, and the end.
    start: Vec<usize>,
    /// Values of the basis at each member; zeros where a block has no such term.
    basis: Vec<[f64; 3]>,
    /// Number of basis functions of all blocks together.
    terms: usize,
    /// The fringe order, mm.
    order_mm: f64,
}

impl Tiles {
    fn new(field: &Field, blocks: &Blocks, order_mm: f64) -> Self {
        let mut start = vec![0; blocks.len() + 1];
        for block in blocks.of_point.iter().flatten() {
            start[*block as usize + 1] += 1;
        }
        for block in 0..blocks.len() {
            start[block + 1] += start[block];
        }
        let mut next = start.clone();
        let mut members = vec![0; start[blocks.len()]];
        for (i, block) in blocks.of_point.iter().enumerate() {
            if let Some(block) = block {
                members[next[*block as usize]] = i;
                next[*block as usize] += 1;
            }
        }
        let mut basis = vec![[0.0; 3]; members.len()];
        let mut terms = 0;
        for (block, range) in start.windows(2).enumerate() {
            let count = range[1] - range[0];
            let raw = |k: usize, i: usize| match k {
                0 => 1.0,
                _ => (field.points[i][k - 1] - blocks.centroid[block][k - 1]) / blocks.size_mm,
            };
            let wanted = if count >= FEWEST_FOR_PLANE { 3 } else { 1 };
            let slots = &mut basis[range[0]..range[1]];
            for k in 0..wanted {
                for (slot, &i) in slots.iter_mut().zip(&members[range[0]..range[1]]) {
                    slot[k] = raw(k, i);
                }
                for earlier in 0..k {
                    let dot: f64 = slots.iter().map(|b| b[k] * b[earlier]).sum();
                    slots.iter_mut().for_each(|b| b[k] -= dot * b[earlier]);
                }
                let norm = slots.iter().map(|b| b[k] * b[k]).sum::<f64>().sqrt();
                // points on a line have no slope across it
                let kept = norm > 1e-6 * (count as f64).sqrt();
                terms += usize::from(kept);
                let scale = if kept { 1.0 / norm } else { 0.0 };
                slots.iter_mut().for_each(|b| b[k] *= scale);
            }
        }
        Self {
            members,
            start,
            basis,
            terms,
            order_mm,
        }
    }

    /// The blocks' least-squares planes through one value a member.
    fn planes(&self, values: &[f64]) -> Vec<f64> {
        let mut planes = vec![0.0; values.len()];
        for range in self.start.windows(2) {
            let mut coefficients = [0.0; 3];
            let members = range[0]..range[1];
            let basis = &self.basis[members.clone()];
            for (value, basis) in values[members.clone()].iter().zip(basis) {
                for (a, b) in coefficients.iter_mut().zip(basis) {
                    *a += b * value;
                }
            }
            for (plane, basis) in planes[members].iter_mut().zip(basis) {
                *plane = coefficients.iter().zip(basis).map(|(a, b)| a * b).sum();
            }
        }
        planes
    }

    /// What the planes leave of one value a member.
    fn without_planes(&self, values: &[f64]) -> Vec<f64> {
        let planes = self.planes(values);
        values.iter().zip(planes).map(|(v, p)| v - p).collect()
    }
}

/// Normal equations of an amplitude pair, mm.
struct Normal {
    gram: Matrix2<f64>,
    right: Vector2<f64>,
    /// Variance of a point's residual, mm^2.
    variance: f64,
}

impl Normal {
    fn solution(&self) -> Vector2<f64> {
        self.gram
            .try_inverse()
            .map_or(Vector2::zeros(), |inverse| inverse * self.right)
    }
}

/// Normal equations with the inflation of their variance.
struct Scaled {
    normal: Normal,
    inflation: f64,
}

impl Scaled {
    /// Share of a ripple's amplitude that shows in spite of the noise in the argument, which the planes let through:
    /// exp(-v / 2) of a phase of variance v.
    fn kept(&self, tiles: &Tiles) -> f64 {
        let share = tiles.terms as f64 / tiles.members.len().max(1) as f64;
        let per_mm = 2.0 * std::f64::consts::TAU / tiles.order_mm;
        (-0.5 * per_mm * per_mm * share * self.normal.variance * self.inflation)
            .exp()
            .max(0.5)
    }
}

/// One component of the field, one value a member of the tiles, mm.
struct Component {
    model: Vec<f64>,
    /// Measured minus model.
    misfit: Vec<f64>,
    /// The misfit without the blocks' planes.
    residual: Vec<f64>,
}

impl Component {
    /// Argument of the fringes, rad a unit multiple, given the error's `amplitude` (mm).
    fn argument(&self, tiles: &Tiles, amplitude: Vector2<f64>) -> Vec<f64> {
        let per_mm = std::f64::consts::TAU / tiles.order_mm;
        let add = |planes: Vec<f64>| -> Vec<f64> {
            self.model
                .iter()
                .zip(planes)
                .map(|(m, p)| per_mm * (m + p))
                .collect()
        };
        let measured = add(tiles.planes(&self.misfit));
        if amplitude == Vector2::zeros() {
            return measured;
        }
        // the planes hold a part of the ripple; a few sweeps make argument and ripple agree
        const SWEEPS: usize = 3;
        let mut argument = measured.clone();
        for _ in 0..SWEEPS {
            let error: Vec<f64> = argument
                .iter()
                .map(|a| (2.0 * a).sin_cos())
                .map(|(sin, cos)| amplitude[0] * sin + amplitude[1] * cos)
                .collect();
            argument = measured
                .iter()
                .zip(tiles.planes(&error))
                .map(|(m, p)| m - per_mm * p)
                .collect();
        }
        argument
    }

    fn normal(&self, tiles: &Tiles, amplitude: Vector2<f64>) -> Normal {
        let argument = self.argument(tiles, amplitude);
        self.normal_of(tiles, &waves(tiles, &argument, 2.0))
    }

    fn normal_of(&self, tiles: &Tiles, [sin, cos]: &[Vec<f64>; 2]) -> Normal {
        let gram = Matrix2::new(dot(sin, sin), dot(sin, cos), dot(sin, cos), dot(cos, cos));
        let right = Vector2::new(dot(sin, &self.residual), dot(cos, &self.residual));
        let mut normal = Normal {
            gram,
            right,
            variance: 0.0,
        };
        let left = dot(&self.residual, &self.residual) - right.dot(&normal.solution());
        let freedom = (self.residual.len() as f64 - tiles.terms as f64 - 2.0).max(1.0);
        // exact data have no scale: rounding is no ripple
        let exact = 1e-6 * tiles.order_mm;
        normal.variance = (left / freedom).max(exact * exact);
        normal
    }

    /// The normal equations at `amplitude`, and how much larger the decoys are than white noise makes them.
    fn scaled(&self, tiles: &Tiles, amplitude: Vector2<f64>) -> Scaled {
        let argument = self.argument(tiles, amplitude);
        let own = waves(tiles, &argument, 2.0);
        let normal = self.normal_of(tiles, &own);
        let squares: Vec<Option<f64>> = DECOYS
            .par_iter()
            .map(|&multiple| {
                let decoy = waves(tiles, &argument, multiple);
                self.decoy_square(&own, &decoy)
                    .map(|square| square / (2.0 * normal.variance))
            })
            .collect();
        let valid: Vec<f64> = squares.into_iter().flatten().collect();
        let mean = valid.iter().sum::<f64>() / valid.len().max(1) as f64;
        Scaled {
            normal,
            inflation: mean.max(1.0),
        }
    }

    /// The sum of squares that a decoy explains beyond the ripple itself, mm^2.
    fn decoy_square(&self, own: &[Vec<f64>; 2], decoy: &[Vec<f64>; 2]) -> Option<f64> {
        let columns = [&own[0], &own[1], &decoy[0], &decoy[1]];
        let gram = Matrix4::from_fn(|a, b| dot(columns[a], columns[b]));
        let right = Vector4::from_fn(|a, _| dot(columns[a], &self.residual));
        let all = right.dot(&(gram.try_inverse()? * right));
        let ripple = gram.fixed_view::<2, 2>(0, 0).into_owned().try_inverse()?;
        let right = right.fixed_rows::<2>(0).into_owned();
        let square = all - right.dot(&(ripple * right));
        square.is_finite().then_some(square.max(0.0))
    }
}

/// Sine and cosine of a multiple of the argument, without what a plane a block takes.
fn waves(tiles: &Tiles, argument: &[f64], multiple: f64) -> [Vec<f64>; 2] {
    let (sin, cos): (Vec<f64>, Vec<f64>) =
        argument.iter().map(|a| (multiple * a).sin_cos()).unzip();
    [tiles.without_planes(&sin), tiles.without_planes(&cos)]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
