//! The plan by which the Newton matrix is eliminated.

/// The order in which the Newton matrix is eliminated, with everything that follows from it and the
/// pattern.
///
/// Made by the macro from the pattern of `f_ẋ ∪ f_x ∪ f_z` and from the values of the model at
/// sample points; the entries are s×s blocks, so that it serves every tableau. A *slot* is an
/// unknown `(k, z)` and the equation that is its pivot.
#[derive(Clone, Copy, Debug)]
pub struct Elimination {
    /// The pivots in order.
    /// Read by factorisation and substitution.
    pub pivots: &'static [Pivot],
    /// For each block the slot at its other end: of `L` that of its equation, of `U` that of its
    /// unknown.
    /// Read by substitution.
    pub slots: &'static [u32],
    /// For each pivot the blocks of `L` in its row.
    /// Read by substitution, row by row.
    pub left: &'static [Left],
    /// For each pivot, for each block of its `L`, for each block of its `U`: the block that is
    /// updated.
    /// Read by factorisation.
    pub updates: &'static [Update],
    /// What blocks are made of before elimination, those of a kind one after the other, fill first.
    /// Read by the assembly of Newton matrices.
    pub assembly: &'static [Assembly],
    /// For each equation its slot; of a [kinematic](Kinematic) state its own.
    /// Read where right-hand sides are written.
    pub slot_of_equation: &'static [u32],
    /// The pivots, supernode by supernode.
    /// Read by substitution of several columns.
    pub supernodes: &'static [Supernode],
    /// For each state whether it is kinematic, and what it follows from; empty if none is.
    /// Read by the reconstruction of kinematic states.
    pub kinematic: &'static [Kinematic],
    /// The entries of `f_ẋ` and `f_x` by which other equations depend on kinematic states, state by
    /// state, in the order of their velocities.
    /// Read by right-hand sides and assembly through kinematic states.
    pub dependents: &'static [Dependent],
}

impl Elimination {
    /// No plan: the matrix is eliminated as a dense one.
    pub const NONE: Self = Self {
        pivots: &[],
        slots: &[],
        left: &[],
        updates: &[],
        assembly: &[],
        slot_of_equation: &[],
        supernodes: &[],
        kinematic: &[],
        dependents: &[],
    };

    /// Whether there is a plan.
    #[must_use]
    pub const fn has_plan(&self) -> bool {
        !self.pivots.is_empty()
    }

    /// How many blocks are fill.
    #[must_use]
    pub const fn fill(&self) -> usize {
        let mut count = 0;
        while count < self.assembly.len() && self.assembly[count].is_fill() {
            count += 1;
        }
        count
    }

    /// How many products of `s×s` blocks the updates of a factorisation cost.
    pub(crate) const fn block_product_count(&self) -> f64 {
        let (mut products, mut index) = (0.0, 0);
        while index < self.pivots.len() {
            let pivot = &self.pivots[index];
            let lower = (pivot.upper - pivot.block - 1) as f64;
            let upper = (pivot.end - pivot.upper) as f64;
            products += lower * upper;
            index += 1;
        }
        products
    }
}

/// A pivot: the blocks that it owns lie one after the other, itself, its column `L`, its row `U`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pivot {
    /// The unknown that it determines.
    pub slot: u32,
    /// The equation that determines it.
    pub equation: u32,
    /// Its own block.
    pub block: u32,
    /// Where the blocks of its row begin.
    pub upper: u32,
    /// Where the blocks of its row end.
    pub end: u32,
    /// Where in [`Elimination::left`] the blocks of `L` in its row begin, and where they end.
    pub left: [u32; 2],
    /// The pivot is the identity, whatever the step size and the point.
    pub identity: bool,
}

/// A kinematic state `q`, with an equation `q̇ − c v = 0` where `v` is a state that is not
/// kinematic itself, a control or a parameter. It is no unknown of any elimination: its derivatives
/// at the stages are
///
/// ```text
/// k_q = c (x_v + hA k_v)        or        k_q = c v
/// ```
///
/// and its column of the Newton matrix, multiplied by `c hA`, is a part of that of `v`: see
/// [`Assembly`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kinematic {
    /// Its equation, or [`Kinematic::NONE`].
    pub equation: u32,
    /// The entry of the Jacobian that is `−c`.
    pub entry: u32,
    /// The variable `v`.
    pub velocity: u32,
}

impl Kinematic {
    /// The state is not kinematic.
    pub const NONE: u32 = u32::MAX;
}

/// An entry of `f_ẋ` or `f_x` by which an equation depends on a kinematic state that is not
/// determined by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dependent {
    /// The entry.
    pub entry: u32,
    /// The state.
    pub state: u32,
    /// It is the first one of the state.
    pub first: bool,
    /// It is the last one.
    pub last: bool,
}

impl Pivot {
    /// The blocks of its column, below it.
    #[must_use]
    #[inline(always)]
    pub const fn lower(&self) -> core::ops::Range<usize> {
        self.block as usize + 1..self.upper as usize
    }
    /// The blocks of `L` in its row, in [`Elimination::left`].
    #[must_use]
    #[inline(always)]
    pub const fn left(&self) -> core::ops::Range<usize> {
        self.left[0] as usize..self.left[1] as usize
    }
    /// The blocks of its row, to the right of it.
    #[must_use]
    #[inline(always)]
    pub const fn upper(&self) -> core::ops::Range<usize> {
        self.upper as usize..self.end as usize
    }
}

/// Pivots one after the other, four at most, that have the same rows below them and the same
/// columns beside them but for themselves, and whose rows have the same blocks of `L`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Supernode {
    /// The first of them.
    pub first: u32,
    /// How many they are.
    pub count: u32,
}

/// A block of `L`, as it is met in its row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Left {
    /// The block.
    pub block: u32,
    /// The slot of the pivot whose column it is in.
    pub slot: u32,
}

/// A block that is updated by the product of two others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Update {
    /// The block.
    pub block: u32,
    /// Nothing is there before: the block is fill, and this is its first update.
    pub first: bool,
}

/// A term `c diag(f) (hA)^order` of a block of the Newton matrix before elimination, with an entry
/// `f` of the Jacobian at all stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assembly {
    /// The block.
    pub block: u32,
    /// The entry `f`, or [`Assembly::NONE`]: the block is fill.
    pub entry: u32,
    /// The entry that is `−c`, if `f` multiplies a [kinematic](Kinematic) state; or
    /// [`Assembly::NONE`] of one.
    pub by: u32,
    /// Zero for entries of `f_ẋ` and `f_z`, one for those of `f_x`, and one more for those that
    /// multiply a kinematic state.
    pub order: u32,
    /// It is the first term of its block: those of lower order come first.
    pub first: bool,
}

impl Assembly {
    /// No entry.
    pub const NONE: u32 = u32::MAX;

    /// Whether elimination alone puts anything there.
    #[must_use]
    pub const fn is_fill(&self) -> bool {
        self.entry == Self::NONE
    }
}
