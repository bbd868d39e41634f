//! Models with constraints, whose index the macro reduces.

mod car_axis;
mod circuit;
mod consistent;
mod divided_intervals;
mod double_pendulum;
mod mechanisms;
mod ocp;
mod pendulum;
mod projected;
mod reduced_models;
mod singular;
mod slider_crank;
mod squeezer;
mod wheelset;
