//! Factors of the Newton matrix `J_ij = δ_ij [f_ẋ,i | f_z,i] + h a_ij [f_x,i | 0]`.

use super::block::{Block, coupling};
use super::dense::Dense;
use super::fused::{Arithmetic, Kernel, dispatch};
use super::left_out::{fill, follows, has_followers, is_fill, is_led, row_of, rows};
use super::sparse::{self, Planned};
use super::straight::{AtRow, each_row};
use super::substitution;
use crate::memory::{Fallback, Kept, fallback::Pivoting};
use crate::model::{ArrayK, Dae};
use crate::scalar::{Field, Lanes, Real};
use crate::shape::{Aligned, Array, Plain, assign};
use bytemuck::Zeroable;
use core::marker::PhantomData;

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
pub struct Factors<M: Dae, T: Plain, const S: usize, F: Fallback = Pivoting> {
    blocks: Aligned<M::Factors<Block<T, S>>>,
    /// `−hA` of the blocks.
    coupling: Block<T, S>,
    /// Memory that is touched only where the plan is not good enough.
    dense: F::Place<Dense<M, T, S>>,
    /// Whether the dense factors are the ones that hold.
    is_dense: bool,
}

impl<M: Dae, T: Plain, const S: usize, F: Fallback> Clone for Factors<M, T, S, F> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: Dae, T: Plain, const S: usize, F: Fallback> Copy for Factors<M, T, S, F> {}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Factors<M, E, S, F> {
    /// Factors by the plan, of the matrix of these Jacobian entries, each with its value at all stages. A pivot
    /// that vanishes leaves elements that are not finite.
    pub fn factor_by_plan(&mut self, jacobian: &M::Jacobian<[E; S]>, a: &[[E; S]; S], h: E) {
        self.is_dense = false;
        let Self { coupling, blocks, .. } = self;
        dispatch(Assemble::<M, E, S, false> { jacobian, a, h, coupling, blocks });
        sparse::factor::<M, E, S>(coupling, blocks.as_mut());
    }

    /// The same for [`solve_led`](Self::solve_led) alone: states that have gone into [those that they follow](crate::model::Led) are left out.
    pub fn factor_led_by_plan(&mut self, jacobian: &M::Jacobian<[E; S]>, a: &[[E; S]; S], h: E) {
        if const { !is_led::<M>() } {
            return self.factor_by_plan(jacobian, a, h);
        }
        self.is_dense = false;
        let Self { coupling, blocks, .. } = self;
        dispatch(Assemble::<M, E, S, true> { jacobian, a, h, coupling, blocks });
        sparse::factor_led::<M, E, S>(coupling, blocks.as_mut());
    }

    /// Solves `J X = B` in place, all columns of `B` at once; equations are in their slots.
    pub fn solve<R: Array<E>>(&self, b: &mut ArrayK<M, [R; S]>) {
        match self.dense() {
            Some(dense) => dense.solve(b),
            None => substitution::solve(self.planned(), b.as_mut()),
        }
    }

    /// Solves `J X = B` in place but for states that [follow](super::follows), where there is nothing.
    pub fn solve_led<R: Array<E>>(&self, b: &mut ArrayK<M, [R; S]>) {
        if const { !has_followers::<M>() } {
            return self.solve(b);
        }
        match self.dense() {
            Some(dense) => {
                dense.solve(b);
                for (slot, row) in b.as_mut().iter_mut().enumerate() {
                    if follows::<M>(slot).is_some() {
                        *row = Zeroable::zeroed();
                    }
                }
            }
            None => substitution::solve_led(self.planned(), b.as_mut()),
        }
    }

    /// Solves `Jᵀ X = B` in place, all columns of `B` at once; the solution has equations in their slots.
    pub fn solve_transposed<R: Array<E>>(&self, b: &mut ArrayK<M, [R; S]>) {
        match self.dense() {
            Some(dense) => dense.solve_transposed(b),
            None => substitution::solve_transposed(self.planned(), b.as_mut()),
        }
    }

    /// The factors by the plan.
    pub fn planned(&self) -> Planned<'_, M, E, S> {
        Planned { model: PhantomData, blocks: self.blocks.as_ref(), coupling: &self.coupling }
    }

    /// Whether the factors that are there are those of the plan.
    pub fn is_planned(&self) -> bool {
        self.dense().is_none()
    }

    /// The factors of the whole matrix, if they are the ones that hold.
    #[inline(always)]
    fn dense(&self) -> Option<&Dense<M, E, S>> {
        self.dense.get().filter(|_| self.is_dense)
    }

    /// Copies what holds.
    pub fn copy_from(&mut self, other: &Self) {
        self.is_dense = other.is_dense;
        if let (Some(to), Some(from)) = (self.dense.get_mut(), other.dense()) {
            assign(to, from);
        } else {
            assign(&mut self.blocks, &other.blocks);
            self.coupling = other.coupling;
        }
    }
}

