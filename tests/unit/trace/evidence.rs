use nalgebra::{DMatrix, DVector};

use plychain::trace::quoted::evidence::{Compiled, log_evidences};
use plychain::trace::quoted::quadratic::Equations;
use plychain::trace::quoted::space::{monomials, values};

/// By dense algebra, point by point; of 11 points, which fill no whole number of vectors.
#[test]
fn evidences_are_those_of_dense_algebra() {
    let (n, constants, count) = (13, 3, 11);
    let products = monomials(constants);
    let width = (constants + 1) * n + products.len();
    let number = |i: usize, j: usize| f64::sin((3 * i * i + 7 * j * (i + 2)) as f64);
    let columns = DMatrix::from_fn(40, width, number);
    let all = columns.tr_mul(&columns);
    let equations = Equations::new(&all, n, constants);
    let distance = |k: usize, i: usize| 0.2 * number(k + 1, i + 4);
    let distances: Vec<f64> = (0..constants)
        .flat_map(|k| (0..count).map(move |i| distance(k, i)))
        .collect();
    let half = equations.turned(&(DMatrix::identity(n, n) * 0.5));
    let [whole, half] = [&equations, &half].map(Compiled::new);
    let found = log_evidences(&[&whole, &half], &distances, count);
    for (i, found) in found.iter().enumerate() {
        let scale = [1.0, 0.5][i / count];
        let d: Vec<f64> = std::iter::once(1.0)
            .chain((0..constants).map(|k| distance(k, i % count)))
            .collect();
        // the columns and what is left at the point, then plain least squares
        let mut x = DMatrix::zeros(40, n);
        for (a, d) in d.iter().enumerate() {
            x += columns.columns(a * n, n) * (d * scale);
        }
        let m = DVector::from_vec(values(&products, &d));
        let y = columns.columns((constants + 1) * n, products.len()) * m;
        let p = x.tr_mul(&x) + DMatrix::identity(n, n);
        let z = x.tr_mul(&y);
        let solved = p.clone().lu().solve(&z).unwrap();
        let expected = -0.5 * (y.norm_squared() - z.dot(&solved) + p.determinant().ln());
        assert!(
            (found - expected).abs() < 1e-9 * expected.abs(),
            "{i}: {found} {expected}"
        );
    }
}

#[test]
fn no_density_where_the_equations_are_not_positive() {
    let all = DMatrix::from_diagonal(&DVector::from_vec(vec![-2.0, 1.0]));
    let equations = Equations::new(&all, 1, 0);
    let found = log_evidences(&[&Compiled::new(&equations)], &[], 1);
    assert_eq!(found, [f64::NEG_INFINITY]);
}
