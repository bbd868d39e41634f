//! The end of a step of the matrix adjoint: `Λ_n`, and the update of `Λ_w`; see `matrix_adjoint`.
//!
//! ```text
//! Λ_n = Λ_{n+1} − Σ_i (f_x,iᵀ M_i − G_x,i) = (1 − bᵀ A⁻¹ 1) Λ_{n+1} + Σ_i ω_i (f_ẋ,iᵀ M_i − G_ẋ,i)        ω = (hA)⁻¹ 1
//! ```
//!
//! The first form reads the entries of `f_x`. The second follows from `Jᵀ M = …`, which already
//! contains these sums: it reads the entries of `f_ẋ` only, mostly one for each state.

use super::products::StridedMatrix;
use crate::irk::coefficients::Coefficients;
use crate::irk::forward::stage_sensitivities::StageRowLayout;
use crate::linalg::{Arithmetic, PanelRow};
use crate::plan::Plan;
use crate::scalar::Lanes;
use crate::shape::InBounds;

/// `−ω`, and `1 − bᵀ A⁻¹ 1`.
pub(in crate::irk) struct InverseWeights<E, const S: usize> {
    minus_weights: [E; S],
    r_infinity: E,
}

impl<E: Lanes, const S: usize> InverseWeights<E, S> {
    /// Bound of `Σ |b_i (A⁻¹ 1)_i|`, the factor by which rounding errors of `Λ` are multiplied.
    const MAX_GROWTH: f64 = 16.0;

    /// Returns the weights if `A` has an accurate inverse and `h` a finite reciprocal.
    pub fn new(coefficients: &Coefficients<E, S>, h: E) -> Option<Self> {
        let ones = solve_ones(*coefficients.tableau.a());
        let (mut keep, mut size, mut minus_weights) = (1.0, 0.0, [E::from_f64(0.0); S]);
        for ((to, b), one) in minus_weights.iter_mut().zip(coefficients.tableau.b()).zip(ones) {
            keep -= b * one;
            size += (b * one).abs();
            *to = E::from_f64(-one) * h.reciprocal();
        }
        let finite = minus_weights.iter().all(|weight| E::all(weight.is_finite()));
        // The comparison is false for values that are not numbers.
        (finite && size <= Self::MAX_GROWTH).then_some(Self { minus_weights, r_infinity: E::from_f64(keep) })
    }
}

/// Computes `A⁻¹ 1` by Gaussian elimination with row pivoting; not finite if `A` is singular.
fn solve_ones<const S: usize>(mut a: [[f64; S]; S]) -> [f64; S] {
    let mut x = [1.0; S];
    for k in 0..S {
        let mut pivot_row = k;
        for i in k + 1..S {
            if a[i][k].abs() > a[pivot_row][k].abs() {
                pivot_row = i;
            }
        }
        a.swap(k, pivot_row);
        x.swap(k, pivot_row);
        let row = a[k];
        for i in (0..S).filter(|&i| i != k) {
            let factor = a[i][k] / row[k];
            for (element, pivot) in a[i].iter_mut().zip(row) {
                *element -= factor * pivot;
            }
            x[i] -= factor * x[k];
        }
    }
    for (k, x) in x.iter_mut().enumerate() {
        *x /= a[k][k];
    }
    x
}

/// Updates the columns of `(Λ, Λ_w)` of a panel.
pub(in crate::irk) struct AdvancePanel<'a, 'b, M, E, const S: usize, const W: usize> {
    pub plan: M,
    pub rows: StageRowLayout,
    pub jacobian: &'a [[E; S]],
    pub g: &'a [[E; W]],
    pub m: &'a [PanelRow<E, S, W>],
    /// `(Λ, Λ_w)`
    pub sum: &'a mut StridedMatrix<'b, E>,
    pub column: usize,
    /// Whether the step is the first of the interval: only the lower triangle is used.
    pub is_first: bool,
    /// Whether the step is the last of the interval: `Λ_{n+1} = 0`.
    pub is_last: bool,
    pub inverse: &'a Option<InverseWeights<E, S>>,
    /// Number of entries of the Jacobian, in column order, before the first row of the triangle.
    pub skipped_entries: &'a mut usize,
}

impl<M: Plan, E: Lanes, const S: usize, const W: usize> AdvancePanel<'_, '_, M, E, S, W> {
    #[inline(always)]
    pub fn evaluate<A: Arithmetic>(mut self) {
        let mut row = if self.is_first { self.column } else { 0 };
        if self.plan.facts().has_direct_rates
            && let Some(inverse) = self.inverse
        {
            let mut derivative = 0;
            while let Some(&direction) = self.plan.structure().directions.get(row)
                && (direction as usize) < self.plan.nx()
            {
                self.row_from_derivatives::<A>(inverse, row, direction as usize, &mut derivative);
                row += 1;
            }
        }
        self.rows_from_entries::<A>(row);
    }

