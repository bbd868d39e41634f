//! Explicit pairs: two methods with the same stages, whose difference estimates the error, and
//! their dense output.
//!
//! E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, sections II.5,
//! II.6 and II.10; the coefficients of the codes DOPRI5 and DOP853.

use crate::adaptive::step_size::PiParameters;
use crate::scalar::Scalar;
use crate::tableau::{DormandPrince5, DormandPrince8, Method};

/// The coefficients of a pair with `S` stages besides its tableau. One more stage, at the end of
/// the step, follows.
pub trait EmbeddedPair<const S: usize>: Method<S> {
    /// The coefficients `e` of the difference of the two methods: of the stages, and of the stage
    /// at the end.
    const ERROR_COEFFICIENTS: ([f64; S], f64);
    /// The coefficients of the difference to a third method, of order three; see
    /// [`combined_estimate`](Self::combined_estimate).
    const THIRD_ORDER: Option<[f64; S]>;
    /// The factor for undamped errors, which accumulate.
    const GLOBAL_ERROR_FACTOR: GlobalErrorFactor;
    /// The stability bound on the negative real axis, for `h |J d|/|d|`.
    const STABILITY_BOUND: f64;
    /// `b` minus the coefficients of the last stage, which is at the end of the step.
    const FSAL_DIFFERENCE: [f64; S] = {
        let mut last = *Self::TABLEAU.b();
        let (mut column, row) = (0, &Self::TABLEAU.a()[S - 1]);
        while column < S {
            last[column] -= row[column];
            column += 1;
        }
        last
    };
    /// The step-size controller.
    const CONTROL: PiParameters;
    /// Further stages for dense output: their nodes, and their coefficients of the stages, of the
    /// stage at the end and of the preceding further stages.
    const DENSE_STAGES: &'static [DenseStage<S>];
    /// The coefficients of the interpolation polynomial beyond degree three: of the stages, of the
    /// stage at the end, and of the further stages.
    const DENSE_POLYNOMIAL: &'static [([f64; S], f64, [f64; 3])];

    /// The error estimate `d₅² / √(d₅² + 0.01 d₃²)` from the two differences; non-finite values are
    /// returned.
    fn combined_estimate(fine: f64, coarse: Option<f64>) -> f64 {
        let Some(coarse) = coarse else { return fine };
        let both = fine * fine + 0.01 * coarse * coarse;
        if both > 0.0 && both.is_finite() { fine * fine / Scalar::sqrt(both) } else { both }
    }
}

/// The global error factor: undamped local errors of all steps accumulate until the end.
#[derive(Clone, Copy, Debug)]
pub struct GlobalErrorFactor {
    /// The factor increases by one for this number of steps of the present length in the interval.
    pub steps_per_unit: f64,
    /// The range of the maximum factor: for short intervals, and for long ones.
    pub max_factor: (f64, f64),
    /// The maximum factor increases by one for this number of steps of a run with tolerance one.
    /// Over an oscillation, local errors accumulate to the same number of tolerances at every
    /// tolerance, since the error has a higher order than the estimate.
    pub unit_steps: f64,
}

impl GlobalErrorFactor {
    /// The factor, at least one, for an interval of `steps` steps, each `unit` times as long as
    /// with a tolerance of one.
    pub fn evaluate(&self, steps: f64, unit: f64) -> f64 {
        let most = (steps * unit / self.unit_steps).clamp(self.max_factor.0, self.max_factor.1);
        (steps / self.steps_per_unit).min(most).max(1.0)
    }
}

/// A further stage for dense output.
pub struct DenseStage<const S: usize> {
    /// The node `c`.
    pub node: f64,
    /// The coefficients of the stages.
    pub stages: [f64; S],
    /// The coefficient of the stage at the end.
    pub end_coefficient: f64,
    /// The coefficients of the preceding further stages.
    pub dense_coefficients: [f64; 2],
}

impl EmbeddedPair<6> for DormandPrince5 {
    const ERROR_COEFFICIENTS: ([f64; 6], f64) = (
        [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0],
        -1.0 / 40.0,
    );
    const THIRD_ORDER: Option<[f64; 6]> = None;
    const GLOBAL_ERROR_FACTOR: GlobalErrorFactor =
        GlobalErrorFactor { steps_per_unit: 180.0, max_factor: (16.0, 16.0), unit_steps: 1.0 };
    const STABILITY_BOUND: f64 = 3.25;
    const CONTROL: PiParameters = PiParameters {
        order: 5.0,
        beta: 0.04,
        initial_error: 1e-4,
        safety: 0.9,
        uses_prediction: false,
        factor_range: (0.2, 10.0),
    };
    const DENSE_STAGES: &'static [DenseStage<6>] = &[];
    const DENSE_POLYNOMIAL: &'static [([f64; 6], f64, [f64; 3])] = &[(
        [
            -12715105075.0 / 11282082432.0,
            0.0,
            87487479700.0 / 32700410799.0,
            -10690763975.0 / 1880347072.0,
            701980252875.0 / 199316789632.0,
            -1453857185.0 / 822651844.0,
        ],
        69997945.0 / 29380423.0,
        [0.0; 3],
    )];
}

