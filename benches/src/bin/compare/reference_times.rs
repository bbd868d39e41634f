//! Times of acados, carried over from the machine where they were measured beside CasADi.
//!
//! acados here = acados there × CasADi here / CasADi there, of the simulation of the same case.
//! Where CasADi was not measured there, and where the ratio of the case would favour casados, the
//! median ratio of all cases counts.

use super::rows::Row;
use casados_benches::case::Mode;
use casados_benches::record::load;
use serde_json::Value;

/// The figures, and where they are from.
pub struct ReferenceTimes(Value);

impl ReferenceTimes {
    pub fn load() -> Result<Self, String> {
        load("benches/anchors.json").map(Self)
    }

    /// A figure in seconds.
    pub fn seconds(&self, case: &str, key: &str, mode: Mode) -> Option<f64> {
        let index = Mode::ALL_MODES.iter().position(|m| *m == mode)?;
        self.0["cases"][case][key][index].as_f64().map(|microseconds| 1e-6 * microseconds)
    }

    /// CasADi here over CasADi there, for the simulation of a case.
    pub fn machine_ratio(&self, rows: &[Row], case: &str) -> Option<f64> {
        let row = rows.iter().find(|row| row.case == case && row.mode == Mode::Simulation)?;
        Some(row.casadi?.time.median / self.seconds(case, "casadi", Mode::Simulation)?)
    }

    /// The median of all cases; not a number without CasADi.
    pub fn median_machine_ratio(&self, rows: &[Row]) -> f64 {
        let mut scales: Vec<_> = rows
            .iter()
            .filter(|row| row.mode == Mode::Simulation)
            .filter_map(|row| self.machine_ratio(rows, &row.case))
            .collect();
        scales.sort_unstable_by(f64::total_cmp);
        scales.get(scales.len() / 2).copied().unwrap_or(f64::NAN)
    }
}
