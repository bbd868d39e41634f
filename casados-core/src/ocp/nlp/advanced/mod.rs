//! Advanced options: the constants of [`Ipm`](crate::ocp::Ipm) and [`Sqp`](crate::ocp::Sqp), by
//! strategy.
//!
//! Options have the name that IPOPT or the paper of the method gives them, if there is one. WB is
//! A. Wächter, L. T. Biegler, Math. Program. 106 (2006); NWW is J. Nocedal, A. Wächter, R. A.
//! Waltz, SIAM J. Optim. 19 (2009). Lengths, violations and multipliers are in units of the problem
//! ([`IpmOptions::scaling`](crate::ocp::IpmOptions::scaling)). The pages `docs/algorithms` describe
//! where each option acts.
//!
//! ```
//! use casados::ocp::{HeapIpm, Horizon, LeastSquaresCost, Map, Problem};
//! use casados::prelude::*;
//!
//! #[function]
//! fn push(x: f64, u: f64) -> f64 { x + u }
//! #[function]
//! fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
//!
//! let mut ocp = Problem::new(Map::<Push, f64>::new())
//!     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
//!     .on(Horizon::uniform(3, 1.0))?;
//! ocp.fix_initial_state(&[1.0])?.bound("u", .., -0.3, 0.3)?.guess(&[0.0], &[0.0])?;
//! let mut ipm = HeapIpm::new(&ocp)?;
//! // Without second-order corrections, and with Armijo's constant of IPOPT.
//! ipm.options.advanced.line_search.max_soc = 0;
//! ipm.options.advanced.filter.eta_phi = 1e-8;
//! assert!(ipm.solve(&mut ocp)?.is_converged());
//! // A factor that would leave the regularisation as it is has no meaning.
//! ipm.options.advanced.inertia.perturb_inc_fact = 1.0;
//! assert!(ipm.solve(&mut ocp).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod barrier;
mod globalisation;
mod newton;
mod restoration;
mod start;

pub use barrier::{BarrierOptions, PredictorOptions};
pub use globalisation::{FilterOptions, LineSearchOptions};
pub use newton::{DampingOptions, InertiaOptions, NewtonOptions};
pub use restoration::{RestorationOptions, UnboundedOptions};
pub use start::{RestartOptions, StartOptions};

use crate::ocp::formulation::error::OcpError;

/// The values that an option may have.
#[derive(Clone, Copy)]
enum Range {
    Positive,
    NotNegative,
    Fraction,
    BelowOne,
    AboveOne,
    AtMost(usize),
    Any,
}

impl Range {
    /// Whether a value is in the range, and the text of an error if it is not.
    fn check(self, value: f64) -> (bool, &'static str) {
        match self {
            Self::Positive => (value > 0.0 && value.is_finite(), "above 0 and finite"),
            Self::NotNegative => (value >= 0.0 && value.is_finite(), "at least 0 and finite"),
            Self::Fraction => (value > 0.0 && value <= 1.0, "above 0 and at most 1"),
            Self::BelowOne => (value > 0.0 && value < 1.0, "above 0 and below 1"),
            Self::AboveOne => (value > 1.0 && value.is_finite(), "above 1 and finite"),
            Self::AtMost(largest) => (value >= 1.0 && value <= largest as f64, "from 1 to 16"),
            Self::Any => (true, ""),
        }
    }
}

/// The type of an option, as a number in tables and benches: a switch is 0 or 1.
#[doc(hidden)]
pub trait Setting {
    fn number(&self) -> f64;
    fn set_number(&mut self, value: f64);
}

impl Setting for f64 {
    fn number(&self) -> f64 {
        *self
    }
    fn set_number(&mut self, value: f64) {
        *self = value;
    }
}

impl Setting for usize {
    fn number(&self) -> f64 {
        *self as f64
    }
    fn set_number(&mut self, value: f64) {
        *self = value as Self;
    }
}

impl Setting for bool {
    fn number(&self) -> f64 {
        f64::from(u8::from(*self))
    }
    fn set_number(&mut self, value: f64) {
        *self = value != 0.0;
    }
}

