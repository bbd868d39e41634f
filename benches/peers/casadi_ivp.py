"""CVODES and IDAS, through CasADi, on the initial value problems: for examples/work_precision. Where they are installed,
SciPy's Radau, LSODA and DOP853, and CVODE through scikit-sundae, on those without algebraic states.

Reads one JSON object a line from standard input and answers each with one on standard output:

    {"problem": "hires", "x0": [..], "p": [..], "t": 321.8, "atol": 1e-3, "tolerances": [..], "derivatives": false, "seconds": 0.02}
    {"runs": [{"solver": "CVODES", "tolerance": 1e-4, "y": [..], "derivatives": [..], "time": 2e-4} | {.., "error": ".."}]}

atol is relative to the tolerance. Models are SX graphs with common subexpressions removed. Functions are called through
FunctionBuffer, which copies nothing. Times are the least CPU seconds of a call, of this one thread.
"""

import json
import os
import sys
import time

import casadi as ca
import numpy as np

# Solvers that call equations in Python.
IN_PYTHON = []
try:
    import scipy
    from scipy.integrate import solve_ivp

    IN_PYTHON += [(f"SciPy, {method}", method) for method in ("Radau", "LSODA", "DOP853")]
except ImportError:
    pass
try:
    import sksundae
    from sksundae.cvode import CVODE

    IN_PYTHON += [("CVODE", "CVODE")]
except ImportError:
    pass

# A run that takes longer ends the list of tolerances.
PATIENCE = 3.0


def robertson(x, z, p, t):
    first, second, third = p[0] * x[0], p[1] * x[1] ** 2, p[2] * x[1] * x[2]
    return [third - first, first - third - second, second], []


def hires(x, z, p, t):
    y1, y2, y3, y4, y5, y6, y7, y8 = ca.vertsplit(x)
    bound = 280 * y6 * y8
    return [
        -1.71 * y1 + 0.43 * y2 + 8.32 * y3 + 0.0007,
        1.71 * y1 - 8.75 * y2,
        -10.03 * y3 + 0.43 * y4 + 0.035 * y5,
        8.32 * y2 + 1.71 * y3 - 1.12 * y4,
        -1.745 * y5 + 0.43 * (y6 + y7),
        -bound + 0.69 * y4 + 1.71 * y5 - 0.43 * y6 + 0.69 * y7,
        bound - 1.81 * y7,
        -bound + 1.81 * y7,
    ], []


def van_der_pol(x, z, p, t):
    return [x[1], p[0] * (1 - x[0] ** 2) * x[1] - x[0]], []


def oregonator(x, z, p, t):
    s, q, s2, w = ca.vertsplit(p)
    return [s * (x[1] + x[0] * (1 - q * x[0] - x[1])), (x[2] - (1 + x[0]) * x[1]) / s2, w * (x[0] - x[2])], []


def e5(x, z, p, t):
    y1, y2, y4 = ca.vertsplit(x)
    first, second, third = 7.89e-10 * y1, 1.1e7 * y1 * z[0], 1e6 * 1.13e3 * y2 * z[0]
    return [-first - second, first - third, second - 1.13e3 * y4], [y2 - z[0] - y4]


def akzo_nobel(x, z, p, t):
    y1, y2, y3, y4, y5 = ca.vertsplit(x)
    k1, k2, k3, k4, equilibrium, transfer, solubility, pressure, henry = ca.vertsplit(p)
    root = ca.sqrt(y2)
    r1, r2, r3 = k1 * y1 * y1 * y1 * y1 * root, k2 * y3 * y4, k2 / equilibrium * y1 * y5
    r4, r5, inflow = k3 * y1 * y4 * y4, k4 * z[0] ** 2 * root, transfer * (pressure / henry - y2)
    return [
        -2 * r1 + r2 - r3 - r4,
        -0.5 * r1 - r4 - 0.5 * r5 + inflow,
        r1 - r2 + r3,
        -r2 + r3 - 2 * r4,
        r2 - r3 + r5,
    ], [solubility * y1 * y4 - z[0]]


