//! The checks of integrators accept right answers and find wrong ones.

use super::example::*;
use casados_core::error::Error;
use casados_core::integrator::Integrator;
use casados_core::memory::Heap;
use casados_core::quadrature::Integrand;
use casados_core::result::{Adjoint, Forward, Hessian, Nominal};
use casados_core::statistics::Statistics;
use casados_core::testing::{Exact, Report, check_exact, check_sensitivities, convergence};
use nalgebra::SVector;

/// An integrand, or none.
type Along<'a, 'b, M, T> = Option<&'a mut (dyn Integrand<M, T> + 'b)>;

/// An integrator whose answers are those of `x = x₀ e^{uh} + p x₀²`, `z = p x₀`, `z₀ = u x₀`, with
/// a fault on request.
struct ClosedFormIntegrator<const FAULT: u8> {
    p: f64,
    calls: f64,
    result: Hessian<Example<NO_FAULT>>,
    adjoint: Adjoint<Example<NO_FAULT>>,
}

const GRADIENT_FAULT: u8 = 1;
const HESSIAN_FAULT: u8 = 3;
const FORWARD_FAULT: u8 = 4;
const REPEATED_CALL_FAULT: u8 = 5;

impl<const FAULT: u8> ClosedFormIntegrator<FAULT> {
    fn new() -> Self {
        let (result, adjoint) = (bytemuck::Zeroable::zeroed(), bytemuck::Zeroable::zeroed());
        Self { p: f64::NAN, calls: 0.0, result, adjoint }
    }

    fn evaluate(&mut self, x0: f64, u: f64, h: f64, lambda: f64) {
        let (p, e) = (self.p, f64::exp(u * h));
        let r = &mut self.result;
        let f = &mut r.first.forward;
        (f.nominal.x[0], f.nominal.z[0], f.nominal.z0[0]) = (x0 * e + p * x0 * x0, p * x0, u * x0);
        (f.dx_dx0[0], f.dx_du[0], f.dx_dp[0]) = (e + 2.0 * p * x0, h * x0 * e, x0 * x0);
        (f.dz_dx0[0], f.dz_du[0], f.dz_dp[0]) = (p, 0.0, x0);
        (f.dz0_dx0[0], f.dz0_du[0], f.dz0_dp[0]) = (u, x0, 0.0);
        (r.h_xx[0], r.h_xu[0], r.h_xp[0]) = (lambda * 2.0 * p, lambda * h * e, lambda * 2.0 * x0);
        (r.h_uu[0], r.h_up[0], r.h_pp[0]) = (lambda * h * h * x0 * e, 0.0, 0.0);
        let f = &mut r.first.forward;
        match FAULT {
            FORWARD_FAULT => f.dz0_du[0] *= 1.0 + 1e-12,
            HESSIAN_FAULT => r.h_xu[0] *= 1.0 + 1e-8,
            REPEATED_CALL_FAULT => {
                self.calls += 1.0;
                f.nominal.x[0] *= 1.0 + f64::EPSILON * self.calls;
            }
            _ => {}
        }
        let (x, u, p) = (f.dx_dx0[0], f.dx_du[0], f.dx_dp[0]);
        (r.first.grad_x0[0], r.first.grad_u[0], r.first.grad_p[0]) = (lambda * x, lambda * u, lambda * p);
        if FAULT == GRADIENT_FAULT {
            r.first.grad_u[0] *= 1.0 + 1e-12;
        }
    }
}

impl<const FAULT: u8> Integrator for ClosedFormIntegrator<FAULT> {
    type Model = Example<NO_FAULT>;
    type Number = f64;
    type Memory = Heap;

