//! The polynomial through the stages: dense output and extrapolation of collocation methods.

use super::{Gauss, Method, Tableau};

/// `ℓ_i(θ)`
fn lagrange_polynomial(nodes: &[f64], i: usize, own: f64, theta: f64) -> f64 {
    let mut product = 1.0;
    for (j, other) in nodes.iter().enumerate() {
        if j != i {
            product *= (theta - other) / (own - other);
        }
    }
    product
}

// Functions on slices are compiled once for all numbers of stages.

/// See [`Tableau::lagrange`].
#[cfg_attr(feature = "std", inline(never))]
#[cfg_attr(not(feature = "std"), inline(always))]
fn lagrange(nodes: &[f64], theta: f64, values: &mut [f64]) {
    for (i, (own, value)) in nodes.iter().zip(values).enumerate() {
        *value = lagrange_polynomial(nodes, i, *own, theta);
    }
}

/// See [`Tableau::weights`].
#[cfg_attr(feature = "std", inline(never))]
#[cfg_attr(not(feature = "std"), inline(always))]
fn integrals(nodes: &[f64], theta: f64, values: &mut [f64]) {
    const TABLEAU_5_STAGES: Tableau<5> = Gauss::<5>::TABLEAU;
    const TABLEAU_9_STAGES: Tableau<9> = Gauss::<9>::TABLEAU;
    let (b, c): (&[f64], &[f64]) = if nodes.len() <= 10 {
        (&TABLEAU_5_STAGES.b, &TABLEAU_5_STAGES.c)
    } else {
        (&TABLEAU_9_STAGES.b, &TABLEAU_9_STAGES.c)
    };
    for (i, (own, value)) in nodes.iter().zip(values).enumerate() {
        let mut sum = 0.0;
        for (weight, node) in b.iter().zip(c) {
            sum += weight * lagrange_polynomial(nodes, i, *own, theta * node);
        }
        *value = theta * sum;
    }
}

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
        let mut values = [0.0; S];
        lagrange(&self.c, theta, &mut values);
        values
    }

    /// `b_i(θ) = ∫₀^θ ℓ_i`: the collocation polynomial is `x(θ) = x_n + h Σ_i b_i(θ) k_i`.
    ///
    /// For collocation methods `b_j(c_i) = a_ij` and `b_j(1) = b_j`. The integral is a Gauss
    /// quadrature, exact up to rounding for `S ≤ 18`.
    #[must_use]
    pub fn weights(&self, theta: f64) -> [f64; S] {
        let mut values = [0.0; S];
        integrals(&self.c, theta, &mut values);
        values
    }
}
