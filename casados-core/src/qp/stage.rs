//! Views of the data of one stage: matrices, vectors and bounds.

use super::block::{Block, BlockMut, MatrixLayout};
use super::bounds::{Bounds, BoundsMut};
use super::error::QpField;
use super::layout::{StageDims, StageOffsets, part, part_mut, take_mut};
use crate::scalar::Real;

/// The data of one stage.
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// // ½ vᵀ [Q Sᵀ; S R] v + qᵀx + rᵀu, x₊ = A x + B u + b.
/// let stage = qp.view().stages().next().unwrap();
/// assert_eq!((stage.dims().nx, stage.dims().nu), (1, 1));
/// assert_eq!((stage.r().get(0, 0), stage.b().get(0, 0)), (Some(0.1), Some(1.0)));
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a, T> {
    pub(super) place: StageOffsets,
    pub(super) data: &'a [T],
}

/// A mutable view of the data of one stage.
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// for mut stage in qp.stages_mut() {
///     stage.q_mut().set(0, 0, 3.0); // the weight of the state
/// }
/// assert_eq!(qp.view().stages().filter_map(|stage| stage.q().get(0, 0)).sum::<f64>(), 12.0);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Debug)]
pub struct StageMut<'a, T> {
    pub(super) place: StageOffsets,
    pub(super) data: &'a mut [T],
}

/// The six vectors over the constraints of a stage.
#[derive(Clone, Copy)]
pub(super) enum ConstraintVector {
    Lower,
    Upper,
    LowerLinear,
    LowerQuadratic,
    UpperLinear,
    UpperQuadratic,
}

impl StageOffsets {
    /// Returns the offset of the gradient in the data of the stage.
    pub(super) const fn gradient(&self) -> usize {
        self.matrix() + self.hessian()
    }
    /// Returns the offset of the constant part of the dynamics.
    pub(super) const fn offset(&self) -> usize {
        self.gradient() + self.ld
    }
    /// Returns the offset of a vector over constraints.
    pub(super) const fn constraint_vector_begin(&self, row: ConstraintVector) -> usize {
        self.offset() + self.ld_next + row as usize * self.rows
    }
    fn shape(&self, field: QpField) -> (usize, MatrixLayout) {
        let Self { nx, nu, ng, next, ld, stage, .. } = *self;
        let (matrix, hessian) = (0, self.matrix());
        let (begin, rows, columns, row, column) = match field {
            QpField::A => (matrix, next, nx, ld, 1),
            QpField::B => (matrix + nx, next, nu, ld, 1),
            QpField::C => (matrix + next * ld, ng, nx, ld, 1),
            QpField::D => (matrix + next * ld + nx, ng, nu, ld, 1),
            QpField::Q => (hessian, nx, nx, 1, ld),
            QpField::R => (hessian + nx * ld + nx, nu, nu, 1, ld),
            // The rows of `u` below the columns of `x`.
            _ => (hessian + nx, nu, nx, 1, ld),
        };
        (begin, MatrixLayout { field, stage, rows, columns, row, column })
    }
    /// Returns the offset of a kind of constraints in vectors over constraints, and their number.
    pub(super) const fn constraint_range(&self, field: QpField) -> (usize, usize) {
        match field {
            QpField::StateBounds => (0, self.nx),
            QpField::ControlBounds => (self.nx, self.nu),
            _ => (self.ld, self.ng),
        }
    }
    /// Returns the kind of constraint of a row and its index.
    pub(super) const fn field_of_row(&self, row: usize) -> (QpField, usize) {
        if row < self.nx {
            (QpField::StateBounds, row)
        } else if row < self.ld {
            (QpField::ControlBounds, row - self.nx)
        } else {
            (QpField::GeneralBounds, row - self.ld)
        }
    }
}

