//! The data of a QP.

use super::block::{Block, BlockMut, Shape};
use super::error::{Field, QpError};
use super::layout::{Place, Places, StageDims, assign, end, is_absurd, part, part_mut};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::marker::PhantomData;

/// A quadratic program with the structure of optimal control, over memory of its owner.
///
/// With the feature `alloc`, `Qp::new(&dims)` has its memory on the heap; elsewhere
/// [`Qp::in_memory`] takes arrays or static slices of [`Qp::memory`] numbers. See the
/// [module](super) for the problem.
///
/// A new QP is all zero, without bounds. A state at the start that is given is one whose two bounds
/// are equal: [`Qp::fix_initial_state`].
#[derive(Clone, Debug)]
pub struct Qp<T, D, M> {
    dims: D,
    memory: M,
    /// How many numbers the stages take; behind them is a mark for every state and control of the
    /// first one.
    stages: usize,
    number: PhantomData<T>,
}

/// A QP with its memory on the heap.
#[cfg(feature = "alloc")]
pub type HeapQp<T = f64> = Qp<T, Vec<StageDims>, Vec<T>>;

/// The data of a QP, for solvers.
#[derive(Clone, Copy, Debug)]
pub struct QpView<'a, T> {
    pub(crate) dims: &'a [StageDims],
    pub(super) data: &'a [T],
    /// Periodic states and shared controls.
    pub(super) marks: &'a [T],
}

/// The data of one stage.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a, T> {
    pub(super) place: Place,
    pub(super) data: &'a [T],
}

/// The data of one stage, to be written.
#[derive(Debug)]
pub struct StageMut<'a, T> {
    place: Place,
    data: &'a mut [T],
}

/// Bounds of some components, and what it costs to leave them.
///
/// A violation `e` of a soft bound costs `linear · e + ½ quadratic · e²`. A bound whose linear
/// penalty is infinite, as that of every new QP, is hard.
#[derive(Clone, Copy, Debug)]
pub struct Bounds<'a, T> {
    /// −∞ where there is none.
    pub lower: &'a [T],
    /// +∞ where there is none.
    pub upper: &'a [T],
    /// Linear penalties of the lower bounds.
    pub lower_linear: &'a [T],
    /// Quadratic penalties of the lower bounds.
    pub lower_quadratic: &'a [T],
    /// Linear penalties of the upper bounds.
    pub upper_linear: &'a [T],
    /// Quadratic penalties of the upper bounds.
    pub upper_quadratic: &'a [T],
}

/// As [`Bounds`], to be written.
#[derive(Debug)]
pub struct BoundsMut<'a, T> {
    /// −∞ where there is none.
    pub lower: &'a mut [T],
    /// +∞ where there is none.
    pub upper: &'a mut [T],
    /// Linear penalties of the lower bounds.
    pub lower_linear: &'a mut [T],
    /// Quadratic penalties of the lower bounds.
    pub lower_quadratic: &'a mut [T],
    /// Linear penalties of the upper bounds.
    pub upper_linear: &'a mut [T],
    /// Quadratic penalties of the upper bounds.
    pub upper_quadratic: &'a mut [T],
}

impl<T: Real> BoundsMut<'_, T> {
    /// One component.
    pub fn set(&mut self, index: usize, lower: T, upper: T) {
        for (bounds, value) in [(&mut *self.lower, lower), (&mut *self.upper, upper)] {
            if let Some(bound) = bounds.get_mut(index) {
                *bound = value;
            }
        }
    }
    /// Makes both bounds of a component soft.
    pub fn soften(&mut self, index: usize, linear: T, quadratic: T) {
        let penalties = [
            (&mut *self.lower_linear, linear),
            (&mut *self.upper_linear, linear),
            (&mut *self.lower_quadratic, quadratic),
            (&mut *self.upper_quadratic, quadratic),
        ];
        for (penalties, value) in penalties {
            if let Some(penalty) = penalties.get_mut(index) {
                *penalty = value;
            }
        }
    }
}

