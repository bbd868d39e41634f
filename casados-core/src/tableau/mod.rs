//! Butcher tableaux and their properties.
//!
//! One step of a Runge-Kutta method with `S` stages:
//!
//! ```text
//! ξ_i = x_n + h Σ_j a_ij k_j        0 = f(k_i, ξ_i, u, z_i, p, t_n + c_i h)
//! x_{n+1} = x_n + h Σ_i b_i k_i
//! ```
//!
//! A method is a type with a tableau ([`Method`]): [`Gauss`], [`RadauIIA`], [`Rk4`], ...; or
//! [`Custom`], whose tableau is created by [`Tableau::new`] and passed to the constructor of the
//! integrator.

mod conditions;
mod explicit;
mod gauss;
mod interpolation;
mod radau;

pub use explicit::{Butcher6, DormandPrince5, DormandPrince8, Euler, Heun, Midpoint, Rk4};
pub use gauss::Gauss;
pub use radau::RadauIIA;

use core::fmt;

/// A Runge-Kutta method with `S` stages whose tableau is known at compile time.
///
/// ```
/// use casados::{Gauss, Method, RadauIIA};
///
/// /// The order of a method.
/// fn order<B: Method<S>, const S: usize>() -> usize { B::TABLEAU.order() }
///
/// assert_eq!((order::<Gauss<3>, 3>(), order::<RadauIIA<3>, 3>()), (6, 5));
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no tableau with {S} stages",
    label = "no such method",
    note = "`Gauss<S>` and `RadauIIA<S>` exist for S = 1..=9; a tableau of your own is `Custom<S>`, made by `Tableau::new`"
)]
pub trait Method<const S: usize>: 'static {
    /// The coefficients.
    const TABLEAU: Tableau<S>;
}

/// A method with `S` stages whose [`Tableau`] is passed to the constructor of the integrator.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// // The implicit midpoint rule.
/// let tableau = Tableau::new([[0.5]], [1.0], [0.5])?;
/// let mut irk = Irk::<Cart, Custom<1>>::with_tableau(Options::default(), tableau)?;
/// let x = irk.solve(&vector![0.0, 1.0], &vector![2.0], 0.5)?.x;
/// assert!((x - vector![0.75, 2.0]).norm() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Custom<const S: usize>;

/// The coefficients of a Runge-Kutta method with `S` stages.
///
/// ```
/// use casados::Tableau;
///
/// let heun = Tableau::new([[0.0, 0.0], [1.0, 0.0]], [0.5, 0.5], [0.0, 1.0])?;
/// assert_eq!(heun.order(), 2);
/// assert!(heun.is_explicit());
/// // Weights that do not sum up to one.
/// assert!(Tableau::new([[0.5]], [0.9], [0.5]).is_err());
/// # Ok::<(), casados::TableauError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tableau<const S: usize> {
    name: &'static str,
    order: usize,
    stage_order: usize,
    a: [[f64; S]; S],
    b: [f64; S],
    c: [f64; S],
}

impl<const S: usize> Tableau<S> {
    /// A published tableau with its published orders, which tests check.
    const fn published(
        name: &'static str,
        order: usize,
        stage_order: usize,
        a: [[f64; S]; S],
        b: [f64; S],
        c: [f64; S],
    ) -> Self {
        Self { name, order, stage_order, a, b, c }
    }

    /// Returns a user-defined tableau. Its orders are computed.
    ///
    /// # Errors
    /// [`TableauError`] if `S = 0`, if a coefficient is not finite, or if `c_i = Σ_j a_ij` or
    /// `Σ_i b_i = 1` is violated by more than the rounding of coefficients to `f64`: `(S + 1) ε`
    /// times the sum of the absolute values. Write `1.0 / 3.0`, not `0.3333`.
    pub fn new(a: [[f64; S]; S], b: [f64; S], c: [f64; S]) -> Result<Self, TableauError> {
        let mut tableau = Self { name: "custom", order: 0, stage_order: 0, a, b, c };
        tableau.check()?;
        tableau.order = tableau.computed_order();
        tableau.stage_order = tableau.computed_stage_order();
        Ok(tableau)
    }

    /// Returns the tableau with another name.
    #[must_use]
    pub const fn named(mut self, name: &'static str) -> Self {
        self.name = name;
        self
    }

