//! Names, patterns and sources of the outputs of `F`, `jac_F`, `adj1_F` and `jac_adj1_F`.
//!
//! Inputs of a derivative are those of the function, then its outputs, `out_…`, whose patterns are
//! empty here: nothing depends on them, and CasADi does not compute what nobody needs. Blocks of
//! Jacobians are ordered by output, then by input.

use super::function::{Port, Signature};
use super::sparsity::{Relation, Sparsity};
use alloc::vec::Vec;
use core::ffi::CStr;
use core::ops::Range;

/// Where the numbers of an output are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// `y`
    Value,
    /// `∂y/∂w`
    Jacobian,
    /// `∇(λᵀy)`
    Gradient,
    /// `∇²(λᵀy)`
    Hessian,
    /// There are none.
    Zero,
}

/// The place of a number in its source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry(pub usize);

/// Where the numbers of an output come from.
#[derive(Clone, Debug)]
pub struct Output {
    /// What they are part of.
    pub source: Source,
    /// The place of each non-zero there.
    pub entries: Vec<Entry>,
}

const INPUTS: [&CStr; 3] = [c"x0", c"u", c"p"];
const OUTPUTS: [&CStr; 2] = [c"xf", c"qf"];
const NOMINAL: [&CStr; 2] = [c"out_xf", c"out_qf"];
const SEEDS: [&CStr; 2] = [c"adj_xf", c"adj_qf"];
const GRADIENTS: [&CStr; 3] = [c"adj_x0", c"adj_u", c"adj_p"];
const NOMINAL_GRADIENTS: [&CStr; 3] = [c"out_adj_x0", c"out_adj_u", c"out_adj_p"];
const JACOBIANS: [[&CStr; 3]; 2] =
    [[c"jac_xf_x0", c"jac_xf_u", c"jac_xf_p"], [c"jac_qf_x0", c"jac_qf_u", c"jac_qf_p"]];
const HESSIANS: [[&CStr; 3]; 3] = [
    [c"jac_adj_x0_x0", c"jac_adj_x0_u", c"jac_adj_x0_p"],
    [c"jac_adj_u_x0", c"jac_adj_u_u", c"jac_adj_u_p"],
    [c"jac_adj_p_x0", c"jac_adj_p_u", c"jac_adj_p_p"],
];
const BY_NOMINAL: [[&CStr; 2]; 3] = [
    [c"jac_adj_x0_out_xf", c"jac_adj_x0_out_qf"],
    [c"jac_adj_u_out_xf", c"jac_adj_u_out_qf"],
    [c"jac_adj_p_out_xf", c"jac_adj_p_out_qf"],
];
const BY_SEEDS: [[&CStr; 2]; 3] = [
    [c"jac_adj_x0_adj_xf", c"jac_adj_x0_adj_qf"],
    [c"jac_adj_u_adj_xf", c"jac_adj_u_adj_qf"],
    [c"jac_adj_p_adj_xf", c"jac_adj_p_adj_qf"],
];

/// Whether an input holds multipliers of an output.
pub fn is_seed(port: &Port) -> bool {
    SEEDS.contains(&port.name)
}

