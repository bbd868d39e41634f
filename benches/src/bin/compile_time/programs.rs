//! The programs: models of the examples, and calls that are compiled and not optimised away.

use casados_benches::record::repository_path;
use std::fs;

pub type Failure = Box<dyn std::error::Error>;

/// A program of one file.
pub struct Program {
    pub name: String,
    source: String,
    /// A number in it that an edit changes, before its last digit.
    edited_weight: Option<&'static str>,
}

impl Program {
    /// Its source after an edit: of a weight, if it has one, or of a comment.
    pub fn edited_source(&self, edit: usize) -> String {
        match self.edited_weight {
            Some(weight) => self.source.replace(weight, &format!("1.{edit}e-2")),
            None => format!("{}// {edit}\n", self.source),
        }
    }
}

/// Prints the operations of the model.
const HEAD: &str = r"#![allow(dead_code, unused_imports, unused_macros)]
use casados::prelude::*;
use casados::__private::Matrix;
use casados::{Batch, Intervals, Radau};
use std::hint::black_box;

fn zeros<V: Matrix<f64>>() -> V {
    black_box(V::zeroed())
}

";

/// The main function around calls.
fn program(name: &str, model: &str, of: &str, calls: &str) -> Program {
    let source = format!(
        "{HEAD}mod model {{\n{}\n}}\n\nfn main() -> Result<(), Box<dyn std::error::Error>> {{
    let o = <model::{of} as Dae>::STRUCTURE.operations;
    println!(\"{{}}\", o.residual_jacobian + o.adjoint + o.hessian);
    if std::env::args().len() > 1 {{\n{calls}    }}\n    Ok(())\n}}\n",
        as_inner_module(model),
    );
    Program { name: name.into(), source, edited_weight: None }
}

/// A file as a module inside of another: its own documentation as comments.
fn as_inner_module(file: &str) -> String {
    file.lines().map(|line| format!("{}\n", line.replacen("//!", "//", 1))).collect()
}

/// A call of an integrator.
fn call(mode: &str) -> String {
    let seed = if matches!(mode, "adjoint" | "hessian") { ", &zeros()" } else { "" };
    format!("        black_box(irk.{mode}(&zeros(), &zeros(), 0.2{seed})?);\n")
}

/// A call of a batch.
fn batch_call(mode: &str) -> String {
    let result = if mode == "forward" { "Forward" } else { "Hessian" };
    let seed = if mode == "hessian" { "&[zeros()], " } else { "" };
    format!(
        "        let intervals = Intervals {{ x0: &[zeros(); 8], u: &[zeros()], h: &[0.2], ..Default::default() }};
        batch.{mode}(&intervals, {seed}&mut vec![casados::result::{result}::default(); 8])?;\n"
    )
}

fn open_integrator(kind: &str, name: &str, model: &str, method: &str) -> String {
    format!("        let mut {name} = {kind}::<model::{model}, {method}>::new(Default::default())?;\n")
}

const MODES: [&str; 4] = ["solve", "forward", "adjoint", "hessian"];

fn all_modes(model: &str, method: &str) -> String {
    let calls: String = MODES.map(call).concat();
    open_integrator("Irk", "irk", model, method) + &calls
}

fn read(name: &str) -> Result<String, Failure> {
    Ok(fs::read_to_string(repository_path(name))?)
}

/// The text between two others.
fn between<'a>(text: &'a str, begin: &str, end: &str) -> Result<&'a str, Failure> {
    let from = text.find(begin).ok_or_else(|| format!("no {begin:?}"))?;
    let length = text[from..].find(end).ok_or_else(|| format!("no {end:?}"))?;
    Ok(&text[from..from + length])
}

/// A chain of so many states; also of what is written for several sizes like it.
fn chain_of_size(file: &str, nx: usize) -> Result<String, Failure> {
    let mut text = String::new();
    for (index, part) in read(file)?.split("NX = [").enumerate() {
        if index == 0 {
            text += part;
        } else {
            let (_, rest) = part.split_once(']').ok_or("the list of sizes has no end")?;
            text += &format!("NX = [{nx}]{rest}");
        }
    }
    Ok(text)
}

const CHAIN: &str = "examples/models/chain.rs";

