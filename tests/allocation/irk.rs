//! Only the first call of each kind allocates, and none after memory was reserved.

use crate::count_allocations;
use crate::models::Nonlinear;
use casados_core::result::Seeds;
use casados_core::{Gauss, Irk, Options};
use nalgebra::{SMatrix, vector};

#[test]
fn memory_is_allocated_once() {
    let options = Options { steps: 3, ..Default::default() };
    let (x0, u, lambda) = (vector![0.4, -0.7], vector![0.9], vector![1.0, 2.0]);
    let seeds = Seeds { x0: SMatrix::<f64, 2, 2>::identity(), u: SMatrix::zeros(), p: SMatrix::zeros() };
    let lambdas = SMatrix::<f64, 2, 3>::identity();
    let run = |irk: &mut Irk<Nonlinear, Gauss<2>>| {
        [
            count_allocations(|| _ = irk.solve(&x0, &u, 0.1).unwrap()),
            count_allocations(|| _ = irk.forward(&x0, &u, 0.1).unwrap()),
            count_allocations(|| _ = irk.forward_adjoint(&x0, &u, 0.1, &lambda).unwrap()),
            count_allocations(|| _ = irk.dense_forward(0.05).unwrap()),
            count_allocations(|| _ = irk.adjoint(&x0, &u, 0.1, &lambda).unwrap()),
            count_allocations(|| _ = irk.adjoint_many(&x0, &u, 0.1, &lambdas).unwrap()),
            count_allocations(|| _ = irk.directional(&x0, &u, 0.1, &seeds).unwrap()),
            count_allocations(|| _ = irk.hessian(&x0, &u, 0.1, &lambda).unwrap()),
        ]
    };
    let mut irk = Irk::<Nonlinear, Gauss<2>>::new(options).unwrap();
    assert_eq!(count_allocations(|| irk.set_parameters(&vector![1.3]).unwrap()), 1);
    // The two records of `solve`; then one for each new kind of call, and a list for those that
    // depend on the number of seeds.
    assert_eq!(run(&mut irk), [2, 1, 0, 0, 2, 1, 2, 2]);
    assert_eq!(run(&mut irk), [0; 8]);

    let mut irk = Irk::<Nonlinear, Gauss<2>>::new(options).unwrap();
    irk.set_parameters(&vector![1.3]).unwrap();
    irk.reserve_hessian().unwrap();
    irk.reserve_adjoint::<1>().unwrap();
    irk.reserve_adjoint::<3>().unwrap();
    irk.reserve_directional::<2>().unwrap();
    assert_eq!(run(&mut irk), [0; 8]);
}
