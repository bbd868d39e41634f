//! Mistakes are errors that say where.

use crate::Test;
use casados::qp::{
    Condensing, HeapInteriorPoint, HeapQp, HeapSolution, InteriorPoint, Qp, QpError, QpField, QpSolver,
    QpStart, Solution, StageDims,
};

const DIMS: [StageDims; 3] = [StageDims::new(2, 1, 1), StageDims::new(2, 1, 1), StageDims::new(2, 0, 0)];

fn problem() -> Result<HeapQp<f64>, QpError> {
    let mut qp = HeapQp::<f64>::new(&DIMS)?;
    for mut stage in qp.stages_mut() {
        stage.a_mut().set_diagonal([1.0, 1.0]);
        stage.b_mut().fill_with(|_, _| 1.0);
        stage.q_mut().set_diagonal([1.0, 1.0]);
        stage.r_mut().set(0, 0, 1.0);
        stage.c_mut().fill_with(|_, _| 1.0);
        stage.g_bounds_mut().set(0, -10.0, 10.0);
    }
    qp.fix_initial_state(&[1.0, -1.0])?;
    Ok(qp)
}

fn solve_error(qp: &HeapQp<f64>) -> Result<QpError, Box<dyn std::error::Error>> {
    let mut solution = HeapSolution::new(qp.dims())?;
    let found = HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, solution.view_mut());
    Ok(found.err().ok_or("solved")?)
}

#[test]
fn crossed_bounds() -> Test {
    let mut qp = problem()?;
    qp.stage_mut(1).ok_or("no stage")?.g_bounds_mut().set(0, 2.0, 1.0);
    let expected =
        QpError::CrossedBounds { field: QpField::GeneralBounds, stage: 1, index: 0, lower: 2.0, upper: 1.0 };
    assert_eq!(solve_error(&qp)?, expected);
    assert_eq!(
        expected.to_string(),
        "stage 1: lower bound 2 exceeds upper bound 1 at element 0 of the bounds of the general constraints"
    );
    Ok(())
}

/// Numbers that are not finite, wherever they are, are named.
#[test]
fn non_finite_data() -> Test {
    type Spoil = fn(&mut casados::qp::StageMut<'_, f64>);
    let places: [(Spoil, QpField, usize); 9] = [
        (|s| s.a_mut().set(1, 0, f64::NAN), QpField::A, 1),
        (|s| s.b_mut().set(1, 0, f64::INFINITY), QpField::B, 1),
        (|s| s.offset_mut()[1] = f64::NAN, QpField::Offset, 1),
        (|s| s.q_mut().set(1, 0, f64::NAN), QpField::Q, 1),
        (|s| s.r_mut().set(0, 0, f64::NAN), QpField::R, 0),
        (|s| s.s_mut().set(0, 1, f64::NAN), QpField::S, 1),
        (|s| s.gradient_x_mut()[0] = f64::NEG_INFINITY, QpField::GradientX, 0),
        (|s| s.gradient_u_mut()[0] = f64::NAN, QpField::GradientU, 0),
        (|s| s.u_bounds_mut().set(0, f64::NAN, 1.0), QpField::ControlBounds, 0),
    ];
    for (spoil, expected, at) in places {
        let mut qp = problem()?;
        spoil(&mut qp.stage_mut(1).ok_or("no stage")?);
        let found = solve_error(&qp)?;
        let QpError::InvalidValue { field, stage, index, value } = found else {
            return Err(format!("{expected}: {found}").into());
        };
        assert_eq!((field, stage, index), (expected, 1, at));
        assert!(!value.is_finite());
    }
    Ok(())
}

/// So are those of a row without bounds, at the state that is given, too: a single stage has no
/// other.
#[test]
fn non_finite_data_of_unbounded_rows() -> Test {
    let mut qp = HeapQp::new(&[StageDims::new(2, 0, 1)])?;
    qp.fix_initial_state(&[1.0, 2.0])?;
    qp.stage_mut(0).ok_or("no stage")?.c_mut().set(0, 1, f64::NAN);
    let QpError::InvalidValue { field, stage, index, .. } = solve_error(&qp)? else {
        return Err("another error".into());
    };
    assert_eq!((field, stage, index), (QpField::C, 0, 1));
    Ok(())
}

#[test]
fn negative_penalty() -> Test {
    let mut qp = problem()?;
    qp.stage_mut(0).ok_or("no stage")?.u_bounds_mut().soften(0, -1.0, 0.0);
    assert_eq!(
        solve_error(&qp)?,
        QpError::InvalidValue { field: QpField::Penalty, stage: 0, index: 0, value: -1.0 }
    );
    Ok(())
}

#[test]
fn wrong_lengths() -> Test {
    let mut qp = problem()?;
    assert_eq!(
        qp.fix_initial_state(&[0.0]),
        Err(QpError::Dimension { field: QpField::StateBounds, stage: 0, expected: 2, found: 1 })
    );
    let mut stage = qp.stage_mut(1).ok_or("no stage")?;
    assert_eq!(
        stage.b_mut().copy_from_columns(&[0.0; 3]),
        Err(QpError::Dimension { field: QpField::B, stage: 1, expected: 2, found: 3 })
    );
    let mut other = HeapSolution::new(&DIMS[..2])?;
    assert_eq!(
        HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, other.view_mut()),
        Err(QpError::Dimension { field: QpField::Stages, stage: 0, expected: 3, found: 2 })
    );
    assert!(matches!(HeapQp::<f64>::new(&[]), Err(QpError::Dimension { field: QpField::Stages, .. })));
    Ok(())
}

