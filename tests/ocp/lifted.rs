//! Stages that converge with the iterates of optimal control: the same solutions, and stages that
//! satisfy their equations there.

use crate::Test;
use crate::chain_model::Chain;
use crate::chain_problem;
use casados::model::{VectorU, VectorX};
use casados::ocp::{HeapSqp, Shooting};
use casados::prelude::*;
use reference_data::Record;

/// Solves a problem to `1e-9` by Gauss-Newton steps, or by those of its exact Hessian.
macro_rules! solve {
    ($ocp:ident, $exact:literal) => {{
        let mut sqp = HeapSqp::new(&$ocp)?.gauss_newton();
        sqp.qp_solver.options.tolerance = 1e-10;
        sqp.options.tolerance = 1e-9;
        let outcome =
            if $exact { sqp.exact(Default::default()).solve(&mut $ocp)? } else { sqp.solve(&mut $ocp)? };
        assert!(outcome.is_converged(), "{outcome}");
        outcome
    }};
}

/// The problem with lifted stages takes two iterations more, at most, than with stages that
/// converge in each; then every interval is integrated with Newton's method to rounding, alone.
macro_rules! agrees {
    ($name:ident, $file:literal, $nx:literal, $stages:literal x $steps:literal, $key:literal, $exact:literal) => {
        #[test]
        fn $name() -> Test {
            let record = Record::load($file)?;
            let options = Options { steps: $steps, ..Default::default() };
            let problem = |options| -> Result<_, Box<dyn std::error::Error>> {
                let dynamics = Shooting::new(Batch::<Chain<$nx>, Gauss<$stages>>::new(options)?);
                Ok(chain_problem::problem!($nx, record.list("xrest")?, record.list("x0")?, dynamics))
            };
            let (mut ocp, mut other) = (problem(options.lifted())?, problem(options)?);
            let (outcome, most) = (solve!(ocp, $exact), solve!(other, $exact).iterations + 2);
            assert!(outcome.iterations <= most, "{} {most}", outcome.iterations);
            let expected = record.number($key)?;
            assert!((outcome.objective - expected).abs() < 1e-8 * expected, "{}", outcome.objective);
            let mut irk = Irk::<Chain<$nx>, Gauss<$stages>>::new(options)?;
            let stages: Vec<_> = ocp.iterate().stages().collect();
            for pair in stages.windows(2) {
                let x0 = VectorX::<Chain<$nx>, f64>::from_column_slice(pair[0].x);
                let u = VectorU::<Chain<$nx>, f64>::from_column_slice(pair[0].u);
                let end = irk.solve(&x0, &u, 0.2)?;
                for (&end, &next) in end.x.iter().zip(pair[1].x) {
                    // The residual of the dynamics as the solver sees it, and as much for what the
                    // last iteration leaves of the stages.
                    assert!((end - next).abs() < 2e-9, "{end} {next}");
                }
            }
            Ok(())
        }
    };
}
agrees!(three_masses, "ocp/chain_3.json", 9, 2 x 2, "objective_gl2x2", false);
agrees!(five_masses, "ocp/chain_5.json", 21, 2 x 2, "objective_gl2x2", false);
agrees!(order_eight, "ocp/chain_3.json", 9, 4 x 4, "objective_gl4x4", false);
agrees!(exact_hessians, "ocp/chain_3.json", 9, 2 x 2, "objective_gl2x2", true);