def transistor_amplifier(x, z, p, t):
    """By the voltages of the capacitors."""
    y1, y4, y7 = ca.vertsplit(z)
    y2, y3, y5, y6, y8 = y1 + x[0], x[1], y4 + x[2], x[3], y7 + x[4]
    transistor = lambda voltage: 1e-6 * (ca.exp(voltage / 0.026) - 1)
    first, second = transistor(y2 - y3), transistor(y5 - y6)
    i1 = (y1 - 0.1 * ca.sin(200 * ca.pi * t)) / 1000
    i4, i7 = (y4 - 6) / 9000 + 0.99 * first, (y7 - 6) / 9000 + 0.99 * second
    return [
        i1 / 1e-6,
        -(y3 / 9000 - first) / 2e-6,
        i4 / 3e-6,
        -(y6 / 9000 - second) / 4e-6,
        i7 / 5e-6,
    ], [
        i1 + y2 / 9000 + (y2 - 6) / 9000 + 0.01 * first,
        i4 + y5 / 9000 + (y5 - 6) / 9000 + 0.01 * second,
        i7 + y8 / 9000,
    ]


def ring_modulator(x, z, p, t):
    y = [None] + ca.vertsplit(x)
    c, cs, cp, r, rp, lh, ls1, ls2, ls3 = 1.6e-8, 2e-12, 1e-8, 25e3, 50, 4.45, 2e-3, 5e-4, 5e-4
    rg1, rg2, rg3, ri, rc = 36.3, 17.3, 17.3, 50, 600
    low, high = 0.5 * ca.sin(2e3 * ca.pi * t), 2 * ca.sin(2e4 * ca.pi * t)
    diode = lambda voltage: 40.67286402e-9 * (ca.exp(17.7493332 * voltage) - 1)
    d1, d2 = diode(y[3] - y[5] - y[7] - high), diode(-y[4] + y[6] - y[7] - high)
    d3, d4 = diode(y[4] + y[5] + y[7] + high), diode(-y[3] - y[6] + y[7] + high)
    return [
        (y[8] - 0.5 * y[10] + 0.5 * y[11] + y[14] - y[1] / r) / c,
        (y[9] - 0.5 * y[12] + 0.5 * y[13] + y[15] - y[2] / r) / c,
        (y[10] - d1 + d4) / cs,
        (-y[11] + d2 - d3) / cs,
        (y[12] + d1 - d3) / cs,
        (-y[13] - d2 + d4) / cs,
        (-y[7] / rp + d1 + d2 - d3 - d4) / cp,
        -y[1] / lh,
        -y[2] / lh,
        (0.5 * y[1] - y[3] - rg2 * y[10]) / ls2,
        (-0.5 * y[1] + y[4] - rg3 * y[11]) / ls3,
        (0.5 * y[2] - y[5] - rg2 * y[12]) / ls2,
        (-0.5 * y[2] + y[6] - rg3 * y[13]) / ls3,
        (-y[1] + low - (ri + rg1) * y[14]) / ls1,
        (-y[2] - (rc + rg1) * y[15]) / ls1,
    ], []


def pleiades(x, z, p, t):
    acceleration = [ca.SX(0)] * 14
    for i in range(7):
        for j in range(i):
            dx, dy = x[j] - x[i], x[7 + j] - x[7 + i]
            square = dx * dx + dy * dy
            cube = square * ca.sqrt(square)
            for axis, d in ((0, dx), (7, dy)):
                acceleration[axis + i] = acceleration[axis + i] + (j + 1) * d / cube
                acceleration[axis + j] = acceleration[axis + j] - (i + 1) * d / cube
    return [x[14:], *acceleration], []


