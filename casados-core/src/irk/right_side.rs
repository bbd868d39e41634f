//! Right-hand sides of forward sensitivities, `−(f_x,i V_n + f_w,i)` in the slots of the equations.

use super::directions::{Directions, panel_of};
use super::evaluate::entry;
use super::implied::leader;
use crate::linalg::{Arithmetic, AtRow, Packet, each_row, implied, is_implied, is_short, slot};
use crate::model::{Dae, Steady};
use crate::scalar::Lanes;
use crate::shape::{Plain, Shape};
use core::marker::PhantomData;

/// What is known of a [steady](Steady) state, if a state is.
#[inline(always)]
fn steady<M: Dae>(state: usize) -> Option<Steady> {
    let steady = *M::STRUCTURE.elimination.steady.get(state)?;
    (steady.entry != Steady::NONE).then_some(steady)
}

/// Whether a steady state is subtracted from the equation of a slot: one that comes later.
#[inline(always)]
fn is_later<M: Dae>(slot: usize, than: &Steady) -> bool {
    matches!(M::STRUCTURE.elimination.steady.get(slot), Some(of) if of.turn > than.turn)
}

/// `h c_i`, as sums of the rows of `hA`.
#[inline(always)]
pub(super) fn nodes<E: Lanes, const S: usize>(a: &[[E; S]; S], h: E) -> [E; S] {
    let mut nodes = [E::from_f64(0.0); S];
    for (node, row) in nodes.iter_mut().zip(a) {
        for &a in row {
            *node = *node + h * a;
        }
    }
    nodes
}

/// `−(f_x,i V_0 + f_w,i)`, where every direction is an element of `w`: entries of the Jacobian go to their places in all panels. Steady
/// states have been subtracted.
pub(super) struct Scatter<'a, M: Dae, E: Plain, D, const S: usize> {
    pub jacobian: &'a M::Jacobian<[E; S]>,
    pub nodes: &'a [E; S],
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
        let place = begin * nk * S + (column - begin);
        let of = slot::<M>(r);
        let Some(steady) = steady::<M>(of) else {
            for (stage, &value) in values.iter().enumerate() {
                if let Some(to) = self.dy.get_mut(place + (of * S + stage) * width) {
                    *to = *to - value;
                }
            }
            return;
        };
        // All stages are the first.
        if !is_implied::<E, S>(&steady)
            && let Some(to) = self.dy.get_mut(place + of * S * width)
        {
            *to = -values[0];
        }
        for index in steady.first..steady.end {
            let Some((r, _, felt)) = by_column::<M, _>(self.jacobian, index as usize) else { continue };
            let of = slot::<M>(r);
            if !is_later::<M>(of, &steady) {
                continue;
            }
            for (stage, (&felt, &node)) in felt.iter().zip(self.nodes).enumerate() {
                if let Some(to) = self.dy.get_mut(place + (of * S + stage) * width) {
                    *to = *to + felt * node * values[0];
                }
            }
        }
    }
}

/// An entry of the Jacobian, by columns.
#[inline(always)]
fn by_column<M: Dae, V: Plain>(jacobian: &M::Jacobian<V>, index: usize) -> Option<(usize, usize, &V)> {
    entry::<M, V>(jacobian, *M::STRUCTURE.by_column.get(index)? as usize)
}

/// The same of a panel that begins with a column: entries column by column, from one of them on. Where the next panel begins.
#[inline(always)]
pub(super) fn place<M: Dae, E: Lanes, D: Directions<E>, const S: usize, const W: usize>(
    jacobian: &M::Jacobian<[E; S]>,
    nodes: &[E; S],
    mut placed: usize,
    dy: &mut [Packet<E, S, W>],
    begin: usize,
) -> usize {
    for (slot, packet) in dy.iter_mut().enumerate() {
        // Of steady states the first stage is looked at, if any.
        let stages = match steady::<M>(slot) {
            Some(steady) => usize::from(!is_implied::<E, S>(&steady)),
            None => S,
        };
        for row in packet.iter_mut().take(stages) {
            *row = [E::from_f64(0.0); W];
        }
    }
    while let Some((r, c, values)) = by_column::<M, _>(jacobian, placed) {
        placed += 1;
        let Some(column) = direction::<M, E, D>(c) else { continue };
        if column >= begin + W {
            return placed - 1;
        }
        let of = slot::<M>(r);
        let Some(steady) = steady::<M>(of) else {
            subtract_at(dy, of, column - begin, values);
            continue;
        };
        // All stages are the first.
        if !is_implied::<E, S>(&steady)
            && let Some(to) = dy.get_mut(of).and_then(|packet| packet.first_mut()?.get_mut(column - begin))
        {
            *to = -values[0];
        }
        for index in steady.first..steady.end {
            let Some((r, _, felt)) = by_column::<M, _>(jacobian, index as usize) else { continue };
            if !is_later::<M>(slot::<M>(r), &steady) {
                continue;
            }
            let mut products = *felt;
            for (product, &node) in products.iter_mut().zip(nodes) {
                *product = -(*product * node * values[0]);
            }
            subtract_at(dy, slot::<M>(r), column - begin, &products);
        }
    }
    placed
}

