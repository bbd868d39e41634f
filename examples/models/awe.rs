//! An aircraft that harvests wind energy on a tether of fixed length, with turbines on board.
//!
//! Six degrees of freedom in non-minimal coordinates: position, velocity, body rates and the
//! rotation matrix itself; the tether is a constraint with a multiplier. The constraint is
//! differentiated twice, and its drift and that of the rotation matrix are damped (Baumgarte). The
//! last state accumulates the cost of an optimal control problem: a quadrature.
//!
//! The benchmark of Frey, De Schutter and Diehl, "Fast integrators with sensitivity propagation for
//! use in CasADi": aircraft after Malz et al. (2019), turbines after Zanon et al. (2013).

#![allow(clippy::module_inception)] // The file is named like the model.

use casados::dae;
use nalgebra::{Matrix3, SVector, Vector3};

/// SI units, but for the turbines and the tether: [`TURBINE_SCALE`](awe::TURBINE_SCALE),
/// [`TETHER_SCALE`](awe::TETHER_SCALE).
#[dae]
pub mod awe {
    use nalgebra::{Matrix3, Vector3};

    /// The state of the aircraft. Earth frame: origin at the ground station, x with the wind, z up.
    #[derive(Clone, Copy, Debug)]
    pub struct State {
        /// Position, m.
        pub q: Vector3<f64>,
        /// Velocity, m/s.
        pub dq: Vector3<f64>,
        /// Angular velocity in the body frame, rad/s.
        pub omega: Vector3<f64>,
        /// Rotation, body to earth: columns along the chord (to the trailing edge), the span, and
        /// up.
        pub r: Matrix3<f64>,
        /// Deflections of aileron, elevator and rudder, rad.
        pub delta: Vector3<f64>,
        /// Drag coefficient of the turbines, in units of `TURBINE_SCALE`.
        pub kappa: f64,
        /// Accumulated cost.
        pub cost: f64,
    }

    /// What is controlled: rates.
    #[derive(Clone, Copy, Debug)]
    pub struct Control {
        /// Deflection rates, rad/s.
        pub delta: Vector3<f64>,
        /// Rate of the drag coefficient, in units of `TURBINE_SCALE` per second.
        pub kappa: f64,
    }

    /// The equations, in their order.
    #[derive(Clone, Copy, Debug)]
    pub struct Residual {
        /// Balance of forces.
        pub force: Vector3<f64>,
        /// Balance of moments.
        pub moment: Vector3<f64>,
        /// Kinematics of the rotation matrix.
        pub rotation: Matrix3<f64>,
        /// Deflections follow their rates.
        pub delta: Vector3<f64>,
        /// So do the turbines.
        pub kappa: f64,
        /// The derivative of the position is the velocity.
        pub velocity: Vector3<f64>,
        /// The tether keeps its length.
        pub tether: f64,
        /// The cost accumulates.
        pub cost: f64,
    }

    /// Unit of the drag coefficient of the turbines, kg/m.
    pub const TURBINE_SCALE: f64 = 10.0;
    /// Unit of the multiplier of the tether, N/m: the tension is `TETHER_SCALE * z[0] * LENGTH`.
    pub const TETHER_SCALE: f64 = 12.499305032751677;
    /// Length of the tether, m.
    pub const LENGTH: f64 = 434.287;
    /// Duration of the optimal orbit, s.
    pub const ORBIT: f64 = 13.456375779859805;

    const G: f64 = 9.81; // m/s²
    const UP: Vector3<f64> = Vector3::new(0.0, 0.0, 1.0);

    // The aircraft, an Ampyx AP2.
    const MASS: f64 = 36.8; // kg
    const INERTIA: Matrix3<f64> = Matrix3::new(
        25.0, 0.0, 0.47, //
        0.0, 32.0, 0.0, //
        0.47, 0.0, 56.0, // kg m²
    );
    const SPAN: f64 = 5.5; // m
    const AREA: f64 = 3.0; // m²
    const CHORD: f64 = AREA / SPAN; // m
    const TURBINE_EFFICIENCY: f64 = 0.75;

    // The tether.
    const DIAMETER: f64 = 0.002; // m
    const TETHER_MASS: f64 = 0.0046 * LENGTH; // kg
    const TETHER_DRAG: f64 = 1.2;
    const ELEMENTS: usize = 5;

    // Damping of the drift of the tether's length and of the rotation matrix, 1/s.
    const TETHER_DAMPING: f64 = 0.1;
    const ROTATION_DAMPING: f64 = 1.0;

    // Scales of the equations.
    const FORCE: f64 = 5178.2085; // N
    const MOMENT: f64 = MASS * G * SPAN / 2.0; // N m
    const CONSTRAINT: f64 = 1_102_500.0; // m²/s²

    /// Speed of the wind at a height: a power law.
    fn wind(height: f64) -> f64 {
        10.0 * ((height * height + 1.0).sqrt() / 100.0).powf(0.15)
    }

