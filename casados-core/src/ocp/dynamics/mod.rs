//! The functions `φ` of intervals: integrators, batches, collocation and maps.

pub(in crate::ocp) mod begin;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod collocation;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod inside;
pub(in crate::ocp) mod map;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod return_map;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod shooting;
pub(in crate::ocp) mod single;
pub(in crate::ocp) mod wrapped;
