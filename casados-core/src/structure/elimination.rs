//! The plan of the elimination of the Newton matrix.

/// The elimination order of the Newton matrix, with all data that follow from it and the sparsity
/// pattern.
///
/// The macro computes it from the pattern of `f_ẋ ∪ f_x ∪ f_z` and from the values of the model at
/// sample points. Entries are s×s blocks, so that one plan serves every tableau. A *slot* is an
/// unknown `(k, z)` and the equation that is its pivot row.
#[derive(Clone, Copy, Debug)]
pub struct Elimination {
    /// The pivots in elimination order.
    /// Read by factorisation and substitution.
    pub pivots: &'static [Pivot],
    /// For each block the slot of its other index: for `L` that of its equation, for `U` that of
    /// its unknown.
    /// Read by substitution.
    pub slots: &'static [u32],
    /// For each pivot the blocks of `L` in its row.
    /// Read by substitution, row by row.
    pub left: &'static [Left],
    /// For each pivot, for each block of its `L`, for each block of its `U`: the updated block.
    /// Read by factorisation.
    pub updates: &'static [Update],
    /// The terms of the blocks before elimination, grouped by kind, fill-in first.
    /// Read by the assembly of Newton matrices.
    pub assembly: &'static [Assembly],
    /// For each equation its slot; an equation of a [kinematic](Kinematic) state has the slot of
    /// the state.
    /// Read where right-hand sides are written.
    pub slot_of_equation: &'static [u32],
    /// The pivots, supernode by supernode.
    /// Read by substitution of several columns.
    pub supernodes: &'static [Supernode],
    /// For each state whether it is kinematic, with its equation and velocity; empty without
    /// kinematic states.
    /// Read by the reconstruction of kinematic states.
    pub kinematic: &'static [Kinematic],
    /// The entries of `f_ẋ` and `f_x` by which other equations depend on kinematic states, state by
    /// state, in the order of their velocities.
    /// Read by right-hand sides and assembly through kinematic states.
    pub dependents: &'static [Dependent],
}

impl Elimination {
    /// No plan: the dense fallback eliminates the whole matrix.
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

    /// Returns the number of blocks of fill-in.
    #[must_use]
    pub const fn fill(&self) -> usize {
        let mut count = 0;
        while count < self.assembly.len() && self.assembly[count].is_fill() {
            count += 1;
        }
        count
    }

    /// Returns the number of products of `s×s` blocks in the updates of a factorisation.
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

/// A pivot. Its blocks are adjacent: the pivot block, its column of `L`, its row of `U`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pivot {
    /// Slot of its unknown.
    pub slot: u32,
    /// Its equation.
    pub equation: u32,
    /// Index of the pivot block.
    pub block: u32,
    /// Index of the first block of its row of `U`.
    pub upper: u32,
    /// Index after the last block of its row of `U`.
    pub end: u32,
    /// Range of the blocks of `L` in its row, in [`Elimination::left`].
    pub left: [u32; 2],
    /// Whether the pivot is the identity for every step size and point.
    pub identity: bool,
}

/// A kinematic state `q`, with an equation `q̇ − c v = 0` where `v` is a state that is not
/// kinematic itself, a control or a parameter. It is condensed, no unknown of the elimination: its
/// derivatives at the stages are
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
    /// Marks a state that is not kinematic.
    pub const NONE: u32 = u32::MAX;
}

/// An entry of `f_ẋ` or `f_x` of a kinematic state in an equation that is not its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dependent {
    /// The entry.
    pub entry: u32,
    /// The state.
    pub state: u32,
    /// Whether it is the first entry of the state.
    pub first: bool,
    /// Whether it is the last entry of the state.
    pub last: bool,
}

impl Pivot {
    /// Returns the range of the blocks of its column, below it.
    #[must_use]
    #[inline(always)]
    pub const fn lower(&self) -> core::ops::Range<usize> {
        self.block as usize + 1..self.upper as usize
    }
    /// Returns the range of the blocks of `L` in its row, in [`Elimination::left`].
    #[must_use]
    #[inline(always)]
    pub const fn left(&self) -> core::ops::Range<usize> {
        self.left[0] as usize..self.left[1] as usize
    }
    /// Returns the range of the blocks of its row, to the right of it.
    #[must_use]
    #[inline(always)]
    pub const fn upper(&self) -> core::ops::Range<usize> {
        self.upper as usize..self.end as usize
    }
}

/// Consecutive pivots, at most four, with the same rows below them and the same columns beside them
/// (except for themselves), whose rows have the same blocks of `L`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Supernode {
    /// Index of its first pivot.
    pub first: u32,
    /// Number of its pivots.
    pub count: u32,
}

/// A block of `L` in the list of its row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Left {
    /// Index of the block.
    pub block: u32,
    /// Slot of the pivot of its column.
    pub slot: u32,
}

/// A block that is updated by the product of two others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Update {
    /// Index of the block.
    pub block: u32,
    /// Whether the block is fill-in and this is its first update: it has no value before.
    pub first: bool,
}

/// A term `c diag(f) (hA)^order` of a block of the Newton matrix before elimination, with an entry
/// `f` of the Jacobian at all stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assembly {
    /// Index of the block.
    pub block: u32,
    /// The entry `f`, or [`Assembly::NONE`] for fill-in.
    pub entry: u32,
    /// The entry that is `−c`, if `f` multiplies a [kinematic](Kinematic) state, otherwise
    /// [`Assembly::NONE`]: then `c = 1`.
    pub by: u32,
    /// Power of `hA`: zero for entries of `f_ẋ` and `f_z`, one for those of `f_x`, plus one if the
    /// entry multiplies a kinematic state.
    pub order: u32,
    /// Whether it is the first term of its block; terms of lower order come first.
    pub first: bool,
}

impl Assembly {
    /// No entry.
    pub const NONE: u32 = u32::MAX;

    /// Whether the block is fill-in.
    #[must_use]
    pub const fn is_fill(&self) -> bool {
        self.entry == Self::NONE
    }
}
