//! Only first calls allocate, and later ones no more than the lists that their results own.
#![allow(unsafe_code)]

use casados::prelude::*;
use nalgebra::{Vector1, vector};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local!(static COUNT: Cell<usize> = const { Cell::new(0) });

/// Counts the allocations of each thread.
struct CountingAllocator;

// SAFETY: every call is passed on to the system's allocator.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.realloc(pointer, layout, size) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// The number of allocations in the third call.
fn third(mut call: impl FnMut()) -> usize {
    call();
    call();
    let before = COUNT.get();
    call();
    COUNT.get() - before
}

/// A ball: height and velocity, gravity, and what is left of the speed after a bounce.
#[ode]
fn ball(x: [f64; 2], u: f64, p: [f64; 2]) -> [f64; 2] {
    [x[1], u - p[0]]
}
#[function]
fn height(x: [f64; 2], _u: f64, _p: [f64; 2]) -> f64 {
    x[0]
}
#[function]
fn bounce(x: [f64; 2], _u: f64, p: [f64; 2]) -> [f64; 2] {
    [x[0], -p[1] * x[1]]
}

#[test]
fn allocations_of_later_calls() {
    let (x0, u, p, lambda) = (vector![1.0, 0.0], Vector1::new(0.1), vector![9.81, 0.8], vector![1.0, 0.5]);
    macro_rules! check {
        ($method:ty) => {
            let adaptive = || {
                let mut adaptive = Adaptive::<Ball, $method>::new(AdaptiveOptions::default()).unwrap();
                adaptive.set_parameters(&p).unwrap();
                adaptive
            };
            let mut single = adaptive();
            assert_eq!(third(|| _ = single.solve(&x0, &u, 0.7).unwrap()), 0);
            assert_eq!(third(|| _ = single.forward(&x0, &u, 0.7).unwrap()), 0);
            assert_eq!(third(|| _ = single.adjoint(&x0, &u, 0.7, &lambda).unwrap()), 0);
            assert_eq!(third(|| _ = single.hessian(&x0, &u, 0.7, &lambda).unwrap()), 0);

            let mut hybrid =
                Hybrid::new(adaptive(), &[Event::jump::<Height, Bounce>(Crossing::Falling)]).unwrap();
            for frozen in [false, true] {
                assert_eq!(hybrid.solve(&x0, &u, 2.0).unwrap().occurrences.len(), 3);
                if frozen {
                    hybrid.freeze().unwrap();
                }
                assert_eq!(third(|| _ = hybrid.solve(&x0, &u, 2.0).unwrap()), 0);
                assert_eq!(third(|| _ = hybrid.dense(1.3).unwrap()), 0);
                // Events with their times in a list that grows, and a copy of the events.
                let times = third(|| drop(hybrid.forward(&x0, &u, 2.0).unwrap()));
                assert!(times <= 2, "{times}");
                assert_eq!(third(|| drop(hybrid.adjoint(&x0, &u, 2.0, &lambda).unwrap())), 1);
                let times = third(|| drop(hybrid.hessian(&x0, &u, 2.0, &lambda).unwrap()));
                assert!(times <= 3, "{times}");
            }

            let mut horizon = Piecewise::new(adaptive());
            let (controls, ends) = ([u; 4], [0.1, 0.2, 0.3, 0.4]);
            for frozen in [false, true] {
                horizon.solve(&x0, &controls, &ends).unwrap();
                if frozen {
                    horizon.freeze().unwrap();
                }
                assert_eq!(third(|| _ = horizon.solve(&x0, &controls, &ends).unwrap()), 0);
                assert_eq!(third(|| _ = horizon.dense(0.3).unwrap()), 0);
                // A list for each derivative by the controls: dx, dz (which have no size), then the
                // gradient, h_xu, h_uu, h_up.
                assert_eq!(third(|| drop(horizon.forward(&x0, &controls, &ends).unwrap())), 1);
                assert_eq!(third(|| drop(horizon.adjoint(&x0, &controls, &ends, &lambda).unwrap())), 1);
                assert_eq!(third(|| drop(horizon.hessian(&x0, &controls, &ends, &lambda).unwrap())), 5);
            }
        };
    }
    check!(Radau);
    check!(Gauss<3>);
    check!(DormandPrince5);
}
