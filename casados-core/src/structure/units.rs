//! Units of the variables of a model.

/// The units of the variables of a model (states, algebraic states, controls, parameters) and of
/// the time, from doc comments; plots show them at their axes. A list is empty if all its units are
/// unknown; the text of a variable without unit is empty.
///
/// `#[dae]`, `#[ode]` and `#[function]` read a unit after the comma in the first paragraph of a
/// field's doc comment, or in a list in the model's doc comment that begins with names of
/// variables. Units are products and quotients of powers of SI units, with `L`, `bar`, `eV`, `min`,
/// `h`, `d`, `°`, `deg`, `°C`, `rpm`, `ha`, `%` and `‰`.
///
/// ```
/// use casados::prelude::*;
///
/// /// A cart that is pushed.
/// ///
/// /// - `u`: force per mass, N/kg
/// /// - `t`: s
/// #[ode]
/// mod cart {
///     pub struct State {
///         /// Position on the rail, m.
///         pub place: f64,
///         /// Velocity, m/s; positive to the right.
///         pub speed: f64,
///     }
///     pub fn cart(x: &State, u: f64) -> State { State { place: x.speed, speed: u } }
/// }
/// assert_eq!((Cart::UNITS.x, Cart::UNITS.u, Cart::UNITS.t), (&["m", "m/s"][..], &["N/kg"][..], "s"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Units {
    /// Differential states.
    pub x: &'static [&'static str],
    /// Algebraic states.
    pub z: &'static [&'static str],
    /// Controls.
    pub u: &'static [&'static str],
    /// Parameters.
    pub p: &'static [&'static str],
    /// The time.
    pub t: &'static str,
}

impl Units {
    /// No units.
    pub const NONE: Self = Self { x: &[], z: &[], u: &[], p: &[], t: "" };
}
