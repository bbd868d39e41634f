//! Tests without an integrator: patterns, indices, names.

mod cache;
mod interface;

use super::dependence::{self, Dimensions};
use super::entries::{EntryTerm, MatrixSum};
use super::function::Port;
use super::groups::groups;
use super::second::Blocks;
use super::signature::{Entry, Output, Shape, Source};
use super::sparsity::{Dependence, Sparsity};
use crate::structure::Pattern;
use alloc::borrow::ToOwned;
use alloc::vec;
use alloc::vec::Vec;

#[test]
fn patterns_are_compressed_columns() {
    let lower = Sparsity::new(3, 2, |row, column| row > column);
    assert_eq!(lower.compressed(), [3, 2, 0, 2, 3, 1, 2, 2]);
    assert_eq!(lower.entries(), [(1, 0), (2, 0), (2, 1)]);
    assert_eq!(Sparsity::vector(4).compressed(), [4, 1, 1]);
    assert_eq!(Sparsity::vector(0).compressed(), [0, 1, 0, 0]);
    assert_eq!(Sparsity::zero(2, 3).compressed(), [2, 3, 0, 0, 0, 0]);
    assert_eq!(Sparsity::zero(2, 0).compressed(), [2, 0, 0]);

    let (transposed, order) = lower.transposed();
    assert_eq!(transposed.entries(), [(0, 1), (0, 2), (1, 2)]);
    assert_eq!(transposed.dimensions(), [2, 3]);
    assert_eq!(order, [0, 1, 2]);
    let (_, order) = Sparsity::vector(2).diagonal(1).transposed();
    assert_eq!(order, [0, 1]);
    let full = Sparsity::new(2, 2, |_, _| true);
    // Row by row, from entries in column-major order.
    assert_eq!(full.transposed().1, [0, 2, 1, 3]);
    let upper = Sparsity::new(2, 2, |row, column| row <= column);
    assert_eq!(upper.symmetric(), (full, vec![0, 1, 1, 2]));
    let one = Sparsity::new(3, 3, |row, column| row == 0 && column == 2);
    assert_eq!(one.symmetric().0.entries(), [(2, 0), (0, 2)]);
    assert_eq!(lower.diagonal(2).entries(), [(1, 0), (2, 0), (2, 1), (4, 2), (5, 2), (5, 3)]);
    assert_eq!(lower.diagonal(2).dimensions(), [6, 4]);
}

#[test]
fn relations_have_blocks() {
    let mut relation = Dependence::zero(2, 3);
    relation.set(0, 2);
    relation.set(1, 0);
    assert_eq!(relation.block(0..2, 1..3).entries(), [(0, 1)]);
    assert_eq!(relation.transposed_block(0..2, 1..3).entries(), [(1, 0)]);
    let other = relation.clone();
    assert!(relation.add_row(0, &other, 1));
    assert!(!relation.add_row(0, &other, 1));
    assert_eq!(relation.row(0), [true, false, true]);
}

/// `ẋ₀ = u − x₀`, `ẋ₁ = x₀ − x₁`, `ẋ₂ = x₁`: variables `(ẋ, x, u)`.
const CASCADE: Pattern = Pattern { rows: &[0, 1, 2, 0, 1, 1, 2, 0], columns: &[0, 1, 2, 3, 3, 4, 4, 6] };
const CASCADE_DIMENSIONS: Dimensions = Dimensions { nx: 3, nz: 0, nw: 4 };

#[test]
fn implicit_methods_depend_on_all_that_leads_there() {
    let variables = dependence::variables(CASCADE_DIMENSIONS, CASCADE, None);
    let states = variables.block(3..6, 0..4);
    // No equation depends on the last state.
    let expected = [[1, 0, 0, 1], [1, 1, 0, 1], [1, 1, 1, 1]];
    assert_eq!(states, Sparsity::new(3, 4, |row, column| expected[row][column] == 1));
}

#[test]
fn explicit_methods_reach_an_equation_further_with_each_evaluation() {
    let states = |depth| dependence::variables(CASCADE_DIMENSIONS, CASCADE, Some(depth)).block(3..6, 0..4);
    let once = [[1, 0, 0, 1], [1, 1, 0, 0], [0, 1, 1, 0]];
    assert_eq!(states(1), Sparsity::new(3, 4, |row, column| once[row][column] == 1));
    let twice = [[1, 0, 0, 1], [1, 1, 0, 1], [1, 1, 1, 0]];
    assert_eq!(states(2), Sparsity::new(3, 4, |row, column| twice[row][column] == 1));
    assert_eq!(states(3), dependence::variables(CASCADE_DIMENSIONS, CASCADE, None).block(3..6, 0..4));
}

