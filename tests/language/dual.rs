//! Models over dual numbers: their derivatives against the graphs of the same models, and their
//! passes.

use casados::__private::Array;
use casados::__private::Tangent;
use casados::dual::DualModel;
use casados::{
    __private::{ArrayK, ArrayV},
    model::Pattern,
};
use casados::{Dae, Ode, Shape, dae, ode};
use num_dual::DualNum;

/// The pendulum on a cart (M = 1, m = 0.1, l = 0.8, g = 9.81).
#[dae]
fn pendulum<T: DualNum<Primitive = f64> + Copy>(xdot: [T; 4], x: [T; 4], u: [T; 1]) -> [T; 4] {
    let [_, theta, v, omega] = x;
    let (s, c) = theta.sin_cos();
    let denominator = -c * c * 0.1 + 1.1;
    let force = -s * omega * omega * 0.08 + c * s * 0.981 + u[0];
    let torque = -c * s * omega * omega * 0.08 + u[0] * c + s * 10.791;
    [xdot[0] - v, xdot[1] - omega, xdot[2] - force / denominator, xdot[3] - torque / (denominator * 0.8)]
}

/// Stiffness of a spring by deflection, linear between whole numbers.
const STIFFNESS: [f64; 4] = [1.0, 2.5, 2.0, 4.0];

/// A mass on a spring whose stiffness is a table, with a stop at 2.5 and a damper that depends on
/// time.
#[ode]
fn spring<T: DualNum<Primitive = f64> + Copy>(t: T, p: [T; 2], x: [T; 2], u: T) -> [T; 2] {
    let [position, velocity] = x;
    let at = position.abs();
    let interval = (at.re() as usize).min(STIFFNESS.len() - 2);
    let weight = at - interval as f64;
    let stiffness = weight * (STIFFNESS[interval + 1] - STIFFNESS[interval]) + STIFFNESS[interval];
    let mut force = u - stiffness * position * p[0] - velocity * p[1] * t.cos();
    if position > T::from(2.5) {
        let depth = position - 2.5;
        force -= depth * depth * 100.0;
    }
    [velocity, force]
}

/// States that are driven by their neighbours: sparse. The lengths come from the attribute and from
/// the module.
#[dae(N = [12])]
mod chain {
    use nalgebra::SVector;
    use num_dual::DualNum;

    const CONTROLS: usize = 5 / 4;

    fn link<T: DualNum<Primitive = f64> + Copy>(a: T, b: T) -> T {
        (a - b) * (a - b) + a.sin()
    }

    pub fn model<T: DualNum<Primitive = f64> + Copy, const N: usize>(
        xdot: &[T; N],
        x: SVector<T, N>,
        u: [T; CONTROLS],
    ) -> [T; N] {
        core::array::from_fn(|i| {
            let left = if i == 0 { u[0] } else { x[i - 1] };
            xdot[i] - link(x[i], left)
        })
    }
}

