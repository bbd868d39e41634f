//! Links: the map from the end of a phase to the start of the next.

use crate::function::{ArrayV, Function};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::constraint::{Constraint, ConstraintContext, Constraints};
use crate::ocp::formulation::functions::node_evaluation::{
    AvailableVariables, ParameterDerivatives, QuadraticTerms, write_variables,
};
use crate::qp::element::set;
use crate::qp::{copy_common, part_mut};
use crate::scalar::Real;
use crate::shape::{Array, Outputs, Plain, Shape};
use bytemuck::Zeroable;
use core::fmt;

/// The end of a phase.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct PhaseEnd<'a, T> {
    pub(in crate::ocp) stage: usize,
    pub(in crate::ocp) x: &'a [T],
    /// Free parameters, and their positions among the parameters of the model.
    pub(in crate::ocp) w: &'a [T],
    pub(in crate::ocp) free: FreeParametersView<'a>,
    /// The set parameters.
    pub(in crate::ocp) p: &'a [T],
    pub(in crate::ocp) t: T,
}

/// The dimensions that a link must match.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct PhaseDims {
    /// `NX`, `NU`, `NP`, `NZ` of the phase before the link.
    pub(in crate::ocp) ending_dims: [usize; 4],
    /// States of the phases before and after the link, without linear controls and integrals.
    pub(in crate::ocp) model_states: usize,
    pub(in crate::ocp) next_states: usize,
    /// The last stage of the phase before the link, and whether its time is fixed.
    pub(in crate::ocp) stage: usize,
    pub(in crate::ocp) is_timed: bool,
}

/// The map from the end of a phase to the start of the next: [`Jump`], or [`Continuous`].
///
/// ```
/// use casados::ocp::{Continuous, Link};
///
/// fn is_named<L: Link<f64>>(link: &L, name: &str) -> bool { link.name() == name }
/// assert!(is_named(&Continuous, "Continuous"));
/// ```
pub trait Link<T: Real> {
    /// Returns its name for messages.
    fn name(&self) -> &'static str;
    /// Returns whether it is linear.
    #[doc(hidden)]
    fn is_linear(&self) -> bool;
    /// Checks that its arguments match the phase before and its outputs the states of the phase
    /// after.
    #[doc(hidden)]
    fn check(&self, dims: PhaseDims) -> Result<(), OcpError>;
    /// Evaluates the first state of the next phase.
    #[doc(hidden)]
    fn value(&mut self, end: PhaseEnd<'_, T>, values: &mut [T]) -> Result<(), OcpError>;
    /// Evaluates the first state of the next phase and its derivatives, a column over the variables
    /// of the stage for each state.
    #[doc(hidden)]
    fn linearise(
        &mut self,
        end: PhaseEnd<'_, T>,
        values: &mut [T],
        columns: (&mut [T], usize),
    ) -> Result<(), OcpError>;
    /// Evaluates `∂y/∂p` of the next state, a row over the parameters for each state, and adds the
    /// derivatives with respect to parameters of the gradient, weighted by these multipliers.
    #[doc(hidden)]
    fn add_parameter_derivatives(
        &mut self,
        end: PhaseEnd<'_, T>,
        multipliers: &[T],
        slopes: &mut [T],
        cross: &mut ParameterDerivatives<'_, T>,
    );
    /// Adds its second derivatives, weighted by these multipliers.
    #[doc(hidden)]
    fn add_hessian(&mut self, end: PhaseEnd<'_, T>, multipliers: &[T], terms: &mut QuadraticTerms<'_, T>);
}

/// The states are continuous.
///
/// [`Phases`](crate::ocp::Phases) has an example.
///
/// ```
/// use casados::ocp::{Continuous, Link};
///
/// assert_eq!(Link::<f64>::name(&Continuous), "Continuous");
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Continuous;

impl<T: Real> Link<T> for Continuous {
    fn name(&self) -> &'static str {
        "Continuous"
    }
    fn is_linear(&self) -> bool {
        true
    }
    fn check(&self, dims: PhaseDims) -> Result<(), OcpError> {
        check_dimension("Continuous", "output", [dims.next_states, dims.model_states])
    }
    fn value(&mut self, end: PhaseEnd<'_, T>, values: &mut [T]) -> Result<(), OcpError> {
        copy_common(values, end.x);
        Ok(())
    }
    fn linearise(
        &mut self,
        end: PhaseEnd<'_, T>,
        values: &mut [T],
        (columns, ld): (&mut [T], usize),
    ) -> Result<(), OcpError> {
        copy_common(values, end.x);
        (0..values.len()).for_each(|i| set(columns, i * ld + i, T::ONE));
        Ok(())
    }
    fn add_hessian(&mut self, _: PhaseEnd<'_, T>, _: &[T], _: &mut QuadraticTerms<'_, T>) {}
    fn add_parameter_derivatives(
        &mut self,
        _: PhaseEnd<'_, T>,
        _: &[T],
        _: &mut [T],
        _: &mut ParameterDerivatives<'_, T>,
    ) {
    }
}