/// One integrator of one model, in the modes that somebody may use.
pub fn programs_by_use() -> Result<Vec<Program>, Failure> {
    let (chain, awe) = (chain_of_size(CHAIN, 21)?, read("examples/models/awe.rs")?);
    let mut all = Vec::new();
    for mode in MODES {
        let calls = open_integrator("Irk", "irk", "Chain<21>", "Gauss<2>") + &call(mode);
        all.push(program(&format!("5 masses, `Gauss<2>`: `{mode}`"), &chain, "Chain<21>", &calls));
    }
    for mode in ["forward", "hessian"] {
        let calls = open_integrator("Batch", "batch", "Chain<21>", "Gauss<2>") + &batch_call(mode);
        all.push(program(&format!("the same, `Batch`: `{mode}`"), &chain, "Chain<21>", &calls));
    }
    all.push(least_squares(&chain)?);
    let single = all_modes("Awe", "RadauIIA<4>");
    all.push(program("aircraft, `RadauIIA<4>`: all modes", &awe, "Awe", &single));
    let both = single + &open_integrator("Batch", "batch", "Awe", "RadauIIA<4>") + &batch_call("hessian");
    all.push(program("and `Batch`: `hessian`", &awe, "Awe", &both));
    let robertson = read("examples/models/ivp/chemistry.rs")?;
    let solve = open_integrator("Adaptive", "irk", "Robertson", "Radau") + &call("solve");
    all.push(program("Robertson, `Adaptive<_, Radau>`: `solve`", &robertson, "Robertson", &solve));
    let both = solve + &call("forward");
    all.push(program("and `forward`", &robertson, "Robertson", &both));
    all.push(quadrotor()?);
    Ok(all)
}

/// Sequential quadratic programming with the Hessian of Gauss and Newton over a batch.
fn least_squares(chain: &str) -> Result<Program, Failure> {
    let problem = chain_of_size("examples/models/chain_problem.rs", 21)?;
    let calls = "        let batch = Batch::<model::Chain<21>, Gauss<2>>::new(Default::default())?;
        let mut ocp = chain_problem::problem!(21, vec![0.0; 21], [0.0; 21], casados::ocp::Shooting::new(batch));
        let mut sqp = casados::ocp::HeapSqp::new(&ocp)?.gauss_newton();
        println!(\"{}\", sqp.solve(&mut ocp)?);\n";
    let mut program = program("SQP of Gauss and Newton over it", chain, "Chain<21>", calls);
    program.source = program.source.replacen(
        "fn main",
        &format!("mod chain_problem {{\n{}\n}}\n\nfn main", as_inner_module(&problem)),
        1,
    );
    Ok(program)
}

/// A quadrotor with quaternion: 14 states, path constraints, exact Hessians.
pub fn quadrotor() -> Result<Program, Failure> {
    let (flight, tools) = (read("examples/models/ocps/flight.rs")?, read("examples/models/ocps/mod.rs")?);
    let flight = between(&flight, "use super", "/// A rocket in a plane")?;
    let tools = between(&tools, "use casados", "/// Calls a macro")?;
    let source = format!(
        "#![allow(dead_code)]\nmod flight {{\n{flight}\n}}\n{tools}
fn main() -> Result<(), Failure> {{
    let mut ocp = flight::quadrotor(GIVEN)?;
    let outcome = casados::ocp::HeapSqp::new(&ocp)?.solve(&mut ocp)?;
    println!(\"{{outcome}}\");\n    Ok(())\n}}\n"
    );
    let name = "optimal control of a quadrotor, 14 states, exact Hessians".into();
    Ok(Program { name, source, edited_weight: Some("1e-2") })
}

/// All modes of models that grow.
pub fn programs_of_growing_models() -> Result<Vec<Program>, Failure> {
    [5, 9, 17, 33]
        .into_iter()
        .map(|masses| {
            let nx = 6 * (masses - 2) + 3;
            let model = format!("Chain<{nx}>");
            let calls = all_modes(&model, "Gauss<4>");
            Ok(program(&format!("chain {masses}"), &chain_of_size(CHAIN, nx)?, &model, &calls))
        })
        .collect()
}
