//! One measurement under two names: the same points and displacements in another order, with other last digits, moved, turned or in other
//! units.
//!
//! Two measurements of one specimen, or of two, have noise of their own. What one leaves of the other, once all that is said here is taken
//! out, is then their noise together. Of copies far less is left.

use nalgebra::Complex;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use crate::field::Field;
use crate::noise::white;

/// Points in the complex plane, or displacements.
type ComplexField = Vec<Complex<f64>>;

/// Fewer points are not compared: little is left of them beside what is fitted.
const FEWEST: usize = 20;

/// Points are the same up to this share of the spacing between them.
const NEAR: f64 = 0.25;

/// Copies leave less of each other than this share of the noise that two measurements would have.
const SHARE: f64 = 0.5;

/// Points that are looked at before all are.
const LOOKED_AT: usize = 200;

/// A rotation in rad, a factor beside 1 and a shift in mm below which none is named: files round.
const NOTHING: f64 = 1e-4;

/// What two fields have in common if they are one measurement, in words; none where they are two.
pub fn copied(first: &Field, second: &Field) -> Option<String> {
    let n = first.len();
    if n < FEWEST || second.len() != n {
        return None;
    }
    let [a, b] = [first, second].map(Cloud::new);
    let (angle, pairs) = a.turned_to(&b)?;
    // second = factor x first, in the axes of the first, beside a motion
    let back = Complex::from_polar(1.0, -angle);
    let own = without_motion(&a.points, &a.displacement);
    let matched: ComplexField = pairs.iter().map(|&k| b.displacement[k] * back).collect();
    let other = without_motion(&a.points, &matched);
    let dot = |x: &ComplexField, y: &ComplexField| -> Complex<f64> {
        let products = x.iter().zip(y).map(|(x, y)| x.conj() * y);
        products.sum()
    };
    // complex: a specimen that turned turns its strain
    let by = dot(&own, &other) / dot(&own, &own).re;
    let factor = by.norm();
    let left: ComplexField = other.iter().zip(&own).map(|(o, u)| o - u * by).collect();
    let noise = |field: &Field| -> f64 { white(field).sd_mm.iter().map(|s| s * s).sum() };
    let expected = n as f64 * (noise(first) * factor * factor + noise(second));
    let left = dot(&left, &left).re;
    if left.is_nan() || left > SHARE * SHARE * expected {
        return None;
    }
    let in_order = pairs.iter().enumerate().all(|(k, pair)| k == *pair);
    let scale = b.size / a.size;
    let shift = (b.centre - a.centre * back.conj() * scale).norm();
    let mut words = vec!["the same points and displacements".to_string()];
    words.extend((!in_order).then(|| "in another order".into()));
    words.extend(
        (angle.abs() > NOTHING).then(|| format!("turned by {:.2} deg", angle.to_degrees())),
    );
    words.extend((shift > NOTHING).then(|| format!("moved by {shift:.4} mm")));
    words.extend(is_other(scale).then(|| format!("with coordinates {scale:.5} times as large")));
    words
        .extend(is_other(factor).then(|| format!("with displacements {factor:.5} times as large")));
    words.extend((left > 0.0).then(|| "with other last digits".into()));
    Some(words.join(", "))
}

fn is_other(factor: f64) -> bool {
    (factor - 1.0).abs() > NOTHING
}

/// A field about its middle, in units of its size.
struct Cloud {
    centre: Complex<f64>,
    /// Root mean square distance from the centre, mm.
    size: f64,
    points: ComplexField,
    displacement: ComplexField,
    /// Between neighbours, over the size.
    spacing: f64,
}

impl Cloud {
    fn new(field: &Field) -> Self {
        let plane = |all: &[[f64; 2]]| all.iter().map(|p| Complex::new(p[0], p[1])).collect();
        let (points, displacement): (ComplexField, ComplexField) =
            (plane(&field.points), plane(&field.displacement));
        let n = points.len() as f64;
        let centre = points.iter().sum::<Complex<f64>>() / n;
        let square: f64 = points.iter().map(|p| (p - centre).norm_sqr()).sum();
        let size = (square / n).sqrt().max(f64::MIN_POSITIVE);
        Self {
            points: points.iter().map(|p| (p - centre) / size).collect(),
            spacing: field.spacing_mm() / size,
            displacement,
            centre,
            size,
        }
    }

    /// The angle by which this is turned to lie on another, and for every point the other's; none where they do not lie on each other.
    fn turned_to(&self, other: &Self) -> Option<(f64, Vec<usize>)> {
        let entry = |(k, p): (usize, &Complex<f64>)| GeomWithData::new([p.re, p.im], k);
        let tree = RTree::bulk_load(other.points.iter().enumerate().map(entry).collect());
        let near = NEAR * self.spacing.max(other.spacing);
        let found = |angle: f64, k: usize| {
            let p = self.points[k] * Complex::from_polar(1.0, angle);
            let nearest = tree.nearest_neighbor([p.re, p.im])?;
            let [x, y] = *nearest.geom();
            ((x - p.re).hypot(y - p.im) < near).then_some(nearest.data)
        };
        let stride = (self.points.len() / LOOKED_AT).max(1);
        let looked_at = || (0..self.points.len()).step_by(stride);
        for angle in self.angles(other) {
            let pairs: Vec<(usize, usize)> = looked_at()
                .filter_map(|k| Some((k, found(angle, k)?)))
                .collect();
            if 10 * pairs.len() < 9 * looked_at().count() {
                continue;
            }
            let turn = pairs
                .iter()
                .map(|(k, j)| other.points[*j] * self.points[*k].conj());
            let angle = turn.sum::<Complex<f64>>().arg();
            let all: Option<Vec<usize>> = (0..self.points.len()).map(|k| found(angle, k)).collect();
            let Some(all) = all else { continue };
            let mut each = all.clone();
            each.sort_unstable();
            each.dedup();
            if each.len() == all.len() {
                return Some((angle, all));
            }
        }
        None
    }

    /// Angles by which this may be turned: by moments of the points, and by where displacements are large.
    fn angles(&self, other: &Self) -> Vec<f64> {
        let apart = |of: &dyn Fn(&Self) -> Complex<f64>| (of(other) * of(self).conj()).arg();
        let moment = |power: i32| {
            move |cloud: &Self| -> Complex<f64> { cloud.points.iter().map(|p| p.powi(power)).sum() }
        };
        let weighed = |cloud: &Self| -> Complex<f64> {
            let free = without_motion(&cloud.points, &cloud.displacement);
            let each = cloud
                .points
                .iter()
                .zip(&free)
                .map(|(p, u)| p * u.norm_sqr());
            each.sum()
        };
        let mut angles = vec![0.0, apart(&weighed)];
        for power in [2, 4] {
            let first = apart(&moment(power)) / f64::from(power);
            let turn = std::f64::consts::TAU / f64::from(power);
            angles.extend((0..power).map(|k| first + f64::from(k) * turn));
        }
        angles
    }
}

/// Displacements without the translation and the rotation that fit them best, however large, and without a strain that is the same all over
/// and in all directions, as a finite rotation has.
fn without_motion(points: &ComplexField, displacement: &ComplexField) -> ComplexField {
    let n = points.len() as f64;
    let mean = displacement.iter().sum::<Complex<f64>>() / n;
    let pairs = points.iter().zip(displacement);
    let turn = pairs
        .map(|(p, u)| p.conj() * (u - mean))
        .sum::<Complex<f64>>()
        / n;
    let pairs = points.iter().zip(displacement);
    pairs.map(|(p, u)| u - mean - turn * p).collect()
}
