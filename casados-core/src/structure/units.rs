//! Units of the variables of a model.

/// The unit of each variable of a model, of states, algebraic states, controls and parameters, and
/// of the time, as the doc comments say: axes of pictures have it. A list is empty where no unit of
/// it is known, and so is the text of a variable without one.
///
/// `#[dae]`, `#[ode]` and `#[function]` take the unit from what stands behind a comma, in the first
/// paragraph of a field's doc comment, or in a list in the model's, which begins with names of
/// variables. Products and quotients of powers of units of the SI are units, with `L`, `bar`, `eV`,
/// `min`, `h`, `d`, `°`, `deg`, `°C`, `rpm`, `ha`, `%` and `‰`.
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
    /// No unit is known.
    pub const NONE: Self = Self { x: &[], z: &[], u: &[], p: &[], t: "" };
}