/// Compares all derivatives of a dual model and of the graph of the same model. What is not in the
/// pattern of the graph must be exactly zero in the dense one.
///
/// Both round in at most fifty operations on the way to an entry, on intermediate results of the
/// size of the largest entry (all variables and constants are of order one to ten): they differ by
/// 100 ε times that at most.
fn compare<M: DualModel, G: Dae<Shape = M::Shape>>(points: &[Vec<f64>]) {
    for point in points {
        let v = ArrayV::<M, f64>::from_fn(|i| point[i]);
        let mu = ArrayK::<M, f64>::from_fn(|i| 1.0 - 0.3 * i as f64);
        let zero = |_| 0.0;
        let (mut f, mut g) = (ArrayK::<M, f64>::from_fn(zero), ArrayK::<M, f64>::from_fn(zero));
        let mut jacobian = M::Jacobian::<f64>::from_fn(|_| f64::NAN);
        let mut sparse = G::Jacobian::<f64>::from_fn(|_| f64::NAN);
        M::jacobian_constants::<f64>(&mut jacobian);
        G::jacobian_constants::<f64>(&mut sparse);
        M::residual_jacobian::<f64>(&v, &mut f, &mut jacobian);
        G::residual_jacobian::<f64>(&v, &mut g, &mut sparse);
        assert_close("residual", f.as_ref(), g.as_ref());
        assert_close(
            "Jacobian",
            &dense(&M::STRUCTURE.jacobian, jacobian.as_ref(), M::Shape::NV),
            &dense(&G::STRUCTURE.jacobian, sparse.as_ref(), M::Shape::NV),
        );

        // In one direction, term by term: also the product with the Jacobian, whose terms are as
        // large.
        let direction = |i: usize| if i + 1 < M::Shape::NV { 0.7 - 0.2 * (i % 5) as f64 } else { 0.0 };
        let along = ArrayV::<M, Tangent<f64>>::from_fn(|i| Tangent { value: v[i], derivative: direction(i) });
        let nothing = |_| Tangent { value: f64::NAN, derivative: f64::NAN };
        let mut of_dual = ArrayK::<M, Tangent<f64>>::from_fn(nothing);
        let mut of_graph = of_dual;
        M::tangent::<f64>(&along, &mut of_dual);
        G::tangent::<f64>(&along, &mut of_graph);
        let parts = |f: &ArrayK<M, Tangent<f64>>| -> (Vec<f64>, Vec<f64>) {
            f.as_ref().iter().map(|f| (f.value, f.derivative)).unzip()
        };
        assert_eq!(parts(&of_graph).0, g.as_ref());
        assert_close("values of duals", &parts(&of_dual).0, f.as_ref());
        let mut product = vec![0.0; M::Shape::NK];
        for (entry, value) in sparse.as_ref().iter().enumerate() {
            let (row, column) = G::STRUCTURE.jacobian.at(entry);
            product[row] += value * direction(column);
        }
        assert_close("tangent of duals", &parts(&of_dual).1, &product);
        assert_close("tangent of the graph", &parts(&of_graph).1, &product);

        let (mut a, mut b) = (ArrayV::<M, f64>::from_fn(zero), ArrayV::<M, f64>::from_fn(zero));
        M::adjoint::<f64>(&v, &mu, &mut a);
        G::adjoint::<f64>(&v, &mu, &mut b);
        assert_close("adjoint", a.as_ref(), b.as_ref());

        let mut hessian = M::Hessian::<f64>::from_fn(|_| f64::NAN);
        let mut sparse = G::Hessian::<f64>::from_fn(|_| f64::NAN);
        M::hessian::<f64>(&v, &mu, &mut hessian);
        G::hessian::<f64>(&v, &mu, &mut sparse);
        assert_close(
            "Hessian",
            &dense(&M::STRUCTURE.hessian, hessian.as_ref(), M::Shape::NV),
            &dense(&G::STRUCTURE.hessian, sparse.as_ref(), M::Shape::NV),
        );
    }
}

fn dense(pattern: &Pattern, values: &[f64], columns: usize) -> Vec<f64> {
    let mut matrix = vec![0.0; columns * columns];
    for (entry, value) in values.iter().enumerate() {
        let (row, column) = pattern.at(entry);
        matrix[row * columns + column] = *value;
    }
    matrix
}

fn assert_close(what: &str, a: &[f64], b: &[f64]) {
    assert_eq!(a.len(), b.len());
    let scale = b.iter().fold(1.0, |scale: f64, value| scale.max(value.abs()));
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        let tolerance = if *b == 0.0 { 0.0 } else { 100.0 * f64::EPSILON * scale };
        assert!((a - b).abs() <= tolerance, "{what}, element {i}: {a:e} and {b:e}");
    }
}

/// Points with coordinates between -2 and 2: multiples of the golden ratio, which no structure
/// repeats.
fn points(length: usize, count: usize) -> Vec<Vec<f64>> {
    let golden = |k: usize| (k as f64 * 0.618_033_988_749_894_9).fract() * 4.0 - 2.0;
    (0..count).map(|point| (0..length).map(|i| golden(point * length + i + 1)).collect()).collect()
}

#[test]
fn derivatives_of_dual_models() {
    compare::<Pendulum, graph::Pendulum>(&points(10, 20));
    compare::<Chain<12>, graph::Chain<12>>(&points(26, 20));
    // On both sides of every branch.
    let mut points = points(8, 20);
    for (point, position) in
        points.iter_mut().zip([-2.7, -1.5, -0.5, 0.3, 1.2, 2.3, 2.6, 3.5].into_iter().cycle())
    {
        point[2] = position;
    }
    compare::<Spring, graph::Spring>(&points);
}

/// The values are those of the function, bit by bit.
#[test]
fn values_of_dual_models() {
    let v = [0.3, 0.1, -0.2, 0.5, 0.0, 0.4, 1.0, -1.5, 2.0, 0.0];
    let mut f = [0.0; 4];
    let expected = pendulum([0.3, 0.1, -0.2, 0.5], [0.0, 0.4, 1.0, -1.5], [2.0]);
    Pendulum::residual::<f64>(&v, &mut f);
    assert_eq!(f, expected);
    f = [0.0; 4];
    Pendulum::residual_jacobian::<f64>(&v, &mut f, &mut [0.0; 36]);
    assert_eq!(f, expected);

    let v = [0.3, 0.1, 2.7, 0.5, -1.0, 1.5, 0.8, 0.2];
    let [velocity, force] = spring(0.2, [1.5, 0.8], [2.7, 0.5], -1.0);
    let mut f = [0.0; 2];
    Spring::residual::<f64>(&v, &mut f);
    assert_eq!(f, [0.3 - velocity, 0.1 - force]);
}