macro_rules! matrices {
    ($($(#[$attribute:meta])* $name:ident $name_mut:ident $field:ident;)*) => {
        impl<'a, T: Real> Stage<'a, T> { $(
            $(#[$attribute])*
            #[must_use]
            pub fn $name(&self) -> Block<'a, T> {
                let (begin, shape) = self.place.shape(QpField::$field);
                Block { data: self.data.get(begin..).unwrap_or_default(), shape }
            }
        )* }
        impl<'a, T: Real> StageMut<'a, T> { $(
            $(#[$attribute])*
            pub fn $name_mut(&mut self) -> BlockMut<'_, T> {
                let (begin, shape) = self.place.shape(QpField::$field);
                BlockMut { data: self.data.get_mut(begin..).unwrap_or_default(), shape }
            }
        )* }
    };
}

matrices! {
    /// `A`, `∂x₊/∂x`
    a a_mut A;
    /// `B`, `∂x₊/∂u`
    b b_mut B;
    /// `C`, of the general constraints
    c c_mut C;
    /// `D`, of the general constraints
    d d_mut D;
    /// `Q`. Its lower triangle is read.
    q q_mut Q;
    /// `R`. Its lower triangle is read.
    r r_mut R;
    /// `S`, a row for each control
    s s_mut S;
}

macro_rules! vectors {
    ($($(#[$attribute:meta])* $name:ident $name_mut:ident: $place:ident => $begin:expr, $length:expr;)*) => {
        impl<'a, T: Real> Stage<'a, T> { $(
            $(#[$attribute])*
            #[must_use]
            pub fn $name(&self) -> &'a [T] {
                let $place = self.place;
                part(self.data, $begin, $length)
            }
        )* }
        impl<'a, T: Real> StageMut<'a, T> { $(
            $(#[$attribute])*
            pub fn $name_mut(&mut self) -> &mut [T] {
                let $place = self.place;
                part_mut(self.data, $begin, $length)
            }
        )* }
    };
}

vectors! {
    /// `b`, the constant part of `x₊ = A x + B u + b`
    offset offset_mut: p => p.offset(), p.next;
    /// `q`
    gradient_x gradient_x_mut: p => p.gradient(), p.nx;
    /// `r`
    gradient_u gradient_u_mut: p => p.gradient() + p.nx, p.nu;
}

macro_rules! bounds {
    ($($(#[$attribute:meta])* $name:ident $name_mut:ident $field:ident;)*) => {
        impl<'a, T: Real> Stage<'a, T> { $(
            $(#[$attribute])*
            #[must_use]
            pub fn $name(&self) -> Bounds<'a, T> {
                self.bounds(QpField::$field)
            }
        )* }
        impl<'a, T: Real> StageMut<'a, T> { $(
            $(#[$attribute])*
            pub fn $name_mut(&mut self) -> BoundsMut<'_, T> {
                self.bounds_mut(QpField::$field)
            }
        )* }
    };
}

bounds! {
    /// Bounds of the states
    x_bounds x_bounds_mut StateBounds;
    /// Bounds of the controls
    u_bounds u_bounds_mut ControlBounds;
    /// Bounds of the general constraints
    g_bounds g_bounds_mut GeneralBounds;
}

impl<'a, T: Real> Stage<'a, T> {
    /// Returns the dimensions.
    #[must_use]
    pub fn dims(&self) -> StageDims {
        StageDims::new(self.place.nx, self.place.nu, self.place.ng)
    }
    fn bounds(&self, field: QpField) -> Bounds<'a, T> {
        self.bounds_in_range(self.place.constraint_range(field))
    }
    /// Returns the bounds of all rows; the padding is zero.
    pub(crate) fn all_bounds(&self) -> Bounds<'a, T> {
        self.bounds_in_range((0, self.place.rows))
    }
    #[inline(always)]
    fn bounds_in_range(&self, (begin, length): (usize, usize)) -> Bounds<'a, T> {
        let rows = |row| part(self.data, self.place.constraint_vector_begin(row) + begin, length);
        Bounds {
            lower: rows(ConstraintVector::Lower),
            upper: rows(ConstraintVector::Upper),
            lower_linear: rows(ConstraintVector::LowerLinear),
            lower_quadratic: rows(ConstraintVector::LowerQuadratic),
            upper_linear: rows(ConstraintVector::UpperLinear),
            upper_quadratic: rows(ConstraintVector::UpperQuadratic),
        }
    }
}

impl<T: Real> StageMut<'_, T> {
    /// Returns the dimensions.
    #[must_use]
    pub fn dims(&self) -> StageDims {
        StageDims::new(self.place.nx, self.place.nu, self.place.ng)
    }
    fn bounds_mut(&mut self, field: QpField) -> BoundsMut<'_, T> {
        let (begin, length) = self.place.constraint_range(field);
        let rows = self
            .data
            .get_mut(self.place.constraint_vector_begin(ConstraintVector::Lower)..)
            .unwrap_or_default();
        let mut vectors = rows.chunks_exact_mut(self.place.rows.max(1));
        let mut next = || part_mut(vectors.next().unwrap_or_default(), begin, length);
        BoundsMut {
            lower: next(),
            upper: next(),
            lower_linear: next(),
            lower_quadratic: next(),
            upper_linear: next(),
            upper_quadratic: next(),
        }
    }
}

/// The arrays of a stage in memory: matrices column after column, over `v = (x, u)`.
pub(crate) struct Arrays<'a, T> {
    /// `nx + nu`
    pub n: usize,
    /// The stride of columns.
    pub ld: usize,
    /// The number of states of the next stage.
    pub next: usize,
    /// The offset of general constraints in vectors over constraints, and the length of these
    /// vectors.
    pub rows: usize,
    /// `[A B; C D]ᵀ`: a column for each next state, then one for each general constraint.
    pub matrix: &'a mut [T],
    /// `[Q Sᵀ; S R]`; only the lower triangle is read.
    pub hessian: &'a mut [T],
    /// `(q, r)`
    pub gradient: &'a mut [T],
    /// The constant part of the dynamics.
    pub offset: &'a mut [T],
    /// Six vectors over the constraints.
    pub limits: &'a mut [T],
}

/// The arrays that residuals depend on.
pub(crate) struct ArraysRef<'a, T> {
    pub n: usize,
    pub ld: usize,
    pub next: usize,
    pub matrix: &'a [T],
    pub hessian: &'a [T],
    pub gradient: &'a [T],
    pub offset: &'a [T],
}

impl<'a, T: Real> Stage<'a, T> {
    /// Returns the arrays.
    pub(crate) fn arrays(&self) -> ArraysRef<'a, T> {
        let (p, data) = (self.place, self.data);
        ArraysRef {
            n: p.n,
            ld: p.ld,
            next: p.next,
            matrix: part(data, 0, p.matrix()),
            hessian: part(data, p.matrix(), p.hessian()),
            gradient: part(data, p.gradient(), p.ld),
            offset: part(data, p.offset(), p.ld_next),
        }
    }
}

impl<T: Real> StageMut<'_, T> {
    /// Returns the arrays.
    pub(crate) fn arrays(&mut self) -> Arrays<'_, T> {
        let p = self.place;
        let mut rest = &mut *self.data;
        Arrays {
            n: p.n,
            ld: p.ld,
            next: p.next,
            rows: p.rows,
            matrix: take_mut(&mut rest, p.matrix()),
            hessian: take_mut(&mut rest, p.hessian()),
            gradient: take_mut(&mut rest, p.ld),
            offset: take_mut(&mut rest, p.ld_next),
            limits: rest,
        }
    }
}
