//! The elimination planned by the macro, on models made to break a static order: the pivoted
//! factorisation of the whole matrix takes over, and results stay right.

use casados::memory::Refusing;
use casados::mode;
use casados::prelude::*;
use nalgebra::{SVector, vector};

/// `A(p) k = b` in two algebraic unknowns, the first pivot of which may vanish at run time:
/// `p z₀ + z₁ = 1`, `z₀ + z₁ = u`. Exactly: `z₀ = (1 − u)/(p − 1)`, `z₁ = u − z₀`.
#[dae]
fn vanishing(xdot: f64, x: f64, z: [f64; 2], u: [f64; 1], p: [f64; 1]) -> [f64; 3] {
    [xdot + x - z[0], p[0] * z[0] + z[1] - 1.0, z[0] + z[1] - u[0]]
}

/// A pivot that is small, zero or large: the algebraic states are the closed form to rounding.
#[test]
fn t21_vanishing_pivots() {
    let u = 0.25;
    for p in [0.0, 1e-300, 1e-20, 1e-9, 0.5, 2.0, 1e9] {
        let mut irk = Irk::<Vanishing, RadauIIA<3>>::new(Options::default()).unwrap();
        irk.set_parameters(&vector![p]).unwrap();
        let step = irk.forward(&vector![1.0], &vector![u], 0.1).unwrap();
        let z0 = (1.0 - u) / (p - 1.0);
        // Condition of [p 1; 1 1] times ε, with room for the eight operations of its elimination.
        let condition = (p.abs() + 1.0).powi(2) / (p - 1.0).abs();
        let bound = 8.0 * f64::EPSILON * condition * z0.abs().max((u - z0).abs());
        assert!((step.z[0] - z0).abs() <= bound, "p = {p}: {} {z0}", step.z[0]);
        assert!((step.z[1] - (u - z0)).abs() <= bound, "p = {p}: {}", step.z[1]);
        // ∂z₀/∂u = −1/(p − 1), ∂z₀/∂p = −(1 − u)/(p − 1)²
        let (by_u, by_p) = (-1.0 / (p - 1.0), -(1.0 - u) / (p - 1.0).powi(2));
        assert!((step.dz_du[(0, 0)] - by_u).abs() <= 8.0 * f64::EPSILON * condition * by_u.abs());
        assert!(
            (step.dz_dp[(0, 0)] - by_p).abs() <= 16.0 * f64::EPSILON * condition * by_p.abs().max(by_u.abs())
        );
    }
}

/// Without memory to pivot the whole matrix: the same bits where the plan is good enough, in less
/// memory, and an error where it is not; after which the integrator is as it was.
#[test]
fn elimination_without_fallback() {
    fn check<const S: usize>(newton: Newton)
    where
        RadauIIA<S>: casados::Method<S>,
    {
        type Whole<const S: usize> = Irk<Vanishing, RadauIIA<S>, f64, Inline<mode::Forward>>;
        type Lean<const S: usize> = Irk<Vanishing, RadauIIA<S>, f64, Inline<mode::Forward, 1, Refusing>>;
        // The matrix over three unknowns at all stages, at the least.
        assert!(Lean::<S>::SIZE + 9 * S * S * 8 <= Whole::<S>::SIZE);
        let options = Options { newton, ..Default::default() };
        let mut whole = Whole::<S>::inline(options).unwrap();
        let mut lean = Lean::<S>::inline(options).unwrap();
        let mut refused = 0;
        for p in [0.0, 0.5, 1e-300, 2.0, 1e9, 0.0, 0.25] {
            whole.set_parameters(&vector![p]).unwrap();
            lean.set_parameters(&vector![p]).unwrap();
            let expected = *whole.forward(&vector![1.0], &vector![0.25], 0.1).unwrap();
            let found = lean.forward(&vector![1.0], &vector![0.25], 0.1).copied();
            if whole.statistics().dense > 0 {
                assert_eq!(found.unwrap_err(), Error::NotPivoted { step: 0 });
                refused += 1;
            } else {
                assert_eq!(found.unwrap(), expected);
            }
        }
        assert!((1..7).contains(&refused), "{refused}");
    }
    let fixed = Newton { fixed_iterations: Some(2), ..Default::default() };
    check::<1>(fixed);
    check::<3>(fixed);
    check::<2>(Newton::default());
    // These equations are linear: with any number of stages one iteration is exact, and the mean
    // Jacobian has no part in it.
    check::<4>(Newton::default());
}

