//! Factors in the eigenbasis of the tableau with a check of their accuracy, and with pivoting of
//! the whole matrices as fallback; used by adaptive integrators.

use super::complex::Complex;
use crate::linalg::dense_lu::DenseLu;
use crate::linalg::kernel::arithmetic::{Arithmetic, Block};
use crate::linalg::kernel::dispatch::{Kernel, dispatch};
use crate::linalg::newton_matrix::{for_each_dense_entry, kinematic, slot};
use crate::linalg::sparse_lu::factor::{self, PlannedFactors};
use crate::linalg::sparse_lu::solve;
use crate::model::{ArrayK, Dae};
use crate::plan::Known;
use crate::scalar::Real;
use crate::shape::{Aligned, InBounds, Plain, Shape};
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// Maximal number of eigenvalues, one per conjugate pair.
const MAX_EIGENVALUES: usize = 4;

/// Number of real parts of a number for all eigenvalues.
pub const COMPLEX_PARTS: usize = 2 * MAX_EIGENVALUES;

/// A right-hand side or a solution of the systems of all eigenvalues, one row per slot.
pub type EigenRows<M, T> = ArrayK<M, [[Complex<T, COMPLEX_PARTS>; 1]; 1]>;

/// Factors of `[f_ẋ + hμ_l f_x | f_z]` for all eigenvalues.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
pub struct EigenFactors<M: Dae, T: Plain> {
    blocks: Aligned<M::Factors<[[Complex<T, COMPLEX_PARTS>; 1]; 1]>>,
    /// The Jacobian, and `hμ`: used to condense kinematic states.
    jacobian: M::Jacobian<T>,
    h_mu: Complex<T, COMPLEX_PARTS>,
    /// Memory of the dense fallback, untouched while the plan is accurate; real and imaginary part
    /// are two stages.
    dense: [DenseLu<M, T, 2>; MAX_EIGENVALUES],
    is_dense: bool,
    pivoted: bool,
}

impl<M: Dae, T: Real> EigenFactors<M, T> {
    /// Whether the plan is used, so that pivoting may improve the factors.
    fn uses_plan(&self) -> bool {
        !self.pivoted && M::STRUCTURE.elimination.has_plan()
    }

    /// Whether the current factors are those of the plan.
    pub fn has_planned_factors(&self) -> bool {
        !self.is_dense
    }

    /// Sets whether all following factorisations pivot the whole matrices.
    pub fn set_pivoted(&mut self, pivoted: bool) {
        self.pivoted = pivoted;
    }

    /// Factorises the matrices of a Jacobian. Returns `false` if there is a plan whose factors are
    /// not used.
    ///
    /// # Errors
    /// The unknown without a pivot.
    pub fn factor(
        &mut self,
        jacobian: &M::Jacobian<T>,
        values: &Complex<T, COMPLEX_PARTS>,
        h: T,
    ) -> Result<bool, usize> {
        let scale = values.scaled(h);
        (self.jacobian, self.h_mu) = (*jacobian, scale);
        self.is_dense = !(self.uses_plan() && self.factor_by_plan(jacobian, &scale));
        if self.is_dense {
            self.factor_dense(jacobian, &scale)?;
        }
        Ok(!self.is_dense || !M::STRUCTURE.elimination.has_plan())
    }

    /// Factorises by the plan; returns whether the factors are finite.
    fn factor_by_plan(&mut self, jacobian: &M::Jacobian<T>, scale: &Complex<T, COMPLEX_PARTS>) -> bool {
        let blocks = self.blocks.as_mut();
        dispatch(Assemble::<M, T> { jacobian: jacobian.as_ref(), scale, blocks, model: PhantomData })
    }

