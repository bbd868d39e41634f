//! Further outputs of a step: derivatives at a point of it, and rows of `D` at a stage.

use super::output::{DerivativeOutput, PanelCombination};
use super::sweep::ForwardSweep;
use crate::irk::coefficients::Coefficients;
use crate::irk::directions::{ArrayC, Directions, column_of, panel, panels, static_columns, total_columns};
use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::memory::Fallback;
use crate::model::{ArrayW, Dae};
use crate::plan::Plan;
use crate::scalar::Lanes;
use crate::shape::{Array, InBounds, Shape};

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> ForwardSweep<M, E, R, S> {
    /// Writes the derivatives of `x` at a point of the step with the `weights` `h b_i(θ)`. This and
    /// the following functions return zero if everything they write is finite, otherwise NaN.
    pub(crate) fn write_differential<P: Plan, D: Directions<E>>(
        &self,
        of: (P, D),
        weights: &[E; S],
        to: &mut impl DerivativeOutput<E>,
    ) -> E {
        self.write_combination::<P, D, _, false>(of, Some(self.v()), weights, to)
    }

    /// Writes the derivatives of `z` at a point of the step with the values `lagrange` of the
    /// Lagrange polynomials.
    pub(crate) fn write_algebraic<P: Plan, D: Directions<E>>(
        &self,
        of: (P, D),
        lagrange: &[E; S],
        to: &mut impl DerivativeOutput<E>,
    ) -> E {
        self.write_combination::<P, D, _, true>(of, None, lagrange, to)
    }

    /// Writes the derivatives of `Σ_i weight_i k_i`.
    #[cfg(feature = "alloc")]
    pub(crate) fn write_slopes<P: Plan, D: Directions<E>>(
        &self,
        of: (P, D),
        weights: &[E; S],
        to: &mut impl DerivativeOutput<E>,
    ) -> E {
        self.write_combination::<P, D, _, false>(of, None, weights, to)
    }

    /// Writes `V + Σ_i weight_i dy_i` of the states or of the algebraic states.
    fn write_combination<P: Plan, D: Directions<E>, G: DerivativeOutput<E>, const ALGEBRAIC: bool>(
        &self,
        (plan, directions): (P, D),
        v: Option<&[E]>,
        weights: &[E; S],
        to: &mut G,
    ) -> E {
        if ALGEBRAIC && M::Shape::NZ == 0 {
            return E::from_f64(0.0);
        }
        dispatch(WriteCombination::<P, E, D, _, S, ALGEBRAIC> {
            plan,
            directions,
            v,
            dy: self.dy(),
            weights,
            to,
        })
    }
}

impl<M: Dae, E: Lanes, const S: usize> ForwardSweep<M, E, ArrayC<M, E>, S> {
    /// Writes the rows of `D` at a stage for some variables, over all directions.
    pub(crate) fn write_stage_rows<F: Fallback>(
        &self,
        coefficients: &Coefficients<E, S>,
        h: E,
        stage: usize,
        variables: &[u32],
        d: &mut [ArrayW<M, E>],
    ) {
        let (v, dy) = (self.v(), self.dy());
        let (plan, columns) = (F::plan::<M>(), const { total_columns::<M, E, F>() });
        let d = ArrayW::<M, E>::flat_mut(d);
        dispatch(WriteStageRows { plan, columns, v, dy, coefficients, h, stage, variables, d });
    }
}

/// See [`ForwardSweep::write_stage_rows`].
struct WriteStageRows<'a, M, E: Lanes, const S: usize> {
    plan: M,
    /// Number of columns of all directions.
    columns: usize,
    v: &'a [E],
    dy: &'a [E],
    coefficients: &'a Coefficients<E, S>,
    h: E,
    stage: usize,
    variables: &'a [u32],
    /// One row per variable.
    d: &'a mut [E],
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for WriteStageRows<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { plan, columns, v, dy, coefficients, h, stage, variables, d } = self;
        let (nx, nz, nk, nw) = (plan.nx(), plan.nz(), plan.nk(), plan.nw());
        let (zero, one) = (E::from_f64(0.0), E::from_f64(1.0));
        for &variable in variables {
            let variable = variable as usize;
            let Some(row) = d.get_mut(variable * nw..(variable + 1) * nw).in_bounds() else { continue };
            row.fill(zero);
            // A state or an input without influence on the model has the derivative one with
            // respect to itself.
            let own_direction = if variable < nx {
                None
            } else if variable < 2 * nx {
                Some(variable - nx)
            } else {
                variable.checked_sub(nx + nz).filter(|_| variable >= 2 * nx + nz)
            };
            let own_direction = own_direction.filter(|&own| own >= nx || column_of(plan, own).is_none());
            if let Some(element) = own_direction.and_then(|own| row.get_mut(own).in_bounds()) {
                *element = one;
            }
            if variable >= 2 * nx + nz {
                continue;
            }
            let unknown = if variable < nx { variable } else { variable - nx };
            panels!([static_columns::<M, E>(), columns], E, S, column, W => {
                let (dy, _) = panel::<E, W>(dy, column, nk * S).as_chunks::<S>();
                let v = panel::<E, W>(v, column, nx);
                let mut values = [zero; W];
                if let Some(panel_row) = dy.get(unknown).in_bounds() {
                    match (v.get(unknown), coefficients.a.get(stage)) {
                        (Some(v), Some(a)) if (nx..2 * nx).contains(&variable) => {
                            values = *v;
                            for (&a, dk) in a.iter().zip(panel_row) {
                                A::subtract_row(&mut values, -(h * a), dk);
                            }
                        }
                        _ => values = panel_row.get(stage).in_bounds().copied().unwrap_or(values),
                    }
                }
                for (c, &value) in values.iter().enumerate() {
                    let direction = plan.structure().directions.get(column + c);
                    if let Some(element) =
                        direction.and_then(|&direction| row.get_mut(direction as usize).in_bounds())
                    {
                        *element = value;
                    }
                }
            });
        }
    }
}

/// `V + Σ_i weight_i dy_i`, from panels to matrices.
struct WriteCombination<'a, P, E, D, G, const S: usize, const ALGEBRAIC: bool> {
    plan: P,
    directions: D,
    v: Option<&'a [E]>,
    dy: &'a [E],
    weights: &'a [E; S],
    to: &'a mut G,
}

impl<P: Plan, E: Lanes, D: Directions<E>, G: DerivativeOutput<E>, const S: usize, const ALGEBRAIC: bool>
    Kernel for WriteCombination<'_, P, E, D, G, S, ALGEBRAIC>
{
    type Number = E;
    type Output = E;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> E {
        let Self { plan, directions, v, dy, weights, to } = self;
        let (nx, nk) = (plan.nx(), plan.nk());
        let unknowns = if ALGEBRAIC { nx..nk } else { 0..nx };
        let mut minus_weights = *weights;
        for weight in &mut minus_weights {
            *weight = -*weight;
        }
        let mut sum = E::from_f64(0.0);
        panels!([D::COLUMNS, directions.columns()], E, S, column, W => {
            let v = v.map(|v| panel::<E, W>(v, column, nx)).filter(|v| v.len() == unknowns.len());
            let (dy, _) = panel::<E, W>(dy, column, nk * S).as_chunks::<S>();
            let unknowns = unknowns.clone();
            let columns = PanelCombination { base: v, unit_rows: &[], dy, unknowns, minus_weights: &minus_weights };
            sum = sum + columns.write::<A>(&mut to.columns_mut::<W>(column));
        });
        // Zero times a non-finite number is NaN.
        E::from_f64(0.0) * sum
    }
}