/// All blocks of the Newton matrix, each written once; or of that without states that have gone into those that they follow.
struct Assemble<'a, M: Dae, E: Plain, const S: usize, const LED: bool> {
    jacobian: &'a M::Jacobian<[E; S]>,
    a: &'a [[E; S]; S],
    h: E,
    /// Becomes `−hA`.
    coupling: &'a mut Block<E, S>,
    blocks: &'a mut M::Factors<Block<E, S>>,
}

impl<M: Dae, E: Field + Plain, const S: usize, const LED: bool> Kernel for Assemble<'_, M, E, S, LED> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { jacobian, a, h, coupling: to, blocks } = self;
        let coupling = coupling(a, h);
        *to = coupling;
        let mut square = [[E::from_f64(0.0); S]; S];
        if LED {
            A::subtract_blocks(&mut square, &coupling, &coupling);
        }
        each_row::<A, _>(&mut Rows::<M, E, S, LED> { jacobian, coupling, square, blocks });
    }
}

/// See [`Assemble`].
struct Rows<'a, M: Dae, E: Plain, const S: usize, const LED: bool> {
    jacobian: &'a M::Jacobian<[E; S]>,
    /// `−hA`
    coupling: Block<E, S>,
    /// `−(hA)²`
    square: Block<E, S>,
    blocks: &'a mut M::Factors<Block<E, S>>,
}

impl<M: Dae, E: Field + Plain, const S: usize, const LED: bool> AtRow for Rows<'_, M, E, S, LED> {
    const ROWS: usize = rows::<M>(LED);
    const SIMPLE: usize = fill::<M>(LED);
    const INSTRUCTIONS: usize = 2 + 2 * S * if size_of::<E>() > 8 { S } else { 1 };
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let (jacobian, blocks) = (self.jacobian.as_ref(), self.blocks.as_mut());
        let Some((own, led)) = row_of::<M>(LED, row) else { return };
        if const { sparse::begins_with_update::<M, E>() } && is_fill(own, led) {
            return;
        }
        let Some(to) = blocks.get_mut(own.block as usize) else { return };
        // An index that marks what is not there lies outside of the Jacobian.
        let (state, direct) = (jacobian.get(own.state as usize), jacobian.get(own.direct as usize));
        let mut block = [[E::from_f64(0.0); S]; S];
        if let Some(state) = state {
            if (const { S > 1 }) && own.scaled {
                to[0] = *state;
                return;
            }
            for (column, ha) in block.iter_mut().zip(&self.coupling) {
                A::subtract_products(column, state, ha);
            }
        }
        if let Some(direct) = direct {
            for (stage, (column, &direct)) in block.iter_mut().zip(direct).enumerate() {
                column[stage] = column[stage] + direct;
            }
        }
        if LED
            && let Some(led) = led
            && let Some(minus_c) = jacobian.get(led.by as usize)
        {
            let ways = [(led.direct, &self.coupling), (led.state, &self.square)];
            for (entry, columns) in ways {
                let Some(&(mut felt)) = jacobian.get(entry as usize) else { continue };
                for (felt, &minus_c) in felt.iter_mut().zip(minus_c) {
                    *felt = -(*felt * minus_c);
                }
                for (column, ha) in block.iter_mut().zip(columns) {
                    A::subtract_products(column, &felt, ha);
                }
            }
        }
        *to = block;
    }
    /// Fill.
    #[inline(always)]
    fn simple(&mut self, row: usize) {
        let Some((own, _)) = row_of::<M>(LED, row) else { return };
        if const { sparse::begins_with_update::<M, E>() } {
            return;
        }
        if let Some(block) = self.blocks.as_mut().get_mut(own.block as usize) {
            *block = [[E::from_f64(0.0); S]; S];
        }
    }
}

impl<M: Dae, T: Real, const S: usize, F: Fallback> Factors<M, T, S, F> {
    /// By pivoting the whole matrix, with the row of each equation in its slot.
    ///
    /// # Errors
    /// The unknown and the stage for which there is no pivot; nothing if there is no memory for it.
    pub fn factor_dense(
        &mut self,
        jacobian: &M::Jacobian<[T; S]>,
        a: &[[T; S]; S],
        h: T,
    ) -> Result<(), Option<(usize, usize)>> {
        let (pattern, blocks, nx) = (M::STRUCTURE.jacobian, M::STRUCTURE.blocks, M::STRUCTURE.x.len());
        let Some(dense) = self.dense.get_mut() else { return Err(None) };
        self.is_dense = true;
        dense.clear();
        for (e, values) in jacobian.as_ref().iter().enumerate().take(blocks[3]) {
            let (r, c) = pattern.at(e);
            let r = slot::<M>(r);
            for (stage, value) in values.iter().enumerate() {
                if e < blocks[1] {
                    dense.add(r, c, stage, *value);
                } else if e < blocks[2] {
                    dense.add_row(r, c - nx, stage, h * *value, &a[stage]);
                } else {
                    dense.add(r, c - nx, stage, *value);
                }
            }
        }
        dense.factor().map_err(Some)
    }
}
