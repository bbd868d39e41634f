//! Integration with projection onto the invariants.

use super::Projectable;
use super::kkt::{Kkt, ProjectionFunction, Variable, variable};
use crate::error::{Argument, Error};
use crate::finite::{check_forward, check_model_input, check_output, check_second_derivatives};
use crate::function::{ArrayY, Function};
use crate::integrator::Integrator;
use crate::memory::{Family, Memory, WithAdjoint, WithForward, WithHessian};
use crate::model::{ArrayW, Dae, VectorP, VectorU, VectorX};
use crate::quadrature::OptionalIntegrand;
use crate::result::{Adjoint, Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Outputs, Plain, Shape, entry, update_entry};
use crate::statistics::Statistics;
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// An integrator with projection onto the invariants of its model at the end of every call:
///
/// ```text
/// x₊ = argmin ½ |x − x̂(x₀, u, p)|²    with  y(x, p, t + h) = 0
/// ```
///
/// where `x̂` is the result of the integrator. Derivatives of first and second order are exact
/// derivatives of the composed map. For a projection after every step, let the integrator take one
/// step per call. `adjoint` and `hessian` integrate twice, since they need the projection first.
/// Algebraic states and integrals are those of the integrator.
///
/// ```
/// use casados::prelude::*;
/// use casados::{Integrator, Projected};
/// use nalgebra::vector;
///
/// /// A pendulum on a circle of radius one.
/// #[dae(index_reduction(projection))]
/// fn pendulum(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
///     let circle = x[0] * x[0] + x[1] * x[1] - 1.0;
///     [xdot[0] - x[2], xdot[1] - x[3], xdot[2] + z * x[0], xdot[3] + z * x[1] + 9.81, circle]
/// }
///
/// let mut irk = Projected::new(Irk::<Pendulum, RadauIIA<2>>::new(Options::default())?);
/// let mut x = vector![1.0, 0.0, 0.0, 0.0];
/// for _ in 0..1000 {
///     x = irk.solve(&x, &vector![], 0.02)?.x;
/// }
/// assert!((x[0].hypot(x[1]) - 1.0).abs() < 1e-15);
/// # Ok::<(), casados::Error>(())
/// ```
#[non_exhaustive]
pub struct Projected<I: Integrator<Model: Projectable>> {
    integrator: I,
    /// The parameters, if they were set.
    parameters: Option<VectorP<I::Model, I::Number>>,
    time: I::Number,
    nominal: NominalStorage<I, NominalMemory<I::Model, I::Number>>,
    forward: <I::Memory as Memory>::Forward<Forward<I::Model, I::Number>>,
    adjoint: <I::Memory as Memory>::Adjoint<Adjoints<I::Model, I::Number>>,
    hessian: <I::Memory as Memory>::Hessian<HessianMemory<I::Model, I::Number>>,
}

type NominalStorage<I, V> = <<I as Integrator>::Memory as Memory>::Nominal<V>;

/// The memory of all calls.
#[derive(Zeroable)]
#[zeroable(bound = "")]
struct NominalMemory<M: Projectable, T: Real> {
    result: Nominal<M, T>,
    kkt: Kkt<M, T>,
}

/// Results of `adjoint`.
struct Adjoints<M, T>(PhantomData<fn() -> (M, T)>);

impl<M: Dae, T: Plain> Family for Adjoints<M, T> {
    type Of<const C: usize> = Adjoint<M, T, C>;
}

/// Results of `hessian`, and its scratch memory.
#[derive(Zeroable)]
#[zeroable(bound = "")]
struct HessianMemory<M: Projectable, T: Real> {
    result: Hessian<M, T>,
    /// `d(x, ν)/dw`: columns of `x₀`, `u` and `p`.
    by_x: <<ProjectionFunction<M> as Function>::Outputs as Outputs>::MatrixYX<M::Shape, T>,
    by_u: <<ProjectionFunction<M> as Function>::Outputs as Outputs>::MatrixYU<M::Shape, T>,
    by_p: <<ProjectionFunction<M> as Function>::Outputs as Outputs>::MatrixYP<M::Shape, T>,
    hessian_entries: <ProjectionFunction<M> as Function>::Hessian<T>,
}

/// `A + B`, element by element.
fn add_assign<T: Real>(to: &mut [T], from: &[T]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *to + *from);
}

impl<M: Projectable, T: Real, I: Integrator<Model = M, Number = T>> Projected<I> {
    /// Returns an integrator with projection. Its parameters must be set here: otherwise models
    /// with parameters return [`Error::ParametersNotSet`]. Its time is set by `set_time`, and zero
    /// by default.
    pub fn new(integrator: I) -> Self {
        Self {
            integrator,
            parameters: None,
            time: T::ZERO,
            nominal: Default::default(),
            forward: Default::default(),
            adjoint: Default::default(),
            hessian: Default::default(),
        }
    }

    /// Returns the integrator. Every call overwrites its parameters and its time with those of the
    /// projection.
    pub fn integrator(&mut self) -> &mut I {
        &mut self.integrator
    }

