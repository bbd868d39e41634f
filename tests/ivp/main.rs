//! The set of initial value problems: errors at the ends, and derivatives.

#[path = "../../examples/models"]
mod models {
    pub mod ivp;
}

mod algebraic;
mod ends;
mod explicit;
mod far_below;
mod jumps;
mod kinks;
mod rough;
mod sensitivities;
mod test_set;
mod tolerances;
mod vibrations;
