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

from models import awe, chain, pendulum

MODES = ["simulation", "forward", "adjoint", "hessian"]


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
