//! Rows of a model that differ by hundreds of orders of magnitude, known to the macro or not: the results are those of
//! the model with rows as they come.

use casados::prelude::*;
use nalgebra::vector;

/// An oscillator with a force that is an algebraic state, its rows multiplied by numbers that the macro does not see (it
/// takes any numbers around one for them when it chooses pivots), or by the literals that it does.
macro_rules! oscillators {
    ($($name:ident $literal:ident $type:ident $literal_type:ident [$a:literal, $b:literal, $c:literal];)*) => {
        $(
            mod $name {
                pub const ROWS: [f64; 3] = [$a, $b, $c];
            }
            #[dae(name = $type)]
            fn $name(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64) -> [f64; 3] {
                [
                    $name::ROWS[0] * (xdot[0] - x[1]),
                    $name::ROWS[1] * (xdot[1] + z - u),
                    $name::ROWS[2] * (z + 0.1 * z * z * z - x[0] - 0.2 * x[1]),
                ]
            }
            #[dae(name = $literal_type)]
            fn $literal(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64) -> [f64; 3] {
                [$a * (xdot[0] - x[1]), $b * (xdot[1] + z - u), $c * (z + 0.1 * z * z * z - x[0] - 0.2 * x[1])]
            }
        )*
        #[test]
        fn rows_in_any_unit() {
            let expected = found::<Plain>();
            $(
                compare(stringify!($name), &found::<$type>(), &expected);
                compare(stringify!($literal), &found::<$literal_type>(), &expected);
            )*
        }
    };
}

oscillators! {
    plain plain_literal Plain PlainLiteral [1.0, 1.0, 1.0];
    large large_literal Large LargeLiteral [1e200, 1.0, 1.0];
    large_force large_force_literal LargeForce LargeForceLiteral [1.0, 1e200, 1.0];
    large_spring large_spring_literal LargeSpring LargeSpringLiteral [1.0, 1.0, 1e200];
    small small_literal Small SmallLiteral [1e-200, 1.0, 1.0];
    small_force small_force_literal SmallForce SmallForceLiteral [1.0, 1e-200, 1.0];
    small_spring small_spring_literal SmallSpring SmallSpringLiteral [1.0, 1.0, 1e-200];
    all_large all_large_literal AllLarge AllLargeLiteral [1e200, 1e200, 1e200];
    all_small all_small_literal AllSmall AllSmallLiteral [1e-200, 1e-200, 1e-200];
    mixed mixed_literal Mixed MixedLiteral [1e150, 1e-150, 1.0];
    mixed_too mixed_too_literal MixedToo MixedTooLiteral [1.0, 1e-150, 1e150];
    mixed_more mixed_more_literal MixedMore MixedMoreLiteral [1e200, 1e-200, 1.0];
    mixed_most mixed_most_literal MixedMost MixedMostLiteral [1e-200, 1e200, 1.0];
    far far_literal Far FarLiteral [1.0, 1e200, 1e-200];
    farther farther_literal Farther FartherLiteral [1.0, 1e-200, 1e200];
}

/// `x₊` alone, and `x₊`, `dx₊/dx₀`, `dx₊/du`, the gradient and the Hessian of `λᵀx₊` by `x₀`, one after the other.
fn found<M: Dae<Shape = casados::Dims<2, 1, 1, 0, 3, 7, 3>>>() -> Vec<f64> {
    let mut irk = Irk::<M, Gauss<3>>::new(Options { steps: 3, ..Default::default() }).unwrap();
    let (x0, u, lambda) = (vector![1.0, 0.5], vector![0.3], vector![0.7, -0.4]);
    let simulated = irk.solve(&x0, &u, 0.4).unwrap().x;
    let step = irk.hessian(&x0, &u, 0.4, &lambda).unwrap();
    let (x, by_x0, by_u) = (step.x.as_slice(), step.dx_dx0.as_slice(), step.dx_du.as_slice());
    let parts = [simulated.as_slice(), x, by_x0, by_u, step.grad_x0.as_slice()];
    [parts.concat(), step.h_xx.as_slice().to_vec()].concat()
}

/// Rows multiplied by numbers that are no powers of two have entries that differ by a rounding. Three steps, each a system of
/// condition below ten, some ten roundings; all results are of size one.
fn compare(name: &str, found: &[f64], expected: &[f64]) {
    assert!(expected.len() == 16 && found.len() == 16);
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 300.0 * f64::EPSILON, "{name}: {found} {expected}");
    }
}
