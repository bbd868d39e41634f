//! Other solvers, in processes of their own that answer line by line: diffsol by a program of
//! `benches/`, which is built when it is first asked for, and CVODES and IDAS by Python with
//! CasADi.

use super::problems::Problem;
use super::record::Run;
use reference_data::Record;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A process that answers requests.
pub struct Peer {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

impl Peer {
    /// Those that there are; what is not found is said.
    pub fn start_all() -> Vec<Self> {
        let mut peers = Vec::new();
        for (name, peer) in [("diffsol", Self::diffsol()), ("CVODES and IDAS", Self::casadi())] {
            match peer {
                Ok(peer) => peers.push(peer),
                Err(missing) => eprintln!("without {name}: {missing}"),
            }
        }
        peers
    }

    /// Built by cargo: minutes, the first time.
    fn diffsol() -> Result<Self, String> {
        eprintln!("building the solvers of diffsol (minutes, the first time) ...");
        let manifest = repository("benches/Cargo.toml");
        let built = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()))
            .args(["build", "--release", "--quiet", "--features", "diffsol", "--bin", "ivp_peers"])
            .arg("--manifest-path")
            .arg(&manifest)
            .status();
        match built {
            Ok(status) if status.success() => {}
            Ok(status) => return Err(format!("cargo ended with {status}")),
            Err(error) => return Err(format!("cannot start cargo: {error}")),
        }
        let target =
            std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| repository("benches/target"), PathBuf::from);
        Self::start(&mut Command::new(target.join("release/ivp_peers")))
    }

    /// By the interpreter that `CASADOS_PYTHON` names, or `python3`.
    fn casadi() -> Result<Self, String> {
        let python = std::env::var("CASADOS_PYTHON").unwrap_or_else(|_| "python3".into());
        let mut peer = Self::start(Command::new(&python).arg(repository("benches/peers/casadi_ivp.py")))?;
        match peer.ask(&json!({ "do": "versions" })) {
            Ok(answer) => eprintln!("CVODES and IDAS of {}", answer["versions"].as_str().unwrap_or("CasADi")),
            Err(_) => return Err(format!("{python} has no casadi (python3 -m pip install casadi numpy)")),
        }
        Ok(peer)
    }

    fn start(command: &mut Command) -> Result<Self, String> {
        let program = command.get_program().to_string_lossy().into_owned();
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| format!("cannot start {program}: {error}"))?;
        match (child.stdin.take(), child.stdout.take()) {
            (Some(input), Some(output)) => Ok(Self { child, input, output: BufReader::new(output) }),
            _ => Err("no pipe".into()),
        }
    }

    fn ask(&mut self, request: &Value) -> Result<Value, String> {
        writeln!(self.input, "{request}").map_err(|error| error.to_string())?;
        let mut line = String::new();
        self.output.read_line(&mut line).map_err(|error| error.to_string())?;
        let answer: Value = serde_json::from_str(&line).map_err(|error| error.to_string())?;
        match answer["error"].as_str() {
            Some(error) => Err(error.into()),
            None => Ok(answer),
        }
    }

    /// All its solvers on a problem.
    ///
    /// # Errors
    /// Of the process; a solver that fails is a run with an error.
    pub fn run_solvers(
        &mut self,
        problem: &Problem,
        derivatives: bool,
        seconds: f64,
    ) -> Result<Vec<Run>, String> {
        let tolerances: Vec<f64> = (6..=24).map(|i| 10f64.powf(-0.5 * f64::from(i))).collect();
        // Peers take the amplifier as an equation with algebraic states, the voltages of its
        // capacitors.
        let mut x0 = problem.x0.clone();
        if problem.name == "transistor_amplifier" {
            let y = &problem.x0;
            x0 = vec![y[1] - y[0], y[2], y[4] - y[3], y[5], y[7] - y[6]];
        }
        // The absolute tolerance of E5 is below what the others take for zero.
        let atol = problem.atol.max(1e-22);
        let answer = self.ask(&json!({
            "problem": problem.name, "x0": x0, "p": problem.p, "t": problem.t, "atol": atol,
            "tolerances": tolerances, "derivatives": derivatives, "seconds": seconds,
        }))?;
        let runs = Record::from(answer).records("runs")?;
        Ok(runs.iter().filter_map(|run| Run::of_peer(problem, run, derivatives)).collect())
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It waits for a line that will not come.
        self.child.kill().ok();
        self.child.wait().ok();
    }
}
