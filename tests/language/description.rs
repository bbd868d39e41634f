//! What models say about themselves, and whether the costs that they expect are those of the plan.
//!
//! The texts are in `description/`; `CASADOS_WRITE=1 cargo test --test language description`
//! writes them anew: read them before committing them, as somebody who sees the model for the first
//! time.

use casados::Dae;
use casados::model::{Cost, Structure};
use casados::prelude::*;
use std::cell::Cell;
use std::ops::{Add, Div, Mul, Sub};
use std::path::Path;

use crate::models::awe::Awe;
use crate::models::chain::Chain;
use crate::models::pendulum::Pendulum;

/// A tank with an outflow and a meter, linear but for the multiplication with the valve:
/// quadrature, algebraic state, parameter.
#[dae]
mod tank {
    pub struct State {
        pub level: f64,
        pub volume: f64,
    }

    pub fn tank(xdot: &State, x: &State, z: f64, u: f64, p: f64, t: f64) -> [f64; 3] {
        [xdot.level - t.cos() + z, xdot.volume - z, z - u * p * x.level]
    }
}

/// Compares with the text that is stored.
fn assert_stored_text<M: Dae>(file: &str) {
    let text = M::describe().to_string();
    for line in text.lines() {
        assert!(line.chars().count() <= 96, "{line}");
        assert_eq!(line, line.trim_end(), "a line ends in spaces");
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("language/description").join(file);
    if std::env::var_os("CASADOS_WRITE").is_some() {
        std::fs::write(&path, &text).expect("tests/language/description can be written");
    }
    let stored = std::fs::read_to_string(&path).expect("the text is there");
    assert!(text == stored, "{file} differs:\n{text}");
}

#[test]
fn description_of_a_pendulum() {
    assert_stored_text::<Pendulum>("pendulum.txt");
}

#[test]
fn description_of_a_chain() {
    assert_stored_text::<Chain<21>>("chain.txt");
}

#[test]
fn description_of_an_aircraft() {
    assert_stored_text::<Awe>("awe.txt");
}

#[test]
fn description_of_a_tank() {
    let structure = Tank::describe();
    assert!(structure.linear_in_state && !structure.is_explicit());
    // The valve may change from interval to interval, but not within one.
    assert!(structure.constant_matrix);
    assert_stored_text::<Tank>("tank.txt");
}

thread_local! {
    static OPERATIONS: Cell<u64> = const { Cell::new(0) };
}

/// A number that counts what is done with it.
#[derive(Clone, Copy, Debug)]
struct Counted(f64);

macro_rules! counted {
    ($($trait:ident $function:ident $operator:tt),*) => {$(
        impl $trait for Counted {
            type Output = Self;
            fn $function(self, other: Self) -> Self {
                OPERATIONS.set(OPERATIONS.get() + 1);
                Self(self.0 $operator other.0)
            }
        }
    )*};
}
counted!(Add add +, Sub sub -, Mul mul *, Div div /);

/// Operations of a computation.
fn count_operations<T>(computation: impl FnOnce() -> T) -> (T, u64) {
    OPERATIONS.set(0);
    let result = computation();
    (result, OPERATIONS.get())
}

type Matrix = Vec<Vec<Counted>>;

/// `a b`, without an addition to zero.
fn product_without_addition(a: &Matrix, b: &Matrix) -> Matrix {
    let column =
        |row: &Vec<Counted>, j: usize| (1..row.len()).fold(row[0] * b[0][j], |sum, k| sum + row[k] * b[k][j]);
    a.iter().map(|row| (0..b[0].len()).map(|j| column(row, j)).collect()).collect()
}

/// `t − a b`
fn subtract_product(t: &mut Matrix, a: &Matrix, b: &Matrix) {
    for (t, a) in t.iter_mut().zip(a) {
        for (j, t) in t.iter_mut().enumerate() {
            *t = a.iter().zip(b).fold(*t, |t, (a, b)| t - *a * b[j]);
        }
    }
}

/// Gauss-Jordan elimination in place; the blocks here need no pivoting.
fn block_inverse(a: &Matrix) -> Matrix {
    let mut a = a.clone();
    for k in 0..a.len() {
        let pivot = Counted(1.0) / a[k][k];
        a[k][k] = Counted(1.0);
        // The element itself becomes the reciprocal.
        (0..a.len()).for_each(|j| a[k][j] = if j == k { pivot } else { a[k][j] * pivot });
        let row = a[k].clone();
        for i in (0..a.len()).filter(|&i| i != k) {
            let factor = std::mem::replace(&mut a[i][k], Counted(0.0));
            for j in 0..row.len() {
                a[i][j] = if j == k { Counted(-(factor * row[j]).0) } else { a[i][j] - factor * row[j] };
            }
        }
    }
    a
}

/// Any matrix of the pattern of a model, eliminated by its plan: operations of the factorisation
/// and of a solve, and the largest error of a solution of which every element is one.
fn eliminate_by_plan(structure: &Structure, s: usize) -> (u64, u64, f64) {
    let plan = &structure.elimination;
    let n = plan.slot_of_equation.len();
    let mut blocks = vec![vec![vec![Counted(0.0); s]; s]; plan.slots.len()];
    let mut random = casados::testing::Random::new(7);
    for term in plan.assembly.iter().filter(|term| !term.is_fill()) {
        for (i, row) in blocks[term.block as usize].iter_mut().enumerate() {
            for (_, element) in row.iter_mut().enumerate().filter(|&(j, _)| term.order > 0 || i == j) {
                *element = Counted(0.1 * random.symmetric());
            }
        }
    }
    for pivot in plan.pivots {
        for (i, row) in blocks[pivot.block as usize].iter_mut().enumerate() {
            // Diagonally dominant, and an identity where the plan says so.
            if pivot.identity {
                row.fill(Counted(0.0));
            }
            row[i].0 += if pivot.identity { 1.0 } else { 8.0 };
        }
    }
    // Rows of M · 1, by slots.
    let mut rows = vec![vec![vec![Counted(0.0)]; s]; n];
    let mut add = |slot: usize, block: &Matrix| {
        for (row, block) in rows[slot].iter_mut().zip(block) {
            row[0].0 += block.iter().map(|element| element.0).sum::<f64>();
        }
    };
    for pivot in plan.pivots {
        add(pivot.slot as usize, &blocks[pivot.block as usize]);
        pivot.lower().for_each(|lower| add(plan.slots[lower] as usize, &blocks[lower]));
        pivot.upper().for_each(|upper| add(pivot.slot as usize, &blocks[upper]));
    }

    let ((), factorisation) = count_operations(|| {
        let mut updates = plan.updates.iter();
        for pivot in plan.pivots {
            if !pivot.identity {
                let inverse = block_inverse(&blocks[pivot.block as usize]);
                pivot
                    .lower()
                    .for_each(|lower| blocks[lower] = product_without_addition(&blocks[lower], &inverse));
                blocks[pivot.block as usize] = inverse;
            }
            for lower in pivot.lower() {
                for (upper, target) in pivot.upper().zip(&mut updates) {
                    let (left, right) = (blocks[lower].clone(), blocks[upper].clone());
                    subtract_product(&mut blocks[target.block as usize], &left, &right);
                }
            }
        }
        assert!(updates.next().is_none());
    });
    let ((), solve) = count_operations(|| {
        for pivot in plan.pivots {
            let packet = rows[pivot.slot as usize].clone();
            pivot.lower().for_each(|lower| {
                subtract_product(&mut rows[plan.slots[lower] as usize], &blocks[lower], &packet);
            });
        }
        for pivot in plan.pivots.iter().rev() {
            for upper in pivot.upper() {
                let other = rows[plan.slots[upper] as usize].clone();
                subtract_product(&mut rows[pivot.slot as usize], &blocks[upper], &other);
            }
            if !pivot.identity {
                rows[pivot.slot as usize] =
                    product_without_addition(&blocks[pivot.block as usize], &rows[pivot.slot as usize]);
            }
        }
    });
    let found = plan.pivots.iter().map(|pivot| &rows[pivot.slot as usize]);
    let error = found.flatten().map(|row| (row[0].0 - 1.0).abs()).fold(0.0, f64::max);
    (factorisation, solve, error)
}

/// Costs of factors and solves are what an elimination by the plan takes, operation by operation.
#[test]
fn costs_of_the_plan() {
    for structure in [Pendulum::describe(), Chain::<21>::describe(), Awe::describe(), Tank::describe()] {
        for s in 1..=5 {
            let Cost { factorisation, solve, .. } = structure.cost(s);
            let (counted, counted_solve, error) = eliminate_by_plan(structure, s);
            assert_eq!((factorisation, solve), (counted, counted_solve), "{} s = {s}", structure.name);
            // Dominant diagonals: a condition of some ten, some hundred roundings.
            assert!(error < 1e3 * f64::EPSILON, "{}: {error}", structure.name);
        }
    }
}

/// LU factors of a matrix of `n` rows and a solve with them, operation by operation: the cost
/// without a plan.
#[test]
fn costs_of_dense_elimination() {
    let structure = Structure { elimination: casados::__private::Elimination::NONE, ..*Tank::describe() };
    for s in 1..=4 {
        let n = 3 * s;
        let mut a: Matrix = (0..n)
            .map(|i| (0..n).map(|j| Counted(if i == j { 8.0 } else { 1.0 / (1 + i + j) as f64 })).collect())
            .collect();
        let ((), factorisation) = count_operations(|| {
            for k in 0..n {
                for i in k + 1..n {
                    let factor = a[i][k] / a[k][k];
                    a[i][k] = factor;
                    let (above, below) = a.split_at_mut(i);
                    for (entry, pivot) in below[0].iter_mut().zip(&above[k]).skip(k + 1) {
                        *entry = *entry - factor * *pivot;
                    }
                }
            }
        });
        let mut b = vec![Counted(1.0); n];
        let ((), solve) = count_operations(|| {
            for i in 0..n {
                b[i] = (0..i).fold(b[i], |sum, k| sum - a[i][k] * b[k]);
            }
            for i in (0..n).rev() {
                b[i] = (i + 1..n).fold(b[i], |sum, k| sum - a[i][k] * b[k]) / a[i][i];
            }
        });
        let cost = structure.cost(s);
        assert_eq!((cost.factorisation, cost.solve), (factorisation, solve));
    }
}

/// The cost of everything else, for the tank by hand: nx = 2, nk = 3, s stages.
#[test]
fn costs_of_the_tank() {
    let structure = Tank::describe();
    // f_x has one entry, f_u and f_p one each; the volume influences nobody.
    assert_eq!(structure.directions, [0, 2, 3]);
    assert_eq!(structure.quadratures, [1]);
    let operations = structure.operations;
    for s in [1, 3] {
        let cost = structure.cost(s as usize);
        assert_eq!(cost.residual, s * u64::from(operations.residual));
        let matrix = s * s;
        let newton =
            2 * s * s * 2 + cost.residual_jacobian + matrix + cost.factorisation + cost.solve + 3 * s;
        assert_eq!(cost.iteration, newton);
        assert_eq!(cost.forward, 3 * (2 * s + cost.solve + 4 * s) + 2 * s);
        assert_eq!(cost.adjoint, 2 * s + cost.solve + 2 * s * 3);
        // Second derivatives by (x₀, u), (x₀, p) and (u, p): three curved variables, one of them a
        // state.
        assert_eq!((structure.hessian.len(), structure.curved), (3, &[2, 5, 6][..]));
        let second = s * u64::from(operations.hessian) + 3 * 2 * s * s + 3 * 2 * s * 6 + 6 * 2 * s * 3;
        assert_eq!(cost.hessian, second);
    }
}