    /// Density of the air at a height: the standard atmosphere, kg/m³.
    fn density(height: f64) -> f64 {
        const LAPSE: f64 = 0.0065; // K/m
        const GROUND: f64 = 288.15; // K
        const GAS: f64 = 287.053; // J/(kg K)
        1.225 * ((GROUND - LAPSE * height) / GROUND).powf(G / LAPSE / GAS - 1.0)
    }

    /// The wind that something at position `q` with velocity `dq` feels.
    fn apparent_wind(q: Vector3<f64>, dq: Vector3<f64>) -> Vector3<f64> {
        Vector3::new(wind(q.z), 0.0, 0.0) - dq
    }

    /// `Σ cᵢ aⁱ`
    fn polynomial<const N: usize>(c: [f64; N], a: f64) -> f64 {
        c.iter().rev().fold(0.0, |sum, c| sum * a + c)
    }

    /// Coefficients of the force and the moment in the control frame (x forward, y along the span,
    /// z down), from the angle of attack, the sideslip, the normalised rates and the deflections.
    fn coefficients(
        alpha: f64,
        beta: f64,
        rates: Vector3<f64>,
        delta: Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let [p, q, r] = [rates.x, rates.y, rates.z];
        let [aileron, elevator, rudder] = [delta.x, delta.y, delta.z];
        let force = Vector3::new(
            polynomial([-0.0293, 0.4784, 2.5549], alpha)
                + polynomial([-0.6029, 4.4124], alpha) * q
                + polynomial([-0.0106, 0.1115], alpha) * elevator,
            polynomial([-0.1855, -0.0299, 0.0936], alpha) * beta
                + polynomial([-0.1022, -0.0140, 0.0496], alpha) * p
                + polynomial([0.1694, 0.1368], alpha) * r
                + polynomial([-0.0514, -0.0024, 0.0579], alpha) * aileron
                + polynomial([0.10325, 0.0268, -0.1036], alpha) * rudder,
            polynomial([-0.5526, -5.0676, 5.7736], alpha)
                + polynomial([-7.5560, 0.1251, 6.1486], alpha) * q
                + polynomial([-0.315, -0.0013, 0.2923], alpha) * elevator,
        );
        let moment = Vector3::new(
            polynomial([-0.0630, -0.0003, 0.0312], alpha) * beta
                + polynomial([-0.5632, -0.0247, 0.2813], alpha) * p
                + polynomial([0.1811, 0.6448], alpha) * r
                + polynomial([-0.2489, -0.0087, 0.2383], alpha) * aileron
                + polynomial([0.00436, -0.0013], alpha) * rudder,
            polynomial([-0.0307, -0.6027], alpha)
                + polynomial([-11.3022, -0.0026, 5.2885], alpha) * q
                + polynomial([-1.0427, -0.0061, 0.9974], alpha) * elevator,
            polynomial([0.0577, -0.0849], alpha) * beta
                + polynomial([-0.0565, -0.9137], alpha) * p
                + polynomial([-0.0553, 0.0290, 0.0257], alpha) * r
                + polynomial([0.01903, -0.1147], alpha) * aileron
                + polynomial([-0.0404, -0.0117, 0.04089], alpha) * rudder,
        );
        (force, moment)
    }

    /// Angle of attack and sideslip, both small, from the apparent wind in the body frame.
    fn flow_angles(wind: Vector3<f64>) -> (f64, f64) {
        let forward = (wind.x * wind.x + 1e-16).sqrt();
        (wind.z / forward, wind.y / forward)
    }

    /// From the body frame to the control frame and back.
    fn flip(v: Vector3<f64>) -> Vector3<f64> {
        Vector3::new(-v.x, v.y, -v.z)
    }

    /// Drag of the tether: that of its elements, each moving in proportion to its distance from the
    /// ground, and as much of it as the kite carries.
    fn tether_drag(q: Vector3<f64>, dq: Vector3<f64>) -> Vector3<f64> {
        let element = q / ELEMENTS as f64;
        let mut force = Vector3::zeros();
        for k in 0..ELEMENTS {
            let s = (k as f64 + 0.5) / ELEMENTS as f64;
            let wind = apparent_wind(q * s, dq * s);
            let speed = (wind.norm_squared() + 1e-12).sqrt();
            let along = element.dot(&wind) / speed;
            let across = (element.norm_squared() - along * along + 1e-12).sqrt();
            let pressure = 0.5 * TETHER_DRAG * density(s * q.z) * speed * DIAMETER * across;
            force += wind * (s * pressure);
        }
        force
    }

    /// What the turbines generate, W.
    pub fn power(x: &State) -> f64 {
        TURBINE_EFFICIENCY * TURBINE_SCALE * x.kappa * apparent_wind(x.q, x.dq).norm().powi(3)
    }

