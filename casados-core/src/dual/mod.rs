//! Models over dual numbers: derivatives at run time, by the arithmetic of [`num_dual`].
//!
//! Such a model may be any Rust code: branches on data, tables, other crates. First derivatives use
//! forward duals, second ones hyper-duals. One evaluation gives the derivatives with respect to
//! several variables if no equation depends on two of them; see [`Passes`].
//!
//! The patterns of a dual model are dense, since its dependencies are known at run time only.

mod dependency_tracking;
mod passes;
mod structure;

pub use dependency_tracking::Tracked;
pub use num_dual::{DualNum, DualNumCopy};
pub use passes::Passes;
pub use structure::{hessian_pattern, jacobian_pattern};

use crate::model::{ArrayK, ArrayV, Dae};
use crate::scalar::{Lanes, Tangent};
use crate::shape::Shape;
use bytemuck::Zeroable;
use num_dual::{Dual64, HyperDual64};
use std::sync::OnceLock;
use structure::{hessian_entry, jacobian_entry};

/// A model over dual numbers: implemented by `#[dae]` and `#[ode]` for a function that is generic
/// over `DualNum`.
///
/// ```
/// use casados::dual::{DualModel, DualNum};
/// use casados::prelude::*;
///
/// /// The rate is a series that stops where its terms are small: more than the attributes read.
/// #[ode]
/// fn decay<T: DualNum<Primitive = f64> + Copy>(x: [T; 1]) -> [T; 1] {
///     let (mut sum, mut term, mut k) = (T::zero(), T::one(), 1.0);
///     while term.re().abs() > 1e-17 {
///         sum += term;
///         term *= x[0] / k;
///         k += 1.0;
///     }
///     [-sum]
/// }
///
/// fn is_dual<M: DualModel>() {}
/// is_dual::<Decay>();
/// // ẋ = −exp(x) from zero: x = −ln(1 + t), and its derivative by the start is 1 / (1 + t).
/// let mut irk = Irk::<Decay, Gauss<4>>::new(Options { steps: 4, ..Options::default() })?;
/// let end = irk.forward(&nalgebra::vector![0.0], &nalgebra::vector![], 1.0)?;
/// assert!((end.x[0] + 2.0_f64.ln()).abs() < 1e-9 && (end.dx_dx0[0] - 0.5).abs() < 1e-9);
/// # Ok::<(), casados::Error>(())
/// ```
pub trait DualModel: Dae {
    /// Evaluates the residual: reads variables by their index in `(ẋ, x, z, u, p, t)` and passes
    /// the equations to `equation`.
    fn evaluate<T>(variable: impl Fn(usize) -> T, equation: impl FnMut(usize, T))
    where
        T: DualNum<Primitive = f64> + DualNumCopy;

    /// Storage of the passes of this model.
    fn passes() -> &'static OnceLock<Passes>;
}

/// The passes of a model, computed on its first differentiation. They are independent of the point:
/// a model whose control flow depends on its variables gets dense passes.
fn colouring<M: DualModel>(point: impl Fn(usize) -> f64) -> &'static Passes {
    M::passes().get_or_init(|| {
        Passes::colour_model(M::Shape::NV, M::Shape::NK, point, |variable, equation| {
            M::evaluate::<Tracked>(variable, equation);
        })
    })
}

/// `f(v)`
pub fn residual<M: DualModel, S: Lanes>(v: &ArrayV<M, S::Cell>, f: &mut ArrayK<M, S::Cell>) {
    for lane in 0..S::LANES {
        M::evaluate::<f64>(|i| S::lane(&v[i], lane), |row, value| S::set_lane(&mut f[row], lane, value));
    }
}

