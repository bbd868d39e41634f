//! Right-hand sides of forward sensitivities, `−(f_x,i V_n + f_w,i)` in the slots of the equations,
//! from which [kinematic](crate::irk::kinematic) states have been eliminated:
//!
//! ```text
//! −(f_x,i V_n + f_q,i h c_i c V_v + f_q̇,i c V_v + f_w,i)
//! ```

use crate::irk::directions::{Directions, panel_of};
use crate::irk::kinematic::{KinematicPanel, dependent_entry, minus_c};
use crate::linalg::{Arithmetic, PanelRow, RowVisitor, for_each_row, is_unrolled};
use crate::model::Dependent;
use crate::plan::{Plan, StructureTable};
use crate::scalar::{Lanes, each};
use crate::shape::InBounds;

/// Right-hand sides if every direction is an element of `w` and `V_n` the unit matrix: scatters the
/// entries of the Jacobian to all panels.
pub(in crate::irk) struct Scatter<'a, M, E, D, const S: usize> {
    pub plan: M,
    pub jacobian: &'a [[E; S]],
    pub nodes: &'a [E; S],
    pub dy: &'a mut [E],
    pub directions: D,
}

impl<M: Plan, E: Lanes, D: Directions<E>, const S: usize> Scatter<'_, M, E, D, S> {
    /// Scatters all entries.
    #[inline(always)]
    pub fn evaluate<A: Arithmetic>(&mut self) {
        for_each_row::<A, _>(self);
        for_each_row::<A, _>(&mut ScatterDependents(self));
    }

    /// Subtracts from one column of an equation.
    #[inline(always)]
    fn subtract_column(&mut self, slot: usize, column: usize, values: &[E; S]) {
        let nk = self.plan.nk();
        let (begin, width) = panel_of::<E>(true, column, self.directions.columns(), S);
        let offset = begin * nk * S + (column - begin);
        each!(i < S => {
            if let Some(to) = self.dy.get_mut(offset + (slot * S + i) * width).in_bounds() {
                *to = *to - values[i];
            }
        });
    }
}

impl<M: Plan, E: Lanes, D: Directions<E>, const S: usize> RowVisitor for Scatter<'_, M, E, D, S> {
    /// The entries of `f_x`, `f_z`, `f_u` and `f_p`.
    const ROWS: Option<usize> = StructureTable::Entries(1, 5).known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Entries(1, 5).row_count(self.plan.structure())
    }
    const INSTRUCTIONS: usize = 3 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let (plan, first) = (self.plan, self.plan.structure().blocks[1]);
        let Some((r, c, values)) = plan.entry(self.jacobian, first + row) else { return };
        let slot = plan.slot(r);
        if plan.kinematic(slot).is_none()
            && let Some(column) = direction_column::<M, E, D>(plan, self.directions, c)
        {
            self.subtract_column(slot, column, values);
        }
    }
}

/// Scatters the entries by which other equations depend on kinematic states.
struct ScatterDependents<'a, 'b, M, E, D, const S: usize>(&'a mut Scatter<'b, M, E, D, S>);

impl<M: Plan, E: Lanes, D: Directions<E>, const S: usize> RowVisitor
    for ScatterDependents<'_, '_, M, E, D, S>
{
    const ROWS: Option<usize> = StructureTable::Dependents.known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Dependents.row_count(self.0.plan.structure())
    }
    const INSTRUCTIONS: usize = 3 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let Scatter { plan, jacobian, nodes, directions, .. } = &*self.0;
        let Some(dependent) = plan.structure().elimination.dependents.get(row).in_bounds() else { return };
        let Some((slot, velocity, products)) = eliminated_entry(*plan, jacobian, nodes, dependent) else {
            return;
        };
        if let Some(column) = direction_column::<M, E, D>(*plan, *directions, velocity) {
            self.0.subtract_column(slot, column, &products);
        }
    }
}

/// Returns the entry of the velocity that results from eliminating a kinematic state, `c f_q̇,i` or
/// `h c_i c f_q,i`, with its slot and its variable.
#[inline(always)]
fn eliminated_entry<M: Plan, E: Lanes, const S: usize>(
    plan: M,
    jacobian: &[[E; S]],
    nodes: &[E; S],
    dependent: &Dependent,
) -> Option<(usize, usize, [E; S])> {
    let kinematic = plan.kinematic(dependent.state as usize)?;
    let minus_c = minus_c(kinematic, jacobian)?;
    let (slot, &(mut products), derivative) = dependent_entry(plan, dependent, jacobian)?;
    each!(i < S => {
        let factor = if derivative { minus_c } else { nodes[i] * minus_c };
        products[i] = -(products[i] * factor);
    });
    Some((slot, kinematic.velocity as usize, products))
}

/// Returns an entry of the Jacobian in column order.
#[inline(always)]
fn entry_by_column<M: Plan, V>(plan: M, jacobian: &[V], index: usize) -> Option<(usize, usize, &V)> {
    plan.entry(jacobian, *plan.structure().by_column.get(index)? as usize)
}

