//! A function as CasADi sees it: names and patterns of its inputs and outputs.

use super::sparsity::Sparsity;
use alloc::borrow::Cow;
use alloc::vec::Vec;
use core::ffi::CStr;

/// An input or an output.
#[derive(Clone, Debug)]
pub struct Port {
    /// Its name.
    pub name: Cow<'static, CStr>,
    /// Its non-zeros.
    pub sparsity: Sparsity,
}

impl Port {
    /// A port of this name with these non-zeros.
    pub fn new(name: impl Into<Cow<'static, CStr>>, sparsity: Sparsity) -> Self {
        Self { name: name.into(), sparsity }
    }
}

/// Inputs and outputs of a function.
#[derive(Clone, Debug, Default)]
pub struct Signature {
    /// What it takes.
    pub inputs: Vec<Port>,
    /// What it gives.
    pub outputs: Vec<Port>,
}

/// The arguments of a call and the places of its results.
pub trait Call {
    /// Copies the non-zeros of an input; zeros if it is not given.
    fn read(&self, input: usize, to: &mut [f64]);
    /// Whether an output is wanted.
    fn wants(&self, output: usize) -> bool;
    /// The non-zeros of an output, if it is wanted.
    fn output(&mut self, output: usize) -> Option<&mut [f64]>;
}
