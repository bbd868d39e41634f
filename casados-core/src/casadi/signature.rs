//! Names, sparsity patterns and sources of the outputs of `F`, `jac_F`, `adj1_F` and `jac_adj1_F`,
//! for one interval or for many, whose matrices are block-diagonal.
//!
//! Inputs of a derivative are those of the function, followed by its outputs, `out_…`, with empty
//! patterns: nothing depends on them, and CasADi does not compute unused values. Blocks of
//! Jacobians are ordered by output, then by input.

use super::function::{Port, Signature};
use super::second::Blocks;
use super::sparsity::{Dependence, Sparsity};
use alloc::vec::Vec;
use core::ffi::CStr;
use core::ops::Range;

/// The source of the numbers of an output.
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
    /// No numbers.
    Zero,
}

/// The index of a number in its source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry(pub usize);

/// Indices at equal distances, at least one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StridedPlaces {
    pub first: usize,
    pub stride: usize,
    pub count: usize,
}

/// The source of an output, and its entries.
#[derive(Clone, Debug)]
pub struct Output {
    /// The source.
    pub source: Source,
    /// The index of each non-zero in the source.
    pub entries: Vec<Entry>,
    /// The same indices as runs at equal distances, in order.
    pub runs: Vec<StridedPlaces>,
    /// Whether the output belongs to algebraic states.
    pub algebraic: bool,
}

impl Output {
    fn new(source: Source, entries: Vec<Entry>, algebraic: bool) -> Self {
        let mut runs: Vec<StridedPlaces> = Vec::new();
        for &Entry(place) in &entries {
            match runs.last_mut() {
                Some(run) if run.count == 1 && place > run.first => {
                    (run.stride, run.count) = (place - run.first, 2);
                }
                Some(run) if run.count > 1 && run.first + run.stride * run.count == place => run.count += 1,
                _ => runs.push(StridedPlaces { first: place, stride: 1, count: 1 }),
            }
        }
        Self { source, entries, runs, algebraic }
    }
}

/// The index of the output of algebraic states.
const ALGEBRAIC: usize = 1;
const INPUTS: [&CStr; 3] = [c"x0", c"u", c"p"];
const OUTPUTS: [&CStr; 3] = [c"xf", c"zf", c"qf"];
const NOMINAL: [&CStr; 3] = [c"out_xf", c"out_zf", c"out_qf"];
const SEEDS: [&CStr; 3] = [c"adj_xf", c"adj_zf", c"adj_qf"];
const GRADIENTS: [&CStr; 3] = [c"adj_x0", c"adj_u", c"adj_p"];
const NOMINAL_GRADIENTS: [&CStr; 3] = [c"out_adj_x0", c"out_adj_u", c"out_adj_p"];
const JACOBIANS: [[&CStr; 3]; 3] = [
    [c"jac_xf_x0", c"jac_xf_u", c"jac_xf_p"],
    [c"jac_zf_x0", c"jac_zf_u", c"jac_zf_p"],
    [c"jac_qf_x0", c"jac_qf_u", c"jac_qf_p"],
];
const HESSIANS: [[&CStr; 3]; 3] = [
    [c"jac_adj_x0_x0", c"jac_adj_x0_u", c"jac_adj_x0_p"],
    [c"jac_adj_u_x0", c"jac_adj_u_u", c"jac_adj_u_p"],
    [c"jac_adj_p_x0", c"jac_adj_p_u", c"jac_adj_p_p"],
];
const BY_NOMINAL: [[&CStr; 3]; 3] = [
    [c"jac_adj_x0_out_xf", c"jac_adj_x0_out_zf", c"jac_adj_x0_out_qf"],
    [c"jac_adj_u_out_xf", c"jac_adj_u_out_zf", c"jac_adj_u_out_qf"],
    [c"jac_adj_p_out_xf", c"jac_adj_p_out_zf", c"jac_adj_p_out_qf"],
];
const BY_SEEDS: [[&CStr; 3]; 3] = [
    [c"jac_adj_x0_adj_xf", c"jac_adj_x0_adj_zf", c"jac_adj_x0_adj_qf"],
    [c"jac_adj_u_adj_xf", c"jac_adj_u_adj_zf", c"jac_adj_u_adj_qf"],
    [c"jac_adj_p_adj_xf", c"jac_adj_p_adj_zf", c"jac_adj_p_adj_qf"],
];

/// Whether an input holds multipliers of an output.
pub fn is_seed(port: &Port) -> bool {
    SEEDS.contains(&port.name.as_ref())
}

/// The dimensions and patterns of one interval.
pub struct Shape<'a> {
    /// The number of intervals.
    pub count: usize,
    /// The inputs as ranges of `w`.
    pub inputs: [Range<usize>; 3],
    /// The states, algebraic states and integrals as ranges of `y`; empty ones are no outputs,
    /// except the states.
    pub outputs: [Range<usize>; 3],
    /// The pattern of `∂y/∂w`.
    pub value: &'a Dependence,
    /// The pattern of `∇²(λᵀy)`.
    pub hessian: &'a Dependence,
}

