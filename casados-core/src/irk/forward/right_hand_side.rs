//! Right-hand sides of forward sensitivities, `−(f_x,i V_n + f_w,i)` in the slots of the equations,
//! from which [kinematic](crate::irk::kinematic) states have been eliminated:
//!
//! ```text
//! −(f_x,i V_n + f_q,i h c_i c V_v + f_q̇,i c V_v + f_w,i)
//! ```

use crate::irk::directions::{Directions, panel_of};
use crate::irk::jacobian_entries::entry;
use crate::irk::kinematic::{KinematicPanel, dependence, minus_c};
use crate::linalg::{Arithmetic, AtRow, PanelRow, each_row, is_short, kinematic, slot};
use crate::model::{Dae, Dependent};
use crate::scalar::{Lanes, each};
use crate::shape::{Plain, Shape};
use core::marker::PhantomData;

/// Right-hand sides where every direction is an element of `w` and `V_n` the unit matrix: entries
/// of the Jacobian go to their places in all panels.
pub(in crate::irk) struct Scatter<'a, M: Dae, E: Plain, D, const S: usize> {
    pub jacobian: &'a M::Jacobian<[E; S]>,
    pub nodes: &'a [E; S],
    pub dy: &'a mut [E],
    pub directions: PhantomData<D>,
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize> Scatter<'_, M, E, D, S> {
    /// Places all of them.
    #[inline(always)]
    pub fn all<A: Arithmetic>(&mut self) {
        each_row::<A, _>(self);
        each_row::<A, _>(&mut ScatterDependents(self));
    }

    /// Subtracts from one column of an equation.
    #[inline(always)]
    fn subtract(&mut self, slot: usize, column: usize, values: &[E; S]) {
        let nk = M::Shape::NK;
        let (begin, width) = panel_of::<E>(column, D::COLUMNS, S);
        let place = begin * nk * S + (column - begin);
        each!(i < S => {
            if let Some(to) = self.dy.get_mut(place + (slot * S + i) * width) {
                *to = *to - values[i];
            }
        });
    }
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize> AtRow for Scatter<'_, M, E, D, S> {
    /// The entries of `f_x`, `f_z`, `f_u` and `f_p`.
    const ROWS: usize = M::STRUCTURE.blocks[5] - M::STRUCTURE.blocks[1];
    const INSTRUCTIONS: usize = 3 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let Some((r, c, values)) = entry::<M, _>(self.jacobian, M::STRUCTURE.blocks[1] + row) else { return };
        let slot = slot::<M>(r);
        if kinematic::<M>(slot).is_none()
            && let Some(column) = direction::<M, E, D>(c)
        {
            self.subtract(slot, column, values);
        }
    }
}

/// The entries by which other equations depend on kinematic states.
struct ScatterDependents<'a, 'b, M: Dae, E: Plain, D, const S: usize>(&'a mut Scatter<'b, M, E, D, S>);

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize> AtRow for ScatterDependents<'_, '_, M, E, D, S> {
    const ROWS: usize = M::STRUCTURE.elimination.dependents.len();
    const INSTRUCTIONS: usize = 3 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let Some(dependent) = M::STRUCTURE.elimination.dependents.get(row) else { return };
        let through = through::<M, E, S>(self.0.jacobian, self.0.nodes, dependent);
        let Some((slot, velocity, products)) = through else { return };
        if let Some(column) = direction::<M, E, D>(velocity) {
            self.0.subtract(slot, column, &products);
        }
    }
}

/// What an equation has of a velocity through a kinematic state: `c f_q̇,i` or `h c_i c f_q,i`,
/// with its slot and the variable.
#[inline(always)]
fn through<M: Dae, E: Lanes, const S: usize>(
    jacobian: &M::Jacobian<[E; S]>,
    nodes: &[E; S],
    of: &Dependent,
) -> Option<(usize, usize, [E; S])> {
    let kinematic = kinematic::<M>(of.state as usize)?;
    let minus_c = minus_c::<M, E, S>(kinematic, jacobian)?;
    let (slot, &(mut products), derivative) = dependence::<M, E, S>(of, jacobian)?;
    each!(i < S => {
        let factor = if derivative { minus_c } else { nodes[i] * minus_c };
        products[i] = -(products[i] * factor);
    });
    Some((slot, kinematic.velocity as usize, products))
}

