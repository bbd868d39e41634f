//! The tables.

use super::Results;
use super::rows::{AcadosTime, Measured, Row};
use casados_benches::case::Mode;
use std::fmt::Write;

/// Three digits.
pub fn three_digits(value: f64) -> String {
    match value {
        v if !v.is_finite() => "–".into(),
        v if v < 0.995 => format!("{v:.3}"),
        v if v < 9.95 => format!("{v:.2}"),
        v if v < 99.5 => format!("{v:.1}"),
        v => format!("{v:.0}"),
    }
}

fn optional_text(value: Option<f64>, show: impl Fn(f64) -> String) -> String {
    value.map_or_else(|| "–".into(), show)
}

fn microseconds(seconds: f64) -> String {
    three_digits(1e6 * seconds)
}

/// The median, and the range of rounds or the quartiles.
fn spread(m: &Measured) -> String {
    format!("{} [{}, {}]", microseconds(m.time.median), microseconds(m.time.q1), microseconds(m.time.q3))
}

fn error(m: &Measured) -> String {
    optional_text(m.error, |e| format!("{e:.0e}"))
}

/// Iterations of Newton's method, and how many factorisations pivoted the whole matrix if any did.
fn iterations(m: &Measured) -> String {
    if m.dense > 0 { format!("{} ({} dense)", m.iterations, m.dense) } else { m.iterations.to_string() }
}

/// Where times of acados are from, in a word or two.
pub fn time_origin<'a>(all: impl Iterator<Item = &'a AcadosTime>) -> &'static str {
    let (mut measured, mut carried) = (false, false);
    all.for_each(|theirs| match theirs {
        AcadosTime::Measured(_) => measured = true,
        AcadosTime::CarriedOver(_) => carried = true,
    });
    match (measured, carried) {
        (true, false) => "measured",
        (true, true) => "measured, ≈ carried over",
        (false, true) => "carried over",
        (false, false) => "none",
    }
}

/// What was measured with its range, what was carried over with a sign.
fn acados_time(acados: &AcadosTime) -> String {
    match acados {
        AcadosTime::Measured(measured) => spread(measured),
        AcadosTime::CarriedOver(seconds) => format!("≈ {}", microseconds(*seconds)),
    }
}

fn speedup(ratio: f64) -> String {
    format!("{}×", three_digits(ratio))
}

/// All tables as Markdown.
pub fn markdown(results: &Results) -> String {
    let mut text = String::new();
    write_report(&mut text, results).expect("a string takes everything");
    text
}

fn write_report(text: &mut String, results: &Results) -> std::fmt::Result {
    writeln!(text, "### The run\n")?;
    for line in &results.machine {
        writeln!(text, "- {line}")?;
    }
    let (implicit, explicit): (Vec<_>, Vec<_>) =
        results.rows.iter().partition(|row| !row.case.contains("erk4"));
    let carried = |row: &Row| row.acados.iter().any(|a| matches!(a, Some(AcadosTime::CarriedOver(_))));
    if results.scale.is_finite() && results.rows.iter().any(carried) {
        let s = three_digits(results.scale);
        writeln!(
            text,
            "- CasADi's simulations took {s} times (median) what they took where acados was measured beside them"
        )?;
    }
    if !implicit.is_empty() {
        single_calls_section(text, &implicit)?;
        peers_section(text, &implicit)?;
        batch_section(text, &implicit)?;
    }
    if !explicit.is_empty() {
        writeln!(text, "\n### Explicit: RK4, one step, one call\n")?;
        single_table(text, &explicit)?;
        peers_table(text, &explicit)?;
    }
    adaptive_section(text, results)?;
    growth_section(text, results)?;
    precision_section(text, results)
}

fn single_calls_section(text: &mut String, rows: &[&Row]) -> std::fmt::Result {
    writeln!(text, "\n### One call\n")?;
    writeln!(
        text,
        "Microseconds: the median of five rounds [the least, the greatest]. Cold: from zero. 1e-8:\n\
         Newton's method to 1e-8 / steps, as acados; rounding: the default. Warm: two intervals in turn\n\
         whose inputs are 1e-2 apart. Error: largest, relative to the largest element of the reference.\n"
    )?;
    single_table(text, rows)
}

fn single_table(text: &mut String, rows: &[&Row]) -> std::fmt::Result {
    writeln!(
        text,
        "| case | nx | mode | cold 1e-8 | error | iterations | cold, rounding | error | iterations | warm 1e-8 | iterations | reference |"
    )?;
    writeln!(text, "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")?;
    for row in rows {
        writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            row.case,
            row.nx,
            row.mode.name(),
            spread(&row.cold),
            error(&row.cold),
            iterations(&row.cold),
            spread(&row.rounding),
            error(&row.rounding),
            iterations(&row.rounding),
            row.warm.as_ref().map_or_else(|| "–".into(), spread),
            row.warm.as_ref().map_or_else(|| "–".into(), iterations),
            row.reference
        )?;
    }
    Ok(())
}

fn peers_section(text: &mut String, rows: &[&Row]) -> std::fmt::Result {
    writeln!(text, "\n### One call beside CasADi and acados\n")?;
    writeln!(
        text,
        "Microseconds; cold, tolerance 1e-8 / steps; all that has a range was measured in turn, in five\n\
         rounds, and what has the sign ≈ was carried over by the ratio of CasADi. The last columns say\n\
         how many times faster casados is. Errors stand behind the peer that they are of.\n"
    )?;
    peers_table(text, rows)
}