/// `f(v)` and its Jacobian.
pub fn residual_jacobian<M: DualModel, S: Lanes>(
    v: &ArrayV<M, S::Cell>,
    f: &mut ArrayK<M, S::Cell>,
    jacobian: &mut M::Jacobian<S::Cell>,
) {
    residual::<M, S>(v, f);
    for entry in jacobian.as_mut() {
        S::from_f64(0.0).store(entry);
    }
    for lane in 0..S::LANES {
        jacobian_entries::<M>(
            |i| S::lane(&v[i], lane),
            |row, column, value| {
                S::set_lane(&mut jacobian[jacobian_entry::<M::Shape>(row, column)], lane, value);
            },
        );
    }
}

/// `f(v)` and `∂f/∂v v'`, with one dual number for each variable.
pub fn tangent<M: DualModel, S: Lanes>(v: &ArrayV<M, Tangent<S>>, f: &mut ArrayK<M, Tangent<S>>) {
    let cells = |number: S| {
        let mut cell: S::Cell = Zeroable::zeroed();
        number.store(&mut cell);
        cell
    };
    let parts = |number: Tangent<S>| [cells(number.value), cells(number.derivative)];
    for lane in 0..S::LANES {
        M::evaluate::<Dual64>(
            |i| {
                let [value, derivative] = parts(v[i]);
                Dual64::new(S::lane(&value, lane), S::lane(&derivative, lane))
            },
            |row, found| {
                let [mut value, mut derivative] = parts(f[row]);
                S::set_lane(&mut value, lane, found.re);
                S::set_lane(&mut derivative, lane, found.eps);
                f[row] = Tangent { value: S::load(&value), derivative: S::load(&derivative) };
            },
        );
    }
}

/// `∇(μᵀ f)`
pub fn adjoint<M: DualModel, S: Lanes>(
    v: &ArrayV<M, S::Cell>,
    mu: &ArrayK<M, S::Cell>,
    gradient: &mut ArrayV<M, S::Cell>,
) {
    for element in gradient.as_mut() {
        S::from_f64(0.0).store(element);
    }
    for lane in 0..S::LANES {
        jacobian_entries::<M>(
            |i| S::lane(&v[i], lane),
            |row, column, value| {
                let sum = S::lane(&gradient[column], lane) + S::lane(&mu[row], lane) * value;
                S::set_lane(&mut gradient[column], lane, sum);
            },
        );
    }
}

/// The lower triangle of `∇²(μᵀ f)`.
pub fn hessian<M: DualModel, S: Lanes>(
    v: &ArrayV<M, S::Cell>,
    mu: &ArrayK<M, S::Cell>,
    hessian: &mut M::Hessian<S::Cell>,
) {
    for entry in hessian.as_mut() {
        S::from_f64(0.0).store(entry);
    }
    for lane in 0..S::LANES {
        let passes = colouring::<M>(|i| S::lane(&v[i], lane));
        for &(first, second) in passes.pairs() {
            M::evaluate::<HyperDual64>(
                |i| {
                    let seed = |colour| f64::from(passes.contains(colour, i));
                    HyperDual64::new(S::lane(&v[i], lane), seed(first), seed(second), 0.0)
                },
                |row, value| {
                    if let (Some(a), Some(b)) = (passes.column(first, row), passes.column(second, row)) {
                        let entry = &mut hessian[hessian_entry(a, b)];
                        S::set_lane(
                            entry,
                            lane,
                            S::lane(entry, lane) + S::lane(&mu[row], lane) * value.eps1eps2,
                        );
                    }
                },
            );
        }
    }
}

/// Visits every structural non-zero of the Jacobian at one point.
fn jacobian_entries<M: DualModel>(point: impl Fn(usize) -> f64, mut entry: impl FnMut(usize, usize, f64)) {
    let passes = colouring::<M>(&point);
    for colour in 0..passes.len() {
        M::evaluate::<Dual64>(
            |i| Dual64::new(point(i), f64::from(passes.contains(colour, i))),
            |row, value| {
                if let Some(column) = passes.column(colour, row) {
                    entry(row, column, value.eps);
                }
            },
        );
    }
}
