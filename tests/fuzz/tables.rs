//! Tables at any point: between the points the value is finite, beyond them it goes on as its last
//! piece does, and derivatives are those of the values.

use super::source::Source;
use super::*;
use casados::tables::{Linear, Linear2, Spline, Spline2};

const POINTS: [f64; 5] = [-2.0, -1.0, 0.25, 0.5, 3.0];
const VALUES: [f64; 5] = [1.0, -3.0, 0.0, 2.5, 2.0];
static LINE: Linear<5> = Linear::new(POINTS, VALUES);
static NATURAL: Spline<5> = Spline::natural(POINTS, VALUES);
static CLAMPED: Spline<5> = Spline::clamped(POINTS, VALUES, [0.5, -1.0]);
static NOT_A_KNOT: Spline<5> = Spline::not_a_knot(POINTS, VALUES);
const GRID: [[f64; 5]; 5] = [
    [0.0, 1.0, 2.0, 3.0, 4.0],
    [1.0, -1.0, 0.5, 2.0, 0.0],
    [2.0, 0.0, -4.0, 1.0, 1.0],
    [3.0, 1.0, 1.0, 5.0, -2.0],
    [4.0, 3.0, 2.0, 1.0, 0.0],
];
static PLANE: Linear2<5, 5> = Linear2::new(POINTS, POINTS, GRID);
static SURFACE: Spline2<5, 5> = Spline2::natural(POINTS, POINTS, GRID);

const CALLS: u64 = 20_000;

#[test]
fn tables() {
    let mut counts = Counts::new("tables");
    for seed in seeds(CALLS) {
        let mut source = Source::new(seed);
        let (x, y) = (source.number(), source.number());
        let [gx, gy] = PLANE.gradient(x, y);
        let [sx, sy] = SURFACE.gradient(x, y);
        let lines = [LINE.value(x), LINE.derivative(x), NATURAL.value(x), NATURAL.derivative(x)];
        let others = [CLAMPED.value(x), NOT_A_KNOT.value(x), NOT_A_KNOT.derivative(x)];
        let planes = [PLANE.value(x, y), gx, gy, SURFACE.value(x, y), sx, sy];
        // What is no number is none, and far beyond the last point cubes are infinite.
        let near = |v: f64| v.abs() < 1e50;
        if near(x) {
            assert!(
                lines.iter().chain(&others).all(|v| v.is_finite()),
                "seed {seed}: {x:e} {lines:?} {others:?}"
            );
        }
        if near(x) && near(y) {
            assert!(planes.iter().all(|v| v.is_finite()), "seed {seed}: {x:e} {y:e} {planes:?}");
        }
        if x.is_nan() {
            assert!(lines[0].is_nan() && lines[2].is_nan() && planes[0].is_nan(), "seed {seed}: {lines:?}");
        }
        // Between two points a linear table lies between their values.
        if let Some(i) = POINTS.windows(2).position(|pair| pair[0] <= x && x <= pair[1]) {
            let (low, high) = (VALUES[i].min(VALUES[i + 1]), VALUES[i].max(VALUES[i + 1]));
            assert!((low - 1e-12..=high + 1e-12).contains(&lines[0]), "seed {seed}: {x} {}", lines[0]);
        }
        counts.count(if near(x) && near(y) { "Ok" } else { "far or no number" });
    }
    enough(&counts, 10_000);
}
