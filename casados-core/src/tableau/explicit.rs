//! Explicit methods.

use super::{Method, Tableau};

/// The explicit Euler method, order 1.
///
/// ```
/// use casados::{Euler, Method};
///
/// assert_eq!(Euler::TABLEAU.order(), 1);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Euler;

impl Method<1> for Euler {
    const TABLEAU: Tableau<1> = Tableau::published("explicit Euler", 1, 1, [[0.0]], [1.0], [0.0]);
}

/// The explicit midpoint rule of Runge, order 2.
///
/// ```
/// use casados::{Midpoint, Method};
///
/// assert_eq!(Midpoint::TABLEAU.order(), 2);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Midpoint;

impl Method<2> for Midpoint {
    const TABLEAU: Tableau<2> =
        Tableau::published("explicit midpoint", 2, 1, [[0.0, 0.0], [0.5, 0.0]], [0.0, 1.0], [0.0, 0.5]);
}

/// The method of Heun (explicit trapezoidal rule), order 2.
///
/// ```
/// use casados::{Heun, Method};
///
/// assert_eq!(Heun::TABLEAU.order(), 2);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Heun;

impl Method<2> for Heun {
    const TABLEAU: Tableau<2> =
        Tableau::published("Heun", 2, 1, [[0.0, 0.0], [1.0, 0.0]], [0.5, 0.5], [0.0, 1.0]);
}

/// The classical Runge-Kutta method, order 4.
///
/// ```
/// use casados::{Rk4, Method};
///
/// assert_eq!(Rk4::TABLEAU.order(), 4);
/// assert!(Rk4::TABLEAU.is_explicit());
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Rk4;

impl Method<4> for Rk4 {
    const TABLEAU: Tableau<4> = Tableau::published(
        "classical Runge-Kutta",
        4,
        1,
        [[0.0; 4], [0.5, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
        [0.0, 0.5, 0.5, 1.0],
    );
}

/// The method of Dormand and Prince with six stages, order 5.
///
/// The seventh stage of the published pair, for error estimates, has weight zero and is omitted. J.
/// R. Dormand, P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comput. Appl. Math. 6
/// (1980).
///
/// ```
/// use casados::{DormandPrince5, Method};
///
/// assert_eq!(DormandPrince5::TABLEAU.order(), 5);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DormandPrince5;

impl Method<6> for DormandPrince5 {
    const TABLEAU: Tableau<6> = Tableau::published(
        "Dormand-Prince 5",
        5,
        1,
        [
            [0.0; 6],
            [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
            [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
            [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
            [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
        ],
        [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
        [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0],
    );
}

/// The method of Butcher with seven stages, order 6.
///
/// J. C. Butcher, On Runge-Kutta processes of high order, J. Austral. Math. Soc. 4 (1964).
///
/// ```
/// use casados::{Butcher6, Method};
///
/// assert_eq!(Butcher6::TABLEAU.order(), 6);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Butcher6;

impl Method<7> for Butcher6 {
    const TABLEAU: Tableau<7> = Tableau::published(
        "Butcher 6",
        6,
        1,
        [
            [0.0; 7],
            [1.0 / 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 2.0 / 3.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [1.0 / 12.0, 1.0 / 3.0, -1.0 / 12.0, 0.0, 0.0, 0.0, 0.0],
            [-1.0 / 16.0, 9.0 / 8.0, -3.0 / 16.0, -3.0 / 8.0, 0.0, 0.0, 0.0],
            [0.0, 9.0 / 8.0, -3.0 / 8.0, -3.0 / 4.0, 1.0 / 2.0, 0.0, 0.0],
            [9.0 / 44.0, -9.0 / 11.0, 63.0 / 44.0, 18.0 / 11.0, 0.0, -16.0 / 11.0, 0.0],
        ],
        [11.0 / 120.0, 0.0, 27.0 / 40.0, 27.0 / 40.0, -4.0 / 15.0, -4.0 / 15.0, 11.0 / 120.0],
        [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0, 1.0 / 2.0, 1.0 / 2.0, 1.0],
    );
}

/// The method of Dormand and Prince with twelve stages, order 8, known from the code DOP853.
///
/// E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993),
/// section II.5; coefficients published to 30 digits, rounded once.
///
/// ```
/// use casados::{DormandPrince8, Method};
///
/// assert_eq!(DormandPrince8::TABLEAU.order(), 8);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DormandPrince8;

impl Method<12> for DormandPrince8 {
    const TABLEAU: Tableau<12> = Tableau::published(
        "Dormand-Prince 8",
        8,
        1,
        [
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.05260015195876773, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0197250569845379, 0.0591751709536137, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.02958758547680685, 0.0, 0.08876275643042054, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [
                0.2413651341592667,
                0.0,
                -0.8845494793282861,
                0.924834003261792,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
            ],
            [
                0.037037037037037035,
                0.0,
                0.0,
                0.17082860872947386,
                0.12546768756682242,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
            ],
            [
                0.037109375,
                0.0,
                0.0,
                0.17025221101954405,
                0.06021653898045596,
                -0.017578125,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
            ],
            [
                0.03709200011850479,
                0.0,
                0.0,
                0.17038392571223998,
                0.10726203044637328,
                -0.015319437748624402,
                0.008273789163814023,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
            ],
            [
                0.6241109587160757,
                0.0,
                0.0,
                -3.3608926294469414,
                -0.868219346841726,
                27.59209969944671,
                20.154067550477894,
                -43.48988418106996,
                0.0,
                0.0,
                0.0,
                0.0,
            ],
            [
                0.47766253643826434,
                0.0,
                0.0,
                -2.4881146199716677,
                -0.590290826836843,
                21.230051448181193,
                15.279233632882423,
                -33.28821096898486,
                -0.020331201708508627,
                0.0,
                0.0,
                0.0,
            ],
            [
                -0.9371424300859873,
                0.0,
                0.0,
                5.186372428844064,
                1.0914373489967295,
                -8.149787010746927,
                -18.52006565999696,
                22.739487099350505,
                2.4936055526796523,
                -3.0467644718982196,
                0.0,
                0.0,
            ],
            [
                2.273310147516538,
                0.0,
                0.0,
                -10.53449546673725,
                -2.0008720582248625,
                -17.9589318631188,
                27.94888452941996,
                -2.8589982771350235,
                -8.87285693353063,
                12.360567175794303,
                0.6433927460157636,
                0.0,
            ],
        ],
        [
            0.054293734116568765,
            0.0,
            0.0,
            0.0,
            0.0,
            4.450312892752409,
            1.8915178993145003,
            -5.801203960010585,
            0.3111643669578199,
            -0.1521609496625161,
            0.20136540080403034,
            0.04471061572777259,
        ],
        [
            0.0,
            0.05260015195876773,
            0.0789002279381516,
            0.1183503419072274,
            0.2816496580927726,
            0.3333333333333333,
            0.25,
            0.3076923076923077,
            0.6512820512820513,
            0.6,
            0.8571428571428571,
            1.0,
        ],
    );
}
