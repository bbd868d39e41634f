//! Right-hand sides of forward sensitivities, `−(f_x,i V_n + f_w,i)` in the slots of the equations.

use super::directions::{Directions, panel_of};
use super::evaluate::entry;
use crate::linalg::{Arithmetic, AtRow, Packet, each_row, is_short, slot};
use crate::model::Dae;
use crate::scalar::Lanes;
use crate::shape::{Plain, Shape};
use core::marker::PhantomData;

/// `−(f_x,i V_0 + f_w,i)`, where every direction is an element of `w`: entries of the Jacobian go to their places in all panels.
pub(super) struct Scatter<'a, M: Dae, E: Plain, D, const S: usize> {
    pub jacobian: &'a M::Jacobian<[E; S]>,
    pub dy: &'a mut [E],
    pub directions: PhantomData<D>,
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize> AtRow for Scatter<'_, M, E, D, S> {
    /// The entries of `f_x`, `f_z`, `f_u` and `f_p`.
    const ROWS: usize = M::STRUCTURE.blocks[5] - M::STRUCTURE.blocks[1];
    const INSTRUCTIONS: usize = 3 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let nk = M::Shape::NK;
        let Some((r, c, values)) = entry::<M, _>(self.jacobian, M::STRUCTURE.blocks[1] + row) else { return };
        let Some(column) = direction::<M, E, D>(c) else { return };
        let (begin, width) = panel_of::<E>(column, D::COUNT, S);
        let place = begin * nk * S + slot::<M>(r) * S * width + (column - begin);
        for (stage, &value) in values.iter().enumerate() {
            if let Some(to) = self.dy.get_mut(place + stage * width) {
                *to = *to - value;
            }
        }
    }
}

/// The same of a panel that begins with a column: entries column by column, from one of them on. Where the next panel begins.
#[inline(always)]
pub(super) fn place<M: Dae, E: Lanes, D: Directions<E>, const S: usize, const W: usize>(
    jacobian: &M::Jacobian<[E; S]>,
    mut placed: usize,
    dy: &mut [Packet<E, S, W>],
    begin: usize,
) -> usize {
    while let Some(&index) = M::STRUCTURE.by_column.get(placed) {
        let Some((r, c, values)) = entry::<M, _>(jacobian, index as usize) else { break };
        if let Some(column) = direction::<M, E, D>(c) {
            if column >= begin + W {
                break;
            }
            if let Some(packet) = dy.get_mut(slot::<M>(r)) {
                for (row, &value) in packet.iter_mut().zip(values) {
                    if let Some(to) = row.get_mut(column - begin) {
                        *to = *to - value;
                    }
                }
            }
        }
        placed += 1;
    }
    placed
}

/// The direction that a variable other than `ẋ` is, if it is one.
#[inline(always)]
fn direction<M: Dae, E, D: Directions<E>>(variable: usize) -> Option<usize> {
    let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
    if variable < 2 * nx {
        D::column(variable - nx)
    } else if variable < 2 * nx + nz {
        None
    } else {
        D::column(variable - nx - nz)
    }
}

/// `−f_x,i V_n` of a panel.
pub(super) struct Later<'a, M: Dae, E: Plain, const S: usize, const W: usize> {
    pub jacobian: &'a M::Jacobian<[E; S]>,
    pub v: &'a [[E; W]],
    pub dy: &'a mut [Packet<E, S, W>],
}

impl<M: Dae, E: Lanes, const S: usize, const W: usize> Later<'_, M, E, S, W> {
    /// The first entry of `f_x`.
    const FIRST: usize = M::STRUCTURE.blocks[1];

    #[inline(always)]
    pub fn all<A: Arithmetic>(mut self) {
        if const { is_short::<A, Self>() } {
            self.dy.fill([[E::from_f64(0.0); W]; S]);
            each_row::<A, _>(&mut self);
        } else {
            self.row_by_row::<A>();
        }
    }

    /// Each row in registers, and written once; zeros where equations have no states.
    #[inline(always)]
    fn row_by_row<A: Arithmetic>(&mut self) {
        let (mut packet, mut last) = ([[E::from_f64(0.0); W]; S], 0);
        for row in 0..Self::ROWS {
            let Some((r, c, values)) = entry::<M, _>(self.jacobian, Self::FIRST + row) else { return };
            if last != r {
                self.put(last, &packet);
                self.clear(last + 1, r);
                (packet, last) = ([[E::from_f64(0.0); W]; S], r);
            }
            let Some(v) = self.v.get(c - M::Shape::NX) else { return };
            for (row, &value) in packet.iter_mut().zip(values) {
                A::subtract_row(row, value, v);
            }
        }
        self.put(last, &packet);
        self.clear(last + 1, M::Shape::NK);
    }

    /// The row of an equation.
    #[inline(always)]
    fn put(&mut self, equation: usize, packet: &Packet<E, S, W>) {
        if let Some(to) = self.dy.get_mut(slot::<M>(equation)) {
            *to = *packet;
        }
    }

    /// Equations without states.
    #[inline(always)]
    fn clear(&mut self, begin: usize, end: usize) {
        for equation in begin..end {
            self.put(equation, &[[E::from_f64(0.0); W]; S]);
        }
    }
}

impl<M: Dae, E: Lanes, const S: usize, const W: usize> AtRow for Later<'_, M, E, S, W> {
    const ROWS: usize = M::STRUCTURE.blocks[2] - M::STRUCTURE.blocks[1];
    const INSTRUCTIONS: usize = 2 + S * if size_of::<E>() > 8 { 3 * W } else { 4 * W.div_ceil(4) };
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let Some((r, c, values)) = entry::<M, _>(self.jacobian, Self::FIRST + row) else { return };
        let (Some(packet), Some(v)) = (self.dy.get_mut(slot::<M>(r)), self.v.get(c - M::Shape::NX)) else {
            return;
        };
        for (row, &value) in packet.iter_mut().zip(values) {
            A::subtract_row(row, value, v);
        }
    }
}

/// `−f_w,i` of a panel, of controls and parameters.
pub(super) struct Inputs<'a, M: Dae, E: Plain, D, const S: usize, const W: usize> {
    pub jacobian: &'a M::Jacobian<[E; S]>,
    pub directions: &'a D,
    pub dy: &'a mut [Packet<E, S, W>],
    pub column: usize,
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize, const W: usize> AtRow for Inputs<'_, M, E, D, S, W> {
    const ROWS: usize = M::STRUCTURE.blocks[5] - M::STRUCTURE.blocks[3];
    const INSTRUCTIONS: usize = 4 + 2 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let shift = M::Shape::NX + M::Shape::NZ;
        let Some((r, c, values)) = entry::<M, _>(self.jacobian, M::STRUCTURE.blocks[3] + row) else { return };
        let Some(packet) = self.dy.get_mut(slot::<M>(r)) else { return };
        for (row, &value) in packet.iter_mut().zip(values) {
            self.directions.add(c - shift, -value, self.column, row);
        }
    }
}
