//! Every call of the integrators, for several methods and models: that this links says that none of
//! them panics.
#![cfg_attr(target_os = "none", no_std, no_main)]

use casados::prelude::*;
use casados::{mode, result::Seeds};
use core::hint::black_box;
use firmware::board;
use firmware::catalyst::Catalyst;
use firmware::pendulum::Pendulum;
use firmware::quadrotor::Quadrotor;
use nalgebra::{SMatrix, SVector};

/// Calls with memory for these modes; explicit integrators have one for all.
macro_rules! every_call {
    (Irk, $($case:tt)*) => { every_call!(Irk: mode::Adjoint<1>, mode::Adjoint<3>, mode::Directional<3>; $($case)*) };
    (Erk, $($case:tt)*) => { every_call!(Erk: mode::Hessian, mode::Hessian, mode::Hessian; $($case)*) };
    ($integrator:ident: $adjoint:ty, $adjoints:ty, $directional:ty;
        $model:ty, $nx:literal, $nu:literal, $method:ty, $number:ty) => {{
        type Of<Mode> = $integrator<$model, $method, $number, Inline<Mode, 3>>;
        #[inline(never)]
        fn run(steps: usize) -> Result<(), Error> {
            let options = Options { steps, ..firmware::options(black_box(3)) };
            let x = black_box(SVector::<$number, $nx>::from_element(0.1));
            let (u, h) = black_box((SVector::<$number, $nu>::from_element(0.1), 0.05));
            let seeds = Seeds {
                x0: SMatrix::<$number, $nx, 3>::from_element(0.1),
                u: SMatrix::zeros(),
                p: SMatrix::zeros(),
            };
            let mut integrator = Of::<mode::Hessian>::inline(options)?;
            integrator.set_time(h)?;
            integrator.solve(&x, &u, h)?;
            integrator.forward(&x, &u, h)?;
            integrator.forward_adjoint(&x, &u, h, &x)?;
            integrator.hessian(&x, &u, h, &x)?;
            every_call!(dense $integrator, integrator, h);
            Of::<$adjoint>::inline(options)?.adjoint(&x, &u, h, &x)?;
            Of::<$adjoints>::inline(options)?.adjoint_many(&x, &u, h, &seeds.x0)?;
            Of::<$directional>::inline(options)?.directional(&x, &u, h, &seeds)?;
            Ok(())
        }
        run(black_box(2)).is_ok()
    }};
    (dense Irk, $integrator:ident, $h:ident) => {
        $integrator.dense($h * 1.5)?;
        $integrator.dense_forward($h * 1.5)?;
    };
    (dense Erk, $integrator:ident, $h:ident) => {};
}

/// An integrator that does not pivot.
#[inline(never)]
fn refusing() -> Result<(), Error> {
    type Refusing = Inline<mode::Hessian, 3, casados::memory::Refusing>;
    let mut integrator = Irk::<Pendulum, Gauss<3>, f64, Refusing>::inline(black_box(Options::default()))?;
    let (x, u) = black_box((SVector::<f64, 4>::from_element(0.1), SVector::<f64, 1>::from_element(0.1)));
    integrator.hessian(&x, &u, black_box(0.05), &x)?;
    Ok(())
}

#[cfg_attr(target_os = "none", cortex_m_rt::entry)]
fn main() -> ! {
    let mut good = every_call!(Irk, Pendulum, 4, 1, Gauss<2>, f64);
    good &= every_call!(Irk, Pendulum, 4, 1, RadauIIA<3>, f32);
    good &= every_call!(Irk, Catalyst, 3, 2, RadauIIA<2>, f64);
    good &= every_call!(Irk, Quadrotor, 12, 4, Gauss<1>, f32);
    good &= refusing().is_ok();
    good &= every_call!(Erk, Pendulum, 4, 1, Rk4, f64);
    good &= every_call!(Erk, Quadrotor, 12, 4, DormandPrince5, f32);
    board::exit(good)
}
