//! A function beside the linear model.

use super::NONE;
use casados_core::function::{ArrayV, FunctionStructure};
use casados_core::model::Pattern;
use casados_core::shape::{Count, Plain};
use casados_core::{Dims, Function, Lanes};

/// `y = x + BY`
pub struct Shifted<const BY: i8>;

impl<const BY: i8> Function for Shifted<BY> {
    type Shape = Dims<1, 1, 1, 1, 2, 6, 3>;
    type Outputs = Count<1>;
    type Jacobian<T: Plain> = [T; 1];
    type Hessian<T: Plain> = [T; 0];
    const STRUCTURE: FunctionStructure = FunctionStructure {
        name: "shifted",
        x: &["x"],
        z: &["z"],
        u: &["u"],
        p: &["p"],
        jacobian: Pattern { rows: &[0], columns: &[1] },
        blocks: [0, 0, 1, 1, 1, 1],
        by_row: &[0],
        begins: &[0, 1],
        constant: &[true],
        hessian: Pattern { rows: &[], columns: &[] },
        linear: &[true],
        variables: &[1],
        operations: NONE,
    };
    fn value<S: Lanes>(v: &ArrayV<Self, S::Cell>, y: &mut [S::Cell; 1]) {
        (S::load(&v[1]) + S::from_f64(f64::from(BY))).store(&mut y[0]);
    }
    fn jacobian_constants<S: Lanes>(jacobian: &mut [S::Cell; 1]) {
        S::from_f64(1.0).store(&mut jacobian[0]);
    }
    fn value_jacobian<S: Lanes>(v: &ArrayV<Self, S::Cell>, y: &mut [S::Cell; 1], _: &mut [S::Cell; 1]) {
        Self::value::<S>(v, y);
    }
    fn adjoint<S: Lanes>(_: &ArrayV<Self, S::Cell>, mu: &[S::Cell; 1], gradient: &mut ArrayV<Self, S::Cell>) {
        gradient.iter_mut().for_each(|cell| S::from_f64(0.0).store(cell));
        S::load(&mu[0]).store(&mut gradient[1]);
    }
    fn time_derivative<S: Lanes>(_: &ArrayV<Self, S::Cell>, rate: &mut [S::Cell; 1]) {
        S::from_f64(0.0).store(&mut rate[0]);
    }
    fn hessian<S: Lanes>(_: &ArrayV<Self, S::Cell>, _: &[S::Cell; 1], _: &mut [S::Cell; 0]) {}
}
