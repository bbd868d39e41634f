"""The chain of masses by direct collocation with CasADi and IPOPT: for benches/src/bin/ocp.rs.

Reads one JSON object a line from standard input and answers each with one on standard output:

    {"masses": 3, "x_rest": [..], "x0": [..], "stages": 2, "steps": 2, "repetitions": 3}
    {"seconds": 0.1, "objective": 4.65, "iterations": 12} | {"error": ".."}

Models are SX graphs, one function of an interval that is mapped over the horizon; the linear solver is MUMPS. Times are the least
CPU seconds of a call, thirty at most; the start is the one of the others, x = x_rest and u = 0 everywhere.
"""

import json
import sys
import time

import casadi as ca
import numpy as np

N, TS = 40, 0.2


def chain(masses):
    free = masses - 2
    x, u = ca.SX.sym("x", 6 * free + 3), ca.SX.sym("u", 3)
    positions = [ca.SX.zeros(3)] + [x[3 * i : 3 * i + 3] for i in range(free + 1)]
    forces = []
    for before, here in zip(positions, positions[1:]):
        d = here - before
        forces.append((1.0 - 0.033 / ca.norm_2(d)) / 0.033 * d)
    velocities = x[3 * (free + 1) :]
    accelerations = [b - a - ca.vertcat(0, 0, 9.81) for a, b in zip(forces, forces[1:])]
    return ca.Function("f", [x, u], [ca.vertcat(velocities, u, *accelerations)])


def coefficients(stages):
    """Derivatives at the points of Gauss, and the value at the end, of the Lagrange polynomials through start and points."""
    points = [0.0] + ca.collocation_points(stages, "legendre")
    derivatives, end = np.zeros((stages + 1, stages + 1)), np.zeros(stages + 1)
    for j, here in enumerate(points):
        polynomial = np.poly1d([1.0])
        for other in points[:j] + points[j + 1 :]:
            polynomial *= np.poly1d([1.0, -other]) / (here - other)
        end[j] = polynomial(1.0)
        derivatives[j] = [np.polyder(polynomial)(point) for point in points]
    return derivatives, end


def solve(request):
    masses, stages, steps = request["masses"], request["stages"], request["steps"]
    f = chain(masses)
    nx = f.size1_in(0)
    x_rest, x0 = ca.DM(request["x_rest"]), ca.DM(request["x0"])
    derivatives, end = coefficients(stages)
    x, u = ca.SX.sym("x", nx), ca.SX.sym("u", 3)
    points = ca.SX.sym("k", nx, stages * steps)
    here, rows = x, []
    for step in range(steps):
        inner = [points[:, step * stages + j] for j in range(stages)]
        all_points = [here] + inner
        for j in range(1, stages + 1):
            slope = sum(derivatives[i, j] * all_points[i] for i in range(stages + 1))
            rows.append(slope - TS / steps * f(all_points[j], u))
        here = sum(end[i] * all_points[i] for i in range(stages + 1))
    interval = ca.Function("interval", [x, u, points], [ca.vertcat(*rows), here]).map(N)

    states, controls = ca.MX.sym("X", nx, N + 1), ca.MX.sym("U", 3, N)
    inner = ca.MX.sym("K", nx, N * stages * steps)
    residual, ends = interval(states[:, :-1], controls, inner)
    weights = np.full(nx, 2.0)
    weights[3 * (masses - 2) : 3 * (masses - 1)] = 2.0 * (masses - 1)
    deviation = states - ca.repmat(x_rest, 1, N + 1)
    squares = ca.DM(weights).T @ (deviation**2)
    factor = np.full(N + 1, 0.5 * TS)
    factor[-1] = 0.5
    objective = squares @ ca.DM(factor) + 0.5 * TS * 0.02 * ca.sumsqr(controls)

    lower, upper = np.full((nx, N + 1), -np.inf), np.full((nx, N + 1), np.inf)
    lower[1 : 3 * (masses - 1) : 3, 1:N] = -0.05
    lower[:, 0] = upper[:, 0] = np.array(x0).ravel()
    free = np.full(nx * N * stages * steps, np.inf)
    pack = lambda a, b, c: ca.vertcat(ca.vec(a), ca.vec(b), ca.vec(c))
    problem = {
        "x": pack(states, controls, inner),
        "f": objective,
        "g": ca.vertcat(ca.vec(residual), ca.vec(ends - states[:, 1:])),
    }
    options = {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-6, "ipopt.max_cpu_time": 30.0, "expand": True}
    # With MUMPS' own scaling steps are so inexact that only the smallest problem is solved; the order is by minimum degree.
    options.update({"ipopt.mumps_permuting_scaling": 0, "ipopt.mumps_scaling": 0, "ipopt.mumps_pivot_order": 0})
    solver = ca.nlpsol("solver", "ipopt", problem, options)
    arguments = {
        "x0": pack(ca.repmat(x_rest, 1, N + 1), ca.DM.zeros(3, N), ca.repmat(x_rest, 1, N * stages * steps)),
        "lbx": pack(ca.DM(lower), -ca.DM.ones(3, N), ca.DM(-free)),
        "ubx": pack(ca.DM(upper), ca.DM.ones(3, N), ca.DM(free)),
        "lbg": 0,
        "ubg": 0,
    }
    seconds = np.inf
    for _ in range(request["repetitions"]):
        begin = time.process_time()
        solution = solver(**arguments)
        seconds = min(seconds, time.process_time() - begin)
        if not solver.stats()["success"]:
            raise RuntimeError(solver.stats()["return_status"])
    return {
        "seconds": seconds,
        "objective": float(solution["f"]),
        "iterations": solver.stats()["iter_count"],
    }


for line in sys.stdin:
    try:
        answer = solve(json.loads(line))
    except Exception as error:  # noqa: BLE001: whatever it is, the other side is to know
        answer = {"error": str(error)}
    print(json.dumps(answer), flush=True)
