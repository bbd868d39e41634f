//! Factors of the Newton matrix `J_ij = δ_ij [f_ẋ,i | f_z,i] + h a_ij [f_x,i | 0]`.

use super::block::Block;
use super::dense::Dense;
use super::sparse;
use crate::model::{ArrayK, Assembly, Dae};
use crate::scalar::Real;
use crate::shape::{Array, Plain, assign};
use bytemuck::Zeroable;

/// Planned factors are good enough if a solution satisfies its equations to this many ε of their terms.
const ROUNDING: f64 = 4096.0;

/// The row of right-hand sides that belongs to an equation: that of the unknown whose pivot it is.
#[inline(always)]
pub fn slot<M: Dae>(equation: usize) -> usize {
    match M::STRUCTURE.elimination.slot_of_equation.get(equation) {
        Some(&slot) => slot as usize,
        None => equation,
    }
}

/// The factors, by the plan or dense.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Factors<M: Dae, T: Plain, const S: usize> {
    blocks: M::Factors<Block<T, S>>,
    /// Memory that is touched only where the plan is not good enough.
    dense: Dense<M, T, S>,
    /// Whether the dense factors are the ones that hold.
    is_dense: bool,
    /// Whether the plan is not to be used.
    pivoted: bool,
}

impl<M: Dae, T: Plain, const S: usize> Clone for Factors<M, T, S> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: Dae, T: Plain, const S: usize> Copy for Factors<M, T, S> {}

impl<M: Dae, T: Real, const S: usize> Factors<M, T, S> {
    /// Whether the plan is in use, so that pivoting the whole matrix may give better factors.
    pub fn is_planned(&self) -> bool {
        !self.pivoted && !M::STRUCTURE.elimination.pivots.is_empty()
    }

    /// From now on, whether every matrix is to be pivoted as a whole.
    pub fn set_pivoted(&mut self, pivoted: bool) {
        self.pivoted = pivoted;
    }

    /// Factors of the matrix of these Jacobians, one per stage. Whether those of the plan hold, if there is one.
    ///
    /// # Errors
    /// The unknown and the stage for which there is no pivot.
    pub fn factor(
        &mut self,
        jacobian: &[M::Jacobian<T>; S],
        a: &[[T; S]; S],
        h: T,
    ) -> Result<bool, (usize, usize)> {
        self.is_dense = !(self.is_planned() && self.factor_by_plan(jacobian, a, h));
        if self.is_dense {
            self.factor_dense(jacobian, a, h)?;
        }
        Ok(!self.is_dense || M::STRUCTURE.elimination.pivots.is_empty())
    }

    /// As [`Factors::factor`], and the factors of the plan are tried on one solution before they are trusted.
    ///
    /// # Errors
    /// The unknown and the stage for which there is no pivot.
    pub fn factor_checked(
        &mut self,
        jacobian: &[M::Jacobian<T>; S],
        a: &[[T; S]; S],
        h: T,
    ) -> Result<bool, (usize, usize)> {
        let planned = self.factor(jacobian, a, h)?;
        if self.is_dense || self.is_accurate(jacobian, a, h) {
            return Ok(planned);
        }
        self.factor_dense(jacobian, a, h)?;
        Ok(false)
    }

    /// Whether a solution of `J y = J v` satisfies these equations, each relative to the size of its terms:
    /// however equations and unknowns are scaled, an elimination that lost digits shows here.
    fn is_accurate(&self, jacobian: &[M::Jacobian<T>; S], a: &[[T; S]; S], h: T) -> bool {
        let mut y: ArrayK<M, [[T; 1]; S]> = Zeroable::zeroed();
        for (unknown, y) in y.as_mut().iter_mut().enumerate() {
            for (stage, y) in y.iter_mut().enumerate() {
                // Neither equal nor alternating, so that no structure hides an error.
                *y = [T::from_f64(1.0 + 0.25 * ((3 * unknown + 5 * stage) % 7) as f64)];
            }
        }
        let mut expected: ArrayK<M, [T; S]> = Zeroable::zeroed();
        let mut found: ArrayK<M, [T; S]> = Zeroable::zeroed();
        let mut size: ArrayK<M, [T; S]> = Zeroable::zeroed();
        multiply::<M, T, S>(jacobian, a, h, &y, &mut expected, &mut size);
        for (y, expected) in y.as_mut().iter_mut().zip(expected.as_ref()) {
            *y = expected.map(|value| [value]);
        }
        self.solve(&mut y);
        size.as_mut().fill([T::ZERO; S]);
        multiply::<M, T, S>(jacobian, a, h, &y, &mut found, &mut size);
        let bound = T::EPSILON * T::from_f64(ROUNDING);
        let rows = expected.as_ref().iter().zip(found.as_ref()).zip(size.as_ref());
        rows.flat_map(|((e, f), s)| e.iter().zip(f).zip(s)).all(|((e, f), s)| (*e - *f).abs() <= bound * *s)
    }

