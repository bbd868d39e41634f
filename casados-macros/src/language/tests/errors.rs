//! Errors of the evaluator, and their messages.

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
fn refused_expressions() {
    refused("x[6]", "index out of range: the length is 6 but the index is 6");
    refused("x[0 - 1]", "");
    refused("let i = 3usize; x[i - 4]", "overflows `usize`");
    refused("let s = &x[4..9]; s[0]", "range out of bounds");
    refused("x[4 / (2 - 2)]", "has no value");
    refused("fn g(a: f64) -> f64 { g(a) } g(x[0])", "calls itself");
    refused("fn g(a: f64) -> f64 { h(a) } fn h(a: f64) -> f64 { g(a) } g(x[0])", "calls itself");
    refused("loop {} x[0]", "does this loop end");
    refused("let mut s = 0.0; while x[0] > 0.0 { s += 1.0; } s", "how often this loop runs depends");
    refused("if x[0] > 0.0 { return x[1]; } x[2]", "this early `return` depends on model variables");
    refused("for i in 0..3 { if x[i] > 0.0 { break; } } x[2]", "how often the loop runs");
    refused("let i = if x[0] > 0.0 { 1 } else { 2 }; x[i]", "this integer depends on model variables");
    refused("x[x[0] as usize]", "has no derivative");
    refused("unknown(x[0])", "does not see the function `unknown`");
    refused("crate::params::mass(x[0])", "does not see the function `crate::params::mass`");
    for call in ["smooth::abs(x[0])", "crate::smooth::max(x[0], x[1])", "super::helpers::sin(x[0])"] {
        refused(call, "does not see the function");
    }
    refused("use crate::smooth::abs; abs(x[0])", "does not see the function `crate::smooth::abs`");
    refused("Outside::sqrt(x[0])", "does not see the function `Outside::sqrt`");
    refused("let k: f64 = gains::default(); k * x[0]", "does not see the function `gains::default`");
    refused("x.map(smooth::abs)[0]", "does not see the function `smooth::abs`");
    refused("let k: f64 = crate::array::from_fn(|i| 0.0); k", "does not see the function");
    refused("nalgebra::Quaternion::new(x[0], x[1], x[2], x[3]).norm()", "four numbers of the state");
    refused("use nalgebra::DVector; DVector::zeros(3).norm() + x[0]", "`SVector`, `SMatrix`");
    refused("x[0] * 1_u128 as f64", "a model has no `u128`");
    refused(
        "let n: u128 = 340282366920938463463374607431768211455; x[0] * n as f64",
        "a model has no `u128`",
    );
    refused("x[0] * 340282366920938463463374607431768211455 as f64", "does not fit into an `i128`");
    refused("x[N]", "needed as an integer");
    refused("let mut s = 0.0; for i in 0..crate::N { s += x[i]; } s", "needed as an integer");
    refused("assert!(x[0] > 0.0); x[0]", "not known at compile time");
    refused("assert!(x.len() == 7, \"seven\"); x[0]", "");
    refused("println!(\"{}\", x[0]); x[0]", "the macro `println!`");
    refused("unsafe { x[0] }", "unsafe code");
    refused("const A: f64 = B; const B: f64 = A; A", "in terms of itself");
    refused("let [a, b] = x; a", "does not match");
    refused(
        "let mut s = 0.0; for i in 0..6 { s += match i { LIMIT => 0.0, _ => x[i] }; } s",
        "as an integer",
    );
    refused("match (x[0], 1usize) { (_, LIMIT) => 0.0, _ => x[1] }", "as an integer");
    refused("use crate::Mode::*; match Some(2) { Some(Fast) => x[0], _ => x[1] }", "as an integer");
    refused("match u8::try_from(-1) { Ok(_) => x[0], Err(e) => x[1] }", "write `Err(_)`");
    refused("match Some(1) { Many(n) => x[0], _ => x[1] }", "this pattern on an `Option`");
    refused("let p = Point { x: 1.0 }; p.x", "does not see the definition of `Point`");
    refused(
        "let mut a = x[0]; let mut b = x[1]; let r = if x[2] > 0.0 { &mut a } else { &mut b }; *r",
        "choose between values",
    );
    refused(
        "let a = if x[0] > 0.0 { Some(x[0]) } else { None }; 1.0",
        "must be numbers or arrays of equal length",
    );
    refused("let n: u8 = 255; let k = n + 1; x[0]", "overflows `u8`");
    refused("1.0f32", "`f64`");
    refused("let mut f = 1; for k in 1..14 { f *= k; } x[0] * f as f64", "overflows `i32`: if another type");
    refused("x[0] * (1 << 31) as f64", "overflows `i32`");
    refused(
        "let mut r = [0.0; 3]; for i in 0..3 { for j in 0..3 { r[i] += (i - j) as f64 * x[j]; } } r[0]",
        "overflows `usize`",
    );
    refused("let k = 2i32; let n = (k - 5).try_into().unwrap_or(0); x[n]", "write `usize::try_from(..)`");
    refused("let k = 300i32; let n: u8 = k.into(); x[0]", "300 does not fit into `u8`");
    refused("x[0].clamp(1.0, 0.0)", "the bounds of `clamp` are 1 > 0");
    refused("let n = (-1i128..).len(); x[n]", "");
    for many in [
        "nalgebra::SMatrix::<f64, 100000, 100000>::zeros()[0]",
        "nalgebra::SMatrix::<f64, 9000000000000000000, 9000000000000000000>::identity()[0]",
        "let a: [f64; 100000000] = core::array::repeat(0.0); a[0]",
        "let a: [f64; 100000000] = Default::default(); a[0]",
        "let a: nalgebra::SMatrix<f64, 9000000000000000000, 9> = Default::default(); a[0]",
    ] {
        refused(many, "evaluation steps");
    }
    refused("let i: i32 = -1; x[i as usize]", "index out of range");
}

