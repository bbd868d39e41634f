//! Points inside of intervals: the QP against dual numbers, solutions against finer horizons with
//! controls that are one, names, and mistakes by name.

use crate::Test;
use crate::free_parameters::stage_numbers;
use casados::ocp::{
    Constraint, Convexification, Exact, GeneralCost, HeapIpm, HeapSqp, Horizon, Kind, LeastSquaresCost, Map,
    OcpError, Part, Problem, Shooting,
};
use casados::prelude::*;
use num_dual::{DualNum, HyperDual64};

/// An algebraic state, a parameter and the time in the equations and in the constraints.
#[dae]
mod pendulums {
    pub struct State {
        pub angle: f64,
        pub speed: f64,
    }
    pub struct Setting {
        pub drag: f64,
        pub gain: f64,
    }
    #[dae]
    fn pendulum(xdot: &State, x: &State, z: f64, u: f64, p: &Setting, t: f64) -> [f64; 3] {
        [
            xdot.angle - x.speed,
            xdot.speed - u * p.gain + x.angle.sin() + p.drag * z * x.speed,
            z - x.angle * x.speed - p.drag * u * u - 0.3 * t,
        ]
    }
    #[function]
    fn load(x: &State, z: f64, u: f64, p: &Setting, t: f64) -> [f64; 2] {
        [x.angle * z * p.drag + t * u, x.speed * x.speed * u + z * z]
    }
    #[function]
    fn price(x: &State, _z: f64, u: f64, p: &Setting) -> f64 {
        u * u * p.drag + x.angle * u
    }
}

type H = HyperDual64;
const GAIN: f64 = 1.4;
const STEP: f64 = 0.4;
const STEPS: usize = 2;
const POINTS: [f64; 2] = [0.3, 0.8];

fn load(x: [H; 2], z: H, u: H, p: H, t: f64) -> [H; 2] {
    [x[0] * z * p + u * t, x[1] * x[1] * u + z * z]
}

/// The implicit midpoint rule by fixed-point iterations, whose factor is about 0.1: state at the
/// end, and the algebraic state of the first midpoint, which is that of the node.
fn implicit_midpoint_step(mut x: [H; 2], u: H, p: H, t: f64, h: f64) -> ([H; 2], H) {
    let h = h / STEPS as f64;
    let mut first = None;
    for n in 0..STEPS {
        let at = t + (n as f64 + 0.5) * h;
        let (mut end, mut z) = (x, H::from(0.0));
        for _ in 0..60 {
            let middle = [(x[0] + end[0]) * 0.5, (x[1] + end[1]) * 0.5];
            z = middle[0] * middle[1] + p * u * u + 0.3 * at;
            end[0] = x[0] + middle[1] * h;
            end[1] = x[1] + (u * GAIN - middle[0].sin() - p * z * middle[1]) * h;
        }
        first.get_or_insert(z);
        x = end;
    }
    (x, first.expect("a step"))
}

/// All that a stage has at `(x₀, x₁, w, u)`: its cost, where it ends, and its rows.
fn stage([a, b, p, u]: [H; 4], t: f64) -> (H, [H; 2], Vec<H>) {
    let mut x = [a, b];
    let ends = [0.0, POINTS[0], POINTS[1], 1.0];
    let (mut states, mut algebraic) = (vec![x], Vec::new());
    for pair in ends.windows(2) {
        let (end, z) = implicit_midpoint_step(x, u, p, t + pair[0] * STEP, (pair[1] - pair[0]) * STEP);
        algebraic.push(z);
        states.push(end);
        x = end;
    }
    let mut rows: Vec<H> =
        (0..3).flat_map(|j| load(states[j], algebraic[j], u, p, t + ends[j] * STEP)).collect();
    // Bounds of the speed at both points, then of the algebraic state at the node and there.
    rows.extend([states[1][1], states[2][1]]);
    rows.extend(algebraic);
    ((u * u * p + a * u) * STEP, x, rows)
}

