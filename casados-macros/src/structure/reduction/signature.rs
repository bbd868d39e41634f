//! The signature matrix of a model, and the number of differentiations of each equation.
//!
//! `σ_ij` is the order of the highest derivative of unknown `j` in equation `i`. With a
//! highest-value transversal, the offsets are the smallest `c, d ≥ 0` with
//!
//! ```text
//! d_j − c_i ≥ σ_ij        d_j − c_i = σ_ij on the transversal
//! ```
//!
//! Equation `i`, differentiated `c_i` times, contains at most the `d_j`-th derivative of unknown
//! `j` (J. D. Pryce, A simple structural analysis method for DAEs, BIT 41, 2001).

/// The entries `(unknown, σ)` of a row; others are −∞.
pub type Row = Vec<(usize, u32)>;

/// The offsets of equations and unknowns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Offsets {
    /// The number of differentiations of each equation.
    pub equations: Vec<u32>,
    /// The highest resulting derivative of each unknown.
    pub unknowns: Vec<u32>,
    /// The equation that determines each unknown.
    pub transversal: Vec<usize>,
}

/// The offsets; `None` without a transversal: then the equations do not determine the unknowns,
/// after any number of differentiations.
pub fn offsets(rows: &[Row]) -> Option<Offsets> {
    let transversal = transversal(rows)?;
    let mut matched = vec![(0, 0); rows.len()];
    for (unknown, &row) in transversal.iter().enumerate() {
        matched[row] = *rows[row].iter().find(|entry| entry.0 == unknown)?;
    }
    let (mut equations, mut unknowns) = (vec![0; rows.len()], vec![0; rows.len()]);
    loop {
        for (row, &c) in rows.iter().zip(&equations) {
            row.iter().for_each(|&(unknown, order)| unknowns[unknown] = unknowns[unknown].max(order + c));
        }
        let next: Vec<u32> = matched.iter().map(|&(unknown, order)| unknowns[unknown] - order).collect();
        if next == equations {
            return Some(Offsets { equations, unknowns, transversal });
        }
        equations = next;
    }
}

/// The row of each column in a highest-value transversal, by the Hungarian method with the costs
/// `1 − σ`: potentials of rows and columns, and shortest augmenting paths.
fn transversal(rows: &[Row]) -> Option<Vec<usize>> {
    const NONE: i64 = 1 << 40;
    let count = rows.len();
    // The last column is the start of a path.
    let mut row_of = vec![usize::MAX; count + 1];
    let (mut of_rows, mut of_columns) = (vec![0i64; count], vec![0i64; count + 1]);
    for start in 0..count {
        row_of[count] = start;
        let (mut distance, mut before) = (vec![NONE; count + 1], vec![count; count + 1]);
        let mut done = vec![false; count + 1];
        let mut column = count;
        while row_of[column] != usize::MAX {
            done[column] = true;
            let row = row_of[column];
            for &(next, order) in &rows[row] {
                let cost = 1 - i64::from(order) - of_rows[row] - of_columns[next];
                if !done[next] && cost < distance[next] {
                    (distance[next], before[next]) = (cost, column);
                }
            }
            let next = (0..count).filter(|&next| !done[next]).min_by_key(|&next| distance[next])?;
            let step = distance[next];
            if step >= NONE / 2 {
                return None;
            }
            for other in 0..=count {
                if done[other] {
                    of_rows[row_of[other]] += step;
                    of_columns[other] -= step;
                } else {
                    distance[other] -= step;
                }
            }
            column = next;
        }
        while column != count {
            row_of[column] = row_of[before[column]];
            column = before[column];
        }
    }
    row_of.pop();
    Some(row_of)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &[&[(usize, u32)]]) -> Vec<Row> {
        text.iter().map(|row| row.to_vec()).collect()
    }

    /// Two explicit states.
    #[test]
    fn index_one() {
        let found = offsets(&rows(&[&[(0, 1), (1, 0)], &[(1, 1), (0, 0)]]));
        let expected = Offsets { equations: vec![0, 0], unknowns: vec![1, 1], transversal: vec![0, 1] };
        assert_eq!(found, Some(expected));
    }

    /// The pendulum `q̇ = v`, `v̇ = −λ q − g`, `q·q = 1`: the constraint is differentiated twice,
    /// the equation of `q̇` once.
    #[test]
    fn pendulum() {
        let found = offsets(&rows(&[
            &[(0, 1), (2, 0)],
            &[(1, 1), (3, 0)],
            &[(2, 1), (0, 0), (4, 0)],
            &[(3, 1), (1, 0), (4, 0)],
            &[(0, 0), (1, 0)],
        ]));
        let found = found.expect("the pendulum has a transversal");
        assert_eq!(found.equations, [1, 1, 0, 0, 2]);
        assert_eq!(found.unknowns, [2, 2, 1, 1, 0]);
    }

    /// Two equations for one of two unknowns.
    #[test]
    fn singular() {
        assert_eq!(offsets(&rows(&[&[(0, 0)], &[(0, 1)]])), None);
    }

    /// The sum is the largest of all permutations, for random patterns.
    #[test]
    fn transversal_has_largest_sum() {
        let mut state = 1u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let mut solved = 0;
        for _ in 0..2000 {
            let count = 1 + random(5) as usize;
            let rows: Vec<Row> = (0..count)
                .map(|_| {
                    (0..count)
                        .filter_map(|column| match random(4) {
                            0 | 1 => None,
                            other => Some((column, other as u32 - 2)),
                        })
                        .collect()
                })
                .collect();
            let best = brute_force_transversal(&rows, 0, &mut vec![false; count]);
            let found = offsets(&rows);
            let sum = found.as_ref().map(|found| {
                let order = |(unknown, &row): (usize, &usize)| {
                    rows[row].iter().find(|entry| entry.0 == unknown).map_or(0, |entry| entry.1)
                };
                found.transversal.iter().enumerate().map(order).sum::<u32>()
            });
            assert_eq!(sum, best, "{rows:?}");
            let Some(found) = found else { continue };
            solved += 1;
            for (row, c) in rows.iter().zip(&found.equations) {
                assert!(row.iter().all(|&(unknown, order)| found.unknowns[unknown] >= c + order));
            }
        }
        assert!(solved > 500, "{solved}");
    }

    /// Tries all permutations.
    fn brute_force_transversal(rows: &[Row], row: usize, taken: &mut Vec<bool>) -> Option<u32> {
        let Some(entries) = rows.get(row) else { return Some(0) };
        let mut most = None;
        for &(column, order) in entries {
            if !std::mem::replace(&mut taken[column], true) {
                let rest = brute_force_transversal(rows, row + 1, taken).map(|rest| rest + order);
                most = most.max(rest);
                taken[column] = false;
            }
        }
        most
    }
}
