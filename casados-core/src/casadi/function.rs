//! The signature of a function for CasADi: names and patterns of its inputs and outputs.

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
    /// A port with this name and these non-zeros.
    pub fn new(name: impl Into<Cow<'static, CStr>>, sparsity: Sparsity) -> Self {
        Self { name: name.into(), sparsity }
    }
}

/// The inputs and outputs of a function.
#[derive(Clone, Debug, Default)]
pub struct Signature {
    /// The inputs.
    pub inputs: Vec<Port>,
    /// The outputs.
    pub outputs: Vec<Port>,
}

/// The arguments of a call, and the storage of its results.
pub trait Call {
    /// Copies the non-zeros of an input; zeros if it is not given.
    fn read(&self, input: usize, to: &mut [f64]);
    /// Whether an output is requested.
    fn wants(&self, output: usize) -> bool;
    /// The storage for the non-zeros of an output, if requested.
    fn output(&mut self, output: usize) -> Option<&mut [f64]>;
}