/// The states of the next phase are a function of the states and parameters at the end of a phase:
/// an impact, a separation with a loss of mass, a change of the frame.
///
/// The function has the arguments of the model before the link, depends on no control and no
/// algebraic state, and has an output for each state of the model after it. Its first and second
/// derivatives are exact. A decision at the switch, as an impulse, is a free parameter of the phase
/// before.
///
/// [`Phases`](crate::ocp::Phases) has an example.
///
/// ```
/// use casados::ocp::{Jump, Link};
/// use casados::prelude::*;
///
/// /// A ball of which the ground leaves nine tenths of the speed.
/// #[function]
/// fn impact(x: [f64; 2]) -> [f64; 2] { [x[0], -0.9 * x[1]] }
///
/// assert_eq!(Link::<f64>::name(&Jump::<Impact>::new()), "Impact");
/// ```
pub struct Jump<F: Function, T: Plain = f64> {
    function: Constraint<F, T>,
    v: ArrayV<F, T>,
}

impl<F: Function, T: Real> Jump<F, T> {
    /// The link by this function.
    #[must_use]
    pub fn new() -> Self {
        let none = T::from_f64(f64::INFINITY);
        let function = Constraint::new(Array::from_fn(|_| -none), Array::from_fn(|_| none));
        Self { function, v: Zeroable::zeroed() }
    }

    fn load_variables(&mut self, PhaseEnd { x, w, free, p, t, .. }: PhaseEnd<'_, T>) {
        let begin = 2 * F::Shape::NX + F::Shape::NZ + F::Shape::NU;
        write_variables::<F::Shape, T>(&mut self.v, [x, &[], &[], p], t);
        free.write_parameters(part_mut(self.v.as_mut(), begin, F::Shape::NP), w);
    }
}

impl<F: Function, T: Real> Default for Jump<F, T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<F: Function, T: Plain> fmt::Debug for Jump<F, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Jump").field(&F::STRUCTURE.name).finish()
    }
}

impl<F: Function, T: Real> Link<T> for Jump<F, T> {
    fn name(&self) -> &'static str {
        F::STRUCTURE.name
    }
    fn is_linear(&self) -> bool {
        F::STRUCTURE.hessian.is_empty()
    }
    fn check(&self, dims: PhaseDims) -> Result<(), OcpError> {
        let function_dims = [F::Shape::NX, F::Shape::NU, F::Shape::NP, F::Shape::NZ];
        let name = F::STRUCTURE.name;
        for (argument, (expected, found)) in
            ["x", "u", "p", "z"].into_iter().zip(dims.ending_dims.into_iter().zip(function_dims))
        {
            check_dimension(name, argument, [expected, found])?;
        }
        check_dimension(name, "output", [dims.next_states, F::Outputs::NY])?;
        AvailableVariables { z: false, u: false, stage: dims.stage, t: dims.is_timed, degrees: &[] }
            .check::<F>()
    }
    fn value(&mut self, end: PhaseEnd<'_, T>, values: &mut [T]) -> Result<(), OcpError> {
        self.load_variables(end);
        self.function.value(&self.v, values, ConstraintContext::new(end.stage, end.free, &[]))
    }
    fn linearise(
        &mut self,
        end: PhaseEnd<'_, T>,
        values: &mut [T],
        (columns, ld): (&mut [T], usize),
    ) -> Result<(), OcpError> {
        self.load_variables(end);
        self.function.linearise(
            &self.v,
            values,
            columns,
            ld,
            ConstraintContext::new(end.stage, end.free, &[]),
        )
    }
    fn add_hessian(&mut self, end: PhaseEnd<'_, T>, multipliers: &[T], terms: &mut QuadraticTerms<'_, T>) {
        self.load_variables(end);
        self.function.add_hessian(
            &self.v,
            multipliers,
            ConstraintContext::new(end.stage, end.free, &[]),
            terms,
        );
    }
    fn add_parameter_derivatives(
        &mut self,
        end: PhaseEnd<'_, T>,
        multipliers: &[T],
        slopes: &mut [T],
        cross: &mut ParameterDerivatives<'_, T>,
    ) {
        self.load_variables(end);
        let context = ConstraintContext::new(end.stage, end.free, &[]);
        self.function.add_parameter_derivatives(&self.v, Some(multipliers), context, slopes, cross);
    }
}

/// # Errors
/// [`OcpError::LinkDimension`]
fn check_dimension(
    link: &'static str,
    what: &'static str,
    [expected, found]: [usize; 2],
) -> Result<(), OcpError> {
    if expected == found { Ok(()) } else { Err(OcpError::LinkDimension { link, what, expected, found }) }
}