    /// Factorises with pivoting of the whole matrices.
    fn factor_dense(
        &mut self,
        jacobian: &M::Jacobian<T>,
        scale: &Complex<T, COMPLEX_PARTS>,
    ) -> Result<(), usize> {
        let square = *scale * *scale;
        for (l, dense) in self.dense.iter_mut().enumerate() {
            dense.clear();
            for_each_dense_entry::<M, _>(jacobian.as_ref(), |place, &value, minus_c| {
                let (r, c, value) =
                    (place.slot, place.column, minus_c.map_or(value, |&minus_c| -(minus_c * value)));
                let (re, im) = match place.ha_power {
                    0 => (T::ONE, T::ZERO),
                    1 => scale.get(l),
                    _ => square.get(l),
                };
                dense.add_row(r, c, 0, value, &[re, -im]);
                dense.add_row(r, c, 1, value, &[im, re]);
            });
            // Rows of kinematic states are those of the unit matrix.
            for state in (0..M::Shape::NX).filter(|&state| kinematic::<M>(state).is_some()) {
                (0..2).for_each(|part| dense.add(state, state, part, T::ONE));
            }
            dense.factor().map_err(|(unknown, _)| unknown)?;
        }
        Ok(())
    }

    /// Solves all systems in place; equations are in their slots.
    pub fn solve(&self, rows: &mut EigenRows<M, T>) {
        self.eliminate(rows);
        if self.is_dense {
            self.solve_dense(rows);
        } else {
            let blocks = self.blocks.as_ref();
            let factors = PlannedFactors::<_, _, 1> { plan: Known::<M>::PLAN, blocks };
            solve::solve(factors, rows.as_mut());
        }
        self.reconstruct(rows);
    }

    /// `b_r ← b_r − (f_q̇ + hμ f_q) b_q` for each kinematic state `q`.
    fn eliminate(&self, rows: &mut EigenRows<M, T>) {
        for dependent in M::STRUCTURE.elimination.dependents {
            let (entry, [[own]]) = (dependent.entry as usize, rows[dependent.state as usize]);
            let own = if entry < M::STRUCTURE.blocks[1] { own } else { self.h_mu * own };
            let [[to]] = &mut rows[slot::<M>(M::STRUCTURE.jacobian.at(entry).0)];
            *to = *to - own.scaled(self.jacobian[entry]);
        }
    }

    /// `y_q = b_q + c hμ y_v`
    fn reconstruct(&self, rows: &mut EigenRows<M, T>) {
        let nx = M::Shape::NX;
        for state in 0..M::STRUCTURE.elimination.kinematic.len() {
            let Some(of) = kinematic::<M>(state) else { continue };
            if (of.velocity as usize) < 2 * nx {
                let [[velocity]] = rows[of.velocity as usize - nx];
                let [[to]] = &mut rows[state];
                *to = *to - (self.h_mu * velocity).scaled(self.jacobian[of.entry as usize]);
            }
        }
    }

    /// Returns the componentwise backward error of a solution with these factors, the largest of
    /// all equations and eigenvalues (W. Oettli, W. Prager, Numer. Math. 6 (1964)). The exact
    /// solution is given: a multiple of `units` for each unknown.
    #[inline(never)]
    pub fn backward_error(&self, units: &ArrayK<M, T>) -> f64 {
        let mut right = EigenRows::<M, T>::zeroed();
        for (index, ([[row]], unit)) in right.as_mut().iter_mut().zip(units.as_ref()).enumerate() {
            // Weights that are neither equal nor alternating, so that no structure of the model
            // hides an error.
            let weight = (1 + index * 7 % 11) as f64 * if index * 5 % 7 < 3 { -0.2 } else { 0.2 };
            *row = Complex::real(T::from_f64(weight) * *unit);
        }
        let mut solution = EigenRows::<M, T>::zeroed();
        self.multiply(&right, |equation, term| {
            let [[row]] = &mut solution[equation];
            *row = *row + term;
        });
        right = solution;
        for state in (0..M::Shape::NX).filter(|&state| kinematic::<M>(state).is_some()) {
            right[state] = [[Complex::zero()]];
        }
        solution = right;
        self.solve(&mut solution);
        let mut sizes: ArrayK<M, [T; MAX_EIGENVALUES]> = Zeroable::zeroed();
        let size = |z: Complex<T, COMPLEX_PARTS>, l: usize| {
            let (re, im) = z.get(l);
            re.abs() + im.abs()
        };
        for (sizes, [[row]]) in sizes.as_mut().iter_mut().zip(right.as_ref()) {
            *sizes = core::array::from_fn(|l| size(*row, l));
        }
        self.multiply(&solution, |equation, term| {
            let [[row]] = &mut right[equation];
            *row = *row - term;
            for (l, sum) in sizes[equation].iter_mut().enumerate() {
                *sum = *sum + size(term, l);
            }
        });
        let mut largest = 0.0f64;
        for (sizes, [[row]]) in sizes.as_ref().iter().zip(right.as_ref()) {
            for (l, sum) in sizes.iter().enumerate() {
                let error = (size(*row, l) / *sum).to_f64();
                // An equation whose terms are all zero has no error; a solution that is not finite
                // has an infinite one.
                if *sum != T::ZERO && (error.is_nan() || error > largest) {
                    largest = if error.is_nan() { f64::INFINITY } else { error };
                }
            }
        }
        largest
    }

