"""Figures 1 and 2: the chain of masses, by all integrators and solvers."""

import ctypes
import json
import os
import subprocess
import sys

import callbacks
import casadi as ca
import numpy as np
from common import FOLDER, ROOT, Ipopt, data, environment, expression, library, own, race, whole
from models import chain

N, TS, TOLERANCE = 40, 0.2, 1e-6
SETTINGS = {"s2n1": (2, 1), "s4n4": (4, 4)}
# Where derivatives of adaptive methods are so slow that three iterations have to do.
FEW = 3
# What needs no library of casados.
PEERS = ["CasADi collocation", "acados, call-backs", "acados SQP, Gauss-Newton"]


class Problem:
    """The multiple shooting of one size, with the end of an interval as a function."""

    def __init__(self, masses):
        self.masses, self.record = masses, data(f"ocp/chain_{masses}.json")
        self.rest, self.x0 = np.array(self.record["xrest"]), np.array(self.record["x0"])
        self.nx = len(self.rest)
        x, u, f = chain(self.nx)
        self.dae = {"x": x, "p": u, "ode": ca.cse(f)}
        self.f = ca.Function("f", [x, u], [ca.cse(f)])

    def objective(self, states, controls):
        weights = np.full(self.nx, 2.0)
        weights[3 * (self.masses - 2) : 3 * (self.masses - 1)] = 2.0 * (self.masses - 1)
        squares = ca.DM(weights).T @ ((states - ca.repmat(ca.DM(self.rest), 1, N + 1)) ** 2)
        factor = np.full(N + 1, 0.5 * TS)
        factor[-1] = 0.5
        return squares @ ca.DM(factor) + 0.5 * TS * 0.02 * ca.sumsqr(controls)

    def bounds(self, inner):
        """Bounds and start of states, controls and stages, in this order."""
        lower, upper = np.full((self.nx, N + 1), -np.inf), np.full((self.nx, N + 1), np.inf)
        lower[1 : 3 * (self.masses - 1) : 3, 1:N] = -0.05
        lower[:, 0] = upper[:, 0] = self.x0
        free = np.full(self.nx * inner, np.inf)
        flat = lambda a: a.ravel(order="F")
        return {
            "x0": np.concatenate([np.tile(self.rest, N + 1), np.zeros(3 * N), np.tile(self.rest, inner)]),
            "lbx": np.concatenate([flat(lower), -np.ones(3 * N), -free]),
            "ubx": np.concatenate([flat(upper), np.ones(3 * N), free]),
            "lbg": 0,
            "ubg": 0,
        }

    def shooting(self, ends, limit=None):
        """`ends` gives the ends of all intervals at their states and controls."""
        states, controls = ca.MX.sym("X", self.nx, N + 1), ca.MX.sym("U", 3, N)
        gaps = ends(states[:, :-1], controls) - states[:, 1:]
        nlp = {
            "x": ca.vertcat(ca.vec(states), ca.vec(controls)),
            "f": self.objective(states, controls),
            "g": ca.vec(gaps),
        }
        return Ipopt(nlp, self.bounds(0), TOLERANCE, limit)

    def collocation(self, stages, steps):
        derivatives, end = coefficients(stages)
        x, u = ca.SX.sym("x", self.nx), ca.SX.sym("u", 3)
        points = ca.SX.sym("k", self.nx, stages * steps)
        here, rows = x, []
        for step in range(steps):
            inner = [here] + [points[:, step * stages + j] for j in range(stages)]
            for j in range(1, stages + 1):
                slope = sum(derivatives[j, i] * inner[i] for i in range(stages + 1))
                rows.append(slope - TS / steps * self.f(inner[j], u))
            here = sum(end[i] * inner[i] for i in range(stages + 1))
        interval = ca.Function("interval", [x, u, points], [ca.vertcat(*rows), here]).map(N)
        states, controls = ca.MX.sym("X", self.nx, N + 1), ca.MX.sym("U", 3, N)
        inner = ca.MX.sym("K", self.nx, N * stages * steps)
        residual, ends = interval(states[:, :-1], controls, inner)
        nlp = {
            "x": ca.vertcat(ca.vec(states), ca.vec(controls), ca.vec(inner)),
            "f": self.objective(states, controls),
            "g": ca.vertcat(ca.vec(residual), ca.vec(ends - states[:, 1:])),
        }
        return Ipopt(nlp, self.bounds(N * stages * steps), TOLERANCE, expand=True)

    def integrator(self, plugin, **options):
        return ca.integrator("F", plugin, self.dae, 0, TS, options)


def coefficients(stages):
    """Derivatives at the points of Gauss (rows), and the value at the end, of the Lagrange
    polynomials through start and points."""
    points = [0.0] + ca.collocation_points(stages, "legendre")
    derivatives, end = np.zeros((stages + 1, stages + 1)), np.zeros(stages + 1)
    for i, here in enumerate(points):
        polynomial = np.poly1d([1.0])
        for other in points[:i] + points[i + 1 :]:
            polynomial *= np.poly1d([1.0, -other]) / (here - other)
        end[i] = polynomial(1.0)
        derivatives[:, i] = [np.polyder(polynomial)(point) for point in points]
    return derivatives, end


