//! All checks of one interval of an integrator, with the share of comparisons that may be unable to
//! tell.

use casados::memory::{WithAdjoint, WithHessian};
use casados::testing::check_sensitivities;
use casados::{Dae, Integrator, Options, Shape};
use nalgebra::SVector;

/// All checks of one interval; of the comparisons with differences at most a tenth may be unable to
/// tell.
pub fn check_interval<M, I, const NX: usize, const NU: usize, const NP: usize>(
    mut integrator: I,
    x0: &SVector<f64, NX>,
    u: &SVector<f64, NU>,
    p: &SVector<f64, NP>,
    h: f64,
) where
    M: Dae,
    M::Shape: Shape<
            VectorX<f64> = SVector<f64, NX>,
            VectorU<f64> = SVector<f64, NU>,
            VectorP<f64> = SVector<f64, NP>,
        >,
    I: Integrator<Model = M, Number = f64, Memory: WithHessian + WithAdjoint<1>>,
{
    let report =
        check_sensitivities::<M, I>(&mut integrator, x0, u, p, h).expect("the interval can be integrated");
    println!("{report}");
    report.assert();
    for row in &report.rows {
        assert!(row.inconclusive * 10 <= row.entries, "{report}");
    }
}

/// Default options with a number of steps.
pub fn options(steps: usize) -> Options {
    Options { steps, ..Default::default() }
}
