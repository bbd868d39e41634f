//! The same integrator where its plan of elimination fails in every iteration.
#![cfg_attr(target_os = "none", no_std, no_main)]

include!(concat!(env!("OUT_DIR"), "/case.rs"));

firmware::measure!(firmware::lost::Lost<Model>, STAGES, Number, casados::Inline<casados::mode::Forward, 1, Fallback>);
