"""The orbit and the chain of masses from given starts, by direct collocation with CasADi and IPOPT:
for benches/src/bin/interior_point.rs.

Reads one JSON object a line from standard input and answers each with one on standard output:

    {"problem": "orbit", "h": 0.33, "x": [[..]; 41], "u": [[..]; 40], "iterations": 200, "repetitions": 1}
    {"problem": "chain", "masses": 3, "x_rest": [..], "x0": [..], "x": .., "u": ..}
    {"status": "Solve_Succeeded", "objective": -3.26, "iterations": 15, "seconds": 4.7} | {"error": ".."}

Variables are states, controls, and `(x', z)` at the stages of each interval, which begin between the
states of the start. The linear solver is MUMPS, tolerances are 1e-8, all else is IPOPT's default.
"""

import json
import sys
import time

import casadi as ca
import numpy as np
from models import awe
from models import chain as chain_model

N, DEGREE, inf = 40, np.pi / 180, np.inf
RENAMED = {"Solve_Succeeded": "solved", "Solved_To_Acceptable_Level": "acceptable"}


def tableau(stages, scheme):
    """A, b and the values at the start of the Lagrange polynomials through the nodes."""
    c = ca.collocation_points(stages, scheme)
    A, b, start = np.zeros((stages, stages)), np.zeros(stages), np.zeros(stages)
    for j, here in enumerate(c):
        polynomial = np.poly1d([1.0])
        for other in c[:j] + c[j + 1 :]:
            polynomial *= np.poly1d([1.0, -other]) / (here - other)
        integral = polynomial.integ()
        A[:, j] = [integral(node) for node in c]
        b[j], start[j] = integral(1.0), polynomial(0.0)
    return A, b, start


def interval(f, nx, nz, nu, h, stages, steps, scheme):
    """Residuals of stages, the end, and algebraic states at the start; one column of `y` a stage."""
    A, b, start = tableau(stages, scheme)
    x, u, y = ca.SX.sym("x", nx), ca.SX.sym("u", nu), ca.SX.sym("y", nx + nz, stages * steps)
    h, here, rows = h / steps, x, []
    for step in range(steps):
        k = y[:nx, step * stages : (step + 1) * stages]
        z = y[nx:, step * stages : (step + 1) * stages]
        for i in range(stages):
            rows.append(f(k[:, i], here + h * ca.mtimes(k, ca.DM(A[i])), u, z[:, i]))
        here = here + h * ca.mtimes(k, ca.DM(b))
    z0 = ca.mtimes(y[nx:, :stages], ca.DM(start))
    return ca.Function("interval", [x, u, y], [ca.vertcat(*rows), here, z0])


def limits():
    """The nonlinear path constraints of examples/awe_orbit, in other words."""
    x, z = ca.SX.sym("x", 23), ca.SX.sym("z", 1)
    q, R = x[0:3], ca.reshape(x[9:18], 3, 3)
    wind = 10.0 * (ca.sqrt(x[2] ** 2 + 1) / 100.0) ** 0.15
    air = ca.vertcat(wind, 0, 0) - x[3:6]
    body, speed = ca.mtimes(R.T, air), ca.norm_2(air)
    tension, unit = 12.499305032751677 * 434.287 * z, 41.23105625617661
    return ca.Function("limits", [x, z], [ca.vertcat(
        (1800 - tension) / 1800,
        (tension - 50) / 50,
        1 - speed / 32,
        speed / 10 - 1,
        (9 * DEGREE * body[0] - body[2]) / unit / (9 * DEGREE),
        (body[2] + 6 * DEGREE * body[0]) / unit / (6 * DEGREE),
        (20 * DEGREE * body[0] - body[1]) / unit / (20 * DEGREE),
        (body[1] + 20 * DEGREE * body[0]) / unit / (20 * DEGREE),
        (ca.dot(q, R[:, 2]) - np.cos(40 * DEGREE) * ca.norm_2(q)) / 500,
    )])


