//! What the macro finds in a model: its description in words, and spy plots of its Jacobian and of
//! the factors of its Newton matrix.
//!
//! ```text
//! cargo run --release --example spy [FOLDER]
//! ```

#[path = "../models/awe.rs"]
#[allow(dead_code)]
mod awe;
#[path = "../models/chain.rs"]
#[allow(dead_code)]
mod chain;
#[path = "../models/pendulum.rs"]
mod pendulum;

use casados::plot::{Figure, Sparsity};
use casados::prelude::*;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let folder = match &arguments[..] {
        [] => PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/plots")),
        [folder] if !folder.as_encoded_bytes().starts_with(b"-") => PathBuf::from(folder),
        _ => {
            eprintln!("usage: cargo run --release --example spy [FOLDER]");
            return ExitCode::FAILURE;
        }
    };
    match run(&folder) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("spy: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(folder: &Path) -> Result<(), Box<dyn Error>> {
    let models = [
        ("pendulum", pendulum::Pendulum::describe()),
        ("chain", chain::Chain::<21>::describe()),
        ("awe", awe::Awe::describe()),
    ];
    for (file, structure) in models {
        println!("{structure}");
        let path = folder.join(format!("spy_{file}.svg"));
        let figure = Figure::new().size(1240, 420).with(Sparsity::jacobian(structure));
        figure.column(0.5).with(Sparsity::factors(structure)).save(&path)?;
        println!("Drawn in {}\n", path.display());
    }
    Ok(())
}
