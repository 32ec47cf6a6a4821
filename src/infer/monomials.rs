//! Variables and exponents of monomials: collapsing a variable, and the products by which each monomial comes from a lower one.

use crate::reduce::Surface;

/// A variable of the surface, scaled to [-1, 1]: a parameter, or the ratio of one to the first.
#[derive(Debug, Clone)]
pub struct ScaledVariable {
    /// Index of the parameter.
    pub numerator: usize,
    /// Whether it is divided by the first parameter.
    pub ratio: bool,
    /// Inverse of its half-width.
    pub per_half: f64,
    /// What is added to it over its half-width.
    pub offset: f64,
}

/// The variables of a surface but for a collapsed one, by index of the sampled parameters.
pub fn variables(surface: &Surface, collapsed: Option<usize>) -> Vec<ScaledVariable> {
    let thickness = surface.variables.thickness();
    let terms = surface.variables.terms();
    let kept = (0..surface.variables.count()).filter(|k| Some(*k) != collapsed);
    kept.map(|k| {
        let (numerator, ratio) = terms[k];
        let [middle, half] = surface.variables.scaling(k);
        // The sampled parameters leave the thickness out.
        let before = thickness.is_some_and(|t| t < numerator);
        ScaledVariable {
            numerator: numerator - usize::from(before),
            ratio,
            per_half: 1.0 / half,
            offset: -middle / half,
        }
    })
    .collect()
}

/// Exponents without one variable.
pub fn without(e: &[u8], variable: Option<usize>) -> Vec<u8> {
    let kept = e.iter().enumerate().filter(|(k, _)| Some(*k) != variable);
    kept.map(|(_, e)| *e).collect()
}

/// Degree of a monomial.
pub fn degree(e: &[u8]) -> usize {
    e.iter().map(|k| usize::from(*k)).sum()
}

/// Index of a monomial; 0, the constant, if it is not there.
pub fn position(exponents: &[Vec<u8>], e: &[u8]) -> usize {
    exponents.iter().position(|x| x == e).unwrap_or(0)
}

/// The monomials without one variable, by degree, with every lower monomial that a product needs; and the products.
pub fn closure(
    exponents: &[Vec<u8>],
    collapsed: Option<usize>,
) -> (Vec<Vec<u8>>, Vec<(usize, usize)>) {
    let mut all: Vec<Vec<u8>> = exponents.iter().map(|e| without(e, collapsed)).collect();
    let mut next = 0;
    while next < all.len() {
        if let Some(lower) = lower(&all[next]) {
            all.push(lower.0);
        }
        next += 1;
    }
    all.sort_by_key(|e| (degree(e), std::cmp::Reverse(e.clone())));
    all.dedup();
    if all.first().is_none_or(|e| e.iter().any(|k| *k > 0)) {
        all.insert(0, vec![0; all.first().map_or(0, Vec::len)]);
    }
    let products = all[1..]
        .iter()
        .filter_map(|e| lower(e).map(|(lower, variable)| (position(&all, &lower), variable)))
        .collect();
    (all, products)
}

/// The monomial one degree lower in the last variable that has any, and that variable.
fn lower(e: &[u8]) -> Option<(Vec<u8>, usize)> {
    let variable = e.iter().rposition(|k| *k > 0)?;
    let mut lower = e.to_vec();
    lower[variable] -= 1;
    Some((lower, variable))
}