/// Everything in arrays, of exactly the lengths that the constant functions say, and in ones that
/// are too short.
#[test]
fn memory_in_arrays() -> Test {
    const DATA: usize = Qp::<f64, (), ()>::memory(&DIMS);
    const POINT: usize = Solution::<f64, (), ()>::memory(&DIMS);
    // Bounds of two general constraints, two sides each.
    const WORK: (usize, usize) = InteriorPoint::<f64, (), ()>::memory(&DIMS, 4, 0, 0);
    let mut qp = Qp::in_memory(DIMS, [0.0; DATA])?;
    for mut stage in qp.stages_mut() {
        stage.a_mut().set_diagonal([1.0, 1.0]);
        stage.b_mut().fill_with(|_, _| 1.0);
        stage.q_mut().set_diagonal([1.0, 1.0]);
        stage.r_mut().set(0, 0, 1.0);
        stage.c_mut().fill_with(|_, _| 1.0);
        stage.g_bounds_mut().set(0, -10.0, 10.0);
    }
    qp.fix_initial_state(&[1.0, -1.0])?;
    let mut solution = Solution::in_memory(DIMS, [0.0; POINT])?;
    let mut solver = InteriorPoint::in_memory([0.0; WORK.0], [0; WORK.1]);
    solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
    let mut on_heap = HeapSolution::new(&DIMS)?;
    HeapInteriorPoint::new().solve(problem()?.view(), QpStart::Cold, on_heap.view_mut())?;
    for (a, b) in solution.stages().zip(on_heap.stages()) {
        assert_eq!((a.x, a.u, a.dynamics), (b.x, b.u, b.dynamics));
    }
    let mut short = InteriorPoint::in_memory([0.0; WORK.0 - 1], [0; WORK.1]);
    assert_eq!(
        short.solve(qp.view(), QpStart::Cold, solution.view_mut()),
        Err(QpError::Dimension { field: QpField::Numbers, stage: 0, expected: WORK.0, found: WORK.0 - 1 })
    );
    let mut short = InteriorPoint::in_memory([0.0; WORK.0], [0; WORK.1 - 1]);
    assert_eq!(
        short.solve(qp.view(), QpStart::Cold, solution.view_mut()),
        Err(QpError::Dimension { field: QpField::Indices, stage: 0, expected: WORK.1, found: WORK.1 - 1 })
    );
    Ok(())
}

/// Options that make no sense are named, with their values; the largest number of iterations does
/// not overflow and ends.
#[test]
fn options() -> Test {
    type Spoil = fn(&mut casados::qp::InteriorPointOptions);
    let cases: [(Spoil, &str); 8] = [
        (|o| o.tolerance = f64::NAN, "tolerance"),
        (|o| o.tolerance = -1.0, "tolerance"),
        (|o| o.tolerance = 0.0, "tolerance"),
        (|o| o.relative_tolerance = 1.0, "relative_tolerance"),
        (|o| o.start_mu = 0.0, "start_mu"),
        (|o| o.start_mu = f64::INFINITY, "start_mu"),
        (|o| o.warm_distance = -1.0, "warm_distance"),
        (|o| o.no_bound = f64::NAN, "no_bound"),
    ];
    let qp = problem()?;
    let mut solution = HeapSolution::new(qp.dims())?;
    for (spoil, expected) in cases {
        let mut solver = HeapInteriorPoint::new();
        spoil(&mut solver.options);
        let found = solver.solve(qp.view(), QpStart::Cold, solution.view_mut());
        assert!(matches!(found, Err(QpError::InvalidOption { name, .. }) if name == expected), "{found:?}");
    }
    let mut solver = HeapInteriorPoint::new();
    (solver.options.max_iterations, solver.options.active_sets) = (usize::MAX, usize::MAX);
    solver.solve(qp.view(), QpStart::Warm, solution.view_mut())?;
    let mut unbounded = HeapQp::<f64>::new(&[StageDims::new(0, 1, 0)])?;
    let mut stage = unbounded.stage_mut(0).ok_or("no stage")?;
    stage.gradient_u_mut()[0] = -1.0;
    stage.u_bounds_mut().set(0, 0.0, f64::INFINITY);
    let mut solution = HeapSolution::new(unbounded.dims())?;
    let found = solver.solve(unbounded.view(), QpStart::Cold, solution.view_mut());
    assert!(matches!(found, Err(QpError::Stalled { .. })), "{found:?}");
    Ok(())
}

