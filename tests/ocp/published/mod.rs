//! Problems of public collections as published: no time scaled by hand, no parameter as a control,
//! no copy of a state. Values are closed forms or published optima.
//!
//! | problem | formulation | value | source |
//! | --- | --- | --- | --- |
//! | Bryson and Denham | linear control, points inside intervals, integral | 4 | closed form |
//! | condition in the middle | phases, linear control, integral | 0.92053144 | closed form; PSOPT `interior_point` |
//! | hanging chain | linear control, bounded integral | 5.06848 | closed form; PSOPT `chain`; COPS 5.06891 |
//! | periodic orbit | boundary condition, free end time | 17.0652165601579626 | Hairer, Nørsett, Wanner |
//! | catalyst mixing | phases with free lengths | −0.0480556 | COPS |
//! | isomerisation of α-pinene | free parameters | 19.8721 | COPS |
//! | Goddard's rocket | free end time, phases | 1.01283 | COPS |
//! | reentry of the shuttle | free end time | 34.1412° | PSOPT `shuttle_reentry` |
//!
//! COPS: E. D. Dolan, J. J. Moré, T. S. Munson, "Benchmarking optimization software with COPS 3.0",
//! ANL/MCS-TM-273, 2004. Values of PSOPT are from `doc/SQP_ALL_EXAMPLES.csv`. Other published
//! problems: the brachistochrone and linear tangent steering (`free_end`), predator
//! and prey (`free_estimates`), Delta III (`phases/launch`).

mod curves;
mod derivatives;
mod flight;
mod processes;
mod textbook;
