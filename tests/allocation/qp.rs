//! A solver of QPs allocates in its first call only.

use crate::COUNT;
use casados_core::qp::{
    BatchInteriorPoint, Condensing, HeapInteriorPoint, HeapQp, HeapSolution, QpInstance, QpSolver, QpStart,
    StageDims,
};

#[test]
fn memory_is_allocated_once() -> Result<(), casados_core::qp::QpError> {
    let mut dims = [StageDims::new(3, 2, 1); 8];
    dims[7].nu = 0;
    let mut qp = HeapQp::<f64>::new(&dims)?;
    for mut stage in qp.stages_mut() {
        stage.a_mut().set_diagonal([1.0, 0.9, 0.8]);
        stage.b_mut().fill_with(|i, j| (i + j) as f64);
        stage.q_mut().set_diagonal([1.0; 3]);
        stage.r_mut().set_diagonal([0.1; 2]);
        stage.c_mut().fill_with(|_, _| 1.0);
        stage.g_bounds_mut().set(0, -5.0, 5.0);
        stage.u_bounds_mut().set(0, -0.5, 0.5);
    }
    qp.fix_initial_state(&[1.0, 2.0, 1.0])?;
    let mut solution = HeapSolution::new(&dims)?;
    let mut solver = HeapInteriorPoint::new();
    let mut count = |start| {
        let before = COUNT.get();
        let result = solver.solve(qp.view(), start, solution.view_mut());
        result.map(|_| COUNT.get() - before)
    };
    assert_eq!(count(QpStart::Cold)?, 2, "numbers and indices");
    assert_eq!(count(QpStart::Cold)?, 0);
    assert_eq!(count(QpStart::Warm)?, 0);
    let mut batch = BatchInteriorPoint::new();
    batch.threads = 1;
    let mut instances = vec![QpInstance { qp: qp.clone(), solution: HeapSolution::new(&dims)? }; 5];
    let mut count = |start| {
        let before = COUNT.get();
        let result = batch.solve(&mut instances, start);
        result.map(|_| COUNT.get() - before)
    };
    assert!(count(QpStart::Cold)? > 0);
    assert_eq!(count(QpStart::Cold)?, 0);
    assert_eq!(count(QpStart::Warm)?, 0);
    // Side by side in registers: nothing but controls has bounds.
    dims.iter_mut().for_each(|dims| dims.ng = 0);
    let mut plain = HeapQp::<f64>::new(&dims)?;
    for mut stage in plain.stages_mut() {
        stage.a_mut().set_diagonal([1.0, 0.9, 0.8]);
        stage.b_mut().fill_with(|i, j| (i + j) as f64);
        stage.q_mut().set_diagonal([1.0; 3]);
        stage.r_mut().set_diagonal([0.1; 2]);
        stage.u_bounds_mut().set(0, -0.5, 0.5);
    }
    plain.fix_initial_state(&[1.0, 2.0, 1.0])?;
    let mut instances = vec![QpInstance { qp: plain, solution: HeapSolution::new(&dims)? }; 21];
    let mut count = |start| {
        let before = COUNT.get();
        let result = batch.solve(&mut instances, start);
        result.map(|statuses| (COUNT.get() - before, statuses.iter().all(Result::is_ok)))
    };
    assert!(count(QpStart::Cold)?.0 > 0);
    assert_eq!(count(QpStart::Cold)?, (0, true));
    assert_eq!(count(QpStart::Warm)?, (0, true));
    let mut condensing = Condensing::new(3, HeapInteriorPoint::new());
    let mut count = |start| {
        let before = COUNT.get();
        let result = condensing.solve(qp.view(), start, solution.view_mut());
        result.map(|_| COUNT.get() - before)
    };
    assert!(count(QpStart::Cold)? > 0);
    // Dimensions are kept of two calls.
    count(QpStart::Cold)?;
    assert_eq!(count(QpStart::Cold)?, 0);
    assert_eq!(count(QpStart::Warm)?, 0);
    Ok(())
}
