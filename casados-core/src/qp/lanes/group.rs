//! A group of problems, one in each lane, and the solution of their equations for given active
//! sets.
//!
//! ```text
//! M = H + [A B]ᵀ P₊ [A B],  m = g + [A B]ᵀ (p₊ + P₊ b)        of a control at a bound: its row is u = bound
//! M_uu = L Lᵀ,  K = M_xu L⁻ᵀ,  P = M_xx − K Kᵀ,  p = m_x − K L⁻¹ m_u
//! ```
//!
//! as in [`interior::riccati`](super::super::interior), followed by a forward sweep for states and
//! controls and a backward sweep for multipliers. The gradient by a control at a bound is its
//! multiplier; for other controls it is the residual.

use super::cells::{
    Matrix, Start, assign_negated, mirror, product, scale, subtract, subtract_scaled, subtract_transposed,
};
use crate::qp::layout::{StageDims, copy_common, part, part_mut, take_mut};
use crate::scalar::Lanes;

/// The ratio of a pivot to its diagonal element below which it may be a rounding error: such a
/// problem leaves the group.
const SMALL_PIVOT: f64 = 1e-7;

/// The dimensions of the problems of a group; all stages are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    pub nx: usize,
    pub nu: usize,
    pub intervals: usize,
}

impl Size {
    /// Returns the size if all stages have equal dimensions, without general constraints, and the
    /// last one has no controls.
    pub fn of(dims: &[StageDims]) -> Option<Self> {
        let (last, before) = dims.split_last()?;
        let StageDims { nx, nu, .. } = *before.first()?;
        let alike = before.iter().all(|stage| *stage == StageDims::new(nx, nu, 0));
        (alike && *last == StageDims::new(nx, 0, 0) && nx > 0 && nu > 0).then_some(Self {
            nx,
            nu,
            intervals: before.len(),
        })
    }
    /// `nx + nu`
    pub const fn n(&self) -> usize {
        self.nx + self.nu
    }
    /// Returns the number of cells of a group.
    pub const fn cells(&self) -> usize {
        let (Self { nx, nu, intervals }, n) = (*self, self.n());
        (intervals + 1) * (n * n + 2 * n + nx)
            + intervals * (n * nx + nx + 3 * nu + n * nu + 3 * nu)
            + nx * nx
            + n * nx
            + n * n
            + 2 * n
            + 1
    }
}

/// The data of a group, its active sets, and its point; arrays over the horizon.
pub struct Group<'m, C> {
    pub size: Size,
    /// `[A B]ᵀ`, a column for each next state.
    pub dynamics: &'m mut [C],
    /// Both triangles; at the last stage the rows of controls are zero.
    pub hessian: &'m mut [C],
    pub gradient: &'m mut [C],
    /// `b`
    pub offset: &'m mut [C],
    pub lower: &'m mut [C],
    pub upper: &'m mut [C],
    /// The active bound of a control: −1 for the lower, 1 for the upper, 0 for none.
    pub active: &'m mut [C],
    /// `(x, u)`
    pub v: &'m mut [C],
    /// `π` of the dynamics of the previous stage; at the first stage the gradient by its state.
    pub multipliers: &'m mut [C],
    /// The gradient of the Lagrangian by the controls, without multipliers of their bounds.
    pub slope: &'m mut [C],
    /// Nonzero if a pivot is weak.
    pub has_small_pivot: &'m mut [C],
    /// `(K; L)`
    panels: &'m mut [C],
    /// Reciprocals of pivots, and `L⁻¹ m_u`.
    inverse: &'m mut [C],
    y: &'m mut [C],
    /// Of the current stage: `P`, `−[A B]ᵀ P`, `M`, `m`, `−(p + P b)`.
    p: &'m mut [C],
    w: &'m mut [C],
    m: &'m mut [C],
    pub g: &'m mut [C],
    pub minus: &'m mut [C],
}

impl<'m, C: Copy> Group<'m, C> {
    /// A group in memory of [`Size::cells`].
    pub fn new(size: Size, mut memory: &'m mut [C]) -> Self {
        let (Size { nx, nu, intervals }, n) = (size, size.n());
        let memory = &mut memory;
        let mut take = |length| take_mut(memory, length);
        Self {
            size,
            dynamics: take(intervals * n * nx),
            hessian: take((intervals + 1) * n * n),
            gradient: take((intervals + 1) * n),
            offset: take(intervals * nx),
            lower: take(intervals * nu),
            upper: take(intervals * nu),
            active: take(intervals * nu),
            v: take((intervals + 1) * n),
            multipliers: take((intervals + 1) * nx),
            slope: take(intervals * nu),
            has_small_pivot: take(1),
            panels: take(intervals * n * nu),
            inverse: take(intervals * nu),
            y: take(intervals * nu),
            p: take(nx * nx),
            w: take(n * nx),
            m: take(n * n),
            g: take(n),
            minus: take(n),
        }
    }

