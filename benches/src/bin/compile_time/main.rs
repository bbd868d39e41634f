//! How long programs that use a model take to compile, their dependencies built before; and how
//! that grows.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --bin compile_time [-- FILE.md]
//! ```
//!
//! Writes packages to `target/compile_time`, and builds each three times after its source was
//! touched. Counted is the user time of the compiler for the last crate alone, by GNU time, which
//! also says how much memory it takes: medians, so that other work of the machine matters little.
//! With a file, the tables go between its lines `<!-- compile time -->` and
//! `<!-- end of compile time -->`.

mod programs;

use casados_benches::record::{insert_between_markers, repository_path};
use casados_benches::time::log_log_slope;
use programs::{Failure, Program};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// What cargo compiles the package with instead of the compiler alone.
const WRAPPER: &str = "#!/bin/sh\nexec /usr/bin/time -o \"$CASADOS_MEASURED\" -f '%U %M' \"$@\"\n";

const MANIFEST: &str = r#"[workspace]

[package]
name = "compile-time"
version = "0.0.0"
edition = "2024"

[dependencies]
casados = { path = "CASADOS" }
nalgebra = { version = "0.35", default-features = false, features = ["std", "macros"] }

[profile.dev.package."*"]
opt-level = 3

[profile.one]
inherits = "release"
codegen-units = 1
"#;

/// A way to build the package.
struct BuildSettings {
    profile: &'static str,
    /// Whether it names the processor of this machine.
    native: bool,
}

/// As cargo does it, with one codegen unit, with the processor named, and for debugging.
const BUILDS: [BuildSettings; 4] = [
    BuildSettings { profile: "release", native: false },
    BuildSettings { profile: "one", native: false },
    BuildSettings { profile: "release", native: true },
    BuildSettings { profile: "dev", native: false },
];
const RELEASE: &BuildSettings = &BUILDS[0];
const ONE_CODEGEN_UNIT: &BuildSettings = &BUILDS[1];
const NATIVE: &BuildSettings = &BUILDS[2];
const DEBUG: &BuildSettings = &BUILDS[3];

/// One compilation of the package.
#[derive(Clone, Copy)]
struct Measured {
    /// User time, in seconds.
    seconds: f64,
    /// The largest memory, in MB.
    memory: f64,
    /// Of the program, in KB.
    size: f64,
}

impl BuildSettings {
    /// Where it builds: what is native has dependencies of its own.
    fn target_directory(&self) -> &'static str {
        if self.native { "native" } else { "target" }
    }
}

/// The package in which all programs are built.
struct Package {
    folder: PathBuf,
}

