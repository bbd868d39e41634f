//! The chain of masses against reference objectives and trajectories.

use crate::Test;
use crate::chain_model::Chain;
use crate::data::Record;
use casados::ocp::{GaussNewton, Horizon, LeastSquaresCost, Problem, Shooting};
use casados::prelude::*;
use casados::qp::{HeapInteriorPoint, HeapSolution, QpSolver, Start as QpStart};

#[function(NX = [9, 15, 21, 27, 33])]
fn state<const NX: usize>(x: [f64; NX], _u: [f64; 3]) -> [f64; NX] {
    x
}

#[function(NX = [9, 15, 21, 27, 33])]
fn control<const NX: usize>(_x: [f64; NX], u: [f64; 3]) -> [f64; 3] {
    u
}

#[test]
fn smoke() -> Test {
    const NX: usize = 9;
    let record = Record::load("ocp/chain_3.json")?;
    let (n, ts) = (record.number("N")? as usize, record.number("Ts")?);
    let (rest, x0) = (record.list("xrest")?, record.list("x0")?);
    let free = (NX - 3) / 6;
    let mut q = [2.0; NX];
    q[3 * free..3 * free + 3].fill(2.0 * (free + 1) as f64);
    let batch = Batch::<Chain<NX>, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?;
    let mut ocp = Problem::new(Shooting::new(batch))
        .running_cost((
            LeastSquaresCost::<State<NX>>::diagonal(&q),
            LeastSquaresCost::<Control<NX>>::diagonal(&[0.02; 3]),
        ))
        .terminal_cost(LeastSquaresCost::<State<NX>>::diagonal(&q))
        .on(Horizon::uniform(n, ts))?;
    let reference: Vec<f64> = rest.iter().copied().chain([0.0; 3]).collect();
    ocp.set_reference(.., &reference)?.set_terminal_reference(&rest)?;
    ocp.fix_initial_state(&x0)?.bound("u", .., -1.0, 1.0)?;
    for mass in 0..=free {
        ocp.bound(&format!("x[{}]", 3 * mass + 1), 1..n, -0.05, f64::INFINITY)?;
    }
    ocp.guess(&rest, &[0.0; 3])?;
    let mut solver = HeapInteriorPoint::new();
    let mut solution = HeapSolution::new(ocp.qp().dims())?;
    for iteration in 0..12 {
        ocp.linearise(GaussNewton::default())?;
        let (residuals, objective) = ocp.residuals();
        println!("{iteration} {objective:.9} {residuals}");
        if residuals.largest() < 1e-6 {
            break;
        }
        solver.solve(ocp.qp(), QpStart::Cold, solution.view_mut())?;
        *ocp.iterate_mut() = solution.clone();
    }
    Ok(())
}
