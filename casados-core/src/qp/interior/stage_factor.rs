//! The factorisation of a stage.

use super::cholesky::{Pivots, cholesky};
use super::kernels::{Columns, Part, Source, copy, mirror, product};
use super::riccati::{Equations, InitialStateKind, Riccati};
use super::shared::Shared;
use crate::qp::element::add;
use crate::qp::error::QpError;
use crate::qp::layout::{StageOffsets, padded_len, part, part_mut};
use crate::scalar::{Packed, Real};

impl<T: Real> Riccati<'_, T> {
    /// Computes `M`, its factors, and `P`.
    #[inline(always)]
    pub fn factor_stage<E: Packed<T>>(
        &mut self,
        place: &StageOffsets,
        equations: &Equations<'_, T>,
        scratch: &mut [T],
        shared: &mut Shared<'_, T>,
    ) -> Result<(), QpError> {
        self.assemble::<E>(place, equations);
        shared.extract_shared_controls(place, self.m);
        let StageOffsets { nx, nu, n, ld, stage, .. } = *place;
        let Equations { qp, first, indefinite, .. } = *equations;
        let largest = self.largest;
        let inverse = part_mut(self.inverse, place.v, ld);
        let added = part_mut(self.added, place.v, ld);
        let panel = part_mut(self.m, nx * ld, nu * ld);
        let (inverse, added) = (part_mut(inverse, nx, nu), part_mut(added, nx, nu));
        let pivots = Pivots { inverse, added, largest, indefinite };
        let (regularised, negative) = cholesky::<T, E>(panel, ld, nx, n, pivots);
        self.regularised += regularised;
        let kept = part_mut(self.panels, place.factor, ld * place.pivots);
        copy::<T, E>(part_mut(kept, 0, nu * ld), panel);
        match negative {
            Some((index, pivot)) if indefinite => {
                return Err(QpError::NotConvex { stage, index, pivot: pivot.to_f64() });
            }
            Some(found) => self.verify(qp, place, found, scratch)?,
            None => {}
        }
        let kept = part_mut(self.panels, place.factor, ld * place.pivots);
        let (before, _) = self.m.split_at_checked(nx * ld).unwrap_or_default();
        if stage == 0 && first == InitialStateKind::Fixed {
            return Ok(());
        }
        let panel = Columns { data: part(kept, 0, nu * ld), ld };
        let ld_x = padded_len::<T>(nx);
        let source = Source::Matrix(Columns { data: before, ld });
        product::<T, E>(self.p, ld_x, source, panel, panel, (nx, 0..nx, nu), Part::Lower);
        if indefinite {
            // Columns with a negative pivot were subtracted, but must be added.
            let inverse = part(self.inverse, place.v + nx, nu);
            let columns = panel.data.chunks_exact(ld.max(1)).zip(inverse);
            for (column, _) in columns.filter(|(_, inverse)| **inverse < T::ZERO) {
                self.negative += 1;
                for (p, &factor) in self.p.chunks_exact_mut(ld_x.max(1)).zip(column).take(nx) {
                    let twice = factor + factor;
                    for (p, &c) in p.iter_mut().zip(column).take(nx) {
                        *p = *p + twice * c;
                    }
                }
            }
        }
        if stage > 0 || first == InitialStateKind::Coupled {
            mirror::<T, E>(self.p, ld_x, nx);
            return Ok(());
        }
        let start = part_mut(kept, nu * ld, nx * ld);
        for (start, p) in start.chunks_exact_mut(ld.max(1)).zip(self.p.chunks_exact(ld_x.max(1))) {
            for (start, &p) in start.iter_mut().zip(p) {
                *start = p;
            }
        }
        let (inverse, added) = (part_mut(self.inverse, place.v, nx), part_mut(self.added, place.v, nx));
        let (regularised, negative) =
            cholesky::<T, E>(start, ld, 0, nx, Pivots { inverse, added, largest, indefinite: false });
        self.regularised += regularised;
        match negative {
            Some((index, pivot)) => self.verify(qp, place, (nu + index, pivot), scratch),
            None => Ok(()),
        }
    }

    /// Assembles `M`: the columns of controls except the upper triangle among controls, and the
    /// lower triangle of the columns of states.
    #[inline(always)]
    fn assemble<E: Packed<T>>(&mut self, place: &StageOffsets, equations: &Equations<'_, T>) {
        let StageOffsets { nx, nu, n, ng, ld, next, ld_next, stage, .. } = *place;
        let Equations { qp, first, objective, .. } = *equations;
        let data = part(qp.data, place.data, place.data_len());
        let weights = part(equations.weights, place.row, place.rows);
        let matrix = Columns { data: part(data, 0, place.matrix()), ld };
        let hessian = if objective { part(data, place.matrix(), place.hessian()) } else { &[] };
        let source = Source::Matrix(Columns { data: hessian, ld });
        let p = Columns { data: &*self.p, ld: ld_next };
        product::<T, E>(self.w, ld, Source::Zero, matrix, p, (n, 0..next, next), Part::Full);
        for (i, &weight) in part(weights, ld, ng).iter().enumerate() {
            let column = (next + i) * ld;
            for (w, &c) in part_mut(self.w, column, ld).iter_mut().zip(part(matrix.data, column, ld)) {
                *w = -c * weight;
            }
        }
        let w = Columns { data: &*self.w, ld };
        // Columns are computed in groups of four. The first group with a control is computed
        // completely.
        let whole = nx / 4 * 4;
        if stage > 0 || first != InitialStateKind::Fixed {
            product::<T, E>(self.m, ld, source, matrix, w, (nx, 0..whole, next + ng), Part::Lower);
        }
        product::<T, E>(self.m, ld, source, matrix, w, (n, whole..n, next + ng), Part::Full);
        // The Hessian has its lower triangle only; the mixed block is controls times states.
        let mixed = part_mut(self.m, nx * ld, nu * ld);
        for (i, row) in hessian.chunks(ld.max(1)).take(nx).enumerate() {
            let mut index = i;
            for &s in part(row, nx, nu) {
                add(mixed, index, s);
                index += ld;
            }
        }
        let (mut largest, mut rest) = (self.largest, &mut *self.m);
        for &weight in part(weights, 0, n) {
            if let Some(diagonal) = rest.first_mut() {
                *diagonal = *diagonal + weight;
                largest = diagonal.abs().max(largest);
            }
            rest = rest.get_mut(ld + 1..).unwrap_or_default();
        }
        self.largest = largest;
    }
}
