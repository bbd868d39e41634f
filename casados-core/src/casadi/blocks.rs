//! The inputs and outputs of the functions of integrators.

use super::cache::{IntervalResults, Part, equal};
use super::function::{Call, Port, Signature};
use super::second::Blocks;
use super::signature::{self, Output, Source, StridedPlaces};
use crate::model::Dae;
use crate::result::{Adjoint, Forward, Hessian};
use crate::shape::{Matrix, Shape};

/// Reads `(x₀, u, p)`, the first three inputs.
pub fn read_inputs(signature: &Signature, call: &dyn Call, to: &mut [f64]) {
    read(signature.inputs.iter().enumerate().take(3), call, to);
}

/// Reads the multipliers of the outputs, which follow the nominal outputs among the inputs of
/// adjoints.
pub fn read_multipliers(signature: &Signature, call: &dyn Call, to: &mut [f64]) {
    read(signature.inputs.iter().enumerate().filter(|(_, port)| signature::is_seed(port)), call, to);
}

/// Reads inputs one after the other.
fn read<'a>(inputs: impl Iterator<Item = (usize, &'a Port)>, call: &dyn Call, to: &mut [f64]) {
    let mut rest = to;
    for (input, port) in inputs {
        let length = port.sparsity.entries().len().min(rest.len());
        let (to, behind) = rest.split_at_mut(length);
        call.read(input, to);
        rest = behind;
    }
}

/// The results that the requested outputs require.
#[derive(Clone, Copy)]
pub struct WantedDerivatives {
    pub value: bool,
    pub jacobian: bool,
    pub gradient: bool,
    pub hessian: bool,
    /// Whether algebraic states are required, as values and in the Jacobian.
    pub algebraic: [bool; 2],
}

impl WantedDerivatives {
    /// The results required by a call.
    pub fn by(outputs: &[Output], call: &dyn Call) -> Self {
        let wants = |source| {
            outputs.iter().enumerate().any(|(index, output)| {
                output.source == source && !output.entries.is_empty() && call.wants(index)
            })
        };
        Self {
            value: wants(Source::Value),
            jacobian: wants(Source::Jacobian),
            gradient: wants(Source::Gradient),
            hessian: wants(Source::Hessian),
            algebraic: [Source::Value, Source::Jacobian].map(|source| {
                outputs.iter().enumerate().any(|(index, output)| {
                    let is_one = output.algebraic && output.source == source && !output.entries.is_empty();
                    is_one && call.wants(index)
                })
            }),
        }
    }

    /// Whether no output is requested.
    pub fn is_empty(&self) -> bool {
        !(self.value || self.jacobian || self.gradient || self.hessian)
    }

    /// Whether all of it is in the cache entry, for these multipliers.
    pub fn is_in<T>(&self, answer: &IntervalResults<T>, lambda: &[f64]) -> bool {
        let same = || answer.lambda.get().is_some_and(|known| equal(known, lambda));
        (!self.value || answer.value.get().is_some())
            && (!self.jacobian || answer.jacobian.get().is_some())
            && self.algebraic.iter().zip(&answer.algebraic).all(|(wanted, known)| !wanted || *known)
            && (!self.gradient || answer.gradient.get().is_some() && same())
            && (!self.hessian || answer.hessian.get().is_some() && same())
    }
}