/// What the six vectors over the constraints of a stage are.
#[derive(Clone, Copy)]
pub(super) enum Row {
    Lower,
    Upper,
    LowerLinear,
    LowerQuadratic,
    UpperLinear,
    UpperQuadratic,
}

impl Place {
    /// Begin of the gradient in the data of the stage.
    pub(super) const fn gradient(&self) -> usize {
        self.matrix() + self.hessian()
    }
    /// Begin of the offset of the dynamics.
    pub(super) const fn offset(&self) -> usize {
        self.gradient() + self.ld
    }
    /// Begin of a vector over constraints.
    pub(super) const fn row_data(&self, row: Row) -> usize {
        self.offset() + self.ld_next + row as usize * self.rows
    }
    fn shape(&self, field: Field) -> (usize, Shape) {
        let Self { nx, nu, ng, next, ld, stage, .. } = *self;
        let (matrix, hessian) = (0, self.matrix());
        let (begin, rows, columns, row, column) = match field {
            Field::A => (matrix, next, nx, ld, 1),
            Field::B => (matrix + nx, next, nu, ld, 1),
            Field::C => (matrix + next * ld, ng, nx, ld, 1),
            Field::D => (matrix + next * ld + nx, ng, nu, ld, 1),
            Field::Q => (hessian, nx, nx, 1, ld),
            Field::R => (hessian + nx * ld + nx, nu, nu, 1, ld),
            // u's rows left of the diagonal
            _ => (hessian + nx, nu, nx, 1, ld),
        };
        (begin, Shape { field, stage, rows, columns, row, column })
    }
    /// Where the constraints of a kind begin in vectors over constraints, and how many there are.
    pub(super) const fn kind(&self, field: Field) -> (usize, usize) {
        match field {
            Field::StateBounds => (0, self.nx),
            Field::ControlBounds => (self.nx, self.nu),
            _ => (self.ld, self.ng),
        }
    }
    /// What a row is.
    pub(super) const fn name(&self, row: usize) -> (Field, usize) {
        if row < self.nx {
            (Field::StateBounds, row)
        } else if row < self.ld {
            (Field::ControlBounds, row - self.nx)
        } else {
            (Field::GeneralBounds, row - self.ld)
        }
    }
}

