//! Pictures: they are parsed, and what they show is held against what was to be drawn.

mod figures;
mod reader;
mod units;

use casados::ocp::{
    Constraint, HeapOcp, HeapSqp, Horizon, Iteration, LeastSquaresCost, Log, Problem, TrajectoryError,
};
use casados::plot::{Colour, Curve, Figure, Panel, Space, Sparsity};
use casados::prelude::*;
use reader::{axes, groups, lines, pixels, points};
use roxmltree::Document;

type Test = Result<(), Box<dyn std::error::Error>>;

/// A pixel is drawn with a tenth, numbers are read with two of them.
const PIXEL: f64 = 0.2;

/// A cart that is pushed: position, velocity.
#[ode]
fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u]
}
#[function]
fn deviation(x: [f64; 2], u: f64) -> [f64; 3] {
    [x[0], x[1], u]
}

type CartProblem = Problem<Irk<Cart, Gauss<2>>, LeastSquaresCost<Deviation>>;

/// At rest beside its place, with a force within one.
fn solved_problem() -> Result<(HeapOcp<CartProblem>, HeapSqp), Box<dyn std::error::Error>> {
    let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
        .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[10.0, 1.0, 0.1]))
        .on(Horizon::uniform(20, 0.2))?;
    ocp.fix_initial_state(&[2.0, 0.0])?.bound("u", .., -1.0, 1.0)?.guess(&[0.0; 2], &[0.0])?;
    let mut sqp = HeapSqp::new(&ocp)?;
    assert!(sqp.solve(&mut ocp)?.is_converged());
    Ok((ocp, sqp))
}

#[test]
fn plots_of_trajectories() -> Test {
    let (mut ocp, _) = solved_problem()?;
    let svg = Figure::new().with(Panel::trajectories(&ocp.solution()?, "u")?).to_svg();
    let document = Document::parse(&svg)?;
    let panel = groups(&document, "panel", Some("Cart: u"))[0];
    let [x, y] = axes(&panel)?;

    // Stairs: the value of each interval at both of its ends.
    let drawn = points(&panel, &groups(&document, "series", Some("u"))[0])?.concat();
    let controls: Vec<f64> = ocp.iterate().stages().filter_map(|stage| stage.u.first().copied()).collect();
    for (k, &u) in controls.iter().enumerate() {
        for t in [0.2 * k as f64, 0.2 * (k + 1) as f64] {
            let is_there = |point: &&[f64; 2]| {
                (x.pixel(point[0]) - x.pixel(t)).abs() < PIXEL
                    && (y.pixel(point[1]) - y.pixel(u)).abs() < PIXEL
            };
            assert!(drawn.iter().any(|point| is_there(&point)), "u = {u} at {t}: {drawn:?}");
        }
    }

    let mut bounds = Vec::new();
    let mut active = Vec::new();
    for line in lines(&panel) {
        let ends = pixels(&line)?;
        let (first, last) = (ends[0], ends[ends.len() - 1]);
        if line.attribute("stroke-dasharray").is_some() {
            bounds.push(y.value(first[1]));
            assert!((x.value(last[0]) - 4.0).abs() < 0.01 && (last[1] - first[1]).abs() < 0.01);
        }
        if line.attribute("stroke-width") == Some("6") {
            let value = y.value(first[1]);
            assert!((value.abs() - 1.0).abs() < 0.01, "{value} is no bound");
            active.push([x.value(first[0]), x.value(last[0])]);
        }
    }
    bounds.sort_by(f64::total_cmp);
    assert!(
        bounds.len() == 2 && (bounds[0] + 1.0).abs() < 0.01 && (bounds[1] - 1.0).abs() < 0.01,
        "{bounds:?}"
    );
    // As many intervals as there are controls at a bound: at the start and on the way to rest.
    let covered: f64 = active.iter().map(|[from, to]| to - from).sum();
    let expected = 0.2 * controls.iter().filter(|u| (u.abs() - 1.0).abs() < 1e-6).count() as f64;
    assert!(expected >= 0.4 && (covered - expected).abs() < 0.02, "{active:?}, but {controls:?}");
    Ok(())
}

#[test]
fn names_in_plots() -> Test {
    let (mut ocp, _) = solved_problem()?;
    let svg = Figure::new().with(Panel::trajectories(&ocp.solution()?, "x")?).to_svg();
    let document = Document::parse(&svg)?;
    let panel = groups(&document, "panel", None)[0];
    for (i, name) in ["x[0]", "x[1]"].into_iter().enumerate() {
        let drawn = points(&panel, &groups(&document, "series", Some(name))[0])?.concat();
        assert_eq!(drawn.len(), 21);
        for (point, stage) in drawn.iter().zip(ocp.iterate().stages()) {
            assert!((point[1] - stage.x[i]).abs() < 0.01, "{name}: {point:?}, but {}", stage.x[i]);
        }
    }
    let unknown = Panel::trajectories(&ocp.solution()?, "y").map(|_| ()).unwrap_err();
    assert!(matches!(unknown, TrajectoryError::Unknown { .. }), "{unknown}");
    Ok(())
}

