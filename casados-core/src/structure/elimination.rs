//! The plan by which the Newton matrix is eliminated.

/// The order in which the Newton matrix is eliminated, with everything that follows from it and the pattern.
///
/// Made by the macro from the pattern of `f_ẋ ∪ f_x ∪ f_z` and from the values of the model at sample points; the entries
/// are s×s blocks, so that it serves every tableau. A *slot* is an unknown `(k, z)` and the equation that is its pivot.
#[derive(Clone, Copy, Debug)]
pub struct Elimination {
    /// The pivots in order.
    pub pivots: &'static [Pivot],
    /// For each block the slot at its other end: of `L` that of its equation, of `U` that of its unknown.
    pub slots: &'static [u32],
    /// For each pivot the blocks of `L` in its row: of pivots that are not scaled, of which those of states that follow others come first, then of those
    /// that are, of which they come last.
    pub left: &'static [Left],
    /// For each pivot, for each block of its `L`, for each block of its `U`: the block that is updated.
    pub updates: &'static [Update],
    /// For each block what it is made of before elimination, those of a kind one after the other, fill first.
    pub assembly: &'static [Assembly],
    /// For each equation its slot.
    pub slot_of_equation: &'static [u32],
    /// For each slot whether it is a state whose pivot has the same right-hand sides at all stages; empty if none is.
    pub steady: &'static [Steady],
    /// The pivots that iterations of Newton's method do not leave out, supernode by supernode.
    pub supernodes: &'static [Supernode],
    /// For each state whether it follows another in every iteration of Newton's method; empty if none does.
    pub followers: &'static [Follower],
    /// What the blocks are made of where states that are [absorbed](Follower::absorbed) are left out of the elimination, as
    /// [`assembly`](Self::assembly); empty if none is.
    pub led: &'static [Led],
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
        steady: &[],
        supernodes: &[],
        followers: &[],
        led: &[],
    };

    /// How many blocks are fill.
    #[must_use]
    pub const fn fill(&self) -> usize {
        let mut count = 0;
        while count < self.assembly.len() && self.assembly[count].is_fill() {
            count += 1;
        }
        count
    }

    /// How many blocks are fill where states that are [absorbed](Follower::absorbed) are left out.
    #[must_use]
    pub const fn fill_led(&self) -> usize {
        let mut count = 0;
        while count < self.led.len() && self.led[count].is_fill() {
            count += 1;
        }
        count
    }

    /// How many products of `s×s` blocks the updates of a factorisation cost; a block with scaled rows is a fraction of one.
    pub(crate) const fn products(&self, s: f64) -> f64 {
        let (mut products, mut index) = (0.0, 0);
        while index < self.pivots.len() {
            let pivot = &self.pivots[index];
            let lower = (pivot.upper - pivot.block - 1) as f64;
            let upper = (pivot.end - pivot.upper) as f64;
            products += if pivot.scaled && s > 1.0 { upper + lower * upper / s } else { lower * upper };
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
    /// Where in [`Elimination::left`] the blocks of `L` in its row begin, where those begin whose pivots are no states that
    /// [follow](Follower) others, where those of scaled pivots begin, where those of scaled pivots that follow begin, and where all end.
    pub left: [u32; 5],
    /// The pivot is the identity, whatever the step size and the point.
    pub identity: bool,
    /// The pivot is the identity, and nothing has been added to the blocks of its column, three or more, which are
    /// `h diag(state) A`: with two stages or more only `state` is stored, and `hA` is applied once for all of them.
    pub scaled: bool,
    /// Its state is [`steady`](Steady).
    pub steady: bool,
    /// How many pivots from this one on are scaled and have the same rows below them, as those of the coordinates of a point: at most
    /// three, which go through these rows together; zero if one before this one has counted it.
    pub beside: u32,
    /// How many pivots from this one on are a [`Supernode`]; zero if one before this one has counted it.
    pub supernode: u32,
}

/// A state `x_j` with a pivot `ẋ_j − c v = 0` that is the first thing done to it, where `v` is a state, a control or a parameter: right-hand
/// sides `r_j = c dv` of linearised equations are the same at all stages then, and so is what they add to `x_j` but for the nodes,
///
/// ```text
/// f_x,i (dx_j + h Σ_l a_il r_j) = f_x,i (dx_j + h c_i r_j)
/// ```
///
/// which goes into the right-hand sides of the other equations at once: nothing is left to be subtracted below the pivot.
///
/// If no other pivot has a block of `U` in its column, nobody asks for `dk_j` of such a state on the way back either. It is not found then,
/// only [implied](Steady::implied): what is made of it is made of `r_j` and the `dk_v`,
///
/// ```text
/// dk_ij = r_j + h Σ_l a_il c dk_lv        h Σ_i b_i dk_ij = h r_j + h² Σ_l (Σ_i b_i a_il) c dk_lv
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Steady {
    /// The entry of the Jacobian that is `−c`, or [`Steady::NONE`].
    pub entry: u32,
    /// Where in the [entries by column](super::Structure::by_column) those of `x_j` begin
    pub first: u32,
    /// and end.
    pub end: u32,
    /// The position of the slot's pivot: states are subtracted from equations whose pivots come later.
    pub turn: u32,
    /// Whether no other pivot has a block of `U` in its column.
    pub implied: bool,
}

impl Steady {
    /// No entry: the slot is no such state.
    pub const NONE: u32 = u32::MAX;
}

/// A state `x_j` with a pivot `ẋ_j − c v = 0` and nothing else, where `v` is a state that does not follow itself, a control or a parameter. Its
/// derivatives at the stages are those of
///
/// ```text
/// k_ij = c (x_v + h Σ_l a_il k_lv)        or        k_ij = c v
/// ```
///
/// before the first iteration of Newton's method and after each of them, so that its equation has no residual and nothing is subtracted below its
/// pivot; and that nobody finds its increment but where others [ask](Follower::asked) for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Follower {
    /// The entry of the Jacobian that is `−c`, or [`Follower::NONE`].
    pub entry: u32,
    /// Where in the [entries by column](super::Structure::by_column) those of `x_j` begin
    pub first: u32,
    /// and end.
    pub end: u32,
    /// Whether another pivot has a block of `U` in its column.
    pub asked: bool,
    /// Whether nobody asks for it, and it is the first that follows whom it follows: iterations leave it out of the elimination. Of
    /// `Δk_j = c hA Δk_v` the column of `x_j` is then a part of that of `v` ([`Led`]).
    pub absorbed: bool,
}