/// Values, gradients and Hessians of everything at a stage and with any multipliers are those of
/// hyper-dual numbers through the method.
#[test]
fn quadratic_programs_by_dual_numbers() -> Test {
    const N: usize = 2;
    let options = Options { steps: STEPS, ..Options::default() };
    let mut ocp = Problem::new(Irk::<Pendulum, Gauss<1>>::new(options)?)
        .running_cost(GeneralCost::<Price>::new())
        .path_constraints(Constraint::<Load>::new([-1.0, f64::NEG_INFINITY], [2.0, 3.0]))
        .on(Horizon::uniform(N, STEP))?;
    ocp.inside(&POINTS)?.set_parameters(.., &[0.0, GAIN])?.free_initial_state().free("p.drag", .., 0.25)?;
    ocp.bound("x.speed", .., -3.0, 3.5)?.bound("z", .., -0.5, 0.75)?;
    for k in 0..=N {
        let x = [0.5 + 0.2 * k as f64, -0.6 + 0.3 * k as f64];
        ocp.guess_stage(k, &x, if k < N { &[0.7] } else { &[] })?;
    }
    let (mut pi, mut mu) = (vec![[0.0; 2]; N], vec![[0.0; 11]; N]);
    for k in 0..N {
        let stage = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?;
        for (i, pi) in pi[k].iter_mut().enumerate() {
            *pi = 0.7 - 0.9 * i as f64 + 0.2 * k as f64;
            stage.dynamics[i] = *pi;
        }
        assert_eq!(stage.g_upper.len(), 11);
        for (i, mu) in mu[k].iter_mut().enumerate() {
            *mu = (1.3 * i as f64 + 0.4 + k as f64).sin();
            stage.g_upper[i] = mu.max(0.0);
            stage.g_lower[i] = (-*mu).max(0.0);
        }
    }
    ocp.linearise(Exact { convexification: Convexification::None })?;
    let given = |row: usize| match row {
        0 | 2 | 4 => (-1.0, 2.0),
        1 | 3 | 5 => (f64::NEG_INFINITY, 3.0),
        6 | 7 => (-3.0, 3.5),
        _ => (-0.5, 0.75),
    };
    for k in 0..N {
        let at = [0.5 + 0.2 * k as f64, -0.6 + 0.3 * k as f64, 0.25, 0.7];
        let t = k as f64 * STEP;
        let by = |i: usize, j: usize| {
            let one = |l: usize, i: usize| f64::from(l == i);
            stage(core::array::from_fn(|l| H::new(at[l], one(l, i), one(l, j), 0.0)), t)
        };
        let mut expected = Vec::new();
        let mut hessian = [[0.0; 4]; 4];
        let lower = (0..4).flat_map(|j| (j..4).map(move |i| (i, j)));
        for (i, j) in lower {
            let (cost, end, rows) = by(i, j);
            let of_rows: f64 = rows.iter().zip(&mu[k]).map(|(row, mu)| mu * row.eps1eps2).sum();
            let value = cost.eps1eps2 + pi[k][0] * end[0].eps1eps2 + pi[k][1] * end[1].eps1eps2 + of_rows;
            (hessian[i][j], hessian[j][i]) = (value, value);
            expected.push(value);
        }
        // The gradient at zero of the QP.
        expected.extend((0..4).map(|i| by(i, i).0.eps1 - (0..4).map(|j| hessian[i][j] * at[j]).sum::<f64>()));
        for i in 0..2 {
            let slopes: Vec<f64> = (0..4).map(|j| by(j, j).1[i].eps1).collect();
            let offset = by(0, 0).1[i].re - slopes.iter().zip(&at).map(|(a, v)| a * v).sum::<f64>();
            expected.extend(slopes);
            expected.push(offset);
        }
        for row in 0..11 {
            let slopes: Vec<f64> = (0..4).map(|j| by(j, j).2[row].eps1).collect();
            let shift = slopes.iter().zip(&at).map(|(a, v)| a * v).sum::<f64>() - by(0, 0).2[row].re;
            expected.extend(slopes);
            expected.extend([given(row).0 + shift, given(row).1 + shift]);
        }
        let found = &stage_numbers(&ocp, 2)[k];
        assert_eq!(found.len(), expected.len());
        for (i, (a, b)) in found.iter().zip(&expected).enumerate() {
            // Newton's method of the integrator stops at 1e-12, relative.
            assert!(a == b || (a - b).abs() < 1e-10 * (1.0 + b.abs()), "stage {k}, {i}: {a} {b}");
        }
    }
    Ok(())
}