/// No equation of the chain depends on two derivatives, nor on two states of the same parity: with
/// the control, which is no state of the second equation, three evaluations instead of 25. Three
/// pairs of them have second derivatives.
#[test]
fn colouring_of_sparse_models() {
    Chain::<12>::residual_jacobian::<f64>(&[0.3; 26], &mut [0.0; 12], &mut [0.0; 300]);
    let passes = Chain::<12>::passes().get().unwrap();
    assert_eq!((passes.len(), passes.pairs().len()), (3, 3));
}

/// A model that looks at its state may depend on anything elsewhere.
#[test]
fn colouring_of_models_with_branches() {
    Spring::residual_jacobian::<f64>(&[0.3; 8], &mut [0.0; 2], &mut [0.0; 14]);
    let passes = Spring::passes().get().unwrap();
    assert_eq!((passes.len(), passes.pairs().len()), (7, 28));
}

/// Each constant is evaluated once.
#[ode]
mod doubled {
    use num_dual::DualNum;

    const C0: usize = 1;
    const C1: usize = C0 * C0;
    const C2: usize = C1 * C1;
    const C3: usize = C2 * C2;
    const C4: usize = C3 * C3;
    const C5: usize = C4 * C4;
    const C6: usize = C5 * C5;
    const C7: usize = C6 * C6;
    const C8: usize = C7 * C7;
    const C9: usize = C8 * C8;
    const C10: usize = C9 * C9;
    const C11: usize = C10 * C10;
    const C12: usize = C11 * C11;
    const C13: usize = C12 * C12;
    const C14: usize = C13 * C13;
    const C15: usize = C14 * C14;
    const C16: usize = C15 * C15;
    const C17: usize = C16 * C16;
    const C18: usize = C17 * C17;
    const C19: usize = C18 * C18;
    const C20: usize = C19 * C19;
    const C21: usize = C20 * C20;
    const C22: usize = C21 * C21;
    const C23: usize = C22 * C22;
    const C24: usize = C23 * C23;
    const C25: usize = C24 * C24;
    const C26: usize = C25 * C25;
    const C27: usize = C26 * C26;
    const C28: usize = C27 * C27;
    const C29: usize = C28 * C28;
    const C30: usize = C29 * C29;

    pub fn doubled<T: DualNum<Primitive = f64> + Copy>(x: [T; C30]) -> [T; C30] {
        x.map(|x| -x)
    }
}

#[test]
fn explicit_dual_models() {
    assert_eq!(Doubled::STRUCTURE.x.len(), doubled::doubled([1.0]).len());
    assert_eq!(Spring::ROWS, [(0, 1.0), (1, 1.0)]);
    assert_eq!(Spring::STRUCTURE.u, ["u"]);
    assert_eq!(Spring::STRUCTURE.p, ["p[0]", "p[1]"]);
}

/// The same models as graphs.
mod graph {
    use super::STIFFNESS;
    use casados::{dae, ode};

    #[dae]
    pub fn pendulum(xdot: [f64; 4], x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
        let [_, theta, v, omega] = x;
        let (s, c) = theta.sin_cos();
        let denominator = -c * c * 0.1 + 1.1;
        let force = -s * omega * omega * 0.08 + c * s * 0.981 + u[0];
        let torque = -c * s * omega * omega * 0.08 + u[0] * c + s * 10.791;
        [xdot[0] - v, xdot[1] - omega, xdot[2] - force / denominator, xdot[3] - torque / (denominator * 0.8)]
    }

    #[ode]
    pub fn spring(t: f64, p: [f64; 2], x: [f64; 2], u: f64) -> [f64; 2] {
        let [position, velocity] = x;
        let at = position.abs();
        let mut stiffness = 0.0;
        for interval in 0..3 {
            let weight = at - interval as f64;
            let (first, last) = (STIFFNESS[interval], STIFFNESS[interval + 1]);
            if at >= interval as f64 {
                stiffness = weight * (last - first) + first;
            }
        }
        let mut force = u - stiffness * position * p[0] - velocity * p[1] * t.cos();
        if position > 2.5 {
            let depth = position - 2.5;
            force -= depth * depth * 100.0;
        }
        [velocity, force]
    }

    #[dae(N = [12])]
    pub fn chain<const N: usize>(xdot: &[f64; N], x: [f64; N], u: [f64; 1]) -> [f64; N] {
        core::array::from_fn(|i| {
            let left = if i == 0 { u[0] } else { x[i - 1] };
            xdot[i] - ((x[i] - left) * (x[i] - left) + x[i].sin())
        })
    }
}