def squeezer(x, z, p, t):
    m = [0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498]
    inertia = [2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5]
    xb, yb, xc, yc, spring, length, torque = -0.03635, 0.03273, 0.014, 0.072, 4530, 0.07785, 0.033
    d, da, e, ea, rr, ra, ss, sa, sb_, sc, sd_ = 0.028, 0.0115, 0.02, 0.01421, 0.007, 0.00092, 0.035, 0.01874, 0.01043, 0.018, 0.02
    ta, tb, u, ua, ub, zf, zt, fa = 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.04, 0.01421
    be, th, ga, ph, de, om, ep, vb, vt, vg, vp, vd, vo, ve = ca.vertsplit(x)
    ab, at, ag, ap, ad, ao, ae = ca.vertsplit(z[:7])
    lam = z[7:]
    s = {k: ca.sin(v) for k, v in dict(b=be, t=th, g=ga, p=ph, d=de, o=om, e=ep, bt=be + th, pd=ph + de, oe=om + ep).items()}
    c = {k: ca.cos(v) for k, v in dict(b=be, t=th, g=ga, p=ph, d=de, o=om, e=ep, bt=be + th, pd=ph + de, oe=om + ep).items()}
    m11 = m[0] * ra**2 + m[1] * (rr**2 - 2 * da * rr * c["t"] + da**2) + inertia[0] + inertia[1]
    m21 = m[1] * (da**2 - da * rr * c["t"]) + inertia[1]
    m22 = m[1] * da**2 + inertia[1]
    m33 = m[2] * (sa**2 + sb_**2) + inertia[2]
    m44 = m[3] * (e - ea) ** 2 + inertia[3]
    m54 = m[3] * ((e - ea) ** 2 + zt * (e - ea) * s["p"]) + inertia[3]
    m55 = m[3] * (zt**2 + 2 * zt * (e - ea) * s["p"] + (e - ea) ** 2) + m[4] * (ta**2 + tb**2) + inertia[3] + inertia[4]
    m66 = m[5] * (zf - fa) ** 2 + inertia[5]
    m76 = m[5] * ((zf - fa) ** 2 - u * (zf - fa) * s["o"]) + inertia[5]
    m77 = m[5] * ((zf - fa) ** 2 - 2 * u * (zf - fa) * s["o"] + u**2) + m[6] * (ua**2 + ub**2) + inertia[5] + inertia[6]
    xd, yd = sd_ * c["g"] + sc * s["g"] + xb, sd_ * s["g"] - sc * c["g"] + yb
    distance = ca.sqrt((xd - xc) ** 2 + (yd - yc) ** 2)
    force = -spring * (distance - length) / distance
    fx, fy = force * (xd - xc), force * (yd - yc)
    f = [
        torque - m[1] * da * rr * vt * (vt + 2 * vb) * s["t"],
        m[1] * da * rr * vb * vb * s["t"],
        fx * (sc * c["g"] - sd_ * s["g"]) + fy * (sd_ * c["g"] + sc * s["g"]),
        m[3] * zt * (e - ea) * vd * vd * c["p"],
        -m[3] * zt * (e - ea) * vp * (vp + 2 * vd) * c["p"],
        -m[5] * u * (zf - fa) * ve * ve * c["o"],
        m[5] * u * (zf - fa) * vo * (vo + 2 * ve) * c["o"],
    ]
    crank_x, crank_y = -rr * s["b"] + d * s["bt"], rr * c["b"] - d * c["bt"]
    vbt, vpd, voe = vb + vt, vp + vd, vo + ve
    lx, ly = lam[0] + lam[2] + lam[4], lam[1] + lam[3] + lam[5]
    moved_x = crank_x * ab + d * s["bt"] * at - rr * c["b"] * vb * vb + d * c["bt"] * vbt * vbt
    moved_y = crank_y * ab - d * c["bt"] * at - rr * s["b"] * vb * vb + d * s["bt"] * vbt * vbt
    return [x[7:], z[:7]], [
        m11 * ab + m21 * at - f[0] + crank_x * lx + crank_y * ly,
        m21 * ab + m22 * at - f[1] + d * s["bt"] * lx - d * c["bt"] * ly,
        m33 * ag - f[2] - ss * c["g"] * lam[0] - ss * s["g"] * lam[1],
        m44 * ap + m54 * ad - f[3] - e * c["pd"] * lam[2] - e * s["pd"] * lam[3],
        m54 * ap + m55 * ad - f[4] + (zt * s["d"] - e * c["pd"]) * lam[2] - (e * s["pd"] + zt * c["d"]) * lam[3],
        m66 * ao + m76 * ae - f[5] + zf * s["oe"] * lam[4] - zf * c["oe"] * lam[5],
        m76 * ao + m77 * ae - f[6] + (zf * s["oe"] - u * c["e"]) * lam[4] - (zf * c["oe"] + u * s["e"]) * lam[5],
        moved_x - ss * c["g"] * ag + ss * s["g"] * vg * vg,
        moved_y - ss * s["g"] * ag - ss * c["g"] * vg * vg,
        moved_x - e * c["pd"] * (ap + ad) + e * s["pd"] * vpd * vpd + zt * s["d"] * ad + zt * c["d"] * vd * vd,
        moved_y - e * s["pd"] * (ap + ad) - e * c["pd"] * vpd * vpd - zt * c["d"] * ad + zt * s["d"] * vd * vd,
        moved_x + zf * s["oe"] * (ao + ae) + zf * c["oe"] * voe * voe - u * c["e"] * ae + u * s["e"] * ve * ve,
        moved_y - zf * c["oe"] * (ao + ae) + zf * s["oe"] * voe * voe - u * s["e"] * ae - u * c["e"] * ve * ve,
    ]