    /// Computes the row of a state from `f_ẋ`.
    #[inline(always)]
    fn row_from_derivatives<A: Arithmetic>(
        &mut self,
        inverse: &InverseWeights<E, S>,
        row: usize,
        state: usize,
        derivative: &mut usize,
    ) {
        let mut panel_row = [E::from_f64(0.0); W];
        if !self.is_last
            && let Some(lambda) = row_chunk::<E, W>(self.sum, row, self.column)
        {
            A::subtract_row(&mut panel_row, -inverse.r_infinity, lambda);
        }
        if let Some((equation, _, values)) = self.plan.entry(self.jacobian, state)
            && let Some(m) = self.m.get(self.plan.slot(equation)).in_bounds()
        {
            for ((&weight, &value), m) in inverse.minus_weights.iter().zip(values).zip(m) {
                A::subtract_row(&mut panel_row, weight * value, m);
            }
        }
        while let Some(&of) = self.plan.structure().curved.get(*derivative)
            && of as usize <= state
        {
            for (stage, &weight) in inverse.minus_weights.iter().enumerate() {
                if of as usize == state
                    && let Some(g) = self.g.get(self.rows.row_index::<S>(*derivative, stage))
                {
                    A::subtract_row(&mut panel_row, -weight, g);
                }
            }
            *derivative += 1;
        }
        self.write_row(row, &panel_row);
    }

    /// Computes the rows from `begin` on from the entries of `f_x`, `f_u` and `f_p`.
    #[inline(always)]
    fn rows_from_entries<A: Arithmetic>(&mut self, begin: usize) {
        let plan = self.plan;
        let (mut position, mut row) = (*self.skipped_entries, begin);
        let mut c = plan.facts().nonlinear_before[0];
        while let Some(&direction) = plan.structure().directions.get(row) {
            let variable = variable_of_direction(plan, direction as usize);
            // One accumulator per stage, so that additions do not wait for each other.
            let mut sums = [[E::from_f64(0.0); W]; S];
            if !self.is_last
                && let Some(lambda) = row_chunk::<E, W>(self.sum, row, self.column)
            {
                sums[0] = *lambda;
            }
            // Skips entries of algebraic states and of rows that are not computed.
            while let Some(of) = variable_of_entry(plan, position)
                && of < variable
            {
                position += 1;
            }
            // Later panels skip the same entries.
            if row == begin && (self.is_first || plan.facts().has_direct_rates && self.inverse.is_some()) {
                *self.skipped_entries = position;
            }
            while let Some(&index) = plan.structure().by_column.get(position)
                && let Some((equation, of, values)) = plan.entry(self.jacobian, index as usize)
                && of == variable
            {
                position += 1;
                if let Some(m) = self.m.get(self.plan.slot(equation)).in_bounds() {
                    for ((sum, &value), m) in sums.iter_mut().zip(values).zip(m) {
                        A::subtract_row(sum, value, m);
                    }
                }
            }
            while let Some(&of) = self.plan.structure().curved.get(c)
                && of as usize <= variable
            {
                if of as usize == variable {
                    add_stages::<A, E, S, W>(self.rows, &mut sums, self.g, c);
                }
                c += 1;
            }
            let Some((panel_row, others)) = sums.split_first_mut() else { return };
            for other in others {
                A::subtract_row(panel_row, E::from_f64(-1.0), other);
            }
            let panel_row = *panel_row;
            self.write_row(row, &panel_row);
            row += 1;
        }
    }

    #[inline(always)]
    fn write_row(&mut self, row: usize, panel_row: &[E; W]) {
        if let Some(to) = self.sum.row_mut(row, self.column).and_then(|to| to.first_chunk_mut()) {
            *to = *panel_row;
        }
    }
}

/// The variable of an entry, in column order.
#[inline(always)]
fn variable_of_entry<M: Plan>(plan: M, place: usize) -> Option<usize> {
    let &entry = plan.structure().by_column.get(place)?;
    Some(*plan.structure().jacobian.columns.get(entry as usize)? as usize)
}

/// The variable of a direction.
#[inline(always)]
fn variable_of_direction<M: Plan>(plan: M, direction: usize) -> usize {
    let (nx, nz) = (plan.nx(), plan.nz());
    nx + direction + if direction < nx { 0 } else { nz }
}

/// `W` columns of a row.
#[inline(always)]
pub(in crate::irk) fn row_chunk<'a, E, const W: usize>(
    of: &'a StridedMatrix<'_, E>,
    row: usize,
    column: usize,
) -> Option<&'a [E; W]> {
    of.row(row, column)?.first_chunk()
}

/// `panel_row += G` of a nonlinear variable.
#[inline(always)]
pub(in crate::irk) fn add_stages<A: Arithmetic, E: Lanes, const S: usize, const W: usize>(
    rows: StageRowLayout,
    panel_row: &mut PanelRow<E, S, W>,
    g: &[[E; W]],
    curved: usize,
) {
    for (stage, row) in panel_row.iter_mut().enumerate() {
        if let Some(g) = g.get(rows.row_index::<S>(curved, stage)).in_bounds() {
            A::subtract_row(row, E::from_f64(-1.0), g);
        }
    }
}
