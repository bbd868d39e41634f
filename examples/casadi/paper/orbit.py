"""Tables 1 to 3: the power-optimal orbit of an aircraft on a tether, and its intervals."""

import statistics
import time

import casadi as ca
import numpy as np
from common import Ipopt, data, environment, library, own, race, whole
from models import awe

N, T, NX, NU = 40, 0.3364093944964951, 23, 4
TOLERANCE = 1e-8
DEGREE = np.pi / 180


def limits():
    """The path constraints, all at least zero: nine nonlinear ones, and bounds as constraints.

    The tension is that of the algebraic state at the node, which solves the balance of forces
    together with the constraint of the tether."""
    xd, x, u, z, f = awe()
    force = ca.substitute(ca.vertcat(f[0:3], f[22]), xd[0:3], x[3:6])
    known = ca.substitute(force, ca.vertcat(xd[3:6], z), ca.DM.zeros(4))
    inverse = ca.inv_minor(ca.jacobian(force[0:3], xd[3:6]))
    along = ca.jacobian(force[3], xd[3:6]) @ inverse
    tether = (known[3] - along @ known[0:3]) / (along @ ca.jacobian(force[0:3], z))
    tension = 12.499305032751677 * tether * 434.287
    q, dq, R = x[0:3], x[3:6], ca.reshape(x[9:18], 3, 3)
    air = ca.vertcat(10.0 * (ca.sqrt(q[2] * q[2] + 1) / 100.0) ** 0.15, 0, 0) - dq
    chord, span, up = ca.vertsplit(ca.mtimes(R.T, air))
    speed, scale = ca.norm_2(air), 41.23105625617661
    h = [(1800 - tension) / 1800, (tension - 50) / 50, 1 - speed / 32, speed / 10 - 1]
    h += [(9 * DEGREE * chord - up) / scale / (9 * DEGREE), (up + 6 * DEGREE * chord) / scale / (6 * DEGREE)]
    h += [(20 * DEGREE * chord - span) / scale / (20 * DEGREE), (span + 20 * DEGREE * chord) / scale / (20 * DEGREE)]
    h += [(ca.dot(q, R[:, 2]) - np.cos(40 * DEGREE) * ca.norm_2(q)) / 500, q[2] - 100]
    most = [50 * DEGREE] * 3 + [20 * DEGREE, 30 * DEGREE, 30 * DEGREE] + [2, 2, 2, 100]
    for value, bound in zip([x[6], x[7], x[8], x[18], x[19], x[20], u[0], u[1], u[2], u[3]], most):
        h += [bound - value, value + bound]
    return ca.Function("limits", [x, u], [ca.cse(ca.vertcat(*h))])


class Orbit:
    """All 22 physical states are periodic; the last one accumulates the cost."""

    def __init__(self):
        record = data("awe/orbit.json")
        pad = lambda x: np.resize(np.append(x, 0.0), NX) if len(x) < NX else np.array(x)
        self.guess = [[pad(x) for x in record["guess_dc"]["x"]], record["guess_dc"]["u"]]
        self.limits = limits()

    def numbers(self):
        return [number for x, u in zip(*self.guess) for number in [*x, *u]]

    def start(self):
        x, u = self.guess
        return np.concatenate([np.array(x).ravel(), np.array(u).ravel()])

    def variables(self):
        states, controls = ca.MX.sym("X", NX, N), ca.MX.sym("U", NU, N)
        # What the last interval leads to, and nothing accumulated where the first one begins.
        begins = ca.horzcat(ca.vertcat(states[:22, 0], 0), states[:, 1:])
        ends = ca.horzcat(states[:, 1:], states[:, 0])
        return states, controls, begins, ends

    def arguments(self, n, gaps, start):
        lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
        lower[4] = upper[4] = 0.0
        lbg = np.zeros(gaps + 30 * N)
        ubg = np.concatenate([np.zeros(gaps), np.full(30 * N, np.inf)])
        return {"x0": start, "lbx": lower, "ubx": upper, "lbg": lbg, "ubg": ubg}

    def shooting(self, function):
        """`function` gives the ends of all intervals."""
        states, controls, begins, ends = self.variables()
        gaps, h = function(begins, controls) - ends, self.limits.map(N)(states, controls)
        nlp = {
            "x": ca.vertcat(ca.vec(states), ca.vec(controls)),
            "f": states[22, 0],
            "g": ca.vertcat(ca.vec(gaps), ca.vec(h)),
        }
        arguments = self.arguments(N * (NX + NU), N * NX, self.start())
        return Ipopt(nlp, arguments, TOLERANCE, mu_init=1e-2)

    def collocation(self):
        """Radau IIA with four stages, states and algebraic states of which are variables."""
        points = ca.collocation_points(4, "radau")
        derivatives = coefficients(points)
        xd, x, u, z, f = awe()
        model = ca.Function("f", [xd, x, u, z], [ca.cse(f)])
        begin, control, inner = ca.SX.sym("x", NX), ca.SX.sym("u", NU), ca.SX.sym("k", NX + 1, 4)
        here = ca.horzcat(begin, inner[:NX, :])
        rows = [model(here @ ca.DM(derivatives[j]) / T, inner[:NX, j], control, inner[NX, j]) for j in range(4)]
        interval = ca.Function("interval", [begin, control, inner], [ca.vertcat(*rows)]).map(N)
        states, controls, begins, ends = self.variables()
        stages = ca.MX.sym("K", NX + 1, 4 * N)
        residual, last = interval(begins, controls, stages), stages[:NX, 3::4]
        h = self.limits.map(N)(states, controls)
        nlp = {
            "x": ca.vertcat(ca.vec(states), ca.vec(controls), ca.vec(stages)),
            "f": states[22, 0],
            "g": ca.vertcat(ca.vec(residual), ca.vec(last - ends), ca.vec(h)),
        }
        guesses = [np.append(x, data("awe/intervals.json")["lambda"][0]) for x in self.guess[0] for _ in range(4)]
        start = np.concatenate([self.start(), np.concatenate(guesses)])
        arguments = self.arguments(len(start), N * (4 * (NX + 1) + NX), start)
        return Ipopt(nlp, arguments, TOLERANCE, expand=True, mu_init=1e-2)


