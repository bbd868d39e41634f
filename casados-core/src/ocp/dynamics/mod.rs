//! The functions `φ` of intervals: integrators, batches, collocation and maps.

#[cfg(feature = "alloc")]
pub(in crate::ocp) mod collocation;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod dense_output;
pub(in crate::ocp) mod interval_setup;
pub(in crate::ocp) mod map;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod return_map;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod shooting;
pub(in crate::ocp) mod single_interval;
pub(in crate::ocp) mod wrapped_integrators;