/// An entry of the Jacobian, by columns.
#[inline(always)]
fn by_column<M: Dae, V: Plain>(jacobian: &M::Jacobian<V>, index: usize) -> Option<(usize, usize, &V)> {
    entry::<M, V>(jacobian, *M::STRUCTURE.by_column.get(index)? as usize)
}

/// Entries of the Jacobian that are in their panels.
#[derive(Clone, Copy, Default)]
pub(in crate::irk) struct Placed {
    /// Column by column.
    entries: usize,
    /// Those by which equations depend on kinematic states.
    dependents: usize,
}

/// The same of a panel that begins with a column: entries column by column, those that follow the
/// ones of the panel before.
#[inline(always)]
pub(in crate::irk) fn place<M: Dae, E: Lanes, D: Directions<E>, const S: usize, const W: usize>(
    jacobian: &M::Jacobian<[E; S]>,
    nodes: &[E; S],
    placed: &mut Placed,
    dy: &mut [PanelRow<E, S, W>],
    begin: usize,
) {
    for (slot, panel_row) in dy.iter_mut().enumerate() {
        if kinematic::<M>(slot).is_none() {
            *panel_row = [[E::from_f64(0.0); W]; S];
        }
    }
    while let Some(dependent) = M::STRUCTURE.elimination.dependents.get(placed.dependents) {
        let through = through::<M, E, S>(jacobian, nodes, dependent);
        if let Some((slot, velocity, products)) = through
            && let Some(column) = direction::<M, E, D>(velocity)
        {
            if column >= begin + W {
                break;
            }
            subtract_at(dy, slot, column.wrapping_sub(begin), &products);
        }
        placed.dependents += 1;
    }
    while let Some((r, c, values)) = by_column::<M, _>(jacobian, placed.entries) {
        if let Some(column) = direction::<M, E, D>(c) {
            if column >= begin + W {
                break;
            }
            if kinematic::<M>(slot::<M>(r)).is_none() {
                subtract_at(dy, slot::<M>(r), column - begin, values);
            }
        }
        placed.entries += 1;
    }
}

/// Subtracts from one column of a row.
#[inline(always)]
fn subtract_at<E: Lanes, const S: usize, const W: usize>(
    dy: &mut [PanelRow<E, S, W>],
    slot: usize,
    column: usize,
    values: &[E; S],
) {
    let Some(panel_row) = dy.get_mut(slot) else { return };
    for (row, &value) in panel_row.iter_mut().zip(values) {
        if let Some(to) = row.get_mut(column) {
            *to = *to - value;
        }
    }
}

/// The direction that a variable other than `ẋ` is, if it is one.
#[inline(always)]
fn direction<M: Dae, E, D: Directions<E>>(variable: usize) -> Option<usize> {
    let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
    if variable >= 2 * nx && variable < 2 * nx + nz {
        return None;
    }
    D::column(if variable < 2 * nx { variable - nx } else { variable - nx - nz })
}

