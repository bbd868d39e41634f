//! Celestial and multibody mechanics.
#![allow(clippy::manual_memcpy)] // One loop over the bodies reads best.

use casados::{dae, ode};

/// Seven stars in a plane attract each other: close encounters. x = [x, y, ẋ, ẏ], seven of each;
/// the mass of star `j` is its number.
#[ode]
pub fn pleiades(x: [f64; 28]) -> [f64; 28] {
    let mut derivative: [f64; 28] = core::array::from_fn(|i| if i < 14 { x[14 + i] } else { 0.0 });
    for i in 0..7 {
        for j in 0..i {
            let (dx, dy) = (x[j] - x[i], x[7 + j] - x[7 + i]);
            let square = dx * dx + dy * dy;
            let cube = square * square.sqrt();
            let (mass_i, mass_j) = ((i + 1) as f64, (j + 1) as f64);
            derivative[14 + i] += mass_j * dx / cube;
            derivative[21 + i] += mass_j * dy / cube;
            derivative[14 + j] -= mass_i * dx / cube;
            derivative[21 + j] -= mass_i * dy / cube;
        }
    }
    derivative
}

/// Andrews' squeezing mechanism, seven bodies in a plane, with its constraints differentiated
/// twice. x = [angles β Θ γ Φ δ Ω ε, their rates], z = [their accelerations, the six multipliers].
///
/// E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section VII.7.
#[dae]
pub fn squeezer(xdot: [f64; 14], x: [f64; 14], z: [f64; 13]) -> [f64; 27] {
    const M: [f64; 7] = [0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498];
    const I: [f64; 7] = [2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5];
    const XB: f64 = -0.03635;
    const YB: f64 = 0.03273;
    const XC: f64 = 0.014;
    const YC: f64 = 0.072;
    const SPRING: f64 = 4530.0;
    const LENGTH: f64 = 0.07785;
    const TORQUE: f64 = 0.033;
    const D: f64 = 0.028;
    const DA: f64 = 0.0115;
    const E: f64 = 0.02;
    const EA: f64 = 0.01421;
    const RR: f64 = 0.007;
    const RA: f64 = 0.00092;
    const SS: f64 = 0.035;
    const SA: f64 = 0.01874;
    const SB: f64 = 0.01043;
    const SC: f64 = 0.018;
    const SD: f64 = 0.02;
    const TA: f64 = 0.02308;
    const TB: f64 = 0.00916;
    const U: f64 = 0.04;
    const UA: f64 = 0.01228;
    const UB: f64 = 0.00449;
    const ZF: f64 = 0.02;
    const ZT: f64 = 0.04;
    const FA: f64 = 0.01421;

    let [beta, theta, gamma, phi, delta, omega, epsilon, vb, vt, vg, vp, vd, vo, ve] = x;
    let (ab, at, ag, ap, ad, ao, ae) = (z[0], z[1], z[2], z[3], z[4], z[5], z[6]);
    let lambda = [z[7], z[8], z[9], z[10], z[11], z[12]];
    let (sb, cb) = beta.sin_cos();
    let (st, ct) = theta.sin_cos();
    let (sg, cg) = gamma.sin_cos();
    let (sp, cp) = phi.sin_cos();
    let (sd, cd) = delta.sin_cos();
    let (so, co) = omega.sin_cos();
    let (se, ce) = epsilon.sin_cos();
    let (sbt, cbt) = (beta + theta).sin_cos();
    let (spd, cpd) = (phi + delta).sin_cos();
    let (soe, coe) = (omega + epsilon).sin_cos();

    // The mass matrix: the entries that are not zero.
    let m11 = M[0] * RA * RA + M[1] * (RR * RR - 2.0 * DA * RR * ct + DA * DA) + I[0] + I[1];
    let m21 = M[1] * (DA * DA - DA * RR * ct) + I[1];
    let m22 = M[1] * DA * DA + I[1];
    let m33 = M[2] * (SA * SA + SB * SB) + I[2];
    let m44 = M[3] * (E - EA) * (E - EA) + I[3];
    let m54 = M[3] * ((E - EA) * (E - EA) + ZT * (E - EA) * sp) + I[3];
    let m55 = M[3] * (ZT * ZT + 2.0 * ZT * (E - EA) * sp + (E - EA) * (E - EA))
        + M[4] * (TA * TA + TB * TB)
        + I[3]
        + I[4];
    let m66 = M[5] * (ZF - FA) * (ZF - FA) + I[5];
    let m76 = M[5] * ((ZF - FA) * (ZF - FA) - U * (ZF - FA) * so) + I[5];
    let m77 = M[5] * ((ZF - FA) * (ZF - FA) - 2.0 * U * (ZF - FA) * so + U * U)
        + M[6] * (UA * UA + UB * UB)
        + I[5]
        + I[6];

    let xd = SD * cg + SC * sg + XB;
    let yd = SD * sg - SC * cg + YB;
    let distance = ((xd - XC) * (xd - XC) + (yd - YC) * (yd - YC)).sqrt();
    let force = -SPRING * (distance - LENGTH) / distance;
    let (fx, fy) = (force * (xd - XC), force * (yd - YC));
    let f = [
        TORQUE - M[1] * DA * RR * vt * (vt + 2.0 * vb) * st,
        M[1] * DA * RR * vb * vb * st,
        fx * (SC * cg - SD * sg) + fy * (SD * cg + SC * sg),
        M[3] * ZT * (E - EA) * vd * vd * cp,
        -M[3] * ZT * (E - EA) * vp * (vp + 2.0 * vd) * cp,
        -M[5] * U * (ZF - FA) * ve * ve * co,
        M[5] * U * (ZF - FA) * vo * (vo + 2.0 * ve) * co,
    ];

    // The constraints are three times the point of the crank minus that of another chain: their
    // Jacobian, and their second derivatives along the motion.
    let (crank_x, crank_y) = (-RR * sb + D * sbt, RR * cb - D * cbt);
    let (vbt, vpd, voe) = (vb + vt, vp + vd, vo + ve);
    let curve_x = -RR * cb * vb * vb + D * cbt * vbt * vbt;
    let curve_y = -RR * sb * vb * vb + D * sbt * vbt * vbt;
    let (lx, ly) = (lambda[0] + lambda[2] + lambda[4], lambda[1] + lambda[3] + lambda[5]);
    let moved_x = crank_x * ab + D * sbt * at + curve_x;
    let moved_y = crank_y * ab - D * cbt * at + curve_y;

    [
        xdot[0] - vb,
        xdot[1] - vt,
        xdot[2] - vg,
        xdot[3] - vp,
        xdot[4] - vd,
        xdot[5] - vo,
        xdot[6] - ve,
        xdot[7] - ab,
        xdot[8] - at,
        xdot[9] - ag,
        xdot[10] - ap,
        xdot[11] - ad,
        xdot[12] - ao,
        xdot[13] - ae,
        m11 * ab + m21 * at - f[0] + crank_x * lx + crank_y * ly,
        m21 * ab + m22 * at - f[1] + D * sbt * lx - D * cbt * ly,
        m33 * ag - f[2] - SS * cg * lambda[0] - SS * sg * lambda[1],
        m44 * ap + m54 * ad - f[3] - E * cpd * lambda[2] - E * spd * lambda[3],
        m54 * ap + m55 * ad - f[4] + (ZT * sd - E * cpd) * lambda[2] - (E * spd + ZT * cd) * lambda[3],
        m66 * ao + m76 * ae - f[5] + ZF * soe * lambda[4] - ZF * coe * lambda[5],
        m76 * ao + m77 * ae - f[6] + (ZF * soe - U * ce) * lambda[4] - (ZF * coe + U * se) * lambda[5],
        moved_x - SS * cg * ag + SS * sg * vg * vg,
        moved_y - SS * sg * ag - SS * cg * vg * vg,
        moved_x - E * cpd * (ap + ad) + E * spd * vpd * vpd + ZT * sd * ad + ZT * cd * vd * vd,
        moved_y - E * spd * (ap + ad) - E * cpd * vpd * vpd - ZT * cd * ad + ZT * sd * vd * vd,
        moved_x + ZF * soe * (ao + ae) + ZF * coe * voe * voe - U * ce * ae + U * se * ve * ve,
        moved_y - ZF * coe * (ao + ae) + ZF * soe * voe * voe - U * se * ae - U * ce * ve * ve,
    ]
}
