//! The wheelset of the Test Set for IVP Solvers (B. Simeon, C. Führer, P. Rentrop), of index 2: a
//! pair of wheels on a straight track that hunts between the rails, with creep at the contacts.
//!
//! The contacts are algebraic in the test set. The constraint of velocities contains them, so that
//! they have to be differentiated, and no equation gives them explicitly: here they are states,
//! whose derivatives follow from the contact conditions.

#![allow(clippy::module_inception)] // The model's module is named as it is.

use casados::prelude::*;
use nalgebra::SVector;

/// `(x, y, z, θ, φ)`, its rates, the deviation of the turning rate, and the contacts `(ψ, ξ)` left
/// and right; `z` are the forces of the constraints, in 1e4 N.
#[dae(
    index_reduction,
    nominal(z = -0.008),
    range(
        x = [-0.01..=0.01, -1e-4..=1e-4, -1e-3..=1e-3, -0.03..=0.03, -0.01..=0.01, -0.3..=0.3, -0.01..=0.01,
            -0.01..=0.01, -1.0..=1.0, -0.1..=0.1, -1.0..=1.0, -0.01..=0.01, 0.12..=0.18, -0.01..=0.01, -0.18..=-0.12],
        z = -0.02..=-0.001
    )
)]
mod wheelset {
    const MASS: f64 = 16.08; // kg
    const G: f64 = 9.81; // m/s²
    const SPEED: f64 = 30.0; // m/s
    const RADIUS: f64 = 0.1; // m
    const SPIN: f64 = 0.0605; // moments of inertia, kg m²
    const YAW: f64 = 0.366;
    const ARM: f64 = 0.19; // of the springs, m
    const SPRING: f64 = 6400.0; // N/m
    const FRICTION: f64 = 0.12;

    const CONE: f64 = 0.0262; // rad
    const HALF: f64 = 0.1506; // of the distance of the wheels, m
    const RAIL: f64 = 0.06; // its radius, m

    // Contact, after A. Jaschinski.
    const E: f64 = 1.3537956;
    const ECCENTRICITY: f64 = 0.7115218;
    const POISSON: f64 = 0.28;
    const SHEAR: f64 = 7.92e10; // N/m²
    #[allow(clippy::approx_constant)]
    const PI: f64 = 3.1415926;
    const C11: f64 = 4.72772197;
    const C22: f64 = 4.27526987;
    const C23: f64 = 1.97203505;

    /// One wheel on its rail: `side` is 1 left and −1 right.
    struct Contact {
        side: f64,
        xi: f64,
        sin: f64,
        cos: f64,
        /// The radius of the wheel there, and its slope.
        radius: f64,
        slope: f64,
        /// The slope of the rail, and its second derivative.
        rail: f64,
        bend: f64,
        /// The row of the constraint.
        row: [f64; 5],
        /// The angle of the plane of contact.
        sin_delta: f64,
        cos_delta: f64,
    }

    fn contact(x: [f64; 15], side: f64, psi: f64, xi: f64) -> Contact {
        let ((st, ct), (sp, cp)) = (x[3].sin_cos(), x[4].sin_cos());
        let (sin, cos) = psi.sin_cos();
        let radius = RADIUS + CONE.tan() * (HALF - side * xi);
        let slope = -side * CONE.tan();
        let at = x[0] + xi * ct * cp + radius * (ct * sp * cos - st * sin);
        let from_middle = HALF + CONE.sin() * RAIL - side * at;
        let depth = (RAIL * RAIL - from_middle * from_middle).sqrt();
        let rail = side * from_middle / depth;
        let row = [
            rail,
            -1.0,
            0.0,
            rail * (radius * (-ct * sin - cos * sp * st) - cp * st * xi),
            -cos * radius * sp - cp * xi + rail * (cp * cos * ct * radius - ct * sp * xi),
        ];
        let up = -side * (slope * sp + cos * cp);
        let delta = (((slope * cp - sp * cos) * ct + sin * st) / up).atan();
        let (sin_delta, cos_delta) = delta.sin_cos();
        let bend = -RAIL * RAIL / (depth * depth * depth);
        Contact { side, xi, sin, cos, radius, slope, rail, bend, row, sin_delta, cos_delta }
    }

