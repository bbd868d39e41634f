//! The conditions of optimality at a solution, by code that is not the solver's: derivatives of
//! intervals by an integrator of single ones, those of constraints by differences.

use crate::awe::Awe;
use crate::problem::limits;
use casados::prelude::*;
use casados::qp::HeapSolution;
use nalgebra::SVector;

/// Residuals of the conditions of Karush, Kuhn and Tucker, the largest of each kind.
#[derive(Clone, Copy, Debug, Default)]
pub struct KktResiduals {
    /// `∇L` in states and controls.
    pub stationarity: f64,
    /// Gaps between intervals, and between the ends of the orbit.
    pub equations: f64,
    /// Violations of bounds and constraints.
    pub inequalities: f64,
    /// Products of multipliers and distances, and multipliers of the wrong sign.
    pub complementarity: f64,
}

const DEGREE: f64 = core::f64::consts::PI / 180.0;
const NX: usize = 23;
const NU: usize = 4;
/// Periodic states: all but the accumulated cost.
const PERIODIC: usize = 22;

impl KktResiduals {
    /// At states, controls and multipliers, with intervals of length `h`.
    ///
    /// # Errors
    /// Those of the integrator.
    pub fn at_point(solution: &HeapSolution, h: f64) -> Result<Self, casados::Error> {
        let options = Options { start: Start::Zero, ..Default::default() };
        let mut irk = Irk::<Awe, RadauIIA<4>>::new(options)?;
        let mut found = Self::default();
        let stages: Vec<_> = solution.stages().collect();
        let (mut carried, mut first) = ([0.0; NX], [0.0; NX]);
        for (k, pair) in stages.windows(2).enumerate() {
            let [stage, next] = pair else { continue };
            let (x, u) = (SVector::from_column_slice(stage.x), SVector::from_column_slice(stage.u));
            let step = *irk.forward(&x, &u, h)?;
            let z = step.nominal.z0[0];
            let pi = SVector::<f64, NX>::from_column_slice(stage.dynamics);
            let force: Vec<f64> = stage.g_upper.iter().zip(stage.g_lower).map(|(a, b)| a - b).collect();
            let (values, slopes, slope_z) = derivatives(&x, z, &force);
            let mut of_x = step.dx_dx0.transpose() * pi + slopes + step.dz0_dx0.transpose() * slope_z;
            let mut of_u = step.dx_du.transpose() * pi + step.dz0_du.transpose() * slope_z;
            for i in 0..NX {
                of_x[i] += stage.x_upper[i] - stage.x_lower[i] - carried[i];
                found.equations = found.equations.max((step.x[i] - next.x[i]).abs());
                found.add_bound(stage.x[i], state_bounds(i, k), [stage.x_lower[i], stage.x_upper[i]]);
            }
            for i in 0..NU {
                of_u[i] += stage.u_upper[i] - stage.u_lower[i];
                let most = if i < 3 { 2.0 } else { 100.0 };
                found.add_bound(stage.u[i], [-most, most], [stage.u_lower[i], stage.u_upper[i]]);
            }
            for (i, &value) in values.iter().enumerate() {
                found.add_bound(value, [0.0, f64::INFINITY], [stage.g_lower[i], stage.g_upper[i]]);
            }
            carried.copy_from_slice(stage.dynamics);
            found.stationarity = found.stationarity.max(of_u.amax());
            if k == 0 {
                first.copy_from_slice(of_x.as_slice());
                // Of a state that is given its multiplier is free.
                first[22] = 0.0;
                found.equations = found.equations.max(stage.x[22].abs()).max(stage.x[4].abs());
            } else {
                found.stationarity = found.stationarity.max(of_x.amax());
            }
        }
        if let (Some(begin), Some(end)) = (stages.first(), stages.last()) {
            // The objective is the last state at the end. Periodic states are one variable, and the
            // multiplier of `dq_y = 0` at the start is free.
            for i in (0..PERIODIC).filter(|&i| i != 4) {
                found.stationarity = found.stationarity.max((first[i] - carried[i]).abs());
            }
            found.stationarity = found.stationarity.max((1.0 - carried[22]).abs());
            for i in 0..PERIODIC {
                found.equations = found.equations.max((begin.x[i] - end.x[i]).abs());
            }
        }
        Ok(found)
    }

    /// Takes into account a value with bounds and multipliers. Of equal bounds these are free.
    fn add_bound(&mut self, value: f64, [low, high]: [f64; 2], [lower, upper]: [f64; 2]) {
        self.inequalities = self.inequalities.max(low - value).max(value - high);
        if low < high {
            for (distance, multiplier) in [(value - low, lower), (high - value, upper)] {
                let product = if distance.is_finite() { distance.abs() } else { 1.0 } * multiplier;
                self.complementarity = self.complementarity.max(product.abs()).max(-multiplier);
            }
        }
    }

    /// The largest of all.
    pub fn largest_residual(&self) -> f64 {
        self.stationarity.max(self.equations).max(self.inequalities).max(self.complementarity)
    }
}

/// The bounds of a state.
fn state_bounds(i: usize, k: usize) -> [f64; 2] {
    let most = match i {
        2 => return [100.0, f64::INFINITY],
        6..=8 => 50.0 * DEGREE,
        18 => 20.0 * DEGREE,
        19 | 20 => 30.0 * DEGREE,
        4 | 22 if k == 0 => 0.0,
        _ => f64::INFINITY,
    };
    [-most, most]
}

/// The constraints, and the gradient of `forceᵀ g` by `x` and `z`: central differences of fourth
/// order.
fn derivatives(x: &SVector<f64, NX>, z: f64, force: &[f64]) -> ([f64; 9], SVector<f64, NX>, SVector<f64, 1>) {
    let value = |x: &SVector<f64, NX>, z: f64| limits((*x).into(), [z], [0.0; NU]);
    let sum = |x: &SVector<f64, NX>, z: f64| value(x, z).iter().zip(force).map(|(g, f)| g * f).sum::<f64>();
    let slope = |f: &dyn Fn(f64) -> f64, size: f64| {
        let e = 1e-3 * size.abs().max(1e-1);
        (8.0 * (f(e) - f(-e)) - (f(2.0 * e) - f(-2.0 * e))) / (12.0 * e)
    };
    let of_x = SVector::from_fn(|i, _| {
        let along = |e: f64| {
            let mut x = *x;
            x[i] += e;
            sum(&x, z)
        };
        slope(&along, x[i])
    });
    (value(x, z), of_x, SVector::from([slope(&|e| sum(x, z + e), z)]))
}
