//! What can be chosen.

/// How far a step goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Globalisation {
    /// All the way, always: what converges fastest where it converges.
    #[default]
    FullStep,
    /// As far as the merit function `f + ν ‖c‖₁` shrinks as it should, with second-order correction.
    Merit,
    /// As far as objective or violation shrink compared to all iterates before, with second-order correction.
    Filter,
}

/// Options of [`Sqp`](super::Sqp).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SqpOptions {
    /// Every one of the four [`Residuals`](crate::qp::Residuals) is to be below. Default 1e-6; of single precision 1e-3.
    pub tolerance: f64,
    /// Default 50.
    pub max_iterations: usize,
    /// Default [`Globalisation::FullStep`].
    pub globalisation: Globalisation,
    /// Whether QPs begin at the solution of the one before. Default true.
    pub warm_start: bool,
    /// QPs are solved to this part of the largest residual, if that is more than the solver's own tolerance: what the
    /// linearisation is off by is more. Default 1e-4.
    pub qp_accuracy: f64,
    /// Whether bounds of states and constraints get penalties while a QP is infeasible. Default true.
    pub elastic: bool,
    /// The first of these penalties, linear; they grow by factors of ten up to ten thousand times that. Default 1e3.
    pub elastic_penalty: f64,
    /// The shortest step of a line search. Default 1e-6.
    pub shortest_step: f64,
}

impl SqpOptions {
    /// For numbers of some precision.
    #[must_use]
    pub fn new<T: crate::scalar::Real>() -> Self {
        Self {
            tolerance: if T::EPSILON < 1e-10 { 1e-6 } else { 1e-3 },
            max_iterations: 50,
            globalisation: Globalisation::default(),
            warm_start: true,
            qp_accuracy: 1e-4,
            elastic: true,
            elastic_penalty: 1e3,
            shortest_step: 1e-6,
        }
    }
}