/// Numbers of entries that are already in their panels.
#[derive(Clone, Copy, Default)]
pub(in crate::irk) struct ScatterProgress {
    /// Entries of the Jacobian in column order.
    entries: usize,
    /// Entries by which equations depend on kinematic states.
    dependents: usize,
}

/// Scatters to the panel that begins with a column: entries in column order, from the end of the
/// preceding panel on.
#[inline(always)]
pub(in crate::irk) fn scatter_panel<M: Plan, E: Lanes, D: Directions<E>, const S: usize, const W: usize>(
    (plan, directions): (M, D),
    jacobian: &[[E; S]],
    nodes: &[E; S],
    progress: &mut ScatterProgress,
    dy: &mut [PanelRow<E, S, W>],
    begin: usize,
) {
    for (slot, panel_row) in dy.iter_mut().enumerate() {
        if plan.kinematic(slot).is_none() {
            *panel_row = [[E::from_f64(0.0); W]; S];
        }
    }
    while let Some(dependent) = plan.structure().elimination.dependents.get(progress.dependents) {
        if let Some((slot, velocity, products)) = eliminated_entry(plan, jacobian, nodes, dependent)
            && let Some(column) = direction_column::<M, E, D>(plan, directions, velocity)
        {
            if column >= begin + W {
                break;
            }
            subtract_at(dy, slot, column.wrapping_sub(begin), &products);
        }
        progress.dependents += 1;
    }
    while let Some((r, c, values)) = entry_by_column(plan, jacobian, progress.entries) {
        if let Some(column) = direction_column::<M, E, D>(plan, directions, c) {
            if column >= begin + W {
                break;
            }
            if plan.kinematic(plan.slot(r)).is_none() {
                subtract_at(dy, plan.slot(r), column - begin, values);
            }
        }
        progress.entries += 1;
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
    let Some(panel_row) = dy.get_mut(slot).in_bounds() else { return };
    for (row, &value) in panel_row.iter_mut().zip(values) {
        if let Some(to) = row.get_mut(column).in_bounds() {
            *to = *to - value;
        }
    }
}

/// The column of a variable other than `ẋ`, if it is a direction.
#[inline(always)]
fn direction_column<M: Plan, E, D: Directions<E>>(plan: M, directions: D, variable: usize) -> Option<usize> {
    let (nx, nz) = (plan.nx(), plan.nz());
    if variable >= 2 * nx && variable < 2 * nx + nz {
        return None;
    }
    directions.column(if variable < 2 * nx { variable - nx } else { variable - nx - nz })
}

/// The right-hand side of a panel for general `V_n`.
pub(in crate::irk) struct PanelRightHandSide<'a, M, E, D, const S: usize, const W: usize> {
    pub kinematic: KinematicPanel<'a, M, E, D, S, W>,
    pub nodes: &'a [E; S],
    pub dy: &'a mut [PanelRow<E, S, W>],
}

