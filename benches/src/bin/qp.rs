//! One QP of the chain of masses at a tolerance of 1e-8: the library's interior point, condensed
//! and not, cold and warm, beside clarabel in the same run.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --features clarabel --bin qp
//! ```
//!
//! The reference column is HPIPM (mode `speed`; warm: as acados runs it, condensed to ten blocks)
//! on another day on a machine on which clarabel took what the last column says: the ratio of the
//! two columns of clarabel carries it here.

use casados::qp::{
    Clarabel, Condensing, HeapInteriorPoint, HeapQp, HeapSolution, QpError, QpSolver, QpStart, StageDims,
};
use casados_benches::record::{load, numbers};
use casados_benches::time::{Summary, measure, pin_to_last_core};
use std::time::Duration;

type Failure = Box<dyn std::error::Error>;

/// Milliseconds of HPIPM cold, of acados' QP warm, and of clarabel beside them.
const REFERENCES: [(usize, [f64; 3]); 3] =
    [(3, [0.45, 0.25, 2.6]), (5, [0.90, 0.54, 11.6]), (7, [2.27, 1.1, 45.0])];
const ROUNDS: usize = 5;
const BUDGET: Duration = Duration::from_millis(100);

fn chain(masses: usize) -> Result<HeapQp<f64>, Failure> {
    let record = load(&format!("tests/data/ocp/qp_chain_{masses}.json"))?;
    let list = |key: &str| numbers(&record[key]);
    let size = |key: &str| record[key].as_u64().map(|n| n as usize).ok_or_else(|| format!("no number {key}"));
    let (n, nx) = (size("N")?, size("nx")?);
    let mut dims = vec![StageDims::new(nx, 3, 0); n + 1];
    dims[n].nu = 0;
    let mut qp = HeapQp::new(&dims)?;
    let (a, b, offset, q, r) = (list("A"), list("B"), list("b"), list("Q"), list("R"));
    let (gradient, wall, lower) = (list("q"), list("wall_index"), list("wall_lower"));
    for (k, mut stage) in qp.stages_mut().enumerate() {
        // The last element of a list repeats.
        let (second, last) = (k.min(1), k / n);
        stage.q_mut().fill_with(|i, j| q[(last * nx + i) * nx + j]);
        stage.gradient_x_mut().copy_from_slice(&gradient[second * nx..][..nx]);
        if k == n {
            break;
        }
        stage.a_mut().fill_with(|i, j| a[(second * nx + i) * nx + j]);
        stage.b_mut().fill_with(|i, j| b[(second * nx + i) * 3 + j]);
        stage.r_mut().fill_with(|i, j| r[i * 3 + j]);
        stage.offset_mut().copy_from_slice(&offset[second * nx..][..nx]);
        (0..3).for_each(|i| stage.u_bounds_mut().set(i, -1.0, 1.0));
        if k > 0 {
            for (&i, &lower) in wall.iter().zip(&lower) {
                stage.x_bounds_mut().set(i as usize, lower, f64::INFINITY);
            }
        }
    }
    qp.fix_initial_state(&list("x0"))?;
    Ok(qp)
}

/// A solver and its best median over the rounds: what others do on the machine only adds.
struct Entry {
    name: String,
    solver: Box<dyn QpSolver<f64>>,
    start: QpStart,
    solution: HeapSolution<f64>,
    best: f64,
    iterations: usize,
}

impl Entry {
    fn new(
        name: String,
        solver: Box<dyn QpSolver<f64>>,
        start: QpStart,
        qp: &HeapQp<f64>,
    ) -> Result<Self, QpError> {
        let solution = HeapSolution::new(qp.dims())?;
        let mut entry = Self { name, solver, start, solution, best: f64::INFINITY, iterations: 0 };
        entry.solver.solve(qp.view(), QpStart::Cold, entry.solution.view_mut())?;
        Ok(entry)
    }
    fn run(&mut self, qp: &HeapQp<f64>) -> Result<(), QpError> {
        let Self { solver, start, solution, iterations, .. } = self;
        let time: Summary = measure(BUDGET, || {
            *iterations = solver.solve(qp.view(), *start, solution.view_mut())?.iterations;
            Ok::<_, QpError>(())
        })?;
        self.best = self.best.min(time.median * 1e3);
        Ok(())
    }
}

fn main() -> Result<(), Failure> {
    println!("pinned: {}", pin_to_last_core());
    println!("| masses | solver | start | iterations | ms | reference ms |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (masses, [cold, warm, clarabel_there]) in REFERENCES {
        let qp = chain(masses)?;
        let mut entries = Vec::new();
        for start in [QpStart::Cold, QpStart::Warm] {
            entries.push(Entry::new(
                "interior point".into(),
                Box::new(HeapInteriorPoint::new()),
                start,
                &qp,
            )?);
            for block in [2, 4, 5] {
                let solver = Box::new(Condensing::new(block, HeapInteriorPoint::new()));
                entries.push(Entry::new(format!("condensed in blocks of {block}"), solver, start, &qp)?);
            }
        }
        let mut clarabel = Clarabel::new();
        let settings = &mut clarabel.settings;
        (settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas) = (1e-8, 1e-8, 1e-8);
        entries.push(Entry::new("clarabel".into(), Box::new(clarabel), QpStart::Cold, &qp)?);
        for _ in 0..ROUNDS {
            for entry in &mut entries {
                entry.run(&qp)?;
            }
        }
        for Entry { name, start, iterations, best, .. } in &entries {
            let reference = match (name.as_str(), start) {
                ("clarabel", _) => clarabel_there,
                (_, QpStart::Cold) => cold,
                (_, QpStart::Warm) => warm,
            };
            println!("| {masses} | {name} | {start:?} | {iterations} | {best:.3} | {reference} |");
        }
    }
    Ok(())
}
