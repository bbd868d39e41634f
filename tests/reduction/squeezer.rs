//! Andrews' squeezing mechanism from its constraints, of index 3, against the reference of the test
//! set.

use bytemuck::Zeroable;
use casados::__private::function::ArrayV;
use casados::prelude::*;
use casados::{Consistent, Constrained};
use nalgebra::SVector;
use reference_data::Record;

/// Seven bodies in a plane: x = [angles β Θ γ Φ δ Ω ε, their rates], z = [six multipliers].
///
/// E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section VII.7.
#[dae(index_reduction)]
pub fn squeezer(xdot: [f64; 14], x: [f64; 14], z: [f64; 6]) -> [f64; 20] {
    const M: [f64; 7] = [0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498];
    const I: [f64; 7] = [2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5];
    const XA: f64 = -0.06934;
    const YA: f64 = -0.00227;
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
    let [.., ab, at, ag, ap, ad, ao, ae] = xdot;
    let lambda = z;
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

    // The point of the crank, where three other chains end; its derivatives by both angles.
    let (crank_x, crank_y) = (RR * cb - D * cbt, RR * sb - D * sbt);
    let (turned_x, turned_y) = (-crank_y, crank_x);
    let (lx, ly) = (lambda[0] + lambda[2] + lambda[4], lambda[1] + lambda[3] + lambda[5]);

    [
        xdot[0] - vb,
        xdot[1] - vt,
        xdot[2] - vg,
        xdot[3] - vp,
        xdot[4] - vd,
        xdot[5] - vo,
        xdot[6] - ve,
        m11 * ab + m21 * at - f[0] + turned_x * lx + turned_y * ly,
        m21 * ab + m22 * at - f[1] + D * sbt * lx - D * cbt * ly,
        m33 * ag - f[2] - SS * cg * lambda[0] - SS * sg * lambda[1],
        m44 * ap + m54 * ad - f[3] - E * cpd * lambda[2] - E * spd * lambda[3],
        m54 * ap + m55 * ad - f[4] + (ZT * sd - E * cpd) * lambda[2] - (E * spd + ZT * cd) * lambda[3],
        m66 * ao + m76 * ae - f[5] + ZF * soe * lambda[4] - ZF * coe * lambda[5],
        m76 * ao + m77 * ae - f[6] + (ZF * soe - U * ce) * lambda[4] - (ZF * coe + U * se) * lambda[5],
        crank_x - SS * sg - XB,
        crank_y + SS * cg - YB,
        crank_x - E * spd - ZT * cd - XA,
        crank_y + E * cpd - ZT * sd - YA,
        crank_x - ZF * coe - U * se - XA,
        crank_y - ZF * soe + U * ce - YA,
    ]
}

/// The reference is of quadruple precision; the angles at the start are given to sixteen digits.
#[test]
fn reference_angles_and_rates() {
    let record = Record::load("ivp/ends.json").unwrap().record("squeezer").unwrap();
    let x0: SVector<f64, 14> = record.vector("x0").unwrap();
    let expected = record.records("ends").unwrap()[0].list("y").unwrap();
    let reduction = Squeezer::STRUCTURE.reduction.unwrap();
    assert_eq!(reduction.differentiated, [(14, 2), (15, 2), (16, 2), (17, 2), (18, 2), (19, 2)]);
    // The loops are closed to the rounding of lengths of centimetres, at the start and by a state
    // that is off by thousandths.
    let invariants = |x: &SVector<f64, 14>| {
        let mut v = ArrayV::<<Squeezer as Constrained>::Invariants, f64>::zeroed();
        v[14..28].copy_from_slice(x.as_slice());
        let mut y = [f64::NAN; 12];
        <Squeezer as Constrained>::Invariants::value::<f64>(&v, &mut y);
        y.iter().fold(0.0, |most: f64, y| most.max(y.abs()))
    };
    assert!(invariants(&x0) < 1e-16, "{}", invariants(&x0));
    let off = x0.map(|x| x + 1e-3);
    let found =
        Consistent::<Squeezer>::new().hold("x[0]").unwrap().solve(&off, &SVector::zeros(), 0.0).unwrap();
    assert!(invariants(&off) > 1e-6 && invariants(&found) < 1e-16, "{}", invariants(&found));

    let options = AdaptiveOptions { rtol: 1e-9, atol: 1e-9, ..Default::default() };
    let mut radau = Adaptive::<Squeezer, Radau>::new(options).unwrap();
    let end = radau.solve(&x0, &SVector::zeros(), 0.03).unwrap();
    for (state, expected) in end.x.iter().zip(&expected) {
        // A thousand tolerances, as for the form that was differentiated by hand.
        assert!((state - expected).abs() < 1e-6 * expected.abs().max(1.0), "{state} {expected}");
    }
    for (force, expected) in end.z.iter().zip(&expected[21..]) {
        assert!((force - expected).abs() < 1e-6 * expected.abs().max(1.0), "{force} {expected}");
    }
}
