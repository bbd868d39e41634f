//! The polynomial through the stages: dense output and extrapolation of collocation methods.

use super::{Gauss, Method, Tableau};

impl<const S: usize> Tableau<S> {
    /// The Lagrange polynomials of the nodes at `theta`:
    /// `ℓ_i(θ) = Π_{j≠i} (θ − c_j) / (c_i − c_j)`.
    ///
    /// `Σ_i ℓ_i(θ) y_i` is the polynomial of degree `S − 1` through the stage values `y_i`; `θ` is
    /// the time since the start of the step over `h`, and may lie outside `[0, 1]`. The product
    /// form is accurate to a few roundings for every `θ`. Not finite if two nodes are equal (see
    /// [`Tableau::is_collocation`]).
    #[must_use]
    pub fn lagrange(&self, theta: f64) -> [f64; S] {
        core::array::from_fn(|i| {
            let mut product = 1.0;
            for j in 0..S {
                if j != i {
                    product *= (theta - self.c[j]) / (self.c[i] - self.c[j]);
                }
            }
            product
        })
    }

    /// `b_i(θ) = ∫₀^θ ℓ_i`: the collocation polynomial is `x(θ) = x_n + h Σ_i b_i(θ) k_i`.
    ///
    /// For collocation methods `b_j(c_i) = a_ij` and `b_j(1) = b_j`. The integral is a Gauss
    /// quadrature, exact up to rounding for `S ≤ 18`.
    #[must_use]
    pub fn weights(&self, theta: f64) -> [f64; S] {
        const FEW: Tableau<5> = Gauss::<5>::TABLEAU;
        const MANY: Tableau<9> = Gauss::<9>::TABLEAU;
        if S <= 10 { self.integrate(theta, &FEW) } else { self.integrate(theta, &MANY) }
    }

    fn integrate<const Q: usize>(&self, theta: f64, quadrature: &Tableau<Q>) -> [f64; S] {
        let mut sum = [0.0; S];
        for (weight, node) in quadrature.b.iter().zip(&quadrature.c) {
            let lagrange = self.lagrange(theta * node);
            for (sum, l) in sum.iter_mut().zip(&lagrange) {
                *sum += weight * l;
            }
        }
        sum.map(|s| theta * s)
    }
}
