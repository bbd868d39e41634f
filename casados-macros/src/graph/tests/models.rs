//! Typical models, for counts of operations.

use super::expression::E;
use crate::graph::{Graph, Node};
use std::cell::RefCell;

/// The chain of masses on springs, with `n_mass - 2` free masses. Variables `(ẋ, x, u)`.
pub fn chain(n_mass: usize) -> (Graph, Vec<Node>, u32) {
    let graph = RefCell::new(Graph::default());
    let masses = n_mass - 2;
    let nx = 6 * masses + 3;
    let v = E::variables(&graph, (2 * nx + 3) as u32);
    let (dx, x, u) = (&v[..nx], &v[nx..2 * nx], &v[2 * nx..]);
    let force = |i: usize| -> [E; 3] {
        let d: [E; 3] = std::array::from_fn(|k| match i {
            0 => x[k],
            _ => x[3 * i + k] - x[3 * (i - 1) + k],
        });
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let stiffness = 1.0 / 0.033 * (1.0 - 0.033 / length);
        d.map(|d| stiffness * d)
    };
    let mut f = Vec::new();
    for i in 0..3 * masses {
        f.push(dx[i] - x[3 * (masses + 1) + i]);
    }
    for k in 0..3 {
        f.push(dx[3 * masses + k] - u[k]);
    }
    for i in 0..masses {
        let (left, right) = (force(i), force(i + 1));
        for k in 0..3 {
            let gravity = if k == 2 { 9.81 } else { 0.0 };
            f.push(dx[3 * (masses + 1) + 3 * i + k] - (right[k] - left[k] - gravity));
        }
    }
    let f: Vec<Node> = f.iter().map(|f| f.1).collect();
    (graph.into_inner(), f, (2 * nx + 3) as u32)
}

type V<'g> = [E<'g>; 3];

