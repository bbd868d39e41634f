//! The order of a tableau: order conditions of rooted trees, and simplifying assumptions.
//!
//! J. C. Butcher, Implicit Runge-Kutta processes, Math. Comp. 18 (1964); E. Hairer, S. P. Nørsett,
//! G. Wanner, Solving Ordinary Differential Equations I, sections II.2 and II.7.

use super::{Tableau, TableauError};

/// Maximal order of the trees that are checked: 1205 trees, in milliseconds.
const MAX_TREE_ORDER: usize = 10;

/// A sum, and the sum of the absolute values of its terms, which scales its rounding error.
#[derive(Clone, Copy)]
struct TreeSum {
    value: f64,
    absolute: f64,
}

impl TreeSum {
    const UNIT_SUM: Self = Self { value: 1.0, absolute: 1.0 };

    fn of_terms(terms: impl Iterator<Item = f64>) -> Self {
        terms.fold(Self { value: 0.0, absolute: 0.0 }, |s, t| Self {
            value: s.value + t,
            absolute: s.absolute + t.abs(),
        })
    }

    /// Whether it equals `exact`, if every term carries at most `roundings` relative errors of `ε`.
    fn equals_to_rounding(self, exact: f64, roundings: usize) -> bool {
        let scale = self.absolute + exact.abs();
        (self.value - exact).abs() <= roundings as f64 * f64::EPSILON * scale
    }
}

impl<const S: usize> Tableau<S> {
    pub(super) fn check(&self) -> Result<(), TableauError> {
        if S == 0 {
            return Err(TableauError::Empty);
        }
        if !self.a.iter().flatten().chain(&self.b).chain(&self.c).all(|v| v.is_finite()) {
            return Err(TableauError::NotFinite);
        }
        for (stage, (row, &node)) in self.a.iter().zip(&self.c).enumerate() {
            let sum = TreeSum::of_terms(row.iter().copied());
            if !sum.equals_to_rounding(node, S + 1) {
                return Err(TableauError::RowSum { stage, sum: sum.value, node });
            }
        }
        let sum = TreeSum::of_terms(self.b.iter().copied());
        if sum.equals_to_rounding(1.0, S + 1) {
            Ok(())
        } else {
            Err(TableauError::WeightSum { sum: sum.value })
        }
    }

    /// Returns the order: from order conditions up to `MAX_TREE_ORDER`, beyond that from
    /// `B(p), C(q), D(r)` with `p ≤ q + r + 1` and `p ≤ 2q + 2`.
    pub(super) fn computed_order(&self) -> usize {
        let by_trees = (1..=MAX_TREE_ORDER).take_while(|&n| self.satisfies_trees(n)).count();
        if by_trees < MAX_TREE_ORDER {
            return by_trees;
        }
        let (p, q, r) = (self.quadrature_order(), self.stage_order_c(), self.stage_order_d());
        by_trees.max(p.min(q + r + 1).min(2 * q + 2))
    }

    pub(super) fn computed_stage_order(&self) -> usize {
        self.stage_order_c().min(self.quadrature_order())
    }

    /// The largest `p` with `B(p)`: `Σ_i b_i c_i^{k−1} = 1/k` for `k ≤ p`. At most `2S`.
    fn quadrature_order(&self) -> usize {
        let holds = |k: usize| {
            let sum = TreeSum::of_terms((0..S).map(|i| self.b[i] * integer_power(self.c[i], k - 1)));
            sum.equals_to_rounding(1.0 / k as f64, S + 2 * k)
        };
        (1..=2 * S).take_while(|&k| holds(k)).count()
    }

    /// The largest `q` with `C(q)`: `Σ_j a_ij c_j^{k−1} = c_i^k / k` for all `i`, `k ≤ q`. At most
    /// `S`.
    fn stage_order_c(&self) -> usize {
        let holds = |k: usize| {
            (0..S).all(|i| {
                let sum = TreeSum::of_terms((0..S).map(|j| self.a[i][j] * integer_power(self.c[j], k - 1)));
                sum.equals_to_rounding(integer_power(self.c[i], k) / k as f64, S + 2 * k)
            })
        };
        (1..=S).take_while(|&k| holds(k)).count()
    }

