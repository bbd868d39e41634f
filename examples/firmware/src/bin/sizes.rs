//! Bytes of integrators: with forward sensitivities, with what they fall back on and without; and
//! for every mode.
#![cfg_attr(target_os = "none", no_std, no_main)]

use casados::memory::{Pivoting, Refusing};
use casados::{Erk, Gauss, Inline, Irk, Rk4, mode};
use firmware::pendulum::Pendulum;
use firmware::quadrotor::{PlanarQuadrotor, Quadrotor};
use firmware::{board, report};

/// Of one to four stages, each with and without.
macro_rules! sizes {
    ($($name:literal: $model:ty, $number:ty;)*) => { $(report::numbers($name, &[
        sizes!(1, $model, $number, Pivoting), sizes!(1, $model, $number, Refusing),
        sizes!(2, $model, $number, Pivoting), sizes!(2, $model, $number, Refusing),
        sizes!(3, $model, $number, Pivoting), sizes!(3, $model, $number, Refusing),
        sizes!(4, $model, $number, Pivoting), sizes!(4, $model, $number, Refusing),
    ]);)* };
    ($stages:literal, $model:ty, $number:ty, $fallback:ty) => {
        Irk::<$model, Gauss<$stages>, $number, Inline<mode::Forward, 1, $fallback>>::SIZE as u32
    };
}

/// For every mode.
macro_rules! modes {
    ($($name:literal: $integrator:ident<$method:ty>;)*) => { $(report::numbers($name, &[
        $integrator::<Pendulum, $method, f64, Inline<mode::Nominal>>::SIZE as u32,
        $integrator::<Pendulum, $method, f64, Inline<mode::Forward>>::SIZE as u32,
        $integrator::<Pendulum, $method, f64, Inline<mode::Adjoint>>::SIZE as u32,
        $integrator::<Pendulum, $method, f64, Inline<mode::Hessian>>::SIZE as u32,
    ]);)* };
}

#[cfg_attr(target_os = "none", cortex_m_rt::entry)]
fn main() -> ! {
    sizes! {
        "Pendulum-f64": Pendulum, f64;
        "PlanarQuadrotor-f64": PlanarQuadrotor, f64;
        "Quadrotor-f64": Quadrotor, f64;
        "Pendulum-f32": Pendulum, f32;
        "PlanarQuadrotor-f32": PlanarQuadrotor, f32;
        "Quadrotor-f32": Quadrotor, f32;
    }
    modes! { "implicit": Irk<Gauss<2>>; "explicit": Erk<Rk4>; }
    board::exit(true)
}