    /// Computes the solution for the active sets.
    #[inline(always)]
    pub fn solve<E: Lanes<Cell = C>>(&mut self) {
        self.backward::<E>();
        self.forward::<E>();
        self.dynamics_multipliers::<E>();
    }

    /// Sweeps backward, and detects weak pivots.
    #[inline(always)]
    pub fn backward<E: Lanes<Cell = C>>(&mut self) {
        let (Size { nx, nu, intervals }, n) = (self.size, self.size.n());
        let last = part(self.hessian, intervals * n * n, n * n);
        for (p, h) in self.p.chunks_exact_mut(nx.max(1)).zip(last.chunks_exact(n.max(1))) {
            copy_common(p, h);
        }
        copy_common(self.g, part(self.gradient, intervals * n, n));
        let mut weak = E::from_f64(0.0);
        for k in (0..intervals).rev() {
            let dynamics = Matrix { data: part(self.dynamics, k * n * nx, n * nx), ld: n };
            let hessian = Matrix { data: part(self.hessian, k * n * n, n * n), ld: n };
            let p = Matrix { data: &*self.p, ld: nx };
            assign_negated::<E>(part_mut(self.minus, 0, nx), self.g);
            subtract::<E>(self.minus, p, part(self.offset, k * nx, nx), [nx, nx]);
            product::<E>((self.w, n), Start::Zero, (dynamics, p), [n, nx, nx], false);
            let w = Matrix { data: &*self.w, ld: n };
            product::<E>((self.m, n), Start::Matrix(hessian), (dynamics, w), [n, n, nx], true);
            copy_common(self.g, part(self.gradient, k * n, n));
            subtract::<E>(self.g, dynamics, self.minus, [n, nx]);
            self.fix_active::<E>(k);
            weak = weak + self.eliminate::<E>(k);
            let panel = Matrix { data: part(self.panels, k * n * nu, n * nu), ld: n };
            let start = Start::Matrix(Matrix { data: &*self.m, ld: n });
            product::<E>((self.p, nx), start, (panel, panel), [nx, nx, nu], true);
            mirror(self.p, nx);
        }
        for to in self.has_small_pivot.iter_mut() {
            weak.store(to);
        }
    }

    /// Copies the columns of controls to a panel. A control at a bound gets the row and column of
    /// the identity; its effect on other controls is in their gradients.
    #[inline(always)]
    fn fix_active<E: Lanes<Cell = C>>(&mut self, k: usize) {
        let (Size { nx, nu, .. }, n) = (self.size, self.size.n());
        let panel = part_mut(self.panels, k * n * nu, n * nu);
        for (c, column) in panel.chunks_exact_mut(n.max(1)).enumerate() {
            let of_controls = part(self.m, (nx + c) * n, n);
            for (i, to) in column.iter_mut().enumerate() {
                // Only the lower triangle is stored.
                let from = if i >= nx + c { of_controls.get(i) } else { self.m.get(i * n + nx + c) };
                if let Some(&from) = from {
                    *to = from;
                }
            }
        }
        let (zero, one) = (E::from_f64(0.0), E::from_f64(1.0));
        let active = part(self.active, k * nu, nu);
        let (lower, upper) = (part(self.lower, k * nu, nu), part(self.upper, k * nu, nu));
        let bound = |active: E, lower: &C, upper: &C| {
            let at_upper = E::select(E::lt(zero, active), E::load(upper), zero);
            E::select(E::lt(active, zero), E::load(lower), at_upper)
        };
        let controls = || active.iter().zip(lower).zip(upper).enumerate();
        for (c, ((active, lower), upper)) in controls() {
            let bound = bound(E::load(active), lower, upper);
            subtract_scaled(self.g, -bound, part(panel, c * n, n));
        }
        for (c, ((active, lower), upper)) in controls() {
            let active = E::load(active);
            let (fixed, bound) = (active * active, bound(active, lower, upper));
            let free = one - fixed;
            scale(part_mut(panel, c * n, n), free);
            for column in panel.chunks_exact_mut(n.max(1)) {
                scale(part_mut(column, nx + c, 1), free);
            }
            for pivot in part_mut(panel, c * n + nx + c, 1) {
                (E::load(pivot) + fixed).store(pivot);
            }
            for g in part_mut(self.g, nx + c, 1) {
                (E::load(g) * free - bound).store(g);
            }
        }
    }

