//! Quadrotors: in a plane, with six states, and in space, with twelve.

use casados::ode;

const G: f64 = 9.81; // m/s²

/// In a vertical plane.
///
/// x = [horizontal and vertical position m, pitch rad, their velocities], u = [thrusts of both
/// rotors N].
#[ode]
pub fn planar_quadrotor(x: [f64; 6], u: [f64; 2]) -> [f64; 6] {
    const MASS: f64 = 0.5; // kg
    const INERTIA: f64 = 0.005; // kg m²
    const ARM: f64 = 0.15; // m

    let [_, _, pitch, v, w, rate] = x;
    let (sin, cos) = pitch.sin_cos();
    let thrust = (u[0] + u[1]) / MASS;
    [v, w, rate, -thrust * sin, thrust * cos - G, (u[1] - u[0]) * ARM / INERTIA]
}

/// In space; angles are roll, pitch and yaw, rates those of the body.
///
/// x = [position m, angles rad, velocity m/s, rates rad/s], u = [thrusts of the rotors in front,
/// right, behind, left N].
#[ode]
pub fn quadrotor(x: [f64; 12], u: [f64; 4]) -> [f64; 12] {
    const MASS: f64 = 1.0; // kg
    const INERTIA: [f64; 3] = [0.01, 0.01, 0.02]; // kg m²
    const ARM: f64 = 0.2; // m
    const DRAG: f64 = 0.02; // torque of a rotor per thrust, m

    let [_, _, _, roll, pitch, yaw, vx, vy, vz, p, q, r] = x;
    let [front, right, behind, left] = u;
    let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    let thrust = (front + right + behind + left) / MASS;
    let [ix, iy, iz] = INERTIA;
    [
        vx,
        vy,
        vz,
        p + (q * sr + r * cr) * sp / cp,
        q * cr - r * sr,
        (q * sr + r * cr) / cp,
        thrust * (cr * sp * cy + sr * sy),
        thrust * (cr * sp * sy - sr * cy),
        thrust * cr * cp - G,
        (ARM * (left - right) + (iy - iz) * q * r) / ix,
        (ARM * (behind - front) + (iz - ix) * r * p) / iy,
        (DRAG * (right + left - front - behind) + (ix - iy) * p * q) / iz,
    ]
}