def coefficients(points):
    """Derivatives of the Lagrange polynomials through the start and the points, at these: a row for
    each point."""
    nodes = [0.0, *points]
    rows = np.zeros((len(points), len(nodes)))
    for i, here in enumerate(nodes):
        polynomial = np.poly1d([1.0])
        for other in nodes[:i] + nodes[i + 1 :]:
            polynomial *= np.poly1d([1.0, -other]) / (here - other)
        rows[:, i] = [np.polyder(polynomial)(point) for point in points]
    return rows


def solve(rounds, seconds):
    """Table 1."""
    print("orbit")
    orbit, path = Orbit(), library("awe")
    awes, single = ca.external("awes", path), ca.external("awe", path)

    def one_by_one(states, controls):
        pairs = zip(ca.horzsplit(states), ca.horzsplit(controls))
        return ca.horzcat(*[single(x, u, ca.MX(0, 1)) for x, u in pairs])

    makers = {
        "casados, whole problem": lambda: whole(path, TOLERANCE, mu_init=1e-2),
        "casados, horizon": lambda: orbit.shooting(lambda x, u: awes(x, u, ca.MX(0, N))),
        "casados, intervals": lambda: orbit.shooting(one_by_one),
        "direct collocation": orbit.collocation,
        "casados interior point": lambda: lambda: own(path, 2),
    }
    with environment(orbit.numbers()):
        return race(makers, rounds, seconds)


def implicit(plugin, **options):
    """CasADi's integrator of the model, whose derivatives are algebraic states then."""
    xd, x, u, z, f = awe()
    dae = {"x": x, "z": ca.vertcat(xd, z), "p": u, "ode": xd, "alg": ca.cse(f)}
    return ca.integrator("F", plugin, dae, 0, T, options)


class Call:
    """A function of `(x, u)` with its arguments in place: nothing of Python is in its time."""

    def __init__(self, function):
        self.function, self.w = function, np.zeros(NX + NU)
        self.outputs = [np.zeros(function.numel_out(i)) for i in range(function.n_out())]
        self.buffer, self.run = function.buffer()
        self.buffer.set_arg(0, memoryview(self.w))
        for i, output in enumerate(self.outputs):
            self.buffer.set_res(i, memoryview(output))

    def __call__(self, x, u):
        self.w[:NX], self.w[NX:] = x, u
        begin = time.thread_time()
        self.run()
        return time.thread_time() - begin


def intervals(rounds, seconds):
    """Tables 2 and 3: times of the simulations and Jacobians of the 40 intervals, and how far their
    entries are from an independent reference, relative to entries above one."""
    print("intervals of the orbit")
    path, record = library("awe"), data("awe/intervals.json")["intervals"]
    references = {"simulation": [r["x_next"] for r in record], "Jacobian": [r["forward"] for r in record]}
    w = ca.MX.sym("w", NX + NU)
    single = ca.external("awe", path)
    collocation = implicit(
        "collocation",
        number_of_finite_elements=1,
        interpolation_order=4,
        collocation_scheme="radau",
        rootfinder="newton",
        rootfinder_options={"abstol": 1e-12, "max_iter": 50},
    )
    idas = implicit("idas", abstol=1e-10, reltol=1e-10, max_num_steps=100000, calc_ic=True)
    ends = {
        "casados": single(w[:NX], w[NX:], ca.MX(0, 1)),
        "CasADi collocation": collocation(x0=w[:NX], p=w[NX:])["xf"],
        "CasADi IDAS": idas(x0=w[:NX], p=w[NX:])["xf"],
    }
    tables = {}
    for mode in ["simulation", "Jacobian"]:
        outputs = {name: end if mode == "simulation" else ca.jacobian(end, w) for name, end in ends.items()}
        calls = {name: Call(ca.Function("f", [w], [ca.densify(value)])) for name, value in outputs.items()}
        times = {name: [[] for _ in range(N)] for name in calls}
        values, spent = {name: [None] * N for name in calls}, dict.fromkeys(calls, 0.0)
        for turn in range(rounds):
            for k in range(N):
                # Inputs that nobody has seen: else they would be found in the cache.
                x = np.array(record[k]["x0"]) * (1 + 1e-13 * turn)
                for name, call in calls.items():
                    if turn > 0 and spent[name] > seconds:
                        continue
                    taken = call(x, record[k]["u"])
                    spent[name] += taken
                    times[name][k].append(taken)
                    if turn == 0:
                        values[name][k] = call.outputs[0].copy()
        rows = {}
        for name, samples in times.items():
            of_intervals = [statistics.median(taken) for taken in samples]
            expected = [np.array(reference).ravel(order="F") for reference in references[mode]]
            pairs = zip(values[name], expected)
            difference = max((np.abs(a - b) / np.maximum(1.0, np.abs(b))).max() for a, b in pairs)
            rows[name] = {
                "median": statistics.median(of_intervals),
                "max": max(of_intervals),
                "min": min(of_intervals),
                "difference": float(difference),
            }
            print(f"  {mode}, {name}: {rows[name]}", flush=True)
        tables[mode] = rows
    return tables
