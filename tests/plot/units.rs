//! Units at the axes: those of the doc comments of a model, and those that a call says.

use super::reader::groups;
use casados::ocp::{Constraint, HeapIpm, Horizon, LeastSquaresCost, Problem, Trajectory};
use casados::plot::{Figure, Panel};
use casados::prelude::*;
use roxmltree::Document;

type Test = Result<(), Box<dyn std::error::Error>>;

/// A trolley that is pushed.
///
/// - `u`: force per mass, N/kg
/// - `t`: s
#[ode]
mod trolley {
    /// Where it is and how fast.
    pub struct Motion {
        /// Position on the rail, m.
        pub place: f64,
        /// Velocity, from the wall outwards, m/s; zero at rest.
        pub speed: f64,
    }
    pub struct State {
        pub motion: Motion,
        /// Turns of both wheels, clockwise, since the start.
        pub turns: [f64; 2],
    }
    pub fn trolley(x: &State, u: f64) -> State {
        let Motion { speed, .. } = x.motion;
        State { motion: Motion { place: speed, speed: u }, turns: [speed, 0.5 * speed] }
    }
    #[function]
    pub fn deviation(x: &State, u: f64) -> [f64; 3] {
        [x.motion.place - 1.0, x.motion.speed, u]
    }
    /// Kinetic energy per mass, J/kg
    #[function]
    pub fn energy(x: &State, _u: f64) -> f64 {
        0.5 * x.motion.speed * x.motion.speed
    }
}

fn solved_problem(points: usize) -> Result<Trajectory, Box<dyn std::error::Error>> {
    let mut ocp = Problem::new(Erk::<Trolley, Rk4>::new(Options::default())?)
        .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[10.0, 1.0, 0.1]))
        .path_constraints(Constraint::<Energy>::new([-1.0], [0.2]))
        .on(Horizon::uniform(10, 0.1))?;
    ocp.fix_initial_state(&[0.0; 4])?.guess(&[0.0; 4], &[0.0])?;
    assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
    Ok(if points > 0 { ocp.dense_solution(points)? } else { ocp.solution()? })
}

/// What is written in a picture, but for the numbers.
fn texts(panel: Panel) -> Result<Vec<String>, Box<dyn std::error::Error>> {
    let svg = Figure::new().with(panel).to_svg();
    let document = Document::parse(&svg)?;
    let panel = groups(&document, "panel", None)[0];
    let texts = panel.descendants().filter(|node| node.tag_name().name() == "text");
    let texts = texts.filter_map(|node| node.text()).map(String::from);
    Ok(texts.filter(|text| text.parse::<f64>().is_err()).collect())
}

#[test]
fn units_of_axes() -> Test {
    for points in [0, 3] {
        let solution = solved_problem(points)?;
        let has = |name: &str, expected: &[&str]| -> Test {
            let found = texts(Panel::trajectories(&solution, name)?)?;
            for text in expected {
                assert!(found.iter().any(|found| found == text), "{name}: {text} is not in {found:?}");
            }
            Ok(())
        };
        has("x.motion.place", &["time, s", "x.motion.place, m"])?;
        has("u", &["time, s", "u, N/kg"])?;
        has("Energy", &["Energy, J/kg"])?;
        // Lines with other units have each its own, and the axis has none.
        has("x.motion", &["x.motion.place, m", "x.motion.speed, m/s"])?;
        let several = texts(Panel::trajectories(&solution, "x.motion")?)?;
        assert!(!several.iter().any(|text| text.starts_with("x.motion, ")), "{several:?}");
        // `clockwise` and `since the start` are no units.
        let turns = texts(Panel::trajectories(&solution, "x.turns")?)?;
        assert!(!turns.iter().any(|text| text.contains("x.turns, ")), "{turns:?}");
    }
    Ok(())
}

#[test]
fn units_given_in_calls() -> Test {
    let mut solution = solved_problem(0)?;
    solution.set_unit("x.turns", "rad")?.set_unit("x.motion.place", "cm")?.set_unit("t", "min")?;
    let turns = texts(Panel::trajectories(&solution, "x.turns")?)?;
    assert!(["x.turns, rad", "time, min"].iter().all(|text| turns.iter().any(|t| t == text)), "{turns:?}");
    let place = texts(Panel::trajectories(&solution, "x.motion.place")?)?;
    assert!(place.iter().any(|text| text == "x.motion.place, cm"), "{place:?}");
    assert!(solution.set_unit("z", "m").is_err());
    Ok(())
}

#[test]
fn units_in_files() -> Test {
    let solution = solved_problem(0)?;
    let text = serde_json::to_string(&solution)?;
    let read: Trajectory = serde_json::from_str(&text)?;
    assert_eq!(read, solution);
    let mut old: serde_json::Value = serde_json::from_str(&text)?;
    old.as_object_mut().ok_or("an object")?.remove("time_unit");
    for series in old["series"].as_array_mut().ok_or("a list")? {
        series.as_object_mut().ok_or("an object")?.remove("unit");
    }
    let old: Trajectory = serde_json::from_value(old)?;
    assert_eq!((old.time_unit(), old.get("u")?.unit.as_str()), ("", ""));
    assert_eq!(old.state("x.motion.speed")?, solution.state("x.motion.speed")?);
    Ok(())
}
