//! Fekete's points and Medical Akzo Nobel's problem, for the comparison of both forms.

use casados::dae;

/// What the models share is in their module.
#[dae]
pub mod equations {
    /// The repulsion of six charges, of one from all others.
    fn repulsion(x: [f64; 36], i: usize, axis: usize) -> f64 {
        let mut sum = 0.0;
        for j in 0..6 {
            if j != i {
                let d = [x[3 * i] - x[3 * j], x[3 * i + 1] - x[3 * j + 1], x[3 * i + 2] - x[3 * j + 2]];
                let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                sum += d[axis] / square;
            }
        }
        sum
    }

    /// Fekete's points: six charges on the unit sphere, in a medium, with the constraints
    /// differentiated twice. x = [positions, velocities], z = multipliers.
    #[dae]
    pub fn fekete(xdot: [f64; 36], x: [f64; 36], z: [f64; 6]) -> [f64; 42] {
        let mut residual = [0.0; 42];
        for i in 0..6 {
            let mut constraint = 0.0;
            for axis in 0..3 {
                let k = 3 * i + axis;
                let force = repulsion(x, i, axis) - 0.5 * x[18 + k] + 2.0 * z[i] * x[k];
                residual[k] = xdot[k] - x[18 + k];
                residual[18 + k] = xdot[18 + k] - force;
                constraint += x[18 + k] * x[18 + k] + x[k] * force;
            }
            residual[36 + i] = constraint;
        }
        residual
    }

    /// The same with the multipliers in their places.
    #[ode]
    pub fn fekete_eliminated(x: [f64; 36]) -> [f64; 36] {
        let mut slope = [0.0; 36];
        for i in 0..6 {
            let (mut numerator, mut square) = (0.0, 0.0);
            let force = [0, 1, 2].map(|axis| repulsion(x, i, axis) - 0.5 * x[18 + 3 * i + axis]);
            for (axis, force) in force.iter().enumerate() {
                let k = 3 * i + axis;
                numerator += x[18 + k] * x[18 + k] + x[k] * force;
                square += x[k] * x[k];
            }
            for (axis, force) in force.iter().enumerate() {
                let k = 3 * i + axis;
                slope[k] = x[18 + k];
                slope[18 + k] = force - numerator / square * x[k];
            }
        }
        slope
    }

    /// Medical Akzo Nobel's sixth concentration in its place; states and parameters are those of
    /// [`AkzoNobel`](crate::models::ivp::chemistry::AkzoNobel).
    #[ode]
    pub fn akzo_eliminated(x: [f64; 5], p: [f64; 9]) -> [f64; 5] {
        let [y1, y2, y3, y4, y5] = x;
        let [k1, k2, k3, k4, equilibrium, transfer, solubility, pressure, henry] = p;
        let z = solubility * y1 * y4;
        let root = y2.sqrt();
        let r1 = k1 * y1 * y1 * y1 * y1 * root;
        let r2 = k2 * y3 * y4;
        let r3 = k2 / equilibrium * y1 * y5;
        let r4 = k3 * y1 * y4 * y4;
        let r5 = k4 * z * z * root;
        let inflow = transfer * (pressure / henry - y2);
        [
            -2.0 * r1 + r2 - r3 - r4,
            -0.5 * r1 - r4 - 0.5 * r5 + inflow,
            r1 - r2 + r3,
            -r2 + r3 - 2.0 * r4,
            r2 - r3 + r5,
        ]
    }
}