/// Settings of clarabel are checked and count in every call; those of the call before do not.
#[test]
fn clarabel_settings() -> Test {
    use casados::qp::Clarabel;
    type Change = fn(&mut Clarabel, f64);
    let cases: [(&str, Change, &[f64]); 6] = [
        ("tol_gap_abs", |c, v| c.settings.tol_gap_abs = v, &[f64::NAN, -1.0, f64::INFINITY]),
        ("tol_gap_rel", |c, v| c.settings.tol_gap_rel = v, &[f64::NAN, -1.0, f64::INFINITY]),
        ("tol_feas", |c, v| c.settings.tol_feas = v, &[f64::NAN, 0.0, f64::INFINITY]),
        ("tol_ktratio", |c, v| c.settings.tol_ktratio = v, &[f64::NAN, 0.0]),
        ("time_limit", |c, v| c.settings.time_limit = v, &[f64::NAN, 0.0]),
        ("max_step_fraction", |c, v| c.settings.max_step_fraction = v, &[f64::NAN, 0.0, 1.0]),
    ];
    let qp = problem()?;
    let mut solution = HeapSolution::new(qp.dims())?;
    for (expected, change, values) in cases {
        for &wrong in values {
            let mut solver = Clarabel::new();
            solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
            change(&mut solver, wrong);
            let found = solver.solve(qp.view(), QpStart::Cold, solution.view_mut());
            assert!(
                matches!(found, Err(QpError::InvalidOption { name, .. }) if name == expected),
                "{expected} {wrong}: {found:?}"
            );
        }
    }
    let mut solver = Clarabel::new();
    let iterations = solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?.iterations;
    assert!(iterations > 2);
    solver.settings.max_iter = 2;
    let found = solver.solve(qp.view(), QpStart::Cold, solution.view_mut());
    assert!(matches!(found, Err(QpError::MaxIterations { iterations: 2, .. })), "{found:?}");
    solver.settings.max_iter = 100;
    // This one holds for the life of a solver: a new one is made.
    solver.settings.equilibrate_enable = false;
    solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
    Ok(())
}

/// Blocks without intervals condense nothing, those that are longer than the horizon all of it.
#[test]
fn blocks_of_any_length() -> Test {
    let qp = problem()?;
    let mut expected = HeapSolution::new(qp.dims())?;
    HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, expected.view_mut())?;
    for block in [0, usize::MAX] {
        let mut solution = HeapSolution::new(qp.dims())?;
        let mut solver = Condensing::new(block, HeapInteriorPoint::new());
        solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
        for (found, expected) in solution.stages().zip(expected.stages()) {
            for (found, expected) in found.u.iter().zip(expected.u) {
                // Both are within tolerances of 1e-8 of the solution of a problem whose Hessian is
                // no less than one.
                assert!((found - expected).abs() < 1e-7, "{block}: {found} instead of {expected}");
            }
        }
    }
    Ok(())
}

/// Sizes that no memory has are errors, elements that a matrix does not have are none.
#[test]
fn absurd_sizes() -> Test {
    for dims in
        [[usize::MAX, 0, 0], [0, usize::MAX, 1], [usize::MAX / 2, 3, usize::MAX], [1 << 31, 1 << 31, 0]]
    {
        let dims = [StageDims::new(dims[0], dims[1], dims[2])];
        assert!(matches!(HeapQp::<f64>::new(&dims), Err(QpError::OutOfMemory { .. })));
        assert!(matches!(HeapSolution::<f64>::new(&dims), Err(QpError::OutOfMemory { .. })));
    }
    let mut qp = problem()?;
    let mut stage = qp.stage_mut(0).ok_or("no stage")?;
    stage.a_mut().set(usize::MAX, usize::MAX, 1.0);
    assert_eq!(stage.a_mut().as_block().get(usize::MAX, 0), None);
    assert_eq!(stage.a_mut().as_block().get(0, usize::MAX), None);
    Ok(())
}