impl Follower {
    /// No entry: the state follows nobody.
    pub const NONE: u32 = u32::MAX;
}

impl Pivot {
    /// The blocks of its column, below it.
    #[must_use]
    #[inline(always)]
    pub const fn lower(&self) -> core::ops::Range<usize> {
        self.block as usize + 1..self.upper as usize
    }
    /// The blocks of `L` in its row, in [`Elimination::left`], for so many stages: those whose pivots are scaled are left out where
    /// that means anything.
    #[must_use]
    #[inline(always)]
    pub const fn left(&self, stages: usize) -> core::ops::Range<usize> {
        self.left[0] as usize..self.left[if stages > 1 { 2 } else { 4 }] as usize
    }
    /// All blocks of `L` in its row, in [`Elimination::left`], but for those of states that follow others.
    #[must_use]
    #[inline(always)]
    pub const fn left_led(&self) -> core::ops::Range<usize> {
        self.left[1] as usize..self.left[3] as usize
    }
    /// The blocks of its row, to the right of it.
    #[must_use]
    #[inline(always)]
    pub const fn upper(&self) -> core::ops::Range<usize> {
        self.upper as usize..self.end as usize
    }
}

/// Pivots one after the other, four at most, that have the same rows below them and the same columns beside them but for themselves, and whose rows
/// have the same blocks of `L` of pivots that are no states that [follow](Follower) others. If one of them is such a state, or [`scaled`](Pivot::scaled), it is alone.
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
    /// The same where states that are [absorbed](Follower::absorbed) are left out.
    pub first_led: bool,
}

/// A block of the Newton matrix before elimination: `diag(direct) + h diag(state) A`; zero where there is only fill.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assembly {
    /// The block.
    pub block: u32,
    /// The entry of the Jacobian that multiplies the unknown itself (`f_ẋ` or `f_z`), or [`Assembly::NONE`].
    pub direct: u32,
    /// The entry of `f_x`, or [`Assembly::NONE`].
    pub state: u32,
    /// The block belongs to the column of a pivot that is [`scaled`](Pivot::scaled).
    pub scaled: bool,
}

impl Assembly {
    /// No entry.
    pub const NONE: u32 = u32::MAX;

    /// Whether elimination alone puts anything there.
    #[must_use]
    pub const fn is_fill(&self) -> bool {
        self.direct == Self::NONE && self.state == Self::NONE
    }
}

/// A block of the matrix without states that are [absorbed](Follower::absorbed): its own entries, and
/// `c (diag(direct) + h diag(state) A) hA` from one of them, which follows the unknown of the column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Led {
    /// Its own entries.
    pub own: Assembly,
    /// The entry of the Jacobian that is `−c`, or [`Assembly::NONE`].
    pub by: u32,
    /// The entry of `f_ẋ` of the state that is absorbed, or [`Assembly::NONE`].
    pub direct: u32,
    /// Its entry of `f_x`, or [`Assembly::NONE`].
    pub state: u32,
}

impl Led {
    /// Whether elimination alone puts anything there.
    #[must_use]
    pub const fn is_fill(&self) -> bool {
        self.own.is_fill() && self.by == Assembly::NONE
    }
}