#[ode]
mod carts {
    #[ode]
    fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
        [x[1], u - 0.4 * x[1] * x[1] * x[0]]
    }
    #[function]
    fn end(x: [f64; 2], _u: f64) -> f64 {
        (x[0] - 1.0) * (x[0] - 1.0) + 0.1 * x[1] * x[1]
    }
    #[function]
    fn effort(_x: [f64; 2], u: f64) -> f64 {
        1e-3 * u * u
    }
    #[function]
    fn speed(x: [f64; 2], u: f64) -> f64 {
        x[1] + 0.05 * u
    }
    #[function]
    fn walk(x: [f64; 2], u: f64) -> [f64; 2] {
        [x[0] + x[1], x[1] + u]
    }
}

/// One interval with two points is three intervals with one control: by both solvers, by batches.
#[test]
fn inner_points_as_nodes() -> Test {
    let irk = || Irk::<Cart, Gauss<2>>::new(Options::default());
    let limit = || Constraint::<Speed>::new([-1.0], [0.9]);
    let mut fine = Problem::new(irk()?)
        .running_cost(GeneralCost::<Effort>::new())
        .terminal_cost(GeneralCost::<End>::new())
        .path_constraints(limit())
        .on(Horizon::uniform(3, 0.5))?;
    fine.fix_initial_state(&[0.0, 0.7])?.shared("u")?.guess(&[0.0; 2], &[0.0])?;
    fine.bound("x[0]", 1..3, -1.0, 0.6)?;
    let expected = HeapIpm::new(&fine)?.solve(&mut fine)?;
    assert!(expected.is_converged());
    let u = fine.stage(0)?.u[0];
    let solution = fine.solution()?;
    // Something is at its bound inside, and nothing at the only node.
    let active = solution.state("x[0]")?[2] > 0.6 - 1e-5 || solution.constraint("Speed")?[1] > 0.9 - 1e-5;
    assert!(active && solution.constraint("Speed")?[0] < 0.89);

    let parts = [1.0 / 3.0, 2.0 / 3.0];
    let coarse = || {
        Problem::new(irk()?)
            .running_cost(GeneralCost::<Effort>::new())
            .terminal_cost(GeneralCost::<End>::new())
            .path_constraints(limit())
            .on(Horizon::uniform(1, 1.5))
    };
    let mut by_ipm = coarse()?;
    by_ipm.inside(&parts)?.fix_initial_state(&[0.0, 0.7])?.guess(&[0.0; 2], &[0.0])?;
    by_ipm.bound("x[0]", 0..1, -1.0, 0.6)?;
    let mut by_sqp = by_ipm.clone();
    let outcome = HeapIpm::new(&by_ipm)?.solve(&mut by_ipm)?;
    assert!(outcome.is_converged());
    assert!(HeapSqp::new(&by_sqp)?.solve(&mut by_sqp)?.is_converged());
    assert!((outcome.objective - expected.objective).abs() < 1e-8);
    for ocp in [&mut by_ipm, &mut by_sqp] {
        let solution = ocp.solution()?;
        let at_point = solution.inside("x[0]@0.6666666666666666")?[0];
        assert!((at_point - fine.stage(2)?.x[0]).abs() < 1e-6, "{at_point}");
        assert!((solution.control("u")?[0] - u).abs() < 1e-5);
    }
    Ok(())
}