/// Subtracts from one column of a row.
#[inline(always)]
fn subtract_at<E: Lanes, const S: usize, const W: usize>(
    dy: &mut [Packet<E, S, W>],
    slot: usize,
    column: usize,
    values: &[E; S],
) {
    let Some(packet) = dy.get_mut(slot) else { return };
    for (row, &value) in packet.iter_mut().zip(values) {
        if let Some(to) = row.get_mut(column) {
            *to = *to - value;
        }
    }
}

/// The right-hand side that a steady state has at all stages.
#[inline(always)]
fn own<A: Arithmetic, M: Dae, E: Lanes, D: Directions<E>, const S: usize, const W: usize>(
    jacobian: &M::Jacobian<[E; S]>,
    v: &[[E; W]],
    directions: &D,
    column: usize,
    state: usize,
) -> Option<[E; W]> {
    let (_, c, values) = entry::<M, _>(jacobian, steady::<M>(state)?.entry as usize)?;
    let value = *values.first()?;
    let mut row = [E::from_f64(0.0); W];
    if c < 2 * M::Shape::NX {
        A::subtract_row(&mut row, value, v.get(c - M::Shape::NX)?);
    } else {
        directions.add(c - M::Shape::NX - M::Shape::NZ, -value, column, &mut row);
    }
    Some(row)
}

