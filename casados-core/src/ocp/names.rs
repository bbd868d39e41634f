//! What the variables of a model are called.

/// Names of the variables of a model.
#[derive(Clone, Copy, Debug)]
pub struct Names {
    /// Of the model.
    pub model: &'static str,
    /// States.
    pub x: &'static [&'static str],
    /// Algebraic states.
    pub z: &'static [&'static str],
    /// Controls.
    pub u: &'static [&'static str],
    /// Parameters.
    pub p: &'static [&'static str],
}
