//! Algebraic states `ζ(x, u, p)` at the end of an interval, as functions of the state there, and
//! the chain rule:
//!
//! ```text
//! d(ζ)/dw = ζ_x X + (0, ζ_u, ζ_p)        ∇(νᵀζ) = Dᵀ ∇_(x, u, p)(νᵀζ)        ∇²(νᵀζ) = Dᵀ ∇²_(x, u, p)(νᵀζ) D + terms of ∇²x
//! ```
//!
//! with `X = dx/dw` and `D = (X, (0, I, 0), (0, 0, I))`. The terms of `∇²x` have the multipliers
//! `λ + ζ_xᵀν` of the state.

use super::interval::Consistent;
use super::second::Blocks;

/// The numbers of states, algebraic states and directions, and of rows of `∂y/∂w`.
#[derive(Clone, Copy, Debug)]
pub struct OutputDimensions {
    pub nx: usize,
    pub nz: usize,
    pub nw: usize,
    pub ny: usize,
}

/// Adds `ζ_xᵀν` to the multipliers of the state.
pub fn add_to_seed(sizes: OutputDimensions, zeta: &Consistent, nu: &[f64], lambda: &mut [f64]) {
    for (lambda, column) in lambda.iter_mut().zip(zeta.jacobian.chunks_exact(sizes.nz)) {
        *lambda += dot(column, nu);
    }
}

/// Adds the direct derivatives of `νᵀζ` with respect to controls and parameters to the gradient.
pub fn add_to_gradient(sizes: OutputDimensions, zeta: &Consistent, nu: &[f64], gradient: &mut [f64]) {
    let columns = gradient.iter_mut().zip(zeta.jacobian.chunks_exact(sizes.nz));
    for (gradient, column) in columns.skip(sizes.nx) {
        *gradient += dot(column, nu);
    }
}

/// Writes the rows of `ζ`, which follow those of the state.
pub fn write_jacobian(sizes: OutputDimensions, zeta: &Consistent, jacobian: &mut [f64]) {
    let OutputDimensions { nx, nz, ny, .. } = sizes;
    for (w, column) in jacobian.chunks_exact_mut(ny).enumerate() {
        let (x, rest) = column.split_at_mut(nx);
        for (i, to) in rest.iter_mut().take(nz).enumerate() {
            let direct = if w < nx { 0.0 } else { zeta.jacobian[i + nz * w] };
            *to = x.iter().enumerate().fold(direct, |sum, (j, x)| sum + zeta.jacobian[i + nz * j] * x);
        }
    }
}

/// Adds `Dᵀ ∇²(νᵀζ) D` to the Hessian; `X` are the first rows of the Jacobian.
pub fn add_to_hessian(
    sizes: OutputDimensions,
    blocks: Blocks,
    zeta: &Consistent,
    jacobian: &[f64],
    hessian: &mut [f64],
) {
    let OutputDimensions { nx, nw, ny, .. } = sizes;
    // The column of `D` for a direction.
    let column = |w: usize| {
        (0..nw).map(move |v| match v {
            _ if v < nx => jacobian[v + ny * w],
            _ => f64::from(u8::from(v == w)),
        })
    };
    for b in 0..nw {
        let row = |i| column(b).enumerate().map(|(j, d)| zeta.hessian[blocks.index(i, j)] * d).sum();
        let product: alloc::vec::Vec<f64> = (0..nw).map(row).collect();
        for a in 0..=b {
            let value: f64 = column(a).zip(&product).map(|(d, product)| d * product).sum();
            // Diagonal blocks have both triangles.
            let [place, mirrored] = [blocks.index(a, b), blocks.index(b, a)];
            hessian[place] += value;
            if place != mirrored {
                hessian[mirrored] += value;
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
