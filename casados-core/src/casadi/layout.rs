//! Where the numbers of a problem are in its variables, constraints and matrices.

use super::sparsity::Sparsity;
use crate::qp::{QpView, StageDims};
use alloc::vec::Vec;

/// Where the numbers of a problem are in its variables, constraints and matrices.
pub struct Layout {
    pub dims: Vec<StageDims>,
    periodic: Vec<usize>,
    pub variables: usize,
    pub constraints: usize,
    /// In compressed columns, with the stage of each column.
    pub jacobian: Vec<Slot>,
    pub hessian: Vec<Slot>,
}

/// An entry of a matrix: where it is in the matrix of a stage, or its value.
#[derive(Clone, Copy)]
pub enum Slot {
    Entry { stage: usize, index: usize },
    Constant(f64),
}

impl Layout {
    /// The layout of stages of these dimensions, with the patterns of Jacobian and Hessian.
    pub fn new(dims: Vec<StageDims>, periodic: Vec<usize>) -> (Self, [Sparsity; 2]) {
        let last = dims.len().saturating_sub(1);
        let next = |stage: usize| dims.get(stage + 1).map_or(0, |dims| dims.nx);
        let variables = dims.iter().map(|dims| dims.nx + dims.nu).sum();
        let rows: usize = dims.iter().enumerate().map(|(stage, dims)| next(stage) + dims.ng).sum();
        let (mut jacobian, mut hessian) = (Vec::new(), Vec::new());
        let (mut of_jacobian, mut of_hessian) = (Vec::new(), Vec::new());
        let (mut column, mut row, mut before) = (0, 0, 0);
        for (stage, &StageDims { nx, nu, ng, .. }) in dims.iter().enumerate() {
            let n = nx + nu;
            let ld = crate::qp::pad::<f64>(n);
            for j in 0..n {
                if stage > 0 && j < nx {
                    of_jacobian.push((before + j, column + j));
                    jacobian.push(Slot::Constant(-1.0));
                }
                for i in 0..next(stage) + ng {
                    of_jacobian.push((row + i, column + j));
                    jacobian.push(Slot::Entry { stage, index: i * ld + j });
                }
                if (stage == 0 || stage == last)
                    && let Some(tie) = periodic.iter().position(|&state| state == j)
                {
                    of_jacobian.push((rows + tie, column + j));
                    jacobian.push(Slot::Constant(if stage == 0 { 1.0 } else { -1.0 }));
                }
                for i in 0..n {
                    of_hessian.push((column + i, column + j));
                    hessian.push(Slot::Entry { stage, index: i.min(j) * ld + i.max(j) });
                }
            }
            column += n;
            before = row;
            row += next(stage) + ng;
        }
        let constraints = rows + periodic.len();
        let patterns = [
            Sparsity::from_entries(constraints, variables, of_jacobian),
            Sparsity::from_entries(variables, variables, of_hessian),
        ];
        (Self { dims, periodic, variables, constraints, jacobian, hessian }, patterns)
    }

    /// `g` of the ends of intervals and the values of constraints.
    pub fn constraints(&self, x: &[f64], ends: &[f64], to: &mut [f64]) {
        let last = self.dims.len().saturating_sub(1);
        let phi: usize = self.dims.iter().skip(1).map(|dims| dims.nx).sum();
        let (ends, values) = ends.split_at(phi.min(ends.len()));
        let (mut ends, mut values) = (ends.iter(), values.iter());
        let (mut to, mut begin) = (to.iter_mut(), 0);
        for (stage, dims) in self.dims.iter().enumerate() {
            begin += dims.nx + dims.nu;
            if stage < last {
                for (to, (end, next)) in to.by_ref().zip(ends.by_ref().zip(&x[begin..])).take(dims.nx) {
                    *to = end - next;
                }
            }
            for (to, value) in to.by_ref().zip(values.by_ref()).take(dims.ng) {
                *to = *value;
            }
        }
        let end = begin - self.dims.last().map_or(0, |dims| dims.nx + dims.nu);
        for (to, &state) in to.zip(&self.periodic) {
            *to = x[state] - x[end + state];
        }
    }

    /// `∇f`: that of the QP at the point.
    pub fn gradient(&self, qp: &QpView<'_, f64>, x: &[f64], to: &mut Vec<f64>) {
        to.clear();
        let mut begin = 0;
        for stage in qp.stages() {
            let arrays = stage.arrays();
            let v = &x[begin..begin + arrays.n];
            begin += arrays.n;
            for i in 0..arrays.n {
                let product: f64 =
                    (0..arrays.n).map(|j| arrays.hessian[i.min(j) * arrays.ld + i.max(j)] * v[j]).sum();
                to.push(arrays.gradient[i] + product);
            }
        }
    }

    /// The entries of a matrix, out of the matrices of the stages.
    pub fn write<'a>(
        &self,
        qp: &QpView<'a, f64>,
        slots: &[Slot],
        choose: impl Fn((&'a [f64], &'a [f64])) -> &'a [f64],
        to: &mut Vec<f64>,
    ) {
        let matrices: Vec<&[f64]> = qp
            .stages()
            .map(|stage| {
                let arrays = stage.arrays();
                choose((arrays.matrix, arrays.hessian))
            })
            .collect();
        to.clear();
        to.extend(slots.iter().map(|slot| match *slot {
            Slot::Entry { stage, index } => matrices[stage][index],
            Slot::Constant(value) => value,
        }));
    }
}
