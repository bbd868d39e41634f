//! What the variables of a model are called.

use crate::structure::Units;

/// Names of the variables of a model.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let error = ocp.bound("v", .., -1.0, 1.0).err().ok_or("there is one")?;
/// let OcpError::UnknownName { known, .. } = error else { return Err(error.into()) };
/// assert_eq!((known.model, known.x, known.u), ("Push", &["x"][..], &["u"][..]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    /// Their units, as far as the model says.
    pub units: Units,
    /// Which parameter the time of the model is a multiple of, if one is: `#[ode(duration = p)]`.
    pub duration: Option<usize>,
    /// Which controls are rates of linear ones, which are states behind those of the model.
    pub linear: &'static [u32],
    /// How many integrals are the last states.
    pub integrals: usize,
}

impl Names {
    /// How many states the model has without linear controls and integrals.
    pub(in crate::ocp) const fn model_state_count(&self) -> usize {
        self.x.len() - self.linear.len() - self.integrals
    }

    /// What a control is called, of a rate the control that has it.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn control_name(&self, control: usize) -> &'static str {
        let state = self.linear_state(control).and_then(|state| self.x.get(state));
        state.or(self.u.get(control)).copied().unwrap_or("")
    }

    /// The state that a linear control is.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn linear_state(&self, control: usize) -> Option<usize> {
        let position = self.linear.iter().position(|&linear| linear as usize == control)?;
        Some(self.model_state_count() + position)
    }
}
