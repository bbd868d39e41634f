//! Construction of a problem on a horizon, on the heap or in given memory.

use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::functions::argument_checks::{ConstraintsOf, CostOf};
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::horizon::Horizon;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::{self, Layout};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::{Qp, Solution, StageDims};
#[cfg(feature = "alloc")]
use crate::qp::{try_reserve, zeros};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

impl<D, L, E, G, H> Problem<D, L, E, G, H> {
    /// Creates the problem on a horizon, with memory on the heap.
    ///
    /// # Errors
    /// [`OcpError::Missing`] if there is no interval; [`OcpError::Times`], [`OcpError::NotThere`],
    /// [`OcpError::InvalidWeight`], [`OcpError::CrossedBounds`], [`OcpError::InvalidValue`],
    /// [`OcpError::OutOfMemory`]; with a free end time [`OcpError::FixedEndTime`],
    /// [`OcpError::OutOfRange`], [`OcpError::DependsOnTime`], [`OcpError::Unsupported`]
    #[cfg(feature = "alloc")]
    pub fn on<T: Real>(self, horizon: Horizon<'_, T>) -> Result<HeapOcp<Self, T>, OcpError>
    where
        D: Dynamics<T>,
        L: CostOf<D, T>,
        E: CostOf<D, T>,
        G: ConstraintsOf<D, T>,
        H: ConstraintsOf<D, T>,
    {
        let layout = Layout::new(horizon.intervals(), H::INITIAL_STATE_COPIES);
        let mut dims = Vec::new();
        try_reserve(&mut dims, layout.intervals.saturating_add(1))?;
        dims.resize(layout.intervals, data::stage_dims::<Self, T>(layout, false));
        dims.push(data::stage_dims::<Self, T>(layout, true));
        let qp = Qp::new(&dims)?;
        let iterate = Solution::new(&dims)?;
        let length = data::data_len::<Self, T>(layout);
        let mut ocp = Ocp::build(self, horizon, qp, iterate, zeros(length)?)?;
        ocp.free_end(&horizon)?;
        Ok(ocp)
    }

    /// Returns the dimensions of the stages, which are one more than intervals.
    #[must_use]
    pub const fn dims<T: Real, const STAGES: usize>() -> [StageDims; STAGES]
    where
        Self: Formulation<T>,
    {
        let layout = Layout::new(STAGES.saturating_sub(1), 0);
        let mut dims = [data::stage_dims::<Self, T>(layout, false); STAGES];
        if let Some(last) = dims.last_mut() {
            *last = data::stage_dims::<Self, T>(layout, true);
        }
        dims
    }

    /// Returns the number of elements of a problem's memory; `usize::MAX` if it overflows.
    #[must_use]
    pub const fn memory<T: Real>(dims: &[StageDims]) -> usize
    where
        Self: Formulation<T>,
    {
        Qp::<T, (), ()>::memory(dims)
            .saturating_add(Solution::<T, (), ()>::memory(dims))
            .saturating_add(data::data_len::<Self, T>(Layout::new(dims.len().saturating_sub(1), 0)))
    }

    /// Creates the problem on a horizon, in given memory of at least [`Problem::memory`] elements;
    /// `dims` are [`Problem::dims`].
    ///
    /// # Errors
    /// [`OcpError::Missing`] if there is no interval; [`OcpError::Times`], [`OcpError::NotThere`],
    /// [`OcpError::InvalidWeight`], [`OcpError::CrossedBounds`], [`OcpError::InvalidValue`];
    /// [`OcpError::Length`] if memory or dimensions do not fit; [`OcpError::Unsupported`] for a
    /// free end time and for boundary conditions.
    #[allow(clippy::type_complexity)]
    pub fn on_horizon<'a, T: Real>(
        self,
        horizon: Horizon<'_, T>,
        dims: &'a [StageDims],
        memory: &'a mut [T],
    ) -> Result<Ocp<Self, T, &'a [StageDims], &'a mut [T]>, OcpError>
    where
        D: Dynamics<T>,
        L: CostOf<D, T>,
        E: CostOf<D, T>,
        G: ConstraintsOf<D, T>,
        H: ConstraintsOf<D, T>,
    {
        if matches!(horizon, Horizon::Free { .. }) || H::INITIAL_STATE_COPIES > 0 {
            let what = "free end times and boundary conditions in given memory";
            return Err(OcpError::Unsupported { what, remedy: "Take `Problem::on`" });
        }
        let intervals = horizon.intervals();
        let (part, expected) = (Part::Dimensions, intervals.saturating_add(1));
        if dims.len() != expected {
            return Err(OcpError::Length { part, stage: 0, expected, found: dims.len() });
        }
        for (stage, &dims) in dims.iter().enumerate() {
            let given = data::stage_dims::<Self, T>(Layout::new(intervals, 0), stage == intervals);
            for (expected, found) in [(given.nx, dims.nx), (given.nu, dims.nu), (given.ng, dims.ng)] {
                if expected != found {
                    return Err(OcpError::Length { part: Part::Dimensions, stage, expected, found });
                }
            }
        }
        let (expected, found) = (Self::memory::<T>(dims), memory.len());
        if found < expected {
            return Err(OcpError::Length { part: Part::Memory, stage: 0, expected, found });
        }
        let (qp, rest) = memory.split_at_mut_checked(Qp::<T, (), ()>::memory(dims)).unwrap_or_default();
        let (iterate, rest) =
            rest.split_at_mut_checked(Solution::<T, (), ()>::memory(dims)).unwrap_or_default();
        Ocp::build(self, horizon, Qp::in_memory(dims, qp)?, Solution::in_memory(dims, iterate)?, rest)
    }
}

/// Memory that can be reallocated: memory on the heap.
pub trait Reallocatable<V>: AsRef<[V]> + Sized {
    /// Returns memory of this length that begins with `first`; further elements are copies of the
    /// last one.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]; [`OcpError::Unsupported`] for given memory.
    #[doc(hidden)]
    fn reallocate(first: &[V], length: usize) -> Result<Self, OcpError>;
}

#[cfg(feature = "alloc")]
impl<V: Copy + Default> Reallocatable<V> for Vec<V> {
    fn reallocate(first: &[V], length: usize) -> Result<Self, OcpError> {
        let mut list = Vec::new();
        try_reserve(&mut list, length)?;
        list.extend_from_slice(first);
        list.resize(length, V::default());
        Ok(list)
    }
}

const FIXED_MEMORY_ERROR: OcpError = OcpError::Unsupported {
    what: "bounds of algebraic states in given memory",
    remedy: "Take `Problem::on`",
};

impl<V> Reallocatable<V> for &[V] {
    fn reallocate(_: &[V], _: usize) -> Result<Self, OcpError> {
        Err(FIXED_MEMORY_ERROR)
    }
}

impl<V> Reallocatable<V> for &mut [V] {
    fn reallocate(_: &[V], _: usize) -> Result<Self, OcpError> {
        Err(FIXED_MEMORY_ERROR)
    }
}