    /// The largest `r` with `D(r)`: `Σ_i b_i c_i^{k−1} a_ij = b_j (1 − c_j^k) / k` for all `j`,
    /// `k ≤ r`.
    fn stage_order_d(&self) -> usize {
        let holds = |k: usize| {
            (0..S).all(|j| {
                let sum = TreeSum::of_terms(
                    (0..S).map(|i| self.b[i] * integer_power(self.c[i], k - 1) * self.a[i][j]),
                );
                // The right-hand side cancels: its rounding error scales with b_j / k.
                let exact = self.b[j] * (1.0 - integer_power(self.c[j], k)) / k as f64;
                let scaled = TreeSum { absolute: sum.absolute + self.b[j].abs() / k as f64, ..sum };
                scaled.equals_to_rounding(exact, S + 2 * k + 1)
            })
        };
        (1..=S).take_while(|&k| holds(k)).count()
    }

    /// Whether `Σ_i b_i Φ_i(t) = 1/γ(t)` holds for all rooted trees with `nodes` nodes.
    fn satisfies_trees(&self, nodes: usize) -> bool {
        let mut tree = Tree::first_tree(nodes);
        loop {
            let (weight, density) = self.elementary_weight(&tree);
            // A term is a product of `nodes` coefficients, summed over S stages as often.
            if !weight.equals_to_rounding(1.0 / density, nodes * (S + 2)) {
                return false;
            }
            if !tree.next_tree() {
                return true;
            }
        }
    }

    /// The elementary weight `Σ_i b_i Φ_i(t)` and the density `γ(t)`.
    fn elementary_weight(&self, tree: &Tree) -> (TreeSum, f64) {
        // For each level the product of the vectors A Φ of the nodes that wait for their parent,
        // and the number of nodes below. In reverse preorder a node comes after all its
        // descendants.
        let mut product = [[TreeSum::UNIT_SUM; S]; MAX_TREE_ORDER + 1];
        let mut size = [0usize; MAX_TREE_ORDER + 1];
        let mut density = 1.0;
        for &level in tree.levels[1..tree.nodes].iter().rev() {
            let phi = core::mem::replace(&mut product[level + 1], [TreeSum::UNIT_SUM; S]);
            let nodes = 1 + core::mem::take(&mut size[level + 1]);
            density *= nodes as f64;
            size[level] += nodes;
            for (product, row) in product[level].iter_mut().zip(&self.a) {
                let factor = weighted_row_sum(row, &phi);
                product.value *= factor.value;
                product.absolute *= factor.absolute;
            }
        }
        (weighted_row_sum(&self.b, &product[1]), density * tree.nodes as f64)
    }
}

/// `Σ_j row_j φ_j`
fn weighted_row_sum<const S: usize>(row: &[f64; S], phi: &[TreeSum; S]) -> TreeSum {
    row.iter().zip(phi).fold(TreeSum { value: 0.0, absolute: 0.0 }, |s, (a, phi)| TreeSum {
        value: s.value + a * phi.value,
        absolute: s.absolute + a.abs() * phi.absolute,
    })
}

/// `baseⁿ`, without the elementary functions, which `no_std` does not have.
fn integer_power(base: f64, n: usize) -> f64 {
    (0..n).fold(1.0, |product, _| product * base)
}

/// A rooted tree: the level of each node in preorder, the root at level 0, canonical (largest)
/// among all orders of the children.
struct Tree {
    levels: [usize; MAX_TREE_ORDER],
    nodes: usize,
}

impl Tree {
    /// The first tree: a path.
    fn first_tree(nodes: usize) -> Self {
        Self { levels: core::array::from_fn(|i| i), nodes }
    }

    /// Moves to the next tree, if there is one. T. Beyer, S. M. Hedetniemi, Constant time
    /// generation of rooted trees, SIAM J. Comput. 9 (1980).
    fn next_tree(&mut self) -> bool {
        let levels = &mut self.levels;
        let Some(p) = (1..self.nodes).rev().find(|&i| levels[i] > 1) else { return false };
        let Some(parent) = (0..p).rev().find(|&i| levels[i] + 1 == levels[p]) else { return false };
        for i in p..self.nodes {
            levels[i] = levels[i - (p - parent)];
        }
        true
    }
}
