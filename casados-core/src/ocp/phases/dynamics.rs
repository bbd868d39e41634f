//! The type of dynamics of joined phases.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{Nodes, Sink};
use crate::ocp::formulation::program::curvature::{Convexification, Curvature, Exact, GaussNewton};

/// The type of dynamics that a [`Curvature`] of [`Phases`](super::Phases) is generic over; each
/// phase linearises its own.
///
/// No value has this type.
///
/// ```
/// use casados::ocp::{Curvature, Exact, PhaseDynamics};
///
/// fn is_exact<C: Curvature<PhaseDynamics, f64>>(_: C) -> bool { C::EXACT }
/// assert!(is_exact(Exact::default()));
/// ```
#[derive(Clone, Copy, Debug)]
pub enum PhaseDynamics {}

macro_rules! curvatures {
    ($($number:ty, $curvature:ty, $exact:expr;)*) => {$(
        impl Curvature<PhaseDynamics, $number> for $curvature {
            const EXACT: bool = $exact;
            fn convexification(&self) -> Convexification {
                self.convexification
            }
            fn run(
                self,
                dynamics: &mut PhaseDynamics,
                _: &Nodes<'_, $number>,
                _: Sink<'_, $number>,
            ) -> Result<(), OcpError> {
                match *dynamics {}
            }
        }
    )*};
}

curvatures! {
    f64, Exact, true;
    f32, Exact, true;
    f64, GaussNewton, false;
    f32, GaussNewton, false;
}