/// Bounds by name at all points, in messages, in a solution, in text and back.
#[test]
fn names_of_inner_points() -> Test {
    let batch = Batch::<Pendulum, Gauss<2>>::new(Options::default())?;
    let mut ocp = Problem::new(Shooting::new(batch))
        .running_cost(GeneralCost::<Price>::new())
        .path_constraints(Constraint::<Load>::new([-1.0, -2.0], [2.0, 3.0]))
        .on(Horizon::uniform(2, 0.4))?;
    ocp.inside(&[0.25, 0.5])?.fix_initial_state(&[0.3, 0.0])?.set_parameters(.., &[0.1, 1.0])?;
    ocp.guess(&[0.3, 0.0], &[0.1])?.bound("x.angle", .., -0.5, 0.4)?.bound("z", 1.., -0.2, 0.5)?;
    ocp.soften("x.angle", 1.., 50.0, 0.0)?.soften_upper("Load[1]", .., 20.0, 1.0)?;
    ocp.set_path_bounds(1..2, &[-1.0, -2.5], &[2.5, 3.0])?;
    let text = ocp.to_string();
    for line in [
        "-0.5 ≤ x.angle@0.25 ≤ 0.4 at stage 0\n",
        "-0.5 ≤ x.angle@0.5 ≤ 0.4 at stage 1, soft: 50 e\n",
        "-0.2 ≤ z@0.25 ≤ 0.5 at stage 1\n",
        "-1 ≤ Load[0]@0.5 ≤ 2.5 at stage 1\n",
        "-2 ≤ Load[1]@0.25 ≤ 3 at stage 0, soft above: 20 e + ½ 1 e²\n",
        "-0.2 ≤ z ≤ 0.5 at stage 1\n",
    ] {
        assert!(text.contains(line), "{text}");
    }
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    let solution = ocp.solution()?;
    let load = solution.get("Load[0]@0.5")?;
    assert_eq!((load.kind, load.upper[1], load.values.len()), (Kind::Inside, Some(2.5), 2));
    let z = solution.get("z")?;
    assert_eq!((z.kind, z.lower[0], z.lower[1]), (Kind::Algebraic, None, Some(-0.2)));
    assert!(solution.csv().to_string().contains(",x.angle@0.25,x.angle@0.5,z@0.25,z@0.5\n"));
    let mut other = ocp.clone();
    other.guess(&[0.0; 2], &[0.0])?;
    assert_eq!(other.restore(&solution)?.solution()?, solution);

    // What contradicts itself inside of an interval is named there.
    let mut ocp =
        Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?).on(Horizon::uniform(2, 0.5))?;
    ocp.inside(&[0.5])?.fix_initial_state(&[0.0, 1.0])?.guess(&[0.0; 2], &[0.0])?;
    ocp.bound("u", .., -1.0, 1.0)?.bound("x[0]", 0..1, -1.0, 0.1)?;
    let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
    let text = outcome.to_string();
    assert!(text.contains("the upper bound of `x[0]` at point 1 inside of interval 0"), "{text}");
    Ok(())
}