    fn set_parameters(&mut self, p: &SVector<f64, 1>) -> Result<(), Error> {
        self.p = p[0];
        Ok(())
    }
    fn set_time(&mut self, _: f64) -> Result<(), Error> {
        Ok(())
    }
    fn reset(&mut self) {}
    fn statistics(&self) -> Statistics {
        Statistics::default()
    }
    fn solve_with_quadrature(
        &mut self,
        x0: &SVector<f64, 1>,
        u: &SVector<f64, 1>,
        h: f64,
        _: Along<'_, '_, Self::Model, f64>,
    ) -> Result<&Nominal<Example<NO_FAULT>>, Error> {
        self.evaluate(x0[0], u[0], h, 1.0);
        Ok(&self.result)
    }
    fn forward_with_quadrature(
        &mut self,
        x0: &SVector<f64, 1>,
        u: &SVector<f64, 1>,
        h: f64,
        _: Along<'_, '_, Self::Model, f64>,
    ) -> Result<&Forward<Example<NO_FAULT>>, Error> {
        self.evaluate(x0[0], u[0], h, 1.0);
        Ok(&self.result)
    }
    fn adjoint_with_quadrature(
        &mut self,
        x0: &SVector<f64, 1>,
        u: &SVector<f64, 1>,
        h: f64,
        lambda: &SVector<f64, 1>,
        _: Along<'_, '_, Self::Model, f64>,
    ) -> Result<&Adjoint<Example<NO_FAULT>>, Error> {
        self.evaluate(x0[0], u[0], h, lambda[0]);
        let first = self.result.first;
        self.adjoint.nominal = first.forward.nominal;
        (self.adjoint.grad_x0, self.adjoint.grad_u) = (first.grad_x0, first.grad_u);
        self.adjoint.grad_p = first.grad_p;
        Ok(&self.adjoint)
    }
    fn hessian_with_quadrature(
        &mut self,
        x0: &SVector<f64, 1>,
        u: &SVector<f64, 1>,
        h: f64,
        lambda: &SVector<f64, 1>,
        _: Along<'_, '_, Self::Model, f64>,
    ) -> Result<&Hessian<Example<NO_FAULT>>, Error> {
        self.evaluate(x0[0], u[0], h, lambda[0]);
        Ok(&self.result)
    }
}

fn sensitivities<const FAULT: u8>() -> Report {
    let v = SVector::<f64, 1>::new;
    check_sensitivities::<Example<NO_FAULT>, _>(
        &mut ClosedFormIntegrator::<FAULT>::new(),
        &v(0.7),
        &v(-1.2),
        &v(0.4),
        0.3,
    )
    .expect("a closed form does not fail")
}

#[test]
fn faults_of_sensitivities() {
    let report = sensitivities::<NO_FAULT>();
    report.assert();
    for row in &report.rows {
        assert!(row.difference <= 1e-10, "{report}");
    }
    let found = |report: Report, quantity: &str, entry: &str| {
        assert!(
            report.wrong.iter().any(|wrong| wrong.quantity == quantity && wrong.entry == entry),
            "{report}"
        );
    };
    found(sensitivities::<GRADIENT_FAULT>(), "adjoint", "by torque");
    found(sensitivities::<HESSIAN_FAULT>(), "Hessian", "by angle at the start and torque");
    found(sensitivities::<FORWARD_FAULT>(), "forward", "force at the start by torque");
    found(sensitivities::<REPEATED_CALL_FAULT>(), "solve", "element 0");
}

#[test]
fn exact_solution() {
    let v = SVector::<f64, 1>::new;
    let (x0, u, p, h) = (0.7, -1.2, 0.4, 0.3);
    let e = f64::exp(u * h);
    let mut exact = Exact {
        states: vec![x0 * e + p * x0 * x0, p * x0],
        first: vec![vec![e + 2.0 * p * x0, h * x0 * e, x0 * x0], vec![p, 0.0, x0]],
        second: vec![vec![
            vec![2.0 * p, h * e, 2.0 * x0],
            vec![h * e, h * h * x0 * e, 0.0],
            vec![2.0 * x0, 0.0, 0.0],
        ]],
    };
    let run = |exact: &Exact| {
        let (mut coarse, mut fine) =
            (ClosedFormIntegrator::<NO_FAULT>::new(), ClosedFormIntegrator::<NO_FAULT>::new());
        check_exact::<Example<NO_FAULT>, _>(&mut coarse, &mut fine, &v(x0), &v(u), &v(p), h, exact)
            .expect("a closed form does not fail")
    };
    run(&exact).assert();
    exact.second[0][1][1] *= 1.0 + 1e-13;
    assert!(!run(&exact).passed());
}

#[test]
fn convergence_order() {
    // The explicit Euler method on ẋ = −x: an order that is asked for and one that is not there.
    let euler = |steps: usize| {
        let h = 1.0 / steps as f64;
        Ok::<_, Error>(vec![(0..steps).fold(1.0, |x, _| x - h * x)])
    };
    let report = convergence(&[16, 32, 64, 128, 256], &[f64::exp(-1.0)], 1e-15, euler);
    report.assert_order(1.0);
    assert!(std::panic::catch_unwind(|| report.assert_order(2.0)).is_err());
    // Rounding says nothing about an order, and a failure is no result.
    assert_eq!(convergence(&[1, 2], &[1.0], 1e-15, |_| Ok::<_, Error>(vec![1.0])).order(), None);
    let failed = convergence(&[1, 2], &[1.0], 1e-15, |_| Err(Error::NoResult));
    assert!(std::panic::catch_unwind(|| failed.assert_error(1.0)).is_err());
}

