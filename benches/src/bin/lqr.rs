//! The 128 control-bounded LQRs of "Differentiable nonlinear model predictive control" (J. Frey et
//! al., arXiv 2505.01353, table 1), one after the other on one thread: iterations and CPU time.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --bin lqr            times
//! valgrind --tool=callgrind target/release/lqr 1 2                            |u| ≤ 1, twice: instructions
//! ```

use casados::qp::{HeapInteriorPoint, HeapQp, HeapSolution, QpSolver, QpStart, StageDims};
use casados_benches::record::{load, numbers};
use casados_benches::time::pin;
use cpu_time::ThreadTime;

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
fn solve(most: f64, rounds: usize) -> Result<(usize, usize, f64), Failure> {
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

fn main() -> Result<(), Failure> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    if let [most, rounds] = &arguments[..] {
        solve(most.parse()?, rounds.parse()?)?;
        return Ok(());
    }
    println!("pinned: {}", pin());
    println!("| controls | iterations | most | ms | µs an iteration |");
    println!("| --- | --- | --- | --- | --- |");
    for most in [1e4, 1.0] {
        let (sum, largest, best) = solve(most, 30)?;
        println!("| ±{most} | {sum} | {largest} | {best:.2} | {:.1} |", best * 1e3 / sum as f64);
    }
    Ok(())
}
