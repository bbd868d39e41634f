//! Kinematic states `q`, with equations `q̇ − c v = 0`: condensed, so that they are no unknowns of
//! Newton's method, of the elimination or of derivatives.
//!
//! ```text
//! stages         k_q = c (x_v + hA k_v)      or c v of a control or parameter
//! J X = B        B_r ← B_r − (f_q̇ + f_q hA) B_q  X_q = B_q + c hA X_v
//! forward        B_q = c V_v at all stages, so that hA B_q = h c_i c V_v
//! Jᵀ M = B       B_v ← B_v + c (hA)ᵀ B_q         M_q = B_q − Σ_r (f_q̇ + (hA)ᵀ f_q) M_r
//! ```
//!
//! In all arrays they have their places among the other unknowns and equations: at the end of a
//! step, in results, in `D`, in backward errors.

mod stages;

pub(super) use stages::kinematic_derivative;

use crate::irk::coefficients::Coefficients;
use crate::irk::directions::Directions;
use crate::irk::workspace::Linearization;
use crate::linalg::{
    Arithmetic, Block, Kernel, PanelRow, RowVisitor, Visitor, dispatch, for_each_row, minus_ha,
    subtract_diagonal, subtract_product, subtract_transposed,
};
use crate::memory::Fallback;
use crate::model::{ArrayK, Dae, Dependent, Kinematic};
use crate::plan::{self, DerivedFacts, Plan, PlanOf, StructureTable};
use crate::scalar::{Lanes, each};
use crate::shape::{InBounds, Plain};

/// Whether any state is kinematic.
pub(super) const fn has_kinematic_states<M: Dae>() -> bool {
    !M::STRUCTURE.elimination.kinematic.is_empty()
}

/// `−c`
#[inline(always)]
pub(super) fn minus_c<E: Copy, const S: usize>(kinematic: &Kinematic, jacobian: &[[E; S]]) -> Option<E> {
    match jacobian.get(kinematic.entry as usize) {
        Some(entry) => entry.first().copied(),
        None => None,
    }
}

/// Returns an entry by which an equation depends on a kinematic state: its slot, its values, and
/// whether it multiplies the derivative.
#[inline(always)]
pub(super) fn dependent_entry<'a, M: Plan, E, const S: usize>(
    plan: M,
    kinematic: &Dependent,
    jacobian: &'a [[E; S]],
) -> Option<(usize, &'a [E; S], bool)> {
    let index = kinematic.entry as usize;
    let (row, _, values) = plan.entry(jacobian, index)?;
    Some((plan.slot(row), values, index < plan.structure().blocks[1]))
}

/// Whether the plan is known to have no kinematic unknown.
pub(super) const fn has_no_kinematic_unknowns<M: Plan>() -> bool {
    let Some(structure) = M::KNOWN_STRUCTURE else { return false };
    let (mut index, end) = DerivedFacts::of(structure).non_kinematic_range;
    while index < end {
        if plan::kinematic(structure, index).is_some() {
            return false;
        }
        index += 1;
    }
    true
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Linearization<M, E, S, F> {
    /// Solves `J X = B` for all unknowns in place; the right-hand side of an equation is in its
    /// slot.
    pub(super) fn solve<const W: usize>(
        &self,
        (coefficients, h): (&Coefficients<E, S>, E),
        b: &mut ArrayK<M, PanelRow<E, S, W>>,
    ) {
        if const { !has_kinematic_states::<M>() } {
            return self.factors.solve(b);
        }
        let (plan, a) = (F::plan::<M>(), &coefficients.a);
        let jacobian = F::Plan::<M>::jacobian(&self.jacobian);
        dispatch(CondensationKernel::<_, E, S, W, ELIMINATE> { plan, jacobian, a, h, rows: b.as_mut() });
        self.factors.solve(b);
        dispatch(CondensationKernel::<_, E, S, W, RECONSTRUCT> { plan, jacobian, a, h, rows: b.as_mut() });
    }

    /// Solves `Jᵀ X = B` for all equations in place; the solution of an equation is in its slot.
    pub(super) fn solve_transposed<const W: usize>(
        &self,
        (coefficients, h): (&Coefficients<E, S>, E),
        b: &mut ArrayK<M, PanelRow<E, S, W>>,
    ) {
        if const { !has_kinematic_states::<M>() } {
            return self.factors.solve_transposed(b);
        }
        let (plan, a) = (F::plan::<M>(), &coefficients.a);
        let jacobian = F::Plan::<M>::jacobian(&self.jacobian);
        dispatch(CondensationKernel::<_, E, S, W, CONDENSE_TRANSPOSED> {
            plan,
            jacobian,
            a,
            h,
            rows: b.as_mut(),
        });
        self.factors.solve_transposed(b);
        dispatch(CondensationKernel::<_, E, S, W, RECONSTRUCT_TRANSPOSED> {
            plan,
            jacobian,
            a,
            h,
            rows: b.as_mut(),
        });
    }
}

/// Operations on the rows of all unknowns, before and after the solution of the condensed system.
pub(super) const ELIMINATE: u8 = 0;
const RECONSTRUCT: u8 = 1;
pub(super) const CONDENSE_TRANSPOSED: u8 = 2;
pub(super) const RECONSTRUCT_TRANSPOSED: u8 = 3;

struct CondensationKernel<'a, M: Plan, E: Plain, const S: usize, const W: usize, const WHAT: u8> {
    plan: M,
    jacobian: &'a M::Jacobian<[E; S]>,
    a: &'a [[E; S]; S],
    h: E,
    rows: &'a mut [PanelRow<E, S, W>],
}

