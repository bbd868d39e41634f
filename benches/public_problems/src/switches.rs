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
    ("acceptable points", Off::Ipm(|ipm| ipm.options.acceptable_tolerance = ipm.options.tolerance)),
];
