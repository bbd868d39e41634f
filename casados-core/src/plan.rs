//! The structure of a model for kernels, bound at compile time or at run time.
//!
//! | plan | kernels are compiled | loops over tables | lengths |
//! | --- | --- | --- | --- |
//! | [`Known<M>`](Known) | for each model | unrolled if short | constants |
//! | [`&'static ModelTable`](ModelTable) | once for all models | loops | read |
//!
//! A kernel is generic over its plan and takes it as a value, which has size zero for a known
//! model. Compile-time decisions use [`Plan::KNOWN_STRUCTURE`].

use crate::model::{ArrayK, ArrayV, ArrayX, Dae};
use crate::shape::{Plain, Shape};
use crate::structure::{Kinematic, Structure};
use core::marker::PhantomData;

/// Storage of a fixed number of elements: an array for a known model, otherwise a slice.
pub trait Elements<T>: AsRef<[T]> + AsMut<[T]> {}
impl<T, A: AsRef<[T]> + AsMut<[T]> + ?Sized> Elements<T> for A {}

/// The plan of a kernel.
pub trait Plan: Copy + Send + Sync + 'static {
    /// The structure of the model, if kernels are compiled for it.
    const KNOWN_STRUCTURE: Option<&'static Structure>;
    /// The number of columns in memory for directions that are computed together, if known.
    const NC: usize;

    /// One element for each differential state.
    type X<T: Plain>: Elements<T> + ?Sized;
    /// One element for each unknown of a stage, or for each equation.
    type K<T: Plain>: Elements<T> + ?Sized;
    /// One element for each variable.
    type V<T: Plain>: Elements<T> + ?Sized;
    /// One element for each entry of the Jacobian.
    type Jacobian<T: Plain>: Elements<T> + ?Sized;
    /// One element for each block of the factors.
    type Factors<T: Plain>: Elements<T> + ?Sized;

    /// The structure of the model.
    fn structure(self) -> &'static Structure;
    /// Facts derived from the structure.
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

    /// The row of right-hand sides that belongs to an equation: that of its pivot unknown.
    #[inline(always)]
    fn slot(self, equation: usize) -> usize {
        match self.structure().elimination.slot_of_equation.get(equation) {
            Some(&slot) => slot as usize,
            None => equation,
        }
    }

    /// The description of the [kinematic](Kinematic) state in a slot, if it is one.
    #[inline(always)]
    fn kinematic(self, slot: usize) -> Option<&'static Kinematic> {
        kinematic(self.structure(), slot)
    }

    /// The index of the state that is the velocity of a kinematic state, if it is a state.
    #[inline(always)]
    fn velocity(self, of: &Kinematic) -> Option<usize> {
        let (nx, velocity) = (self.nx(), of.velocity as usize);
        if velocity < 2 * nx { velocity.checked_sub(nx) } else { None }
    }

    /// An entry of a Jacobian: row, column, value.
    #[inline(always)]
    fn entry<V>(self, jacobian: &[V], index: usize) -> Option<(usize, usize, &V)> {
        let pattern = &self.structure().jacobian;
        let &row = pattern.rows.get(index)?;
        let &column = pattern.columns.get(index)?;
        Some((row as usize, column as usize, jacobian.get(index)?))
    }
}

/// The plan of a model, with conversions from its arrays.
pub trait PlanOf<M: Dae>: Plan {
    /// One element for each differential state.
    fn x<T: Plain>(of: &ArrayX<M, T>) -> &Self::X<T>;
    /// One element for each unknown of a stage, or for each equation.
    fn k<T: Plain>(of: &ArrayK<M, T>) -> &Self::K<T>;
    /// Mutable version of [`PlanOf::k`].
    fn k_mut<T: Plain>(of: &mut ArrayK<M, T>) -> &mut Self::K<T>;
    /// One element for each variable.
    fn v<T: Plain>(of: &ArrayV<M, T>) -> &Self::V<T>;
    /// Mutable version of [`PlanOf::v`].
    fn v_mut<T: Plain>(of: &mut ArrayV<M, T>) -> &mut Self::V<T>;
    /// One element for each entry of the Jacobian.
    fn jacobian<T: Plain>(of: &M::Jacobian<T>) -> &Self::Jacobian<T>;
    /// One element for each block of the factors.
    fn factors_mut<T: Plain>(of: &mut M::Factors<T>) -> &mut Self::Factors<T>;
}

/// Converts the arrays of a model to those of a plan.
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

/// The plan of a model that is known when kernels are compiled.
pub struct Known<M>(PhantomData<fn() -> M>);

impl<M> Known<M> {
    /// The only value.
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
    // The number of columns in the rows of `ArrayC`.
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
    /// The plan of a model.
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

/// The description of the [kinematic](Kinematic) state in a slot, if it is one.
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
    /// The range of the unknowns from the first to the last that is not kinematic: `(first, end)`.
    pub non_kinematic_range: (usize, usize),
    /// The number of terms of the Newton matrix that are fill.
    pub fill_terms: usize,
    /// The numbers of nonlinear variables before the first state, and before the first algebraic
    /// state.
    pub nonlinear_before: [usize; 2],
    /// Whether each equation with a derivative contains that of one state, in the order of the
    /// states: the entries of `f_ẋ` are then those of the states.
    pub has_direct_rates: bool,
}

impl DerivedFacts {
    /// The facts of a structure.
    pub const fn of(structure: &Structure) -> Self {
        let nx = structure.x.len();
        Self {
            non_kinematic_range: non_kinematic_range(structure),
            fill_terms: structure.elimination.fill(),
            nonlinear_before: [count_before(structure.curved, nx), count_before(structure.curved, 2 * nx)],
            has_direct_rates: has_direct_rates(structure),
        }
    }
}

/// The number of elements before `number` in an ascending list: of influential directions, or of
/// nonlinear variables.
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

/// See [`DerivedFacts`].
pub const fn has_direct_rates(structure: &Structure) -> bool {
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

/// A table of the structure, which kernels traverse row by row.
#[derive(Clone, Copy)]
pub enum StructureTable {
    /// The terms of the Newton matrix, fill first.
    Assembly,
    /// The terms that are fill.
    Fill,
    /// The entries of equations with respect to kinematic states.
    Dependents,
    /// The states up to the last kinematic one.
    Kinematic,
    /// The unknowns of a stage.
    Unknowns,
    /// The entries of the Jacobian from the start of a block to that of another.
    Entries(usize, usize),
}

impl StructureTable {
    /// All entries of the Jacobian.
    pub const JACOBIAN: Self = Self::Entries(0, 5);

    /// The number of rows.
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

    /// The number of rows, if kernels are compiled for one model.
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
