//! Explicit pairs: two methods on the same stages, whose difference estimates the error, and their
//! dense output.
//!
//! E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, sections II.5,
//! II.6 and II.10; the coefficients of the codes DOPRI5 and DOP853.

use crate::adaptive::step_size::PiParameters;
use crate::scalar::Scalar;
use crate::tableau::{DormandPrince5, DormandPrince8, Method};

/// What a method of `S` stages needs besides its tableau. A stage follows them whose point is the
/// end of the step.
pub trait EmbeddedPair<const S: usize>: Method<S> {
    /// The difference to the other method: of the stages, and of the one at the end.
    const ERROR_COEFFICIENTS: ([f64; S], f64);
    /// The difference to a third one of low order: the estimate is then that of higher order, as
    /// far as the two agree.
    const THIRD_ORDER: Option<[f64; S]>;
    /// How often the error counts of what is not damped.
    const GLOBAL_ERROR_FACTOR: GlobalErrorFactor;
    /// Steps are at the bound of stability where `h |J d|/|d|` is this much, on the real axis.
    const STABILITY_BOUND: f64;
    /// `b` less the coefficients of the last stage, which is at the end of the step.
    const FSAL_DIFFERENCE: [f64; S] = {
        let mut last = *Self::TABLEAU.b();
        let (mut column, row) = (0, &Self::TABLEAU.a()[S - 1]);
        while column < S {
            last[column] -= row[column];
            column += 1;
        }
        last
    };
    /// How the step size follows the error.
    const CONTROL: PiParameters;
    /// Stages for dense output alone: for each its node, its coefficients of the stages, of the one
    /// at the end and of the ones before it.
    const DENSE_STAGES: &'static [DenseStage<S>];
    /// Coefficients of the polynomial beyond the cubic one: of the stages, of the one at the end,
    /// of those above.
    const DENSE_POLYNOMIAL: &'static [([f64; S], f64, [f64; 3])];

    /// The estimate from the two differences; what is not finite stays so.
    fn combined_estimate(fine: f64, coarse: Option<f64>) -> f64 {
        let Some(coarse) = coarse else { return fine };
        let both = fine * fine + 0.01 * coarse * coarse;
        if both > 0.0 && both.is_finite() { fine * fine / Scalar::sqrt(both) } else { both }
    }
}

/// How often the error of a step counts that nothing damps: it is there at the end, together with
/// those of all other steps.
#[derive(Clone, Copy, Debug)]
pub struct GlobalErrorFactor {
    /// Once for so many steps of this length as the interval has,
    pub steps_per_unit: f64,
    /// but no more often than the first number; in long intervals, than up to the second one:
    pub max_factor: (f64, f64),
    /// once for so many steps of a run with a tolerance of one, whatever the tolerance is. Over an
    /// oscillation, errors of a step in tolerances add up to the same at every tolerance, since
    /// the error is of one order more than the estimate.
    pub unit_steps: f64,
}

impl GlobalErrorFactor {
    /// In an interval of so many steps, each `unit` times as long as with a tolerance of one; once
    /// at least.
    pub fn evaluate(&self, steps: f64, unit: f64) -> f64 {
        let most = (steps * unit / self.unit_steps).clamp(self.max_factor.0, self.max_factor.1);
        (steps / self.steps_per_unit).min(most).max(1.0)
    }
}

/// A stage for dense output.
pub struct DenseStage<const S: usize> {
    /// `c`
    pub node: f64,
    /// Of the stages.
    pub stages: [f64; S],
    /// Of the one at the end.
    pub end_coefficient: f64,
    /// Of the stages for dense output before it.
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
    // Where a step is as long as the one before, its error is `0.965^(1/0.0375) = 0.39`.
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

    /// Over more oscillations errors count more often, over as many with more steps as often.
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
