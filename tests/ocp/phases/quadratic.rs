//! Linear-quadratic phases with other numbers of states and controls, against a recursion of
//! Riccati written here; and one horizon that is cut in two.

use crate::Test;
use casados::ocp::{
    Constraint, Continuous, GeneralCost, HeapIpm, HeapSqp, Horizon, Jump, LeastSquaresCost, Map, Phases,
    Problem,
};
use casados::prelude::*;
use nalgebra::{DMatrix, DVector, dmatrix, dvector};

#[function]
fn single(x: f64, u: f64) -> f64 {
    0.9 * x + 0.5 * u
}
#[function]
fn single_outputs(x: f64, u: f64) -> [f64; 2] {
    [x, u]
}
/// Three states from one, and a constant.
#[function]
fn split(x: f64, _u: f64) -> [f64; 3] {
    [x, 0.5 * x + 0.25, -2.0 * x]
}
#[function]
fn triple(x: [f64; 3], u: [f64; 2]) -> [f64; 3] {
    [x[0] + 0.1 * x[1], 0.8 * x[1] + 0.2 * x[2] + u[0], 0.7 * x[2] + u[1] - 0.3 * u[0]]
}
#[function]
fn triple_outputs(x: [f64; 3], u: [f64; 2]) -> [f64; 5] {
    [x[0], x[1], x[2], u[0], u[1]]
}
#[function]
fn triple_end(x: [f64; 3], _u: [f64; 2]) -> [f64; 3] {
    [x[0] - 1.0, x[1], x[2] + 0.5]
}

/// A quadratic function `½ xᵀ P x + pᵀ x + c` of the state at the start of a stage.
struct ValueFunction(DMatrix<f64>, DVector<f64>, f64);

impl ValueFunction {
    /// Before a stage with `x₊ = A x + B u + b` and the cost `½ xᵀQx + ½ uᵀRu`; the gains.
    fn value_before_stage(
        self,
        [a, b, q, r]: [&DMatrix<f64>; 4],
        offset: &DVector<f64>,
    ) -> (Self, DMatrix<f64>, DVector<f64>) {
        let Self(p, linear, constant) = self;
        let ahead = &p * offset + &linear;
        let inverse = (r + b.transpose() * &p * b).try_inverse().unwrap_or_default();
        let (gain, shift) = (&inverse * b.transpose() * &p * a, &inverse * b.transpose() * &ahead);
        let closed = a - b * &gain;
        let matrix = q + a.transpose() * &p * &closed;
        let vector = closed.transpose() * &ahead;
        let constant = constant + linear.dot(offset) + 0.5 * (&p * offset).dot(offset)
            - 0.5 * (b.transpose() * &ahead).dot(&shift);
        (Self(matrix, vector, constant), gain, shift)
    }
}