#[test]
fn invalid_arguments() -> Test {
    let problem =
        || Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?).on(Horizon::uniform(2, 0.5));
    let mut ocp = problem()?;
    for (points, wrong) in [(&[0.5, 0.5][..], 1), (&[0.0], 0), (&[0.2, 1.0], 1), (&[f64::NAN], 0)] {
        let error = ocp.inside(points).err().ok_or("it is refused")?;
        assert!(matches!(error, OcpError::InvalidPoint { index, .. } if index == wrong), "{error}");
    }
    // An algebraic state has bounds where it is there.
    let error = ocp.bound("z", .., 0.0, 1.0).err().ok_or("there is none")?;
    assert!(matches!(error, OcpError::UnknownName { .. }), "{error}");
    ocp.inside(&[0.5])?;
    assert!(matches!(ocp.inside(&[0.5]), Err(OcpError::Unsupported { .. })));
    let mut ocp = problem()?;
    ocp.bound("x[0]", 1.., -1.0, 1.0)?;
    assert!(matches!(ocp.inside(&[0.5]), Err(OcpError::Unsupported { .. })));
    let mut dae =
        Problem::new(Irk::<Pendulum, Gauss<2>>::new(Options::default())?).on(Horizon::uniform(2, 0.4))?;
    let error = dae.bound("z", 2.., 0.0, 1.0).err().ok_or("there is none at the end")?;
    assert!(matches!(error, OcpError::NoSuchStage { part: Part::AlgebraicBounds, .. }), "{error}");
    assert!(matches!(dae.bound("z", .., 1.0, 0.0), Err(OcpError::CrossedBounds { name: "z", .. })));
    let mut map = Problem::new(Map::<Walk, f64>::new()).on(Horizon::uniform(2, 0.4))?;
    assert!(matches!(map.inside(&[0.5]), Err(OcpError::Unsupported { .. })));
    Ok(())
}

/// Moves held over three pieces are those of a horizon three times as fine whose controls are one:
/// costs, derivatives and the solution, with an end time that is free.
#[test]
fn move_blocking() -> Test {
    let irk = || Irk::<Sledges, Gauss<2>>::new(Options::default());
    let cost = || (GeneralCost::<Way>::new(), LeastSquaresCost::<Push>::diagonal(&[0.3]));
    let mut fine = Problem::new(irk()?)
        .running_cost(cost())
        .terminal_cost(GeneralCost::<Place>::new())
        .on(Horizon::free(3, 0.1..=4.0, 1.0))?;
    fine.fix_initial_state(&[1.0, 0.2])?.shared("u")?.guess(&[0.5, 0.0], &[0.1])?;
    let mut coarse = Problem::new(irk()?)
        .running_cost(cost())
        .terminal_cost(GeneralCost::<Place>::new())
        .on(Horizon::free(1, 0.1..=4.0, 1.0))?;
    coarse.hold(3)?.fix_initial_state(&[1.0, 0.2])?.guess(&[0.5, 0.0], &[0.1])?;
    let mut by_sqp = coarse.clone();
    let expected = HeapIpm::new(&fine)?.solve(&mut fine)?;
    let found = HeapIpm::new(&coarse)?.solve(&mut coarse)?;
    assert!(expected.is_converged() && found.is_converged(), "{found}");
    assert!(
        (found.objective - expected.objective).abs() < 1e-9,
        "{} {}",
        found.objective,
        expected.objective
    );
    assert!(HeapSqp::new(&by_sqp)?.solve(&mut by_sqp)?.is_converged());
    for ocp in [&mut coarse, &mut by_sqp] {
        let (one, two) = (ocp.solution()?, fine.solution()?);
        assert!(
            (one.end_time() - two.end_time()).abs() < 1e-6 && one.end_time() < 3.9 && one.end_time() > 0.2
        );
        assert!((one.control("u")?[0] - two.control("u")?[0]).abs() < 1e-6);
    }
    Ok(())
}

#[ode(duration = p)]
mod sledges {
    fn sledge(x: [f64; 2], u: f64, _p: f64) -> [f64; 2] {
        [x[1], u - 0.5 * x[1] * x[1] * x[0]]
    }
    #[function]
    fn way(x: [f64; 2], u: f64, _p: f64) -> f64 {
        1.0 + x[0] * x[0] + 0.2 * x[1] * u
    }
    #[function]
    fn push(_x: [f64; 2], u: f64, _p: f64) -> f64 {
        u
    }
    #[function]
    fn place(x: [f64; 2], _u: f64, _p: f64) -> f64 {
        20.0 * x[0] * x[0] + 5.0 * x[1] * x[1]
    }
}
