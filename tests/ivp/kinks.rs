//! Forces that jump or have a kink where a state or the time says so, and one that is steep: what
//! ends an iteration knows of this step, and a small estimate after refusals is doubted.
//!
//! The references are SciPy's `DOP853` with tolerances of 3e-14 from kink to kink, each located by
//! Newton's method, on the smooth equations between them.

use casados::{Adaptive, AdaptiveOptions, Gauss, Radau, ode};
use nalgebra::{SVector, vector};

const TOLERANCES: [f64; 7] = [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10];

/// The largest error at the ends in tolerances, at the worst tolerance.
macro_rules! largest_error {
    ($model:ty, $method:ty, $x0:expr, $ends:expr) => {{
        let mut largest = 0.0f64;
        for tolerance in TOLERANCES {
            let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
            let mut adaptive = Adaptive::<$model, $method>::new(options).expect("valid");
            for (end, expected) in $ends {
                let x = adaptive.solve(&$x0, &SVector::zeros(), end).expect("a solution").x;
                for (x, expected) in x.iter().zip(expected) {
                    largest = largest.max((x - expected).abs() / (1.0 + expected.abs()) / tolerance);
                }
            }
        }
        largest
    }};
}

/// A spring that is stiffer on one side.
#[ode]
fn two_springs(x: [f64; 2], t: f64) -> [f64; 2] {
    [x[1], -0.1 * x[1] - 2.0 * x[0] - x[0].abs() + t.cos()]
}

/// On either side the equations are linear: Newton's method converges at once, and that ended the
/// iteration of the step over a kink after one increment. Errors were up to 1e5 tolerances.
#[test]
fn contraction_rates_across_kinks() {
    let radau = largest_error!(TwoSprings, Radau, vector![1.0, 0.0], TWO_SPRINGS);
    let gauss = largest_error!(TwoSprings, Gauss<3>, vector![1.0, 0.0], TWO_SPRINGS);
    assert!(radau <= 30.0 && gauss <= 30.0, "{radau} and {gauss} tolerances");
}

/// A rod that is heated at one end until its middle is warm, within a band of 0.02.
#[ode]
fn rod(x: [f64; 10]) -> [f64; 10] {
    let mut derivative = [0.0; 10];
    for i in 0..10 {
        let left = if i == 0 { x[0] } else { x[i - 1] };
        let right = if i == 9 { x[9] } else { x[i + 1] };
        derivative[i] = 25.0 * (left - 2.0 * x[i] + right) - 0.5 * x[i];
    }
    derivative[0] += 20.0 * (1.0 + ((1.0 - x[4]) / 0.02).tanh());
    derivative
}

/// Increments that are small and do not shrink are rounding errors, or those of a Jacobian that is
/// out of date. With it, Gauss's method was off by 1800 tolerances of 1e-10 and 140 of 1e-9.
#[test]
fn slow_newton_iterations() {
    let error = largest_error!(Rod, Gauss<3>, SVector::<f64, 10>::zeros(), ROD);
    assert!(error <= 30.0, "{error} tolerances");
}

/// A converter whose switch is closed for 0.4 of each period.
#[ode]
fn converter(x: [f64; 2], t: f64) -> [f64; 2] {
    let mut voltage = 0.0;
    for period in 0..20 {
        let since = t - period as f64;
        if since >= 0.0 {
            voltage = if since < 0.4 { 12.0 } else { 0.0 };
        }
    }
    [(voltage - x[1]) / 2.0, (x[0] - x[1] / 1.5) / 3.0]
}

/// Steps that become longer behind a jump are looked at: a whole pulse between two of Gauss's nodes
/// was an error of 4e6 tolerances of 1e-7. SciPy's `DOP853` is off by 27 to 170 tolerances, its
/// `Radau` by 2 to 6, and by 3800 of 1e-4.
#[test]
fn pulses_between_collocation_nodes() {
    let error = largest_error!(Converter, Gauss<4>, vector![0.0, 0.0], CONVERTER);
    assert!(error <= 100.0, "{error} tolerances");
}

const TWO_SPRINGS: [(f64, [f64; 2]); 3] = [
    (11.0, [-1.2668208510055323, 1.4943380305433915]),
    (16.599999999999998, [-1.772122672271711, 0.9058379703365899]),
    (20.0, [-0.03090949090782078, -1.6627825134036693]),
];

const ROD: [(f64, [f64; 10]); 3] = [
    (
        3.3000000000000003,
        [
            1.9274948371679017,
            1.7233704267121894,
            1.4548685939491712,
            1.2228730001759516,
            1.0577741497748518,
            0.9499785087724927,
            0.8809388911036349,
            0.8366703927534339,
            0.8096247416272639,
            0.7966103677898129,
        ],
    ),
    (
        4.9799999999999995,
        [
            1.373404151872229,
            1.334352579380288,
            1.2638770695694117,
            1.174120091615463,
            1.07863195944992,
            0.989090474571876,
            0.9134882891811806,
            0.8559780142734288,
            0.8178665402749186,
            0.7990108611834403,
        ],
    ),
    (
        6.0,
        [
            1.3306191161922654,
            1.2961568847611553,
            1.234031241368099,
            1.1539313615087712,
            1.0672152186845183,
            0.9842264131950371,
            0.9126478824349078,
            0.8570928710559502,
            0.8196602694123912,
            0.8009354115709476,
        ],
    ),
];

const CONVERTER: [(f64, [f64; 2]); 3] = [
    (11.0, [1.2861579357335342, 5.532486805528128]),
    (16.599999999999998, [3.261667668026095, 4.060658288802973]),
    (20.0, [3.0632244520742553, 4.711353426905771]),
];
