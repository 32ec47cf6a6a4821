//! Reduced bases of a plate: made for many tests at once, and held against the solver.

use std::sync::{Arc, PoisonError};
use std::time::Instant;

use super::basis::{Query, ROUNDING, Shape, SpanBasis};
use super::plate::{Plate, query};
use super::setup::Setup;
use super::view::View;
use crate::error::Result;
use crate::laminate::Ply;

/// What a reduced basis answers to one test beside what the solver does.
#[derive(Debug, Clone, Copy)]
pub struct Certificate {
    /// Solutions in the basis.
    pub solutions: usize,
    /// Bound of the error in the energy norm, over that of the answer.
    pub bound: f64,
    /// The error itself.
    pub error: f64,
    /// Largest difference at a point of the view, mm, and its bound.
    pub largest_mm: f64,
    pub bound_mm: f64,
    /// Time of the answer and of the solution, s.
    pub answer_s: f64,
    pub solve_s: f64,
}

impl Certificate {
    /// Hold a basis's answer to a test against the solver's, at its points of view; nothing where it has none.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn of(plate: &Plate, setup: &Setup, ply: &Ply, view: &View) -> Result<Option<Self>> {
        let Some(query) = query(setup, ply) else {
            return Ok(None);
        };
        let basis = &view.basis;
        let begin = Instant::now();
        let Some(answer) = basis.answer(&query) else {
            return Ok(None);
        };
        let nodal = basis.nodal(&answer);
        let answer_s = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let solved = plate.factorised(setup, ply)?.1;
        let solve_s = begin.elapsed().as_secs_f64();
        let error: Vec<f64> = solved
            .nodal
            .iter()
            .zip(&nodal)
            .map(|(a, b)| a - b)
            .collect();
        let seen = view.seen(&error);
        Ok(Some(Self {
            solutions: basis.size(),
            bound: answer.relative(),
            error: basis.energy(&plate.assembly, &solved.mesh, &error) / answer.energy,
            largest_mm: seen.iter().flatten().fold(0.0, |m, e| m.max(e.abs())),
            bound_mm: view.bound_mm(&answer),
            answer_s,
            solve_s,
        }))
    }

    /// The bound over the error, where that is not all rounding.
    pub fn effectivity(&self) -> f64 {
        self.bound / self.error.max(ROUNDING)
    }
}

/// Stacks of a plate of which a basis is made, at most: its residuals are some 100 columns a stack, as long as the field.
const MOST_STACKS: usize = 6;

/// Tests that one basis answers.
struct Alike<'a> {
    shape: Option<Shape>,
    /// One of them.
    setup: &'a Setup,
    queries: Vec<Query>,
}

/// Answer tests like these from reduced bases from now on, where there are enough of them on one mesh (`least` of a uniform plate, and
/// more of one whose stiffness is a sum of fields or that has several stacks, because the cost of a bound grows with their square; none of
/// many stacks, because its size does too), to within [`super::TOLERANCE`] of the
/// field; what a basis cannot answer so well is solved.
///
/// # Errors
/// Those of [`Plate::solve`].
pub fn span(plate: &Plate, tests: &[(Setup, Ply)], least: usize) -> Result<()> {
    let mut kinds: Vec<Alike<'_>> = Vec::new();
    for (setup, ply) in tests {
        let Some(query) = query(setup, ply) else {
            continue;
        };
        let same = |k: &&mut Alike<'_>| Shape::of(&query.profile) == k.shape;
        match kinds.iter_mut().find(same) {
            Some(kind) => kind.queries.push(query),
            None => kinds.push(Alike {
                shape: Shape::of(&query.profile),
                setup,
                queries: vec![query],
            }),
        }
    }
    for Alike {
        setup,
        queries,
        shape,
    } in kinds
    {
        let fields = shape.map_or(1 << 10, Shape::count);
        let stacks = plate.assembly.stacks();
        if stacks > MOST_STACKS || queries.len() < least * fields.pow(3) * stacks {
            continue;
        }
        let known = plate.basis_of(&queries[0].profile);
        let is_answered = |b: &SpanBasis, q| b.answer(q).is_some_and(|a| a.is_enough());
        let answered = |b: &Arc<SpanBasis>| queries.iter().all(|q| is_answered(b, q));
        if known.as_ref().is_some_and(answered) {
            continue;
        }
        let mesh = plate.mesh_of(setup)?;
        let basis = Arc::new(SpanBasis::greedy(plate, &mesh, &queries)?);
        let mut bases = plate.bases.write().unwrap_or_else(PoisonError::into_inner);
        bases.retain(|b| known.as_ref().is_none_or(|k| !Arc::ptr_eq(k, b)));
        bases.push(basis);
    }
    Ok(())
}
