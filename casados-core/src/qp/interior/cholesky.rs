//! The Cholesky factor of the controls of a stage, and substitutions with it.
//!
//! With pivots of either sign, `M_uu = L S Lᵀ`, where the reciprocals of pivots have the signs `S`.

use super::kernels::{Columns, Part, Source, chunk, product, splat, subtract, subtract_column};
use crate::qp::element::set;
use crate::qp::layout::part;
use crate::scalar::{Packed, Real};

/// The number of columns processed together, with their triangle in registers.
const GROUP: usize = 4;

/// Returns `W` rows of `W` columns of a panel, from a row on, by reference.
#[inline(always)]
#[allow(unsafe_code)]
pub fn triangle<T: Real, const W: usize>(panel: &[T], ld: usize, row: usize) -> Option<[&[T; W]; W]> {
    if panel.len() < row + (W - 1) * ld + W {
        return None;
    }
    // SAFETY: `i ≤ W − 1`, and the panel is as long as the last of these chunks needs.
    Some(core::array::from_fn(|i| unsafe { chunk::<_, W>(panel, row + i * ld) }))
}

/// Computes `y = L⁻¹ g_u`, and `g − (K; L) S y` for the elements before `row`; `S` are the signs of
/// the reciprocals of pivots.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn eliminate<T: Real, E: Packed<T>>(
    g: &mut [T],
    panel: &[T],
    ld: usize,
    inverse: &[T],
    y: &mut [T],
    row: usize,
) {
    let (mut panel, mut inverse, mut y, mut row) = (panel, inverse, y, row);
    while !inverse.is_empty() {
        let width = inverse.len().min(if cfg!(feature = "std") { GROUP } else { 1 });
        let last = inverse.len() == width;
        let size = if last { row } else { g.len() };
        match width {
            1 => eliminate_group::<T, E, 1>(g, panel, ld, inverse, y, (row, size)),
            2 => eliminate_group::<T, E, 2>(g, panel, ld, inverse, y, (row, size)),
            3 => eliminate_group::<T, E, 3>(g, panel, ld, inverse, y, (row, size)),
            _ => eliminate_group::<T, E, GROUP>(g, panel, ld, inverse, y, (row, size)),
        }
        if last {
            return;
        }
        panel = panel.get(width * ld..).unwrap_or_default();
        inverse = inverse.get(width..).unwrap_or_default();
        y = y.get_mut(width..).unwrap_or_default();
        row += width;
    }
}

/// As [`eliminate`], for `W` columns and `size` elements of `g`.
#[inline(always)]
fn eliminate_group<T: Real, E: Packed<T>, const W: usize>(
    g: &mut [T],
    panel: &[T],
    ld: usize,
    inverse: &[T],
    y: &mut [T],
    (row, size): (usize, usize),
) {
    let own = g.get(row..).and_then(|own| own.first_chunk::<W>());
    let (Some(block), Some(own)) = (triangle::<T, W>(panel, ld, row), own) else { return };
    let (Some(inverse), Some(y)) = (inverse.first_chunk::<W>(), y.first_chunk_mut::<W>()) else { return };
    let mut signed = *own;
    for i in 0..W {
        for j in 0..i {
            signed[i] = signed[i] - signed[j] * block[j][i];
        }
        signed[i] = signed[i] * inverse[i];
        y[i] = if inverse[i] < T::ZERO { -signed[i] } else { signed[i] };
    }
    if size > 0 {
        subtract::<T, E>(g, Columns { data: panel, ld }, &signed, size, W);
    }
}

/// Computes `u = −L⁻ᵀ u`, where `L` starts at row `row` of its panel.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn substitute<T: Real>(u: &mut [T], panel: &[T], ld: usize, row: usize, inverse: &[T]) {
    match u.len() {
        _ if cfg!(not(feature = "std")) => back_substitute_any(u, panel, ld, row, inverse),
        1 => back_substitute_fixed::<T, 1>(u, panel, ld, row, inverse),
        2 => back_substitute_fixed::<T, 2>(u, panel, ld, row, inverse),
        3 => back_substitute_fixed::<T, 3>(u, panel, ld, row, inverse),
        GROUP => back_substitute_fixed::<T, GROUP>(u, panel, ld, row, inverse),
        _ => back_substitute_any(u, panel, ld, row, inverse),
    }
}

/// As [`substitute`], for `W` elements.
#[inline(always)]
fn back_substitute_fixed<T: Real, const W: usize>(
    u: &mut [T],
    panel: &[T],
    ld: usize,
    row: usize,
    inverse: &[T],
) {
    let (Some(block), Some(u)) = (triangle::<T, W>(panel, ld, row), u.first_chunk_mut::<W>()) else { return };
    let Some(inverse) = inverse.first_chunk::<W>() else { return };
    for i in (0..W).rev() {
        let mut sum = -u[i];
        for j in i + 1..W {
            sum = sum - block[i][j] * u[j];
        }
        u[i] = sum * inverse[i];
    }
}

