//! The problem of the chain of masses: from a disturbance back to rest, with a wall beside it.
//!
//! The first experiment of Frey, De Schutter and Diehl, "Fast integrators with sensitivity
//! propagation for use in CasADi", after Wirsching, Bock and Diehl (2006).

use casados::function;

/// The states.
#[function(NX = [9, 15, 21, 27, 33])]
pub fn state<const NX: usize>(x: [f64; NX], _u: [f64; 3]) -> [f64; NX] {
    x
}

/// The controls.
#[function(NX = [9, 15, 21, 27, 33])]
pub fn control<const NX: usize>(_x: [f64; NX], u: [f64; 3]) -> [f64; 3] {
    u
}

/// How much each state costs: positions of the end as much as there are springs.
pub fn weights<const NX: usize>() -> [f64; NX] {
    let free = (NX - 3) / 6;
    core::array::from_fn(|i| if i / 3 == free { 2.0 * (free + 1) as f64 } else { 2.0 })
}

/// The problem of a size with dynamics, at the start `x_k = x_rest`, `u = 0`: 40 intervals of 0.2
/// s.
///
/// ```text
/// min  ½ Σ_k h (‖x_k − x_rest‖²_Q + ‖u_k‖²_R) + ½ ‖x_N − x_rest‖²_Q        |u| ≤ 1,  y ≥ −0.05 from the second node to the last but one
/// ```
macro_rules! problem {
    ($nx:literal, $rest:expr, $x0:expr, $dynamics:expr) => {{
        use casados::ocp::{Horizon, LeastSquaresCost, Problem};
        let (n, rest, q) = (40, $rest, $crate::chain_problem::weights::<$nx>());
        let mut ocp = Problem::new($dynamics)
            .running_cost((
                LeastSquaresCost::<$crate::chain_problem::State<$nx>>::diagonal(&q),
                LeastSquaresCost::<$crate::chain_problem::Control<$nx>>::diagonal(&[0.02; 3]),
            ))
            .terminal_cost(LeastSquaresCost::<$crate::chain_problem::State<$nx>>::diagonal(&q))
            .on(Horizon::uniform(n, 0.2))?;
        let reference: Vec<f64> = rest.iter().copied().chain([0.0; 3]).collect();
        ocp.set_reference(.., &reference)?.set_terminal_reference(&rest)?;
        ocp.fix_initial_state(&$x0)?.bound("u", .., -1.0, 1.0)?;
        for mass in 0..=($nx - 3) / 6 {
            ocp.bound(&format!("x[{}]", 3 * mass + 1), 1..n, -0.05, f64::INFINITY)?;
        }
        ocp.guess(&rest, &[0.0; 3])?;
        ocp
    }};
}
pub(crate) use problem;
