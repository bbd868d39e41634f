//! The slider crank of the Test Set for IVP Solvers (B. Simeon), from its constraints of position:
//! a crank that turns at a given speed, an elastic connecting rod with two modes of bending and two
//! nodes along it, and a sliding block.

#![allow(clippy::module_inception)] // The model's module is named as it is.

use casados::prelude::*;
use casados::{Consistent, Constrained, Function};
use nalgebra::SVector;

/// Positions `(φ₁, φ₂, x₃, q)`, their rates, and the forces of the constraints.
#[dae(index_reduction)]
mod slider_crank {
    const CRANK: f64 = 0.15; // m
    const ROD: f64 = 0.30; // m
    const ROD_MASS: f64 = 0.151104; // kg
    const BLOCK_MASS: f64 = 0.075552; // kg
    const CRANK_INERTIA: f64 = 0.002727; // kg m²
    const ROD_INERTIA: f64 = 0.0045339259; // kg m²
    const DENSITY: f64 = 7870.0; // kg/m³
    const SIDE: f64 = 0.008; // of the cross-section of the rod, m
    const ELASTICITY: f64 = 0.2e12; // N/m²
    const SPEED: f64 = 150.0; // rad/s

    /// As the test set has it.
    #[allow(clippy::approx_constant)]
    const PI: f64 = 3.1415927;

    const VOLUME: f64 = SIDE * SIDE * ROD;
    const MASS: f64 = DENSITY * VOLUME;
    const STIFFNESS: f64 = ELASTICITY * SIDE * SIDE / ROD;
    const SLENDERNESS: f64 = SIDE / ROD;

    /// The finite elements of the rod.
    const M: [[f64; 4]; 4] = [
        [0.5 * MASS, 0.0, 0.0, 0.0],
        [0.0, 0.5 * MASS, 0.0, 0.0],
        [0.0, 0.0, 8.0 * MASS, MASS],
        [0.0, 0.0, MASS, 2.0 * MASS],
    ];
    const BENDING: f64 = STIFFNESS * PI * PI * PI * PI / 24.0 * SLENDERNESS * SLENDERNESS;
    const K: [[f64; 4]; 4] = [
        [BENDING, 0.0, 0.0, 0.0],
        [0.0, 16.0 * BENDING, 0.0, 0.0],
        [0.0, 0.0, 16.0 / 3.0 * STIFFNESS, -8.0 / 3.0 * STIFFNESS],
        [0.0, 0.0, -8.0 / 3.0 * STIFFNESS, 7.0 / 3.0 * STIFFNESS],
    ];
    const B13: f64 = -VOLUME * 16.0 / (PI * PI * PI);
    const B14: f64 = VOLUME * (8.0 / (PI * PI * PI) - 1.0 / PI);
    const B24: f64 = VOLUME * 0.5 / PI;
    const B: [[f64; 4]; 4] =
        [[0.0, 0.0, B13, B14], [0.0, 0.0, 0.0, B24], [-B13, 0.0, 0.0, 0.0], [-B14, -B24, 0.0, 0.0]];
    const C1: [f64; 4] = [0.0, 0.0, VOLUME * 2.0 / 3.0, VOLUME / 6.0];
    const C2: [f64; 4] = [VOLUME * 2.0 / PI, 0.0, 0.0, 0.0];
    const C12: [f64; 4] = [0.0, 0.0, ROD * VOLUME / 3.0, ROD * VOLUME / 6.0];
    const C21: [f64; 4] = [ROD * VOLUME / PI, -ROD * VOLUME * 0.5 / PI, 0.0, 0.0];

    fn dot(a: [f64; 4], b: [f64; 4]) -> f64 {
        a.iter().zip(&b).map(|(a, b)| a * b).sum()
    }

    fn times(a: [[f64; 4]; 4], b: [f64; 4]) -> [f64; 4] {
        a.map(|row| dot(row, b))
    }