    /// The matrix `S` with `S v = ω × v`.
    fn skew(omega: Vector3<f64>) -> Matrix3<f64> {
        let [x, y, z] = [omega.x, omega.y, omega.z];
        Matrix3::new(
            0.0, -z, y, //
            z, 0.0, -x, //
            -y, x, 0.0,
        )
    }

    /// The cost per second of an optimal orbit: power, and regularisation of everything that moves.
    fn running_cost(xdot: &State, u: &Control, beta: f64, power: f64) -> f64 {
        let profit = 121.96560160548071 * power / 291516.74163444503 / ORBIT;
        let controls = 0.25 * u.delta.norm_squared() + 0.025 * u.kappa * u.kappa;
        let states = 1.25e-11 * xdot.q.norm_squared()
            + 1.25e-10 * xdot.dq.norm_squared()
            + 6.25e-3 * xdot.omega.norm_squared()
            + 1.25e-10 * xdot.r.norm_squared()
            + 1.25e-8 * xdot.delta.norm_squared()
            + 1.25e-9 * xdot.kappa * xdot.kappa
            + 1.25e-10 * xdot.cost * xdot.cost;
        controls + states + 0.2 * beta * beta - profit
    }

    /// `f(ẋ, x, u, z) = 0`; z = [multiplier of the tether, in units of `TETHER_SCALE`].
    pub fn awe(xdot: State, x: State, u: Control, z: [f64; 1]) -> Residual {
        let (q, dq, ddq) = (x.q, x.dq, xdot.dq);

        // Air: on the wings and on the turbines.
        let wind = apparent_wind(q, dq);
        let speed = wind.norm();
        let (alpha, beta) = flow_angles(x.r.transpose() * wind);
        let rates = flip(x.omega).component_mul(&Vector3::new(SPAN, CHORD, SPAN)) / (2.0 * speed);
        let (lift, twist) = coefficients(alpha, beta, rates, x.delta);
        let pressure = 0.5 * density(q.z) * speed * speed * AREA;
        let force = x.r * flip(lift) * pressure;
        let moment = flip(twist.component_mul(&Vector3::new(SPAN, CHORD, SPAN))) * pressure;

        let turbines = wind * (TURBINE_SCALE * x.kappa * speed);

        // The tether is straight, turns with the kite, and has mass but no weight.
        let tension = q * (TETHER_SCALE * z[0]);
        let e = q / LENGTH;
        let s = e.dot(&dq);
        let ds = dq.norm_squared() / LENGTH + e.dot(&ddq);
        let inertia = ddq * (MASS + TETHER_MASS / 3.0)
            + e * (TETHER_MASS / 3.0 * ((1.0 + e.norm_squared()) * ds + s * s / LENGTH));
        let weight = UP * (MASS * G);

        // Its constraint c = 0, twice differentiated and damped.
        let c = (q.norm_squared() - LENGTH * LENGTH) / 2.0;
        let dc = q.dot(&dq);
        let ddc = dq.norm_squared() + q.dot(&ddq);

        let drift = Matrix3::identity() - x.r.transpose() * x.r;
        Residual {
            force: (inertia + weight + tension - force - turbines - tether_drag(q, dq)) / FORCE,
            moment: (moment - (INERTIA * xdot.omega + x.omega.cross(&(INERTIA * x.omega)))) / MOMENT,
            rotation: xdot.r - x.r * (drift * (ROTATION_DAMPING / 2.0) + skew(x.omega)),
            delta: xdot.delta - u.delta,
            kappa: xdot.kappa - u.kappa,
            velocity: xdot.q - dq,
            tether: (ddc + 2.0 * TETHER_DAMPING * dc + TETHER_DAMPING * TETHER_DAMPING * c) / CONSTRAINT,
            cost: xdot.cost - running_cost(&xdot, &u, beta, power(&x)),
        }
    }
}

impl From<SVector<f64, 23>> for awe::State {
    fn from(x: SVector<f64, 23>) -> Self {
        let vector = |i: usize| Vector3::new(x[i], x[i + 1], x[i + 2]);
        Self {
            q: vector(0),
            dq: vector(3),
            omega: vector(6),
            r: Matrix3::from_columns(&[vector(9), vector(12), vector(15)]),
            delta: vector(18),
            kappa: x[21],
            cost: x[22],
        }
    }
}

impl From<SVector<f64, 4>> for awe::Control {
    fn from(u: SVector<f64, 4>) -> Self {
        Self { delta: Vector3::new(u[0], u[1], u[2]), kappa: u[3] }
    }
}

impl From<awe::Residual> for SVector<f64, 24> {
    fn from(f: awe::Residual) -> Self {
        let numbers = f.force.iter().chain(&f.moment).chain(&f.rotation).chain(&f.delta).chain([&f.kappa]);
        let mut numbers = numbers.chain(&f.velocity).chain([&f.tether, &f.cost]);
        SVector::from_fn(|_, _| numbers.next().copied().unwrap_or(f64::NAN))
    }
}
