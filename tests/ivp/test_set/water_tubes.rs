//! The water tube system of the Test Set for IVP Solvers: a network of 18 pipes of a kilometre
//! between 13 nodes, of index 2. Water cannot be compressed: flows into a node add up to zero, and
//! its pressure is in no equation of the node.

use casados::dae;

/// Flows at `t = 17 h` in m³/s (F. Mazzia, C. Magherini, Test Set for Initial Value Problem
/// Solvers, release 2.4, water tube system).
pub const FLOWS: [f64; 18] = [
    0.229_848_829_647_743e-2,
    0.118_898_465_074_658_5e-2,
    0.110_950_364_573_084_5e-2,
    0.158_962_010_031_482_5e-3,
    0.103_002_264_071_510_2e-2,
    0.871_060_630_683_616_5e-3,
    0.324_357_148_090_348_9e-2,
    0.110_950_364_573_084_5e-2,
    0.712_098_620_652_134_1e-3,
    0.641_461_396_383_309_9e-3,
    0.941_697_854_952_434_7e-3,
    0.340_342_851_909_651_1e-2,
    0.239_763_931_073_939_5e-2,
    0.239_763_931_073_939_5e-2,
    0.334_858_143_045_417_8e-2,
    0.135_356_001_703_544_4e-2,
    0.199_502_141_341_873_6e-2,
    0.574_622_074_119_357_5e-2,
];

/// Pressures of the nodes 5 and 8, which have a buffer.
pub const PRESSURES: [f64; 2] = [0.111_126_859_147_810_8e6, 0.111_127_004_559_238_7e6];

/// Equations and what they share.
#[dae]
pub mod equations {
    const VISCOSITY: f64 = 1.31e-6;
    const DENSITY: f64 = 1e3;
    const CRITICAL: f64 = 2.3e3;
    const LENGTH: f64 = 1e3;
    const ROUGHNESS: f64 = 2e-4;
    const AREA: f64 = core::f64::consts::FRAC_PI_4;
    const BUFFER: f64 = 200.0 / (DENSITY * 9.8);
    /// From and to which nodes the pipes lead.
    const FROM: [usize; 18] = [1, 2, 2, 3, 3, 4, 5, 6, 7, 7, 8, 8, 9, 11, 11, 12, 12, 13];
    const TO: [usize; 18] = [2, 3, 6, 4, 5, 5, 10, 5, 4, 8, 5, 10, 8, 9, 12, 7, 8, 11];
    /// The place of a node's pressure among all, with those of the buffers first.
    const PLACE: [usize; 14] = [0, 2, 3, 4, 5, 0, 6, 7, 1, 8, 9, 10, 11, 12];

    /// The Reynolds number of a flow, in pipes of one metre.
    fn reynolds(flow: f64) -> f64 {
        (flow / (VISCOSITY * AREA)).abs()
    }

    /// The equation of Colebrook for the resistance of a pipe.
    fn colebrook(flow: f64, resistance: f64) -> f64 {
        let root = resistance.sqrt();
        let number = if reynolds(flow) > CRITICAL { reynolds(flow) } else { CRITICAL };
        1.0 / root - 1.74 + 2.0 * (2.0 * ROUGHNESS + 18.7 / (number * root)).ln() / core::f64::consts::LN_10
    }

    /// What is lost along a pipe: turbulent or laminar.
    fn loss(flow: f64, resistance: f64) -> f64 {
        if reynolds(flow) > CRITICAL {
            resistance * DENSITY * LENGTH * flow * flow / (AREA * AREA)
        } else {
            32.0 * VISCOSITY * DENSITY * LENGTH * flow / AREA
        }
    }

    /// What flows into a node from outside, with the time in hours.
    fn inflow(node: usize, t: f64) -> f64 {
        if node == 1 {
            (1.0 - ((-t).exp() - 1.0).cos()) / 200.0
        } else if node == 13 {
            (1.0 - ((-t).exp() - 1.0).cos()) / 80.0
        } else if node == 10 {
            -t * t * (3.0 * t * t - 92.0 * t + 720.0) / 1e6
        } else {
            0.0
        }
    }

    /// The network. x = [flows, pressures of the nodes 5 and 8], z = [resistances, pressures of
    /// the other nodes].
    #[dae(index_reduction, nominal(x = [
        2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 1.1e5, 1.1e5
    ], z = [
        0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475, 0.0475,
        1.1e5, 1.1e5, 1.1e5, 1.1e5, 1.1e5, 1.1e5, 1.1e5, 1.1e5, 1.1e5, 1.1e5, 1.1e5
    ]))]
    pub fn water_tubes(xdot: [f64; 20], x: [f64; 20], z: [f64; 29], t: f64) -> [f64; 49] {
        let mut residual = [0.0; 49];
        let mut net = [0.0; 13];
        for n in 0..13 {
            net[PLACE[n + 1]] = inflow(n + 1, t / 3600.0);
        }
        for e in 0..18 {
            let (a, b) = (PLACE[FROM[e]], PLACE[TO[e]]);
            let from = if a < 2 { x[18 + a] } else { z[16 + a] };
            let to = if b < 2 { x[18 + b] } else { z[16 + b] };
            residual[e] = DENSITY * LENGTH / AREA * xdot[e] - (from - to - loss(x[e], z[e]));
            residual[20 + e] = colebrook(x[e], z[e]);
            net[a] -= x[e];
            net[b] += x[e];
        }
        residual[18] = BUFFER * xdot[18] - net[0];
        residual[19] = BUFFER * xdot[19] - net[1];
        for n in 0..11 {
            residual[38 + n] = net[2 + n];
        }
        residual
    }
}