/// As [`substitute`], for any number of elements.
#[inline(always)]
fn back_substitute_any<T: Real>(u: &mut [T], panel: &[T], ld: usize, row: usize, inverse: &[T]) {
    for i in (0..u.len()).rev() {
        let column = part(panel, i * ld + row, u.len());
        let (before, after) = u.split_at_mut_checked(i + 1).unwrap_or_default();
        let Some(here) = before.last_mut() else { return };
        let below = column.get(i + 1..).unwrap_or_default();
        let sum = below.iter().zip(&*after).fold(-*here, |sum, (&l, &u)| sum - l * u);
        *here = inverse.get(i).map_or(T::ZERO, |&inverse| sum * inverse);
    }
}

/// Computes `d` with `d_index = 1` and `L₁₁ᵀ d₁ = −l` before it, for the factors of the variables
/// before `index`.
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

/// The results for the pivots.
pub struct Pivots<'a, T> {
    pub inverse: &'a mut [T],
    pub added: &'a mut [T],
    /// The largest element of the diagonal.
    pub largest: T,
    /// Whether negative pivots are accepted.
    pub indefinite: bool,
}

/// Computes the Cholesky factor of a symmetric matrix, whose diagonal starts at row `row` of a
/// panel; the other rows of the panel are multiplied by `L⁻ᵀ`. Returns the number of vanishing
/// pivots, which are replaced by large numbers so that the solution has no component in their
/// direction, and the index and value of the first negative one, which may be a rounding error.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
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
        // Rows of a product start at multiples of its width.
        let width = (count - begin).min(GROUP - (row + begin) % GROUP);
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
        let group = (group, ld, row + begin);
        let last = begin + width;
        let pivots = Pivots {
            inverse: inverse.get_mut(begin..last).unwrap_or_default(),
            added: added.get_mut(begin..last).unwrap_or_default(),
            largest,
            indefinite,
        };
        let found = match width {
            // Firmware has one copy: code size matters more than passes over a column.
            _ if cfg!(not(feature = "std")) => factor_columns::<T, E>(group, width, rows, noise, pivots),
            1 => factor_group::<T, E, 1>(group, rows, noise, pivots),
            2 => factor_group::<T, E, 2>(group, rows, noise, pivots),
            3 => factor_group::<T, E, 3>(group, rows, noise, pivots),
            _ => factor_group::<T, E, GROUP>(group, rows, noise, pivots),
        };
        regularised += found.regularised;
        signed |= found.signed;
        negative = negative.or(found.negative.map(|(index, pivot)| (begin + index, pivot)));
        begin += width;
    }
    (regularised, negative)
}

/// The results for the pivots of a group.
struct PivotReport<T> {
    regularised: usize,
    negative: Option<(usize, T)>,
    signed: bool,
}

/// Factorises the columns of a group, one after the other.
#[inline(always)]
fn factor_columns<T: Real, E: Packed<T>>(
    (group, ld, first): (&mut [T], usize, usize),
    width: usize,
    rows: usize,
    noise: T,
    Pivots { inverse, added, largest, indefinite }: Pivots<'_, T>,
) -> PivotReport<T> {
    let mut all = PivotReport { regularised: 0, negative: None, signed: false };
    let mut rest = group;
    for (i, (inverse, added)) in inverse.chunks_mut(1).zip(added.chunks_mut(1)).enumerate() {
        let (column, others) = rest.split_at_mut_checked(ld).unwrap_or_default();
        let pivot = Pivots { inverse, added, largest, indefinite };
        let found = factor_group::<T, E, 1>((&mut *column, ld, first + i), rows, noise, pivot);
        let factors = column.get(first + i + 1..).unwrap_or_default();
        let left = others.chunks_exact_mut(ld.max(1)).zip(factors).take(width.saturating_sub(i + 1));
        for (other, &factor) in left {
            subtract_column::<T, E>(other, if found.signed { -factor } else { factor }, column);
        }
        all.regularised += found.regularised;
        all.signed |= found.signed;
        all.negative = all.negative.or(found.negative.map(|(_, pivot)| (i, pivot)));
        rest = others;
    }
    all
}