    impl Contact {
        /// Creep forces where the normal force is `normal`.
        fn creep(&self, x: [f64; 15], normal: f64) -> [f64; 3] {
            let (sp, cp) = x[4].sin_cos();
            let [vx, vy, vz, vtheta, vphi, beta] = [x[5], x[6], x[7], x[8], x[9], x[10]];
            let Self { xi, sin, cos, radius, slope, rail, bend, cos_delta, .. } = *self;
            let tilt = self.side * self.sin_delta;
            let (st, ct) = (x[3] / cos_delta).sin_cos();
            let turning = SPEED / RADIUS + beta;

            let curvature = -bend / (1.0 + rail * rail).powf(1.5);
            let sum = 0.5 / (radius * (1.0 + slope * slope).sqrt()) + 0.5 * curvature;
            let ellipse = (3.0 * normal.abs() * (1.0 - POISSON) * E
                / (2.0 * PI * sum * SHEAR * ECCENTRICITY.sqrt()))
            .cbrt();

            let out = xi * sp - radius * cp * cos;
            let slip_x = -turning * radius * (st * cos + ct * sp * sin) + vx
                - vtheta * (radius * (st * sp * cos + ct * sin) + xi * st * cp)
                - vphi * ct * out;
            let slip_y = turning * radius * cp * sin + vy + vphi * (xi * cp + radius * sp * cos);
            let slip_z = -turning * radius * (ct * cos - st * sp * sin) + SPEED + vz
                - vtheta * (xi * ct * cp + radius * (ct * sp * cos - st * sin))
                + vphi * st * out;
            let [rx, ry, rz] = [slip_x - 2.0 * vx, slip_y - 2.0 * vy, slip_z - 2.0 * vz - 2.0 * SPEED];
            let rolling = 0.5 * (rx * rx + ry * ry + rz * rz).sqrt();

            let along = (st * slip_x + ct * slip_z) / rolling;
            let across = (ct * cos_delta * slip_x + tilt * slip_y - st * cos_delta * slip_z) / rolling;
            let spin = (-tilt * turning + cos_delta * vtheta) / rolling;
            let most = FRICTION * normal;
            let stiffness = SHEAR * ellipse * ellipse / most;
            let tx = -most * (stiffness * C11 * along).tanh();
            let ty = -most * (stiffness * (C22 * across + ellipse * C23 * spin)).tanh();
            let size = tx * tx + ty * ty;
            let scale = if size > most * most { most.abs() / size.sqrt() } else { 1.0 };
            let (tx, ty) = (tx * scale, ty * scale);
            [st * tx + ct * cos_delta * ty, tilt * ty, ct * tx - st * cos_delta * ty]
        }

        /// Moments of a force at the contact.
        fn moments(&self, x: [f64; 15], [tx, ty, tz]: [f64; 3]) -> [f64; 3] {
            let ((st, ct), (sp, cp)) = (x[3].sin_cos(), x[4].sin_cos());
            let Self { xi, sin, cos, radius, .. } = *self;
            [
                -(xi * st + radius * sin * ct * cp) * tx - radius * sin * sp * ty
                    + (-xi * ct + radius * sin * st * cp) * tz,
                -(xi * ct * sp - radius * cos * ct * cp) * tx
                    + (xi * cp + radius * cos * sp) * ty
                    + (xi * st * sp - radius * cos * st * cp) * tz,
                -radius * (cos * st + sin * ct * sp) * tx + radius * sin * cp * ty
                    - radius * (cos * ct - sin * st * sp) * tz,
            ]
        }

        /// The normals of wheel and rail are parallel.
        fn parallel(&self, x: [f64; 15]) -> [f64; 2] {
            let ((st, ct), (sp, cp)) = (x[3].sin_cos(), x[4].sin_cos());
            let Self { sin, cos, slope, rail, .. } = *self;
            [
                rail * (slope * sp + cp * cos) + slope * ct * cp - ct * sp * cos + st * sin,
                slope * st * cp - st * sp * cos - ct * sin,
            ]
        }
    }

    fn dot(a: [f64; 5], b: [f64; 5]) -> f64 {
        a.iter().zip(&b).map(|(a, b)| a * b).sum()
    }