    /// By the plan; whether that went well.
    fn factor_by_plan(&mut self, jacobian: &[M::Jacobian<T>; S], a: &[[T; S]; S], h: T) -> bool {
        let plan = &M::STRUCTURE.elimination;
        let blocks = self.blocks.as_mut();
        let ha = a.map(|row| row.map(|a| h * a));
        blocks.fill([[T::ZERO; S]; S]);
        for entry in plan.assembly {
            let Some(block) = blocks.get_mut(entry.block as usize) else { continue };
            if entry.state != Assembly::NONE {
                for ((row, ha), jacobian) in block.iter_mut().zip(&ha).zip(jacobian) {
                    let value = jacobian[entry.state as usize];
                    *row = ha.map(|ha| value * ha);
                }
            }
            if entry.direct != Assembly::NONE {
                for (stage, (row, jacobian)) in block.iter_mut().zip(jacobian).enumerate() {
                    row[stage] = row[stage] + jacobian[entry.direct as usize];
                }
            }
        }
        sparse::factor(plan, blocks);
        // A pivot that vanishes leaves infinite elements or NaN.
        let pivots = plan.pivots.iter().filter_map(|pivot| blocks.get(pivot.block as usize));
        pivots.flatten().flatten().fold(true, |finite, element| finite & element.is_finite())
    }

    /// By pivoting the whole matrix, with the row of each equation in its slot.
    ///
    /// # Errors
    /// The unknown and the stage for which there is no pivot.
    pub fn factor_dense(
        &mut self,
        jacobian: &[M::Jacobian<T>; S],
        a: &[[T; S]; S],
        h: T,
    ) -> Result<(), (usize, usize)> {
        let (pattern, blocks, nx) = (M::STRUCTURE.jacobian, M::STRUCTURE.blocks, M::STRUCTURE.x.len());
        self.is_dense = true;
        self.dense.clear();
        for (stage, jacobian) in jacobian.iter().enumerate() {
            for e in 0..blocks[3] {
                let (r, c) = pattern.at(e);
                let (r, value) = (slot::<M>(r), jacobian[e]);
                if e < blocks[1] {
                    self.dense.add(r, c, stage, value);
                } else if e < blocks[2] {
                    self.dense.add_row(r, c - nx, stage, h * value, &a[stage]);
                } else {
                    self.dense.add(r, c - nx, stage, value);
                }
            }
        }
        self.dense.factor()
    }

    /// Solves `J X = B` in place, all columns of `B` at once; equations are in their slots.
    pub fn solve<R: Array<T>>(&self, b: &mut ArrayK<M, [R; S]>) {
        if self.is_dense {
            self.dense.solve(b);
        } else {
            sparse::solve(&M::STRUCTURE.elimination, self.blocks.as_ref(), b.as_mut());
        }
    }

    /// Solves `Jᵀ X = B` in place, all columns of `B` at once; the solution has equations in their slots.
    pub fn solve_transposed<R: Array<T>>(&self, b: &mut ArrayK<M, [R; S]>) {
        if self.is_dense {
            self.dense.solve_transposed(b);
        } else {
            sparse::solve_transposed(&M::STRUCTURE.elimination, self.blocks.as_ref(), b.as_mut());
        }
    }

    /// Copies what holds.
    pub fn copy_from(&mut self, other: &Self) {
        self.pivoted = other.pivoted;
        self.is_dense = other.is_dense;
        if other.is_dense {
            assign(&mut self.dense, &other.dense);
        } else {
            assign(&mut self.blocks, &other.blocks);
        }
    }
}

/// `J y` in the slots of the equations, and the sum of the sizes of its terms.
fn multiply<M: Dae, T: Real, const S: usize>(
    jacobian: &[M::Jacobian<T>; S],
    a: &[[T; S]; S],
    h: T,
    y: &ArrayK<M, [[T; 1]; S]>,
    product: &mut ArrayK<M, [T; S]>,
    size: &mut ArrayK<M, [T; S]>,
) {
    let (pattern, blocks, nx) = (M::STRUCTURE.jacobian, M::STRUCTURE.blocks, M::STRUCTURE.x.len());
    for e in 0..blocks[3] {
        let (r, c) = pattern.at(e);
        let (r, y) = (slot::<M>(r), &y[if e < blocks[1] { c } else { c - nx }]);
        for (stage, jacobian) in jacobian.iter().enumerate() {
            let [own] = y[stage];
            let (mut sum, mut sizes) = (own, own.abs());
            if e >= blocks[1] && e < blocks[2] {
                (sum, sizes) = (T::ZERO, T::ZERO);
                for (a, [y]) in a[stage].iter().zip(y) {
                    let term = h * *a * *y;
                    (sum, sizes) = (sum + term, sizes + term.abs());
                }
            }
            product[r][stage] = product[r][stage] + jacobian[e] * sum;
            size[r][stage] = size[r][stage] + jacobian[e].abs() * sizes;
        }
    }
}