fn peers_table(text: &mut String, rows: &[&Row]) -> std::fmt::Result {
    let from = |k: usize| time_origin(rows.iter().filter_map(|row| row.acados[k].as_ref()));
    writeln!(
        text,
        "\n| case | mode | casados | CasADi | error | acados IRK, {} | error | GNSF, {} | than CasADi | than IRK | than GNSF |",
        from(0),
        from(1)
    )?;
    writeln!(text, "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")?;
    for row in rows {
        let own = row.cold.time.median;
        let ratio = |time: Option<f64>| optional_text(time, |t| speedup(t / own));
        let irk = row.acados[0].and_then(|theirs| theirs.measured());
        writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            row.case,
            row.mode.name(),
            spread(&row.cold),
            row.casadi.as_ref().map_or_else(|| "–".into(), spread),
            // Its own values are no reference for it.
            row.casadi.as_ref().filter(|_| row.reference != "CasADi").map_or_else(|| "–".into(), error),
            row.acados[0].as_ref().map_or_else(|| "–".into(), acados_time),
            irk.as_ref().map_or_else(|| "–".into(), error),
            row.acados[1].as_ref().map_or_else(|| "–".into(), acados_time),
            ratio(row.casadi.map(|c| c.time.median)),
            ratio(row.acados[0].as_ref().map(AcadosTime::seconds)),
            ratio(row.acados[1].as_ref().map(AcadosTime::seconds))
        )?;
    }
    Ok(())
}

fn batch_section(text: &mut String, rows: &[&Row]) -> std::fmt::Result {
    writeln!(text, "\n### Forty intervals\n")?;
    writeln!(
        text,
        "Microseconds of one of 40 different intervals, whose results are all kept; cold, tolerance 1e-8\n\
         / steps; on one thread.\n"
    )?;
    writeln!(
        text,
        "| case | mode | one call after the other | than acados IRK | in a batch | error | than one by one | than acados IRK |"
    )?;
    writeln!(text, "| --- | --- | --- | --- | --- | --- | --- | --- |")?;
    for row in rows {
        let than = |measured: &Measured| row.acados[0].map(|t| t.seconds() / measured.time.median);
        let batch = row.batch.as_ref();
        writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            row.case,
            row.mode.name(),
            spread(&row.batch_of_forty),
            optional_text(than(&row.batch_of_forty), speedup),
            batch.map_or("–".into(), spread),
            batch.map_or("–".into(), error),
            optional_text(batch.map(|batch| row.batch_of_forty.time.median / batch.time.median), speedup),
            optional_text(batch.and_then(than), speedup)
        )?;
    }
    Ok(())
}

fn adaptive_section(text: &mut String, results: &Results) -> std::fmt::Result {
    if results.adaptive.is_empty() {
        return Ok(());
    }
    writeln!(text, "\n### Beside solvers with step-size control\n")?;
    writeln!(
        text,
        "Peers at relative and absolute tolerance 1e-8, default settings; microseconds of one call, error\n\
         against the exact flow. The adjoint and the Hessian have no exact flow to compare with.\n"
    )?;
    writeln!(text, "| problem | nx | mode | solver | time | error |\n| --- | --- | --- | --- | --- | --- |")?;
    for line in &results.adaptive {
        let (time, error) = match &line.measured {
            Ok(m) => (spread(m), error(m)),
            Err(failure) => (failure.clone(), "–".into()),
        };
        writeln!(
            text,
            "| {} | {} | {} | {} | {time} | {error} |",
            line.problem,
            line.nx,
            line.mode.name(),
            line.solver
        )?;
    }
    Ok(())
}

fn growth_section(text: &mut String, results: &Results) -> std::fmt::Result {
    for growth in &results.growth {
        writeln!(text, "\n### Growth, s = {}, {} steps\n", growth.stages, growth.steps)?;
        writeln!(
            text,
            "Microseconds of one call, cold, for chains of 9 to 65 masses; the exponent is the slope of log\n\
             time over log nx.\n"
        )?;
        writeln!(text, "| nx | simulation | forward | adjoint | Hessian |\n| --- | --- | --- | --- | --- |")?;
        for (nx, measured) in &growth.points {
            let [a, b, c, d] = measured.map(|m| microseconds(m.time.median));
            writeln!(text, "| {nx} | {a} | {b} | {c} | {d} |")?;
        }
        let [a, b, c, d] = [0, 1, 2, 3].map(|mode| format!("{:.2}", growth.fitted_exponent(mode)));
        writeln!(text, "| exponent | {a} | {b} | {c} | {d} |")?;
        let [a, b, c, d] =
            [0, 1, 2, 3].map(|mode| format!("{:.2}", growth.fitted_exponent_per_iteration(mode)));
        writeln!(text, "| of an iteration of Newton's method | {a} | {b} | {c} | {d} |")?;
    }
    Ok(())
}

fn precision_section(text: &mut String, results: &Results) -> std::fmt::Result {
    let Some((all, uncertainty)) = &results.precision else { return Ok(()) };
    writeln!(text, "\n### What accuracy costs\n")?;
    writeln!(
        text,
        "Chain of 5 masses, 0.2 s, Gauss-Legendre; microseconds of one call, error against the exact flow\n\
         (itself known to {uncertainty:.0e}).\n"
    )?;
    writeln!(
        text,
        "| s | steps | simulation | error | forward | error |\n| --- | --- | --- | --- | --- | --- |"
    )?;
    for p in all {
        let (a, b) = (microseconds(p.simulation.time.median), microseconds(p.forward.time.median));
        writeln!(
            text,
            "| {} | {} | {a} | {} | {b} | {} |",
            p.stages,
            p.steps,
            error(&p.simulation),
            error(&p.forward)
        )?;
    }
    Ok(())
}

/// The name of a mode, as in plots.
pub fn mode_label(mode: Mode) -> &'static str {
    match mode {
        Mode::Simulation => "simulation",
        Mode::Forward => "forward",
        Mode::Adjoint => "adjoint",
        Mode::Hessian => "Hessian",
    }
}
