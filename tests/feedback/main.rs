//! Control and estimation in closed loop: real-time iterations that contract or diverge, estimates
//! with their covariance.

mod absurd_measurement;
mod ball_on_plate;
mod covariance;
mod glucose;

type Test = Result<(), Box<dyn std::error::Error>>;
