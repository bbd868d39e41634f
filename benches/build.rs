//! The chain of the examples, for the numbers of states that are measured here: one text for the
//! model.

use std::{env, error::Error, fs, path::Path};

const MODEL: &str = "../examples/models/chain.rs";
/// Masses 3, 5, 7, 9, 13, 17, 33, 65.
const SIZES: &str = "[9, 21, 33, 45, 69, 93, 189, 381]";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={MODEL}");
    let text = fs::read_to_string(MODEL)?;
    let (head, tail) = text.split_once("#[dae(NX = ").ok_or("the chain has no list of sizes")?;
    let (_, tail) = tail.split_once(']').ok_or("the list of sizes has no end")?;
    // Comments on the file as a whole cannot be included.
    let head = head.lines().filter(|line| !line.starts_with("//!")).collect::<Vec<_>>().join("\n");
    let out = Path::new(&env::var("OUT_DIR")?).join("chain.rs");
    fs::write(out, format!("{head}\n#[dae(NX = {SIZES}{tail}"))?;
    Ok(())
}
