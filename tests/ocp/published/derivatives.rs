//! First and second derivatives of two of the problems against hyper-dual numbers through the
//! classical Runge-Kutta method.

use super::flight::{Depth, Rocket, THRUST};
use super::processes::{Misfit, Pinene, SAMPLES};
use crate::Test;
use crate::phases::kkt::{hessian, jacobian, variables};
use casados::ocp::{Convexification, Exact, Formulation, GeneralCost, HeapOcp, Horizon, Problem};
use casados::prelude::*;
use num_dual::{DualNum, HyperDual64 as H};

/// An interval.
fn rk4<const N: usize>(rates: impl Fn([H; N]) -> [H; N], mut x: [H; N], h: f64, steps: usize) -> [H; N] {
    let h = h / steps as f64;
    let to = |x: [H; N], k: [H; N], h: f64| core::array::from_fn(|i| x[i] + k[i] * h);
    for _ in 0..steps {
        let a = rates(x);
        let b = rates(to(x, a, 0.5 * h));
        let c = rates(to(x, b, 0.5 * h));
        let d = rates(to(x, c, h));
        x = core::array::from_fn(|i| x[i] + (a[i] + (b[i] + c[i]) * 2.0 + d[i]) * (h / 6.0));
    }
    x
}

/// At each interval, of the cost and the end as functions of all variables `(x, w, u)`: slopes of
/// the end, and the Hessian with the costates of the iterate.
fn compare<P: Formulation<f64, Dynamics: casados::ocp::SecondOrder<f64>>>(
    ocp: &mut HeapOcp<P>,
    of: impl Fn(usize, &[H]) -> (H, Vec<H>),
) -> Test {
    ocp.linearise(Exact { convexification: Convexification::None })?;
    for k in 0..ocp.intervals() {
        let stage = ocp.qp().stage(k).ok_or("no stage")?;
        let at = ocp.iterate().stages().nth(k).ok_or("no stage")?;
        let v = variables(&at);
        let by = |i: usize, j: usize| {
            let one = |l: usize, i: usize| f64::from(l == i);
            let v: Vec<H> = (0..v.len()).map(|l| H::new(v[l], one(l, i), one(l, j), 0.0)).collect();
            of(k, &v)
        };
        for i in 0..v.len() {
            let ends = by(i, i).1;
            for (row, end) in ends.iter().enumerate() {
                let (found, expected) = (jacobian(&stage, row, i), end.eps1);
                assert!(
                    (found - expected).abs() < 1e-12 * (1.0 + expected.abs()),
                    "{k} {row} {i}: {found} {expected}"
                );
            }
            for j in 0..=i {
                let (cost, ends) = by(i, j);
                let terms = ends.iter().zip(at.dynamics).map(|(end, pi)| pi * end.eps1eps2);
                let size: f64 = 1.0 + terms.clone().map(f64::abs).sum::<f64>();
                let expected = cost.eps1eps2 + terms.sum::<f64>();
                let found = hessian(&stage, i, j);
                assert!((found - expected).abs() < 1e-11 * size, "{k} {i} {j}: {found} {expected}");
            }
        }
    }
    Ok(())
}

/// Sets nonzero costates.
fn disturb<P: Formulation<f64>>(ocp: &mut HeapOcp<P>) {
    for k in 0..ocp.intervals() {
        if let Some(stage) = ocp.iterate_mut().stage_mut(k) {
            for (i, pi) in stage.dynamics.iter_mut().enumerate() {
                *pi = (1.0 + 2.0 * i as f64 + 0.7 * k as f64).sin();
            }
        }
    }
}

/// Derivatives of the rocket by distance, speed, mass, end time and thrust.
#[test]
fn derivatives_of_goddards_rocket() -> Test {
    const N: usize = 3;
    let mut ocp = Problem::new(Erk::<Rocket, Rk4>::new(Options { steps: 2, ..Options::default() })?)
        .terminal_cost(GeneralCost::<Depth>::new())
        .on(Horizon::free(N, 0.05..=1.0, 0.17))?;
    ocp.free_initial_state();
    for k in 0..=N {
        let x = [1.0 + 0.001 * k as f64, 0.03 + 0.02 * k as f64, 1.0 - 0.1 * k as f64];
        ocp.guess_stage(k, &x, if k < N { &[0.3 * THRUST] } else { &[] })?;
    }
    disturb(&mut ocp);
    compare(&mut ocp, |_, v| {
        let (end, u) = (v[3], v[4]);
        let rates = |x: [H; 3]| {
            let drag = x[1] * x[1] * ((x[0] - 1.0) * -500.0).exp() * 310.0;
            [x[1] * end, ((u - drag) / x[2] - (x[0] * x[0]).recip()) * end, u * end * -2.0]
        };
        let x = rk4(rates, [v[0], v[1], v[2]], 1.0 / N as f64, 2);
        (H::from(0.0), x.to_vec())
    })
}

/// Derivatives of the five substances by initial substances and rates; time in 1e4 minutes.
#[test]
fn derivatives_of_pinene() -> Test {
    let times: Vec<f64> = SAMPLES.iter().map(|(time, _)| 1e-4 * time).collect();
    let mut ocp = Problem::new(Erk::<Pinene, Rk4>::new(Options { steps: 3, ..Options::default() })?)
        .stage_cost(GeneralCost::<Misfit>::new())
        .on(Horizon::nodes(&times))?;
    ocp.free_initial_state();
    for (k, (_, measured)) in SAMPLES.iter().enumerate() {
        let mut p = [0.0; 10];
        p[5..].copy_from_slice(measured);
        ocp.set_parameters(k..=k, &p)?.guess_stage(k, &measured.map(|x| 0.01 * x + 0.1), &[])?;
    }
    ocp.free("p.rates", 0.0.., 0.4)?;
    disturb(&mut ocp);
    compare(&mut ocp, |k, v| {
        let rates = |x: [H; 5]| {
            [
                (v[5] + v[6]) * -x[0],
                v[5] * x[0],
                v[6] * x[0] - (v[7] + v[8]) * x[2] + v[9] * x[4],
                v[7] * x[2],
                v[8] * x[2] - v[9] * x[4],
            ]
        };
        let x: [H; 5] = core::array::from_fn(|i| v[i]);
        let mut cost = H::from(0.0);
        for (x, measured) in x.iter().zip(SAMPLES[k].1) {
            cost += (*x - measured) * (*x - measured);
        }
        (cost, rk4(rates, x, times[k + 1] - times[k], 3).to_vec())
    })
}