def one_by_one(function):
    """The ends of all intervals, each by a call of its own."""

    def ends(states, controls):
        pairs = zip(ca.horzsplit(states), ca.horzsplit(controls))
        return ca.horzcat(*[function(x, u) for x, u in pairs])

    return ends


def acados(problem, stages, steps):
    """acados' own SQP, where `ACADOS_SOURCE_DIR` says that it is installed."""
    request = {"masses": problem.masses, "x_rest": list(problem.rest), "x0": list(problem.x0)}
    request |= {"stages": stages, "steps": steps, "seconds": 1.0}
    script = ROOT / "benches" / "peers" / "acados_ocp.py"
    command = [sys.executable, str(script), str(FOLDER / "acados")]
    answer = subprocess.run(command, input=json.dumps(request) + "\n", capture_output=True, text=True, check=True)
    answer = json.loads(answer.stdout.splitlines()[-1])
    if "error" in answer:
        raise RuntimeError(answer["error"])
    keys = {"objective": "objective", "iterations": "iterations", "total": "seconds", "functions": "linear"}
    return {key: answer[name] for key, name in keys.items()} | {"complete": True}


def acados_callbacks(problem, stages, steps):
    """acados' integrator in IPOPT, with Python in between."""
    name = f"chain_{problem.masses}_s{stages}n{steps}_callback"
    engine = callbacks.Acados(name, chain(problem.nx), TS, stages, steps, str(FOLDER / "acados"))
    return problem.shooting(one_by_one(callbacks.integrator(engine, problem.nx, 3)))


def calls(masses, setting, count=20000):
    """The shortest times in nanoseconds of calls of Rust, exported ones, and ones that are known."""
    overhead, times = ctypes.CDLL(library(f"chain_{masses}_{setting}")).overhead, {}
    for mode, name in enumerate(["values", "Jacobian", "Hessian"]):
        to = (ctypes.c_double * 3)()
        if overhead(ctypes.c_int(mode), ctypes.c_uint(count), ctypes.byref(to)):
            raise RuntimeError(f"{name}: a call failed")
        times[f"{masses} masses, {setting}: {name}"] = list(to)
    return times


def runners(masses, setting):
    stages, steps = SETTINGS[setting]
    problem, path = Problem(masses), library(f"chain_{masses}_{setting}")
    external = lambda name: ca.external(name, path)
    horizon = lambda F: lambda x, u: F(x, u, ca.MX(0, N))
    single = lambda F: one_by_one(lambda x, u: F(x, u, ca.MX(0, 1)))
    theirs = lambda F: one_by_one(lambda x, u: F(x0=x, p=u)["xf"])
    collocation = problem.integrator(
        "collocation",
        number_of_finite_elements=steps,
        interpolation_order=stages,
        collocation_scheme="legendre",
    )
    adaptive = {"abstol": 1e-8, "reltol": 1e-8}
    few = FEW if masses > 3 else None
    makers = {
        "casados, whole problem": lambda: whole(path, TOLERANCE),
        "casados, horizon": lambda: problem.shooting(horizon(external("chains"))),
        "casados, intervals": lambda: problem.shooting(single(external("chain"))),
        "casados, call-backs": lambda: problem.shooting(
            one_by_one(callbacks.integrator(callbacks.Exported("chain", path), problem.nx, 3))
        ),
        "CasADi collocation": lambda: problem.shooting(theirs(collocation)),
        "direct collocation": lambda: problem.collocation(stages, steps),
        "casados SQP, exact": lambda: lambda: own(path, 0),
        "casados SQP, Gauss-Newton": lambda: lambda: own(path, 1),
        "casados interior point": lambda: lambda: own(path, 2),
    }
    if "ACADOS_SOURCE_DIR" in os.environ:
        makers["acados SQP, Gauss-Newton"] = lambda: lambda: acados(problem, stages, steps)
        makers["acados, call-backs"] = lambda: acados_callbacks(problem, stages, steps)
    if setting == "s2n1":
        # What has nothing to do with stages and steps of the implicit method.
        rk = lambda: problem.integrator("rk", number_of_finite_elements=4)
        makers |= {
            "casados RK4, whole problem": lambda: expression(path, "explicit", TOLERANCE),
            "casados RK4": lambda: problem.shooting(single(external("chain_rk4"))),
            "CasADi RK4": lambda: problem.shooting(theirs(rk())),
            "CasADi CVODES": lambda: problem.shooting(theirs(problem.integrator("cvodes", **adaptive)), few),
            "CasADi IDAS": lambda: problem.shooting(theirs(problem.integrator("idas", **adaptive)), few),
        }
    return problem, makers


def run(masses, setting, rounds, seconds, leave_out=()):
    """Medians of all that take part."""
    problem, makers = runners(masses, setting)
    print(f"chain of {masses} masses, {setting}")
    with environment([*problem.rest, *problem.x0]):
        return race({name: make for name, make in makers.items() if name not in leave_out}, rounds, seconds)


def peers(masses, setting, rounds, seconds):
    """Medians of acados, and of CasADi's integrator as the common yardstick: without a library."""
    makers = runners(masses, setting)[1]
    print(f"peers: chain of {masses} masses, {setting}")
    return race({name: makers[name] for name in PEERS if name in makers}, rounds, seconds)