macro_rules! matrices {
    ($($(#[$attribute:meta])* $name:ident $name_mut:ident $field:ident;)*) => {
        impl<'a, T: Real> Stage<'a, T> { $(
            $(#[$attribute])*
            #[must_use]
            pub fn $name(&self) -> Block<'a, T> {
                let (begin, shape) = self.place.shape(Field::$field);
                Block { data: self.data.get(begin..).unwrap_or_default(), shape }
            }
        )* }
        impl<'a, T: Real> StageMut<'a, T> { $(
            $(#[$attribute])*
            pub fn $name_mut(&mut self) -> BlockMut<'_, T> {
                let (begin, shape) = self.place.shape(Field::$field);
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
                self.bounds(Field::$field)
            }
        )* }
        impl<'a, T: Real> StageMut<'a, T> { $(
            $(#[$attribute])*
            pub fn $name_mut(&mut self) -> BoundsMut<'_, T> {
                self.bounds_mut(Field::$field)
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
    /// The dimensions.
    #[must_use]
    pub fn dims(&self) -> StageDims {
        StageDims::new(self.place.nx, self.place.nu, self.place.ng)
    }
    fn bounds(&self, field: Field) -> Bounds<'a, T> {
        self.some_bounds(self.place.kind(field))
    }
    /// Those of everything; what is padding is zero.
    pub(crate) fn all_bounds(&self) -> Bounds<'a, T> {
        self.some_bounds((0, self.place.rows))
    }
    #[inline(always)]
    fn some_bounds(&self, (begin, length): (usize, usize)) -> Bounds<'a, T> {
        let rows = |row| part(self.data, self.place.row_data(row) + begin, length);
        Bounds {
            lower: rows(Row::Lower),
            upper: rows(Row::Upper),
            lower_linear: rows(Row::LowerLinear),
            lower_quadratic: rows(Row::LowerQuadratic),
            upper_linear: rows(Row::UpperLinear),
            upper_quadratic: rows(Row::UpperQuadratic),
        }
    }
}

impl<T: Real> StageMut<'_, T> {
    /// The dimensions.
    #[must_use]
    pub fn dims(&self) -> StageDims {
        StageDims::new(self.place.nx, self.place.nu, self.place.ng)
    }
    fn bounds_mut(&mut self, field: Field) -> BoundsMut<'_, T> {
        let (begin, length) = self.place.kind(field);
        let rows = self.data.get_mut(self.place.row_data(Row::Lower)..).unwrap_or_default();
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

/// The arrays of a stage as they lie in memory: matrices column after column, over `v = (x, u)`.
pub(crate) struct Arrays<'a, T> {
    /// `nx + nu`
    pub n: usize,
    /// The distance of columns.
    pub ld: usize,
    /// States of the next stage.
    pub next: usize,
    /// Where general constraints begin in vectors over constraints, and their length.
    pub rows: usize,
    /// `[A B; C D]ᵀ`: a column for each next state, then one for each general constraint.
    pub matrix: &'a mut [T],
    /// `[Q Sᵀ; S R]`, of which the lower triangle counts.
    pub hessian: &'a mut [T],
    /// `(q, r)`
    pub gradient: &'a mut [T],
    /// The constant part of the dynamics.
    pub offset: &'a mut [T],
    /// Six vectors over the constraints.
    pub limits: &'a mut [T],
}

/// Those of them that a point is judged by.
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
    /// The arrays.
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
    /// The arrays.
    pub(crate) fn arrays(&mut self) -> Arrays<'_, T> {
        let p = self.place;
        let mut rest = &mut *self.data;
        Arrays {
            n: p.n,
            ld: p.ld,
            next: p.next,
            rows: p.rows,
            matrix: super::layout::take_mut(&mut rest, p.matrix()),
            hessian: super::layout::take_mut(&mut rest, p.hessian()),
            gradient: super::layout::take_mut(&mut rest, p.ld),
            offset: super::layout::take_mut(&mut rest, p.ld_next),
            limits: rest,
        }
    }
}

impl<'a, T: Real> QpView<'a, T> {
    /// The dimensions of the stages.
    #[must_use]
    pub fn dims(&self) -> &'a [StageDims] {
        self.dims
    }
    /// A stage.
    #[must_use]
    pub fn stage(&self, stage: usize) -> Option<Stage<'a, T>> {
        self.stages().nth(stage)
    }
    /// All stages, in order.
    pub fn stages(&self) -> impl DoubleEndedIterator<Item = Stage<'a, T>> + ExactSizeIterator + use<'a, T> {
        let data = self.data;
        Places::<T>::new(self.dims)
            .map(move |place| Stage { place, data: part(data, place.data, place.data_len()) })
    }
}

#[cfg(feature = "alloc")]
impl<T: Real> HeapQp<T> {
    /// A QP with its memory on the heap.
    ///
    /// # Errors
    /// [`QpError::OutOfMemory`]; [`QpError::Dimension`] if there is no stage.
    pub fn new(dims: &[StageDims]) -> Result<Self, QpError> {
        Self::in_memory(super::memory::copy(dims)?, super::memory::zeros(Self::memory(dims))?)
    }
}

impl<T: Real, D, M> Qp<T, D, M> {
    /// How many numbers the data takes; `usize::MAX` if they are more than that.
    #[must_use]
    pub const fn memory(dims: &[StageDims]) -> usize {
        if is_absurd(dims) { usize::MAX } else { end::<T>(dims).data + marks(dims) }
    }
}

