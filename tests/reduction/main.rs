//! Models with constraints, whose index the macro reduces.

mod car_axis;
mod circuit;
mod consistent;
mod divided;
mod double_pendulum;
mod everywhere;
mod mechanisms;
mod ocp;
mod pendulum;
mod projected;
mod singular;
mod slider_crank;
mod squeezer;
mod wheelset;
