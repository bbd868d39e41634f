//! The index reduction by `#[dae(index_reduction)]`.

use super::describe::fmt_title;
use core::fmt::{self, Display, Formatter};

/// Equations that were differentiated in time until the model had index 1.
///
/// Equation `i` was the constraint `g(x, p, t) = 0`. Its derivative of order `c` determines
/// derivatives or algebraic states; `g` and its derivatives of lower order are invariants: the
/// outputs of [`Constrained::Invariants`](crate::Constrained::Invariants), in the order of
/// `differentiated`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reduction {
    /// The equations, and the number of differentiations of each.
    pub differentiated: &'static [(u32, u32)],
    /// The rates `r_m` of Baumgarte stabilisation, in 1 / unit of time: the equations are
    /// `Π_m (d/dt + r_m) g = 0`. Empty without stabilisation.
    pub rates: &'static [f64],
    /// Whether the macro generated the equations of the projection onto the invariants.
    pub projection: bool,
    /// Number of sample points at which the matrix `∂f/∂(ẋ, z)` is singular, and number of all
    /// sample points.
    pub singular: [u32; 2],
}

impl Reduction {
    /// The number of invariants.
    #[must_use]
    pub fn invariants(&self) -> usize {
        self.differentiated.iter().map(|&(_, times)| times as usize).sum()
    }

    /// Returns the equation of an invariant, and the order of its derivative.
    #[must_use]
    pub fn invariant(&self, mut output: usize) -> Option<(u32, u32)> {
        for &(equation, times) in self.differentiated {
            if output < times as usize {
                return Some((equation, output as u32));
            }
            output -= times as usize;
        }
        None
    }
}

impl Display for Reduction {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        fmt_title(f, "reduced")?;
        // Adjacent equations with the same number of differentiations are one entry.
        let alike = |a: &(u32, u32), b: &(u32, u32)| b.0 == a.0 + 1 && b.1 == a.1;
        for (place, run) in self.differentiated.chunk_by(alike).enumerate() {
            let (first, times) = run[0];
            let comma = if place == 0 { "" } else { ", " };
            match run.len() {
                1 => write!(f, "{comma}equation {first}")?,
                count => write!(f, "{comma}equations {first}-{}", first as usize + count - 1)?,
            }
            match times {
                1 => write!(f, " differentiated once")?,
                2 => write!(f, " differentiated twice")?,
                _ => write!(f, " differentiated {times} times")?,
            }
        }
        writeln!(f)?;
        fmt_title(f, "  invariants")?;
        writeln!(f, "{}: what was differentiated, and its lower derivatives", self.invariants())?;
        fmt_title(f, "  stabilised")?;
        match self.rates {
            [] if self.projection => writeln!(f, "by the projection of `Projected`")?,
            [] => writeln!(f, "no: errors of a constraint grow with time")?,
            rates => {
                write!(f, "errors decay with the rates")?;
                rates.iter().try_for_each(|rate| write!(f, " {rate}"))?;
                writeln!(f, " (Baumgarte)")?;
            }
        }
        let [singular, points] = self.singular;
        if singular > 0 {
            fmt_title(f, "  rank")?;
            writeln!(
                f,
                "full at {} of {points} sample points, which need not satisfy the constraints",
                points - singular
            )?;
        }
        Ok(())
    }
}
