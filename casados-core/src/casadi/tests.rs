//! What needs no integrator: patterns, the cache, the pool of memories, and pointers.
#![allow(unsafe_code)]

use super::cache::{Answer, Cache};
use super::dependence::{self, Dimensions};
use super::ffi::{self, Side};
use super::function::{Call, Port, Signature};
use super::library::{Client, Failure, Library};
use super::signature::{Entry, Output, Shape, Source};
use super::sparsity::{Relation, Sparsity};
use crate::structure::Pattern;
use alloc::vec;
use alloc::vec::Vec;
use core::ptr::{null, null_mut};
use core::sync::atomic::{AtomicUsize, Ordering};

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
    // Row by row, where entries are column by column.
    assert_eq!(full.transposed().1, [0, 2, 1, 3]);
    assert_eq!(full.upper().entries(), [(0, 0), (0, 1), (1, 1)]);
    assert_eq!(lower.diagonal(2).entries(), [(1, 0), (2, 0), (2, 1), (4, 2), (5, 2), (5, 3)]);
    assert_eq!(lower.diagonal(2).dimensions(), [6, 4]);
}

#[test]
fn relations_have_blocks() {
    let mut relation = Relation::zero(2, 3);
    relation.set(0, 2);
    relation.set(1, 0);
    assert_eq!(relation.block(0..2, 1..3).entries(), [(0, 1)]);
    assert_eq!(relation.transposed_block(0..2, 1..3).entries(), [(1, 0)]);
    let other = relation.clone();
    assert!(relation.join(0, &other, 1));
    assert!(!relation.join(0, &other, 1));
    assert_eq!(relation.row(0), [true, false, true]);
}

/// `ẋ₀ = u − x₀`, `ẋ₁ = x₀ − x₁`, `ẋ₂ = x₁`: variables `(ẋ, x, u)`.
const CASCADE: Pattern = Pattern { rows: &[0, 1, 2, 0, 1, 1, 2, 0], columns: &[0, 1, 2, 3, 3, 4, 4, 6] };
const OF_CASCADE: Dimensions = Dimensions { nx: 3, nz: 0, nw: 4 };

#[test]
fn implicit_methods_depend_on_all_that_leads_there() {
    let variables = dependence::variables(OF_CASCADE, CASCADE, None);
    let states = variables.block(3..6, 0..4);
    // The last state is no argument of anybody.
    let expected = [[1, 0, 0, 1], [1, 1, 0, 1], [1, 1, 1, 1]];
    assert_eq!(states, Sparsity::new(3, 4, |row, column| expected[row][column] == 1));
}

#[test]
fn explicit_methods_reach_an_equation_further_with_each_evaluation() {
    let states = |depth| dependence::variables(OF_CASCADE, CASCADE, Some(depth)).block(3..6, 0..4);
    let once = [[1, 0, 0, 1], [1, 1, 0, 0], [0, 1, 1, 0]];
    assert_eq!(states(1), Sparsity::new(3, 4, |row, column| once[row][column] == 1));
    let twice = [[1, 0, 0, 1], [1, 1, 0, 1], [1, 1, 1, 0]];
    assert_eq!(states(2), Sparsity::new(3, 4, |row, column| twice[row][column] == 1));
    assert_eq!(states(3), dependence::variables(OF_CASCADE, CASCADE, None).block(3..6, 0..4));
}

/// `z₀ = x₀` is equation 1, `ẋ₀ = z₁` is 2, and `z₁ = z₀ p` is 0: no equation is where its unknown
/// is.
#[test]
fn equations_are_matched_with_unknowns() {
    let jacobian = Pattern { rows: &[0, 0, 0, 1, 1, 2, 2], columns: &[2, 3, 5, 1, 2, 0, 3] };
    let dimensions = Dimensions { nx: 1, nz: 2, nw: 3 };
    let variables = dependence::variables(dimensions, jacobian, None);
    assert_eq!(variables.row(2), [true, false, true]);
    // By way of the state, which depends on the other one.
    assert_eq!(variables.row(1), [true, false, true]);
    assert_eq!(variables.row(4), [false, true, false]);
    let mut hessian = Relation::zero(3, 3);
    dependence::curvature(&variables, Pattern { rows: &[5], columns: &[4] }, &mut hessian);
    assert_eq!(hessian.block(0..3, 0..3).entries(), [(2, 1), (1, 2)]);
}

