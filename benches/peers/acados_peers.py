"""acados' integrators on the models of the benchmarks: times and values on request.

    ACADOS_SOURCE_DIR=/an/installation python3 acados_peers.py FOLDER

FOLDER is where the code that acados generates is kept and compiled; what is there already is not made again. Reads one JSON
object a line from standard input and answers each with one on standard output. Requests:

    {"do": "versions"}
    {"do": "time", "case": CASE, "integrator": "IRK" | "GNSF" | "ERK", "mode": MODE, "seconds": 0.2}

CASE is that of casadi_peers.py; MODE is "simulation", "forward", "adjoint" or "hessian". Each call starts cold, with a
tolerance of Newton's method of 1e-8 / steps. Of its two settings, the Jacobian new in each iteration or kept, the faster one
counts: it is chosen when a question is asked for the first time. acados_driver.c says what is timed.
"""

import ctypes as c
import os

import casadi as ca
import numpy as np

import models
from acados_common import HOME, answer_all

class Question(c.Structure):
    _fields_ = [(n, c.c_int) for n in ("stages", "steps", "radau", "iterations", "reuse")]
    _fields_ += [("tolerance", c.c_double)] + [(n, c.c_int) for n in ("forward", "adjoint", "hessian")]


class Peer(c.Structure):
    _fields_ = [(n, c.c_void_p) for n in ("solver", "into", "out", "seed")]


def model(case, name):
    """The model as acados wants it."""
    from acados_template import AcadosModel

    all = AcadosModel()
    all.name = name
    if case["model"] == "awe":
        all.xdot, all.x, all.u, all.z, all.f_impl_expr = models.awe()
    else:
        all.x, all.u, f = {"pendulum": models.pendulum, "chain": models.chain}[case["model"]](case["nx"])
        all.xdot = ca.SX.sym("xd", all.x.numel())
        all.f_expl_expr, all.f_impl_expr = f, all.xdot - f
    return all


def has_hessian(case, integrator):
    """GNSF has none; what is generated for ERK grows so fast that the C compiler takes minutes with 45 states."""
    return integrator == "IRK" or integrator == "ERK" and case["nx"] <= 21


def generated(case, integrator, folder):
    """A solver of acados for a model: code is generated and compiled once, for questions of all kinds."""
    from acados_template import AcadosSim, AcadosSimSolver

    name = f"{case['model']}_{case['nx']}_{integrator.lower()}"
    sim = AcadosSim()
    sim.model = model(case, name)
    sim.name = name
    options = sim.solver_options
    options.T, options.integrator_type = case["T"], integrator
    options.num_stages, options.num_steps = 4, 1
    options.output_z, options.sens_adj, options.sens_hess = False, True, has_hessian(case, integrator)
    sim.code_gen_options.code_export_directory = os.path.join(folder, name)
    sim.code_gen_options.json_file = os.path.join(folder, name + ".json")
    # Without this a compilation that was broken off would never be taken up again.
    new = not os.path.exists(os.path.join(folder, name, f"libacados_sim_solver_{name}.so"))
    return AcadosSimSolver(sim, generate=new, build=new, verbose=False)


class Call:
    """One question to one model, with its arguments in place."""

    def __init__(self, driver, generated, case, integrator, mode, reuse):
        self.driver, self.generated, self.mode = driver, generated, mode
        self.inputs = np.array([x + u for x, u in case["inputs"]], dtype=float)
        self.nx, self.nu = case["nx"], self.inputs.shape[1] - case["nx"]
        self.seed = np.array(case["lambda"] + [0.0] * self.nu)
        self.peer = Peer(None, generated.sim_in, generated.sim_out, self.seed.ctypes.data)
        question = Question(
            stages=case["stages"] or 4,
            steps=case["steps"],
            radau=case["scheme"] == "radau",
            iterations=100,  # enough for chains of any length: the tolerance ends them
            reuse=reuse,
            tolerance=1e-8 / case["steps"],
            forward=mode in ("forward", "hessian"),
            adjoint=mode in ("adjoint", "hessian"),
            hessian=mode == "hessian",
        )
        config, dims = c.c_void_p(generated.sim_config), c.c_void_p(generated.sim_dims)
        if driver.driver_open(config, dims, c.byref(question), c.byref(self.peer)):
            raise RuntimeError("acados has no solver for this question")

    def seconds(self, budget):
        """Median, quartiles and number of samples of the CPU seconds of a call."""
        quartiles = (c.c_double * 3)()
        data, count = c.c_void_p(self.inputs.ctypes.data), len(self.inputs)
        samples = self.driver.driver_time(c.byref(self.peer), data, count, self.nx, self.nu, c.c_double(budget), quartiles)
        if samples < 0:
            raise RuntimeError("acados reports failure")
        return {"median": quartiles[0], "q1": quartiles[1], "q3": quartiles[2], "samples": samples}

    def values(self):
        """What casados gives for the first input, as flat lists: Jacobian by rows, lower triangle of the Hessian by rows."""
        x, nx, width = self.inputs[0], self.nx, self.nx + self.nu
        data = x.ctypes.data
        self.driver.driver_call(c.byref(self.peer), c.c_void_p(data), c.c_void_p(data + 8 * nx))
        get = lambda name: self.generated.get(name)
        out = {"x": get("x").ravel().tolist()}
        if self.mode in ("forward", "hessian"):
            out["forward"] = get("S_forw").ravel().tolist()
        if self.mode in ("adjoint", "hessian"):
            out["adjoint"] = get("S_adj").ravel().tolist()
        if self.mode == "hessian":
            out["hessian"] = get("S_hess")[np.tril_indices(width)].tolist()
        return out


# What was built for earlier requests.
cache = {}


def serve(request, driver, folder):
    if request["do"] == "versions":
        import acados_template  # noqa: F401: an error if it is missing

        commit = open(os.path.join(HOME, "lib", "git_commit_hash")).read().strip()[:9]
        return {"acados": f"acados {commit}"}
    case, integrator, mode = request["case"], request["integrator"], request["mode"]
    if mode == "hessian" and not has_hessian(case, integrator):
        raise ValueError(f"no Hessian of {integrator} with {case['nx']} states")
    key = (case["name"], integrator, mode)
    if key not in cache:
        own = (case["model"], case["nx"], integrator)
        if own not in cache:
            cache[own] = generated(case, integrator, folder)
        reuses = (0,) if integrator == "ERK" else (0, 1)
        calls = [Call(driver, cache[own], case, integrator, mode, reuse) for reuse in reuses]
        cache[key] = min(calls, key=lambda call: call.seconds(0.02)["median"])
    call = cache[key]
    return {"time": call.seconds(request["seconds"]), "values": call.values()}


answer_all(serve)