/// Real integrators with a model written by hand, against the closed form of its solution.
mod logistic {
    use super::*;
    use crate::models::{NONE, adjoint_of_jacobian};
    use casados_core::model::{ArrayK, ArrayV, Dae, Elimination, Ode, Pattern, Structure, symmetric};
    use casados_core::options::Options;
    use casados_core::scalar::Lanes;
    use casados_core::shape::{Dims, Plain};
    use casados_core::{DormandPrince8, Erk, Gauss, Irk};

    /// `ẋ = u x (1 − x/K)`
    struct Logistic;

    impl Dae for Logistic {
        type Shape = Dims<1, 0, 1, 1, 1, 5, 3>;
        type Jacobian<T: Plain> = [T; 4];
        type Hessian<T: Plain> = [T; 5];
        type Factors<B: Plain> = [B; 0];
        const STRUCTURE: Structure = Structure {
            name: "logistic",
            x: &["population"],
            z: &[],
            u: &["rate"],
            p: &["limit"],
            jacobian: Pattern { rows: &[0, 0, 0, 0], columns: &[0, 1, 2, 3] },
            blocks: [0, 1, 2, 2, 3, 4],
            by_column: &[1, 2, 3],
            constant: &[true, false, false, false],
            hessian: Pattern { rows: &[1, 2, 3, 3, 3], columns: &[1, 1, 1, 2, 3] },
            linear: &[false],
            linear_in_state: false,
            constant_matrix: false,
            autonomous: false,
            constant_rows: &[false; 1],
            trivial: &[],
            quadratures: &[],
            directions: &[0, 1, 2],
            column_of_direction: &[0, 1, 2],
            curved: &[1, 2, 3],
            symmetric: &const {
                symmetric::<3, 8>(&Pattern { rows: &[1, 2, 3, 3, 3], columns: &[1, 1, 1, 2, 3] }, &[1, 2, 3])
            },
            diagonal_controls: &[],
            operations: NONE,
            elimination: Elimination::NONE,
            reduction: None,
        };

        fn residual<S: Lanes>(v: &ArrayV<Self, S::Cell>, f: &mut ArrayK<Self, S::Cell>) {
            let v = &v.map(|cell| S::load(&cell));
            let (mut values, cells) = (f.map(|cell| S::load(&cell)), f);
            let f = &mut values;
            let [xdot, x, u, limit, _] = *v;
            f[0] = xdot - u * x * (S::from_f64(1.0) - x / limit);
            cells.iter_mut().zip(f).for_each(|(cell, value)| value.store(cell));
        }
        fn jacobian_constants<S: Lanes>(jacobian: &mut Self::Jacobian<S::Cell>) {
            let (mut values, cells) = (jacobian.map(|cell| S::load(&cell)), jacobian);
            let jacobian = &mut values;
            jacobian[0] = S::from_f64(1.0);
            cells.iter_mut().zip(jacobian).for_each(|(cell, value)| value.store(cell));
        }
        fn residual_jacobian<S: Lanes>(
            v: &ArrayV<Self, S::Cell>,
            f: &mut ArrayK<Self, S::Cell>,
            jacobian: &mut Self::Jacobian<S::Cell>,
        ) {
            Self::residual::<S>(v, f);
            let v = &v.map(|cell| S::load(&cell));
            let (mut values, cells) = (jacobian.map(|cell| S::load(&cell)), jacobian);
            let jacobian = &mut values;
            let [_, x, u, limit, _] = *v;
            let (one, r) = (S::from_f64(1.0), x / limit);
            jacobian[1] = -u * (one - r - r);
            jacobian[2] = -x * (one - r);
            jacobian[3] = -u * r * r;
            cells.iter_mut().zip(jacobian).for_each(|(cell, value)| value.store(cell));
        }
        fn adjoint<S: Lanes>(
            v: &ArrayV<Self, S::Cell>,
            mu: &ArrayK<Self, S::Cell>,
            g: &mut ArrayV<Self, S::Cell>,
        ) {
            adjoint_of_jacobian::<Self, S>(v, mu, g, [v[0]; 4], [v[0]; 1]);
        }
        fn hessian<S: Lanes>(
            v: &ArrayV<Self, S::Cell>,
            mu: &ArrayK<Self, S::Cell>,
            hessian: &mut Self::Hessian<S::Cell>,
        ) {
            let v = &v.map(|cell| S::load(&cell));
            let mu = &mu.map(|cell| S::load(&cell));
            let (mut values, cells) = (hessian.map(|cell| S::load(&cell)), hessian);
            let hessian = &mut values;
            let [_, x, u, limit, _] = *v;
            let (one, two, r) = (S::from_f64(1.0), S::from_f64(2.0), x / limit);
            let mu = mu[0];
            *hessian = [
                mu * two * u / limit,
                -mu * (one - r - r),
                -mu * two * u * r / limit,
                -mu * r * r,
                mu * two * u * r * r / limit,
            ];
            cells.iter_mut().zip(hessian).for_each(|(cell, value)| value.store(cell));
        }
    }