    pub fn wheelset(xdot: [f64; 15], x: [f64; 15], z: [f64; 2]) -> [f64; 17] {
        let (sp, cp) = x[4].sin_cos();
        let [left, right] = [contact(x, 1.0, x[11], x[12]), contact(x, -1.0, x[13], x[14])];
        let (e1, e2) = (1e4 * z[0], 1e4 * z[1]);
        let constraint: [f64; 5] = core::array::from_fn(|i| left.row[i] * e1 + right.row[i] * e2);

        let determinant = -left.sin_delta * right.cos_delta - right.sin_delta * left.cos_delta;
        let normal_left = (right.cos_delta * constraint[0] - right.sin_delta * constraint[1]) / determinant;
        let normal_right = (-left.cos_delta * constraint[0] - left.sin_delta * constraint[1]) / determinant;
        let (tl, tr) = (left.creep(x, normal_left), right.creep(x, normal_right));
        let (ml, mr) = (left.moments(x, tl), right.moments(x, tr));

        let velocity = [x[5], x[6], x[7], x[8], x[9]];
        let [_, _, _, vtheta, vphi] = velocity;
        let turning = SPEED / RADIUS + x[10];
        let springs = -2.0 * ARM * ARM * SPRING * x[3];
        let [parallel_left, parallel_right] = [left.parallel(x), right.parallel(x)];
        [
            xdot[0] - x[5],
            xdot[1] - x[6],
            xdot[2] - x[7],
            xdot[3] - x[8],
            xdot[4] - x[9],
            MASS * xdot[5] - (tl[0] + tr[0] + constraint[0] - 2.0 * SPRING * x[0]),
            MASS * xdot[6] - (tl[1] + tr[1] + constraint[1] - MASS * G),
            MASS * xdot[7] - (tl[2] + tr[2] + constraint[2] - 2.0 * SPRING * x[2]),
            YAW * cp * xdot[8]
                - (YAW * vtheta * vphi * sp - SPIN * turning * vphi - (SPIN - YAW) * vtheta * sp * vphi
                    + ml[0]
                    + mr[0]
                    + cp * springs
                    + constraint[3]),
            YAW * xdot[9]
                - (SPIN * turning * vtheta * cp
                    + (SPIN - YAW) * vtheta * sp * vtheta * cp
                    + ml[1]
                    + mr[1]
                    + constraint[4]),
            SPIN * (sp * xdot[8] + xdot[10]) - (-SPIN * vtheta * vphi * cp + ml[2] + mr[2] + sp * springs),
            dot(left.row, velocity),
            dot(right.row, velocity),
            parallel_left[0],
            parallel_left[1],
            parallel_right[0],
            parallel_right[1],
        ]
    }
}

const START: [f64; 15] = [
    0.14941e-2,
    0.40089e-6,
    0.11241e-5,
    -0.28573e-3,
    0.26459e-3,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
    7.563440639517294e-6,
    0.1490635714733819,
    -7.412238035766714e-6,
    -0.1521364296121248,
];

/// At `t = 10` by DASSL with tolerances of 1e-9, as the test set has it.
const END: [f64; 15] = [
    0.86355386965811e-2,
    0.13038281022727e-4,
    -0.93635784016818e-4,
    -0.13642299804033e-1,
    0.15292895005422e-2,
    -0.76985374142666e-1,
    -0.25151106429207e-3,
    0.20541188079539e-2,
    -0.23904837703692,
    -0.13633468454173e-1,
    -0.24421377661131,
    0.37839614386969e-3,
    0.14173214964613,
    -0.33666751972196e-3,
    -0.15949425684022,
];
const FORCES: [f64; 2] = [-0.10124044903201e-1, -0.56285630573753e-2];

#[test]
fn differentiated_contacts() {
    let reduction = Wheelset::STRUCTURE.reduction.unwrap();
    assert_eq!(reduction.differentiated, [(11, 1), (12, 1), (13, 1), (14, 1), (15, 1), (16, 1)]);
    assert_eq!(reduction.singular[0], 0);
}

/// The reference was found with tolerances of 1e-9 as well, by a method of lower order in 54,000
/// steps. Runs with 1e-9 and 1e-10 lie on both sides of it: by up to 6e-8 in positions and 3e-6 in
/// their rates, as those of 1e-8 are by 2e-7 and 1e-5.
#[test]
fn hunting_of_the_wheelset() {
    let options = AdaptiveOptions { rtol: 1e-9, atol: 1e-9, ..Default::default() };
    let mut radau = Adaptive::<Wheelset, Radau>::new(options).unwrap();
    let end = radau.solve(&SVector::from(START), &Default::default(), 10.0).unwrap();
    let off = end.x - SVector::from(END);
    assert!(off.rows(0, 5).amax() < 1e-7 && off.rows(11, 4).amax() < 1e-7, "{off}");
    assert!(off.rows(5, 6).amax() < 5e-6, "{off}");
    assert!((end.z - SVector::from(FORCES)).amax() < 5e-8, "{}", end.z);
}
