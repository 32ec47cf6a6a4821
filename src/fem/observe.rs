//! From nodal displacements to any points of the plate, through the element shape functions.

use rayon::prelude::*;
use rstar::{AABB, RTree, RTreeObject};

use super::beyond::{Nearby, Patch};
use super::element;
use crate::geometry::Mesh;

/// A nodal field: two components a node, interleaved.
pub type Nodal = [f64];

/// Where each of a set of points lies in the mesh.
#[derive(Debug, Clone)]
pub struct Observer {
    places: Vec<ObservedPlace>,
    /// What [`ObservedPlace::Outside`] counts.
    patches: Vec<Patch>,
    nodes: Vec<[u32; 8]>,
    corners: Vec<[[f64; 2]; 8]>,
    /// Where points are averages over places: those of each point, in order.
    averages: Option<Vec<AveragedPoint>>,
}

/// A point that stands for several places.
#[derive(Debug, Clone)]
struct AveragedPoint {
    /// Its first place.
    first: u32,
    /// The weight of each of its places.
    weights: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
enum ObservedPlace {
    Inside(ElementPoint),
    Outside(u32),
}

/// A point of an element.
#[derive(Debug, Clone, Copy)]
struct ElementPoint {
    element: u32,
    local: [f64; 2],
}

/// Finds the element that holds a point.
pub struct Locator<'a> {
    mesh: &'a Mesh,
    tree: RTree<Envelope>,
}

struct Envelope {
    element: u32,
    /// About the element, and some way further.
    bounds: AABB<[f64; 2]>,
    /// What holds it, but for rounding.
    low: [f64; 2],
    high: [f64; 2],
}

impl Envelope {
    fn of(element: usize, x: &[[f64; 2]; 8]) -> Self {
        let [mut low, mut high] = [x[0], x[0]];
        for p in x {
            for k in 0..2 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        // A curved edge may bulge past its nodes by at most an eighth of its length.
        let reach = high[0] - low[0] + high[1] - low[1];
        let margin = 0.125 * reach;
        let bounds = AABB::from_corners(low.map(|v| v - margin), high.map(|v| v + margin));
        for (edge, middle) in x[4..].iter().enumerate() {
            let (from, to) = (x[edge], x[(edge + 1) % 4]);
            for k in 0..2 {
                // m + b t + a t^2 over -1 <= t <= 1
                let b = 0.5 * (to[k] - from[k]);
                let a = 0.5 * (from[k] + to[k]) - middle[k];
                if b.abs() < 2.0 * a.abs() {
                    let turn = middle[k] - b * b / (4.0 * a);
                    low[k] = low[k].min(turn);
                    high[k] = high[k].max(turn);
                }
            }
        }
        Self {
            element: element as u32,
            bounds,
            low: low.map(|v| v - ROUNDING * reach),
            high: high.map(|v| v + ROUNDING * reach),
        }
    }

    fn holds(&self, point: [f64; 2]) -> bool {
        (0..2).all(|k| self.low[k] <= point[k] && point[k] <= self.high[k])
    }
}

impl RTreeObject for Envelope {
    type Envelope = AABB<[f64; 2]>;

    fn envelope(&self) -> Self::Envelope {
        self.bounds
    }
}

/// How far outside [-1, 1] a local coordinate may lie: points on an element's edge, to rounding.
const SLACK: f64 = 1e-9;

/// How far outside its element a point may lie, over the element's size.
const ROUNDING: f64 = 1e-6;

impl<'a> Locator<'a> {
    /// Index the elements of a mesh.
    pub fn new(mesh: &'a Mesh) -> Self {
        let envelopes = (0..mesh.elements.len())
            .map(|e| Envelope::of(e, &mesh.corners(e)))
            .collect();
        Self {
            mesh,
            tree: RTree::bulk_load(envelopes),
        }
    }

    fn locate(&self, point: [f64; 2]) -> Option<ElementPoint> {
        self.tree
            .locate_in_envelope_intersecting(AABB::from_point(point))
            .filter(|envelope| envelope.holds(point))
            .filter_map(|envelope| {
                let local = invert(&self.mesh.corners(envelope.element as usize), point)?;
                Some(ElementPoint {
                    element: envelope.element,
                    local,
                })
            })
            // A point on a shared edge belongs to the element of the smaller index, whatever the search order.
            .min_by_key(|place| place.element)
    }

    /// Locate all points; which of them lie on the plate. The others are left out.
    pub fn observe(&self, points: &[[f64; 2]]) -> (Observer, Vec<bool>) {
        let spots: Vec<Option<ElementPoint>> = points.par_iter().map(|&p| self.locate(p)).collect();
        let inside = spots.iter().map(Option::is_some).collect();
        let places = spots.into_iter().flatten().map(ObservedPlace::Inside);
        (self.observer(places.collect(), Vec::new()), inside)
    }

