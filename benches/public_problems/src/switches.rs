//! Mechanisms that can be switched off, one line each.

use casados::ocp::{Barrier, Convexification, Globalisation, HeapIpm, HeapSqp};

/// Switches a mechanism off.
#[derive(Clone, Copy)]
pub enum Off {
    Sqp(fn(&mut HeapSqp)),
    Ipm(fn(&mut HeapIpm)),
}

/// Mechanisms by their names, and how each is switched off or exchanged.
pub const SWITCHES: &[(&str, Off)] = &[
    ("scaling", Off::Sqp(|sqp| sqp.options.scaling = false)),
    ("warm start of QPs", Off::Sqp(|sqp| sqp.options.warm_start = false)),
    ("inexact QPs", Off::Sqp(|sqp| sqp.options.qp_accuracy = 0.0)),
    ("elastic mode", Off::Sqp(|sqp| sqp.options.elastic = false)),
    ("merit function, filter instead", Off::Sqp(|sqp| sqp.options.globalisation = Globalisation::Filter)),
    ("globalisation", Off::Sqp(|sqp| sqp.options.globalisation = Globalisation::FullStep)),
    (
        "reduced convexification, projection instead",
        Off::Sqp(|sqp| sqp.curvature.convexification = Convexification::Project),
    ),
    ("scaling", Off::Ipm(|ipm| ipm.options.scaling = false)),
    ("adaptive barrier, monotone instead", Off::Ipm(|ipm| ipm.options.barrier = Barrier::Monotone)),
    ("elastic mode", Off::Ipm(|ipm| ipm.options.elastic = false)),
    ("second-order corrections", Off::Ipm(|ipm| ipm.options.advanced.line_search.max_soc = 0)),
    ("higher-order corrections", Off::Ipm(|ipm| ipm.options.advanced.predictor.max_corrections = 0)),
    ("one correction for three", Off::Ipm(|ipm| ipm.options.advanced.predictor.max_corrections = 1)),
    ("refinement of equations", Off::Ipm(|ipm| ipm.options.advanced.newton.max_refinement_steps = 0)),
    ("multiplier reset", Off::Ipm(|ipm| ipm.options.advanced.newton.multiplier_reset_delta_w = f64::MAX)),
    (
        "limit of violation growth",
        Off::Ipm(|ipm| ipm.options.advanced.line_search.max_violation_growth = f64::MAX),
    ),
    ("tiny steps", Off::Ipm(|ipm| ipm.options.advanced.line_search.tiny_step_tol = 0.0)),
    ("damping", Off::Ipm(|ipm| ipm.options.advanced.damping.short_steps_before_damping = usize::MAX)),
    (
        "reset of small slacks",
        Off::Ipm(|ipm| ipm.options.advanced.barrier.complementarity_stall_iterations = usize::MAX),
    ),
    ("restoration phase", Off::Ipm(|ipm| ipm.options.advanced.restoration.max_restoration_phases = 0)),
    ("restart", Off::Ipm(|ipm| ipm.options.restart = false)),
    ("perturbed start", Off::Ipm(|ipm| ipm.options.perturb_start = false)),
    ("restart", Off::Sqp(|sqp| sqp.options.restart = false)),
    ("perturbed start", Off::Sqp(|sqp| sqp.options.perturb_start = false)),
    ("acceptable points", Off::Ipm(|ipm| ipm.options.acceptable_tolerance = ipm.options.tolerance)),
];
