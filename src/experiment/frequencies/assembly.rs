//! The stored matrices, split into the families of functions that symmetry keeps apart.

use nalgebra::{DMatrix, DVector};

use super::basis::{Integrals, LegendreBasis};
use super::plate::{INERTIAS, PlateCoefficients, STIFFNESSES};
use super::theory::{Derivative, EdgeLayers, PAIRS, PlateSupports, Theory};

/// Lower triangle of a symmetric matrix: (row, column, value), row >= column.
pub type Triangle = Vec<(u32, u32, f64)>;

/// Functions, and thereby modes, that couple with no others.
#[derive(Debug, Clone)]
pub struct IntegralFamily {
    /// Whether the deflection changes its sign with the turn of the plate by 180 degrees; none where the supports have no such symmetry.
    pub odd: Option<bool>,
    /// Global numbers of the family's functions.
    pub functions: Vec<usize>,
    pub stiffness: Vec<Triangle>,
    pub inertia: Vec<Triangle>,
    /// Motions without strain, in the family's unknowns.
    pub rigid: Vec<DVector<f64>>,
    /// The functions' amplitudes from the family's unknowns, where these are fewer (functions x unknowns).
    pub lift: Option<DMatrix<f64>>,
}

/// A function: product of polynomial `m` in xi and `n` in eta of a field.
#[derive(Debug, Clone, Copy)]
pub struct Function {
    pub field: usize,
    pub m: usize,
    pub n: usize,
}

/// Polynomials of every field along both axes, with their integrals.
#[derive(Debug, Clone)]
pub struct Functions {
    pub bases: Vec<[LegendreBasis; 2]>,
    /// Integrals along an axis between the bases of two fields: `[axis][field][field]`.
    integrals: [Vec<Vec<Integrals>>; 2],
    pub list: Vec<Function>,
}

impl Functions {
    /// `order` polynomials along each axis for every field, and the functions of `layers`.
    pub fn new(
        theory: Theory,
        supports: &PlateSupports,
        order: usize,
        layers: Option<EdgeLayers>,
    ) -> Self {
        let fields = theory.fields();
        let bases: Vec<[LegendreBasis; 2]> = (0..fields)
            .map(|field| [0, 1].map(|axis| theory.basis(supports, [field, axis], order, layers)))
            .collect();
        let integrals = [0, 1].map(|axis| {
            let along = |f: usize| (0..fields).map(move |g| (f, g));
            (0..fields)
                .map(|f| {
                    along(f)
                        .map(|(f, g)| Integrals::of(&bases[f][axis], &bases[g][axis]))
                        .collect()
                })
                .collect()
        });
        let list = (0..fields)
            .flat_map(|field| {
                let [along, across] = [0, 1].map(|axis| bases[field][axis].count());
                (0..along).flat_map(move |m| (0..across).map(move |n| Function { field, m, n }))
            })
            .collect();
        Self {
            bases,
            integrals,
            list,
        }
    }

    /// Integral over [-1, 1]^2 of a derivative of `u` times one of `v`.
    fn integral(&self, (p, u): (&Derivative, Function), (q, v): (&Derivative, Function)) -> f64 {
        let [along, across] = &self.integrals;
        let degrees = ([u.m, v.m], [u.n, v.n]);
        let orders = ([p.order[0], q.order[0]], [p.order[1], q.order[1]]);
        p.factor
            * q.factor
            * along[u.field][v.field].get(orders.0, degrees.0)
            * across[u.field][v.field].get(orders.1, degrees.1)
    }

    /// Matrix of the integral of strain i times strain j, each a sum of derivatives, made symmetric.
    pub fn form(&self, i: &[Derivative], j: &[Derivative], once: bool) -> Triangle {
        let mut triangle = Triangle::new();
        for (r, &u) in self.list.iter().enumerate() {
            for (c, &v) in self.list[..=r].iter().enumerate() {
                let mut sum = 0.0;
                for p in i {
                    for q in j {
                        if p.field == u.field && q.field == v.field {
                            sum += self.integral((p, u), (q, v));
                        }
                        if !once && p.field == v.field && q.field == u.field {
                            sum += self.integral((p, v), (q, u));
                        }
                    }
                }
                if sum != 0.0 {
                    triangle.push((r as u32, c as u32, sum));
                }
            }
        }
        triangle
    }

    /// Amplitudes of the functions in a rigid motion with deflection r0 + r1 xi + r2 eta.
    fn rigid(&self, [r0, r1, r2]: [f64; 3]) -> DVector<f64> {
        let linear = LegendreBasis::new([0, 0], 2, None);
        // integrals of 1 and of the coordinate times a polynomial
        let moments: Vec<[Integrals; 2]> = self
            .bases
            .iter()
            .map(|pair| [0, 1].map(|axis| Integrals::of(&pair[axis], &linear)))
            .collect();
        let moment = |f: &Function, axis: usize, power: usize| {
            let degree = [f.m, f.n][axis];
            let norm = [2.0_f64, 2.0 / 3.0][power].sqrt();
            norm * moments[f.field][axis].get([0, 0], [degree, power])
        };
        let amplitudes = self.list.iter().map(|f| {
            let ones = moment(f, 0, 0) * moment(f, 1, 0);
            match f.field {
                0 => {
                    r0 * ones
                        + r1 * moment(f, 0, 1) * moment(f, 1, 0)
                        + r2 * moment(f, 0, 0) * moment(f, 1, 1)
                }
                1 => -r1 * ones,
                _ => -r2 * ones,
            }
        });
        DVector::from_iterator(self.list.len(), amplitudes)
    }
}

