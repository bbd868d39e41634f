"""CasADi's integrators on the models of the benchmarks: times and values on request.

Reads one JSON object a line from standard input and answers each with one on standard output. Requests:

    {"do": "versions"}
    {"do": "time", "case": CASE, "solver": "collocation" | "rk" | "cvodes" | "idas", "modes": [...], "seconds": 0.2}
    {"do": "values", "case": CASE, "modes": [...]}       collocation, or rk where stages is 0; rounding level
    {"do": "flow", "case": CASE}                         the exact flow and its Jacobian, to about 1e-13

CASE has the model ("pendulum", "chain", "awe"), nx, T, scheme ("legendre", "radau"), stages, steps, inputs [[x0, u], ...],
lambda. Models are SX graphs with common subexpressions removed. Functions are called through FunctionBuffer, which
copies nothing and allocates nothing. Times are CPU seconds of this one thread.
"""

import json
import math
import os
import sys
import time

import casadi as ca
import numpy as np

MODES = ["simulation", "forward", "adjoint", "hessian"]


def pendulum(nx):
    """Explicit: x, u, right-hand side."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 1)
    M, m, l, g = 1.0, 0.1, 0.8, 9.81
    s, c, w = ca.sin(x[1]), ca.cos(x[1]), x[3]
    d = M + m - m * c * c
    a = (-m * l * s * w * w + m * g * c * s + u) / d
    b = (-m * l * c * s * w * w + u * c + (M + m) * g * s) / (l * d)
    return x, u, ca.vertcat(x[2], w, a, b)


def chain(nx):
    """Explicit: x, u, right-hand side."""
    x, u = ca.SX.sym("x", nx), ca.SX.sym("u", 3)
    free = (nx - 3) // 6
    D, m, L = 1.0, 0.033, 0.033
    p = [x[3 * i : 3 * i + 3] for i in range(free + 1)]
    v = [x[3 * (free + 1 + i) : 3 * (free + 1 + i) + 3] for i in range(free)]
    force = []
    for i in range(free + 1):
        d = p[i] - p[i - 1] if i else p[i]
        force.append(D / m * (1 - L / ca.norm_2(d)) * d)
    a = [force[i + 1] - force[i] - ca.DM([0, 0, 9.81]) for i in range(free)]
    return x, u, ca.vertcat(*v, u, *a)


def awe():
    """Implicit: xdot, x, u, z, residual. An aircraft on a tether; see examples/models/awe.rs."""
    xd, x, u, z = ca.SX.sym("xd", 23), ca.SX.sym("x", 23), ca.SX.sym("u", 4), ca.SX.sym("z", 1)
    g, mk, mt, lt, diameter, cd = 9.81, 36.8, 0.0046 * 434.287, 434.287, 0.002, 1.2
    J = ca.DM([[25, 0, 0.47], [0, 32, 0], [0.47, 0, 56]])
    b, S = 5.5, 3.0
    c = S / b
    q, dq, om, R = x[0:3], x[3:6], x[6:9], ca.reshape(x[9:18], 3, 3)
    delta, kappa = x[18:21], 10 * x[21]
    ddq, dom, dR = xd[3:6], xd[6:9], ca.reshape(xd[9:18], 3, 3)

    wind = lambda h: 10.0 * (ca.sqrt(h * h + 1) / 100.0) ** 0.15
    rho = lambda h: 1.225 * ((288.15 - 0.0065 * h) / 288.15) ** (g / 0.0065 / 287.053 - 1)
    apparent = lambda q, dq: ca.vertcat(wind(q[2]), 0, 0) - dq
    ua = apparent(q, dq)
    V = ca.sqrt(ca.dot(ua, ua))
    body = ca.mtimes(R.T, ua)
    forward = ca.sqrt(body[0] ** 2 + 1e-16)
    alpha, beta = body[2] / forward, body[1] / forward
    flip = ca.DM([-1, 1, -1])
    rates = flip * om / (2 * V) * ca.DM([b, c, b])
    P, Q, Rr = rates[0], rates[1], rates[2]
    da, de, dr = delta[0], delta[1], delta[2]
    poly = lambda *cs: sum(k * alpha**i for i, k in enumerate(cs))
    CX = poly(-0.0293, 0.4784, 2.5549) + poly(-0.6029, 4.4124) * Q + poly(-0.0106, 0.1115) * de
    CY = (poly(-0.1855, -0.0299, 0.0936) * beta + poly(-0.1022, -0.0140, 0.0496) * P + poly(0.1694, 0.1368) * Rr
          + poly(-0.0514, -0.0024, 0.0579) * da + poly(0.10325, 0.0268, -0.1036) * dr)
    CZ = (poly(-0.5526, -5.0676, 5.7736) + poly(-7.5560, 0.1251, 6.1486) * Q
          + poly(-0.315, -0.0013, 0.2923) * de)
    Cl = (poly(-0.0630, -0.0003, 0.0312) * beta + poly(-0.5632, -0.0247, 0.2813) * P + poly(0.1811, 0.6448) * Rr
          + poly(-0.2489, -0.0087, 0.2383) * da + poly(0.00436, -0.0013) * dr)
    Cm = poly(-0.0307, -0.6027) + poly(-11.3022, -0.0026, 5.2885) * Q + poly(-1.0427, -0.0061, 0.9974) * de
    Cn = (poly(0.0577, -0.0849) * beta + poly(-0.0565, -0.9137) * P + poly(-0.0553, 0.0290, 0.0257) * Rr
          + poly(0.01903, -0.1147) * da + poly(-0.0404, -0.0117, 0.04089) * dr)
    pressure = 0.5 * rho(q[2]) * V * V * S
    Fa = ca.mtimes(R, flip * ca.vertcat(CX, CY, CZ)) * pressure
    Ma = flip * ca.vertcat(b * Cl, c * Cm, b * Cn) * pressure
    Fg = kappa * V * ua
    power = 0.75 * kappa * V**3

    Ft, t = ca.SX.zeros(3), q / 5
    for k in range(5):
        s = (k + 0.5) / 5
        w = apparent(s * q, s * dq)
        n = ca.sqrt(ca.dot(w, w) + 1e-12)
        across = ca.sqrt(ca.dot(t, t) - (ca.dot(t, w) / n) ** 2 + 1e-12)
        Ft += s * 0.5 * cd * rho(s * q[2]) * n * diameter * across * w

    e = q / lt
    s = ca.dot(e, dq)
    sd = ca.dot(dq, dq) / lt + ca.dot(e, ddq)
    inertia = (mk + mt / 3) * ddq + mt / 3 * e * ((1 + ca.dot(e, e)) * sd + s * s / lt)
    force = inertia + ca.DM([0, 0, mk * g]) + 12.499305032751677 * z * q - Fa - Fg - Ft
    moment = Ma - (ca.mtimes(J, dom) + ca.cross(om, ca.mtimes(J, om)))
    rotation = dR - ca.mtimes(R, (ca.DM.eye(3) - ca.mtimes(R.T, R)) / 2 + ca.skew(om))
    con, dcon = (ca.dot(q, q) - lt * lt) / 2, ca.dot(q, dq)
    ddcon = ca.dot(dq, dq) + ca.dot(q, ddq)
    tf = 13.456375779859805
    wx = [1.25e-11] * 3 + [1.25e-10] * 3 + [6.25e-3] * 3 + [1.25e-10] * 9 + [1.25e-8] * 3 + [1.25e-9, 1.25e-10]
    cost = (-121.96560160548071 * power / 291516.74163444503 / tf + ca.dot(ca.DM([0.25, 0.25, 0.25, 0.025]), u * u)
            + ca.dot(ca.DM(wx), xd * xd) + 0.2 * beta * beta)
    f = ca.vertcat(force / 5178.2085, moment / (mk * g * b / 2), ca.reshape(rotation, 9, 1), xd[18:21] - u[0:3],
                   xd[21] - u[3], xd[0:3] - dq, (ddcon + 0.2 * dcon + 0.01 * con) / 1102500.0, xd[22] - cost)
    return xd, x, u, z, f


def dae(case):
    if case["model"] == "awe":
        xd, x, u, z, f = awe()
        return {"x": x, "z": ca.vertcat(xd, z), "p": u, "ode": xd, "alg": ca.cse(f)}
    x, u, ode = {"pendulum": pendulum, "chain": chain}[case["model"]](case["nx"])
    return {"x": x, "p": u, "ode": ca.cse(ode)}


def fixed(case, tolerance=None):
    """The fixed-step integrator of the case."""
    if case["stages"] == 0:
        return ca.integrator("F", "rk", dae(case), 0, case["T"], {"number_of_finite_elements": case["steps"]})
    options = {
        "number_of_finite_elements": case["steps"],
        "interpolation_order": case["stages"],
        "collocation_scheme": case["scheme"],
    }
    if tolerance:
        options["rootfinder_options"] = {"abstol": tolerance, "abstolStep": tolerance}
    return ca.integrator("F", "collocation", dae(case), 0, case["T"], options)


def integrator(case, solver):
    if solver in ("collocation", "rk"):
        return fixed(case)
    options = {"abstol": case["tolerance"], "reltol": case["tolerance"], "max_num_steps": 100000}
    problem = dae(case)
    if solver == "idas" and case["model"] == "awe":
        options["calc_ic"] = True
    return ca.integrator("F", solver, problem, 0, case["T"], options)


def functions(F, case, modes):
    """For each mode a function of w = (x0, u) and lambda with what a call of casados gives in that mode."""
    nx = case["nx"]
    nu = len(case["inputs"][0][1])
    w, lam = ca.MX.sym("w", nx + nu), ca.MX.sym("lam", nx)
    x = F(x0=w[:nx], p=w[nx:])["xf"]
    for mode in modes:
        if mode == "simulation":
            outputs = [x]
        elif mode == "forward":
            outputs = [x, ca.jacobian(x, w)]
        elif mode == "adjoint":
            # Without x among the outputs: CasADi would integrate once more for it.
            outputs = [ca.jtimes(x, w, lam, True)]
        else:
            hessian, gradient = ca.hessian(ca.dot(lam, x), w)
            outputs = [x, ca.jacobian(x, w), gradient, hessian]
        yield mode, ca.Function(mode, [w, lam], [ca.densify(o) for o in outputs])


class Call:
    """A function with its arguments in place."""

    def __init__(self, function, case):
        self.inputs = [np.array(x + u, dtype=float) for x, u in case["inputs"]]
        self.w, self.lam = self.inputs[0].copy(), np.array(case["lambda"], dtype=float)
        self.flat = [np.zeros(function.numel_out(i)) for i in range(function.n_out())]
        self.outputs = [f.reshape(function.size_out(i), order="F") for i, f in enumerate(self.flat)]
        self.buffer, self.run = function.buffer()
        self.buffer.set_arg(0, memoryview(self.w))
        self.buffer.set_arg(1, memoryview(self.lam))
        for i, o in enumerate(self.flat):
            self.buffer.set_res(i, memoryview(o))
        self.keep = function

    def single(self, k):
        self.w[:] = self.inputs[k]
        self.run()

    def seconds(self, budget):
        """Median, quartiles and number of samples of the CPU seconds of a call."""
        samples, several = [], len(self.inputs) > 1
        clock, begin = time.thread_time_ns, time.perf_counter()
        self.single(0)
        start = clock()
        self.run()
        once = max(clock() - start, 1)
        repetitions = max(1, math.ceil(200_000 / once))
        while True:
            if several:
                total = 0
                for k in range(len(self.inputs)):
                    self.w[:] = self.inputs[k]
                    start = clock()
                    self.run()
                    total += clock() - start
                samples.append(total / len(self.inputs))
            else:
                start = clock()
                for _ in range(repetitions):
                    self.run()
                samples.append((clock() - start) / repetitions)
            spent = time.perf_counter() - begin
            if (spent > budget and len(samples) >= 3) or spent > 10 * budget + 1:
                break
        q1, median, q3 = np.percentile(samples, [25, 50, 75]) * 1e-9
        return {"median": median, "q1": q1, "q3": q3, "samples": len(samples)}


def values(call, mode, case):
    """What casados gives, as flat lists: x, Jacobian by rows, gradient, lower triangle of the Hessian by rows."""
    rows = []
    for k in range(len(call.inputs)):
        call.single(k)
        out = {}
        names = {"simulation": ["x"], "forward": ["x", "forward"], "adjoint": ["adjoint"],
                 "hessian": ["x", "forward", "adjoint", "hessian"]}[mode]
        for name, value in zip(names, call.outputs):
            if name == "hessian":
                out[name] = value[np.tril_indices(value.shape[0])].tolist()
            else:
                out[name] = value.flatten(order="C").tolist()
        rows.append(out)
    return rows


def tightest(case, modes):
    """Values of the fixed-step integrator, with the tightest tolerance that its Newton's method reaches."""
    for tolerance in (1e-14, 1e-13, 1e-12, 1e-11):
        try:
            return {m: values(Call(f, case), m, case) for m, f in functions(fixed(case, tolerance), case, modes)}
        except RuntimeError as error:
            failure = error
    raise failure