    /// Name of the method.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }
    /// `a_ij`, in row-major order.
    #[must_use]
    pub const fn a(&self) -> &[[f64; S]; S] {
        &self.a
    }
    /// The weights `b_i`.
    #[must_use]
    pub const fn b(&self) -> &[f64; S] {
        &self.b
    }
    /// The nodes `c_i`.
    #[must_use]
    pub const fn c(&self) -> &[f64; S] {
        &self.c
    }
    /// Order of convergence for ordinary differential equations. For a user-defined tableau it is
    /// exact up to 10; above that it is the order that the simplifying assumptions `B`, `C`, `D`
    /// guarantee.
    #[must_use]
    pub const fn order(&self) -> usize {
        self.order
    }
    /// The largest `q` with `B(q)` and `C(q)`: order of the stage values.
    #[must_use]
    pub const fn stage_order(&self) -> usize {
        self.stage_order
    }

    /// Whether `a_ij = 0` for `j ≥ i`: stages are computed one after the other.
    #[must_use]
    pub const fn is_explicit(&self) -> bool {
        self.first_implicit_stage().is_none()
    }

    /// Returns the first stage that depends on itself or a later one.
    pub(crate) const fn first_implicit_stage(&self) -> Option<usize> {
        let mut i = 0;
        while i < S {
            let mut j = i;
            while j < S {
                if self.a[i][j] != 0.0 {
                    return Some(i);
                }
                j += 1;
            }
            i += 1;
        }
        None
    }

    /// Whether the last stage is the end of the step: `a_si = b_i`.
    #[must_use]
    pub const fn is_stiffly_accurate(&self) -> bool {
        let mut j = 0;
        while j < S {
            if self.a[S - 1][j] != self.b[j] {
                return false;
            }
            j += 1;
        }
        S > 0
    }

    /// Whether the method preserves quadratic invariants: `b_i a_ij + b_j a_ji = b_i b_j` to
    /// rounding.
    #[must_use]
    pub const fn is_symplectic(&self) -> bool {
        let (a, b) = (&self.a, &self.b);
        let mut i = 0;
        while i < S {
            let mut j = 0;
            while j <= i {
                let (p, q, r) = (b[i] * a[i][j], b[j] * a[j][i], b[i] * b[j]);
                // Each product carries the rounding errors of two factors and its own.
                let bound = 2.0 * f64::EPSILON * (p.abs() + q.abs() + r.abs());
                if (p + q - r).abs() > bound {
                    return false;
                }
                j += 1;
            }
            i += 1;
        }
        true
    }

    /// Whether the method is the collocation method of its nodes: they are distinct, and `C(S)`
    /// holds. Then its stages define a polynomial of degree `S`; see [`Tableau::weights`].
    #[must_use]
    pub const fn is_collocation(&self) -> bool {
        let mut i = 0;
        while i < S {
            let mut j = 0;
            while j < i {
                if self.c[i] == self.c[j] {
                    return false;
                }
                j += 1;
            }
            i += 1;
        }
        self.stage_order >= S
    }
}

/// The reason why a user-defined tableau is invalid.
///
/// ```
/// # use casados::{Tableau, TableauError};
/// // Nodes have to be sums of rows, and weights sum up to one.
/// let node = Tableau::new([[0.5]], [1.0], [0.4]);
/// assert!(matches!(node, Err(TableauError::RowSum { stage: 0, sum: 0.5, node: 0.4 })));
/// let weight = Tableau::new([[f64::NAN]], [1.0], [0.5]);
/// println!("{}", weight.unwrap_err());
/// ```
#[derive(Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum TableauError {
    /// There are no stages.
    Empty,
    /// A coefficient is infinite or NaN.
    NotFinite,
    /// `c_i ≠ Σ_j a_ij`
    RowSum {
        /// Index `i` of the stage, from 0.
        stage: usize,
        /// `Σ_j a_ij`
        sum: f64,
        /// `c_i`
        node: f64,
    },
    /// `Σ_i b_i ≠ 1`
    WeightSum {
        /// `Σ_i b_i`
        sum: f64,
    },
}

impl fmt::Display for TableauError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str("a tableau needs at least one stage"),
            Self::NotFinite => f.write_str("a coefficient of the tableau is not finite"),
            Self::RowSum { stage, sum, node } => {
                write!(f, "row {stage} of A sums to {sum:e}, but c[{stage}] = {node:e}")
            }
            Self::WeightSum { sum } => write!(f, "the weights b sum to {sum:e} instead of 1"),
        }
    }
}

debug_is_display!(TableauError);

impl core::error::Error for TableauError {}
