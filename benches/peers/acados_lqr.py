"""acados' batch solver on the 128 control-bounded LQRs of `src/bin/lqr.rs`.

    python3 benches/peers/acados_lqr.py THREADS

The data are those of `tests/data/ocp/lqr.json`. The cost is linear least squares and the dynamics
are discrete, one SQP iteration with HPIPM (tolerance 1e-8, as in `lqr.rs`), which solves an LQR.
Prints the least milliseconds of a hundred rounds: setting all initial states and solving, on the
clock and in CPU time of all threads; and the largest residual. Code is generated in the working
folder.
"""

import json
import sys
import time
from pathlib import Path

import casadi
import numpy as np
from acados_template import AcadosOcp, AcadosOcpBatchSolver

DATA = Path(__file__).resolve().parents[2] / "tests" / "data" / "ocp" / "lqr.json"
INTERVALS, ROUNDS = 20, 100


def numbers(values):
    """A list of numbers, whatever it is nested in."""
    return np.array(values, dtype=float).ravel()


def problem(data, most):
    offset = numbers(data["b"])
    nx = offset.size
    a = numbers(data["A"]).reshape(nx, nx)
    b = numbers(data["B"]).reshape(nx, -1)
    nu = b.shape[1]
    ocp = AcadosOcp()
    ocp.model.name = f"lqr_{most:g}".replace("+", "")
    ocp.model.x, ocp.model.u = casadi.SX.sym("x", nx), casadi.SX.sym("u", nu)
    ocp.model.disc_dyn_expr = a @ ocp.model.x + b @ ocp.model.u + offset
    ocp.cost.cost_type = ocp.cost.cost_type_e = "LINEAR_LS"
    ocp.cost.Vx = np.vstack([np.eye(nx), np.zeros((nu, nx))])
    ocp.cost.Vu = np.vstack([np.zeros((nx, nu)), np.eye(nu)])
    ocp.cost.W, ocp.cost.yref = np.eye(nx + nu), np.zeros(nx + nu)
    ocp.cost.Vx_e, ocp.cost.W_e, ocp.cost.yref_e = np.eye(nx), np.eye(nx), np.zeros(nx)
    ocp.constraints.x0 = np.zeros(nx)
    ocp.constraints.idxbu = np.arange(nu)
    ocp.constraints.lbu, ocp.constraints.ubu = -most * np.ones(nu), most * np.ones(nu)
    options = ocp.solver_options
    options.N_horizon, options.tf, options.integrator_type = INTERVALS, INTERVALS, "DISCRETE"
    options.qp_solver, options.nlp_solver_type = "PARTIAL_CONDENSING_HPIPM", "SQP"
    options.nlp_solver_max_iter, options.tol = 1, 1e-8
    options.with_batch_functionality = True
    return ocp


def main():
    threads = int(sys.argv[1])
    data = json.loads(DATA.read_text())
    for most in [1e4, 1.0]:
        ocp = problem(data, most)
        x0 = numbers(data["x0"]).reshape(-1, ocp.model.x.rows())
        batch = AcadosOcpBatchSolver(ocp, len(x0), num_threads_in_batch_solve=threads, verbose=False)
        clock, cpu = np.inf, np.inf
        for _ in range(ROUNDS):
            for solver in batch.ocp_solvers:
                solver.reset()
            begin, cpu_begin = time.perf_counter(), time.process_time()
            for solver, state in zip(batch.ocp_solvers, x0):
                solver.set(0, "lbx", state)
                solver.set(0, "ubx", state)
            batch.solve()
            clock = min(clock, time.perf_counter() - begin)
            cpu = min(cpu, time.process_time() - cpu_begin)
        solvers = batch.ocp_solvers
        residual = max(np.max(s.get_residuals(recompute=True)) for s in solvers)
        iterations = sum(int(np.sum(s.get_stats("qp_iter"))) for s in solvers)
        print(
            f"| ±{most:g}, acados, {threads} threads | {iterations} | {1e3 * clock:.2f} on the clock"
            f" | {1e3 * cpu:.2f} CPU | {residual:.1e} |"
        )


if __name__ == "__main__":
    main()
