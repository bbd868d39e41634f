//! The Cholesky factor of the controls of a stage, and substitutions with it.
//!
//! Where pivots of either sign are allowed, `M_uu = L S Lᵀ` with signs `S`, which the reciprocals
//! of pivots have.

use super::kernels::{Columns, Part, Source, product, scale, subtract_column};
use crate::qp::layout::part;
use crate::scalar::{Packed, Real};

/// `y = L⁻¹ g_u`, and `g − (K; L) S y` for what is left; `S` are the signs of pivots, which their
/// reciprocals have.
#[inline(always)]
pub fn eliminate<T: Real, E: Packed<T>>(
    g: &mut [T],
    panel: &[T],
    ld: usize,
    inverse: &[T],
    y: &mut [T],
    row: usize,
) {
    for (i, ((column, &inverse), y)) in panel.chunks_exact(ld.max(1)).zip(inverse).zip(y).enumerate() {
        let signed = g.get(row + i).map_or(T::ZERO, |&g| g * inverse);
        *y = if inverse < T::ZERO { -signed } else { signed };
        subtract_column::<T, E>(g, signed, column);
    }
}

/// `u = −L⁻ᵀ u`, where `L` begins at some row of its panel.
#[inline(always)]
pub fn substitute<T: Real>(u: &mut [T], panel: &[T], ld: usize, row: usize, inverse: &[T]) {
    for i in (0..u.len()).rev() {
        let column = part(panel, i * ld + row, u.len());
        let (before, after) = u.split_at_mut_checked(i + 1).unwrap_or_default();
        let Some(here) = before.last_mut() else { return };
        let below = column.get(i + 1..).unwrap_or_default();
        let sum = below.iter().zip(&*after).fold(-*here, |sum, (&l, &u)| sum - l * u);
        *here = inverse.get(i).map_or(T::ZERO, |&inverse| sum * inverse);
    }
}

/// `d` with `d_index = 1` and `L₁₁ᵀ d₁ = −l` before it, for the factors of the variables before
/// `index`.
pub fn unit<T: Real>(d: &mut [T], panel: &[T], ld: usize, row: usize, inverse: &[T], index: usize) {
    if let Some(d) = d.get_mut(index) {
        *d = T::ONE;
    }
    for i in (0..index).rev() {
        let column = part(panel, i * ld + row, index + 1);
        let sum = column.iter().zip(&*d).skip(i + 1).fold(T::ZERO, |sum, (&l, &d)| sum - l * d);
        if let (Some(d), Some(&inverse)) = (d.get_mut(i), inverse.get(i)) {
            *d = sum * inverse;
        }
    }
}

/// What is kept of pivots.
pub struct Pivots<'a, T> {
    pub inverse: &'a mut [T],
    pub added: &'a mut [T],
    /// The largest element of the diagonal.
    pub largest: T,
    /// Whether negative pivots are pivots like others.
    pub indefinite: bool,
}

/// The Cholesky factor of a symmetric matrix, whose diagonal begins at some row of a panel; the
/// other rows of the panel are multiplied by `L⁻ᵀ`. Returns how many pivots vanished, and were
/// replaced by something large: the solution then does not move in their direction. And the first
/// of them that is negative, which may be rounding, and its index.
#[inline(always)]
pub fn cholesky<T: Real, E: Packed<T>>(
    panel: &mut [T],
    ld: usize,
    row: usize,
    rows: usize,
    pivots: Pivots<'_, T>,
) -> (usize, Option<(usize, T)>) {
    let Pivots { inverse, added, largest, indefinite } = pivots;
    let mut signed = false;
    let (mut regularised, mut negative) = (0, None);
    let noise = T::from_f64(T::EPSILON * 4.0) * T::from_whole(rows);
    for (diagonal, inverse) in
        panel.get(row..).unwrap_or_default().iter().step_by((ld + 1).max(1)).zip(&mut *inverse)
    {
        *inverse = *diagonal;
    }
    let count = inverse.len();
    let mut begin = 0;
    while begin < count {
        // Rows of a product begin at a multiple of its width.
        let width = (count - begin).min(4 - (row + begin) % 4);
        let (done, group) = panel.split_at_mut_checked(begin * ld).unwrap_or_default();
        if signed {
            for (done, &inverse) in done.chunks_exact(ld.max(1)).zip(&*inverse) {
                for (i, column) in group.chunks_exact_mut(ld.max(1)).enumerate().take(width) {
                    let factor = done.get(row + begin + i).copied().unwrap_or(T::ZERO);
                    let factor = if inverse < T::ZERO { -factor } else { factor };
                    subtract_column::<T, E>(column, factor, done);
                }
            }
        } else if begin > 0 {
            let done = Columns { data: &*done, ld };
            let y = done.below(row + begin);
            product::<T, E>(group, ld, Source::Target, done, y, (rows, 0..width, begin), Part::Full);
        }
        for i in 0..width {
            let (column, rest) =
                group.get_mut(i * ld..).unwrap_or_default().split_at_mut_checked(ld).unwrap_or_default();
            let index = begin + i;
            let (Some(&found), Some(inverse), Some(added)) =
                (column.get(row + index), inverse.get_mut(index), added.get_mut(index))
            else {
                break;
            };
            let mut pivot = found;
            *added = T::ZERO;
            // `inverse` is still what the diagonal was before elimination.
            let is_positive = pivot > noise * *inverse;
            let small = T::from_f64(T::EPSILON).sqrt() * inverse.abs();
            let is_negative = indefinite && pivot < -small;
            if !is_positive && !is_negative {
                if (pivot < T::ZERO || indefinite) && negative.is_none() {
                    negative = Some((index, pivot));
                }
                pivot = if largest > T::ZERO { largest } else { T::ONE };
                *added = pivot - found;
                regularised += 1;
            }
            let size = T::ONE / pivot.abs().sqrt();
            *inverse = if is_negative { -size } else { size };
            signed |= is_negative;
            scale::<T, E>(column, size);
            for (j, other) in rest.chunks_exact_mut(ld.max(1)).take(width - 1 - i).enumerate() {
                let factor = column.get(row + index + 1 + j).copied().unwrap_or(T::ZERO);
                subtract_column::<T, E>(other, if is_negative { -factor } else { factor }, column);
            }
        }
        begin += width;
    }
    (regularised, negative)
}
