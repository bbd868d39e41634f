//! The 128 control-bounded LQRs of "Differentiable nonlinear model predictive control" (J. Frey et
//! al., arXiv 2505.01353, table 1): one after the other, and side by side in registers, in CPU time
//! of one thread; and side by side on all threads, in time on the clock.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --features parallel --bin lqr    times
//! valgrind --tool=callgrind target/release/lqr 1 2        |u| ≤ 1, twice: instructions; TOGETHER=1: side by side
//! ```

use casados::qp::{
    BatchInteriorPoint, HeapInteriorPoint, HeapQp, HeapSolution, QpInstance, QpSolver, QpStart, StageDims,
};
use casados_benches::record::{load, numbers};
use cpu_time::ThreadTime;
use std::time::Instant;

type Failure = Box<dyn std::error::Error>;

/// The problems, with controls between `±most`.
fn problems(most: f64) -> Result<Vec<HeapQp<f64>>, Failure> {
    let record = load("tests/data/ocp/lqr.json")?;
    let list = |key: &str| numbers(&record[key]);
    let (a, b, offset, x0) = (list("A"), list("B"), list("b"), list("x0"));
    let (n, nx, nu) = (20, offset.len(), b.len() / offset.len());
    let mut dims = vec![StageDims::new(nx, nu, 0); n + 1];
    dims[n].nu = 0;
    let mut problems = Vec::new();
    for x0 in x0.chunks_exact(nx) {
        let mut qp = HeapQp::new(&dims)?;
        for (k, mut stage) in qp.stages_mut().enumerate() {
            stage.q_mut().set_diagonal(vec![1.0; nx]);
            if k == n {
                break;
            }
            stage.a_mut().fill_with(|i, j| a[i * nx + j]);
            stage.b_mut().fill_with(|i, j| b[i * nu + j]);
            stage.r_mut().set_diagonal(vec![1.0; nu]);
            stage.offset_mut().copy_from_slice(&offset);
            (0..nu).for_each(|i| stage.u_bounds_mut().set(i, -most, most));
        }
        qp.fix_initial_state(x0)?;
        problems.push(qp);
    }
    Ok(problems)
}

/// Solves all, so many times: iterations of all, the most of one, and the least milliseconds.
fn solve_one_by_one(most: f64, rounds: usize) -> Result<(usize, usize, f64), Failure> {
    let problems = problems(most)?;
    let mut solver = HeapInteriorPoint::new();
    let mut solution = HeapSolution::new(problems[0].dims())?;
    let (mut sum, mut largest, mut best) = (0, 0, f64::INFINITY);
    for _ in 0..rounds {
        (sum, largest) = (0, 0);
        let begin = ThreadTime::now();
        for qp in &problems {
            let statistics = solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
            sum += statistics.iterations;
            largest = largest.max(statistics.iterations);
        }
        best = best.min(begin.elapsed().as_secs_f64() * 1e3);
    }
    Ok((sum, largest, best))
}

/// The same side by side: iterations of all, the most of one, and the least milliseconds of CPU
/// time of one thread, and on the clock with all threads.
fn solve_side_by_side(most: f64, rounds: usize) -> Result<(usize, usize, [f64; 2]), Failure> {
    let mut instances = Vec::new();
    for qp in problems(most)? {
        let solution = HeapSolution::new(qp.dims())?;
        instances.push(QpInstance { qp, solution });
    }
    let mut best = [f64::INFINITY; 2];
    let (mut sum, mut largest) = (0, 0);
    for (threads, best) in [1, usize::MAX].into_iter().zip(&mut best) {
        let mut batch = BatchInteriorPoint::new();
        batch.threads = threads;
        for _ in 0..rounds {
            let (cpu, clock) = (ThreadTime::now(), Instant::now());
            let statuses = batch.solve(&mut instances, QpStart::Cold)?;
            let passed = if threads == 1 { cpu.elapsed() } else { clock.elapsed() };
            *best = best.min(passed.as_secs_f64() * 1e3);
            let iterations = || statuses.iter().flatten().map(|statistics| statistics.iterations);
            (sum, largest) = (iterations().sum(), iterations().max().unwrap_or(0));
        }
    }
    Ok((sum, largest, best))
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    if let [most, rounds] = &arguments[..] {
        if std::env::var_os("TOGETHER").is_some() {
            solve_side_by_side(most.parse()?, rounds.parse()?)?;
        } else {
            solve_one_by_one(most.parse()?, rounds.parse()?)?;
        }
        return Ok(());
    }
    println!("| 128 LQRs | iterations | most | ms | µs an iteration |");
    println!("| --- | --- | --- | --- | --- |");
    for most in [1e4, 1.0] {
        let (sum, largest, best) = solve_one_by_one(most, 30)?;
        println!("| ±{most}, alone | {sum} | {largest} | {best:.2} | {:.1} |", best * 1e3 / sum as f64);
        let (sum, largest, [best, clock]) = solve_side_by_side(most, 60)?;
        println!("| ±{most}, together | {sum} | {largest} | {best:.2} | {:.1} |", best * 1e3 / sum as f64);
        println!("| ±{most}, together, all threads | {sum} | {largest} | {clock:.2} on the clock | |");
    }
    Ok(())
}
