//! Peers in Python processes of their own, which answer line by line in JSON.

use crate::record::repository_path;
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// The interpreter that `CASADOS_PYTHON` names, or `python3`.
#[must_use]
pub fn python() -> String {
    std::env::var("CASADOS_PYTHON").unwrap_or_else(|_| "python3".into())
}

/// A process that runs a script of `benches/peers`.
pub struct Peer {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Peer {
    /// Starts it, with arguments and variables that `prepare` adds.
    ///
    /// # Errors
    /// If there is no such interpreter.
    pub fn start(script: &str, prepare: impl FnOnce(&mut Command) -> &mut Command) -> Result<Self, String> {
        let python = python();
        let mut command = Command::new(&python);
        command.arg(repository_path("benches/peers").join(script));
        let mut child = prepare(&mut command)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| format!("cannot start {python}: {e}"))?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let (Some(input), Some(output)) = (input, output) else { return Err("no pipe".into()) };
        Ok(Self { child, input, output: BufReader::new(output) })
    }

    /// Starts it once for each installation of acados that `ACADOS_SOURCE_DIR` lists, such as one
    /// for each target of BLASFEO. Its argument is where code that acados generates is kept: beside
    /// this program.
    ///
    /// # Errors
    /// If the variable is not set, or there is no such interpreter.
    pub fn acados(script: &str) -> Result<Vec<(PathBuf, Self)>, String> {
        let list = std::env::var_os("ACADOS_SOURCE_DIR").ok_or("ACADOS_SOURCE_DIR is not set")?;
        let program = std::env::current_exe().map_err(|e| e.to_string())?;
        let start = |home: PathBuf| {
            let name = home.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "_");
            let folder = program.with_file_name("acados").join(name);
            let peer = Self::start(script, |command| command.arg(folder).env("ACADOS_SOURCE_DIR", &home))?;
            Ok((home, peer))
        };
        std::env::split_paths(&list).map(start).collect()
    }

    /// The answer to a request.
    ///
    /// # Errors
    /// What the other side says, or that it says nothing.
    pub fn ask(&mut self, request: &Value) -> Result<Value, String> {
        writeln!(self.input, "{request}").map_err(|e| e.to_string())?;
        loop {
            let mut line = String::new();
            if self.output.read_line(&mut line).map_err(|e| e.to_string())? == 0 {
                return Err("it ended".into());
            }
            // Libraries introduce themselves first.
            let Ok(answer) = serde_json::from_str::<Value>(&line) else { continue };
            return match answer["error"].as_str() {
                Some(error) => Err(error.into()),
                None => Ok(answer),
            };
        }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It waits for a line that will not come.
        self.child.kill().ok();
        self.child.wait().ok();
    }
}