def orbit(request):
    xd, x, u, z, residual = awe()
    f = ca.Function("f", [xd, x, u, z], [residual])
    phi = interval(f, 23, 1, 4, request["h"], 4, 1, "radau").map(N)
    X, U, Y = ca.MX.sym("X", 23, N + 1), ca.MX.sym("U", 4, N), ca.MX.sym("Y", 24, 4 * N)
    stages, ends, z0 = phi(X[:, :-1], U, Y)
    paths = limits().map(N)(X[:, :-1], z0)
    lower, upper = np.full((23, N + 1), -inf), np.full((23, N + 1), inf)
    lower[2, :N] = 100
    lower[6:9, :N], upper[6:9, :N] = -50 * DEGREE, 50 * DEGREE
    for i, most in enumerate((20, 30, 30)):
        lower[18 + i, :N], upper[18 + i, :N] = -most * DEGREE, most * DEGREE
    lower[[22, 4], 0] = upper[[22, 4], 0] = 0
    most = np.tile(np.array([[2.0], [2.0], [2.0], [100.0]]), (1, N))
    zero = ca.vertcat(ca.vec(stages), ca.vec(ends - X[:, 1:]), X[:22, 0] - X[:22, N])
    return (X, U, Y), X[22, N], zero, ca.vec(paths), (lower, upper), (-most, most)


def chain(request):
    masses = request["masses"]
    nx = 6 * (masses - 2) + 3
    x, u, rate = chain_model(nx)
    rate = ca.Function("rate", [x, u], [rate])
    f = lambda xd, x, u, z: xd - rate(x, u)
    phi = interval(f, nx, 0, 3, 0.2, 2, 2, "legendre").map(N)
    X, U, Y = ca.MX.sym("X", nx, N + 1), ca.MX.sym("U", 3, N), ca.MX.sym("Y", nx, 4 * N)
    stages, ends, _ = phi(X[:, :-1], U, Y)
    weights = np.full(nx, 2.0)
    weights[3 * (masses - 2) : 3 * (masses - 1)] = 2.0 * (masses - 1)
    squares = ca.DM(weights).T @ (X - ca.repmat(ca.DM(request["x_rest"]), 1, N + 1)) ** 2
    factor = np.full(N + 1, 0.1)
    factor[-1] = 0.5
    objective = squares @ ca.DM(factor) + 0.1 * 0.02 * ca.sumsqr(U)
    lower, upper = np.full((nx, N + 1), -inf), np.full((nx, N + 1), inf)
    lower[1 : 3 * (masses - 1) : 3, 1:N] = -0.05
    lower[:, 0] = upper[:, 0] = request["x0"]
    zero = ca.vertcat(ca.vec(stages), ca.vec(ends - X[:, 1:]))
    return (X, U, Y), objective, zero, ca.MX(0, 1), (lower, upper), (-np.ones((3, N)), np.ones((3, N)))


pack = lambda parts: ca.vertcat(*[ca.vec(ca.MX(part) if isinstance(part, ca.MX) else ca.DM(part)) for part in parts])
solvers = {}


def solver(request):
    """One for each problem: it is the start that is another."""
    key = (request["problem"], request.get("masses"))
    if key not in solvers:
        (X, U, Y), objective, zero, paths, (xl, xu), (ul, uu) = {"orbit": orbit, "chain": chain}[key[0]](request)
        problem = {"x": pack((X, U, Y)), "f": objective, "g": ca.vertcat(zero, paths)}
        options = {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-8, "expand": True,
                   "ipopt.max_iter": request["iterations"], "ipopt.max_cpu_time": 120.0}
        free = np.full(Y.shape, inf)
        bounds = {"lbx": pack((xl, ul, -free)), "ubx": pack((xu, uu, free)), "lbg": 0,
                  "ubg": ca.vertcat(ca.DM.zeros(zero.numel()), ca.DM(np.full(paths.numel(), inf)))}
        solvers[key] = ca.nlpsol("solver", "ipopt", problem, options), bounds, Y.shape
    return solvers[key]


def solve(request):
    nlp, bounds, (ny, columns) = solver(request)
    x, u = np.array(request["x"]).T, np.array(request["u"]).T
    y = np.zeros((ny, columns))
    h = request.get("h", 0.2)
    y[: x.shape[0]] = np.repeat((x[:, 1:] - x[:, :-1]) / h, columns // N, axis=1)
    seconds = inf
    for _ in range(request.get("repetitions", 1)):
        begin = time.process_time()
        solution = nlp(x0=pack((x, u, y)), **bounds)
        seconds = min(seconds, time.process_time() - begin)
    stats = nlp.stats()
    status = stats["return_status"]
    return {"status": RENAMED.get(status, status), "seconds": seconds, "objective": float(solution["f"]),
            "iterations": stats["iter_count"]}


for line in sys.stdin:
    try:
        answer = solve(json.loads(line))
    except Exception as error:  # noqa: BLE001: whatever it is, the other side is to know
        answer = {"error": str(error)}
    print(json.dumps(answer), flush=True)
