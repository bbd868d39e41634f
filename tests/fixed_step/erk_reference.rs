//! Explicit integrators against reference values of an independent code: pendulum and chains, RK4,
//! one step.

use crate::models::chain::Chain;
use crate::models::pendulum::Pendulum;
use casados::{Erk, Options, Rk4};
use nalgebra::SMatrix;
use reference_data::Record;

/// The reference has 17 digits; each value is a sum of some 100 terms of the size of the largest,
/// with roundings of both codes.
#[track_caller]
fn close<const R: usize, const C: usize>(what: &str, ours: SMatrix<f64, R, C>, exact: SMatrix<f64, R, C>) {
    let error = (ours - exact).amax() / exact.amax();
    assert!(error <= 1e-13, "{what}: {error:e}");
}

macro_rules! compare {
    ($test:ident, $model:ty, $file:literal, $nx:literal, $nu:literal, $nw:literal) => {
        #[test]
        fn $test() -> Result<(), Box<dyn std::error::Error>> {
            let reference = Record::load($file)?;
            let (x0, u) = (reference.vector::<$nx>("x0")?, reference.vector::<$nu>("u")?);
            let (lambda, h) = (reference.vector::<$nx>("lambda")?, reference.number("T")?);
            let x = reference.vector::<$nx>("x_next")?;
            let jacobian = reference.matrix::<$nx, $nw>("forward")?;
            let gradient = reference.vector::<$nw>("adjoint")?;
            let hessian = reference.symmetric::<$nw>("hessian")?;

            let mut erk = Erk::<$model, Rk4>::new(Options::default())?;
            close("x", erk.solve(&x0, &u, h)?.x, x);
            let adjoint = erk.adjoint(&x0, &u, h, &lambda)?;
            close("adjoint x0", adjoint.grad_x0, gradient.fixed_rows::<$nx>(0).into());
            close("adjoint u", adjoint.grad_u, gradient.fixed_rows::<$nu>($nx).into());
            let all = erk.hessian(&x0, &u, h, &lambda)?;
            close("dx/dx0", all.dx_dx0, jacobian.fixed_columns::<$nx>(0).into());
            close("dx/du", all.dx_du, jacobian.fixed_columns::<$nu>($nx).into());
            close("gradient x0", all.grad_x0, gradient.fixed_rows::<$nx>(0).into());
            let mut ours = SMatrix::<f64, $nw, $nw>::zeros();
            ours.fixed_view_mut::<$nx, $nx>(0, 0).copy_from(&all.h_xx);
            ours.fixed_view_mut::<$nx, $nu>(0, $nx).copy_from(&all.h_xu);
            ours.fixed_view_mut::<$nu, $nx>($nx, 0).copy_from(&all.h_xu.transpose());
            ours.fixed_view_mut::<$nu, $nu>($nx, $nx).copy_from(&all.h_uu);
            close("hessian", ours, hessian);
            Ok(())
        }
    };
}

compare!(pendulum_rk4, Pendulum, "pendulum/pendulum_T005_erk4n1.json", 4, 1, 5);
compare!(chain_of_3_masses_rk4, Chain<9>, "chain/chain_3_erk4n1.json", 9, 3, 12);
compare!(chain_of_5_masses_rk4, Chain<21>, "chain/chain_5_erk4n1.json", 21, 3, 24);
compare!(chain_of_7_masses_rk4, Chain<33>, "chain/chain_7_erk4n1.json", 33, 3, 36);