/// Eliminates pivot `I` of a block of `W`. `inverse` has the diagonal before elimination, and the
/// reciprocal of the pivot afterwards.
#[inline(always)]
fn eliminate_pivot<T: Real, const W: usize, const I: usize>(
    block: &mut [[T; W]; W],
    noise: T,
    pivots: &mut Pivots<'_, T>,
    found: &mut PivotReport<T>,
) {
    let (Some(&column), Some(&mut before)) = (block.get(I), pivots.inverse.get_mut(I)) else { return };
    let mut pivot = column.get(I).copied().unwrap_or(T::ZERO);
    // NaN is not positive.
    let is_positive = pivot > noise * before;
    if !is_positive {
        pivot = other_pivot(I, (pivot, before), pivots, found);
    }
    // The next pivot depends on this quotient, not on a square root.
    let inverse = T::ONE / pivot;
    set(pivots.inverse, I, inverse);
    for j in I + 1..W {
        let factor = column[j] * inverse;
        for i in j..W {
            block[j][i] = block[j][i] - factor * column[i];
        }
    }
}

/// Returns the replacement of a pivot that is not positive; `before` is the diagonal before
/// elimination. A negative pivot stays if `indefinite`, otherwise it becomes a large number.
#[cold]
#[inline(never)]
fn other_pivot<T: Real>(
    index: usize,
    (pivot, before): (T, T),
    pivots: &mut Pivots<'_, T>,
    found: &mut PivotReport<T>,
) -> T {
    let small = T::from_f64(T::EPSILON).sqrt() * before.abs();
    if pivots.indefinite && pivot < -small {
        found.signed = true;
        return pivot;
    }
    if (pivot < T::ZERO || pivots.indefinite) && found.negative.is_none() {
        found.negative = Some((index, pivot));
    }
    let replaced = if pivots.largest > T::ZERO { pivots.largest } else { T::ONE };
    set(pivots.added, index, replaced - pivot);
    found.regularised += 1;
    replaced
}

/// Factorises `W` columns of a panel after earlier columns were subtracted: their diagonal block
/// starts at row `first`. The block is factorised first, then all rows are multiplied by its `L⁻ᵀ`
/// in registers. `inverse` has the diagonal before elimination.
#[inline(always)]
#[allow(unsafe_code)]
fn factor_group<T: Real, E: Packed<T>, const W: usize>(
    (group, ld, first): (&mut [T], usize, usize),
    rows: usize,
    noise: T,
    Pivots { inverse, added, largest, indefinite }: Pivots<'_, T>,
) -> PivotReport<T> {
    let mut found = PivotReport { regularised: 0, negative: None, signed: false };
    let Some(columns) = triangle::<T, W>(group, ld, first) else { return found };
    let mut block = [[T::ZERO; W]; W];
    for j in 0..W {
        for i in j..W {
            block[j][i] = columns[j][i];
        }
    }
    if let Some(added) = added.first_chunk_mut::<W>() {
        *added = [T::ZERO; W];
    }
    let mut pivots = Pivots { inverse, added, largest, indefinite };
    // Straight-line code keeps the block in registers.
    eliminate_pivot::<T, W, 0>(&mut block, noise, &mut pivots, &mut found);
    if W > 1 {
        eliminate_pivot::<T, W, 1>(&mut block, noise, &mut pivots, &mut found);
    }
    if W > 2 {
        eliminate_pivot::<T, W, 2>(&mut block, noise, &mut pivots, &mut found);
    }
    if W > 3 {
        eliminate_pivot::<T, W, 3>(&mut block, noise, &mut pivots, &mut found);
    }
    let Some(inverse) = pivots.inverse.first_chunk_mut::<W>() else { return found };
    for j in 0..W {
        let size = inverse[j].abs().sqrt();
        inverse[j] = if inverse[j] < T::ZERO { -size } else { size };
        for i in j + 1..W {
            block[j][i] = block[j][i] * size;
        }
    }
    let mut sizes = *inverse;
    if found.signed {
        // The subtracted rows have the signs of pivots.
        for (column, size) in block.iter_mut().zip(&mut sizes) {
            if *size < T::ZERO {
                *column = column.map(|l| -l);
                *size = -*size;
            }
        }
    }
    let (cells, ld, rows) = (E::cells_mut(group), ld / E::LANES, rows.div_ceil(E::LANES));
    if cells.len() < (W - 1) * ld + rows {
        return found;
    }
    for r in 0..rows {
        let mut values = [E::from_f64(0.0); W];
        for (j, value) in values.iter_mut().enumerate() {
            // SAFETY: `j ≤ W − 1` and `r < rows`.
            let [cell] = unsafe { chunk::<_, 1>(cells, j * ld + r) };
            *value = E::load(cell);
        }
        for j in 0..W {
            for i in 0..j {
                values[j] = values[j].minus_product(values[i], splat::<T, E>(block[i][j]));
            }
            values[j] = values[j] * splat::<T, E>(sizes[j]);
        }
        for (j, value) in values.iter().enumerate() {
            if let Some(cell) = cells.get_mut(j * ld + r) {
                value.store(cell);
            }
        }
    }
    found
}
