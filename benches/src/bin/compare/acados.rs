//! acados, one Python process for each installation; what it computes is timed in C.

use super::rows::Measured;
use casados_benches::case::{Case, Family, Mode, Values};
use casados_benches::peer::Peer;
use casados_benches::time::Summary;
use serde_json::json;
use std::path::PathBuf;

/// What acados generates for GNSF of larger models takes the C compiler minutes: six for a chain of
/// 33 masses.
const LARGEST_GNSF: usize = 69;

/// Who is farther from the reference than this, in units of its largest element, computes something
/// else: the tolerance of Newton's method is 1e-8 / steps.
const MAX_PEER_ERROR: f64 = 1e-6;

/// An installation.
pub struct Acados {
    peer: Peer,
    /// Its commit, and where it is.
    pub version: String,
}

impl Acados {
    /// All installations that there are.
    ///
    /// # Errors
    /// One line that says what is missing.
    pub fn start_all() -> Result<Vec<Self>, String> {
        Peer::acados("acados_peers.py")?.into_iter().map(Self::read_version).collect()
    }

    fn read_version((home, mut peer): (PathBuf, Peer)) -> Result<Self, String> {
        let missing = |_| format!("no acados with acados_template in {}", home.display());
        let answer = peer.ask(&json!({ "do": "versions" })).map_err(missing)?;
        let name = home.file_name().unwrap_or_default().to_string_lossy();
        Ok(Self { peer, version: format!("{} ({name})", answer["acados"].as_str().unwrap_or("?")) })
    }

    /// Time of one call, and its error.
    ///
    /// # Errors
    /// What acados says, or that its result is wrong.
    pub fn time(
        &mut self,
        case: &Case,
        integrator: &str,
        mode: Mode,
        seconds: f64,
        reference: Option<&Values>,
    ) -> Result<Measured, String> {
        let answer = self.peer.ask(&json!({
            "do": "time", "case": case.to_json(case.single), "integrator": integrator, "mode": mode.name(), "seconds": seconds,
        }))?;
        let error = reference.and_then(|r| Values::read(&answer["values"]).relative_error(r, mode));
        if let Some(error) = error.filter(|error| error.is_nan() || *error > MAX_PEER_ERROR) {
            return Err(format!("{}, {integrator}: an error of {error:.0e}", case.name));
        }
        Ok(Measured { time: Summary::read(&answer["time"]), error, ..Default::default() })
    }
}

/// The integrators that a row has columns for, where acados has them.
pub fn integrators_of_row(case: &Case, mode: Mode) -> [Option<&'static str>; 2] {
    if case.family == Family::Rk4 {
        return [Some("ERK"), None];
    }
    // GNSF has no Hessian, and acados' search for its structure ends with an error for the
    // aircraft.
    let structured = mode != Mode::Hessian && case.model != "awe" && case.nx <= LARGEST_GNSF;
    [Some("IRK"), structured.then_some("GNSF")]
}