#[test]
fn names_and_places_of_two_intervals() {
    // `y = (y₀)` over `w = (x₀, x₁, u)`, no parameter.
    let (mut value, mut hessian) = (Relation::zero(1, 3), Relation::zero(3, 3));
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
    let names = |ports: &[Port]| ports.iter().map(|port| port.name.to_str().unwrap()).collect::<Vec<_>>();
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
    // An interval has 1 × 3 derivatives of first order, column by column, and 3 × 3 of second.
    assert_eq!(jac.0.outputs[0].sparsity.entries(), [(0, 1), (1, 3)]);
    assert_eq!((places(&jac.1[0]), jac.1[0].source), (vec![1, 4], Source::Jacobian));
    assert_eq!(places(&jac.1[1]), [2, 5]);
    assert_eq!(places(&adj.1[1]), [2, 5]);
    assert_eq!(second.0.outputs[1].sparsity.entries(), [(1, 0), (3, 1)]);
    assert_eq!((places(&second.1[1]), second.1[1].source), (vec![7, 16], Source::Hessian));
    assert_eq!(second.0.outputs[4].sparsity.entries(), [(1, 0), (3, 1)]);
    assert_eq!(places(&second.1[4]), [1, 4]);
}

fn known(value: f64) -> Answer<()> {
    let mut answer = Answer::default();
    answer.value.set(1)[0] = value;
    answer
}

#[test]
fn the_oldest_inputs_are_forgotten() {
    let mut cache = Cache::new(2);
    for input in [1.0, 2.0, 3.0] {
        cache.store(&[input], &mut known(10.0 * input));
    }
    assert!(cache.find(&[1.0]).is_none());
    for input in [2.0, 3.0] {
        assert_eq!(cache.find(&[input]).unwrap().value.get().unwrap(), &[10.0 * input]);
    }
    cache.store(&[4.0], &mut known(40.0));
    assert!(cache.find(&[2.0]).is_none() && cache.find(&[3.0]).is_some());
    // Bits count: zeros of both signs are two inputs.
    cache.store(&[0.0], &mut known(0.0));
    assert!(cache.find(&[-0.0]).is_none() && cache.find(&[0.0]).is_some());
    let mut none = Cache::new(0);
    none.store(&[1.0], &mut known(1.0));
    assert!(none.find(&[1.0]).is_none());
}

#[test]
fn answers_to_the_same_inputs_are_joined() {
    let mut cache = Cache::new(2);
    cache.store(&[1.0], &mut known(1.0));
    let mut gradient = Answer::default();
    gradient.lambda.set(1)[0] = 5.0;
    gradient.gradient.set(1)[0] = 50.0;
    cache.store(&[1.0], &mut gradient);
    let entry = cache.find(&[1.0]).unwrap();
    assert_eq!((entry.value.get().unwrap()[0], entry.gradient.get().unwrap()[0]), (1.0, 50.0));
    // A Hessian of other multipliers takes the gradient of the former ones along.
    let mut hessian = Answer::default();
    hessian.lambda.set(1)[0] = 6.0;
    hessian.hessian.set(1)[0] = 600.0;
    cache.store(&[1.0], &mut hessian);
    let entry = cache.find(&[1.0]).unwrap();
    assert!(entry.gradient.get().is_none());
    assert_eq!((entry.lambda.get().unwrap()[0], entry.hessian.get().unwrap()[0]), (6.0, 600.0));
}

