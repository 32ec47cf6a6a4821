use nalgebra::{DMatrix, DVector};

use plychain::posterior::{Compiled, Equations, PlacesOf, log_evidences};

/// By dense algebra, point by point; of 11 points, which fill no whole number of vectors.
#[test]
fn evidences_are_those_of_dense_algebra() {
    let (n, constants, factors, count) = (13, 3, 9, 11);
    let width = (constants + 1) * n + factors;
    let number = |i: usize, j: usize| f64::sin((3 * i * i + 7 * j * (i + 2)) as f64);
    let columns = DMatrix::from_fn(40, width, number);
    let all = columns.tr_mul(&columns);
    let equations = Equations::new(&all, n, constants);
    let one = || std::iter::once(1.0);
    let place = |i: usize| -> (Vec<f64>, Vec<f64>) {
        let coordinates = (0..constants).map(|k| 0.2 * number(k + 1, i + 4));
        let left = (1..factors).map(|k| 0.1 * number(k + 3, i + 9));
        (
            one().chain(coordinates).collect(),
            one().chain(left).collect(),
        )
    };
    let places: Vec<(Vec<f64>, Vec<f64>)> = (0..count).map(place).collect();
    let half = equations.turned(&(DMatrix::identity(n, n) * 0.5));
    let [whole, half] = [&equations, &half].map(Compiled::new);
    let found = log_evidences(&[&whole, &half], &PlacesOf::new(&places, vec![1.0; count]));
    assert_eq!(found.len(), 2 * count);
    for (i, found) in found.iter().enumerate() {
        let scale = [1.0, 0.5][i / count];
        let (coordinates, left) = &places[i % count];
        // the columns and what is left at the point, then plain least squares
        let mut x = DMatrix::zeros(40, n);
        for (a, by) in coordinates.iter().enumerate() {
            x += columns.columns(a * n, n) * (by * scale);
        }
        let left = DVector::from_column_slice(left);
        let y = columns.columns((constants + 1) * n, factors) * left;
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
    let here = [(vec![1.0], vec![1.0])];
    let found = log_evidences(
        &[&Compiled::new(&equations)],
        &PlacesOf::new(&here, vec![1.0]),
    );
    assert_eq!(found, [f64::NEG_INFINITY]);
}
