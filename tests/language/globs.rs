//! Globs stand beside each other: those of the prelude, of optimal control, quadratic programs and
//! pictures, and nalgebra's own. A name that two of them had would not compile here.
#![deny(ambiguous_glob_imports)]

use casados::ocp::*;
use casados::plot::*;
use casados::prelude::*;
use casados::qp::*;
use nalgebra::*;

macro_rules! names {
    ($($name:ident)*) => {
        #[allow(unused_imports)]
        mod each {
            use super::{$($name as _),*};
        }
        const NAMES: &[&str] = &[$(stringify!($name)),*];
    };
}
names! {
    Adaptive AdaptiveOptions Crossing Event Hybrid Piecewise Radau Batch BatchError Intervals Heap Jacobian
    Newton Options Start LeastSquares Quadrature Seeds Butcher6 Custom DormandPrince5 DormandPrince8 Euler
    Gauss Heun Midpoint RadauIIA Rk4 Tableau Dae Erk Error Function Inline Irk Ode Record dae function ode
    Collocation Constraint ConvexCost Exact Formulation GaussNewton GeneralCost Globalisation HeapIpm
    HeapOcp HeapRealTime HeapSqp Horizon Huber IpmOptions Iteration LeastSquaresCost Log Map OcpError Outcome
    Problem RealTime Sensitivities Shooting SolutionFactors SqpOptions Status Trajectory
    WithIntegral
    Block Bounds Condensing QpField HeapInteriorPoint HeapQp HeapSolution InteriorPoint InteriorPointOptions Qp
    QpError QpSolver QpStart QpStatistics QpView Residuals Side Solution Stage StageDims
    Kind Series Cell Colour Curve Figure Panel Space Sparsity
    SVector SMatrix Vector3 Matrix3 DMatrix DVector RealField UnitQuaternion Rotation3 Isometry3
}

/// The list above has all of the prelude.
#[test]
fn names_of_the_prelude() {
    let source = include_str!("../../src/lib.rs");
    let (_, rest) = source.split_once("pub mod prelude {").expect("there is a prelude");
    let (prelude, _) = rest.split_once("\n}").expect("it ends");
    let code = prelude.lines().filter(|line| !line.trim_start().starts_with("#[") && !line.contains("as _;"));
    let names: Vec<&str> = code
        .flat_map(|line| line.split(|c: char| !c.is_alphanumeric()))
        .filter(|word| word.starts_with(char::is_uppercase))
        .collect();
    assert!(names.len() > 30, "{names:?}");
    for name in names {
        assert!(NAMES.contains(&name), "`{name}` is not in the list");
    }
}