/// `z₀ = x₀` is equation 1, `ẋ₀ = z₁` is 2, and `z₁ = z₀ p` is 0: no equation has the index of its
/// unknown.
#[test]
fn equations_are_matched_with_unknowns() {
    let jacobian = Pattern { rows: &[0, 0, 0, 1, 1, 2, 2], columns: &[2, 3, 5, 1, 2, 0, 3] };
    let dimensions = Dimensions { nx: 1, nz: 2, nw: 3 };
    let variables = dependence::variables(dimensions, jacobian, None);
    assert_eq!(variables.row(2), [true, false, true]);
    // Through the state, which depends on the other one.
    assert_eq!(variables.row(1), [true, false, true]);
    assert_eq!(variables.row(4), [false, true, false]);
    let mut hessian = Dependence::zero(3, 3);
    dependence::curvature(&variables, Pattern { rows: &[5], columns: &[4] }, &mut hessian);
    assert_eq!(hessian.block(0..3, 0..3).entries(), [(2, 1), (1, 2)]);
}

#[test]
fn second_derivatives_lie_in_blocks() {
    let blocks = Blocks([2, 1, 3]);
    assert_eq!(blocks.len(), 4 + 2 + 1 + 6 + 3 + 9);
    assert_eq!(blocks.block_layout(0, 0), [0, 1, 2]);
    assert_eq!((blocks.block_layout(0, 1), blocks.block_layout(1, 0)), ([4, 1, 2], [4, 2, 1]));
    assert_eq!((blocks.block_layout(1, 2), blocks.block_layout(2, 1)), ([13, 1, 1], [13, 1, 1]));
    assert_eq!((blocks.block_layout(0, 2), blocks.block_layout(2, 0)), ([7, 1, 2], [7, 2, 1]));
    assert_eq!(blocks.block_layout(2, 2), [16, 1, 3]);
    // Every index belongs to one pair, or to both orders of a pair.
    let mut count = [0; 25];
    (0..6).for_each(|i| (0..6).for_each(|j| count[blocks.index(i, j)] += 1));
    let expected = [vec![1; 4], vec![2; 2], vec![1], vec![2; 9], vec![1; 9]].concat();
    assert_eq!(count.to_vec(), expected);
}

#[test]
fn names_make_groups() {
    let x = ["x.q[0]", "x.q[1]", "x.arm.q", "x.cart.r[0][0]", "x.cart.r[0][1]"];
    let found = groups([&x, &["u[0]", "u.force", "u.x_q", "u.größe"]]);
    let said: Vec<_> = found.iter().map(|g| (g.name.to_str().unwrap(), g.controls, g.rows.clone())).collect();
    let expected = [
        ("x_q", false, 0..2),
        ("x_arm_q", false, 2..3),
        ("x_cart_r", false, 3..5),
        ("u_force", true, 1..2),
        ("u_x_q", true, 2..3),
        ("u_gr_e", true, 3..4),
    ];
    assert_eq!(said, expected);
    // The second of two groups with one name is dropped.
    assert_eq!(groups([&["x.a.b", "x.c", "x.a_b"], &[]]).len(), 2);
    assert!(groups([&["x[0]", "x[1]"], &["u[0]"]]).is_empty());
}