#[test]
fn riccati_recursion_over_phases() -> Test {
    let (first_intervals, second_intervals) = (5, 7);
    for by_sqp in [false, true] {
        let mut first = Problem::new(Map::<Single, f64>::new())
            .stage_cost(LeastSquaresCost::<SingleOutputs>::diagonal(&[1.0, 0.3]))
            .on(Horizon::uniform(first_intervals, 1.0))?;
        first.fix_initial_state(&[2.0])?.guess(&[0.0], &[0.0])?;
        let mut second = Problem::new(Map::<Triple, f64>::new())
            .stage_cost(LeastSquaresCost::<TripleOutputs>::diagonal(&[0.2, 1.0, 0.4, 0.1, 0.7]))
            .terminal_cost(LeastSquaresCost::<TripleEnd>::diagonal(&[5.0, 1.0, 2.0]))
            .on(Horizon::uniform(second_intervals, 1.0))?;
        second.guess(&[0.0; 3], &[0.0; 2])?;
        let mut both = Phases::new(&mut first).then(Jump::<Split>::new(), &mut second).join()?;
        let outcome = if by_sqp {
            HeapSqp::new(&both)?.solve(&mut both)?
        } else {
            HeapIpm::new(&both)?.solve(&mut both)?
        };
        assert!(outcome.is_converged() && outcome.is_convex, "{outcome}");
        drop(both);

        let target = dvector![1.0, 0.0, -0.5];
        let weights = DMatrix::from_diagonal(&dvector![5.0, 1.0, 2.0]);
        let mut value =
            ValueFunction(weights.clone(), -(&weights * &target), 0.5 * (&weights * &target).dot(&target));
        let (a, b) =
            (dmatrix![1.0, 0.1, 0.0; 0.0, 0.8, 0.2; 0.0, 0.0, 0.7], dmatrix![0.0, 0.0; 1.0, 0.0; -0.3, 1.0]);
        let (q, r) =
            (DMatrix::from_diagonal(&dvector![0.2, 1.0, 0.4]), DMatrix::from_diagonal(&dvector![0.1, 0.7]));
        let mut gains = Vec::new();
        for _ in 0..second_intervals {
            let (before, gain, shift) = value.value_before_stage([&a, &b, &q, &r], &DVector::zeros(3));
            value = before;
            gains.push((gain, shift));
        }
        // The link costs nothing, and nothing is decided there.
        let (jump, constant) = (dmatrix![1.0; 0.5; -2.0], dvector![0.0, 0.25, 0.0]);
        let ValueFunction(p, linear, rest) = value;
        value = ValueFunction(
            jump.transpose() * &p * &jump,
            jump.transpose() * (&p * &constant + &linear),
            rest + 0.5 * (&p * &constant).dot(&constant) + linear.dot(&constant),
        );
        for _ in 0..first_intervals {
            let [a, b, q, r] = [dmatrix![0.9], dmatrix![0.5], dmatrix![1.0], dmatrix![0.3]];
            let (before, gain, shift) = value.value_before_stage([&a, &b, &q, &r], &DVector::zeros(1));
            value = before;
            gains.push((gain, shift));
        }
        let ValueFunction(p, linear, rest) = value;
        let cost = 0.5 * p[(0, 0)] * 4.0 + linear[0] * 2.0 + rest;
        assert!((outcome.objective - cost).abs() < 1e-7 * cost, "{} {cost}", outcome.objective);

        let mut x = dvector![2.0];
        for k in 0..=first_intervals {
            assert!((first.stage(k)?.x[0] - x[0]).abs() < 1e-6);
            if k < first_intervals {
                let (gain, shift) = gains.pop().ok_or("no gain")?;
                let u = -(gain * &x) - shift;
                assert!((first.stage(k)?.u[0] - u[0]).abs() < 1e-6);
                x = dvector![0.9 * x[0] + 0.5 * u[0]];
            }
        }
        let mut x = &jump * &x + &constant;
        for k in 0..=second_intervals {
            let at = second.stage(k)?;
            assert!(at.x.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-6), "{k}: {:?} {x}", at.x);
            if k < second_intervals {
                let (gain, shift) = gains.pop().ok_or("no gain")?;
                let u = -(gain * &x) - shift;
                assert!(at.u.iter().zip(&u).all(|(a, b)| (a - b).abs() < 1e-6));
                x = &a * &x + &b * &u;
            }
        }
    }
    Ok(())
}

/// A pendulum with a path constraint.
#[ode]
mod pendulum {
    pub fn pendulum(x: [f64; 2], u: f64, p: f64) -> [f64; 2] {
        [x[1], u - p * x[0].sin()]
    }
    #[function]
    fn price(x: [f64; 2], u: f64, p: f64) -> f64 {
        x[0] * x[0] + 0.1 * u * u + 0.01 * p * p
    }
    #[function]
    fn power(x: [f64; 2], u: f64, _p: f64) -> f64 {
        u * x[1]
    }
}

