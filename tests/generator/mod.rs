//! Writes random models as Rust source: every function of the model language, shared
//! subexpressions, every kind of variable. What the attributes make of them is checked in
//! `derivatives.rs`.
//!
//! The source is the same in every run. After a change here, write the file anew:
//! `CASADOS_WRITE=1 cargo test --test derivatives generated_file`

use casados::testing::Random;
use std::fmt::Write;

/// How many models.
pub const MODELS: usize = 12;

/// The file `tests/generated/models.rs`.
pub fn generated_file() -> String {
    let mut text = String::from(
        "//! Random models, written by `tests/generator`: not to be edited by hand.\n\n\
         use casados::{dae, ode};\n",
    );
    let mut turn = 0;
    for number in 0..MODELS {
        generate_model(&mut text, number, &mut turn);
    }
    text
}

/// Functions of one argument, written so that every real argument is in their domain and that
/// values stay moderate. `A` is the argument.
const UNARY: &[&str] = &[
    "-(A)",
    "(0.5 + (A) * (A)).sqrt()",
    "(1.3 + (A).sin()).cbrt()",
    "(-1.3 + (A).cos()).cbrt()",
    "(A).sin().exp()",
    "(A).tanh().exp2()",
    "(A).cos().exp_m1()",
    "(1.5 + (A).sin()).ln()",
    "((A) * (A)).ln_1p()",
    "(0.7 + (A) * (A)).log2()",
    "(2.0 + (A).cos()).log10()",
    "(A).sin()",
    "(A).cos()",
    "(0.6 * (A).sin()).tan()",
    "(0.8 * (A).sin()).asin()",
    "(0.7 * (A).cos()).acos()",
    "(A).atan()",
    "(A).sin().sinh()",
    "(A).cos().cosh()",
    "(A).tanh()",
    "(A).asinh()",
    "(1.4 + (A) * (A)).acosh()",
    "(0.9 * (A).tanh()).atanh()",
    "(A).abs()",
    "(A) * (A).signum()",
    "(1.2 + (A) * (A)).recip()",
    "(A).to_radians()",
    "(A).sin().powi(2)",
    "(1.1 + (A).cos()).powi(-3)",
    "(A).tanh().powi(5)",
    "(1.1 + (A).sin()).powf(1.7)",
    "(1.6 + (A).cos()).powf(-0.4)",
    "(A).clamp(-0.6, 0.8)",
    "{ let (s, c) = (A).sin_cos(); s - 0.5 * c }",
];

/// Functions of two arguments, `A` and `B`.
const BINARY: &[&str] = &[
    "(A) + (B)",
    "(A) - (B)",
    "(A) * (B)",
    "(A) * (B)",
    "(A) / (1.5 + (B).sin())",
    "(A) / (1.0 + (B) * (B))",
    "(A).atan2(B)",
    "(A).hypot(B)",
    "(A).hypot(1.0 + (B) * (B))",
    "(1.2 + (A).sin()).powf((B).cos())",
    "(A).mul_add(B, 0.5)",
    "(A).min(B)",
    "(A).max(B)",
    "if A < B { (A) * (B) } else { (A).sin() + (B) }",
    "if (A) >= 0.2 && (B) < 0.5 { (A) - (B) * (B) } else { (B).cos() }",
    "if (A) <= -0.3 || !((B) > 0.1) { (B) * (B) } else { (A) + 1.5 * (B) }",
];

/// One model: bindings that use variables and earlier bindings, then equations that use the
/// bindings.
fn generate_model(text: &mut String, number: usize, turn: &mut usize) {
    let mut random = Random::new(1000 + number as u64);
    let explicit = number.is_multiple_of(3);
    let nx = 1 + random.below(4);
    let nu = random.below(3);
    let np = random.below(3);
    let nz = if explicit { 0 } else { random.below(3) };

    let mut leaves: Vec<String> = Vec::new();
    let mut arguments: Vec<String> = Vec::new();
    let mut argument = |name: &str, length: usize, leaves: &mut Vec<String>| {
        if length > 0 {
            arguments.push(format!("{name}: [f64; {length}]"));
            leaves.extend((0..length).map(|i| format!("{name}[{i}]")));
        }
    };
    if !explicit {
        argument("xdot", nx, &mut leaves);
    }
    argument("x", nx, &mut leaves);
    argument("z", nz, &mut leaves);
    argument("u", nu, &mut leaves);
    argument("p", np, &mut leaves);
    if number % 4 == 1 {
        arguments.push("t: f64".into());
        leaves.push("t".into());
    }

    let (attribute, length) = if explicit { ("ode", nx) } else { ("dae", nx + nz) };
    let _ = write!(
        text,
        "\n#[{attribute}]\npub fn random{number}({}) -> [f64; {length}] {{\n",
        arguments.join(", ")
    );
    // Every function in turn over all the models, so that none is left out; arguments at random.
    let bindings = 9;
    let mut operands = leaves.clone();
    for binding in 0..bindings {
        let total = UNARY.len() + BINARY.len();
        let template = |i: usize| if i < UNARY.len() { UNARY[i] } else { BINARY[i - UNARY.len()] };
        // Recent bindings are taken more often: expressions grow deep.
        let recent = |random: &mut Random| {
            if binding > 0 && random.below(2) == 0 {
                format!("a{}", binding - 1 - random.below(binding.min(3)))
            } else {
                leaves[random.below(leaves.len())].clone()
            }
        };
        let (a, b) = (recent(&mut random), recent(&mut random));
        let inner = fill_placeholders(template(*turn % total), &a, &b);
        let c = recent(&mut random);
        let outer = BINARY[random.below(6)];
        let expression = fill_placeholders(outer, "inner", &c);
        *turn += 1;
        let _ = write!(text, "    let inner = {inner};\n    let a{binding} = {expression};\n");
        operands.push(format!("a{binding}"));
    }
    text.push_str("    [\n");
    for row in 0..length {
        // All bindings occur: row by row in turn.
        let used: Vec<String> =
            (0..bindings).filter(|b| b % length == row).map(|b| format!("a{b}")).collect();
        let (a, b) = (used.join(" + "), &operands[random.below(operands.len())]);
        let right = fill_placeholders(BINARY[random.below(6)], &a, b);
        // Index 1: the unknown of the row with a coefficient that is never zero.
        let left = match (explicit, row < nx) {
            (true, _) => String::new(),
            (false, true) if number.is_multiple_of(2) => format!("xdot[{row}] - "),
            (false, true) => format!("(1.5 + x[{row}].sin()) * xdot[{row}] + "),
            (false, false) => format!("z[{0}] + z[{0}].powi(3) - 0.1 * ", row - nx),
        };
        let _ = writeln!(text, "        {left}({right}),");
    }
    text.push_str("    ]\n}\n");
}

fn fill_placeholders(template: &str, a: &str, b: &str) -> String {
    // Names of methods are lower case, so that the placeholders are the only capital letters.
    template.replace('A', a).replace('B', b)
}

/// Every function of the language that has a derivative occurs.
pub const FUNCTIONS: &[&str] = &[
    "sqrt",
    "cbrt",
    "exp",
    "exp2",
    "exp_m1",
    "ln",
    "ln_1p",
    "log2",
    "log10",
    "sin",
    "cos",
    "sin_cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "atan2",
    "sinh",
    "cosh",
    "tanh",
    "asinh",
    "acosh",
    "atanh",
    "hypot",
    "powi",
    "powf",
    "abs",
    "signum",
    "min",
    "max",
    "clamp",
    "mul_add",
    "recip",
    "to_radians",
];