/// The sum of two inputs, of three numbers and of one; it fails below zero and panics above 100.
struct Sum(Vec<Signature>, &'static AtomicUsize);

/// What a thread has, which counts itself.
struct Counted(&'static AtomicUsize);

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Sum {
    fn new(workers: &'static AtomicUsize) -> Self {
        let port = |name, length| Port::new(name, Sparsity::vector(length));
        let signature = Signature {
            inputs: vec![port(c"a", 3), port(c"b", 1)],
            outputs: vec![port(c"c", 3), port(c"d", 1)],
        };
        Self(vec![signature], workers)
    }
}

impl Client for Sum {
    type Worker = Counted;
    fn signatures(&self) -> &[Signature] {
        &self.0
    }
    fn worker(&self) -> Result<Counted, Failure> {
        self.1.fetch_add(1, Ordering::Relaxed);
        Ok(Counted(self.1))
    }
    fn evaluate(&self, _: &mut Counted, _: usize, call: &mut dyn Call) -> Result<(), Failure> {
        let (mut a, mut b) = ([0.0; 3], [0.0; 1]);
        call.read(0, &mut a);
        call.read(1, &mut b);
        if b[0] < 0.0 {
            return Err(Failure("below zero".into()));
        }
        assert!(b[0] <= 100.0, "on purpose");
        assert!(!call.wants(2) && call.output(2).is_none());
        if let Some(c) = call.output(0) {
            c.copy_from_slice(&a.map(|a| a + b[0]));
        }
        if let Some(d) = call.output(1) {
            d[0] = a.iter().sum();
        }
        Ok(())
    }
    fn integrations(&self) -> u64 {
        7
    }
}

/// A call with two inputs and two outputs.
fn call(library: &Library<Sum>, inputs: [Option<&[f64]>; 2], id: i32) -> Option<([f64; 3], [f64; 1])> {
    let (mut c, mut d) = ([f64::NAN; 3], [f64::NAN; 1]);
    let arguments = inputs.map(|input| input.map_or(null(), <[f64]>::as_ptr));
    let mut results = [c.as_mut_ptr(), d.as_mut_ptr()];
    // SAFETY: as many pointers as there are inputs and outputs, to arrays of their lengths.
    let status = unsafe { ffi::evaluate(library, 0, arguments.as_ptr(), results.as_mut_ptr(), id) };
    (status == 0).then_some((c, d))
}

#[test]
fn pointers_become_calls() {
    static WORKERS: AtomicUsize = AtomicUsize::new(0);
    static LIBRARY: Library<Sum> = Library::new(|| Sum::new(&WORKERS));
    ffi::refer(&LIBRARY);
    let id = ffi::check_out(&LIBRARY);
    let (a, b) = ([1.0, 2.0, 3.0], [10.0]);
    assert_eq!(call(&LIBRARY, [Some(&a), Some(&b)], id), Some(([11.0, 12.0, 13.0], [6.0])));
    assert_eq!(call(&LIBRARY, [None, Some(&b)], id), Some(([10.0; 3], [0.0])));
    // No pointers at all.
    // SAFETY: null is allowed for both.
    assert_eq!(unsafe { ffi::evaluate(&LIBRARY, 0, null(), null_mut(), id) }, 0);
    // SAFETY: as above; there is no such function.
    assert_eq!(unsafe { ffi::evaluate(&LIBRARY, 9, null(), null_mut(), id) }, 1);
    // Failures, and a panic; then it works again.
    assert_eq!(call(&LIBRARY, [Some(&a), Some(&[-1.0])], id), None);
    assert_eq!(call(&LIBRARY, [Some(&a), Some(&[101.0])], id), None);
    assert_eq!(call(&LIBRARY, [Some(&a), None], id), Some((a, [6.0])));
    for stranger in [-1, 1, i32::MIN, i32::MAX] {
        assert_eq!(call(&LIBRARY, [Some(&a), None], stranger), None);
    }
    assert_eq!(ffi::count(&LIBRARY, 0, Side::Input), 2);
    assert_eq!(ffi::count(&LIBRARY, 1, Side::Input), 0);
    assert_eq!(ffi::integrations(&LIBRARY), 7);
    // SAFETY: the name ends with zero, and lives until the last reference is gone.
    let name = unsafe { core::ffi::CStr::from_ptr(ffi::name(&LIBRARY, 0, Side::Output, 1)) };
    assert_eq!(name, c"d");
    assert!(ffi::name(&LIBRARY, 0, Side::Output, 2).is_null());
    assert!(ffi::sparsity(&LIBRARY, 0, Side::Input, -1).is_null());
    // SAFETY: a pattern of a dense vector is three numbers.
    let pattern = unsafe { core::slice::from_raw_parts(ffi::sparsity(&LIBRARY, 0, Side::Input, 0), 3) };
    assert_eq!(pattern, [3, 1, 1]);
    ffi::release(&LIBRARY, id);
    assert_eq!(call(&LIBRARY, [Some(&a), None], id), None);
    // With the last reference everything goes.
    assert_eq!(WORKERS.load(Ordering::Relaxed), 1);
    ffi::forget(&LIBRARY);
    assert_eq!(WORKERS.load(Ordering::Relaxed), 0);
}

#[test]
fn threads_have_memory_of_their_own() {
    static WORKERS: AtomicUsize = AtomicUsize::new(0);
    static LIBRARY: Library<Sum> = Library::new(|| Sum::new(&WORKERS));
    let ids: Vec<i32> = (0..4).map(|_| ffi::check_out(&LIBRARY)).collect();
    assert_eq!(ids, [0, 1, 2, 3]);
    ffi::release(&LIBRARY, 2);
    assert_eq!(ffi::check_out(&LIBRARY), 2);
    std::thread::scope(|scope| {
        for id in ids {
            scope.spawn(move || {
                for round in 0..20 {
                    let b = [f64::from(id * 100 + round) / 100.0];
                    let expected = ([1.0 + b[0]; 3], [3.0]);
                    assert_eq!(call(&LIBRARY, [Some(&[1.0; 3]), Some(&b)], id), Some(expected));
                }
            });
        }
    });
    assert_eq!(WORKERS.load(Ordering::Relaxed), 4);
}

/// A panic of what makes the client is a library without functions.
#[test]
fn a_client_that_cannot_be_made() {
    static LIBRARY: Library<Sum> = Library::new(|| panic!("on purpose"));
    assert_eq!(ffi::count(&LIBRARY, 0, Side::Input), 0);
    assert_eq!(call(&LIBRARY, [None, None], ffi::check_out(&LIBRARY)), None);
    assert_eq!(ffi::integrations(&LIBRARY), 0);
}