/// A Jacobian for each step, as the option says, and a step for each Jacobian: with enough
/// iterations the same as Newton's own.
#[test]
fn jacobian_updates_once_per_step() {
    let run = |jacobian, fixed_iterations| {
        let newton = Newton { jacobian, fixed_iterations, ..Default::default() };
        let mut irk =
            Irk::<Scaled, Gauss<2>>::new(Options { steps: 3, newton, ..Default::default() }).unwrap();
        irk.set_parameters(&vector![1.0, 1.0]).unwrap();
        let x = irk.solve(&vector![1.0, 0.5], &SVector::zeros(), 0.3).unwrap().x;
        (x, *irk.statistics())
    };
    let (expected, _) = run(Jacobian::Full, None);
    // The cubic term is 0.1 of the others: increments shrink at least tenfold.
    let (frozen, statistics) = run(Jacobian::Frozen, Some(16));
    assert!((frozen - expected).amax() <= 20.0 * f64::EPSILON, "{}", frozen - expected);
    assert_eq!((statistics.jacobians, statistics.factorizations), (3, 3));
    assert_eq!((statistics.residuals, statistics.iterations), (45, 48));
    let (_, full) = run(Jacobian::Full, Some(4));
    assert_eq!((full.jacobians, full.factorizations, full.residuals), (12, 12, 0));
}

/// Rows scaled by up to `10^±120` against each other: nothing changes but rounding.
#[dae]
fn scaled(xdot: [f64; 2], x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    [p[0] * (xdot[0] - x[1]), p[1] * (xdot[1] + x[0] + 0.1 * x[0] * x[0] * x[0])]
}

#[test]
fn t21_rows_of_any_scale() {
    let run = |p: [f64; 2]| {
        let mut irk = Irk::<Scaled, Gauss<3>>::new(Options { steps: 4, ..Default::default() }).unwrap();
        irk.set_parameters(&SVector::from(p)).unwrap();
        let step = irk.forward(&vector![1.0, 0.5], &SVector::zeros(), 0.5).unwrap();
        let result = (step.x, step.dx_dx0);
        assert_eq!(irk.statistics().dense, 0, "scaling of rows is no reason to leave the plan");
        result
    };
    let (x, s) = run([1.0, 1.0]);
    for p in [[1e120, 1e-120], [1e-120, 1e120], [1e150, 1e150]] {
        let (scaled_x, scaled_s) = run(p);
        // Four steps of a system of condition below two, some twenty roundings each.
        assert!((scaled_x - x).amax() <= 80.0 * f64::EPSILON, "{}", scaled_x - x);
        assert!((scaled_s - s).amax() <= 80.0 * f64::EPSILON, "{}", scaled_s - s);
    }
}

/// `x ż-type` coupling whose coefficient crosses zero along the trajectory:
/// `cos(t) a + sin(t) b = 1`, `−sin(t) a + cos(t) b = x`. Exactly `a = cos t − x sin t`,
/// `b = sin t + x cos t`, whichever entry vanishes.
#[dae]
fn rotating(xdot: f64, x: f64, z: [f64; 2], t: f64) -> [f64; 3] {
    let (s, c) = t.sin_cos();
    [xdot + x, c * z[0] + s * z[1] - 1.0, -s * z[0] + c * z[1] - x]
}

#[test]
fn pivot_that_crosses_zero() {
    let mut irk = Irk::<Rotating, RadauIIA<2>>::new(Options { steps: 1, ..Default::default() }).unwrap();
    let mut x = vector![1.0];
    for n in 0..400 {
        let (start, h) = (f64::from(n) * 0.01, 0.01);
        irk.set_time(start).unwrap();
        let step = irk.forward(&x, &SVector::zeros(), h).unwrap();
        let (s, c) = (start + h).sin_cos();
        let (a, b) = (c - step.x[0] * s, s + step.x[0] * c);
        // A rotation has condition one; the time at the last stage carries a few roundings of t ≤
        // 4.
        assert!((step.z[0] - a).abs() <= 32.0 * f64::EPSILON, "{n}: {} {a}", step.z[0]);
        assert!((step.z[1] - b).abs() <= 32.0 * f64::EPSILON, "{n}: {} {b}", step.z[1]);
        let by_x = step.dx_dx0[(0, 0)];
        assert!((step.dz_dx0[(0, 0)] + s * by_x).abs() <= 32.0 * f64::EPSILON);
        x = step.x;
    }
}

