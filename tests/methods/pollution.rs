//! Pollution of the air: 25 reactions of 20 species (J. Verwer, Gauss-Seidel iteration for stiff
//! ODEs from chemical kinetics, SIAM J. Sci. Comput. 15 (1994)), as in the Test Set for IVP Solvers
//! of the University of Bari.

use casados::ode;

#[ode]
pub fn pollution(x: [f64; 20]) -> [f64; 20] {
    let [y1, y2, y3, y4, y5, y6, y7, _, y9, y10, y11, _, y13, y14, _, y16, y17, _, y19, y20] = x;
    let r1 = 0.35 * y1;
    let r2 = 26.6 * y2 * y4;
    let r3 = 1.23e4 * y5 * y2;
    let r4 = 8.6e-4 * y7;
    let r5 = 8.2e-4 * y7;
    let r6 = 1.5e4 * y7 * y6;
    let r7 = 1.3e-4 * y9;
    let r8 = 2.4e4 * y9 * y6;
    let r9 = 1.65e4 * y11 * y2;
    let r10 = 9e3 * y11 * y1;
    let r11 = 0.022 * y13;
    let r12 = 1.2e4 * y10 * y2;
    let r13 = 1.88 * y14;
    let r14 = 1.63e4 * y1 * y6;
    let r15 = 4.8e6 * y3;
    let r16 = 3.5e-4 * y4;
    let r17 = 0.0175 * y4;
    let r18 = 1e8 * y16;
    let r19 = 4.44e11 * y16;
    let r20 = 1.24e3 * y17 * y6;
    let r21 = 2.1 * y19;
    let r22 = 5.78 * y19;
    let r23 = 0.0474 * y1 * y4;
    let r24 = 1.78e3 * y19 * y1;
    let r25 = 3.12 * y20;
    [
        -r1 - r10 - r14 - r23 - r24 + r2 + r3 + r9 + r11 + r12 + r22 + r25,
        -r2 - r3 - r9 - r12 + r1 + r21,
        -r15 + r1 + r17 + r19 + r22,
        -r2 - r16 - r17 - r23 + r15,
        -r3 + r4 + r4 + r6 + r7 + r13 + r20,
        -r6 - r8 - r14 - r20 + r3 + r18 + r18,
        -r4 - r5 - r6 + r13,
        r4 + r5 + r6 + r7,
        -r7 - r8,
        -r12 + r7 + r9,
        -r9 - r10 + r8 + r11,
        r9,
        -r11 + r10,
        -r13 + r12,
        r14,
        -r18 - r19 + r16,
        -r20,
        r20,
        -r21 - r22 - r24 + r23 + r25,
        -r25 + r24,
    ]
}

pub const START: [f64; 20] = {
    let mut x = [0.0; 20];
    (x[1], x[3], x[6], x[7], x[8], x[16]) = (0.2, 0.04, 0.1, 0.3, 0.01, 0.007);
    x
};

/// At t = 60, as published there.
pub const END_VALUES: [f64; 20] = [
    0.5646255480022769e-1,
    0.1342484130422339,
    0.4139734331099427e-8,
    0.5523140207484359e-2,
    0.2018977262302196e-6,
    0.1464541863493966e-6,
    0.7784249118997964e-1,
    0.3245075353396018,
    0.7494013383880406e-2,
    0.1622293157301561e-7,
    0.1135863833257075e-7,
    0.2230505975721359e-2,
    0.208716288279863e-3,
    0.1396921016840158e-4,
    0.8964884856898295e-2,
    0.4352846369330103e-17,
    0.6899219696263405e-2,
    0.1007803037365946e-3,
    0.1772146513969984e-5,
    0.5682943292316392e-4,
];
