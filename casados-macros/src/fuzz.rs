//! Random tokens and mutated models: they expand to errors at tokens, without a panic and in
//! bounded time. All tests are seeded and reproducible.

use super::expand;
use crate::language::Form;
use proc_macro2::{Delimiter, Group, Ident, Literal, Punct, Spacing, Span, TokenStream, TokenTree};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// Models that use most of the language.
const MODELS: [&str; 6] = [
    "fn oscillator(x: [f64; 2], u: f64, p: [f64; 2]) -> [f64; 2] { [x[1], u - p[0] * x[0].sin() - p[1] * x[1].abs()] }",
    "fn pendulum(xdot: [f64; 4], x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
        const CART: f64 = 1.0; const BALL: f64 = 0.1;
        let [_, angle, velocity, omega] = x;
        let (sin, cos) = angle.sin_cos();
        let mass = CART + BALL - BALL * cos * cos;
        [xdot[0] - velocity, xdot[1] - omega, mass * xdot[2] - u[0], xdot[3] - 9.81 * sin]
    }",
    "fn chain(x: [f64; 6], u: [f64; 2]) -> [f64; 6] {
        let mut rates = [0.0; 6];
        for i in 0..3 {
            let before = if i == 0 { 0.0 } else { x[i - 1] };
            rates[i] = x[3 + i];
            rates[3 + i] = before - 2.0 * x[i] + x.get(i + 1).copied().unwrap_or(1.0);
        }
        let sum: f64 = x.iter().zip(&rates).map(|(a, b)| a * b).sum();
        rates[5] += u[0] * sum.max(0.0) + u.iter().fold(0.0, |s, v| s + v * v);
        rates
    }",
    "fn branches(x: f64, z: f64, xdot: f64, p: f64, t: f64) -> [f64; 2] {
        let slope = match x { v if v > 1.0 => v.ln(), _ => 0.5 * x };
        let helper = |a: f64, b: f64| -> f64 { (a * a + b * b).sqrt() };
        [xdot - helper(slope, z) * t.cos(), z.powi(3) + p * z - x.clamp(-2.0, 2.0)]
    }",
    "mod model {
        pub struct State { pub position: [f64; 2], pub speed: f64 }
        const N: usize = 2;
        fn norm(v: [f64; N]) -> f64 { let mut s = 0.0; for e in v { s += e * e; } s.sqrt() }
        pub fn rocket(x: State, u: f64) -> State {
            State { position: [x.speed, norm(x.position)], speed: u - x.speed.powf(1.5) }
        }
    }",
    "fn matrices(x: SVector<f64, 2>, p: [f64; 4]) -> SVector<f64, 2> {
        let a = SMatrix::<f64, 2, 2>::new(p[0], p[1], p[2], p[3]);
        let y = a * x + a.transpose() * x;
        y.component_mul(&x) * 0.5
    }",
];

const ATTRIBUTES: [&str; 5] =
    ["", "name = Model", "range(x = -1.0..=1.0)", "nominal(x = 0.5), name = Other", "sizes(x = 3), linear"];

const TOKEN_WORDS: [&str; 54] = [
    "fn", "mod", "let", "mut", "for", "in", "if", "else", "match", "while", "loop", "return", "break",
    "continue", "const", "struct", "impl", "use", "pub", "self", "Self", "as", "ref", "move", "where", "dyn",
    "f64", "f32", "usize", "bool", "x", "xdot", "z", "u", "p", "t", "model", "sin", "sum", "map", "iter",
    "core", "array", "from_fn", "SMatrix", "Some", "None", "true", "r#fn", "_", "vec", "panic", "unwrap",
    "T",
];

const TOKEN_NUMBERS: [&str; 16] = [
    "0",
    "1",
    "2",
    "3",
    "7",
    "0.0",
    "1.5",
    "1e400",
    "1e-400",
    "18446744073709551615",
    "18446744073709551616",
    "1000000000",
    "0x7f",
    "1_0",
    "2usize",
    "3f32",
];

const PUNCTUATION: &str = "+-*/%^!&|=<>,;:.?@#$~'";

struct Source(u64);