    /// Locate all points; those that lie outside, in the hole or across an edge, see the cubic that continues the field
    /// from the nodes about the nearest one. Meant for distances well below the hole's radius.
    pub fn observe_extended(&self, points: &[[f64; 2]]) -> Observer {
        let spots: Vec<Option<ElementPoint>> = points.par_iter().map(|&p| self.locate(p)).collect();
        let outside: Vec<[f64; 2]> = points
            .iter()
            .zip(&spots)
            .filter(|(_, spot)| spot.is_none())
            .map(|(p, _)| *p)
            .collect();
        if outside.is_empty() {
            let places = spots.into_iter().flatten().map(ObservedPlace::Inside);
            return self.observer(places.collect(), Vec::new());
        }
        let nearby = Nearby::new(self.mesh);
        let patch = |&p: &[f64; 2]| {
            let nearest = nearby.nearest(p);
            nearby.patch(p, nearest, self.size_at(nearest))
        };
        let patches = outside.par_iter().map(patch).collect();
        let mut next = 0;
        let places = spots
            .into_iter()
            .map(|spot| {
                spot.map_or_else(
                    || {
                        next += 1;
                        ObservedPlace::Outside(next - 1)
                    },
                    ObservedPlace::Inside,
                )
            })
            .collect();
        self.observer(places, patches)
    }

    /// Averages over places with weights, one a point; places that lie outside see the field continued.
    pub fn observe_averages(&self, samples: &[Vec<([f64; 2], f64)>]) -> Observer {
        let places: Vec<[f64; 2]> = samples.iter().flatten().map(|(p, _)| *p).collect();
        let mut first = 0;
        let averages = samples.iter().map(|samples| {
            first += samples.len() as u32;
            AveragedPoint {
                first: first - samples.len() as u32,
                weights: samples.iter().map(|(_, w)| *w).collect(),
            }
        });
        let averages = Some(averages.collect());
        Observer {
            averages,
            ..self.observe_extended(&places)
        }
    }

    /// Which points lie on the plate.
    pub fn holds(&self, points: &[[f64; 2]]) -> Vec<bool> {
        points
            .par_iter()
            .map(|&p| self.locate(p).is_some())
            .collect()
    }

    /// Largest extent along either direction of the elements that meet at a point of the mesh, mm.
    fn size_at(&self, point: [f64; 2]) -> f64 {
        self.tree
            .locate_in_envelope_intersecting(AABB::from_point(point))
            .map(|envelope| {
                let (low, high) = (envelope.bounds.lower(), envelope.bounds.upper());
                (high[0] - low[0]).max(high[1] - low[1])
            })
            .fold(0.0, f64::max)
    }

    fn observer(&self, places: Vec<ObservedPlace>, patches: Vec<Patch>) -> Observer {
        Observer {
            places,
            patches,
            nodes: self.mesh.elements.clone(),
            corners: (0..self.mesh.elements.len())
                .map(|e| self.mesh.corners(e))
                .collect(),
            averages: None,
        }
    }
}

/// Newton's method for the local coordinates of a point; `None` if it lies outside the element.
fn invert(x: &[[f64; 2]; 8], point: [f64; 2]) -> Option<[f64; 2]> {
    let [mut a, mut b] = [0.0, 0.0];
    for _ in 0..20 {
        let p = element::position(x, &element::shape(a, b));
        let j = element::jacobian(x, &element::shape_gradient(a, b));
        let det = element::determinant(&j);
        let r = [point[0] - p[0], point[1] - p[1]];
        let da = (j[1][1] * r[0] - j[0][1] * r[1]) / det;
        let db = (j[0][0] * r[1] - j[1][0] * r[0]) / det;
        a = (a + da).clamp(-2.0, 2.0);
        b = (b + db).clamp(-2.0, 2.0);
        if da.abs() + db.abs() < 1e-13 {
            break;
        }
    }
    let inside = a.abs().max(b.abs()) <= 1.0 + SLACK;
    let p = element::position(x, &element::shape(a, b));
    let near = (p[0] - point[0]).abs() + (p[1] - point[1]).abs() < 1e-9;
    (inside && near).then_some([a, b])
}

impl Observer {
    /// Number of points.
    pub fn count(&self) -> usize {
        self.averages.as_ref().map_or(self.places.len(), Vec::len)
    }

    /// Put the points into another order: point k is from now on what point `order[k]` was.
    pub fn reorder(&mut self, order: &[usize]) {
        match &mut self.averages {
            Some(averages) => *averages = order.iter().map(|&k| averages[k].clone()).collect(),
            None => self.places = order.iter().map(|&k| self.places[k]).collect(),
        }
    }

    /// The element that a point lies in, with the values of its shape functions there; none outside the mesh.
    pub(super) fn spot(&self, k: usize) -> Option<(usize, [f64; 8])> {
        match self.places[k] {
            ObservedPlace::Inside(ElementPoint { element, local }) => {
                Some((element as usize, element::shape(local[0], local[1])))
            }
            ObservedPlace::Outside(_) => None,
        }
    }

