//! Everything as JSON.

use super::Results;
use super::rows::{AcadosTime, Measured};
use casados_benches::case::Mode;
use serde_json::{Value, json};

fn measured(m: &Measured) -> Value {
    json!({ "median": m.time.median, "q1": m.time.q1, "q3": m.time.q3, "samples": m.time.samples, "error": m.error, "iterations": m.iterations, "dense": m.dense })
}

/// A measurement, or the seconds that were carried over.
fn acados_time(acados: &AcadosTime) -> Value {
    match acados {
        AcadosTime::Measured(m) => measured(m),
        AcadosTime::CarriedOver(seconds) => json!({ "carried": seconds }),
    }
}

/// Times in seconds.
pub fn seconds_of(results: &Results) -> Value {
    let rows: Vec<_> = results
        .rows
        .iter()
        .map(|row| {
            json!({
                "case": row.case, "nx": row.nx, "mode": row.mode.name(), "reference": row.reference,
                "cold": measured(&row.cold), "rounding": measured(&row.rounding),
                "warm": row.warm.as_ref().map(measured), "forty": measured(&row.batch_of_forty),
                "batch": row.batch.as_ref().map(measured),
                "casadi": row.casadi.as_ref().map(measured),
                "acados_irk": row.acados[0].as_ref().map(acados_time), "acados_gnsf": row.acados[1].as_ref().map(acados_time),
            })
        })
        .collect();
    let adaptive: Vec<_> = results.adaptive.iter().map(|line| json!({
        "problem": line.problem, "solver": line.solver, "mode": line.mode.name(),
        "measured": line.measured.as_ref().ok().map(measured), "failure": line.measured.as_ref().err(),
    })).collect();
    let growth: Vec<_> = results.growth.iter().map(|g| json!({
        "stages": g.stages, "steps": g.steps,
        "points": g.points.iter().map(|(nx, times)| json!({
            "nx": nx,
            "times": times.iter().zip(Mode::ALL_MODES).map(|(m, mode)| (mode.name().to_owned(), measured(m))).collect::<serde_json::Map<_, _>>(),
        })).collect::<Vec<_>>(),
    })).collect();
    let precision: Vec<_> = results.precision.iter().flat_map(|(all, _)| all).map(|p| json!({
        "stages": p.stages, "steps": p.steps, "simulation": measured(&p.simulation), "forward": measured(&p.forward),
    })).collect();
    json!({
        "machine": results.machine, "scale": results.scale, "rows": rows, "adaptive": adaptive, "growth": growth,
        "precision": precision,
    })
}
