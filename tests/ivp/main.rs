//! The set of initial value problems: errors at the ends, and derivatives.

#[path = "../../examples/models"]
mod models {
    pub mod ivp;
}

mod algebraic;
mod end_values;
mod explicit;
mod jumps;
mod kinks;
mod nonsmooth_forces;
mod sensitivities;
mod small_states;
mod test_set;
mod tolerances;
mod vibrations;
