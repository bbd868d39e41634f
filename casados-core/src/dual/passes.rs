//! Colouring: the variables that are differentiated in one evaluation.

use super::dependency_tracking::{DependencyTape, Tracked};
use alloc::vec;
use alloc::vec::Vec;

/// A colouring of the variables: no equation depends on two variables of one colour, so that one
/// evaluation, with all variables of a colour seeded, separates their derivatives. Pairs of colours
/// give second derivatives in the same way.
///
/// If the control flow of a model depends on its variables (a comparison, a value read), the
/// dependencies at one point do not hold at others. Then every variable has its own colour.
#[derive(Debug)]
pub struct Passes {
    /// The colour of each variable; `t` has none.
    colours: Vec<usize>,
    /// For each colour and row, the variable of that colour on which the row depends.
    columns: Vec<Vec<Option<usize>>>,
    /// Pairs of colours with a second derivative.
    pairs: Vec<(usize, usize)>,
}

impl Passes {
    /// Runs the model with dependency tracking. `variables` includes `t`.
    pub(super) fn colour_model(
        variables: usize,
        equations: usize,
        point: impl Fn(usize) -> f64,
        model: impl FnOnce(&dyn Fn(usize) -> Tracked, &mut dyn FnMut(usize, Tracked)),
    ) -> Self {
        let columns = variables - 1;
        let mut depends = vec![vec![false; columns]; equations];
        let tape = DependencyTape::record(variables, || {
            model(&|i| Tracked::variable(point(i), i), &mut |row, value: Tracked| {
                let depends_on = value.dependencies();
                if let Some(row) = depends.get_mut(row) {
                    row.iter_mut().enumerate().for_each(|(i, entry)| *entry = depends_on.contains(i));
                }
            });
        });
        if tape.depends_on_value() {
            depends.iter_mut().for_each(|row| row.fill(true));
        }
        let interacts = |a: usize, b: usize| tape.depends_on_value() || tape.interacts(a, b);
        Self::colour_greedily(columns, &depends, interacts)
    }

    /// Greedy colouring: each variable takes the first free colour.
    fn colour_greedily(
        variables: usize,
        depends: &[Vec<bool>],
        interacts: impl Fn(usize, usize) -> bool,
    ) -> Self {
        let mut colours = Vec::with_capacity(variables);
        let mut columns: Vec<Vec<Option<usize>>> = Vec::new();
        for variable in 0..variables {
            let free = |taken: &Vec<Option<usize>>| {
                taken.iter().zip(depends).all(|(taken, row)| taken.is_none() || !row[variable])
            };
            let colour = columns.iter().position(free).unwrap_or(columns.len());
            if colour == columns.len() {
                columns.push(vec![None; depends.len()]);
            }
            if let Some(taken) = columns.get_mut(colour) {
                for (taken, _) in taken.iter_mut().zip(depends).filter(|(_, row)| row[variable]) {
                    *taken = Some(variable);
                }
            }
            colours.push(colour);
        }
        let mut needed = vec![vec![false; columns.len()]; columns.len()];
        for a in 0..variables {
            for b in 0..variables {
                if interacts(a, b) && depends.iter().any(|row| row[a] && row[b]) {
                    needed[colours[a].min(colours[b])][colours[a].max(colours[b])] = true;
                }
            }
        }
        let pairs = (0..columns.len())
            .flat_map(|a| (a..columns.len()).map(move |b| (a, b)))
            .filter(|&(a, b)| needed[a][b])
            .collect();
        Self { colours, columns, pairs }
    }

    /// The number of evaluations for the Jacobian.
    #[must_use]
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// Whether there are no derivatives.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// The pairs of colours whose evaluations give the Hessian.
    #[must_use]
    pub fn pairs(&self) -> &[(usize, usize)] {
        &self.pairs
    }

    /// Whether a variable has this colour.
    pub(super) fn contains(&self, colour: usize, variable: usize) -> bool {
        self.colours.get(variable) == Some(&colour)
    }

    /// The variable of a colour on which an equation depends.
    pub(super) fn column(&self, colour: usize, row: usize) -> Option<usize> {
        *self.columns.get(colour)?.get(row)?
    }
}