/// The matrices of all functions before they are split.
pub struct Whole {
    pub stiffness: Vec<Triangle>,
    pub inertia: Vec<Triangle>,
    pub rigid: Vec<DVector<f64>>,
}

impl Whole {
    /// All but air and point mass, whose triangles are empty.
    pub fn new(theory: Theory, supports: &PlateSupports, functions: &Functions) -> Self {
        let (strains, motions) = (theory.strains(), theory.motions());
        let stiffness = PAIRS.map(|[i, j]| functions.form(&strains[i], &strains[j], i == j));
        let mut inertia: Vec<Triangle> =
            motions.iter().map(|m| functions.form(m, m, true)).collect();
        inertia.resize(INERTIAS, Triangle::new());
        let rigid = theory.rigid_motions(supports);
        Self {
            stiffness: stiffness.into(),
            inertia,
            rigid: rigid.into_iter().map(|r| functions.rigid(r)).collect(),
        }
    }

    /// The families of functions, for laminates whose bending and twisting couple (`twisting`) or do not.
    pub fn families(
        &self,
        functions: &Functions,
        twisting: bool,
        whole: bool,
    ) -> Vec<IntegralFamily> {
        let parity = [0, 1].map(|axis| functions.bases.iter().all(|b| b[axis].has_parity()));
        let both = parity[0] && parity[1];
        let key = |f: &Function| {
            let odd = [
                Theory::is_odd(f.field, 0, f.m),
                Theory::is_odd(f.field, 1, f.n),
            ];
            let class = match (whole, twisting, both) {
                (true, ..) => 0,
                (_, true, true) => usize::from(odd[0] != odd[1]),
                (_, true, false) => 0,
                _ => 2 * usize::from(parity[0] && odd[0]) + usize::from(parity[1] && odd[1]),
            };
            let sum = (both && !whole).then_some(odd[0] != odd[1]);
            (class, sum)
        };
        let keys: Vec<_> = functions.list.iter().map(key).collect();
        let mut classes: Vec<(usize, Option<bool>)> = keys.clone();
        classes.sort_unstable();
        classes.dedup();
        let members = classes.iter().map(|class| {
            let members = (0..keys.len()).filter(|&i| keys[i] == *class);
            self.family(class.1, members.collect())
        });
        members.collect()
    }

    fn family(&self, odd: Option<bool>, functions: Vec<usize>) -> IntegralFamily {
        let mut local = vec![None; functions.last().map_or(0, |last| last + 1)];
        for (i, &global) in functions.iter().enumerate() {
            local[global] = Some(i as u32);
        }
        let restrict = |triangle: &Triangle| -> Triangle {
            let place = |i: u32| local.get(i as usize).copied().flatten();
            let entries = triangle.iter();
            entries
                .filter_map(|&(r, c, v)| Some((place(r)?, place(c)?, v)))
                .collect()
        };
        let rigid = self.rigid.iter().map(|r| r.select_rows(&functions));
        IntegralFamily {
            odd,
            stiffness: self.stiffness.iter().map(restrict).collect(),
            inertia: self.inertia.iter().map(restrict).collect(),
            // a motion of another family has no part in this one
            rigid: rigid.filter(|r| r.amax() > 0.0).collect(),
            functions,
            lift: None,
        }
    }
}

impl IntegralFamily {
    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.lift
            .as_ref()
            .map_or(self.functions.len(), |l| l.ncols())
    }

    /// Number of modes with strain.
    pub fn elastic(&self) -> usize {
        self.unknowns() - self.rigid.len()
    }

    /// Full symmetric stiffness and mass matrices.
    pub fn matrices(&self, of: &PlateCoefficients) -> [DMatrix<f64>; 2] {
        let sum = |triangles: &[Triangle], factors: &[f64]| {
            let mut m = DMatrix::zeros(self.unknowns(), self.unknowns());
            for (triangle, &factor) in triangles.iter().zip(factors) {
                if factor == 0.0 {
                    continue;
                }
                for &(r, c, v) in triangle {
                    m[(r as usize, c as usize)] += factor * v;
                }
            }
            m.fill_upper_triangle_with_lower_triangle();
            m
        };
        [
            sum(&self.stiffness, &of.stiffness),
            sum(&self.inertia, &of.inertia),
        ]
    }

    /// v' T v for every stored matrix: stiffnesses, inertias.
    pub fn energies(&self, v: &DVector<f64>) -> ([f64; STIFFNESSES], [f64; INERTIAS]) {
        let form = |triangle: &Triangle| {
            triangle.iter().fold(0.0, |sum, &(r, c, t)| {
                let twice = if r == c { 1.0 } else { 2.0 };
                sum + twice * t * v[r as usize] * v[c as usize]
            })
        };
        (
            std::array::from_fn(|k| form(&self.stiffness[k])),
            std::array::from_fn(|k| form(&self.inertia[k])),
        )
    }
}