/// The plan of a model has the pattern of its Newton matrix, and each unknown is the pivot of one
/// equation.
#[test]
fn pivots_of_the_plan() {
    fn check<M: Dae>(unknowns: usize) {
        let plan = M::STRUCTURE.elimination;
        assert_eq!(plan.pivots.len(), unknowns);
        let mut slots: Vec<u32> = plan.slot_of_equation.to_vec();
        slots.sort_unstable();
        assert_eq!(slots, (0..unknowns as u32).collect::<Vec<_>>());
        let mut pivots: Vec<u32> = plan.pivots.iter().map(|pivot| pivot.slot).collect();
        pivots.sort_unstable();
        assert_eq!(pivots, slots);
        assert_eq!(plan.pivots.last().map(|pivot| pivot.end as usize), Some(plan.slots.len()));
    }
    check::<Vanishing>(3);
    check::<Scaled>(2);
    check::<Rotating>(3);
}

/// Two algebraic states whose matrix is anything: no static order is good for all of them.
#[dae]
fn any_matrix(xdot: f64, x: f64, z: [f64; 2], p: [f64; 4]) -> [f64; 3] {
    [xdot + x, p[0] * z[0] + p[1] * z[1] - x, p[2] * z[0] + p[3] * z[1] - 1.0]
}

/// Permutations, and matrices next to them: of two orders one has a pivot of zero, and the other
/// one gives the answer.
#[test]
fn dense_fallback() {
    let mut pivoted = 0;
    for tiny in [0.0, 1e-300, 1e-17, 1e-12] {
        for p in [[1.0, tiny, tiny, 1.0], [tiny, 1.0, 1.0, tiny]] {
            let mut irk = Irk::<AnyMatrix, RadauIIA<2>>::new(Options::default()).unwrap();
            irk.set_parameters(&SVector::from(p)).unwrap();
            let step = irk.hessian(&vector![1.0], &SVector::zeros(), 0.1, &vector![1.0]).unwrap();
            let determinant = p[0] * p[3] - p[1] * p[2];
            let (z0, z1) = ((p[3] * step.x[0] - p[1]) / determinant, (p[0] - p[2] * step.x[0]) / determinant);
            // A matrix of condition one, and some ten roundings.
            assert!((step.z[0] - z0).abs() <= 16.0 * f64::EPSILON, "{p:?}: {} {z0}", step.z[0]);
            assert!((step.z[1] - z1).abs() <= 16.0 * f64::EPSILON, "{p:?}: {} {z1}", step.z[1]);
            let by_x = p[3] / determinant * step.dx_dx0[(0, 0)];
            assert!((step.dz_dx0[(0, 0)] - by_x).abs() <= 16.0 * f64::EPSILON, "{p:?}");
            pivoted += irk.statistics().dense;
        }
    }
    assert!(pivoted > 0, "no static order is right for all of these");
}

/// An algebraic part that was planned for a range, and is used outside of it, where the coefficient
/// of `z₀` vanishes: `(u − 30) z₀ + 2 z₁ = 1`, `2 z₀ + 3 z₁ = u`.
#[dae(range(u = 40.0..=60.0), nominal(x = 0.5))]
fn out_of_range(xdot: f64, x: f64, z: [f64; 2], u: f64) -> [f64; 3] {
    [xdot + x - z[0], (u - 30.0) * z[0] + 2.0 * z[1] - 1.0, 2.0 * z[0] + 3.0 * z[1] - u]
}

#[test]
fn values_outside_of_declared_ranges() {
    let plan = OutOfRange::STRUCTURE.elimination;
    assert_eq!(plan.slot_of_equation, [0, 1, 2], "z₀ is found from the second equation");
    for u in [30.0, 30.0 + 1e-14, 30.0 - 1e-9, 29.0, 50.0, -100.0] {
        let mut irk = Irk::<OutOfRange, RadauIIA<2>>::new(Options::default()).unwrap();
        let step = irk.forward(&vector![1.0], &vector![u], 0.1).unwrap();
        let (delta, determinant) = (u - 30.0, 3.0 * (u - 30.0) - 4.0);
        let z = [(3.0 - 2.0 * u) / determinant, (delta * u - 2.0) / determinant];
        let by_u = [(-3.0 * z[0] - 2.0) / determinant, (delta + 2.0 * z[0]) / determinant];
        // Largest element of the matrix times that of its inverse, ε, and eight operations.
        let condition = delta.abs().max(3.0).powi(2) / determinant.abs();
        let bound = |size: [f64; 2]| 8.0 * f64::EPSILON * condition * size[0].abs().max(size[1].abs());
        for i in 0..2 {
            assert!((step.z[i] - z[i]).abs() <= bound(z), "u = {u}: {} {}", step.z[i], z[i]);
            let found = step.dz_du[(i, 0)];
            assert!((found - by_u[i]).abs() <= 4.0 * bound(by_u), "u = {u}: {found} {}", by_u[i]);
        }
    }
}