    impl Ode for Logistic {
        const ROWS: &'static [(u32, f64)] = &[(0, 1.0)];
    }

    const AT: [f64; 3] = [0.1, 1.5, 2.0];
    const T: f64 = 2.0;

    /// `x = K x₀ e^{uT} / D` with `D = K + x₀ (e^{uT} − 1)`, and what can be written down of its
    /// derivatives.
    fn exact() -> Exact {
        let [x0, u, k] = AT;
        let e = f64::exp(u * T);
        let d = k + x0 * (e - 1.0);
        let x = k * x0 * e / d;
        let first = vec![k * k * e / (d * d), T * x * (1.0 - x / k), x / k - k * x0 * e / (d * d)];
        Exact { states: vec![x], first: vec![first], second: vec![] }
    }

    fn options(steps: usize) -> Options {
        Options { steps, ..Default::default() }
    }

    fn check<I: Integrator<Model = Logistic, Number = f64, Memory = Heap>>(
        build: impl Fn(usize) -> Result<I, Error>,
        steps: usize,
    ) {
        let v = SVector::<f64, 1>::new;
        let [x0, u, p] = AT.map(v);
        let integrate = |steps| build(steps).expect("options are valid");
        check_sensitivities::<Logistic, _>(&mut integrate(2), &x0, &u, &p, 0.5)
            .expect("the model can be integrated")
            .assert();
        let (mut coarse, mut fine) = (integrate(steps / 2), integrate(steps));
        let report = check_exact::<Logistic, _>(&mut coarse, &mut fine, &x0, &u, &p, T, &exact())
            .expect("the model can be integrated");
        report.assert();
        assert!(report.rows.iter().all(|row| row.tolerance < 1e-12), "{report}");
    }

    /// Stages that are given as the solution of one call are none of the next, if the first is
    /// refused: its results are those of an integrator that never had them.
    #[test]
    fn stages_given_to_refused_calls() {
        let v = SVector::<f64, 1>::new;
        let [x0, u, p] = AT.map(v);
        let none = v(f64::NAN);
        let fresh = || {
            let mut irk = Irk::<Logistic, Gauss<5>>::new(options(2)).expect("options are valid");
            irk.set_parameters(&p).expect("finite");
            irk
        };
        let expected = *fresh().hessian(&x0, &u, T, &v(1.0)).expect("a solution");
        let mut irk = fresh();
        let stages = [[[7.0; 5]]; 2];
        type Refused = fn(&mut Irk<Logistic, Gauss<5>>, [&SVector<f64, 1>; 3]) -> bool;
        let refused: [Refused; 6] = [
            |irk, [_, u, none]| irk.solve(none, u, T).is_err(),
            |irk, [x0, u, none]| irk.adjoint(x0, u, T, none).is_err(),
            |irk, [x0, u, none]| irk.hessian(x0, u, T, none).is_err(),
            |irk, [x0, u, none]| irk.forward_adjoint(x0, u, T, none).is_err(),
            |irk, [x0, _, none]| irk.forward(x0, none, T).is_err(),
            |irk, [x0, u, _]| irk.forward(x0, u, f64::INFINITY).is_err(),
        ];
        for refused in refused {
            irk.set_solution(&stages).expect("memory");
            assert!(refused(&mut irk, [&x0, &u, &none]));
            let found = irk.hessian(&x0, &u, T, &v(1.0)).expect("a solution");
            assert_eq!((found.x, found.dx_dx0, found.h_xx), (expected.x, expected.dx_dx0, expected.h_xx));
        }
    }

    #[test]
    fn implicit() {
        check(|steps| Irk::<Logistic, Gauss<5>>::new(options(steps)), 32);
    }

    #[test]
    fn explicit() {
        check(|steps| Erk::<Logistic, DormandPrince8>::new(options(steps)), 64);
    }

    #[test]
    fn order_of_convergence() {
        let v = SVector::<f64, 1>::new;
        let [x0, u, p] = AT.map(v);
        let report = convergence(&[2, 4, 8, 16, 32], &exact().states, 1e-15, |steps| {
            let mut irk = Irk::<Logistic, Gauss<2>>::new(options(steps))?;
            irk.set_parameters(&p)?;
            Ok::<_, Error>(vec![irk.solve(&x0, &u, T)?.x[0]])
        });
        report.assert_order(4.0);
    }
}