#[function]
fn speed(x: [f64; 2], _u: f64) -> f64 {
    x[1]
}

#[test]
fn plots_of_constraints() -> Test {
    let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
        .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[10.0, 0.01, 0.01]))
        .path_constraints(Constraint::<Speed>::new([-0.5], [f64::INFINITY]))
        .on(Horizon::uniform(20, 0.2))?;
    ocp.fix_initial_state(&[2.0, 0.0])?.guess(&[0.0; 2], &[0.0])?;
    assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    let solution = ocp.dense_solution(3)?;
    let svg = Figure::new().with(Panel::trajectories(&solution, "Speed")?).to_svg();
    let document = Document::parse(&svg)?;
    let panel = groups(&document, "panel", None)[0];
    let drawn = points(&panel, &groups(&document, "series", Some("Speed"))[0])?.concat();
    let expected = solution.get("Speed")?;
    assert_eq!(expected.values.len(), 80);
    // Points that a picture does not show apart are left out.
    assert!(drawn.len() > 40);
    let [x, y] = axes(&panel)?;
    for point in &drawn {
        let is_there = |(&time, &value): (&f64, &f64)| {
            (x.pixel(time) - x.pixel(point[0])).abs() < PIXEL
                && (y.pixel(value) - y.pixel(point[1])).abs() < PIXEL
        };
        assert!(solution.times().iter().zip(&expected.values).any(is_there), "{point:?}");
    }
    // Where the speed is at its bound the line is wide, and only there.
    let wide: Vec<_> =
        lines(&panel).into_iter().filter(|l| l.attribute("stroke-width") == Some("6")).collect();
    assert!(!wide.is_empty());
    for line in &wide {
        for pixel in pixels(line)? {
            assert!((y.value(pixel[1]) + 0.5).abs() < 0.01, "{} is no bound", y.value(pixel[1]));
        }
    }
    Ok(())
}

#[test]
fn convergence_plots() -> Test {
    let row = |iteration, size: f64| {
        let mut row = Iteration::default();
        row.iteration = iteration;
        row.residuals.stationarity = size;
        row.residuals.dynamics = 1e-3 * size;
        row
    };
    let rows = [row(0, 1e2), row(1, 3.0), row(2, 1e-4), row(3, 1e-9)];
    let figure = Figure::new()
        .with(Panel::convergence(Log(&rows)))
        .with(Panel::convergences([("one", Log(&rows)), ("none", Log(&[]))]));
    let svg = figure.to_svg();
    let document = Document::parse(&svg)?;
    for (panel, name, factor) in [(0, "stationarity", 1.0), (0, "dynamics", 1e-3), (1, "one", 1.0)] {
        let panel = groups(&document, "panel", None)[panel];
        let drawn = points(&panel, &groups(&document, "series", Some(name))[0])?.concat();
        assert_eq!(drawn.len(), 4, "{name}");
        for (point, row) in drawn.iter().zip(&rows) {
            let expected = factor * row.residuals.stationarity;
            assert!((point[1] / expected - 1.0).abs() < 0.05, "{name}: {point:?}, but {expected}");
            assert!((point[0] - row.iteration as f64).abs() < 0.01);
        }
    }
    // A residual that is zero has no place on this axis.
    let series = groups(&document, "series", Some("inequalities"))[0];
    assert!(lines(&series).is_empty());
    Ok(())
}

#[test]
fn histograms() -> Test {
    // 90 of one time, nine of a longer one, and one far away.
    let times: Vec<f64> = (0..100)
        .map(|i| {
            if i < 90 {
                0.1
            } else if i < 99 {
                0.15
            } else {
                7.0
            }
        })
        .collect();
    let svg = Figure::new().with(Panel::histogram([("feedback", times.as_slice())]).x("ms")).to_svg();
    let document = Document::parse(&svg)?;
    let panel = groups(&document, "panel", None)[0];
    let pieces = points(&panel, &groups(&document, "series", Some("feedback"))[0])?;
    assert_eq!(pieces.len(), 3, "gaps are gaps");
    for (piece, (time, share)) in pieces.iter().zip([(0.1, 0.9), (0.15, 0.09), (7.0, 0.01)]) {
        let [from, to] = [piece[0], piece[1]];
        assert!(from[0] < 1.001 * time && to[0] > 0.999 * time, "{piece:?} is not around {time}");
        assert!((to[0] / from[0]).log10() - 1.0 / 12.0 < 0.01);
        assert!((from[1] / share - 1.0).abs() < 0.03 && from[1] == to[1], "{piece:?}, but {share}");
    }
    Ok(())
}
