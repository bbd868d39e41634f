"""The chain of masses by acados' SQP: for benches/src/bin/ocp.rs.

    ACADOS_SOURCE_DIR=/an/installation python3 acados_ocp.py FOLDER

FOLDER is where the code that acados generates is kept and compiled. Reads one JSON object a line from standard input and answers
each with one on standard output:

    {"masses": 3, "x_rest": [..], "x0": [..], "stages": 2, "steps": 2, "seconds": 0.2}
    {"seconds": 0.003, "linear": 0.002, "objective": 4.65, "iterations": 6} | {"error": ".."}

Gauss-Newton, full steps, HPIPM in its mode for speed after partial condensing to five or ten blocks, whichever is faster; three
iterations of the integrator's Newton's method with a Jacobian that is kept. All from x = x_rest, u = 0 everywhere. Times: the
median CPU seconds of a call of acados' C function with its clock silenced, and of them the part that linearisation has in other
calls by that clock, which knows no CPU time.
"""

import ctypes
import os
import time

import casadi as ca
import numpy as np

import models
from acados_common import answer_all

N, TS = 40, 0.2


def problem(request, blocks, folder):
    from acados_template import ACADOS_INFTY, AcadosOcp, AcadosOcpSolver

    masses, stages, steps = request["masses"], request["stages"], request["steps"]
    nx = 6 * (masses - 2) + 3
    ocp = AcadosOcp()
    ocp.name = ocp.model.name = f"ocp_chain_{masses}_s{stages}n{steps}_b{blocks}"
    x, u, f = models.chain(nx)
    ocp.model.x, ocp.model.u, ocp.model.xdot = x, u, ca.SX.sym("xd", nx)
    ocp.model.f_expl_expr, ocp.model.f_impl_expr = f, ocp.model.xdot - f

    weights = np.full(nx, 2.0)
    weights[3 * (masses - 2) : 3 * (masses - 1)] = 2.0 * (masses - 1)
    ocp.cost.cost_type = ocp.cost.cost_type_e = "LINEAR_LS"
    ocp.cost.W, ocp.cost.W_e = np.diag(np.append(weights, [0.02] * 3)), np.diag(weights)
    ocp.cost.Vx, ocp.cost.Vx_e = np.eye(nx + 3, nx), np.eye(nx)
    ocp.cost.Vu = np.vstack([np.zeros((nx, 3)), np.eye(3)])
    ocp.cost.yref, ocp.cost.yref_e = np.array(request["x_rest"] + [0.0] * 3), np.array(request["x_rest"])

    walls = np.arange(1, 3 * (masses - 1), 3)
    ocp.constraints.x0 = np.array(request["x0"])
    ocp.constraints.idxbu, ocp.constraints.lbu, ocp.constraints.ubu = np.arange(3), -np.ones(3), np.ones(3)
    ocp.constraints.idxbx = walls
    ocp.constraints.lbx, ocp.constraints.ubx = np.full(len(walls), -0.05), np.full(len(walls), ACADOS_INFTY)

    options = ocp.solver_options
    options.N_horizon, options.tf = N, N * TS
    options.integrator_type, options.collocation_type = "IRK", "GAUSS_LEGENDRE"
    options.sim_method_num_stages, options.sim_method_num_steps = stages, steps
    options.sim_method_newton_iter, options.sim_method_jac_reuse = 3, True
    options.nlp_solver_type, options.hessian_approx = "SQP", "GAUSS_NEWTON"
    options.qp_solver, options.hpipm_mode = "PARTIAL_CONDENSING_HPIPM", "SPEED"
    options.qp_solver_cond_N = blocks
    options.tol = 1e-6
    ocp.code_gen_options.code_export_directory = os.path.join(folder, ocp.model.name)
    # Without this a compilation that was broken off would never be taken up again.
    new = not os.path.exists(os.path.join(folder, ocp.name, f"libacados_ocp_solver_{ocp.name}.so"))
    solver = AcadosOcpSolver(ocp, generate=new, build=new, verbose=False)
    return solver, getattr(solver.shared_lib, ocp.name + "_acados_solve")


def solve(driver, solver, function, request, seconds):
    clock = ctypes.c_int.in_dll(driver, "driver_clock")
    x_rest, none = np.array(request["x_rest"]), np.zeros(3)
    whole, parts = [], []
    begin = time.perf_counter()
    while len(whole) < 5 or time.perf_counter() - begin < seconds:
        for clock.value in (0, 1):
            solver.reset()
            for k in range(N + 1):
                solver.set(k, "x", x_rest)
            for k in range(N):
                solver.set(k, "u", none)
            start = time.thread_time_ns()
            status = function(solver.capsule)
            spent = 1e-9 * (time.thread_time_ns() - start)
            if status:
                raise RuntimeError(f"acados ends with status {status}")
            if clock.value:
                parts.append(float(solver.get_stats("time_lin") / solver.get_stats("time_tot")))
            else:
                whole.append(spent)
    seconds = float(np.median(whole))
    return {
        "seconds": seconds,
        "linear": seconds * float(np.median(parts)),
        "objective": float(solver.get_cost()),
        "iterations": int(solver.get_stats("sqp_iter")),
    }


# What was built for earlier requests.
cache = {}


def serve(request, driver, folder):
    key = (request["masses"], request["stages"], request["steps"])
    if key not in cache:
        all = [problem(request, blocks, folder) for blocks in (5, 10)]
        cache[key] = min(all, key=lambda pair: solve(driver, *pair, request, 0.05)["seconds"])
    return solve(driver, *cache[key], request, request["seconds"])


answer_all(serve)
