//! Names of the variables of a model.

use crate::structure::Units;

/// Start and length of an interval, the last parameters of models with polynomial controls.
pub(in crate::ocp) const INTERVAL_PARAMETERS: usize = 2;

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
    /// The name of the model.
    pub model: &'static str,
    /// States.
    pub x: &'static [&'static str],
    /// Algebraic states.
    pub z: &'static [&'static str],
    /// Controls.
    pub u: &'static [&'static str],
    /// Parameters.
    pub p: &'static [&'static str],
    /// The units of the variables, where the model gives them.
    pub units: Units,
    /// The parameter that scales the time of the model, `#[ode(duration = p)]`.
    pub duration: Option<usize>,
    /// The controls that are rates of linear controls. Linear controls are states that follow the
    /// model's states.
    pub linear: &'static [u32],
    /// The degree of each control as written, if some are polynomials in every interval, whose
    /// coefficients are controls (`#[ode(degree(u = 1))]`); otherwise empty.
    pub degrees: &'static [u32],
    /// The number of integrals, which are the last states.
    pub integrals: usize,
}

impl Names {
    /// Returns the number of states without linear controls and integrals.
    pub(in crate::ocp) const fn model_state_count(&self) -> usize {
        self.x.len() - self.linear.len() - self.integrals
    }

    /// Returns the number of controls as written, without the coefficients of polynomials.
    pub(in crate::ocp) const fn model_control_count(&self) -> usize {
        if self.degrees.is_empty() { self.u.len() } else { self.degrees.len() }
    }

    /// Returns the number of parameters as written, without start and length of an interval.
    pub(in crate::ocp) const fn model_parameter_count(&self) -> usize {
        if self.degrees.is_empty() { self.p.len() } else { self.p.len() - INTERVAL_PARAMETERS }
    }

    /// Returns each control as written: its first coefficient and its degree.
    pub(in crate::ocp) fn model_controls(&self) -> impl Iterator<Item = (usize, usize)> {
        let mut next = 0;
        (0..self.model_control_count()).map(move |control| {
            let first = next;
            let degree = self.degrees.get(control).map_or(0, |&degree| degree as usize);
            next += degree + 1;
            (first, degree)
        })
    }

    /// Returns the first coefficient and the degree of the control with a coefficient, if it is a
    /// polynomial.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn polynomial_of(&self, coefficient: usize) -> Option<(usize, usize)> {
        let mut controls = self.model_controls();
        controls.find(|&(first, degree)| degree > 0 && (first..=first + degree).contains(&coefficient))
    }

    /// Returns the name of a control as written: of a rate that of the linear control, of a
    /// coefficient that of the polynomial.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn control_name(&self, control: usize) -> &'static str {
        let state = self.linear_state(control).and_then(|state| self.x.get(state));
        let name = state.or(self.u.get(control)).copied().unwrap_or("");
        match self.polynomial_of(control) {
            Some(_) => name.rfind('[').and_then(|bracket| name.get(..bracket)).unwrap_or(name),
            None => name,
        }
    }

    /// Returns the index of a linear control among the states.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn linear_state(&self, control: usize) -> Option<usize> {
        let position = self.linear.iter().position(|&linear| linear as usize == control)?;
        Some(self.model_state_count() + position)
    }
}