/// The same of a panel, whatever `V_n` is.
pub(in crate::irk) struct Later<'a, M: Dae, E: Plain, D, const S: usize, const W: usize> {
    pub kinematic: KinematicPanel<'a, M, E, D, S, W>,
    pub nodes: &'a [E; S],
    pub dy: &'a mut [PanelRow<E, S, W>],
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize, const W: usize> Later<'_, M, E, D, S, W> {
    /// The first entry of `f_x`.
    const FIRST: usize = M::STRUCTURE.blocks[1];
    /// Whether an unrolled loop begins with zeros everywhere: of plain numbers that is less than a
    /// row that begins with its first entry.
    const AT_ONCE: bool = size_of::<E>() <= 8;

    #[inline(always)]
    pub fn all<A: Arithmetic>(mut self) {
        if const { Self::AT_ONCE && is_short::<A, Self>() } {
            self.dy.fill([[E::from_f64(0.0); W]; S]);
        }
        self.kinematic.place::<A>(self.nodes, self.dy);
        if const { is_short::<A, Self>() } {
            each_row::<A, _>(&mut self);
            if const { !Self::AT_ONCE } {
                self.clear(const { Self::after(Self::ROWS) }, M::Shape::NK);
            }
        } else {
            self.row_by_row::<A>();
        }
        self.kinematic.subtract_derivatives::<A>(self.dy);
        let KinematicPanel { jacobian, directions, column, .. } = self.kinematic;
        each_row::<A, _>(&mut Inputs::<M, E, D, S, W> { jacobian, directions, dy: &mut *self.dy, column });
    }

    /// Each row in registers, and written once; zeros where equations have no states.
    #[inline(always)]
    fn row_by_row<A: Arithmetic>(&mut self) {
        let (mut panel_row, mut last) = ([[E::from_f64(0.0); W]; S], 0);
        for row in 0..Self::ROWS {
            let Some((r, c, values)) = entry::<M, _>(self.kinematic.jacobian, Self::FIRST + row) else {
                return;
            };
            if last != r {
                self.put(last, &panel_row);
                self.clear(last + 1, r);
                (panel_row, last) = ([[E::from_f64(0.0); W]; S], r);
            }
            self.subtract::<A>(&mut panel_row, c - M::Shape::NX, values);
        }
        self.put(last, &panel_row);
        self.clear(last + 1, M::Shape::NK);
    }

    /// `panel_row − f_x,i V`, of one state.
    #[inline(always)]
    fn subtract<A: Arithmetic>(&self, panel_row: &mut PanelRow<E, S, W>, state: usize, values: &[E; S]) {
        if kinematic::<M>(state).is_some() {
            let Some(x) = self.dy.get(state) else { return };
            each!(i < S => { A::subtract_row(&mut panel_row[i], values[i], &x[i]); });
            return;
        }
        let Some(v) = self.kinematic.v.get(state) else { return };
        each!(i < S => { A::subtract_row(&mut panel_row[i], values[i], v); });
    }

    /// The equation that follows that of the entry before this one.
    const fn after(row: usize) -> usize {
        if row == 0 { 0 } else { M::STRUCTURE.jacobian.at(Self::FIRST + row - 1).0 + 1 }
    }

    /// The row of an equation.
    #[inline(always)]
    fn put(&mut self, equation: usize, panel_row: &PanelRow<E, S, W>) {
        let slot = slot::<M>(equation);
        if kinematic::<M>(slot).is_some() {
            return;
        }
        if let Some(to) = self.dy.get_mut(slot) {
            *to = *panel_row;
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
        let Some((r, c, values)) = entry::<M, _>(self.kinematic.jacobian, Self::FIRST + row) else { return };
        let slot = slot::<M>(r);
        let next = Self::after(row);
        // The first entry of an equation has nothing to add to.
        let mut panel_row = [[E::from_f64(0.0); W]; S];
        if Self::AT_ONCE || r < next {
            panel_row = *self.dy.get(slot).unwrap_or(&panel_row);
        } else {
            self.clear(next, r);
        }
        if kinematic::<M>(slot).is_some() {
            return;
        }
        self.subtract::<A>(&mut panel_row, c - M::Shape::NX, values);
        if let Some(to) = self.dy.get_mut(slot) {
            *to = panel_row;
        }
    }
}

/// `−f_w,i` of a panel, of controls and parameters.
struct Inputs<'a, M: Dae, E: Plain, D, const S: usize, const W: usize> {
    jacobian: &'a M::Jacobian<[E; S]>,
    directions: &'a D,
    dy: &'a mut [PanelRow<E, S, W>],
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
        let (None, Some(panel_row)) = (kinematic::<M>(slot), self.dy.get_mut(slot)) else { return };
        for (row, &value) in panel_row.iter_mut().zip(values) {
            self.directions.add(c - shift, -value, self.column, row);
        }
    }
}
