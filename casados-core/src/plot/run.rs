//! Plots of the convergence of solvers, and of run times.

use super::curve::Curve;
use super::panel::Panel;
use crate::ocp::{Iteration, Log};
use alloc::string::String;
use alloc::vec::Vec;

/// The number of bins in a decade.
const BINS: f64 = 12.0;

impl Panel {
    /// The four residuals of the optimality conditions over the iterations of a run.
    #[must_use]
    pub fn convergence(log: Log<'_>) -> Self {
        let residual = |of: fn(&Iteration) -> f64| -> Vec<(f64, f64)> {
            log.0.iter().map(|row| (row.iteration as f64, of(row))).collect()
        };
        Self::iteration_panel("Residuals")
            .with(Curve::line("stationarity", residual(|row| row.residuals.stationarity)).marked())
            .with(Curve::line("dynamics", residual(|row| row.residuals.dynamics)).marked())
            .with(Curve::line("inequalities", residual(|row| row.residuals.inequalities)).marked())
            .with(Curve::line("complementarity", residual(|row| row.residuals.complementarity)).marked())
    }

    /// The largest residual over the iterations of several runs.
    #[must_use]
    pub fn convergences<'a, N: Into<String>>(runs: impl IntoIterator<Item = (N, Log<'a>)>) -> Self {
        runs.into_iter().fold(Self::iteration_panel("Largest residual"), |panel, (name, log)| {
            let points = log.0.iter().map(|row| (row.iteration as f64, row.residuals.largest()));
            panel.with(Curve::line(name, points).marked())
        })
    }

    fn iteration_panel(title: &str) -> Self {
        Self::new(title).x("iteration").log_y()
    }

    /// Histograms of times or other positive numbers: their shares of the total, in bins of a
    /// twelfth of a decade.
    #[must_use]
    pub fn histogram<'a, N: Into<String>>(samples: impl IntoIterator<Item = (N, &'a [f64])>) -> Self {
        samples.into_iter().fold(Self::new("Shares").log_x().log_y(), |panel, (name, times)| {
            let bin = |time: f64| (time.log10() * BINS).floor();
            let is_positive = |time: &&f64| time.is_finite() && **time > 0.0;
            let mut bins: Vec<f64> = times.iter().filter(is_positive).map(|&time| bin(time)).collect();
            bins.sort_unstable_by(f64::total_cmp);
            let mut points: Vec<(f64, f64)> = Vec::new();
            let edge = |bin: f64| 10f64.powf(bin / BINS);
            for group in bins.chunk_by(|a, b| a == b) {
                let Some(&bin) = group.first() else { continue };
                if points.last().is_some_and(|&(end, _)| end < edge(bin - 0.5)) {
                    points.push((f64::NAN, f64::NAN));
                }
                let share = group.len() as f64 / times.len() as f64;
                points.extend([(edge(bin), share), (edge(bin + 1.0), share)]);
            }
            panel.with(Curve::line(name, points))
        })
    }
}