def flow(case):
    """The exact flow by collocation with 4 stages and many steps; two step numbers bound its error."""
    results = []
    for steps in (48, 64):
        results.append(tightest({**case, "stages": 4, "steps": steps}, ["forward"])["forward"][0])
    coarse, fine = results
    error = {k: float(np.abs(np.subtract(coarse[k], fine[k])).max() / np.abs(fine[k]).max()) for k in fine}
    return {"values": fine, "uncertainty": error}


def serve(request, cache):
    if request["do"] == "versions":
        return {"casadi": ca.__version__, "python": sys.version.split()[0], "numpy": np.__version__}
    case = request["case"]
    if request["do"] == "flow":
        return flow(case)
    if request["do"] == "values":
        return tightest(case, request["modes"])
    solver, answer = request["solver"], {}
    for mode in request["modes"]:
        key = (case["name"], solver, mode)
        if key not in cache:
            F = integrator(case, solver)
            cache.update({(case["name"], solver, m): Call(f, case) for m, f in functions(F, case, [mode])})
        call = cache[key]
        answer[mode] = {"time": call.seconds(request["seconds"]), "values": values(call, mode, case)}
    return answer


def main():
    # CasADi prints what it fails on. Answers have a descriptor of their own.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    cache = {}
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = serve(request, cache)
        except Exception as error:  # A solver that fails is a line of the table, not the end of the run.
            answer = {"error": str(error).strip().splitlines()[-1]}
        print(json.dumps(answer), file=answers, flush=True)


main()