impl<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Qp<T, D, M> {
    /// A QP in given memory, of at least [`Qp::memory`] numbers.
    ///
    /// # Errors
    /// [`QpError::Dimension`] if there is less, or no stage.
    pub fn in_memory(dims: D, memory: M) -> Result<Self, QpError> {
        let (expected, found) = (Self::memory(dims.as_ref()), memory.as_ref().len());
        if dims.as_ref().is_empty() {
            return Err(QpError::Dimension { field: Field::Stages, stage: 0, expected: 1, found: 0 });
        }
        if found < expected {
            return Err(QpError::Dimension { field: Field::Data, stage: 0, expected, found });
        }
        let stages = end::<T>(dims.as_ref()).data;
        let mut qp = Self { dims, memory, stages, number: PhantomData };
        qp.clear();
        Ok(qp)
    }
    /// All zero, without bounds.
    pub fn clear(&mut self) {
        let Self { dims, memory, .. } = self;
        clear(dims.as_ref(), memory.as_mut());
    }
    /// For solvers.
    #[must_use]
    pub fn view(&self) -> QpView<'_, T> {
        let (dims, data) = (self.dims.as_ref(), self.memory.as_ref());
        QpView { dims, data, marks: part(data, self.stages, marks(dims)) }
    }
    /// Periodic states and shared controls.
    pub(super) fn marks_mut(&mut self) -> &mut [T] {
        part_mut(self.memory.as_mut(), self.stages, marks(self.dims.as_ref()))
    }
    /// The dimensions of the stages.
    #[must_use]
    pub fn dims(&self) -> &[StageDims] {
        self.dims.as_ref()
    }
    /// A stage, to be written.
    pub fn stage_mut(&mut self, stage: usize) -> Option<StageMut<'_, T>> {
        let place = Places::<T>::new(self.dims.as_ref()).nth(stage)?;
        Some(StageMut { place, data: part_mut(self.memory.as_mut(), place.data, place.data_len()) })
    }
    /// All stages, in order, to be written.
    pub fn stages_mut(&mut self) -> impl Iterator<Item = StageMut<'_, T>> {
        stages_mut(self.dims.as_ref(), self.memory.as_mut())
    }
    /// All numbers.
    #[cfg(feature = "alloc")]
    pub(super) fn data_mut(&mut self) -> &mut [T] {
        self.memory.as_mut()
    }
    /// `x₀`, by two equal bounds of every component, which are hard.
    ///
    /// # Errors
    /// [`QpError::Dimension`]
    pub fn fix_initial_state(&mut self, x0: &[T]) -> Result<(), QpError> {
        let Some(mut stage) = self.stage_mut(0) else { return Ok(()) };
        let bounds = stage.x_bounds_mut();
        let (expected, found) = (bounds.lower.len(), x0.len());
        if expected != found {
            return Err(QpError::Dimension { field: Field::StateBounds, stage: 0, expected, found });
        }
        assign(bounds.lower, x0);
        assign(bounds.upper, x0);
        for penalties in [bounds.lower_linear, bounds.upper_linear] {
            penalties.fill(T::from_f64(f64::INFINITY));
        }
        Ok(())
    }
}

/// States and controls of the first stage.
const fn marks(dims: &[StageDims]) -> usize {
    match dims.first() {
        Some(first) => first.nx + first.nu,
        None => 0,
    }
}

/// All stages, in order, to be written.
pub(super) fn stages_mut<'a, T: Real>(
    dims: &'a [StageDims],
    mut data: &'a mut [T],
) -> impl Iterator<Item = StageMut<'a, T>> {
    Places::<T>::new(dims)
        .map(move |place| StageMut { place, data: super::layout::take_mut(&mut data, place.data_len()) })
}

/// Writes zeros and no bounds.
pub(super) fn clear<T: Real>(dims: &[StageDims], data: &mut [T]) {
    data.fill(T::ZERO);
    let infinity = T::from_f64(f64::INFINITY);
    let values = [-infinity, infinity, infinity, T::ZERO, infinity, T::ZERO];
    for stage in stages_mut(dims, data) {
        let rows = stage.data.get_mut(stage.place.row_data(Row::Lower)..).unwrap_or_default();
        for (row, value) in rows.chunks_exact_mut(stage.place.rows.max(1)).zip(values) {
            row.fill(value);
        }
    }
}