    /// Sets the parameters and the time of the integrator before a call.
    ///
    /// # Errors
    /// [`Error::ParametersNotSet`]
    fn prepare_integrator(&mut self) -> Result<VectorP<M, T>, Error> {
        self.integrator.set_time(self.time)?;
        match &self.parameters {
            Some(p) => {
                self.integrator.set_parameters(p)?;
                Ok(*p)
            }
            None if M::Shape::NP > 0 => Err(Error::ParametersNotSet),
            None => Ok(VectorP::<M, T>::zeroed()),
        }
    }

    /// Integrates, and projects the final state.
    fn project(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&mut NominalMemory<M, T>, Error> {
        let p = self.prepare_integrator()?;
        let nominal = *self.integrator.solve_with_quadrature(x0, u, h, integrand)?;
        let memory = I::Memory::nominal(&mut self.nominal)?;
        memory.result = nominal;
        memory.kkt.project(&mut memory.result.x, &p, self.time + h)?;
        Ok(memory)
    }
}

/// `V ← dx₊/dw` for one block of columns; `of(row, column)` receives the rows of `d(x, ν)/dw`.
fn write_projected_columns<M: Projectable, T: Real, V: Matrix<T>>(
    kkt: &Kkt<M, T>,
    block: &mut V,
    parameters: bool,
    mut visit_row: impl FnMut(usize, usize, T),
) {
    for column in 0..V::COLUMNS {
        let parameter_seed = |parameter| if parameters && parameter == column { T::ONE } else { T::ZERO };
        let direction = kkt.direction(|row| block[(row, column)], parameter_seed);
        for (row, value) in direction.as_ref().iter().enumerate() {
            if row < V::ROWS {
                block[(row, column)] = *value;
            }
            visit_row(row, column, *value);
        }
    }
}

impl<M: Projectable, T: Real, I: Integrator<Model = M, Number = T>> Integrator for Projected<I> {
    type Model = M;
    type Number = T;
    type Memory = I::Memory;

    fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        self.integrator.set_parameters(p)?;
        self.parameters = Some(*p);
        Ok(())
    }

    fn set_time(&mut self, t: T) -> Result<(), Error> {
        self.integrator.set_time(t)?;
        self.time = t;
        Ok(())
    }

    fn reset(&mut self) {
        self.integrator.reset();
    }

    fn statistics(&self) -> Statistics {
        self.integrator.statistics()
    }

    fn solve_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        Ok(&self.project(x0, u, h, integrand)?.result)
    }

    fn forward_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error>
    where
        I::Memory: WithForward,
    {
        let p = self.prepare_integrator()?;
        let forward = self.integrator.forward_with_quadrature(x0, u, h, integrand)?;
        let result = I::Memory::forward(&mut self.forward)?;
        result.clone_from(forward);
        let memory = I::Memory::nominal(&mut self.nominal)?;
        memory.kkt.project(&mut result.nominal.x, &p, self.time + h)?;
        memory.kkt.check_parameters()?;
        write_projected_columns(&memory.kkt, &mut result.dx_dx0, false, |_, _, _| {});
        write_projected_columns(&memory.kkt, &mut result.dx_du, false, |_, _, _| {});
        write_projected_columns(&memory.kkt, &mut result.dx_dp, true, |_, _, _| {});
        check_forward(result, 0)?;
        Ok(result)
    }

    fn adjoint_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error>
    where
        I::Memory: WithAdjoint<1>,
    {
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        let memory = self.project(x0, u, h, None)?;
        memory.kkt.check_parameters()?;
        let mu = memory.kkt.multipliers(lambda);
        check_output(mu.as_ref(), 0)?;
        let mut integrator_seed = VectorX::<M, T>::zeroed();
        integrator_seed.as_mut_slice().copy_from_slice(&mu.as_ref()[..M::Shape::NX]);
        let x = memory.result.x;
        let adjoint = self.integrator.adjoint_with_quadrature(x0, u, h, &integrator_seed, integrand)?;
        let result = I::Memory::adjoint(&mut self.adjoint)?;
        result.clone_from(adjoint);
        result.nominal.x = x;
        let kkt = &I::Memory::nominal(&mut self.nominal)?.kkt;
        let gradient = result.grad_p.as_mut_slice();
        kkt.visit_parameter_jacobian(|row, parameter, value| {
            if let (Some(gradient), Some(mu)) = (gradient.get_mut(parameter), mu.as_ref().get(row)) {
                *gradient = *gradient - value * *mu;
            }
        });
        check_output(result.grad_p.as_slice(), 0)?;
        Ok(result)
    }

    fn hessian_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error>
    where
        I::Memory: WithHessian,
    {
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        let memory = self.project(x0, u, h, None)?;
        memory.kkt.check_parameters()?;
        let mu = memory.kkt.multipliers(lambda);
        check_output(mu.as_ref(), 0)?;
        let mut integrator_seed = VectorX::<M, T>::zeroed();
        integrator_seed.as_mut_slice().copy_from_slice(&mu.as_ref()[..M::Shape::NX]);
        let x = memory.result.x;
        let hessian = self.integrator.hessian_with_quadrature(x0, u, h, &integrator_seed, integrand)?;
        let memory = I::Memory::hessian(&mut self.hessian)?;
        memory.result.clone_from(hessian);
        let kkt = &I::Memory::nominal(&mut self.nominal)?.kkt;
        memory.project_derivatives(kkt, &mu, x);
        let result = &memory.result;
        check_forward(&result.first.forward, 0)?;
        check_output(result.first.grad_p.as_slice(), 0)?;
        check_second_derivatives(result)?;
        Ok(result)
    }
}

