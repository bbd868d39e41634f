//! Model predictive control in `f32`.
#![cfg_attr(target_os = "none", no_std, no_main)]

firmware::mpc!(f32);
