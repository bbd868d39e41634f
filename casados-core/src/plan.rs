//! The structure of a model for kernels, bound at compile time or at run time.
//!
//! | | kernels are compiled | loops over tables | lengths |
//! | --- | --- | --- | --- |
//! | [`Known<M>`](Known) | for each model | unrolled if short | constants |
//! | [`&'static ModelTable`](ModelTable) | once for all models | loops | read |
//!
//! A kernel is generic over its plan and has it as a value, which has no size if the model is known
//! at compile time. Decisions that need constants use [`Plan::KNOWN_STRUCTURE`].

use crate::model::{ArrayK, ArrayV, ArrayX, Dae};
use crate::shape::{Plain, Shape};
use crate::structure::{Kinematic, Structure};
use core::marker::PhantomData;

/// An array if the model is known at compile time, otherwise a slice.
pub trait Elements<T>: AsRef<[T]> + AsMut<[T]> {}
impl<T, A: AsRef<[T]> + AsMut<[T]> + ?Sized> Elements<T> for A {}

/// The plan of a kernel.
pub trait Plan: Copy + Send + Sync + 'static {
    /// The structure of the model, if kernels are compiled for one model.
    const KNOWN_STRUCTURE: Option<&'static Structure>;
    /// Number of columns of the memory for directions, if it is known.
    const NC: usize;

    /// One element per differential state.
    type X<T: Plain>: Elements<T> + ?Sized;
    /// One element per unknown of a stage, or per equation.
    type K<T: Plain>: Elements<T> + ?Sized;
    /// One element per variable.
    type V<T: Plain>: Elements<T> + ?Sized;
    /// One element per entry of the Jacobian.
    type Jacobian<T: Plain>: Elements<T> + ?Sized;
    /// One element per block of the factors.
    type Factors<T: Plain>: Elements<T> + ?Sized;

    /// Returns the structure of the model.
    fn structure(self) -> &'static Structure;
    /// Returns the facts derived from the structure.
    fn facts(self) -> &'static DerivedFacts;

    /// The number of differential states.
    #[inline(always)]
    fn nx(self) -> usize {
        self.structure().x.len()
    }
    /// The number of algebraic states.
    #[inline(always)]
    fn nz(self) -> usize {
        self.structure().z.len()
    }
    /// The number of controls.
    #[inline(always)]
    fn nu(self) -> usize {
        self.structure().u.len()
    }
    /// The number of unknowns of a stage.
    #[inline(always)]
    fn nk(self) -> usize {
        self.nx() + self.nz()
    }
    /// The number of variables, time included.
    #[inline(always)]
    fn nv(self) -> usize {
        self.nx() + self.nz() + self.nw() + 1
    }
    /// The number of directions `(x₀, u, p)`.
    #[inline(always)]
    fn nw(self) -> usize {
        self.nx() + self.nu() + self.structure().p.len()
    }

    /// Returns the row of an equation in right-hand sides: that of the unknown whose pivot it is.
    #[inline(always)]
    fn slot(self, equation: usize) -> usize {
        match self.structure().elimination.slot_of_equation.get(equation) {
            Some(&slot) => slot as usize,
            None => equation,
        }
    }

    /// Returns the kinematic state of a slot, if it is [kinematic](Kinematic).
    #[inline(always)]
    fn kinematic(self, slot: usize) -> Option<&'static Kinematic> {
        kinematic(self.structure(), slot)
    }

    /// Returns the unknown of the velocity of a kinematic state, if the velocity is a state.
    #[inline(always)]
    fn velocity(self, of: &Kinematic) -> Option<usize> {
        let (nx, velocity) = (self.nx(), of.velocity as usize);
        if velocity < 2 * nx { velocity.checked_sub(nx) } else { None }
    }

    /// Returns an entry of a Jacobian: row, column, value.
    #[inline(always)]
    fn entry<V>(self, jacobian: &[V], index: usize) -> Option<(usize, usize, &V)> {
        let pattern = &self.structure().jacobian;
        let &row = pattern.rows.get(index)?;
        let &column = pattern.columns.get(index)?;
        Some((row as usize, column as usize, jacobian.get(index)?))
    }
}

