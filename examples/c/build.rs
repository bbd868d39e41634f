//! The header of the library: `casados_pendulum.h` is to be what cbindgen makes of the source.

use cbindgen::{Builder, Language, Style};
use std::{env, fs, path::Path};

fn main() {
    let header = "casados_pendulum.h";
    println!("cargo:rerun-if-changed=src/lib.rs");
    println!("cargo:rerun-if-changed={header}");
    let new = Path::new(&env::var("OUT_DIR").unwrap()).join(header);
    Builder::new()
        .with_src("src/lib.rs")
        .with_language(Language::C)
        .with_style(Style::Type)
        .with_include_guard("CASADOS_PENDULUM_H")
        .with_cpp_compat(true)
        .with_documentation(true)
        .with_header("/* Made by cbindgen from src/lib.rs. */")
        .generate()
        .unwrap()
        .write_to_file(&new);
    if env::var_os("UPDATE_HEADER").is_some() {
        fs::copy(&new, header).unwrap();
    } else if fs::read(&new).ok() != fs::read(header).ok() {
        panic!("{header} is not what src/lib.rs declares: build once with UPDATE_HEADER=1");
    }
    println!("cargo:rerun-if-env-changed=UPDATE_HEADER");
}