/// Declares the options of a strategy with their defaults and ranges.
macro_rules! options {
    ($(#[$meta:meta])* $name:ident {
        $($(#[$doc:meta])* $field:ident: $type:ty = $default:expr, $range:expr;)*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[non_exhaustive]
        pub struct $name {
            $($(#[$doc])* #[doc = concat!(" Default `", stringify!($default), "`.")] pub $field: $type,)*
        }

        impl $name {
            /// The defaults.
            pub const DEFAULT: Self = Self { $($field: $default,)* };

            /// Checks that all values are allowed.
            ///
            /// # Errors
            /// [`OcpError::InvalidOption`](crate::ocp::OcpError::InvalidOption)
            pub(in crate::ocp::nlp) fn validate(&self) -> Result<(), crate::ocp::OcpError> {
                #[allow(unused_imports)]
                use super::Range::*;
                $(super::check(stringify!($field), &self.$field, $range)?;)*
                Ok(())
            }

            /// Visits all options by their names.
            pub(super) fn visit(&mut self, visit: &mut dyn FnMut(&'static str, &mut dyn super::Setting)) {
                $(visit(stringify!($field), &mut self.$field);)*
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::DEFAULT
            }
        }
    };
}
use options;

/// # Errors
/// [`OcpError::InvalidOption`]
fn check(name: &'static str, value: &dyn Setting, range: Range) -> Result<(), OcpError> {
    let value = value.number();
    match range.check(value) {
        (true, _) => Ok(()),
        (false, allowed) => Err(OcpError::InvalidOption { name, value, allowed }),
    }
}

/// Declares the strategies of a solver.
macro_rules! strategies {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $field:ident: $type:ident = $default:expr;)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[non_exhaustive]
        pub struct $name {
            $($(#[$doc])* pub $field: $type,)*
        }

        impl $name {
            /// The defaults.
            pub const DEFAULT: Self = Self { $($field: $default,)* };

            /// Checks that all values are allowed.
            ///
            /// # Errors
            /// [`OcpError::InvalidOption`]
            pub(in crate::ocp::nlp) fn validate(&self) -> Result<(), OcpError> {
                $(self.$field.validate()?;)*
                Ok(())
            }

            /// Visits all options by strategy and name.
            #[doc(hidden)]
            pub fn visit(&mut self, visit: &mut dyn FnMut(&'static str, &'static str, &mut dyn Setting)) {
                $(self.$field.visit(&mut |name, value| visit(stringify!($field), name, value));)*
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::DEFAULT
            }
        }
    };
}

strategies! {
    /// Advanced options of [`Ipm`](crate::ocp::Ipm); [`advanced`](self) has an example.
    AdvancedIpmOptions {
        /// The filter.
        filter: FilterOptions = FilterOptions::DEFAULT;
        /// The line search.
        line_search: LineSearchOptions = LineSearchOptions::DEFAULT;
        /// The barrier parameter.
        barrier: BarrierOptions = BarrierOptions::DEFAULT;
        /// Higher-order corrections.
        predictor: PredictorOptions = PredictorOptions::DEFAULT;
        /// Newton's equations.
        newton: NewtonOptions = NewtonOptions::DEFAULT;
        /// The inertia correction.
        inertia: InertiaOptions = InertiaOptions::DEFAULT;
        /// Damping after short steps.
        damping: DampingOptions = DampingOptions::DEFAULT;
        /// Restoration phase and elastic mode.
        restoration: RestorationOptions = RestorationOptions::DEFAULT;
        /// The test for unboundedness.
        unbounded: UnboundedOptions = UnboundedOptions::DEFAULT;
        /// The restart of a failed run.
        restart: RestartOptions = RestartOptions::DEFAULT;
        /// Degenerate starts.
        start: StartOptions = StartOptions::DEFAULT;
    }
}

strategies! {
    /// Advanced options of [`Sqp`](crate::ocp::Sqp); [`advanced`](self) has an example.
    AdvancedSqpOptions {
        /// The filter.
        filter: FilterOptions = FilterOptions::DEFAULT;
        /// The inertia correction.
        inertia: InertiaOptions = InertiaOptions::QUADRATIC_PROGRAM;
        /// The restart of a failed run.
        restart: RestartOptions = RestartOptions::DEFAULT;
        /// Degenerate starts.
        start: StartOptions = StartOptions::DEFAULT;
    }
}