/// A plan of this model, with conversions from the arrays of the model.
pub trait PlanOf<M: Dae>: Plan {
    /// One element per differential state.
    fn x<T: Plain>(of: &ArrayX<M, T>) -> &Self::X<T>;
    /// One element per unknown of a stage, or per equation.
    fn k<T: Plain>(of: &ArrayK<M, T>) -> &Self::K<T>;
    /// One element per unknown of a stage, or per equation.
    fn k_mut<T: Plain>(of: &mut ArrayK<M, T>) -> &mut Self::K<T>;
    /// One element per variable.
    fn v<T: Plain>(of: &ArrayV<M, T>) -> &Self::V<T>;
    /// One element per variable.
    fn v_mut<T: Plain>(of: &mut ArrayV<M, T>) -> &mut Self::V<T>;
    /// One element per entry of the Jacobian.
    fn jacobian<T: Plain>(of: &M::Jacobian<T>) -> &Self::Jacobian<T>;
    /// One element per block of the factors.
    fn factors_mut<T: Plain>(of: &mut M::Factors<T>) -> &mut Self::Factors<T>;
}

/// Converts arrays of a model to those of a plan.
macro_rules! arrays {
    ($M:ident: $of:ident => $as_ref:expr, $as_mut:expr) => {
        #[inline(always)]
        fn x<T: Plain>($of: &ArrayX<$M, T>) -> &Self::X<T> {
            $as_ref
        }
        #[inline(always)]
        fn k<T: Plain>($of: &ArrayK<$M, T>) -> &Self::K<T> {
            $as_ref
        }
        #[inline(always)]
        fn k_mut<T: Plain>($of: &mut ArrayK<$M, T>) -> &mut Self::K<T> {
            $as_mut
        }
        #[inline(always)]
        fn v<T: Plain>($of: &ArrayV<$M, T>) -> &Self::V<T> {
            $as_ref
        }
        #[inline(always)]
        fn v_mut<T: Plain>($of: &mut ArrayV<$M, T>) -> &mut Self::V<T> {
            $as_mut
        }
        #[inline(always)]
        fn jacobian<T: Plain>($of: &$M::Jacobian<T>) -> &Self::Jacobian<T> {
            $as_ref
        }
        #[inline(always)]
        fn factors_mut<T: Plain>($of: &mut $M::Factors<T>) -> &mut Self::Factors<T> {
            $as_mut
        }
    };
}

/// The plan of a model that is known at compile time.
pub struct Known<M>(PhantomData<fn() -> M>);

impl<M> Known<M> {
    /// Its only value.
    pub const PLAN: Self = Self(PhantomData);
}

impl<M> Clone for Known<M> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}
impl<M> Copy for Known<M> {}

impl<M: Dae> Plan for Known<M> {
    const KNOWN_STRUCTURE: Option<&'static Structure> = Some(&M::STRUCTURE);
    // The length of the rows of `ArrayC`.
    const NC: usize = if cfg!(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32")) {
        M::Shape::NC
    } else {
        M::Shape::NW
    };
    type X<T: Plain> = ArrayX<M, T>;
    type K<T: Plain> = ArrayK<M, T>;
    type V<T: Plain> = ArrayV<M, T>;
    type Jacobian<T: Plain> = M::Jacobian<T>;
    type Factors<T: Plain> = M::Factors<T>;
    #[inline(always)]
    fn structure(self) -> &'static Structure {
        const { &M::STRUCTURE }
    }
    #[inline(always)]
    fn facts(self) -> &'static DerivedFacts {
        const { &DerivedFacts::of(&M::STRUCTURE) }
    }
}

impl<M: Dae> PlanOf<M> for Known<M> {
    arrays!(M: of => of, of);
}

/// The plan of any model, read by kernels at run time.
#[derive(Debug)]
pub struct ModelTable {
    structure: &'static Structure,
    facts: DerivedFacts,
}

impl ModelTable {
    /// Returns the table of a model.
    pub const fn of(structure: &'static Structure) -> Self {
        Self { structure, facts: DerivedFacts::of(structure) }
    }
}

impl Plan for &'static ModelTable {
    const KNOWN_STRUCTURE: Option<&'static Structure> = None;
    const NC: usize = 0;
    type X<T: Plain> = [T];
    type K<T: Plain> = [T];
    type V<T: Plain> = [T];
    type Jacobian<T: Plain> = [T];
    type Factors<T: Plain> = [T];
    #[inline(always)]
    fn structure(self) -> &'static Structure {
        self.structure
    }
    #[inline(always)]
    fn facts(self) -> &'static DerivedFacts {
        &self.facts
    }
}