impl<M: Plan, E: Lanes, const S: usize, const W: usize, const WHAT: u8> Kernel
    for CondensationKernel<'_, M, E, S, W, WHAT>
{
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { plan, jacobian, a, h, rows } = self;
        condense::<A, M, E, S, W, WHAT>(plan, jacobian.as_ref(), &minus_ha(a, h), rows);
    }
}

/// The operation inside of a kernel.
#[inline(always)]
pub(super) fn condense<
    A: Arithmetic,
    M: Plan,
    E: Lanes,
    const S: usize,
    const W: usize,
    const OPERATION: u8,
>(
    plan: M,
    jacobian: &[[E; S]],
    minus_ha: &Block<E, S>,
    rows: &mut [PanelRow<E, S, W>],
) {
    if rows.len() != plan.nk() {
        return;
    }
    let (minus_ha, sum) = (*minus_ha, [[E::from_f64(0.0); W]; S]);
    let mut rows = VelocityRows::<M, E, S, W, OPERATION> { plan, jacobian, minus_ha, rows, sum };
    if const { OPERATION == ELIMINATE || OPERATION == RECONSTRUCT_TRANSPOSED } {
        for_each_row::<A, _>(&mut DependentRows(rows));
    } else {
        for_each_row::<A, _>(&mut rows);
    }
}

struct VelocityRows<'a, M, E, const S: usize, const W: usize, const WHAT: u8> {
    plan: M,
    jacobian: &'a [[E; S]],
    minus_ha: Block<E, S>,
    rows: &'a mut [PanelRow<E, S, W>],
    /// Partial sum of a state, between the first and the last entry by which equations depend on
    /// it.
    sum: PanelRow<E, S, W>,
}

/// Approximate number of instructions of a product with `hA`.
const fn product_instructions<E>(stages: usize, width: usize) -> usize {
    if size_of::<E>() > 8 { stages * stages * width } else { stages * stages * width.div_ceil(4) }
}

/// Operations between a kinematic state and its velocity.
impl<M: Plan, E: Lanes, const S: usize, const W: usize, const WHAT: u8> RowVisitor
    for VelocityRows<'_, M, E, S, W, WHAT>
{
    const ROWS: Option<usize> = StructureTable::Kinematic.known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Kinematic.row_count(self.plan.structure())
    }
    const INSTRUCTIONS: usize = 2 + product_instructions::<E>(S, W);
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, state: usize) {
        let Self { plan, jacobian, minus_ha, rows, .. } = self;
        let Some(kinematic) = plan.kinematic(state) else { return };
        let (Some(velocity), Some(minus_c)) = (plan.velocity(kinematic), minus_c(kinematic, jacobian)) else {
            return;
        };
        let (from, to) = if const { WHAT == RECONSTRUCT } { (velocity, state) } else { (state, velocity) };
        let Some(from) = rows.get(from).in_bounds() else { return };
        let mut product = [[E::from_f64(0.0); W]; S];
        if const { WHAT == RECONSTRUCT } {
            subtract_product::<A, E, S, W>(&mut product, minus_ha, from);
        } else {
            subtract_transposed::<A, E, S, W>(&mut product, minus_ha, from);
        }
        if let Some(to) = rows.get_mut(to).in_bounds() {
            subtract_diagonal::<A, E, S, W>(to, &[minus_c; S], &product);
        }
    }
}