impl<M: Projectable, T: Real> HessianMemory<M, T> {
    /// Applies the projection to derivatives.
    fn project_derivatives(
        &mut self,
        kkt: &Kkt<M, T>,
        mu: &ArrayY<ProjectionFunction<M>, T>,
        x: VectorX<M, T>,
    ) {
        let Self { result, by_x, by_u, by_p, hessian_entries: second } = self;
        let first = &mut result.first;
        first.forward.nominal.x = x;
        write_projected_columns(kkt, &mut first.forward.dx_dx0, false, |row, column, value| {
            by_x[(row, column)] = value
        });
        write_projected_columns(kkt, &mut first.forward.dx_du, false, |row, column, value| {
            by_u[(row, column)] = value
        });
        write_projected_columns(kkt, &mut first.forward.dx_dp, true, |row, column, value| {
            by_p[(row, column)] = value
        });
        let mut gradient = VectorP::<M, T>::zeroed();
        kkt.visit_parameter_jacobian(|row, parameter, value| {
            let gradient = gradient.as_mut_slice().get_mut(parameter);
            if let (Some(gradient), Some(mu)) = (gradient, mu.as_ref().get(row)) {
                *gradient = *gradient - value * *mu;
            }
        });
        add_assign(first.grad_p.as_mut_slice(), gradient.as_slice());
        kkt.hessian(mu, second);
        let direction_row = |index: usize| {
            let (nx, nu) = (M::Shape::NX, M::Shape::NU);
            ArrayW::<M, T>::from_fn(|w| match (variable::<M>(index), w.checked_sub(nx + nu)) {
                (Variable::Parameter(parameter), p) => {
                    if p == Some(parameter) {
                        T::ONE
                    } else {
                        T::ZERO
                    }
                }
                (Variable::Unknown(row), Some(p)) => entry(by_p, row, p),
                (Variable::Unknown(row), None) => match w.checked_sub(nx) {
                    Some(u) => entry(by_u, row, u),
                    None => entry(by_x, row, w),
                },
            })
        };
        let pattern = &<ProjectionFunction<M> as Function>::STRUCTURE.hessian;
        for ((i, j), &value) in pattern.iter().zip(second.as_ref()) {
            let (a, b) = (direction_row(i), direction_row(j));
            subtract_rank_two(result, &a, &b, if i == j { value * T::from_f64(0.5) } else { value });
        }
    }
}

/// `H −= value (a bᵀ + b aᵀ)`
fn subtract_rank_two<M: Dae, T: Real>(
    result: &mut Hessian<M, T>,
    a: &ArrayW<M, T>,
    b: &ArrayW<M, T>,
    value: T,
) {
    let (a, b) = (split_row::<M, T>(a), split_row::<M, T>(b));
    let [x, u, p] = [[a[0], b[0]], [a[1], b[1]], [a[2], b[2]]];
    subtract_rank_two_block(&mut result.h_xx, x, x, value);
    subtract_rank_two_block(&mut result.h_xu, x, u, value);
    subtract_rank_two_block(&mut result.h_uu, u, u, value);
    subtract_rank_two_block(&mut result.h_xp, x, p, value);
    subtract_rank_two_block(&mut result.h_up, u, p, value);
    subtract_rank_two_block(&mut result.h_pp, p, p, value);
}

/// Splits a row into the parts of `x₀`, `u` and `p`.
fn split_row<M: Dae, T: Real>(row: &ArrayW<M, T>) -> [&[T]; 3] {
    let (x, rest) = row.as_ref().split_at_checked(M::Shape::NX).unwrap_or_default();
    let (u, p) = rest.split_at_checked(M::Shape::NU).unwrap_or_default();
    [x, u, p]
}

/// [`subtract_rank_two`] for one block, with the parts of its rows and columns.
fn subtract_rank_two_block<T: Real, V: Matrix<T>>(
    matrix: &mut V,
    rows: [&[T]; 2],
    columns: [&[T]; 2],
    value: T,
) {
    for (j, (a_j, b_j)) in columns[0].iter().zip(columns[1]).enumerate() {
        for (i, (a_i, b_i)) in rows[0].iter().zip(rows[1]).enumerate() {
            update_entry(matrix, i, j, |element| element - value * (*a_i * *b_j + *b_i * *a_j));
        }
    }
}
