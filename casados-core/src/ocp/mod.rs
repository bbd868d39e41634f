//! Problems of optimal control, discretised by multiple shooting.

mod bounds;
mod constraint;
mod convexify;
mod cost;
mod data;
mod dynamics;
mod error;
mod horizon;
mod instance;
mod kkt;
mod linearise;
mod map;
mod point;
mod problem;
mod real_time;
#[cfg(feature = "alloc")]
mod shooting;
mod single;
mod sqp;

pub use constraint::{Constraint, Constraints};
pub use convexify::Convexification;
pub use cost::{Cost, GeneralCost, LeastSquaresCost};
pub use dynamics::{Dynamics, IntegralTerms, Interval, Names, Nodes, SecondOrder, Sink, Step};
pub use error::{ConstraintName, OcpError, Part, Text};
pub use horizon::Horizon;
#[cfg(feature = "alloc")]
pub use instance::HeapOcp;
pub use instance::Ocp;
pub use linearise::{Curvature, Exact, GaussNewton};
pub use map::Map;
pub use problem::{Formulation, Problem};
#[cfg(feature = "alloc")]
pub use real_time::HeapRealTime;
pub use real_time::{Feedback, Prepared, RealTime};
#[cfg(feature = "alloc")]
pub use shooting::Shooting;
pub use single::{Along, IntegralCost};
#[cfg(feature = "alloc")]
pub use sqp::HeapSqp;
pub use sqp::{Globalisation, Iteration, Log, Outcome, Sqp, SqpOptions, Status, Times};
