//! Weights of costs.

use crate::Test;
use casados::LeastSquares;
use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Problem, WithIntegral};
use casados::prelude::*;
use nalgebra::SMatrix;

#[function]
fn next(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[0] + 0.1 * x[1], x[1] + u]
}

#[function]
fn output(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[0], u]
}

#[ode]
fn mass(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u]
}

/// Weights of costs are those of a norm: `yᵀ W y ≥ 0`.
#[test]
fn definiteness_of_weights() -> Test {
    type Weighted = LeastSquaresCost<Output>;
    let refused = |cost: Weighted| {
        let stage = Problem::new(Map::<Next, f64>::new()).stage_cost(cost);
        stage.on(Horizon::uniform(3, 0.1)).err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert_eq!(
        refused(Weighted::diagonal(&[1.0, -1.0])),
        "the weight of output 1 of `Output` is -1: it must be finite and at least 0"
    );
    assert_eq!(
        refused(Weighted::diagonal(&[f64::NAN, 1.0])),
        "the weight of output 0 of `Output` is NaN: it must be finite and at least 0"
    );
    let matrix = |elements: [f64; 4]| Weighted::new(&SMatrix::<f64, 2, 2>::from_row_slice(&elements));
    for (elements, outputs) in [
        ([1.0, 0.5, 0.4, 1.0], [1, 0]),
        ([1.0, f64::NAN, 0.5, 1.0], [0, 1]),
        ([1.0, 0.5, f64::NAN, 1.0], [1, 0]),
        ([1.0, f64::INFINITY, f64::INFINITY, 1.0], [1, 0]),
        // Its eigenvalues are 3 and −1.
        ([1.0, 2.0, 2.0, 1.0], [1, 1]),
        ([0.0, 1.0, 1.0, 1.0], [1, 0]),
        ([1.0, 1.0, 1.0, 0.0], [1, 1]),
    ] {
        let stage = Problem::new(Map::<Next, f64>::new()).stage_cost(matrix(elements));
        match stage.on(Horizon::uniform(3, 0.1)) {
            Err(OcpError::InvalidWeight { function: "Output", outputs: found, .. }) => {
                assert_eq!(found, outputs, "{elements:?}");
            }
            other => return Err(format!("{elements:?}: {:?}", other.err()).into()),
        }
    }
    // Singular, and with an output that does not count.
    for elements in [[1.0, 1.0, 1.0, 1.0], [1.0 / 9.0, 1.0 / 3.0, 1.0 / 3.0, 1.0], [0.0, 0.0, 0.0, 1.0]] {
        assert_eq!(refused(matrix(elements)), "", "{elements:?}");
    }
    // Those that are changed on the way.
    let mut ocp = Problem::new(Map::<Next, f64>::new())
        .stage_cost(Weighted::diagonal(&[1.0; 2]))
        .on(Horizon::uniform(3, 0.1))?;
    ocp.fix_initial_state(&[1.0; 2])?.guess(&[1.0; 2], &[0.0])?;
    ocp.problem().stage_cost.set_weights(&SMatrix::<f64, 2, 2>::from_diagonal_element(-2.0));
    let mut sqp = HeapSqp::new(&ocp)?;
    assert!(matches!(sqp.solve(&mut ocp), Err(OcpError::InvalidWeight { outputs: [0, 0], value: -2.0, .. })));
    ocp.problem().stage_cost.set_weights(&SMatrix::<f64, 2, 2>::identity());
    assert!(sqp.solve(&mut ocp)?.is_converged());
    Ok(())
}

/// Those of integrals are checked, too.
#[test]
fn weights_of_integrals() -> Test {
    let problem = |weights| {
        let irk = Irk::<Mass, Gauss<2>>::new(Options::default())?;
        let along = WithIntegral::new(irk, LeastSquares::<Output>::new(&weights));
        let ocp = Problem::new(along).on(Horizon::uniform(3, 0.1))?;
        Ok::<_, Box<dyn std::error::Error>>(ocp)
    };
    let indefinite = SMatrix::<f64, 2, 2>::new(1.0, 2.0, 2.0, 1.0);
    let error = problem(indefinite).err().map(|error| error.to_string()).unwrap_or_default();
    assert_eq!(
        error,
        "the weight of output 1 of `Output` is 1: it must be larger: the weights are not positive semidefinite"
    );
    let mut ocp = problem(SMatrix::identity())?;
    ocp.fix_initial_state(&[1.0, 0.0])?.guess(&[1.0, 0.0], &[0.0])?;
    let mut sqp = HeapSqp::new(&ocp)?;
    assert!(sqp.solve(&mut ocp)?.is_converged());
    ocp.problem().dynamics.integral.weights[(1, 1)] = f64::NAN;
    assert!(matches!(sqp.solve(&mut ocp), Err(OcpError::InvalidWeight { outputs: [1, 1], .. })));
    Ok(())
}