    /// Visits the terms of the product of the matrices with a solution, each with the slot of its
    /// equation.
    fn multiply(&self, solution: &EigenRows<M, T>, mut term: impl FnMut(usize, Complex<T, COMPLEX_PARTS>)) {
        let square = self.h_mu * self.h_mu;
        for_each_dense_entry::<M, _>(self.jacobian.as_ref(), |place, &value, minus_c| {
            let value = minus_c.map_or(value, |&minus_c| -(minus_c * value));
            let [[unknown]] = solution[place.column];
            let unknown = match place.ha_power {
                0 => unknown,
                1 => self.h_mu * unknown,
                _ => square * unknown,
            };
            term(place.slot, unknown.scaled(value));
        });
    }

    fn solve_dense(&self, rows: &mut EigenRows<M, T>) {
        let mut parts: ArrayK<M, [[T; 1]; 2]> = Zeroable::zeroed();
        for (l, dense) in self.dense.iter().enumerate() {
            for (part, [[row]]) in parts.as_mut().iter_mut().zip(rows.as_ref()) {
                let (re, im) = row.get(l);
                *part = [[re], [im]];
            }
            dense.solve(&mut parts);
            for ([[re], [im]], [[row]]) in parts.as_ref().iter().zip(rows.as_mut()) {
                row.set(l, (*re, *im));
            }
        }
    }
}

/// Assembles and factorises the matrices; returns whether the pivots are finite.
struct Assemble<'a, M, T> {
    jacobian: &'a [T],
    scale: &'a Complex<T, COMPLEX_PARTS>,
    blocks: &'a mut [Block<Complex<T, COMPLEX_PARTS>, 1>],
    model: PhantomData<M>,
}

impl<M: Dae, T: Real> Kernel for Assemble<'_, M, T> {
    type Number = T;
    type Output = bool;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> bool {
        let Self { jacobian, scale, blocks, .. } = self;
        let plan = &M::STRUCTURE.elimination;
        let square = *scale * *scale;
        for entry in plan.assembly {
            let Some([[to]]) = blocks.get_mut(entry.block as usize).in_bounds() else { continue };
            let mut element = if entry.first { Complex::zero() } else { *to };
            // Absent entries have an index outside of the Jacobian.
            if let Some(&(mut value)) = jacobian.get(entry.entry as usize) {
                if let Some(&minus_c) = jacobian.get(entry.by as usize) {
                    value = -(minus_c * value);
                }
                element = match entry.order {
                    0 => element.plus(value),
                    1 => element + scale.scaled(value),
                    _ => element + square.scaled(value),
                };
            }
            *to = element;
        }
        factor::Factor::<_, _, 1> { plan: Known::<M>::PLAN, blocks: &mut *blocks }.run::<A>();
        // A vanishing pivot gives an inverse of infinity or NaN.
        let pivots = plan.pivots.iter().filter_map(|pivot| blocks.get(pivot.block as usize));
        pivots.fold(true, |finite, [[element]]| finite & element.is_finite())
    }
}
