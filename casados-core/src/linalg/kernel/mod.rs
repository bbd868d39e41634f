//! Kernels: generic over their [`arithmetic`], compiled for each instruction set ([`dispatch`]),
//! with loops over constant tables [unrolled](unroll); sums in [double-double](double_double)
//! arithmetic, loops over [vectors](vector), and [prefetching](prefetch).

pub mod arithmetic;
pub mod dispatch;
pub mod double_double;
pub mod prefetch;
pub mod unroll;
pub mod vector;
