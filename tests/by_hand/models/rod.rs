//! A model with many states.

use super::{NONE, adjoint_of_jacobian};
use casados_core::model::{ArrayK, ArrayV, Elimination, Pattern, Structure, all, by_column, symmetric};
use casados_core::shape::Plain;
use casados_core::{Dae, Dims, Lanes};

/// A rod of `N` cells: `ẋ_i = x_{i−1} − 2 x_i + x_{i+1} − x_i³`, heated with `u` at its left end.
pub struct Rod;

/// Cells of the rod.
pub const N: usize = 150;
const ENTRIES: usize = 4 * N - 1;

/// Non-zeros of the Jacobian: `f_ẋ` is the identity, `f_x` tridiagonal.
const fn rod() -> ([u32; ENTRIES], [u32; ENTRIES]) {
    let (mut rows, mut columns) = ([0; ENTRIES], [0; ENTRIES]);
    let (mut i, mut e) = (0, N);
    while i < N {
        (rows[i], columns[i]) = (i as u32, i as u32);
        let mut c = if i == 0 { 0 } else { i - 1 };
        while c <= i + 1 && c < N {
            (rows[e], columns[e]) = (i as u32, (N + c) as u32);
            c += 1;
            e += 1;
        }
        i += 1;
    }
    columns[e] = 2 * N as u32;
    (rows, columns)
}
const fn diagonal() -> [u32; N] {
    let (mut rows, mut i) = ([0; N], 0);
    while i < N {
        rows[i] = (N + i) as u32;
        i += 1;
    }
    rows
}
static ROD: ([u32; ENTRIES], [u32; ENTRIES]) = rod();
static ROD_HESSIAN: [u32; N] = diagonal();

impl Dae for Rod {
    type Shape = Dims<N, 0, 1, 0, N, { 2 * N + 2 }, { N + 1 }>;
    type Jacobian<T: Plain> = [T; ENTRIES];
    type Hessian<T: Plain> = [T; N];
    type Factors<B: Plain> = [B; 0];
    const STRUCTURE: Structure = Structure {
        name: "rod",
        x: &["cell"; N],
        z: &[],
        u: &["u"],
        p: &[],
        jacobian: Pattern { rows: &ROD.0, columns: &ROD.1 },
        blocks: [0, N, ENTRIES - 1, ENTRIES - 1, ENTRIES, ENTRIES],
        by_column: &by_column::<{ 2 * N + 2 }, { ENTRIES - N }>(
            &Pattern { rows: &ROD.0, columns: &ROD.1 },
            N,
        ),
        constant: &[false; ENTRIES],
        hessian: Pattern { rows: &ROD_HESSIAN, columns: &ROD_HESSIAN },
        linear: &[false; N],
        linear_in_state: false,
        constant_matrix: false,
        autonomous: false,
        constant_rows: &[false; N],
        trivial: &[],
        quadratures: &[],
        directions: &all::<{ N + 1 }>(),
        column_of_direction: &all::<{ N + 1 }>(),
        curved: &ROD_HESSIAN,
        symmetric: &const {
            symmetric::<N, N>(&Pattern { rows: &ROD_HESSIAN, columns: &ROD_HESSIAN }, &ROD_HESSIAN)
        },
        diagonal_controls: &[],
        operations: NONE,
        elimination: Elimination::NONE,
        reduction: None,
    };
    fn residual<S: Lanes>(v: &ArrayV<Self, S::Cell>, f: &mut ArrayK<Self, S::Cell>) {
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (f.map(|cell| S::load(&cell)), f);
        let f = &mut values;
        let zero = S::from_f64(0.0);
        for i in 0..N {
            let x = v[N + i];
            let left = if i == 0 { v[2 * N] } else { v[N + i - 1] };
            let right = if i + 1 == N { zero } else { v[N + i + 1] };
            f[i] = v[i] - left - right + x + x + x * x * x;
        }
        cells.iter_mut().zip(f).for_each(|(cell, value)| value.store(cell));
    }
    fn jacobian_constants<S: Lanes>(_: &mut [S::Cell; ENTRIES]) {}
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        f: &mut ArrayK<Self, S::Cell>,
        j: &mut [S::Cell; ENTRIES],
    ) {
        Self::residual::<S>(v, f);
        let v = &v.map(|cell| S::load(&cell));
        let (mut values, cells) = (j.map(|cell| S::load(&cell)), j);
        let j = &mut values;
        for (e, j) in j.iter_mut().enumerate() {
            let (r, c) = Self::STRUCTURE.jacobian.at(e);
            *j = if c == r {
                S::from_f64(1.0)
            } else if c == N + r {
                S::from_f64(2.0) + S::from_f64(3.0) * v[c] * v[c]
            } else {
                S::from_f64(-1.0)
            };
        }
        cells.iter_mut().zip(j).for_each(|(cell, value)| value.store(cell));
    }
    fn adjoint<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        mu: &ArrayK<Self, S::Cell>,
        gradient: &mut ArrayV<Self, S::Cell>,
    ) {
        adjoint_of_jacobian::<Self, S>(v, mu, gradient, [v[0]; ENTRIES], [v[0]; N]);
    }
    fn hessian<S: Lanes>(v: &ArrayV<Self, S::Cell>, mu: &ArrayK<Self, S::Cell>, h: &mut [S::Cell; N]) {
        let v = &v.map(|cell| S::load(&cell));
        let mu = &mu.map(|cell| S::load(&cell));
        let (mut values, cells) = (h.map(|cell| S::load(&cell)), h);
        let h = &mut values;
        for i in 0..N {
            h[i] = mu[i] * S::from_f64(6.0) * v[N + i];
        }
        cells.iter_mut().zip(h).for_each(|(cell, value)| value.store(cell));
    }
}
