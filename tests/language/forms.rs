//! Forms of a model: arguments in any order, references, structs, modules, const parameters.

use crate::{same_bits, subarray};
use casados::Shape;
use casados::{Dae, Ode, dae, ode};

#[dae]
fn any_order(t: f64, p: [f64; 1], z: [f64; 1], x: &[f64; 2], u: &f64, xdot: &[f64; 2]) -> [f64; 3] {
    [xdot[0] - x[1] * t, xdot[1] - p[0] * z[0], z[0] - u * x[0]]
}

#[ode(name = Decay)]
fn scalar_model(x: f64, p: f64, _t: f64) -> f64 {
    -p * x
}

/// A cart with a pendulum, in which everything has a name.
#[dae]
mod crane {
    #[derive(Clone, Copy)]
    pub struct Body {
        pub position: f64,
        pub velocity: f64,
    }

    #[derive(Clone, Copy)]
    pub struct State<const N: usize> {
        pub cart: Body,
        pub loads: [Body; N],
    }

    #[derive(Clone, Copy)]
    pub struct Control {
        pub force: f64,
    }

    const N: usize = 2;
    pub type Full = State<N>;

    impl Body {
        fn energy(&self, mass: f64) -> f64 {
            mass * self.velocity * self.velocity / 2.0
        }
    }

    fn pull(load: &Body, cart: &Body) -> f64 {
        super::STIFFNESS * (load.position - cart.position)
    }

    // Not the model, though it has such arguments: the other one is named like the module.
    pub fn energy(xdot: &Full, x: &Full) -> f64 {
        x.cart.energy(1.0) + xdot.loads.iter().map(|load| load.energy(0.5)).sum::<f64>()
    }

    pub fn crane(xdot: Full, x: Full, u: Control) -> Full {
        let total: f64 = x.loads.iter().map(|load| pull(load, &x.cart)).sum();
        Full {
            loads: core::array::from_fn(|i| Body {
                velocity: xdot.loads[i].velocity + pull(&x.loads[i], &x.cart) * energy(&xdot, &x),
                position: xdot.loads[i].position - x.loads[i].velocity,
            }),
            cart: Body {
                position: xdot.cart.position - x.cart.velocity,
                velocity: xdot.cart.velocity - total - u.force,
            },
        }
    }
}

/// What the module above takes from outside.
const STIFFNESS: f64 = 1.25;

#[ode]
mod two_candidates {
    pub fn other(x: [f64; 1]) -> [f64; 1] {
        [x[0] * 3.0]
    }
    #[model]
    pub fn right(x: [f64; 1]) -> [f64; 1] {
        [other(x)[0] * 2.0]
    }
}

#[dae(N = [1, 3])]
fn ladder<const N: usize>(xdot: [f64; N], x: [f64; N], u: [f64; 2]) -> [f64; N] {
    let mut f = xdot;
    for i in 0..N {
        f[i] -= x[(i + 1) % N] * u[i % 2];
    }
    f
}

#[ode((M, N) = [(1, 2), (2, 3)])]
fn grid<const M: usize, const N: usize>(x: [[f64; N]; M]) -> [[f64; N]; M] {
    core::array::from_fn(|i| core::array::from_fn(|j| x[i][j] * (i + j) as f64 + x[M - 1][N - 1]))
}

#[ode(K = 1..=3)]
fn range_of_sizes<const K: usize>(x: [f64; K]) -> [f64; K] {
    x.map(|a| -a)
}

#[test]
fn arguments_in_any_order() {
    // v = (ẋ, x, z, u, p, t)
    same_bits::<AnyOrder>(|v| {
        any_order(v[7], [v[6]], [v[4]], &subarray(v, 2), &v[5], &subarray(v, 0)).to_vec()
    });
    assert_eq!(AnyOrder::STRUCTURE.z, ["z[0]"]);
    assert_eq!(AnyOrder::STRUCTURE.u, ["u"]);
    assert_eq!(AnyOrder::STRUCTURE.p, ["p[0]"]);
}

#[test]
fn scalars_and_another_name() {
    same_bits::<Decay>(|v| vec![v[0] - scalar_model(v[1], v[2], v[3])]);
    assert_eq!(<Decay as Ode>::ROWS, [(0, 1.0)]);
}

#[test]
fn structs_of_a_module() {
    let body = |v: &[f64]| crane::Body { position: v[0], velocity: v[1] };
    let state = |v: &[f64]| crane::Full { cart: body(v), loads: [body(&v[2..]), body(&v[4..])] };
    same_bits::<Crane>(|v| {
        let f = crane::crane(state(v), state(&v[6..]), crane::Control { force: v[12] });
        [f.cart, f.loads[0], f.loads[1]].iter().flat_map(|body| [body.position, body.velocity]).collect()
    });
    assert_eq!(
        Crane::STRUCTURE.x,
        [
            "x.cart.position",
            "x.cart.velocity",
            "x.loads[0].position",
            "x.loads[0].velocity",
            "x.loads[1].position",
            "x.loads[1].velocity"
        ]
    );
    assert_eq!(Crane::STRUCTURE.u, ["u.force"]);
}

#[test]
fn marked_functions() {
    same_bits::<TwoCandidates>(|v| vec![v[0] - two_candidates::right([v[1]])[0]]);
}

#[test]
fn size_parameters() {
    same_bits::<Ladder<1>>(|v| ladder::<1>(subarray(v, 0), subarray(v, 1), subarray(v, 2)).to_vec());
    same_bits::<Ladder<3>>(|v| ladder::<3>(subarray(v, 0), subarray(v, 3), subarray(v, 6)).to_vec());
    same_bits::<Grid<2, 3>>(|v| {
        let g = grid([subarray::<3>(v, 6), subarray(v, 9)]);
        (0..6).map(|i| v[i] - g[i / 3][i % 3]).collect()
    });
    same_bits::<RangeOfSizes<3>>(|v| (0..3).map(|i| v[i] + v[3 + i]).collect());
    assert_eq!(<<RangeOfSizes<2> as Dae>::Shape as Shape>::NX, 2);
    assert_eq!(Grid::<2, 3>::STRUCTURE.x[4], "x[1][1]");
}
