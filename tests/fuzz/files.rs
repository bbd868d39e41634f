//! Files of trajectories with anything in them, and pictures of any data.

use super::source::Source;
use super::*;
use casados::ocp::{Horizon, Problem, Trajectory};
use casados::plot::{Curve, Figure, Panel};
use casados::prelude::*;
use serde_json::Value;

/// A cart: place, m; speed, m/s.
#[ode]
fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u]
}

fn is_consistent() -> Result<Value, Box<dyn std::error::Error>> {
    let mut ocp = Problem::new(Erk::<Cart, Rk4>::new(Options::default())?).on(Horizon::uniform(3, 0.5))?;
    ocp.fix_initial_state(&[0.0, 1.0])?.bound("u", .., -1.0, 1.0)?.guess(&[0.0; 2], &[0.5])?;
    Ok(serde_json::to_value(ocp.solution()?)?)
}

/// Changes something somewhere: numbers, lengths, names, kinds.
fn corrupt(value: &mut Value, source: &mut Source) {
    match value {
        Value::Array(list) => match source.below(8) {
            0 => drop(list.pop()),
            1 => list.extend(list.first().cloned()),
            2 => list.clear(),
            _ if list.is_empty() => {}
            _ => {
                let at = source.below(list.len());
                corrupt(&mut list[at], source);
            }
        },
        Value::Object(map) => {
            let keys: Vec<String> = map.keys().cloned().collect();
            let key = &keys[source.below(keys.len())];
            if source.below(30) == 0 {
                map.remove(key);
            } else {
                corrupt(&mut map[key.as_str()], source);
            }
        }
        Value::Number(_) => {
            let any = [Value::from(u64::MAX), Value::from(-1), Value::from(source.number()), Value::Null];
            *value = any[source.below(4)].clone();
        }
        Value::String(text) => {
            *text = ["", "x[9]", "State", "\u{0}<&>\"\u{ffff}", "x"][source.below(5)].to_owned();
        }
        Value::Null | Value::Bool(_) => *value = Value::from(source.number()),
    }
}

/// What is read can be asked for anything, drawn and written: no panic, and the picture is XML.
#[test]
fn trajectories_from_corrupted_files() -> Result<(), Box<dyn std::error::Error>> {
    let sound = is_consistent()?;
    let mut counts = Counts::new("trajectories that are read");
    for seed in seeds(2_000) {
        let mut source = Source::new(seed);
        let mut value = sound.clone();
        for _ in 0..=source.below(3) {
            corrupt(&mut value, &mut source);
        }
        let read = serde_json::from_value::<Trajectory>(value);
        if let Ok(trajectory) = &read {
            assert!(trajectory.times().iter().all(|time| time.is_finite()), "seed {seed}");
            let _ = (trajectory.csv().to_string(), trajectory.violations(0.0).len());
            for series in trajectory.series() {
                let _ = (series.multipliers(), series.violations(), trajectory.times_of(series).len());
                if let Ok(panel) = Panel::trajectories(trajectory, &series.name) {
                    let svg = Figure::new().with(panel).to_svg();
                    assert!(roxmltree::Document::parse(&svg).is_ok(), "seed {seed}: {svg}");
                    assert!(!svg.contains("NaN") && !svg.contains("inf\""), "seed {seed}: {svg}");
                }
            }
        }
        counts.count(if read.is_ok() { "Ok" } else { "error" });
    }
    enough(&counts, 300);
    Ok(())
}

#[test]
fn pictures() {
    let mut counts = Counts::new("pictures");
    for seed in seeds(1_000) {
        let mut source = Source::new(seed);
        let names = ["", "a < b & c", "\u{1b}[0m\u{ffff}", "speed, m/s"];
        let mut panel =
            Panel::new(names[source.below(4)]).x(names[source.below(4)]).y(names[source.below(4)]);
        for _ in 0..=source.below(3) {
            let points: Vec<(f64, f64)> =
                (0..source.below(9)).map(|_| (source.number(), source.number())).collect();
            let name = names[source.below(4)];
            panel = panel.with(match source.below(4) {
                0 => Curve::line(name, points),
                1 => Curve::steps(name, points),
                2 => Curve::dots(name, points),
                _ => Curve::coloured(name, points.into_iter().map(|(x, y)| (x, y, x))),
            });
        }
        if source.below(3) == 0 {
            panel = panel.limit(source.number()).text((source.number(), source.number()), "here");
        }
        if source.below(3) == 0 {
            panel = panel.x_range(source.number()..source.number()).y_range(source.number()..source.number());
        }
        panel = match source.below(5) {
            0 => panel.log_x(),
            1 => panel.log_y(),
            2 => panel.log_x().log_y(),
            3 => panel.equal(),
            _ => panel,
        };
        let svg = Figure::new().with(panel).to_svg();
        let document = roxmltree::Document::parse(&svg);
        assert!(document.is_ok(), "seed {seed}: {svg}");
        for node in document.iter().flat_map(|document| document.descendants()) {
            for attribute in node.attributes() {
                let value = attribute.value();
                assert!(!value.contains("NaN") && !value.contains("inf"), "seed {seed}: {value}");
            }
        }
        counts.count("Ok");
    }
    enough(&counts, 1_000);
}