#[test]
fn divided_horizon() -> Test {
    let swing = |n: usize| -> Result<_, casados::ocp::OcpError> {
        let mut swing = Problem::new(Irk::<Pendulum, Gauss<2>>::new(Options::default())?)
            .running_cost(GeneralCost::<Price>::new())
            .path_constraints(Constraint::<Power>::new([-0.3], [0.3]))
            .on(Horizon::uniform(n, 0.2))?;
        swing.set_parameters(.., &[2.0])?.guess(&[0.1, 0.0], &[0.0])?.bound("u", .., -0.5, 0.5)?;
        Ok(swing)
    };
    let mut whole = swing(12)?;
    whole.fix_initial_state(&[1.0, 0.0])?.bound("x[1]", 12.., 0.0, 0.0)?;
    let outcome = HeapIpm::new(&whole)?.solve(&mut whole)?;
    assert!(outcome.is_converged(), "{outcome}");
    for (cut, by_sqp) in [(1, false), (5, true), (11, false)] {
        let (mut first, mut second) = (swing(cut)?, swing(12 - cut)?);
        first.fix_initial_state(&[1.0, 0.0])?;
        second.bound("x[1]", 12 - cut.., 0.0, 0.0)?;
        let mut both = Phases::new(&mut first).then(Continuous, &mut second).join()?;
        let outcome = if by_sqp {
            HeapSqp::new(&both)?.solve(&mut both)?
        } else {
            HeapIpm::new(&both)?.solve(&mut both)?
        };
        assert!(outcome.is_converged(), "{outcome}");
        super::kkt::check(&mut both)?;
        drop(both);
        for k in 0..12 {
            let at = if k < cut { first.stage(k)? } else { second.stage(k - cut)? };
            let expected = whole.stage(k)?;
            let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
            assert!(same(at.x, expected.x) && same(at.u, expected.u), "{cut} {k}: {at:?} {expected:?}");
            assert!(same(at.dynamics, expected.dynamics) && same(at.g_upper, expected.g_upper), "{cut} {k}");
        }
    }
    Ok(())
}

/// A push that is linear in time, and its work.
#[ode(linear = u, integrals(work = u * x[1]))]
mod sledge {
    pub fn sledge(x: [f64; 2], u: f64) -> [f64; 2] {
        [x[1], u]
    }
    #[function]
    fn effort(_x: [f64; 2], u: f64, du: f64) -> f64 {
        u * u + 0.1 * du * du
    }
}

/// In each phase integrals begin at zero, and a linear control where it is best.
#[test]
fn linear_controls_and_integrals_of_phases() -> Test {
    let ride = |n: usize| -> Result<_, casados::ocp::OcpError> {
        let mut ride = Problem::new(Irk::<Sledge, Gauss<3>>::new(Options::default())?)
            .running_cost(GeneralCost::<Effort>::new())
            .on(Horizon::uniform(n, 0.1))?;
        ride.guess(&[0.0; 2], &[0.0])?;
        Ok(ride)
    };
    let (mut first, mut second) = (ride(4)?, ride(6)?);
    first.fix_initial_state(&[0.0; 2])?.bound("u", .., -9.0, 9.0)?;
    second.bound("x[0]", 6.., 1.0, 1.0)?.bound("x[1]", 6.., 0.0, 0.0)?.bound("u", ..1, 2.0, 2.0)?;
    let mut both = Phases::new(&mut first).then(Continuous, &mut second).join()?;
    let outcome = HeapIpm::new(&both)?.solve(&mut both)?;
    assert!(outcome.is_converged(), "{outcome}");
    super::kkt::check(&mut both)?;
    drop(both);
    let (one, other) = (first.solution()?, second.solution()?);
    assert_eq!((one.integral("work")?[0], other.integral("work")?[0]), (0.0, 0.0));
    // It ends at rest: the work of both is none.
    assert!((one.integral("work")?[4] + other.integral("work")?[6]).abs() < 1e-6);
    assert!((other.control("u")?[0] - 2.0).abs() < 1e-6 && (one.control("u")?[4] - 2.0).abs() > 0.1);
    Ok(())
}
