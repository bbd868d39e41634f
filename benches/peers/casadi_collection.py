"""IPOPT on the problems of ocps.py: for benches/src/bin/ocp_collection, and the references of
tests/collection.rs.

Reads one JSON object a line from standard input and answers each with one on standard output:

    {"problem": "car", "grid": {"intervals": 1.0, "length": 1.0}, "bounds": 1.0, "x": [[..], ..], "u": [[..], ..]}
    {"status": "Solve_Succeeded", "iterations": 15, "objective": 8.04} | {"error": ".."}

where `grid` is what the horizon is multiplied by, `bounds` are those of controls, `x` and `u` the guess.

With the argument --write it writes tests/data/ocp/collection.json instead: objectives of all
minima that it finds at a tolerance of 1e-10 with bounds that are not relaxed, from the plain guess,
from some that are disturbed, and from points of tests/data/ocp/starts.json, which it stays near.
"""

import json
import pathlib
import sys

import casadi as ca
import numpy as np

import ocps

# Guesses, of which the first one is plain; how much the others are disturbed, of what states move.
GUESSES, DISTURBANCE = 12, 0.1
# A barrier so small that IPOPT does not leave a point for the middle between bounds.
STAY = {"ipopt.mu_init": 1e-10}
STAY |= {f"ipopt.{kind}_{by}": 1e-12 for kind in ["bound", "slack_bound"] for by in ["push", "frac"]}
# Minima are different ones from here on.
APART = 1e-6


def solve(o, x, options={}):
    n = o.n
    xs, us = ca.MX.sym("X", o.nx, n + 1), ca.MX.sym("U", o.nu, n)
    f = ca.sum2(o.cost.map(n)(xs[:, :-1], us)) + o.end(xs[:, -1])
    g = ca.vec(o.path.map(n)(xs[:, :-1], us)) if o.path.size1_out(0) else ca.MX(0, 1)
    v, guess = [ca.vec(xs), ca.vec(us)], [x.ravel(), o.u.ravel()]
    lower, upper = [o.x_lower.ravel(), o.u_lower.ravel()], [o.x_upper.ravel(), o.u_upper.ravel()]
    rows = g.numel()
    if o.soft is not None:
        slack = ca.MX.sym("s", rows)
        v, f, g = v + [slack], f + o.soft * ca.sum1(slack), g + slack
        guess, lower, upper = guess + [np.zeros(rows)], lower + [np.zeros(rows)], upper + [np.full(rows, np.inf)]
    gaps = ca.vec(o.phi.map(n)(xs[:, :-1], us) - xs[:, 1:])
    ends = np.zeros(gaps.numel())
    problem = {"x": ca.vertcat(*v), "f": f, "g": ca.vertcat(gaps, g)}
    quiet = {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-6, "ipopt.max_iter": 1000}
    solver = ca.nlpsol("solver", "ipopt", problem, {**quiet, **options})
    solution = solver(
        x0=np.concatenate(guess), lbx=np.concatenate(lower), ubx=np.concatenate(upper),
        lbg=np.concatenate([ends, np.full(rows, o.g_lower)]), ubg=np.concatenate([ends, np.full(rows, o.g_upper)]),
    )
    stats = solver.stats()
    return {"status": stats["return_status"], "iterations": stats["iter_count"], "objective": float(solution["f"])}


def minima(o, points):
    random = np.random.default_rng(31)
    exact = {"ipopt.tol": 1e-10, "ipopt.bound_relax_factor": 0.0}
    found = []
    for guess in range(GUESSES):
        moved = np.abs(o.x[0] - o.x[-1]) + 0.1
        noise = DISTURBANCE * moved * random.standard_normal(o.x.shape) if guess else 0.0
        answer = solve(o, o.x + noise, exact)
        objective = answer["objective"]
        if answer["status"] == "Solve_Succeeded" and all(abs(objective - f) > APART * (1 + abs(f)) for f in found):
            found.append(objective)
    for point in points:
        o.u = np.array(point["u"])
        answer = solve(o, np.array(point["x"]), {**exact, **STAY})
        if answer["status"] == "Solve_Succeeded":
            found.append(answer["objective"])
    return sorted(found)


def write():
    data = {
        "source": f"IPOPT through CasADi {ca.__version__}, benches/peers/casadi_collection.py --write",
        "problems": {},
    }
    folder = pathlib.Path(__file__).parents[2] / "tests/data/ocp"
    starts = json.loads((folder / "starts.json").read_text())
    for make in ocps.ALL:
        o = make()
        answer = solve(o, o.x)
        data["problems"][make.__name__] = {"iterations": answer["iterations"], "minima": minima(o, starts.get(make.__name__, []))}
        print(make.__name__, data["problems"][make.__name__], flush=True)
    (folder / "collection.json").write_text(json.dumps(data, indent=1) + "\n")


def serve():
    known = {make.__name__: make for make in ocps.ALL + ocps.INFEASIBLE}
    for request in sys.stdin:
        try:
            request = json.loads(request)
            ocps.GRID.update(request["grid"])
            o = known[request["problem"]]()
            o.u = np.array(request["u"])
            o.u_lower, o.u_upper = request["bounds"] * o.u_lower, request["bounds"] * o.u_upper
            answer = solve(o, np.array(request["x"]))
        except Exception as error:  # noqa: BLE001: whatever it is, the other side is to know
            answer = {"error": str(error)}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    write() if "--write" in sys.argv else serve()
