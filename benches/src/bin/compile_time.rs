//! How long a program that uses a model takes to compile, its dependencies built before; and how
//! that grows.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --bin compile_time [-- FILE.md]
//! ```
//!
//! Writes a package to `target/compile_time` that integrates one model in all modes, and times
//! `cargo build --release` after the source is touched: the macro, the compiler, the linker. With a
//! file, the table goes between its lines `<!-- compile time -->` and
//! `<!-- end of compile time -->`.

use casados_benches::record::{insert, repository};
use casados_benches::time::slope;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

type Failure = Box<dyn std::error::Error>;

/// A model, and the method that integrates it.
struct Program {
    name: String,
    source: String,
    model: String,
    method: &'static str,
}

fn programs() -> Result<Vec<Program>, Failure> {
    let awe = fs::read_to_string(repository("examples/models/awe.rs"))?;
    let chain = fs::read_to_string(repository("examples/models/chain.rs"))?;
    let (head, tail) = chain.split_once("NX = [").ok_or("the chain has no list of sizes")?;
    let (_, tail) = tail.split_once(']').ok_or("the list of sizes has no end")?;
    let mut all =
        vec![Program { name: "aircraft".into(), source: awe, model: "Awe".into(), method: "RadauIIA<4>" }];
    for masses in [5, 9, 17, 33] {
        let nx = 6 * (masses - 2) + 3;
        all.push(Program {
            name: format!("chain {masses}"),
            source: format!("{head}NX = [{nx}]{tail}"),
            model: format!("Chain<{nx}>"),
            method: "Gauss<4>",
        });
    }
    Ok(all)
}

const MANIFEST: &str = r#"[workspace]

[package]
name = "compile-time"
version = "0.0.0"
edition = "2024"

[dependencies]
casados = { path = "CASADOS" }
nalgebra = { version = "0.35", default-features = false, features = ["std", "macros"] }

[profile.release]
codegen-units = 4

"#;

/// Prints the operations of the model. All calls are compiled, and none is optimised away.
const MAIN: &str = r##"#![allow(dead_code)]
mod model;
use casados::prelude::*;
use casados::shape::Matrix;
use std::hint::black_box;

fn zeros<V: Matrix<f64>>() -> V {
    black_box(V::zeroed())
}

fn main() -> Result<(), casados::Error> {
    let o = <model::MODEL as Dae>::STRUCTURE.operations;
    println!("{}", o.residual_jacobian + o.adjoint + o.hessian);
    if std::env::args().len() > 1 {
        let mut irk = Irk::<model::MODEL, METHOD>::new(Options::default())?;
        let (x0, u, lambda) = (zeros(), zeros(), zeros());
        black_box(irk.solve(&x0, &u, 0.2)?);
        black_box(irk.forward(&x0, &u, 0.2)?);
        black_box(irk.adjoint(&x0, &u, 0.2, &lambda)?);
        black_box(irk.hessian(&x0, &u, 0.2, &lambda)?);
    }
    Ok(())
}
"##;

fn build(folder: &Path) -> Result<f64, Failure> {
    let begin = Instant::now();
    let output = Command::new(env!("CARGO"))
        .args(["build", "--release", "--quiet", "--target-dir", "target"])
        .current_dir(folder)
        .output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    Ok(begin.elapsed().as_secs_f64())
}

fn run() -> Result<(), Failure> {
    let target: Option<PathBuf> = std::env::args_os().nth(1).map(Into::into);
    let folder = repository("target/compile_time");
    fs::create_dir_all(folder.join("src"))?;
    let casados = repository("").canonicalize()?;
    fs::write(folder.join("Cargo.toml"), MANIFEST.replace("CASADOS", &casados.to_string_lossy()))?;
    fs::write(folder.join("src/main.rs"), "fn main() {}\n")?;
    fs::write(folder.join("src/model.rs"), "")?;
    eprintln!("building the dependencies");
    build(&folder)?;

    let mut table = String::from(
        "| model | operations | seconds | microseconds per operation |\n| --- | --- | --- | --- |\n",
    );
    let mut points = Vec::new();
    for program in programs()? {
        fs::write(folder.join("src/model.rs"), &program.source)?;
        let mut times = Vec::new();
        for k in 0..3 {
            let main = MAIN.replace("MODEL", &program.model).replace("METHOD", program.method);
            fs::write(folder.join("src/main.rs"), format!("{main}// {k}\n"))?;
            times.push(build(&folder)?);
        }
        // What else the machine does can only add to it.
        let seconds = times.into_iter().fold(f64::INFINITY, f64::min);
        let output = Command::new(folder.join("target/release/compile-time")).output()?;
        let operations: f64 = String::from_utf8(output.stdout)?.trim().parse()?;
        if program.name.starts_with("chain") {
            points.push((operations, seconds));
        }
        let line = format!(
            "| {} | {operations:.0} | {seconds:.1} | {:.0} |\n",
            program.name,
            1e6 * seconds / operations
        );
        eprint!("{line}");
        table += &line;
    }
    table += &format!("\nOver the chains the time grows like operations^{:.2}.\n", slope(points.into_iter()));
    println!("{table}");
    if let Some(file) = target {
        insert(&file, "compile time", &table)?;
    }
    Ok(())
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("compile_time: {error}");
            ExitCode::FAILURE
        }
    }
}