/// The numbers of outputs: for each source several blocks, in order. Missing results are empty.
#[derive(Clone, Copy, Default)]
pub struct ResultBlocks<'a> {
    pub value: [&'a [f64]; 1],
    pub jacobian: [&'a [f64]; 3],
    pub gradient: [&'a [f64]; 3],
    pub hessian: [&'a [f64]; 6],
}

impl<'a> ResultBlocks<'a> {
    /// The blocks of a cache entry.
    pub fn of<T>(answer: &'a IntervalResults<T>) -> Self {
        let of = |part: &'a Part| part.get().map_or(&[][..], |values| values);
        Self {
            value: [of(&answer.value)],
            jacobian: [of(&answer.jacobian), &[], &[]],
            gradient: [of(&answer.gradient), &[], &[]],
            hessian: [of(&answer.hessian), &[], &[], &[], &[], &[]],
        }
    }

    /// The block that contains the element `place` of a source, and the index of its first element.
    fn block(&self, source: Source, place: usize) -> (&'a [f64], usize) {
        let blocks = match source {
            Source::Value => &self.value[..],
            Source::Jacobian => &self.jacobian,
            Source::Gradient => &self.gradient,
            Source::Hessian => &self.hessian,
            Source::Zero => &[],
        };
        let mut begin = 0;
        for block in blocks {
            if place < begin + block.len() {
                return (block, begin);
            }
            begin += block.len();
        }
        (&[], begin)
    }
}

/// Writes the requested outputs. The numbers of each output are in one block.
pub fn write(numbers: &ResultBlocks<'_>, outputs: &[Output], call: &mut dyn Call) {
    for (index, Output { source, runs, .. }) in outputs.iter().enumerate() {
        let Some(run) = runs.first() else { continue };
        let Some(to) = call.output(index) else { continue };
        let (block, begin) = numbers.block(*source, run.first);
        let mut rest = to;
        for &StridedPlaces { first, stride, count } in runs {
            let (to, behind) = rest.split_at_mut(count.min(rest.len()));
            rest = behind;
            let range = first.wrapping_sub(begin)..=(first + stride * (count - 1)).wrapping_sub(begin);
            let from = block.get(range).unwrap_or_default();
            if stride == 1 && from.len() == to.len() {
                to.copy_from_slice(from);
            } else if from.is_empty() {
                to.fill(f64::NAN);
            } else {
                let from = from.iter().step_by(stride);
                to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
            }
        }
    }
}

/// Copies blocks one after the other.
pub fn concatenate(blocks: &[&[f64]], to: &mut [f64]) {
    let mut rest = to;
    for block in blocks {
        let (to, behind) = rest.split_at_mut(block.len());
        to.copy_from_slice(block);
        rest = behind;
    }
}

/// The blocks of `∇(λᵀx)`.
pub fn adjoint_gradient_blocks<M: Dae>(result: &Adjoint<M>) -> [&[f64]; 3] {
    [result.grad_x0.as_slice(), result.grad_u.as_slice(), result.grad_p.as_slice()]
}

/// The blocks of `∇(λᵀx)`.
pub fn hessian_gradient_blocks<M: Dae>(result: &Hessian<M>) -> [&[f64]; 3] {
    [result.grad_x0.as_slice(), result.grad_u.as_slice(), result.grad_p.as_slice()]
}

/// Writes blocks of `count` rows, next to each other, to the rows from `first` on of a matrix with
/// `rows` rows.
pub fn rows(blocks: [&[f64]; 3], count: usize, first: usize, rows: usize, to: &mut [f64]) {
    if count > 0 && count == rows {
        concatenate(&blocks, to);
    } else if count > 0 {
        let columns = blocks.into_iter().flat_map(|block| block.chunks_exact(count));
        for (column, to) in columns.zip(to.chunks_exact_mut(rows)) {
            to[first..first + count].copy_from_slice(column);
        }
    }
}

/// Writes the rows of the states in a matrix of `ny` rows.
pub fn jacobian<M: Dae>(result: &Forward<M>, ny: usize, to: &mut [f64]) {
    rows(jacobian_blocks(result), M::Shape::NX, 0, ny, to);
}

/// The blocks of `∂x/∂(x₀, u, p)`.
pub fn jacobian_blocks<M: Dae>(result: &Forward<M>) -> [&[f64]; 3] {
    [result.dx_dx0.as_slice(), result.dx_du.as_slice(), result.dx_dp.as_slice()]
}

/// The layout of second derivatives of a model.
pub fn second<M: Dae>() -> Blocks {
    Blocks([M::Shape::NX, M::Shape::NU, M::Shape::NP])
}
