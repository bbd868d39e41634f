//! One integrator, measured. The environment variable `CASE` says which one when this is built:
//! model, stages, number type, and what it falls back on.
#![cfg_attr(target_os = "none", no_std, no_main)]

include!(concat!(env!("OUT_DIR"), "/case.rs"));

firmware::measure!(Model, STAGES, Number, casados::Inline<casados::mode::Forward, 1, Fallback>);
