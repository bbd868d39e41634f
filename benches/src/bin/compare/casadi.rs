//! CasADi in a Python process of its own, which answers line by line.

use super::rows::Measured;
use casados_benches::case::{Case, Mode, Values};
use casados_benches::record::repository;
use casados_benches::time::Summary;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// The process.
pub struct Casadi {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    /// Of CasADi, Python and numpy.
    pub versions: String,
}

impl Casadi {
    /// Starts the interpreter that `CASADOS_PYTHON` names, or `python3`.
    ///
    /// # Errors
    /// One line that says what is missing.
    pub fn start() -> Result<Self, String> {
        let python = std::env::var("CASADOS_PYTHON").unwrap_or_else(|_| "python3".into());
        let mut child = Command::new(&python)
            .arg(repository("benches/peers/casadi_peers.py"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| format!("cannot start {python}: {e}"))?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let (Some(input), Some(output)) = (input, output) else { return Err("no pipe".into()) };
        let mut casadi = Self { child, input, output: BufReader::new(output), versions: String::new() };
        let missing = |_| format!("{python} has no casadi (python3 -m pip install casadi)");
        let answer = casadi.ask(&json!({ "do": "versions" })).map_err(missing)?;
        let name = |key: &str| answer[key].as_str().unwrap_or("?").to_owned();
        casadi.versions =
            format!("CasADi {}, Python {}, numpy {}", name("casadi"), name("python"), name("numpy"));
        Ok(casadi)
    }

    fn ask(&mut self, request: &Value) -> Result<Value, String> {
        writeln!(self.input, "{request}").map_err(|e| e.to_string())?;
        let mut line = String::new();
        self.output.read_line(&mut line).map_err(|e| e.to_string())?;
        let answer: Value = serde_json::from_str(&line).map_err(|e| e.to_string())?;
        match answer["error"].as_str() {
            Some(error) => Err(error.into()),
            None => Ok(answer),
        }
    }

    /// Values of the same method to rounding, for the first input.
    ///
    /// # Errors
    /// What CasADi says.
    pub fn values(&mut self, case: &Case, modes: &[Mode]) -> Result<Values, String> {
        let names: Vec<_> = modes.iter().map(|m| m.name()).collect();
        let answer = self.ask(&json!({ "do": "values", "case": case.json(), "modes": names }))?;
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
    pub fn flow(&mut self, case: &Case) -> Result<(Values, f64), String> {
        let answer = self.ask(&json!({ "do": "flow", "case": case.json() }))?;
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
        let answer = self.ask(
            &json!({ "do": "time", "case": case.json(), "solver": solver, "modes": modes, "seconds": seconds }),
        )?;
        let answer = &answer[mode.name()];
        let number = |key: &str| answer["time"][key].as_f64().unwrap_or(f64::NAN);
        let samples = answer["time"]["samples"].as_u64().unwrap_or(0) as usize;
        let time = Summary { median: number("median"), q1: number("q1"), q3: number("q3"), samples };
        let values = Values::read(&answer["values"][0]);
        Ok(Measured { time, error: reference.and_then(|r| values.error(r, mode)), ..Default::default() })
    }
}

impl Drop for Casadi {
    fn drop(&mut self) {
        // It waits for a line that will not come.
        self.child.kill().ok();
        self.child.wait().ok();
    }
}