    pub fn slider_crank(xdot: [f64; 14], x: [f64; 14], z: [f64; 3], t: f64) -> [f64; 17] {
        let [phi1, phi2, block, q @ ..] = [x[0], x[1], x[2], x[3], x[4], x[5], x[6]];
        let [v1, v2, _, w @ ..] = [x[7], x[8], x[9], x[10], x[11], x[12], x[13]];
        let [a1, a2, a3, a @ ..] = [xdot[7], xdot[8], xdot[9], xdot[10], xdot[11], xdot[12], xdot[13]];
        let (s, c) = (phi1 - phi2).sin_cos();
        let (s1, c1) = phi1.sin_cos();
        let (s2, c2) = phi2.sin_cos();
        let length = ROD + q[3];
        let (along, across) = (dot(C1, q), dot(C2, q));
        let mq = times(M, q);
        let bw = times(B, w);
        let coupled = 0.5 * CRANK * ROD * ROD_MASS * c + DENSITY * CRANK * (s * across + c * along);
        let of_crank: [f64; 4] = core::array::from_fn(|i| DENSITY * CRANK * (-s * C1[i] + c * C2[i]));
        let of_rod: [f64; 4] =
            core::array::from_fn(|i| DENSITY * (C21[i] + dot(q, [B[0][i], B[1][i], B[2][i], B[3][i]])));
        let inertia = ROD_INERTIA + dot(q, mq) + 2.0 * DENSITY * dot(C12, q);

        let on_crank = -0.5 * CRANK * ROD * ROD_MASS * v2 * v2 * s
            + DENSITY * CRANK * v2 * v2 * (-s * along + c * across)
            - 2.0 * DENSITY * CRANK * v2 * (c * dot(C1, w) + s * dot(C2, w));
        let on_rod = 0.5 * CRANK * ROD * ROD_MASS * v1 * v1 * s
            + DENSITY * CRANK * v1 * v1 * (s * along - c * across)
            - 2.0 * DENSITY * v2 * dot(C12, w)
            - 2.0 * v2 * dot(w, mq)
            - DENSITY * dot(w, bw);
        let kq = times(K, q);
        let ma = times(M, a);
        let bent: [f64; 4] = core::array::from_fn(|i| {
            let force = v2 * v2 * mq[i]
                + DENSITY * (v2 * v2 * C12[i] + CRANK * v1 * v1 * (c * C1[i] + s * C2[i]) + 2.0 * v2 * bw[i])
                - kq[i];
            of_crank[i] * a1 + of_rod[i] * a2 + ma[i] - force
        });
        [
            xdot[0] - x[7],
            xdot[1] - x[8],
            xdot[2] - x[9],
            xdot[3] - x[10],
            xdot[4] - x[11],
            xdot[5] - x[12],
            xdot[6] - x[13],
            (CRANK_INERTIA + ROD_MASS * CRANK * CRANK) * a1 + coupled * a2 + dot(of_crank, a) - on_crank
                + CRANK * c1 * z[0]
                + CRANK * s1 * z[1]
                + z[2],
            coupled * a1 + inertia * a2 + dot(of_rod, a) - on_rod + length * c2 * z[0] + length * s2 * z[1],
            BLOCK_MASS * a3 + z[1],
            bent[0],
            bent[1],
            bent[2],
            bent[3] + s2 * z[0] - c2 * z[1],
            CRANK * s1 + length * s2,
            block - CRANK * c1 - length * c2,
            phi1 - SPEED * t,
        ]
    }
}

/// Near the smooth motion: the modes of the rod as the test set has them.
const SMOOTH_START: [f64; 14] = [
    0.0,
    0.0,
    0.450016933,
    0.0,
    0.0,
    0.103339863e-4,
    0.169327969e-4,
    150.0,
    -74.995767,
    -0.268938672e-5,
    0.444896105,
    0.463434311e-2,
    -0.178591076e-5,
    -0.268938672e-5,
];

/// At `t = 0.1`: with the modes of the rod as the only coordinates, by Dormand and Prince of order
/// eight with a tolerance of 3e-14, which is within 4e-12 in the rates of that with 1e-13.
const END: [f64; 14] = [
    15.0,
    -0.3311734988256447,
    0.16973733263995847,
    0.00018931928430201294,
    2.3757513204876805e-05,
    -5.323896778155902e-06,
    -8.363313291740267e-06,
    150.0,
    60.25346755129468,
    -8.753116326728396,
    -0.030055411709262715,
    -0.0055004306460663625,
    0.0004974111669612207,
    0.0011055599704169515,
];
const FORCES: [f64; 3] = [-62.32935927945395, -163.79209934712657, 25.29857948799753];

#[test]
fn modal_coordinates_of_the_rod() {
    // The data of the test set satisfy the constraints to nine digits; what follows from the rod
    // and the crank is found.
    let mut consistent = Consistent::<SliderCrank>::new();
    for held in ["x[0]", "x[3]", "x[4]", "x[5]", "x[6]", "x[7]", "x[10]", "x[11]", "x[12]", "x[13]"] {
        consistent = consistent.hold(held).unwrap();
    }
    let start = consistent.solve(&SVector::from(SMOOTH_START), &Default::default(), 0.0).unwrap();
    assert!((start - SVector::from(SMOOTH_START)).amax() < 1e-7, "{start}");
    assert_eq!(start[6], SMOOTH_START[6]);

    // The slowest oscillation of the rod along itself is 7000 rad/s: thirty steps a period.
    let mut irk = Irk::<SliderCrank, Gauss<4>>::new(Options { steps: 3000, ..Default::default() }).unwrap();
    let end = irk.solve(&start, &Default::default(), 0.1).unwrap();
    // Displacements are of size 1e-4, those along the rod of 1e-5; their rates follow.
    let off = end.x - SVector::from(END);
    assert!(off.rows(0, 3).amax() < 1e-11, "{off}");
    assert!(off.rows(3, 4).amax() < 1e-12, "{off}");
    assert!(off.rows(7, 3).amax() < 1e-8, "{off}");
    assert!(off.rows(10, 4).amax() < 1e-8, "{off}");
    assert!((end.z - SVector::from(FORCES)).amax() < 1e-4, "{}", end.z);

    // The published end, of data that are off by 2e-10 at the start and of the tolerance of then.
    let published = [-3.311734987910881e-1, 1.69737332671841e-1, 1.893192460247178e-4];
    for (found, published) in end.x.as_slice()[1..].iter().zip(published) {
        assert!((found - published).abs() < 1e-9, "{found} {published}");
    }
}

#[test]
fn differentiated_constraints() {
    let reduction = SliderCrank::STRUCTURE.reduction.unwrap();
    assert_eq!(reduction.differentiated, [(14, 2), (15, 2), (16, 2)]);
    assert_eq!(reduction.singular[0], 0);
    // The rate of the crank is an invariant: d(φ₁ − ω t)/dt = 0.
    let mut v = [0.0; 14 + 14 + 3 + 1];
    v[14 + 7] = 150.0;
    let mut y = [f64::NAN; 6];
    <SliderCrank as Constrained>::Invariants::value::<f64>(&v, &mut y);
    assert_eq!(y[4..], [0.0, 0.0]);
}
