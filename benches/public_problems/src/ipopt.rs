//! IPOPT on the same discretised problem: CasADi loads this package's dynamic library.

use crate::run::Made;
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A process that has loaded one problem.
pub struct Ipopt {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Ipopt {
    /// Loads a problem by its name, refined so many times.
    ///
    /// # Errors
    /// If the interpreter that `CASADOS_PYTHON` names, or `python3`, cannot be started.
    pub fn start(problem: &str, refinement: usize, limit: f64) -> Result<Self, String> {
        let python = std::env::var("CASADOS_PYTHON").unwrap_or_else(|_| "python3".into());
        let program = std::env::current_exe().map_err(|e| e.to_string())?;
        let library = program.with_file_name("libpublic_problems.so");
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/ipopt.py");
        let mut child = Command::new(&python)
            .args([script, &library.to_string_lossy(), &limit.to_string()])
            .env("CASADOS_PROBLEM", problem)
            .env("CASADOS_REFINEMENT", refinement.to_string())
            .env("OMP_NUM_THREADS", "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| format!("cannot start {python}: {e}"))?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let (Some(input), Some(output)) = (input, output) else { return Err("no pipe".into()) };
        Ok(Self { child, input, output: BufReader::new(output) })
    }

    /// Solves it once.
    ///
    /// # Errors
    /// What the other side says, or that it says nothing.
    pub fn solve(&mut self) -> Result<Made, String> {
        writeln!(self.input).map_err(|e| e.to_string())?;
        loop {
            let mut line = String::new();
            if self.output.read_line(&mut line).map_err(|e| e.to_string())? == 0 {
                return Err("it ended".into());
            }
            // Libraries introduce themselves first.
            let Ok(answer) = serde_json::from_str::<Value>(&line) else { continue };
            if let Some(error) = answer["error"].as_str() {
                return Err(error.into());
            }
            let number = |key: &str| answer[key].as_f64().unwrap_or(f64::NAN);
            let status = answer["status"].as_str().unwrap_or("").replace('_', " ");
            return Ok(Made {
                converged: matches!(&*status, "Solve Succeeded" | "Solved To Acceptable Level"),
                status,
                objective: number("objective"),
                iterations: number("iterations") as usize,
                qp_iterations: 0,
                worst_step: 0,
                time: number("time"),
            });
        }
    }
}

impl Drop for Ipopt {
    fn drop(&mut self) {
        // It waits for a line that will not come.
        self.child.kill().ok();
        self.child.wait().ok();
    }
}