impl Package {
    /// Writes it, and builds what it depends on in all profiles.
    fn new() -> Result<Self, Failure> {
        let folder = repository_path("target/compile_time");
        fs::create_dir_all(folder.join("src"))?;
        let folder = folder.canonicalize()?;
        let casados = repository_path("").canonicalize()?;
        fs::write(folder.join("Cargo.toml"), MANIFEST.replace("CASADOS", &casados.to_string_lossy()))?;
        let wrapper = folder.join("measure.sh");
        fs::write(&wrapper, WRAPPER)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            fs::set_permissions(&wrapper, fs::Permissions::from_mode(0o755))?;
        }
        fs::write(folder.join("src/main.rs"), "fn main() {}\n")?;
        let package = Self { folder };
        for build in &BUILDS {
            eprintln!("building the dependencies ({}, native: {})", build.profile, build.native);
            package.build(build)?;
        }
        Ok(package)
    }

    fn build(&self, build: &BuildSettings) -> Result<Measured, Failure> {
        let times = self.folder.join("measured");
        let output = Command::new(env!("CARGO"))
            .args(["build", "--quiet", "--profile", build.profile, "--target-dir", build.target_directory()])
            .env("RUSTFLAGS", if build.native { "-C target-cpu=native" } else { "" })
            .env("RUSTC_WORKSPACE_WRAPPER", self.folder.join("measure.sh"))
            .env("CASADOS_MEASURED", &times)
            .current_dir(&self.folder)
            .output()?;
        if !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
        }
        let text = fs::read_to_string(&times).map_err(|_| "GNU time is not installed as /usr/bin/time")?;
        let mut numbers = text.split_whitespace();
        let mut next = || numbers.next().and_then(|n| n.parse::<f64>().ok()).ok_or("what GNU time says");
        let (seconds, kilobytes) = (next()?, next()?);
        let size = fs::metadata(self.binary(build))?.len() as f64 / 1e3;
        Ok(Measured { seconds, memory: kilobytes / 1e3, size })
    }

    fn binary(&self, build: &BuildSettings) -> PathBuf {
        let folder = if build.profile == "dev" { "debug" } else { build.profile };
        self.folder.join(build.target_directory()).join(folder).join("compile-time")
    }

    /// Builds a program three times; the medians.
    fn measure(&self, program: &Program, build: &BuildSettings) -> Result<Measured, Failure> {
        let mut all = Vec::new();
        for edit in 0..3 {
            fs::write(self.folder.join("src/main.rs"), program.edited_source(edit))?;
            all.push(self.build(build)?);
        }
        let median = |of: fn(&Measured) -> f64| {
            let mut values: Vec<f64> = all.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        Ok(Measured {
            seconds: median(|m| m.seconds),
            memory: median(|m| m.memory),
            size: median(|m| m.size),
        })
    }
}

/// The table of programs.
fn table_of_programs(package: &Package) -> Result<String, Failure> {
    let mut table = String::from(
        "| program | s | MB | KB | one unit: s | MB | KB | native: s | MB | KB |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
",
    );
    for program in programs::programs_by_use()? {
        let mut line = format!("| {} |", program.name);
        for build in [RELEASE, ONE_CODEGEN_UNIT, NATIVE] {
            let m = package.measure(&program, build)?;
            line += &format!(" {:.1} | {:.0} | {:.0} |", m.seconds, m.memory, m.size);
        }
        eprintln!("{line}");
        table += &format!("{line}\n");
    }
    let quadrotor = programs::quadrotor()?;
    let debug = package.measure(&quadrotor, DEBUG)?;
    table += &format!(
        "\nIn a debug build with optimised dependencies, after an edit of a weight: the quadrotor {:.1} s.\n",
        debug.seconds
    );
    Ok(table)
}

/// The table of models that grow.
fn table_of_growing_models(package: &Package) -> Result<String, Failure> {
    let mut table = String::from(
        "| all modes | operations | seconds | microseconds per operation |\n| --- | --- | --- | --- |\n",
    );
    let mut points = Vec::new();
    for program in programs::programs_of_growing_models()? {
        let seconds = package.measure(&program, RELEASE)?.seconds;
        let output = Command::new(package.binary(RELEASE)).output()?;
        let operations: f64 = String::from_utf8(output.stdout)?.trim().parse()?;
        points.push((operations, seconds));
        let each = 1e6 * seconds / operations;
        let line = format!("| {} | {operations:.0} | {seconds:.1} | {each:.0} |\n", program.name);
        eprint!("{line}");
        table += &line;
    }
    table += &format!(
        "\nOver the chains the time grows like operations^{:.2}.\n",
        log_log_slope(points.into_iter())
    );
    Ok(table)
}

fn measure_all(target: Option<&Path>) -> Result<(), Failure> {
    let package = Package::new()?;
    let table = format!("{}\n{}", table_of_programs(&package)?, table_of_growing_models(&package)?);
    println!("{table}");
    if let Some(file) = target {
        insert_between_markers(file, "compile time", &table)?;
    }
    Ok(())
}

fn main() -> ExitCode {
    let target: Option<PathBuf> = std::env::args_os().nth(1).map(Into::into);
    match measure_all(target.as_deref()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("compile_time: {error}");
            ExitCode::FAILURE
        }
    }
}