impl<M: Plan, E: Lanes, D: Directions<E>, const S: usize, const W: usize>
    PanelRightHandSide<'_, M, E, D, S, W>
{
    /// Whether an unrolled loop clears all rows first: cheaper for scalars than code for the first
    /// entry of each row.
    const CLEARS_FIRST: bool = size_of::<E>() <= 8;

    #[inline(always)]
    pub fn evaluate<A: Arithmetic>(mut self) {
        if const { Self::CLEARS_FIRST && is_unrolled::<A, Self>() } {
            self.dy.fill([[E::from_f64(0.0); W]; S]);
        }
        let plan = self.kinematic.plan;
        self.kinematic.write_states::<A>(self.nodes, self.dy);
        if const { is_unrolled::<A, Self>() } {
            for_each_row::<A, _>(&mut self);
            if const { !Self::CLEARS_FIRST } {
                self.clear_rows(const { Self::equation_after_last() }, plan.nk());
            }
        } else {
            self.row_by_row::<A>();
        }
        self.kinematic.subtract_derivative_terms::<A>(self.dy);
        let KinematicPanel { jacobian, directions, column, .. } = self.kinematic;
        for_each_row::<A, _>(&mut InputEntries { plan, jacobian, directions, dy: &mut *self.dy, column });
    }

    /// Accumulates each row in registers and writes it once; rows of equations without states are
    /// zero.
    #[inline(always)]
    fn row_by_row<A: Arithmetic>(&mut self) {
        let (mut panel_row, mut last) = ([[E::from_f64(0.0); W]; S], 0);
        let (plan, blocks) = (self.kinematic.plan, &self.kinematic.plan.structure().blocks);
        for index in blocks[1]..blocks[2] {
            let Some((r, c, values)) = plan.entry(self.kinematic.jacobian, index) else { return };
            if last != r {
                self.write_row(last, &panel_row);
                self.clear_rows(last + 1, r);
                (panel_row, last) = ([[E::from_f64(0.0); W]; S], r);
            }
            self.subtract_state::<A>(&mut panel_row, c - plan.nx(), values);
        }
        self.write_row(last, &panel_row);
        self.clear_rows(last + 1, plan.nk());
    }

    /// `panel_row − f_x,i V` for one state.
    #[inline(always)]
    fn subtract_state<A: Arithmetic>(
        &self,
        panel_row: &mut PanelRow<E, S, W>,
        state: usize,
        values: &[E; S],
    ) {
        if self.kinematic.plan.kinematic(state).is_some() {
            let Some(x) = self.dy.get(state).in_bounds() else { return };
            each!(i < S => { A::subtract_row(&mut panel_row[i], values[i], &x[i]); });
            return;
        }
        let Some(v) = self.kinematic.v.get(state).in_bounds() else { return };
        each!(i < S => { A::subtract_row(&mut panel_row[i], values[i], v); });
    }

    /// The equation after that of the preceding entry.
    #[inline(always)]
    fn next_equation(&self, row: usize) -> usize {
        let structure = self.kinematic.plan.structure();
        match structure.jacobian.rows.get((structure.blocks[1] + row).wrapping_sub(1)) {
            Some(&equation) if row > 0 => equation as usize + 1,
            _ => 0,
        }
    }

    /// The equation after that of the last entry, for kernels that are compiled for one model.
    const fn equation_after_last() -> usize {
        let Some(structure) = M::KNOWN_STRUCTURE else { return 0 };
        let [_, begin, end, ..] = structure.blocks;
        if begin == end { 0 } else { structure.jacobian.at(end - 1).0 + 1 }
    }

    /// Writes the row of an equation.
    #[inline(always)]
    fn write_row(&mut self, equation: usize, panel_row: &PanelRow<E, S, W>) {
        let slot = self.kinematic.plan.slot(equation);
        if self.kinematic.plan.kinematic(slot).is_some() {
            return;
        }
        if let Some(to) = self.dy.get_mut(slot).in_bounds() {
            *to = *panel_row;
        }
    }

    /// Clears the rows of equations without states.
    #[inline(always)]
    fn clear_rows(&mut self, begin: usize, end: usize) {
        for equation in begin..end {
            self.write_row(equation, &[[E::from_f64(0.0); W]; S]);
        }
    }
}

impl<M: Plan, E: Lanes, D: Directions<E>, const S: usize, const W: usize> RowVisitor
    for PanelRightHandSide<'_, M, E, D, S, W>
{
    const ROWS: Option<usize> = StructureTable::Entries(1, 2).known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Entries(1, 2).row_count(self.kinematic.plan.structure())
    }
    const INSTRUCTIONS: usize = 2 + S * if size_of::<E>() > 8 { 3 * W } else { 4 * W.div_ceil(4) };
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let (plan, first) = (self.kinematic.plan, self.kinematic.plan.structure().blocks[1]);
        let Some((r, c, values)) = plan.entry(self.kinematic.jacobian, first + row) else { return };
        let slot = plan.slot(r);
        let next = self.next_equation(row);
        // The first entry of an equation starts the sum.
        let mut panel_row = [[E::from_f64(0.0); W]; S];
        if Self::CLEARS_FIRST || r < next {
            panel_row = *self.dy.get(slot).in_bounds().unwrap_or(&panel_row);
        } else {
            self.clear_rows(next, r);
        }
        if plan.kinematic(slot).is_some() {
            return;
        }
        self.subtract_state::<A>(&mut panel_row, c - plan.nx(), values);
        if let Some(to) = self.dy.get_mut(slot).in_bounds() {
            *to = panel_row;
        }
    }
}

/// `−f_w,i` of controls and parameters, for a panel.
struct InputEntries<'a, M, E, D, const S: usize, const W: usize> {
    plan: M,
    jacobian: &'a [[E; S]],
    directions: D,
    dy: &'a mut [PanelRow<E, S, W>],
    column: usize,
}

impl<M: Plan, E: Lanes, D: Directions<E>, const S: usize, const W: usize> RowVisitor
    for InputEntries<'_, M, E, D, S, W>
{
    const ROWS: Option<usize> = StructureTable::Entries(3, 5).known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Entries(3, 5).row_count(self.plan.structure())
    }
    const INSTRUCTIONS: usize = 4 + 2 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let (plan, shift, first) = (self.plan, self.plan.nk(), self.plan.structure().blocks[3]);
        let Some((r, c, values)) = plan.entry(self.jacobian, first + row) else { return };
        let slot = plan.slot(r);
        let (None, Some(panel_row)) = (plan.kinematic(slot), self.dy.get_mut(slot)) else { return };
        for (row, &value) in panel_row.iter_mut().zip(values) {
            self.directions.add_scaled(c - shift, -value, self.column, row);
        }
    }
}
