//! The NAND gate of the Test Set for IVP Solvers: a circuit of three MOS transistors whose
//! capacitances depend on their voltages, fully implicit, `C(y) ẏ = f(t, y)`.

use casados::dae;

/// At `t = 80`, by PSIDE with tolerances of 1e-16 on a Cray C90 (F. Mazzia, C. Magherini, Test Set
/// for Initial Value Problem Solvers, release 2.4, NAND gate).
pub const END: [f64; 14] = [
    4.971_088_699_385_777,
    4.999_752_103_929_311,
    -2.499_998_781_491_227,
    -2.499_999_999_999_975,
    4.970_837_023_296_724,
    -0.209_121_403_207_385_5,
    4.970_593_243_278_363,
    -2.500_077_409_198_803,
    -2.499_998_781_491_227,
    -0.209_028_958_387_81,
    -0.239_999_999_996_626_9e-3,
    -0.209_121_403_207_385_5,
    -2.499_999_999_999_991,
    -2.500_077_409_198_803,
];

/// The start, at `t = 0`: node potentials in volts.
pub const START: [f64; 14] =
    [5.0, 5.0, -2.5, -2.5, 5.0, 3.62385, 5.0, -2.5, -2.5, 3.62385, 0.0, 3.62385, -2.5, -2.5];

/// Equations and what they share.
#[dae]
pub mod equations {
    const RESISTANCE: f64 = 4.0;
    const RESISTANCE_BULK: f64 = 10.0;
    const GATE: f64 = 0.6e-4;
    const BULK: f64 = 2.4e-5;
    const LOAD: f64 = 0.5e-4;
    const DELTA: f64 = 0.02;
    const SATURATION: f64 = 1e-14;
    const THERMAL: f64 = 25.85;
    const SUPPLY: f64 = 5.0;
    const GROUND: f64 = -2.5;

    /// A ramp of one volt a nanosecond to five volts.
    fn ramp(since: f64) -> f64 {
        since.max(0.0) - (since - 5.0).max(0.0)
    }

    /// Its rate.
    fn rate(since: f64) -> f64 {
        if since > 0.0 && since < 5.0 { 1.0 } else { 0.0 }
    }

    /// The first input, a trapezoid in each of four periods; its rate.
    fn first(t: f64) -> [f64; 2] {
        let (mut value, mut slope) = (0.0, 0.0);
        for period in 0..4 {
            let since = t - 20.0 * period as f64 - 5.0;
            value += ramp(since) - ramp(since - 10.0);
            slope += rate(since) - rate(since - 10.0);
        }
        [value, slope]
    }

    /// The second input, in each of two periods.
    fn second(t: f64) -> [f64; 2] {
        let (mut value, mut slope) = (0.0, 0.0);
        for period in 0..2 {
            let since = t - 40.0 * period as f64 - 15.0;
            value += ramp(since) - ramp(since - 20.0);
            slope += rate(since) - rate(since - 20.0);
        }
        [value, slope]
    }

    /// The current of a junction, which only one direction has.
    fn junction(v: f64) -> f64 {
        if v <= 0.0 { SATURATION * (1.0 - (v / THERMAL).exp()) } else { 0.0 }
    }

    /// The capacitance of a junction.
    fn capacitance(v: f64) -> f64 {
        if v <= 0.0 { BULK / (1.0 - v / 0.87).sqrt() } else { BULK * (1.0 + v / (2.0 * 0.87)) }
    }

    /// The current from drain to source, of Shichman and Hodges, where it flows forwards: with the
    /// threshold, its coefficient of the bulk and its potential, and the gain.
    fn channel(drain: f64, gate: f64, bulk: f64, kind: [f64; 4]) -> f64 {
        let [threshold, body, potential, gain] = kind;
        let over = gate - threshold - body * ((potential - bulk).sqrt() - potential.sqrt());
        let modulation = gain * (1.0 + DELTA * drain);
        if over <= 0.0 {
            0.0
        } else if over <= drain {
            -modulation * over * over
        } else {
            -modulation * drain * (2.0 * over - drain)
        }
    }