/// Operations between a kinematic state and the equations that depend on it.
struct DependentRows<'a, M, E, const S: usize, const W: usize, const WHAT: u8>(
    VelocityRows<'a, M, E, S, W, WHAT>,
);

impl<M: Plan, E: Lanes, const S: usize, const W: usize, const WHAT: u8> RowVisitor
    for DependentRows<'_, M, E, S, W, WHAT>
{
    const ROWS: Option<usize> = StructureTable::Dependents.known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Dependents.row_count(self.0.plan.structure())
    }
    const INSTRUCTIONS: usize = 2 + product_instructions::<E>(S, W);
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, index: usize) {
        let VelocityRows { plan, jacobian, minus_ha, rows, sum } = &mut self.0;
        let Some(kinematic) = plan.structure().elimination.dependents.get(index).in_bounds() else { return };
        let Some((slot, values, derivative)) = dependent_entry(*plan, kinematic, jacobian) else { return };
        let Some(&own) = rows.get(kinematic.state as usize).in_bounds() else { return };
        let Some(&row) = rows.get(slot).in_bounds() else { return };
        let (mut own_row, mut row) = (own, row);
        if kinematic.first {
            *sum = [[E::from_f64(0.0); W]; S];
        }
        if const { WHAT == ELIMINATE } {
            if kinematic.first {
                subtract_product::<A, E, S, W>(sum, minus_ha, &own_row);
            }
            subtract_diagonal::<A, E, S, W>(&mut row, values, if derivative { &own_row } else { sum });
            if let Some(to) = rows.get_mut(slot).in_bounds() {
                *to = row;
            }
            return;
        }
        if derivative {
            subtract_diagonal::<A, E, S, W>(&mut own_row, values, &row);
        } else {
            subtract_diagonal::<A, E, S, W>(sum, values, &row);
        }
        if kinematic.last {
            // `own + (hA)ᵀ sum`
            subtract_transposed::<A, E, S, W>(&mut own_row, minus_ha, sum);
        }
        if let (true, Some(to)) = (derivative || kinematic.last, rows.get_mut(kinematic.state as usize)) {
            *to = own_row;
        }
    }
}

/// A panel of forward sensitivities.
pub(super) struct KinematicPanel<'a, M, E, D, const S: usize, const W: usize> {
    pub plan: M,
    pub jacobian: &'a [[E; S]],
    /// `V` at the start of the step.
    pub v: &'a [[E; W]],
    pub directions: D,
    /// The first column of the panel.
    pub column: usize,
}

