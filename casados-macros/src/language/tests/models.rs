//! Complete models: size, time, nesting.

use super::super::{Form, read};
use quote::quote;

fn function(source: &str, name: &str) -> proc_macro2::TokenStream {
    let file = syn::parse_file(source).unwrap();
    let item =
        file.items.into_iter().find(|item| matches!(item, syn::Item::Fn(item) if item.sig.ident == name));
    quote!(#item)
}

#[test]
fn a_chain_of_any_length_is_linear_in_size() {
    let chain = function(include_str!("../../../../examples/models/chain.rs"), "chain");
    let operations = |nx: usize| {
        let nx = proc_macro2::Literal::usize_unsuffixed(nx);
        let start = std::time::Instant::now();
        let source =
            read(Form::Dae, quote!(NX = [#nx]), chain.clone()).unwrap_or_else(|error| panic!("{error}"));
        let model = &source.parts[0].models[0];
        println!("nx = {nx}: {:?}", start.elapsed());
        model.graph.operation_count(&model.residual)
    };
    // Every additional mass has the same cost: one spring, one row of accelerations and of
    // velocities.
    let (a, b, c) = (operations(45), operations(51), operations(189));
    assert_eq!(c - b, 23 * (b - a));
}

#[test]
fn nesting_of_every_kind_is_bounded() {
    super::on_compiler_stack(nested_models);
}

fn nested_models() {
    let wrap = |before: &str, after: &str, n: usize| {
        let body = format!("{}x[0]{}", before.repeat(n), after.repeat(n));
        format!("fn f(x: [f64; 6]) -> f64 {{ fn g(a: f64) -> f64 {{ a }} {body} }}")
    };
    for (before, after) in [
        ("{ if true { ", " } else { 0.0 } }"),
        ("g(", ")"),
        ("{ let a = ", "; a }"),
        ("(|a: f64| a)(", ")"),
        ("match 1 { 1 => ", ", _ => 0.0 }"),
        ("{ if x[1] > 0.0 { ", " } else { 0.0 } }"),
        ("f64::max(", ", 1.0)"),
        ("-", ""),
        ("[", "][0]"),
    ] {
        assert!(super::evaluate(&wrap(before, after, 20)).is_ok(), "{before}");
        let error = super::evaluate(&wrap(before, after, 205)).err().map(|error| error.to_string());
        assert!(error.is_some_and(|error| error.contains("nested too deeply")), "{before}");
    }
}

/// Long sums without parentheses, as written by other programs; on the stack of an expansion.
#[test]
fn sums_of_thousands_of_terms() {
    let terms: Vec<String> = (0..3000).map(|i| format!("{i}.5 * x[{}]", i % 6)).collect();
    let source = format!("fn f(x: [f64; 6]) -> f64 {{ {} }}", terms.join(" + "));
    let value = stacker::grow(crate::STACK_BYTES, || {
        let (evaluator, list) = super::evaluate(&source).unwrap();
        evaluator
            .graph
            .evaluate(&list, crate::graph::EvaluationPoint { variables: &[1.0; 6], ..Default::default() })
    });
    // Half-integers: `Σ (i + ½)`, exact.
    assert_eq!(value, [4_500_000.0]);
}

/// Deep nesting without parentheses is an error at the user's tokens.
#[test]
fn long_chains_are_errors() {
    let condition = |i: usize| format!("if x[0] < {i}.0 {{ {i}.0 }} else ");
    let conditions = (0..1500).map(condition).collect::<String>();
    let deep = "nested too deeply";
    for (body, expected) in [
        (format!("x[0]{}", ".sin()".repeat(5000)), deep),
        (format!("{conditions}{{ 0.0 }}"), deep),
        (format!("{}x[0]", "-".repeat(5000)), "more than 4096 terms"),
    ] {
        let source = format!("fn f(x: [f64; 6]) -> f64 {{ {body} }}");
        let error = stacker::grow(crate::STACK_BYTES, || {
            super::evaluate(&source).map(|_| ()).map_err(|e| e.to_string())
        });
        let message = error.expect_err("the chain is too long");
        assert!(message.contains(expected), "{message}");
    }
}

/// Modules that use each other, and unknown names: resolved in bounded time.
#[test]
fn uses_that_lead_in_circles() {
    let names = ["a", "b", "c", "d", "e", "g"];
    let module = |name: &str| {
        let others: String = names.iter().map(|other| format!("pub use super::{other}::*; ")).collect();
        format!(
            "pub mod {name} {{ {others} pub use super::a::K; pub use super::b::T as T; pub use self::r#in as r#in; }} "
        )
    };
    let modules: String = names.iter().map(|name| module(name)).collect();
    let of = |body: &str| {
        let source = format!("mod m {{ {modules} pub fn m(x: f64) -> f64 {{ {body} }} }}");
        read(Form::Ode, quote!(), syn::parse_str(&source).unwrap())
    };
    assert!(of("a::K * x + b::other::K + super::super::K + self::a::b::LIMIT").is_ok());
    for body in ["a::f(x)", "super::m::f(x)", "self::self::f(x)", "c::T { y: x }.y", "a::r#in(x)"] {
        let error = of(body).err().map(|error| error.to_string());
        assert!(error.is_some_and(|error| error.contains("does not see")), "{body}");
    }
}
