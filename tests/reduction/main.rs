//! Models with constraints, whose index the macro reduces.

mod car_axis;
mod circuit;
mod consistent;
mod double_pendulum;
mod mechanisms;
mod pendulum;
mod projected;