# The model, the number of algebraic states, and a guess for them.
PROBLEMS = {
    "robertson": (robertson, []),
    "hires": (hires, []),
    "van_der_pol_1e3": (van_der_pol, []),
    "van_der_pol_1e6": (van_der_pol, []),
    "oregonator": (oregonator, []),
    "e5": (e5, [0.0]),
    "akzo_nobel": (akzo_nobel, [115.83 * 0.444 * 0.007]),
    "transistor_amplifier": (transistor_amplifier, [0.0, 6.0, 6.0]),
    "ring_modulator": (ring_modulator, []),
    "pleiades": (pleiades, []),
    "squeezer": (squeezer, [0.0] * 13),
}


def function(request, solver, tolerance):
    """w = (x0, p) to the values at the end, and their derivatives by w if they are asked for."""
    model, guess = PROBLEMS[request["problem"]]
    nx, np_, nz = len(request["x0"]), len(request["p"]), len(guess)
    x, z, p, t = ca.SX.sym("x", nx), ca.SX.sym("z", nz), ca.SX.sym("p", np_), ca.SX.sym("t")
    ode, alg = model(x, z, p, t)
    ode, alg = ca.cse([ca.vertcat(*ode), ca.vertcat(*alg) if alg else ca.SX(0, 1)])
    dae = {"x": x, "z": z, "p": p, "t": t, "ode": ode, "alg": alg}
    options = {"abstol": request["atol"] * tolerance, "reltol": tolerance, "max_num_steps": 300000}
    if request["derivatives"]:
        options["fsens_err_con"] = True
    if solver == "idas":
        # From consistent values IDAS does not always get back to them: only where they are a guess.
        options["calc_ic"] = request["problem"] == "squeezer" or request["derivatives"]
        slope = ca.Function("slope", [x, z, p, t], [ode])(request["x0"], guess, request["p"], 0)
        if not request["derivatives"]:
            options["init_xdot"] = [float(v) for v in np.array(slope).flatten()]
    F = ca.integrator("F", solver, dae, 0, request["t"], options)
    w = ca.MX.sym("w", nx + np_)
    end = F(x0=w[:nx], p=w[nx:], z0=guess)
    y = ca.vertcat(end["xf"], end["zf"])
    if request["problem"] == "e5":
        y = ca.vertcat(end["xf"][:2], end["zf"], end["xf"][2])
    if request["problem"] == "transistor_amplifier":
        v, a = end["xf"], end["zf"]
        y = ca.vertcat(a[0], a[0] + v[0], v[1], a[1], a[1] + v[2], v[3], a[2], a[2] + v[4])
    outputs = [y] + ([ca.densify(ca.jacobian(end["xf"], w))] if request["derivatives"] else [])
    return ca.Function("end", [w], outputs)


class Call:
    def __init__(self, f, w):
        self.w = np.array(w, dtype=float)
        self.flat = [np.zeros(f.numel_out(i)) for i in range(f.n_out())]
        self.shapes = [f.size_out(i) for i in range(f.n_out())]
        self.buffer, self.run = f.buffer()
        self.buffer.set_arg(0, memoryview(self.w))
        for i, o in enumerate(self.flat):
            self.buffer.set_res(i, memoryview(o))
        self.keep = f

    def outputs(self):
        return [f.reshape(s, order="F").flatten(order="C").tolist() for f, s in zip(self.flat, self.shapes)]