    /// In both directions: voltages of drain, gate and bulk to the source, of gate and bulk to the
    /// drain.
    fn transistor(voltages: [f64; 5], forwards: [f64; 4], backwards: [f64; 4]) -> f64 {
        let [drain, gate_source, bulk_source, gate_drain, bulk_drain] = voltages;
        if drain > 0.0 {
            channel(drain, gate_source, bulk_source, forwards)
        } else {
            -channel(-drain, gate_drain, bulk_drain, backwards)
        }
    }

    /// Depletion and enhancement.
    fn depletion(voltages: [f64; 5]) -> f64 {
        let kind = [-2.43, 0.2, 1.28, 5.35e-4];
        transistor(voltages, kind, kind)
    }

    /// The test set has a tenth of the gain backwards, and so has its reference.
    fn enhancement(voltages: [f64; 5]) -> f64 {
        transistor(voltages, [0.2, 0.035, 1.01, 1.748e-3], [0.2, 0.035, 1.01, 1.748e-4])
    }

    /// The NAND gate; times in nanoseconds.
    #[dae]
    pub fn nand(xdot: [f64; 14], x: [f64; 14], t: f64) -> [f64; 14] {
        let [v1, d1] = first(t);
        let [v2, d2] = second(t);
        let [y1, y2, y3, y4, y5, y6, y7, y8, y9, y10, y11, y12, y13, y14] = x;
        let load = depletion([y2 - y1, y5 - y1, y3 - y5, y5 - y2, y4 - SUPPLY]);
        let upper = enhancement([y7 - y6, v1 - y6, y8 - y10, v1 - y7, y9 - y5]);
        let lower = enhancement([y12 - y11, v2 - y11, y13, v2 - y12, y14 - y10]);
        // Charges of the junctions: each capacitance times the rate of its voltage.
        let c3 = capacitance(y3 - y5) * (xdot[2] - xdot[4]);
        let c8 = capacitance(y8 - y10) * (xdot[7] - xdot[9]);
        let c9 = capacitance(y9 - y5) * (xdot[8] - xdot[4]);
        let c14 = capacitance(y14 - y10) * (xdot[13] - xdot[9]);
        [
            GATE * (xdot[0] - xdot[4]) + (y1 - y5) / RESISTANCE + load,
            GATE * (xdot[1] - xdot[4]) + (y2 - SUPPLY) / RESISTANCE - load,
            c3 + (y3 - GROUND) / RESISTANCE_BULK - junction(y3 - y5),
            capacitance(y4 - SUPPLY) * xdot[3] + (y4 - GROUND) / RESISTANCE_BULK - junction(y4 - SUPPLY),
            GATE * (2.0 * xdot[4] - xdot[0] - xdot[1]) - c3 - c9
                + LOAD * xdot[4]
                + (y5 - y1) / RESISTANCE
                + junction(y3 - y5)
                + (y5 - y7) / RESISTANCE
                + junction(y9 - y5),
            GATE * (xdot[5] - d1) + (y6 - y10) / RESISTANCE + upper,
            GATE * (xdot[6] - d1) + (y7 - y5) / RESISTANCE - upper,
            c8 + (y8 - GROUND) / RESISTANCE_BULK - junction(y8 - y10),
            c9 + (y9 - GROUND) / RESISTANCE_BULK - junction(y9 - y5),
            LOAD * xdot[9] - c8 - c14
                + (y10 - y6) / RESISTANCE
                + junction(y8 - y10)
                + (y10 - y12) / RESISTANCE
                + junction(y14 - y10),
            GATE * (xdot[10] - d2) + y11 / RESISTANCE + lower,
            GATE * (xdot[11] - d2) + (y12 - y10) / RESISTANCE - lower,
            capacitance(y13) * xdot[12] + (y13 - GROUND) / RESISTANCE_BULK - junction(y13),
            c14 + (y14 - GROUND) / RESISTANCE_BULK - junction(y14 - y10),
        ]
    }
}
