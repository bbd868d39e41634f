//! What the evaluator refuses, and what it says.

use super::evaluate;

fn refused(body: &str, message: &str) {
    let source = format!("fn f(x: [f64; 6]) -> f64 {{ {body} }}");
    match evaluate(&source) {
        Ok(_) => panic!("accepted: {body}"),
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains(message), "{body}: {text}");
        }
    }
}

#[test]
fn refusals() {
    refused("x[6]", "index out of range: the length is 6 but the index is 6");
    refused("x[0 - 1]", "");
    refused("let i = 3usize; x[i - 4]", "overflows `usize`");
    refused("let s = &x[4..9]; s[0]", "range out of bounds");
    refused("x[4 / (2 - 2)]", "has no value");
    refused("fn g(a: f64) -> f64 { g(a) } g(x[0])", "calls itself");
    refused("fn g(a: f64) -> f64 { h(a) } fn h(a: f64) -> f64 { g(a) } g(x[0])", "calls itself");
    refused("loop {} x[0]", "does this loop end");
    refused("let mut s = 0.0; while x[0] > 0.0 { s += 1.0; } s", "how often this loop runs depends");
    refused("if x[0] > 0.0 { return x[1]; } x[2]", "whether the function returns here");
    refused("for i in 0..3 { if x[i] > 0.0 { break; } } x[2]", "how often the loop runs");
    refused("let i = if x[0] > 0.0 { 1 } else { 2 }; x[i]", "an integer depends on model quantities");
    refused("x[x[0] as usize]", "has no derivative");
    refused("unknown(x[0])", "does not see the function `unknown`");
    refused("crate::params::mass(x[0])", "does not see the function `crate::params::mass`");
    refused("x[N]", "needed as an integer");
    refused("let mut s = 0.0; for i in 0..crate::N { s += x[i]; } s", "needed as an integer");
    refused("assert!(x[0] > 0.0); x[0]", "not known at compile time");
    refused("assert!(x.len() == 7, \"seven\"); x[0]", "");
    refused("println!(\"{}\", x[0]); x[0]", "the macro `println!`");
    refused("unsafe { x[0] }", "unsafe code");
    refused("const A: f64 = B; const B: f64 = A; A", "in terms of itself");
    refused("let [a, b] = x; a", "does not match");
    refused("let p = Point { x: 1.0 }; p.x", "does not see the definition of `Point`");
    refused(
        "let mut a = x[0]; let mut b = x[1]; let r = if x[2] > 0.0 { &mut a } else { &mut b }; *r",
        "choose between values",
    );
    refused("let a = if x[0] > 0.0 { Some(x[0]) } else { None }; 1.0", "between which nothing can choose");
    refused("let n: u8 = 255; let k = n + 1; x[0]", "overflows `u8`");
    refused("1.0f32", "`f64`");
    refused("let i: i32 = -1; x[i as usize]", "index out of range");
}

#[test]
fn nesting_is_bounded() {
    let deep = |n: usize| format!("{}x[0]{}", "(".repeat(n), ")".repeat(n));
    assert!(evaluate(&format!("fn f(x: [f64; 6]) -> f64 {{ {} }}", deep(60))).is_ok());
    refused(&deep(210), "nested more than");
    let blocks = |n: usize| format!("{}x[0]{}", "{ if true ".repeat(n), " else { 0.0 } }".repeat(n));
    let _ = evaluate(&format!("fn f(x: [f64; 6]) -> f64 {{ {} }}", blocks(10)));
}

#[test]
fn constants_from_outside() {
    let source = "fn f(x: [f64; 6]) -> f64 {
        let [a, b] = crate::PAIR; let t: [f64; 3] = TABLE;
        use crate::params::*; let g = || { use crate::params::*; gravity }; let k = g() + g();
        MASS * x[0] + k + crate::params::TABLE[1 + 1] * PARAMS.mass + MASS + (COUNT as f64) + a * b + t[1] }";
    let (evaluator, _) = evaluate(source).unwrap();
    let names: Vec<String> =
        evaluator.opaque.iter().map(|tokens| tokens.to_string().replace(' ', "")).collect();
    for name in [
        "MASS",
        "crate::params::TABLE[2]",
        "PARAMS.mass",
        "(COUNTasf64)",
        "crate::PAIR[0]",
        "TABLE[1]",
        "gravity",
    ] {
        assert_eq!(names.iter().filter(|known| *known == name).count(), 1, "{name} in {names:?}");
    }
    assert_eq!(evaluator.uses.len(), 1);
}
