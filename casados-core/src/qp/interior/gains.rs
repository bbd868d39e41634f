//! Gains `K = M_xu M_uu⁻¹`: `u = −Kᵀ x − M_uu⁻¹ g_u` and `p = g_x − K g_u` are one product each
//! from stage to stage. Substitutions with the factor would be a chain of dependent operations.
//! Firmware has no memory for gains.

use super::cholesky::{eliminate, triangle};
use super::kernels::{Columns, Source, difference, lanes, splat};
use super::riccati::{GAINS, Riccati};
use crate::qp::layout::{StageOffsets, copy_common, part, part_mut};
use crate::scalar::{Packed, Real};

impl<T: Real> Riccati<'_, T> {
    /// Computes the gains of a stage from its factors `(K L; L)`.
    #[inline(always)]
    pub fn write_gains<E: Packed<T>>(&mut self, place: &StageOffsets) {
        let StageOffsets { nx, nu, ld, .. } = *place;
        let panel = part(self.panels, place.factor, ld * nu);
        let inverse = part(self.inverse, place.v + nx, nu);
        let gains = part_mut(self.gains, place.factor, ld * nu);
        match nu {
            1 => return gains_of_group::<T, E, 1>(gains, panel, ld, nx, inverse),
            2 => return gains_of_group::<T, E, 2>(gains, panel, ld, nx, inverse),
            3 => return gains_of_group::<T, E, 3>(gains, panel, ld, nx, inverse),
            4 => return gains_of_group::<T, E, 4>(gains, panel, ld, nx, inverse),
            _ => {}
        }
        for register in 0..nx.div_ceil(E::LANES) {
            let begin = register * E::LANES;
            for (column, &inverse) in inverse.iter().enumerate().rev() {
                let (own, done) = gains.split_at_mut_checked((column + 1) * ld).unwrap_or_default();
                let Some(cell) = E::cells(part(panel, column * ld + begin, E::LANES)).first() else { return };
                let mut sum = E::load(cell);
                let factors = part(panel, column * ld + nx + column + 1, nu - column - 1);
                for (done, &factor) in done.chunks_exact(ld).zip(factors) {
                    let Some(cell) = E::cells(done).get(register) else { return };
                    sum = sum.minus_product(E::load(cell), splat(factor));
                }
                sum = sum * splat(inverse);
                if nx - begin < E::LANES {
                    // Rows of the factor `L` become zero.
                    sum = E::select(lanes::<T, E>(0, nx - begin), sum, E::from_f64(0.0));
                }
                let own = part_mut(own, column * ld + begin, E::LANES);
                if let Some(cell) = E::cells_mut(own).first_mut() {
                    sum.store(cell);
                }
            }
        }
    }

    /// Returns the gradient of a stage after elimination of its controls.
    #[inline(always)]
    pub fn eliminate_controls<E: Packed<T>>(&mut self, place: &StageOffsets, gradient: &[T]) -> &[T] {
        let StageOffsets { nx, nu, ld, .. } = *place;
        let left = part_mut(self.g, 0, ld);
        if const { GAINS } {
            let (own, gains) = (Columns { data: gradient, ld }, part(self.gains, place.factor, ld * nu));
            let gains = Columns { data: gains, ld };
            difference::<T, E>(left, Source::Matrix(own), gains, part(gradient, nx, nu), (nx, nu));
        } else {
            copy_common(left, gradient);
            let panel = part(self.panels, place.factor, ld * place.pivots);
            let inverse = part(self.inverse, place.v + nx, nu);
            eliminate::<T, E>(left, panel, ld, inverse, part_mut(self.y, place.v + nx, nu), nx);
        }
        left
    }
}

/// Computes the gains of `W` controls, whose factor is in registers.
#[inline(always)]
fn gains_of_group<T: Real, E: Packed<T>, const W: usize>(
    gains: &mut [T],
    panel: &[T],
    ld: usize,
    nx: usize,
    inverse: &[T],
) {
    let (Some(block), Some(inverse)) = (triangle::<T, W>(panel, ld, nx), inverse.first_chunk::<W>()) else {
        return;
    };
    let (from, to, ld) = (E::cells(panel), E::cells_mut(gains), ld / E::LANES);
    for register in 0..nx.div_ceil(E::LANES) {
        let mut values = [E::from_f64(0.0); W];
        for j in (0..W).rev() {
            let Some(cell) = from.get(j * ld + register) else { return };
            values[j] = E::load(cell);
            for i in j + 1..W {
                values[j] = values[j].minus_product(values[i], splat::<T, E>(block[j][i]));
            }
            values[j] = values[j] * splat::<T, E>(inverse[j]);
        }
        let states = nx - register * E::LANES;
        for (j, value) in values.iter().enumerate() {
            let Some(cell) = to.get_mut(j * ld + register) else { return };
            let none = E::from_f64(0.0);
            let value =
                if states < E::LANES { E::select(lanes::<T, E>(0, states), *value, none) } else { *value };
            value.store(cell);
        }
    }
}