fn dot<'g>(a: V<'g>, b: V<'g>) -> E<'g> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross<'g>(a: V<'g>, b: V<'g>) -> V<'g> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The coefficients of one aerodynamic coefficient: polynomials in the angle of attack for each
/// input (1, α, β, p, q, r, δa, δe, δr).
type Table = [&'static [f64]; 9];
const CX: Table =
    [&[-0.0293], &[0.4784, 2.5549], &[], &[], &[-0.6029, 4.4124], &[], &[], &[-0.0106, 0.1115], &[]];
const CY: Table = [
    &[],
    &[],
    &[-0.1855, -0.0299, 0.0936],
    &[-0.1022, -0.0140, 0.0496],
    &[],
    &[0.1694, 0.1368],
    &[-0.0514, -0.0024, 0.0579],
    &[],
    &[0.10325, 0.0268, -0.1036],
];
const CZ: Table = [
    &[-0.5526],
    &[-5.0676, 5.7736],
    &[],
    &[],
    &[-7.5560, 0.1251, 6.1486],
    &[],
    &[],
    &[-0.315, -0.0013, 0.2923],
    &[],
];
const CL: Table = [
    &[],
    &[],
    &[-0.0630, -0.0003, 0.0312],
    &[-0.5632, -0.0247, 0.2813],
    &[],
    &[0.1811, 0.6448],
    &[-0.2489, -0.0087, 0.2383],
    &[],
    &[0.00436, -0.0013],
];
const CM: Table = [
    &[-0.0307],
    &[-0.6027],
    &[],
    &[],
    &[-11.3022, -0.0026, 5.2885],
    &[],
    &[],
    &[-1.0427, -0.0061, 0.9974],
    &[],
];
const CN: Table = [
    &[],
    &[],
    &[0.0577, -0.0849],
    &[-0.0565, -0.9137],
    &[],
    &[-0.0553, 0.0290, 0.0257],
    &[0.01903, -0.1147],
    &[],
    &[-0.0404, -0.0117, 0.04089],
];

/// The six-degree-of-freedom aircraft on a tether of the airborne-wind-energy benchmark (Malz et
/// al. 2019). Variables `(ẋ, x, z, u)`.
#[allow(clippy::too_many_lines, clippy::many_single_char_names, clippy::similar_names)]
pub fn aircraft() -> (Graph, Vec<Node>, u32) {
    let graph = RefCell::new(Graph::default());
    let v = E::variables(&graph, 51);
    let (dx, x, z, u) = (&v[..23], &v[23..46], &v[46..47], &v[47..51]);
    let three = |a: &[E<'_>]| -> [Node; 3] { [a[0].1, a[1].1, a[2].1] };
    let vector = |a: &[E<'_>]| three(a).map(|node| E(&graph, node));
    let (q, dq, omega) = (vector(&x[0..3]), vector(&x[3..6]), vector(&x[6..9]));
    let rotation = [vector(&x[9..12]), vector(&x[12..15]), vector(&x[15..18])];
    let (delta, kappa) = (vector(&x[18..21]), x[21] * 10.0);
    let (ddq, domega) = (vector(&dx[3..6]), vector(&dx[6..9]));
    let lambda = z[0] * 12.499_305_032_751_677;

    let (mk, mt, lt, g) = (36.8, 1.997_720_199_999_999_8, 434.287, 9.81);
    fn wind_at<'g>(z: E<'g>) -> E<'g> {
        10.0 * ((z * z + 1.0).sqrt() / 100.0).powf(0.15)
    }
    fn density<'g>(z: E<'g>) -> E<'g> {
        1.225 * ((288.15 - 0.0065 * z) / 288.15).powf(9.81 / 0.0065 / 287.053 - 1.0)
    }
    let ua = [wind_at(q[2]) - dq[0], -dq[1], -dq[2]];
    let speed = dot(ua, ua).sqrt();
    let rho = density(q[2]);
    let along = dot(ua, rotation[0]);
    let along = (along * along + 1e-16).sqrt();
    let alpha = dot(ua, rotation[2]) / along;
    let beta = dot(ua, rotation[1]) / along;

    let (b, area) = (5.5, 3.0);
    let c = area / b;
    let d = [-1.0, 1.0, -1.0];
    let rates: V = std::array::from_fn(|i| d[i] * omega[i] / (2.0 * speed));
    let inputs = [
        None,
        Some(alpha),
        Some(beta),
        Some(b * rates[0]),
        Some(c * rates[1]),
        Some(b * rates[2]),
        Some(delta[0]),
        Some(delta[1]),
        Some(delta[2]),
    ];
    let coefficient = |table: &Table| {
        let mut sum = alpha.of(0.0);
        for (input, polynomial) in inputs.iter().zip(table) {
            let mut value = alpha.of(0.0);
            let mut power = alpha.of(1.0);
            for &factor in *polynomial {
                value = value + factor * power;
                power = power * alpha;
            }
            sum = sum + input.map_or(value, |input| input * value);
        }
        sum
    };
    let pressure = 0.5 * rho * speed * speed * area;
    let body = [CX, CY, CZ].map(|table| coefficient(&table));
    let body: V = std::array::from_fn(|i| d[i] * body[i] * pressure);
    let aero: V = std::array::from_fn(|i| {
        rotation[0][i] * body[0] + rotation[1][i] * body[1] + rotation[2][i] * body[2]
    });
    let arms = [b, c, b];
    let moment = [CL, CM, CN].map(|table| coefficient(&table));
    let moment: V = std::array::from_fn(|i| d[i] * arms[i] * moment[i] * pressure);

    let turbine = ua.map(|ua| kappa * speed * ua);
    let power = 0.75 * kappa * speed * speed * speed;

    let mut drag = [q[0].of(0.0); 3];
    for k in 0..5 {
        let s = (f64::from(k) + 0.5) / 5.0;
        let height = s * q[2];
        let uk = [wind_at(height) - s * dq[0], -(s * dq[1]), -(s * dq[2])];
        let n = (dot(uk, uk) + 1e-12).sqrt();
        let t = q.map(|q| q / 5.0);
        let along = dot(t, uk) / n;
        let length = (dot(t, t) - along * along + 1e-12).sqrt();
        let factor = s * 0.5 * 1.2 * density(height) * n * 0.002 * length;
        for i in 0..3 {
            drag[i] = drag[i] + factor * uk[i];
        }
    }

    let e = q.map(|q| q / lt);
    let s = dot(e, dq);
    let sd = dot(dq, dq) / lt + dot(e, ddq);
    let tether = mt / 3.0 * ((1.0 + dot(e, e)) * sd + s * s / lt);
    let (sf, sm, sc) = (5_178.208_5, 992.772, 1_102_500.0);
    let mut f = Vec::new();
    for i in 0..3 {
        let gravity = if i == 2 { mk * g } else { 0.0 };
        let force = (mk + mt / 3.0) * ddq[i] + tether * e[i] + gravity + lambda * q[i];
        f.push((force - aero[i] - turbine[i] - drag[i]) / sf);
    }
    let inertia = |w: V<'_>| -> [Node; 3] {
        [(25.0 * w[0] + 0.47 * w[2]).1, (32.0 * w[1]).1, (0.47 * w[0] + 56.0 * w[2]).1]
    };
    let inertia = |w| inertia(w).map(|node| E(&graph, node));
    let (jw, gyro) = (inertia(domega), cross(omega, inertia(omega)));
    for i in 0..3 {
        f.push((moment[i] - (jw[i] + gyro[i])) / sm);
    }
    // dR - R (kappa/2 (I - RᵀR) + skew(ω))
    let zero = q[0].of(0.0);
    let skew = [[zero, -omega[2], omega[1]], [omega[2], zero, -omega[0]], [-omega[1], omega[0], zero]];
    let mut inner = [[zero; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            let unit = if i == j { 1.0 } else { 0.0 };
            inner[i][j] = 0.5 * (unit - dot(rotation[i], rotation[j])) + skew[i][j];
        }
    }
    for j in 0..3 {
        for i in 0..3 {
            let product =
                rotation[0][i] * inner[0][j] + rotation[1][i] * inner[1][j] + rotation[2][i] * inner[2][j];
            f.push(dx[9 + 3 * j + i] - product);
        }
    }
    (0..3).for_each(|i| f.push(dx[18 + i] - u[i]));
    f.push(dx[21] - u[3]);
    (0..3).for_each(|i| f.push(dx[i] - dq[i]));
    let constraint = 0.5 * (dot(q, q) - lt * lt);
    let rate = dot(q, dq);
    let second = dot(dq, dq) + dot(q, ddq);
    f.push((second + 2.0 * 0.1 * rate + 0.1 * 0.1 * constraint) / sc);
    let mut cost = -(121.965_601_605_480_71 / 291_516.741_634_445_03 / 13.456_375_779_859_805) * power;
    let wu = [0.25, 0.25, 0.25, 0.025];
    for i in 0..4 {
        cost = cost + wu[i] * u[i] * u[i];
    }
    for (i, &rate) in dx.iter().enumerate() {
        let weight = match i {
            0..3 => 1.25e-11,
            3..6 => 1.25e-10,
            6..9 => 6.25e-3,
            9..18 => 1.25e-10,
            18..21 => 1.25e-8,
            21 => 1.25e-9,
            _ => 1.25e-10,
        };
        cost = cost + weight * rate * rate;
    }
    cost = cost + 0.2 * beta * beta;
    f.push(dx[22] - cost);
    let f: Vec<Node> = f.iter().map(|f| f.1).collect();
    (graph.into_inner(), f, 51)
}