/// A matrix that is singular is an error that names the unknown, and the integrator goes on.
#[test]
fn t20_singular_matrices() {
    let mut irk = Irk::<AnyMatrix, RadauIIA<2>>::new(Options::default()).unwrap();
    irk.set_parameters(&vector![1.0, 2.0, 2.0, 4.0]).unwrap();
    let error = irk.solve(&vector![1.0], &SVector::zeros(), 0.1).map(|step| step.x).unwrap_err();
    assert!(matches!(error, casados::Error::Singular { unknown: "z[0]" | "z[1]", .. }), "{error}");
    irk.set_parameters(&vector![1.0, 0.0, 0.0, 1.0]).unwrap();
    assert!(irk.solve(&vector![1.0], &SVector::zeros(), 0.1).is_ok());
}

/// Determinants down to 1e-300, which a solution does not depend on, and matrices whose condition
/// it does: errors are ε times it.
#[test]
fn t35_near_singular_matrices() {
    let solve = |p: [f64; 4]| {
        let mut irk = Irk::<AnyMatrix, RadauIIA<2>>::new(Options::default()).expect("valid");
        irk.set_parameters(&SVector::from(p)).expect("finite");
        irk.solve(&vector![1.0], &SVector::zeros(), 0.1).map(|step| (step.x[0], step.z[0], step.z[1]))
    };
    // Rows and columns of any scale.
    for p in [
        [1e-150, 0.0, 0.0, 1e-150],
        [1e-300, 0.0, 0.0, 1.0],
        [1e150, 0.0, 0.0, 1e-150],
        [0.0, 1e-150, 1e150, 0.0],
    ] {
        let (x, z0, z1) = solve(p).expect("a solution");
        let determinant = p[0] * p[3] - p[1] * p[2];
        let exact = [(p[3] * x - p[1]) / determinant, (p[0] - p[2] * x) / determinant];
        for (found, exact) in [z0, z1].into_iter().zip(exact) {
            assert!((found - exact).abs() <= 8.0 * f64::EPSILON * exact.abs(), "{p:?}: {found:e} {exact:e}");
        }
    }
    // [1 1; 1 1 + δ]: z1 = (1 − x)/δ, z0 = x − z1, of condition (2 + δ)²/δ.
    for k in 1..=45 {
        let delta = 2f64.powi(-k);
        let (x, z0, z1) = solve([1.0, 1.0, 1.0, 1.0 + delta]).expect("a solution");
        let (exact, condition) = ((1.0 - x) / delta, 4.0 / delta);
        let size = exact.abs().max(1.0);
        assert!((z1 - exact).abs() <= 4.0 * condition * f64::EPSILON * size, "2^-{k}: {z1} {exact}");
        // And each equation is satisfied to rounding, whatever the condition: ten operations.
        assert!((z0 + z1 - x).abs() <= 10.0 * f64::EPSILON * z1.abs().max(1.0), "2^-{k}");
        assert!((z0 + (1.0 + delta) * z1 - 1.0).abs() <= 10.0 * f64::EPSILON * z1.abs().max(1.0), "2^-{k}");
    }
    // What is singular to the last bit is refused.
    assert!(matches!(solve([1.0, 1.0, 1.0, 1.0]), Err(casados::Error::Singular { .. })));
}

/// A matrix of `ẋ` of rank five for eight states, in equal steps: the same solution as in the form
/// with algebraic states.
#[test]
fn t23_rank_deficient_mass() {
    use crate::models::circuits::{TransistorAmplifier, TransistorCapacitors};
    use reference_data::Record;
    let set = Record::load("ivp/ends.json").expect("the reference is there");
    let y: SVector<f64, 8> = set.record("transistor_amplifier").expect("a problem").vector("x0").expect("x0");
    let options = Options { steps: 40, ..Default::default() };
    let mut nodes = Irk::<TransistorAmplifier, RadauIIA<3>>::new(options).expect("valid");
    let x = nodes.solve(&y, &SVector::zeros(), 0.002).expect("a solution").x;
    let capacitors = |y: &SVector<f64, 8>| vector![y[1] - y[0], y[2], y[4] - y[3], y[5], y[7] - y[6]];
    let mut reduced = Irk::<TransistorCapacitors, RadauIIA<3>>::new(options).expect("valid");
    let step = *reduced.solve(&capacitors(&y), &SVector::zeros(), 0.002).expect("a solution");
    // Voltages up to 6, forty steps; the derivatives of algebraic voltages are differences of them.
    let bound = 40.0 * 8.0 * 6.0 * f64::EPSILON;
    let error = (capacitors(&x) - step.x).amax().max((vector![x[0], x[3], x[6]] - step.z).amax());
    println!("{error:e}");
    assert!(error <= bound, "{error:e} {bound:e}");
}
