//! The layout of the variables, constraints and matrices of a problem.
//!
//! Identified variables of several stages (shared controls, periodic states) are one variable of
//! the program, at the place of the first. The variables of all stages are followed by slack
//! variables `e`, one for each soft side; the constraints of all stages by the soft bounds of
//! variables:
//!
//! ```text
//! lower ≤ x + e_lower − e_upper ≤ upper        e ≥ 0, at the cost linear · e + ½ quadratic · e²
//! ```

use super::entries::{EntryTerm, MatrixSum, Term};
use super::program::{Program, SoftBound};
use super::sparsity::Sparsity;
use crate::qp::{QpView, StageDims};
use alloc::vec;
use alloc::vec::Vec;

/// The layout of the variables, constraints and matrices of a problem.
#[derive(Default)]
pub struct Layout {
    pub dims: Vec<StageDims>,
    pub variables: usize,
    pub constraints: usize,
    /// The index of the variable for each state and control, stage by stage.
    pub columns: Vec<usize>,
    /// The number of constraint functions: all constraints but soft bounds of variables.
    pub functions: usize,
    slacks: Vec<Slack>,
    /// The variables with soft bounds.
    soft: Vec<usize>,
    pub jacobian: MatrixSum,
    /// The upper triangle of the Hessian.
    pub upper: MatrixSum,
    /// The full Hessian, and the indices of its entries in the upper triangle.
    pub hessian: Sparsity,
    pub mirrored: Vec<usize>,
    /// The bounds of variables, and of constraints.
    pub bounds: [Vec<[f64; 2]>; 2],
}

/// A slack variable that relaxes one side of a constraint.
struct Slack {
    variable: usize,
    row: usize,
    sign: f64,
    linear: f64,
    quadratic: f64,
}

/// A layout under construction.
struct LayoutBuilder {
    layout: Layout,
    jacobian: Vec<Term>,
    /// The terms of the upper triangle.
    hessian: Vec<Term>,
}

impl Layout {
    /// The layout of a program.
    pub fn new(program: &mut dyn Program) -> Self {
        let dims = program.dims();
        let (columns, variables) = columns(&dims, &program.couplings());
        let of_stages = dims
            .iter()
            .enumerate()
            .map(|(stage, stage_dims)| dims.get(stage + 1).map_or(0, |next| next.nx) + stage_dims.ng);
        let functions = of_stages.sum();
        let bounds = [vec![[f64::NEG_INFINITY, f64::INFINITY]; variables], vec![[0.0; 2]; functions]];
        let layout =
            Self { dims, variables, constraints: functions, columns, functions, bounds, ..Self::default() };
        let mut draft = LayoutBuilder { layout, jacobian: Vec::new(), hessian: Vec::new() };
        draft.stages(program);
        draft.add_bounds(program);
        let LayoutBuilder { mut layout, jacobian, hessian } = draft;
        let (n, m) = (layout.variables, layout.constraints);
        layout.jacobian = MatrixSum::new(m, n, jacobian);
        layout.upper = MatrixSum::new(n, n, hessian);
        (layout.hessian, layout.mirrored) = layout.upper.sparsity.symmetric();
        layout
    }

    /// Copies the variables to the states and controls of all stages.
    pub fn gather(&self, x: &[f64], to: &mut Vec<f64>) {
        to.clear();
        to.extend(self.columns.iter().map(|&column| x[column]));
    }

    /// Copies the states and controls of all stages to the variables, except slack variables.
    pub fn scatter(&self, from: &[f64], to: &mut [f64]) {
        for (&column, &value) in self.columns.iter().zip(from).rev() {
            to[column] = value;
        }
    }

    /// The penalty of the slack variables.
    pub fn penalty(&self, x: &[f64]) -> f64 {
        self.slacks.iter().fold(0.0, |sum, slack| {
            let e = x[slack.variable];
            sum + e * (slack.linear + 0.5 * slack.quadratic * e)
        })
    }

    /// Computes `g` from the ends of intervals and the values of constraints, at states and
    /// controls `v`.
    pub fn constraints(&self, x: &[f64], v: &[f64], ends: &[f64], to: &mut [f64]) {
        let last = self.dims.len().saturating_sub(1);
        let phi: usize = self.dims.iter().skip(1).map(|dims| dims.nx).sum();
        let (ends, values) = ends.split_at(phi.min(ends.len()));
        let (mut ends, mut values) = (ends.iter(), values.iter());
        let (mut rows, mut begin) = (to.iter_mut(), 0);
        for (stage, dims) in self.dims.iter().enumerate() {
            begin += dims.nx + dims.nu;
            if stage < last {
                for (to, (end, next)) in rows.by_ref().zip(ends.by_ref().zip(&v[begin..])).take(dims.nx) {
                    *to = end - next;
                }
            }
            for (to, value) in rows.by_ref().zip(values.by_ref()).take(dims.ng) {
                *to = *value;
            }
        }
        for (to, &variable) in rows.zip(&self.soft) {
            *to = x[variable];
        }
        for slack in &self.slacks {
            to[slack.row] += slack.sign * x[slack.variable];
        }
    }

    /// Computes `∇f`: the gradients of all stages, and of the penalties.
    pub fn gradient(&self, qp: &QpView<'_, f64>, x: &[f64], to: &mut [f64]) {
        to.fill(0.0);
        let mut columns = self.columns.iter();
        for stage in qp.stages() {
            let arrays = stage.arrays();
            for (gradient, &column) in arrays.gradient[..arrays.n].iter().zip(columns.by_ref()) {
                to[column] += gradient;
            }
        }
        for slack in &self.slacks {
            to[slack.variable] += slack.linear + slack.quadratic * x[slack.variable];
        }
    }
}

