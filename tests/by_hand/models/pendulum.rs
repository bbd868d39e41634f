//! A pendulum on a cart, differentiated with numbers `a + b ε₁ + c ε₂ + d ε₁ε₂`, `ε₁² = ε₂² = 0`.

use super::{NONE, adjoint_of_jacobian};
use casados_core::model::{ArrayK, ArrayV, Elimination, Pattern, Structure, columns, symmetric};
use casados_core::shape::Plain;
use casados_core::{Dae, Dims, Lanes};
use std::ops::{Add, Div, Mul, Sub};

const HESSIAN: Pattern = Pattern { rows: &[5, 7, 7, 8, 8, 8], columns: &[5, 5, 7, 5, 7, 8] };

/// `a + b ε₁ + c ε₂ + d ε₁ε₂`
#[derive(Clone, Copy)]
struct Hyper<S>([S; 4]);

impl<S: Lanes> Hyper<S> {
    fn number(a: f64) -> Self {
        Self::of(S::from_f64(a))
    }
    fn of(a: S) -> Self {
        let zero = S::from_f64(0.0);
        Self([a, zero, zero, zero])
    }
    /// `φ(a)` with `φ`, `φ′` and `φ″` at the value.
    fn chain(self, f: S, f1: S, f2: S) -> Self {
        let [_, b, c, d] = self.0;
        Self([f, f1 * b, f1 * c, f1 * d + f2 * b * c])
    }
    fn sin(self) -> Self {
        let (s, c) = self.0[0].sin_cos();
        self.chain(s, c, -s)
    }
    fn cos(self) -> Self {
        let (s, c) = self.0[0].sin_cos();
        self.chain(c, -s, -c)
    }
}
impl<S: Lanes> Add for Hyper<S> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self(core::array::from_fn(|i| self.0[i] + o.0[i]))
    }
}
impl<S: Lanes> Sub for Hyper<S> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self(core::array::from_fn(|i| self.0[i] - o.0[i]))
    }
}
impl<S: Lanes> Mul for Hyper<S> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, o.0);
        Self([a * e, a * f + b * e, a * g + c * e, a * h + b * g + c * f + d * e])
    }
}
impl<S: Lanes> Div for Hyper<S> {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let r = S::from_f64(1.0) / o.0[0];
        self * o.chain(r, -r * r, S::from_f64(2.0) * r * r * r)
    }
}

/// Accelerations of cart and pendulum at `(angle, rate, force)`.
fn accelerations<S: Lanes>([angle, omega, force]: [Hyper<S>; 3]) -> [Hyper<S>; 2] {
    let n = Hyper::number;
    let (mass, ball, length, g) = (n(1.0), n(0.1), n(0.8), n(9.81));
    let (s, c) = (angle.sin(), angle.cos());
    let denominator = mass + ball - ball * c * c;
    let centrifugal = ball * length * s * omega * omega;
    [
        (force - centrifugal + ball * g * c * s) / denominator,
        (force * c - centrifugal * c + (mass + ball) * g * s) / (length * denominator),
    ]
}

/// Variables `(ẋ, x, u, t)`, `x = (position, angle, velocity, rate)`.
pub struct Pendulum;

/// Accelerations with `ε₁` and `ε₂` on two of `(angle, rate, force)`.
fn perturbed<S: Lanes>(v: &[S; 10], first: usize, second: usize) -> [Hyper<S>; 2] {
    let mut arguments = [v[5], v[7], v[8]].map(Hyper::of);
    arguments[first].0[1] = S::from_f64(1.0);
    arguments[second].0[2] = S::from_f64(1.0);
    accelerations(arguments)
}

impl Dae for Pendulum {
    type Shape = Dims<4, 0, 1, 0, 4, 10, 5>;
    type Jacobian<T: Plain> = [T; 12];
    type Hessian<T: Plain> = [T; 6];
    type Factors<B: Plain> = [B; 0];
    const STRUCTURE: Structure = Structure {
        name: "pendulum",
        x: &["position", "angle", "velocity", "rate"],
        z: &[],
        u: &["force"],
        p: &[],
        jacobian: Pattern {
            rows: &[0, 1, 2, 3, 0, 1, 2, 2, 3, 3, 2, 3],
            columns: &[0, 1, 2, 3, 6, 7, 5, 7, 5, 7, 8, 8],
        },
        blocks: [0, 4, 10, 10, 12, 12],
        by_column: &[6, 8, 4, 5, 7, 9, 10, 11],
        constant: &[false; 12],
        hessian: HESSIAN,
        linear: &[true, true, false, false],
        linear_in_state: false,
        constant_matrix: false,
        autonomous: false,
        constant_rows: &[false; 4],
        trivial: &[],
        quadratures: &[0],
        directions: &[1, 2, 3, 4],
        column_of_direction: &columns::<5>(&[1, 2, 3, 4]),
        curved: &[5, 7, 8],
        symmetric: &symmetric::<3, 9>(&HESSIAN, &[5, 7, 8]),
        diagonal_controls: &[],
        operations: NONE,
        elimination: Elimination::NONE,
        reduction: None,
    };
    fn residual<S: Lanes>(v: &ArrayV<Self, S::Cell>, f: &mut ArrayK<Self, S::Cell>) {
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (f.map(|cell| S::load(&cell)), f);
        let f = &mut values;
        let [cart, ball] = accelerations([v[5], v[7], v[8]].map(Hyper::of));
        *f = [v[0] - v[6], v[1] - v[7], v[2] - cart.0[0], v[3] - ball.0[0]];
        cells.iter_mut().zip(f).for_each(|(cell, value)| value.store(cell));
    }
    fn jacobian_constants<S: Lanes>(_: &mut [S::Cell; 12]) {}
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        f: &mut ArrayK<Self, S::Cell>,
        j: &mut [S::Cell; 12],
    ) {
        Self::residual::<S>(v, f);
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (j.map(|cell| S::load(&cell)), j);
        let j = &mut values;
        let one = S::from_f64(1.0);
        let [angle, rate, force] = core::array::from_fn(|i| perturbed(v, i, i).map(|a| -a.0[1]));
        *j = [one, one, one, one, -one, -one, angle[0], rate[0], angle[1], rate[1], force[0], force[1]];
        cells.iter_mut().zip(j).for_each(|(cell, value)| value.store(cell));
    }
    fn adjoint<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        mu: &ArrayK<Self, S::Cell>,
        gradient: &mut ArrayV<Self, S::Cell>,
    ) {
        adjoint_of_jacobian::<Self, S>(v, mu, gradient, [v[0]; 12], [v[0]; 4]);
    }
    fn hessian<S: Lanes>(v: &ArrayV<Self, S::Cell>, mu: &ArrayK<Self, S::Cell>, h: &mut [S::Cell; 6]) {
        let v = &v.map(|cell| S::load(&cell));
        let mu = &mu.map(|cell| S::load(&cell));
        let (mut values, cells) = (h.map(|cell| S::load(&cell)), h);
        let h = &mut values;
        let pairs = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];
        for (h, (first, second)) in h.iter_mut().zip(pairs) {
            let [cart, ball] = perturbed(v, first, second);
            *h = -(mu[2] * cart.0[3] + mu[3] * ball.0[3]);
        }
        cells.iter_mut().zip(h).for_each(|(cell, value)| value.store(cell));
    }
}
