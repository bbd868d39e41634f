//! Names and sparsity patterns of the functions of a problem, for `casadi.nlpsol`.

use super::function::{Port, Signature};
use super::groups::Group;
use super::layout::Layout;
use super::sparsity::Sparsity;
use alloc::vec;
use alloc::vec::Vec;

/// The signatures of all functions.
pub fn signatures(layout: &Layout, groups: &[Group], transposed: Sparsity) -> Vec<Signature> {
    let [jacobian, upper] = [&layout.jacobian.sparsity, &layout.upper.sparsity];
    let (n, m) = (layout.variables, layout.constraints);
    let last = layout.dims.len().saturating_sub(1);
    let (nx, nu) = layout.dims.first().map_or((0, 0), |first| (first.nx, first.nu));
    let [states, controls] = [[nx, layout.dims.len()], [nu, last]];
    let columns =
        |name, [rows, columns]: [usize; 2]| Port::new(name, Sparsity::new(rows, columns, |_, _| true));
    let by_name = groups.iter().map(|group| {
        let count = if group.controls { last } else { layout.dims.len() };
        Port::new(group.name.clone(), Sparsity::new(group.rows.len(), count, |_, _| true))
    });
    let port = |name, rows| Port::new(name, Sparsity::vector(rows));
    let zero = |name, rows, columns| Port::new(name, Sparsity::zero(rows, columns));
    let point = vec![port(c"x", n), port(c"p", 0)];
    let lagrangian = [point.clone(), vec![port(c"lam_f", 1), port(c"lam_g", m)]].concat();
    let (f, g) = (port(c"f", 1), port(c"g", m));
    let jac_g = Port::new(c"jac_g_x", jacobian.clone());
    let nominal = [point.clone(), vec![zero(c"out_f", 1, 1), zero(c"out_g", m, 1)]].concat();
    let adjoint = [nominal.clone(), vec![port(c"adj_f", 1), port(c"adj_g", m)]].concat();
    let second = [adjoint.clone(), vec![zero(c"out_adj_x", n, 1), zero(c"out_adj_p", 0, 1)]].concat();
    let of_point = |outputs| Signature { inputs: point.clone(), outputs };
    let of_lagrangian = |outputs| Signature { inputs: lagrangian.clone(), outputs };
    vec![
        of_point(vec![f.clone(), g.clone()]),
        of_point(vec![f.clone()]),
        of_point(vec![g.clone()]),
        of_point(vec![f.clone(), port(c"grad_f_x", n)]),
        of_point(vec![g.clone(), jac_g.clone()]),
        of_lagrangian(vec![Port::new(c"triu_hess_gamma_x_x", upper.clone())]),
        of_lagrangian(vec![f, g, port(c"grad_gamma_x", n), port(c"grad_gamma_p", 0)]),
        Signature {
            inputs: Vec::new(),
            outputs: vec![port(c"lbx", n), port(c"ubx", n), port(c"x0", n), port(c"lbg", m), port(c"ubg", m)],
        },
        Signature {
            inputs: nominal,
            outputs: vec![
                Port::new(c"jac_f_x", Sparsity::new(1, n, |_, _| true)),
                zero(c"jac_f_p", 1, 0),
                jac_g,
                zero(c"jac_g_p", m, 0),
            ],
        },
        Signature { inputs: adjoint, outputs: vec![port(c"adj_x", n), port(c"adj_p", 0)] },
        Signature {
            inputs: second,
            outputs: vec![
                Port::new(c"jac_adj_x_x", layout.hessian.clone()),
                zero(c"jac_adj_x_p", n, 0),
                zero(c"jac_adj_x_out_f", n, 1),
                zero(c"jac_adj_x_out_g", n, m),
                port(c"jac_adj_x_adj_f", n),
                Port::new(c"jac_adj_x_adj_g", transposed),
                zero(c"jac_adj_p_x", 0, n),
                zero(c"jac_adj_p_p", 0, 0),
                zero(c"jac_adj_p_out_f", 0, 1),
                zero(c"jac_adj_p_out_g", 0, m),
                zero(c"jac_adj_p_adj_f", 0, 1),
                zero(c"jac_adj_p_adj_g", 0, m),
            ],
        },
        Signature {
            inputs: vec![port(c"x", n)],
            outputs: [columns(c"x", states), columns(c"u", controls)].into_iter().chain(by_name).collect(),
        },
    ]
}
