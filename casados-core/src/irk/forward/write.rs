//! What a sweep writes after a step: derivatives at a point of it, and rows of `D` at a stage.

use super::output::{Columns, Target};
use super::sweep::Sweep;
use crate::irk::coefficients::Coefficients;
use crate::irk::directions::{ArrayC, Directions, Identity, all_columns, panel, panels};
use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::model::{ArrayW, Dae};
use crate::scalar::Lanes;
use crate::shape::{Array, Shape};
use core::marker::PhantomData;

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

impl<M: Dae, E: Lanes, const S: usize> Sweep<M, E, ArrayC<M, E>, S> {
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
            panels!(all_columns::<M, E>(), E, S, column, W => {
                let (dy, _) = panel::<E, W>(dy, column, nk * S).as_chunks::<S>();
                let v = panel::<E, W>(v, column, nx);
                let mut values = [zero; W];
                if let Some(panel_row) = dy.get(unknown) {
                    match (v.get(unknown), coefficients.a.get(stage)) {
                        (Some(v), Some(a)) if (nx..2 * nx).contains(&variable) => {
                            values = *v;
                            for (&a, dk) in a.iter().zip(panel_row) {
                                A::subtract_row(&mut values, -(h * a), dk);
                            }
                        }
                        _ => values = panel_row.get(stage).copied().unwrap_or(values),
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
        panels!(D::COLUMNS, E, S, column, W => {
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
