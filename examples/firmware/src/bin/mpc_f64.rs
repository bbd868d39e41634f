//! Model predictive control in `f64`.
#![cfg_attr(target_os = "none", no_std, no_main)]

firmware::mpc!(f64);