/// `head` and `tail` around `x[0]`, `n` times.
fn nested(head: &str, tail: &str, n: usize) -> String {
    format!("{}x[0]{}", head.repeat(n), tail.repeat(n))
}

#[test]
fn nesting_is_bounded() {
    super::on_compiler_stack(nested_errors);
}

fn nested_errors() {
    // The first ones are expressions, the others blocks, closures and calls.
    const EXPRESSIONS: usize = 13;
    let forms = [
        ("(", ")"),
        ("-", ""),
        ("x[1] + (", ")"),
        ("{ ", " }"),
        ("if x[1] > 0.0 { ", " } else { 0.0 }"),
        ("if true { ", " } else { 0.0 }"),
        ("Some(", ").unwrap()"),
        ("[", "][0]"),
        ("(", ", 0.0).0"),
        ("x[1].max(", ")"),
        ("", ".sin()"),
        ("f64::max(x[1], ", ")"),
        ("f64::sin(", ")"),
        ("{ let y = ", "; y }"),
        ("match 1 { 0 => 0.0, _ => ", " }"),
        ("match x[1] > 0.0 { true => 0.0, false => ", " }"),
        ("{ let mut y = 0.0; for _ in 0..1 { y += ", "; } y }"),
        ("loop { break ", "; }"),
        ("(|a: f64| a + ", ")(x[1])"),
        ("(0..1).map(|_| ", ").sum::<f64>()"),
        ("core::array::from_fn::<f64, 1, _>(|_| ", ")[0]"),
        ("[0.0].iter().fold(0.0, |a: f64, b| a + b + ", ")"),
        ("twice(", ")"),
        ("Number(", ").twice().0"),
        ("Number { 0: ", " }.0"),
        ("(Number(x[1]) + Number(", ")).0"),
    ];
    let items = "struct Number(f64); \
        impl Number { fn twice(self) -> Number { Number(twice(self.0)) } } \
        impl core::ops::Add for Number { type Output = Number; fn add(self, other: Number) -> Number { \
        Number(self.0 + other.0) } } fn twice(a: f64) -> f64 { a + a }";
    let body = |expression: &str| format!("fn f(x: [f64; 6]) -> f64 {{ {items} {expression} }}");
    for (number, (head, tail)) in forms.into_iter().enumerate() {
        let source = |n: usize| body(&nested(head, tail, n));
        let depth = if number < EXPRESSIONS { 60 } else { 20 };
        if let Err(error) = evaluate(&source(depth)) {
            panic!("{depth} times {head} {tail}: {error}");
        }
        // At most one, two, three brackets per level: up to the limit of the parser, and deeper.
        for depth in [84, 126, 150, 250, 300] {
            if let Err(error) = evaluate(&source(depth)) {
                let error = error.to_string();
                assert!(error.contains("nested too deeply"), "{depth} times {head} {tail}: {error}");
            }
        }
    }
    // Calls nest as well.
    let calls = |n: usize| {
        let functions: String =
            (0..n).map(|i| format!("fn f{i}(a: f64) -> f64 {{ f{}(a) + 1.0 }} ", i + 1)).collect();
        format!("fn f(x: [f64; 6]) -> f64 {{ {functions} fn f{n}(a: f64) -> f64 {{ a }} f0(x[0]) }}")
    };
    assert!(evaluate(&calls(20)).is_ok());
    let error = evaluate(&calls(300)).err().map(|error| error.to_string());
    assert!(error.is_some_and(|error| error.contains("nested too deeply")));
}

#[test]
fn dual_models_need_their_feature() {
    let function = syn::parse_quote! { fn f<T: DualNum + Copy>(xdot: [T; 1]) -> [T; 1] { xdot } };
    let error = crate::language::dual::require_feature(&function, false).unwrap_err().to_string();
    assert!(error.contains("needs the feature `num-dual`") && error.contains("with `f64`"), "{error}");
    assert!(crate::language::dual::require_feature(&function, true).is_ok());
}

/// A capital letter makes a name in a refutable pattern a constant.
#[test]
fn constants_from_outside_in_patterns() {
    let source = "fn f(x: [f64; 6]) -> f64 {
        let M = x[1]; let (A, [B, ..]) = (x[2], x); let g = |C: f64| C * M;
        match x[0] { LIMIT => g(A), crate::OTHER => B, _ => x[3] } }";
    let (evaluator, list) = evaluate(source).unwrap();
    let value = |opaque: &[f64]| {
        let variables = &[2.0, 3.0, 5.0, 7.0];
        evaluator.graph.evaluate(&list, crate::graph::EvaluationPoint { variables, opaque, seeds: &[] })[0]
    };
    assert_eq!((value(&[2.0, 1.0]), value(&[1.0, 2.0]), value(&[1.0, 1.0])), (15.0, 2.0, 7.0));
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
