//! What derivatives over a step are written to: matrices of results, and rows of `D` at a stage.

use super::sweep::Sweep;
use crate::irk::directions::{Directions, Identity, panel, panels};
use crate::irk::workspace::Coefficients;
use crate::linalg::{Arithmetic, Kernel, Packet, dispatch};
use crate::model::{ArrayW, Dae};
use crate::scalar::Lanes;
use crate::shape::{Array, Shape};
use core::marker::PhantomData;
use core::ops::Range;

/// Where derivatives are written.
pub(crate) trait Target<E> {
    /// The columns of a matrix that belong to columns of the panels, from this one on.
    fn columns<const W: usize>(&mut self, column: usize) -> [&mut [E]; W];
    /// Where the columns behind these are, if it is known.
    fn following<const W: usize>(&self, _column: usize) -> &[E] {
        &[]
    }
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Sweep<M, E, R, S> {
    /// Writes the derivatives of `x` at the point of the step where the weights, `h` included, are
    /// `weights`. All of these say zero if all that is written is finite, else NaN.
    pub(crate) fn write_differential<D: Directions<E>>(
        &self,
        weights: &[E; S],
        to: &mut impl Target<E>,
    ) -> E {
        self.write::<D, _, false>(Some(self.v()), weights, to)
    }

    /// Writes the derivatives of `z` at the point of the step where the Lagrange polynomials are
    /// `lagrange`.
    pub(crate) fn write_algebraic<D: Directions<E>>(&self, lagrange: &[E; S], to: &mut impl Target<E>) -> E {
        self.write::<D, _, true>(None, lagrange, to)
    }

    /// Writes the derivatives of `Σ_i weight_i k_i`.
    #[cfg(feature = "alloc")]
    pub(crate) fn write_slopes<D: Directions<E>>(&self, weights: &[E; S], to: &mut impl Target<E>) -> E {
        self.write::<D, _, false>(None, weights, to)
    }

    /// Writes `V + Σ_i weight_i dy_i`, of the states or of the algebraic ones.
    fn write<D: Directions<E>, G: Target<E>, const ALGEBRAIC: bool>(
        &self,
        v: Option<&[E]>,
        weights: &[E; S],
        to: &mut G,
    ) -> E {
        if ALGEBRAIC && M::Shape::NZ == 0 {
            return E::from_f64(0.0);
        }
        dispatch(Write::<M, E, D, _, S, ALGEBRAIC> { v, dy: self.dy(), weights, to, of: PhantomData })
    }
}

impl<M: Dae, E: Lanes, const S: usize> Sweep<M, E, ArrayW<M, E>, S> {
    /// Rows of `D` at a stage for some variables, over all directions.
    pub(crate) fn write_rows(
        &self,
        coefficients: &Coefficients<E, S>,
        h: E,
        stage: usize,
        variables: &[u32],
        d: &mut [ArrayW<M, E>],
    ) {
        let (v, dy) = (self.v(), self.dy());
        dispatch(WriteRows::<M, E, S> { v, dy, coefficients, h, stage, variables, d });
    }
}

/// See [`Sweep::write_rows`].
struct WriteRows<'a, M: Dae, E: Lanes, const S: usize> {
    v: &'a [E],
    dy: &'a [E],
    coefficients: &'a Coefficients<E, S>,
    h: E,
    stage: usize,
    variables: &'a [u32],
    d: &'a mut [ArrayW<M, E>],
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for WriteRows<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { v, dy, coefficients, h, stage, variables, d } = self;
        let (nx, nz, nk) = (M::Shape::NX, M::Shape::NZ, M::Shape::NK);
        let (zero, one) = (E::from_f64(0.0), E::from_f64(1.0));
        for &variable in variables {
            let variable = variable as usize;
            let Some(row) = d.get_mut(variable) else { continue };
            row.as_mut().fill(zero);
            // A state or an input on which the model does not depend moves with itself.
            let own = if variable < nx {
                None
            } else if variable < 2 * nx {
                Some(variable - nx)
            } else {
                variable.checked_sub(nx + nz).filter(|_| variable >= 2 * nx + nz)
            };
            let own = own.filter(|&own| own >= nx || Identity::<M>::column(own).is_none());
            if let Some(element) = own.and_then(|own| row.as_mut().get_mut(own)) {
                *element = one;
            }
            if variable >= 2 * nx + nz {
                continue;
            }
            let unknown = if variable < nx { variable } else { variable - nx };
            panels!(M::STRUCTURE.directions.len(), E, S, column, W => {
                let (dy, _) = panel::<E, W>(dy, column, nk * S).as_chunks::<S>();
                let v = panel::<E, W>(v, column, nx);
                let mut values = [zero; W];
                if let Some(packet) = dy.get(unknown) {
                    match (v.get(unknown), coefficients.a.get(stage)) {
                        (Some(v), Some(a)) if (nx..2 * nx).contains(&variable) => {
                            values = *v;
                            for (&a, dk) in a.iter().zip(packet) {
                                A::subtract_row(&mut values, -(h * a), dk);
                            }
                        }
                        _ => values = packet.get(stage).copied().unwrap_or(values),
                    }
                }
                for (c, &value) in values.iter().enumerate() {
                    let direction = M::STRUCTURE.directions.get(column + c);
                    if let Some(element) =
                        direction.and_then(|&direction| row.as_mut().get_mut(direction as usize))
                    {
                        *element = value;
                    }
                }
            });
        }
    }
}

