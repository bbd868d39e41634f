//! Stiff and demanding initial value problems: those of the Test Set for IVP Solvers (F. Mazzia, C.
//! Magherini, University of Bari, release 2.4) and of E. Hairer and G. Wanner, Solving Ordinary
//! Differential Equations II.

#![allow(dead_code)] // Each program that includes it takes a part.

pub mod chemistry;
pub mod circuits;
pub mod mechanics;
pub mod oscillators;
pub mod vibrations;
