//! Detection of explicit models.

use super::{Pattern, Structure};

/// Number of words of the bit set of states.
const MAX_STATE_WORDS: usize = 64;

impl Structure {
    /// Whether the model is explicit: every equation has one derivative of its own, with a constant
    /// coefficient, and there are no algebraic states. Models with more than 4096 states are
    /// recognised only if their equations have the order of the states.
    ///
    /// The first entries of the Jacobian are then those of `f_ẋ`, one for each equation.
    #[must_use]
    pub const fn is_explicit(&self) -> bool {
        let (nx, Pattern { rows, columns }) = (self.x.len(), self.jacobian);
        let known = rows.len() >= nx && columns.len() >= nx && self.constant.len() >= nx;
        if !known || !self.z.is_empty() || self.blocks[1] != nx {
            return false;
        }
        // Bit set of the derivatives that have occurred.
        let mut seen = [0_u64; MAX_STATE_WORDS];
        let mut row = 0;
        while row < nx {
            let column = columns[row] as usize;
            let (word, bit) = (column / 64, 1_u64 << (column % 64));
            let first = if word < MAX_STATE_WORDS { seen[word] & bit == 0 } else { column == row };
            if rows[row] as usize != row || !self.constant[row] || !first {
                return false;
            }
            if word < MAX_STATE_WORDS {
                seen[word] |= bit;
            }
            row += 1;
        }
        true
    }
}