    /// Nodal forces of forces at the points: the transpose of [`Observer::displacement`].
    pub fn forces(&self, at_points: &[[f64; 2]], unknowns: usize) -> Vec<f64> {
        let mut nodal = vec![0.0; unknowns];
        let mut add = |node: u32, weight: f64, force: &[f64; 2]| {
            nodal[2 * node as usize] += weight * force[0];
            nodal[2 * node as usize + 1] += weight * force[1];
        };
        for (k, force) in at_points.iter().enumerate() {
            match (self.spot(k), self.places[k]) {
                (Some((e, shape)), _) => {
                    for (&node, n) in self.nodes[e].iter().zip(shape) {
                        add(node, n, force);
                    }
                }
                (None, ObservedPlace::Outside(patch)) => {
                    for (node, weights) in &self.patches[patch as usize].nodes {
                        add(*node, weights[0], force);
                    }
                }
                (None, ObservedPlace::Inside(_)) => {}
            }
        }
        nodal
    }

    /// Nodal forces of a unit couple at the first point, which lies on the plate: what they do with a field is its local rotation there,
    /// (d u_2 / d x_1 - d u_1 / d x_2) / 2.
    pub fn couple(&self, unknowns: usize) -> Vec<f64> {
        let mut nodal = vec![0.0; unknowns];
        if let Some(ObservedPlace::Inside(spot)) = self.places.first() {
            let e = spot.element as usize;
            let (g, _) = element::physical_gradient(&self.corners[e], spot.local[0], spot.local[1]);
            for (node, g) in self.nodes[e].iter().zip(g) {
                nodal[2 * *node as usize] -= 0.5 * g[1];
                nodal[2 * *node as usize + 1] += 0.5 * g[0];
            }
        }
        nodal
    }

    /// Displacement (u1, u2) at every point, mm.
    pub fn displacement(&self, nodal: &Nodal) -> Vec<[f64; 2]> {
        let at = |place: &ObservedPlace| match place {
            ObservedPlace::Inside(spot) => {
                let n = element::shape(spot.local[0], spot.local[1]);
                let mut u = [0.0; 2];
                for (node, n) in self.nodes[spot.element as usize].iter().zip(n) {
                    u[0] += n * nodal[2 * *node as usize];
                    u[1] += n * nodal[2 * *node as usize + 1];
                }
                u
            }
            ObservedPlace::Outside(patch) => self.patches[*patch as usize].derivative(nodal, 0),
        };
        let values: Vec<[f64; 2]> = self.places.par_iter().map(at).collect();
        self.averaged(values)
    }

    /// The averages of values at the places.
    fn averaged<T: Copy + Summable>(&self, values: Vec<T>) -> Vec<T> {
        let Some(averages) = &self.averages else {
            return values;
        };
        let one = |average: &AveragedPoint| {
            let values = &values[average.first as usize..];
            let mut sum = T::ZERO;
            for (w, v) in average.weights.iter().zip(values) {
                sum.add(*w, v);
            }
            sum
        };
        averages.iter().map(one).collect()
    }

    /// Displacement gradient at every point, `g[i][k]` = derivative of u_i along direction k.
    pub fn gradient(&self, nodal: &Nodal) -> Vec<[[f64; 2]; 2]> {
        let inside = |spot: &ElementPoint| {
            let e = spot.element as usize;
            let (g, _) = element::physical_gradient(&self.corners[e], spot.local[0], spot.local[1]);
            let mut sum = [[0.0; 2]; 2];
            for (node, g) in self.nodes[e].iter().zip(g) {
                for (i, row) in sum.iter_mut().enumerate() {
                    for (k, value) in row.iter_mut().enumerate() {
                        *value += g[k] * nodal[2 * *node as usize + i];
                    }
                }
            }
            sum
        };
        let at = |place: &ObservedPlace| match place {
            ObservedPlace::Inside(spot) => inside(spot),
            ObservedPlace::Outside(patch) => {
                let patch = &self.patches[*patch as usize];
                let (first, second) = (patch.derivative(nodal, 1), patch.derivative(nodal, 2));
                [[first[0], second[0]], [first[1], second[1]]]
            }
        };
        let values: Vec<[[f64; 2]; 2]> = self.places.par_iter().map(at).collect();
        self.averaged(values)
    }
}

/// Values of which weighted sums are taken.
trait Summable {
    const ZERO: Self;
    fn add(&mut self, weight: f64, other: &Self);
}

impl Summable for [f64; 2] {
    const ZERO: Self = [0.0; 2];

    fn add(&mut self, weight: f64, other: &Self) {
        for (sum, x) in self.iter_mut().zip(other) {
            *sum += weight * x;
        }
    }
}

impl Summable for [[f64; 2]; 2] {
    const ZERO: Self = [[0.0; 2]; 2];

    fn add(&mut self, weight: f64, other: &Self) {
        for (sum, x) in self.iter_mut().zip(other) {
            sum.add(weight, x);
        }
    }
}