    /// Eliminates the controls of a stage; returns a nonzero number where a pivot is weak.
    #[inline(always)]
    fn eliminate<E: Lanes<Cell = C>>(&mut self, k: usize) -> E {
        let (Size { nx, nu, .. }, n) = (self.size, self.size.n());
        let (zero, one, part_of) = (E::from_f64(0.0), E::from_f64(1.0), E::from_f64(SMALL_PIVOT));
        let panel = part_mut(self.panels, k * n * nu, n * nu);
        let inverse = part_mut(self.inverse, k * nu, nu);
        let y = part_mut(self.y, k * nu, nu);
        let mut weak = zero;
        for (c, (inverse, y)) in inverse.iter_mut().zip(y).enumerate() {
            let (before, rest) = panel.split_at_mut_checked(c * n).unwrap_or_default();
            let column = part_mut(rest, 0, n);
            let diagonal = column.get(nx + c).map_or(one, E::load);
            for other in before.chunks_exact(n.max(1)) {
                let factor = other.get(nx + c).map_or(zero, E::load);
                subtract_scaled(part_mut(column, 0, nx), factor, other);
                subtract_scaled(part_mut(column, nx + c, nu - c), factor, part(other, nx + c, nu - c));
            }
            let pivot = column.get(nx + c).map_or(one, E::load);
            weak = weak + E::select(E::lt(pivot, part_of * diagonal), one, zero);
            let reciprocal = one / pivot.sqrt();
            reciprocal.store(inverse);
            scale(part_mut(column, 0, nx), reciprocal);
            scale(part_mut(column, nx + c, nu - c), reciprocal);
            let factor = self.g.get(nx + c).map_or(zero, E::load) * reciprocal;
            factor.store(y);
            subtract_scaled(part_mut(self.g, 0, nx), factor, column);
            subtract_scaled(part_mut(self.g, nx + c, nu - c), factor, part(column, nx + c, nu - c));
        }
        weak
    }

    #[inline(always)]
    fn forward<E: Lanes<Cell = C>>(&mut self) {
        let (Size { nx, nu, intervals }, n) = (self.size, self.size.n());
        for k in 0..intervals {
            let panel = part(self.panels, k * n * nu, n * nu);
            let (here, next) = self.v.split_at_mut_checked((k + 1) * n).unwrap_or_default();
            let here = part_mut(here, k * n, n);
            let (x, controls) = here.split_at_mut_checked(nx).unwrap_or_default();
            // `Lᵀ u = −(y + Kᵀ x)`
            assign_negated::<E>(controls, part(self.y, k * nu, nu));
            let panels = Matrix { data: panel, ld: n };
            subtract_transposed::<E>(controls, panels, x);
            for c in (0..nu).rev() {
                let (until, after) = controls.split_at_mut_checked(c + 1).unwrap_or_default();
                let Some(u) = until.last_mut() else { break };
                let mut sum = E::load(u);
                for (u, factor) in after.iter().zip(part(panel, c * n + nx + c + 1, nu - c - 1)) {
                    sum = sum.subtract_product(E::load(factor), E::load(u));
                }
                let inverse = self.inverse.get(k * nu + c).map_or(sum, E::load);
                (sum * inverse).store(u);
            }
            let minus = part_mut(self.minus, 0, nx);
            assign_negated::<E>(minus, part(self.offset, k * nx, nx));
            let dynamics = Matrix { data: part(self.dynamics, k * n * nx, n * nx), ld: n };
            subtract_transposed::<E>(minus, dynamics, here);
            assign_negated::<E>(part_mut(next, 0, nx), minus);
        }
    }

    /// Computes the multipliers of the dynamics, and the slopes.
    #[inline(always)]
    fn dynamics_multipliers<E: Lanes<Cell = C>>(&mut self) {
        let (Size { nx, nu, intervals }, n) = (self.size, self.size.n());
        for k in (0..=intervals).rev() {
            copy_common(self.g, part(self.gradient, k * n, n));
            assign_negated::<E>(self.minus, part(self.v, k * n, n));
            let hessian = Matrix { data: part(self.hessian, k * n * n, n * n), ld: n };
            subtract::<E>(self.g, hessian, self.minus, [n, if k < intervals { n } else { nx }]);
            if k < intervals {
                assign_negated::<E>(part_mut(self.minus, 0, nx), part(self.multipliers, (k + 1) * nx, nx));
                let dynamics = Matrix { data: part(self.dynamics, k * n * nx, n * nx), ld: n };
                subtract::<E>(self.g, dynamics, self.minus, [n, nx]);
                copy_common(part_mut(self.slope, k * nu, nu), part(self.g, nx, nu));
            }
            copy_common(part_mut(self.multipliers, k * nx, nx), part(self.g, 0, nx));
        }
    }
}