impl<M: Dae> PlanOf<M> for &'static ModelTable {
    arrays!(M: of => of.as_ref(), of.as_mut());
}

/// Returns the kinematic state of a slot, if it is [kinematic](Kinematic).
#[inline(always)]
pub const fn kinematic(structure: &Structure, slot: usize) -> Option<&'static Kinematic> {
    let kinematic = structure.elimination.kinematic;
    if slot < kinematic.len() && kinematic[slot].equation != Kinematic::NONE {
        Some(&kinematic[slot])
    } else {
        None
    }
}

/// Facts derived from a structure at compile time.
#[derive(Debug)]
pub struct DerivedFacts {
    /// The range `(first, end)` of unknowns without the kinematic states before the first and after
    /// the last other unknown.
    pub non_kinematic_range: (usize, usize),
    /// Number of assembly terms that are fill-in.
    pub fill_terms: usize,
    /// Numbers of nonlinear variables before the first state, and before the first algebraic state.
    pub nonlinear_before: [usize; 2],
    /// Whether each equation with a derivative has that of one state, in the order of the states:
    /// the entries of `f_ẋ` are then in this order.
    pub has_direct_rates: bool,
}

impl DerivedFacts {
    /// Derives the facts of a structure.
    pub const fn of(structure: &Structure) -> Self {
        let nx = structure.x.len();
        Self {
            non_kinematic_range: non_kinematic_range(structure),
            fill_terms: structure.elimination.fill(),
            nonlinear_before: [count_before(structure.curved, nx), count_before(structure.curved, 2 * nx)],
            has_direct_rates: has_ordered_derivatives(structure),
        }
    }
}

/// Returns how many elements of an ascending list (directions with influence, nonlinear variables)
/// are less than `number`.
pub const fn count_before(numbers: &[u32], number: usize) -> usize {
    let mut count = 0;
    while count < numbers.len() && (numbers[count] as usize) < number {
        count += 1;
    }
    count
}

const fn non_kinematic_range(structure: &Structure) -> (usize, usize) {
    let (mut first, mut end) = (0, StructureTable::Unknowns.row_count(structure));
    while first < end && kinematic(structure, first).is_some() {
        first += 1;
    }
    while end > first && kinematic(structure, end - 1).is_some() {
        end -= 1;
    }
    (first, end)
}

/// See [`DerivedFacts::has_direct_rates`].
pub const fn has_ordered_derivatives(structure: &Structure) -> bool {
    let (count, pattern) = (structure.blocks[1], &structure.jacobian);
    let mut entry = 0;
    while entry < count {
        if pattern.at(entry).1 != entry {
            return false;
        }
        entry += 1;
    }
    count == structure.x.len()
}

/// A table of the structure that kernels process row by row.
#[derive(Clone, Copy)]
pub enum StructureTable {
    /// The terms of the Newton matrix, fill-in first.
    Assembly,
    /// The terms that are fill-in.
    Fill,
    /// Entries by which equations depend on kinematic states.
    Dependents,
    /// States up to the last kinematic one.
    Kinematic,
    /// Unknowns of a stage.
    Unknowns,
    /// Entries of the Jacobian from the start of a block to the start of another.
    Entries(usize, usize),
}

impl StructureTable {
    /// All entries of the Jacobian.
    pub const JACOBIAN: Self = Self::Entries(0, 5);

    /// Returns the number of rows.
    #[inline(always)]
    pub const fn row_count(self, structure: &Structure) -> usize {
        let Structure { elimination, blocks, x, z, .. } = structure;
        match self {
            Self::Assembly => elimination.assembly.len(),
            Self::Fill => elimination.fill(),
            Self::Dependents => elimination.dependents.len(),
            Self::Kinematic => elimination.kinematic.len(),
            Self::Unknowns => x.len() + z.len(),
            Self::Entries(begin, end) => blocks[end] - blocks[begin],
        }
    }

    /// Returns the number of rows, if kernels are compiled for one model.
    pub const fn known_row_count<P: Plan>(self) -> Option<usize> {
        match P::KNOWN_STRUCTURE {
            Some(structure) => Some(self.row_count(structure)),
            None => None,
        }
    }

    /// Whether the table may have rows.
    pub const fn may_have_rows<P: Plan>(self) -> bool {
        !matches!(self.known_row_count::<P>(), Some(0))
    }
}