/// The four functions: `inputs` and `outputs` are ranges of `w` and of `y`, `value` says where
/// `∂y/∂w` has entries, `hessian` where `∇²(λᵀy)` has.
pub fn functions(
    inputs: &[Range<usize>; 3],
    outputs: &[Range<usize>],
    value: &Relation,
    hessian: &Relation,
) -> [(Signature, Vec<Output>); 4] {
    let names = |names: &[&'static CStr], ranges: &[Range<usize>], zero: bool| -> Vec<Port> {
        let sparsity = |length| if zero { Sparsity::zero(length, 1) } else { Sparsity::vector(length) };
        names.iter().zip(ranges).map(|(name, range)| Port::new(name, sparsity(range.len()))).collect()
    };
    let [of_inputs, of_outputs] = [names(&INPUTS, inputs, false), names(&OUTPUTS, outputs, false)];
    let nominal = names(&NOMINAL, outputs, true);
    let seeds = names(&SEEDS, outputs, false);
    let gradients = names(&GRADIENTS, inputs, false);
    let of_adjoint = [of_inputs.clone(), nominal.clone(), seeds].concat();
    let of_second = [of_adjoint.clone(), names(&NOMINAL_GRADIENTS, inputs, true)].concat();

    let plain = |source, ranges: &[Range<usize>]| -> Vec<Output> {
        let entries = |range: &Range<usize>| range.clone().map(Entry).collect();
        ranges.iter().map(|range| Output { source, entries: entries(range) }).collect()
    };
    let [first, second] = [first(inputs, outputs, value), second(inputs, outputs, value, hessian)];
    let whole =
        |inputs, (outputs, sources): (Vec<Port>, Vec<Output>)| (Signature { inputs, outputs }, sources);
    [
        whole(of_inputs.clone(), (of_outputs, plain(Source::Value, outputs))),
        whole([of_inputs, nominal].concat(), first),
        whole(of_adjoint, (gradients, plain(Source::Gradient, inputs))),
        whole(of_second, second),
    ]
}

/// The blocks of `∂y/∂w`.
fn first(inputs: &[Range<usize>; 3], outputs: &[Range<usize>], value: &Relation) -> (Vec<Port>, Vec<Output>) {
    let rows = outputs.iter().map(Range::len).sum::<usize>();
    let mut blocks = (Vec::new(), Vec::new());
    for (names, output) in JACOBIANS.iter().zip(outputs) {
        for (name, input) in names.iter().zip(inputs) {
            let sparsity = value.block(output.clone(), input.clone());
            let entries = places(&sparsity, output.start + rows * input.start, 1, rows);
            push(&mut blocks, name, sparsity, Source::Jacobian, entries);
        }
    }
    blocks
}

/// The blocks of the derivatives of `∇(λᵀy)`.
fn second(
    inputs: &[Range<usize>; 3],
    outputs: &[Range<usize>],
    value: &Relation,
    hessian: &Relation,
) -> (Vec<Port>, Vec<Output>) {
    let directions = inputs.iter().map(Range::len).sum::<usize>();
    let rows = outputs.iter().map(Range::len).sum::<usize>();
    let mut blocks = (Vec::new(), Vec::new());
    for (gradient, row) in inputs.iter().enumerate() {
        for (name, column) in HESSIANS[gradient].iter().zip(inputs) {
            let sparsity = hessian.block(row.clone(), column.clone());
            let entries = places(&sparsity, row.start + directions * column.start, 1, directions);
            push(&mut blocks, name, sparsity, Source::Hessian, entries);
        }
        for (name, output) in BY_NOMINAL[gradient].iter().zip(outputs) {
            push(&mut blocks, name, Sparsity::zero(row.len(), output.len()), Source::Zero, Vec::new());
        }
        for (name, output) in BY_SEEDS[gradient].iter().zip(outputs) {
            let sparsity = value.transposed_block(output.clone(), row.clone());
            let entries = places(&sparsity, output.start + rows * row.start, rows, 1);
            push(&mut blocks, name, sparsity, Source::Jacobian, entries);
        }
    }
    blocks
}

/// Where the entries of a block are, whose first element is at `first`, with this distance from row
/// to row and from column to column.
fn places(sparsity: &Sparsity, first: usize, row: usize, column: usize) -> Vec<Entry> {
    sparsity.entries().iter().map(|&(i, j)| Entry(first + i * row + j * column)).collect()
}

fn push(
    blocks: &mut (Vec<Port>, Vec<Output>),
    name: &'static CStr,
    sparsity: Sparsity,
    source: Source,
    entries: Vec<Entry>,
) {
    blocks.0.push(Port::new(name, sparsity));
    blocks.1.push(Output { source, entries });
}