impl LayoutBuilder {
    /// Adds the entries of the matrices of all stages.
    fn stages(&mut self, program: &mut dyn Program) {
        let Layout { dims, columns, .. } = &self.layout;
        let (mut begin, mut row) = (0, 0);
        for (stage, &StageDims { nx, nu, ng, .. }) in dims.iter().enumerate() {
            let next = dims.get(stage + 1).map_or(0, |next| next.nx);
            let (n, rows) = (nx + nu, next + ng);
            let ld = crate::qp::padded_len::<f64>(n);
            let pattern = program.pattern(stage);
            for (j, &column) in columns[begin..begin + n].iter().enumerate() {
                for i in (0..rows).filter(|&i| pattern.jacobian.contains(i, j)) {
                    let slot = match i.checked_sub(next) {
                        None if j < nx => EntryTerm::Interval { stage, block: 0, index: i + j * next },
                        None => EntryTerm::Interval { stage, block: 1, index: i + (j - nx) * next },
                        Some(_) => EntryTerm::Node { stage, index: i * ld + j },
                    };
                    self.jacobian.push(([row + i, column], slot));
                }
                for i in (0..n).filter(|&i| columns[begin + i] <= column) {
                    let entry = [columns[begin + i], column];
                    let (one, other) = (i.min(j), i.max(j));
                    if pattern.interval.contains(i, j) {
                        let (block, index) = match (one.checked_sub(nx), other.checked_sub(nx)) {
                            (Some(one), Some(other)) => (4, one + other * nu),
                            (None, Some(other)) => (3, one + other * nx),
                            _ => (2, one + other * nx),
                        };
                        self.hessian.push((entry, EntryTerm::Interval { stage, block, index }));
                    }
                    if pattern.node.contains(i, j) {
                        self.hessian.push((entry, EntryTerm::Node { stage, index: one * ld + other }));
                    }
                }
            }
            for (i, &column) in columns[begin + n..].iter().take(next).enumerate() {
                self.jacobian.push(([row + i, column], EntryTerm::Constant(-1.0)));
            }
            begin += n;
            row += rows;
        }
    }

    /// Adds bounds, with slack variables for soft sides.
    fn add_bounds(&mut self, program: &dyn Program) {
        let (mut begin, mut row) = (0, 0);
        for stage in 0..self.layout.dims.len() {
            for limits in program.bounds(stage) {
                self.add_variable_bounds(self.layout.columns[begin], limits);
                begin += 1;
            }
            row += self.layout.dims.get(stage + 1).map_or(0, |next| next.nx);
            for limits in program.limits(stage) {
                self.layout.bounds[1][row] = limits.map(|limit| limit.value);
                self.slack(row, limits);
                row += 1;
            }
        }
    }

    /// Adds the bounds of a variable, as a row if a side is soft. For a variable of several stages
    /// the tightest bounds hold.
    fn add_variable_bounds(&mut self, variable: usize, limits: [SoftBound; 2]) {
        let none = [f64::NEG_INFINITY, f64::INFINITY];
        let (mut hard, mut soft) = (none, none);
        for (side, limit) in limits.iter().enumerate() {
            if limit.penalty.is_some() { soft[side] = limit.value } else { hard[side] = limit.value }
        }
        let [lower, upper] = &mut self.layout.bounds[0][variable];
        (*lower, *upper) = (lower.max(hard[0]), upper.min(hard[1]));
        if limits.iter().any(|limit| limit.penalty.is_some()) {
            let row = self.layout.constraints;
            self.layout.constraints += 1;
            self.layout.bounds[1].push(soft);
            self.layout.soft.push(variable);
            self.jacobian.push(([row, variable], EntryTerm::Constant(1.0)));
            self.slack(row, limits);
        }
    }

    /// Adds a slack variable for each soft side of a row.
    fn slack(&mut self, row: usize, limits: [SoftBound; 2]) {
        for (limit, sign) in limits.into_iter().zip([1.0, -1.0]) {
            let Some([linear, quadratic]) = limit.penalty else { continue };
            let variable = self.layout.variables;
            self.layout.variables += 1;
            self.layout.bounds[0].push([0.0, f64::INFINITY]);
            self.layout.slacks.push(Slack { variable, row, sign, linear, quadratic });
            self.jacobian.push(([row, variable], EntryTerm::Constant(sign)));
            if quadratic != 0.0 {
                self.hessian.push(([variable; 2], EntryTerm::Constant(quadratic)));
            }
        }
    }
}

/// The index of the variable for each state and control, and the number of variables: shared
/// controls are those of stage 0, periodic states of the last stage are those of the first.
fn columns(dims: &[StageDims], [periodic, shared]: &[Vec<usize>; 2]) -> (Vec<usize>, usize) {
    let last = dims.len().saturating_sub(1);
    let first = dims.first().map_or(0, |dims| dims.nx);
    let (mut columns, mut variables) = (Vec::new(), 0);
    for (stage, &StageDims { nx, nu, .. }) in dims.iter().enumerate() {
        for i in 0..nx + nu {
            let same = match i.checked_sub(nx) {
                None if stage == last && last > 0 && periodic.contains(&i) => Some(i),
                Some(control) if stage > 0 && shared.contains(&control) => Some(first + control),
                _ => None,
            };
            match same.and_then(|place| columns.get(place).copied()) {
                Some(column) => columns.push(column),
                None => {
                    columns.push(variables);
                    variables += 1;
                }
            }
        }
    }
    (columns, variables)
}
