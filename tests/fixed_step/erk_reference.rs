//! Explicit integrators against reference values of an independent code: pendulum and chains, RK4,
//! one step.

use crate::data::Record;
use crate::{explicit, system};
use casados::{Erk, Options, Rk4, Scalar};
use nalgebra::SMatrix;

system! {
    /// A pendulum on a cart, as in `examples/models/pendulum.rs`.
    Pendulum [4, 0, 1, 0] S |v, f| {
        let n = S::from_f64;
        let (xdot, [_, angle, velocity, omega], force) = (&v[..4], [v[4], v[5], v[6], v[7]], v[8]);
        let (sin, cos) = angle.sin_cos();
        let mass = n(1.1) - n(0.1) * cos * cos;
        let centrifugal = n(0.1 * 0.8) * sin * omega * omega;
        (f[0], f[1]) = (xdot[0] - velocity, xdot[1] - omega);
        f[2] = xdot[2] - (n(0.1 * 9.81) * cos * sin - centrifugal + force) / mass;
        f[3] = xdot[3] - (force * cos - centrifugal * cos + n(1.1 * 9.81) * sin) / (n(0.8) * mass);
    }
}
explicit!(Pendulum: 0 1 2 3);

/// The chain of masses, as in `examples/models/chain.rs`: `v = (ẋ, x, u, t)`.
fn chain<S: Scalar>(v: &[S], f: &mut [S]) {
    let (nx, n) = (f.len(), S::from_f64);
    let (xdot, x, u) = (&v[..nx], &v[nx..2 * nx], &v[2 * nx..2 * nx + 3]);
    let free = (nx - 3) / 6;
    let spring = |i: usize| -> [S; 3] {
        let d: [S; 3] =
            core::array::from_fn(|k| if i == 0 { x[k] } else { x[3 * i + k] - x[3 * (i - 1) + k] });
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        d.map(|d| n(1.0 / 0.033) * (n(1.0) - n(0.033) / length) * d)
    };
    for i in 0..free {
        let (before, after) = (spring(i), spring(i + 1));
        for k in 0..3 {
            let (position, velocity) = (3 * i + k, 3 * (free + 1 + i) + k);
            f[position] = xdot[position] - x[velocity];
            let gravity = n(if k == 2 { 9.81 } else { 0.0 });
            f[velocity] = xdot[velocity] - (after[k] - before[k] - gravity);
        }
    }
    for k in 0..3 {
        f[3 * free + k] = xdot[3 * free + k] - u[k];
    }
}

system! { Chain3 [9, 0, 3, 0] S |v, f| { chain(v, f) } }
system! { Chain5 [21, 0, 3, 0] S |v, f| { chain(v, f) } }
system! { Chain7 [33, 0, 3, 0] S |v, f| { chain(v, f) } }
explicit!(Chain3: 0 1 2 3 4 5 6 7 8);
explicit!(Chain5: 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20);
explicit!(Chain7: 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32);

/// The reference has 17 digits; each value is a sum of some 100 terms of the size of the largest,
/// with roundings of both codes.
#[track_caller]
fn close<const R: usize, const C: usize>(what: &str, ours: SMatrix<f64, R, C>, exact: SMatrix<f64, R, C>) {
    let error = (ours - exact).amax() / exact.amax();
    assert!(error <= 1e-13, "{what}: {error:e}");
}

macro_rules! compare {
    ($test:ident, $model:ident, $file:literal, $nx:literal, $nu:literal, $nw:literal) => {
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
compare!(chain_of_3_masses_rk4, Chain3, "chain/chain_3_erk4n1.json", 9, 3, 12);
compare!(chain_of_5_masses_rk4, Chain5, "chain/chain_5_erk4n1.json", 21, 3, 24);
compare!(chain_of_7_masses_rk4, Chain7, "chain/chain_7_erk4n1.json", 33, 3, 36);