/// Makes a right-hand side of which steady states have been subtracted that of the whole system again.
#[inline(always)]
pub(super) fn restore<A: Arithmetic, M: Dae, E: Lanes, D: Directions<E>, const S: usize, const W: usize>(
    jacobian: &M::Jacobian<[E; S]>,
    nodes: &[E; S],
    v: &[[E; W]],
    (directions, column): (&D, usize),
    dy: &mut [Packet<E, S, W>],
) {
    for state in 0..M::Shape::NX {
        let Some(steady) = steady::<M>(state) else { continue };
        let own = own::<A, M, E, D, S, W>(jacobian, v, directions, column, state);
        let Some(own) = own else { continue };
        for index in steady.first..steady.end {
            let Some((r, _, felt)) = by_column::<M, _>(jacobian, index as usize) else { continue };
            let of = slot::<M>(r);
            let (true, Some(packet)) = (is_later::<M>(of, &steady), dy.get_mut(of)) else { continue };
            for ((row, &felt), &node) in packet.iter_mut().zip(felt).zip(nodes) {
                A::subtract_row(row, -(felt * node), &own);
            }
        }
        if let Some(packet) = dy.get_mut(state) {
            *packet = [own; S];
        }
    }
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

/// `−(f_x,i V_n + f_w,i)` of a panel; steady states have been subtracted.
pub(super) struct Later<'a, M: Dae, E: Plain, D, const S: usize, const W: usize> {
    pub jacobian: &'a M::Jacobian<[E; S]>,
    pub nodes: &'a [E; S],
    pub v: &'a [[E; W]],
    pub directions: &'a D,
    pub dy: &'a mut [Packet<E, S, W>],
    pub column: usize,
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize, const W: usize> Later<'_, M, E, D, S, W> {
    /// The first entry of `f_x`.
    const FIRST: usize = M::STRUCTURE.blocks[1];
    /// Whether a straight line begins with zeros everywhere. (Where numbers are registers, 3 masses with four stages take 2 % less when each
    /// row begins with its first entry; of plain numbers they take 3 % more.)
    const AT_ONCE: bool = size_of::<E>() <= 8;

    #[inline(always)]
    pub fn all<A: Arithmetic>(mut self) {
        if const { Self::AT_ONCE && is_short::<A, Self>() } {
            self.dy.fill([[E::from_f64(0.0); W]; S]);
        }
        // What multiplies `f_x` lies where their right-hand sides do, until all others are there.
        for state in 0..M::STRUCTURE.elimination.steady.len() {
            if let Some(leader) = leader::<M, E, S>(self.jacobian, state) {
                let (Some(v), Some(to)) = (self.v.get(state), self.dy.get_mut(state)) else { continue };
                for (to, &node) in to.iter_mut().zip(self.nodes) {
                    let mut row = *v;
                    leader.add_state::<A, M, W>(&mut row, node, self.v);
                    *to = row;
                    leader.add_input::<M, D, W>(to, node, self.directions, self.column);
                }
            } else if let (Some(own), Some(v), Some(to)) =
                (self.own::<A>(state), self.v.get(state), self.dy.get_mut(state))
            {
                for (to, &node) in to.iter_mut().zip(self.nodes) {
                    let mut row = *v;
                    A::subtract_row(&mut row, -node, &own);
                    *to = row;
                }
            }
        }
        if const { is_short::<A, Self>() } {
            each_row::<A, _>(&mut self);
            if const { !Self::AT_ONCE } {
                self.clear(const { Self::after(Self::ROWS) }, M::Shape::NK);
            }
        } else {
            self.row_by_row::<A>();
        }
        let Self { jacobian, directions, column, .. } = self;
        each_row::<A, _>(&mut Inputs::<M, E, D, S, W> { jacobian, directions, dy: &mut *self.dy, column });
        for state in 0..M::STRUCTURE.elimination.steady.len() {
            if implied::<M, E, S>(state).is_some() {
                continue;
            }
            let Some(own) = self.own::<A>(state) else { continue };
            if let Some(to) = self.dy.get_mut(state).and_then(|packet| packet.first_mut()) {
                *to = own;
            }
        }
    }

    /// The right-hand side of a steady state.
    #[inline(always)]
    fn own<A: Arithmetic>(&self, state: usize) -> Option<[E; W]> {
        own::<A, M, E, D, S, W>(self.jacobian, self.v, self.directions, self.column, state)
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
            if !self.subtract::<A>(&mut packet, slot::<M>(r), c - M::Shape::NX, values) {
                return;
            }
        }
        self.put(last, &packet);
        self.clear(last + 1, M::Shape::NK);
    }

    /// `packet − f_x,i V`, of one state, in the equation of a slot. Whether there is one.
    #[inline(always)]
    fn subtract<A: Arithmetic>(
        &self,
        packet: &mut Packet<E, S, W>,
        slot: usize,
        state: usize,
        values: &[E; S],
    ) -> bool {
        if matches!(steady::<M>(state), Some(steady) if is_later::<M>(slot, &steady)) {
            let Some(x) = self.dy.get(state) else { return false };
            for ((row, &value), x) in packet.iter_mut().zip(values).zip(x) {
                A::subtract_row(row, value, x);
            }
            return true;
        }
        let Some(v) = self.v.get(state) else { return false };
        for (row, &value) in packet.iter_mut().zip(values) {
            A::subtract_row(row, value, v);
        }
        true
    }

    /// The equation that follows that of the entry before this one.
    const fn after(row: usize) -> usize {
        if row == 0 { 0 } else { M::STRUCTURE.jacobian.at(Self::FIRST + row - 1).0 + 1 }
    }

    /// The row of an equation.
    #[inline(always)]
    fn put(&mut self, equation: usize, packet: &Packet<E, S, W>) {
        let slot = slot::<M>(equation);
        if steady::<M>(slot).is_some() {
            return;
        }
        if let Some(to) = self.dy.get_mut(slot) {
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

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize, const W: usize> AtRow for Later<'_, M, E, D, S, W> {
    const ROWS: usize = M::STRUCTURE.blocks[2] - M::STRUCTURE.blocks[1];
    const INSTRUCTIONS: usize = 2 + S * if size_of::<E>() > 8 { 3 * W } else { 4 * W.div_ceil(4) };
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let Some((r, c, values)) = entry::<M, _>(self.jacobian, Self::FIRST + row) else { return };
        let slot = slot::<M>(r);
        let next = Self::after(row);
        // The first entry of an equation has nothing to add to.
        let mut packet = [[E::from_f64(0.0); W]; S];
        if Self::AT_ONCE || r < next {
            packet = *self.dy.get(slot).unwrap_or(&packet);
        } else {
            self.clear(next, r);
        }
        if steady::<M>(slot).is_some() || !self.subtract::<A>(&mut packet, slot, c - M::Shape::NX, values) {
            return;
        }
        if let Some(to) = self.dy.get_mut(slot) {
            *to = packet;
        }
    }
}

/// `−f_w,i` of a panel, of controls and parameters, but for steady states.
struct Inputs<'a, M: Dae, E: Plain, D, const S: usize, const W: usize> {
    jacobian: &'a M::Jacobian<[E; S]>,
    directions: &'a D,
    dy: &'a mut [Packet<E, S, W>],
    column: usize,
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize, const W: usize> AtRow for Inputs<'_, M, E, D, S, W> {
    const ROWS: usize = M::STRUCTURE.blocks[5] - M::STRUCTURE.blocks[3];
    const INSTRUCTIONS: usize = 4 + 2 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let shift = M::Shape::NX + M::Shape::NZ;
        let Some((r, c, values)) = entry::<M, _>(self.jacobian, M::STRUCTURE.blocks[3] + row) else { return };
        let slot = slot::<M>(r);
        let (None, Some(packet)) = (steady::<M>(slot), self.dy.get_mut(slot)) else { return };
        for (row, &value) in packet.iter_mut().zip(values) {
            self.directions.add(c - shift, -value, self.column, row);
        }
    }
}