def one(request, solver, tolerance):
    call = Call(function(request, solver, tolerance), request["x0"] + request["p"])
    start = time.thread_time_ns()
    call.run()
    least, count, begin = time.thread_time_ns() - start, 0, time.perf_counter()
    y, *derivatives = call.outputs()
    # What takes long is not repeated.
    while least < 3e8 and (count < 2 or time.perf_counter() - begin < request["seconds"]):
        start = time.thread_time_ns()
        call.run()
        least = min(least, time.thread_time_ns() - start)
        count += 1
    if not np.all(np.isfinite(y)) or call.buffer.ret() != 0:
        raise RuntimeError("no solution")
    return {"y": y, "derivatives": derivatives[0] if derivatives else [], "time": least * 1e-9}


def in_python(request, solver, tolerance):
    """SciPy and scikit-sundae: equations and Jacobians are CasADi's, called from Python at every evaluation."""
    model, _ = PROBLEMS[request["problem"]]
    nx, end = len(request["x0"]), request["t"]
    x, t = ca.SX.sym("x", nx), ca.SX.sym("t")
    ode = ca.cse(ca.vertcat(*model(x, None, ca.DM(request["p"]), t)[0]))
    rates, jacobian = Rates("f", [x, t], ode), Rates("J", [x, t], ca.densify(ca.jacobian(ode, x)))
    tolerances = {"rtol": tolerance, "atol": request["atol"] * tolerance}
    if solver == "CVODE":

        def write(t, y, to):
            to[:] = rates(y, t)

        def write_jacobian(t, y, _, to):
            to[:] = jacobian(y, t).reshape(nx, nx, order="F")

        run = CVODE(write, jacfn=write_jacobian, max_num_steps=300000, **tolerances)
        call = lambda: run.solve(np.array([0.0, end]), np.array(request["x0"]))
    else:
        j = {} if solver == "DOP853" else {"jac": lambda t, y: jacobian(y, t).reshape(nx, nx, order="F")}
        f = lambda t, y: rates(y, t)
        call = lambda: solve_ivp(f, (0, end), request["x0"], method=solver, **j, **tolerances)
    start = time.thread_time_ns()
    result = call()
    taken = time.thread_time_ns() - start
    y = np.array(result.y)
    y = y[-1] if solver == "CVODE" else y[:, -1]
    if not result.success or not np.all(np.isfinite(y)):
        raise RuntimeError("no solution")
    return {"y": y.tolist(), "derivatives": [], "time": taken * 1e-9}


class Rates:
    """A function of a state and the time, into memory that stays."""

    def __init__(self, name, arguments, value):
        self.f = ca.Function(name, arguments, [value])
        self.x, self.t = np.zeros(arguments[0].numel()), np.zeros(1)
        self.to = np.zeros(value.numel())
        self.buffer, self.run = self.f.buffer()
        self.buffer.set_arg(0, memoryview(self.x))
        self.buffer.set_arg(1, memoryview(self.t))
        self.buffer.set_res(0, memoryview(self.to))

    def __call__(self, x, t):
        self.x[:], self.t[0] = x, t
        self.run()
        return self.to.copy()


def serve(request):
    if request.get("do") == "versions":
        versions = [f"CasADi {ca.__version__}"]
        if any(solver == "Radau" for _, solver in IN_PYTHON):
            versions.append(f"SciPy {scipy.__version__}")
        if any(solver == "CVODE" for _, solver in IN_PYTHON):
            versions.append(f"scikit-sundae {sksundae.__version__}")
        return {"versions": ", ".join(versions)}
    algebraic = bool(PROBLEMS[request["problem"]][1])
    runs = []
    solvers = [("IDAS", one, "idas")] if algebraic else [("CVODES", one, "cvodes"), ("IDAS", one, "idas")]
    if not algebraic and not request["derivatives"]:
        solvers += [(name, in_python, solver) for name, solver in IN_PYTHON]
    for name, solve, solver in solvers:
        for tolerance in request["tolerances"]:
            run = {"solver": name, "tolerance": tolerance}
            try:
                run.update(solve(request, solver, tolerance))
            except Exception as error:  # A solver that fails is a line of the table, not the end of the run.
                run["error"] = str(error).strip().splitlines()[-1]
            runs.append(run)
            if run.get("time", 0) > PATIENCE:
                break
    return {"runs": runs}


def main():
    # CasADi prints what it fails on. Answers have a descriptor of their own.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        try:
            answer = serve(json.loads(line))
        except Exception as error:
            answer = {"error": str(error)}
        print(json.dumps(answer), file=answers, flush=True)


main()