impl EmbeddedPair<12> for DormandPrince8 {
    const ERROR_COEFFICIENTS: ([f64; 12], f64) = (
        [
            0.01312004499419488,
            0.0,
            0.0,
            0.0,
            0.0,
            -1.2251564463762044,
            -0.4957589496572502,
            1.6643771824549864,
            -0.35032884874997366,
            0.3341791187130175,
            0.08192320648511571,
            -0.022355307863886294,
        ],
        0.0,
    );
    const THIRD_ORDER: Option<[f64; 12]> = {
        let mut coarse = *<Self as Method<12>>::TABLEAU.b();
        coarse[0] -= 0.2440944881889764;
        coarse[8] -= 0.7338466882816118;
        coarse[11] -= 0.022058823529411766;
        Some(coarse)
    };
    const GLOBAL_ERROR_FACTOR: GlobalErrorFactor =
        GlobalErrorFactor { steps_per_unit: 10.0, max_factor: (16.0, 40.0), unit_steps: 40.0 };
    const STABILITY_BOUND: f64 = 6.1;
    // For a constant step size the error is `0.965^(1/0.0375) = 0.39`.
    const CONTROL: PiParameters = PiParameters {
        order: 8.0,
        beta: 0.05,
        initial_error: 1.0,
        safety: 0.965,
        uses_prediction: true,
        factor_range: (1.0 / 3.0, 6.0),
    };
    const DENSE_STAGES: &'static [DenseStage<12>] = &[
        DenseStage {
            node: 0.1,
            stages: [
                0.056167502283047954,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.25350021021662483,
                -0.2462390374708025,
                -0.12419142326381637,
                0.15329179827876568,
                0.00820105229563469,
                0.007567897660545699,
            ],
            end_coefficient: -0.008298,
            dense_coefficients: [0.0; 2],
        },
        DenseStage {
            node: 0.2,
            stages: [
                0.03183464816350214,
                0.0,
                0.0,
                0.0,
                0.0,
                0.028300909672366776,
                0.053541988307438566,
                -0.05492374857139099,
                0.0,
                0.0,
                -0.00010834732869724932,
                0.0003825710908356584,
            ],
            end_coefficient: -0.00034046500868740456,
            dense_coefficients: [0.1413124436746325, 0.0],
        },
        DenseStage {
            node: 7.0 / 9.0,
            stages: [
                -0.42889630158379194,
                0.0,
                0.0,
                0.0,
                0.0,
                -4.697621415361164,
                7.683421196062599,
                4.06898981839711,
                0.3567271874552811,
                0.0,
                0.0,
                0.0,
            ],
            end_coefficient: -0.0013990241651590145,
            dense_coefficients: [2.9475147891527724, -9.15095847217987],
        },
    ];
    const DENSE_POLYNOMIAL: &'static [([f64; 12], f64, [f64; 3])] = &[
        (
            [
                -8.428938276109013,
                0.0,
                0.0,
                0.0,
                0.0,
                0.5667149535193777,
                -3.0689499459498917,
                2.38466765651207,
                2.117034582445028,
                -0.871391583777973,
                2.2404374302607883,
                0.6315787787694688,
            ],
            -0.08899033645133331,
            [18.148505520854727, -9.194632392478356, -4.436036387594894],
        ),
        (
            [
                10.427508642579134,
                0.0,
                0.0,
                0.0,
                0.0,
                242.28349177525817,
                165.20045171727028,
                -374.5467547226902,
                -22.113666853125306,
                7.733432668472264,
                -30.674084731089398,
                -9.332130526430229,
            ],
            15.697238121770845,
            [-31.139403219565178, -9.35292435884448, 35.81684148639408],
        ),
        (
            [
                19.985053242002433,
                0.0,
                0.0,
                0.0,
                0.0,
                -387.0373087493518,
                -189.17813819516758,
                527.8081592054236,
                -11.57390253995963,
                6.8812326946963,
                -1.0006050966910838,
                0.7777137798053443,
            ],
            -2.778205752353508,
            [-60.19669523126412, 84.32040550667716, 11.99229113618279],
        ),
        (
            [
                -25.69393346270375,
                0.0,
                0.0,
                0.0,
                0.0,
                -154.18974869023643,
                -231.5293791760455,
                357.6391179106141,
                93.40532418362432,
                -37.45832313645163,
                104.0996495089623,
                29.8402934266605,
            ],
            -43.53345659001114,
            [96.32455395918828, -39.17726167561544, -149.72683625798564],
        ),
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The factor grows with the number of oscillations, and is independent of the steps per
    /// oscillation.
    #[test]
    fn global_error_factor_of_long_intervals() {
        let factor = <DormandPrince8 as EmbeddedPair<12>>::GLOBAL_ERROR_FACTOR;
        let count = |steps: f64, tolerance: f64| factor.evaluate(steps, f64::powf(tolerance, 0.125));
        assert_eq!(count(5.0, 1e-8), 1.0);
        assert_eq!(count(50.0, 1e-8), 5.0);
        assert_eq!([count(1000.0, 1e-8), count(1000.0, 1e-4)], [16.0; 2]);
        assert!((count(10_000.0, 1e-8) - 25.0).abs() < 1e-9);
        assert!((count(1000.0, 1.0) - 25.0).abs() < 1e-9);
        assert_eq!(count(1e6, 1e-8), 40.0);
    }

    #[test]
    fn combined_estimate_of_non_finite_differences() {
        let combined = <DormandPrince8 as EmbeddedPair<12>>::combined_estimate;
        assert_eq!((combined(0.0, Some(0.0)), combined(0.3, Some(0.0))), (0.0, 0.3));
        assert!((combined(0.3, Some(4.0)) - 0.09 / 0.5).abs() < 1e-15);
        for [fine, coarse] in [[f64::NAN, 1.0], [1.0, f64::NAN], [1.0, f64::INFINITY], [1e200, 1.0]] {
            assert!(!combined(fine, Some(coarse)).is_finite(), "{fine} {coarse}");
        }
    }
}
