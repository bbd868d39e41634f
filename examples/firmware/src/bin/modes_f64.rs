//! Every kind of call in `f64`.
#![cfg_attr(target_os = "none", no_std, no_main)]

use casados::{Gauss, RadauIIA, Rk4};
use firmware::catalyst::Catalyst;
use firmware::pendulum::Pendulum;
use firmware::quadrotor::{PlanarQuadrotor, Quadrotor};

firmware::modes! {
    f64;
    "pendulum": Irk<Pendulum, Gauss<2>>, 3.0;
    "pendulum-erk": Erk<Pendulum, Rk4>, 3.0;
    "catalyst": Irk<Catalyst, RadauIIA<2>>, 0.5;
    "six": Irk<PlanarQuadrotor, Gauss<2>>, 3.0;
    "twelve": Irk<Quadrotor, Gauss<1>>, 3.0;
    "twelve-erk": Erk<Quadrotor, Rk4>, 3.0;
}
