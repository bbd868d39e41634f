//! A rod that is heated at one end and loses heat at the other: the heat equation in cells.
//!
//! ```text
//! ρc ∂T/∂t = k ∂²T/∂y²      −k ∂T/∂y = q at y = 0      −k ∂T/∂y = H (T − T_air) at y = L
//! ```
//!
//! In each cell the heat that flows in and out is balanced (finite volumes): heat is conserved to
//! rounding, and temperatures are off by a multiple of the square of the width of a cell.

use casados::ode;

#[ode(N = [5, 10, 20])]
pub mod rod {
    pub const LENGTH: f64 = 0.2; // m
    pub const CONDUCTIVITY: f64 = 50.0; // W/(m K), steel
    pub const CAPACITY: f64 = 3.9e6; // J/(m³ K)
    pub const TRANSFER: f64 = 100.0; // W/(m² K), from the surface to the air

    /// Between the middles of two cells, W/(m² K).
    pub fn conductance(cells: usize) -> f64 {
        CONDUCTIVITY * cells as f64 / LENGTH
    }

    /// From the middle of the last cell to the air, half a cell and the surface, W/(m² K).
    pub fn loss(cells: usize) -> f64 {
        1.0 / (0.5 / conductance(cells) + 1.0 / TRANSFER)
    }

    /// x = [temperatures of the cells from the heated end on, °C], u = [heat that flows into it,
    /// kW/m²], p = [temperature of the air, °C].
    pub fn rod<const N: usize>(x: [f64; N], u: f64, p: f64) -> [f64; N] {
        let heat = CAPACITY * LENGTH / N as f64; // of a cell, J/(m² K)
        core::array::from_fn(|i| {
            let inflow = if i == 0 { 1e3 * u } else { conductance(N) * (x[i - 1] - x[i]) };
            let outflow = if i + 1 == N { loss(N) * (x[i] - p) } else { conductance(N) * (x[i] - x[i + 1]) };
            (inflow - outflow) / heat
        })
    }

    /// The temperature of the last cell, and the flow.
    #[function(N = [5, 10, 20])]
    pub fn end_and_flow<const N: usize>(x: [f64; N], u: f64, _p: f64) -> [f64; 2] {
        [x[N - 1], u]
    }
}