impl Source {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) % bound.max(1) as u64) as usize
    }

    fn token(&mut self, depth: usize) -> TokenTree {
        match self.below(12) {
            0..=4 => match TOKEN_WORDS[self.below(TOKEN_WORDS.len())] {
                "r#fn" => Ident::new_raw("fn", Span::call_site()).into(),
                word => Ident::new(word, Span::call_site()).into(),
            },
            5 | 6 => {
                let number: Literal =
                    TOKEN_NUMBERS[self.below(TOKEN_NUMBERS.len())].parse().expect("a literal");
                number.into()
            }
            7 => Literal::string("text").into(),
            8 if depth > 0 => {
                let length = self.below(6);
                let inner = (0..length).map(|_| self.token(depth - 1)).collect();
                Group::new(self.delimiter(), inner).into()
            }
            _ => {
                let punctuation = PUNCTUATION.as_bytes()[self.below(PUNCTUATION.len())] as char;
                // A single quote alone is the start of an incomplete lifetime.
                let spacing =
                    if self.below(2) == 0 || punctuation == '\'' { Spacing::Joint } else { Spacing::Alone };
                Punct::new(punctuation, spacing).into()
            }
        }
    }

    fn delimiter(&mut self) -> Delimiter {
        [Delimiter::Parenthesis, Delimiter::Brace, Delimiter::Bracket, Delimiter::None][self.below(4)]
    }

    /// The tokens with one random change, at any depth.
    fn mutate(&mut self, tokens: TokenStream) -> TokenStream {
        let mut list: Vec<TokenTree> = tokens.into_iter().collect();
        let groups: Vec<usize> =
            (0..list.len()).filter(|i| matches!(list[*i], TokenTree::Group(_))).collect();
        if !groups.is_empty() && self.below(5) > 0 {
            let place = groups[self.below(groups.len())];
            if let TokenTree::Group(group) = list[place].clone() {
                let delimiter = if self.below(20) == 0 { self.delimiter() } else { group.delimiter() };
                list[place] = Group::new(delimiter, self.mutate(group.stream())).into();
                return list.into_iter().collect();
            }
        }
        let (place, other) = (self.below(list.len()), self.below(list.len()));
        match self.below(6) {
            _ if list.is_empty() => list.push(self.token(2)),
            0 => drop(list.remove(place)),
            1 => list.insert(place, list[other].clone()),
            2 => list.swap(place, other),
            3 => list[place] = list[other].clone(),
            4 => list.insert(place, self.token(2)),
            _ => list[place] = self.token(2),
        }
        list.into_iter().collect()
    }
}

/// Time limit of an expansion in an unoptimised build on a busy machine.
const MAX_EXPANSION_TIME: Duration = Duration::from_secs(20);

/// Expands an item within the time limit; returns whether it is a model.
fn expands_in_time(seed: u64, form: Form, attribute: TokenStream, item: TokenStream) -> bool {
    let (text, begin) = (format!("seed {seed}: #[{attribute}] {item}"), Instant::now());
    let outcome = catch_unwind(AssertUnwindSafe(|| expand(form, attribute, item).to_string()));
    assert!(begin.elapsed() < MAX_EXPANSION_TIME, "{:?}: {text}", begin.elapsed());
    match outcome {
        Ok(expanded) => !expanded.contains("compile_error"),
        Err(_) => panic!("{text}"),
    }
}

fn form(seed: u64) -> Form {
    if seed.is_multiple_of(2) { Form::Dae } else { Form::Ode }
}

/// The models are valid before mutation, so that the mutations cause the rejections.
#[test]
fn models_are_models() {
    for (index, model) in MODELS.iter().enumerate() {
        let form = if model.contains("xdot") { Form::Dae } else { Form::Ode };
        let expanded = expand(form, TokenStream::new(), model.parse().expect("tokens")).to_string();
        assert!(!expanded.contains("compile_error"), "{index}: {expanded}");
    }
}

#[test]
fn random_tokens_expand() {
    for seed in 0..4000 {
        let mut source = Source(seed);
        let length = source.below(40);
        let mut item: TokenStream = (0..length).map(|_| source.token(3)).collect();
        if source.below(2) == 0 {
            // The item starts like a function.
            let begin: TokenStream = "fn f(x: [f64; 2], u: f64) -> [f64; 2]".parse().expect("tokens");
            item = begin.into_iter().chain([Group::new(Delimiter::Brace, item).into()]).collect();
        }
        let length = source.below(6);
        let attribute = (0..length).map(|_| source.token(2)).collect();
        expands_in_time(seed, form(seed), attribute, item);
    }
}

#[test]
fn mutated_models() {
    let mut models = 0;
    for seed in 0..4000 {
        let mut source = Source(seed);
        let mut item: TokenStream = MODELS[source.below(MODELS.len())].parse().expect("tokens");
        let mut attribute: TokenStream = ATTRIBUTES[source.below(ATTRIBUTES.len())].parse().expect("tokens");
        for _ in 0..1 + source.below(4) {
            item = source.mutate(item);
        }
        if source.below(4) == 0 {
            attribute = source.mutate(attribute);
        }
        models += usize::from(expands_in_time(seed, form(seed), attribute, item));
    }
    // Some mutations leave a valid model (57 of these seeds), and some do not.
    assert!((20..3900).contains(&models), "{models}");
}