impl Shape<'_> {
    /// The layout of second derivatives.
    fn blocks(&self) -> Blocks {
        Blocks([0, 1, 2].map(|kind| self.inputs[kind].len()))
    }

    /// The number of elements of `w`.
    fn directions(&self) -> usize {
        self.inputs.iter().map(Range::len).sum()
    }

    /// The number of elements of `y`.
    fn rows(&self) -> usize {
        self.outputs.iter().map(Range::len).sum()
    }

    /// The existing outputs, with their ranges.
    fn existing_outputs(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        self.outputs.iter().cloned().enumerate().filter(|(kind, range)| *kind == 0 || !range.is_empty())
    }

    /// The four functions.
    pub fn functions(&self) -> [(Signature, Vec<Output>); 4] {
        let inputs = &self.inputs;
        let (kinds, outputs): (Vec<_>, Vec<_>) = self.existing_outputs().unzip();
        let outputs = &outputs;
        let of = |names: [&'static CStr; 3]| kinds.iter().map(|&kind| names[kind]).collect::<Vec<_>>();
        let [of_inputs, of_outputs] =
            [self.ports(&INPUTS, inputs, false), self.ports(&of(OUTPUTS), outputs, false)];
        let nominal = self.ports(&of(NOMINAL), outputs, true);
        let seeds = self.ports(&of(SEEDS), outputs, false);
        let gradients = self.ports(&GRADIENTS, inputs, false);
        let of_adjoint = [of_inputs.clone(), nominal.clone(), seeds].concat();
        let of_second = [of_adjoint.clone(), self.ports(&NOMINAL_GRADIENTS, inputs, true)].concat();
        let [value, gradient] = [
            self.vectors(Source::Value, outputs, self.rows(), |index| kinds[index] == ALGEBRAIC),
            self.vectors(Source::Gradient, inputs, self.directions(), |_| false),
        ];
        let [first, second] = [self.first(), self.hessian_outputs()];
        let whole =
            |inputs, (outputs, sources): (Vec<Port>, Vec<Output>)| (Signature { inputs, outputs }, sources);
        [
            whole(of_inputs.clone(), (of_outputs, value)),
            whole([of_inputs, nominal].concat(), first),
            whole(of_adjoint, (gradients, gradient)),
            whole(of_second, second),
        ]
    }

    /// Ports with one column for each interval.
    fn ports(&self, names: &[&'static CStr], ranges: &[Range<usize>], zero: bool) -> Vec<Port> {
        let sparsity = |length| Sparsity::new(length, self.count, |_, _| !zero);
        names.iter().zip(ranges).map(|(name, range)| Port::new(*name, sparsity(range.len()))).collect()
    }

    fn vectors(
        &self,
        source: Source,
        ranges: &[Range<usize>],
        length: usize,
        is_algebraic: impl Fn(usize) -> bool,
    ) -> Vec<Output> {
        let intervals = |range: &Range<usize>| {
            let of = |k: usize| range.clone().map(move |index| Entry(k * length + index));
            (0..self.count).flat_map(of).collect()
        };
        let outputs = ranges
            .iter()
            .enumerate()
            .map(|(index, range)| Output::new(source, intervals(range), is_algebraic(index)));
        outputs.collect()
    }

    /// The blocks of `∂y/∂w`.
    fn first(&self) -> (Vec<Port>, Vec<Output>) {
        let rows = self.rows();
        let mut blocks = (Vec::new(), Vec::new());
        for (kind, output) in self.existing_outputs() {
            for (name, input) in JACOBIANS[kind].iter().zip(&self.inputs) {
                let sparsity = self.value.block(output.clone(), input.clone());
                let algebraic = kind == ALGEBRAIC;
                let place =
                    BlockPlace { first: output.start + rows * input.start, row: 1, column: rows, algebraic };
                self.push(&mut blocks, name, &sparsity, Source::Jacobian, place);
            }
        }
        blocks
    }

    /// The blocks of the derivatives of `∇(λᵀy)`.
    fn hessian_outputs(&self) -> (Vec<Port>, Vec<Output>) {
        let rows = self.rows();
        let mut blocks = (Vec::new(), Vec::new());
        for (gradient, row) in self.inputs.iter().enumerate() {
            for (kind, (name, column)) in HESSIANS[gradient].iter().zip(&self.inputs).enumerate() {
                let sparsity = self.hessian.block(row.clone(), column.clone());
                let [first, row, column] = self.blocks().block_layout(gradient, kind);
                let place = BlockPlace { first, row, column, algebraic: false };
                self.push(&mut blocks, name, &sparsity, Source::Hessian, place);
            }
            for (kind, output) in self.existing_outputs() {
                let name = BY_NOMINAL[gradient][kind];
                let sparsity = Sparsity::zero(row.len(), output.len());
                let place = BlockPlace { first: 0, row: 0, column: 0, algebraic: false };
                self.push(&mut blocks, name, &sparsity, Source::Zero, place);
            }
            for (kind, output) in self.existing_outputs() {
                let name = BY_SEEDS[gradient][kind];
                let sparsity = self.value.transposed_block(output.clone(), row.clone());
                let algebraic = kind == ALGEBRAIC;
                let place =
                    BlockPlace { first: output.start + rows * row.start, row: rows, column: 1, algebraic };
                self.push(&mut blocks, name, &sparsity, Source::Jacobian, place);
            }
        }
        blocks
    }

    /// Adds a block for each interval.
    fn push(
        &self,
        blocks: &mut (Vec<Port>, Vec<Output>),
        name: &'static CStr,
        sparsity: &Sparsity,
        source: Source,
        place: BlockPlace,
    ) {
        // The number of elements of one interval.
        let length = match source {
            Source::Hessian => self.blocks().len(),
            _ => self.rows() * self.directions(),
        };
        let of = |k: usize| {
            let entries = sparsity.entries().iter();
            entries.map(move |&(i, j)| Entry(k * length + place.first + i * place.row + j * place.column))
        };
        let entries = (0..self.count).flat_map(of).collect();
        blocks.0.push(Port::new(name, sparsity.diagonal(self.count)));
        blocks.1.push(Output::new(source, entries, place.algebraic));
    }
}

/// The index of the first element of a block, the strides of rows and columns, and whether the
/// block belongs to algebraic states.
#[derive(Clone, Copy)]
struct BlockPlace {
    first: usize,
    row: usize,
    column: usize,
    algebraic: bool,
}