#[test]
fn matrices_are_sums_of_numbers_of_stages() {
    let node = |index| EntryTerm::Node { stage: 0, index };
    let interval = |stage, block, index| EntryTerm::Interval { stage, block, index };
    // Column 0 with stride two, an entry of two intervals, a node and a constant, a constant alone;
    // and successive entries of one block and of two.
    let terms = vec![
        ([0, 1], EntryTerm::Constant(100.0)),
        ([0, 1], node(2)),
        ([0, 0], node(1)),
        ([1, 0], node(3)),
        ([2, 0], node(5)),
        ([0, 1], interval(0, 1, 0)),
        ([0, 1], interval(1, 0, 1)),
        ([2, 1], EntryTerm::Constant(-1.0)),
        ([0, 2], interval(0, 0, 1)),
        ([1, 2], interval(0, 0, 2)),
        ([2, 2], interval(0, 1, 1)),
    ];
    let entries = MatrixSum::new(3, 3, terms);
    assert_eq!(entries.sparsity.entries(), [(0, 0), (1, 0), (2, 0), (0, 1), (2, 1), (0, 2), (1, 2), (2, 2)]);
    let mut matrix = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
    let mut values = [f64::NAN; 8];
    let mut write = |matrix: &[f64], xx: &[f64]| {
        entries.write_interval(0, &[&[0.0, 7.0, 8.0], xx, &[], &[], &[]], 10.0, &mut values);
        entries.write_interval(1, &[&[0.0, 0.5], &[], &[], &[], &[]], 10.0, &mut values);
        entries.write_nodes([matrix].into_iter(), 10.0, &mut values);
        values
    };
    let expected = [10.0, 30.0, 50.0, 1065.0, -10.0, 70.0, 80.0, 90.0];
    assert_eq!(write(&matrix, &[4.0, 9.0]), expected);
    // Written again: zeros for a missing block.
    assert_eq!(write(&matrix, &[4.0, 9.0]), expected);
    assert_eq!(write(&matrix, &[]), [10.0, 30.0, 50.0, 1025.0, -10.0, 70.0, 80.0, 0.0]);
    entries.zero_node_terms(0, &mut matrix);
    assert_eq!(matrix, [0.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
}

#[test]
fn names_and_places_of_two_intervals() {
    // `y = (y₀)` over `w = (x₀, x₁, u)`, no parameter.
    let (mut value, mut hessian) = (Dependence::zero(1, 3), Dependence::zero(3, 3));
    value.set(0, 1);
    value.set(0, 2);
    hessian.set(1, 2);
    hessian.set(2, 1);
    let shape = Shape {
        count: 2,
        inputs: [0..2, 2..3, 3..3],
        outputs: [0..1, 1..1, 1..1],
        value: &value,
        hessian: &hessian,
    };
    let [f, jac, adj, second] = shape.functions();
    let names =
        |ports: &[Port]| ports.iter().map(|port| port.name.to_str().unwrap().to_owned()).collect::<Vec<_>>();
    assert_eq!(names(&f.0.inputs), ["x0", "u", "p"]);
    assert_eq!(names(&f.0.outputs), ["xf"]);
    assert_eq!(names(&jac.0.inputs), ["x0", "u", "p", "out_xf"]);
    assert_eq!(names(&jac.0.outputs), ["jac_xf_x0", "jac_xf_u", "jac_xf_p"]);
    assert_eq!(names(&adj.0.inputs), ["x0", "u", "p", "out_xf", "adj_xf"]);
    assert_eq!(names(&adj.0.outputs), ["adj_x0", "adj_u", "adj_p"]);
    assert_eq!(second.0.inputs.len(), 8);
    let of_u = ["jac_adj_u_x0", "jac_adj_u_u", "jac_adj_u_p", "jac_adj_u_out_xf", "jac_adj_u_adj_xf"];
    assert_eq!(names(&second.0.outputs)[5..10], of_u);
    assert_eq!(f.0.inputs[0].sparsity.dimensions(), [2, 2]);
    assert_eq!(second.0.inputs[3].sparsity.compressed(), [1, 2, 0, 0, 0]);

    let places = |output: &Output| output.entries.iter().map(|Entry(place)| *place).collect::<Vec<_>>();
    // An interval has 1 × 3 derivatives of first order, in column-major order, and 3 × 3 of second.
    assert_eq!(jac.0.outputs[0].sparsity.entries(), [(0, 1), (1, 3)]);
    assert_eq!((places(&jac.1[0]), jac.1[0].source), (vec![1, 4], Source::Jacobian));
    assert_eq!(places(&jac.1[1]), [2, 5]);
    assert_eq!(places(&adj.1[1]), [2, 5]);
    assert_eq!(second.0.outputs[1].sparsity.entries(), [(1, 0), (3, 1)]);
    assert_eq!((places(&second.1[1]), second.1[1].source), (vec![5, 12], Source::Hessian));
    assert_eq!(second.0.outputs[4].sparsity.entries(), [(1, 0), (3, 1)]);
    assert_eq!(places(&second.1[4]), [1, 4]);
}
