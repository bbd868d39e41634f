//! CasADi in a Python process of its own.

use super::rows::Measured;
use casados_benches::case::{Case, Mode, Values};
use casados_benches::peer::{Peer, python};
use casados_benches::time::Summary;
use serde_json::json;

/// The process.
pub struct Casadi {
    peer: Peer,
    /// Of CasADi, Python and numpy.
    pub versions: String,
}

impl Casadi {
    /// Starts the interpreter that `CASADOS_PYTHON` names, or `python3`.
    ///
    /// # Errors
    /// One line that says what is missing.
    pub fn start() -> Result<Self, String> {
        let mut peer = Peer::start("casadi_peers.py", |command| command)?;
        let missing = |_| format!("{} has no casadi (python3 -m pip install casadi)", python());
        let answer = peer.ask(&json!({ "do": "versions" })).map_err(missing)?;
        let name = |key: &str| answer[key].as_str().unwrap_or("?").to_owned();
        let versions =
            format!("CasADi {}, Python {}, numpy {}", name("casadi"), name("python"), name("numpy"));
        Ok(Self { peer, versions })
    }

    /// Values of the same method to rounding, for the first input.
    ///
    /// # Errors
    /// What CasADi says.
    pub fn values(&mut self, case: &Case, modes: &[Mode]) -> Result<Values, String> {
        let names: Vec<_> = modes.iter().map(|m| m.name()).collect();
        let answer = self.peer.ask(&json!({ "do": "values", "case": case.to_json(1), "modes": names }))?;
        let mut values = Values::default();
        for mode in modes {
            let part = Values::read(&answer[mode.name()][0]);
            match mode {
                Mode::Simulation => values.x = part.x,
                Mode::Forward => values.forward = part.forward,
                Mode::Adjoint => values.adjoint = part.adjoint,
                Mode::Hessian => values.hessian = part.hessian,
            }
        }
        Ok(values)
    }

    /// The exact flow and its Jacobian, and how far two step numbers of its computation are apart.
    ///
    /// # Errors
    /// What CasADi says.
    pub fn exact_flow(&mut self, case: &Case) -> Result<(Values, f64), String> {
        let answer = self.peer.ask(&json!({ "do": "flow", "case": case.to_json(1) }))?;
        let apart = answer["uncertainty"].as_object().into_iter().flatten().filter_map(|(_, v)| v.as_f64());
        Ok((Values::read(&answer["values"]), apart.fold(0.0, f64::max)))
    }

    /// Time of one call, and its error.
    ///
    /// # Errors
    /// What CasADi says.
    pub fn time(
        &mut self,
        case: &Case,
        solver: &str,
        mode: Mode,
        seconds: f64,
        reference: Option<&Values>,
    ) -> Result<Measured, String> {
        let modes = [mode.name()];
        let answer = self.peer.ask(
            &json!({ "do": "time", "case": case.to_json(1), "solver": solver, "modes": modes, "seconds": seconds }),
        )?;
        let answer = &answer[mode.name()];
        let values = Values::read(&answer["values"][0]);
        let error = reference.and_then(|r| values.relative_error(r, mode));
        Ok(Measured { time: Summary::read(&answer["time"]), error, ..Default::default() })
    }
}
