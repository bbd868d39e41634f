//! Golden expansions of small models whose graphs are built by hand.

use super::expand;
use crate::graph::{Binary, Compare, Graph, Node, Unary};
use crate::language::units::Units;
use crate::language::{Instance, Model, Place, Variables};
use crate::structure::{Analysis, analyse};
use proc_macro2::{Span, TokenStream};
use quote::quote;

fn names(name: &str, length: usize) -> Vec<String> {
    (0..length).map(|index| format!("{name}[{index}]")).collect()
}

/// A model; the dimensions are those of `x`, `z`, `u`, `p`.
fn model(name: &str, [nx, nz, nu, np]: [usize; 4], graph: Graph, residual: Vec<Node>) -> Model {
    Model {
        name: syn::Ident::new(name, Span::call_site()),
        visibility: syn::parse_quote!(pub),
        documentation: vec![syn::parse_quote!(#[doc = " A model."])],
        instance: Vec::new(),
        variables: Variables { x: names("x", nx), z: names("z", nz), u: names("u", nu), p: names("p", np) },
        units: Units::default(),
        samplings: Vec::new(),
        reduction: None,
        duration: None,
        extra: crate::language::Extra::default(),
        is_model: false,
        graph,
        spans: vec![Span::call_site(); residual.len()],
        residual,
        opaque: Vec::new(),
        tables: Vec::new(),
        uses: Vec::new(),
        krate: syn::parse_quote!(::casados),
    }
}

fn analysis(model: Model) -> Analysis {
    analyse(model).unwrap()
}

fn expanded_text(item: TokenStream, place: Place, models: Vec<Analysis>) -> String {
    let (name, _) = super::named_item(&item).unwrap();
    let file: syn::File =
        syn::parse2(expand(item, place, &[super::ReadItem::Models(name, models)]).unwrap()).unwrap();
    prettyplease::unparse(&file)
}

/// A graph under construction from formulas.
struct Builder(Graph);

impl Builder {
    fn v(&mut self, index: u32) -> Node {
        self.0.variable(index)
    }
    fn c(&mut self, value: f64) -> Node {
        self.0.constant(value)
    }
    fn add(&mut self, a: Node, b: Node) -> Node {
        self.0.binary(Binary::Add, a, b)
    }
    fn sub(&mut self, a: Node, b: Node) -> Node {
        self.0.binary(Binary::Sub, a, b)
    }
    fn mul(&mut self, factors: &[Node]) -> Node {
        let (first, rest) = factors.split_first().unwrap();
        rest.iter().fold(*first, |product, &factor| self.0.binary(Binary::Mul, product, factor))
    }
    fn div(&mut self, a: Node, b: Node) -> Node {
        self.0.binary(Binary::Div, a, b)
    }
}

/// The pendulum on a cart, evaluated from left to right.
fn pendulum() -> Model {
    let mut b = Builder(Graph::default());
    let xdot: Vec<Node> = (0..4).map(|i| b.v(i)).collect();
    let [theta, v, omega, u] = [5, 6, 7, 8].map(|i| b.v(i));
    let (s, c) = (b.0.unary(Unary::Sin, theta), b.0.unary(Unary::Cos, theta));
    let (cart, m, l, g) = (1.0, 0.1, 0.8, 9.81);
    let (total, mass) = (b.c(cart + m), b.c(m));
    let mcc = b.mul(&[mass, c, c]);
    let denominator = b.sub(total, mcc);
    let (ml, mg) = (b.c(-m * l), b.c(m * g));
    let swing = b.mul(&[ml, s, omega, omega]);
    let weight = b.mul(&[mg, c, s]);
    let force = b.add(swing, weight);
    let force = b.add(force, u);
    let acceleration = b.div(force, denominator);
    let swing = b.mul(&[ml, c, s, omega, omega]);
    let uc = b.mul(&[u, c]);
    let tg = b.c((cart + m) * g);
    let weight = b.mul(&[tg, s]);
    let torque = b.add(swing, uc);
    let torque = b.add(torque, weight);
    let length = b.c(l);
    let inertia = b.mul(&[length, denominator]);
    let angular = b.div(torque, inertia);
    let residual = [(0, v), (1, omega), (2, acceleration), (3, angular)].map(|(i, g)| b.sub(xdot[i], g));
    model("Pendulum", [4, 0, 1, 0], b.0, residual.to_vec())
}

/// `x' z = p max(x, 0)`, `z + t = RATE`: a selection, a constant from outside, time; implicit,
/// without controls.
fn valve() -> Model {
    let mut b = Builder(Graph::default());
    let [xdot, x, z, p, t] = [0, 1, 2, 3, 4].map(|i| b.v(i));
    let zero = b.c(0.0);
    let open = b.0.compare(Compare::Lt, zero, x);
    let level = b.0.select(open, x, zero);
    let left = b.mul(&[xdot, z]);
    let right = b.mul(&[p, level]);
    let rate = b.0.opaque(0);
    let sum = b.add(z, t);
    let residual = vec![b.sub(left, right), b.sub(sum, rate)];
    let mut model = model("Valve", [1, 1, 0, 1], b.0, residual);
    model.opaque = vec![quote!(RATE)];
    model.uses = vec![syn::parse_quote!(
        use crate::tables::RATE;
    )];
    model
}

/// `x' = -N x`, for `N` states.
fn decay(length: u32) -> Model {
    let mut b = Builder(Graph::default());
    let rate = b.c(f64::from(length));
    let residual = (0..length).map(|i| {
        let (xdot, x) = (b.v(i), b.v(length + i));
        let flow = b.mul(&[rate, x]);
        b.add(xdot, flow)
    });
    let residual = residual.collect();
    let mut model = model("Decay", [length as usize, 0, 0, 0], b.0, residual);
    model.instance =
        vec![Instance { name: syn::parse_quote!(N), ty: syn::parse_quote!(usize), value: u64::from(length) }];
    model
}

#[test]
fn of_a_pendulum() {
    let item = quote!(
        fn pendulum() {}
    );
    insta::assert_snapshot!(expanded_text(item, Place::Beside, vec![analysis(pendulum())]));
}

#[test]
fn of_a_module_with_a_selection_and_an_outer_constant() {
    let item = quote!(
        mod valve {
            fn model() {}
        }
    );
    insta::assert_snapshot!(expanded_text(item, Place::Inside, vec![analysis(valve())]));
}

#[test]
fn of_instances_of_an_explicit_model() {
    let item = quote!(
        fn decay<const N: usize>() {}
    );
    insta::assert_snapshot!(expanded_text(item, Place::Beside, vec![analysis(decay(1)), analysis(decay(2))]));
}

#[test]
fn types_are_emitted_with_errors() {
    let item = quote!(
        pub(crate) fn chain_of_masses<const N: usize>(x: [f64; N]) {}
    );
    let error = syn::Error::new(Span::call_site(), "what is wrong");
    let file: syn::File = syn::parse2(super::with_errors(quote!(N = 3), item, &error)).unwrap();
    insta::assert_snapshot!(prettyplease::unparse(&file));
}