impl<M: Plan, E: Lanes, D: Directions<E>, const S: usize, const W: usize> KinematicPanel<'_, M, E, D, S, W> {
    /// `c V_v`
    #[inline(always)]
    pub fn velocity_directions<A: Arithmetic>(&self, kinematic: &Kinematic) -> [E; W] {
        let mut row = [E::from_f64(0.0); W];
        let Some(minus_c) = minus_c(kinematic, self.jacobian) else { return row };
        match self.plan.velocity(kinematic) {
            Some(velocity) => {
                if let Some(v) = self.v.get(velocity).in_bounds() {
                    A::subtract_row(&mut row, minus_c, v);
                }
            }
            None => {
                let input = kinematic.velocity as usize - self.plan.nk();
                self.directions.add_scaled(input, -minus_c, self.column, &mut row);
            }
        }
        row
    }

    /// Writes `V_q + h c_i c V_v`, the factor of the entries of `f_q`, to the rows of the states.
    #[inline(always)]
    pub fn write_states<A: Arithmetic>(&self, nodes: &[E; S], rows: &mut [PanelRow<E, S, W>]) {
        for state in 0..StructureTable::Kinematic.row_count(self.plan.structure()) {
            let Some(kinematic) = self.plan.kinematic(state) else { continue };
            let (own, Some(v), Some(to)) =
                (self.velocity_directions::<A>(kinematic), self.v.get(state), rows.get_mut(state))
            else {
                continue;
            };
            for (to, &node) in to.iter_mut().zip(nodes) {
                let mut row = *v;
                A::subtract_row(&mut row, -node, &own);
                *to = row;
            }
        }
    }

    /// Subtracts `f_q̇ c V_v` from the equations that depend on the derivative of a kinematic
    /// state.
    #[inline(always)]
    pub fn subtract_derivative_terms<A: Arithmetic>(&self, rows: &mut [PanelRow<E, S, W>]) {
        if const { !depend_on_derivatives::<M>() } {
            return;
        }
        for dependent in self.plan.structure().elimination.dependents {
            let of = self.plan.kinematic(dependent.state as usize);
            if let (Some(of), Some((slot, values, true))) =
                (of, dependent_entry(self.plan, dependent, self.jacobian))
                && let Some(row) = rows.get_mut(slot).in_bounds()
            {
                let own = self.velocity_directions::<A>(of);
                subtract_diagonal::<A, E, S, W>(row, values, &[own; S]);
            }
        }
    }

    /// Computes `dk_q = c (V_v + hA dk_v)`, and passes it to the visitor.
    #[inline(always)]
    pub fn reconstruct<A: Arithmetic>(
        &self,
        minus_ha: &Block<E, S>,
        rows: &mut [PanelRow<E, S, W>],
        visitor: &mut impl Visitor<E, S, W>,
    ) {
        for_each_row::<A, _>(&mut ReconstructPanel { panel: self, minus_ha, rows, visitor });
    }
}

/// See [`KinematicPanel::reconstruct`].
struct ReconstructPanel<'a, 'b, M, E, D, V, const S: usize, const W: usize> {
    panel: &'b KinematicPanel<'a, M, E, D, S, W>,
    minus_ha: &'b Block<E, S>,
    rows: &'b mut [PanelRow<E, S, W>],
    visitor: &'b mut V,
}

impl<M: Plan, E: Lanes, D: Directions<E>, V: Visitor<E, S, W>, const S: usize, const W: usize> RowVisitor
    for ReconstructPanel<'_, '_, M, E, D, V, S, W>
{
    const ROWS: Option<usize> = StructureTable::Kinematic.known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Kinematic.row_count(self.panel.plan.structure())
    }
    const INSTRUCTIONS: usize = 4 + product_instructions::<E>(S, W);
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, state: usize) {
        let Self { panel: forward, minus_ha, rows, visitor } = self;
        let Some(kinematic) = forward.plan.kinematic(state) else { return };
        let mut panel_row = [[E::from_f64(0.0); W]; S];
        match (forward.plan.velocity(kinematic), minus_c(kinematic, forward.jacobian)) {
            (Some(velocity), Some(minus_c)) => {
                if let (Some(v), Some(dk)) = (forward.v.get(velocity), rows.get(velocity).in_bounds()) {
                    panel_row = [*v; S];
                    subtract_product::<A, E, S, W>(&mut panel_row, minus_ha, dk);
                }
                each!(i < S => {
                    each!(w < W => { panel_row[i][w] = -(minus_c * panel_row[i][w]); });
                });
            }
            _ => panel_row = [forward.velocity_directions::<A>(kinematic); S],
        }
        if let Some(row) = rows.get_mut(state).in_bounds() {
            *row = panel_row;
        }
        visitor.on_solved::<A>(state, &panel_row);
    }
}

/// Whether an equation other than its own may depend on the derivative of a kinematic state.
const fn depend_on_derivatives<M: Plan>() -> bool {
    let Some(structure) = M::KNOWN_STRUCTURE else { return true };
    let (dependents, mut index) = (structure.elimination.dependents, 0);
    while index < dependents.len() {
        if (dependents[index].entry as usize) < structure.blocks[1] {
            return true;
        }
        index += 1;
    }
    false
}
