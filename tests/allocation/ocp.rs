//! Batches of problems allocate in the first call of a kind only.

use crate::COUNT;
use casados::function;
use casados_core::ocp::{BatchOcp, Exact, GeneralCost, HeapIpm, HeapSqp, Horizon, Map, OcpError, Problem};

#[function]
fn push(x: [f64; 1], u: [f64; 1], p: [f64; 1]) -> f64 {
    x[0] + p[0] * u[0]
}
#[function]
fn price(x: [f64; 1], u: [f64; 1], _p: [f64; 1]) -> f64 {
    1.0 - x[0].cos() + 0.5 * u[0] * u[0]
}

macro_rules! allocates_once {
    ($ocp:expr, $solver:expr) => {{
        let mut batch = BatchOcp::new($ocp, 6, $solver)?;
        batch.threads = 1;
        let mut count = || -> Result<usize, OcpError> {
            for (i, instance) in batch.instances_mut().iter_mut().enumerate() {
                instance.fix_initial_state(&[0.1 * i as f64])?.guess(&[0.2], &[0.0])?;
            }
            let before = COUNT.get();
            assert!(batch.solve()?.iter().all(Result::is_ok));
            let seed = |_: usize, _: &_, seed: &mut casados_core::qp::HeapSolution<f64>| {
                seed.stage_mut(0).into_iter().for_each(|stage| stage.u[0] = 1.0);
            };
            assert!(batch.adjoint(Exact::default(), seed)?.iter().all(|gradient| gradient.is_ok()));
            assert!(batch.value_gradient(Exact::default())?.get(5).is_ok());
            assert!(batch.differentiate(Exact::default())?.iter().all(Result::is_ok));
            Ok(COUNT.get() - before)
        };
        assert!(count()? > 0);
        assert_eq!(count()?, 0);
    }};
}

#[test]
fn batches_allocate_once() -> Result<(), OcpError> {
    let mut ocp = Problem::new(Map::<Push, f64>::new())
        .stage_cost(GeneralCost::<Price>::new())
        .on(Horizon::uniform(8, 0.1))?;
    ocp.fix_initial_state(&[0.3])?.set_parameters(.., &[1.0])?.bound("u", .., -0.2, 0.2)?;
    allocates_once!(&ocp, HeapSqp::new(&ocp)?);
    allocates_once!(&ocp, HeapIpm::new(&ocp)?);
    Ok(())
}