/// `V + Σ_i weight_i dy_i`, panels to matrices.
struct Write<'a, M, E, D, G, const S: usize, const ALGEBRAIC: bool> {
    v: Option<&'a [E]>,
    dy: &'a [E],
    weights: &'a [E; S],
    to: &'a mut G,
    of: PhantomData<(M, D)>,
}

impl<M: Dae, E: Lanes, D: Directions<E>, G: Target<E>, const S: usize, const ALGEBRAIC: bool> Kernel
    for Write<'_, M, E, D, G, S, ALGEBRAIC>
{
    type Number = E;
    type Output = E;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> E {
        let Self { v, dy, weights, to, .. } = self;
        let (nx, nk) = (M::Shape::NX, M::Shape::NK);
        let unknowns = if ALGEBRAIC { nx..nk } else { 0..nx };
        let mut minus_weights = *weights;
        for weight in &mut minus_weights {
            *weight = -*weight;
        }
        let mut sum = E::from_f64(0.0);
        panels!(D::COUNT, E, S, column, W => {
            let v = v.map(|v| panel::<E, W>(v, column, nx)).filter(|v| v.len() == unknowns.len());
            let (dy, _) = panel::<E, W>(dy, column, nk * S).as_chunks::<S>();
            let unknowns = unknowns.clone();
            let columns = Columns { start: v, ones: &[], dy, unknowns, minus_weights: &minus_weights };
            sum = sum + columns.write::<A>(&mut to.columns::<W>(column));
        });
        // Nothing times what is not finite is not a number.
        E::from_f64(0.0) * sum
    }
}

/// `V + Σ_i weight_i dy_i` of a panel.
pub(in crate::irk) struct Columns<'a, E, const S: usize, const W: usize> {
    /// What is added to. Nothing stands for zero, or for the unit matrix.
    pub start: Option<&'a [[E; W]]>,
    /// In which row each column of the unit matrix has its one; empty without one.
    pub ones: &'a [u32],
    /// The derivatives of the stages.
    pub dy: &'a [Packet<E, S, W>],
    /// The unknown of each row.
    pub unknowns: Range<usize>,
    /// `−weight_i`
    pub minus_weights: &'a [E; S],
}

/// So many rows are computed before they are written, each number to its column.
const ROWS: usize = 4;

impl<E: Lanes, const S: usize, const W: usize> Columns<'_, E, S, W> {
    /// Writes its columns; their sum, which is finite only if all of them are.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub fn write<A: Arithmetic>(&self, to: &mut [&mut [E]; W]) -> E {
        let mut sums = [E::from_f64(0.0); W];
        let (blocks, rest) = self.dy.get(self.unknowns.clone()).unwrap_or_default().as_chunks::<ROWS>();
        for (n, dy) in blocks.iter().enumerate() {
            self.rows::<A, ROWS>(n * ROWS, dy, to, &mut sums);
        }
        for (n, dy) in rest.iter().enumerate() {
            self.rows::<A, 1>(blocks.len() * ROWS + n, core::array::from_ref(dy), to, &mut sums);
        }
        for (to, &row) in to.iter_mut().zip(self.ones) {
            if let Some(one) = to.get_mut(row as usize) {
                *one = *one + E::from_f64(1.0);
            }
        }
        let mut sum = E::from_f64(0.0);
        for element in sums {
            sum = sum + element;
        }
        sum
    }

    /// Some rows.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn rows<A: Arithmetic, const R: usize>(
        &self,
        begin: usize,
        dy: &[Packet<E, S, W>; R],
        to: &mut [&mut [E]; W],
        sums: &mut [E; W],
    ) {
        let v = self.start.and_then(|v| v.get(begin..)?.first_chunk::<R>());
        let mut rows = v.copied().unwrap_or([[E::from_f64(0.0); W]; R]);
        for (row, dk) in rows.iter_mut().zip(dy) {
            for (&weight, dk) in self.minus_weights.iter().zip(dk) {
                A::subtract_row(row, weight, dk);
            }
            for (sum, &element) in sums.iter_mut().zip(&*row) {
                *sum = *sum + element;
            }
        }
        // Of numbers that are not registers themselves four by four are exchanged in registers.
        let squares = if const { size_of::<E>() <= 8 && R == ROWS } { W / ROWS } else { 0 };
        for square in 0..squares {
            let mut numbers = [[E::from_f64(0.0); ROWS]; ROWS];
            for (to, row) in numbers.iter_mut().zip(&rows) {
                if let Some(row) = row.as_chunks::<ROWS>().0.get(square) {
                    *to = *row;
                }
            }
            let numbers = A::transposed(&numbers);
            for (to, numbers) in to.iter_mut().skip(square * ROWS).zip(&numbers) {
                if let Some(to) = to.get_mut(begin..begin + ROWS) {
                    to.copy_from_slice(numbers);
                }
            }
        }
        for (c, to) in to.iter_mut().enumerate().skip(squares * ROWS) {
            if let Some(to) = to.get_mut(begin..begin + R) {
                for (to, row) in to.iter_mut().zip(&rows) {
                    *to = row[c];
                }
            }
        }
    }
}
