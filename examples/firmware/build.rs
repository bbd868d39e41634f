//! Where the linker finds `memory.x`, and which integrator the program `measure` is about.

use std::{env, fs, path::Path};

fn main() -> std::io::Result<()> {
    println!("cargo:rustc-link-search={}", env!("CARGO_MANIFEST_DIR"));
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-env-changed=CASE");
    let case = env::var("CASE").unwrap_or("pendulum::Pendulum 2 f64 Pivoting".into());
    let words: Vec<&str> = case.split(' ').collect();
    let [model, stages, number, fallback] = words[..] else {
        panic!("CASE: model, stages, number type, fallback; not {case}")
    };
    fs::write(
        Path::new(&env::var("OUT_DIR").unwrap()).join("case.rs"),
        format!(
            "type Model = firmware::{model};\nconst STAGES: usize = {stages};\ntype Number = {number};\n\
             type Fallback = casados::memory::{fallback};\n"
        ),
    )
}
