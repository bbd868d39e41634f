//! Adjoints of solutions, and derivatives of optimal values, from the factors of a solution.

use super::bordered_system::BorderedSystem;
use super::bound_stiffness::BoundStiffness;
use super::factors::SolutionFactors;
use super::kkt_direction::KktDirection;
use super::parameters::KktParameterDerivatives;
use super::recursion::ActiveConstraintSink;
use super::results::{SolutionAdjoint, ValueHessian};
use super::{recursion, solve};
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::instance::{InitialState, Ocp};
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::qp::element::{get, set};
use crate::qp::{QpView, Solution, StageDims, copy_common, part, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;

impl<T: Real> SolutionFactors<T> {
    /// Computes the Hessian of the optimal value.
    pub fn value_hessian(&mut self) -> ValueHessian<'_, T> {
        let ([_, _, np], given) = (self.dims, self.given_initial_states());
        let mut direction = core::mem::take(&mut self.direction);
        for i in 0..given {
            solve::solve_initial_state(self, i, &mut direction);
            copy_common(part_mut(&mut self.hessian_x0, i * given, given), direction.multipliers(0));
        }
        for p in 0..np {
            solve::solve_parameter(self, p, &mut direction);
            copy_common(part_mut(&mut self.hessian_x0_p, p * given, given), direction.multipliers(0));
            for q in 0..np {
                let value = get(&self.parameter_derivatives.value_hessian, p * np + q)
                    + self.product_with_parameter(q, &direction);
                set(&mut self.hessian_p, p * np + q, value);
            }
        }
        self.direction = direction;
        ValueHessian {
            xx: part(&self.hessian_x0, 0, given * given),
            xp: part(&self.hessian_x0_p, 0, given * np),
            pp: &self.hessian_p,
        }
    }

    /// Computes `λᵀ dw/dx₀` and `λᵀ dw/dp`, where `λ` are the states and controls of `seed`;
    /// multipliers of the seed are ignored.
    ///
    /// # Errors
    /// [`OcpError::Length`] if the seed has other dimensions; [`OcpError::InvalidValue`] if it is
    /// not finite.
    pub fn adjoint<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &mut self,
        seed: &Solution<T, D, M>,
    ) -> Result<SolutionAdjoint<'_, T>, OcpError> {
        self.check_seed(seed)?;
        let mut direction = core::mem::take(&mut self.direction);
        solve::solve_seed(self, seed, &mut direction);
        for p in 0..self.dims[2] {
            let value = self.product_with_parameter(p, &direction);
            set(&mut self.adjoint, p, value);
        }
        self.direction = direction;
        Ok(SolutionAdjoint {
            x0: part(self.direction.multipliers(0), 0, self.given_initial_states()),
            p: &self.adjoint,
        })
    }

    /// The product of a KKT direction with the derivative of the optimality conditions with respect
    /// to a parameter.
    fn product_with_parameter(&self, p: usize, direction: &KktDirection<T>) -> T {
        let [nx, nu, _] = self.dims;
        let mut sum = T::ZERO;
        for k in 0..=self.intervals {
            let gradient = part(self.parameter_derivatives.gradient_jacobian(k), p * (nx + nu), nx + nu);
            let (of_x, of_u) = gradient.split_at_checked(nx).unwrap_or_default();
            let end = part(self.parameter_derivatives.end_jacobian(k), p * nx, nx);
            let pairs = of_x.iter().zip(direction.state(k)).chain(of_u.iter().zip(direction.control(k)));
            let pairs = pairs.chain(end.iter().zip(direction.multipliers(k + 1)));
            sum = pairs.fold(sum, |sum, (&a, &b)| sum + a * b);
        }
        let slope = |stage, row| self.parameter_derivatives.constraint_slope(stage, row, p);
        sum + self.product_with_forces(direction, slope)
    }

    fn check_seed<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &self,
        seed: &Solution<T, D, M>,
    ) -> Result<(), OcpError> {
        let [nx, nu, _] = self.dims;
        let (expected, found) = (self.intervals + 1, seed.dims().len());
        if expected != found {
            return Err(OcpError::Length { part: Part::Dimensions, stage: 0, expected, found });
        }
        for (stage, stage_point) in seed.stages().enumerate() {
            let controls = if stage < self.intervals { nu } else { self.free };
            for (part, values, expected) in
                [(Part::States, stage_point.x, nx), (Part::Controls, stage_point.u, controls)]
            {
                if values.len() != expected {
                    return Err(OcpError::Length { part, stage, expected, found: values.len() });
                }
                if let Some((index, value)) = crate::finite::find_non_finite(values) {
                    return Err(OcpError::InvalidValue { part, stage, name: "seed", index, value });
                }
            }
        }
        Ok(())
    }

    /// # Errors
    /// [`OcpError::InvalidOption`]
    pub(in crate::ocp) fn check_smoothing(&self) -> Result<(), OcpError> {
        let value = self.smoothing.to_f64();
        if value >= 0.0 && value.is_finite() {
            return Ok(());
        }
        Err(OcpError::InvalidOption { name: "smoothing", value, allowed: "at least 0 and finite" })
    }

    /// Factorises the QP at the iterate by the recursion and the bordered system, with active
    /// constraints of this compliance. A small one leaves an error to be removed by forces, a
    /// smaller one loses digits: `∛ε` for solves, `√ε` for gains, which have no forces.
    ///
    /// # Errors
    /// [`OcpError::Qp`]
    pub(in crate::ocp) fn factorise_qp<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &mut self,
        qp: QpView<'_, T>,
        iterate: &Solution<T, D, M>,
        compliance: T,
        on_active: ActiveConstraintSink<'_, T>,
    ) -> Result<(), OcpError> {
        let mut largest = T::ZERO;
        for stage in qp.stages() {
            for &value in stage.arrays().hessian {
                largest = value.abs().max(largest);
            }
        }
        let mut stiffness = BoundStiffness::new(largest, self.smoothing, compliance);
        recursion::factorise(self, qp, iterate, &mut stiffness, on_active)?;
        self.weakly_active = stiffness.weakly_active;
        let mut direction = core::mem::take(&mut self.direction);
        let result = BorderedSystem::factorise(self, &mut direction);
        self.direction = direction;
        self.write_feedback();
        recursion::value_gradient(qp, iterate, &mut self.gradient);
        result
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Factorises the optimality conditions at the iterate, which must be a solution, for
    /// derivatives of the solution and of its value.
    ///
    /// With [`Exact`](crate::ocp::Exact) Hessians without convexification the derivatives are
    /// exact. With Gauss-Newton Hessians they are approximations, except for the gradient of the
    /// value, which does not depend on the Hessian.
    ///
    /// # Errors
    /// The errors of [`Ocp::linearise`]; [`OcpError::Missing`] if the initial state is undefined;
    /// [`OcpError::Length`] if the memory is that of another problem;
    /// [`OcpError::InvalidOption`] for the smoothing; [`OcpError::Qp`] if the reduced Hessian is
    /// not positive definite.
    pub fn factorise<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        factors: &mut SolutionFactors<T>,
    ) -> Result<(), OcpError> {
        self.prepare_factors(factors)?;
        self.differentiate_with(curvature, &mut factors.parameter_derivatives)?;
        let mut derivatives = core::mem::take(&mut factors.parameter_derivatives);
        let compliance = T::from_f64(T::EPSILON).cbrt();
        let result =
            factors.factorise_qp(self.qp.view(), &self.iterate, compliance, &mut |place, stiffness, c| {
                derivatives.add_constraint(place, stiffness, c);
            });
        factors.parameter_derivatives = derivatives;
        result
    }

    /// Linearises the problem, and computes the derivatives of its functions with respect to
    /// parameters.
    ///
    /// # Errors
    /// The errors of [`Ocp::linearise`]; [`OcpError::Unsupported`]
    pub(in crate::ocp) fn differentiate_with<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        result: &mut KktParameterDerivatives<T>,
    ) -> Result<(), OcpError> {
        if self.layout().inner_rows > 0 {
            let what =
                "derivatives of solutions with bounds of algebraic states or at points inside intervals";
            return Err(OcpError::Unsupported { what, remedy: "Write these as path constraints at nodes" });
        }
        result.reset();
        let free = self.free.clone();
        self.linearise_with_observer(curvature, &mut |k, step| result.add_interval(k, step, free.view()))?;
        self.differentiate_functions(C::EXACT, result)?;
        result.clear_free_parameters(self.free.view());
        Ok(())
    }

    /// Checks memory and options, and prepares the bordered system.
    ///
    /// # Errors
    /// [`OcpError::Missing`], [`OcpError::Length`], [`OcpError::InvalidOption`],
    /// [`OcpError::Unsupported`]
    pub(super) fn prepare_factors(&self, factors: &mut SolutionFactors<T>) -> Result<(), OcpError> {
        if self.initial_state == InitialState::Unknown {
            return Err(OcpError::Missing { part: Part::InitialState, stage: 0 });
        }
        factors.check_smoothing()?;
        let (part, stage) = (Part::Memory, 0);
        let free = self.free.count();
        let problem_dims = [P::Shape::NX, free + P::Shape::NU, P::Shape::NP, self.intervals(), free];
        let [nx, nu, np] = factors.dims;
        for (expected, found) in problem_dims.into_iter().zip([nx, nu, np, factors.intervals, factors.free]) {
            if expected != found {
                return Err(OcpError::Length { part, stage, expected, found });
            }
        }
        let free_states = match self.initial_state {
            InitialState::Free => 0..nx,
            InitialState::PartlyFixed => {
                let names = self.names();
                names.model_state_count()..names.model_state_count() + names.linear.len()
            }
            _ => 0..0,
        };
        factors.bordered_system.prepare(self.qp.view(), free_states, [nx, nu, self.intervals()])
    }
}
